"""Finite-size particles in bodies: spheres, ellipsoids, lines, triangles, dipoles.

Each contributes its own moment of inertia and torque to its body.  Ellipsoids, lines, triangles and
dipoles have an orientation, which rotates with the body.  After an atom's position and ID,
`displace` then has its quaternion relative to the body's principal frame, its own principal
moments, and its dipole in that frame.
"""

from math import sqrt

import numpy as np

from ..loops.compiled import F1, F2, I1, L1, address, call, loop
from ..motion.block import ATOM, LANES, MOMENT, Layout, P, Q, four, take, three, write
from ..motion.frames import (
    angular_velocity,
    product,
    rotation_matrix,
    to_body,
    to_space,
)
from ..motion.step import show_atoms_moments

# rows of `displace`, if atoms can have an orientation: quaternion, principal moments of particles
# for which LAMMPS stores an angular momentum, dipole; zero where an atom has none
ORIENT, OWN_MOMENT, DIPOLE, ROWS = 4, 8, 11, 14


@loop
def add_torques(body: L1, index: I1, atom_torque: F2, wrench: F2):
    """Add the torques on the atoms themselves to the torques on their bodies, space frame."""
    for j in range(index.size if atom_torque.size else 0):
        for k in range(3):
            wrench[3 + k, body[j]] += atom_torque[index[j], k]


@loop
def set_spins(layout: Layout, atom_omega: F2, atom_angmom: F2):
    """Set the atoms' angular velocity to that of their body, and the angular momentum of particles
    for which LAMMPS stores it; space frame."""
    block, blocks, rounds, d = layout.block, layout.blocks, layout.rounds, layout.displace
    for k in range(blocks.shape[0] - 1):
        take(layout, k, MOMENT, P + 4, MOMENT)
        show_atoms_moments(layout, k)
        for b in range(LANES):
            q, (i1, i2, i3) = four(block, Q, b), three(block, MOMENT, b)
            w1, w2, w3 = angular_velocity(q, four(block, P, b), i1, i2, i3)
            write(block, ATOM, b, to_space(rotation_matrix(q), w1, w2, w3))
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            for b in range(rounds[r + 1] - rounds[r]):
                j = rounds[r] + b
                i, (x, y, z) = layout.index[j], three(block, ATOM, b)
                if atom_omega.size:
                    atom_omega[i, 0], atom_omega[i, 1], atom_omega[i, 2] = x, y, z
                if atom_angmom.size and d.shape[0] == ROWS and d[OWN_MOMENT, j] > 0.0:
                    a = rotation_matrix(product(four(block, Q, b), four(d, ORIENT, j)))
                    w1, w2, w3 = to_body(a, x, y, z)
                    i1, i2, i3 = three(d, OWN_MOMENT, j)
                    momentum = to_space(a, i1 * w1, i2 * w2, i3 * w3)
                    for c in range(3):
                        atom_angmom[i, c] = momentum[c]


@loop
def orient(layout: Layout, atom_mu: F2, orient_atom: L1, quat: F1):
    """Set the orientations and dipoles of atoms from their bodies.

    Args:
        orient_atom: (2,) address of a function of LAMMPS's fix and its first argument; 0 for none.
        quat: (4,) scratch array.
    """
    block, blocks, rounds, d = layout.block, layout.blocks, layout.rounds, layout.displace
    for k in range(blocks.shape[0] - 1):
        take(layout, k, Q, Q + 4, Q)
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            for b in range(rounds[r + 1] - rounds[r]):
                j = rounds[r] + b
                i, q = layout.index[j], four(block, Q, b)
                w, x, y, z = product(q, four(d, ORIENT, j))
                size = sqrt(w * w + x * x + y * y + z * z)
                if size > 0.0:
                    quat[0], quat[1], quat[2], quat[3] = w / size, x / size, y / size, z / size
                    call(orient_atom[0], orient_atom[1], np.int64(i), address(quat))
                x, y, z = to_space(rotation_matrix(q), *three(d, DIPOLE, j))
                size = sqrt(x * x + y * y + z * z)
                if size > 0.0:
                    part = atom_mu[i, 3] / size  # keep the length of the dipole, mu[3], exactly
                    atom_mu[i, 0], atom_mu[i, 1], atom_mu[i, 2] = part * x, part * y, part * z
