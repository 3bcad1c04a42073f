"""How a body's atoms are put together across the periodic faces."""

import numpy as np

_CELLS = 64  # of a box length, in which gaps are counted
_GAP = 0.1  # gaps inside a body that are narrower than this part of the box suggest no cut


def unfold(lammps, communicator, membership, sharers, ids, body, tag, atoms):
    """Put each body's atoms together across the periodic faces; collective.

    Along each box vector the image flags hold where they make the body narrower than half the
    box. Otherwise a body that the nearest images make narrower than a quarter of the box is one
    that a face cuts, and put together by them: flags that were wrong at the start stay so while
    LAMMPS keeps count, so that they differ proves nothing. A body that is wide both ways is left
    as its flags have it: a wall that spans the box has no other shape. There is doubt if these are
    alike for all of its atoms, or make it as wide as the box, and a gap inside is wider than
    the one outside.

    Args:
        sharers: the `Sharers` of the bodies.  ids: (n,) the bodies' IDs.
        body, tag, atoms: (m,) the place of each atom's body, its ID, its index in LAMMPS's arrays.
    Returns:
        (place, image, delta, rebuilt, doubt): of each body's first atom its place in the box and
        image flags, (3, n) each; the place of each atom from there, (atoms, 3); the bodies that
        were put together by the nearest images, (n,) bool; a warning, None for none.
    """
    n, box = len(ids), lammps.box
    x, image = lammps.per_atom("x", columns=3)[atoms], lammps.images[atoms]
    first = np.full((1, n), np.inf)
    np.minimum.at(first[0], body, tag)
    sharers.combine(first, np.minimum)
    lead = tag == first[0, body]
    reference = np.zeros((6, n))
    reference[:, body[lead]] = np.concatenate([x[lead], image[lead]], axis=1).T
    sharers.combine(reference)
    place, flags = reference[:3], reference[3:]
    # differences of the images are whole numbers: far from the origin nothing is lost
    image = lammps.image_difference(image - flags[:, body].T.astype(np.int64))
    delta = x - place[:, body].T
    nearest = delta - box.lattice(delta) @ box.h.T
    delta = delta + image @ box.h.T

    def ends(values):
        """Lowest and highest value over each body's atoms, on all ranks, (3, n) each."""
        low, high = np.full((3, n), np.inf), np.full((3, n), -np.inf)
        for k in range(3):
            np.minimum.at(low[k], body, values[:, k])
            np.maximum.at(high[k], body, values[:, k])
        sharers.combine(low, np.minimum)
        sharers.combine(high, np.maximum)
        return low, high

    parts = delta @ box.inverse.T * box.periodic
    low, high = ends(parts)
    width = high - low
    wide = width >= 0.5
    if not communicator.any(wide.any()):
        return place, flags, delta, np.zeros(n, bool), None
    compact = np.ptp(ends(nearest @ box.inverse.T * box.periodic), axis=0)
    cut = wide & (compact < 0.25)
    unsure = wide & ~cut & ~(np.not_equal(*ends(image)) & (width < 1))
    gap = np.zeros((3, n))
    for k in np.flatnonzero(box.periodic):
        gap[k] = _widest_gap(parts[:, k] - low[k, body], body, n, sharers)
    gap[~unsure | (gap <= np.maximum(1.0 - width, _GAP))] = 0.0
    doubt = _doubt(communicator, membership, sharers.owned, ids, first[0], width, gap)
    fold = np.rint((delta - nearest) @ box.inverse.T) * cut[:, body].T
    return place, flags, delta - fold @ box.h.T, cut.any(axis=0), doubt


def _doubt(communicator, membership, owned, ids, first, width, gap):
    """The warning for bodies that may be cut, with a gap (3, n) above zero, or None; collective."""
    gap = gap * owned
    worst = []
    if gap.any():
        k, b = np.unravel_index(gap.argmax(), gap.shape)
        worst = [gap[k, b], width[k, b], k, ids[b], first[b], gap.any(axis=0).sum()]
    rows = communicator.gather_to_all(np.array(worst).reshape(-1, 6))
    if not len(rows):
        return None
    inside, wide, k, body, atom, _ = rows[rows[:, 0].argmax()]
    others = rows[:, 5].sum() - 1
    return (
        f"WARNING: {membership.name(int(body))} (its first atom is {atom:.0f}) "
        f"may be cut by a periodic face: by its image flags it is {wide:.2f} box "
        f"lengths wide along {'xyz'[int(k)]}, with a gap of {inside:.2f} inside and of "
        f"{max(0.0, 1.0 - wide):.2f} outside. The flags are trusted"
        + (f" (as are those of {others:.0f} more)" if others else "")
        + ". If they are wrong, set them (set ... image, or in the data file) before the first run"
    )


def _widest_gap(parts, body, n, sharers):
    """Widest stretch inside each body without atoms, (n,), rounded down; collective.

    Args:
        parts: (atoms,) the atoms' distances from the end of their body, 0 to 1 (further ones count
            as at 1).
    """
    filled = np.zeros((_CELLS, n))
    filled[np.clip((parts * _CELLS).astype(int), 0, _CELLS - 1), body] = 1.0
    sharers.combine(filled, np.maximum)
    widest = run = np.zeros(n)
    for row in filled > 0:
        widest = np.where(row, np.maximum(widest, run), widest)
        run = np.where(row, 0.0, run + 1.0)
    return widest / _CELLS
