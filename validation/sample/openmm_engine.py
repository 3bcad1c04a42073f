"""OpenMM: LangevinMiddleIntegrator with rigid water, and exactly the scene's forces."""

from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from ..scenes.units import COULOMB
from . import engine
from .engine import BAR, KJ, NM, Engine, EngineRun, Failed, Sample, Shift, Water
from .schemes import Scheme

TOLERANCE = 1e-6  # relative, of constraints; not used by SETTLE, which holds water
PARAMETERS = "charge", "site"


def version() -> str | None:
    """The version of the package in this Python; None if there is none."""
    try:
        return metadata.version("openmm")
    except metadata.PackageNotFoundError:
        return None


def energy() -> str:
    """The energy of a pair as an OpenMM expression; nm and kJ/mol."""
    size, depth = engine.SIZE * NM, engine.DEPTH * KJ
    coulomb = f"{COULOMB * KJ * NM!r}*charge1*charge2*({_ended(engine.COULOMB)})"
    repulsion, dispersion = _ended(engine.REPULSION), _ended(engine.DISPERSION)
    first, second = 4 * depth * size**12, 4 * depth * size**6
    return f"{coulomb} + site1*site2*({first!r}*({repulsion}) - {second!r}*({dispersion}))"


def _ended(shift: Shift) -> str:
    """The modified 1 / r^power as an expression."""
    inner, outer = shift.inner * NM, shift.outer * NM
    a, b, c = Shift(shift.power, inner, outer).coefficients
    past = f"max(0, r-{inner!r})" if inner else "r"
    return f"r^(-{shift.power}) - ({a / 3!r}+{b / 4!r}*{past})*{past}^3 - ({c!r})"


def worker_input(course: EngineRun, water: Water) -> dict:
    """See `Engine`: all numbers and the forces, in OpenMM's units (nm, ps, kJ/mol, g/mol)."""
    (oxygen, hydrogen), charge, bond = engine.MASS, engine.CHARGE, engine.BOND * NM
    return {
        "platform": "CPU",
        "box": np.diag(water.box * NM).tolist(),
        "x": (water.x * NM).tolist(),
        "mass": [oxygen, hydrogen, hydrogen],
        "parameters": [[charge[0], 1.0], [charge[1], 0.0], [charge[1], 0.0]],
        "lengths": [bond, bond, engine.ACROSS * NM],
        "energy": energy(),
        "cutoff": engine.COULOMB.outer * NM,
        "temperature": course.temperature,
        "friction": course.friction,
        "steps": course.steps,
        "every": course.every,
        "seed": course.seed,
    }


def words(data: dict) -> list[str]:
    """See `Engine`."""
    how = f"{data['temperature']:g} K, {data['friction']:g}/ps, STEP"
    return [f"LangevinMiddleIntegrator({how})", f"CustomNonbondedForce({data['energy']})"]


def samples(data: dict, folder: Path) -> Iterator[Sample]:
    """See `Engine`."""
    import openmm  # optional

    try:
        context, barostat = create_context(data)
        for step in range(0, data["steps"] + 1, data["every"]):
            if step:
                context.getIntegrator().step(data["every"])
            potential = context.getState(getEnergy=True).getPotentialEnergy()._value
            pressure = barostat.computeCurrentPressure(context)._value
            yield Sample(step, potential / KJ, pressure * BAR)
    except openmm.OpenMMException as error:
        raise Failed(str(error)) from None


def create_context(data: dict) -> tuple[Any, Any]:
    """OpenMM's ``Context`` of rigid three-site molecules with these forces, at the start, with
    velocities of the temperature; and a barostat that only measures the pressure and never changes
    the box."""
    import openmm

    system, force = openmm.System(), openmm.CustomNonbondedForce(data["energy"])
    system.setDefaultPeriodicBoxVectors(*map(tuple, data["box"]))
    force.setNonbondedMethod(openmm.CustomNonbondedForce.CutoffPeriodic)
    force.setCutoffDistance(data["cutoff"])
    for name in PARAMETERS:
        force.addPerParticleParameter(name)
    for first in range(0, len(data["x"]), 3):
        for mass, values in zip(data["mass"], data["parameters"]):
            system.addParticle(mass)
            force.addParticle(values)
        for (i, j), length in zip(((0, 1), (0, 2), (1, 2)), data["lengths"]):
            system.addConstraint(first + i, first + j, length)
            force.addExclusion(first + i, first + j)
    barostat = openmm.MonteCarloBarostat(1.0, data["temperature"], 0)
    for term in force, barostat:
        system.addForce(term)
    integrator = openmm.LangevinMiddleIntegrator(
        data["temperature"], data["friction"], data["dt"] / 1e3
    )
    integrator.setConstraintTolerance(TOLERANCE)
    integrator.setRandomNumberSeed(data["seed"])
    context = openmm.Context(
        system,
        integrator,
        openmm.Platform.getPlatformByName(data["platform"]),
        {"Threads": "1"} if data["platform"] == "CPU" else {},
    )
    context.setPositions([openmm.Vec3(*place) for place in data["x"]])
    context.setVelocitiesToTemperature(data["temperature"], data["seed"])
    return context, barostat


ENGINE = Engine(
    "OpenMM",
    "pip install 'fix_nosquish[engines]'",
    version,
    worker_input,
    words,
    samples,
    same=True,
)
SCHEMES = [
    Scheme(
        f"openmm-langevin-{friction:g}", f"OpenMM LangevinMiddle {friction:g}/ps",
        ("LangevinMiddleIntegrator",), kind="engine", engine=ENGINE, friction=friction,
        steps=(1.0, 2.0, 4.0, 6.0, 8.0), reach=reach,
    )
    for friction, reach in ((5.0, 6.0), (20.0, 8.0))
]  # fmt: skip
