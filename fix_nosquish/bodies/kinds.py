"""Whether bodies of one kind, molecules of one species, have one shape."""

import numpy as np

from .principal import weights

_DIFFERENT = 1e-3  # deviation, as a part of a body's size, that a data file's digits do not explain
_SAID = 5  # warnings at most
_SHAPES = "three-dimensional", "planar", "linear"


def compare(bodies, lammps, communicator, membership):
    """Warn of bodies with the same atom types, in the order of IDs, but not one shape; collective.

    Each body is laid over the one of its kind that has the lowest ID, turned (or mirrored: a
    racemate is of one kind) by least squares. All atoms count alike: by their masses, rounding
    errors would turn bodies about directions in which only massless sites extend.

    Returns:
        a list of lines, alike on all ranks.
    """
    place, key = _places_and_keys(bodies, lammps)
    compared = (bodies.natoms > 1) & (key >= 0)
    owned = bodies.sharers.owned
    keys, natoms, lowest, counts = _kinds(bodies, communicator, key, compared & owned)
    if not len(keys):
        return []
    kind = np.searchsorted(keys, key).clip(max=len(keys) - 1)
    kind[~compared | (keys[kind] != key)] = -1
    far = _deviations(bodies, communicator, kind, place, natoms, lowest)
    differ, furthest = _furthest(communicator, len(keys), kind, far, bodies.id, owned)
    mixed = np.count_nonzero(counts, axis=1) > 1
    said = np.flatnonzero((differ > 0) | mixed)
    said = said[np.argsort(-furthest[said, 0], kind="stable")]
    lines = [
        _line(membership, natoms[k], lowest[k], counts[k], differ[k], *furthest[k])
        for k in said[:_SAID]
    ]
    if len(said) > _SAID:
        lines.append(f"WARNING: bodies of {len(said) - _SAID} other kinds differ in shape, too")
    return lines


def _deviations(bodies, communicator, kind, place, natoms, lowest):
    """How far each body is from the first of its kind, as a part of its size, (n,); collective.

    Args:
        kind: (n,) int of each body, -1 for those that are not compared.
        place: (m,) of each atom among its body's.
        natoms, lowest: of each kind, the number of atoms and the lowest ID of a body.
    """
    sharers, start = bodies.sharers, np.concatenate([[0], np.cumsum(natoms)])
    mine = kind[bodies.body] >= 0
    body, d = bodies.body[mine], bodies.displace[:3, mine]
    where = start[kind[body]] + place[mine]
    of_first = bodies.id[body] == lowest[kind[body]]
    told = communicator.gather_to_all(np.concatenate([[where], d])[:, of_first].T)
    model = np.empty((3, start[-1]))
    model[:, told[:, 0].astype(int)] = told[:, 1:].T
    size = np.maximum.reduceat(np.linalg.norm(model, axis=0), start[:-1])

    model = model[:, where]
    products = sharers.total(body, *(a * b for a in d for b in model)).T.reshape(-1, 3, 3)

    def deviation(turn):
        """How far each body is from the first of its kind, turned so, of its size, (n,)."""
        off = np.linalg.norm(d - np.einsum("mab,bm->am", turn[body], model), axis=0)
        return np.where(kind >= 0, sharers.highest(body, off)[0] / size[kind], 0.0)

    # principal axes of bodies of one shape differ in their signs only, unless moments are equal
    turn = np.eye(3) * np.where(products < 0, -1.0, 1.0)
    far = deviation(turn)
    doubt = far > _DIFFERENT
    if communicator.any(doubt.any()):
        left, _, right = np.linalg.svd(products[doubt])
        turn[doubt] = left @ right
        far = deviation(turn)
    return far


def _furthest(communicator, kinds, kind, far, ids, owned):
    """Of each of so many kinds, how many bodies differ from the first, (kinds,), and how far is
    the one that is furthest, and its ID, (kinds, 2); collective.

    Args:
        kind, far, ids, owned: (bodies,) of each, what `compare` knows of it.
    """
    other = np.flatnonzero((far > _DIFFERENT) & owned)
    other = other[np.lexsort((-far[other], kind[other]))]  # of each kind the furthest is the first
    which, first, count = np.unique(kind[other], return_index=True, return_counts=True)
    worst = other[first]
    found = np.stack([which, count, far[worst], ids[worst]], axis=1).astype(float)
    found = communicator.gather_to_all(found)
    found = found[np.lexsort((-found[:, 2], found[:, 0]))]
    differ, furthest = np.zeros(kinds, int), np.zeros((kinds, 2))
    np.add.at(differ, found[:, 0].astype(int), found[:, 1].astype(int))
    which, first = np.unique(found[:, 0].astype(int), return_index=True)
    furthest[which] = found[first, 2:]
    return differ, furthest


def _kinds(bodies, communicator, key, owned):
    """The kinds of which there are several bodies; collective.

    Args:
        key: (bodies,) what tells kinds apart.  owned: (bodies,) bool, which to count here.
    Returns:
        keys (n,), natoms (n,), the lowest body ID of each (n,), how many have each shape (n, 3).
    """
    shape = _shapes(bodies)[owned]
    keys, first, kind = np.unique(key[owned], return_index=True, return_inverse=True)
    rows = np.empty((len(keys), 6), np.int64)
    rows[:, 0], rows[:, 1] = keys, bodies.natoms[owned][first]
    rows[:, 2] = np.iinfo(np.int64).max
    np.minimum.at(rows[:, 2], kind, bodies.id[owned])
    for k in range(3):
        rows[:, 3 + k] = np.bincount(kind, shape == k, minlength=len(keys))
    rows = communicator.gather_to_all(rows)
    keys, first, kind = np.unique(rows[:, 0], return_index=True, return_inverse=True)
    natoms, counts = rows[first, 1], np.zeros((len(keys), 3), int)
    lowest = np.full(len(keys), np.iinfo(np.int64).max)
    np.minimum.at(lowest, kind, rows[:, 2])
    np.add.at(counts, kind, rows[:, 3:])
    several = counts.sum(axis=1) > 1
    return keys[several], natoms[several], lowest[several], counts[several]


def _places_and_keys(bodies, lammps):
    """The place of each atom here among its body's, in the order of IDs, and keys of kinds.

    Returns:
        (m,) int; (n,) int64, the same number for bodies with the same types in this order, -1 if
        ranks that share the body would have to tell each other the order: each knows it where the
        IDs follow one another.
    """
    tag, body = bodies.tag, bodies.body
    first, last = bodies.sharers.lowest(body, tag, -tag) * np.array([[1], [-1]])
    order = np.lexsort((tag, body))
    here = np.bincount(body, minlength=len(bodies))
    place = np.empty(len(tag), int)
    place[order] = np.arange(len(tag)) - (np.cumsum(here) - here)[body[order]]
    shared = here < bodies.natoms
    place = np.where(shared[body], tag - first[body], place).astype(int)
    types = lammps.types[bodies.index]
    # whole numbers, whose sums do not depend on their order
    halves = np.floor(weights((place << 20) + types) * 2.0**31)
    sums = bodies.sharers.total(body, *halves)
    key = (sums[0] % 2**31).astype(np.int64) << 31 | (sums[1] % 2**31).astype(np.int64)
    gaps = last - first + 1 != bodies.natoms
    return place, np.where(shared & gaps, -1, key)


def _shapes(bodies):
    """Which of _SHAPES each body has, (n,)."""
    shape = np.zeros(len(bodies), int)
    shape[: bodies.rotors][bodies.flat] = 1
    shape[bodies.rotors :] = 2
    return shape if not bodies.planar else np.zeros(len(bodies), int)


def _line(membership, natoms, lowest, counts, differ, far, furthest):
    name = membership.name(int(lowest))
    text = (
        f"WARNING: the {counts.sum()} bodies of {natoms} atoms that have the same atom types as "
        f"{name}, in the same order, differ in shape"
    )
    if differ:
        other = membership.name(int(furthest))
        text += (
            f": {differ} differ from it by more than {_DIFFERENT:g} of its size, {other} the most, "
            f"by {far:.2g}"
        )
    if np.count_nonzero(counts) > 1:
        text += "; " + " and ".join(f"{n} are {what}" for n, what in zip(counts, _SHAPES) if n)
    return (
        f"{text}. If like molecules are meant, give them one shape before the fix is defined "
        "(minimize bends them, fix nosquish/fire does not)"
    )
