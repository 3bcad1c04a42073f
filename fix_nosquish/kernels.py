"""The compiled loops over bodies and their atoms: one loop per pass, arrays in, arrays out.

Only the free rotation has a file of its own, `rotor.py`.

Arrays of bodies are (components, bodies); arrays of LAMMPS's atoms are (atoms, 3).
Body b's atoms on this rank are entries first[b] to first[b + 1] of `index` (their
index in LAMMPS's arrays) and of `d` (their place in the body's principal frame).
Everything is in the units of the LAMMPS run; a force times `ftm2v` is a mass times
an acceleration.
"""

import numpy as np
from numba import njit

from .rotor import compiled


@njit(inline="always")
def rotation_matrix(q, b):
    """Transpose of A(q), eq. 2.3: takes a body-frame vector to the space frame."""
    w, x, y, z = q[0, b], q[1, b], q[2, b], q[3, b]
    return (
        w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z,
    )  # fmt: skip


@njit(inline="always")
def to_space(r, x, y, z):
    """The matrix r (9 numbers, row by row) times (x, y, z)."""
    return (
        r[0] * x + r[1] * y + r[2] * z,
        r[3] * x + r[4] * y + r[5] * z,
        r[6] * x + r[7] * y + r[8] * z,
    )


@njit(inline="always")
def to_body(r, x, y, z):
    """The transpose of the matrix r times (x, y, z)."""
    return (
        r[0] * x + r[3] * y + r[6] * z,
        r[1] * x + r[4] * y + r[7] * z,
        r[2] * x + r[5] * y + r[8] * z,
    )


@njit(inline="always")
def body_frame_angular_momentum(q, p, b):
    """L in the principal frame, from S(q)^T p = 2 (0, L)."""
    return (
        0.5 * (-q[1, b] * p[0, b] + q[0, b] * p[1, b] + q[3, b] * p[2, b] - q[2, b] * p[3, b]),
        0.5 * (-q[2, b] * p[0, b] - q[3, b] * p[1, b] + q[0, b] * p[2, b] + q[1, b] * p[3, b]),
        0.5 * (-q[3, b] * p[0, b] + q[2, b] * p[1, b] - q[1, b] * p[2, b] + q[0, b] * p[3, b]),
    )


@njit(inline="always")
def body_frame_angular_velocity(q, p, moment, b):
    """omega in the principal frame; zero about an axis without moment."""
    l1, l2, l3 = body_frame_angular_momentum(q, p, b)
    i1, i2, i3 = moment[0, b], moment[1, b], moment[2, b]
    return (
        l1 / i1 if i1 > 0.0 else 0.0,
        l2 / i2 if i2 > 0.0 else 0.0,
        l3 / i3 if i3 > 0.0 else 0.0,
    )


@compiled
def kick(bodies, extended, v, q, p, mass, force, torque, dtf):
    """Half a step of momentum from force and torque (2.58).

    Bodies from `extended` on are points.  The torque is in the space frame: with
    (0, tau) the four-torque, 2 S(q) (0, A tau) (2.60) equals 2 (0, tau) q.
    """
    for b in range(bodies):
        for k in range(3):
            v[k, b] += dtf / mass[b] * force[k, b]
    for b in range(extended):
        x, y, z = 2.0 * dtf * torque[0, b], 2.0 * dtf * torque[1, b], 2.0 * dtf * torque[2, b]
        q0, q1, q2, q3 = q[0, b], q[1, b], q[2, b], q[3, b]
        p[0, b] += -x * q1 - y * q2 - z * q3
        p[1, b] += x * q0 + y * q3 - z * q2
        p[2, b] += -x * q3 + y * q0 + z * q1
        p[3, b] += x * q2 - y * q1 + z * q0


@compiled
def drift(bodies, x, v, dt):
    """Move the centres of mass by a whole step."""
    for k in range(3):
        for b in range(bodies):
            x[k, b] += dt * v[k, b]


@compiled
def place(first, index, d, shift, x, q, atom_x):
    """Write the positions of the bodies' atoms; `shift` takes each into LAMMPS's periodic image."""
    for b in range(first.size - 1):
        r = rotation_matrix(q, b)
        for j in range(first[b], first[b + 1]):
            i = index[j]
            dx, dy, dz = to_space(r, d[j, 0], d[j, 1], d[j, 2])
            atom_x[i, 0] = x[0, b] + dx + shift[j, 0]
            atom_x[i, 1] = x[1, b] + dy + shift[j, 1]
            atom_x[i, 2] = x[2, b] + dz + shift[j, 2]


@compiled
def set_velocities(first, index, d, v, q, p, moment, atom_v):
    """Write the velocities v + omega x r of the bodies' atoms."""
    for b in range(first.size - 1):
        r = rotation_matrix(q, b)
        w1, w2, w3 = body_frame_angular_velocity(q, p, moment, b)
        for j in range(first[b], first[b + 1]):
            i = index[j]
            d1, d2, d3 = d[j, 0], d[j, 1], d[j, 2]
            dx, dy, dz = to_space(r, w2 * d3 - w3 * d2, w3 * d1 - w1 * d3, w1 * d2 - w2 * d1)
            atom_v[i, 0] = v[0, b] + dx
            atom_v[i, 1] = v[1, b] + dy
            atom_v[i, 2] = v[2, b] + dz


@compiled
def gather(first, index, d, q, atom_f, force, torque):
    """Sum force and torque (space frame, about the centre of mass) over this rank's atoms.

    Returns False when any sum is not finite.
    """
    check = 0.0
    for b in range(first.size - 1):
        r = rotation_matrix(q, b)
        fx = fy = fz = tx = ty = tz = 0.0
        for j in range(first[b], first[b + 1]):
            i = index[j]
            ax, ay, az = atom_f[i, 0], atom_f[i, 1], atom_f[i, 2]
            dx, dy, dz = to_space(r, d[j, 0], d[j, 1], d[j, 2])
            fx += ax
            fy += ay
            fz += az
            tx += dy * az - dz * ay
            ty += dz * ax - dx * az
            tz += dx * ay - dy * ax
        force[0, b], force[1, b], force[2, b] = fx, fy, fz
        torque[0, b], torque[1, b], torque[2, b] = tx, ty, tz
        check += 0.0 * (fx + fy + fz + tx + ty + tz)
    return check == 0.0


@compiled
def add_torques(first, index, atom_torque, torque):
    """Add the torques that act on the atoms themselves (spheres) to those on their bodies."""
    for b in range(first.size - 1):
        for j in range(first[b], first[b + 1]):
            for k in range(3):
                torque[k, b] += atom_torque[index[j], k]


@compiled
def set_spins(first, index, q, p, moment, atom_omega):
    """Write the bodies' angular velocity, space frame, as that of their atoms."""
    for b in range(first.size - 1):
        w1, w2, w3 = body_frame_angular_velocity(q, p, moment, b)
        w = to_space(rotation_matrix(q, b), w1, w2, w3)
        for j in range(first[b], first[b + 1]):
            for k in range(3):
                atom_omega[index[j], k] = w[k]


@compiled
def constraint_virial(first, index, d, atom_mass, q, p, mass, moment, force, torque, ftm2v, atom_f, virial, atom_virial):
    """Add the virial of the forces that keep the bodies rigid to virial (xx yy zz xy xz yz).

    The constraint force on atom i is m_i a_i - f_i, with the acceleration a_i of the rigid
    motion itself; its virial is taken about the centre of mass.  atom_mass has an entry for
    each of `index`; atom_virial is (atoms, 6), or (0, 6) if the atoms' parts are not wanted.
    """
    for b in range(first.size - 1):
        r = rotation_matrix(q, b)
        w1, w2, w3 = body_frame_angular_velocity(q, p, moment, b)
        t1, t2, t3 = to_body(r, torque[0, b], torque[1, b], torque[2, b])
        i1, i2, i3 = moment[0, b], moment[1, b], moment[2, b]
        # Euler's equations; an axis without moment does not turn
        a1 = (t1 * ftm2v - (i3 - i2) * w2 * w3) / i1 if i1 > 0.0 else 0.0
        a2 = (t2 * ftm2v - (i1 - i3) * w3 * w1) / i2 if i2 > 0.0 else 0.0
        a3 = (t3 * ftm2v - (i2 - i1) * w1 * w2) / i3 if i3 > 0.0 else 0.0
        ww = w1 * w1 + w2 * w2 + w3 * w3
        for j in range(first[b], first[b + 1]):
            d1, d2, d3 = d[j, 0], d[j, 1], d[j, 2]
            wd = w1 * d1 + w2 * d2 + w3 * d3
            # alpha x d + omega x (omega x d)
            ax, ay, az = to_space(
                r,
                a2 * d3 - a3 * d2 + wd * w1 - ww * d1,
                a3 * d1 - a1 * d3 + wd * w2 - ww * d2,
                a1 * d2 - a2 * d1 + wd * w3 - ww * d3,
            )
            i, m = index[j], atom_mass[j]
            cx = m * (ax / ftm2v + force[0, b] / mass[b]) - atom_f[i, 0]
            cy = m * (ay / ftm2v + force[1, b] / mass[b]) - atom_f[i, 1]
            cz = m * (az / ftm2v + force[2, b] / mass[b]) - atom_f[i, 2]
            dx, dy, dz = to_space(r, d1, d2, d3)
            parts = dx * cx, dy * cy, dz * cz, dx * cy, dx * cz, dy * cz
            for k in range(6):
                virial[k] += parts[k]
                if atom_virial.size:
                    atom_virial[i, k] += parts[k]


@compiled
def find(keys, wanted):
    """For each entry of `wanted` its place in `keys` (both unique, positive), or -1.

    A hash table of the size of the rank's own data: no array grows with the system.
    """
    size = 4
    while size < 2 * keys.size:
        size *= 2
    table = np.full(size, -1, np.int64)
    for j in range(keys.size):
        h = (keys[j] * 0x9E3779B1 >> 16) & (size - 1)
        while table[h] >= 0:
            h = (h + 1) & (size - 1)
        table[h] = j
    found = np.empty(wanted.size, np.int64)
    for i in range(wanted.size):
        h = (wanted[i] * 0x9E3779B1 >> 16) & (size - 1)
        while table[h] >= 0 and keys[table[h]] != wanted[i]:
            h = (h + 1) & (size - 1)
        found[i] = table[h]
    return found
