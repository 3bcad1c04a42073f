"""Bodies that other fixes insert as molecules of a template with a mass, centre or inertia of its
own: keyword mol.

What fix rigid/small takes from its template, such a body has: its mass, centre of mass and tensor
of inertia, the velocity of its insertion, and no rotation.  Bodies whose template says what follows
from their atoms are made of these.
"""

from typing import NamedTuple

import numpy as np

from ..host.hosts import Host
from ..motion.frames import matrices
from ..ranks.communicator import Alone
from .build import Prescribed
from .members import Members
from .unwrap import UnwrappedPositions

# parts of a body, and of the box, by which places that follow from the atoms are off, at most
_SAME, _ROUNDED = 1e-9, 1e-12
_COLUMNS = 13  # what a template says of a molecule; see `Molecules`
_UNKNOWN = (
    "WARNING: this LAMMPS does not tell a molecule template's mass, com and inertia: inserted "
    "bodies have those of their atoms"
)


class Molecules(NamedTuple):
    """The molecules that were inserted since the last time, the same on all ranks.

    Attributes:
        before: (k,) the highest ID of an atom before each.
        natoms: (k,) of each.
        v: (3, k) the velocity.
        q: (4, k) the quaternion of how it was turned.
        template: (k, 13) what its template says: the centre, mass, centre of mass and tensor of
            inertia (xx yy zz yz xz xy); no number for what is not known.
        warnings: lines for the log.
    """

    before: np.ndarray
    natoms: np.ndarray
    v: np.ndarray
    q: np.ndarray
    template: np.ndarray
    warnings: list[str]


def inserted(host: Host, communicator: Alone) -> Molecules | None:
    """The `Molecules` that the host has noted, which it forgets; None for none; collective."""
    rows = host.inserted()
    if not len(rows):
        return None
    # of an ID that was given twice the first molecule is gone
    _, last = np.unique(rows[::-1, 0], return_index=True)
    rows = rows[len(rows) - 1 - last]
    natoms = communicator.total(rows[:, 1]).round().astype(int)
    template, warnings = np.full((len(rows), _COLUMNS), np.nan), []
    for number in np.unique(rows[:, 2]):
        told = host.molecule(int(number))
        if told is None:
            warnings = [_UNKNOWN]
        else:
            template[rows[:, 2] == number] = told
    return Molecules(rows[:, 0], natoms, rows[:, 3:6].T, rows[:, 6:].T, template, warnings)


def read(molecules: Molecules, unwrapped: UnwrappedPositions) -> Prescribed:
    """What the template says of those of these bodies that are inserted molecules, where it is not
    what follows from their atoms; collective.

    Raises:
        RunError: on all ranks, if a molecule is not one body, or for a moment that is negative.
    """
    members, box = unwrapped.members, unwrapped.members.lammps.box
    which, inside = _molecule_of_body(molecules, unwrapped)
    template = np.where(inside[:, None], molecules.template[which], np.nan)
    middle, mass, com, tensor = np.split(template.T, [3, 4, 7])
    turn = matrices(molecules.q[:, which])
    geometric = members.total(unwrapped.delta.T) / members.natoms
    centre = geometric + np.einsum("abn,bn->an", turn, com - middle)
    tensor = tensor[[0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(3, 3, -1)
    inertia = np.einsum("abn,bcn,dcn->adn", turn, tensor, turn)
    of_atoms = unwrapped.inertia()
    size = np.sqrt(np.trace(of_atoms) / np.where(members.mass > 0, members.mass, 1.0))
    near = _SAME * size + _ROUNDED * box.size + 8 * np.spacing(box.farthest)
    own = _differs(mass, members.mass, _SAME * members.mass)
    own |= _differs(centre, unwrapped.centre, near)
    own |= _differs(inertia, of_atoms, members.mass * near * (2 * size + near))
    _refuse_negative(members, own, inertia)

    def told(by_template: np.ndarray, by_atoms: np.ndarray) -> np.ndarray:
        """What the template says, and where it says nothing what follows from the atoms."""
        return np.where(np.isnan(by_template), by_atoms, by_template)[..., own]

    mass, v = told(mass[0], members.mass), molecules.v[:, which[own]]
    return Prescribed(
        which=own,
        ids=np.unique(members.communicator.gather_to_all(members.ids[own])),
        mass=mass,
        centre=told(centre, unwrapped.centre),
        inertia=told(inertia, of_atoms).transpose(2, 0, 1),
        momenta=np.concatenate([mass * v, np.zeros_like(v)]),
        warnings=molecules.warnings,
    )


def _molecule_of_body(
    molecules: Molecules, unwrapped: UnwrappedPositions
) -> tuple[np.ndarray, np.ndarray]:
    """The place of each body in `Molecules`, (n,), and whether it is one of them, (n,) bool;
    collective.

    Raises:
        RunError: on all ranks, if a molecule is not one body.
    """
    members, first = unwrapped.members, unwrapped.first
    which = np.searchsorted(molecules.before, first) - 1
    inside = (which >= 0) & (first <= molecules.before[which] + molecules.natoms[which])
    natoms = molecules.natoms[which]
    members.refuse(
        inside & (natoms != members.natoms),
        lambda k: (
            f"has {members.natoms[k]:.0f} atoms, of a molecule of {natoms[k]} that was inserted as "
            "one rigid body: put all of its atoms into one body, with one molecule-ID and in the "
            "fix's group; or leave out the word rigid where it is inserted, and the body is made "
            "of its atoms"
        ),
    )
    return which, inside


def _differs(told: np.ndarray, other: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """For which bodies (n,) the template says another number, in columns (..., n); where it says
    nothing it is not."""
    off = np.abs(told - other) > bound
    return off.any(axis=tuple(range(off.ndim - 1)))


def _refuse_negative(members: Members, own: np.ndarray, inertia: np.ndarray) -> None:
    """End the run if the template of a body in `own` (n,) bool has a negative principal moment;
    collective."""
    tensors = np.where(own, np.nan_to_num(inertia), 0.0).transpose(2, 0, 1)
    moment = np.linalg.eigvalsh(tensors)
    members.refuse(
        moment[:, 0] < -1e-7 * np.abs(moment).max(axis=1, initial=0.0),
        lambda k: f"has a negative principal moment, {moment[k, 0]:g}, in the molecule template",
    )
