"""Compare the shapes of rigid bodies that are molecules of the same species."""

from typing import NamedTuple

import numpy as np

from ..host.lammps import Lammps
from ..ranks.communicator import Alone
from .bodies import Bodies
from .membership import Membership
from .principal import weights

_DIFFERENT = 1e-3  # deviation / size of the body that rounding in a data file does not explain
_OTHER = 0.3  # deviation above which a body is a different fragment, not a deformed molecule
_WARNINGS = 5  # largest number of warnings
_SHAPES = "three-dimensional", "planar", "linear"


class Species(NamedTuple):
    """Species: bodies with the same atom types in the order of IDs; identical on all ranks.

    A species has at least two bodies.

    Attributes:
        key: (s,) int64 hash of the atom types, ascending.
        first: (s,) lowest body ID.
        natoms: (s,) number of atoms of a body.
        counts: (s, 3) number of bodies with each of _SHAPES.
    """

    key: np.ndarray
    first: np.ndarray
    natoms: np.ndarray
    counts: np.ndarray


def compare(bodies: Bodies, membership: Membership) -> list[str]:
    """Warn of molecules of one species that differ in shape; collective.

    Fragments may have the same types but intentionally different shapes.  If at least a tenth of
    the bodies deviate by more than _OTHER, there is no warning.

    Each body is superposed on the body of its species with the lowest ID, by a least-squares
    rotation (or reflection, so a racemate is one species).  All atoms have the same weight: weights
    by mass would leave rotations that move only massless sites to rounding errors.

    Returns:
        lines for the log, identical on all ranks.
    """
    communicator, owned = membership.communicator, bodies.sharers.owned
    place, key = _places_and_keys(bodies, membership.lammps)
    compared = (bodies.natoms > 1) & (key >= 0)
    all_species = _species(bodies, communicator, key, compared & owned)
    keys, counts = all_species.key, all_species.counts
    if not len(keys):
        return []
    species = np.searchsorted(keys, key).clip(max=len(keys) - 1)
    species[~compared | (keys[species] != key)] = -1
    far = _deviations(bodies, communicator, species, place, all_species)
    rows = np.column_stack([species, -far, bodies.id, far > _DIFFERENT, far > _OTHER])
    rows = _of_each(communicator.gather_to_all(_of_each(rows[owned & (species >= 0)])))
    differ, fragments = rows[:, 3:].T
    mixed = np.count_nonzero(counts, axis=1) > 1
    odd = (10 * fragments < counts.sum(axis=1)) & ((differ > 0) | mixed)
    worst = np.flatnonzero(odd)[np.argsort(rows[odd, 1], kind="stable")]
    lines = [_line(membership, all_species, k, *rows[k, 1:4]) for k in worst[:_WARNINGS]]
    if more := len(worst[_WARNINGS:]):
        lines.append(f"WARNING: bodies of {more} other kinds differ in shape, too")
    return lines


def _of_each(rows: np.ndarray) -> np.ndarray:
    """Merge rows (n, k) with the same first column: the row with the lowest second column, with
    sums in the columns after the third."""
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    first = np.unique(rows[:, 0], return_index=True)[1]
    return np.hstack([rows[first, :3], np.add.reduceat(rows[:, 3:], first, axis=0)])


def _deviations(
    bodies: Bodies,
    communicator: Alone,
    species: np.ndarray,
    place: np.ndarray,
    all_species: Species,
) -> np.ndarray:
    """Deviation of each body from the first of its species, divided by its size, (n,); collective.

    Args:
        species: (n,) index in `all_species` of each body; -1 if the body is not compared.
        place: (m,) index of each atom within its body.
    """
    sharers, start = bodies.sharers, np.concatenate([[0], np.cumsum(all_species.natoms)])
    mine = species[bodies.body] >= 0
    body, d = bodies.body[mine], bodies.displace[:3, mine]
    where = start[species[body]] + place[mine]
    of_first = bodies.id[body] == all_species.first[species[body]]
    rows = communicator.gather_to_all(np.concatenate([[where], d])[:, of_first].T)
    model = np.empty((3, start[-1]))
    model[:, rows[:, 0].astype(int)] = rows[:, 1:].T
    size = np.maximum.reduceat(np.linalg.norm(model, axis=0), start[:-1])

    model = model[:, where]
    products = sharers.total(body, (a * b for a in d for b in model)).T.reshape(-1, 3, 3)

    def deviation(turn: np.ndarray) -> np.ndarray:
        """The deviations for rotations `turn` (n, 3, 3) of the first body of each species, (n,)."""
        off = np.linalg.norm(d - np.einsum("mab,bm->am", turn[body], model), axis=0)
        return np.where(species >= 0, sharers.highest(body, off)[0] / size[species], 0.0)

    # for one shape the principal axes differ in signs only, unless moments are equal
    turn = np.eye(3) * np.where(products < 0, -1.0, 1.0)
    far = deviation(turn)
    doubt = far > _DIFFERENT
    if communicator.any(doubt.any()):
        left, _, right = np.linalg.svd(products[doubt])
        turn[doubt] = left @ right
        far = deviation(turn)
    return far


def _species(bodies: Bodies, communicator: Alone, key: np.ndarray, owned: np.ndarray) -> Species:
    """The species with more than one body; collective.

    Args:
        key: (n,) hash of the species.
        owned: (n,) bool, the bodies that this rank counts.
    """
    counts = _shapes(bodies)[:, None] == np.arange(len(_SHAPES))
    rows = np.column_stack([key, bodies.id, bodies.natoms.astype(np.int64), counts])[owned]
    rows = _of_each(communicator.gather_to_all(_of_each(rows)))
    rows = rows[rows[:, 3:].sum(axis=1) > 1]
    return Species(rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3:])


def _places_and_keys(bodies: Bodies, lammps: Lammps) -> tuple[np.ndarray, np.ndarray]:
    """The index of each atom within its body, in the order of atom IDs, and the keys of species.

    Returns:
        (m,) int; (n,) int64, equal for bodies with the same types in this order.  The key is -1 for
        a body on several ranks whose atom IDs have gaps: its order would need communication.
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
    # integers, so that the sums do not depend on the order of summation
    halves = np.floor(weights((place << 20) + types) * 2.0**31)
    sums = bodies.sharers.total(body, halves)
    key = (sums[0] % 2**31).astype(np.int64) << 31 | (sums[1] % 2**31).astype(np.int64)
    gaps = last - first + 1 != bodies.natoms
    return place, np.where(shared & gaps, -1, key)


def _shapes(bodies: Bodies) -> np.ndarray:
    """Which of _SHAPES each body has, (n,)."""
    shape = np.zeros(len(bodies), int)
    if not bodies.planar:
        shape[: bodies.rotors] = bodies.flat
        shape[bodies.rotors :] = 2
    return shape


def _line(
    membership: Membership, species: Species, k: int, nearness: float, body: float, differ: float
) -> str:
    """The warning of one species.

    Args:
        k: index in `species`.
        nearness: minus the largest deviation.  body: ID of the body with it.
        differ: number of bodies that differ from the first.
    """
    name, counts = membership.name(int(species.first[k])), species.counts[k]
    text = (
        f"WARNING: the {counts.sum()} bodies of {species.natoms[k]} atoms that have the same atom "
        f"types as {name}, in the same order, differ in shape"
    )
    if differ:
        text += (
            f": {differ:.0f} differ from it by more than {_DIFFERENT:g} of its size, "
            f"{membership.name(int(body))} the most, by {-nearness:.2g}"
        )
    if np.count_nonzero(counts) > 1:
        text += "; " + " and ".join(f"{n} are {what}" for n, what in zip(counts, _SHAPES) if n)
    return (
        f"{text}. If like molecules are meant, give them one shape before the fix is defined "
        "(before that, minimize bends molecules)"
    )
