"""Free tops: what they keep is known, so is the exact motion.  Reduced units, all bodies of a case
in one run."""

from dataclasses import replace

import numpy as np
from scipy.special import ellipk

from ..running import run
from ..scenes import bodies
from ..statistics import measures, motion
from . import criteria
from .measure import EXACT, LESS, SLOW, BlowUp, Case, Number, Stand, of_parts

TURN = 0.05  # radians in a step, as in practice
# about the principal axes, none of them alone
SPIN = np.array([0.6, -0.5, 0.7]) / np.linalg.norm([0.6, -0.5, 0.7])
ATTITUDE = bodies.turned(2002)  # of all tops at the start
COMPARED_AT = 20_000  # steps, 1,000 radians, at which tops are held against the exact motion
RATIOS = 10.0 ** -np.arange(13)
STEPS = 10.0 ** np.arange(-8, 1.01, 0.5)  # radians in a step
APART = 0.2  # radians in a step, from which each speed has a run of its own: it may break it
SWING = 0.1  # of the energy, that a fast top may be off at most
# radians in a step about the middle axis; parts of the spin about each of the others
MIDDLE, TILTS = 0.1, (0.1, 1e-3)
WINDOW, EVERY = 200, 2  # turns at the end; steps between their frames
GAP = 10.0  # between bodies
BENT = bodies.BENT, bodies.MASSES
TOPS = (
    "largest of: relative change of energy; that of angular momentum; distance from the exact "
    "motion after 1,000 rad; each over its bound"
)
OF_TOPS = {"criterion": TOPS, "bars": EXACT, "short": 20_000, "full": 2_000_000}


def _row_of(stand, name, shapes, spins, **more):
    """A scene of bodies side by side, each turned alike, of shapes (positions, masses) and angular
    velocities in the shapes' frame."""
    found = [
        bodies.body(*shape, place=_place(k), turn=ATTITUDE, spin=ATTITUDE.apply(spin))
        for k, (shape, spin) in enumerate(zip(shapes, spins))
    ]
    setup = *bodies.FREE, "comm_modify cutoff 3.0", "neighbor 1.0 bin", "neigh_modify once yes"
    box = GAP * len(shapes), GAP, GAP
    return bodies.scene(stand.folder.parent, found, setup, box=box, dt=1.0, name=name, **more)


def _place(k):
    return np.array([GAP * (k + 0.5), GAP / 2, GAP / 2])


def _run(stand, scene, label, steps, every, frames=0):
    """The folder of a run that tells energies, and atoms, every so many steps."""
    more = motion.dump(frames or every)
    return stand.run(scene, label, [steps], dt=1.0, every=every, more=more)[1]


def _each(folder, size):
    """Mass, positions and velocities of each body of so many atoms, in turn."""
    _, mass, x, v = motion.frames(folder)
    for k in range(0, len(mass), size):
        yield mass[k : k + size], x[:, k : k + size], v[:, k : k + size]


def _change(values):
    """The largest relative change since the start."""
    return np.abs(values / values[0] - 1).max()


def _from_exact(k, moment, steps, x):
    """Largest distance of an atom of the k-th top, of `bodies.three_rods`, from where the exact
    motion has it; x: (6, 3) after so many steps."""
    turn = bodies.symmetric_top(ATTITUDE, TURN * SPIN, moment, steps)
    exact = _place(k) + turn.apply(bodies.three_rods(moment)[0])
    return float(np.linalg.norm(x - exact, axis=1).max())


def _kept(stand, moments, labels, steps):
    """Largest change of a body's energy and angular momentum, and distance from the exact motion
    after `COMPARED_AT` steps."""
    shapes = [bodies.three_rods(moment) for moment in moments]
    scene = _row_of(stand, "tops", shapes, [TURN * SPIN] * len(moments))
    every = max(1, steps // 200)
    folder = _run(stand, scene, "run", steps, every)
    k, found = min(steps, COMPARED_AT) // every, []
    for top, (moment, (mass, x, v)) in enumerate(zip(moments, _each(folder, 6))):
        energy, _, momentum = motion.conserved(mass, x, v)
        far = _from_exact(top, moment, k * every, x[k])
        found.append((_change(energy), motion.relative(momentum), far))
    keys = "energy", "angular momentum", "distance from the exact motion, σ,"
    note = ", ".join(
        f"{key} {max(values):.1e} ({labels[int(np.argmax(values))]})"
        for key, values in zip(keys, zip(*found))
    )
    energy, momentum, far = np.max(found, axis=0)
    rounding = criteria.in_a_step(momentum, steps)
    return of_parts({"top's energy": energy, "rounding": rounding, "orientation": far}, note)


@Case.of(
    "needles",
    "Free tops from a sphere to a needle, I₃/I₁ from 1 to 1e-12, 0.05 rad a step.",
    **OF_TOPS,
)
def needles(stand: Stand, steps: int) -> Number:
    """Moments (1, 1, r)."""
    moments = [np.array([1, 1, r]) for r in RATIOS]
    return _kept(stand, moments, [f"I₃/I₁ = {r:g}" for r in RATIOS], steps)


@Case.of(
    "disks",
    "Free tops from a sphere to a disk, (I₁ + I₂ − I₃)/I₃ from 1 to 1e-12, 0.05 rad a step.",
    **OF_TOPS,
)
def disks(stand: Stand, steps: int) -> Number:
    """Moments (1 + t, 1 + t, 2): a ball of six atoms for t = 1."""
    moments = [np.array([1 + t, 1 + t, 2]) for t in RATIOS]
    return _kept(stand, moments, [f"(I₁ + I₂ − I₃)/I₃ = {t:g}" for t in RATIOS], steps)


@Case.of(
    "turn-per-step",
    "The same free top at 19 speeds, |ω|Δt from 1e-8 to 10 rad.",
    10_000,
    1_000_000,
    criterion=f"largest |ω|Δt up to which |ΔE/E| is below (|ω|Δt)² and {SWING}, beside rounding",
    bars="none: the largest of the speeds tried, each √10 times the one before; each run gives the "
    "same every time",
)
def turn_per_step(stand: Stand, steps: int) -> Number:
    """Where (|ω|Δt)² is less than rounding, it is rounding that is judged."""
    off, spin = np.full(len(STEPS), np.inf), bodies.moments(*BENT)[1] @ SPIN
    for some in (np.flatnonzero(STEPS < APART), *np.flatnonzero(STEPS >= APART)[:, None]):
        name = f"tops up to {STEPS[some[-1]]:.2g}"
        shapes, spins = [BENT] * len(some), [STEPS[k] * spin for k in some]
        scene = _row_of(stand, run.folder_name(name), shapes, spins, bonded=True)
        try:
            folder = _run(stand, scene, name, steps, steps // 200)
        except BlowUp:
            continue
        for k, top in zip(some, _each(folder, 3)):
            off[k] = _change(motion.conserved(*top)[0])
    bound = criteria.CRITERIA["speeds' energy"].bound
    allowed = bound * np.minimum(STEPS**2, SWING) + 2 * criteria.rounding(steps)
    borne = int(np.argmin(np.append(off <= allowed, False)))
    words = (f"{value:.1e}" if np.isfinite(value) else "breaks" for value in off)
    told = ", ".join(f"{step:.2g} rad {word}" for step, word in zip(STEPS, words))
    return Number(STEPS[borne - 1] if borne else 0.0, note=f"|ΔE/E| at {told}")


@Case.of(
    "middle-axis",
    "Free tops about the middle axis, which is unstable, tilted from it by 0.1 and 0.001: they "
    "turn over again and again, as Jacobi's elliptic functions tell; 1e6 turns with --full"
    f"{LESS}.",
    10_000,
    1_000_000,
    criterion="larger relative error of the mean time between two turns over, in the last "
    f"{WINDOW} turns",
    bars="from the scatter of the times between two turns over",
    tenth=SLOW,
)
def middle_axis(stand: Stand, turns: int) -> Number:
    """The pace at the end, against the exact one."""
    axes = bodies.moments(*BENT)[1]
    spins = [axes @ (MIDDLE * np.array([tilt, 1.0, tilt])) for tilt in TILTS]
    scene = _row_of(stand, "tops", [BENT] * len(TILTS), spins, bonded=True)
    until, window = (
        round(n * 2 * np.pi / MIDDLE / EVERY) * EVERY for n in (turns - WINDOW, WINDOW)
    )
    how = {"dt": 1.0, "every": max(1, until // 200)}
    more = [f"run {until}", *motion.dump(EVERY)]
    _, folder = stand.run(scene, "run", [window], more=more, **how)
    steps, found = motion.frames(folder)[0], []
    for tilt, (mass, x, v) in zip(TILTS, _each(folder, 3)):
        r = x - np.einsum("i,fij->fj", mass, x)[:, None] / mass.sum()
        shape = bodies.BENT - mass @ bodies.BENT / mass.sum()
        # the axis lies in the plane of the atoms
        weights = np.linalg.lstsq(shape.T, axes[:, 1], rcond=None)[0]
        along = np.einsum("fj,i,fij->f", motion.conserved(mass, x, v)[2], weights, r)
        found.append(_pace(_turns_over(steps, along), exact_interval(tilt)))
    note = "; ".join(f"tilted by {tilt:g}: {number.note}" for tilt, number in zip(TILTS, found))
    return replace(max(found, key=lambda number: number.value), note=note)


def _pace(times, exact):
    """The number of `middle_axis` for one top, of its times of turning over."""
    if len(times) < 3:
        return Number(1.0, note=f"does not turn over at least three times in {WINDOW} turns")
    mean = measures.of_few(np.diff(times) / exact)
    return Number.of(
        mean._replace(value=abs(mean.value - 1)),
        f"{mean.value * exact:.3f} steps at the end, exact {exact:.3f}",
    )


def exact_interval(tilt: float) -> float:
    """Steps between two turns over, half a period of the angular momentum about the middle axis
    (Landau and Lifshitz, Mechanics, section 37)."""
    moments = bodies.moments(*BENT)[0]
    momentum = moments * MIDDLE * np.array([tilt, 1.0, tilt])
    square, twice = momentum @ momentum, (momentum**2 / moments).sum()
    high, middle, low = moments if square >= twice * moments[1] else moments[::-1]
    m = (middle - low) * (twice * high - square) / ((high - middle) * (square - twice * low))
    return 2 * ellipk(m) / np.sqrt((high - middle) * (square - twice * low) / (high * middle * low))


def _turns_over(time, values):
    """Times of changes of sign."""
    k = np.flatnonzero(values[1:] * values[:-1] < 0)
    return time[k] + (time[k + 1] - time[k]) * values[k] / (values[k] - values[k + 1])


CASES = needles, disks, middle_axis, turn_per_step
