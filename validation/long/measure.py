"""A free body for very many steps: what rounding errors do to energy, momentum and shape.

Without forces everything is known: the kinetic energy and both momenta are constant.  The splitting
of the rotation keeps the energy up to a term that falls with dt^2 and does not grow; everything
else may change by rounding only.  Two time steps show both: one so short that the dt^2 term is
below the bound, and one as long as in practice.

The numbers come from the atoms that LAMMPS dumps, for its own fixes as for ours.
"""

import itertools
from pathlib import Path

import numpy as np

from validation.running import machine, run
from validation.scenes import bodies
from validation.scenes.integrators import INTEGRATORS
from validation.statistics import measures, motion

BOUND = 1e-10
FRAMES = 1000
# radians that the body turns about in a step, of each time step
ANGLES = {"short": 3e-6, "practical": 0.05}
NAMES = "nosquish", "rigid/nve", "rigid"
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


def long_run(out, steps: int, names, meter, silence: float) -> tuple[list[dict], dict]:
    """Run, or take over what is there already, and measure.

    Args:
        out: folder for the runs and results.
        steps: of each run.
        names: of `NAMES`.
        meter: a ``console.Meter``.

    Returns:
        (rows, series): a dict for each run, and for each the relative errors against the steps.
    """
    folder = Path(out) / "runs"
    body = bodies.body(PLACE, MASS, velocity=VELOCITY, spin=SPIN)
    setup = *bodies.FREE, "neighbor 1.0 bin"
    scene = bodies.scene(folder, [body], setup, box=20, corner=(-10, -10, -10), dt=1, name="body")
    rows, series = [], {}
    for (kind, angle), name in itertools.product(ANGLES.items(), names):
        one = INTEGRATORS[name]
        label = f"{one.label}, {kind} step"
        directory = (folder / f"{run.folder_name(name)}-{kind}").resolve()
        job = run.job(
            scene,
            one,
            directory,
            [steps],
            dt=angle / np.linalg.norm(SPIN),
            every=max(1, steps // 200),
            silence=silence,
            more=[line.format(folder=directory) for line in motion.dump(max(1, steps // FRAMES))],
            origin=machine.origin(scene, one),
        )
        meter.begin(label, steps)
        result = run.once(job, meter.at)
        meter.end(result.error)
        row = {
            "name": name,
            "label": one.label,
            "step": kind,
            "angle": angle,
            "error": result.error,
        }
        series[label] = errors = _errors(directory)
        rows.append(row | _row(errors, result))
        if result.interrupted:
            break
    return rows, series


def _row(errors, result):
    """What a run's errors come to."""
    steps = errors["steps"]
    if not len(steps):
        return {}
    row = {"steps": int(steps[-1])} | {key: float(np.abs(errors[key]).max()) for key in QUANTITIES}
    if len(steps) > 20:
        row["energy_drift"] = measures.drift(steps / steps[-1], errors["energy"]).plain()
    if result.timings:
        row["us_per_step"] = result.timings[0]["loop"] / result.timings[0]["steps"] * 1e6
    return row


def _errors(folder):
    """Relative errors of what is constant, from a run's dump: steps (frames,), and for each of
    QUANTITIES (frames,)."""
    if not motion.has_frames(folder):
        return {"steps": np.empty(0), **{key: np.empty(0) for key in QUANTITIES}}
    steps, mass, x, v = motion.frames(folder)
    energy, momentum, angular = motion.conserved(mass, x, v)
    distance = motion.distances(x)
    return {
        "steps": steps,
        "energy": energy / energy[0] - 1,
        "angular_momentum": np.linalg.norm(angular - angular[0], axis=1)
        / np.linalg.norm(angular[0]),
        "momentum": np.linalg.norm(momentum - momentum[0], axis=1) / np.linalg.norm(momentum[0]),
        "shape": np.abs(distance / distance[0] - 1).max(axis=1),
    }
