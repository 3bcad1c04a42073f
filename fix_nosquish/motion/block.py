"""Bodies in blocks: the memory layout of a rank's bodies in the compiled loops.

`state` (rows, bodies) holds the bodies; its rows are named below.  Loops work on blocks of up to
LANES bodies.  `take` copies some rows of a block to an array (rows, LANES), which fits into the
L1 cache.  Each operation is a loop over the lanes, which the compiler vectorises.  `put` copies the
result back, so a pass reads and writes the state once.  A loop always runs over all lanes; unused
lanes are copies of the first body.  A body's result therefore does not depend on its column, and
all ranks that share the body compute the same bits.

The atoms of a block come in rounds: the first atom of each body, then the second atom of each body
that has one, and so on.  Bodies are sorted by their number of atoms, so a round fills the first
lanes of the block.  Bodies with all atoms on this rank and bodies shared with other ranks are in
separate blocks.  A body of more than LANES atoms fills a block alone, with a copy in every lane,
and each of its rounds takes LANES of its atoms.
"""

from typing import Any, NamedTuple

import numpy as np

from ..loops.compiled import F2, F64, I1, I2, LANES, I, inlined, prefetch, record

# rows of `state`, and the first ones of a block: mass, principal moments, centre of mass, velocity,
# quaternion, its momentum, force, torque; number of atoms, image flags, home, ID
MASS, MOMENT, X, V, Q, P, FORCE, TORQUE = 0, 1, 4, 7, 10, 14, 18, 21
NATOMS, IMAGE, HOME, ID, ROWS = 24, 25, 28, 29, 30
# rows of a block: a matrix, an atom's vector, and scratch rows of each loop; rows of `take_names`:
# whether sums count the body, its ID, which components of its velocity and whether its rotation
# are active
MATRIX, ATOM, OWN = 24, 33, 36
COUNTED, NUMBER, FREE, BLOCK_ROWS = 45, 46, 47, 51
LINE = 8  # doubles in a cache line

# kinds of bodies: points, linear bodies, bodies that rotate about z only, rotors with three moments
POINT, LINEAR, PLANAR, ROTOR = range(4)
# bodies: all, those with all atoms on this rank, those with atoms on other ranks, too
ALL, UNSHARED, SHARED = range(3)


# The kind of each body: [0, rotors) have three moments, or one if planar; [rotors, turning) are
# linear; the rest are points. With keyword moments, own_moments is the first of three rows of
# `state`: the square root of each moment divided by that of the atoms. Otherwise it is 0.
Kinds: Any = record("Kinds", rotors=I, turning=I, planar=I, own_moments=I)


class Layout(NamedTuple):
    """A rank's bodies and their atoms, as the loops use them.

    Attributes:
        state: (rows, bodies).  kinds: a record.
        blocks: (blocks + 1, 3) first body and first round of each block, and whether all atoms of
            its bodies are on this rank.
        rounds: (rounds + 1,) first atom of each round, as an entry of index.
        index: (atoms,) index of each atom in LAMMPS's arrays (atoms, 3).
        displace: (4, atoms) position in the body's principal frame, and atom ID.
        block: (BLOCK_ROWS or more, LANES) scratch array.
    """

    state: F2
    kinds: Kinds
    blocks: I2
    rounds: I1
    index: I1
    displace: F2
    block: F64


class Images(NamedTuple):
    """The atoms that LAMMPS stores in another periodic image than their body.

    Attributes:
        away: (k,) entries of `Layout.index`.
        shift: (k, 3) LAMMPS's position minus the position that follows from the body.
    """

    away: I1
    shift: F2


@inlined
def at(i):
    """An index known to be non-negative: numba then omits the test for negative indices."""
    return np.uint64(i)


@inlined
def kind_of(layout, body):
    """The kind of the bodies in the block that begins with this one."""
    if body < layout.kinds.rotors:
        return PLANAR if layout.kinds.planar else ROTOR
    return LINEAR if body < layout.kinds.turning else POINT


@inlined
def fetch_ahead(layout, k, row, until, atoms):
    """Prefetch the data of block k: LAMMPS's force computation has evicted it from the cache."""
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
    """Copy rows [row, until) of block k to rows from `to` on; unused lanes repeat the first."""
    block, begin, end = layout.block, layout.blocks[k, 0], layout.blocks[k + 1, 0]
    for r in range(until - row):
        for b in range(end - begin):
            block[at(to + r), at(b)] = layout.state[at(row + r), at(begin + b)]
        for b in range(end - begin, LANES):
            block[at(to + r), at(b)] = block[at(to + r), 0]


@inlined
def take_names(layout, k, rank, mask):
    """Set the rows COUNTED, NUMBER and FREE of a block.

    NUMBER is the body's ID.  COUNTED is the weight of the body in sums over all ranks: 1.0 on the
    rank that counts it, 0.0 on other ranks and in unused lanes.  FREE is 1.0 for each active
    velocity component, and for a rotation with all torque components active, else 0.0; for the
    mask see `hold`.
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
    """Mask of the active force and torque components of lane b: six numbers, 1.0 or 0.0."""
    last = layout.blocks[k + 1, 0] - 1
    column = min(layout.blocks[k, 0] + b, last) if mask.shape[1] > 1 else 0
    return (
        mask[0, column], mask[1, column], mask[2, column],
        mask[3, column], mask[4, column], mask[5, column],
    )  # fmt: skip


@inlined
def hold(layout, k, mask):
    """Set the inactive components of force and torque to zero in block k.

    The mask, 1.0 or 0.0, is (6, bodies); (6, 1) for all bodies alike; (6, 0) if all are active.
    """
    first, last = layout.blocks[k, 0], layout.blocks[k + 1, 0] - 1
    for row in range(mask.shape[0] if mask.shape[1] else 0):  # a short loop: most runs skip it
        for b in range(LANES):
            layout.block[FORCE + row, b] *= mask[row, min(min(first + b, last), mask.shape[1] - 1)]


@inlined
def put(layout, k, row, until, from_row):
    """Copy the rows from `from_row` on back to rows [row, until) of `state`."""
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
    """Write numbers to lane b of consecutive rows, beginning with this one."""
    for k in range(len(values)):
        block[row + k, b] = values[k]
