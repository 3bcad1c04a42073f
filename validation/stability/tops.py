"""Free tops: what they keep is known, so is the exact motion.  Reduced units, all bodies of a case
in one run."""

from dataclasses import replace

import numpy as np
from scipy.special import ellipk

from ..running import run
from ..scenes import bodies
from ..statistics import motion
from . import criteria
from .measure import EXTREME, LESS, SLOW, BlowUp, Case, Number, Stand, of_parts

TURN = 0.05  # radians in a step, as in practice
# about the principal axes, none of them alone
SPIN = np.array([0.6, -0.5, 0.7]) / np.linalg.norm([0.6, -0.5, 0.7])
ATTITUDE = bodies.turned(2002)  # of all tops at the start
COMPARED_AT = 20_000  # steps, 1,000 radians, at which tops are held against the exact motion
RATIOS = 10.0 ** -np.arange(13)
STEPS = 10.0 ** np.arange(-8, 1.01, 0.5)  # radians in a step
APART = 0.2  # radians in a step, from which each speed has a run of its own: it may break it
SWING = 0.1  # of the energy, that a fast top may be off at most
SPLITS = {"sphere": (1.0, 1.0, 1.0), "needle": (1.0, 1.0, 0.1), "disk": (1.0, 1.0, 1.9)}
SPLIT = 1e-12
# radians in a step about the middle axis; parts of the spin about each of the others
MIDDLE, TILTS = 0.1, (0.1, 1e-3)
WINDOW, EVERY, NEVER = 200, 2, 10**9  # turns; steps between frames in a window, and outside
GAP = 10.0  # between bodies
BENT = bodies.BENT, bodies.MASSES
TOPS = (
    "largest of: relative change of energy; that of angular momentum; distance from the exact "
    "motion after 1,000 rad; each over its bound"
)
OF_TOPS = {"criterion": TOPS, "bars": EXTREME, "short": 20_000, "full": 2_000_000}


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
    scene, every = (
        _row_of(stand, "tops", shapes, [TURN * SPIN] * len(moments)),
        max(1, steps // 200),
    )
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
    "degenerate",
    "Sphere, needle and disk, and again with moments within 1e-12 of the same, 1,000 rad at 0.05 "
    "rad a step.",
    COMPARED_AT,
    COMPARED_AT,
    criterion="largest distance of an atom from the exact motion",
    bars=EXTREME,
)
def degenerate(stand: Stand, steps: int) -> Number:
    """The exact motion of both is that of the equal ones, but for some 1e-9 σ."""
    ends, far = [], {}
    for name, split in ("equal", 0.0), ("split", SPLIT):
        apart = split * np.array([1, -0.5, 0.3])
        shapes = [bodies.three_rods(np.array(moment) + apart) for moment in SPLITS.values()]
        scene = _row_of(stand, name, shapes, [TURN * SPIN] * len(shapes))
        folder = _run(stand, scene, name, steps, 0, frames=steps)
        ends.append([x[-1] for _, x, _ in _each(folder, 6)])
        for k, (kind, moment) in enumerate(SPLITS.items()):
            far[f"{kind}, {name}"] = _from_exact(k, np.array(moment), steps, ends[-1][k])
    apart = max(np.linalg.norm(one - other, axis=1).max() for one, other in zip(*ends))
    told = ", ".join(f"{key} {value:.2g} σ" for key, value in far.items())
    return Number(max(far.values()), note=f"{told}; equal and split are {apart:.1e} σ apart")


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
    criterion="larger relative error of the phase, so of the mean time between two turns over; "
    "where their count is not sure, of that time at the end",
    bars="from the scatter of the times between two turns over in a window",
    tenth=SLOW,
)
def middle_axis(stand: Stand, turns: int) -> Number:
    """How far the phase has gone, against the exact one.

    Times of turning over are taken in windows of `WINDOW` turns, the first at the start, then up to
    1e3, 1e4 ... turns.  How often it has turned over between two windows follows from the mean time
    between two until then; it is sure if the time in the next window says the same number.
    """
    axes = bodies.moments(*BENT)[1]
    spins = [axes @ (MIDDLE * np.array([tilt, 1.0, tilt])) for tilt in TILTS]
    scene = _row_of(stand, "tops", [BENT] * len(TILTS), spins, bonded=True)
    at = WINDOW, *10.0 ** np.arange(3, np.log10(turns) - 1e-9), turns
    window, *ends = (round(one * 2 * np.pi / MIDDLE / EVERY) * EVERY for one in at)
    more = [*motion.dump(EVERY), f"run {window}"]
    for start, end in zip((window, *ends), ends):
        more += [f"dump_modify atoms every {NEVER}", f"run {end - window - start}"]
        more += [f"dump_modify atoms every {EVERY}", f"run {window}"]
    every = max(1, ends[-1] // 200)
    _, folder = stand.run(scene, "run", [window], dt=1.0, every=every, more=more[:-1])
    steps = motion.frames(folder)[0]
    windows = np.split(np.arange(len(steps)), 1 + np.flatnonzero(np.diff(steps) > EVERY))
    found = []
    for tilt, (mass, x, v) in zip(TILTS, _each(folder, 3)):
        r = x - np.einsum("i,fij->fj", mass, x)[:, None] / mass.sum()
        shape = bodies.BENT - mass @ bodies.BENT / mass.sum()
        # the axis lies in the plane of the atoms
        weights = np.linalg.lstsq(shape.T, axes[:, 1], rcond=None)[0]
        along = np.einsum("fj,i,fij->f", motion.conserved(mass, x, v)[2], weights, r)
        times = [_turns_over(steps[k], along[k]) for k in windows]
        found.append(_phase(times, exact_interval(tilt), ends[-1]))
    note = "; ".join(f"tilted by {tilt:g}: {one.note}" for tilt, one in zip(TILTS, found))
    return replace(max(found, key=lambda one: one.value), note=note)


def _phase(windows, exact, steps):
    """The number of `middle_axis` for one top, of the times of turning over in each window and the
    exact time between two."""
    if min(len(times) for times in windows) < 3:
        return Number(1.0, note=f"does not turn over at least three times in {WINDOW} turns")
    count, first, last = len(windows[0]) - 1, windows[0][0], windows[0][-1]
    for times in windows[1:]:
        gap = times[0] - last
        between, after = round(gap * count / (last - first)), round(gap / np.diff(times).mean())
        if between != after:
            end = np.diff(windows[-1])
            error = end.std(ddof=1) / np.sqrt(len(end)) / exact
            note = (
                f"by step {times[0]:.0f} of {steps} it has turned over {count + between} or "
                f"{count + after} times, as its pace changes; {end.mean():.3f} steps at the end, "
                f"exact {exact:.3f}"
            )
            return Number(abs(end.mean() / exact - 1), error, note)
        count, last = count + between + len(times) - 1, times[-1]
    mean = (last - first) / count
    error = np.sqrt(2) * np.diff(windows[0]).std(ddof=1) / (last - first)
    note = (
        f"turned over {count} times, the exact top {(last - first) / exact:.1f} times: every "
        f"{mean:.4f} steps, exact {exact:.4f}"
    )
    return Number(abs(mean / exact - 1), error, note)


def exact_interval(tilt: float) -> float:
    """Time between two turns over, half a period of the angular momentum about the middle axis
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


@Case.of(
    "long-tops",
    "100 free tops at 0.05 rad a step: 1e6 steps, 1e8 body-steps, with --full.",
    20_000,
    1_000_000,
    criterion="largest of the relative changes of energy, momenta and distances, each over its "
    "bound",
    bars=EXTREME,
)
def long_tops(stand: Stand, steps: int) -> Number:
    """All asymmetric."""
    spins = np.random.default_rng(6).normal(size=(100, 3))
    spins *= TURN / np.linalg.norm(spins, axis=1)[:, None]
    scene = _row_of(stand, "tops", [BENT] * len(spins), spins, bonded=True)
    scene = bodies.drifting(scene, np.array([0.013, -0.021, 0.017]) * TURN)
    folder, found = _run(stand, scene, "run", steps, max(1, steps // 200), steps // 20), []
    for mass, x, v in _each(folder, 3):
        energy, *momenta = motion.conserved(mass, x, v)
        shape = _change(motion.distances(x))
        found.append((_change(energy), *map(motion.relative, momenta), shape))
    energy, momentum, angular, shape = worst = np.max(found, axis=0)
    keys = "energy", "momentum", "angular momentum", "|q|, by the distances"
    note = ", ".join(f"{key} {value:.1e}" for key, value in zip(keys, worst))
    parts = {"top's energy": energy, **kept(stand, steps, max(momentum, angular), shape)}
    return of_parts(parts, note)


def kept(stand: Stand, steps: int, momenta: float, shape: float) -> dict[str, float]:
    """Parts of a number: relative changes of momenta and of distances in so many steps."""
    asked = stand.integrator.tolerance or criteria.rounding(steps)
    return {"rounding": criteria.in_a_step(momenta, steps), "shape": shape / asked}


CASES = needles, disks, degenerate, middle_axis, turn_per_step, long_tops
