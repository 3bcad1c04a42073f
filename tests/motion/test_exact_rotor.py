"""The exact free rotor against the equations of motion in higher precision, and what a flow of
Hamilton's equations obeys."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fix_nosquish.motion.operations import EXACT
from support.rotors import ASYMMETRIC, advance, body_momentum, energy, product, space_momentum, tops
from support.systems import OURS, apart, line_of_class, mixture
from validation.scenes import bodies as shapes_of
from validation.scenes.boxes import nearest
from validation.scenes.integrators import target

EPS = np.finfo(float).eps
SHAPES = {
    "asymmetric": ASYMMETRIC,
    "water": np.array([1.7704, 1.1538, 0.6166]),
    "planar": np.array([1.0, 0.65, 0.35]),
    "nearly oblate": np.array([2.0, 1.0 + 1e-9, 1.0]),
    "nearly prolate": np.array([1.0 + 1e-6, 1.0, 0.3]),
    "oblate": np.array([2.0, 1.2, 1.2]),
    "prolate": np.array([1.3, 1.3, 0.4]),
    "sphere": np.array([0.6, 0.6, 0.6]),
    "needle": np.array([1.0, 0.99, 1e-5]),
    "small": np.array([3.0, 1.7, 0.8]) * 1e-45,  # as in si units
}
WORDS = {
    "NVT": "temp 14e-1 14e-1 1 seed 1",
    "NPT": "temp 14e-1 14e-1 1 seed 1 iso 15e-1 15e-1 2 barostat mtk",
    "NPH": "iso 15e-1 15e-1 2",
}
ANGLES = 1e-12, 1e-4, 0.01, 0.1, 0.3, 1.0, 5.0  # rad in a step


def advance_exactly(q, p, moments, dt, steps=1):
    """`one_atom_bodies` without forces: their q and p after some exact steps."""
    return advance(q, p, moments, dt, steps, EXACT)


def near_separatrix(L, moments, distance):
    """L with that L_3 with which it circles about the axis 1 or 3 as rarely as this tells."""
    r1, r2, r3 = 1 / moments
    L = L.copy()
    L[2] = L[0] * np.sqrt((r2 - r1) / (r3 - r2)) * (1 + distance)
    return L


def reference(L, moments, time):
    """The rotation of a top in the principal frame of its start, and L then, in long double, from
    Taylor series of Euler's equations and dr/dt = r (0, omega) / 2.

    Args:
        L: (3, n).  time: (n,).
    """
    wide, order = np.longdouble, 22
    L, rate = L.astype(wide), (1 / moments.astype(wide))[:, None]
    parts = int(
        np.ceil((np.linalg.norm(L.astype(float), axis=0) * np.abs(time)).max() / moments[2] * 4)
    )
    h, r = time.astype(wide) / parts, np.zeros((4, L.shape[1]), wide)
    r[0] = 1
    momenta, spins, turns = (np.zeros((rows, order + 1, L.shape[1]), wide) for rows in (3, 4, 4))
    for _ in range(parts):
        momenta[:, 0], turns[:, 0] = L, r
        for k in range(order):
            spins[1:, k] = rate * momenta[:, k]
            (a, b, c), (_, x, y, z) = momenta[:, : k + 1], spins[:, k::-1]
            slope = np.array([b * z - c * y, c * x - a * z, a * y - b * x]).sum(axis=1)
            turn = product(turns[:, : k + 1], spins[:, k::-1]).sum(axis=1) / 2
            momenta[:, k + 1], turns[:, k + 1] = h / (k + 1) * slope, h / (k + 1) * turn
        L, r = momenta.sum(axis=1), turns.sum(axis=1)
    return r, L


def apart_from_reference(q, p, moments, time):
    """How far a step is from the reference, of each body: q, and p over its size, the larger; and
    how many times a relative error of p the equations make of it by then."""
    L, rng = body_momentum(q, p)[1:], np.random.default_rng(2)
    turn, then = reference(L, moments, time)
    tiny = 1e-10 * np.linalg.norm(L, axis=0)
    other = np.concatenate(reference(L + tiny * rng.normal(size=L.shape), moments, time))
    sizes = np.concatenate([np.ones((4, q.shape[1])), np.tile(np.linalg.norm(L, axis=0), (3, 1))])
    response = np.abs((other - np.concatenate([turn, then])) / sizes).max(axis=0) / 1e-10
    want_q = product(q.astype(np.longdouble), turn)
    want_p = 2 * product(want_q, np.concatenate([0 * then[:1], then]))
    # in one step all have one dt, so they differ in their momenta
    got_q, got_p = advance_exactly(q, p * time, moments, 1.0)
    off_q = np.abs(got_q - want_q).max(axis=0)
    off_p = np.abs(got_p / time - want_p).max(axis=0) / np.linalg.norm(p, axis=0)
    return np.maximum(off_q, off_p).astype(float), response.astype(float)


def turning(moments, angle, n=30, seed=1):
    """Tops, and the time in which each turns by this angle; among them such as turn about one axis,
    hardly about two, and near the separatrix."""
    rng = np.random.default_rng(seed)
    q, p = tops(n, moments, seed)
    L = body_momentum(q, p)[1:]
    L[:, 6:12] *= 10.0 ** rng.uniform(-9, 0, (3, 6))
    L[:, :6] *= np.repeat(np.eye(3), 2, axis=1)
    if moments[0] > moments[1] > moments[2]:
        L[:, 12:18] = near_separatrix(L[:, 12:18], moments, 10.0 ** -np.arange(2, 14, 2))
    p = 2 * product(q, np.concatenate([0 * L[:1], L]))
    L = body_momentum(q, p)[1:]  # as it is after rounding
    return q, p, angle / np.linalg.norm(L / moments[:, None], axis=0)


@pytest.mark.parametrize(
    ("shape", "angle"),
    [(shape, angle) for shape in SHAPES for angle in ANGLES if shape != "needle" or angle < 0.01]
    + [("asymmetric", 10.0)],
)
def test_equals_the_equations_of_motion(shape, angle):
    """Locks out a power series too short or with a wrong term, a wrong sign or branch on either
    side of the separatrix, a loss of digits there and where moments are nearly equal, parts
    of a large angle missed, and a division by what may be zero."""
    moments = SHAPES[shape]
    q, p, time = turning(moments, angle)
    off, response = apart_from_reference(q, p, moments, time)
    ratio = off / (EPS * np.maximum(1, response))
    bound = 8 if angle <= 1 else 20  # large angles are divided into parts, whose errors add up
    assert ratio.max() < bound, (ratio.argmax(), off.max(), response.max())


@pytest.mark.parametrize("time", [10.0, -30.0])
@pytest.mark.parametrize("axis", [0, 2])
def test_many_parts(axis, time):
    """Locks out parts that are too long or too many, backward ones, and an angle about the angular
    momentum that loses whole turns: many turns at once."""
    q, p = tops(8, ASYMMETRIC, 3)
    L = body_momentum(q, p)[1:]
    L[axis] *= 3
    p = 2 * product(q, np.concatenate([0 * L[:1], L]))
    turn, then = reference(L, ASYMMETRIC, np.full(8, time))
    got_q, got_p = advance_exactly(q, p, ASYMMETRIC, time)
    size = np.linalg.norm(L, axis=0)
    bound = 1e-14 * abs(time) * np.maximum(1, size)
    assert (np.abs(got_q - product(q.astype(np.longdouble), turn)).max(axis=0) < bound).all()
    assert (np.abs(body_momentum(got_q, got_p)[1:] - then).max(axis=0) < bound * size).all()


def test_each_lane_for_itself():
    """Locks out a body whose result depends on what is beside it in its block: slow and fast bodies
    of all shapes move as each does alone, to the last bit, and what rests stays."""
    rng = np.random.default_rng(7)
    shapes = list(SHAPES.values())[:-1]
    moments = np.array(shapes).T[:, rng.integers(0, len(shapes), 150)]
    q, p = tops(150, ASYMMETRIC, 7)
    p *= 10.0 ** rng.uniform(-3, 1, 150)
    p[:, ::10] = 0.0
    together = advance_exactly(q, p, moments, 0.3)
    for b in range(150):
        one = slice(b, b + 1)
        for got, want in zip(together, advance_exactly(q[:, one], p[:, one], moments[:, one], 0.3)):
            np.testing.assert_array_equal(got[:, one], want)
    np.testing.assert_array_equal(together[0][:, ::10], q[:, ::10])


def test_broken_runs_end():
    """Locks out a division into parts that never ends where a run has broken."""
    q, p = tops(4, ASYMMETRIC, 8)
    p[:, 0], p[:, 1], p[:, 2] = np.nan, np.inf, 1e200
    advance_exactly(q, p, ASYMMETRIC, 0.3)


@pytest.mark.parametrize(("dt", "steps"), [(0.1, 300_000), (2.0, 10_000)])
def test_many_steps(dt, steps):
    """Locks out rounding that adds up: a norm of q, an angular momentum in space, or an energy that
    creeps away, in many steps that are little, and in some that are not."""
    moments = np.repeat(ASYMMETRIC[:, None], 4, axis=1)
    q, p = tops(4, ASYMMETRIC, 10)
    L, start, size = space_momentum(q, p), energy(q, p, ASYMMETRIC), np.linalg.norm(p, axis=0)
    q, p = advance_exactly(q, p, moments, dt, steps)
    assert np.abs(np.linalg.norm(q, axis=0) - 1).max() < 1e-12
    assert (np.abs(body_momentum(q, p)[0]) / size).max() < 1e-12
    assert (np.abs(space_momentum(q, p) - L) / size).max() < 1e-12
    assert np.abs(energy(q, p, ASYMMETRIC) / start - 1).max() < 1e-11


# ---- in LAMMPS


FREE = "pair_style zero 2.5\npair_coeff * *\n"


def exactly(system, start, time):
    """Where each atom is relative to the first of its body after some time of free motion."""
    place = np.empty_like(start.x)
    for body in np.unique(system.molecule):
        mine = system.molecule == body
        mass, v, first = system.mass[mine], start.v[mine], start.x[mine][0]
        r = nearest(start.x[mine] - first, system.h)
        r -= mass @ r / mass.sum()
        principal, axes = shapes_of.moments(r, mass)
        axes[:, 0] *= np.linalg.det(axes)
        frame, L = Rotation.from_matrix(axes), mass @ np.cross(r, v)
        turn = reference(frame.inv().apply(L)[:, None], principal, np.array([time]))[0][:, 0]
        turned = frame * Rotation.from_quat(turn.astype(float), scalar_first=True)
        then = turned.apply(frame.inv().apply(r))
        place[mine] = then - then[0]
    return place


def test_free_bodies_in_lammps(simulate):
    """Locks out a keyword that is read and not used, or with inner steps of the other left: bodies
    without forces are where the exact motion leads them, by long steps, and split ones are not."""
    system, steps, dt = mixture("solid planar"), 50, 20.0
    start = simulate(system, OURS, 0, before=FREE)
    want, off = exactly(system, start, steps * dt * system.dt), {}
    for words in "rotor exact", "rotor split", "mrot 2":
        run = simulate(system, OURS, steps, dt=dt, before=FREE, words=f"molecule {words}")
        first = np.searchsorted(system.molecule, system.molecule)
        have = nearest(run.x - run.x[first], system.h)
        off[words] = np.linalg.norm(have - want, axis=1).max()
        assert ("exact rotation" in run.log) == (words == "rotor exact")
    assert off["rotor exact"] < 1e-11, off
    assert 1e-4 < off["mrot 2"] < 0.3 * off["rotor split"], off


@pytest.mark.parametrize("name", WORDS)
def test_every_integrator_has_it(simulate, name):
    """Locks out an integrator whose rotation stays split: with rotor exact it comes near to many
    inner steps, and with one inner step it does not."""
    system, fix = mixture("solid planar"), f"fix 1 {{group}} nosquish/{name.lower()} {{words}}"
    exact, fine, split = (
        simulate(system, fix, 40, dt=4, words=f"molecule {WORDS[name]} {words}")
        for words in ("rotor exact", "mrot 50", "mrot 1")
    )
    assert apart(exact, fine, system.h) < 0.01 * apart(split, fine, system.h)


def test_default(simulate):
    """Locks out symmetric tops that are split where nothing asks for it, others that are not, and
    a mixture whose bodies are moved in two ways."""
    runs = {
        words: simulate(mixture("ammonia methane"), OURS, 20, words=f"molecule {words}")
        for words in ("", "rotor exact", "rotor split", "order 321")
    }
    for one, other in ("", "rotor exact"), ("rotor split", "order 321"):
        np.testing.assert_array_equal(runs[one].x, runs[other].x)
    assert (runs[""].x != runs["rotor split"].x).any()
    assert "exact rotation" in runs[""].log and "exact" not in runs["order 321"].log
    assert "exact" not in simulate(mixture("solid ammonia"), OURS, 0).log


@pytest.mark.parametrize("scheme", ["Gear", "MatubayasiNakahara"])
def test_refused_by_other_schemes(simulate, scheme):
    """Locks out a keyword that is taken and does nothing."""
    fix = line_of_class(target(scheme))
    run = simulate(mixture("solid"), fix, 1, words="molecule rotor exact", check=False)
    says = f"rotor exact is for the rotation of fix_nosquish.NVE, not that of {scheme}"
    assert run.code != 0 and says in run.screen
