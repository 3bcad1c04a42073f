"""The virial of the constraint forces, which keep the bodies rigid."""

from ..loops.compiled import F1, F2, I1, F, inlined, loop
from .block import (
    FORCE,
    LANES,
    MASS,
    MATRIX,
    MOMENT,
    OWN,
    TORQUE,
    Layout,
    P,
    Q,
    four,
    hold,
    nine,
    take,
    three,
    write,
)
from .frames import angular_velocity, to_body, to_space
from .step import displaced, rotation_matrices, show_atoms_moments

ACCELERATION = OWN


@inlined
def acceleration_matrices(block, ftm2v):
    """Matrices from a displacement (principal frame) to the acceleration about the centre of mass
    (space frame), alpha x + omega x omega x, in units of force per mass."""
    for b in range(LANES):
        r = nine(block, MATRIX, b)
        i1, i2, i3 = three(block, MOMENT, b)
        w1, w2, w3 = angular_velocity(four(block, Q, b), four(block, P, b), i1, i2, i3)
        x, y, z = three(block, TORQUE, b)
        t1, t2, t3 = to_body(r, x, y, z)
        # Euler's equations; no rotation about an axis with zero moment
        a1 = (t1 * ftm2v - (i3 - i2) * w2 * w3) / i1 if i1 > 0.0 else 0.0
        a2 = (t2 * ftm2v - (i1 - i3) * w3 * w1) / i2 if i2 > 0.0 else 0.0
        a3 = (t3 * ftm2v - (i2 - i1) * w1 * w2) / i3 if i3 > 0.0 else 0.0
        c1 = to_space(r, -w2 * w2 - w3 * w3, w1 * w2 + a3, w1 * w3 - a2)
        c2 = to_space(r, w1 * w2 - a3, -w1 * w1 - w3 * w3, w2 * w3 + a1)
        c3 = to_space(r, w1 * w3 + a2, w2 * w3 - a1, -w1 * w1 - w2 * w2)
        write(block, ACCELERATION, b, (
            c1[0] / ftm2v, c2[0] / ftm2v, c3[0] / ftm2v,
            c1[1] / ftm2v, c2[1] / ftm2v, c3[1] / ftm2v,
            c1[2] / ftm2v, c2[2] / ftm2v, c3[2] / ftm2v,
        ))  # fmt: skip


@loop
def constraint_virial(
    layout: Layout,
    atom_mass: F1,
    type_mass: F1,
    type: I1,
    ftm2v: F,
    atom_f: F2,
    virial: F1,
    atom_virial: F2,
    mask: F2,
):
    """Add the virial of the constraint forces to virial (xx yy zz xy xz yz).

    The constraint force on atom i is m_i a_i - f_i, with the acceleration a_i of the rigid motion;
    its virial is taken about the centre of mass.  Masses are per atom, or per type if atom_mass is
    empty.  atom_virial is (atoms, 9), or (0, 9) if per-atom virials are not wanted.  They are not
    symmetric because an atom's constraint force is not along its displacement (xx yy zz xy xz yz yx
    zx zy, displacement first).
    """
    block, blocks, rounds, d = layout.block, layout.blocks, layout.rounds, layout.displace
    for k in range(blocks.shape[0] - 1):
        take(layout, k, MASS, TORQUE + 3, MASS)
        hold(layout, k, mask)
        show_atoms_moments(layout, k)
        rotation_matrices(block)
        acceleration_matrices(block, ftm2v)
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            for b in range(rounds[r + 1] - rounds[r]):
                j = rounds[r] + b
                i = layout.index[j]
                m = atom_mass[i] if atom_mass.size else type_mass[type[i]]
                fx, fy, fz = three(block, FORCE, b)
                dx, dy, dz = displaced(block, b, d, j)
                ax, ay, az = to_space(nine(block, ACCELERATION, b), d[0, j], d[1, j], d[2, j])
                cx = m * (ax + fx / block[MASS, b]) - atom_f[i, 0]
                cy = m * (ay + fy / block[MASS, b]) - atom_f[i, 1]
                cz = m * (az + fz / block[MASS, b]) - atom_f[i, 2]
                parts = (
                    dx * cx, dy * cy, dz * cz, dx * cy, dx * cz, dy * cz, dy * cx, dz * cx, dz * cy,
                )  # fmt: skip
                for c in range(6):
                    virial[c] += parts[c]
                if atom_virial.size:
                    for c in range(9):
                        atom_virial[i, c] += parts[c]
