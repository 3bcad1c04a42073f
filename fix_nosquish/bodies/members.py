"""The atoms that bodies are made of, and sums over the atoms of each body."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from ..errors import refuse
from ..host.lammps import Lammps
from ..ranks.communicator import Ranks
from ..ranks.sharing import Sharers
from .membership import FLEXIBLE, OUT, Membership
from .particles import Particles, particles_of


class Members(NamedTuple):
    """This rank's atoms that are in bodies.

    Attributes:
        ids: (n,) IDs of the bodies that have an atom on this rank, ascending.
        natoms, mass: (n,) number and total mass of each body's atoms on all ranks.
        atoms, body, tag, atom_mass: (m,) index of each atom in LAMMPS's arrays, index of its body
            in `ids`, atom ID, and mass.
        particles: size, orientation and spin of the atoms; None if this atom style has only point
            masses.
        sharers: the `Sharers` of these bodies.
        membership: the `Membership`.
    """

    ids: np.ndarray
    natoms: np.ndarray
    mass: np.ndarray
    atoms: np.ndarray
    body: np.ndarray
    tag: np.ndarray
    atom_mass: np.ndarray
    particles: Particles | None
    sharers: Sharers
    membership: Membership

    @property
    def lammps(self) -> Lammps:
        return self.membership.lammps

    @property
    def communicator(self) -> Ranks:
        return self.membership.communicator

    @property
    def owned(self) -> np.ndarray:
        """(n,) bool, the bodies that this rank counts in sums over bodies."""
        return self.sharers.owned

    def total(self, columns: Iterable[np.ndarray]) -> np.ndarray:
        """Sums of columns (m,) over each body's atoms on all ranks, (columns, n); collective."""
        return self.sharers.total(self.body, columns)

    def lowest(self, *columns: np.ndarray) -> np.ndarray:
        """Minima of columns (m,) over each body's atoms, (columns, n); collective."""
        return self.sharers.lowest(self.body, *columns)

    def highest(self, *columns: np.ndarray) -> np.ndarray:
        """Maxima of columns (m,) over each body's atoms, (columns, n); collective."""
        return self.sharers.highest(self.body, *columns)

    def inertia(self, r: np.ndarray) -> np.ndarray:
        """Inertia tensors of the bodies, (3, 3, n), space frame; collective.

        Args:
            r: (m, 3) positions of the atoms relative to the reference point of their body.
        """
        pairs, mass = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)), self.atom_mass
        xx, yy, zz, xy, xz, yz = self.total(mass * (r[:, a] * r[:, b]) for a, b in pairs)
        tensors = np.array([[yy + zz, -xy, -xz], [-xy, xx + zz, -yz], [-xz, -yz, xx + yy]])
        if self.particles is not None:
            of_particles = self.particles.inertia().reshape(9, -1)
            tensors = tensors + self.total(of_particles).reshape(3, 3, -1)
        return tensors

    def furthest(self, which: np.ndarray, far: np.ndarray, *columns: np.ndarray) -> np.ndarray:
        """The body of all ranks with the largest value; collective.

        Args:
            which: (n,) bool, the bodies to consider; at least one on some rank.
            far: (n,) the values.
            columns: (n,) each, other values of the bodies.
        Returns:
            its value, and its values in the columns.
        """
        k = np.flatnonzero(which)
        k = k[[far[k].argmax()]] if len(k) else k
        rows = np.array([far[k], *(column[k] for column in columns)], float).T
        rows = self.communicator.gather_to_all(rows)
        return rows[rows[:, 0].argmax()]

    def refuse(self, wrong: np.ndarray, text: Callable[[int], str]) -> None:
        """Raise an error if a body on any rank is wrong; collective.

        Args:
            wrong: (n,) bool.
            text: returns the message, without the body's name, for a body by its index in `ids`.
        Raises:
            RunError: on all ranks.
        """
        name, ids = self.membership.name, self.ids
        self.communicator.refuse(wrong, lambda k: f"{name(ids[k])} {text(k)}")


def find_members(
    membership: Membership,
    shapes: np.ndarray | None,
    oriented: bool,
    atoms: np.ndarray | None,
) -> Members:
    """The `Members` of this rank; collective.

    Args:
        shapes, oriented: see `build.Recipe`.
        atoms: see `build.build`.
    Raises:
        RunError: on all ranks, for atoms that a body cannot have.
    """
    lammps, communicator = membership.lammps, membership.communicator
    ids_of_atoms = membership.ids()
    atoms = np.flatnonzero(ids_of_atoms > OUT) if atoms is None else atoms
    ids_of_atoms = ids_of_atoms[atoms]
    tag, mass = lammps.tags[atoms].astype(np.int64), lammps.masses[atoms]
    refuse(
        not membership.command.mol and not communicator.count(len(atoms)),
        f"there is no atom to form a body of in group '{membership.command.group}': "
        "fill the group before the fix, or give keyword mol if a fix inserts the bodies",
    )
    _refuse_odd_atoms(membership, atoms, tag, mass, lammps.unknown(shapes))
    ids, body = np.unique(ids_of_atoms, return_inverse=True)
    sharers = sharers_of(communicator, ids)
    natoms, body_mass = sharers.total(body, [np.ones(len(atoms)), mass])
    points_only = not oriented and lammps.radius is None
    particles = None if points_only else particles_of(lammps, shapes, atoms)
    return Members(
        ids, natoms, body_mass, atoms, body, tag, mass, particles, sharers, membership
    )  # fmt: skip


def _refuse_odd_atoms(
    membership: Membership,
    atoms: np.ndarray,
    tag: np.ndarray,
    mass: np.ndarray,
    unknown: np.ndarray | None,
) -> None:
    """Raise an error if an atom cannot be in a body; collective.

    Args:
        atoms, tag, mass: (m,) index, ID and mass of the atoms.
        unknown: see `Lammps.unknown`.
    """
    communicator = membership.communicator
    communicator.refuse(
        tag <= 0,
        lambda k: "the fix needs atom IDs, which this script turns off (atom_modify id no)",
    )
    # IDs of flexible atoms are stored as floating-point numbers
    communicator.refuse(
        tag >= FLEXIBLE,
        lambda k: f"atom {tag.max()} has too large an ID: less than 2^52 is possible",
    )
    what = np.zeros(len(atoms), "U1") if unknown is None else unknown[atoms]
    communicator.refuse(what != "", lambda k: f"atom {tag[k]} is {what[k]}")
    communicator.refuse(
        ~(mass >= 0),
        lambda k: (
            f"atom {tag[k]} has mass {mass[k]:g}, which is negative: give it a mass above zero"
        ),
    )


def sharers_of(communicator: Ranks, ids: np.ndarray) -> Sharers:
    """The `Sharers` of the bodies with these IDs (n,); collective."""
    return Sharers(communicator).find(len(ids), np.arange(len(ids)), ids, ids % communicator.size)
