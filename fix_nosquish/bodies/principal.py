"""Principal moments of inertia and principal frames, determined by the atoms alone."""

import numpy as np

from .members import Members

# a moment below this fraction of the body's largest is zero, as in LAMMPS's fix rigid
_ZERO_MOMENT = 1e-7
# moments closer than this fraction of the largest are equal: their axes follow from the atoms
_EQUAL_MOMENTS = 1e-9


def moments_and_axes(
    members: Members, inertia: np.ndarray, r: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments and axes in the order of the integrator; collective.

    In two dimensions bodies rotate about z only, which is axis 3.

    Args:
        inertia: (n, 3, 3) inertia tensors, space frame.
        r: (m, 3) positions of the atoms relative to the centres of mass, space frame.  With the
            orientations of particles they fix the axes of equal moments.
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
        inertia: (n, 3, 3) inertia tensors, space frame.
    Returns:
        moment (3, n), in descending order; axes (n, 3, 3), in columns; and (2, n) bool, whether
        moments 1 and 2, and 2 and 3, are equal, so that their axes are arbitrary.
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
    """Frames (n, 3, 3) with the third column along these unit vectors (n, 3), or opposite to them;
    a frame depends on its vector only."""
    n = np.arange(len(axis))
    axis = axis * np.sign(axis[n, np.abs(axis).argmax(axis=1)])[:, None]
    other = np.zeros_like(axis)
    other[n, np.abs(axis).argmin(axis=1)] = 1.0
    first = np.cross(axis, other)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(axis, first), axis], axis=2)


def _principal_in_plane(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments and axes in two dimensions; see `moments_and_axes`."""
    values, turned = np.linalg.eigh(inertia[:, :2, :2])
    axes = np.zeros_like(inertia)
    axes[:, 2, 2] = 1.0
    axes[:, :2, 0] = turned[:, :, 1]
    axes[:, 0, 1], axes[:, 1, 1] = -turned[:, 1, 1], turned[:, 0, 1]
    return np.maximum([values[:, 1], values[:, 0], inertia[:, 2, 2]], 0.0), axes


def weights(tag: np.ndarray) -> np.ndarray:
    """Two pseudo-random numbers in [0, 1) for each atom, (2, n): splitmix64 of its tag."""
    bits = 2 * tag.astype(np.uint64) + np.array([[0], [1]], np.uint64)
    bits = (bits + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in (30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB):
        bits = (bits ^ (bits >> np.uint64(shift))) * np.uint64(factor)
    return ((bits ^ (bits >> np.uint64(31))) >> np.uint64(11)) * 2.0**-53


def _choose_axes(axes: np.ndarray, equal: np.ndarray, sums: np.ndarray) -> None:
    """Align the axes of equal moments with weighted sums of the atoms' positions, in place.

    The frame then depends on the atoms alone, not on when and on how many ranks the bodies are
    made.  The splitting into rotations about axes depends on the frame, and so does the trajectory.

    Args:
        axes: (n, 3, 3), in columns.
        equal: (2, n) bool, see `_principal`.
        sums: (n, 2, 3), two weighted sums of each body, space frame.
    """
    chosen = np.flatnonzero(equal.any(axis=0))
    equal, frames = equal[:, chosen], axes[chosen]
    # all moments are equal; moments 1 and 2 are equal, so axis 3 is unique
    both, last = equal[0] & equal[1], equal[0] & ~equal[1]
    sum_1, sum_2 = sums[chosen, 0], sums[chosen, 1]
    alone = np.where(last[:, None], frames[:, :, 2], frames[:, :, 0])

    def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (a * b).sum(axis=1, keepdims=True)

    def without(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """The component of a perpendicular to b."""
        return (
            a - np.divide(dot(a, b), dot(b, b), out=np.zeros((len(a), 1)), where=dot(b, b) > 0) * b
        )

    first = np.where(both[:, None], sum_1, alone)
    sum_1, sum_2 = without(sum_1, alone), without(sum_2, first)
    second = np.where(both[:, None] | (dot(sum_1, sum_1) < 1e-6 * dot(sum_2, sum_2)), sum_2, sum_1)
    # a sphere has no direction: keep its axes
    determined = dot(second, second)[:, 0] > 1e-20 * (sums[chosen] ** 2).sum(axis=(1, 2))
    determined &= dot(first, first)[:, 0] > 0
    first, second = (a[determined] / np.sqrt(dot(a, a)[determined]) for a in (first, second))
    third = np.cross(first, second)
    last = last[determined, None, None]
    axes[chosen[determined]] = np.where(
        last, np.stack([second, third, first], axis=2), np.stack([first, second, third], axis=2)
    )
