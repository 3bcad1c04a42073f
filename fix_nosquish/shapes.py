"""Shapes of bodies: kept where something has deformed them between two runs."""

from typing import NamedTuple

import numpy as np

from .bodies import OFF_BODY, matrices
from .errors import RunError

_TORN = 2.0  # atoms further off than this times the size of their body say nothing of where it is
_LITTLE = 1e-12  # a part of what atoms tell of a turn that changes none which they do tell
_MISTAKEN = 0.2  # so may those, where atoms are known by their IDs alone


class Kept(NamedTuple):
    """What keeping the shapes of bodies changes.

    Attributes:
        which: (atoms of bodies,) bool, the atoms here of bodies that were turned or deformed.
        atoms: (m,) their indices.  shift: (m, 3) how far each has to move.
        turn: (m, 3, 3) the new rotation of the frame in which `former` has them.
        text: a line for the log; None if no body was deformed.
    """

    which: np.ndarray
    atoms: np.ndarray
    shift: np.ndarray
    turn: np.ndarray
    text: str


def keep(lammps, communicator, membership, sharers, former, ids, body, atoms, mass, r):
    """Give bodies that something has deformed since the last run their shape again; collective.

    Such a body is put at the centre of mass of its atoms and turned to fit them best, by least
    squares weighted with mass (Kabsch, Acta Cryst. A 34, 827 (1978)).  A body of other atoms than
    before has the shape that its atoms have.  The same fit tells how a body was turned whole, by
    which the orientations of its particles follow.

    Args:
        former: the `Former` of LAMMPS's atoms.  ids: (n,) the bodies' IDs.
        body, atoms, mass: (m,) each atom's body, index in LAMMPS's arrays, mass.
        r: (m, 3) its place from the body's centre of mass, in the space frame.
    Returns:
        r (m, 3), the same array if nothing has deformed a body; `Kept`, None if nothing has turned
        or deformed one; and whether some body, on any rank, is of other atoms than before.
    Raises:
        RunError: on all ranks, if a body was torn apart.
    """
    n = len(ids)

    def total(columns):
        sums = np.array([np.bincount(body, c, minlength=n) for c in columns])
        sharers.combine(sums)
        return sums

    def largest(values, start, operation):
        """The largest (or smallest) value over each body's atoms, (len(values), n)."""
        result = np.full((len(values), n), start)
        for row, column in zip(result, values):
            operation.at(row, body, column)
        sharers.combine(result, operation)
        return result

    known, old, natoms = (of_all[atoms] for of_all in (former.known, former.id, former.natoms))
    low = largest(np.where(known, (old, -old, natoms), -np.inf), np.inf, np.minimum)
    same = (low[0] == -low[1]) & (low[2] == total([np.ones(len(atoms))])[0])
    if not former.followed:
        same &= low[0] == ids
    new = communicator.any(not same.all())
    weight = mass * same[body]
    d = former.displace[:3, atoms]
    sums = total([weight, *(weight * d)])
    d = d - np.divide(sums[1:], sums[0], out=np.zeros((3, n)), where=same)[:, body]
    bound = OFF_BODY * lammps.box.size + 8 * np.spacing(lammps.box.farthest)

    def off(placed):
        """How far each body's atoms are from these places, at most, (n,)."""
        return largest([np.linalg.norm(r - placed, axis=1)], 0.0, np.maximum)[0] * same

    moved = off(np.einsum("abm,bm->ma", matrices(former.q[:, atoms]), d)) > bound
    if not communicator.any(moved.any()):
        return r, None, new
    weight = weight * moved[body]
    products = total([weight * a * b for a in r.T for b in d]).T.reshape(n, 3, 3)
    # atoms in a line do not tell a turn about it: there is none
    before = matrices(largest(former.q[:, atoms], -np.inf, np.maximum)).transpose(2, 0, 1)
    products = products + _LITTLE * np.abs(products).max(axis=(1, 2))[:, None, None] * before
    turn = np.tile(np.eye(3), (n, 1, 1))
    turn[moved] = best_turns(products[moved], lammps.dimension == 2)
    placed = np.einsum("mab,bm->ma", turn[body], d)
    far = off(placed) * moved
    deformed, text = far > bound, None
    if communicator.any(deformed.any()):
        size = np.maximum(largest([np.linalg.norm(d, axis=0)], 0.0, np.maximum)[0], bound)
        most = _TORN if former.followed else _MISTAKEN
        text = _say(communicator, membership, ids, far, size, deformed & sharers.owned, most)
    mine, here = moved[body], deformed[body]
    placed = np.where(here[:, None], placed, r)
    kept = Kept(mine, atoms[mine], (placed - r)[mine], turn[body[mine]], text)
    return placed if text else r, kept, new


def best_turns(products, plane=False):
    """The rotations that bring one set of vectors nearest to another.

    Args:
        products: (n, 3, 3), the sums over the vectors of weight times a bᵀ; b is turned into a.
        plane: whether to turn about z only.
    Returns:
        (n, 3, 3) rotation matrices.
    """
    if plane:
        xx, xy, yx, yy = products[:, :2, :2].reshape(-1, 4).T
        angle = np.arctan2(yx - xy, xx + yy)
        turn = np.tile(np.eye(3), (len(products), 1, 1))
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
        turn[:, 1, 0] = np.sin(angle)
        turn[:, 0, 1] = -turn[:, 1, 0]
        return turn
    left, _, right = np.linalg.svd(products)
    left[:, :, 2] *= np.linalg.det(left @ right)[:, None]
    return left @ right


def _say(communicator, membership, ids, far, size, which, most):
    """The line for the log on these bodies (n,) bool, off by `most` sizes at most; collective.

    Raises: as `keep`.
    """
    worst = []
    if which.any():
        k = np.argmax(far / size * which)
        worst = [[far[k] / size[k], far[k], ids[k]]]
    rows = communicator.gather_to_all(np.array(worst).reshape(-1, 3))
    part, distance, name = rows[rows[:, 0].argmax()]
    name = membership.name(int(name))
    if part > most:
        raise RunError(
            f"{name} was torn apart between the runs: an atom is {distance:.3g} away from where "
            f"the body's shape has it, {part:.2g} times its size. Bodies that a periodic face cuts "
            "are torn when the boundary changes, or the box without 'remap'; IDs must stay as they "
            "are. If the new shape is meant, unfix this fix and define it again",
            everywhere=True,
        )
    count = round(communicator.total(np.array([which.sum()]))[0])
    return (
        f"Bodies that were deformed between the runs: {count}; "
        f"{name} the most, by {distance:.3g}, {part:.2g} of its size. They keep their shape: "
        "each was put at the centre of mass of its atoms and turned to fit them. "
        "If the new shape is meant, unfix this fix and define it again\n"
    )
