"""Shapes of bodies: kept where something has deformed them between two runs."""

from typing import NamedTuple

import numpy as np

from ..errors import refuse
from ..motion.frames import matrices, product, quaternions
from .bodies import OFF_BODY
from .extended import DIPOLE, ORIENT, OWN_MOMENT
from .members import Members
from .membership import PreviousBodies
from .particles import Particles

_TORN = 2.0  # atoms further off than this times the size of their body say nothing of where it is
_LINE = 1e-10  # a body whose atoms tell less than this part of a turn about their line is a line
_ANOTHER = 1e-6  # radians by which an orientation is another one
_WEAK = 1e-6  # directions that tell less than this part of such a turn are along the line
_MISTAKEN = 0.2  # so may those, where atoms are known by their IDs alone


class ShapeCorrection(NamedTuple):
    """What keeping the bodies' shapes changes; by default nothing.

    Attributes:
        atoms: (k,) indices in LAMMPS's arrays of the atoms that have to move.
        shift: (k, 3) how far.
        text: a line for the log; empty if no body was deformed.
        turned: how many particles, on all ranks, have got another orientation.
        new: whether some body, on any rank, is of other atoms than before.
    """

    atoms: np.ndarray = np.empty(0, np.int64)
    shift: np.ndarray = np.empty((0, 3))
    text: str = ""
    turned: int = 0
    new: bool = True


def keep(
    members: Members, previous: PreviousBodies, r: np.ndarray
) -> tuple[Members, np.ndarray, ShapeCorrection]:
    """Give bodies that something has deformed since the last run their shape again; collective.

    Such a body is put at the centre of mass of its atoms and turned to fit them best, by least
    squares weighted with mass (Kabsch, Acta Cryst. A 34, 827 (1978)).  A body of other atoms than
    before has the shape that its atoms have.  The same fit tells how a body was turned whole, by
    which the orientations of its particles follow.  Atoms in a line do not tell how far it was
    turned about that line: the particles' orientations, as they are now, do.

    Args:
        previous: what LAMMPS's atoms were in bodies.
        r: (m, 3) the atoms' places from their body's centre of mass, space frame.
    Returns:
        the `Members`, with particles that are turned with their bodies; r in the kept shapes; and
        the `ShapeCorrection`.
    Raises:
        RunError: on all ranks, if a body was torn apart.
    """
    communicator, atoms, body = members.communicator, members.atoms, members.body
    columns = previous.displace[:, atoms]
    same = _of_the_same_atoms(members, previous)
    new = communicator.any(not same.all())
    weight, d = members.atom_mass * same[body], columns[:3]
    mass, *moments = members.total([weight, *(weight * d)])
    d = d - np.divide(moments, mass, out=np.zeros((3, len(mass))), where=same)[:, body]
    box = members.lammps.box
    bound = OFF_BODY * box.size + 8 * np.spacing(box.farthest)

    def off(placed: np.ndarray) -> np.ndarray:
        """How far each body's atoms are from these places, at most, (n,)."""
        return members.highest(np.linalg.norm(r - placed, axis=1))[0] * same

    moved = off(np.einsum("abm,bm->ma", matrices(previous.q[:, atoms]), d)) > bound
    if not communicator.any(moved.any()):
        return members, r, ShapeCorrection(new=new)
    particles = members.particles if len(columns) > ORIENT else None
    turn = _turns(members, previous, moved, r, d, particles)
    placed = np.einsum("mab,bm->ma", turn[body], d)
    far = off(placed) * moved
    deformed, text, turned = far > bound, "", 0
    if communicator.any(deformed.any()):
        size = np.maximum(members.highest(np.linalg.norm(d, axis=0))[0], bound)
        most = _TORN if previous.followed else _MISTAKEN
        text = _say(members, far, size, deformed & members.owned, most)
    if particles is not None:
        particles, others = _turned(particles, moved[body], turn[body], columns)
        members, turned = members._replace(particles=particles), communicator.count(others)
    here = deformed[body]
    placed = np.where(here[:, None], placed, r)
    shift = (placed - r)[here]
    return members, placed, ShapeCorrection(atoms[here], shift, text, turned, new)


def _of_the_same_atoms(members: Members, previous: PreviousBodies) -> np.ndarray:
    """Which bodies have the atoms that they had, (n,) bool; collective."""
    before = np.where(previous.known, previous.natoms, 0)[members.atoms]
    return members.lowest(before)[0] == members.natoms


def _turns(
    members: Members,
    previous: PreviousBodies,
    moved: np.ndarray,
    r: np.ndarray,
    d: np.ndarray,
    particles: Particles | None,
) -> np.ndarray:
    """How far each body that has `moved` (n,) is turned, (n, 3, 3); collective.

    Args:
        r (m, 3), d (3, m): the atoms' places from the centre now, and in their body's frame.
        particles: what the atoms are; None if none can have an orientation.
    """
    n, plane = len(moved), members.lammps.dimension == 2
    weight = members.atom_mass * moved[members.body]
    products = members.total(weight * a * b for a in r.T for b in d).T.reshape(n, 3, 3)
    turn = np.tile(np.eye(3), (n, 1, 1))
    turn[moved] = best_turns(products[moved], plane)
    if particles is not None and not plane:
        directions = _directions(particles, previous.displace[:, members.atoms]).reshape(9, -1)
        told = members.total(directions).T.reshape(n, 3, 3)
        before = matrices(members.highest(*previous.q[:, members.atoms])).transpose(2, 0, 1)
        turn[moved] = twist(turn[moved], products[moved], told[moved], before[moved])
    return turn


def best_turns(products: np.ndarray, plane: bool = False) -> np.ndarray:
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


def _directions(particles: Particles, columns: np.ndarray) -> np.ndarray:
    """The sums of a bᵀ over each particle's directions now, a, and in its body, b: (3, 3, m).

    Args:
        columns: (rows, m) of `Bodies.displace`.
    """
    orient, dipole = columns[ORIENT:OWN_MOMENT], columns[DIPOLE:]
    axes = np.einsum("akm,bkm->abm", particles.axes, matrices(orient)) * orient.any(axis=0)
    square = (dipole**2).sum(axis=0)
    both = np.einsum("am,bm->abm", particles.dipole, dipole)
    return axes + np.divide(both, square, out=np.zeros_like(both), where=square > 0)


def _turned(
    before: Particles, which: np.ndarray, turn: np.ndarray, columns: np.ndarray
) -> tuple[Particles, int]:
    """The particles, turned with their bodies.

    Args:
        which: (m,) bool, the particles of bodies that have moved.
        turn: (m, 3, 3) the new rotation of each particle's body.
        columns: (rows, m) of `Bodies.displace`.
    Returns:
        these, and how many of them had another orientation.
    """
    turn, d = turn[which], columns[:, which]
    quat, dipole = before.quat.copy(), before.dipole.copy()
    quat[:, which] = product(quaternions(turn), d[ORIENT:OWN_MOMENT])
    dipole[:, which] = np.einsum("mab,bm->am", turn, d[DIPOLE:])
    now = before._replace(quat=quat, dipole=dipole)
    size = np.linalg.norm(dipole, axis=0)
    others = np.abs(now.axes - before.axes).max(axis=(0, 1)) > _ANOTHER
    others |= np.abs(dipole - before.dipole).max(axis=0) > _ANOTHER * size
    return now, int(others.sum())


def twist(turn: np.ndarray, products: np.ndarray, *others: np.ndarray) -> np.ndarray:
    """Rotations of bodies; those that are a line are turned about it so that directions fit best.

    Args:
        turn: (n, 3, 3) of `best_turns`.  products: (n, 3, 3), from which they are.
        others: products of other vectors, (n, 3, 3) each; the later ones serve where those before
            say nothing.
    Returns:
        (n, 3, 3) rotation matrices.
    """
    left, size, _ = np.linalg.svd(products)
    left_out = size[:, 1] <= _LINE * size[:, 0]
    along = left[:, :, :1] @ left[:, :, :1].transpose(0, 2, 1)
    across, turn = np.eye(3) - along, turn.copy()
    for told in others:
        told = told @ turn.transpose(0, 2, 1)
        size = np.linalg.norm(told, axis=(1, 2))[:, None, None]
        about = across @ told @ across
        which = left_out & (np.linalg.norm(about, axis=(1, 2)) > _WEAK * size[:, 0, 0])
        turn[which] = best_turns((about + size * along)[which]) @ turn[which]
        left_out &= ~which
    return turn


def _say(
    members: Members, far: np.ndarray, size: np.ndarray, which: np.ndarray, most: float
) -> str:
    """The line for the log on bodies that were deformed; collective.

    Args:
        far, size: (n,) how far an atom of each body is from its place, and the body's size.
        which: (n,) bool, the bodies that were deformed.
        most: an atom may be off by so many sizes.
    Raises:
        RunError: on all ranks, if one is off by more.
    """
    part, distance, body = members.furthest(which, far / size, far, members.ids)
    name = members.membership.name(int(body))
    refuse(
        part > most,
        f"{name} was torn apart between the runs: an atom is {distance:.3g} away from where "
        f"the body's shape has it, {part:.2g} times its size. Keep the atoms' IDs and the "
        "boundary, and change the box with 'remap'; or, if the new shape is meant, unfix this "
        "fix and define it again",
    )
    count = members.communicator.count(which.sum())
    return (
        f"Bodies that were deformed between the runs: {count}; "
        f"{name} the most, by {distance:.3g}, {part:.2g} of its size. They keep their shape: "
        "each was put at the centre of mass of its atoms and turned to fit them. "
        "If the new shape is meant, unfix this fix and define it again\n"
    )
