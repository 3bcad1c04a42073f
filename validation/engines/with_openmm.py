"""OpenMM: LangevinMiddleIntegrator with rigid water, and exactly the scene's forces."""

import json
import sys
from importlib import metadata
from pathlib import Path

import numpy as np

from ..sampling.measure import COULOMB
from .engine import BAR, KJ, NM, OUTPUT, Course, Engine, Samples, wait
from .water import Shift, Water

WORKER = Path(__file__).with_name("openmm_worker.py")
JOB = "job.json"
TOLERANCE = 1e-6  # relative, of constraints; SETTLE, which water has, needs none
PARAMETERS = "charge", "site"


def version() -> str | None:
    """Of the package that this Python has; None if it has none."""
    try:
        return metadata.version("openmm")
    except metadata.PackageNotFoundError:
        return None


def energy(water: Water) -> str:
    """The energy of a pair, in OpenMM's words; nm and kJ/mol."""
    size, depth = water.size * NM, water.depth * KJ
    coulomb = f"{COULOMB * KJ * NM!r}*charge1*charge2*({_ended(water.coulomb)})"
    repulsion, dispersion = _ended(water.repulsion), _ended(water.dispersion)
    first, second = 4 * depth * size**12, 4 * depth * size**6
    return f"{coulomb} + site1*site2*({first!r}*({repulsion}) - {second!r}*({dispersion}))"


def _ended(shift: Shift) -> str:
    """1 / r^power, as it ends smoothly."""
    inner, outer = shift.inner * NM, shift.outer * NM
    a, b, c = Shift(shift.power, inner, outer).coefficients
    past = f"max(0, r-{inner!r})" if inner else "r"
    return f"r^(-{shift.power}) - ({a / 3!r}+{b / 4!r}*{past})*{past}^3 - ({c!r})"


def job(course: Course, water: Water) -> dict:
    """What the worker does."""
    (oxygen, hydrogen), charge = water.mass, water.charge
    return {
        "platform": "CPU",
        "box": np.diag(water.box * NM).tolist(),
        "x": (water.x * NM).tolist(),
        "mass": [oxygen, hydrogen, hydrogen],
        "parameters": PARAMETERS,
        "values": [[charge[0], 1.0], [charge[1], 0.0], [charge[1], 0.0]],
        "lengths": [water.bond * NM, water.bond * NM, water.across * NM],
        "energy": energy(water),
        "cutoff": max(water.coulomb.outer, water.dispersion.outer) * NM,
        "tolerance": TOLERANCE,
        "temperature": course.temperature,
        "friction": course.friction,
        "dt": course.dt / 1e3,
        "steps": course.steps,
        "every": course.every,
        "seed": course.seed,
    }


def inputs(course: Course, water: Water) -> dict[str, str]:
    """See `Engine`; the worker does what they say, so it is one of them."""
    return {JOB: json.dumps(job(course, water)), WORKER.name: WORKER.read_text()}


def words(course: Course, water: Water) -> list[str]:
    """See `Engine`."""
    how = f"{course.temperature:g} K, {course.friction:g}/ps, STEP"
    return [f"{course.thermostat}({how})", f"CustomNonbondedForce({energy(water)})"]


def run(course: Course, folder: Path, silence: float, on_step) -> Samples:
    """See `Engine`."""
    seconds = wait([sys.executable, WORKER.name, JOB], folder, silence, on_step)
    step, potential, pressure = np.loadtxt(folder / OUTPUT, ndmin=2, unpack=True)
    return Samples(step, potential / KJ, pressure * BAR, seconds)


ENGINE = Engine("OpenMM", "pip install 'fix_nosquish[engines]'", version, inputs, words, run)
