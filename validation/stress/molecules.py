"""Molecules from the scenes: longest stable steps, heat, cold, and long runs.  LAMMPS units
``real``: Angstrom, fs, kcal/mol."""

import bisect
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..running import starts as scene_starts
from ..scenes import FS_PER_PS, SCENES, Scene, smooth_water
from ..statistics import measures, motion
from . import criteria
from .measure import (
    COMPARED,
    EXACT,
    LINE,
    Case,
    Number,
    Runner,
    of_parts,
)

ALLOWED = criteria.CRITERIA["stable"].bound  # change of the energy, relative to the kinetic energy
GIVEN_UP = 10  # times that: a larger change ends a run
MOST = 4000  # largest number of steps in a search with many molecules
UP_TO = f"5 ps, or {MOST:,} steps if that is less"
LONGEST = (
    "longest Δt at which the energy changes by less than {:.0%} of the kinetic energy, from the "
    "first to the last fifth of {} (--full: {})"
)
GRID = (
    "how finely steps were tried, a quarter of the way from the last good one to the first bad one"
)
ONE = f"{GRID}; one start, so what another would give is not in it"
STARTS = 8  # of a drift, at most
SAMPLES = 50  # of the energy in a run at one time step
PAPER_DIMER = 0.3  # fs, of the paper's figure 2a, for hydrogens of 0.1 amu
BODIES = 512  # of water
SMOOTH = smooth_water("water", "TIP3P with a smooth cutoff", "water_512", "512", BODIES)
DRIFT = "|drift of the energy| over the mean kinetic energy"
OF_DRIFT = {"criterion": DRIFT, "bars": LINE, "starts": STARTS}


def find_longest_step(runner: Runner, scene: Scene, dts: np.ndarray, time: float, **how) -> Number:
    """Find the time step up to which a `change` in runs of up to `MOST` steps is allowed, by
    bisection; then try half of it.  If that is bad, the limit is below it.

    Args:
        dts: time steps, ascending.  time: that each run covers.
        how: arguments of ``Runner.run``.
    """

    def why(k: int) -> str:
        """Why a step is bad; empty if it is good."""
        off, error = change(runner, scene, dts[k], min(time, MOST * dts[k]), **how)
        reason = error or f"energy off by {off:.2g} of the kinetic energy"
        return "" if off < ALLOWED else reason

    bad = bisect.bisect_left(range(len(dts)), True, key=lambda k: bool(why(k)))
    half = int(np.searchsorted(dts, dts[max(bad - 1, 0)] / 2, side="right")) - 1
    if half >= 0 and why(half):
        return find_longest_step(runner, scene, dts[: half + 1], time, **how)
    return _between(dts, bad, why(bad) if bad < len(dts) else "")


def _between(dts: np.ndarray, first: int, error: str) -> Number:
    """The limit if ``dts[first]`` is the first bad step."""
    if first == 0:
        return Number(0.0, note=f"not even at {dts[0]:.4g} fs, the shortest step tried: {error}")
    longest = dts[first - 1]
    if first == len(dts):
        meaning = "the longest step tried, so no error: the limit is at least that"
        return Number(longest, note=f"stable at {longest:.4g} fs, {meaning}")
    return Number(
        (dts[first] + longest) / 2,
        (dts[first] - longest) / 4,
        f"stable at {longest:.4g} fs, not at {dts[first]:.4g} fs",
    )


def change(runner: Runner, scene: Scene, dt: float, time: float, **how) -> tuple[float, str | None]:
    """The change of the energy from the first to the last fifth of a run, relative to the kinetic
    energy at the start, and why the run ended.  The run ends at `GIVEN_UP` times the allowed
    change; a run that is not complete has an infinite change."""
    every = max(1, round(time / dt) // SAMPLES)
    lines = [
        "run 0",
        "variable first equal $(etotal)",
        f"variable most equal $(ke*{GIVEN_UP * ALLOWED})",
        "variable far equal 1-(abs(etotal-v_first)<v_most)",
        f"fix far all halt {every} v_far > 0.5 error hard",
    ]
    runs, label = [SAMPLES * every], f"{dt:g} fs"
    result, _ = runner.attempt(scene, label, runs, more=lines, dt=dt, every=every, **how)
    fifth, total = SAMPLES // 5, result.thermo["TotEng"]
    if "Fix halt" in (result.error or ""):
        return np.inf, f"energy off by {GIVEN_UP * ALLOWED:g} of the kinetic energy"
    if result.error or not np.isfinite(total).all():
        return np.inf, result.error
    return abs(total[-fifth:].mean() - total[:fifth].mean()) / result.thermo["KinEng"][0], None


def drift(
    runner: Runner, scene: Scene, steps: int, ns: float, every: int, note: str = "", **how
) -> Number:
    """The slope of the energy over the mean kinetic energy, per ns, which is ``ns`` of the scene's
    units of time; the note has places for the temperature at start and end."""
    how = {"dt": scene.dt, **how}
    result, _ = runner.run(scene, f"start {runner.start + 1}", [steps], every=every, **how)
    thermo = result.thermo
    return Number.of(
        measures.drift(thermo["Time"], thermo["TotEng"]).times(ns / thermo["KinEng"].mean()),
        note.format(thermo["Temp"][0], thermo["Temp"][-1]),
    )


def start_later(
    runner: Runner,
    scene: Scene,
    steps: int,
    dt: float,
    more: Iterable[str],
    **how,
) -> tuple[Scene, Path]:
    """The scene of the runner's start, and its file: so many steps later, as ours moves it, and
    again so many for each further start; the same for all integrators."""
    outer = replace(runner, folder=runner.folder.parent)
    state = (outer.folder / "start" / "state.dump").resolve()
    more = [*more, *scene_starts.to_dump(state, steps)]
    how = {"by": COMPARED["nosquish"], "dt": dt, "every": steps // 20, "more": more, **how}
    outer.run(scene, "start", [STARTS * steps], **how)
    return scene_starts.from_dump(scene, state, (runner.start + 1) * steps), state


def coarse(scene: Scene) -> Scene:
    """The scene with a coarser mesh, which stability does not depend on."""
    return scene.on_mesh("1e-4")


def water(runner: Runner) -> Scene:
    """Some water, the same for all integrators."""
    return coarse(scene_starts.of_size(SCENES["water"], BODIES, runner.folder.parent / "data"))


@Case.of(
    "water-dt",
    f"{BODIES} TIP3P molecules at 295 K.",
    [0.2 * FS_PER_PS, 0.5],
    [5 * FS_PER_PS, 0.25],
    criterion=LONGEST.format(ALLOWED, "0.2 ps", UP_TO),
    bars=ONE,
)
def water_dt(runner: Runner, length: list[float]) -> Number:
    """Measure the longest step. Args: length: the time, and the spacing of the steps tried."""
    return find_longest_step(
        runner, water(runner), np.arange(0.5, 12.1, length[1]), length[0], ranks=runner.ranks
    )


def _water_drift(runner, temperature, time, dt, warm_time, warm_dt, damping):
    """The `drift` of water after Langevin dynamics.

    The cutoff is smooth and there is no mesh: the energy change by a mesh of 1e-4 at 1 K, the same
    with all integrators, is a hundred times the bound.
    """
    bath, steps = f"{temperature} {temperature} {damping} 4928", round(warm_time / warm_dt)
    more, how = [f"fix heat all langevin {bath}"], {"ranks": runner.ranks}
    scene, state = start_later(runner, SMOOTH, steps, warm_dt, more, **how)
    how |= {"dt": dt, "files": [state], "note": "{:.3g} K at the start, {:.3g} K at the end"}
    return drift(runner, scene, round(time / dt), 1000 * FS_PER_PS, 5, **how)


@Case.of(
    "water-hot",
    f"{BODIES} TIP3P molecules at 1500 K and 1 g/cm³, smooth cutoff, 2 fs.",
    1.6 * FS_PER_PS,
    40 * FS_PER_PS,
    **OF_DRIFT,
)
def water_hot(runner: Runner, time: float) -> Number:
    """Measure the drift after heating for 0.2 ps."""
    return _water_drift(runner, 1500.0, time, 2.0, 200.0, 0.5, 50.0)


@Case.of(
    "water-cold",
    f"{BODIES} TIP3P molecules, cooled to 1 K, smooth cutoff, 4 fs.",
    8 * FS_PER_PS,
    100 * FS_PER_PS,
    **OF_DRIFT,
)
def water_cold(runner: Runner, time: float) -> Number:
    """Measure the drift after cooling for 10 ps."""
    return _water_drift(runner, 1.0, time, 4.0, 10_000.0, 4.0, 200.0)


@Case.of(
    "long-dimer",
    "The bound water dimer at 0.3 fs, in empty space: 1e8 body-steps with --full.",
    200_000,
    50_000_000,
    criterion="largest of: change of the mean energy from the first tenth to the last, in parts of "
    "the kinetic energy; relative changes of momenta and of distances; each over its bound",
    bars=EXACT,
)
def long_dimer(runner: Runner, steps: int) -> Number:
    """Measure the conservation laws of two molecules that stay bound."""
    result, folder = runner.run(
        SCENES["dimer"],
        "run",
        [steps],
        dt=PAPER_DIMER,
        every=max(1, steps // 2000),
        more=motion.dump(steps // 20),
    )
    energy, kinetic = result.thermo["TotEng"], result.thermo["KinEng"].mean()
    tenth = len(energy) // 10
    heat = abs(energy[-tenth:].mean() - energy[:tenth].mean()) / kinetic
    _, mass, x, v = motion.frames(folder)
    lost, p = [], mass[:, None] * v[0]
    for vectors, each in zip(motion.conserved(mass, x, v)[1:], (p, np.cross(x[0], p))):
        size = np.linalg.norm(each, axis=1).sum()
        lost.append(np.linalg.norm(vectors - vectors[0], axis=1).max() / size)
    pairs = [motion.distances(x[:, atoms]) for atoms in (slice(3), slice(3, None))]
    shape = max(np.abs(d / d[0] - 1).max() for d in pairs)
    keys = "energy", "momentum", "angular momentum", "|q|, by the distances"
    numbers = (f"{key} {value:.1e}" for key, value in zip(keys, (heat, *lost, shape)))
    momenta = criteria.in_a_step(max(lost), steps)
    tolerance = runner.integrator.tolerance or criteria.rounding(steps)
    return of_parts(
        {"long run": heat, "rounding": momenta, "shape": shape / tolerance}, ", ".join(numbers)
    )


CASES = water_dt, water_hot, water_cold, long_dimer
