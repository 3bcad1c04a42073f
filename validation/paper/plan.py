"""The paper's test problems again: the water dimer, liquid water and the peptide of its figures."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from ..running import machine
from ..running.run import Meter
from ..running.trajectory import WHOLE, Series, Trajectory, do
from ..scenes import FS_PER_PS, SCENES, TEMPERATURE, Scene, steps
from ..scenes import peptide as paper_peptide
from ..scenes.integrators import INTEGRATORS, PAPER

# What the paper says, in its words; no number is read off its figures.
STATEMENTS = {
    "dimer": "Section III, figure 2a: NO_SQUISH is more accurate than Ref. 12 but both methods are "
    "stable at long times.",
    "liquid": "Section III, figure 2b: similar trends; the phase space volume preserving "
    "integrator performs well but not as well as the symplectic NO_SQUISH.",
    "peptide": "Section III, figure 3: NO_SQUISH and SHAKE/RATTLE perform well and the average "
    "energy conservation measure is about 1e-5 for both methods.",
    "gear": "Section IV: far more accurate than standard Gear predictor corrector or Runge-Kutta "
    "methods.",
}
AVERAGE_MEASURE = 1e-5  # of figure 3, section III
LIQUID = 6000.0  # ps, of figure 2b
DIMER_DT, DT = 0.3, 3.0  # fs, of figure 2a, and of figures 2b and 3
GEAR_DT = 1.0  # fs; Gear's scheme does not bear DT
SMALL_DT = 0.5  # fs; what is left of the energy's fluctuation is the force field's
STEPS = 1.5, 2.0, DT  # fs, for the law of the time step
# fs between samples of the energy where trajectories of several steps or sizes are compared
SAMPLED = 30.0
ORDERED = "nosquish-123"  # NO_SQUISH with rigid/nve/small's order of axes


@dataclass(frozen=True)
class Lengths:
    """How long everything is, in ps; of --short where not said otherwise."""

    dimer: float = 50.0  # each trajectory of the dimer
    starts: int = 10  # their number
    apart: float = 60.0  # time between one start and the next
    liquid: float = 3.6  # 1,000 waters
    peptide: float = 3.6  # figure 3's trajectories
    ordered: float = 3.6  # the peptide with `ORDERED`
    drifting: float = 2.4  # the peptide with ``rigid/small``
    gear: float = 0.15  # Gear's trajectories of the liquid and the peptide
    gear_starts: int = 4  # their number, and of its dimers
    force_field: float = 0.2  # runs at a small step
    accuracies: tuple[str, ...] = ("1e-6",)  # of the mesh, in these
    sizes: tuple[int, ...] = (1000, 2000)  # numbers of waters
    size: float = 1.5  # how long each, and the peptide with each of `STEPS`
    every: int = 10  # steps between samples of the energy, where not said otherwise


SHORT = Lengths()
FULL = Lengths(
    dimer=300.0,
    starts=32,
    apart=1000.0,
    liquid=3000.0,
    peptide=300.0,
    ordered=75.0,
    drifting=30.0,
    gear=2.0,
    force_field=4.0,
    accuracies=("1e-4", "1e-6", "1e-7"),
    sizes=(1000, 2000, 8000),
    size=15.0,
    every=50,
)


@dataclass(frozen=True)
class _Planner:
    """Makes trajectories of some lengths: with MPI ranks, in the folder of all."""

    lengths: Lengths
    ranks: int
    out: Path

    def one(self, scene: Scene, integrator: str, time: float, dt: float = DT, **more) -> Trajectory:
        """A trajectory so many ps long."""
        who = (INTEGRATORS | PAPER)[integrator]
        usual: dict = {"name": f"{scene.name}-{integrator}", "label": f"{scene.name}, {who.label}"}
        usual |= {"every": self.lengths.every, "ranks": self.ranks}
        return Trajectory(scene=scene, integrator=who, dt=dt, steps=steps(time, dt), **usual | more)

    def starts(self, scene: Scene, number: int, time: float, dt: float, **more):
        """A trajectory that leaves so many starts, and where each is."""
        name, apart = f"{scene.name}-starts", steps(time, dt)
        named = {"name": name, "label": f"{scene.name}, starts"}
        how = {"state": apart, "every": 1000, "piece": WHOLE}
        one = self.one(scene, "nosquish", 0, dt, **named, **how, **more)
        dump, _ = one.end(self.out)
        return replace(one, steps=number * apart), [(dump, n * apart) for n in range(1, number + 1)]

    def dimers(self) -> Iterator[Trajectory]:
        """Figure 2a: from each start, with Gear's scheme from the first ones only."""
        scene, lengths = SCENES["dimer"], self.lengths
        first, states = self.starts(scene, lengths.starts, lengths.apart, DIMER_DT, ranks=1)
        yield first
        how = {"ranks": 1, "piece": WHOLE, "every": 2 * lengths.every}
        for number, start in enumerate(states, 1):
            names = "nosquish", "matubayasi-nakahara", "gear"
            for name in names[: 3 if number <= lengths.gear_starts else 2]:
                named = {"name": f"dimer-{name}-{number}"}
                named["label"] = f"dimer {number}, {PAPER[name].label}"
                yield self.one(scene, name, lengths.dimer, DIMER_DT, start=start, **named, **how)

    def gear(self, scene: Scene) -> Iterator[Trajectory]:
        """Gear's scheme, and where it does not fail at once."""
        time, how = self.lengths.gear, {"every": 2, "piece": WHOLE}
        yield self.one(scene, "gear", time, **how)
        first, states = self.starts(scene, self.lengths.gear_starts, time, DT)
        yield first
        for number, start in enumerate(states, 1):
            for name in "nosquish", "gear":
                named = {"name": f"{scene.name}-{name}-short-step-{number}"}
                told = f"{scene.name} {number} at {GEAR_DT:g} fs"
                named["label"] = f"{told}, {PAPER[name].label}"
                yield self.one(scene, name, time, GEAR_DT, start=start, **named, **how)

    def named(self, scene: Scene, time: float, dt: float, name: str, label: str, **more):
        """A trajectory of NO_SQUISH with another name than its scene's."""
        return self.one(scene, "nosquish", time, dt, name=name, label=label, **more)


def plan(lengths: Lengths, ranks: int, out: Path) -> Iterator[Trajectory]:
    """All trajectories, in the order in which they run: those of figures 2a and 3, what is short,
    those of figure 2b.

    Args:
        ranks: MPI ranks of what is larger than the dimer.
        out: folder of all trajectories.
    """
    make = _Planner(lengths, ranks, out)
    liquid, peptide = SCENES["water"], paper_peptide.scene()
    yield from make.dimers()
    for name in "nosquish", "shake", "rigid/nve/small", ORDERED:
        time = lengths.ordered if name == ORDERED else lengths.peptide
        yield make.one(peptide, name, time, more=paper_peptide.dump(steps(1.0, DT)))
    yield from make.gear(liquid)
    yield from make.gear(peptide)
    alone, within = paper_peptide.alone(peptide), paper_peptide.within(peptide)
    yield make.named(alone, 0, DT, "peptide-alone", "peptide without water")
    yield make.named(within, 0, DT, "peptide-within", "peptide, Coulomb within")
    small, at = (lengths.force_field, SMALL_DT), f"at {SMALL_DT:g} fs"
    yield make.named(liquid, *small, "water-small-step", f"water {at}", every=2)
    for name, change in paper_peptide.force_fields(lengths.accuracies).items():
        names = f"force-field-{name}", f"peptide {at}, {name}"
        yield make.named(change(peptide), *small, *names, every=2)
    for size in lengths.sizes:  # copies that are alike would not be independent
        copies = liquid.of_size(size)
        warm = f"velocity water create {TEMPERATURE['water']:g} {size}"
        copies = replace(copies, setup=(*copies.setup, warm))
        every = steps(SAMPLED / FS_PER_PS, DT)
        names = f"water-{size}", f"{size:,} waters"
        yield make.named(copies, lengths.size, DT, *names, every=every)
    for dt in STEPS:
        names = f"peptide-at-{dt:g}-fs", f"peptide at {dt:g} fs"
        every = steps(SAMPLED / FS_PER_PS, dt)
        yield make.named(peptide, lengths.size, dt, *names, every=every)
    yield make.one(peptide, "rigid/small", lengths.drifting)
    for name in "nosquish", "matubayasi-nakahara":
        yield make.one(liquid, name, lengths.liquid)


def paper(
    out: Path, chosen: Iterable[Trajectory], ranks: int, silence: float, meter: Meter
) -> tuple[dict[str, Series], dict]:
    """Run trajectories of `plan` that are not there yet.

    Args:
        silence: s without a sign of life after which a run is given up.

    Returns:
        by name, and plain data; ``interrupted`` says that a Ctrl-C ended it.
    """
    circumstances = machine.circumstances() | {"interrupted": False, "ranks": ranks}
    found = {}
    try:
        for one in chosen:
            found[one.name], circumstances["interrupted"] = do(one, out, silence, meter)
            if circumstances["interrupted"]:
                break
    except KeyboardInterrupt:  # between two runs
        circumstances["interrupted"] = True
    return found, circumstances
