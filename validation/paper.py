"""The paper's test problems run again: the water dimer, liquid water and the peptide of its figures 2 and 3.

Each trajectory is run in pieces that follow one another, each an LAMMPS run of its own that starts from the atoms that the one
before has left; a piece that is complete in the output folder is not run again, so that the same command goes on
after a Ctrl-C, unless the code or what it starts from has changed.  Energies are in the pieces' logs, sampled as they run.
"""

from dataclasses import dataclass, replace

import numpy as np

from validation import machine, paper_peptide, run
from validation.compare import FS_PER_PS
from validation.integrators import INTEGRATORS, PAPER
from validation.scenes import SCENES
from validation.starts import from_dump, to_dump

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
TEMPERATURE = {"dimer": 155.0, "water": 295.0, "peptide": 300.0}  # K, of the figures' captions
PIECE = 25_000  # steps of a piece of a run on a mesh: some minutes
DIMER_DT, DT = 0.3, 3.0  # fs, of figure 2a, and of figures 2b and 3
GEAR_DT = 1.0  # fs; Gear's scheme does not bear DT
SMALL_DT = 0.5  # fs; what is left of the energy's fluctuation is the force field's
STEPS = 1.5, 2.0, DT  # fs, for the law of the time step
SAMPLED = 30.0  # fs between samples of the energy where trajectories of several steps or sizes are compared
ORDERED = "nosquish-123"  # NO_SQUISH with rigid/nve/small's order of axes


@dataclass(frozen=True)
class Lengths:
    """How long everything is, in ps.

    Attributes:
        dimer: each trajectory of the dimer.  starts: their number.  apart: time between one start and the next.
        liquid: 1,000 waters.  peptide: figure 3's trajectories.
        ordered: the peptide with `ORDERED`.  drifting: with ``rigid/small``.
        gear: Gear's trajectories of the liquid and the peptide.  gear_starts: their number, and of its dimers.
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


@dataclass(frozen=True)
class Trajectory:
    """One run of one integrator.

    Attributes:
        name: of its folder, and what its results are called by.
        label: for the terminal.
        scene: a ``Scene``.  integrator: an ``Integrator``.
        dt: fs.  steps: in all.  every: steps between samples of the energy.
        ranks: MPI ranks.
        piece: steps of a piece.
        state: steps between dumps of all atoms; None is at the end of each piece only.
        start: (dump, step) that the atoms are read from; None leaves them as the scene has them.
        more: LAMMPS commands before each piece; ``{folder}`` is the piece's.
    """

    name: str
    label: str
    scene: object
    integrator: object
    dt: float
    steps: int
    every: int
    ranks: int
    piece: int = PIECE
    state: int | None = None
    start: tuple | None = None
    more: tuple[str, ...] = ()

    @property
    def pieces(self):
        """How many pieces there are."""
        return max(1, -(-self.steps // self.piece))

    def jobs(self, out, silence):
        """The pieces' jobs, in order, each when the one before has been done; one without steps gives the energy of the start.

        Args:
            out: folder of all trajectories.
            silence: s without a sign of life after which a run is given up.
        """
        start, done = self.start, 0
        while done < self.steps or not done:
            steps = min(self.piece, self.steps - done)
            folder = out / run.folder_name(self.name) / f"piece-{done}"
            scene = from_dump(self.scene, *start) if start else self.scene
            files = [start[0]] if start and start[0].exists() else []  # else LAMMPS says so
            state = folder.resolve() / "state.dump"
            reach = self.state or max(1, steps)
            more = [
                *to_dump(state, reach),
                *(line.format(folder=folder.resolve()) for line in self.more),
            ]
            origin = machine.origin(self.scene, self.integrator, *files)
            yield run.job(scene, self.integrator, folder, [steps], dt=self.dt, every=self.every, ranks=self.ranks, silence=silence, more=more,
                          origin=origin)  # fmt: skip
            start, done = (state, steps), done + max(1, steps)


@dataclass
class Series:
    """What a trajectory left.

    Attributes:
        trajectory: the ``Trajectory``.
        error: None, or why it is not complete.
        time: (n,) ps.  total, kinetic, potential: (n,) kcal/mol.  temperature: (n,) K.  All without samples that are not finite.
        positions: of the first piece's start and the last piece's end, or None (see ``run.Result``).
        pieces: (folder, steps) of each that is complete.
        seconds: that the steps took.
    """

    trajectory: Trajectory
    error: str | None
    time: np.ndarray
    total: np.ndarray
    kinetic: np.ndarray
    potential: np.ndarray
    temperature: np.ndarray
    positions: dict | None
    pieces: list
    seconds: float


def plan(lengths, ranks, out):
    """All trajectories, in the order in which they run: those of figures 2a and 3, what is short, those of figure 2b.

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


def do(trajectory, out, silence, meter):
    """Run a trajectory, or take over what is there: a ``Series``, and whether a Ctrl-C ended it."""
    results, error, interrupted = [], None, False
    for number, job in enumerate(trajectory.jobs(out, silence), 1):
        meter.begin(
            trajectory.label + (f" {number}/{trajectory.pieces}" if trajectory.pieces > 1 else ""),
            sum(job.runs),
        )
        result = run.once(job, meter.at)
        meter.end(result.error)
        results.append((job, result))
        if result.error:
            error, interrupted = result.error, result.interrupted
            break
    return series(trajectory, results, error), interrupted


def series(trajectory, results, error):
    """Put the pieces' results together.

    Args:
        results: list of (job, result), in order.
        error: None, or why it is not complete.
    """
    names = {
        "time": "Step",
        "total": "TotEng",
        "kinetic": "KinEng",
        "potential": "PotEng",
        "temperature": "Temp",
    }
    parts, done = {name: [] for name in names}, 0
    for job, result in results:
        for name, column in names.items():
            values = result.thermo.get(column, np.empty(0))
            values = (
                values[1:] if done else values
            )  # a piece's first sample is the last one of the piece before
            parts[name].append(
                (values + done) * trajectory.dt / FS_PER_PS if name == "time" else values
            )
        done += sum(job.runs)
    table = {
        name: np.concatenate(values) if values else np.empty(0) for name, values in parts.items()
    }
    finite = np.isfinite(table["total"])
    until = len(finite) if finite.all() else int(np.argmin(finite))
    if until < len(finite) and not error:
        error = "energy is not finite"
    ends = [result.positions for _, result in results if result.positions]
    positions = {**ends[0], "x": np.stack([ends[0]["x"][0], ends[-1]["x"][-1]])} if ends else None
    return Series(
        trajectory, error, **{name: values[:until] for name, values in table.items()}, positions=positions,
        pieces=[(job.directory, sum(job.runs)) for job, result in results if not result.error],
        seconds=sum(one["loop"] for _, result in results for one in result.timings),
    )  # fmt: skip


def paper(out, chosen, ranks, silence, meter):
    """Run everything that is not there yet.

    Args:
        out: folder.  chosen: trajectories of ``plan``.  ranks: MPI ranks of what is larger than the dimer.
        silence: s without a sign of life after which a run is given up.
        meter: a ``console.Meter``.

    Returns:
        (found, circumstances): name to ``Series``, and plain data; ``interrupted`` says that a Ctrl-C ended it.
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
