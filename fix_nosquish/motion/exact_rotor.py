"""The exact free rotor: torque-free rotation of a rigid body over a time of any length.

By Jacobi's solution the angular momentum in the principal frame is given by elliptic functions, and
the orientation by one elliptic integral (van Zon and Schofield, J. Comput. Phys. 225, 145, 2007;
Celledoni, Fasso, Safstrom and Zanna, SIAM J. Sci. Comput. 30, 2084, 2008).  Here both are expressed
about the midpoint M of the time interval 2 h.  The phase of the elliptic functions is then not
needed, and rotation about a principal axis is no special case.

With a_1 = 1/I_3 - 1/I_2, a_2 = 1/I_3 - 1/I_1, a_3 = 1/I_2 - 1/I_1, none of them negative,

    X = a_3 L_2^2 + a_2 L_3^2      A = a_1 X      d = a_1 L_3^2 - a_3 L_1^2
    Y = a_2 L_1^2 + a_1 L_2^2      B = a_3 Y      N = X Y / L^2

are constants of the motion (d / |L| = (2 T - L^2 / I_2) / |L|, with the energy T, is called c), and
for A > B, with the modulus k^2 = B / A and u = sqrt(A) h (otherwise A and B are exchanged),

    S = sn(u) / sqrt(A)    C = cn(u) = sqrt(1 - A S^2)    D = dn(u) = sqrt(1 - B S^2)
    J = integral from 0 to h of S^2 / (1 - N S^2), of the third kind
    psi = 2 T h / |L| + c N J

M, the angular momentum after the time h, follows from the addition theorem of the elliptic
functions, with Delta = 1 - a_1 a_3 L_2^2 S^2:

    M_1 = (L_1 C + a_1 L_2 L_3 S D) / Delta
    M_2 = (L_2 C D - a_2 L_3 L_1 S) / Delta
    M_3 = (L_3 D + a_3 L_1 L_2 S C) / Delta

Both q and p are multiplied from the right by the unit quaternion

    r_0 = cos(psi) sqrt(E / F)             E = 1 - N S^2,   F = 1 - a_1 a_3 M_2^2 S^2
    r_1 = M_1 (G - a_3 S H) C              G = C D sin(psi) - c S cos(psi),  H = |L| E cos(psi)
    r_2 = M_2 G C D                        r_1 to r_3 all divided by |L| C D sqrt(E F)
    r_3 = M_3 (G + a_1 S H) D

For a symmetric top a_1 or a_3 is zero and all functions are elementary.  Where A h^2 and B h^2 are
small, S and J are computed by power series, for all bodies of a block at once.  Otherwise the time
is divided into parts that are small.
"""

from math import ceil, cos, factorial, sin, sqrt

from ..loops.compiled import contracted, inlined
from .block import LANES, MOMENT, OWN, P, Q, four, three, write
from .frames import angular_momentum
from .rotor import s_times, series, turn

LITTLE = 1 / 32  # up to this (A + B) h^2 the power series are exact to rounding
SMALL = 0.5  # up to this psi so are the series of sine and cosine; see `rotor.SMALL`
MOST = 1e4  # largest number of parts; a body that rotates faster becomes NaN, which ends the run
FAR = OWN  # row: 1.0 for a body that the power series cannot advance in one part

# S / h, for powers of x = (A + B) h^2, y = A B h^4: coefficients of x^n y^k, from S'' = -(A + B) S
# + 2 A B S^3
_S = tuple(
    tuple((-1) ** n * c / factorial(2 * n + 4 * k + 1) for n, c in enumerate(row))
    for k, row in enumerate((
        (1, 1, 1, 1, 1, 1, 1, 1),
        (12, 132, 1224, 11064, 99636, 896796),
        (3024, 132624, 4095792, 111810672),
        (4390848, 490287168),
    ))
)  # fmt: skip
((_S00, _S10, _S20, _S30, _S40, _S50, _S60, _S70), (_S01, _S11, _S21, _S31, _S41, _S51),
 (_S02, _S12, _S22, _S32), (_S03, _S13)) = _S  # fmt: skip


@contracted
def sine_amplitude(e, f, h):
    """S, from e = A + B and f = A B, for e h^2 <= LITTLE."""
    t = h * h
    x, y = e * t, f * t * t
    s3 = _S03 + x * _S13
    s2 = _S02 + x * (_S12 + x * (_S22 + x * _S32))
    s1 = _S01 + x * (_S11 + x * (_S21 + x * (_S31 + x * (_S41 + x * _S51))))
    s0 = x * (_S20 + x * (_S30 + x * (_S40 + x * (_S50 + x * (_S60 + x * _S70)))))
    return h + h * (x * (_S10 + s0) + y * (s1 + y * (s2 + y * s3)))


@contracted
def third_kind(e, f, g, s):
    """J, from e = A S^2 + B S^2, f = A B S^4, g = N S^2 and S.

    With x = s^2 / S^2 it is the integral of s^2 / ((1 - g x) sqrt(1 - e x + f x^2)) from 0 to S.
    The power series of 1 / sqrt has Legendre polynomials as coefficients; 1 / (1 - g x) sums them.
    """
    half = 0.5 * e
    w1 = half
    w2 = 1.5 * half * w1 - 0.5 * f
    w3 = (5 / 3) * half * w2 - (2 / 3) * f * w1
    w4 = 1.75 * half * w3 - 0.75 * f * w2
    w5 = 1.8 * half * w4 - 0.8 * f * w3
    w6 = (11 / 6) * half * w5 - (5 / 6) * f * w4
    w7 = (13 / 7) * half * w6 - (6 / 7) * f * w5
    w8 = 1.875 * half * w7 - 0.875 * f * w6
    c1 = w1 + g
    c2 = w2 + g * c1
    c3 = w3 + g * c2
    c4 = w4 + g * c3
    c5 = w5 + g * c4
    c6 = w6 + g * c5
    c7 = w7 + g * c6
    c8 = w8 + g * c7
    total = 1 / 3 + c1 * (1 / 5) + c2 * (1 / 7) + c3 * (1 / 9) + c4 * (1 / 11)
    total += c5 * (1 / 13) + c6 * (1 / 15) + c7 * (1 / 17) + c8 * (1 / 19)
    return s * s * s * total


@contracted
def rotation_of(l1, l2, l3, inverse_1, inverse_2, inverse_3, h, small):
    """The rotation r of a body in the time 2 h, for (A + B) h^2 <= LITTLE.

    Args:
        l1, l2, l3: initial L, principal frame.  inverse_1, inverse_2, inverse_3: inverse moments.
        small: whether |psi| <= SMALL; otherwise its sine and cosine are computed by libm.
    Returns:
        (1 - r_0, r_1, r_2, r_3), (A + B) h^2, psi.
    """
    a1, a2, a3 = inverse_3 - inverse_2, inverse_3 - inverse_1, inverse_2 - inverse_1
    x1, x2, x3 = l1 * l1, l2 * l2, l3 * l3
    square = x1 + x2 + x3
    size = sqrt(square)
    size = size if size > 0.0 else 1.0
    x, y = a3 * x2 + a2 * x3, a2 * x1 + a1 * x2
    a, b, d = a1 * x, a3 * y, a1 * x3 - a3 * x1
    e, f, a13 = a + b, a * b, a1 * a3
    s = sine_amplitude(e, f, h)
    t = s * s
    c_2, d_2, delta = 1.0 - a * t, 1.0 - b * t, 1.0 - a13 * x2 * t
    cn, dn = sqrt(c_2), sqrt(d_2)
    cd = cn * dn
    one = 1.0 / (size * cd * delta)
    per_size = one * cd * delta
    per_delta = one * size * cd
    m1 = (l1 * cn + a1 * s * dn * l2 * l3) * per_delta
    m2 = (l2 * cd - a2 * s * l3 * l1) * per_delta
    m3 = (l3 * dn + a3 * s * cn * l1 * l2) * per_delta
    n, c = x * y * per_size * per_size, d * per_size
    g = n * t
    twice = x1 * inverse_1 + x2 * inverse_2 + x3 * inverse_3
    psi = twice * per_size * h + c * n * third_kind(e * t, f * t * t, g, s)
    if small:
        sine, versine = series(psi)
        cosine = 1.0 - versine
    else:
        sine, cosine = sin(psi), cos(psi)
    big_e, big_f = 1.0 - g, 1.0 - a13 * m2 * m2 * t
    root = 1.0 / sqrt(big_e * big_f)
    big_g = cd * sine - c * s * cosine
    lift = s * size * big_e * cosine
    factor = root * one * delta  # 1 / (|L| C D sqrt(E F))
    r0 = cosine * big_e * root
    r1 = m1 * (big_g - a3 * lift) * cn * factor
    r2 = m2 * big_g * cd * factor
    r3 = m3 * (big_g + a1 * lift) * dn * factor
    versine = (r1 * r1 + r2 * r2 + r3 * r3) / (1.0 + r0) if small else 1.0 - r0
    return (versine, r1, r2, r3), e * h * h, psi


@inlined
def turned(q, rotation):
    """q times r, for q a quaternion or its momentum, and the rotation of `rotation_of`."""
    versine, r1, r2, r3 = rotation
    return turn(1.0, versine, q, s_times(q, r1, r2, r3))


@inlined
def free_top(q, p, moment_1, moment_2, moment_3, dt):
    """Advance (q, p) by dt, in parts with (A + B) h^2 <= LITTLE."""
    inverse_1, inverse_2, inverse_3 = 1.0 / moment_1, 1.0 / moment_2, 1.0 / moment_3
    l1, l2, l3 = angular_momentum(q, p)
    _, little, _ = rotation_of(l1, l2, l3, inverse_1, inverse_2, inverse_3, 0.5 * dt, False)
    parts = ceil(sqrt(little / LITTLE))
    number = int(parts) if 1.0 < parts < MOST else 1  # parts is NaN in a run that has blown up
    half = 0.5 * dt / number
    for _ in range(number):
        l1, l2, l3 = angular_momentum(q, p)
        rotation, _, _ = rotation_of(l1, l2, l3, inverse_1, inverse_2, inverse_3, half, False)
        q, p = turned(q, rotation), turned(p, rotation)
    return q, p


@inlined
def rotate_exactly(block, dt):
    """Exact free rotation of a block of rotors.

    The first loop leaves bodies that its power series cannot advance; the second one moves them.
    """
    for b in range(LANES):
        q, p, (i1, i2, i3) = four(block, Q, b), four(block, P, b), three(block, MOMENT, b)
        l1, l2, l3 = angular_momentum(q, p)
        (versine, r1, r2, r3), little, psi = rotation_of(
            l1, l2, l3, 1.0 / i1, 1.0 / i2, 1.0 / i3, 0.5 * dt, True
        )
        near = little <= LITTLE and abs(psi) <= SMALL
        rotation = (
            versine if near else 0.0, r1 if near else 0.0, r2 if near else 0.0, r3 if near else 0.0,
        )  # fmt: skip
        write(block, Q, b, turned(q, rotation))
        write(block, P, b, turned(p, rotation))
        block[FAR, b] = 0.0 if near else 1.0
    far = 0
    for b in range(LANES):
        far += int(block[FAR, b])
    if far:
        for b in range(LANES):
            if block[FAR, b] > 0.0:
                q, p, (i1, i2, i3) = four(block, Q, b), four(block, P, b), three(block, MOMENT, b)
                q, p = free_top(q, p, i1, i2, i3, dt)
                write(block, Q, b, q)
                write(block, P, b, p)
