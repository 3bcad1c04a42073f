"""Unwrapped positions: the atoms of each body put together across periodic faces."""

from typing import NamedTuple

import numpy as np

from .members import Members

_CELLS = 64  # number of cells per box length with which gaps are measured
_GAP = 0.1  # width, as a fraction of the box, up to which a gap inside a body is no sign of a cut


class UnwrappedPositions(NamedTuple):
    """Positions of the atoms of bodies, put together across periodic faces; space frame.

    Attributes:
        members: the `Members`.
        first: (n,) ID of each body's first atom, the one with the lowest ID.
        place, image: (3, n) wrapped position and image flags of the first atom.
        delta: (m, 3) position of each atom relative to the first atom of its body.
        centre: (3, n) centre of mass of each body's atoms, relative to the first atom.
        rebuilt: (n,) bool, which bodies were put together by nearest images.
        warnings: lines for the log.
    """

    members: Members
    first: np.ndarray
    place: np.ndarray
    image: np.ndarray
    delta: np.ndarray
    centre: np.ndarray
    rebuilt: np.ndarray
    warnings: list[str]

    def inertia(self) -> np.ndarray:
        """Tensors of inertia of the bodies' atoms about `centre`, (3, 3, n); collective."""
        members = self.members
        return members.inertia(self.delta - self.centre[:, members.body].T)


def unwrap(members: Members) -> UnwrappedPositions:
    """Put the atoms of each body together across periodic faces; collective.

    Along each box vector:
    1. The image flags are used if they make the body narrower than half the box.
    2. Otherwise the nearest images are used if they make it narrower than a quarter of the box.
       Flags that were wrong at the start stay wrong while LAMMPS updates them, so flags that
       differ do not prove that they are right.
    3. Otherwise the image flags are used: a wall that spans the box has no other shape.

    A warning names the bodies of case 3 that may be cut by a face: their flags are equal, or make
    them as wide as the box, and a gap inside is wider than the one outside.
    """
    lammps, body, atoms = members.lammps, members.body, members.atoms
    image = lammps.images(atoms)
    first, place, flags = _first_atoms(members, lammps.x[atoms], image)
    # differences of the images are whole numbers: far from the origin nothing is lost
    image -= flags[:, body].T.astype(np.int64)
    image = lammps.image_difference(image)
    delta = lammps.x[atoms]
    delta -= place[:, body].T
    delta += image @ lammps.box.h.T
    low, width = _extent(members, _fractional(members, delta))
    rebuilt, warnings = np.zeros(len(members.ids), bool), []
    if members.communicator.any((width >= 0.5).any()):
        nearest = lammps.x[atoms] - place[:, body].T
        nearest -= lammps.box.lattice(nearest) @ lammps.box.h.T
        cut = (width >= 0.5) & (_extent(members, _fractional(members, nearest))[1] < 0.25)
        rebuilt = np.logical_or.reduce(cut)
        several_images = _extent(members, image.T)[1] > 0
        doubtful = (width >= 0.5) & ~cut & ~(several_images & (width < 1))
        warnings = _doubt(members, first, width, _gaps(members, delta, low, width, doubtful))
        across = np.rint((delta - nearest) @ lammps.box.inverse.T) * cut[:, body].T
        delta -= across @ lammps.box.h.T
    # bodies without mass are refused later
    weight = np.where(members.mass > 0, members.mass, 1.0)
    centre = members.total(members.atom_mass * along for along in delta.T) / weight
    return UnwrappedPositions(members, first, place, flags, delta, centre, rebuilt, warnings)


def _gaps(
    members: Members, delta: np.ndarray, low: np.ndarray, width: np.ndarray, which: np.ndarray
) -> np.ndarray:
    """The widest gap inside each body, in box lengths rounded down, (3, n), if it suggests that a
    face cuts the body; else 0; collective.

    Args:
        delta: (m, 3) the atoms' positions, as in `UnwrappedPositions`.
        low, width: (3, n) lowest fractional coordinate of each body's atoms, and its width.
        which: (3, n) bool, where a body may be cut.
    """
    gap, fractional = np.zeros_like(width), _fractional(members, delta) - low[:, members.body]
    for k in np.flatnonzero(members.lammps.box.periodic):
        cell = (fractional[k] * _CELLS).astype(int).clip(0, _CELLS - 1)
        filled = np.zeros((_CELLS, len(members.ids)))
        filled[cell, members.body] = cell
        members.sharers.combine(filled, np.maximum)
        last = np.maximum.accumulate(filled)  # the last cell with an atom; the first cell has one
        gap[k] = (np.diff(last, axis=0).max(axis=0) - 1.0).clip(0.0) / _CELLS
    gap[~which | (gap <= np.maximum(1.0 - width, _GAP))] = 0.0
    return gap


def _fractional(members: Members, vectors: np.ndarray) -> np.ndarray:
    """Vectors (m, 3) in units of the box vectors, 0 along those that are not periodic, (3, m)."""
    box = members.lammps.box
    return (vectors @ box.inverse.T * box.periodic).T


def _first_atoms(
    members: Members, x: np.ndarray, image: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The first atom of each body; collective.

    Args:
        x, image: (m, 3) wrapped positions and image flags of this rank's atoms.
    Returns:
        its ID, (n,); its wrapped position and its image flags, (3, n) each.
    """
    (first,) = members.lowest(members.tag)
    lead = members.tag == first[members.body]
    reference = np.zeros((6, len(members.ids)))
    reference[:, members.body[lead]] = np.concatenate([x[lead], image[lead]], axis=1).T
    members.sharers.combine(reference)
    return first, reference[:3], reference[3:]


def _extent(members: Members, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The minimum over each body's atoms of the columns (k, m), and the difference of maximum and
    minimum, (k, n) each; collective."""
    low = members.lowest(*columns)
    return low, members.highest(*columns) - low


def _doubt(members: Members, first: np.ndarray, width: np.ndarray, gap: np.ndarray) -> list[str]:
    """The warning for bodies that a face may cut, if there are any; collective.

    Args:
        first: (n,) ID of each body's first atom.
        width: (3, n) of each body along the box vectors, in box lengths.
        gap: (3, n) the result of `_gaps`.
    """
    widest, along = gap.max(axis=0), gap.argmax(axis=0)
    wide = np.take_along_axis(width, along[None, :], axis=0)[0]
    which = (widest > 0) & members.owned
    several = members.communicator.count(which.sum())
    if not several:
        return []
    inside, wide, k, body, atom = members.furthest(which, widest, wide, along, members.ids, first)
    return [
        f"WARNING: {members.membership.name(int(body))} (its first atom is {atom:.0f}) "
        f"may be cut by a periodic face: by its image flags it is {wide:.2f} box "
        f"lengths wide along {'xyz'[int(k)]}, with a gap of {inside:.2f} inside and of "
        f"{max(0.0, 1.0 - wide):.2f} outside. The flags are trusted"
        + (f" (as are those of {several - 1} more)" if several > 1 else "")
        + ". If they are wrong, set them (set ... image, or in the data file) before the first run"
    ]
