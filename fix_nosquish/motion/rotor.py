"""The free rotor: eqs. 2.52-2.57 of Miller et al., J. Chem. Phys. 116, 8649 (2002).

A rigid body's orientation is a unit quaternion q and its conjugate momentum p.
The rotational Hamiltonian is a sum of h_k = [p . P_k q]^2 / (8 I_k), one for each
principal axis k, and the motion under each h_k alone is an exact rotation:

    zeta_k = (p . P_k q) / (4 I_k)
    q <- cos(zeta_k dt) q + sin(zeta_k dt) P_k q        (2.56)
    p <- cos(zeta_k dt) p + sin(zeta_k dt) P_k p

The free rotation is the symmetric product 3,2,1,2,3 of these (2.53).  Principal moments are
numbered I_1 >= I_2 >= I_3, so the smallest moment (the fastest axis) is outermost:
for TIP3P water the reverse order has about ten times the energy error.

Quaternions are tuples (scalar part first).  The functions are inlined into the
loops of `operations.py`; where `small` is true all angles are below SMALL, and the
compiler vectorises over the bodies.
"""

from math import cos, sin, sqrt

from ..loops.compiled import contracted, inlined

SMALL = 0.5  # radians; below it sine and cosine are computed by power series

# 1 / n!, with the signs of the series of sin(a) / a and of (1 - cos(a)) / a^2
_S2, _S4, _S6, _S8, _S10, _S12 = (
    -1 / 6,
    1 / 120,
    -1 / 5040,
    1 / 362880,
    -1 / 39916800,
    1 / 6227020800,
)
_C0, _C2, _C4, _C6, _C8, _C10, _C12 = (
    1 / 2,
    -1 / 24,
    1 / 720,
    -1 / 40320,
    1 / 3628800,
    -1 / 479001600,
    1 / 87178291200,
)


@inlined
def permute_1(a):
    """P_1 a (2.18)."""
    return -a[1], a[0], a[3], -a[2]


@inlined
def permute_2(a):
    """P_2 a (2.18)."""
    return -a[2], -a[3], a[0], a[1]


@inlined
def permute_3(a):
    """P_3 a (2.18)."""
    return -a[3], a[2], -a[1], a[0]


@inlined
def s_times(q, x, y, z):
    """S(q) (0, x, y, z), with S(q) of (2.6): x P_1 q + y P_2 q + z P_3 q."""
    return (
        -q[1] * x - q[2] * y - q[3] * z,
        q[0] * x - q[3] * y + q[2] * z,
        q[3] * x + q[0] * y - q[1] * z,
        -q[2] * x + q[1] * y + q[0] * z,
    )


@inlined
def dot(a, b):
    """The scalar product of two four-vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@inlined
def mix(c, s, a, b):
    """c a + s b, for four-vectors."""
    return (c * a[0] + s * b[0], c * a[1] + s * b[1], c * a[2] + s * b[2], c * a[3] + s * b[3])


@contracted
def series(a):
    """sin(a) and 1 - cos(a), for |a| <= SMALL, each to an ulp."""
    x = a * a
    s = x * (_S2 + x * (_S4 + x * (_S6 + x * (_S8 + x * (_S10 + x * _S12)))))
    c = x * (_C0 + x * (_C2 + x * (_C4 + x * (_C6 + x * (_C8 + x * (_C10 + x * _C12))))))
    return a + a * s, c


@inlined
def sine_and_versine(angle, small):
    """sin(angle) and 1 - cos(angle).

    For rounded values cos^2 + sin^2 differs from 1, for a given angle always by the same amount:
    after 10^7 multiplications the norm of a quaternion would be off by up to 1e-9. Written as an
    increment with the versine, the rotation preserves the norm.
    """
    if small:
        return series(angle)
    s, c = sin(0.5 * angle), cos(0.5 * angle)
    return 2.0 * s * c, 2.0 * s * s


@contracted
def turn(s, versine, a, b):
    """cos a + sin b, with versine = 1 - cos, for four-vectors."""
    return (
        a[0] + (s * b[0] - versine * a[0]),
        a[1] + (s * b[1] - versine * a[1]),
        a[2] + (s * b[2] - versine * a[2]),
        a[3] + (s * b[3] - versine * a[3]),
    )


@inlined
def rotation(q, p, permuted_q, permuted_p, rate, dt, small):
    """The motion under h_k alone for dt (2.56), from P_k q, P_k p and 1 / (4 I_k): new q and p."""
    s, versine = sine_and_versine(dt * (rate * dot(p, permuted_q)), small)
    return turn(s, versine, q, permuted_q), turn(s, versine, p, permuted_p)


@inlined
def free_rotor(q, p, moment_1, moment_2, moment_3, dt, small):
    """Advance (q, p) by dt with the rotor part of eq. 2.53; no moment is zero."""
    rate_1, rate_2, rate_3, half = 0.25 / moment_1, 0.25 / moment_2, 0.25 / moment_3, 0.5 * dt
    q, p = rotation(q, p, permute_3(q), permute_3(p), rate_3, half, small)
    q, p = rotation(q, p, permute_2(q), permute_2(p), rate_2, half, small)
    q, p = rotation(q, p, permute_1(q), permute_1(p), rate_1, dt, small)
    q, p = rotation(q, p, permute_2(q), permute_2(p), rate_2, half, small)
    q, p = rotation(q, p, permute_3(q), permute_3(p), rate_3, half, small)
    return q, p


@inlined
def turns_little(p, moment, dt):
    """Whether all angles of a rotation by dt are below SMALL, from |p . P_k q| <= |p| and the
    smallest moment."""
    return dt * dt * dot(p, p) <= (4.0 * SMALL * moment) ** 2


@inlined
def free_linear_rotor(q, p, moment, dt):
    """Advance a linear rotor (I_1 = I_2 = moment, I_3 = 0) exactly.

    Its angular velocity is perpendicular to the axis 3 and constant in the body
    frame as well as in space, so h_1 + h_2 together are one rotation.
    """
    permuted_1, permuted_2 = permute_1(q), permute_2(q)
    zeta_1, zeta_2 = 0.25 / moment * dot(p, permuted_1), 0.25 / moment * dot(p, permuted_2)
    zeta = sqrt(zeta_1 * zeta_1 + zeta_2 * zeta_2)
    if zeta > 0.0:
        s, versine = sine_and_versine(dt * zeta, False)
        s_1, s_2 = zeta_1 / zeta, zeta_2 / zeta
        q, p = (
            turn(s, versine, q, mix(s_1, s_2, permuted_1, permuted_2)),
            turn(s, versine, p, mix(s_1, s_2, permute_1(p), permute_2(p))),
        )
    return q, p
