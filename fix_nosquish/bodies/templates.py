"""Bodies inserted by other fixes from a molecule template with mass, com or inertia: keyword mol.

As in fix rigid/small, such a body has the mass, centre of mass and inertia tensor of its template,
the velocity of its insertion, and no angular velocity.  If the template agrees with the atoms, the
body is made from its atoms.
"""

from typing import NamedTuple

import numpy as np

from ..host.hosts import Host
from ..motion.frames import matrices
from ..ranks.communicator import Ranks
from .build import Prescribed
from .unwrap import UnwrappedPositions

# tolerances for agreement with the atoms, as fractions of the body's and of the box's size
_SAME, _ROUNDED = 1e-9, 1e-12
_COLUMNS = 13  # numbers of a template; see `Molecules`
_UNKNOWN = (
    "WARNING: this LAMMPS does not tell a molecule template's mass, com and inertia: inserted "
    "bodies have those of their atoms"
)


class Molecules(NamedTuple):
    """The molecules inserted since the last call, identical on all ranks.

    Attributes:
        before: (k,) highest atom ID before the insertion.
        natoms: (k,) number of atoms.
        v: (3, k) velocity.
        q: (4, k) quaternion of the rotation at insertion.
        template: (k, 13) of the template: geometric centre, mass, centre of mass and inertia
            tensor (xx yy zz yz xz xy); NaN where not given.
        warnings: lines for the log.
    """

    before: np.ndarray
    natoms: np.ndarray
    v: np.ndarray
    q: np.ndarray
    template: np.ndarray
    warnings: list[str]


def inserted(host: Host, communicator: Ranks) -> Molecules | None:
    """Take the `Molecules` from the host's record, and clear it; None if empty; collective."""
    rows = host.inserted()
    if not len(rows):
        return None
    # if an ID was used twice, the first molecule has been deleted
    _, last = np.unique(rows[::-1, 0], return_index=True)
    rows = rows[len(rows) - 1 - last]
    natoms = communicator.total(rows[:, 1]).round().astype(int)
    template, warnings = np.full((len(rows), _COLUMNS), np.nan), []
    for number in np.unique(rows[:, 2]):
        values = host.molecule(int(number))
        if values is None:
            warnings = [_UNKNOWN]
        else:
            template[rows[:, 2] == number] = values
    return Molecules(rows[:, 0], natoms, rows[:, 3:6].T, rows[:, 6:].T, template, warnings)


def read(molecules: Molecules, unwrapped: UnwrappedPositions) -> Prescribed:
    """The properties of inserted bodies whose template differs from their atoms; collective.

    Raises:
        RunError: on all ranks, if a molecule is not one body.
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
    differs = _differs(mass, members.mass, _SAME * members.mass)
    differs |= _differs(centre, unwrapped.centre, near)
    differs |= _differs(inertia, of_atoms, members.mass * near * (2 * size + near))

    def value(by_template: np.ndarray, by_atoms: np.ndarray) -> np.ndarray:
        """The value of the template; where it gives none, the value from the atoms."""
        return np.where(np.isnan(by_template), by_atoms, by_template)[..., differs]

    mass, v = value(mass[0], members.mass), molecules.v[:, which[differs]]
    return Prescribed(
        which=differs,
        ids=np.unique(members.communicator.gather_to_all(members.ids[differs])),
        mass=mass,
        centre=value(centre, unwrapped.centre),
        inertia=value(inertia, of_atoms).transpose(2, 0, 1),
        momenta=np.concatenate([mass * v, np.zeros_like(v)]),
        warnings=molecules.warnings,
    )


def _molecule_of_body(
    molecules: Molecules, unwrapped: UnwrappedPositions
) -> tuple[np.ndarray, np.ndarray]:
    """The index of each body in `Molecules`, (n,), and whether it is one of them, (n,) bool;
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


def _differs(by_template: np.ndarray, by_atoms: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Which bodies (n,) differ from the template, for values (..., n); NaN does not differ."""
    off = np.abs(by_template - by_atoms) > bound
    return off.any(axis=tuple(range(off.ndim - 1)))
