"""Molecules from the scenes: how long a step they bear, heat, cold, very many steps.  LAMMPS units
``real``: Angstrom, fs, kcal/mol."""

import bisect
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..running import starts as scene_starts
from ..scenes import FS_PER_PS, SCENES, Scene, smooth_water
from ..scenes import peptide as paper_peptide
from ..statistics import measures, motion
from . import criteria
from .measure import (
    COMPARED,
    EXACT,
    LESS,
    LINE,
    SLOW,
    Case,
    Number,
    Stand,
    drift_of_starts,
    mean_of_starts,
    of_parts,
)

# of the kinetic energy, that a stable run may gain or lose: of few molecules, of very many
ALLOWED = criteria.CRITERIA["stable, few"].bound
OF_MANY = criteria.CRITERIA["stable, many"].bound
GIVEN_UP = 10  # times that, by which the energy is off when a run is ended
MOST = 4000  # steps that a step limit of many molecules is worth
UP_TO = f"5 ps, or {MOST:,} steps if that is less"
LONGEST = (
    "longest Δt at which the energy changes by less than {:.0%} of the kinetic energy, from the "
    "first to the last fifth of {} (--full: {})"
)
GRID = (
    "how finely steps were tried, a quarter of the way from the last good one to the first bad one"
)
ONE = f"{GRID}; one start, so what another would give is not in it"
STARTS = 4, 19  # of a limit, at least and at most
DRIFTS = 1, 8  # of a drift
SOME = f"from the scatter of {STARTS[0]} starts or more, as Student's t has it, and {GRID}"
SAMPLES = 50  # of the energy in a run at one time step
PAPER_DIMER = 0.3  # fs, of the paper's figure 2a, for hydrogens of 0.1 amu
FINE = 1.1  # ratio of one time step to the next
BODIES = 512  # of water
SMOOTH = smooth_water("water", "TIP3P with a smooth cutoff", "water_512", "512", BODIES)
DRIFT = "|drift of the energy| over the mean kinetic energy"
OF_DRIFT = {"criterion": DRIFT, "bars": LINE, "starts": DRIFTS, "together": drift_of_starts}
OF_STEP = {"starts": STARTS, "together": mean_of_starts, "bars": SOME}
SPACING = 2000  # steps between the dimer's starts
# integrators of the costly cases' short form
HEAVY = ("nosquish", "gear", "rigid/nve", "rigid/nve/small", "rigid", "shake 1e-8", "rattle 1e-4")


def limit(stand: Stand, scene: Scene, dts: np.ndarray, time: float, **how) -> Number:
    """The time step up to which runs keep their energy: it is never off by `GIVEN_UP` times
    `ALLOWED` of the kinetic energy, nor differs between the first and the last fifth of the run by
    more than `ALLOWED` of that.  All are tried in one LAMMPS run, until one breaks it.

    Args:
        scene: of the stand's start.  dts: time steps, ascending.  time: that each run covers.
        how: as ``Stand.run`` has it.
    """
    change, error = changes(stand, scene, f"start {stand.start + 1}", dts, time, ALLOWED, **how)
    bad = int(np.argmin(np.append(change < ALLOWED, False)))
    return _between(dts, bad, error or "energy off")


def halved(stand: Stand, scene: Scene, dts: np.ndarray, time: float, **how) -> Number:
    """As `limit`, of many molecules, which cost more: from one start, of up to `MOST` steps, by
    bisection, and with a step of half the limit after it; if that is bad then the limit is below
    it."""

    def why(k: int) -> str:
        """Why a step is bad; empty if it is good."""
        label, until = f"{dts[k]:g} fs", min(time, MOST * dts[k])
        (off,), error = changes(stand, scene, label, dts[k : k + 1], until, OF_MANY, **how)
        told = error or f"energy off by {off:.2g} of the kinetic energy"
        return "" if off < OF_MANY else told

    bad = bisect.bisect_left(range(len(dts)), True, key=lambda k: bool(why(k)))
    half = int(np.searchsorted(dts, dts[max(bad - 1, 0)] / 2, side="right")) - 1
    if half >= 0 and why(half):
        return halved(stand, scene, dts[: half + 1], time, **how)
    return _between(dts, bad, why(bad) if bad < len(dts) else "")


def _between(dts: np.ndarray, first: int, error: str) -> Number:
    """The limit where ``dts[first]`` is the first bad step."""
    if first == 0:
        return Number(0.0, note=f"not even at {dts[0]:.4g} fs, the shortest step tried: {error}")
    longest = dts[first - 1]
    if first == len(dts):
        told = "the longest step tried, so no error: the limit is at least that"
        return Number(longest, note=f"stable at {longest:.4g} fs, {told}")
    return Number(
        (dts[first] + longest) / 2,
        (dts[first] - longest) / 4,
        f"stable at {longest:.4g} fs, not at {dts[first]:.4g} fs",
    )


def changes(
    stand: Stand, scene: Scene, label: str, dts: np.ndarray, time: float, allowed: float, **how
) -> tuple[np.ndarray, str | None]:
    """By how much of the kinetic energy at the start the energy differs between the first and the
    last fifth of runs, one for each time step, in one LAMMPS run that ends when the energy is off
    by `GIVEN_UP` times what is allowed.  Infinite where one is not complete; and what ended it."""
    counts = np.maximum(SAMPLES, np.round(time / dts).astype(int) // SAMPLES * SAMPLES)
    apart = 2 * int(counts.max())  # between the runs' numbers of steps
    state = f"id {scene_starts.STATE} modify {scene_starts.EXACT}"
    lines = [
        f'write_dump all custom "{{folder}}/start" {state}',
        "run 0",
        "variable first equal $(etotal)",
        f"variable most equal $(ke*{GIVEN_UP * allowed})",
        "variable far equal 1-(abs(etotal-v_first)<v_most)",
    ]
    for k, (dt, steps) in enumerate(zip(dts, counts), 1):
        every = steps // SAMPLES
        begin = -(-k * apart // every) * every
        lines += [
            scene_starts.read("{folder}/start", 0),
            f"reset_timestep {begin}",
            f"timestep {dt:.6g}",
            f"thermo {every}",
            f"fix far all halt {every} v_far > 0.5 error hard",
            f"run {steps}",
            "unfix far",
        ]
    result, _ = stand.attempt(scene, label, [0], more=lines, dt=dts[0], every=1, **how)
    found, fifth = np.full(len(dts), np.inf), SAMPLES // 5
    for k in range(1, len(dts) + 1):
        mine = result.thermo.get("Step", np.empty(0)) // apart == k
        total, kinetic = result.thermo["TotEng"][mine], result.thermo["KinEng"][mine]
        if mine.sum() == SAMPLES + 1 and np.isfinite(total).all():
            found[k - 1] = abs(total[-fifth:].mean() - total[:fifth].mean()) / kinetic[0]
    if "Fix halt" in (result.error or ""):
        return found, f"energy off by {GIVEN_UP * allowed:g} of the kinetic energy"
    return found, result.error


def drift(
    stand: Stand, scene: Scene, steps: int, ns: float, every: int, note: str = "", **how
) -> Number:
    """Change of the energy, by a straight line, over the mean kinetic energy, per ns, which is so
    many of the scene's units of time; the note has places for the temperature at start and end."""
    how = {"dt": scene.dt, **how}
    result, _ = stand.run(scene, f"start {stand.start + 1}", [steps], every=every, **how)
    thermo = result.thermo
    slope = measures.drift(thermo["Time"], thermo["TotEng"]).times(ns / thermo["KinEng"].mean())
    return Number.of(slope, note.format(thermo["Temp"][0], thermo["Temp"][-1]))


def later(
    stand: Stand,
    scene: Scene,
    steps: int,
    dt: float,
    starts: tuple[int, int],
    more: Iterable[str] = (),
    **how,
) -> tuple[Scene, Path]:
    """The scene of the stand's start, and the file that it is from: so many steps later, as
    fix_nosquish.NVE moves it, again so many for each further start; the same for all integrators.
    The most starts of the case are the second of ``starts``."""
    outer = replace(stand, folder=stand.folder.parent)
    state = (outer.folder / "start" / "state.dump").resolve()
    more = [*more, *scene_starts.to_dump(state, steps)]
    how = {"by": COMPARED["nosquish"], "dt": dt, "every": steps // 20, "more": more, **how}
    outer.run(scene, "start", [starts[1] * steps], **how)
    return scene_starts.from_dump(scene, state, (stand.start + 1) * steps), state


def coarse(scene: Scene) -> Scene:
    """The scene with a coarser mesh, which stability does not ask for."""
    return scene.on_mesh("1e-4")


def water(stand: Stand) -> Scene:
    """Some water, the same for all integrators."""
    folder = stand.folder.parent / "data"
    return coarse(scene_starts.of_size(SCENES["water"], BODIES, folder))


@Case.of(
    "water-dt",
    f"{BODIES} TIP3P molecules at 295 K.",
    [0.2 * FS_PER_PS, 0.5],
    [5 * FS_PER_PS, 0.25],
    criterion=LONGEST.format(OF_MANY, "0.2 ps", UP_TO),
    bars=ONE,
    few=HEAVY,
)
def water_dt(stand: Stand, length: list[float]) -> Number:
    """Of the length the time, and between two steps tried."""
    steps = np.arange(0.5, 12.1, length[1])
    return halved(stand, water(stand), steps, length[0], ranks=stand.ranks)


@Case.of(
    "peptide-dt",
    "A helix in 1,417 TIP3P molecules, partly rigid, with flexible bonds between the rigid groups.",
    [0.1 * FS_PER_PS, 1.0],
    [5 * FS_PER_PS, 0.5],
    criterion=LONGEST.format(OF_MANY, "0.1 ps", UP_TO),
    bars=ONE,
    few=HEAVY,
)
def peptide_dt(stand: Stand, length: list[float]) -> Number:
    """As `water_dt`."""
    scene, steps = coarse(paper_peptide.scene()), np.arange(0.5, 8.1, length[1])
    return halved(stand, scene, steps, length[0], ranks=stand.ranks)


def dimer_of(mass: float) -> Scene:
    """The dimer with hydrogens of this mass and the kinetic energy that it has with its own."""
    scene, oxygen, own = SCENES["dimer"], 15.9994, 0.1
    text = (scene.folder / "data.dimer").read_text().split("Velocities")[1].split("Bonds")[0]
    v = np.array([row.split()[1:] for row in text.splitlines() if row.strip()], float)
    square = (v**2).sum(axis=1).reshape(2, 3).sum(axis=0)
    before, after = (oxygen * square[0] + m * square[1:].sum() for m in (own, mass))
    faster = [f"variable v{c} atom v{c}*{np.sqrt(before / after):.17g}" for c in "xyz"]
    more = f"mass 2 {mass:g}", *faster, "velocity all set v_vx v_vy v_vz"
    return replace(scene, setup=(*scene.setup, *more))


def dimer_dt(mass: float) -> Case:
    """The case of one mass of hydrogen, amu."""
    root = np.sqrt(mass)  # all times of the rotation scale with it
    times = f"{1 * root:.1g} ps", f"{25 * root:.2g} ps"

    @Case.of(
        f"dimer-{mass:g}",
        f"The bound water dimer with hydrogens of {mass:g} amu, which turn the faster the lighter "
        "they are.",
        1 * FS_PER_PS,
        25 * FS_PER_PS,
        criterion=LONGEST.format(ALLOWED, *times) + ", a mean over starts",
        **OF_STEP,
    )
    def measure(stand, time):
        scene, state = later(stand, dimer_of(mass), SPACING, PAPER_DIMER * root, STARTS)
        return limit(stand, scene, root * FINE ** np.arange(32), root * time, files=[state])

    return measure


def _water_drift(stand, temperature, time, dt, warm_time, warm_dt, damping):
    """Its `drift` after Langevin dynamics.

    The cutoff is smooth and there is no mesh: what a mesh of 1e-4 takes from the energy at 1 K, the
    same with all integrators, is a hundred times the bound.
    """
    bath, steps = f"{temperature} {temperature} {damping} 4928", round(warm_time / warm_dt)
    more, how = [f"fix heat all langevin {bath}"], {"ranks": stand.ranks}
    scene, state = later(stand, SMOOTH, steps, warm_dt, DRIFTS, more, **how)
    how |= {"dt": dt, "files": [state], "note": "{:.3g} K at the start, {:.3g} K at the end"}
    return drift(stand, scene, round(time / dt), 1000 * FS_PER_PS, 5, **how)


@Case.of(
    "water-hot",
    f"{BODIES} TIP3P molecules at 1500 K and 1 g/cm³, smooth cutoff, 2 fs.",
    1.6 * FS_PER_PS,
    40 * FS_PER_PS,
    few=HEAVY,
    **OF_DRIFT,
)
def water_hot(stand: Stand, time: float) -> Number:
    """Heated for 0.2 ps."""
    return _water_drift(stand, 1500.0, time, 2.0, 200.0, 0.5, 50.0)


@Case.of(
    "water-cold",
    f"{BODIES} TIP3P molecules, cooled to 1 K, smooth cutoff, 4 fs.",
    8 * FS_PER_PS,
    100 * FS_PER_PS,
    few=HEAVY,
    **OF_DRIFT,
)
def water_cold(stand: Stand, time: float) -> Number:
    """Cooled for 10 ps."""
    return _water_drift(stand, 1.0, time, 4.0, 10_000.0, 4.0, 200.0)


@Case.of(
    "long-dimer",
    f"The bound water dimer at 0.3 fs, in empty space: 1e8 body-steps with --full{LESS}.",
    200_000,
    50_000_000,
    criterion="largest of: change of the mean energy from the first tenth to the last, in parts of "
    "the kinetic energy; relative changes of momenta and of distances; each over its bound",
    bars=EXACT,
    tenth=SLOW,
)
def long_dimer(stand: Stand, steps: int) -> Number:
    """Two molecules that stay bound."""
    result, folder = stand.run(
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
    pairs = [motion.distances(x[:, some]) for some in (slice(3), slice(3, None))]
    shape = max(np.abs(d / d[0] - 1).max() for d in pairs)
    keys = "energy", "momentum", "angular momentum", "|q|, by the distances"
    told = (f"{key} {value:.1e}" for key, value in zip(keys, (heat, *lost, shape)))
    momenta = criteria.in_a_step(max(lost), steps)
    asked = stand.integrator.tolerance or criteria.rounding(steps)
    parts = {"long run": heat, "rounding": momenta, "shape": shape / asked}
    return of_parts(parts, ", ".join(told))


DIMERS = tuple(dimer_dt(mass) for mass in (1.0, 0.1, 0.01))
CASES = water_dt, *DIMERS, peptide_dt, water_hot, water_cold, long_dimer
