"""The compiled loops for atoms that are spheres, with a torque and a spin of their own."""

from .block import ATOM, LANES, MOMENT, Layout, P, Q, four, take, three, write
from .compiled import F2, I1, L1, loop
from .frames import angular_velocity, rotation_matrix, to_space
from .step import show_atoms_moments


@loop
def add_torques(body: L1, index: I1, atom_torque: F2, wrench: F2):
    """Add the torques that act on the atoms themselves to those on their bodies."""
    for j in range(index.size):
        for k in range(3):
            wrench[3 + k, body[j]] += atom_torque[index[j], k]


@loop
def set_spins(layout: Layout, atom_omega: F2):
    """Write the bodies' angular velocity, space frame, as that of their atoms."""
    block, blocks, rounds = layout.block, layout.blocks, layout.rounds
    for k in range(blocks.shape[0] - 1):
        take(layout, k, MOMENT, P + 4, MOMENT)
        show_atoms_moments(layout, k)
        for b in range(LANES):
            q, (i1, i2, i3) = four(block, Q, b), three(block, MOMENT, b)
            w1, w2, w3 = angular_velocity(q, four(block, P, b), i1, i2, i3)
            write(block, ATOM, b, to_space(rotation_matrix(q), w1, w2, w3))
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            for b in range(rounds[r + 1] - rounds[r]):
                for c in range(3):
                    atom_omega[layout.index[rounds[r] + b], c] = block[ATOM + c, b]
