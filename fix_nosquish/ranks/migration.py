"""How bodies follow LAMMPS's atoms, which it moves between ranks and in its arrays."""

from typing import NamedTuple

from ..loops.compiled import F1, F2, F64, I1, I2, L1, L2, I, inlined, loop
from ..loops.memory import (
    LENGTH,
    PLACE,
    WIDTH,
    append,
    floats_in,
    int_rows_in,
    ints_in,
    longs_in,
    new_longs,
    resize,
    rows,
    swap,
)
from ..motion.block import FORCE, HOME, ID, LANES, MOMENT, NATOMS, Images, Kinds, Layout
from ..motion.periodic import PeriodicBox, find_images, take_into_box
from .mpi import Mpi, add_up
from .sharing import SHARING, find, sort

IN_NO_BODY = -1  # an atom's origin
# what stands for the ID of its body: the atom came after the bodies were decided; it is in none
UNDECIDED, OUT = -(2**62), -(2**61)
GONE_ON = -1  # of a row of `arrived`: its atom is not here any more
# what goes with an atom to another rank: its origin, its body's column of state, its of displace
OF_BODY = 1


class BodyRows(NamedTuple):
    """Rows of the bodies' memory.

    Attributes:
        state, displace, blocks, rounds, index: see `block.Layout`.
        away, shift: see `block.Images`.
        wrench: (6, bodies) force and torque, a part of state.
        body: (atoms,) the body of each atom, in the order of index.
        atoms: (bodies,) how many atoms of each are here.
        here, place: (found,) the bodies' atoms that were found here, in LAMMPS's order, and where
            each was in index before, or -1 minus its row of what arrived.
        owner: (found,) the body of each: a column of the state of before, or, for a body that came,
            so many behind them as its entry of first has.
        first: (came,) a row of what arrived with each body that came.
        number, order: the new number of each of these bodies, and which has each new number.
        source: (atoms,) where in here each was.
        old_state, old_displace: those of before.
        ids, column: (shared + arrived,) of the bodies that other ranks held too, and those that
            came, row by row: the ID, and what `owner` has of it.
        following: (2 * bodies,) the next round of each body and its lane there; or, if it is a
            block by itself, its next entry of index and -1.
        buckets, ends: what the functions here work with.
    """

    state: F2
    displace: F2
    blocks: I2
    rounds: I1
    index: I1
    away: I1
    shift: F2
    wrench: F2
    body: L1
    atoms: L1
    here: L1
    place: L1
    owner: L1
    first: L1
    number: L1
    order: L1
    source: L1
    old_state: F2
    old_displace: F2
    ids: L1
    column: L1
    following: L1
    buckets: L1
    ends: L1


BODIES = rows(BodyRows)


class Found(NamedTuple):
    """What is counted: atoms that came from nowhere, how many more there are than before, how many
    are not where they were, and whether one is off its body; then the same of all ranks."""

    came: int
    more: int
    moved: int
    off: int
    all_came: int
    all_more: int
    all_moved: int
    all_off: int


FOUND = Found(*range(8))

# what `follow` does, and what it returns if all is not well
LOCATE, ARRANGE, NOTE, SETTLE, FEWER = 1, 2, 4, 8, 16
CHANGED, OFF = 1, 2  # atoms came or are gone; an atom is not where its body has it

# the bodies are in stretches: rotors, linear bodies and points, of each first those that are whole
STRETCHES = 6


class Atoms(NamedTuple):
    """LAMMPS's atoms on this rank.

    Attributes:
        membership: (natoms,) the ID of the body of each atom, or what `bodies.membership` has
            instead of one.
        groups: (natoms,) the bits of each atom's groups.
        fix_group, body_groups, flexible: masks: an atom that came comes into a body if it has a bit
            of each of the first two, and is flexible if it has one of the third.
        origins: (natoms,) where each atom was: rank << 32 | its place in `index`; if it comes from
            another rank, -2 minus its row in arrived; -1 if it was in no body.
        arrived: what came with atoms from other ranks.
        arrived_cell: (3,) the numbers of its cell: where it is, and its shape.
        atom_x: (natoms, 3).
    """

    membership: L1
    groups: I1
    fix_group: I
    body_groups: I
    flexible: I
    origins: L1
    arrived: F2
    arrived_cell: L1
    atom_x: F2


@inlined
def locate(atoms, bodies, found):
    """Find the atoms of the bodies in LAMMPS's arrays.

    An origin beyond the list of before, or beyond what arrived, counts as none: the atom came.
    """
    count = came = moved = 0
    index, arrived, natoms = (
        ints_in(bodies, BODIES.index),
        atoms.arrived.shape[0],
        atoms.groups.size,
    )
    here, place = new_longs(bodies, BODIES.here, natoms), new_longs(bodies, BODIES.place, natoms)
    for i in range(natoms):
        decided = atoms.membership[i]
        if decided > OUT:
            origin = atoms.origins[i]
            j = origin & 0xFFFFFFFF if origin >= 0 else origin + 1
            if origin == IN_NO_BODY or j >= index.size or -j > arrived:
                came += 1
                continue
            moved += j < 0 or index[j] != i
            here[count], place[count] = i, j
            count += 1
        elif decided == UNDECIDED:
            groups = atoms.groups[i]
            if groups & atoms.flexible or (groups & atoms.fix_group and groups & atoms.body_groups):
                came += 1
    resize(bodies, BODIES.here, count, 1)
    resize(bodies, BODIES.place, count, 1)
    found[FOUND.came], found[FOUND.more] = came, count - index.size
    found[FOUND.moved] = moved + (count != index.size)


# ---------------------------------------------------------------- the order of the passes


@inlined
def of_body(row, b, state, arrived, first):
    """An entry of body b's state: of those of this rank, or those that came with atoms."""
    return (
        state[row, b] if b < state.shape[1] else arrived[first[b - state.shape[1]], OF_BODY + row]
    )


@inlined
def bucket(b, atoms, state, arrived, first):
    """The place of a body with so many atoms here in the order: by stretch, by number of atoms."""
    largest = of_body(MOMENT, b, state, arrived, first)
    third = of_body(MOMENT + 2, b, state, arrived, first)
    stretch = 0 if third > 0.0 else 2 if largest > 0.0 else 4
    if of_body(NATOMS, b, state, arrived, first) > atoms:
        stretch += 1
    return stretch * (LANES + 1) + max(LANES + 1 - atoms, 0)


@inlined
def find_owners(arrived, bodies, sharing):
    """Find the body of each atom that is here: rows `owner` and `first`.

    Atoms that came may have gone on, where a flip of the box sends atoms before LAMMPS does: what
    they have left in `arrived` may be old, and counts for nothing.
    """
    state, body = floats_in(bodies, BODIES.state), longs_in(bodies, BODIES.body)
    place, shared = longs_in(bodies, BODIES.place), longs_in(sharing, SHARING.shared)
    known, n = shared.size, shared.size + arrived.shape[0]
    ids, order = new_longs(bodies, BODIES.ids, n), new_longs(bodies, BODIES.order, n)
    column, owner = new_longs(bodies, BODIES.column, n), new_longs(bodies, BODIES.owner, place.size)
    for i in range(n):
        ids[i] = state[ID, shared[i]] if i < known else arrived[i - known, OF_BODY + ID]
        column[i] = 0 if i < known else GONE_ON
    for j in range(place.size):
        if place[j] < 0:
            column[known - 1 - place[j]] = 0
    sort(order, n, ids, ids)
    resize(bodies, BODIES.first, 0, 1)
    last = -1
    for k in range(n):
        i = order[k]
        if column[i] != GONE_ON:
            if last >= 0 and ids[i] == ids[last]:
                column[i] = column[last]
            elif i < known:
                column[i] = shared[i]
            else:
                column[i] = state.shape[1] + bodies[BODIES.first, LENGTH]
                append(bodies, BODIES.first, i - known)
            last = i
    for j in range(place.size):
        owner[j] = body[place[j]] if place[j] >= 0 else column[known - 1 - place[j]]


@inlined
def number_bodies(arrived, bodies):
    """Number the bodies anew, in the order of `bucket`, and as LAMMPS has their first atoms.

    Row `ends` has where each stretch ends.
    """
    state, owner = floats_in(bodies, BODIES.state), longs_in(bodies, BODIES.owner)
    first, ends = longs_in(bodies, BODIES.first), new_longs(bodies, BODIES.ends, STRETCHES)
    m = state.shape[1] + first.size
    number, order = new_longs(bodies, BODIES.number, m), new_longs(bodies, BODIES.order, m)
    atoms = new_longs(bodies, BODIES.atoms, m)
    buckets = new_longs(bodies, BODIES.buckets, STRETCHES * (LANES + 1) + 1)
    for b in range(m):
        number[b] = 0
    for j in range(owner.size):
        number[owner[j]] += 1  # for now the number of atoms
    for k in range(buckets.size):
        buckets[k] = 0
    for b in range(m):
        if number[b] > 0:
            buckets[bucket(b, number[b], state, arrived, first) + 1] += 1
    for k in range(1, buckets.size):
        buckets[k] += buckets[k - 1]
    for k in range(STRETCHES):
        ends[k] = buckets[(k + 1) * (LANES + 1)]
    for j in range(owner.size):
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
    resize(bodies, BODIES.atoms, ends[STRETCHES - 1], 1)


@inlined
def make_blocks(bodies):
    """Divide the bodies into blocks, and their atoms into rounds; see `block`."""
    atoms, ends = longs_in(bodies, BODIES.atoms), longs_in(bodies, BODIES.ends)
    total, begin, block, turn, entry, stretch = atoms.size, 0, 0, 0, 0, 0
    resize(bodies, BODIES.blocks, total + 1, 3)
    resize(bodies, BODIES.rounds, bodies[BODIES.owner, LENGTH] + 1, 1)
    blocks, rounds = int_rows_in(bodies, BODIES.blocks), ints_in(bodies, BODIES.rounds)
    following = new_longs(bodies, BODIES.following, 2 * total)
    while begin < total:
        while begin >= ends[stretch]:
            stretch += 1
        blocks[block, 0], blocks[block, 1], blocks[block, 2] = begin, turn, stretch % 2 == 0
        end, count = begin + 1, (atoms[begin] + LANES - 1) // LANES
        following[2 * begin], following[2 * begin + 1] = entry, -1
        if atoms[begin] <= LANES:
            end, count = min(begin + LANES, ends[stretch]), atoms[begin]
            for b in range(begin, end):
                following[2 * b], following[2 * b + 1] = turn, b - begin
        lanes = end - begin
        for r in range(count):
            rounds[turn] = entry
            while lanes > 1 and atoms[begin + lanes - 1] <= r:
                lanes -= 1
            entry += lanes if atoms[begin] <= LANES else min(LANES, atoms[begin] - r * LANES)
            turn += 1
        begin = end
        block += 1
    blocks[block, 0], blocks[block, 1], blocks[block, 2] = total, turn, 0
    rounds[turn] = entry
    resize(bodies, BODIES.blocks, block + 1, 3)
    resize(bodies, BODIES.rounds, turn + 1, 1)


@inlined
def place_atoms(bodies):
    """Give each atom its entry of `index`, `source` and `body`."""
    rounds, following = ints_in(bodies, BODIES.rounds), longs_in(bodies, BODIES.following)
    here, owner = longs_in(bodies, BODIES.here), longs_in(bodies, BODIES.owner)
    number, n = longs_in(bodies, BODIES.number), here.size
    resize(bodies, BODIES.index, n, 1)
    index, source = ints_in(bodies, BODIES.index), new_longs(bodies, BODIES.source, n)
    body = new_longs(bodies, BODIES.body, n)
    for j in range(n):
        b = number[owner[j]]
        entry, lane = following[2 * b], following[2 * b + 1]
        if lane >= 0:
            entry = rounds[entry] + lane
        following[2 * b] += 1
        index[entry], source[entry], body[entry] = here[j], j, b


@inlined
def carry_over(arrived, bodies):
    """Copy the bodies and their atoms to the new order."""
    swap(bodies, BODIES.state, BODIES.old_state)
    swap(bodies, BODIES.displace, BODIES.old_displace)
    old_state = floats_in(bodies, BODIES.old_state)
    old_displace = floats_in(bodies, BODIES.old_displace)
    source, place = longs_in(bodies, BODIES.source), longs_in(bodies, BODIES.place)
    order, first = longs_in(bodies, BODIES.order), longs_in(bodies, BODIES.first)
    m, n, height = bodies[BODIES.atoms, LENGTH], source.size, old_state.shape[0]
    resize(bodies, BODIES.state, height, m)
    resize(bodies, BODIES.displace, old_displace.shape[0], n)
    state, displace = floats_in(bodies, BODIES.state), floats_in(bodies, BODIES.displace)
    for row in range(height):
        for b in range(m):
            state[row, b] = of_body(row, order[b], old_state, arrived, first)
    for c in range(displace.shape[0]):
        for j in range(n):
            p = place[source[j]]
            displace[c, j] = old_displace[c, p] if p >= 0 else arrived[-1 - p, OF_BODY + height + c]
    bodies[BODIES.wrench, PLACE] = bodies[BODIES.state, PLACE] + 8 * FORCE * m
    bodies[BODIES.wrench, LENGTH], bodies[BODIES.wrench, WIDTH] = 6, m


@inlined
def arrange(mpi, sharing, arrived, bodies, kinds):
    """Put the bodies of the atoms here in the order of the passes, and find who shares them."""
    find_owners(arrived, bodies, sharing)
    number_bodies(arrived, bodies)
    ends = longs_in(bodies, BODIES.ends)
    kinds.rotors, kinds.turning = ends[1], ends[3]
    make_blocks(bodies)
    place_atoms(bodies)
    carry_over(arrived, bodies)

    state, atoms, asked = floats_in(bodies, BODIES.state), longs_in(bodies, BODIES.atoms), 0
    home, places = (
        new_longs(sharing, SHARING.home, atoms.size),
        new_longs(sharing, SHARING.asked, atoms.size),
    )
    ids, meet = (
        new_longs(sharing, SHARING.ids, atoms.size),
        new_longs(sharing, SHARING.meet, atoms.size),
    )
    for b in range(atoms.size):
        if atoms[b] < state[NATOMS, b]:
            places[asked], ids[asked], meet[asked] = b, state[ID, b], state[HOME, b]
            asked += 1
    for row in (SHARING.asked, SHARING.ids, SHARING.meet):
        resize(sharing, row, asked, 1)
    find(mpi, sharing)
    for b in range(atoms.size):
        state[HOME, b] = home[b]


# ---------------------------------------------------------------- periodic images


@inlined
def settle(layout, bodies, box, atom_x, off):
    """Find which atoms are in other periodic images: see `periodic.find_images`."""
    resize(bodies, BODIES.away, layout.index.size, 1)
    resize(bodies, BODIES.shift, layout.index.size, 3)
    away, shift = ints_in(bodies, BODIES.away), floats_in(bodies, BODIES.shift)
    count = find_images(layout, Images(away, shift), box, atom_x, off)
    resize(bodies, BODIES.away, count, 1)
    resize(bodies, BODIES.shift, count, 3)


@loop
def follow(
    mpi: Mpi,
    sharing: L2,
    atoms: Atoms,
    bodies: L2,
    kinds: Kinds,
    block: F64,
    found: F1,
    box: PeriodicBox,
    off: F1,
    what: I,
) -> I:
    """Be the same bodies after LAMMPS has moved atoms between ranks and in its arrays; collective.

    Args:
        sharing, bodies: tables of memories with `SharingRows` and `BodyRows`.
        kinds, block: see `block.Layout`.
        found: see `Found`.  off: see `periodic.find_images`.
        what: the sum of LOCATE the atoms; ARRANGE the bodies, if some have moved on any rank; NOTE
            where the atoms are now; SETTLE periodic images; FEWER: atoms may be gone.
    Returns:
        0, CHANGED or OFF.
    """
    arranges = what & ARRANGE
    if what & LOCATE:
        locate(atoms, bodies, found)
        mine, all_ranks = found[FOUND.came : FOUND.off], found[FOUND.all_came : FOUND.all_off]
        add_up(mpi, mine, all_ranks)
        changed = found[FOUND.all_more] != 0.0 and not what & FEWER
        if changed or found[FOUND.all_came] != 0.0:
            return CHANGED
        arranges = found[FOUND.all_moved] != 0.0
    if arranges:
        arrange(mpi, sharing, atoms.arrived, bodies, kinds)
    index = ints_in(bodies, BODIES.index)
    if what & NOTE and (arranges or not what & LOCATE):
        for i in range(atoms.origins.size):
            atoms.origins[i] = IN_NO_BODY
        for j in range(index.size):
            atoms.origins[index[j]] = mpi.rank << 32 | j
        atoms.arrived_cell[LENGTH] = 0  # of no more use
    if what & SETTLE:
        state, displace = floats_in(bodies, BODIES.state), floats_in(bodies, BODIES.displace)
        blocks, rounds = int_rows_in(bodies, BODIES.blocks), ints_in(bodies, BODIES.rounds)
        take_into_box(state, box)
        layout = Layout(state, kinds, blocks, rounds, index, displace, block)
        settle(layout, bodies, box, atoms.atom_x, off)
        found[FOUND.off] = not off[0] <= box.near
        add_up(mpi, found[FOUND.off : FOUND.all_came], found[FOUND.all_off :])
        if found[FOUND.all_off] != 0.0:
            return OFF
    return 0
