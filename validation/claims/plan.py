"""What a list of claims is, and the runs of LAMMPS that its claims are measured on."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from .. import experiment
from ..pages import Table
from ..running import machine, run
from ..running.starts import from_dump, to_dump
from ..scenes import FS_PER_PS, Scene
from ..scenes.integrators import Integrator
from ..statistics.positions import Positions

FEW = 16  # samples: less says nothing


@dataclass
class Bench:
    """What the command line asks for, and where it goes.

    Attributes:
        out: folder of the list's results.
        full: whether runs are as long as the committed ones.
        time: ps of the long runs, in place of that; None for the usual one.
        ranks: MPI ranks of what is large.
        silence: s without a word in the log after which a run is given up.
        names: of the simulations that are asked for.
        meter: what is told of progress.
    """

    out: Path
    full: bool
    time: float | None
    ranks: int
    silence: float
    names: set[str]
    meter: run.Meter = field(init=False)

    @property
    def runs(self) -> Path:
        """Folder of the runs of LAMMPS."""
        return self.out / "runs"


@dataclass(frozen=True)
class Simulation:
    """A run of LAMMPS.

    Attributes:
        name: of its folder, and what it is asked for by; with slashes, in such folders.
        label: for the terminal.
        dt: the scene's unit.  steps: in all.  every: steps between samples of the energy.
        keeps: see ``run.job``.
        start: name of the simulation that makes its start, and the step; None for the scene's own.
        state: steps between dumps of all atoms, of one that makes starts.
        more: LAMMPS commands before it; ``{folder}`` is its folder.
        may_fail: whether a failure tells something of the integrator.
    """

    name: str
    label: str
    scene: Scene
    integrator: Integrator
    dt: float
    steps: int
    every: int
    ranks: int = 1
    keeps: Literal["nothing", "positions"] = "positions"
    start: tuple[str, int] | None = None
    state: int | None = None
    more: Sequence[str] = ()
    may_fail: bool = False

    def trajectory(self, bench: Bench) -> experiment.Trajectory:
        """It as a part of an experiment."""
        point = experiment.Point(self.integrator.name, self.dt)
        more: dict = {} if self.state else {"point": point}
        start = self.start[0] if self.start else ""
        return experiment.Trajectory(
            self.name, self.label, partial(self.job, bench), start=start, **more
        )

    def job(self, bench: Bench) -> run.Job:
        """Its job; the file of its start is there."""
        folder, scene, files = _folder(bench, self.name), self.scene, []
        if self.start:
            name, step = self.start
            dump = _state(bench, name)
            scene, files = from_dump(scene, dump, step), [dump]
        more = [line.format(folder=folder) for line in self.more]
        more += to_dump(_state(bench, self.name), self.state) if self.state else []
        return run.job(
            scene,
            self.integrator,
            folder,
            [self.steps],
            dt=self.dt,
            every=self.every,
            ranks=self.ranks,
            keeps=self.keeps,
            silence=bench.silence,
            more=more,
            origin=machine.origin(self.scene, self.integrator, *files),
        )


def _folder(bench, name):
    return (bench.runs / run.folder_name(name)).resolve()


def _state(bench, name):
    return _folder(bench, name) / "state.dump"


@dataclass
class Series:
    """What a simulation left.

    Attributes:
        error: None, or why it is not complete.
        folder: its files.
        time: (n,) ps.  total, kinetic: (n,) kcal/mol.  temperature: (n,) K.  All up to a sample
            that is not finite.
        positions: at its start and end; None if they are not kept.
        seconds: that the steps took.
    """

    simulation: Simulation
    error: str | None
    folder: Path
    time: np.ndarray
    total: np.ndarray
    kinetic: np.ndarray
    temperature: np.ndarray
    positions: Positions | None = None
    seconds: float = 0.0


Found = dict[str, Series]  # by the simulation's name


class Claims(NamedTuple):
    """A list of claims.

    Attributes:
        title: what it is about.
        question: that it answers.
        noun: what its checks are, in the answer.
        parts: part of its checks to their heading.
        plan: gives the simulations.
        judge: from what these left to plain data: ``checks`` and more.
        figures: functions of a summary to captions.
        tables: of a summary, beside the checks.
        notes: what words mean, and how it was measured.
        checks_file: of the CSV file of the checks.
        ours: whether a check that does not hold is a failure of ours, not of what others say.
    """

    title: str
    question: str
    noun: str
    parts: Mapping[str, str]
    plan: Callable[[Bench], Sequence[Simulation]]
    judge: Callable[[Found, Bench], dict]
    figures: Mapping[Callable[[dict], Figure | None], str] = MappingProxyType({})
    tables: Callable[[dict], Sequence[Table]] = lambda summary: ()
    notes: Mapping[str, str] = MappingProxyType({})
    checks_file: str = "table"
    ours: bool = True


def failure(result: run.Result) -> str | None:
    """Why a result is none."""
    finite = np.isfinite(result.thermo.get("TotEng", np.zeros(1))).all()
    return result.error or (None if finite else "energy is not finite")


def series(simulation: Simulation, job: run.Job) -> Series:
    """What the run of a job left, complete or not."""
    result = run.collect(job.directory)
    columns = "Step", "TotEng", "KinEng", "Temp"
    values = [result.thermo.get(column, np.empty(0)) for column in columns]
    finite = np.isfinite(values[1])
    until = len(finite) if finite.all() else int(np.argmin(finite))
    step, total, kinetic, temperature = (some[:until] for some in values)
    return Series(
        simulation,
        failure(result),
        Path(job.directory),
        step * simulation.dt / FS_PER_PS,
        total,
        kinetic,
        temperature,
        result.positions,
        sum(loop.seconds for loop in result.timings),
    )
