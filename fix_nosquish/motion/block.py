"""Bodies in blocks: how the compiled loops lay out a rank's bodies, and take and put them.

`state` (rows, bodies) holds the bodies; its rows are named below.  Loops work on blocks of up to
LANES bodies.  `take` copies some rows of a block to an array (rows, LANES), small enough to stay in
the processor's nearest cache.  Each step of the mathematics is a loop over the lanes, which the
compiler vectorises.  `put` copies the result back, so a pass reads and writes the state once.  A
loop always does all lanes; those behind the last body are copies of the first.  So a body's result
does not depend on its place, and all ranks that hold it get the same bits.

The atoms of a block come in rounds: first the first atom of each of its bodies, then the second of
each that has a second, and so on.  Bodies are ordered by their number of atoms, so a round is the
first lanes of the block.  Bodies of which all atoms are this rank's are in other blocks than those
that other ranks have atoms of.  A body of more than LANES atoms is a block by itself, in all lanes,
and each of its rounds takes LANES of its atoms.
"""

from typing import NamedTuple

import numpy as np

from ..loops.compiled import F2, F64, I1, I2, LANES, I, inlined, prefetch, record

# rows of `state`, and the first ones of a block: mass, principal moments, centre of mass, velocity,
# quaternion, its momentum, force, torque; number of atoms, image flags, home, ID
MASS, MOMENT, X, V, Q, P, FORCE, TORQUE = 0, 1, 4, 7, 10, 14, 18, 21
NATOMS, IMAGE, HOME, ID, ROWS = 24, 25, 28, 29, 30
# rows of a block: a matrix, an atom's vector, and what each loop needs for itself; those of
# `take_names`: whether a body counts, its ID, which of its velocities and whether its rotation are
# free to change
MATRIX, ATOM, OWN = 24, 33, 36
COUNTED, NUMBER, FREE, BLOCK_ROWS = 45, 46, 47, 51
LINE = 8  # numbers that the processor fetches at a time

# kinds of bodies: single atoms, linear bodies, those that turn in a plane only, those with three
# moments
POINT, LINEAR, PLANAR, ROTOR = range(4)
ALL, WHOLE, DIVIDED = range(3)  # parts of the bodies: all, those with all atoms here, the others


# Which bodies are of which kind: [0, rotors) have three moments, or one if all turn in a plane;
# [rotors, turning) are linear; the rest are points. If their moments are chosen (keyword moments),
# own_moments is the first of three rows: the root of each principal moment over that of the atoms.
# Else it is 0.
Kinds = record("Kinds", rotors=I, turning=I, planar=I, own_moments=I)


class Layout(NamedTuple):
    """Where a rank's bodies and their atoms are.

    Attributes:
        state: (rows, bodies).  kinds: a record.
        blocks: (blocks + 1, 3) each block's first body, its first round, and whether all atoms of
            its bodies are this rank's.
        rounds: (rounds + 1,) each round's first atom, as an entry of index.
        index: (atoms,) where LAMMPS has the atom in its arrays, which are (atoms, 3).
        displace: (4, atoms) its place in the body's principal frame, and its ID.
        block: (BLOCK_ROWS or more, LANES) to work with.
    """

    state: F2
    kinds: Kinds
    blocks: I2
    rounds: I1
    index: I1
    displace: F2
    block: F64


class Images(NamedTuple):
    """The atoms that LAMMPS has in another periodic image than their body.

    Attributes:
        away, shift: entries of index, and the vector (3,) from where the body has the atom.
    """

    away: I1
    shift: F2


@inlined
def at(i):
    """An index that is not negative: numba need not look whether to count from the end."""
    return np.uint64(i)


@inlined
def kind_of(layout, body):
    """The kind of the bodies in the block that begins with this one."""
    if body < layout.kinds.rotors:
        return PLANAR if layout.kinds.planar else ROTOR
    return LINEAR if body < layout.kinds.turning else POINT


@inlined
def fetch_ahead(layout, k, row, until, atoms):
    """Have the processor fetch what a pass needs of block k: LAMMPS's forces drove it out."""
    blocks, rounds = layout.blocks, layout.rounds
    if k < blocks.shape[0] - 1:
        for b in range(blocks[k, 0], blocks[k + 1, 0], LINE):
            for r in range(row, until):
                prefetch(layout.state, r, b)
        begin, end = rounds[blocks[k, 1]], rounds[blocks[k + 1, 1]]
        for j in range(begin, end, LINE):
            for c in range(3):
                prefetch(layout.displace, c, j)
        for j in range(begin, end):
            prefetch(atoms, layout.index[at(j)], 0)


@inlined
def take(layout, k, row, until, to):
    """Copy rows of block k to those from `to` on; lanes behind the last body repeat the first."""
    block, begin, end = layout.block, layout.blocks[k, 0], layout.blocks[k + 1, 0]
    for r in range(until - row):
        for b in range(end - begin):
            block[at(to + r), at(b)] = layout.state[at(row + r), at(begin + b)]
        for b in range(end - begin, LANES):
            block[at(to + r), at(b)] = block[at(to + r), 0]


@inlined
def take_names(layout, k, rank, mask):
    """Have the bodies' IDs in row NUMBER, and in row COUNTED what sums over all bodies on all ranks
    multiply by: 1.0 where a body counts, 0.0 for other ranks' and for the lanes behind the last.

    Rows FREE have 1.0 for each component of the velocity that a force changes, and for a rotation
    that any torque changes, else 0.0; mask is as in `hold`.
    """
    block, bodies = layout.block, layout.blocks[k + 1, 0] - layout.blocks[k, 0]
    take(layout, k, HOME, ID + 1, COUNTED)
    for b in range(LANES):
        block[COUNTED, b] = 1.0 if b < bodies and block[COUNTED, b] == rank else 0.0
        write(block, FREE, b, (1.0, 1.0, 1.0, 1.0))
        if mask.size:
            fx, fy, fz, tx, ty, tz = _acting(layout, k, b, mask)
            write(block, FREE, b, (fx, fy, fz, tz if layout.kinds.planar else tx * ty * tz))


@inlined
def _acting(layout, k, b, mask):
    """What of force and torque moves the body in lane b of block k: six numbers, 1.0 or 0.0."""
    last = layout.blocks[k + 1, 0] - 1
    column = min(layout.blocks[k, 0] + b, last) if mask.shape[1] > 1 else 0
    return (
        mask[0, column], mask[1, column], mask[2, column],
        mask[3, column], mask[4, column], mask[5, column],
    )  # fmt: skip


@inlined
def hold(layout, k, mask):
    """Leave in block k only those components of force and torque that move the bodies.

    The mask of these, 1.0 or 0.0, is (6, bodies), or (6, 1) for all alike, or (6, 0) if all do.
    """
    first, last = layout.blocks[k, 0], layout.blocks[k + 1, 0] - 1
    for row in range(mask.shape[0] if mask.shape[1] else 0):  # a short loop: most runs skip it
        for b in range(LANES):
            layout.block[FORCE + row, b] *= mask[row, min(min(first + b, last), mask.shape[1] - 1)]


@inlined
def put(layout, k, row, until, from_row):
    """Copy rows of block k back, from those from `from_row` on."""
    begin, end = layout.blocks[k, 0], layout.blocks[k + 1, 0]
    for r in range(until - row):
        for b in range(end - begin):
            layout.state[at(row + r), at(begin + b)] = layout.block[at(from_row + r), at(b)]


@inlined
def three(block, row, b):
    """Three rows of lane b."""
    return block[row, b], block[row + 1, b], block[row + 2, b]


@inlined
def four(block, row, b):
    """Four rows of lane b."""
    return block[row, b], block[row + 1, b], block[row + 2, b], block[row + 3, b]


@inlined
def nine(block, row, b):
    """Nine rows of lane b."""
    return three(block, row, b) + three(block, row + 3, b) + three(block, row + 6, b)


@inlined
def write(block, row, b, values):
    """Write numbers to the rows of lane b from this one on."""
    for k in range(len(values)):
        block[row + k, b] = values[k]
