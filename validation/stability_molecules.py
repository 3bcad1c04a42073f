"""Molecules from the scenes: how long a step they bear, heat, cold, very many steps.  LAMMPS units ``real``: Angstrom, fs, kcal/mol."""

from dataclasses import replace

import numpy as np

from validation import criteria, measures, motion, paper_peptide, starts
from validation.compare import FS_PER_PS
from validation.criteria import CRITERIA
from validation.scenes import SCENES
from validation.stability import (
    COMPARED,
    EXTREME,
    LESS,
    LINE,
    SLOW,
    Case,
    Number,
    drift_of_starts,
    mean_of_starts,
    of_parts,
)
from validation.stability_tops import kept
from validation.starts import from_dump, to_dump

# of the kinetic energy, that a stable run may gain or lose: of few molecules, of very many
ALLOWED, OF_MANY = CRITERIA["stable, few"].bound, CRITERIA["stable, many"].bound
GIVEN_UP = 10  # times that, by which the energy is off when a run is ended
MOST = 4000  # steps that a step limit of many molecules is worth
LONGEST = "longest {} at which the energy changes by less than {:.0%} of the kinetic energy, from the first to the last fifth of {} (--full: {})"
GRID = (
    "how finely steps were tried, a quarter of the way from the last good one to the first bad one"
)
ONE = f"{GRID}; one start, so what another would give is not in it"
STARTS = 4, criteria.ENOUGH_STARTS  # of a limit, at least and at most
DRIFTS = 1, 8  # of a drift
SOME = f"from the scatter of {STARTS[0]} starts or more, as Student's t has it, and {GRID}"
SAMPLES = 50  # of the energy in a run at one time step
PAPER_DIMER = 0.3  # fs, of the paper's figure 2a, for hydrogens of 0.1 amu
FINE = 1.1  # ratio of one time step to the next
BODIES = 512  # of water
DRIFT = "|drift of the energy| over the mean kinetic energy"
FS_PER_NS = 1000 * FS_PER_PS
SPACING = 2000  # steps between the dimer's starts
HEAVY = (
    "nosquish",
    "gear",
    "rigid/nve",
    "rigid/nve/small",
    "rigid",
    "shake 1e-8",
    "rattle 1e-4",
)  # integrators of the costly cases' short form


def limit(stand, scene, steps_of_time, time, unit=1.0, name=" fs", **how):
    """The time step up to which runs keep their energy: it is never off by `GIVEN_UP` times `ALLOWED` of the kinetic energy, nor differs between the
    first and the last fifth of the run by more than `ALLOWED` of that.

    All time steps are tried in one LAMMPS run, from the shortest, until one breaks it.

    Args:
        scene: a ``Scene``, of the stand's start.  steps_of_time: ascending, in the scene's unit of time.
        time: that each run covers, in that unit.
        unit: that the limit is given in.  name: of it, after a blank.
        how: as ``Stand.run`` has it.
    """
    dts = np.asarray(steps_of_time)
    change, error = changes(stand, scene, f"start {stand.start + 1}", dts, time, ALLOWED, **how)
    stable = change < ALLOWED
    bad = len(dts) if stable.all() else int(np.argmin(stable))
    again = bad + np.flatnonzero(stable[bad:])
    more = f", but again at {dts[again[0]] / unit:.4g}{name}" if len(again) and bad else ""
    return _between(dts / unit, bad, error, more, name)


def halved(stand, scene, steps_of_time, time, allowed, **how):
    """As `limit`, for a costly scene: from one start, of up to `MOST` steps, by bisection, and with a step of half the limit after it.

    If that is bad then the limit is below it.
    """
    dts, tried = np.asarray(steps_of_time), {}

    def bad_at(k):
        if k not in tried:
            (change,), error = changes(
                stand,
                scene,
                f"{dts[k]:g} fs",
                dts[k : k + 1],
                min(time, MOST * dts[k]),
                allowed,
                **how,
            )
            tried[k] = (
                None
                if change < allowed
                else error or f"energy off by {change:.2g} of the kinetic energy"
            )
        return tried[k]

    bad, more = len(dts), ""
    while True:
        good = -1
        while bad - good > 1:
            k = (good + bad) // 2
            good, bad = (good, k) if bad_at(k) else (k, bad)
        half = int(np.searchsorted(dts, dts[max(good, 0)] / 2, side="right")) - 1
        if half < 0:
            break
        if not bad_at(half):
            more += f", good at {dts[half]:g} fs"
            break
        bad, more = half, f", but again at {dts[good]:g} fs"
    return _between(dts, bad, tried.get(bad), more)


def _between(dts, first, error, more, name=" fs"):
    """The limit where ``dts[first]`` is the first bad step."""
    if first == 0:
        return Number(
            0.0,
            0.0,
            f"not even at {dts[0]:.4g}{name}, the shortest step tried"
            + (f": {error}" if error else ""),
        )
    if first == len(dts):
        return Number(
            dts[-1],
            0.0,
            f"stable at {dts[-1]:.4g}{name}, the longest step tried, so no error: the limit is at least that",
        )
    longest, shortest = dts[first - 1], dts[first]
    return Number(
        (shortest + longest) / 2,
        (shortest - longest) / 4,
        f"stable at {longest:.4g}{name}, not at {shortest:.4g}{name}{more}",
    )


def changes(stand, scene, label, dts, time, allowed, **how):
    """By how much of the kinetic energy at the start the energy differs between the first and the last fifth of a run.

    Args:
        dts: time steps, all tried in one LAMMPS run in this order.
        time: that each covers.
        allowed: a run is ended when the energy is off by `GIVEN_UP` times this.
    Returns:
        (time steps,), infinite for a run that is not complete and for those after it; and what ended it.
    """
    counts = np.maximum(SAMPLES, np.round(time / dts).astype(int) // SAMPLES * SAMPLES)
    apart = 2 * int(counts.max())  # between the runs' numbers of steps
    lines = [f'write_dump all custom "{{folder}}/start" id {starts.STATE} modify {starts.EXACT}', "run 0",
             "variable first equal $(etotal)", f"variable most equal $(ke*{GIVEN_UP * allowed})",
             "variable far equal 1-(abs(etotal-v_first)<v_most)"]  # fmt: skip
    for k, (dt, steps) in enumerate(zip(dts, counts), 1):
        every = steps // SAMPLES
        lines += [
            starts.read("{folder}/start", 0), f"reset_timestep {-(-k * apart // every) * every}", f"timestep {dt:.6g}",
            f"thermo {every}", f"fix far all halt {every} v_far > 0.5 error hard", f"run {steps}", "unfix far",
        ]  # fmt: skip
    result, _ = stand.attempt(scene, label, [0], more=lines, dt=dts[0], every=1, **how)
    found = np.full(len(dts), np.inf)
    for k in range(1, len(dts) + 1):
        mine = result.thermo.get("Step", np.empty(0)) // apart == k
        total, kinetic = result.thermo["TotEng"][mine], result.thermo["KinEng"][mine]
        if mine.sum() == SAMPLES + 1 and np.isfinite(total).all():
            fifth = SAMPLES // 5
            found[k - 1] = abs(total[-fifth:].mean() - total[:fifth].mean()) / kinetic[0]
    why = (
        f"energy off by {GIVEN_UP * allowed:g} of the kinetic energy"
        if "Fix halt" in (result.error or "")
        else result.error
    )
    return found, why


def coarse(scene):
    """The scene with a coarser mesh, which stability does not ask for."""
    return scene.on_mesh("1e-4")


def water(stand):
    """Some water, the same for all integrators."""
    return coarse(starts.of_size(SCENES["water"], BODIES, stand.folder.parent / "data"))


def water_dt(stand, length):
    time, between = length
    return halved(
        stand, water(stand), np.arange(0.5, 12.1, between), time, OF_MANY, ranks=stand.ranks
    )


def peptide_dt(stand, length):
    time, between = length
    return halved(
        stand,
        coarse(paper_peptide.scene()),
        np.arange(0.5, 8.1, between),
        time,
        OF_MANY,
        ranks=stand.ranks,
    )


def dimer_of(mass):
    """The dimer with hydrogens of this mass and the kinetic energy that it has with its own."""
    scene = SCENES["dimer"]
    rows = (
        (scene.folder / "data.dimer")
        .read_text()
        .split("Velocities")[1]
        .split("Bonds")[0]
        .splitlines()
    )
    v = np.array([row.split()[1:] for row in rows if row.strip()], float)
    square = (v**2).sum(axis=1).reshape(2, 3).sum(axis=0)
    oxygen, own = 15.9994, 0.1
    before, after = (oxygen * square[0] + m * square[1:].sum() for m in (own, mass))
    faster = [f"variable v{c} atom v{c}*{np.sqrt(before / after):.17g}" for c in "xyz"]
    return replace(
        scene, setup=(*scene.setup, f"mass 2 {mass:g}", *faster, "velocity all set v_vx v_vy v_vz")
    )


def dimer_dt(mass):
    """The case of one mass of hydrogen, amu."""
    root = np.sqrt(mass)  # all times of the rotation scale with it

    def measure(stand, time):
        scene, state = later(stand, dimer_of(mass), SPACING, PAPER_DIMER * root, starts=STARTS)
        return limit(stand, scene, root * FINE ** np.arange(32), root * time, files=[state])

    return Case(
        f"dimer-{mass:g}", f"The bound water dimer with hydrogens of {mass:g} amu, which turn the faster the lighter they are.",
        LONGEST.format("Δt", ALLOWED, f"{1 * root:.1g} ps", f"{25 * root:.2g} ps") + ", a mean over starts",
        SOME, measure, 1 * FS_PER_PS, 25 * FS_PER_PS, starts=STARTS, together=mean_of_starts,
    )  # fmt: skip


def later(stand, scene, steps, dt, *, starts, more=(), **how):
    """The scene so many steps later, as fix_nosquish.NVE moves it, again so many for each further start; the same for all integrators.

    Args:
        starts: of the case, the most of them the second.
        more: LAMMPS commands.  how: as ``Stand.run`` has it.
    Returns:
        the scene of the stand's start, and the file that it is from.
    """
    outer = replace(stand, folder=stand.folder.parent)
    state = (outer.folder / "start" / "state.dump").resolve()
    more = [*more, *to_dump(state, steps)]
    outer.run(
        scene,
        "start",
        [starts[1] * steps],
        integrator=COMPARED["nosquish"],
        dt=dt,
        every=steps // 20,
        more=more,
        **how,
    )
    return from_dump(scene, state, (stand.start + 1) * steps), state


def _change(stand, temperature, time, dt, warm_time, warm_dt, damping):
    """Energy gained or lost per ns, in parts of the mean kinetic energy, by a straight line, after Langevin dynamics."""
    bath = f"fix heat all langevin {temperature} {temperature} {damping} 4928"
    scene, state = later(
        stand,
        water(stand),
        round(warm_time / warm_dt),
        warm_dt,
        starts=DRIFTS,
        more=[bath],
        ranks=stand.ranks,
    )
    result, _ = stand.run(
        scene,
        f"start {stand.start + 1}",
        [round(time / dt)],
        dt=dt,
        every=5,
        ranks=stand.ranks,
        files=[state],
    )
    heat = result.thermo["Temp"]
    slope = measures.drift(result.thermo["Time"] / FS_PER_NS, result.thermo["TotEng"]).times(
        1 / result.thermo["KinEng"].mean()
    )
    return Number(
        slope.value,
        slope.error,
        f"{heat[0]:.3g} K at the start, {heat[-1]:.3g} K at the end",
        slope.freedom,
    )


def water_hot(stand, time):
    return _change(stand, 1500.0, time, 2.0, 200.0, 0.5, 50.0)


def water_cold(stand, time):
    return _change(stand, 1.0, time, 4.0, 10_000.0, 4.0, 200.0)


def long_dimer(stand, steps):
    """Two molecules that stay bound."""
    result, folder = stand.run(
        SCENES["dimer"],
        "run",
        [steps],
        dt=PAPER_DIMER,
        every=max(1, steps // 2000),
        more=motion.dump(steps // 20),
    )
    _, mass, x, v = motion.frames(folder)
    tenth = len(result.thermo["TotEng"]) // 10
    energy = (
        abs(result.thermo["TotEng"][-tenth:].mean() - result.thermo["TotEng"][:tenth].mean())
        / result.thermo["KinEng"].mean()
    )
    _, momentum, angular = motion.conserved(mass, x, v)
    sizes = (
        np.linalg.norm(mass[:, None] * v[0], axis=1).sum(),
        np.linalg.norm(mass[:, None] * np.cross(x[0], v[0]), axis=1).sum(),
    )
    lost = [
        np.linalg.norm(a - a[0], axis=1).max() / size for a, size in zip((momentum, angular), sizes)
    ]
    shape = max(
        np.abs(d / d[0] - 1).max() for d in (motion.distances(x[:, :3]), motion.distances(x[:, 3:]))
    )
    found = {
        "energy": energy,
        "momentum": lost[0],
        "angular momentum": lost[1],
        "|q|, by the distances": shape,
    }
    note = ", ".join(f"{key} {value:.1e}" for key, value in found.items())
    return of_parts({"long run": energy, **kept(stand, steps, max(lost), shape)}, note)


CASES = (
    Case(
        "water-dt", f"{BODIES} TIP3P molecules at 295 K.",
        LONGEST.format("Δt", OF_MANY, "0.2 ps", f"5 ps, or {MOST:,} steps if that is less"),
        ONE, water_dt, (0.2 * FS_PER_PS, 0.5), (5 * FS_PER_PS, 0.25), few=HEAVY,
    ),
    *(dimer_dt(mass) for mass in (1.0, 0.1, 0.01)),
    Case(
        "peptide-dt", "A helix in 1,417 TIP3P molecules, partly rigid, with flexible bonds between the rigid groups.",
        LONGEST.format("Δt", OF_MANY, "0.1 ps", f"5 ps, or {MOST:,} steps if that is less"),
        ONE, peptide_dt, (0.1 * FS_PER_PS, 1.0), (5 * FS_PER_PS, 0.5), few=HEAVY,
    ),
    Case(
        "water-hot", f"{BODIES} TIP3P molecules at 1500 K and 1 g/cm³, 2 fs.", DRIFT, LINE, water_hot, 1.6 * FS_PER_PS, 8 * FS_PER_PS,
        few=HEAVY, starts=DRIFTS, together=drift_of_starts,
    ),
    Case(
        "water-cold", f"{BODIES} TIP3P molecules, cooled to 1 K, 4 fs.", DRIFT, LINE, water_cold, 8 * FS_PER_PS, 10 * FS_PER_PS,
        few=HEAVY, starts=DRIFTS, together=drift_of_starts,
    ),
    Case(
        "long-dimer", f"The bound water dimer at 0.3 fs, in empty space: 1e8 body-steps with --full{LESS}.",
        "largest of: change of the mean energy from the first tenth to the last, in parts of the kinetic energy; relative changes of momenta and of "
        "distances; each over its bound", EXTREME, long_dimer, 200_000, 50_000_000, tenth=SLOW,
    ),
)  # fmt: skip
