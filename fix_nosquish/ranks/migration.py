"""Migration: bodies follow their atoms, which LAMMPS moves between ranks and in its arrays.

`plugin/exchange.h` writes the rows of `arrived`, or with LAMMPS's own fix `host.own_fix`.
"""

from typing import NamedTuple

from ..loops.compiled import F1, F2, F64, I1, L1, L2, I, inlined, loop
from ..loops.memory import (
    CAPACITY,
    ITEMSIZE,
    LENGTH,
    floats_in,
    int_rows_in,
    ints_in,
    longs_in,
    new_longs,
    resize,
)
from ..motion.block import HOME, ID, NATOMS, Images, Kinds, Layout
from ..motion.periodic import PeriodicBox, find_images, take_into_box
from ..structs import IN_NO_BODY, OUT, UNDECIDED
from .arrangement import BODIES, arrange
from .mpi import Mpi, add_up
from .sharing import SHARING, find


class Counts(NamedTuple):
    """Entries of the argument `counts` of `follow`: of this rank, then summed over all ranks.

    Attributes:
        new: number of atoms without an origin.
        more: change of the number of atoms in bodies.
        moved: number of atoms with a new index or rank.
        off: 1 if an atom is not at its position in its body.
    """

    new: int
    more: int
    moved: int
    off: int
    all_new: int
    all_more: int
    all_moved: int
    all_off: int


COUNTS = Counts(*range(8))

# bits of the argument `what` of `follow`, and its return values if it fails
LOCATE, ARRANGE, NOTE, SETTLE, FEWER = 1, 2, 4, 8, 16
CHANGED, OFF = 1, 2  # atoms were added or deleted; an atom is not at its position in its body


class Atoms(NamedTuple):
    """LAMMPS's atoms on this rank.

    Attributes:
        membership: (natoms,) body ID of each atom, or UNDECIDED or OUT.
        groups: (natoms,) group bits of each atom.
        fix_group, body_groups, flexible: group masks: a new atom belongs to a body if it has a bit
            of each of the first two, and is flexible if it has a bit of the third.
        origins: (natoms,) rank << 32 | entry of index at the last NOTE; -2 minus its row of
            `arrived` for an atom from another rank; IN_NO_BODY.
        arrived: rows that arrived with atoms from other ranks, see `arrangement.OF_BODY`.
        arrived_cell: (3,) the numbers of the cell of `arrived`.
        atom_x: (natoms, 3) positions.
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
def locate(atoms, bodies, counts):
    """Find the atoms of the bodies in LAMMPS's arrays.

    An atom whose origin is out of range counts as new.
    """
    count = new = moved = 0
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
                new += 1
                continue
            moved += j < 0 or index[j] != i
            here[count], place[count] = i, j
            count += 1
        elif decided == UNDECIDED:
            groups = atoms.groups[i]
            if groups & atoms.flexible or (groups & atoms.fix_group and groups & atoms.body_groups):
                new += 1
    resize(bodies, BODIES.here, count, 1)
    resize(bodies, BODIES.place, count, 1)
    counts[COUNTS.new], counts[COUNTS.more] = new, count - index.size
    counts[COUNTS.moved] = moved + (count != index.size)


@inlined
def find_sharers(mpi, sharing, bodies):
    """Find which ranks share the bodies of this rank; collective."""
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
    """Find the atoms in other periodic images: see `periodic.find_images`."""
    count = (
        bodies[BODIES.away, CAPACITY] // bodies[BODIES.away, ITEMSIZE]
    )  # start with the capacity: few atoms are in other images
    while True:
        resize(bodies, BODIES.away, count, 1)
        resize(bodies, BODIES.shift, count, 3)
        away, shift = ints_in(bodies, BODIES.away), floats_in(bodies, BODIES.shift)
        count = find_images(layout, Images(away, shift), box, atom_x, off)
        if count <= away.size:
            break
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
    counts: F1,
    box: PeriodicBox,
    off: F1,
    what: I,
) -> I:
    """Follow the atoms after LAMMPS has moved them between ranks and in its arrays; collective.

    Args:
        sharing, bodies: tables of memories with `SharingRows` and `arrangement.BodyRows`.
        kinds, block: see `block.Layout`.
        counts: see `Counts`.
        off: see `periodic.find_images`.
        what: the sum of
            LOCATE: find the atoms, and sort the bodies if an atom of any rank has moved;
            ARRANGE: sort the bodies;
            NOTE: set the origins of the atoms;
            SETTLE: wrap the bodies into the box, and find the periodic images of atoms;
            FEWER: accept that atoms were deleted.
    Returns:
        0, CHANGED or OFF.
    """
    arranges = what & ARRANGE
    if what & LOCATE:
        locate(atoms, bodies, counts)
        sums = counts[COUNTS.all_new : COUNTS.all_off]
        add_up(mpi, counts[COUNTS.new : COUNTS.off], sums)
        changed = counts[COUNTS.all_more] != 0.0 and not what & FEWER
        if changed or counts[COUNTS.all_new] != 0.0:
            return CHANGED
        arranges = counts[COUNTS.all_moved] != 0.0
    if arranges:
        arrange(atoms.arrived, bodies, sharing, kinds)
        find_sharers(mpi, sharing, bodies)
    index = ints_in(bodies, BODIES.index)
    if what & NOTE and (arranges or not what & LOCATE):
        for i in range(atoms.origins.size):
            atoms.origins[i] = IN_NO_BODY
        for j in range(index.size):
            atoms.origins[index[j]] = mpi.rank << 32 | j
        atoms.arrived_cell[LENGTH] = 0  # its rows are in state and displace now
    if what & SETTLE:
        state, displace = floats_in(bodies, BODIES.state), floats_in(bodies, BODIES.displace)
        blocks, rounds = int_rows_in(bodies, BODIES.blocks), ints_in(bodies, BODIES.rounds)
        take_into_box(state, box)
        layout = Layout(state, kinds, blocks, rounds, index, displace, block)
        settle(layout, bodies, box, atoms.atom_x, off)
        counts[COUNTS.off] = not off[0] <= box.near
        add_up(mpi, counts[COUNTS.off : COUNTS.all_new], counts[COUNTS.all_off :])
        if counts[COUNTS.all_off] != 0.0:
            return OFF
    return 0
