"""A free body for very many steps: what rounding errors do to energy, momentum and shape.

Without forces everything is known: the kinetic energy and both momenta are constant.  The splitting
of the rotation keeps the energy up to a term that falls with dt^2 and does not grow; everything
else may change by rounding only.  Two time steps show both: one so short that the dt^2 term is
below the bound, and one as long as in practice.

The numbers come from the atoms that LAMMPS dumps, for its own fixes as for ours.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from ..scenes import bodies
from ..scenes.integrators import INTEGRATORS
from ..statistics import measures, motion
from ..statistics.check import Check
from ..statistics.estimate import plain
from .plan import Bench, Claims, Found, Series, Simulation

BOUND = 1e-10
FRAMES, SAMPLES = 1000, 200  # of atoms, of the thermo output
SHORT, FULL = 30_000, 10_000_000  # steps
ENOUGH = 20  # frames for a drift
NAMES = "nosquish", "rigid/nve", "rigid"
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
PARTS = {
    "short": f"A short step, {ANGLES['short']:g} rad: all that is left is rounding",
    "practical": f"A practical step, {ANGLES['practical']:g} rad: the energy's error does not grow",
}
SOURCE = "our algorithm.md: a free body keeps energy, both momenta and its shape"


def plan(bench: Bench) -> list[Simulation]:
    """Each integrator with each time step."""
    steps = FULL if bench.full else SHORT
    body = bodies.body(PLACE, MASS, velocity=VELOCITY, spin=SPIN)
    setup = *bodies.FREE, "neighbor 1.0 bin"
    sized: dict = {"box": 20, "corner": (-10, -10, -10), "dt": 1, "name": "body"}
    scene = bodies.scene(bench.runs, [body], setup, **sized)
    how: dict = {"scene": scene, "steps": steps, "every": max(1, steps // SAMPLES)}
    how["more"] = motion.dump(max(1, steps // FRAMES))
    made = []
    for kind, angle in ANGLES.items():
        for name in NAMES:
            integrator, dt = INTEGRATORS[name], angle / float(np.linalg.norm(SPIN))
            told = f"{integrator.label}, {kind} step"
            made.append(Simulation(f"{name}-{kind}", told, integrator=integrator, dt=dt, **how))
    return made


def judge(found: Found, bench: Bench) -> dict:
    """``checks``, ``bound`` and ``runs``, a row for each."""
    runs = [_row(one) for one in found.values()]
    made = [check.plain() for row in runs for check in checks(row)]
    return {"checks": made, "bound": BOUND, "runs": runs}


def _row(one: Series) -> dict:
    """A run's largest relative errors of what is constant, from its dump; ``energy_drift`` is in
    the whole run."""
    integrator, kind = one.simulation.integrator, one.simulation.name.rpartition("-")[2]
    row: dict = {"name": integrator.name, "label": integrator.label, "step": kind}
    row |= {"angle": ANGLES[kind], "error": one.error}
    if one.error:
        return row
    steps, mass, x, v = motion.frames(one.folder)
    energy, momentum, angular = motion.conserved(mass, x, v)
    distance = motion.distances(x)
    energy = energy / energy[0] - 1
    row |= {"steps": int(steps[-1]), "us_per_step": one.seconds / steps[-1] * 1e6}
    row |= {"energy": float(np.abs(energy).max()), "angular_momentum": motion.relative(angular)}
    row |= {"momentum": motion.relative(momentum)}
    row["shape"] = float(np.abs(distance / distance[0] - 1).max())
    if len(steps) > ENOUGH:
        row["energy_drift"] = measures.drift(steps / steps[-1], energy)
    return plain(row)


def checks(row: dict) -> Iterator[Check]:
    """What a run's numbers have to be; at the practical step the energy's error is the
    splitting's."""
    for key, what in QUANTITIES.items():
        check = partial(Check.of, row["step"], row["label"], source=SOURCE)
        if row["error"]:
            yield check(f"largest relative change of {what}", None, note=row["error"])
            continue
        bound = None if (key, row["step"]) == ("energy", "practical") else BOUND
        what = f"largest relative change of {what}, {row['steps']:,} steps"
        yield check(what, row[key], high=bound)


CLAIMS = Claims(
    "A free body for very many steps",
    "Does rounding build up in energy, momenta or shape?",
    "statements that a free body keeps what it has to keep",
    PARTS,
    plan,
    judge,
    ours=False,
)
