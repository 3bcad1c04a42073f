"""How bodies follow LAMMPS's atoms, which it moves between ranks and in its arrays."""

from typing import NamedTuple

import numpy as np

from ..loops.compiled import (
    F1,
    F2,
    F64,
    I1,
    I2,
    L1,
    L2,
    I,
    floats,
    inlined,
    int_rows,
    ints,
    longs,
    loop,
)
from ..loops.memory import room
from ..motion.block import FORCE, HOME, ID, LANES, MOMENT, NATOMS, Images, Kinds, Layout
from ..motion.periodic import PeriodicBox, find_images, take_into_box
from .mpi import LONG, RANK, Mpi, add_up
from .sharing import ASKED, ASKED_ROW, BODIES, HOME_ROW, IDS, MEET, SHARED, SHARED_ROW, find, in_row

IN_NO_BODY = -1  # an atom's origin
# what goes with an atom to another rank: its origin, its body's column of state, its of displace
OF_BODY = 1

# rows of the bodies' memory: what loops take (see `block.Layout`), the body of each atom, how many
# atoms of each body are here, where force and torque are, `block.Images`;
KINDS = {
    "state": F2,
    "displace": F2,
    "blocks": I2,
    "rounds": I1,
    "index": I1,
    "body": L1,
    "atoms": L1,
    "wrench": F2,
    "away": I1,
    "shift": F2,
}
(STATE, DISPLACE, BLOCKS, ROUNDS, INDEX, BODY, ATOMS, WRENCH, AWAY, SHIFT) = range(1, 11)
# those of before; atoms found, in LAMMPS's order, and their place in `index`, or -1 minus their row
# of arrived; and what `arrange` works with
_WORK = (
    "here",
    "place",
    "owner",
    "source",
    "first",
    "number",
    "order",
    "following",
    "table",
    "buckets",
    "ends",
)
KINDS |= {"old_state": F2, "old_displace": F2} | dict.fromkeys(_WORK, L1)
OLD_STATE, OLD_DISPLACE, HERE, PLACE, OWNER, SOURCE = range(11, 17)
FIRST, NUMBER, ORDER, FOLLOWING, TABLE, BUCKETS, ENDS = range(17, 24)

# what `locate` counts: atoms that came from nowhere, how many more there are than before, how many
# are not where they were; the same of all ranks; how many atoms are here; how many failed, of all
# ranks
CAME, MORE, MOVED, SUMMED = range(4)
SUMS, COUNT, FAILED, ALL_FAILED, FOUND = 3, 6, 7, 8, 9
# what `follow` does, and what it returns if all is not well
LOCATE, ARRANGE, NOTE, SETTLE, FEWER = 1, 2, 4, 8, 16
CHANGED, OFF = 1, 2  # atoms came or are gone; an atom is not where its body has it

GROUPS = 6
ARRIVED = 5  # row of LAMMPS's arrays (see `lammps.Lammps.table`)


class Atoms(NamedTuple):
    """LAMMPS's atoms on this rank.

    Attributes:
        groups: (natoms,) the bits of each atom's groups.
        fix_group, body_groups, points: masks: an atom is in a body if it has a bit of each of the
            first two, and a point if it has one of the third.
        origins: (natoms,) where each atom was: rank << 32 | its place in `index`; if it comes from
            another rank, -2 minus its row in arrived; -1 if it was in no body.
        arrived: what came with atoms from other ranks.
        arrays: the table of the cells of these arrays.
        atom_x: (natoms, 3).
    """

    groups: I1
    fix_group: I
    body_groups: I
    points: I
    origins: L1
    arrived: F2
    arrays: L2
    atom_x: F2


@inlined
def numbers(memory, row):
    """The int64 array in this row, (n,)."""
    return longs(memory[row, 0], memory[row, 1])


@inlined
def matrix(memory, row):
    """The array in this row, (rows, columns)."""
    return floats(memory[row, 0], memory[row, 1], memory[row, 2])


@inlined
def locate(atoms, bodies, found):
    """Find the atoms of the bodies in LAMMPS's arrays.

    An origin beyond the list of before, or beyond what arrived, counts as none: the atom came.
    """
    count = came = moved = 0
    before, arrived, natoms = bodies[INDEX, 1], atoms.arrived.shape[0], atoms.groups.size
    index = ints(bodies[INDEX, 0], before)
    here, place = in_row(bodies, HERE, natoms), in_row(bodies, PLACE, natoms)
    for i in range(natoms):
        groups = atoms.groups[i]
        if (groups & atoms.fix_group and groups & atoms.body_groups) or groups & atoms.points:
            origin = atoms.origins[i]
            j = origin & 0xFFFFFFFF if origin >= 0 else origin + 1
            if origin == IN_NO_BODY or j >= before or -j > arrived:
                came += 1
                continue
            moved += j < 0 or index[j] != i
            here[count], place[count] = i, j
            count += 1
    found[CAME], found[MORE], found[COUNT] = came, count - before, count
    found[MOVED] = moved + (count != before)


# ---------------------------------------------------------------- the order of the passes


@inlined
def rounds_of(atoms):
    """How many rounds a body of so many atoms takes."""
    return atoms if atoms <= LANES else (atoms + LANES - 1) // LANES


@inlined
def of_body(row, b, state, arrived, first):
    """An entry of body b's state: of those of this rank, or those that came with atoms."""
    return (
        state[row, b] if b < state.shape[1] else arrived[first[b - state.shape[1]], OF_BODY + row]
    )


@inlined
def bucket(b, atoms, state, arrived, first):
    """The place of a body in the order: by kind, whole ones first, by its number of atoms."""
    third = of_body(MOMENT + 2, b, state, arrived, first)
    turns = 0 if third > 0.0 else 1 if of_body(MOMENT, b, state, arrived, first) > 0.0 else 2
    group = 2 * turns + (of_body(NATOMS, b, state, arrived, first) > atoms)
    return group * (LANES + 1) + max(LANES + 1 - atoms, 0)


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


@inlined
def find_owners(arrived, bodies, sharing, counts, n):
    """Find the body of each of the n atoms that are here: a place of the state of before, or, of
    those that came, one behind them, for which FIRST has a row in arrived.

    Returns:
        how many bodies came.
    """
    state, body, place = matrix(bodies, STATE), numbers(bodies, BODY), longs(bodies[PLACE, 0], n)
    owner, first = in_row(bodies, OWNER, n), in_row(bodies, FIRST, arrived.shape[0])
    shared = longs(sharing[SHARED_ROW, 0], counts[SHARED])
    size, m, strangers = 4, state.shape[1], 0
    while size <= 2 * (shared.size + arrived.shape[0]):
        size *= 2
    table = in_row(bodies, TABLE, size)
    if arrived.shape[0]:
        for k in range(size):
            table[k] = -1
        for k in range(shared.size):
            enter(table, state[ID, shared[k]], shared[k])
    for j in range(n):
        if place[j] >= 0:
            owner[j] = body[place[j]]
        else:
            row = -1 - place[j]
            key = arrived[row, OF_BODY + ID]
            h = hashed(key, table)
            while table[h] >= 0 and of_body(ID, table[h], state, arrived, first) != key:
                h = (h + 1) & (size - 1)
            if table[h] < 0:
                table[h], first[strangers] = m + strangers, row
                strangers += 1
            owner[j] = table[h]
    return strangers


@inlined
def number_bodies(arrived, bodies, strangers, n, groups):
    """Number the bodies anew, in the order of `bucket`, and as LAMMPS has their first atoms.

    NUMBER has the new number of each, ORDER what has each new number, ATOMS how many atoms it has
    here.

    Args:
        groups: (GROUPS,) out: how many bodies are in the groups of `bucket` up to each.
    """
    state, owner = matrix(bodies, STATE), longs(bodies[OWNER, 0], n)
    first, m = longs(bodies[FIRST, 0], strangers), state.shape[1] + strangers
    number, order = in_row(bodies, NUMBER, m), in_row(bodies, ORDER, m)
    buckets, atoms = in_row(bodies, BUCKETS, GROUPS * (LANES + 1) + 1), in_row(bodies, ATOMS, m)
    for b in range(m):
        number[b] = 0
    for j in range(n):
        number[owner[j]] += 1  # for now the number of atoms
    for k in range(buckets.size):
        buckets[k] = 0
    for b in range(m):
        if number[b] > 0:
            buckets[bucket(b, number[b], state, arrived, first) + 1] += 1
    for k in range(1, buckets.size):
        buckets[k] += buckets[k - 1]
    for k in range(GROUPS):
        groups[k] = buckets[(k + 1) * (LANES + 1)]
    for j in range(n):
        b = owner[j]
        if number[b] > 0:  # its first atom
            k = bucket(b, number[b], state, arrived, first)
            new = buckets[k]
            buckets[k] += 1
            order[new] = b
            atoms[new] = number[b]
            number[b] = -1 - new
    for b in range(m):
        number[b] = -1 - number[b]
    bodies[ATOMS, 1] = groups[GROUPS - 1]


@inlined
def make_blocks(bodies, n, groups):
    """Divide the bodies into blocks, and their atoms into rounds; see `block`."""
    total, begin, block, turn, entry, group = groups[GROUPS - 1], 0, 0, 0, 0, 0
    atoms = longs(bodies[ATOMS, 0], total)
    blocks = int_rows(room(bodies, BLOCKS, 12 * (total + 1)), total + 1, 3)
    rounds = ints(room(bodies, ROUNDS, 4 * (n + 1)), n + 1)
    while begin < total:
        while begin >= groups[group]:
            group += 1
        blocks[block, 0], blocks[block, 1], blocks[block, 2] = begin, turn, group % 2 == 0
        end = begin + 1
        if atoms[begin] <= LANES:
            end = min(begin + LANES, groups[group])
        lanes = end - begin
        for r in range(rounds_of(atoms[begin])):
            rounds[turn] = entry
            while lanes > 1 and atoms[begin + lanes - 1] <= r:
                lanes -= 1
            entry += lanes if atoms[begin] <= LANES else min(LANES, atoms[begin] - r * LANES)
            turn += 1
        begin = end
        block += 1
    blocks[block, 0], blocks[block, 1], blocks[block, 2] = total, turn, 0
    rounds[turn] = entry
    bodies[BLOCKS, 1], bodies[BLOCKS, 2], bodies[ROUNDS, 1] = block + 1, 3, turn + 1


@inlined
def place_atoms(bodies, n):
    """Give each atom its entry of INDEX; SOURCE has where in HERE it was, BODY its body."""
    blocks = int_rows(bodies[BLOCKS, 0], bodies[BLOCKS, 1], 3)
    rounds, atoms = ints(bodies[ROUNDS, 0], bodies[ROUNDS, 1]), numbers(bodies, ATOMS)
    here, owner = longs(bodies[HERE, 0], n), longs(bodies[OWNER, 0], n)
    number, following = longs(bodies[NUMBER, 0], n), in_row(bodies, FOLLOWING, 2 * atoms.size)
    index, source = ints(room(bodies, INDEX, 4 * n), n), in_row(bodies, SOURCE, n)
    body = in_row(bodies, BODY, n)
    for k in range(blocks.shape[0] - 1):
        for b in range(blocks[k, 0], blocks[k + 1, 0]):
            if atoms[b] > LANES:  # its next entry
                following[2 * b], following[2 * b + 1] = rounds[blocks[k, 1]], -1
            else:  # its next round, its lane
                following[2 * b], following[2 * b + 1] = blocks[k, 1], b - blocks[k, 0]
    for j in range(n):
        b = number[owner[j]]
        entry, lane = following[2 * b], following[2 * b + 1]
        if lane >= 0:
            entry = rounds[entry] + lane
        following[2 * b] += 1
        index[entry], source[entry], body[entry] = here[j], j, b
    bodies[INDEX, 1] = bodies[BODY, 1] = n


@inlined
def carry_over(arrived, bodies, strangers, n):
    """Copy the bodies and their atoms to the new order."""
    for now, old in (STATE, OLD_STATE), (DISPLACE, OLD_DISPLACE):
        for column in range(4):
            bodies[now, column], bodies[old, column] = bodies[old, column], bodies[now, column]
    m, rows = bodies[ATOMS, 1], bodies[OLD_STATE, 1]
    old_state, old_displace = matrix(bodies, OLD_STATE), matrix(bodies, OLD_DISPLACE)
    state = floats(room(bodies, STATE, 8 * rows * m), rows, m)
    width = bodies[OLD_DISPLACE, 1]
    displace = floats(room(bodies, DISPLACE, 8 * width * n), width, n)
    order, first = longs(bodies[ORDER, 0], m), longs(bodies[FIRST, 0], strangers)
    source, place = longs(bodies[SOURCE, 0], n), longs(bodies[PLACE, 0], n)
    for row in range(rows):
        for b in range(m):
            state[row, b] = of_body(row, order[b], old_state, arrived, first)
    for c in range(width):
        for j in range(n):
            p = place[source[j]]
            displace[c, j] = old_displace[c, p] if p >= 0 else arrived[-1 - p, OF_BODY + rows + c]
    bodies[STATE, 1], bodies[STATE, 2] = rows, m
    bodies[DISPLACE, 1], bodies[DISPLACE, 2] = width, n
    bodies[WRENCH, 0], bodies[WRENCH, 1], bodies[WRENCH, 2] = bodies[STATE, 0] + 8 * FORCE * m, 6, m


@inlined
def arrange(mpi, sharing, counts, arrived, bodies, kinds, n):
    """Put the bodies of the n atoms here in the order of the passes, and find who shares them."""
    strangers = find_owners(arrived, bodies, sharing, counts, n)
    groups = in_row(bodies, ENDS, GROUPS)
    number_bodies(arrived, bodies, strangers, n, groups)
    kinds.rotors, kinds.turning = groups[1], groups[3]
    make_blocks(bodies, n, groups)
    place_atoms(bodies, n)
    carry_over(arrived, bodies, strangers, n)

    state, atoms, asked = matrix(bodies, STATE), numbers(bodies, ATOMS), 0
    places, ids = in_row(sharing, ASKED_ROW, atoms.size), in_row(sharing, IDS, atoms.size)
    meet = in_row(sharing, MEET, atoms.size)
    for b in range(atoms.size):
        if atoms[b] < state[NATOMS, b]:
            places[asked], ids[asked], meet[asked] = b, state[ID, b], state[HOME, b]
            asked += 1
    counts[BODIES], counts[ASKED] = atoms.size, asked
    find(mpi, sharing, counts)
    home = longs(sharing[HOME_ROW, 0], atoms.size)
    for b in range(atoms.size):
        state[HOME, b] = home[b]


# ---------------------------------------------------------------- periodic images


@inlined
def settle(layout, bodies, aways, box, atom_x, off):
    """Find which atoms are in other periodic images: see `periodic.find_images`."""
    n = layout.index.size
    away, shift = ints(room(bodies, AWAY, 4 * n), n), floats(room(bodies, SHIFT, 24 * n), n, 3)
    find_images(layout, Images(away, shift, aways), box, atom_x, off)
    bodies[AWAY, 1], bodies[SHIFT, 1], bodies[SHIFT, 2] = aways[0], aways[0], 3


@loop
def follow(
    mpi: Mpi,
    sharing: L2,
    counts: L1,
    atoms: Atoms,
    bodies: L2,
    kinds: Kinds,
    aways: L1,
    block: F64,
    found: L1,
    box: PeriodicBox,
    off: F1,
    what: I,
) -> I:
    """Be the same bodies after LAMMPS has moved atoms between ranks and in its arrays; collective.

    Args:
        bodies: the table of the bodies' memory; see the head of this file.
        kinds, block: see `block.Layout`.  aways: see `block.Images`.
        found: (FOUND,) what is counted.  off: see `periodic.find_images`.
        what: the sum of LOCATE the atoms; ARRANGE the bodies, if some have moved on any rank; NOTE
            where the atoms are now; SETTLE periodic images; FEWER: atoms may be gone.
    Returns:
        0, CHANGED or OFF.
    """
    arranges = what & ARRANGE
    if what & LOCATE:
        locate(atoms, bodies, found)
        add_up(mpi, LONG, found[CAME:SUMMED], found[SUMS : SUMS + SUMMED])
        if found[SUMS + CAME] or (found[SUMS + MORE] and not what & FEWER):
            return CHANGED
        arranges = found[SUMS + MOVED]
    if arranges:
        arrange(mpi, sharing, counts, atoms.arrived, bodies, kinds, found[COUNT])
    index = ints(bodies[INDEX, 0], bodies[INDEX, 1])
    if what & NOTE and (arranges or not what & LOCATE):
        for i in range(atoms.origins.size):
            atoms.origins[i] = IN_NO_BODY
        for j in range(index.size):
            atoms.origins[index[j]] = mpi.interface[RANK] << 32 | j
        atoms.arrays[ARRIVED, 1] = 0  # of no more use
    if what & SETTLE:
        blocks = int_rows(bodies[BLOCKS, 0], bodies[BLOCKS, 1], 3)
        rounds = ints(bodies[ROUNDS, 0], bodies[ROUNDS, 1])
        state, displace = matrix(bodies, STATE), matrix(bodies, DISPLACE)
        take_into_box(state, box)
        layout = Layout(state, kinds, blocks, rounds, index, displace, block)
        settle(layout, bodies, aways, box, atoms.atom_x, off)
        found[FAILED] = not off[0] <= box.near
        add_up(mpi, LONG, found[FAILED:ALL_FAILED], found[ALL_FAILED:FOUND])
        if found[ALL_FAILED]:
            return OFF
    return 0
