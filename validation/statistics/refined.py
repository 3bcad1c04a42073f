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

BEFORE, AFTER = 1, 2  # samples at the begin and at the end that the derivative needs


def rate(x: np.ndarray, h: float) -> np.ndarray:
    """dx/dt between samples 1 and 2, 2 and 3, ... of a series with h between samples: of fourth
    order, as the fastest motions have few samples each period; (n - 3,)."""
    return (27 * (x[2:-1] - x[1:-2]) - (x[3:] - x[:-3])) / (24 * h)


def series(
    a: np.ndarray, u: np.ndarray, s: np.ndarray, h: float, kt: float, freedom: float
) -> np.ndarray:
    """A series whose mean is the refined average, and whose fluctuations are its noise, (n - 3,).

    Args:
        a: the quantity, (n,) of n steps one after the other; it must not depend on velocities.
        u, s: potential energy and S, (n,). If ``a`` is the same array as ``u``, S tells the product
            of the gradients, with less noise.
        h: time step.
        kt: of the thermostat.
        freedom: degrees of freedom that it acts on.
    """
    exact = 24 * kt / h**2 * s[BEFORE:-AFTER]
    slopes = exact if a is u else rate(a, h) * rate(u, h)
    a, u, s = (x[BEFORE:-AFTER] for x in (a, u, s))
    of_a, of_u, of_s = (x - x.mean() for x in (a, u, s))
    warmer = 2 / (freedom * kt**2)  # times <S> the change of 1/kT, less
    bent = (of_a * of_s - h**2 / 12 * slopes) / kt
    return a + bent + warmer * (of_a * of_u * s.mean() + (of_a * of_u).mean() * of_s)
