"""What section II of the paper proves, measured in LAMMPS: each statement a number between bounds.

reversal      forward and back, with every integrator
symplectic    (2.42), of the derivatives of a step
conserved     the energy error's dt^2 law, and that of what is conserved (2.37)
rotors        the free rotation, split and exact, against the exact top
"""

import itertools
from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from ..running import run
from ..running.starts import EXACT
from ..scenes import SCENES, bodies
from ..scenes.integrators import OLDER, constrained, nosquish, rigid
from ..statistics import motion
from ..statistics.check import Check
from ..statistics.estimate import Estimate
from . import figures
from .plan import SHADOW, Bench, Claims, Found, Series, Simulation
from .top import free_top

SCENE = SCENES["dimer"]
PARTS = {
    "reversal": "Forward and back",
    "symplectic": "Symplectic property (2.42)",
    "conserved": "Conserved quantity (2.37)",
    "rotors": "The free rotation, split and exact",
}
SOURCES = {
    "reversal": "Section II.A: a symmetric composition is reversible",
    "symplectic": "Section II.B, (2.42): the composition of Hamiltonian motions is symplectic",
    "conserved": "Section II.B, (2.37): a symplectic step conserves H + Δt² H⁽²⁾ + O(Δt⁴)",
    "rotors": "Section II.D, (2.53); our fix.md: rotor exact has no error but rounding",
}
ROUND_OFF = 1e-12  # the most that rounding may leave of numbers of order one
SHOWN = 1e-9  # the least that is not rounding

WRITE = f'write_dump all custom "{{{{folder}}}}/{{}}" id x y z vx vy vz modify {EXACT}'
READ = 'read_dump "{folder}/start" 0 x y z vx vy vz replace yes'

# ---- forward and back

STEPS = 1, 3, 10, 30, 100, 300, 1000
# A reversal is judged where chaos has not made much of rounding yet: of 1e-15 Angstrom it makes
# 1e-13 in 300 steps and back, and in 1,000 1e-11 to 1e-10, as luck and processor have it.
REVERSED = 300
# Angstrom that may be left: converged shake leaves 4e-12, because it first corrects the data file's
# own lengths
RETURNED = 1e-10
LENGTH = 1.0  # Angstrom: about a bond's, of which a tolerance is a part
TOLERANCES = "1e-3", "1e-4", "1e-6", "1e-8", "1e-10", "1e-12"
ITERATIONS = 2000  # at most, of shake and rattle: a tolerance is reached, not given up
INTEGRATORS = [
    nosquish("NVE", "fix_nosquish.NVE"),
    *(nosquish(name, name, scheme=name) for name in OLDER),
    *(rigid(style) for style in ("rigid/nve", "rigid/nve/small", "rigid", "rigid/small")),
    *(constrained(style, one, ITERATIONS) for style in ("shake", "rattle") for one in TOLERANCES),
]
COME_BACK = "NVE", "MatubayasiNakahara", "rigid/nve", "rigid/nve/small"
REMADE = "its derivatives are made anew at the reversal, of force and torque"


def _there_and_back() -> Iterator[Simulation]:
    """So many steps forward, velocities reversed, as many steps, for each of `STEPS` from the same
    start, with every integrator.

    After the reversal a new run begins.  Integrators that keep a state of their own, as ours do,
    make it anew of the atoms' positions and velocities then: that costs a rounding error, which the
    one after one step tells.
    """
    commands = [WRITE.format("start"), *(f"variable {c} atom -v{c}" for c in "xyz")]
    for n in STEPS:
        commands += [
            READ,
            "reset_timestep 0",
            f"run {n}",
            "velocity all set v_x v_y v_z",
            f"run {n}",
            WRITE.format(f"back-{n}"),
        ]
    how: dict = {"dt": SCENE.dt, "steps": 0, "every": 0, "keeps": "nothing", "more": commands}
    for one in INTEGRATORS:
        yield Simulation(f"reversal/{one.label}", one.label, SCENE, one, **how)


def reversal(found: Found) -> tuple[list[Check], dict]:
    """Forward and back in LAMMPS."""
    check, checks = partial(Check.of, "reversal", unit="Å", source=SOURCES["reversal"]), []
    far = f"distance from the start after {REVERSED:,} steps and back"
    rows = [_reversed(one) for one in found.values()]
    at = STEPS.index(REVERSED)
    for row in rows:
        if row["error"]:
            checks.append(check(row["label"], far, None, note=row["error"]))
        elif row["tolerance"] is None:
            bounds: dict = {"high": RETURNED} if row["name"] in COME_BACK else {"low": SHOWN}
            bounds["note"] = REMADE if row["name"] == "Gear" else ""
            checks.append(check(row["label"], far, row["distance"][at], **bounds))
    *loose, converged = TOLERANCES
    for style in "shake", "rattle":
        mine = [row for row in rows if row["name"] == style and not row["error"]]
        left = {row["tolerance"]: row["distance"][at] for row in mine}
        if len(left) == len(TOLERANCES):
            most = max(left[float(one)] / float(one) for one in loose)
            what = f"{far}, over the tolerance, largest for {loose[0]} to {loose[-1]}"
            last = left[float(converged)]
            checks.append(check(style, f"{far}, tolerance 1e-4", left[1e-4], low=SHOWN))
            checks.append(check(style, f"{far}, tolerance {converged}", last, high=RETURNED))
            checks.append(check(style, what, most, high=LENGTH))
    return checks, {"steps": STEPS, "runs": rows, "dt_fs": SCENE.dt}


def _reversed(one: Series) -> dict:
    """What a run forward and back came to, plain data: of each of `STEPS` how far the atom is that
    is left furthest, Angstrom."""
    integrator, distance = one.simulation.integrator, []
    for n in () if one.error else STEPS:
        left = _positions(one, f"back-{n}") - _positions(one, "start")
        distance.append(float(np.linalg.norm(left, axis=1).max()))
    row = {"name": integrator.name, "label": integrator.label, "error": one.error}
    return row | {"tolerance": integrator.tolerance, "distance": distance}


def _positions(one, dump):
    return motion.read(one.folder / dump)[1][0, :, 1:4]


# ---- symplectic

# Derivatives are central differences with these steps, extrapolated twice.  They leave less than
# the extrapolation once does, 0.005^4 = 6e-10 times a fifth derivative of order one, and rounding,
# 1e-14 / 0.0025; what is said of them is said to 1e-8.
SIDES = 0.01, 0.005, 0.0025
DIFFERENCES = 1e-8
DTS = 0.05, 0.07, 0.1, 0.14, 0.2  # reduced units
APART = 12.0  # between two pairs of bodies, of which each one moves for itself
SPINS = np.array([[0.3, -0.2, 0.35], [-0.25, 0.3, 0.2]])
PLACES = np.array([[0.0, 0, 0], [1.1, 0.5, 0.4]])
TURNS = Rotation.from_rotvec([[0.4, -0.3, 0.2], [-1.1, 0.5, 0.8]])
# what a step keeps
FORMS = {"NVE": "form", "rigid/nve": "form", "MatubayasiNakahara": "volume", "rigid": "nothing"}


def _neighbours(bench: Bench) -> Iterator[Simulation]:
    """One step of many pairs of bodies that attract each other: each pair begins at another place
    of phase space, off in one of its 24 directions."""
    pairs: list[bodies.Body] = []
    for size, sign, way in itertools.product(SIDES, (1, -1), range(24)):
        off = np.zeros((4, 2, 3))  # places, angles, velocities, spins of both bodies
        off.flat[way] = sign * size
        centre = APART * len(pairs) / 2 * np.array([1.0, 0, 0])
        for k in 0, 1:
            pairs.append(
                bodies.body(
                    bodies.BENT,
                    bodies.MASSES,
                    place=centre + PLACES[k] + off[0, k],
                    velocity=off[2, k],
                    turn=Rotation.from_rotvec(off[1, k]) * TURNS[k],
                    spin=SPINS[k] + off[3, k],
                )
            )
    setup = (
        "pair_style gauss 8.0",
        "pair_coeff * * 0.3 0.5",
        "neigh_modify exclude molecule/intra all",
    )
    scene = bodies.scene(
        bench.runs,
        pairs,
        setup,
        name="pairs",
        dt=1.0,
        box=(APART * len(pairs) / 2, APART, APART),
        corner=(-APART / 2,) * 3,
    )
    commands = [WRITE.format("start")]
    for dt in DTS:
        commands += [READ, "reset_timestep 0", f"timestep {dt}", "run 1", WRITE.format(f"end-{dt}")]
    how: dict = {"dt": 1.0, "steps": 0, "every": 0, "keeps": "nothing", "more": commands}
    for one in (one for one in INTEGRATORS if one.name in FORMS):
        yield Simulation(f"symplectic/{one.label}", one.label, scene, one, **how)


def symplectic(found: Found) -> tuple[list[Check], dict]:
    """What a step of LAMMPS loses of the symplectic form (2.42), sum of dp ^ dr over the atoms, on
    the phase space of rigid bodies, and of volume there."""
    check = partial(Check.of, "symplectic", source=SOURCES["symplectic"])
    checks, data = [], {}
    for one in (one for one in found.values() if not one.error):
        label, kept = one.simulation.label, FORMS[one.simulation.integrator.name]
        start, *ends = (_derivative(one, f) for f in ("start", *(f"end-{dt}" for dt in DTS)))
        defect, volume, error = np.transpose([form(start, end) for end in ends])
        data[label] = {"defect": defect.tolist(), "volume": volume.tolist()}
        what = "|Jᵀ g J − g| on the phase space of rigid bodies"
        largest = f"largest of {len(DTS)} time steps"
        if kept == "form":
            most = Estimate(defect.max(), error.max())
            checks.append(check(label, f"{what}, {largest}", most, high=DIFFERENCES))
        else:
            last = Estimate(defect[-1], error[-1])
            checks.append(check(label, f"{what} at Δt = {DTS[-1]}", last, low=100 * DIFFERENCES))
            checks.append(_power(check, label, f"{what} ∝ Δt", DTS, defect, 3.0, 0.2))
        bound: dict = {"low": 100 * DIFFERENCES} if kept == "nothing" else {"high": DIFFERENCES}
        most = Estimate(volume.max(), error.max())
        checks.append(check(label, f"change of volume, {largest}", most, **bound))
    return checks, {"dt": DTS, "found": data}


def _derivative(one: Series, file: str) -> tuple[np.ndarray, float]:
    """Momenta, then places, of a pair's atoms, derived by all directions, (36, 24), and a bound of
    the error."""
    mass = np.tile(bodies.MASSES, 2)[:, None]
    atoms = motion.read(one.folder / file)[1][0, :, 1:].reshape(len(SIDES), 2, 24, 6, 6)
    number = np.arange(atoms[..., 0, 0].size).reshape(*atoms.shape[:3], 1)
    atoms[..., 0] -= APART * number
    states = np.concatenate([mass * atoms[..., 3:], atoms[..., :3]], axis=-1)
    states = np.moveaxis(states, -1, -2)  # x, y, z of p, then of q, each of all atoms
    rows = (states[:, 0] - states[:, 1]).reshape(3, 24, 36) / (2 * np.reshape(SIDES, (3, 1, 1)))
    once = (4 * rows[1:] - rows[:-1]) / 3
    return ((16 * once[1] - once[0]) / 15).T, float(np.abs(once[1] - once[0]).max() / 15)


def form(
    before: tuple[np.ndarray, float], after: tuple[np.ndarray, float]
) -> tuple[float, float, float]:
    """What (2.42) becomes on a constrained phase space.

    There the form of two directions u, v is u^T g v, and a step is symplectic if it keeps it.

    Args:
        before, after: a basis of directions, (2 n, m), and where they lead, with their errors.

    Returns:
        2-norm of the change of the form, the relative change of the volume that belongs to it, and
        the error of the differences.
    """
    (basis, _), (moved, error) = before, after
    g = np.kron([[0, 1], [-1, 0]], np.eye(len(basis) // 2))
    old, new = (part.T @ g @ part for part in (basis, moved))
    volume = np.sqrt(np.linalg.det(new) / np.linalg.det(old)) - 1
    return float(np.linalg.norm(new - old, 2)), float(abs(volume)), error


# ---- a conserved quantity

MULTIPLES = 0.25, 0.5, 1.0, 2.0, 4.0  # of the scene's time step: a factor of 16
SHADOWED = {"NO_SQUISH": "", "NO_SQUISH, m_rot 2": " mrot 2", "NO_SQUISH, exact": " rotor exact"}
SPAN = 40  # of the longest steps


def _shadows() -> Iterator[Simulation]:
    """The dimer's energy and shadow energy with each time step, at the same times."""
    for (label, words), multiple in itertools.product(SHADOWED.items(), MULTIPLES):
        every, dt = round(MULTIPLES[-1] / multiple), multiple * SCENE.dt
        integrator = nosquish(label, label, f"{words} every {every}", "Shadowed")
        how: dict = {"dt": dt, "every": every, "more": run.thermo(SHADOW)}
        named = f"conserved/{label}-{multiple:g}", f"{label}, {dt:g} fs"
        yield Simulation(*named, SCENE, integrator, steps=SPAN * every, **how)


def conserved(found: Found) -> tuple[list[Check], dict]:
    """How the spread of H and of H + dt^2 H^(2) along a trajectory falls with dt."""
    check = partial(Check.of, "conserved", source=SOURCES["conserved"])
    checks, data = [], {}
    for label in SHADOWED:
        runs = [one for one in found.values() if one.simulation.integrator.label == label]
        runs = [one for one in runs if not one.error]
        dt = [one.simulation.dt for one in runs]
        spread = {
            "energy": [float(one.total.std()) for one in runs],
            "shadow": [float(np.nanstd(one.shadow)) for one in runs],
        }
        data[label] = {"dt_fs": dt} | spread
        if len(runs) == len(MULTIPLES):
            law, finer = partial(_power, check, label), "spread of H + Δt² H⁽²⁾ ∝ Δt"
            checks.append(law("spread of H ∝ Δt", dt, spread["energy"], 2.0, 0.1))
            checks.append(law(finer, dt, spread["shadow"], 4.0, 0.1))
    return checks, data


def _power(check, subject, what, x, y, law, within):
    """The exponent of y ~ x^exponent, and what it is to be."""
    (exponent, _), covariance = np.polyfit(np.log(x), np.log(y), 1, cov=True)
    measured = Estimate(float(exponent), float(np.sqrt(covariance[0, 0])), len(x) - 2)
    low, high = round(law - within, 9), round(law + within, 9)
    return check(subject, f"{what} to the power of", measured, low=low, high=high)


# ---- the free rotation

ROTORS = {
    "split": "",
    "split, mrot 2": " mrot 2",
    "split, mrot 4": " mrot 4",
    "exact": " rotor exact",
}  # name: words of our fix
ANGLES = 0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8  # rad in a step
HOLDS = 4  # of the smallest angles: where the law of the error holds
TOTAL = 20.0  # rad
TOPS = 40
THERMAL = 0.028  # rad in 1 fs, rms, of water at 298 K
SITES = np.array([[0.0, 0.0655, 0.0], [0.757, -0.520, 0.0], [-0.757, -0.520, 0.0]])  # TIP3P, Å
MASSES = np.array([15.9994, 1.008, 1.008])


def _tops() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Free waters of one temperature: the places of their atoms in the principal frame (3, 3) and
    their moments (3,), quaternions (n, 4) and angular momenta (n, 3).  A unit of time is that in
    which they turn by 1 rad, rms."""
    rng = np.random.default_rng(2007)
    moments, axes = bodies.moments(SITES, MASSES)
    axes[:, 2] *= np.linalg.det(axes)
    q, L = rng.normal(size=(TOPS, 4)), rng.normal(size=(TOPS, 3)) * np.sqrt(moments)
    q /= np.linalg.norm(q, axis=1)[:, None]
    L /= np.sqrt(((L / moments) ** 2).sum(axis=1).mean())
    return (SITES - MASSES @ SITES / MASSES.sum()) @ axes, moments, q, L


def _free(bench: Bench) -> Iterator[Simulation]:
    """Free waters for so many rad, with each rotor, with each step."""
    sites, moments, turns, momenta = _tops()
    waters = []
    for number, (q, L) in enumerate(zip(turns, momenta)):
        turn = Rotation.from_quat(q, scalar_first=True)
        how: dict = {"place": (4.0 * number, 0, 0), "turn": turn}
        waters.append(bodies.body(sites, MASSES, spin=turn.apply(L / moments), **how))
    setup = *bodies.FREE, "neighbor 1.0 bin"
    scene = bodies.scene(
        bench.runs,
        waters,
        setup,
        name="tops",
        box=(4 * TOPS, 4, 4),
        corner=(-2, -2, -2),
        dt=ANGLES[0],
    )
    commands = [WRITE.format("start")]
    for angle in ANGLES:
        commands += [
            READ,
            "reset_timestep 0",
            f"timestep {angle}",
            f"run {round(TOTAL / angle)}",
            WRITE.format(f"end-{angle}"),
        ]
    how = {"dt": ANGLES[0], "steps": 0, "every": 0, "keeps": "nothing", "more": commands}
    for name, words in ROTORS.items():
        yield Simulation(f"rotors/{name}", name, scene, nosquish(name, name, words), **how)


def rotors(found: Found) -> tuple[list[Check], dict]:
    """The free rotation's error against the exact motion."""
    check = partial(Check.of, "rotors", source=SOURCES["rotors"])
    runs = {one.simulation.label: one for one in found.values() if not one.error}
    errors = {name: _errors(runs[name]) for name in ROTORS if name in runs}
    what, few, last = f"error of the orientation after {TOTAL:g} rad", slice(HOLDS), HOLDS - 1
    checks = []
    if split := errors.get("split"):
        checks.append(_power(check, "split", f"{what} ∝ Δt", ANGLES[few], split[few], 2.0, 0.05))
        if fourfold := errors.get("split, mrot 4"):
            over = f"{what} with m_rot 4 times 4², over that with 1, at {ANGLES[last]:g} rad a step"
            ratio = 16 * fourfold[last] / split[last]
            checks.append(check("split", over, ratio, low=0.95, high=1.05))
    if exact := errors.get("exact"):
        checks.append(
            check(
                "exact",
                f"{what}, largest for {ANGLES[0]:g} to {ANGLES[-1]:g} rad in a step",
                max(exact),
                high=ROUND_OFF,
            )
        )
    return checks, {"angles": ANGLES, "total": TOTAL, "error": errors}


def _errors(one: Series) -> list[float]:
    """The root mean square error of the orientation, rad, at each of `ANGLES`."""
    sites, moments, turns, momenta = _tops()
    exact = [free_top(*top, moments, TOTAL)[0] for top in zip(turns, momenta)]
    want = [turn.apply(sites) for turn in Rotation.from_quat(exact, scalar_first=True)]
    errors = []
    for angle in ANGLES:
        x = _positions(one, f"end-{angle}").reshape(TOPS, 3, 3)
        have = x - np.einsum("a,bai->bi", MASSES / MASSES.sum(), x)[:, None]
        off = [Rotation.align_vectors(*both)[0].magnitude() for both in zip(have, want)]
        errors.append(float(np.sqrt(np.mean(np.square(off)))))
    return errors


MEASURES = {
    "reversal": reversal,
    "symplectic": symplectic,
    "conserved": conserved,
    "rotors": rotors,
}


def plan(bench: Bench) -> list[Simulation]:
    """All runs of LAMMPS."""
    return [*_there_and_back(), *_neighbours(bench), *_shadows(), *_free(bench)]


def judge(found: Found, bench: Bench) -> dict:
    """``checks``, and ``data``: part to what its figure shows."""
    checks: list[Check] = []
    data = {}
    for part, measure in MEASURES.items():
        own = {name: one for name, one in found.items() if name.startswith(f"{part}/")}
        if own:
            made, data[part] = measure(own)
            checks += made
    return {"checks": [check.plain() for check in checks], "data": data}


CLAIMS = Claims(
    "Whether the theory holds",
    "Does NO_SQUISH keep what section II of the paper proves of it?",
    "numbers that the paper's theory bounds",
    PARTS,
    plan,
    judge,
    figures={
        figures.reversal: "The furthest atom's distance from its start after so many steps, "
        "velocities reversed, and as many steps, in LAMMPS: the dimer. What rounding leaves grows "
        "as the motion is chaotic.",
        figures.conserved: "Standard deviation along trajectories of the dimer of the same length. "
        "Pale: Δt² and Δt⁴ through the first point.",
    },
    notes={
        "Forward and back": "Two water molecules of inputs/water_dimer at their own time step: N "
        "steps, all velocities reversed, N steps of a new run. Fixes that keep a state of their "
        "own make it anew of the atoms then, which costs a rounding error: that after one step. "
        "shake and rattle correct to the tolerance named, in as many iterations as that takes.",
        "Symplectic": "A step of two bodies that attract each other, from a start that is moved in "
        "each of the 24 directions of their phase space. Derivatives are central differences in "
        "LAMMPS, extrapolated twice, which resolve 1e-8. Both sides of (2.42) are compared on "
        "these directions (2-norm), with the form Σ dp ∧ dr over the atoms.",
        "Conserved": "The shadow energy of our class Shadowed is H + Δt² H⁽²⁾ with H⁽²⁾ of (2.37).",
        "Free rotation": "Waters without forces, against the exact top in Jacobi's elliptic "
        f"functions. At 298 K water turns by {THERMAL:.3f} rad in 1 fs, rms.",
    },
)
