"""Compositions of exactly solved parts (2.20), and derivatives of them to rounding error.

All functions of a state take arrays whose first axis is the state and whose further axes are states
side by side. Derivatives come from complex numbers: first ones from a complex step, others from
Cauchy's integral on a circle of times, so all functions must be analytic, without absolute values
or comparisons of what is differentiated. The circle's radius is to be short beside the fastest
motion and, for the sake of rounding errors, not shorter than need be.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import null_space

from ..statistics.estimate import Estimate

State = np.ndarray  # (rows, ...), real or complex
Energy = Callable[[State], np.ndarray]
Motion = Callable[[State, float], State]  # where a state is after some time
POINTS = 32  # on the circle; a singularity at three times its radius adds an error of 3^-32


class Part(NamedTuple):
    """A term of a Hamiltonian: its energy of a state, and the motion under it alone, a function of
    state and time."""

    energy: Energy
    motion: Motion


def composed(first: Motion, then: Motion) -> Motion:
    """One motion after the other, each for the whole time."""
    return lambda x, time: then(first(x, time), time)


def repeated(motion: Motion, n: int) -> Motion:
    """A motion in n steps."""

    def steps(x, time):
        for _ in range(n):
            x = motion(x, time / n)
        return x

    return steps


def strang(parts: Sequence[Part]) -> Motion:
    """The symmetric composition: half of the first part, all others, half of the first part (2.20,
    2.53)."""
    outer, *inner = parts
    if not inner:
        return outer.motion
    middle = strang(inner)
    return lambda x, time: outer.motion(middle(outer.motion(x, time / 2), time), time / 2)


def fourth_order(motion: Motion) -> Motion:
    """A symmetric second-order step made fourth order: three steps, the middle one backwards in
    time."""
    outer = 1 / (2 - 2 ** (1 / 3))

    def step(x, time):
        for part in (outer, 1 - 2 * outer, outer):
            x = motion(x, part * time)
        return x

    return step


def taylor(function: Callable, order: int, radius: float) -> State:
    """The coefficient of time^order in a function of time at 0, by Cauchy's integral.

    Args:
        function: takes complex times (n,), gives an array (..., n).
        radius: of the circle, a time.
    """
    times = radius * np.exp(2j * np.pi * np.arange(POINTS) / POINTS)
    return (function(times) * times**-order).mean(axis=-1)


def leading_term(parts: Sequence[Part], radius: float) -> Energy:
    """H^(2) of (2.37) for the symmetric composition of parts, a function of a state.

    For two parts -{h1 + 2 h2, {h1, h2}} / 24 with h1 outside. A Poisson bracket {h, f} is the
    change of f in the motion under h, so both double brackets are second derivatives along a part's
    motion: {h1, {h1, h2}} = d^2/ds^2 h2(e^{s L1} x) and {h2, {h1, h2}} = -d^2/ds^2 h1(e^{s L2} x).
    More parts: the first one outside of all others, whose own composition has the right second
    derivative.

    Args:
        parts: list of `Part`, outermost first.
        radius: see `taylor`.
    """

    def twice(energy, motion, x):
        """The second derivative of an energy along a motion."""
        return 2 * taylor(lambda s: energy(motion(x, s)), 2, radius)

    def term(x):
        wide, total = x[..., None], 0.0
        for k, (energy, motion) in enumerate(parts[:-1]):
            inner = parts[k + 1 :]
            total += sum(twice(part.energy, motion, wide) for part in inner)
            total -= 2 * twice(energy, strang(inner), wide)
        return -total / 24 if np.iscomplexobj(x) else -total.real / 24

    return term


def recursion_terms(
    step: Motion, exact: Motion, energy: Energy, second: Energy, x: State, radius: float
) -> np.ndarray:
    """The two terms of (2.30) for n = 1, G^(0) . grad H^(1) and G^(1) . grad H^(0), whose sum is to
    vanish.

    Args:
        step: a symmetric step of second order; G^(1) is what its modified equations (2.24) have of
            order dt^2.
        exact: any step of fourth order for the same equations.
        energy, second: H^(0) and H^(1), functions of a state.
        x: states (n, ...).
    """
    x = x[..., None]
    field = taylor(lambda s: step(x, s) - exact(x, s), 3, radius).real[..., None]
    first = taylor(lambda s: second(exact(x, s)), 1, radius)
    return np.stack([first, taylor(lambda s: energy(x + s * field), 1, radius)]).real


def jacobian(function: Callable[[State], State], x: State) -> np.ndarray:
    """d function(x)_i / d x_j at a real state, (n, m), by complex steps."""
    tiny = 1e-30
    return function(x[:, None] + 1j * tiny * np.eye(len(x))).imag / tiny


def metric(n: int) -> np.ndarray:
    """g^-1 of (2.34) for n momenta and n coordinates, (2n, 2n)."""
    g = np.zeros((2 * n, 2 * n))
    g[:n, n:], g[n:, :n] = np.eye(n), -np.eye(n)
    return g


def symplectic_defect(J: np.ndarray) -> float:
    """max |J g^-1 J^T - g^-1| (2.42)."""
    g = metric(len(J) // 2)
    return float(np.abs(J @ g @ J.T - g).max())


def tangent(constraints: Callable[[State], State], x: State) -> np.ndarray:
    """An orthonormal basis of the directions in which no constraint changes, (n, directions)."""
    return null_space(jacobian(constraints, x))


def restricted(moved: np.ndarray, basis: np.ndarray) -> tuple[float, float]:
    """What (2.42) becomes on a constrained phase space.

    There the form of two directions u, v is u^T g v, and a step is symplectic if it keeps it. For a
    basis B, of `tangent`:

        B^T J^T g J B = B^T g B

    Args:
        moved: J B.

    Returns:
        (2-norm of the difference of the two sides, the factor by which the step changes the volume
        that belongs to the form).
    """
    g = metric(len(basis) // 2)
    after, before = moved.T @ g @ moved, basis.T @ g @ basis
    volume = np.sqrt(np.linalg.det(after) / np.linalg.det(before))
    return float(np.linalg.norm(after - before, 2)), float(volume)


def slope(x: Sequence[float] | np.ndarray, y: Sequence[float] | np.ndarray) -> Estimate:
    """The exponent of y ~ x^exponent, from a straight line through the logarithms."""
    (exponent, _), covariance = np.polyfit(np.log(x), np.log(y), 1, cov=True)
    return Estimate(float(exponent), float(np.sqrt(covariance[0, 0])), len(x) - 2)
