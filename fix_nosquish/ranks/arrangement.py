"""The order of a rank's bodies and atoms: sorted, in blocks, with the atoms in rounds.

See `motion.block` for what this order is for.  It changes when atoms come or go: bodies that are
new on this rank are in rows that arrived with their atoms.
"""

from typing import NamedTuple

from ..loops.compiled import F2, I1, I2, L1, inlined
from ..loops.memory import (
    ADDRESS,
    LENGTH,
    WIDTH,
    append,
    floats_in,
    int_rows_in,
    ints_in,
    longs_in,
    new_longs,
    resize,
    rows,
)
from ..motion.block import FORCE, ID, LANES, MOMENT, NATOMS, at
from .sharing import SHARING, argsort

GONE_ON = -1  # for a row of `arrived`: its atom has left this rank again
# a row of `arrived`: an atom's origin, its body's column of `state`, its column of `displace`
OF_BODY = 1
# the order of bodies: rotors, linear bodies, points; in each kind, shared bodies come last
STRETCHES = 6


class BodyRows(NamedTuple):
    """Rows of the memory of the bodies.

    Attributes:
        state, displace, blocks, rounds, index: see `block.Layout`.
        away, shift: see `block.Images`.
        wrench: (6, bodies) force and torque, a view of rows of state.
        body: (atoms,) body of each atom, in the order of index.
        atoms: (bodies,) number of each body's atoms on this rank.
        here, place: (found,) atoms of bodies on this rank, in LAMMPS's order, and the previous
            entry of index of each, or -1 minus its row of `arrived`.
        old_body: (found,) body of each: a column of the previous state, or, for a body that is new
            on this rank, the number of these columns plus its entry of first.
        first: (new,) a row of `arrived` for each new body.
        number, order: new column of each of these bodies, and the inverse permutation.
        source: (atoms,) previous entry of index of each atom, or -1 minus its row of `arrived`.
        line: (1, columns) scratch: a row of the previous state or displace.
        ids, column: (shared + arrived,) ID, and body as in old_body, of the previously shared
            bodies and of the rows of `arrived`.
        next_place: (2 * bodies,) next round of each body and its lane there; for a body that fills
            a block alone, its next entry of index and -1.
        buckets, ends: scratch.
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
    old_body: L1
    first: L1
    number: L1
    order: L1
    source: L1
    line: F2
    ids: L1
    column: L1
    next_place: L1
    buckets: L1
    ends: L1


BODIES = rows(BodyRows)


@inlined
def of_body(row, b, state, arrived, first):
    """An entry of the state of body b, from `state` or, for a new body, from `arrived`."""
    return (
        state[row, b] if b < state.shape[1] else arrived[first[b - state.shape[1]], OF_BODY + row]
    )


@inlined
def bucket(b, atoms, state, arrived, first):
    """The sort key of a body: by stretch, then by number of atoms, largest first."""
    largest = of_body(MOMENT, b, state, arrived, first)
    third = of_body(MOMENT + 2, b, state, arrived, first)
    stretch = 0 if third > 0.0 else 2 if largest > 0.0 else 4
    if of_body(NATOMS, b, state, arrived, first) > atoms:
        stretch += 1
    return stretch * (LANES + 1) + max(LANES + 1 - atoms, 0)


@inlined
def find_bodies_of_atoms(arrived, bodies, sharing):
    """Find the body of each atom on this rank: rows `old_body` and `first`.

    Rows of `arrived` whose atoms have left again are ignored, because they may be outdated.  This
    occurs when a flip of the box moves atoms before LAMMPS does.
    """
    state, body = floats_in(bodies, BODIES.state), longs_in(bodies, BODIES.body)
    place, shared = longs_in(bodies, BODIES.place), longs_in(sharing, SHARING.shared)
    known, n = shared.size, shared.size + arrived.shape[0]
    ids, order = new_longs(bodies, BODIES.ids, n), new_longs(bodies, BODIES.order, n)
    column = new_longs(bodies, BODIES.column, n)
    old_body = new_longs(bodies, BODIES.old_body, place.size)
    for i in range(n):
        ids[i] = state[ID, shared[i]] if i < known else arrived[i - known, OF_BODY + ID]
        column[i] = 0 if i < known else GONE_ON
    for j in range(place.size):
        if place[j] < 0:
            column[known - 1 - place[j]] = 0
    argsort(order, n, ids, ids)
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
        old_body[j] = body[place[j]] if place[j] >= 0 else column[known - 1 - place[j]]


@inlined
def number_bodies(arrived, bodies):
    """Number the bodies in the order of `bucket`, then of their first atoms in LAMMPS's arrays.

    Row `ends` gets the end of each stretch.
    """
    state, old_body = floats_in(bodies, BODIES.state), longs_in(bodies, BODIES.old_body)
    first, ends = longs_in(bodies, BODIES.first), new_longs(bodies, BODIES.ends, STRETCHES)
    m = state.shape[1] + first.size
    number, order = new_longs(bodies, BODIES.number, m), new_longs(bodies, BODIES.order, m)
    atoms = new_longs(bodies, BODIES.atoms, m)
    buckets = new_longs(bodies, BODIES.buckets, STRETCHES * (LANES + 1) + 1)
    for b in range(m):
        number[b] = 0
    for j in range(old_body.size):
        number[old_body[j]] += 1  # for now the number of atoms
    for k in range(buckets.size):
        buckets[k] = 0
    for b in range(m):
        if number[b] > 0:
            buckets[bucket(b, number[b], state, arrived, first) + 1] += 1
    for k in range(1, buckets.size):
        buckets[k] += buckets[k - 1]
    for k in range(STRETCHES):
        ends[k] = buckets[(k + 1) * (LANES + 1)]
    for j in range(old_body.size):
        b = old_body[j]
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
    """Divide the bodies into blocks, and their atoms into rounds: see `block.Layout`."""
    atoms, ends = longs_in(bodies, BODIES.atoms), longs_in(bodies, BODIES.ends)
    total, begin, block, turn, entry, stretch = atoms.size, 0, 0, 0, 0, 0
    resize(bodies, BODIES.blocks, total + 1, 3)
    resize(bodies, BODIES.rounds, bodies[BODIES.old_body, LENGTH] + 1, 1)
    blocks, rounds = int_rows_in(bodies, BODIES.blocks), ints_in(bodies, BODIES.rounds)
    next_place = new_longs(bodies, BODIES.next_place, 2 * total)
    while begin < total:
        while begin >= ends[stretch]:
            stretch += 1
        blocks[block, 0], blocks[block, 1], blocks[block, 2] = begin, turn, stretch % 2 == 0
        end, count = begin + 1, (atoms[begin] + LANES - 1) // LANES
        next_place[2 * begin], next_place[2 * begin + 1] = entry, -1
        if atoms[begin] <= LANES:
            end, count = min(begin + LANES, ends[stretch]), atoms[begin]
            for b in range(begin, end):
                next_place[2 * b], next_place[2 * b + 1] = turn, b - begin
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
def fill_index(bodies):
    """Set the rows `index`, `source` and `body`."""
    rounds, next_place = ints_in(bodies, BODIES.rounds), longs_in(bodies, BODIES.next_place)
    here, old_body = longs_in(bodies, BODIES.here), longs_in(bodies, BODIES.old_body)
    number, n = longs_in(bodies, BODIES.number), here.size
    resize(bodies, BODIES.index, n, 1)
    index, source = ints_in(bodies, BODIES.index), new_longs(bodies, BODIES.source, n)
    body = new_longs(bodies, BODIES.body, n)
    for j in range(n):
        b = number[old_body[j]]
        entry, lane = next_place[2 * b], next_place[2 * b + 1]
        if lane >= 0:
            entry = rounds[entry] + lane
        next_place[2 * b] += 1
        index[entry], source[entry], body[entry] = here[j], j, b


@inlined
def reorder(bodies, array, columns, n, arrived, begin):
    """Permute the columns of an array in place, row by row.

    The number of columns may change.  If it grows, the last row is done first, so that each row is
    read before it is overwritten.

    Args:
        array: a row of the memory.
        columns: (n,) old column of each new one, or -1 minus a row of arrived.
        n: new number of columns.
        begin: column of arrived at which the array's entries begin.
    """
    height, before = bodies[array, LENGTH], bodies[array, WIDTH]
    resize(bodies, BODIES.line, 1, before)
    resize(bodies, array, 1, height * max(before, n))
    line, values = floats_in(bodies, BODIES.line), floats_in(bodies, array)
    for k in range(height):
        row = k if n <= before else height - 1 - k
        for c in range(before):
            line[0, at(c)] = values[0, at(row * before + c)]
        for b in range(n):
            c, new = columns[b], at(row * n + b)
            values[0, new] = line[0, at(c)] if c >= 0 else arrived[-1 - c, begin + row]
    resize(bodies, array, height, n)


@inlined
def carry_over(arrived, bodies):
    """Permute the columns of state and displace into the new order."""
    source, place = longs_in(bodies, BODIES.source), longs_in(bodies, BODIES.place)
    order, first = longs_in(bodies, BODIES.order), longs_in(bodies, BODIES.first)
    m, n = bodies[BODIES.atoms, LENGTH], source.size
    height, known = bodies[BODIES.state, LENGTH], bodies[BODIES.state, WIDTH]
    for b in range(m):
        if order[b] >= known:
            order[b] = -1 - first[order[b] - known]
    for j in range(n):
        source[j] = place[source[j]]
    reorder(bodies, BODIES.state, order, m, arrived, OF_BODY)
    reorder(bodies, BODIES.displace, source, n, arrived, OF_BODY + height)
    bodies[BODIES.wrench, ADDRESS] = bodies[BODIES.state, ADDRESS] + 8 * FORCE * m
    bodies[BODIES.wrench, LENGTH], bodies[BODIES.wrench, WIDTH] = 6, m


@inlined
def arrange(arrived, bodies, sharing, kinds):
    """Sort the bodies and atoms of this rank, with those in rows of `arrived`."""
    find_bodies_of_atoms(arrived, bodies, sharing)
    number_bodies(arrived, bodies)
    ends = longs_in(bodies, BODIES.ends)
    kinds.rotors, kinds.turning = ends[1], ends[3]
    make_blocks(bodies)
    fill_index(bodies)
    carry_over(arrived, bodies)
