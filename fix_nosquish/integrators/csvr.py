"""Stochastic velocity rescaling.

Bussi, Donadio and Parrinello, J. Chem. Phys. 126, 014101 (2007).
"""

from math import exp, log, sqrt

from ..loops.compiled import inlined
from ..motion.philox import minus_log, normal_pair
from .rescaling import Rescaling, scaling_by
from .thermostat import OF_THERMOSTATS, thermalise_piston, words_of_all


@inlined
def normal_and_uniform(parameters, attempt):
    """A standard normal deviate, and minus the logarithm of a uniform one."""
    w0, w1, w2, _ = words_of_all(parameters, attempt)
    return normal_pair(w0, w1)[0], minus_log(w2)


@inlined
def sum_of_squares(parameters, n, attempt):
    """The sum of the squares of n independent standard normal deviates: twice a gamma deviate of
    shape n // 2 (Marsaglia and Tsang, ACM Trans. Math. Softw. 26, 363, 2000), plus the square of
    one normal deviate if n is odd."""
    result, pairs = 0.0, n // 2
    if n % 2:
        x, _ = normal_and_uniform(parameters, attempt)
        result = x * x
    d = pairs - 1.0 / 3.0
    while pairs > 0:
        attempt += 1
        x, e = normal_and_uniform(parameters, attempt)
        v = 1.0 + x / sqrt(9.0 * d)
        v = v * v * v
        if v > 0.0 and -e < 0.5 * x * x + d - d * v + d * log(v):
            result += 2.0 * d * v
            pairs = 0
    return result


@inlined
def draw_factor(parameters, state, k, dt):
    """The factor of velocities: Bussi, Donadio and Parrinello (2007), eq. A7; and 0."""
    first, keep = OF_THERMOSTATS[k], exp(-parameters.rate * dt)
    ratio = (1.0 - keep) * parameters.kt / parameters.energies[k]
    x, _ = normal_and_uniform(parameters, first)
    others = sum_of_squares(parameters, int(parameters.degrees[k]) - 1, first + 1)
    square = keep + ratio * (x * x + others) + 2.0 * x * sqrt(keep * ratio)
    sign = 1.0 if x + sqrt(keep / ratio) >= 0.0 else -1.0
    return sign * sqrt(square), 0


class Csvr(Rescaling):
    """Keyword thermostat csvr."""

    acts, on_piston = scaling_by(draw_factor), thermalise_piston
    method = "stochastic velocity rescaling"
