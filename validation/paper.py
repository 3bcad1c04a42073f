"""The paper's test problems run again: the water dimer, liquid water and the peptide of its figures 2 and 3.

Each trajectory is run in pieces that follow one another, each an LAMMPS run of its own that starts from the atoms that the one
before has left; a piece that is complete in the output folder is not run again, so that the same command goes on
after a Ctrl-C.  Energies are in the pieces' logs, sampled as they run.
"""

import re
from dataclasses import dataclass, replace

import numpy as np

from validation import machine, paper_peptide, run
from validation.bench import contents, package_hash
from validation.integrators import PAPER
from validation.scenes import SCENES

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
FS_PER_PS = 1000.0
PIECE = 25_000  # steps of a piece of a run on a mesh: some minutes
DIMER_DT, DT = 0.3, 3.0  # fs, of figure 2a, and of figures 2b and 3
GEAR_DT = 1.0  # fs; Gear's scheme does not bear DT
SMALL_DT = 0.5  # fs; what is left of the energy's fluctuation is the force field's
TEMPERATURE = 295.0  # K, of the liquid


@dataclass(frozen=True)
class Lengths:
    """How long everything is, in ps.

    Attributes:
        dimer: each trajectory of the dimer.  starts: their number.  apart: time between one start and the next.
        liquid: 1,000 waters.  peptide: figure 3's trajectories.
        drifting: the peptide with ``rigid/small``.
        gear: Gear's trajectories of the liquid and the peptide.
        force_field: runs at a small step.  accuracies: of the mesh, in these.
        sizes: numbers of waters beside 1,000, and ``size`` how long each.
        every: steps between samples of the energy, where not said otherwise.
    """

    dimer: float
    starts: int
    apart: float
    liquid: float
    peptide: float
    drifting: float
    gear: float
    force_field: float
    accuracies: tuple[str, ...]
    sizes: tuple[int, ...]
    size: float
    every: int


SHORT = Lengths(dimer=60.0, starts=6, apart=10.0, liquid=6.0, peptide=6.0, drifting=3.0, gear=0.15, force_field=0.15,
                accuracies=("1e-4", "1e-6"), sizes=(2000,), size=1.5, every=10)  # fmt: skip
FULL = Lengths(dimer=300.0, starts=32, apart=30.0, liquid=3000.0, peptide=300.0, drifting=30.0, gear=6.0, force_field=4.0,
               accuracies=("1e-4", "1e-6", "1e-7"), sizes=(2000, 8000), size=15.0, every=50)  # fmt: skip


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

    def jobs(self, out, silence):
        """The pieces' jobs, in order; one without steps gives the energy of the start.

        Args:
            out: folder of all trajectories.
            silence: s without a sign of life after which a run is given up.
        """
        start, done = self.start, 0
        while done < self.steps or not done:
            steps = min(self.piece, self.steps - done)
            folder = out / re.sub(r"[/ ]", "-", self.name) / f"piece-{done}"
            setup = list(self.scene.setup)
            # a change of the input or of the code makes another job
            setup.append(f"variable origin string {contents(self.scene.folder)}{package_hash() if self.integrator.kind == 'ours' else ''}")
            if start:
                dump, step = start
                setup.append(f'read_dump "{dump}" {step} x y z ix iy iz vx vy vz box no replace yes format native')
            state = folder.resolve() / "state.dump"
            reach = self.state or max(1, steps)
            more = [
                f'dump state all custom {reach} "{state}" id x y z ix iy iz vx vy vz',
                "dump_modify state sort id format float %.17g",
                *(line.format(folder=folder.resolve()) for line in self.more),
            ]
            yield run.job(replace(self.scene, setup=tuple(setup)), self.integrator, folder, [steps], dt=self.dt, every=self.every,
                          ranks=self.ranks, silence=silence, more=more)  # fmt: skip
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
    """All trajectories, in the order in which they run: what is short comes first.

    Args:
        lengths: a ``Lengths``.
        ranks: MPI ranks of what is larger than the dimer.
        out: folder of all trajectories.
    """
    every = lengths.every

    def steps(time, dt):
        return round(time * FS_PER_PS / dt)

    def trajectory(scene, integrator, time, dt=DT, **more):
        one = PAPER[integrator]
        usual = {"name": f"{scene.name}-{integrator}", "label": f"{scene.name}, {one.label}", "every": every, "ranks": ranks}
        return Trajectory(scene=scene, integrator=one, dt=dt, steps=steps(time, dt), **usual | more)

    dimer, liquid, peptide = SCENES["dimer"], SCENES["water"], paper_peptide.scene()
    apart = steps(lengths.apart, DIMER_DT)
    whole = {"dt": DIMER_DT, "ranks": 1, "piece": 10**9}
    starts = trajectory(dimer, "nosquish", lengths.apart * lengths.starts, **whole, name="dimer-starts", label="dimer, starts",
                        state=apart, every=1000)  # fmt: skip
    yield starts
    states = (out / starts.name / "piece-0" / "state.dump").resolve()
    for number in range(1, lengths.starts + 1):
        for name in "nosquish", "matubayasi-nakahara", "gear":
            yield trajectory(dimer, name, lengths.dimer, **whole, name=f"dimer-{name}-{number}", label=f"dimer {number}, {PAPER[name].label}",
                             start=(states, number * apart), every=2 * every)  # fmt: skip
    for scene in liquid, peptide:
        yield trajectory(scene, "gear", lengths.gear, every=2, piece=10**9)
        for name in "nosquish", "gear":  # and where Gear's scheme does not fail at once
            yield trajectory(scene, name, lengths.gear, dt=GEAR_DT, every=2, piece=10**9, name=f"{scene.name}-{name}-short-step",
                             label=f"{scene.name} at {GEAR_DT:g} fs, {PAPER[name].label}")  # fmt: skip
    yield trajectory(paper_peptide.alone(peptide), "nosquish", 0, name="peptide-alone", label="peptide without water")
    yield trajectory(paper_peptide.within(peptide), "nosquish", 0, name="peptide-within", label="peptide, Coulomb within")
    for name, change in paper_peptide.force_fields(lengths.accuracies).items():
        yield trajectory(change(peptide), "nosquish", lengths.force_field, dt=SMALL_DT, name=f"force-field-{name}",
                         label=f"peptide at {SMALL_DT:g} fs, {name}", every=10)  # fmt: skip
    for size in lengths.sizes:  # copies that are alike would not be independent
        copies = liquid.of_size(size)
        copies = replace(copies, setup=(*copies.setup, f"velocity water create {TEMPERATURE:g} {size}"))
        yield trajectory(copies, "nosquish", lengths.size, name=f"water-{size}", label=f"{size:,} waters")
    yield trajectory(peptide, "rigid/small", lengths.drifting)
    for name in "nosquish", "shake", "rigid/nve/small":
        yield trajectory(peptide, name, lengths.peptide, more=paper_peptide.dump(steps(1.0, DT)))
    for name in "nosquish", "matubayasi-nakahara":
        yield trajectory(liquid, name, lengths.liquid)


def do(trajectory, out, silence, meter):
    """Run a trajectory, or take over what is there: a ``Series``, and whether a Ctrl-C ended it."""
    results, jobs, error, interrupted = [], list(trajectory.jobs(out, silence)), None, False
    for number, job in enumerate(jobs, 1):
        meter.begin(trajectory.label + (f" {number}/{len(jobs)}" if len(jobs) > 1 else ""), sum(job.runs))
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
    names = {"time": "Step", "total": "TotEng", "kinetic": "KinEng", "potential": "PotEng", "temperature": "Temp"}
    parts, done = {name: [] for name in names}, 0
    for job, result in results:
        for name, column in names.items():
            values = result.thermo.get(column, np.empty(0))
            values = values[1:] if done else values  # a piece's first sample is the last one of the piece before
            parts[name].append((values + done) * trajectory.dt / FS_PER_PS if name == "time" else values)
        done += sum(job.runs)
    table = {name: np.concatenate(values) if values else np.empty(0) for name, values in parts.items()}
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


def paper(out, lengths, ranks, silence, meter):
    """Run everything that is not there yet.

    Args:
        out: folder.  lengths: a ``Lengths``.  ranks: MPI ranks of what is larger than the dimer.
        silence: s without a sign of life after which a run is given up.
        meter: a ``console.Meter``.

    Returns:
        (found, circumstances): name to ``Series``, and plain data; ``interrupted`` says that a Ctrl-C ended it.
    """
    circumstances = machine.circumstances() | {"interrupted": False, "ranks": ranks}
    found = {}
    for trajectory in plan(lengths, ranks, out):
        found[trajectory.name], interrupted = do(trajectory, out, silence, meter)
        if interrupted:
            circumstances["interrupted"] = True
            break
    return found, circumstances


def steps_of(lengths, ranks, out):
    """Steps of all trajectories together."""
    return sum(trajectory.steps for trajectory in plan(lengths, ranks, out))
