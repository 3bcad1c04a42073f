"""The compiled loops over bodies and their atoms: one loop per pass, arrays in, arrays out.

The mathematics of the free rotation is in `rotor.py`.  Everything is in the units of the
LAMMPS run; dtf is a time times the factor ftm2v that makes a force a mass times an acceleration.

`state` holds the bodies, (rows, bodies); its rows are named below.  They are worked on by blocks
of up to BLOCK bodies.  `take` copies a block into the first rows of a scratch array, small enough
to stay in the processor's nearest cache; each step of the mathematics is a loop over the lanes of
the block, which the compiler vectorises; `put` copies the result back.  So the state is read and
written once a pass.  Loops over bodies always do all BLOCK lanes, those after the last body with
copies of the first, so that a body's result does not depend on its place, and all ranks that hold
it get the same bits.

The atoms of a block come in rounds: first the first atom of each of its bodies, then the second of
each that has a second, and so on.  Bodies are ordered by their number of atoms, so a round is the
first lanes of the block.  Bodies of which all atoms are this rank's are in other blocks than those that other ranks
have atoms of.  A body of more than BLOCK atoms is a block by itself, in all lanes, and
its rounds take BLOCK of its atoms each.

    blocks (blocks + 1, 3)   each block's first body and first round, and whether all atoms of its bodies are this rank's
    rounds (rounds + 1,)     each round's first atom, as an entry of
    index (atoms,)           the atom's index in LAMMPS's arrays, which are (atoms, 3)
    d (4, atoms)             its place in the body's principal frame, and its ID
"""

from math import floor

import numpy as np

from . import packing
from .compiled import F1, F2, I1, I2, L1, L2, F, I, inlined, loop, prefetch
from .rotor import free_linear_rotor, free_rotor, permute_3, rotation, turns_little

# the rows of `state`; scratch has those up to TORQUE, and more
MASS, MOMENT, X, V, Q, P, FORCE, TORQUE, NATOMS, IMAGE, HOME, ID, ROWS = (
    0,
    1,
    4,
    7,
    10,
    14,
    18,
    21,
    24,
    25,
    28,
    29,
    30,
)
MATRIX, ATOM, SHIFT, ACCELERATION, FAST = 24, 33, 36, 36, 36
BLOCK = 64
LINE = 8  # numbers that the processor fetches at a time
SCRATCH = 45 * BLOCK


@inlined
def rotation_matrix(w, x, y, z):
    """Transpose of A(q), eq. 2.3, row by row: takes a body-frame vector to the space frame."""
    return (
        w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), w * w - x * x + y * y - z * z, 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z,
    )  # fmt: skip


@inlined(contract=True)
def to_space(r, x, y, z):
    """The matrix r (9 numbers, row by row) times (x, y, z)."""
    return (
        r[0] * x + r[1] * y + r[2] * z,
        r[3] * x + r[4] * y + r[5] * z,
        r[6] * x + r[7] * y + r[8] * z,
    )


@inlined
def to_body(r, x, y, z):
    """The transpose of the matrix r times (x, y, z)."""
    return (
        r[0] * x + r[3] * y + r[6] * z,
        r[1] * x + r[4] * y + r[7] * z,
        r[2] * x + r[5] * y + r[8] * z,
    )


@inlined
def body_frame_angular_momentum(q, p):
    """L in the principal frame, from S(q)^T p = 2 (0, L)."""
    return (
        0.5 * (-q[1] * p[0] + q[0] * p[1] + q[3] * p[2] - q[2] * p[3]),
        0.5 * (-q[2] * p[0] - q[3] * p[1] + q[0] * p[2] + q[1] * p[3]),
        0.5 * (-q[3] * p[0] + q[2] * p[1] - q[1] * p[2] + q[0] * p[3]),
    )


@inlined
def body_frame_angular_velocity(q, p, i1, i2, i3):
    """omega in the principal frame; zero about an axis without moment."""
    l1, l2, l3 = body_frame_angular_momentum(q, p)
    return (
        l1 / i1 if i1 > 0.0 else 0.0,
        l2 / i2 if i2 > 0.0 else 0.0,
        l3 / i3 if i3 > 0.0 else 0.0,
    )


@inlined
def at(i):
    """An index that is not negative: numba need not look whether to count from the end."""
    return np.uint64(i)


# ---------------------------------------------------------------- a block of bodies


@inlined
def fetch_ahead(state, blocks, k, row, until, rounds, index, d, atoms):
    """Have the processor fetch what the passes need of block k: while LAMMPS computed forces, it forgot them."""
    if k < blocks.shape[0] - 1:
        for b in range(blocks[k, 0], blocks[k + 1, 0], LINE):
            for r in range(row, until):
                prefetch(state, r, b)
        begin, end = rounds[blocks[k, 1]], rounds[blocks[k + 1, 1]]
        for j in range(begin, end, LINE):
            for c in range(3):
                prefetch(d, c, j)
        for j in range(begin, end):
            prefetch(atoms, index[at(j)], 0)


@inlined
def take(scratch, state, begin, end, row, until):
    """Copy rows of the bodies [begin, end); the rest of the block is filled with copies of the first."""
    for k in range(row, until):
        for b in range(end - begin):
            scratch[k * BLOCK + b] = state[k, at(begin + b)]
        for b in range(end - begin, BLOCK):
            scratch[k * BLOCK + b] = scratch[k * BLOCK]


@inlined
def put(scratch, state, begin, end, row, until, to_row):
    """Copy rows back, to the rows from to_row on."""
    for k in range(until - row):
        for b in range(end - begin):
            state[to_row + k, at(begin + b)] = scratch[(row + k) * BLOCK + b]


@inlined
def three(scratch, row, b):
    """Three rows of body b."""
    return scratch[row * BLOCK + b], scratch[(row + 1) * BLOCK + b], scratch[(row + 2) * BLOCK + b]


@inlined
def four(scratch, row, b):
    """Four rows of body b."""
    return (
        scratch[row * BLOCK + b],
        scratch[(row + 1) * BLOCK + b],
        scratch[(row + 2) * BLOCK + b],
        scratch[(row + 3) * BLOCK + b],
    )


@inlined
def nine(scratch, row, b):
    """Nine rows of body b."""
    return three(scratch, row, b) + three(scratch, row + 3, b) + three(scratch, row + 6, b)


@inlined
def set_three(scratch, row, b, x, y, z):
    """Write three rows of body b."""
    scratch[row * BLOCK + b] = x
    scratch[(row + 1) * BLOCK + b] = y
    scratch[(row + 2) * BLOCK + b] = z


@inlined
def set_four(scratch, row, b, values):
    """Write four rows of body b."""
    scratch[row * BLOCK + b] = values[0]
    scratch[(row + 1) * BLOCK + b] = values[1]
    scratch[(row + 2) * BLOCK + b] = values[2]
    scratch[(row + 3) * BLOCK + b] = values[3]


@inlined
def set_nine(scratch, row, b, values):
    """Write nine rows of body b."""
    for k in range(9):
        scratch[(row + k) * BLOCK + b] = values[k]


@inlined
def kick_block(scratch, dtf):
    """Momentum from force and torque (2.58).

    The torque is in the space frame: with (0, tau) the four-torque, 2 S(q) (0, A tau) (2.60) equals 2 (0, tau) q.
    """
    for b in range(BLOCK):
        for k in range(3):
            scratch[(V + k) * BLOCK + b] += (
                dtf / scratch[MASS * BLOCK + b] * scratch[(FORCE + k) * BLOCK + b]
            )
        t1, t2, t3 = three(scratch, TORQUE, b)
        x, y, z = 2.0 * dtf * t1, 2.0 * dtf * t2, 2.0 * dtf * t3
        q0, q1, q2, q3 = four(scratch, Q, b)
        p0, p1, p2, p3 = four(scratch, P, b)
        set_four(scratch, P, b, (
            p0 + (-x * q1 - y * q2 - z * q3),
            p1 + (x * q0 + y * q3 - z * q2),
            p2 + (-x * q3 + y * q0 + z * q1),
            p3 + (x * q2 - y * q1 + z * q0),
        ))  # fmt: skip


@inlined
def drift_block(scratch, dt):
    """Move the centres of mass."""
    for k in range(3 * BLOCK):
        scratch[X * BLOCK + k] += dt * scratch[V * BLOCK + k]


@inlined
def rotate_rotors(scratch, dt, mrot):
    """Free rotation of rotors, in mrot inner steps (2.53).

    Power series serve bodies that turn little in an inner step, all lanes at once; the others' motion is found before, one by one.
    """
    inner, fast = dt / mrot, 0
    for b in range(BLOCK):
        i1, i2, i3 = three(scratch, MOMENT, b)
        if not turns_little(four(scratch, P, b), min(i1, min(i2, i3)), inner):
            fast += 1
    if fast:
        for b in range(BLOCK):
            i1, i2, i3 = three(scratch, MOMENT, b)
            q, p = four(scratch, Q, b), four(scratch, P, b)
            turns = 0 if turns_little(p, min(i1, min(i2, i3)), inner) else mrot
            for _ in range(turns):
                q, p = free_rotor(q, p, i1, i2, i3, inner, False)
            set_four(scratch, FAST, b, q)
            set_four(scratch, FAST + 4, b, p)
            scratch[(FAST + 8) * BLOCK + b] = turns
    for _ in range(mrot):
        for b in range(BLOCK):
            i1, i2, i3 = three(scratch, MOMENT, b)
            q, p = free_rotor(four(scratch, Q, b), four(scratch, P, b), i1, i2, i3, inner, True)
            set_four(scratch, Q, b, q)
            set_four(scratch, P, b, p)
    if fast:
        for b in range(BLOCK):
            if scratch[(FAST + 8) * BLOCK + b] > 0.0:
                set_four(scratch, Q, b, four(scratch, FAST, b))
                set_four(scratch, P, b, four(scratch, FAST + 4, b))


@inlined
def rotate_in_plane(scratch, dt):
    """Rotation of bodies that turn about their axis 3 only, as all do in two dimensions: h_3 alone, exact."""
    for b in range(BLOCK):
        q, p = four(scratch, Q, b), four(scratch, P, b)
        q, p = rotation(
            q, p, permute_3(q), permute_3(p), 0.25 / scratch[(MOMENT + 2) * BLOCK + b], dt, False
        )
        set_four(scratch, Q, b, q)
        set_four(scratch, P, b, p)


@inlined
def rotate_linear(scratch, dt):
    """Free rotation of linear bodies, exact."""
    for b in range(BLOCK):
        q, p = free_linear_rotor(
            four(scratch, Q, b), four(scratch, P, b), scratch[MOMENT * BLOCK + b], dt
        )
        set_four(scratch, Q, b, q)
        set_four(scratch, P, b, p)


@inlined
def rotation_matrices(scratch):
    """What takes d to the atoms' places about the centre of mass."""
    for b in range(BLOCK):
        w, x, y, z = four(scratch, Q, b)
        set_nine(scratch, MATRIX, b, rotation_matrix(w, x, y, z))


@inlined
def velocity_matrices(scratch):
    """What takes d to the atoms' velocities about the centre of mass: the rotation matrix times omega x."""
    for b in range(BLOCK):
        q = four(scratch, Q, b)
        i1, i2, i3 = three(scratch, MOMENT, b)
        w1, w2, w3 = body_frame_angular_velocity(q, four(scratch, P, b), i1, i2, i3)
        r = rotation_matrix(q[0], q[1], q[2], q[3])
        set_nine(scratch, MATRIX, b, (
            w3 * r[1] - w2 * r[2], w1 * r[2] - w3 * r[0], w2 * r[0] - w1 * r[1],
            w3 * r[4] - w2 * r[5], w1 * r[5] - w3 * r[3], w2 * r[3] - w1 * r[4],
            w3 * r[7] - w2 * r[8], w1 * r[8] - w3 * r[6], w2 * r[6] - w1 * r[7],
        ))  # fmt: skip


@inlined(contract=True)
def apply_matrices(scratch, row, begin, end, d):
    """The vector in these rows plus the matrix times d, for the atoms of a round."""
    for b in range(end - begin):
        x, y, z = three(scratch, row, b)
        dx, dy, dz = to_space(
            nine(scratch, MATRIX, b), d[0, at(begin + b)], d[1, at(begin + b)], d[2, at(begin + b)]
        )
        set_three(scratch, ATOM, b, x + dx, y + dy, z + dz)


@inlined
def write_atoms(scratch, row, begin, end, rounds, index, d, atoms):
    """Write, for each atom of the rounds [begin, end), the vector in these rows plus its body's matrix times d."""
    for r in range(begin, end):
        j = rounds[r]
        apply_matrices(scratch, row, j, rounds[r + 1], d)
        for b in range(rounds[r + 1] - j):
            i = at(index[at(j + b)])
            for k in range(3):
                atoms[i, k] = scratch[(ATOM + k) * BLOCK + b]


@inlined
def move_to_images(away, shift, aways, index, atom_x):
    """Move the atoms that LAMMPS has in another periodic image than their body there; see `settle`."""
    for a in range(aways[0]):
        for k in range(3):
            atom_x[index[away[a]], k] += shift[a, k]


@inlined(contract=True)
def add_forces(scratch, begin, end, d):
    """Add the forces of the atoms of a round, and their torques about the centre of mass."""
    for b in range(end - begin):
        fx, fy, fz = three(scratch, ATOM, b)
        dx, dy, dz = to_space(
            nine(scratch, MATRIX, b), d[0, at(begin + b)], d[1, at(begin + b)], d[2, at(begin + b)]
        )
        sx, sy, sz = three(scratch, FORCE, b)
        tx, ty, tz = three(scratch, TORQUE, b)
        set_three(scratch, FORCE, b, sx + fx, sy + fy, sz + fz)
        set_three(
            scratch,
            TORQUE,
            b,
            tx + (dy * fz - dz * fy),
            ty + (dz * fx - dx * fz),
            tz + (dx * fy - dy * fx),
        )


@inlined
def gather_block(scratch, bodies, begin, end, rounds, index, d, atom_f):
    """Sum force and torque over the atoms of the rounds [begin, end); returns in how many bodies they are not finite."""
    for k in range(FORCE * BLOCK, (TORQUE + 3) * BLOCK):
        scratch[k] = 0.0
    for r in range(begin, end):
        j = rounds[r]
        for b in range(rounds[r + 1] - j):
            i = at(index[at(j + b)])
            for k in range(3):
                scratch[(ATOM + k) * BLOCK + b] = atom_f[i, k]
        add_forces(scratch, j, rounds[r + 1], d)
    if bodies == 1:  # its atoms are in all lanes, and so must be the sums
        for k in range(FORCE, TORQUE + 3):
            for b in range(1, BLOCK):
                scratch[k * BLOCK] += scratch[k * BLOCK + b]
            for b in range(1, BLOCK):
                scratch[k * BLOCK + b] = scratch[k * BLOCK]
    wrong = 0
    for b in range(bodies):
        fx, fy, fz = three(scratch, FORCE, b)
        tx, ty, tz = three(scratch, TORQUE, b)
        if not 0.0 * (fx + fy + fz + tx + ty + tz) == 0.0:
            wrong += 1
    return wrong


# ---------------------------------------------------------------- the passes of a step

ALL, WHOLE, DIVIDED = range(3)  # parts of the bodies
GATHERS, KEEPS = 1, 2  # force and torque; and writes them to the bodies' state


@inlined
def advance_by(
    rotate, state, rotors, extended, plane, blocks, rounds, index, d, away, shift, aways, atom_x, atom_f, dt, dtf, gathers, kicks,
    mrot, part, scratch,
):  # fmt: skip
    """As `advance`; rotate(scratch, dt, mrot) is the free rotation of rotors, `rotate_rotors` or another integrator's."""
    wrong = 0
    for k in range(blocks.shape[0] - 1):
        if part != ALL and blocks[k, 2] != (part == WHOLE):
            continue
        begin, end = blocks[k, 0], blocks[k + 1, 0]
        fetch_ahead(
            state, blocks, k + 1, MASS, P + 4, rounds, index, d, atom_f if gathers else atom_x
        )
        take(scratch, state, begin, end, MASS, P + 4)
        if gathers and blocks[k, 2]:
            rotation_matrices(scratch)
            wrong += gather_block(
                scratch, end - begin, blocks[k, 1], blocks[k + 1, 1], rounds, index, d, atom_f
            )
            if gathers == KEEPS:
                put(scratch, state, begin, end, FORCE, TORQUE + 3, FORCE)
        else:
            take(scratch, state, begin, end, FORCE, TORQUE + 3)
        for _ in range(kicks):
            kick_block(scratch, dtf)
        drift_block(scratch, dt)
        if begin < rotors:
            if plane:
                rotate_in_plane(scratch, dt)
            else:
                rotate(scratch, dt, mrot)
        elif begin < extended:
            rotate_linear(scratch, dt)
        put(scratch, state, begin, end, X, P + 4, X)
        rotation_matrices(scratch)
        write_atoms(scratch, X, blocks[k, 1], blocks[k + 1, 1], rounds, index, d, atom_x)
    if part != WHOLE:
        move_to_images(away, shift, aways, index, atom_x)
    return wrong


@loop
def advance(
    state: F2, rotors: I, extended: I, plane: I, blocks: I2, rounds: I1, index: I1, d: F2, away: I1, shift: F2, aways: L1,
    atom_x: F2, atom_f: F2, dt: F, dtf: F, gathers: I, kicks: I, mrot: I, part: I, scratch: F1,
) -> I:  # fmt: skip
    """So many half kicks (dtf), drift and free rotation by dt, the atoms' new positions.

    Bodies [0, rotors) have three moments, [rotors, extended) are linear, the rest are points.  If it gathers, force and
    torque of bodies that are whole here are what `gather` would find: with two kicks, the last of one step
    and the first of the next, a whole step is one pass for them.  They go no further, unless it KEEPS them.

    It does this to the bodies of one part, ALL, WHOLE here or DIVIDED between ranks: if to these two, in this order.

    Returns:
        As `gather`, or 0.
    """
    return advance_by(
        rotate_rotors, state, rotors, extended, plane, blocks, rounds, index, d, away, shift, aways, atom_x, atom_f, dt, dtf, gathers,
        kicks, mrot, part, scratch,
    )  # fmt: skip


@loop
def gather(
    state: F2, blocks: I2, rounds: I1, index: I1, d: F2, atom_f: F2, load: F2, every: I, scratch: F1
) -> I:
    """Sum force and torque (space frame, about the centre of mass) over this rank's atoms into load, (6, bodies).

    Of all bodies if `every`, else of those that are not whole here.  Returns the number of bodies for which they are not finite.
    """
    wrong = 0
    for k in range(blocks.shape[0] - 1):
        if blocks[k, 2] and not every:
            continue
        begin, end = blocks[k, 0], blocks[k + 1, 0]
        fetch_ahead(state, blocks, k + 1, Q, Q + 4, rounds, index, d, atom_f)
        take(scratch, state, begin, end, Q, Q + 4)
        rotation_matrices(scratch)
        wrong += gather_block(
            scratch, end - begin, blocks[k, 1], blocks[k + 1, 1], rounds, index, d, atom_f
        )
        put(scratch, load, begin, end, FORCE, TORQUE + 3, 0)
    return wrong


@loop
def kick(state: F2, blocks: I2, dtf: F, scratch: F1):
    """Momentum from force and torque."""
    for k in range(blocks.shape[0] - 1):
        begin, end = blocks[k, 0], blocks[k + 1, 0]
        take(scratch, state, begin, end, MASS, TORQUE + 3)
        kick_block(scratch, dtf)
        put(scratch, state, begin, end, V, V + 3, V)
        put(scratch, state, begin, end, P, P + 4, P)


@loop
def set_velocities(state: F2, blocks: I2, rounds: I1, index: I1, d: F2, atom_v: F2, scratch: F1):
    """Write the velocities v + omega x r of the bodies' atoms."""
    for k in range(blocks.shape[0] - 1):
        take(scratch, state, blocks[k, 0], blocks[k + 1, 0], MOMENT, P + 4)
        velocity_matrices(scratch)
        write_atoms(scratch, V, blocks[k, 1], blocks[k + 1, 1], rounds, index, d, atom_v)


@inlined
def acceleration_matrices(scratch, ftm2v):
    """What takes d to the atoms' accelerations about the centre of mass, as forces per mass: alpha x and omega x omega x."""
    for b in range(BLOCK):
        r = nine(scratch, MATRIX, b)
        i1, i2, i3 = three(scratch, MOMENT, b)
        w1, w2, w3 = body_frame_angular_velocity(
            four(scratch, Q, b), four(scratch, P, b), i1, i2, i3
        )
        x, y, z = three(scratch, TORQUE, b)
        t1, t2, t3 = to_body(r, x, y, z)
        # Euler's equations; an axis without moment does not turn
        a1 = (t1 * ftm2v - (i3 - i2) * w2 * w3) / i1 if i1 > 0.0 else 0.0
        a2 = (t2 * ftm2v - (i1 - i3) * w3 * w1) / i2 if i2 > 0.0 else 0.0
        a3 = (t3 * ftm2v - (i2 - i1) * w1 * w2) / i3 if i3 > 0.0 else 0.0
        c1 = to_space(r, -w2 * w2 - w3 * w3, w1 * w2 + a3, w1 * w3 - a2)
        c2 = to_space(r, w1 * w2 - a3, -w1 * w1 - w3 * w3, w2 * w3 + a1)
        c3 = to_space(r, w1 * w3 + a2, w2 * w3 - a1, -w1 * w1 - w2 * w2)
        set_nine(scratch, ACCELERATION, b, (
            c1[0] / ftm2v, c2[0] / ftm2v, c3[0] / ftm2v,
            c1[1] / ftm2v, c2[1] / ftm2v, c3[1] / ftm2v,
            c1[2] / ftm2v, c2[2] / ftm2v, c3[2] / ftm2v,
        ))  # fmt: skip


@loop
def constraint_virial(
    state: F2, blocks: I2, rounds: I1, index: I1, d: F2, atom_mass: F1, ftm2v: F, atom_f: F2, virial: F1, atom_virial: F2,
    scratch: F1,
):  # fmt: skip
    """Add the virial of the forces that keep the bodies rigid to virial (xx yy zz xy xz yz).

    The constraint force on atom i is m_i a_i - f_i, with the acceleration a_i of the rigid
    motion itself; its virial is taken about the centre of mass.  atom_mass has an entry for
    each of `index`; atom_virial is (atoms, 6), or (0, 6) if the atoms' parts are not wanted.
    """
    for k in range(blocks.shape[0] - 1):
        take(scratch, state, blocks[k, 0], blocks[k + 1, 0], MASS, TORQUE + 3)
        rotation_matrices(scratch)
        acceleration_matrices(scratch, ftm2v)
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            for b in range(rounds[r + 1] - rounds[r]):
                j = rounds[r] + b
                i, m = index[j], atom_mass[j]
                fx, fy, fz = three(scratch, FORCE, b)
                dx, dy, dz = to_space(nine(scratch, MATRIX, b), d[0, j], d[1, j], d[2, j])
                ax, ay, az = to_space(nine(scratch, ACCELERATION, b), d[0, j], d[1, j], d[2, j])
                cx = m * (ax + fx / scratch[MASS * BLOCK + b]) - atom_f[i, 0]
                cy = m * (ay + fy / scratch[MASS * BLOCK + b]) - atom_f[i, 1]
                cz = m * (az + fz / scratch[MASS * BLOCK + b]) - atom_f[i, 2]
                parts = dx * cx, dy * cy, dz * cz, dx * cy, dx * cz, dy * cz
                for c in range(6):
                    virial[c] += parts[c]
                    if atom_virial.size:
                        atom_virial[i, c] += parts[c]


# ---------------------------------------------------------------- after LAMMPS has moved atoms


# what `locate` finds: atoms that came from nowhere, how many more there are than before, whether there is room, how many are not where
# they were; and how many there are
CAME, MORE, LACKING, MOVED, COUNT, FOUND = range(6)
# what there can be room for: atoms, bodies, entries of the table of `arrange`
ROOM_ATOMS, ROOM_BODIES, ROOM_ENTRIES, ROOMS = range(4)


@loop
def locate(
    groups: I1, fix_group: I, body_groups: I, origins: L1, index: I1, state: F2, arrived: F2, counts: L1, here: I1, place: I1,
    room: L1, found: L1,
):  # fmt: skip
    """Find the atoms of the bodies in LAMMPS's arrays.

    Args:
        groups (natoms,): the bits of each atom's groups; it is in a body if it has some bit of both of the next two.
        origins (natoms,): where each atom was: rank << 32 | its place in `index`; if it comes from another rank, -2 minus its row
            in arrived; -1 if it was in no body.
        arrived: what came with the atoms from other ranks.  counts: of `packing`.
        here, place: out: index of each atom found, in LAMMPS's order, and its place in `index`; of one that was
            on another rank, -1 minus its row in arrived.
        room (ROOMS,): for how much there is room.
        found (FOUND,): out: see above; atoms count as moved, too, while it is not known who shares the bodies.
    """
    count = came = moved = 0
    for i in range(groups.size):
        if groups[i] & fix_group and groups[i] & body_groups:
            if origins[i] == -1:
                came += 1
                continue
            j = origins[i] & 0xFFFFFFFF if origins[i] >= 0 else origins[i] + 1
            if j >= index.size or -j > arrived.shape[0]:  # of a list that is no more
                came += 1
                continue
            moved += j < 0 or index[j] != i
            if count < room[ROOM_ATOMS]:
                here[count], place[count] = i, j
            count += 1
    lacking = count > room[ROOM_ATOMS] or state.shape[1] + arrived.shape[0] > room[ROOM_BODIES]
    lacking = lacking or 2 * (counts[packing.SHARED] + arrived.shape[0]) >= room[ROOM_ENTRIES]
    found[CAME], found[MORE], found[LACKING], found[COUNT] = (
        came,
        count - index.size,
        lacking,
        count,
    )
    found[MOVED] = moved + (count != index.size) + (counts[packing.KNOWN] == 0)


# what comes with an atom from another rank: its origin, its column of d, then its body's of state
OF_ATOM, OF_BODY = 1, 5


@inlined
def rounds_of(atoms):
    """How many rounds a body of so many atoms takes."""
    return atoms if atoms <= BLOCK else (atoms + BLOCK - 1) // BLOCK


GROUPS = 6
BUCKETS = GROUPS * (BLOCK + 1) + 1


@inlined
def of_body(row, b, state, arrived, first):
    """An entry of body b's state: of those of this rank, or those that came with atoms."""
    return (
        state[row, b] if b < state.shape[1] else arrived[first[b - state.shape[1]], OF_BODY + row]
    )


@inlined
def bucket(b, atoms, state, arrived, first):
    """The place of a body in the order of the passes: by kind (three moments, one, none), whole ones first, by its number of atoms."""
    turns = (
        0
        if of_body(MOMENT + 2, b, state, arrived, first) > 0.0
        else 1
        if of_body(MOMENT, b, state, arrived, first) > 0.0
        else 2
    )
    group = 2 * turns + (of_body(NATOMS, b, state, arrived, first) > atoms)
    return group * (BLOCK + 1) + max(BLOCK + 1 - atoms, 0)


@inlined
def hashed(key, table):
    """Where to look first for a number in a table whose size is a power of two."""
    return (np.int64(key) * 0x9E3779B1 >> 16) & (table.size - 1)


@inlined
def enter(table, key, value):
    """Write a value to the first free place of a table from where its key is looked for."""
    h = hashed(key, table)
    while table[h] >= 0:
        h = (h + 1) & (table.size - 1)
    table[h] = value


@loop
def arrange(
    here: I1, place: I1, found: L1, body: L1, state: F2, arrived: F2, shared: L1, counts: L1, table: L1, owner: L1, first: L1, number: L1,
    order: L1, atoms: L1, next_: L2, buckets: L1, blocks: I2, rounds: I1, index: I1, source: L1, sizes: L1,
):  # fmt: skip
    """Put the bodies and their atoms in the order of the passes: of `bucket`, and as LAMMPS has their first atoms.

    Arrays may be longer than said here.

    Args:
        here, place (n,), found: of `locate`; n is found[COUNT].
        body: the body of each atom of the list of before; out, (n,): of the new one, as newly numbered.
        state (rows, m): the bodies.
        arrived (k, OF_BODY + rows): what came with atoms from other ranks.
        shared, counts: those of the bodies that other ranks had too, of which these atoms may be; see `packing`.
        table: to look their IDs up in; its size is a power of two, above twice the number of entries of shared and arrived.
        owner (n,), number (m + k,), buckets (BUCKETS,), next_ (m + k, 2): to work with.
        first (k,): out: for each body that was not here, a row in arrived.
        order (m + k,): out: what has each of the new numbers: a body, or m plus an entry of first.
        atoms (m + k,): out: how many atoms the bodies, as newly numbered, have here.
        blocks (m + k + 1, 3), rounds (n + 1,), index (n,): out: see the head of this file.
        source (n,): out: where in `here` each entry of index was.
        sizes (GROUPS + 2,): out: how many bodies are in the groups of `bucket` up to each, how many blocks, how many rounds.
    """
    n, m, strangers, last = found[COUNT], state.shape[1], 0, table.size - 1
    if arrived.shape[0]:
        for k in range(table.size):
            table[k] = -1
        for k in range(counts[packing.SHARED]):
            enter(table, state[ID, shared[k]], shared[k])
    for j in range(n):
        if place[j] >= 0:
            owner[j] = body[place[j]]
        else:
            row = -1 - place[j]
            key = arrived[row, OF_BODY + ID]
            h = hashed(key, table)
            while table[h] >= 0 and of_body(ID, table[h], state, arrived, first) != key:
                h = (h + 1) & last
            if table[h] < 0:
                table[h], first[strangers] = m + strangers, row
                strangers += 1
            owner[j] = table[h]

    for b in range(m + strangers):
        number[b] = 0
    for j in range(n):
        number[owner[j]] += 1  # for now the number of atoms
    for k in range(BUCKETS):
        buckets[k] = 0
    for b in range(m + strangers):
        if number[b] > 0:
            buckets[bucket(b, number[b], state, arrived, first) + 1] += 1
    for k in range(1, BUCKETS):
        buckets[k] += buckets[k - 1]
    for k in range(GROUPS):
        sizes[k] = buckets[(k + 1) * (BLOCK + 1)]
    for j in range(n):
        b = owner[j]
        if number[b] > 0:  # its first atom
            k = bucket(b, number[b], state, arrived, first)
            new = buckets[k]
            buckets[k] += 1
            order[new] = b
            atoms[new] = number[b]
            number[b] = -1 - new
    for b in range(m + strangers):
        number[b] = -1 - number[b]

    total, begin, block, round_, entry, group = sizes[GROUPS - 1], 0, 0, 0, 0, 0
    while begin < total:
        while begin >= sizes[group]:
            group += 1
        blocks[block, 0], blocks[block, 1], blocks[block, 2] = begin, round_, group % 2 == 0
        end = begin + 1
        if atoms[begin] <= BLOCK:
            end = min(begin + BLOCK, sizes[group])
        lanes = end - begin
        for r in range(rounds_of(atoms[begin])):
            rounds[round_] = entry
            while lanes > 1 and atoms[begin + lanes - 1] <= r:
                lanes -= 1
            entry += lanes if atoms[begin] <= BLOCK else min(BLOCK, atoms[begin] - r * BLOCK)
            round_ += 1
        begin = end
        block += 1
    blocks[block, 0], blocks[block, 1], blocks[block, 2] = total, round_, 0
    rounds[round_] = entry
    sizes[GROUPS], sizes[GROUPS + 1] = block, round_

    for k in range(block):
        for b in range(blocks[k, 0], blocks[k + 1, 0]):
            if atoms[b] > BLOCK:  # its next entry
                next_[b, 0], next_[b, 1] = rounds[blocks[k, 1]], -1
            else:  # its next round, its lane
                next_[b, 0], next_[b, 1] = blocks[k, 1], b - blocks[k, 0]
    for j in range(n):
        b = number[owner[j]]
        entry = next_[b, 0] if next_[b, 1] < 0 else rounds[next_[b, 0]] + next_[b, 1]
        next_[b, 0] += 1
        index[entry], source[entry], body[entry] = here[j], j, b


# what `renew` sets: the kinds of these cells, and which of the `compiled.cells` each is
RENEWED = {"state": F2, "old_state": F2, "load": F2, "d": F2, "old_d": F2, "blocks": I2, "rounds": I1, "index": I1, "body": L1, "atoms": L1,
           "rotors": I, "extended": I}  # fmt: skip
(
    STATE_AT,
    OLD_STATE_AT,
    LOAD_AT,
    D_AT,
    OLD_D_AT,
    BLOCKS_AT,
    ROUNDS_AT,
    INDEX_AT,
    BODY_AT,
    ATOMS_AT,
    ROTORS_AT,
    EXTENDED_AT,
) = range(12)


@loop
def renew(cells: L2, found: L1, sizes: L1):
    """Set the bodies' cells to the order that `arrange` has found: from now on the bodies and atoms of before are the old ones."""
    n, m = sizes[GROUPS - 1], found[COUNT]
    for now, old, size in (STATE_AT, OLD_STATE_AT, n), (D_AT, OLD_D_AT, m):
        cells[now, 0], cells[old, 0] = cells[old, 0], cells[now, 0]
        cells[old, 1], cells[old, 2], cells[now, 2] = cells[now, 1], cells[now, 2], size
    cells[LOAD_AT, 0], cells[LOAD_AT, 1], cells[LOAD_AT, 2] = (
        cells[STATE_AT, 0] + 8 * FORCE * n,
        TORQUE + 3 - FORCE,
        n,
    )
    cells[BLOCKS_AT, 1], cells[ROUNDS_AT, 1] = sizes[GROUPS] + 1, sizes[GROUPS + 1] + 1
    cells[INDEX_AT, 1] = cells[BODY_AT, 1] = m
    cells[ATOMS_AT, 1] = n
    cells[ROTORS_AT, 0], cells[EXTENDED_AT, 0] = sizes[1], sizes[3]


@loop
def carry_over(
    order: L1,
    first: L1,
    source: L1,
    place: I1,
    arrived: F2,
    old_state: F2,
    old_d: F2,
    state: F2,
    d: F2,
):
    """Copy the bodies and their atoms to the order that `arrange` has found."""
    for row in range(state.shape[0]):
        for b in range(state.shape[1]):
            state[row, b] = of_body(row, order[b], old_state, arrived, first)
    for c in range(d.shape[0]):
        for j in range(d.shape[1]):
            p = place[source[j]]
            d[c, j] = old_d[c, p] if p >= 0 else arrived[-1 - p, OF_ATOM + c]


@loop
def partial(state: F2, atoms: L1, asked: L1, ids: L1, meet: L1, counts: L1):
    """Find the bodies that are not whole here: their numbers, their IDs, and the rank at which their holders meet."""
    n = 0
    for b in range(state.shape[1]):
        if atoms[b] < state[NATOMS, b]:
            asked[n], ids[n], meet[n] = b, state[ID, b], state[HOME, b]
            n += 1
    counts[packing.BODIES], counts[packing.ASKED], counts[packing.KNOWN] = state.shape[1], n, 0


@loop
def set_home(home: L1, state: F2):
    """Write the rank at which the holders of each body are to meet the next time."""
    for b in range(state.shape[1]):
        state[HOME, b] = home[b]


@loop
def settle(
    state: F2, blocks: I2, rounds: I1, index: I1, d: F2, atom_x: F2, h: F2, inverse: F2, lo: F1, periodic: F1, away: I1,
    shift: F2, aways: L1, off: F1, near: F, scratch: F1,
) -> I:  # fmt: skip
    """Take the bodies into the box, and find the atoms that are in another periodic image than their body.

    Args:
        h, inverse (3, 3), lo (3,), periodic (3,): the `Box`.
        away (atoms,), shift (atoms, 3): out: entries of `index`, and the lattice vector from where the body has the atom.
        aways (1,): out: how many of these there are.
        off (2,): out: the largest distance (along an axis) of an atom from where its body has it, and its entry of `index`.
    Returns:
        0 if that distance is not above `near`.
    """
    for b in range(state.shape[1]):
        x, y, z = state[X, b] - lo[0], state[X + 1, b] - lo[1], state[X + 2, b] - lo[2]
        n1 = periodic[0] * floor(inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z)
        n2 = periodic[1] * floor(inverse[1, 1] * y + inverse[1, 2] * z)
        n3 = periodic[2] * floor(inverse[2, 2] * z)
        if n1 != 0.0 or n2 != 0.0 or n3 != 0.0:
            state[X, b] -= h[0, 0] * n1 + h[0, 1] * n2 + h[0, 2] * n3
            state[X + 1, b] -= h[1, 1] * n2 + h[1, 2] * n3
            state[X + 2, b] -= h[2, 2] * n3
            state[IMAGE, b] += n1
            state[IMAGE + 1, b] += n2
            state[IMAGE + 2, b] += n3
    count = 0
    off[0], off[1] = 0.0, 0.0
    for k in range(blocks.shape[0] - 1):
        take(scratch, state, blocks[k, 0], blocks[k + 1, 0], X, X + 3)
        take(scratch, state, blocks[k, 0], blocks[k + 1, 0], Q, Q + 4)
        rotation_matrices(scratch)
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            j = rounds[r]
            apply_matrices(scratch, X, j, rounds[r + 1], d)
            for b in range(rounds[r + 1] - j):
                i = at(index[at(j + b)])
                for c in range(3):
                    scratch[(ATOM + c) * BLOCK + b] = atom_x[i, c] - scratch[(ATOM + c) * BLOCK + b]
            for b in range(rounds[r + 1] - j):
                x, y, z = three(scratch, ATOM, b)
                n1 = periodic[0] * floor(
                    inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z + 0.5
                )
                n2 = periodic[1] * floor(inverse[1, 1] * y + inverse[1, 2] * z + 0.5)
                n3 = periodic[2] * floor(inverse[2, 2] * z + 0.5)
                x, y, z = (
                    h[0, 0] * n1 + h[0, 1] * n2 + h[0, 2] * n3,
                    h[1, 1] * n2 + h[1, 2] * n3,
                    h[2, 2] * n3,
                )
                set_three(scratch, SHIFT, b, x, y, z)
            for b in range(rounds[r + 1] - j):
                x, y, z = three(scratch, ATOM, b)
                sx, sy, sz = three(scratch, SHIFT, b)
                if sx != 0.0 or sy != 0.0 or sz != 0.0:
                    away[count] = j + b
                    shift[count, 0], shift[count, 1], shift[count, 2] = sx, sy, sz
                    count += 1
                far = max(abs(x - sx), max(abs(y - sy), abs(z - sz)))
                if not far <= off[0]:
                    off[0], off[1] = far, j + b
    aways[0] = count
    return not off[0] <= near
