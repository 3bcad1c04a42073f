"""OpenMM beside LAMMPS: LangevinMiddleIntegrator with rigid water, and exactly the scene's forces.

A run is a ``run.Job`` like those of LAMMPS, whose worker (``engine_worker``) leaves the same files,
so it is started, watched, stored and found again in the same way.

OpenMM gets the water of the scene `water` as numbers: atoms, and forces that end smoothly.  The
scene's ``pair_style lj/gromacs/coul/gromacs`` is GROMACS's shift function: 1 / r^p becomes

    1 / r^p - A / 3 (r - r1)^3 - B / 4 (r - r1)^4 - C   from r1 on,   1 / r^p - C   before,

with A, B and C that make energy, force and the force's slope zero at the cutoff (GROMACS reference
manual, "Modified non-bonded interactions").  Tests compare energy and forces with LAMMPS's.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..running import machine, run
from ..running.store import digest
from ..scenes import Scene
from ..scenes.units import COULOMB as COULOMB_CONSTANT

NAME = "OpenMM"
WORKER = "sample/engine_worker.py"  # in the harness
KJ, NM, BAR = 4.184, 0.1, 1 / 1.01325  # kJ/mol in a kcal/mol, nm in an Angstrom, atm in a bar


class Shift(NamedTuple):
    """The shift function of 1 / r^power, from ``inner`` to ``outer`` (any unit of length)."""

    power: int
    inner: float
    outer: float

    @property
    def coefficients(self) -> tuple[float, float, float]:
        """A, B and C, in powers of that unit."""
        p, r1, rc = self
        wide = rc - r1
        a = -p * ((p + 4) * rc - (p + 1) * r1) / (rc ** (p + 2) * wide**2)
        b = p * ((p + 3) * rc - (p + 1) * r1) / (rc ** (p + 2) * wide**3)
        return a, b, rc**-p - a / 3 * wide**3 - b / 4 * wide**4


# TIP3P as in the scene's force field: of oxygen and hydrogen g/mol and e; Lennard-Jones of the
# oxygens, kcal/mol and Angstrom; distances O-H and H-H, Angstrom; shift functions
MASS, CHARGE = (15.9994, 1.008), (-0.834, 0.417)
DEPTH, SIZE = 0.1521, 3.15061
BOND, ACROSS = 0.9572, 2 * 0.9572 * math.sin(math.radians(104.52) / 2)
DISPERSION, REPULSION, COULOMB = Shift(6, 7.0, 8.5), Shift(12, 7.0, 8.5), Shift(1, 0.0, 8.5)


@dataclass(frozen=True)
class Water:
    """Three-site molecules in a box, in order O, H, H.

    Attributes:
        box: (3,) Angstrom.
        x: (atoms, 3) Angstrom, each molecule whole.
    """

    box: np.ndarray
    x: np.ndarray

    @property
    def molecules(self) -> int:
        """Number of molecules."""
        return len(self.x) // 3


def of_scene(scene: Scene) -> Water:
    """The water of a scene; its data file has the atoms in any order."""
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
    """A run at constant temperature.

    Attributes:
        temperature: K.  friction: 1/ps.  dt: fs.
        runs: steps of equilibration, and steps that are sampled.
        every: steps between samples.
        seed: of random numbers.
    """

    temperature: float
    friction: float
    dt: float
    runs: list[int]
    every: int
    seed: int


class Sample(NamedTuple):
    """At a step the potential energy, kcal/mol, and the pressure, atm."""

    step: int
    potential: float
    pressure: float


class Failed(Exception):
    """OpenMM has ended a run; the same run would end again."""

    def __init__(self, message: str) -> None:
        super().__init__(f"ERROR: {message}")


def versions() -> dict[str, str]:
    """The version of OpenMM, by its name.

    Raises:
        SystemExit: it is not installed.
    """
    try:
        return {NAME: metadata.version("openmm")}
    except metadata.PackageNotFoundError:
        raise SystemExit(
            f"{NAME} is not installed. Install it by: pip install 'fix_nosquish[engines]'\n"
            "Or leave its schemes out of --only"
        ) from None


def job(course: EngineRun, water: Water, folder: Path, silence: float) -> run.Job:
    """The job of a run; its files go to ``folder``."""
    return run.Job(
        directory=str(folder),
        folder="",
        commands=[],
        runs=course.runs,
        body_property=None,
        silence=silence,
        origin=digest(versions(), machine.contents(Path(__file__))),
        worker=WORKER,
        given=parameters(course, water),
    )


TOLERANCE = 1e-6  # relative, of constraints; SETTLE, which water has, needs none
PARAMETERS = "charge", "site"


def energy() -> str:
    """The energy of a pair, in OpenMM's words; nm and kJ/mol."""
    size, depth = SIZE * NM, DEPTH * KJ
    coulomb = f"{COULOMB_CONSTANT * KJ * NM!r}*charge1*charge2*({_ended(COULOMB)})"
    repulsion, dispersion = _ended(REPULSION), _ended(DISPERSION)
    first, second = 4 * depth * size**12, 4 * depth * size**6
    return f"{coulomb} + site1*site2*({first!r}*({repulsion}) - {second!r}*({dispersion}))"


def _ended(shift: Shift) -> str:
    """1 / r^power, as it ends smoothly."""
    inner, outer = shift.inner * NM, shift.outer * NM
    a, b, c = Shift(shift.power, inner, outer).coefficients
    past = f"max(0, r-{inner!r})" if inner else "r"
    return f"r^(-{shift.power}) - ({a / 3!r}+{b / 4!r}*{past})*{past}^3 - ({c!r})"


def parameters(course: EngineRun, water: Water) -> dict:
    """The run as plain data, in OpenMM's units (nm, ps, kJ/mol, g/mol); ``dt`` in fs and
    ``volume`` in Angstrom^3."""
    (oxygen, hydrogen), charge, bond = MASS, CHARGE, BOND * NM
    return {
        "platform": "CPU",
        "dt": course.dt,
        "atoms": len(water.x),
        "volume": float(water.box.prod()),
        "box": np.diag(water.box * NM).tolist(),
        "x": (water.x * NM).tolist(),
        "mass": [oxygen, hydrogen, hydrogen],
        "parameters": [[charge[0], 1.0], [charge[1], 0.0], [charge[1], 0.0]],
        "lengths": [bond, bond, ACROSS * NM],
        "energy": energy(),
        "cutoff": COULOMB.outer * NM,
        "temperature": course.temperature,
        "friction": course.friction,
        "steps": sum(course.runs),
        "every": course.every,
        "seed": course.seed,
    }


def words(given: dict) -> list[str]:
    """Lines that describe a run on the page; ``given``: its `parameters`."""
    how = f"{given['temperature']:g} K, {given['friction']:g}/ps, STEP"
    return [f"LangevinMiddleIntegrator({how})", f"CustomNonbondedForce({given['energy']})"]


def samples(given: dict) -> Iterator[Sample]:
    """Run, and yield the samples; ``given``: the `parameters`.

    Raises:
        Failed: OpenMM has ended the run.
    """
    import openmm  # of the extra engines

    try:
        context, barostat = start(given)
        for step in range(0, given["steps"] + 1, given["every"]):
            if step:
                context.getIntegrator().step(given["every"])
            potential = context.getState(getEnergy=True).getPotentialEnergy()._value
            pressure = barostat.computeCurrentPressure(context)._value
            yield Sample(step, potential / KJ, pressure * BAR)
    except openmm.OpenMMException as error:
        raise Failed(str(error)) from None


def start(given: dict) -> tuple[Any, Any]:
    """OpenMM's ``Context`` at the start, with velocities of the temperature; and a barostat that
    computes the pressure, and never changes the box."""
    import openmm

    system, force = openmm.System(), openmm.CustomNonbondedForce(given["energy"])
    system.setDefaultPeriodicBoxVectors(*map(tuple, given["box"]))
    force.setNonbondedMethod(openmm.CustomNonbondedForce.CutoffPeriodic)
    force.setCutoffDistance(given["cutoff"])
    for name in PARAMETERS:
        force.addPerParticleParameter(name)
    for first in range(0, len(given["x"]), 3):
        for mass, values in zip(given["mass"], given["parameters"]):
            system.addParticle(mass)
            force.addParticle(values)
        for (i, j), length in zip(((0, 1), (0, 2), (1, 2)), given["lengths"]):
            system.addConstraint(first + i, first + j, length)
            force.addExclusion(first + i, first + j)
    barostat = openmm.MonteCarloBarostat(1.0, given["temperature"], 0)
    for one in force, barostat:
        system.addForce(one)
    how = given["temperature"], given["friction"], given["dt"] / 1e3
    integrator = openmm.LangevinMiddleIntegrator(*how)
    integrator.setConstraintTolerance(TOLERANCE)
    integrator.setRandomNumberSeed(given["seed"])
    platform = openmm.Platform.getPlatformByName(given["platform"])
    one_core = {"Threads": "1"} if given["platform"] == "CPU" else {}
    context = openmm.Context(system, integrator, platform, one_core)
    context.setPositions([openmm.Vec3(*place) for place in given["x"]])
    context.setVelocitiesToTemperature(given["temperature"], given["seed"])
    return context, barostat
