"""The free rotor: eqs. 2.52-2.57 of Miller et al., J. Chem. Phys. 116, 8649 (2002).

A rigid body's orientation is a unit quaternion q and its conjugate momentum p.
The rotational Hamiltonian is a sum of h_k = [p . P_k q]^2 / (8 I_k), one for each
principal axis k, and each h_k alone is a rotation that is known exactly:

    zeta_k = (p . P_k q) / (4 I_k)
    q <- cos(zeta_k dt) q + sin(zeta_k dt) P_k q        (2.56)
    p <- cos(zeta_k dt) p + sin(zeta_k dt) P_k p

The free rotation is the palindrome 3,2,1,2,3 of these.  Principal moments are
numbered I_1 >= I_2 >= I_3, so the smallest moment (the fastest axis) is outermost:
for TIP3P water the reverse order has about ten times the energy error.

Quaternions are tuples (scalar part first).  All functions are compiled, and inlined
into the loops over bodies at the end, whose arrays are (components, bodies).
(numba's cache notices a change in the file of a loop only: what a loop inlines
stands in the same file.)
"""

from math import cos, sin, sqrt

from numba import njit

compiled = njit(cache=True, nogil=True, error_model="numpy")


@njit(inline="always")
def permute_1(a):
    """P_1 a (2.18)."""
    return -a[1], a[0], a[3], -a[2]


@njit(inline="always")
def permute_2(a):
    """P_2 a (2.18)."""
    return -a[2], -a[3], a[0], a[1]


@njit(inline="always")
def permute_3(a):
    """P_3 a (2.18)."""
    return -a[3], a[2], -a[1], a[0]


@njit(inline="always")
def dot(a, b):
    """The product of two four-vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]


@njit(inline="always")
def mix(c, s, a, b):
    """c a + s b, for four-vectors."""
    return (
        c * a[0] + s * b[0],
        c * a[1] + s * b[1],
        c * a[2] + s * b[2],
        c * a[3] + s * b[3],
    )


@njit(inline="always")
def sine_and_lost_cosine(angle):
    """sin(angle) and 1 - cos(angle).

    A rounded cosine and sine are together longer or shorter than 1, for one angle always in the same way:
    multiplied 10^7 times, lengths would change by up to 1e-9. Added as a change, they do not.
    """
    s, c = sin(0.5 * angle), cos(0.5 * angle)
    return 2.0 * s * c, 2.0 * s * s


@njit(inline="always")
def turn(s, lost, a, b):
    """cos a + sin b, with lost = 1 - cos, for four-vectors."""
    return (
        a[0] + (s * b[0] - lost * a[0]),
        a[1] + (s * b[1] - lost * a[1]),
        a[2] + (s * b[2] - lost * a[2]),
        a[3] + (s * b[3] - lost * a[3]),
    )


def _rotation(permute):
    @njit(inline="always")
    def rotate(q, p, moment, dt):
        permuted = permute(q)
        s, lost = sine_and_lost_cosine(dt * dot(p, permuted) / (4.0 * moment))
        return turn(s, lost, q, permuted), turn(s, lost, p, permute(p))

    return rotate


rotate_1 = _rotation(permute_1)
rotate_2 = _rotation(permute_2)
rotate_3 = _rotation(permute_3)


@njit(inline="always")
def free_rotor(q, p, moment_1, moment_2, moment_3, dt, mrot):
    """Advance (q, p) by dt in mrot inner steps of eq. 2.53's rotor part.

    Args:
        q, p: quaternion and its conjugate momentum (tuples of 4).
        moment_1, moment_2, moment_3: principal moments, none zero.
        dt: the time step.  mrot: number of inner steps, at least 1.
    """
    inner = dt / mrot
    half = 0.5 * inner
    for _ in range(mrot):
        q, p = rotate_3(q, p, moment_3, half)
        q, p = rotate_2(q, p, moment_2, half)
        q, p = rotate_1(q, p, moment_1, inner)
        q, p = rotate_2(q, p, moment_2, half)
        q, p = rotate_3(q, p, moment_3, half)
    return q, p


@njit(inline="always")
def free_linear_rotor(q, p, moment, dt):
    """Advance a linear rotor (I_1 = I_2 = moment, I_3 = 0) exactly.

    Its angular velocity is perpendicular to the axis 3 and constant in the body
    frame as well as in space, so h_1 + h_2 together are one rotation.
    """
    permuted_1, permuted_2 = permute_1(q), permute_2(q)
    zeta_1 = dot(p, permuted_1) / (4.0 * moment)
    zeta_2 = dot(p, permuted_2) / (4.0 * moment)
    zeta = sqrt(zeta_1 * zeta_1 + zeta_2 * zeta_2)
    if zeta > 0.0:
        s, lost = sine_and_lost_cosine(dt * zeta)
        s_1, s_2 = zeta_1 / zeta, zeta_2 / zeta
        q, p = (
            turn(s, lost, q, mix(s_1, s_2, permuted_1, permuted_2)),
            turn(s, lost, p, mix(s_1, s_2, permute_1(p), permute_2(p))),
        )
    return q, p


@compiled
def rotate(begin, end, q, p, moment, dt, mrot):
    """Free rotation of three-dimensional and planar bodies by a whole step (2.53)."""
    for b in range(begin, end):
        qb, pb = free_rotor(
            (q[0, b], q[1, b], q[2, b], q[3, b]),
            (p[0, b], p[1, b], p[2, b], p[3, b]),
            moment[0, b], moment[1, b], moment[2, b], dt, mrot,
        )  # fmt: skip
        for k in range(4):
            q[k, b] = qb[k]
            p[k, b] = pb[k]


@compiled
def rotate_in_plane(begin, end, q, p, moment, dt):
    """Rotation of bodies that turn about their axis 3 only, as all do in two dimensions: h_3 alone, exact."""
    for b in range(begin, end):
        qb, pb = rotate_3(
            (q[0, b], q[1, b], q[2, b], q[3, b]),
            (p[0, b], p[1, b], p[2, b], p[3, b]),
            moment[2, b], dt,
        )  # fmt: skip
        for k in range(4):
            q[k, b] = qb[k]
            p[k, b] = pb[k]


@compiled
def rotate_linear(begin, end, q, p, moment, dt):
    """Free rotation of linear bodies by a whole step, exact."""
    for b in range(begin, end):
        qb, pb = free_linear_rotor(
            (q[0, b], q[1, b], q[2, b], q[3, b]),
            (p[0, b], p[1, b], p[2, b], p[3, b]),
            moment[0, b], dt,
        )  # fmt: skip
        for k in range(4):
            q[k, b] = qb[k]
            p[k, b] = pb[k]
