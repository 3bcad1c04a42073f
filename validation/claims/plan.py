"""Lists of claims, and the LAMMPS runs on which they are measured."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from .. import experiment
from ..pages import Table
from ..running import machine, run
from ..running.starts import from_dump, to_dump
from ..scenes import FS_PER_PS, Scene
from ..scenes.integrators import Integrator

FEW = 16  # least number of samples


@dataclass
class Bench:
    """Options of the command line, and output folders.

    Attributes:
        out: folder of the list's results.
        full: whether runs are as long as the committed ones.
        time: ps of the long runs, instead of that; None for the usual one.
        ranks: MPI ranks of large systems.
        silence: s without a line in the log after which a run is given up.
        names: of the requested simulations.
        meter: shows progress.
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
        """Folder of the LAMMPS runs."""
        return self.out / "runs"


@dataclass(frozen=True)
class Simulation:
    """A run of LAMMPS.

    Attributes:
        name: of its folder, and on the command line; slashes make subfolders.
        label: for the terminal.
        dt: in the scene's unit.  steps: in all.  every: steps between samples of the energy.
        start: name of the simulation that creates its start, and the step; None for the scene's.
        state: steps between dumps of all atoms, for a simulation that creates starts.
        more: LAMMPS commands before it; ``{folder}`` is its folder.
        may_fail: whether a failure is a result about the integrator.
    """

    name: str
    label: str
    scene: Scene
    integrator: Integrator
    dt: float
    steps: int
    every: int
    ranks: int = 1
    start: tuple[str, int] | None = None
    state: int | None = None
    more: Sequence[str] = ()
    may_fail: bool = False

    def trajectory(self, bench: Bench) -> experiment.Trajectory:
        """Return it as a part of an experiment."""
        return experiment.Trajectory(
            self.name,
            self.label,
            partial(self.job, bench),
            None if self.state else experiment.Point(self.integrator.name, self.dt),
            start=self.start[0] if self.start else "",
        )

    def job(self, bench: Bench) -> run.Job:
        """Its job; the file of its start exists."""
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
            keeps="nothing",
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
    """The output of a simulation.

    Attributes:
        error: None, or why it is not complete.
        folder: its files.
        time: (n,) ps.  total, kinetic: (n,) kcal/mol.  temperature: (n,) K.  All up to the first
            sample that is not finite.
        seconds: time of the steps.
    """

    simulation: Simulation
    error: str | None
    folder: Path
    time: np.ndarray
    total: np.ndarray
    kinetic: np.ndarray
    temperature: np.ndarray
    seconds: float = 0.0


Outputs = dict[str, Series]  # by name of the simulation


class Claims(NamedTuple):
    """A list of claims.

    Attributes:
        title: its subject.
        question: that it answers.
        noun: what its checks are, in the answer.
        parts: headings by part of its checks.
        plan: returns the simulations.
        judge: from their output to plain data: ``checks`` and more.
        tables: further tables of a summary, besides the checks.
        notes: meaning of terms, and how it was measured.
        checks_file: of the CSV file of the checks.
        ours: whether a check that does not hold is our failure, not that of another statement.
    """

    title: str
    question: str
    noun: str
    parts: Mapping[str, str]
    plan: Callable[[Bench], Sequence[Simulation]]
    judge: Callable[[Outputs, Bench], dict]
    tables: Callable[[dict], Sequence[Table]] = lambda summary: ()
    notes: Mapping[str, str] = MappingProxyType({})
    checks_file: str = "table"
    ours: bool = True


def failure(result: run.Result) -> str | None:
    """Why a result is not usable, or None."""
    finite = np.isfinite(result.thermo.get("TotEng", np.zeros(1))).all()
    return result.error or (None if finite else "energy is not finite")


def series(simulation: Simulation, job: run.Job) -> Series:
    """The output of a job's run, complete or not."""
    result = run.collect(job.directory)
    columns = "Step", "TotEng", "KinEng", "Temp"
    values = [result.thermo.get(column, np.empty(0)) for column in columns]
    finite = np.isfinite(values[1])
    until = len(finite) if finite.all() else int(np.argmin(finite))
    step, total, kinetic, temperature = (column[:until] for column in values)
    return Series(
        simulation,
        failure(result),
        Path(job.directory),
        step * simulation.dt / FS_PER_PS,
        total,
        kinetic,
        temperature,
        sum(loop.seconds for loop in result.timings),
    )
