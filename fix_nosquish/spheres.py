"""The compiled loops for atoms that are spheres, with a torque and a spin of their own."""

from .compiled import F1, F2, I1, I2, L1, loop
from .kernels import (
    ATOM,
    BLOCK,
    MOMENT,
    P,
    Q,
    body_frame_angular_velocity,
    four,
    rotation_matrix,
    set_three,
    take,
    three,
    to_space,
)


@loop
def add_torques(body: L1, index: I1, atom_torque: F2, load: F2):
    """Add the torques that act on the atoms themselves (spheres) to those on their bodies (atoms,)."""
    for j in range(index.size):
        for k in range(3):
            load[3 + k, body[j]] += atom_torque[index[j], k]


@loop
def set_spins(state: F2, blocks: I2, rounds: I1, index: I1, atom_omega: F2, scratch: F1):
    """Write the bodies' angular velocity, space frame, as that of their atoms."""
    for k in range(blocks.shape[0] - 1):
        take(scratch, state, blocks[k, 0], blocks[k + 1, 0], MOMENT, P + 4)
        for b in range(BLOCK):
            q = four(scratch, Q, b)
            i1, i2, i3 = three(scratch, MOMENT, b)
            w1, w2, w3 = body_frame_angular_velocity(q, four(scratch, P, b), i1, i2, i3)
            x, y, z = to_space(rotation_matrix(q[0], q[1], q[2], q[3]), w1, w2, w3)
            set_three(scratch, ATOM, b, x, y, z)
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            for b in range(rounds[r + 1] - rounds[r]):
                for c in range(3):
                    atom_omega[index[rounds[r] + b], c] = scratch[(ATOM + c) * BLOCK + b]
