"""MatubayasiNakahara and Gear against their equations, written out for one body,
and against what theory says of them.

The bodies of the first half of this file move in a field U = |x|^2 / 2 - m . (E + G x), with m a
vector fixed in the body: force and torque, coupled, without LAMMPS.
"""

from math import comb, factorial

import numpy as np
import pytest
from fix_nosquish_validation.schemes import gear, matubayasi_nakahara
from numpy.polynomial import Polynomial
from scipy.linalg import expm

from fix_nosquish.motion import block
from support.rotors import (
    ASYMMETRIC,
    S,
    body_momentum,
    conjugate,
    one_atom_bodies,
    product,
    step_cells,
    tops,
)
from support.systems import OURS as NVE
from support.systems import TWO, apart, hot_rods, line_of_class, mixture, smooth
from validation.scenes.integrators import target

MN, GEAR = (line_of_class(target(name)) for name in ("MatubayasiNakahara", "Gear"))
DIPOLE, E, G = (
    np.array([0.3, -0.5, 0.7]),
    np.array([0.2, 1.0, -0.4]),
    np.array([[0.5, 0.2, 0.0], [-0.3, 0.1, 0.4], [0.2, 0.6, -0.2]]),
)


# ---- the field, and bodies in it


def to_space(q, vector):
    return product(product(q, np.concatenate([np.zeros_like(vector[:1]), vector])), conjugate(q))[
        1:
    ]


def to_body(q, vector):
    return to_space(conjugate(q), vector)


def dipoles(q):
    return to_space(q, np.tile(DIPOLE[:, None], q.shape[1]))


def field(x, q):
    """Force and torque in the space frame, (6, n)."""
    m = dipoles(q)
    return np.concatenate([G.T @ m - x, np.cross(m, E[:, None] + G @ x, axis=0)])


def start(n, seed, speed=1.0):
    """x, v, q, p of n bodies of mass 1."""
    x, v = np.random.default_rng(seed).normal(size=(2, 3, n))
    return x, v, *tops(n, ASYMMETRIC, seed, speed)


def make(x, v, q, p, moments=ASYMMETRIC, own_rows=0):
    bodies = one_atom_bodies(q, p, moments, own_rows)
    np.testing.assert_array_equal(bodies.id, np.arange(len(bodies)))
    bodies.x[:], bodies.v[:] = x, v
    return bodies


def move_mn(bodies, dt, steps, mrot=1, force=field):
    """Steps of MatubayasiNakahara's loops as LAMMPS has them called."""
    return move(matubayasi_nakahara.MatubayasiNakahara, bodies, dt, steps, mrot, force)


def move_gear(bodies, dt, steps, force=field, starts=True):
    """Steps of Gear's loops as LAMMPS has them called."""
    return move(gear.Gear, bodies, dt, steps, 1, force, starts)


def move(integrator, bodies, dt, steps, mrot, force, starts=True):
    cells, loops = step_cells(integrator, bodies, dt, mrot), integrator.scheme
    begin = loops.advance.bind_to(cells, gathers=0, ends=0, begins=1, part=block.ALL)
    end = loops.tail.bind_to(cells)
    if starts:
        bodies.wrench[:] = force(bodies.x, bodies.q)
    if starts and loops.start:
        loops.start.bind_to(cells)()
    for _ in range(steps):
        begin()
        bodies.wrench[:] = force(bodies.x, bodies.q)
        end()
    return bodies


def for_gear(*start, moments=ASYMMETRIC):
    return make(*start, moments=moments, own_rows=gear.Gear.rows)


# ---- the equations, for one body of mass 1, as they stand


def rates(x, q, moments):
    """Acceleration, and torque over moments in the principal frame."""
    load = field(x[:, None], q[:, None])[:, 0]
    return load[:3], to_body(q[:, None], load[3:, None])[:, 0] / moments


def paper_mn(x, v, q, w, moments, dt, mrot):
    """(2.61) in the order of (2.53), the parts iL_1 to iL_3 as exponentials of matrices."""
    ix, iy, iz = moments

    def part_1(q, w, h):
        return (
            expm(
                0.5
                * h
                * sum(
                    w[k] * np.stack([S(e)[:, k + 1] for e in np.eye(4)], axis=1) for k in range(3)
                )
            )
            @ q
        )

    def part_2(w, h):
        matrix = np.zeros((3, 3))
        matrix[0, 1], matrix[1, 0] = (iy - iz) / ix * w[2], (iz - iy) / iy * w[2]
        return expm(h * matrix) @ w

    def part_3(w, h):
        matrix = np.zeros((3, 3))
        matrix[1, 2], matrix[2, 1] = (iy - ix) / iy * w[0], (ix - iy) / iz * w[0]
        return expm(h * matrix) @ w

    a, alpha = rates(x, q, moments)
    v, w = v + 0.5 * dt * a, w + 0.5 * dt * alpha
    x = x + dt * v
    h = dt / mrot
    for _ in range(mrot):
        w = part_2(part_3(w, h / 2), h / 2)
        q = part_1(q, w, h)
        w = part_3(part_2(w, h / 2), h / 2)
    a, alpha = rates(x, q, moments)
    return x, v + 0.5 * dt * a, q, w + 0.5 * dt * alpha


def gears_coefficients():
    """For six values: of equations of first and of second order, from products of (1 + x / j) and
    their integrals over [-1, 0]."""

    def product_to(last):
        return np.prod([Polynomial([1, 1 / j]) for j in range(1, last + 1)])

    first, second = product_to(4).integ().coef, 2 * product_to(3).integ(2).coef
    first[0], second[1] = -product_to(5).integ()(-1), -2 * product_to(4).integ()(-1)
    second[0] = 3 / 20  # which the test of polynomials confirms
    return first, second


class PlainGear:
    """The predictor-corrector with unscaled derivatives: y[n] are derivatives n of x,
    omega and q."""

    def __init__(self, x, v, q, w, moments):
        self.moments, self.y = moments, np.zeros((6, 10))
        self.y[0], self.y[1, :3] = [*x, *w, *q], v
        a, torque = rates(x, q, moments)
        self.y[2, :3], torque = a, moments * torque
        for n in range(5):
            w, q = self.y[: n + 1, 3:6], self.y[: n + 1, 6:]
            L = moments * w
            euler = sum(comb(n, j) * np.cross(L[j], w[n - j]) for j in range(n + 1)) + (
                torque if n == 0 else 0
            )
            self.y[n + 1, 3:6] = euler / moments
            self.y[n + 1, 6:] = 0.5 * sum(
                comb(n, j) * S(q[j]) @ [0, *w[n - j]] for j in range(n + 1)
            )

    def unit(self):
        self.y[0, 6:] /= np.linalg.norm(self.y[0, 6:])

    def step(self, dt):
        y, (first, second) = self.y, gears_coefficients()
        for n in range(6):
            y[n] = sum(y[n + m] * dt**m / factorial(m) for m in range(6 - n))
        self.unit()
        x, w, q = y[0, :3], y[0, 3:6].copy(), y[0, 6:].copy()
        a, alpha = rates(x, q, self.moments)

        def correct(k, coefficients, order, right):
            error = (right - y[order, k]) * dt**order / factorial(order)
            for n in range(6):
                y[n, k] += coefficients[n] * error * factorial(n) / dt**n

        correct(slice(0, 3), second, 2, a)
        correct(slice(3, 6), first, 1, alpha + np.cross(self.moments * w, w) / self.moments)
        correct(slice(6, 10), first, 1, 0.5 * S(q) @ [0, *y[0, 3:6]])
        self.unit()


def omega(bodies):
    return body_momentum(bodies.q, bodies.p)[1:] / bodies.moment


@pytest.mark.parametrize("dt, steps, mrot", [(0.2, 1, 1), (-0.2, 1, 1), (0.2, 1, 3), (0.05, 15, 1)])
def test_mn_equals_its_equations(dt, steps, mrot):
    """Locks out a wrong sign or coefficient in a part of (2.61), parts in another order, inner
    steps of a wrong length, and a p in the state that is not 2 S(q) (0, I omega)."""
    first = start(2, 1)
    got = move_mn(make(*first), dt, steps, mrot)
    for b in range(2):
        x, v, q, p = (row[:, b] for row in first)
        w = 0.5 * (S(q).T @ p)[1:] / ASYMMETRIC
        for _ in range(steps):
            x, v, q, w = paper_mn(x, v, q, w, ASYMMETRIC, dt, mrot)
        for have, want in (got.x, x), (got.v, v), (got.q, q), (omega(got), w):
            np.testing.assert_allclose(have[:, b], want, rtol=0, atol=2e-12 if steps > 1 else 3e-15)


@pytest.mark.parametrize("dt, steps", [(0.1, 1), (0.02, 200)])
def test_gear_equals_its_equations(dt, steps):
    """Locks out a wrong coefficient, start, prediction or order of corrections, quaternions left
    unnormalised, and derivatives that are lost between two passes."""
    first = start(5, 2)
    got = move_gear(for_gear(*first), dt, steps)
    for b in range(5):
        x, v, q, p = (row[:, b] for row in first)
        plain = PlainGear(x, v, q, 0.5 * (S(q).T @ p)[1:] / ASYMMETRIC, ASYMMETRIC)
        for _ in range(steps):
            plain.step(dt)
        want = plain.y[0, :3], plain.y[1, :3], plain.y[0, 6:], plain.y[0, 3:6]
        for have, right in zip((got.x, got.v, got.q, omega(got)), want):
            np.testing.assert_allclose(
                have[:, b], right, rtol=0, atol=1e-11 if steps > 1 else 2e-14
            )
        derivatives = got.state[block.ROWS :, b].reshape(5, 10) * [
            [dt**n / factorial(n)] for n in range(1, 6)
        ]
        scaled = plain.y[1:] * [[dt**n / factorial(n)] for n in range(1, 6)]
        np.testing.assert_allclose(derivatives, scaled, rtol=0, atol=1e-11 if steps > 1 else 2e-14)


# ---- what theory says of them


# ---- in LAMMPS


@pytest.mark.parametrize("fix", [MN, GEAR], ids=["MN", "Gear"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_all_kinds_of_bodies(simulate, fix, dimension):
    """Locks out equations of motion other than NVE's for one kind of body, forces that do not reach
    it or atoms that do not follow: the distance between the two trajectories falls with dt^2; in
    two dimensions nothing leaves the plane."""
    kinds = "solid planar pair row single" if dimension == 3 else "planar pair row single"
    system = (
        smooth(kinds) if dimension == 3 else mixture(kinds, side=5, dimension=2, temperature=0.3)
    )
    off = []
    for n in 50, 100:
        theirs, ours = (simulate(system, one, n, dt=100 / n, every=n) for one in (NVE, fix))
        off.append(apart(ours, theirs, system.h))
    if dimension == 2:
        np.testing.assert_array_equal(ours.v[:, 2], 0.0)
        np.testing.assert_array_equal(ours.x[:, 2], ours.x[0, 2])
        if fix == MN:
            assert max(off) == 0.0  # both are exact there
            return
    print("apart:", off)
    assert 1e-9 < off[1] < 1e-3
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.25)


@pytest.mark.parametrize("fix", [MN, GEAR], ids=["MN", "Gear"])
def test_migration(simulate, fix):
    """Locks out derivatives, or anything else of a body, that do not follow its atoms to other
    ranks: a hot system that re-neighbours at every step moves on several ranks as on one."""
    system = hot_rods()
    how = dict(before="neigh_modify every 1 delay 0 check no", every=25, dt=2)
    begin, alone = simulate(system, fix, 0, **how), simulate(system, fix, 25, **how)
    for grid in [(2, 1, 1), (8, 1, 1)] if fix == GEAR else [(2, 2, 1)]:
        split = system._replace(
            setup=system.setup.replace("read_data", "processors {} {} {}\nread_data".format(*grid))
        )
        many = simulate(split, fix, 25, ranks=int(np.prod(grid)), **how)
        cells = [np.floor(run.x / np.diag(system.h) * grid) for run in (begin, many)]
        assert (cells[0] != cells[1]).any(axis=1).sum() > 1, "hardly an atom has changed its rank"
        assert apart(many, alone, system.h) < 1e-9
        np.testing.assert_allclose(many.thermo["TotEng"], alone.thermo["TotEng"], rtol=1e-10)


def test_gears_derivatives_go_on(simulate):
    """Locks out a new start where a run goes on, and derivatives that hang on what is printed: with
    reinit no, with `pre no` and with another output the trajectory is that of one run to the last
    bit; bodies that are made anew start anew."""
    system = mixture()
    whole = simulate(system, GEAR, 40)
    same = simulate(system, GEAR, 40, every=1)
    on = simulate(system, GEAR, 20, after="run 20 pre no")
    kept = simulate(system, GEAR, 20, words="molecule reinit no", after="run 20")
    anew = simulate(system, GEAR, 20, after="run 20")
    for run in same, on:
        np.testing.assert_array_equal(run.x, whole.x)
        np.testing.assert_array_equal(run.v, whole.v)
    assert apart(kept, whole, system.h) < 1e-12
    assert 1e-9 < apart(anew, whole, system.h) < 1e-3


@pytest.mark.parametrize(
    "words, before, expected, ranks",
    [
        ("molecule mrot 2", "", "keywords mrot and order", 1),
        ("molecule order 123", "", "keywords mrot and order", 2),
        ("molecule", TWO, "run_style verlet", 2),
    ],
)
def test_what_gear_refuses(simulate, words, before, expected, ranks):
    """Locks out words that are taken and do nothing,
    and forces of levels that Gear would mix up."""
    run = simulate(
        smooth(), GEAR, 1, words=words, before=before, ranks=ranks, check=False, timeout=60
    )
    assert run.code != 0 and [
        line for line in run.screen.splitlines() if line.startswith("ERROR") and expected in line
    ]
