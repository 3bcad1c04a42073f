"""Atoms that are not point masses: spheres, ellipsoids, lines, triangles, dipoles."""

from typing import NamedTuple, cast

import numpy as np

from ..host.lammps import Lammps
from ..motion.frames import matrices, product

# moments of inertia for unit mass: solid sphere of unit radius, line of unit length
SPHERE, LINE = 0.4, 1.0 / 12.0


class Particles(NamedTuple):
    """Finite size, orientation and spin of atoms.

    Attributes:
        moment: (3, m) principal moments of inertia, 0 for a point.
        quat: (4, m) quaternion from the principal to the space frame, 0 without an orientation.
        dipole: (3, m) dipole, space frame.
        momentum: (3, m) angular momentum, space frame.
        keeps: (m,) bool, whether LAMMPS stores angular momentum, not angular velocity.
    """

    moment: np.ndarray
    quat: np.ndarray
    dipole: np.ndarray
    momentum: np.ndarray
    keeps: np.ndarray

    @property
    def axes(self) -> np.ndarray:
        """Rotations (3, 3, m) from the principal frames to the space frame."""
        none = ~self.quat.any(axis=0)
        return matrices(self.quat + np.outer([1.0, 0.0, 0.0, 0.0], none))

    def inertia(self) -> np.ndarray:
        """Inertia tensors, space frame, (3, 3, m)."""
        axes = self.axes
        return np.einsum("akm,km,bkm->abm", axes, self.moment, axes)

    def directions(self) -> np.ndarray:
        """Two vectors along each particle's orientation, (2, 3, m); 0 without an orientation."""
        axes = self.axes * self.quat.any(axis=0)
        return np.array([axes[:, 0], axes[:, 1]]) + self.dipole

    def kinetic(self) -> np.ndarray:
        """Rotational kinetic energy, mass times velocity squared, (m,)."""
        momentum = np.einsum("akm,am->km", self.axes, self.momentum)
        turns = self.moment > 0
        squares = np.divide(momentum**2, self.moment, out=np.zeros_like(momentum), where=turns)
        return 0.5 * squares.sum(axis=0)

    def in_bodies(self, q: np.ndarray) -> np.ndarray:
        """Rows ORIENT to ROWS (see `extended`) of `displace`, (10, m).

        Args:
            q: (4, m) quaternion of each particle's body.
        """
        conjugate = q * np.array([[1.0], [-1.0], [-1.0], [-1.0]])
        back = np.array(product(conjugate, self.quat))
        size = np.sqrt((back * back).sum(axis=0))
        orient = np.divide(back, size, out=np.zeros_like(back), where=size > 0)
        dipole = np.einsum("abm,am->bm", matrices(q), self.dipole)
        return np.vstack([orient, self.moment * self.keeps, dipole])


def particles_of(lammps: Lammps, shapes: np.ndarray | None, atoms: np.ndarray) -> Particles:
    """The `Particles` of these atoms.

    Args:
        shapes: (natoms, 7), see `hosts.Host.shapes`; None if unknown.
        atoms: (m,) indices of atoms.
    """
    m, mass = len(atoms), lammps.masses[atoms]
    moment, quat, dipole, momentum = (np.zeros((k, m)) for k in (3, 4, 3, 3))
    keeps = np.zeros(m, bool)
    radius, mu = lammps.radius, lammps.per_atom("mu", columns=4)
    # None only in atom styles whose particles have neither
    omega, angmom = (
        cast(np.ndarray, lammps.per_atom(name, columns=3)) for name in ("omega", "angmom")
    )
    if radius is not None:
        moment[:] = SPHERE * mass * radius[atoms] ** 2
        momentum[:] = moment * omega[atoms].T
    if mu is not None:
        dipole[:] = mu[atoms, :3].T * (mu[atoms, 3] > 0)
    quats = lammps.per_atom("quat", columns=4)  # of atom_style bpm/sphere
    if quats is not None and shapes is not None:
        quat[:] = quats[atoms].T
    for name in "ellipsoid", "line", "tri":
        index = lammps.per_atom(name, np.int32)
        if index is None or shapes is None:
            continue
        which = index[atoms] >= 0
        here = atoms[which]
        sizes, quat[:, which] = shapes[here, :3].T, shapes[here, 3:].T
        if name == "line":  # LAMMPS's lines are in two dimensions
            about = mass[which] * (LINE * sizes[0] ** 2)
            moment[:, which] = about * [[0.0], [1.0], [1.0]]
            momentum[:, which] = moment[:, which] * omega[here].T * [[0], [0], [1]]
        else:
            moment[:, which] = sizes
            momentum[:, which], keeps[which] = angmom[here].T, True
    return Particles(moment, quat, dipole, momentum, keeps)
