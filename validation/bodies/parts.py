"""Rigid parts of molecules, from bonds and masses: water, CH3, NH3, aromatic rings.  No LAMMPS."""

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from ..statistics import measures

# g/mol; a mass within NEAR of one of these is that element
ELEMENTS = {"H": 1.008, "C": 12.011, "N": 14.007, "O": 15.999, "S": 32.06, "F": 18.998}
NEAR = 0.3
RING = 5, 6  # atoms of an aromatic ring
# Angstrom: how far an atom of a ring may be from its plane in a run at room temperature
FLAT = 0.35
PARTS = "water", "CH3", "NH3", "rings"


def elements(mass: np.ndarray) -> np.ndarray:
    """The element of each atom, by its mass; empty for none."""
    found = np.full(len(mass), "", dtype="<U2")
    for name, one in ELEMENTS.items():
        found[np.abs(mass - one) < NEAR] = name
    return found


def neighbours(bonds: np.ndarray, atoms: int) -> list[list[int]]:
    """Of each atom those that it is bonded to, from 0; ``bonds`` has rows (type, ID, ID)."""
    found: list[list[int]] = [[] for _ in range(atoms)]
    for _, i, j in bonds:
        found[i - 1].append(j - 1)
        found[j - 1].append(i - 1)
    return found


def rigid(
    atoms: Mapping[str, np.ndarray],
    cell: np.ndarray,
    periodic: Sequence[bool],
    wanted: Collection[str] = PARTS,
) -> tuple[np.ndarray, dict[str, int]]:
    """The rigid part of each atom, numbered from 1 in order of their first atoms, 0 for none; and
    how many there are of each of `PARTS`.

    Args:
        atoms: ``mass``, ``x`` and ``bonds``, as of ``own.reader``.
        cell: vectors as rows, Angstrom.
        wanted: of `PARTS`.
    """
    number = len(atoms["mass"])
    kinds = elements(atoms["mass"])
    tied = neighbours(atoms["bonds"], number)
    made: dict[str, list[set[int]]] = {name: [] for name in PARTS}
    for atom in range(number):
        light = [one for one in tied[atom] if kinds[one] == "H" and len(tied[one]) == 1]
        if kinds[atom] == "O" and len(tied[atom]) == len(light) == 2:
            made["water"].append({atom, *light})
        elif kinds[atom] in ("C", "N") and len(light) == 3 and len(tied[atom]) <= 4:
            made["CH3" if kinds[atom] == "C" else "NH3"].append({atom, *light})
    made["rings"] = _joined(
        ring | {one for atom in ring for one in tied[atom] if kinds[one] == "H"}
        for ring in _rings(tied, kinds)
        if _is_flat(atoms["x"][sorted(ring)], cell, periodic)
    )
    every = sorted((part for name in wanted for part in made[name]), key=min)
    body = np.zeros(number, int)
    for index, part in enumerate(every, 1):
        body[list(part)] = index
    return body, {name: len(made[name]) for name in wanted}


def _rings(tied, kinds) -> Iterator[set[int]]:
    """Closed walks of `RING` atoms that can be aromatic, each once."""
    able = [
        kinds[atom] in ("C", "N", "O", "S") and len(tied[atom]) <= 3 for atom in range(len(tied))
    ]
    seen = set()
    for first in range(len(tied)):
        if not able[first]:
            continue
        walks = [[first]]
        while walks:
            walk = walks.pop()
            for one in tied[walk[-1]]:
                if one == first and len(walk) in RING:
                    key = frozenset(walk)
                    if key not in seen:
                        seen.add(key)
                        yield set(walk)
                elif one > first and able[one] and one not in walk and len(walk) < max(RING):
                    walks.append([*walk, one])


def _is_flat(x, cell, periodic) -> bool:
    r = x[:1] + measures.nearest_image(x - x[:1], cell, periodic)
    r = r - r.mean(axis=0)
    return bool(np.abs(r @ np.linalg.svd(r)[2][2]).max() < FLAT)


def _joined(parts) -> list[set[int]]:
    """Parts, with those that share atoms as one."""
    found: list[set[int]] = []
    for part in parts:
        apart = [one for one in found if not one & part]
        found = [*apart, part.union(*(one for one in found if one & part))]
    return found


def alike(
    atoms: Mapping[str, np.ndarray], body: np.ndarray, cell: np.ndarray, periodic: Sequence[bool]
) -> tuple[np.ndarray, float]:
    """Places of all atoms when each body has the mean shape of its kind; and the largest distance
    that an atom moved.

    Bodies of the same types, in order of ID, are a kind.  Of four atoms, as CH3, the last two may
    change places: a mirror image is no other kind.
    """
    x = atoms["x"].astype(float).copy()
    types = atoms["type"]
    order = np.argsort(body, kind="stable")
    order = order[body[order] > 0]
    _, first, sizes = np.unique(body[order], return_index=True, return_counts=True)
    groups: dict[tuple, list[np.ndarray]] = {}
    for begin, size in zip(first, sizes):
        own = order[begin : begin + size]
        groups.setdefault(tuple(types[own]), []).append(own)
    for rows in groups.values():
        group = np.array(rows)
        r = x[group]
        r = r[:, :1] + measures.nearest_image(r - r[:, :1], cell, periodic)
        mass = atoms["mass"][group][..., None]
        centre = (mass * r).sum(axis=1) / mass.sum(axis=1)
        r = r - centre[:, None]
        mean = r[0]
        for _ in range(5):
            turned = [_fitted(one, mean) for one in r]
            mean = np.mean([one for one, _ in turned], axis=0)
        for own, place, (_, (turn, swap)) in zip(group, centre, (_fitting(one, mean) for one in r)):
            x[own] = place + turn.inv().apply(mean)[swap]
    moved = measures.nearest_image(x - atoms["x"], cell, periodic)
    return atoms["x"] + moved, float(np.linalg.norm(moved, axis=1).max(initial=0.0))


def _fitting(r, mean):
    """(r turned to fit, (the rotation, the order of its atoms))."""
    swaps = [np.arange(len(r))]
    if len(r) == 4:
        swaps.append(np.array([0, 1, 3, 2]))
    best = None
    for swap in swaps:
        turn, off = Rotation.align_vectors(mean, r[swap])
        if best is None or off < best[0] - 1e-9:
            best = off, turn, swap
    assert best
    _, turn, swap = best
    return turn.apply(r[swap]), (turn, swap)


def _fitted(r, mean):
    return _fitting(r, mean)
