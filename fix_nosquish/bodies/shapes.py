"""Shapes of bodies: kept where something has deformed them between two runs."""

from typing import NamedTuple

import numpy as np

from ..errors import RunError
from ..motion.frames import product
from .bodies import OFF_BODY, matrices, quaternions
from .extended import DIPOLE, ORIENT, OWN_MOMENT

_TORN = 2.0  # atoms further off than this times the size of their body say nothing of where it is
_LINE = 1e-10  # a body whose atoms tell less than this part of a turn about their line is a line
_ANOTHER = 1e-6  # radians by which an orientation is another one
_WEAK = 1e-6  # directions that tell less than this part of such a turn are along the line
_MISTAKEN = 0.2  # so may those, where atoms are known by their IDs alone


class Kept(NamedTuple):
    """What keeping the shapes of bodies changes.

    Attributes:
        which: (atoms of bodies,) bool, the atoms here of bodies that were turned or deformed.
        atoms: (m,) their indices.  shift: (m, 3) how far each has to move.
        turn: (m, 3, 3) the new rotation of the frame in which `former` has them.
        text: a line for the log; None if no body was deformed.
        turned: how many particles, on all ranks, have got another orientation.
    """

    which: np.ndarray
    atoms: np.ndarray
    shift: np.ndarray
    turn: np.ndarray
    text: str | None
    turned: int


def keep(lammps, members, former, r, particles=None, oriented=False):
    """Give bodies that something has deformed since the last run their shape again; collective.

    Such a body is put at the centre of mass of its atoms and turned to fit them best, by least
    squares weighted with mass (Kabsch, Acta Cryst. A 34, 827 (1978)).  A body of other atoms than
    before has the shape that its atoms have.  The same fit tells how a body was turned whole, by
    which the orientations of its particles follow.  Atoms in a line do not tell how far it was
    turned about that line: the particles' orientations, as they are now, do.

    Args:
        members: the `Members`.  former: the `Former` of LAMMPS's atoms.
        r: (m, 3) the atoms' places from their body's centre of mass, in the space frame.
        particles: the `Particles` that the atoms are, None if all are points.
        oriented: whether they can have an orientation.
    Returns:
        r (m, 3), the same array if nothing has deformed a body; the particles, turned with their
        bodies; `Kept`, None if nothing has turned or deformed one; and whether some body, on any
        rank, is of other atoms than before.
    Raises:
        RunError: on all ranks, if a body was torn apart.
    """
    atoms, body = members.atoms, members.body
    same = _of_the_same_atoms(members, former)
    new = members.communicator.any(not same.all())
    d = former.displace[:3, atoms]
    mass, *moments = members.total(*(members.mass * same[body] * np.vstack([np.ones(len(r)), d])))
    d = d - np.divide(moments, mass, out=np.zeros((3, len(mass))), where=same)[:, body]
    bound = OFF_BODY * lammps.box.size + 8 * np.spacing(lammps.box.farthest)

    def off(placed):
        """How far each body's atoms are from these places, at most, (n,)."""
        return members.highest(np.linalg.norm(r - placed, axis=1))[0] * same

    moved = off(np.einsum("abm,bm->ma", matrices(former.q[:, atoms]), d)) > bound
    if not members.communicator.any(moved.any()):
        return r, particles, None, new
    turn = _turns(lammps, members, former, moved, r, d, particles if oriented else None)
    placed = np.einsum("mab,bm->ma", turn[body], d)
    far = off(placed) * moved
    deformed, text = far > bound, None
    if members.communicator.any(deformed.any()):
        size = np.maximum(members.highest(np.linalg.norm(d, axis=0))[0], bound)
        most = _TORN if former.followed else _MISTAKEN
        text = _say(members, far, size, deformed & members.owned, most)
    mine, here = moved[body], deformed[body]
    placed = np.where(here[:, None], placed, r)
    kept = Kept(mine, atoms[mine], (placed - r)[mine], turn[body[mine]], text, 0)
    if oriented:
        particles, others = _turned(particles, kept, former)
        others = members.communicator.total(np.array([others]))[0]
        kept = kept._replace(turned=round(others))
    return placed if text else r, particles, kept, new


def _of_the_same_atoms(members, former):
    """Which bodies have the atoms that they had, (n,) bool; collective."""
    known, old, natoms = (rows[members.atoms] for rows in (former.known, former.id, former.natoms))
    low, high, before = members.lowest(*np.where(known, (old, -old, natoms), -np.inf))
    same = (low == -high) & (before == members.total(np.ones(len(known)))[0])
    return same if former.followed else same & (low == members.ids)


def _turns(lammps, members, former, moved, r, d, particles):
    """How far each body that has `moved` (n,) is turned, (n, 3, 3); collective.

    Args:
        r (m, 3), d (3, m): the atoms' places from the centre now, and in their body's frame.
        particles: the `Particles` that the atoms are, None if they have no orientations.
    """
    n, plane = len(moved), lammps.dimension == 2
    weight = members.mass * moved[members.body]
    products = members.total(*(weight * a * b for a in r.T for b in d)).T.reshape(n, 3, 3)
    turn = np.tile(np.eye(3), (n, 1, 1))
    turn[moved] = best_turns(products[moved], plane)
    if particles is not None and not plane:
        directions = _directions(particles, former.displace[:, members.atoms]).reshape(9, -1)
        told = members.total(*directions).T.reshape(n, 3, 3)
        before = matrices(members.highest(*former.q[:, members.atoms])).transpose(2, 0, 1)
        turn[moved] = twist(turn[moved], products[moved], told[moved], before[moved])
    return turn


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


def _directions(particles, columns):
    """The sums of a bᵀ over each particle's directions now, a, and in its body, b: (3, 3, m).

    Args:
        particles: the `Particles`.  columns: (rows, m) of `Bodies.displace`.
    """
    orient, dipole = columns[ORIENT:OWN_MOMENT], columns[DIPOLE:]
    axes = np.einsum("akm,bkm->abm", particles.axes, matrices(orient)) * orient.any(axis=0)
    square = (dipole**2).sum(axis=0)
    both = np.einsum("am,bm->abm", particles.dipole, dipole)
    return axes + np.divide(both, square, out=np.zeros_like(both), where=square > 0)


def _turned(particles, kept, former):
    """The particles, turned with the bodies that keep their shape, and how many of them had another
    orientation."""
    quat, dipole, d = particles.quat.copy(), particles.dipole.copy(), former.displace[:, kept.atoms]
    quat[:, kept.which] = product(quaternions(kept.turn), d[ORIENT:OWN_MOMENT])
    dipole[:, kept.which] = np.einsum("mab,bm->am", kept.turn, d[DIPOLE:])
    now = particles._replace(quat=quat, dipole=dipole)
    size = np.linalg.norm(dipole, axis=0)
    others = np.abs(now.axes - particles.axes).max(axis=(0, 1)) > _ANOTHER
    others |= np.abs(dipole - particles.dipole).max(axis=0) > _ANOTHER * size
    return now, others.sum()


def twist(turn, products, *others):
    """Turns of bodies, which those that are a line have about that line so that directions fit
    best.

    Args:
        turn: (n, 3, 3) of `best_turns`.  products: (n, 3, 3), from which they are.
        others: products of other vectors, (n, 3, 3) each, in turn where those before say nothing.
    """
    left, size, _ = np.linalg.svd(products)
    line, left_out = left[:, :, 0], size[:, 1] <= _LINE * size[:, 0]
    turn = turn.copy()
    for told in others:
        told = told @ turn.transpose(0, 2, 1)
        skew = told - told.transpose(0, 2, 1)
        sine = (line * np.array([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]]).T).sum(axis=1)
        cosine = np.einsum("naa->n", told) - np.einsum("na,nab,nb->n", line, told, line)
        radius = np.hypot(sine, cosine)
        which = left_out & (radius > _WEAK * np.linalg.norm(told, axis=(1, 2)))
        about = line[which] * np.arctan2(sine, cosine)[which, None]
        turn[which] = _about(about) @ turn[which]
        left_out &= ~which
    return turn


def _about(vectors):
    """Rotation matrices (n, 3, 3) about these vectors (n, 3) by their lengths."""
    angle = np.linalg.norm(vectors, axis=1)
    sine = np.sinc(0.5 * angle / np.pi) * 0.5 * vectors.T
    return matrices(np.array([np.cos(0.5 * angle), *sine])).transpose(2, 0, 1)


def _say(members, far, size, which, most):
    """The line for the log on these bodies (n,) bool, off by `most` sizes at most; collective.

    Raises: as `keep`.
    """
    worst = []
    if which.any():
        k = np.argmax(far / size * which)
        worst = [[far[k] / size[k], far[k], members.ids[k]]]
    rows = members.communicator.gather_to_all(np.array(worst).reshape(-1, 3))
    part, distance, name = rows[rows[:, 0].argmax()]
    name = members.membership.name(int(name))
    if part > most:
        raise RunError(
            f"{name} was torn apart between the runs: an atom is {distance:.3g} away from where "
            f"the body's shape has it, {part:.2g} times its size. Bodies that a periodic face cuts "
            "are torn when the boundary changes, or the box without 'remap'; IDs must stay as they "
            "are. If the new shape is meant, unfix this fix and define it again",
            everywhere=True,
        )
    count = round(members.communicator.total(np.array([which.sum()]))[0])
    return (
        f"Bodies that were deformed between the runs: {count}; "
        f"{name} the most, by {distance:.3g}, {part:.2g} of its size. They keep their shape: "
        "each was put at the centre of mass of its atoms and turned to fit them. "
        "If the new shape is meant, unfix this fix and define it again\n"
    )
