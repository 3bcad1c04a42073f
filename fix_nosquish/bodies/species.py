"""Species of rigid bodies, and a warning of bodies of one species that differ in shape."""

import numpy as np

from .bodies import Bodies
from .membership import Membership
from .principal import weights

_DIFFERENT = 1e-3  # deviation / size of the body that rounding in a data file does not explain
_OTHER = 0.2  # deviation above which a body is a different fragment, not a deformed molecule
_WARNINGS = 5  # largest number of warnings
_SHAPES = "three-dimensional", "planar", "linear"


def compare(bodies: Bodies, membership: Membership) -> list[str]:
    """Warn of molecules of one species that differ in shape; collective.

    A species is the bodies whose atoms have the same types.  Each body is compared with the one of
    its species that has the lowest ID: by their extents, which a mirror image has, too.

    Fragments may have the same types but intentionally different shapes.  If at least a tenth of
    the bodies deviate by more than _OTHER, there is no warning.

    Returns:
        lines for the log, identical on all ranks.
    """
    gathered = membership.communicator.gather_to_all
    which = bodies.sharers.owned & (bodies.natoms > 1)
    key = keys(bodies, membership.lammps.types[bodies.index])[which]
    extents = _extents(bodies)[which]
    first = np.column_stack([key, bodies.id[which], bodies.natoms[which], extents])
    first = _of_each(gathered(_of_each(first, 6)), 6)
    model = first[np.searchsorted(first[:, 0], key), 3:]
    far = np.abs(extents - model).max(axis=1, initial=0.0) / model.max(axis=1, initial=1e-300)
    shapes = _shapes(bodies)[which, None] == np.arange(len(_SHAPES))
    rows = np.column_stack([key, -far, bodies.id[which], far > _DIFFERENT, far > _OTHER, shapes])
    rows = _of_each(gathered(_of_each(rows, 3)), 3)
    differ, fragments, *counts = rows[:, 3:].T
    mixed = np.count_nonzero(counts, axis=0) > 1
    odd = (10 * fragments < np.sum(counts, axis=0)) & ((differ > 0) | mixed)
    worst = np.flatnonzero(odd)[np.argsort(rows[odd, 1], kind="stable")]
    lines = [_line(membership, first[k], rows[k]) for k in worst[:_WARNINGS]]
    if more := len(worst[_WARNINGS:]):
        lines.append(f"WARNING: bodies of {more} other kinds differ in shape, too")
    return lines


def _of_each(rows: np.ndarray, kept: int) -> np.ndarray:
    """Merge rows (n, k) with the same first column: so many columns of the row with the lowest
    second column, and the sums of the others."""
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    first = np.unique(rows[:, 0], return_index=True)[1]
    return np.hstack([rows[first, :kept], np.add.reduceat(rows[:, kept:], first, axis=0)])


def _extents(bodies: Bodies) -> np.ndarray:
    """Extents of each body, (n, 3): square roots of the principal second moments of the positions
    of its atoms, which all have the same weight, so that sites without mass count."""
    d, n = bodies.displace[:3], len(bodies)
    sums = bodies.sharers.total(bodies.body, [*d, *(a * b for a in d for b in d)]) / bodies.natoms
    centre, squares = sums[:3].T, sums[3:].T.reshape(n, 3, 3)
    moments = np.linalg.eigvalsh(squares - centre[:, :, None] * centre[:, None, :])
    return np.sqrt(np.maximum(moments, 0.0))


def keys(bodies: Bodies, types: np.ndarray) -> np.ndarray:
    """A number for each body, (n,), that is the same for bodies with the same types of atoms.

    Args:
        types: (m,) of the bodies' atoms.
    """
    # integers, so that the sums do not depend on the order of summation
    return bodies.sharers.total(bodies.body, np.floor(weights(types) * 2.0**31))[0]


def _shapes(bodies: Bodies) -> np.ndarray:
    """Which of _SHAPES each body has, (n,)."""
    shape = np.zeros(len(bodies), int)
    if not bodies.planar:
        shape[: bodies.rotors] = bodies.flat
        shape[bodies.rotors :] = 2
    return shape


def _line(membership: Membership, first: np.ndarray, row: np.ndarray) -> str:
    """The warning of one species.

    Args:
        first: key, ID, number of atoms and extents of its first body.
        row: key, minus the largest deviation, ID of the body with it, how many bodies differ from
            the first, how many are other fragments, and how many have each of _SHAPES.
    """
    (_, lowest, natoms), (_, nearness, body, differ, _), counts = first[:3], row[:5], row[5:]
    text = (
        f"WARNING: the {counts.sum():.0f} bodies of {natoms:.0f} atoms that have the same atom "
        f"types as {membership.name(int(lowest))} differ in shape"
    )
    if differ:
        text += (
            f": {differ:.0f} differ from it by more than {_DIFFERENT:g} of its size, "
            f"{membership.name(int(body))} the most, by {-nearness:.2g}"
        )
    if np.count_nonzero(counts) > 1:
        text += "; " + " and ".join(f"{n:.0f} are {what}" for n, what in zip(counts, _SHAPES) if n)
    return (
        f"{text}. Was there a minimize before this fix was defined? It moves atoms individually, "
        "also beside a rigid fix of LAMMPS: call it after this line, which keeps bodies rigid. If "
        "like molecules are meant, give them one shape before, for example by 'nosquish check "
        "SCRIPT --rigid'"
    )
