"""How a body's atoms are put together across the periodic faces."""

import numpy as np

_CELLS = 64  # of a box length, in which gaps are counted
_GAP = 0.1  # gaps inside a body that are narrower than this part of the box suggest no cut


def unfold(lammps, members):
    """Put each body's atoms together across the periodic faces; collective.

    Along each box vector the image flags hold where they make the body narrower than half the
    box. Otherwise a body that the nearest images make narrower than a quarter of the box is one
    that a face cuts, and put together by them: flags that were wrong at the start stay so while
    LAMMPS keeps count, so that they differ proves nothing. A body that is wide both ways is left
    as its flags have it: a wall that spans the box has no other shape. There is doubt if these are
    alike for all of its atoms, or make it as wide as the box, and a gap inside is wider than
    the one outside.

    Args:
        members: the `Members`.
    Returns:
        (place, image, delta, rebuilt, doubt): of each body's first atom its place in the box and
        image flags, (3, n) each; the place of each atom from there, (atoms, 3); the bodies that
        were put together by the nearest images, (n,) bool; a warning, None for none.
    """
    box, body = lammps.box, members.body
    x = lammps.x[members.atoms]
    image = lammps.images[members.atoms]
    first, place, flags = _first_atoms(members, x, image)
    # differences of the images are whole numbers: far from the origin nothing is lost
    image = lammps.image_difference(image - flags[:, body].T.astype(np.int64))
    delta = x - place[:, body].T
    nearest = delta - box.lattice(delta) @ box.h.T
    delta = delta + image @ box.h.T

    def parts_of(places):
        """Places (m, 3) in parts of the box vectors, where it is periodic, (3, m)."""
        return (places @ box.inverse.T * box.periodic).T

    parts = parts_of(delta)
    low, width = _extent(members, parts)
    wide = width >= 0.5
    if not members.communicator.any(wide.any()):
        return place, flags, delta, np.zeros(len(members.ids), bool), None
    cut = wide & (_extent(members, parts_of(nearest))[1] < 0.25)
    several_images = _extent(members, image.T)[1] > 0
    unsure = wide & ~cut & ~(several_images & (width < 1))
    gap = np.zeros_like(width)
    for k in np.flatnonzero(box.periodic):
        gap[k] = _widest_gap(members, parts[k] - low[k, body])
    gap[~unsure | (gap <= np.maximum(1.0 - width, _GAP))] = 0.0
    doubt = _doubt(members, first, width, gap)
    fold = np.rint((delta - nearest) @ box.inverse.T) * cut[:, body].T
    return place, flags, delta - fold @ box.h.T, cut.any(axis=0), doubt


def _first_atoms(members, x, image):
    """The ID of each body's first atom, (n,), its place and image flags, (3, n); collective."""
    (first,) = members.lowest(members.tag)
    lead = members.tag == first[members.body]
    reference = np.zeros((6, len(members.ids)))
    reference[:, members.body[lead]] = np.concatenate([x[lead], image[lead]], axis=1).T
    members.sharers.combine(reference)
    return first, reference[:3], reference[3:]


def _extent(members, columns):
    """The lowest of the numbers of each body's atoms, and how much higher the highest is, (3, n)
    each; collective."""
    low = members.lowest(*columns)
    return low, members.highest(*columns) - low


def _doubt(members, first, width, gap):
    """The warning for bodies that may be cut, with a gap (3, n) above zero, or None; collective."""
    gap = gap * members.owned
    worst = []
    if gap.any():
        k, b = np.unravel_index(gap.argmax(), gap.shape)
        worst = [gap[k, b], width[k, b], k, members.ids[b], first[b], gap.any(axis=0).sum()]
    rows = members.communicator.gather_to_all(np.array(worst).reshape(-1, 6))
    if not len(rows):
        return None
    inside, wide, k, body, atom, _ = rows[rows[:, 0].argmax()]
    others = rows[:, 5].sum() - 1
    return (
        f"WARNING: {members.membership.name(int(body))} (its first atom is {atom:.0f}) "
        f"may be cut by a periodic face: by its image flags it is {wide:.2f} box "
        f"lengths wide along {'xyz'[int(k)]}, with a gap of {inside:.2f} inside and of "
        f"{max(0.0, 1.0 - wide):.2f} outside. The flags are trusted"
        + (f" (as are those of {others:.0f} more)" if others else "")
        + ". If they are wrong, set them (set ... image, or in the data file) before the first run"
    )


def _widest_gap(members, parts):
    """Widest stretch inside each body without atoms, (n,), rounded down; collective.

    Args:
        parts: (atoms,) the atoms' distances from the end of their body, 0 to 1 (further ones count
            as at 1).
    """
    filled = np.zeros((_CELLS, len(members.ids)))
    filled[np.clip((parts * _CELLS).astype(int), 0, _CELLS - 1), members.body] = 1.0
    members.sharers.combine(filled, np.maximum)
    widest = run = np.zeros(len(members.ids))
    for row in filled > 0:
        widest = np.where(row, np.maximum(widest, run), widest)
        run = np.where(row, 0.0, run + 1.0)
    return widest / _CELLS
