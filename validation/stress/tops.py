"""Free tops: their invariants and their exact motion are known.  Reduced units; all bodies of a
case are in one run."""

import numpy as np

from ..scenes import bodies
from ..statistics import motion
from . import criteria
from .measure import EXACT, Case, Number, Runner, of_parts

TURN = 0.05  # radians in a step, as in practice
# about the principal axes: a mixture of all three
SPIN = np.array([0.6, -0.5, 0.7]) / np.linalg.norm([0.6, -0.5, 0.7])
ATTITUDE = bodies.turned(2002)  # of all tops at the start
COMPARED_AT = 20_000  # steps, 1,000 radians: tops are then compared with the exact motion
RATIOS = 10.0 ** -np.arange(13)
GAP = 10.0  # between bodies
TOPS = (
    "largest of: relative change of energy; that of angular momentum; distance from the exact "
    "motion after 1,000 rad; each over its bound"
)
OF_TOPS = {"criterion": TOPS, "bars": EXACT, "short": 20_000, "full": 2_000_000}


def _place(k):
    return np.array([GAP * (k + 0.5), GAP / 2, GAP / 2])


def _scene(runner, moments):
    """Tops with these moments side by side."""
    tops = [
        bodies.body(
            *bodies.three_rods(moment),
            place=_place(k),
            turn=ATTITUDE,
            spin=ATTITUDE.apply(TURN * SPIN),
        )
        for k, moment in enumerate(moments)
    ]
    setup = *bodies.FREE, "comm_modify cutoff 3.0", "neighbor 1.0 bin", "neigh_modify once yes"
    box = GAP * len(tops), GAP, GAP
    return bodies.scene(runner.folder.parent, tops, setup, box=box, dt=1.0, name="tops")


def _measure_tops(runner, moments, labels, steps):
    """Measure the largest change of a body's energy and angular momentum, and the distance from the
    exact motion after `COMPARED_AT` steps."""
    every = max(1, steps // 200)
    how: dict = {"dt": 1.0, "every": every, "more": motion.dump(every)}
    _, folder = runner.run(_scene(runner, moments), "run", [steps], **how)
    _, mass, x, v = motion.frames(folder)
    frame, errors = min(steps, COMPARED_AT) // every, []
    for k, moment in enumerate(moments):
        atoms = slice(6 * k, 6 * k + 6)
        energy, _, momentum = motion.conserved(mass[atoms], x[:, atoms], v[:, atoms])
        turn = bodies.symmetric_top(ATTITUDE, TURN * SPIN, moment, frame * every)
        off = x[frame, atoms] - _place(k) - turn.apply(bodies.three_rods(moment)[0])
        far = np.linalg.norm(off, axis=1).max()
        errors.append((np.abs(energy / energy[0] - 1).max(), motion.relative(momentum), far))
    keys = "energy", "angular momentum", "distance from the exact motion, σ,"
    note = ", ".join(
        f"{key} {max(values):.1e} ({labels[int(np.argmax(values))]})"
        for key, values in zip(keys, zip(*errors))
    )
    energy, momentum, far = np.max(errors, axis=0)
    rounding = criteria.in_a_step(momentum, steps)
    return of_parts({"top's energy": energy, "rounding": rounding, "orientation": far}, note)


@Case.of(
    "needles",
    "Free tops from a sphere to a needle, I₃/I₁ from 1 to 1e-12, 0.05 rad a step.",
    **OF_TOPS,
)
def needles(runner: Runner, steps: int) -> Number:
    """Measure tops with moments (1, 1, r)."""
    moments = [np.array([1, 1, r]) for r in RATIOS]
    return _measure_tops(runner, moments, [f"I₃/I₁ = {r:g}" for r in RATIOS], steps)


@Case.of(
    "disks",
    "Free tops from a sphere to a disk, (I₁ + I₂ − I₃)/I₃ from 1 to 1e-12, 0.05 rad a step.",
    **OF_TOPS,
)
def disks(runner: Runner, steps: int) -> Number:
    """Measure tops with moments (1 + t, 1 + t, 2): a ball of six atoms for t = 1."""
    moments = [np.array([1 + t, 1 + t, 2]) for t in RATIOS]
    return _measure_tops(runner, moments, [f"(I₁ + I₂ − I₃)/I₃ = {t:g}" for t in RATIOS], steps)


CASES = needles, disks
