"""The exact motion of a free asymmetric top, in Jacobi's elliptic functions."""

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipkinc, elliprf, elliprj


def free_top(
    q: np.ndarray, L: np.ndarray, moments: np.ndarray, time: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where a top without torque is after some time.

    In the principal frame the components of the angular momentum are the functions cn, sn, dn of
    time, dn that of the axis which the angular momentum circles about. It is fixed in space, and
    that axis turns about it by an angle that is an elliptic integral of the third kind, here in
    Carlson's form.

    Args:
        q: (4,) unit quaternion.
        L: (3,) angular momentum in the principal frame.
        moments: (3,), all different, the largest first.
        time: any real number.
    Returns:
        (q, L) then; the sign of q is that with which its largest component is positive.
    """
    order = np.eye(3)
    if (L * L / moments).sum() * moments[1] <= L @ L:
        # it circles about axis 1: number the axes 3, 2, -1
        order = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    i1, i2, i3 = np.abs(order) @ moments
    start = order @ L
    size, twice = np.linalg.norm(L), (L * L / moments).sum()  # |L|, twice the energy

    a1 = np.sqrt(i1 * (size**2 - twice * i3) / (i1 - i3))
    a2 = np.sqrt(i2 * (size**2 - twice * i3) / (i2 - i3))
    a3 = np.copysign(np.sqrt(i3 * (twice * i1 - size**2) / (i1 - i3)), start[2])
    m = (i1 - i2) * (size**2 - twice * i3) / ((i2 - i3) * (twice * i1 - size**2))
    rate = np.sqrt((i2 - i3) * (twice * i1 - size**2) / (i1 * i2 * i3))
    rate *= np.sign(a3 * (1 / i1 - 1 / i3))  # dL_2/dt = (1/I_1 - 1/I_3) L_3 L_1
    angle = np.arctan2(start[1] / a2, start[0] / a1)
    sn, cn, dn, angle_then = ellipj(ellipkinc(angle, m) + rate * time, m)
    then = np.array([a1 * cn, a2 * sn, a3 * dn])

    # dphi/dt = |L| (2 T - L_3^2 / I_3) / (|L|^2 - L_3^2)
    n = 1 - (a2 / a1) ** 2
    turns = (_third_kind(n, angle_then, m) - _third_kind(n, angle, m)) / rate
    phi = size * (time / i3 - (i1 - i3) / (i1 * i3) * turns)
    frame = Rotation.from_matrix(order.T)
    now = Rotation.from_quat(q, scalar_first=True) * frame
    now = now * _to_z(start).inv() * Rotation.from_rotvec([0, 0, phi]) * _to_z(then) * frame.inv()
    q = now.as_quat(scalar_first=True)
    return q * np.sign(q[np.abs(q).argmax()]), order.T @ then


def _to_z(L):
    """The rotation of a vector to the axis z, about z and then y."""
    angles = np.arctan2(L[1], L[0]), np.arctan2(np.hypot(L[0], L[1]), L[2])
    return Rotation.from_euler("zy", np.negative(angles))


def _third_kind(n, angle, m):
    """The elliptic integral Pi(n; angle | m), n < 0."""
    halves = np.round(angle / np.pi)
    s, c2 = np.sin(angle - halves * np.pi), np.cos(angle) ** 2
    complete = elliprf(0, 1 - m, 1) + n / 3 * elliprj(0, 1 - m, 1, 1 - n)
    first = elliprf(c2, 1 - m * s * s, 1)
    third = elliprj(c2, 1 - m * s * s, 1, 1 - n * s * s)
    return 2 * halves * complete + s * first + n / 3 * s**3 * third
