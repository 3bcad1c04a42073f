"""What atoms are besides points: spheres, ellipsoids, lines, triangles, dipoles."""

from typing import NamedTuple, cast

import numpy as np

from ..host.lammps import Lammps
from ..motion.frames import matrices, product

# moments of inertia of unit mass and size: a solid sphere's radius, the length of a line
SPHERE, LINE = 0.4, 1.0 / 12.0


class Particles(NamedTuple):
    """What atoms are besides points.

    Attributes:
        moment: (3, m) principal moments of inertia of each, 0 of a point.
        quat: (4, m) the orientation of its principal frame in space, 0 if it has none.
        dipole: (3, m) its dipole in space.
        momentum: (3, m) its angular momentum in space.
        keeps: (m,) bool, whether LAMMPS has this momentum, not its angular velocity.
    """

    moment: np.ndarray
    quat: np.ndarray
    dipole: np.ndarray
    momentum: np.ndarray
    keeps: np.ndarray

    @property
    def axes(self) -> np.ndarray:
        """Rotations (3, 3, m) from their principal frames to space."""
        none = ~self.quat.any(axis=0)
        return matrices(self.quat + np.outer([1.0, 0.0, 0.0, 0.0], none))

    def inertia(self) -> np.ndarray:
        """Their tensors of inertia in space, (3, 3, m)."""
        axes = self.axes
        return np.einsum("akm,km,bkm->abm", axes, self.moment, axes)

    def directions(self) -> np.ndarray:
        """Two vectors that each of them points to, (2, 3, m), 0 for one without an orientation."""
        axes = self.axes * self.quat.any(axis=0)
        return np.array([axes[:, 0], axes[:, 1]]) + self.dipole

    def kinetic(self) -> np.ndarray:
        """The energy of their rotation, mass times velocity squared, (m,)."""
        momentum = np.einsum("akm,am->km", self.axes, self.momentum)
        turns = self.moment > 0
        squares = np.divide(momentum**2, self.moment, out=np.zeros_like(momentum), where=turns)
        return 0.5 * squares.sum(axis=0)

    def in_bodies(self, q: np.ndarray) -> np.ndarray:
        """What `displace` has of them behind their places: rows ORIENT to ROWS of `extended`,
        (10, m).

        Args:
            q: (4, m) the quaternion of each particle's body.
        """
        conjugate = q * np.array([[1.0], [-1.0], [-1.0], [-1.0]])
        back = np.array(product(conjugate, self.quat))
        size = np.sqrt((back * back).sum(axis=0))
        orient = np.divide(back, size, out=np.zeros_like(back), where=size > 0)
        dipole = np.einsum("abm,am->bm", matrices(q), self.dipole)
        return np.vstack([orient, self.moment * self.keeps, dipole])


def particles_of(lammps: Lammps, shapes: np.ndarray | None, atoms: np.ndarray) -> Particles:
    """What these atoms are besides points: `Particles`.

    Args:
        shapes: (natoms, 7), see `hosts.Host.shapes`; None if none is known.
        atoms: (m,) indices of atoms.
    """
    m, mass = len(atoms), lammps.masses[atoms]
    moment, quat, dipole, momentum = (np.zeros((k, m)) for k in (3, 4, 3, 3))
    keeps = np.zeros(m, bool)
    radius, mu = lammps.radius, lammps.per_atom("mu", columns=4)
    # None only in styles whose particles have neither
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
