"""Molecules from the scenes: how long a step they bear, heat, cold, very many steps.  LAMMPS units ``real``: Angstrom, fs, kcal/mol."""

from dataclasses import replace

import numpy as np

from validation import measures, motion, paper_peptide, starts
from validation.compare import FS_PER_PS
from validation.scenes import SCENES
from validation.stability import COMPARED, EXTREME, LINE, Case, Number

ALLOWED, OF_MANY = 0.1, 0.02  # of the kinetic energy, that a stable run may gain or lose: of few molecules, of very many
LONGEST = "longest Δt at which the energy changes by less than {:.0%} of the kinetic energy"
TRIED = "how finely steps were tried: a quarter of the way from the last good one to the first bad one; each run gives the same every time"
SAMPLES = 50  # of the energy in a run at one time step
PAPER_DIMER = 0.3  # fs, of the paper's figure 2a, for hydrogens of 0.1 amu
FINE = 1.1  # ratio of one time step to the next
RANKS = 2
HEAVY = "nosquish", "gear", "rigid/nve", "rigid/nve/small", "rigid", "shake 1e-8", "rattle 1e-4"  # integrators of the costly cases' short form


def limit(stand, scene, steps_of_time, time, allowed=ALLOWED, **how):
    """The time step up to which runs from one start keep their energy: it is never off by the kinetic energy, nor differs between the first and
    the last fifth of the run by more than a part of that.

    All time steps are tried in one LAMMPS run, from the shortest, until one breaks it.

    Args:
        scene: a ``Scene``.  steps_of_time: ascending, fs.
        time: that each covers, fs.
        allowed: that part.
    """
    dts = np.asarray(steps_of_time)
    stable, error = _stable(stand, scene, "limit", dts, time, allowed, **how)
    first = stable.index(False) if False in stable else len(dts)
    again = f", but again at {dts[first + stable[first:].index(True)]:.4g} fs" if any(stable[first:]) else ""
    return _between(dts, first, error, again if first else "")


def halved(stand, scene, steps_of_time, time, allowed, **how):
    """As `limit`, for a costly scene: by bisection, for which a step that is longer than a bad one is bad."""
    dts, good, bad, why = np.asarray(steps_of_time), -1, len(steps_of_time), None
    while bad - good > 1:
        k = (good + bad) // 2
        (stable,), error = _stable(stand, scene, f"{dts[k]:g} fs", dts[k : k + 1], time, allowed, **how)
        good, bad, why = (k, bad, why) if stable else (good, k, error)
    return _between(dts, bad, why, ", by bisection")


def _between(dts, first, error, more):
    """The limit where ``dts[first]`` is the first bad step."""
    if first == 0:
        return Number(dts[0] / 2, dts[0] / 4, f"not at {dts[0]:g} fs" + (f": {error}" if error else ""))
    if first == len(dts):
        return Number(dts[-1], 0.0, "the longest step tried, so no error: the limit is at least that")
    longest, shortest = dts[first - 1], dts[first]
    return Number((shortest + longest) / 2, (shortest - longest) / 4, f"stable at {longest:.4g} fs, not at {shortest:.4g} fs{more}")


def _stable(stand, scene, label, dts, time, allowed, **how):
    """Whether each of these time steps is good, a list, and what ended the run if something did."""
    counts = np.maximum(SAMPLES, np.round(time / dts).astype(int) // SAMPLES * SAMPLES)
    apart = 2 * int(counts.max())  # between the runs' numbers of steps
    lines = [f'write_dump all custom "{{folder}}/start" id {starts.STATE} modify {starts.EXACT}', "run 0",
             "variable first equal $(etotal)", "variable most equal $(ke)",
             "variable far equal 1-(abs(etotal-v_first)<v_most)"]  # fmt: skip
    for k, (dt, steps) in enumerate(zip(dts, counts), 1):
        every = steps // SAMPLES
        lines += [
            starts.read("{folder}/start", 0), f"reset_timestep {-(-k * apart // every) * every}", f"timestep {dt:.6g}",
            f"thermo {every}", f"fix far all halt {every} v_far > 0.5 error hard", f"run {steps}", "unfix far",
        ]  # fmt: skip
    result, _ = stand.attempt(scene, label, [0], more=lines, dt=dts[0], every=1, **how)
    stable = []
    for k in range(1, len(dts) + 1):
        mine = result.thermo.get("Step", np.empty(0)) // apart == k
        total, kinetic = result.thermo["TotEng"][mine], result.thermo["KinEng"][mine]
        whole, fifth = mine.sum() == SAMPLES + 1, SAMPLES // 5
        stable.append(bool(whole and abs(total[-fifth:].mean() - total[:fifth].mean()) < allowed * kinetic[0]))
    return stable, result.error


def coarse(scene):
    """The scene with a coarser mesh, which stability does not ask for."""
    return replace(scene, setup=("variable kspace_accuracy index 1e-4", *scene.setup))  # the first definition is kept


def water_dt(stand, length):
    time, between = length
    return halved(stand, coarse(SCENES["water"]), np.arange(5.0, 12.1, between), time, OF_MANY, ranks=RANKS)


def peptide_dt(stand, length):
    time, between = length
    return halved(stand, coarse(paper_peptide.scene()), np.arange(2.0, 8.1, between), time, OF_MANY, ranks=RANKS)


def dimer_of(mass):
    """The dimer with hydrogens of this mass and the kinetic energy that it has with its own."""
    scene = SCENES["dimer"]
    rows = (scene.folder / "data.dimer").read_text().split("Velocities")[1].split("Bonds")[0].splitlines()
    v = np.array([row.split()[1:] for row in rows if row.strip()], float)
    square = (v**2).sum(axis=1).reshape(2, 3).sum(axis=0)
    oxygen, own = 15.9994, 0.1
    before, after = (oxygen * square[0] + m * square[1:].sum() for m in (own, mass))
    faster = [f"variable v{c} atom v{c}*{np.sqrt(before / after):.17g}" for c in "xyz"]
    return replace(scene, setup=(*scene.setup, f"mass 2 {mass:g}", *faster, "velocity all set v_vx v_vy v_vz"))


def dimer_dt(mass):
    """The case of one mass of hydrogen, amu."""
    root = np.sqrt(mass)  # all times of the rotation scale with it

    def measure(stand, time):
        return limit(stand, dimer_of(mass), root * FINE ** np.arange(32), root * time)

    return Case(
        f"dimer-{mass:g}", f"The bound water dimer with hydrogens of {mass:g} amu, which turn the faster the lighter they are.",
        LONGEST.format(ALLOWED), "fs",
        "rigid TIP3P is known to run at 6 fs for long (Silveira and Abreu 2019); times of the rotation go with the root of the mass",
        TRIED, measure, 2 * FS_PER_PS, 200 * FS_PER_PS, low=round(6.0 * root, 2),
    )  # fmt: skip


def _warmed(stand, temperature, time, dt, damping):
    """Water after some Langevin dynamics with fix_nosquish.NVE, the same for all integrators: the scene with these atoms, and their file."""
    scene = coarse(SCENES["water"])
    steps = round(time / dt)
    outer = replace(stand, folder=stand.folder.parent)
    state = (outer.folder / "start" / "state.dump").resolve()
    more = [f"fix heat all langevin {temperature} {temperature} {damping} 4928", *starts.to_dump(state, steps)]
    outer.run(scene, "start", [steps], integrator=COMPARED["nosquish"], dt=dt, every=100, ranks=RANKS, more=more)
    return starts.from_dump(scene, state, steps), state


def _change(stand, temperature, time, dt, warm):
    """Energy gained or lost per ps, in parts of the kinetic energy, by a straight line."""
    scene, state = _warmed(stand, temperature, *warm)
    result, _ = stand.run(scene, "run", [round(time / dt)], dt=dt, every=5, ranks=RANKS, files=[state])
    kinetic = result.thermo["KinEng"].mean()
    slope, error = measures.drift(result.thermo["Time"] / FS_PER_PS, result.thermo["TotEng"])
    return Number(abs(slope) / kinetic, error / kinetic, f"at {result.thermo['Temp'].mean():.3g} K")


def water_hot(stand, time):
    return _change(stand, 1500.0, time, 1.0, (200.0, 0.5, 50.0))


def water_cold(stand, time):
    return _change(stand, 1.0, time, 2.0, (10_000.0, 4.0, 200.0))


def long_dimer(stand, steps):
    """Energy over 1 % of the kinetic energy, momenta over 1e-9, distances over 1e-7."""
    result, folder = stand.run(SCENES["dimer"], "run", [steps], dt=PAPER_DIMER, every=max(1, steps // 2000), more=motion.dump(steps // 20))
    _, mass, x, v = motion.frames(folder)
    tenth = len(result.thermo["TotEng"]) // 10
    energy = abs(result.thermo["TotEng"][-tenth:].mean() - result.thermo["TotEng"][:tenth].mean()) / result.thermo["KinEng"].mean()
    _, momentum, angular = motion.conserved(mass, x, v)
    sizes = np.linalg.norm(mass[:, None] * v[0], axis=1).sum(), np.linalg.norm(mass[:, None] * np.cross(x[0], v[0]), axis=1).sum()
    lost = [np.linalg.norm(a - a[0], axis=1).max() / size for a, size in zip((momentum, angular), sizes)]
    shape = max(np.abs(d / d[0] - 1).max() for d in (motion.distances(x[:, :3]), motion.distances(x[:, 3:])))
    found = {"energy": (energy, 1e-2), "momentum": (lost[0], 1e-9), "angular momentum": (lost[1], 1e-9), "|q|, by the distances": (shape, 1e-7)}
    note = ", ".join(f"{key} {value:.1e}" for key, (value, _) in found.items())
    return Number(max(value / bound for value, bound in found.values()), note=note)


CASES = (
    Case(
        "water-dt", "1,000 TIP3P molecules at 295 K.", LONGEST.format(OF_MANY), "fs",
        "rigid TIP3P is known to run at 6 fs for long (Silveira and Abreu 2019)",
        TRIED, water_dt, (0.2 * FS_PER_PS, 0.5), (10 * FS_PER_PS, 0.25), low=6.0, few=HEAVY,
    ),
    *(dimer_dt(mass) for mass in (1.0, 0.1, 0.01)),
    Case(
        "peptide-dt", "A helix in 1,417 TIP3P molecules, partly rigid, with flexible bonds between the rigid groups.",
        LONGEST.format(OF_MANY), "fs", "the paper's step is 3 fs",
        TRIED, peptide_dt, (0.1 * FS_PER_PS, 1.0), (5 * FS_PER_PS, 0.25), low=3.0, few=HEAVY,
    ),
    Case(
        "water-hot", "1,000 TIP3P molecules at 1500 K and 1 g/cm³, 1 fs.", "|drift of the energy| over the kinetic energy", "1/ps",
        "2.5 % in 10 ps", LINE, water_hot, 0.4 * FS_PER_PS, 4 * FS_PER_PS, high=2.5e-3, few=HEAVY,
    ),
    Case(
        "water-cold", "1,000 TIP3P molecules at 1 K, where the smallest errors heat, 2 fs.", "|drift of the energy| over the kinetic energy", "1/ps",
        "1 K may not become 1.3 K in a ps; the mesh's noise is below that", LINE, water_cold, 1.6 * FS_PER_PS, 5 * FS_PER_PS, high=0.3, few=HEAVY,
    ),
    Case(
        "long-dimer", "The bound water dimer at 0.3 fs, in empty space: 1e8 body-steps with --full.",
        "largest relative change of energy over 1e-2, of momenta over 1e-9, of distances over 1e-7", "",
        "the energy stays, all else is rounding, or a constraint's tolerance", EXTREME, long_dimer, 200_000, 50_000_000, high=1.0,
    ),
)  # fmt: skip
