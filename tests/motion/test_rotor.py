"""The free rotor against the paper's own formulas, the exact motion of a top,
and its conservation laws.

Space vectors are taken from quaternions by multiplication, not by the package's matrices.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fix_nosquish.loops.compiled import F1, F2, F, I, loop
from fix_nosquish.motion import rotor
from support.rotors import (
    ASYMMETRIC,
    P,
    S,
    advance,
    body_momentum,
    energy,
    product,
    space_momentum,
    tops,
)


@loop
def rotate_once(axis: I, q: F2, p: F2, moment: F1, dt: F, small: I):
    """One rotation of each body about a principal axis."""
    for b in range(q.shape[1]):
        qb, pb = (q[0, b], q[1, b], q[2, b], q[3, b]), (p[0, b], p[1, b], p[2, b], p[3, b])
        if axis == 1:
            permuted = rotor.permute_1(qb), rotor.permute_1(pb)
        elif axis == 2:
            permuted = rotor.permute_2(qb), rotor.permute_2(pb)
        else:
            permuted = rotor.permute_3(qb), rotor.permute_3(pb)
        rate = 1.0 / (4.0 * moment[b])
        qb, pb = rotor.rotation(qb, pb, permuted[0], permuted[1], rate, dt, small)
        for k in range(4):
            q[k, b], p[k, b] = qb[k], pb[k]


def paper(q, p, moments, dt, mrot):
    """Eqs. 2.53-2.57 for one body as they stand, with 4x4 matrices."""
    inner = dt / mrot
    for _ in range(mrot):
        for k, h in (3, inner / 2), (2, inner / 2), (1, inner), (2, inner / 2), (3, inner / 2):
            zeta = p @ P[k] @ q / (4 * moments[k - 1])
            c, s = np.cos(zeta * h), np.sin(zeta * h)
            q, p = c * q + s * P[k] @ q, c * p + s * P[k] @ p
    return q, p


def exact(q, p, moments, time):
    """One top's motion by Euler's equations and dq/dt = S(q) (0, omega) / 2, integrated tightly."""

    def slope(_, y):
        L, omega = y[4:], y[4:] / moments
        return np.concatenate([0.5 * S(y[:4]) @ [0, *omega], np.cross(L, omega)])

    start = np.concatenate([q, 0.5 * (S(q).T @ p)[1:]])
    y = solve_ivp(slope, (0, time), start, method="DOP853", rtol=3e-14, atol=1e-14).y[:, -1]
    return y[:4], 2.0 * S(y[:4]) @ [0, *y[4:]]


@pytest.mark.quick
def test_reference_matrices():
    """Locks out a reference that errs with the code: S(q) is orthogonal, and its columns turn as
    quaternions 1, i, j, k do."""
    q = tops(1, ASYMMETRIC, 0)[0]
    np.testing.assert_allclose(S(q[:, 0]).T @ S(q[:, 0]), np.eye(4), atol=1e-15)
    for k in 1, 2, 3:
        np.testing.assert_array_equal(P[k] @ q, product(q, np.eye(4)[:, k : k + 1]))


@pytest.mark.quick
@pytest.mark.parametrize("mrot", [1, 3])
@pytest.mark.parametrize("dt", [1e-3, 0.3, -0.3])
def test_equals_the_paper(dt, mrot):
    """Locks out a wrong sign in P_k, a factor of 4 or a half step missed, another order of axes,
    and inner steps of the wrong length."""
    q, p = tops(50, ASYMMETRIC, 1)
    got = advance(q, p, ASYMMETRIC, dt, mrot=mrot)
    wanted = np.array([paper(*pair, ASYMMETRIC, dt, mrot) for pair in zip(q.T, p.T)]).transpose(
        1, 2, 0
    )
    for have, want in zip(got, wanted):
        error = np.abs(have - want).max(axis=0) / np.linalg.norm(want, axis=0)
        assert error.max() < 12 * mrot * np.finfo(float).eps  # the paper's formulas round too


@pytest.mark.quick
@pytest.mark.parametrize("axis", [1, 2, 3])
@pytest.mark.parametrize("small", [True, False])
def test_each_rotation_to_four_ulp(axis, small):
    """Locks out a power series that is too short or has a wrong term, a fall-back that begins too
    late or loses its argument, and a sine and a cosine that do not belong together: (2.56) in long
    double, at angles from 1e-300 to 1e300."""
    n = 3000
    angle = np.geomspace(1e-300, rotor.SMALL, n) if small else np.geomspace(rotor.SMALL, 1e300, n)
    if small:
        angle[: n // 2] = np.linspace(0.0, rotor.SMALL, n // 2)
    rng = np.random.default_rng(8)
    q = tops(n, ASYMMETRIC, 8)[0]
    moment, dt = rng.uniform(0.5, 2.0, n), 0.37
    L = np.zeros((4, n))
    L[axis] = 2 * moment * angle / dt * rng.choice([-1, 1], n)
    p = 2.0 * product(q, L)
    turned, kicked = q.copy(), p.copy()
    rotate_once.bind_to(
        {"axis": axis, "q": turned, "p": kicked, "moment": moment, "dt": dt, "small": small}
    )()

    permuted = P[axis] @ q
    zeta = dt * (
        1
        / (4 * moment)
        * (p[0] * permuted[0] + p[1] * permuted[1] + p[2] * permuted[2] + p[3] * permuted[3])
    )
    wide = np.longdouble
    c, s = np.cos(zeta.astype(wide)), np.sin(zeta.astype(wide))
    size = np.abs(L[axis]).astype(wide) * 2
    size[size == 0] = 1
    for got, old, one in (turned, q, 1), (kicked, p, size):
        want = c * (old.astype(wide) / one) + s * ((P[axis] @ old).astype(wide) / one)
        ulp = np.abs(got.astype(wide) / one - want).max() / np.finfo(float).eps
        assert ulp < 4, (ulp, angle[np.abs(got.astype(wide) / one - want).max(axis=0).argmax()])


def test_fast_bodies_among_slow_ones():
    """Locks out angles beyond the power series' range that the look at a block's angles misses, in
    whichever lane and with whichever moment the smallest; and a fall-back that is another rotor."""
    q, p = tops(200, ASYMMETRIC, 9, speed=0.01)
    fast = np.arange(200) % 3 == 0
    for moments in ASYMMETRIC, ASYMMETRIC[::-1]:
        alone, spins = advance(q, p, moments, 0.3), np.zeros((4, 200))
        spins[1 + moments.argmin()] = 9.5  # beyond the range of the smallest moment only
        for swift in 1000 * p, 2 * product(q, spins):
            quick = np.where(fast, swift, p)
            got = advance(q, quick, moments, 0.3)
            want = np.array([paper(*pair, moments, 0.3, 1) for pair in zip(q.T, quick.T)])
            for slow, have, right in zip(alone, got, want.transpose(1, 2, 0)):
                size = np.linalg.norm(right, axis=0)
                off, changed = (np.abs(have - x).max(axis=0) / size for x in (right, slow))
                assert off.max() < 4e-14  # round-off of angles up to 30
                assert changed[~fast].max() < 20 * np.finfo(float).eps


@pytest.mark.quick
def test_kinds_side_by_side():
    """Locks out a body that is turned by the rotor of another kind, or with another body's moments,
    where kinds stand side by side in blocks that are not full: each moves as it does alone."""
    rng = np.random.default_rng(2)
    moments = np.array([ASYMMETRIC, [1.3, 1.3, 0.0], [0.0, 0.0, 0.0]]).T[:, rng.integers(0, 3, 150)]
    moments *= rng.uniform(0.5, 2.0, 150)
    q, p = tops(150, ASYMMETRIC, 2)
    L = body_momentum(q, p) * np.concatenate([np.ones((1, 150)), moments > 0])
    p = 2.0 * product(q, L)
    together = advance(q, p, moments, 0.3)
    for b in range(150):
        one = slice(b, b + 1)
        for got, want in zip(together, advance(q[:, one], p[:, one], moments[:, one], 0.3)):
            np.testing.assert_array_equal(got[:, one], want)
    still = moments[0] == 0
    np.testing.assert_array_equal(together[0][:, still], q[:, still])


def test_linear_rotor_is_exact():
    """Locks out a splitting of the linear rotor, and a division by zero for one at rest: with its
    axis 3 perpendicular to L, it turns about L by the angle |L| t / I."""
    moments = np.array([1.3, 1.3, 0.0])
    q, p = tops(40, moments, 3)
    p[:, 0] = 0.0
    L, time = space_momentum(q, p), 7.0
    turned, kicked = advance(q, p, moments, time)
    size = np.linalg.norm(L, axis=0)
    half = 0.5 * size * time / moments[0]
    turn = np.concatenate([[np.cos(half)], np.sin(half) * L / np.where(size > 0, size, 1)])
    np.testing.assert_allclose(turned, product(turn, q), atol=1e-14)
    np.testing.assert_allclose(kicked, product(turn, p), atol=3e-14)


def test_many_steps():
    """Locks out a norm of q, or a momentum along q, that creeps away; angular momentum that is not
    conserved in space; and an energy that drifts, as in integrators that are not symplectic."""
    n, dt, bunch, bunches = 4, 0.1, 1000, 300
    q, p = tops(n, ASYMMETRIC, 7)
    L, start, size = space_momentum(q, p), energy(q, p, ASYMMETRIC), np.linalg.norm(p, axis=0)
    energies = []
    for _ in range(bunches):
        q, p = advance(q, p, ASYMMETRIC, bunch * dt, mrot=bunch)  # inner steps are steps
        assert np.abs(np.linalg.norm(q, axis=0) - 1).max() < 1e-12
        assert (np.abs(body_momentum(q, p)[0]) / size).max() < 1e-10
        energies.append(energy(q, p, ASYMMETRIC) / start - 1)
    np.testing.assert_allclose(space_momentum(q, p), L, rtol=0, atol=1e-10 * size.max())
    energies = np.array(energies)
    assert 1e-6 < np.abs(energies).max() < 0.02  # bounded, by the error of a step of this length
    halves = energies.reshape(2, 10, bunches // 20, n).mean(
        axis=2
    )  # ten nearly independent blocks each
    shift = halves[1].mean(axis=0) - halves[0].mean(axis=0)
    error = np.sqrt(halves.var(axis=1, ddof=1).sum(axis=0) / 10)
    assert (np.abs(shift) < 5 * error + 1e-11).all(), (shift, error)
