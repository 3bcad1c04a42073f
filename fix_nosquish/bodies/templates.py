"""Bodies that other fixes insert as molecules of a template with a mass, centre or inertia of its
own: keyword mol.

What fix rigid/small takes from its template, such a body has: its mass, centre of mass and tensor
of inertia, the velocity of its insertion, and no rotation.  Bodies whose template says what follows
from their atoms are made of these.
"""

from typing import NamedTuple

import numpy as np

from .bodies import matrices
from .given import Given

# parts of a body, and of the box, by which places that follow from the atoms are off, at most
_SAME, _ROUNDED = 1e-9, 1e-12
_UNKNOWN = (
    "WARNING: this LAMMPS does not tell a molecule template's mass, com and inertia: inserted "
    "bodies have those of their atoms"
)


class Molecules(NamedTuple):
    """The molecules that were inserted since the last time, the same on all ranks.

    Attributes:
        before: (k,) the highest ID of an atom before each.  natoms: (k,) of each.
        number: (k,) which molecule of the template.
        v: (3, k) the velocity.  q: (4, k) the quaternion of how it was turned.
        templates: dictionary from `number` to the centre, mass, centre of mass and tensor of
            inertia (xx yy zz yz xz xy) of the template, (13,), with no number for what is not
            known; None where nothing is.
    """

    before: np.ndarray
    natoms: np.ndarray
    number: np.ndarray
    v: np.ndarray
    q: np.ndarray
    templates: dict


def inserted(host, communicator):
    """The `Molecules` that the host has noted, which it forgets; None for none; collective."""
    rows = host.inserted()
    if not len(rows):
        return None
    # of an ID that was given twice the first molecule is gone
    _, last = np.unique(rows[::-1, 0], return_index=True)
    rows = rows[len(rows) - 1 - last]
    numbers = rows[:, 2].astype(int)
    templates = {k: host.molecule(k) for k in np.unique(numbers).tolist()}
    natoms = communicator.total(rows[:, 1]).round().astype(int)
    return Molecules(rows[:, 0], natoms, numbers, rows[:, 3:6].T, rows[:, 6:].T, templates)


def read(molecules, lammps, members, start):
    """What the template says of those of these bodies that are inserted molecules, where it is not
    what follows from their atoms; collective.

    Args:
        molecules: the `Molecules`.  members: the `Members`.  start: the `Start`.
    Returns:
        `Given`; None if that is nothing, on any rank.
    Raises:
        RunError: on all ranks, if a molecule is not one body, or for a moment that is negative.
    """
    (first,) = members.lowest(members.tag)
    which = np.searchsorted(molecules.before, first) - 1
    inside = (which >= 0) & (first <= molecules.before[which] + molecules.natoms[which])
    natoms = np.where(inside, molecules.natoms[which], 0)
    members.refuse(
        inside & (natoms != start.natoms),
        lambda k: (
            f"has {start.natoms[k]:.0f} atoms, of a molecule of {natoms[k]} that was inserted as "
            "one rigid body: put all of its atoms into one body, with one molecule-ID and in the "
            "fix's group; or leave out the word rigid where it is inserted, and the body is made "
            "of its atoms"
        ),
    )
    known = {k: t for k, t in molecules.templates.items() if t is not None}
    numbers = np.full((len(first), 13), np.nan)
    for k, template in known.items():
        numbers[inside & (molecules.number[which] == k)] = template
    centre, mass, com, tensor = np.split(numbers.T, [3, 4, 7])
    turn = matrices(molecules.q[:, which])
    geometric = members.total(*start.delta.T) / start.natoms
    own_centre = geometric + np.einsum("abn,bn->an", turn, com - centre)
    tensor = tensor[[0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(3, 3, -1)
    own_inertia = np.einsum("abn,bcn,dcn->adn", turn, tensor, turn)
    of_atoms = members.inertia(members.mass, start.delta - start.centre[:, members.body].T)
    of_atoms = of_atoms + start.particles
    size = np.sqrt(np.trace(of_atoms) / np.where(start.mass > 0, start.mass, 1.0))
    near = _SAME * size + _ROUNDED * lammps.box.size + 8 * np.spacing(lammps.box.farthest)

    def differs(own, other, bound):
        """Whether what the template says is another number; where it says nothing it is not."""
        off = np.abs(own - other) > bound
        return off.any(axis=tuple(range(off.ndim - 1)))

    own = differs(mass[0], start.mass, _SAME * start.mass)
    own |= differs(own_centre, start.centre, near)
    own |= differs(own_inertia, of_atoms, start.mass * near * (2 * size + near))
    _refuse_negative(members, own, own_inertia)
    ids = members.communicator.gather_to_all(members.ids[own])
    warnings = () if len(known) == len(molecules.templates) else (_UNKNOWN,)
    if not (len(ids) or warnings):
        return None

    def told(own, other):
        """What the template says, and where it says nothing what follows from the atoms."""
        return np.where(np.isnan(own), other, own)

    mass = told(mass[0], start.mass)[own]
    v = molecules.v[:, which[own]]
    return Given(
        bodies=np.flatnonzero(own), absent=~own, ids=members.ids[own], named=np.unique(ids),
        mass=mass, centre=told(own_centre, start.centre)[:, own],
        inertia=told(own_inertia, of_atoms)[:, :, own].transpose(2, 0, 1),
        momenta=np.concatenate([mass * v, np.zeros_like(v)]), warnings=warnings,
    )  # fmt: skip


def _refuse_negative(members, own, inertia):
    """Raise an error if a template has a negative principal moment; collective."""
    tensors = np.where(own, np.nan_to_num(inertia), 0.0).transpose(2, 0, 1)
    moment = np.linalg.eigvalsh(tensors)
    members.refuse(
        moment[:, 0] < -1e-7 * np.abs(moment).max(axis=1, initial=0.0),
        lambda k: f"has a negative principal moment, {moment[k, 0]:g}, in the molecule template",
    )
