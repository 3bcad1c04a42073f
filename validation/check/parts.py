"""Rigid parts of molecules, from bonds and masses: water, CH3, NH3, aromatic rings, and any heavy
atom with its hydrogens.  Without LAMMPS."""

import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from ..statistics import measures

# g/mol; a mass within NEAR of one of these identifies the element
ELEMENTS = {"H": 1.008, "C": 12.011, "N": 14.007, "O": 15.999, "S": 32.06, "F": 18.998}
NEAR = 0.3
RING = 5, 6  # atoms of an aromatic ring
# Angstrom: largest distance of an atom from the plane of its ring, at room temperature
FLAT = 0.35
ROUNDS = 5  # iterations of fits to a mean shape
PARTS = "water", "CH3", "NH3", "rings", "XH"
Atoms = Mapping[str, np.ndarray]


def _elements(mass: np.ndarray) -> np.ndarray:
    """The element of each atom, by its mass; empty if unknown."""
    elements = np.full(len(mass), "", dtype="<U2")
    for name, known in ELEMENTS.items():
        elements[np.abs(mass - known) < NEAR] = name
    return elements


def _neighbours(bonds: np.ndarray, atoms: int) -> list[list[int]]:
    """The bonded neighbours of each atom, from 0; ``bonds`` has rows (type, ID, ID)."""
    neighbours: list[list[int]] = [[] for _ in range(atoms)]
    for _, i, j in bonds:
        neighbours[i - 1].append(j - 1)
        neighbours[j - 1].append(i - 1)
    return neighbours


def rigid(
    atoms: Atoms, cell: np.ndarray, periodic: Sequence[bool], wanted: Collection[str] = PARTS[:-1]
) -> tuple[np.ndarray, dict[str, int]]:
    """The rigid part of each atom, numbered from 1 in order of their first atoms, 0 for none; and
    the number of each of `PARTS`.  XH is a heavy atom with its hydrogens, in no other part.

    Args:
        atoms: ``mass``, ``x`` and ``bonds``, as read by ``reader``.
        cell: vectors as rows, Angstrom.
        wanted: of `PARTS`.
    """
    number, kinds = len(atoms["mass"]), _elements(atoms["mass"])
    tied = _neighbours(atoms["bonds"], number)
    parts: dict[str, list[set[int]]] = {name: [] for name in PARTS}
    for atom in range(number):
        light = [other for other in tied[atom] if kinds[other] == "H" and len(tied[other]) == 1]
        if kinds[atom] == "O" and len(tied[atom]) == len(light) == 2:
            parts["water"].append({atom, *light})
        elif kinds[atom] in ("C", "N") and len(light) == 3 and len(tied[atom]) <= 4:
            parts["CH3" if kinds[atom] == "C" else "NH3"].append({atom, *light})
        if kinds[atom] in ("C", "N", "O", "S") and light:
            parts["XH"].append({atom, *light})
    parts["rings"] = _joined(
        ring | {other for atom in ring for other in tied[atom] if kinds[other] == "H"}
        for ring in _rings(tied, kinds)
        if _is_flat(_unwrapped(atoms["x"][sorted(ring)], cell, periodic))
    )
    others = {atom for name in wanted if name != "XH" for part in parts[name] for atom in part}
    parts["XH"] = [part for part in parts["XH"] if part.isdisjoint(others)]
    every = sorted((part for name in wanted for part in parts[name]), key=min)
    body = np.zeros(number, int)
    for index, part in enumerate(every, 1):
        body[list(part)] = index
    return body, {name: len(parts[name]) for name in wanted}


def _rings(tied: list[list[int]], kinds: np.ndarray) -> Iterator[set[int]]:
    """Yield closed walks of `RING` atoms that can be aromatic, each once."""
    able = [kind in ("C", "N", "O", "S") and len(bonded) <= 3 for kind, bonded in zip(kinds, tied)]
    seen = set()
    for first in np.flatnonzero(able):
        walks = [[int(first)]]
        while walks:
            walk = walks.pop()
            for atom in tied[walk[-1]]:
                if atom == first and len(walk) in RING and frozenset(walk) not in seen:
                    seen.add(frozenset(walk))
                    yield set(walk)
                elif atom > first and able[atom] and atom not in walk and len(walk) < max(RING):
                    walks.append([*walk, atom])


def _unwrapped(x: np.ndarray, cell: np.ndarray, periodic: Sequence[bool]) -> np.ndarray:
    """The atoms of bodies, (..., atoms, 3), unwrapped by nearest images."""
    return x[..., :1, :] + measures.nearest_image(x - x[..., :1, :], cell, periodic)


def _is_flat(r: np.ndarray) -> bool:
    r = r - r.mean(axis=0)
    return bool(np.abs(r @ np.linalg.svd(r)[2][2]).max() < FLAT)


def _joined(parts: Iterable[set[int]]) -> list[set[int]]:
    """Merge parts that share atoms."""
    merged: list[set[int]] = []
    for part in parts:
        touching = [other for other in merged if other & part]
        merged = [*(other for other in merged if other not in touching), part.union(*touching)]
    return merged


def _turn(shape: np.ndarray, other: np.ndarray) -> Rotation:
    """The rotation of a body onto the shape; of a linear one, any about its axis."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Optimal rotation is not uniquely")
        return Rotation.align_vectors(shape, other)[0]


def alike(
    atoms: Atoms, body: np.ndarray, cell: np.ndarray, periodic: Sequence[bool]
) -> tuple[np.ndarray, float]:
    """The positions of all atoms if each body has the mean shape of its kind; and the largest
    displacement of an atom.  Bodies with the same types are a kind; atoms of a type correspond in
    order of ID."""
    moved = np.zeros_like(atoms["x"], dtype=float)
    order = np.lexsort((atoms["type"], body))  # stable
    kinds: dict[tuple, list[np.ndarray]] = {}
    for members in np.split(order, np.flatnonzero(np.diff(body[order])) + 1):
        if body[members[0]]:
            kinds.setdefault((*atoms["type"][members],), []).append(members)
    for rows in kinds.values():
        group = np.array(rows)
        mass = atoms["mass"][group[0]]
        r = _unwrapped(atoms["x"][group], cell, periodic)
        if group.shape[1] == 4:  # CH3: a mirror image is the same kind, with two of its H swapped
            volume = np.linalg.det(r[:, 1:] - r[:, :1])
            light = np.argsort(mass, kind="stable")[:2]
            mirrored = np.flatnonzero(volume * volume[0] < 0)[:, None]
            group[mirrored, light] = group[mirrored, light[::-1]]
            r[mirrored, light] = r[mirrored, light[::-1]]
        centred = r - (np.einsum("i,bij->bj", mass, r) / mass.sum())[:, None]
        shape = centred[0]
        for _ in range(ROUNDS):
            turns = [_turn(shape, positions) for positions in centred]
            shape = np.mean(
                [turn.apply(positions) for turn, positions in zip(turns, centred)], axis=0
            )
        moved[group] = np.array([turn.inv().apply(shape) for turn in turns]) - centred
    return atoms["x"] + moved, float(np.linalg.norm(moved, axis=1).max(initial=0.0))
