"""Which atoms bodies are made of, and sums over those of each body."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from ..errors import refuse
from ..host.lammps import Lammps
from ..ranks.communicator import Alone
from ..ranks.sharing import Sharers
from .membership import FLEXIBLE, OUT, Membership
from .particles import Particles, particles_of


class Members(NamedTuple):
    """The atoms of which this rank's bodies are made.

    Attributes:
        ids: (n,) IDs of the bodies that have an atom here, ascending.
        natoms, mass: (n,) number of atoms of each body and their mass, on all ranks.
        atoms, body, tag, atom_mass: (m,) each atom's index in LAMMPS's arrays, the place of its
            body in `ids`, its ID, its mass.
        particles: what the atoms are besides point masses; None if this atom style has only these.
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
    def communicator(self) -> Alone:
        return self.membership.communicator

    @property
    def owned(self) -> np.ndarray:
        """(n,) bool, which bodies are to be counted on this rank."""
        return self.sharers.owned

    def total(self, columns: Iterable[np.ndarray]) -> np.ndarray:
        """Sums of columns (m,) over the atoms of each body, (columns, n); collective."""
        return self.sharers.total(self.body, columns)

    def lowest(self, *columns: np.ndarray) -> np.ndarray:
        """The lowest number of each body's atoms, (len(columns), n); collective."""
        return self.sharers.lowest(self.body, *columns)

    def highest(self, *columns: np.ndarray) -> np.ndarray:
        """The highest number of each body's atoms, (len(columns), n); collective."""
        return self.sharers.highest(self.body, *columns)

    def inertia(self, mass: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Tensors of inertia, (3, 3, n), space frame; collective.

        Args:
            mass: (m,) of the atoms.
            r: (m, 3) their places from the point about which the tensor of their body is.
        """
        pairs = (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)
        xx, yy, zz, xy, xz, yz = self.total(mass * (r[:, a] * r[:, b]) for a, b in pairs)
        tensors = np.array([[yy + zz, -xy, -xz], [-xy, xx + zz, -yz], [-xz, -yz, xx + yy]])
        if self.particles is not None:
            own = self.particles.inertia().reshape(9, -1)
            tensors = tensors + self.total(own).reshape(3, 3, -1)
        return tensors

    def furthest(self, which: np.ndarray, far: np.ndarray, *columns: np.ndarray) -> np.ndarray:
        """Of some bodies of all ranks, the one that is furthest; collective.

        Args:
            which: (n,) bool, these bodies here; there is one on some rank.
            far: (n,) how far each is.
            columns: (n,) each, other numbers of the bodies.
        Returns:
            how far it is, and its number in each column.
        """
        k = np.flatnonzero(which)
        k = k[[far[k].argmax()]] if len(k) else k
        rows = np.array([far[k], *(column[k] for column in columns)], float).T
        rows = self.communicator.gather_to_all(rows)
        return rows[rows[:, 0].argmax()]

    def refuse(self, wrong: np.ndarray, text: Callable[[int], str]) -> None:
        """End the run if a body is wrong; collective.

        Args:
            wrong: (n,) bool, which ones are.
            text: what to say of the first of them, behind its name, by its place in `ids`.
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
    """End the run if an atom cannot be in a body; collective.

    Args:
        atoms, tag, mass: (m,) index, ID and mass of each.
        unknown: see `Lammps.unknown`.
    """
    communicator = membership.communicator
    communicator.refuse(
        tag <= 0,
        lambda k: "the fix needs atom IDs, which this script turns off (atom_modify id no)",
    )
    # a point's ID is calculated with as a real number
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


def sharers_of(communicator: Alone, ids: np.ndarray) -> Sharers:
    """The `Sharers` of bodies of which nothing but the IDs (n,) is known; collective."""
    return Sharers(communicator).find(len(ids), np.arange(len(ids)), ids, ids % communicator.size)
