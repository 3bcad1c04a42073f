"""Free tops: what they keep is known, so is the exact motion.  Reduced units, all bodies of a case in one run."""

from dataclasses import replace

import numpy as np
from scipy.special import ellipk

from validation import criteria, motion, run
from validation import stability_bodies as bodies
from validation.stability import EXTREME, LESS, SLOW, BlowUp, Case, Number, of_parts

TURN = 0.05  # radians in a step, as in practice
SPIN = np.array([0.6, -0.5, 0.7]) / np.linalg.norm(
    [0.6, -0.5, 0.7]
)  # about the principal axes, none of them alone
ATTITUDE = bodies.turned(2002)  # of all tops at the start
COMPARED_AT = 20_000  # steps, 1,000 radians, at which tops are held against the exact motion
RATIOS = 10.0 ** -np.arange(13)
STEPS = 10.0 ** np.arange(-8, 1.01, 0.5)  # radians in a step
APART = 0.2  # radians in a step, from which each speed has a run of its own: it may break it
SWING = 0.1  # of the energy, that a fast top may be off at most
SPLITS = {"sphere": (1, 1, 1), "needle": (1, 1, 0.1), "disk": (1, 1, 1.9)}
SPLIT = 1e-12
MIDDLE, TILTS = (
    0.1,
    (0.1, 1e-3),
)  # radians in a step about the middle axis; parts of the spin about each of the others
WINDOW, EVERY, NEVER = 200, 2, 10**9  # turns; steps between frames in a window, and outside
GAP = 10.0  # between bodies


def _row_of(stand, name, shapes, spins, **more):
    """A scene of bodies side by side, each turned at random.

    Args:
        shapes: list of (positions, masses).  spins: as many angular velocities in the shape's frame.
    """
    found = []
    for k, ((x, mass), spin) in enumerate(zip(shapes, spins)):
        found.append(
            bodies.body(x, mass, place=_place(k), turn=ATTITUDE, spin=ATTITUDE.apply(spin))
        )
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


def _place(k):
    return np.array([GAP * (k + 0.5), GAP / 2, GAP / 2])


def _each(folder, size):
    """Mass, positions and velocities of each body of so many atoms, in turn."""
    _, mass, x, v = motion.frames(folder)
    for k in range(0, len(mass), size):
        yield mass[k : k + size], x[:, k : k + size], v[:, k : k + size]


def _from_exact(k, moment, steps, x):
    """Largest distance of an atom of the k-th top, of `bodies.three_rods`, from where the exact motion has it; x: (6, 3) after so many steps."""
    turn = bodies.symmetric_top(ATTITUDE, TURN * SPIN, moment, steps)
    return float(
        np.linalg.norm(x - _place(k) - turn.apply(bodies.three_rods(moment)[0]), axis=1).max()
    )


def _kept(stand, moments, labels, steps):
    """Largest change of a body's energy and angular momentum, and distance from the exact motion after `COMPARED_AT` steps."""
    scene = _row_of(
        stand,
        "tops",
        [bodies.three_rods(moment) for moment in moments],
        [TURN * SPIN] * len(moments),
    )
    every = max(1, steps // 200)
    _, folder = stand.run(scene, "run", [steps], dt=1.0, every=every, more=motion.dump(every))
    k = min(steps, COMPARED_AT) // every
    found = {"energy": [], "angular momentum": [], "distance from the exact motion, σ,": []}
    for top, (moment, (mass, x, v)) in enumerate(zip(moments, _each(folder, 6))):
        energy, _, momentum = motion.conserved(mass, x, v)
        changes = (
            np.abs(energy / energy[0] - 1).max(),
            motion.relative(momentum),
            _from_exact(top, moment, k * every, x[k]),
        )
        for values, change in zip(found.values(), changes):
            values.append(change)
    note = ", ".join(
        f"{key} {max(values):.1e} ({labels[int(np.argmax(values))]})"
        for key, values in found.items()
    )
    energy, momentum, distance = (max(values) for values in found.values())
    return of_parts(
        {
            "top's energy": energy,
            "rounding": criteria.in_a_step(momentum, steps),
            "orientation": distance,
        },
        note,
    )


def needles(stand, steps):
    """Moments (1, 1, r)."""
    return _kept(
        stand, [np.array([1, 1, r]) for r in RATIOS], [f"I₃/I₁ = {r:g}" for r in RATIOS], steps
    )


def disks(stand, steps):
    """Moments (1 + t, 1 + t, 2): a ball of six atoms for t = 1."""
    return _kept(
        stand,
        [np.array([1 + t, 1 + t, 2]) for t in RATIOS],
        [f"(I₁ + I₂ − I₃)/I₃ = {t:g}" for t in RATIOS],
        steps,
    )


def degenerate(stand, steps):
    """Tops with two or three equal moments, and with moments apart by `SPLIT` in a run of their own: how far from the exact motion, which is that of
    the equal ones but for some 1e-9 σ?"""
    ends, far = [], {}
    for name, split in ("equal", 0.0), ("split", SPLIT):
        shapes = [
            bodies.three_rods(np.array(moment, float) + split * np.array([1, -0.5, 0.3]))
            for moment in SPLITS.values()
        ]
        scene = _row_of(stand, name, shapes, [TURN * SPIN] * len(shapes))
        _, folder = stand.run(scene, name, [steps], dt=1.0, every=0, more=motion.dump(steps))
        ends.append([x[-1] for _, x, _ in _each(folder, 6)])
        for k, (kind, moment) in enumerate(SPLITS.items()):
            far[f"{kind}, {name}"] = _from_exact(k, np.array(moment, float), steps, ends[-1][k])
    apart = max(np.linalg.norm(one - other, axis=1).max() for one, other in zip(*ends))
    told = ", ".join(f"{key} {value:.2g} σ" for key, value in far.items())
    return Number(max(far.values()), note=f"{told}; equal and split are {apart:.1e} σ apart")


def turn_per_step(stand, steps):
    """The largest |ω|Δt up to which the energy is off by no more than (|ω|Δt)², nor `SWING`, beside rounding; where (|ω|Δt)² is less than rounding, it is
    rounding that is judged."""
    off = np.full(len(STEPS), np.inf)
    for some in (np.flatnonzero(STEPS < APART), *np.flatnonzero(STEPS >= APART)[:, None]):
        name = f"tops up to {STEPS[some[-1]]:.2g}"
        shapes, spins = (
            [(bodies.BENT, bodies.MASSES)] * len(some),
            [STEPS[k] * _in_frame(SPIN) for k in some],
        )
        scene = _row_of(stand, run.folder_name(name), shapes, spins, bonded=True)
        try:
            _, folder = stand.run(
                scene, name, [steps], dt=1.0, every=steps // 200, more=motion.dump(steps // 200)
            )
        except BlowUp:
            continue
        for k, (mass, x, v) in zip(some, _each(folder, 3)):
            energy = motion.conserved(mass, x, v)[0]
            off[k] = np.abs(energy / energy[0] - 1).max()
    allowed = criteria.CRITERIA["speeds' energy"].bound * np.minimum(
        STEPS**2, SWING
    ) + 2 * criteria.rounding(steps)
    borne = int(np.argmin(np.append(off <= allowed, False)))
    told = ", ".join(
        f"{step:.2g} rad " + (f"{value:.1e}" if np.isfinite(value) else "breaks")
        for step, value in zip(STEPS, off)
    )
    return Number(STEPS[borne - 1] if borne else 0.0, note=f"|ΔE/E| at {told}")


def _in_frame(spin):
    """From the principal frame of `BENT` to the frame of its coordinates."""
    return bodies.moments(bodies.BENT, bodies.MASSES)[1] @ spin


def middle_axis(stand, turns):
    """How far the phase of tops that turn over again and again has gone, against the exact one.

    Times of turning over are taken in windows of `WINDOW` turns, the first at the start, then up to 1e3, 1e4 ... turns.  How often it has turned over
    between two windows follows from the mean time between two until then; it is sure if the time in the next window says the same number.
    """
    axes = bodies.moments(bodies.BENT, bodies.MASSES)[1]
    spins = [axes @ (MIDDLE * np.array([tilt, 1.0, tilt])) for tilt in TILTS]
    scene = _row_of(stand, "tops", [(bodies.BENT, bodies.MASSES)] * len(TILTS), spins, bonded=True)
    ends = [
        round(end * 2 * np.pi / MIDDLE / EVERY) * EVERY
        for end in (*10.0 ** np.arange(3, np.log10(turns) - 1e-9), turns)
    ]
    window = round(WINDOW * 2 * np.pi / MIDDLE / EVERY) * EVERY
    more = [*motion.dump(EVERY), f"run {window}"]
    for start, end in zip((window, *ends), ends):
        more += [
            f"dump_modify atoms every {NEVER}",
            f"run {end - window - start}",
            f"dump_modify atoms every {EVERY}",
            f"run {window}",
        ]
    _, folder = stand.run(
        scene, "run", [window], dt=1.0, every=max(1, ends[-1] // 200), more=more[:-1]
    )
    at = motion.frames(folder)[0]
    windows = np.split(np.arange(len(at)), 1 + np.flatnonzero(np.diff(at) > EVERY))
    found = []
    for tilt, (mass, x, v) in zip(TILTS, _each(folder, 3)):
        r = x - np.einsum("i,fij->fj", mass, x)[:, None] / mass.sum()
        shape = bodies.BENT - mass @ bodies.BENT / mass.sum()
        weights = np.linalg.lstsq(shape.T, axes[:, 1], rcond=None)[
            0
        ]  # the axis lies in the plane of the atoms
        along = np.einsum("fj,i,fij->f", motion.conserved(mass, x, v)[2], weights, r)
        found.append(
            _phase([_turns_over(at[k], along[k]) for k in windows], exact_interval(tilt), ends[-1])
        )
    worst = max(found, key=lambda one: one.value)
    return replace(
        worst, note="; ".join(f"tilted by {tilt:g}: {one.note}" for tilt, one in zip(TILTS, found))
    )


def _phase(windows, exact, steps):
    """The number of `middle_axis` for one top, of the times of turning over in each window and the exact time between two."""
    if min(len(times) for times in windows) < 3:
        return Number(1.0, note=f"does not turn over at least three times in {WINDOW} turns")
    count, first, last = len(windows[0]) - 1, windows[0][0], windows[0][-1]
    for times in windows[1:]:
        gap = times[0] - last
        between, after = round(gap * count / (last - first)), round(gap / np.diff(times).mean())
        if between != after:
            end = np.diff(windows[-1])
            error = end.std(ddof=1) / np.sqrt(len(end)) / exact
            told = f"by step {times[0]:.0f} of {steps} it has turned over {count + between} or {count + after} times, as its pace changes"
            return Number(
                abs(end.mean() / exact - 1),
                error,
                f"{told}; {end.mean():.3f} steps at the end, exact {exact:.3f}",
            )
        count, last = count + between + len(times) - 1, times[-1]
    mean = (last - first) / count
    error = np.sqrt(2) * np.diff(windows[0]).std(ddof=1) / (last - first)
    told = f"turned over {count} times, the exact top {(last - first) / exact:.1f} times: every {mean:.4f} steps, exact {exact:.4f}"
    return Number(abs(mean / exact - 1), error, told)


def exact_interval(tilt):
    """Time between two turns over, half a period of the angular momentum about the middle axis (Landau and Lifshitz, Mechanics, section 37)."""
    moments = bodies.moments(bodies.BENT, bodies.MASSES)[0]
    momentum = moments * MIDDLE * np.array([tilt, 1.0, tilt])
    square, twice = momentum @ momentum, (momentum**2 / moments).sum()
    high, middle, low = moments if square >= twice * moments[1] else moments[::-1]
    m = (middle - low) * (twice * high - square) / ((high - middle) * (square - twice * low))
    return 2 * ellipk(m) / np.sqrt((high - middle) * (square - twice * low) / (high * middle * low))


def _turns_over(time, values):
    """Times of changes of sign."""
    k = np.flatnonzero(values[1:] * values[:-1] < 0)
    return time[k] + (time[k + 1] - time[k]) * values[k] / (values[k] - values[k + 1])


def long_tops(stand, steps):
    """100 asymmetric tops."""
    rng = np.random.default_rng(6)
    spins = rng.normal(size=(100, 3))
    spins *= TURN / np.linalg.norm(spins, axis=1)[:, None]
    scene = _row_of(stand, "tops", [(bodies.BENT, bodies.MASSES)] * len(spins), spins, bonded=True)
    scene = bodies.drifting(scene, np.array([0.013, -0.021, 0.017]) * TURN)
    _, folder = stand.run(
        scene, "run", [steps], dt=1.0, every=max(1, steps // 200), more=motion.dump(steps // 20)
    )
    worst = {"energy": 0.0, "momentum": 0.0, "angular momentum": 0.0, "|q|, by the distances": 0.0}
    for mass, x, v in _each(folder, 3):
        energy, momentum, angular = motion.conserved(mass, x, v)
        shape = motion.distances(x)
        changes = (
            np.abs(energy / energy[0] - 1).max(),
            motion.relative(momentum),
            motion.relative(angular),
            np.abs(shape / shape[0] - 1).max(),
        )
        worst = {key: max(value, change) for (key, value), change in zip(worst.items(), changes)}
    energy, momentum, angular, shape = worst.values()
    parts = {"top's energy": energy, **kept(stand, steps, max(momentum, angular), shape)}
    return of_parts(parts, ", ".join(f"{key} {value:.1e}" for key, value in worst.items()))


def kept(stand, steps, momenta, shape):
    """Parts of a number: relative changes of momenta and of distances in so many steps."""
    asked = stand.integrator.tolerance or criteria.rounding(steps)
    return {"rounding": criteria.in_a_step(momenta, steps), "shape": shape / asked}


TOPS = "largest of: relative change of energy; that of angular momentum; distance from the exact motion after 1,000 rad; each over its bound"
CASES = (
    Case(
        "needles", "Free tops from a sphere to a needle, I₃/I₁ from 1 to 1e-12, 0.05 rad a step.", TOPS, EXTREME, needles, 20_000, 2_000_000,
    ),
    Case(
        "disks", "Free tops from a sphere to a disk, (I₁ + I₂ − I₃)/I₃ from 1 to 1e-12, 0.05 rad a step.", TOPS, EXTREME, disks, 20_000, 2_000_000,
    ),
    Case(
        "degenerate", "Sphere, needle and disk, and again with moments within 1e-12 of the same, 1,000 rad at 0.05 rad a step.",
        "largest distance of an atom from the exact motion", EXTREME, degenerate, COMPARED_AT, COMPARED_AT,
    ),
    Case(
        "middle-axis", "Free tops about the middle axis, which is unstable, tilted from it by 0.1 and 0.001: they turn over again and again, as Jacobi's "
        f"elliptic functions tell; 1e6 turns with --full{LESS}.",
        "larger relative error of the phase, so of the mean time between two turns over; where their count is not sure, of that time at the end",
        "from the scatter of the times between two turns over in a window",
        middle_axis, 10_000, 1_000_000, tenth=SLOW,
    ),
    Case(
        "turn-per-step", "The same free top at 19 speeds, |ω|Δt from 1e-8 to 10 rad.",
        f"largest |ω|Δt up to which |ΔE/E| is below (|ω|Δt)² and {SWING}, beside rounding",
        "none: the largest of the speeds tried, each √10 times the one before; each run gives the same every time",
        turn_per_step, 10_000, 1_000_000,
    ),
    Case(
        "long-tops", "100 free tops at 0.05 rad a step: 1e6 steps, 1e8 body-steps, with --full.",
        "largest of the relative changes of energy, momenta and distances, each over its bound", EXTREME, long_tops, 20_000, 1_000_000,
    ),
)  # fmt: skip
