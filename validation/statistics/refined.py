"""Averages over configurations without the error of the time step, to second order.

A global thermostat in the middle of the step samples exp(-H'/kT') of the shadow Hamiltonian

    H' = U + K + h^2/12 v U'' v - S,    S = h^2/24 (sum of F^2/M + sum of torque_k^2/I_k),

where T' is such that the kinetic energy of the middle of the step has the temperature T.  Over
velocities, and with integration by parts for the second derivatives, to the order h^2

    <A> = <A>_h + (cov(A, S) - h^2/12 <dA/dt dU/dt>) / kT + cov(A, U) 2 <S> / (f kT^2)

with f degrees of freedom.  The last term is the change of T; <dA/dt dU/dt> is kT times the product
of the gradients of A and U, over masses.  Own derivation, in docs/algorithm.md.
"""

import numpy as np

STEPS = 4  # one after the other, of which a rate of change follows


def rate(x: np.ndarray, h: float) -> np.ndarray:
    """dx/dt in the middle of four steps, (n,) of (n, 4): of fourth order in the time h between
    them, as the fastest motions have few steps each period."""
    return (27 * (x[:, 2] - x[:, 1]) - (x[:, 3] - x[:, 0])) / (24 * h)


def blocks(steps: np.ndarray) -> np.ndarray:
    """Where among printed steps, (m,), there are four one after the other behind others that are
    not, (n, 4)."""
    ahead = np.diff(steps, prepend=-np.inf) > 1
    places = np.flatnonzero(ahead[: 1 - STEPS or None])[:, None] + np.arange(STEPS)
    return places[steps[places[:, -1]] - steps[places[:, 0]] == STEPS - 1]


def series(
    a: np.ndarray, u: np.ndarray, s: np.ndarray, h: float, kt: float, freedom: float
) -> np.ndarray:
    """A series whose mean is the refined average, and whose fluctuations are its noise, (n,).

    Args:
        a: the quantity, at four steps one after the other, (n, 4); it must not depend on
            velocities.
        u, s: potential energy and S, (n, 4).
        h: time step.
        kt: of the thermostat.
        freedom: degrees of freedom that it acts on.
    """
    slopes = rate(a, h) * rate(u, h)
    a, u, s = a[:, 1], u[:, 1], s[:, 1]
    of_a, of_u, of_s = (x - x.mean() for x in (a, u, s))
    warmer = 2 / (freedom * kt**2)  # times <S> the change of 1/kT, less
    bent = (of_a * of_s - h**2 / 12 * slopes) / kt
    return a + bent + warmer * (of_a * of_u * s.mean() + (of_a * of_u).mean() * of_s)
