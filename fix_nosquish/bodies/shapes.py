"""Restore the shapes of bodies that were deformed between two runs."""

from typing import NamedTuple

import numpy as np

from ..errors import refuse
from ..motion.frames import matrices, product, quaternions
from .bodies import OFF_BODY
from .extended import DIPOLE, ORIENT, OWN_MOMENT
from .members import Members
from .membership import PreviousBodies
from .particles import Particles

_TORN = 2.0  # atoms off by more than this times the body's size do not determine its position
_LINE = 1e-10  # relative size of the second singular value below which a body is a line
_ANOTHER = 1e-6  # change of an orientation, radians, that counts as a different one
_MISTAKEN = 0.2  # replaces _TORN where atoms are matched by their IDs alone


class ShapeCorrection(NamedTuple):
    """The changes that restore the bodies' shapes; by default none.

    Attributes:
        atoms: (k,) indices in LAMMPS's arrays of the atoms to move.
        shift: (k, 3) their displacements.
        text: a line for the log; empty if no body was deformed.
        turned: number of particles, on all ranks, with a changed orientation.
        new: whether some body, on any rank, has other atoms than before.
    """

    atoms: np.ndarray = np.empty(0, np.int64)
    shift: np.ndarray = np.empty((0, 3))
    text: str = ""
    turned: int = 0
    new: bool = True


def keep(
    members: Members, previous: PreviousBodies, r: np.ndarray
) -> tuple[Members, np.ndarray, ShapeCorrection]:
    """Restore the shapes of bodies that were deformed since the last run; collective.

    A deformed body is placed at the centre of mass of its atoms, with the orientation of the
    mass-weighted least-squares fit (Kabsch, Acta Cryst. A 34, 827 (1978)).  A body with other atoms
    than before takes the shape of its atoms.  The fit also gives the rotation of a body that was
    rotated as a whole, by which its particles are rotated.

    Args:
        previous: the previous bodies of LAMMPS's atoms.
        r: (m, 3) positions of the atoms relative to the centre of mass, space frame.
    Returns:
        the `Members`, with particles rotated with their bodies; r in the restored shapes; and the
        `ShapeCorrection`.
    Raises:
        RunError: on all ranks, if a body was torn apart, or if the rotation of its particles is not
            known.
    """
    communicator, atoms, body = members.communicator, members.atoms, members.body
    columns, before = previous.displace[:, atoms], np.where(previous.known, previous.natoms, 0)
    same = members.lowest(before[atoms])[0] == members.natoms
    new = communicator.any(not same.all())
    weight, d = members.atom_mass * same[body], columns[:3]
    mass, *moments = members.total([weight, *(weight * d)])
    d = d - np.divide(moments, mass, out=np.zeros((3, len(mass))), where=same)[:, body]
    box = members.lammps.box
    bound = OFF_BODY * box.size + 8 * np.spacing(box.farthest)

    def off(placed: np.ndarray) -> np.ndarray:
        """Largest distance of each body's atoms from these positions, (n,)."""
        return members.highest(np.linalg.norm(r - placed, axis=1))[0] * same

    moved = off(np.einsum("abm,bm->ma", matrices(previous.q[:, atoms]), d)) > bound
    if not communicator.any(moved.any()):
        return members, r, ShapeCorrection(new=new)
    particles = members.particles if len(columns) > ORIENT else None
    if particles is not None:
        _refuse_oriented_lines(members, moved, d, np.any(columns[ORIENT:], axis=0))
    turn = _turns(members, moved, r, d)
    placed = np.einsum("mab,bm->ma", turn[body], d)
    far = off(placed) * moved
    deformed, text, turned = far > bound, "", 0
    if communicator.any(deformed.any()):
        size = np.maximum(members.highest(np.linalg.norm(d, axis=0))[0], bound)
        most = _TORN if previous.followed else _MISTAKEN
        text = _deformation_line(members, far, size, deformed & members.owned, most)
    if particles is not None:
        particles, others = _turned(particles, moved[body], turn[body], columns)
        members, turned = members._replace(particles=particles), communicator.count(others)
    here = deformed[body]
    placed = np.where(here[:, None], placed, r)
    shift = (placed - r)[here]
    return members, placed, ShapeCorrection(atoms[here], shift, text, turned, new)


def _turns(members: Members, moved: np.ndarray, r: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The rotation of each body from its principal frame, (n, 3, 3); collective.

    Args:
        moved: (n,) bool, the bodies to fit; the others get the identity.
        r, d: (m, 3), (3, m) present positions relative to the centre of mass, space frame; and
            positions in the principal frame.
    """
    n, weight = len(moved), members.atom_mass * moved[members.body]
    products = members.total(weight * a * b for a in r.T for b in d).T.reshape(n, 3, 3)
    turn = np.tile(np.eye(3), (n, 1, 1))
    turn[moved] = best_turns(products[moved], members.lammps.dimension == 2)
    return turn


def _refuse_oriented_lines(
    members: Members, moved: np.ndarray, d: np.ndarray, oriented: np.ndarray
) -> None:
    """Raise an error if a line of oriented particles has moved: its atoms do not tell the rotation
    of the particles about the line; collective.

    Args:
        moved: (n,) bool.  d: (3, m) see `_turns`.  oriented: (m,) bool.
    """
    (has,) = members.highest(1.0 * oriented)
    mass = members.atom_mass
    sums = members.total(mass * a * b for a in d for b in d).T.reshape(len(moved), 3, 3)
    size = np.linalg.svd(sums, compute_uv=False)
    line = (size[:, 1] <= _LINE * size[:, 0]) & (members.lammps.dimension == 3)
    members.refuse(
        moved & (has > 0) & line,
        lambda k: (
            "is a line of particles with an orientation, and something has turned or deformed it "
            "between the runs, so their rotation about the line is not known: unfix this fix and "
            "define it again"
        ),
    )


def best_turns(products: np.ndarray, plane: bool = False) -> np.ndarray:
    """The rotations that fit one set of vectors to another by least squares.

    Args:
        products: (n, 3, 3), weighted sums of a bᵀ; b is rotated onto a.
        plane: whether to rotate about z only.
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


def _turned(
    before: Particles, which: np.ndarray, turn: np.ndarray, columns: np.ndarray
) -> tuple[Particles, int]:
    """Rotate the particles with their bodies.

    Args:
        which: (m,) bool, the particles of bodies that have moved.
        turn: (m, 3, 3) new rotation of each particle's body.
        columns: (rows, m) of `Bodies.displace`.
    Returns:
        the particles, and how many have a changed orientation.
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


def _deformation_line(
    members: Members, far: np.ndarray, size: np.ndarray, which: np.ndarray, most: float
) -> str:
    """The line for the log on bodies that were deformed; collective.

    Args:
        far, size: (n,) largest distance of an atom from its position in the body; size of the body.
        which: (n,) bool, the bodies that were deformed.
        most: largest allowed distance, in sizes of the body.
    Raises:
        RunError: on all ranks, if a distance is larger.
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
