"""Principal moments of inertia and the frames along them, which follow from the atoms alone."""

import numpy as np

from .members import Members

# a moment below this part of the body's largest is none, as in LAMMPS's fix rigid
_ZERO_MOMENT = 1e-7
# moments closer than this part of the largest are equal: their axes are the atoms' choice
_EQUAL_MOMENTS = 1e-9


def moments_and_axes(
    members: Members, inertia: np.ndarray, r: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments and axes as the integrator takes them; collective.

    In two dimensions bodies turn about z only, which is axis 3.

    Args:
        inertia: (n, 3, 3) tensors of inertia, space frame.
        r: (m, 3) the atoms' places from the bodies' centres, space frame; with the directions of
            particles, these choose axes that moments leave open.
    Returns:
        moment (3, n); axes (n, 3, 3), in columns, right-handed.
    """
    if members.lammps.dimension == 2:
        return _principal_in_plane(inertia)
    moment, axes, equal = _principal(inertia)
    if members.communicator.any(equal.any()):
        places = np.array([r.T, r.T])
        if members.particles is not None:
            places += members.particles.directions()
        sums = (w * c for w, place in zip(weights(members.tag), places) for c in place)
        _choose_axes(axes, equal, members.total(sums).T.reshape(-1, 2, 3))
    if members.membership.command.order == 123:
        solid = moment[2] > 0
        moment[:, solid] = moment[::-1, solid]
        axes[solid] = axes[solid, :, ::-1]
    axes[np.linalg.det(axes) < 0, :, 2] *= -1.0
    return moment, axes


def _principal(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Principal moments and axes in three dimensions.

    Args:
        inertia: (n, 3, 3) tensors of inertia.
    Returns:
        moment (3, n), from the largest to the smallest; axes (n, 3, 3), in columns; and (2, n)
        bool, whether moments 1 and 2, and 2 and 3, are equal, so that their axes are arbitrary.
    """
    values, axes = np.linalg.eigh(inertia)
    moment, axes = values[:, ::-1].T.copy(), axes[:, :, ::-1].copy()
    point = moment[0] <= 0
    moment[:, point] = 0.0
    axes[point] = np.eye(3)
    linear = moment[2] <= _ZERO_MOMENT * moment[0]
    moment[2, linear] = 0.0
    moment[:2, linear] = 0.5 * (moment[0] + moment[1])[linear]
    axes[linear] = _frames_along(axes[linear, :, 2])
    equal = (moment[:2] - moment[1:] < _EQUAL_MOMENTS * moment[0]) & ~linear
    both = equal.all(axis=0)
    moment[:, both] = moment[:, both].mean(axis=0)
    for k in range(2):
        pair = equal[k] & ~both
        moment[k : k + 2, pair] = moment[k : k + 2, pair].mean(axis=0)
    return moment, axes, equal


def _frames_along(axis: np.ndarray) -> np.ndarray:
    """Frames (n, 3, 3) whose third column is along these unit vectors (n, 3);
    the rest follows from the vector alone."""
    n = np.arange(len(axis))
    axis = axis * np.sign(axis[n, np.abs(axis).argmax(axis=1)])[:, None]
    other = np.zeros_like(axis)
    other[n, np.abs(axis).argmin(axis=1)] = 1.0
    first = np.cross(axis, other)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(axis, first), axis], axis=2)


def _principal_in_plane(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moments and axes of bodies that turn about z, as `moments_and_axes`."""
    values, turned = np.linalg.eigh(inertia[:, :2, :2])
    axes = np.zeros_like(inertia)
    axes[:, 2, 2] = 1.0
    axes[:, :2, 0] = turned[:, :, 1]
    axes[:, 0, 1], axes[:, 1, 1] = -turned[:, 1, 1], turned[:, 0, 1]
    return np.maximum([values[:, 1], values[:, 0], inertia[:, 2, 2]], 0.0), axes


def weights(tag: np.ndarray) -> np.ndarray:
    """Two numbers in [0, 1) for each atom that follow from its tag and are like no others, (2, n).

    They are splitmix64 of it.
    """
    bits = 2 * tag.astype(np.uint64) + np.array([[0], [1]], np.uint64)
    bits = (bits + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in (30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB):
        bits = (bits ^ (bits >> np.uint64(shift))) * np.uint64(factor)
    return ((bits ^ (bits >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53


def _choose_axes(axes: np.ndarray, equal: np.ndarray, sums: np.ndarray) -> None:
    """Where moments are equal, turn the axes to weighted sums of the atoms' places, in place.

    A frame that follows from the atoms alone is found again, whenever and on however many ranks
    the bodies are made.  The splitting into rotations about axes, and so the trajectory, needs it.

    Args:
        axes: (n, 3, 3), in columns.
        equal: (2, n) bool, see `_principal`.
        sums: (n, 2, 3), two vectors of each body, space frame.
    """
    chosen = np.flatnonzero(equal.any(axis=0))
    equal, frames = equal[:, chosen], axes[chosen]
    # all moments are equal; the third one is alone
    both, last = equal[0] & equal[1], equal[0] & ~equal[1]
    one, two = sums[chosen, 0], sums[chosen, 1]
    alone = np.where(last[:, None], frames[:, :, 2], frames[:, :, 0])

    def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (a * b).sum(axis=1, keepdims=True)

    def without(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The part of a that is perpendicular to b."""
        return (
            a - np.divide(dot(a, b), dot(b, b), out=np.zeros((len(a), 1)), where=dot(b, b) > 0) * b
        )

    first = np.where(both[:, None], one, alone)
    one, two = without(one, alone), without(two, first)
    second = np.where(both[:, None] | (dot(one, one) < 1e-6 * dot(two, two)), two, one)
    # a sphere has no direction
    found = dot(second, second)[:, 0] > 1e-20 * (sums[chosen] ** 2).sum(axis=(1, 2))
    found &= dot(first, first)[:, 0] > 0
    first, second = (a[found] / np.sqrt(dot(a, a)[found]) for a in (first, second))
    third = np.cross(first, second)
    last = last[found, None, None]
    axes[chosen[found]] = np.where(
        last, np.stack([second, third, first], axis=2), np.stack([first, second, third], axis=2)
    )
