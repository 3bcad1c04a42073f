"""The proofs of section II of the paper, tested in LAMMPS: each statement is a number with bounds.

reversal      forward and back, with every integrator
symplectic    (2.42), from the derivatives of a step
energy        the dt^2 law of the energy's error
"""

import itertools
from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from ..running.starts import EXACT
from ..scenes import SCENES, bodies
from ..scenes.integrators import OLDER, constrained, nosquish, rigid
from ..statistics import motion
from ..statistics.check import Check
from ..statistics.estimate import Estimate
from .plan import Bench, Claims, Outputs, Series, Simulation

SCENE = SCENES["dimer"]
PARTS = {
    "reversal": "Forward and back",
    "symplectic": "Symplectic property (2.42)",
    "energy": "The energy's error (2.37)",
}
SOURCES = {
    "reversal": "Section II.A: a symmetric composition is reversible",
    "symplectic": "Section II.B, (2.42): the composition of Hamiltonian motions is symplectic",
    "energy": "Section II.B, (2.37): a symplectic step conserves H + Δt² H⁽²⁾ + O(Δt⁴)",
}
SHOWN = 1e-9  # smallest number that is not rounding

WRITE = f'write_dump all custom "{{{{folder}}}}/{{}}" id x y z vx vy vz modify {EXACT}'
READ = 'read_dump "{folder}/start" 0 x y z vx vy vz replace yes'

# ---- forward and back

STEPS = 1, 3, 10, 30, 100, 300, 1000
# A reversal is judged before chaos has amplified rounding much: 1e-15 Angstrom becomes 1e-13 after
# 300 steps and back, and 1e-11 to 1e-10 after 1,000, depending on chance and processor.
REVERSED = 300
RETURNED = 1e-10  # largest remaining distance, Angstrom
INTEGRATORS = [
    nosquish("NVE", "nosquish/nve"),
    *(nosquish(name, name, scheme=name) for name in OLDER),
    *(rigid(style) for style in ("rigid/nve", "rigid/nve/small", "rigid", "rigid/small")),
    *(constrained(style, "1e-4") for style in ("shake", "rattle")),
]
COME_BACK = "NVE", "MatubayasiNakahara", "rigid/nve", "rigid/nve/small"
REMADE = "its derivatives are made anew at the reversal, of force and torque"


def _there_and_back() -> Iterator[Simulation]:
    """Yield runs of so many steps forward, velocities reversed, as many steps, for each of `STEPS`
    from the same start, with every integrator.

    A new run begins after the reversal.  Integrators with internal state, as ours, set it up then
    from the atoms' positions and velocities: the rounding error of this is that after one step.
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
    how: dict = {"dt": SCENE.dt, "steps": 0, "every": 0, "more": commands}
    for integrator in INTEGRATORS:
        yield Simulation(f"reversal/{integrator.label}", integrator.label, SCENE, integrator, **how)


def reversal(outputs: Outputs) -> tuple[list[Check], dict]:
    """Check reversal in LAMMPS."""
    check, checks = partial(Check.of, "reversal", unit="Å", source=SOURCES["reversal"]), []
    far = f"distance from the start after {REVERSED:,} steps and back"
    rows = [_reversed(series) for series in outputs.values()]
    at = STEPS.index(REVERSED)
    for row in rows:
        if row["error"]:
            checks.append(check(row["label"], far, None, note=row["error"]))
        else:
            bounds: dict = {"high": RETURNED} if row["name"] in COME_BACK else {"low": SHOWN}
            bounds["note"] = REMADE if row["name"] == "Gear" else ""
            checks.append(check(row["label"], far, row["distance"][at], **bounds))
    return checks, {"steps": STEPS, "runs": rows, "dt_fs": SCENE.dt}


def _reversed(series: Series) -> dict:
    """The result of a run forward and back, plain data: for each of `STEPS` the distance of the
    atom that is furthest from its start, Angstrom."""
    integrator, distance = series.simulation.integrator, []
    for n in () if series.error else STEPS:
        left = _positions(series, f"back-{n}") - _positions(series, "start")
        distance.append(float(np.linalg.norm(left, axis=1).max()))
    return {
        "name": integrator.name,
        "label": integrator.label,
        "error": series.error,
        "distance": distance,
    }


def _positions(series, dump):
    return motion.read(series.folder / dump)[1][0, :, 1:4]


# ---- symplectic

# Derivatives are central differences with these steps, extrapolated twice.  Their error is smaller
# than after one extrapolation, 0.005^4 = 6e-10 times a fifth derivative of order one, and rounding,
# 1e-14 / 0.0025; the checks need 1e-8.
SIDES = 0.01, 0.005, 0.0025
DIFFERENCES = 1e-8
DTS = 0.05, 0.07, 0.1, 0.14, 0.2  # reduced units
APART = 12.0  # between two pairs of bodies, which do not interact
SPINS = np.array([[0.3, -0.2, 0.35], [-0.25, 0.3, 0.2]])
PLACES = np.array([[0.0, 0, 0], [1.1, 0.5, 0.4]])
TURNS = Rotation.from_rotvec([[0.4, -0.3, 0.2], [-1.1, 0.5, 0.8]])
# conserved in a step
FORMS = {"NVE": "form", "rigid/nve": "form", "MatubayasiNakahara": "volume", "rigid": "nothing"}


def _neighbours(bench: Bench) -> Iterator[Simulation]:
    """Yield one step of many pairs of bodies that attract each other: each pair starts at another
    point of phase space, displaced in one of its 24 directions."""
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
    how: dict = {"dt": 1.0, "steps": 0, "every": 0, "more": commands}
    for integrator in (integrator for integrator in INTEGRATORS if integrator.name in FORMS):
        yield Simulation(
            f"symplectic/{integrator.label}", integrator.label, scene, integrator, **how
        )


def symplectic(outputs: Outputs) -> tuple[list[Check], dict]:
    """Check how a step of LAMMPS changes the symplectic form (2.42), sum of dp ^ dr over the atoms,
    on the phase space of rigid bodies, and the volume there."""
    check = partial(Check.of, "symplectic", source=SOURCES["symplectic"])
    checks, data = [], {}
    for series in (series for series in outputs.values() if not series.error):
        label, invariant = series.simulation.label, FORMS[series.simulation.integrator.name]
        start, *ends = (_derivative(series, f) for f in ("start", *(f"end-{dt}" for dt in DTS)))
        defect, volume, error = np.transpose([form(start, end) for end in ends])
        data[label] = {"defect": defect.tolist(), "volume": volume.tolist()}
        what = "|Jᵀ g J − g| on the phase space of rigid bodies"
        largest = f"largest of {len(DTS)} time steps"
        if invariant == "form":
            most = Estimate(defect.max(), error.max())
            checks.append(check(label, f"{what}, {largest}", most, high=DIFFERENCES))
        else:
            last = Estimate(defect[-1], error[-1])
            checks.append(check(label, f"{what} at Δt = {DTS[-1]}", last, low=100 * DIFFERENCES))
            checks.append(_power(check, label, f"{what} ∝ Δt", DTS, defect, 3.0, 0.2))
        bound: dict = (
            {"low": 100 * DIFFERENCES} if invariant == "nothing" else {"high": DIFFERENCES}
        )
        most = Estimate(volume.max(), error.max())
        checks.append(check(label, f"change of volume, {largest}", most, **bound))
    return checks, {"dt": DTS, "found": data}


def _derivative(series: Series, file: str) -> tuple[np.ndarray, float]:
    """Momenta, then positions, of a pair's atoms, differentiated in all directions, (36, 24), and a
    bound of the error."""
    mass = np.tile(bodies.MASSES, 2)[:, None]
    atoms = motion.read(series.folder / file)[1][0, :, 1:].reshape(len(SIDES), 2, 24, 6, 6)
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
    """The change of (2.42) on a constrained phase space.

    There the form of two directions u, v is u^T g v, and a step is symplectic if it conserves it.

    Args:
        before, after: a basis of directions, (2 n, m), and their images, with their errors.

    Returns:
        2-norm of the change of the form, relative change of the corresponding volume, and the error
        of the differences.
    """
    (basis, _), (moved, error) = before, after
    g = np.kron([[0, 1], [-1, 0]], np.eye(len(basis) // 2))
    old, new = (part.T @ g @ part for part in (basis, moved))
    volume = np.sqrt(np.linalg.det(new) / np.linalg.det(old)) - 1
    return float(np.linalg.norm(new - old, 2)), float(abs(volume)), error


# ---- the energy's error

MULTIPLES = 0.25, 0.5, 1.0, 2.0, 4.0  # of the scene's time step: a factor of 16
ROTORS = {"NO_SQUISH": "", "NO_SQUISH, m_rot 2": " mrot 2", "NO_SQUISH, exact": " rotor exact"}
SPAN = 40  # of the longest steps


def _energies() -> Iterator[Simulation]:
    """Yield the dimer with each time step, sampled at the same times."""
    for (label, words), multiple in itertools.product(ROTORS.items(), MULTIPLES):
        every, dt = round(MULTIPLES[-1] / multiple), multiple * SCENE.dt
        named = f"energy/{label}-{multiple:g}", f"{label}, {dt:g} fs"
        how: dict = {"dt": dt, "steps": SPAN * every, "every": every}
        yield Simulation(*named, SCENE, nosquish(label, label, words), **how)


def energy(outputs: Outputs) -> tuple[list[Check], dict]:
    """Check how the spread of H along a trajectory decreases with dt."""
    check = partial(Check.of, "energy", source=SOURCES["energy"])
    checks, data = [], {}
    for label in ROTORS:
        runs = [
            series for series in outputs.values() if series.simulation.integrator.label == label
        ]
        runs = [series for series in runs if not series.error]
        dt = [series.simulation.dt for series in runs]
        spread = [float(series.total.std()) for series in runs]
        data[label] = {"dt_fs": dt, "energy": spread}
        if len(runs) == len(MULTIPLES):
            checks.append(_power(check, label, "spread of H ∝ Δt", dt, spread, 2.0, 0.1))
    return checks, data


def _power(check, subject, what, x, y, law, within):
    """Check the exponent of y ~ x^exponent."""
    (exponent, _), covariance = np.polyfit(np.log(x), np.log(y), 1, cov=True)
    measured = Estimate(float(exponent), float(np.sqrt(covariance[0, 0])), len(x) - 2)
    low, high = round(law - within, 9), round(law + within, 9)
    return check(subject, f"{what} to the power of", measured, low=low, high=high)


MEASURES = {
    "reversal": reversal,
    "symplectic": symplectic,
    "energy": energy,
}


def plan(bench: Bench) -> list[Simulation]:
    """All runs of LAMMPS."""
    return [*_there_and_back(), *_neighbours(bench), *_energies()]


def judge(outputs: Outputs, bench: Bench) -> dict:
    """``checks``, and ``data``: the underlying numbers of each part."""
    checks: list[Check] = []
    data = {}
    for part, measure in MEASURES.items():
        part_outputs = {
            name: series for name, series in outputs.items() if name.startswith(f"{part}/")
        }
        if part_outputs:
            part_checks, data[part] = measure(part_outputs)
            checks += part_checks
    return {"checks": [check.plain() for check in checks], "data": data}


CLAIMS = Claims(
    "Whether the theory holds",
    "Does NO_SQUISH have the properties that section II of the paper proves?",
    "numbers with a bound from the paper's theory",
    PARTS,
    plan,
    judge,
    notes={
        "Forward and back": "Two water molecules of inputs/water_dimer at their usual time step: N "
        "steps, then all velocities are reversed, then N steps of a new run. A fix with a state of "
        "its own makes it anew from the atoms there, which costs a rounding error. The number for "
        "one step shows it.",
        "Symplectic": "A step of two bodies that attract each other, from a start that is moved in "
        "each of the 24 directions of their phase space. Derivatives are central differences in "
        "LAMMPS, extrapolated twice, which resolve 1e-8. Both sides of (2.42) are compared on "
        "these directions (2-norm), with the form Σ dp ∧ dr over the atoms.",
    },
)
