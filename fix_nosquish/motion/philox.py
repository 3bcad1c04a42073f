"""Counter-based random numbers: Philox 4x32-10 of Salmon, Moraes, Dror and Shaw (SC11, 2011).

A random number depends on a key and a counter only.  Ranks that share a body therefore draw the
same numbers without communication, and a restarted run continues the same random sequence.
Words are 32-bit integers.  Normal deviates use the Box-Muller method, with a logarithm, sine and
cosine that the compiler can vectorise.
"""

from math import floor, log, pi, sqrt

import numpy as np

from ..loops.compiled import contracted, inlined

WORD = 0xFFFFFFFF
_FACTOR_0, _FACTOR_1 = 0xD2511F53, 0xCD9E8D57
_STEP_0, _STEP_1 = 0x9E3779B9, 0xBB67AE85  # increments of the key per round
_HALF_WORD = 2.0**30  # an ID is split into two words of 30 bits, which convert fast
_QUARTER, _QUARTERS = 0x3FFFFFFF, 30  # mask of the angle in its quadrant; shift to the quadrant
_LOG_2, _ROOT_HALF = log(2.0), sqrt(0.5)


@inlined
def _round(c0, c1, c2, c3, k0, k1):
    a, b = c0 * _FACTOR_0, c2 * _FACTOR_1
    return (b >> 32 & WORD) ^ c1 ^ k0, b & WORD, (a >> 32 & WORD) ^ c3 ^ k1, a & WORD


@inlined
def _two_rounds(c, k0, k1):
    c0, c1, c2, c3 = _round(c[0], c[1], c[2], c[3], k0 & WORD, k1 & WORD)
    return _round(c0, c1, c2, c3, k0 + _STEP_0 & WORD, k1 + _STEP_1 & WORD)


@inlined
def philox(c0, c1, c2, c3, k0, k1):
    """Four words from a counter (c0, c1, c2, c3) and a key (k0, k1): ten rounds."""
    c = _two_rounds((c0, c1, c2, c3), k0, k1)
    c = _two_rounds(c, k0 + 2 * _STEP_0, k1 + 2 * _STEP_1)
    c = _two_rounds(c, k0 + 4 * _STEP_0, k1 + 4 * _STEP_1)
    c = _two_rounds(c, k0 + 6 * _STEP_0, k1 + 6 * _STEP_1)
    return _two_rounds(c, k0 + 8 * _STEP_0, k1 + 8 * _STEP_1)


@inlined
def words(number, step, draw, k0, k1):
    """Four words for a body.

    Args:
        number: the body's ID, an integral float of at most 2^53.
        step: time step of the run.  draw: index of the draw in this step, below 4096.
        k0, k1: the key.
    """
    high = floor(number * (1.0 / _HALF_WORD))
    low = np.int32(number - high * _HALF_WORD)
    above = np.int32(high)
    return philox(
        int(low),
        int(above) & WORD,
        int(step) & WORD,
        int(draw) << 20 | int(step) >> 32 & 0xFFFFF,
        int(k0),
        int(k1),
    )


@contracted
def minus_log(word):
    """-ln((word + 1) / 2^32)."""
    m, e = word + 1.0, 0.0
    m, e = (m * 65536.0, 16.0) if m < 65536.0 else (m, e)
    m, e = (m * 256.0, e + 8.0) if m < 16777216.0 else (m, e)
    m, e = (m * 16.0, e + 4.0) if m < 268435456.0 else (m, e)
    m, e = (m * 4.0, e + 2.0) if m < 1073741824.0 else (m, e)
    m, e = (m * 2.0, e + 1.0) if m < 2147483648.0 else (m, e)
    y = m * 2.0**-32  # from 1/2 to 1
    y, e = (y + y, e + 1.0) if y < _ROOT_HALF else (y, e)
    s = (y - 1.0) / (y + 1.0)
    x = s * s
    sum = x * (1 / 13 + x * (1 / 15 + x * (1 / 17 + x * (1 / 19))))
    sum = x * (1 / 3 + x * (1 / 5 + x * (1 / 7 + x * (1 / 9 + x * (1 / 11 + sum)))))
    return e * _LOG_2 - 2.0 * (s + s * sum)


@contracted
def direction(word):
    """Cosine and sine of 2 pi (word + 1/2) / 2^32, up to a rotation common to all words."""
    quarter = word >> _QUARTERS
    a = ((word & _QUARTER) - 536870911.5) * (0.5 * pi / 1073741824.0)
    x = a * a
    s = x * (1 / 362880 - x * (1 / 39916800 - x * (1 / 6227020800 - x * (1 / 1307674368000))))
    s = a - a * (x * (1 / 6 - x * (1 / 120 - x * (1 / 5040 - s))))
    c = x * (1 / 40320 - x * (1 / 3628800 - x * (1 / 479001600 - x * (1 / 87178291200))))
    c = 1.0 - x * (1 / 2 - x * (1 / 24 - x * (1 / 720 - c)))
    sign = 1.0 - (quarter & 2)
    odd = quarter & 1
    return sign * (-s if odd else c), sign * (c if odd else s)


@inlined
def normal_pair(a, b):
    """Two independent standard normal deviates, from two words."""
    r = sqrt(2.0 * minus_log(a))
    c, s = direction(b)
    return r * c, r * s
