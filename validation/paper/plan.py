"""The paper's test problems again: the water dimer, liquid water and the peptide of its figures."""

from dataclasses import dataclass, replace

from validation.running import machine
from validation.running.trajectory import Trajectory, do
from validation.scenes import FS_PER_PS, SCENES, TEMPERATURE
from validation.scenes import peptide as paper_peptide
from validation.scenes.integrators import INTEGRATORS, PAPER

# What the paper says, in its words; no number is read off its figures.
STATEMENTS = {
    "dimer": "Section III, figure 2a: NO_SQUISH is more accurate than Ref. 12 but both methods are stable at long times.",
    "liquid": "Section III, figure 2b: similar trends; the phase space volume preserving integrator performs well but not as well as the "
    "symplectic NO_SQUISH.",
    "peptide": "Section III, figure 3: NO_SQUISH and SHAKE/RATTLE perform well and the average energy conservation measure is about 1e-5 for "
    "both methods.",
    "gear": "Section IV: far more accurate than standard Gear predictor corrector or Runge-Kutta methods.",
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
    """How long everything is, in ps.

    Attributes:
        dimer: each trajectory of the dimer.  starts: their number.  apart: time between one start
            and the next.
        liquid: 1,000 waters.  peptide: figure 3's trajectories.
        ordered: the peptide with `ORDERED`.  drifting: with ``rigid/small``.
        gear: Gear's trajectories of the liquid and the peptide.  gear_starts: their number, and of
            its dimers.
        force_field: runs at a small step.  accuracies: of the mesh, in these.
        sizes: numbers of waters.  size: how long each, and the peptide with each of `STEPS`.
        every: steps between samples of the energy, where not said otherwise.
    """

    dimer: float
    starts: int
    apart: float
    liquid: float
    peptide: float
    ordered: float
    drifting: float
    gear: float
    gear_starts: int
    force_field: float
    accuracies: tuple[str, ...]
    sizes: tuple[int, ...]
    size: float
    every: int


SHORT = Lengths(dimer=50.0, starts=10, apart=60.0, liquid=3.6, peptide=3.6, ordered=3.6, drifting=2.4, gear=0.15, gear_starts=4, force_field=0.2,
                accuracies=("1e-6",), sizes=(1000, 2000), size=1.5, every=10)  # fmt: skip
FULL = Lengths(dimer=300.0, starts=32, apart=1000.0, liquid=3000.0, peptide=300.0, ordered=75.0, drifting=30.0, gear=2.0, gear_starts=4, force_field=4.0,
               accuracies=("1e-4", "1e-6", "1e-7"), sizes=(1000, 2000, 8000), size=15.0, every=50)  # fmt: skip


def plan(lengths, ranks, out):
    """All trajectories, in the order in which they run: those of figures 2a and 3, what is short,
    those of figure 2b.

    Args:
        lengths: a ``Lengths``.
        ranks: MPI ranks of what is larger than the dimer.
        out: folder of all trajectories.
    """
    every = lengths.every

    def steps(time, dt):
        return round(time * FS_PER_PS / dt)

    def trajectory(scene, integrator, time, dt=DT, **more):
        one = (INTEGRATORS | PAPER)[integrator]
        usual = {
            "name": f"{scene.name}-{integrator}",
            "label": f"{scene.name}, {one.label}",
            "every": every,
            "ranks": ranks,
        }
        return Trajectory(scene=scene, integrator=one, dt=dt, steps=steps(time, dt), **usual | more)

    def starts(scene, number, apart, dt, **more):
        """A trajectory that leaves so many starts, and where each is."""
        name, apart = f"{scene.name}-starts", steps(apart, dt)
        one = trajectory(
            scene,
            "nosquish",
            0,
            dt,
            name=name,
            label=f"{scene.name}, starts",
            state=apart,
            every=1000,
            piece=10**9,
            **more,
        )
        dump = (out / name / "piece-0" / "state.dump").resolve()
        return replace(one, steps=number * apart), [(dump, n * apart) for n in range(1, number + 1)]

    dimer, liquid, peptide = SCENES["dimer"], SCENES["water"], paper_peptide.scene()
    first, states = starts(dimer, lengths.starts, lengths.apart, DIMER_DT, ranks=1)
    yield first
    for number, start in enumerate(states, 1):
        for name in ("nosquish", "matubayasi-nakahara", "gear")[
            : 3 if number <= lengths.gear_starts else 2
        ]:
            yield trajectory(dimer, name, lengths.dimer, DIMER_DT, ranks=1, piece=10**9, start=start, every=2 * every,
                             name=f"dimer-{name}-{number}", label=f"dimer {number}, {PAPER[name].label}")  # fmt: skip
    for name in "nosquish", "shake", "rigid/nve/small", ORDERED:
        yield trajectory(
            peptide,
            name,
            lengths.ordered if name == ORDERED else lengths.peptide,
            more=paper_peptide.dump(steps(1.0, DT)),
        )
    for scene in liquid, peptide:
        yield trajectory(scene, "gear", lengths.gear, every=2, piece=10**9)
        first, states = starts(scene, lengths.gear_starts, lengths.gear, DT)
        yield first  # and where Gear's scheme does not fail at once
        for number, start in enumerate(states, 1):
            for name in "nosquish", "gear":
                yield trajectory(scene, name, lengths.gear, GEAR_DT, every=2, piece=10**9, start=start,
                                 name=f"{scene.name}-{name}-short-step-{number}",
                                 label=f"{scene.name} {number} at {GEAR_DT:g} fs, {PAPER[name].label}")  # fmt: skip
    yield trajectory(
        paper_peptide.alone(peptide),
        "nosquish",
        0,
        name="peptide-alone",
        label="peptide without water",
    )
    yield trajectory(
        paper_peptide.within(peptide),
        "nosquish",
        0,
        name="peptide-within",
        label="peptide, Coulomb within",
    )
    yield trajectory(
        liquid,
        "nosquish",
        lengths.force_field,
        SMALL_DT,
        name="water-small-step",
        label=f"water at {SMALL_DT:g} fs",
        every=2,
    )
    for name, change in paper_peptide.force_fields(lengths.accuracies).items():
        yield trajectory(change(peptide), "nosquish", lengths.force_field, SMALL_DT, name=f"force-field-{name}",
                         label=f"peptide at {SMALL_DT:g} fs, {name}", every=2)  # fmt: skip
    for size in lengths.sizes:  # copies that are alike would not be independent
        copies = liquid.of_size(size)
        copies = replace(
            copies, setup=(*copies.setup, f"velocity water create {TEMPERATURE['water']:g} {size}")
        )
        yield trajectory(
            copies,
            "nosquish",
            lengths.size,
            name=f"water-{size}",
            label=f"{size:,} waters",
            every=steps(SAMPLED / FS_PER_PS, DT),
        )
    for dt in STEPS:
        yield trajectory(peptide, "nosquish", lengths.size, dt, name=f"peptide-at-{dt:g}-fs", label=f"peptide at {dt:g} fs",
                         every=steps(SAMPLED / FS_PER_PS, dt))  # fmt: skip
    yield trajectory(peptide, "rigid/small", lengths.drifting)
    for name in "nosquish", "matubayasi-nakahara":
        yield trajectory(liquid, name, lengths.liquid)


def paper(out, chosen, ranks, silence, meter):
    """Run everything that is not there yet.

    Args:
        out: folder.  chosen: trajectories of ``plan``.  ranks: MPI ranks of what is larger than the
            dimer.
        silence: s without a sign of life after which a run is given up.
        meter: a ``console.Meter``.

    Returns:
        (found, circumstances): name to ``Series``, and plain data; ``interrupted`` says that a
        Ctrl-C ended it.
    """
    circumstances = machine.circumstances() | {"interrupted": False, "ranks": ranks}
    found = {}
    try:
        for trajectory in chosen:
            found[trajectory.name], circumstances["interrupted"] = do(
                trajectory, out, silence, meter
            )
            if circumstances["interrupted"]:
                break
    except KeyboardInterrupt:  # between two runs
        circumstances["interrupted"] = True
    return found, circumstances
