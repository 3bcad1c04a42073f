"""A free body for very many steps: what rounding errors do to energy, momentum and shape.

Without forces everything is known: the kinetic energy and both momenta are constant.  The splitting
of the rotation keeps the energy up to a term that falls with dt^2 and does not grow; everything
else may change by rounding only.  Two time steps show both: one so short that the dt^2 term is
below the bound, and one as long as in practice.

The numbers come from the atoms that LAMMPS dumps, for its own fixes as for ours.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..running import machine, run
from ..scenes import bodies
from ..scenes.integrators import INTEGRATORS
from ..statistics import measures, motion
from ..statistics.estimate import Estimate, plain

BOUND = 1e-10
FRAMES = 1000
# radians that the body turns about in a step, of each time step
ANGLES = {"short": 3e-6, "practical": 0.05}
MASS = np.array([1.0, 1.6, 0.4, 1.0, 1.6])
PLACE = np.array([[0, 0, 0], [0.9, 0.1, 0], [-0.2, 0.7, 0.1], [0.1, -0.3, 0.8], [-0.6, -0.4, -0.2]])
SPIN = np.array([0.6, -0.5, 0.7])  # radians per time unit; not along a principal axis
VELOCITY = np.array([0.013, -0.021, 0.017])
QUANTITIES = {
    "energy": "kinetic energy",
    "angular_momentum": "angular momentum",
    "momentum": "momentum",
    "shape": "distances between atoms",
}


@dataclass
class Row:
    """A run's largest relative errors; None where it has none.

    Attributes:
        step, angle: name of the time step, and radians that the body turns in it.
        energy_drift: relative, in the whole run.
    """

    name: str
    label: str
    step: str
    angle: float
    error: str | None
    steps: int | None = None
    energy: float | None = None
    angular_momentum: float | None = None
    momentum: float | None = None
    shape: float | None = None
    energy_drift: Estimate | None = None
    us_per_step: float | None = None


def long_run(
    out: Path, steps: int, names: Sequence[str], meter: run.Meter, silence: float
) -> tuple[dict, dict]:
    """Run, or take over what is there already, and measure.

    Returns:
        (summary, series): plain data with a row for each run, and for each, by name and step, the
        relative errors against the steps.
    """
    folder = Path(out).resolve() / "runs"
    body = bodies.body(PLACE, MASS, velocity=VELOCITY, spin=SPIN)
    setup = *bodies.FREE, "neighbor 1.0 bin"
    scene = bodies.scene(folder, [body], setup, box=20, corner=(-10, -10, -10), dt=1, name="body")
    dump = motion.dump(max(1, steps // FRAMES))
    summary, series = machine.circumstances() | {"bound": BOUND, "interrupted": False}, {}
    rows = []
    for (kind, angle), name in itertools.product(ANGLES.items(), names):
        one, directory = INTEGRATORS[name], folder / f"{run.folder_name(name)}-{kind}"
        how: dict = {"dt": angle / np.linalg.norm(SPIN), "every": max(1, steps // 200)}
        how |= {"silence": silence, "origin": machine.origin(scene, one)}
        more = [line.format(folder=directory) for line in dump]
        meter.begin(f"{one.label}, {kind} step", steps)
        result = run.once(run.job(scene, one, directory, [steps], more=more, **how), meter.at)
        meter.end(result.error)
        row = Row(name, one.label, kind, angle, result.error)
        if motion.has_frames(directory):
            series[name, kind] = errors = _errors(directory)
            _largest(row, errors)
        if result.timings:
            row.us_per_step = result.timings[0].seconds / result.timings[0].steps * 1e6
        rows.append(plain(vars(row)))
        if result.interrupted:
            summary["interrupted"] = True
            break
    return summary | {"runs": rows}, series


def _largest(row: Row, errors: dict) -> None:
    """What a run's errors come to."""
    steps = errors["steps"]
    row.steps = int(steps[-1])
    for key in QUANTITIES:
        setattr(row, key, float(np.abs(errors[key]).max()))
    if len(steps) > 20:
        row.energy_drift = measures.drift(steps / steps[-1], errors["energy"])


def _errors(folder: Path) -> dict:
    """Relative errors of what is constant, from a run's dump: ``steps`` and each of `QUANTITIES`,
    (frames,)."""
    steps, mass, x, v = motion.frames(folder)
    energy, momentum, angular = motion.conserved(mass, x, v)
    distance = motion.distances(x)
    found = {"steps": steps, "energy": energy / energy[0] - 1}
    for key, vector in ("angular_momentum", angular), ("momentum", momentum):
        change = np.linalg.norm(vector - vector[0], axis=1)
        found[key] = change / np.linalg.norm(vector[0])
    return found | {"shape": np.abs(distance / distance[0] - 1).max(axis=1)}
