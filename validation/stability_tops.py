"""Free tops: what they keep is known, so is the exact motion.  Reduced units, all bodies of a case in one run."""

import functools

import numpy as np

from validation import motion
from validation import stability_bodies as bodies
from validation.stability import EXTREME, Case, Number
from validation.theory_top import free_top

TURN = 0.05  # radians in a step, as in practice
SPIN = np.array([0.6, -0.5, 0.7]) / np.linalg.norm([0.6, -0.5, 0.7])  # about the principal axes, none of them alone
RATIOS = 10.0 ** -np.arange(13)
STEPS = 10.0 ** np.arange(-8, 1.01, 0.5)  # radians in a step
SPLITS = {"sphere": (1, 1, 1), "needle": (1, 1, 0.1), "disk": (1, 1, 1.9)}
SPLIT = 1e-12
MIDDLE, TILT = 0.1, 0.1  # radians in a step about the middle axis; part of the spin about each of the others
GAP = 10.0  # between bodies


def _row_of(stand, name, shapes, spins, **more):
    """A scene of bodies side by side, each turned at random.

    Args:
        shapes: list of (positions, masses).  spins: as many angular velocities in the shape's frame.
    """
    found = []
    for k, ((x, mass), spin) in enumerate(zip(shapes, spins)):
        turn = bodies.turned(2002)
        found.append(bodies.body(x, mass, place=(GAP * (k + 0.5), GAP / 2, GAP / 2), turn=turn, spin=turn.apply(spin)))
    box = GAP * len(shapes), GAP, GAP
    return bodies.scene(
        stand.folder.parent,
        found,
        (*bodies.FREE, "comm_modify cutoff 3.0", "neighbor 1.0 bin", "neigh_modify once yes"),
        box=box,
        dt=1.0,
        name=name,
        **more,
    )


def _each(folder, size):
    """Mass, positions and velocities of each body of so many atoms, in turn."""
    _, mass, x, v = motion.frames(folder)
    for k in range(0, len(mass), size):
        yield mass[k : k + size], x[:, k : k + size], v[:, k : k + size]


def _energy(stand, shapes, labels, steps):
    """The largest relative change of a body's kinetic energy, and which body's."""
    scene = _row_of(stand, "tops", shapes, [TURN * SPIN] * len(shapes))
    _, folder = stand.run(scene, "run", [steps], dt=1.0, every=0, more=motion.dump(steps // 200))
    changes = []
    for mass, x, v in _each(folder, len(shapes[0][1])):
        energy = motion.conserved(mass, x, v)[0]
        changes.append(np.abs(energy / energy[0] - 1).max())
    worst = int(np.argmax(changes))
    return Number(changes[worst], note=f"worst: {labels[worst]}")


def needles(stand, steps):
    """Moments (1, 1, r)."""
    return _energy(stand, [bodies.three_rods(np.array([1, 1, r])) for r in RATIOS], [f"I₃/I₁ = {r:g}" for r in RATIOS], steps)


def disks(stand, steps):
    """Moments (1 + t, 1 + t, 2): a ball of six atoms for t = 1."""
    return _energy(stand, [bodies.three_rods(np.array([1 + t, 1 + t, 2])) for t in RATIOS], [f"(I₁ + I₂ − I₃)/I₃ = {t:g}" for t in RATIOS], steps)


def degenerate(stand, steps):
    """Tops with two or three equal moments, and with moments apart by `SPLIT` in a run of their own: how far apart are the same atoms at the end?"""
    ends = []
    for name, split in ("equal", 0.0), ("split", SPLIT):
        shapes = [bodies.three_rods(np.array(moment, float) + split * np.array([1, -0.5, 0.3])) for moment in SPLITS.values()]
        scene = _row_of(stand, name, shapes, [TURN * SPIN] * len(shapes))
        _, folder = stand.run(scene, name, [steps], dt=1.0, every=0, more=motion.dump(steps))
        ends.append([x[-1] for _, x, _ in _each(folder, 6)])
    apart = [np.linalg.norm(one - other, axis=1).max() for one, other in zip(*ends)]
    worst = int(np.argmax(apart))
    return Number(apart[worst], note=f"worst: {list(SPLITS)[worst]}")


def turn_per_step(stand, steps):
    """Error of the energy in parts of (|ω|Δt)², for steps of 1e-8 to 10 rad."""
    scene = _row_of(stand, "tops", [(bodies.BENT, bodies.MASSES)] * len(STEPS), [step * _in_frame(SPIN) for step in STEPS], bonded=True)
    _, folder = stand.run(scene, "run", [steps], dt=1.0, every=0, more=motion.dump(steps // 200))
    found = []
    for turn, (mass, x, v) in zip(STEPS, _each(folder, 3)):
        energy = motion.conserved(mass, x, v)[0]
        found.append(np.abs(energy / energy[0] - 1).max() / (turn**2 + 1e-10))
    worst = int(np.argmax(found))
    return Number(found[worst], note=f"worst: |ω|Δt = {STEPS[worst]:.2g}")


def _in_frame(spin):
    """From the principal frame of `BENT` to the frame of its coordinates."""
    return bodies.moments(bodies.BENT, bodies.MASSES)[1] @ spin


def middle_axis(stand, turns):
    """How long a top that spins about its middle axis takes to turn over, in the last turns of many, less the exact time."""
    axes = bodies.moments(bodies.BENT, bodies.MASSES)[1]
    spin = MIDDLE * np.array([TILT, 1.0, TILT])
    steps, window, every = round(turns * 2 * np.pi / MIDDLE), round(200 * 2 * np.pi / MIDDLE), 5
    scene = _row_of(stand, "top", [(bodies.BENT, bodies.MASSES)], [axes @ spin], bonded=True)
    more = [f"run {steps - window}", *motion.dump(every)]
    _, folder = stand.run(scene, "run", [window], dt=1.0, every=max(1, steps // 200), more=more)
    at, mass, x, v = motion.frames(folder)
    r, u = (a - np.einsum("i,fij->fj", mass, a)[:, None] / mass.sum() for a in (x, v))
    L = np.einsum("i,fij->fj", mass, np.cross(r, u))
    shape = bodies.BENT - mass @ bodies.BENT / mass.sum()
    weights = np.linalg.lstsq(shape.T, axes[:, 1], rcond=None)[0]  # the axis lies in the plane of the atoms
    measured = _intervals(at, np.einsum("fj,i,fij->f", L, weights, r))
    exact = exact_interval()
    if len(measured) < 2:
        return Number(1.0, note=f"does not turn over in the last {window} steps")
    error = measured.std(ddof=1) / np.sqrt(len(measured)) / exact
    return Number(abs(measured.mean() / exact - 1), error, f"{measured.mean():.1f} steps, exact {exact:.1f}")


@functools.cache
def exact_interval(steps=500):
    """Mean time between the turns over of the exact motion from that start, in so many steps."""
    moments = bodies.moments(bodies.BENT, bodies.MASSES)[0]
    start = moments * MIDDLE * np.array([TILT, 1.0, TILT])
    return _intervals(np.arange(steps), np.array([free_top(np.array([1.0, 0, 0, 0]), start, moments, float(t))[1][1] for t in range(steps)])).mean()


def _intervals(time, values):
    """Times between one change of sign and the next."""
    k = np.flatnonzero(values[1:] * values[:-1] < 0)
    return np.diff(time[k] + (time[k + 1] - time[k]) * values[k] / (values[k] - values[k + 1]))


def long_tops(stand, steps):
    """100 asymmetric tops: energy over 1e-3, the rest over 1e-10."""
    rng = np.random.default_rng(6)
    spins = rng.normal(size=(100, 3))
    spins *= TURN / np.linalg.norm(spins, axis=1)[:, None]
    scene = _row_of(stand, "tops", [(bodies.BENT, bodies.MASSES)] * len(spins), spins, bonded=True)
    scene = bodies.drifting(scene, np.array([0.013, -0.021, 0.017]) * TURN)
    _, folder = stand.run(scene, "run", [steps], dt=1.0, every=max(1, steps // 200), more=motion.dump(steps // 20))
    worst = {"energy": 0.0, "momentum": 0.0, "angular momentum": 0.0, "|q|, by the distances": 0.0}
    for mass, x, v in _each(folder, 3):
        energy, momentum, angular = motion.conserved(mass, x, v)
        shape = motion.distances(x)
        changes = np.abs(energy / energy[0] - 1).max(), motion.relative(momentum), motion.relative(angular), np.abs(shape / shape[0] - 1).max()
        worst = {key: max(value, change) for (key, value), change in zip(worst.items(), changes)}
    of = {key: value / (1e-3 if key == "energy" else 1e-10) for key, value in worst.items()}
    return Number(max(of.values()), note=", ".join(f"{key} {value:.1e}" for key, value in worst.items()))


CASES = (
    Case(
        "needles", "Free tops from a sphere to a needle, I₃/I₁ from 1 to 1e-12, 0.05 rad a step.",
        "largest relative change of a kinetic energy", "",
        "the splitting's own error is of order (0.05)², and does not grow", EXTREME, needles, 20_000, 2_000_000, high=2.5e-3,
    ),
    Case(
        "disks", "Free tops from a sphere to a disk, (I₁ + I₂ − I₃)/I₃ from 1 to 1e-12, 0.05 rad a step.",
        "largest relative change of a kinetic energy", "",
        "the splitting's own error is of order (0.05)², and does not grow", EXTREME, disks, 20_000, 2_000_000, high=2.5e-3,
    ),
    Case(
        "degenerate", "Sphere, needle and disk, and again with moments within 1e-12 of the same: motion is continuous in the moments.",
        "largest distance between the same atoms", "σ", "1e-12 times some 10³ radians turned, with a factor of ten to spare",
        EXTREME, degenerate, 20_000, 20_000, high=1e-8,
    ),
    Case(
        "middle-axis", "A free top about its middle axis, which is unstable: it turns over again and again, as Jacobi's elliptic functions tell.",
        "relative error of the time between two turns over, at the end", "", "the splitting's error is of order (0.1)²",
        "standard error of the mean of the times between the last turns over", middle_axis, 10_000, 1_000_000, high=1e-2,
    ),
    Case(
        "turn-per-step", "The same free top at 19 speeds, |ω|Δt from 1e-8 to 10 rad.", "largest |ΔE/E| / ((|ω|Δt)² + 1e-10)", "",
        "a scheme of second order loses at most (|ω|Δt)², and rounding 1e-10", EXTREME, turn_per_step, 10_000, 1_000_000, high=1.0,
    ),
    Case(
        "long-tops", "100 free tops for many steps at 0.05 rad: 1e8 body-steps with --full.",
        "largest relative change of energy over 1e-3, of momenta and distances over 1e-10", "",
        "the energy's splitting error stays, all else is rounding", EXTREME, long_tops, 20_000, 1_000_000, high=1.0,
    ),
)  # fmt: skip
