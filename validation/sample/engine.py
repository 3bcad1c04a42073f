"""Engines other than LAMMPS.

A run of an engine is a ``run.Job`` like one of LAMMPS, with its own worker that writes the same
files (``engine_worker``).  It is therefore started, monitored, stored and found in the same way.
An engine is a module of this folder with an `Engine` of that name, and the schemes that it runs.

An engine gets the water of the scene `water` as numbers: atoms, and forces that end smoothly.  The
scene's ``pair_style lj/gromacs/coul/gromacs`` is GROMACS's shift function: 1 / r^p becomes

    1 / r^p - A / 3 (r - r1)^3 - B / 4 (r - r1)^4 - C   from r1 on,   1 / r^p - C   before,

with A, B and C such that energy, force and the force's slope are zero at the cutoff (GROMACS
reference manual, "Modified non-bonded interactions").  Tests compare energy and forces with LAMMPS.
"""

import math
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..running import machine, run
from ..running.store import digest
from ..scenes import Scene

WORKER = "sample/engine_worker.py"  # in the harness
KJ, NM, BAR = 4.184, 0.1, 1 / 1.01325  # kJ/mol in a kcal/mol, nm in an Angstrom, atm in a bar


class Shift(NamedTuple):
    """Modification of 1 / r^power that ends at ``outer``, smoothly from ``inner`` on: A, B and
    C."""

    power: int
    inner: float
    outer: float

    @property
    def coefficients(self) -> tuple[float, float, float]:
        """A, B, C, in the powers of the unit of length that they have."""
        p, r1, rc = self
        wide = rc - r1
        a = -p * ((p + 4) * rc - (p + 1) * r1) / (rc ** (p + 2) * wide**2)
        b = p * ((p + 3) * rc - (p + 1) * r1) / (rc ** (p + 2) * wide**3)
        return a, b, rc**-p - a / 3 * wide**3 - b / 4 * wide**4


# TIP3P as in the scene's force field: masses of oxygen and hydrogen, g/mol, and charges, e;
# Lennard-Jones of the oxygens (hydrogens have none), kcal/mol and Angstrom; distances O-H and H-H,
# Angstrom; the modification of each part
MASS, CHARGE = (15.9994, 1.008), (-0.834, 0.417)
DEPTH, SIZE = 0.1521, 3.15061
BOND, ACROSS = 0.9572, 2 * 0.9572 * math.sin(math.radians(104.52) / 2)
DISPERSION, REPULSION, COULOMB = Shift(6, 7.0, 8.5), Shift(12, 7.0, 8.5), Shift(1, 0.0, 8.5)


@dataclass(frozen=True)
class Water:
    """Three-site molecules in a box, in order O, H, H.

    Attributes:
        box: (3,) Angstrom.
        x: (atoms, 3) Angstrom, each molecule unwrapped.
    """

    box: np.ndarray
    x: np.ndarray

    @property
    def molecules(self) -> int:
        """The number of molecules."""
        return len(self.x) // 3


def of_scene(scene: Scene) -> Water:
    """The water of the scene, whose data file has the atoms in order of ID."""
    (file,) = (line.split()[1] for line in scene.setup if line.startswith("read_data"))
    lines = [line.split() for line in (scene.folder / file).read_text().splitlines()]
    ends = np.array([words[:2] for words in lines if words[-1:] in (["xhi"], ["yhi"], ["zhi"])])
    low, high = ends.astype(float).T
    # ID, molecule, type, charge, position, image
    atoms = np.array([words for words in lines if len(words) == 10], float)
    atoms = atoms[np.argsort(atoms[:, 0])]
    return Water(high - low, atoms[:, 4:7] - low + atoms[:, 7:10] * (high - low))


@dataclass(frozen=True)
class EngineRun:
    """Settings of a run of an engine.

    Attributes:
        thermostat: the engine's name of it.
        temperature: K.
        friction: 1/ps; for a thermostat that scales velocities, its inverse time constant.
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
        """The number of all steps."""
        return sum(self.runs)


class Sample(NamedTuple):
    """Potential energy, kcal/mol, and pressure, atm, at a step."""

    step: int
    potential: float
    pressure: float


@dataclass(frozen=True)
class Engine:
    """An engine.

    Attributes:
        name: official name.
        install: how to install it.
        version: returns the installed version; None if there is none.
        worker_input: returns the worker's input for a run of water, plain data.
        words: returns lines about that input for the page.
        samples: does the run in the worker, from the input and the folder.  Raises `Failed` if the
            engine ends it.
        seconds: returns the wall time of the steps of the run in a folder; None: from its first
            sample to its last.
        same: whether its forces are those of the scene in LAMMPS.
    """

    name: str
    install: str
    version: Callable[[], str | None]
    worker_input: Callable[[EngineRun, Water], dict]
    words: Callable[[dict], list[str]]
    samples: Callable[[dict, Path], Iterator[Sample]]
    seconds: Callable[[Path], float] | None = None
    same: bool = False

    def job(self, course: EngineRun, water: Water, folder: Path, silence: float) -> run.Job:
        """A run; its files are written to ``folder``."""
        path = Path(str(sys.modules[self.samples.__module__].__file__))
        settings = {"module": path.stem, "dt": course.dt, "atoms": len(water.x)}
        settings |= {"volume": float(water.box.prod())}
        return run.Job(
            directory=str(folder),
            folder="",
            commands=[],
            runs=course.runs,
            body_property=None,
            silence=silence,
            origin=digest(self.name, self.version(), machine.contents(path)),
            worker=WORKER,
            input=settings | self.worker_input(course, water),
        )


class Failed(Exception):
    """The engine has ended a run; a repetition would end in the same way."""

    def __init__(self, message: str) -> None:
        super().__init__(f"ERROR: {message}")


def versions(engines: Iterable[Engine | None]) -> dict[str, str]:
    """The versions of engines other than LAMMPS, by name.

    Raises:
        SystemExit: one is not installed.
    """
    installed = {}
    for engine in dict.fromkeys(filter(None, engines)):
        version = engine.version()
        if version is None:
            raise SystemExit(
                f"{engine.name} is not installed. Install it by: {engine.install}\n"
                "Or leave its schemes out of --only"
            )
        installed[engine.name] = version
    return installed
