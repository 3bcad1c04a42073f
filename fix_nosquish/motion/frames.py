"""Transformations between the principal frame of a body and the space frame."""

import numpy as np

from ..loops.compiled import contracted, inlined
from .rotor import s_times


@inlined
def rotation_matrix(q):
    """Transpose of A(q) (2.3), row by row: rotates from the principal frame to the space frame."""
    w, x, y, z = q
    return (
        w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z,
    )  # fmt: skip


@contracted
def to_space(r, x, y, z):
    """The matrix r (9 numbers, row by row) times (x, y, z)."""
    return (
        r[0] * x + r[1] * y + r[2] * z,
        r[3] * x + r[4] * y + r[5] * z,
        r[6] * x + r[7] * y + r[8] * z,
    )


@inlined
def to_body(r, x, y, z):
    """The transpose of the matrix r times (x, y, z)."""
    return (
        r[0] * x + r[3] * y + r[6] * z,
        r[1] * x + r[4] * y + r[7] * z,
        r[2] * x + r[5] * y + r[8] * z,
    )


@inlined
def angular_momentum(q, p):
    """Angular momentum L in the principal frame, from S(q)^T p = 2 (0, L)."""
    return (
        0.5 * (-q[1] * p[0] + q[0] * p[1] + q[3] * p[2] - q[2] * p[3]),
        0.5 * (-q[2] * p[0] - q[3] * p[1] + q[0] * p[2] + q[1] * p[3]),
        0.5 * (-q[3] * p[0] + q[2] * p[1] - q[1] * p[2] + q[0] * p[3]),
    )


@inlined
def quaternion_momentum(q, l1, l2, l3):
    """Quaternion momentum p = 2 S(q) (0, L) of the angular momentum L in the principal frame."""
    a, b, c, d = s_times(q, l1, l2, l3)
    return 2.0 * a, 2.0 * b, 2.0 * c, 2.0 * d


@inlined
def vector_times(x, y, z, q):
    """The product of quaternions (0, x, y, z) q."""
    return (
        -x * q[1] - y * q[2] - z * q[3],
        x * q[0] + y * q[3] - z * q[2],
        -x * q[3] + y * q[0] + z * q[1],
        x * q[2] - y * q[1] + z * q[0],
    )


@inlined
def angular_velocity(q, p, i1, i2, i3):
    """Angular velocity in the principal frame; zero about an axis with zero moment."""
    l1, l2, l3 = angular_momentum(q, p)
    return (
        l1 / i1 if i1 > 0.0 else 0.0,
        l2 / i2 if i2 > 0.0 else 0.0,
        l3 / i3 if i3 > 0.0 else 0.0,
    )


@inlined
def product(p, q):
    """The quaternion product p q: the rotation q followed by p."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3],
        p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1],
    )


def matrices(q: np.ndarray) -> np.ndarray:
    """Rotation matrices (3, 3, n) from the principal to the space frame, for quaternions (4, n)."""
    return np.array(rotation_matrix(q)).reshape(3, 3, -1)


def quaternions(axes: np.ndarray) -> np.ndarray:
    """Unit quaternions (4, n) of rotation matrices (n, 3, 3) whose columns are the body axes."""
    r = axes.transpose(1, 2, 0)
    # 4 q_i q_j; the row of the largest component is a multiple of the quaternion
    products = np.array([
        [1 + r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]],
        [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - r[0, 0] - r[1, 1] + r[2, 2]],
    ])  # fmt: skip
    largest = np.argmax([products[k, k] for k in range(4)], axis=0)
    q = products[largest, :, np.arange(len(axes))].T
    return q / np.sqrt((q * q).sum(axis=0))
