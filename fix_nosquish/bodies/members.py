"""Which atoms bodies are made of, and sums over those of each body."""

from typing import NamedTuple

import numpy as np

from ..errors import RunError
from ..ranks.communicator import Alone
from ..ranks.sharing import Sharers
from .membership import POINTS, Membership

_LEAST_ID = -(2**53)  # IDs travel as floating-point numbers


class Members(NamedTuple):
    """Which body each atom here is in.

    Attributes:
        ids: (n,) IDs of the bodies that have an atom here, ascending.
        atoms, body, tag, mass: (m,) each atom's index in LAMMPS's arrays, the place of its body in
            `ids`, its ID, its mass.
        sharers: the `Sharers` of these bodies.
        membership: the `Membership`.  communicator: the `Communicator` or `ALONE`.
    """

    ids: np.ndarray
    atoms: np.ndarray
    body: np.ndarray
    tag: np.ndarray
    mass: np.ndarray
    sharers: Sharers
    membership: Membership
    communicator: Alone

    @property
    def owned(self):
        """(n,) bool, which bodies are to be counted on this rank."""
        return self.sharers.owned

    def total(self, *columns):
        """Sums of columns (m,) over the atoms of each body, (len(columns), n); collective."""
        return self.sharers.total(self.body, *columns)

    def lowest(self, *columns):
        """The lowest number of each body's atoms, (len(columns), n); collective."""
        return self.sharers.lowest(self.body, *columns)

    def highest(self, *columns):
        """The highest number of each body's atoms, (len(columns), n); collective."""
        return self.sharers.highest(self.body, *columns)

    def inertia(self, mass, r):
        """Tensors of inertia (3, 3, n) of atoms with these masses (m,) and places (m, 3);
        collective."""
        x, y, z = r.T
        products = x * x, y * y, z * z, x * y, x * z, y * z
        xx, yy, zz, xy, xz, yz = self.total(*(mass * c for c in products))
        return np.array([[yy + zz, -xy, -xz], [-xy, xx + zz, -yz], [-xz, -yz, xx + yy]])

    def refuse(self, wrong, text):
        """End the run if `wrong` (n,) marks a body, with what `text` says of its place; collective.

        Raises:
            RunError: on all ranks.
        """
        problem = None
        if wrong.any():
            place = np.argmax(wrong)
            problem = f"{self.membership.name(self.ids[place])} {text(place)}"
        self.communicator.agree(problem)


def find_members(lammps, communicator, membership, shapes, atoms):
    """The `Members` of this rank; collective.

    Args:
        shapes, atoms: see `build.build`.
    Raises:
        RunError: on all ranks, for atoms that a body cannot have.
    """
    problem = None
    atoms = membership.atoms() if atoms is None else atoms
    try:
        ids_of_atoms = membership.bodies(atoms)
        mass = lammps.masses[atoms]
        tag = lammps.tags[atoms].astype(np.int64)
    except RunError as error:
        if error.everywhere:
            raise
        problem = str(error)
    else:
        if (tag <= 0).any():
            problem = "the fix needs atom IDs, which this script turns off (atom_modify id no)"
        elif (tag >= POINTS).any():  # it calculates with IDs as real numbers
            problem = f"atom {tag.max()} has too large an ID: less than 2^52 is possible"
    communicator.agree(problem)
    if not membership.command.mol and not communicator.count(len(atoms)):
        raise RunError(
            f"there is no atom to form a body of in group '{membership.command.group}': "
            "fill the group before the run, or give keyword mol if a fix inserts the bodies",
            everywhere=True,
        )
    more = lammps.unknown(shapes)
    more = more[atoms] if more is not None else np.zeros(len(atoms), "U1")
    odd = more != ""
    communicator.agree(f"atom {tag[odd][0]} is {more[odd][0]}" if odd.any() else None)
    bad = ~(mass >= 0)
    if bad.any():
        problem = (
            f"atom {tag[bad][0]} has mass {mass[bad][0]:g}, which is negative: "
            "give it a mass above zero"
        )
    communicator.agree(problem)
    ids, body = np.unique(ids_of_atoms, return_inverse=True)
    far = (ids_of_atoms < _LEAST_ID) | ((ids_of_atoms >= POINTS) & (ids_of_atoms != POINTS + tag))
    communicator.agree(
        f"{membership.name(ids_of_atoms[far][0])} has too large an ID: less than 2^52 is possible"
        if far.any()
        else None
    )
    sharers = sharers_of(communicator, ids)
    return Members(ids, atoms, body, tag, mass, sharers, membership, communicator)


def sharers_of(communicator, ids):
    """The `Sharers` of bodies of which nothing but the IDs is known; collective."""
    return Sharers(communicator).find(len(ids), np.arange(len(ids)), ids, ids % communicator.size)
