"""Engines beside LAMMPS.

A run of an engine is a ``run.Job`` as one of LAMMPS is, with a worker of its own that leaves the
same files (``engine_worker``).  So it is started, watched, kept and found again in the same way.
An engine is a module of this folder with an `Engine` of that name, and the schemes that it runs.
"""

import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from ..running import machine, run
from ..running.store import digest
from .shifted import Water

WORKER = "sample/engine_worker.py"  # in the harness
KJ, NM, BAR = 4.184, 0.1, 1 / 1.01325  # kJ/mol in a kcal/mol, nm in an Angstrom, atm in a bar


@dataclass(frozen=True)
class Course:
    """What an engine is to do.

    Attributes:
        thermostat: the engine's word.
        temperature: K.
        friction: 1/ps; of a thermostat that scales velocities the inverse of its time.
        dt: fs.
        runs: steps that are left out, and steps that are sampled.
        every: steps between samples.
        seed: of random numbers.
    """

    thermostat: str
    temperature: float
    friction: float
    dt: float
    runs: list[int]
    every: int
    seed: int

    @property
    def steps(self) -> int:
        """All of them."""
        return sum(self.runs)


class Sample(NamedTuple):
    """At a step the potential energy, kcal/mol, and the pressure, atm."""

    step: int
    potential: float
    pressure: float


@dataclass(frozen=True)
class Engine:
    """An engine.

    Attributes:
        name: as it calls itself.
        install: how to get it.
        version: of the one that is here; None if there is none.
        given: of a course of a water what the worker is given, plain data.
        words: of what is given what the page says of it, lines.
        samples: in the worker, of what is given and the folder of the run: does it.  Raises
            `Failed` where the engine ends it.
        same: whether its forces are the scene's, as LAMMPS has them.
    """

    name: str
    install: str
    version: Callable[[], str | None]
    given: Callable[[Course, Water], dict]
    words: Callable[[dict], list[str]]
    samples: Callable[[dict, Path], Iterator[Sample]]
    same: bool = False

    def job(self, course: Course, water: Water, folder: Path, silence: float) -> run.Job:
        """A run; its files go to ``folder``."""
        path = Path(str(sys.modules[self.samples.__module__].__file__))
        told = {"module": path.stem, "dt": course.dt, "atoms": len(water.x)}
        told |= {"volume": float(water.box.prod())}
        return run.Job(
            directory=str(folder),
            folder="",
            commands=[],
            runs=course.runs,
            body_property=None,
            silence=silence,
            origin=digest(self.name, self.version(), machine.contents(path)),
            worker=WORKER,
            given=told | self.given(course, water),
        )


class Failed(Exception):
    """The engine has ended a run; the same run would end again."""

    def __init__(self, message: str) -> None:
        super().__init__(f"ERROR: {message}")


def versions(engines: Iterable[Engine | None]) -> dict[str, str]:
    """Versions of engines that are not LAMMPS, by name.

    Raises:
        SystemExit: one is not here.
    """
    found = {}
    for engine in dict.fromkeys(filter(None, engines)):
        version = engine.version()
        if version is None:
            raise SystemExit(
                f"{engine.name} is not installed. Install it by: {engine.install}\n"
                "Or leave its schemes out of --only"
            )
        found[engine.name] = version
    return found
