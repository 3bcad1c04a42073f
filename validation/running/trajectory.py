"""A trajectory of one integrator, run in pieces that follow one another.

Each piece is a LAMMPS run of its own that starts from the atoms that the one before has left. A
piece that is complete is not run again (see ``run.once``), so the same command goes on after a
Ctrl-C. Energies are in the pieces' logs, sampled as they run.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..scenes import FS_PER_PS, Scene
from ..scenes.integrators import Integrator
from . import machine, run
from .run import Meter
from .starts import from_dump, to_dump

PIECE = 25_000  # steps of a piece of a run on a mesh: some minutes
WHOLE = 10**9  # of one that is all of them
SHADOW = "f_1[5]"  # of an integrator `Shadowed`


@dataclass(frozen=True)
class Trajectory:
    """One run of one integrator.

    Attributes:
        name: of its folder, and what its results are called by.
        label: for the terminal.
        dt: fs.  steps: in all.  every: steps between samples of the energy.
        ranks: MPI ranks.
        piece: steps of a piece.
        state: steps between dumps of all atoms; None is at the end of each piece only.
        start: (dump, step) that the atoms are read from; None leaves them as the scene has them.
        more: LAMMPS commands before each piece, and before its dump; ``{folder}`` is the piece's.
    """

    name: str
    label: str
    scene: Scene
    integrator: Integrator
    dt: float
    steps: int
    every: int
    ranks: int
    piece: int = PIECE
    state: int | None = None
    start: tuple[Path, int] | None = None
    more: tuple[str, ...] = ()

    @property
    def pieces(self) -> int:
        """How many pieces there are."""
        return max(1, -(-self.steps // self.piece))

    def end(self, out: Path) -> tuple[Path, int]:
        """What another one may ``start`` from: the end of the first piece."""
        folder = out / run.folder_name(self.name) / "piece-0"
        return (folder / "state.dump").resolve(), min(self.piece, self.steps)

    def jobs(self, out: Path, silence: float) -> Iterator[run.Job]:
        """The pieces' jobs, in order, each when the one before has been done; one without steps
        gives the energy of the start.

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
            more = [line.format(folder=folder.resolve()) for line in self.more]
            more += to_dump(state, self.state or max(1, steps))
            how: dict = {"dt": self.dt, "every": self.every, "ranks": self.ranks, "more": more}
            how |= {"origin": machine.origin(self.scene, self.integrator, *files)}
            yield run.job(scene, self.integrator, folder, [steps], silence=silence, **how)
            start, done = (state, steps), done + max(1, steps)


@dataclass
class Series:
    """What a trajectory left.

    Attributes:
        trajectory: the ``Trajectory``.
        error: None, or why it is not complete.
        time: (n,) ps.  total, kinetic, potential: (n,) kcal/mol.  temperature: (n,) K.  All without
            samples that are not finite.
        shadow: (n,) kcal/mol, if the integrator was asked for it, else (0,).
        positions: of the first piece's start and the last piece's end, or None (see
            ``run.Result``).
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
    positions: run.Positions | None
    pieces: list[tuple[str, int]]
    seconds: float
    shadow: np.ndarray = field(default_factory=lambda: np.empty(0))


def do(trajectory: Trajectory, out: Path, silence: float, meter: Meter) -> tuple[Series, bool]:
    """Run a trajectory, or take over what is there: a ``Series``, and whether a Ctrl-C ended it."""
    results: list[tuple[run.Job, run.Result]] = []
    error, interrupted = None, False
    for number, job in enumerate(trajectory.jobs(out, silence), 1):
        number_of = f" {number}/{trajectory.pieces}" * (trajectory.pieces > 1)
        meter.begin(trajectory.label + number_of, sum(job.runs))
        result = run.once(job, meter.at)
        meter.end(result.error)
        results.append((job, result))
        if result.error:
            error, interrupted = result.error, result.interrupted
            break
    return series(trajectory, results, error), interrupted


def series(
    trajectory: Trajectory, results: list[tuple[run.Job, run.Result]], error: str | None
) -> Series:
    """Put the pieces' results together.

    Args:
        results: in order.
        error: None, or why it is not complete.
    """
    columns = "Step", "TotEng", "KinEng", "PotEng", "Temp", SHADOW
    parts: list[list[np.ndarray]] = [[] for _ in columns]
    done = 0
    for job, result in results:
        for values, column in zip(parts, columns):
            # a piece's first sample is the last one of the piece before
            values.append(result.thermo.get(column, np.empty(0))[1 if done else 0 :])
        parts[0][-1] = (parts[0][-1] + done) * trajectory.dt / FS_PER_PS
        done += sum(job.runs)
    table = [np.concatenate(values) if values else np.empty(0) for values in parts]
    finite = np.isfinite(table[1])
    until = len(finite) if finite.all() else int(np.argmin(finite))
    if until < len(finite) and not error:
        error = "energy is not finite"
    ends = [result.positions for _, result in results if result.positions]
    positions = replace(ends[0], x=np.stack([ends[0].x[0], ends[-1].x[-1]])) if ends else None
    pieces = [(job.directory, sum(job.runs)) for job, result in results if not result.error]
    seconds = sum(one.seconds for _, result in results for one in result.timings)
    names = "time", "total", "kinetic", "potential", "temperature", "shadow"
    cut = dict(zip(names, table))
    energies = {name: values[:until] for name, values in cut.items()}
    return Series(
        trajectory, error, **energies, positions=positions, pieces=pieces, seconds=seconds
    )
