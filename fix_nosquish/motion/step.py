"""The passes of a step over a rank's bodies, generated from an integrator's splitting."""

from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import NamedTuple

from ..errors import refuse
from ..loops.compiled import F2, F, I, Kind, Loop, contracted, inlined, loop, untyped
from ..loops.registry import INLINED
from .block import (
    ALL,
    ATOM,
    BLOCK_ROWS,
    FORCE,
    LANES,
    MASS,
    MATRIX,
    MOMENT,
    ROWS,
    SHARED,
    TORQUE,
    UNSHARED,
    Images,
    Layout,
    P,
    Q,
    V,
    X,
    at,
    fetch_ahead,
    four,
    hold,
    kind_of,
    nine,
    put,
    take,
    take_names,
    three,
    write,
)  # fmt: skip
from .frames import (
    angular_momentum,
    angular_velocity,
    quaternion_momentum,
    rotation_matrix,
    to_space,
)

# ---------------------------------------------------------------- atoms and their bodies


@inlined
def rotation_matrices(block):
    """Matrices from an atom's displacement (principal frame) to its position about the centre."""
    for b in range(LANES):
        write(block, MATRIX, b, rotation_matrix(four(block, Q, b)))


@inlined
def velocity_matrices(block):
    """Matrices from the displacement to the velocity about the centre: rotation times omega x."""
    for b in range(LANES):
        q, (i1, i2, i3) = four(block, Q, b), three(block, MOMENT, b)
        w1, w2, w3 = angular_velocity(q, four(block, P, b), i1, i2, i3)
        r = rotation_matrix(q)
        write(block, MATRIX, b, (
            w3 * r[1] - w2 * r[2], w1 * r[2] - w3 * r[0], w2 * r[0] - w1 * r[1],
            w3 * r[4] - w2 * r[5], w1 * r[5] - w3 * r[3], w2 * r[3] - w1 * r[4],
            w3 * r[7] - w2 * r[8], w1 * r[8] - w3 * r[6], w2 * r[6] - w1 * r[7],
        ))  # fmt: skip


@inlined
def show_atoms_moments(layout, k):
    """With keyword moments, set the block to the atoms' moments, and p to the same kinetic energy:
    the velocities of the atoms then have the correct distribution."""
    block, row = layout.block, layout.kinds.own_moments
    if row > 0:
        take(layout, k, row, row + 3, ATOM)
        for b in range(LANES):
            q, (s1, s2, s3) = four(block, Q, b), three(block, ATOM, b)
            l1, l2, l3 = angular_momentum(q, four(block, P, b))
            write(block, P, b, quaternion_momentum(q, l1 / s1, l2 / s2, l3 / s3))
            i1, i2, i3 = three(block, MOMENT, b)
            write(block, MOMENT, b, (i1 / (s1 * s1), i2 / (s2 * s2), i3 / (s3 * s3)))


@inlined
def displaced(block, b, displace, j):
    """The matrix of lane b times the displacement of atom j."""
    return to_space(
        nine(block, MATRIX, b), displace[0, at(j)], displace[1, at(j)], displace[2, at(j)]
    )


@contracted
def apply_matrices(block, row, begin, end, displace):
    """The vector in rows `row` plus the matrix times the displacement, for the atoms of a round."""
    for b in range(end - begin):
        x, y, z = three(block, row, b)
        dx, dy, dz = displaced(block, b, displace, begin + b)
        write(block, ATOM, b, (x + dx, y + dy, z + dz))


@inlined
def write_atoms(layout, k, row, atoms):
    """Write the vector in rows `row` plus matrix times displacement for each atom of block k."""
    blocks, rounds, block = layout.blocks, layout.rounds, layout.block
    for r in range(blocks[k, 1], blocks[k + 1, 1]):
        j = rounds[r]
        apply_matrices(block, row, j, rounds[r + 1], layout.displace)
        for b in range(rounds[r + 1] - j):
            i = at(layout.index[at(j + b)])
            for c in range(3):
                atoms[i, c] = block[ATOM + c, b]


@inlined
def move_to_images(layout, images, atom_x):
    """Shift atoms to the periodic image in which LAMMPS stores them, if it is not their body's."""
    for a in range(images.away.size):
        for c in range(3):
            atom_x[layout.index[images.away[a]], c] += images.shift[a, c]


@contracted
def add_forces(block, begin, end, displace):
    """Add the forces of the atoms of a round, and their torques about the centre of mass."""
    for b in range(end - begin):
        fx, fy, fz = three(block, ATOM, b)
        dx, dy, dz = displaced(block, b, displace, begin + b)
        sx, sy, sz = three(block, FORCE, b)
        tx, ty, tz = three(block, TORQUE, b)
        write(block, FORCE, b, (sx + fx, sy + fy, sz + fz))
        write(
            block, TORQUE, b,
            (tx + (dy * fz - dz * fy), ty + (dz * fx - dx * fz), tz + (dx * fy - dy * fx)),
        )  # fmt: skip


@inlined
def gather_block(layout, k, atom_f):
    """Sum force and torque over the atoms of block k; returns the number of bodies with non-finite
    sums."""
    blocks, rounds, block = layout.blocks, layout.rounds, layout.block
    for row in range(FORCE, TORQUE + 3):
        for b in range(LANES):
            block[row, b] = 0.0
    for r in range(blocks[k, 1], blocks[k + 1, 1]):
        j = rounds[r]
        for b in range(rounds[r + 1] - j):
            i = at(layout.index[at(j + b)])
            for c in range(3):
                block[ATOM + c, b] = atom_f[i, c]
        add_forces(block, j, rounds[r + 1], layout.displace)
    bodies = blocks[k + 1, 0] - blocks[k, 0]
    if bodies == 1:  # a large body's atoms are spread over the lanes: sum these, copy to all lanes
        for row in range(FORCE, TORQUE + 3):
            for b in range(1, LANES):
                block[row, 0] += block[row, b]
            for b in range(1, LANES):
                block[row, b] = block[row, 0]
    wrong = 0
    for b in range(bodies):
        (fx, fy, fz), (tx, ty, tz) = three(block, FORCE, b), three(block, TORQUE, b)
        if not 0.0 * (fx + fy + fz + tx + ty + tz) == 0.0:
            wrong += 1
    return wrong


@loop
def gather(layout: Layout, atom_f: F2, part: I) -> I:
    """Sum force and torque (space frame, about the centre of mass) over this rank's atoms.

    Args:
        part: of the bodies: ALL or SHARED.
    Returns:
        the number of bodies with non-finite sums.
    """
    wrong = 0
    for k in range(layout.blocks.shape[0] - 1):
        if layout.blocks[k, 2] and part == SHARED:
            continue
        fetch_ahead(layout, k + 1, Q, Q + 4, atom_f)
        take(layout, k, Q, Q + 4, Q)
        rotation_matrices(layout.block)
        wrong += gather_block(layout, k, atom_f)
        put(layout, k, FORCE, TORQUE + 3, FORCE)
    return wrong


@loop
def set_velocities(layout: Layout, atom_v: F2):
    """Write the velocities v + omega x r of the bodies' atoms."""
    for k in range(layout.blocks.shape[0] - 1):
        take(layout, k, MOMENT, P + 4, MOMENT)
        show_atoms_moments(layout, k)
        velocity_matrices(layout.block)
        write_atoms(layout, k, V, atom_v)


# ---------------------------------------------------------------- from a splitting to its loops

# whether `advance` only uses the force and torque that it gathers, or also stores them in `state`
DROPS, KEEPS = 1, 2


class Operation(NamedTuple):
    """The meaning of a letter of a splitting.

    Attributes:
        does: an inlined function (block, kind, dt, parameters); see `operations`.
        moves: whether it changes positions or orientations, so that forces must be recomputed.
        prepared: whether the integrator's loop `prepares` sets parameters for it once a step.  Such
            a letter may occur once, between the first and the last letter that moves bodies.
        measures: function like `does` that sums over all bodies what `prepares` needs, or None.
            With it the step is two passes over the bodies, with `prepares` between them.
        exact: whether it rotates bodies exactly where parameters.mrot is EXACT; see `operations`.
        named: whether it may read the rows COUNTED, NUMBER and FREE, see `block.take_names`.
    """

    does: Callable
    moves: bool = False
    prepared: bool = False
    measures: Callable | None = None
    exact: bool = False
    named: bool = True


class Stages(NamedTuple):
    """A splitting as functions (block, kind, dt, parameters).

    `lead` is before the first letter that moves bodies, `middle` from there to the forces, in one
    or two passes, `tail` after the forces.  The flags say whether `tail` moves bodies, whether an
    operation is `prepared`, and whether one is `named`.
    """

    lead: Callable
    middle: tuple[Callable, ...]
    tail: Callable
    tail_moves: bool
    prepared: bool
    named: bool


@inlined
def nothing(block, kind, dt, parameters):
    """The operation that does nothing."""


FORCES = "F"  # where LAMMPS computes them


def stages(splitting: str, operations: Mapping[str, Operation]) -> Stages:
    """The three stages of a step.

    Args:
        splitting: letters separated by spaces, such as "B A B".  A letter that occurs n times
            advances by dt / n each time.  Forces are computed at the letter F, or, without one,
            after the last letter that moves bodies.
        operations: the `Operation` of each letter.
    Raises:
        RunError: for a letter without an operation; for an operation of the letter F, or one that
            is not inlined; if no letter moves bodies; for a prepared letter that occurs twice, or
            is not between the letters that move bodies.
    """
    letters = splitting.split()
    _check_letters(splitting, letters, operations)
    operations = {**operations, FORCES: Operation(nothing, named=False)}
    steps = [operations[letter] for letter in letters]
    movers = [k for k, operation in enumerate(steps) if operation.moves]
    refuse(not movers, f"splitting {splitting!r}: none of its operations moves the bodies")
    cut = letters.index(FORCES) if FORCES in letters else movers[-1] + 1
    first = min(movers[0], cut)
    prepared = [k for k, operation in enumerate(steps) if operation.prepared]
    refuse(
        len(prepared) > 1 or not all(first <= k < cut for k in prepared),
        f"splitting {splitting!r}: a prepared letter may occur once, not before the first letter "
        "that moves bodies, nor after the last",
    )
    shares = (*((operations[letter].does, 1.0 / letters.count(letter)) for letter in letters),)
    middle: tuple[Callable, ...] = (_chain(shares[first:cut]),)
    for k in prepared:
        if measures := steps[k].measures:
            middle = _chain((*shares[first:k], (measures, 1.0))), _chain(shares[k:cut])
    return Stages(
        _chain(shares[:first]), middle, _chain(shares[cut:]),
        any(operation.moves for operation in steps[cut:]), bool(prepared),
        any(operation.named for operation in steps),
    )  # fmt: skip


def _check_letters(splitting: str, letters: list[str], operations: Mapping[str, Operation]) -> None:
    """Raise an error for invalid letters or operations; see `stages`."""
    refuse(
        FORCES in operations,
        f"the letter {FORCES} stands for the forces in a splitting: give the operation another",
    )
    for letter in letters:
        refuse(
            letter not in (*operations, FORCES),
            f"splitting {splitting!r}: there is no operation {letter}, "
            f"only {', '.join(operations)}",
        )
    for letter, operation in operations.items():
        refuse(
            operation.does not in INLINED,
            f"the function {operation.does.__name__} of operation {letter} is not marked "
            "@inlined, as it and all that it calls must be",
        )


@cache  # so that each chain is compiled once
def _chain(parts: tuple[tuple[Callable, float], ...]) -> Callable:
    """The composition of several functions, each for its share of dt."""
    if not parts:
        return nothing
    (does, share), *rest = parts
    others = _chain(tuple(rest))

    @inlined
    def part(block, kind, dt, parameters):
        does(block, kind, share * dt, parameters)

    @inlined
    def chain(block, kind, dt, parameters):
        does(block, kind, share * dt, parameters)
        others(block, kind, dt, parameters)

    return chain if rest else part


class Scheme:
    """A step, and its loops.

    Args:
        owner: the module that the loops belong to, and the prefix of their names.
        splitting, operations: see `stages`.
        numbers, rows, starts, work: see `integrator.Integrator`.
        ends: lead and tail of another step, to use instead.

    Attributes:
        advance, go_on, lead, tail, start: see there.
        prepared: whether a loop must set parameters in each step.
    """

    def __init__(
        self,
        owner: tuple[str, str],
        splitting: str,
        operations: Mapping[str, Operation],
        numbers: Kind,
        rows: int = 0,
        starts: Callable | None = None,
        work: int = 0,
        ends: tuple[Loop, Loop] | None = None,
    ) -> None:
        self.operations, self.numbers, self.work = operations, numbers, work
        parts = stages(splitting, operations)
        self.prepared = parts.prepared
        of_all = partial(make_pass, owner=owner, numbers=numbers, rows=rows)

        self.advance = _make_advance(parts, owner, numbers, rows)
        if ends:
            self.lead, self.tail = ends
        else:
            self.lead = self.tail = of_all("lead", parts.lead, TORQUE + 3, named=parts.named)
        if not ends and (parts.tail is not parts.lead or parts.tail_moves):
            self.tail = of_all(
                "tail", parts.tail, TORQUE + 3, named=parts.named, places=parts.tail_moves
            )
        self.go_on = self.start = None
        if len(parts.middle) > 1:
            self.go_on = of_all("go_on", parts.middle[1], P + 4, named=parts.named, places=True)
        if starts:
            self.start = of_all("start", starts, TORQUE + 3)


@inlined
def place(layout, k, atom_x):
    """Set the positions of the atoms of block k."""
    rotation_matrices(layout.block)
    write_atoms(layout, k, X, atom_x)


@inlined
def place_all(layout, images, atom_x):
    """Set the positions of all atoms from their bodies."""
    for k in range(layout.blocks.shape[0] - 1):
        take(layout, k, X, Q + 4, X)
        place(layout, k, atom_x)
    move_to_images(layout, images, atom_x)


@loop
def place_atoms(layout: Layout, images: Images, atom_x: F2):
    """Set the positions of all atoms from their bodies."""
    place_all(layout, images, atom_x)


def _make_advance(parts: Stages, owner: tuple[str, str], numbers: Kind, rows: int) -> Loop:
    """The first pass of a step, or all of it."""
    lead, tail, named = parts.lead, parts.tail, parts.named
    middle, several = parts.middle[0], len(parts.middle) > 1

    @untyped
    def advance(
        layout: Layout, images: Images, atom_x: F2, atom_f: F2, dt: F,
        parameters: numbers, gathers: I, ends: I, begins: I, part: I, rank: I, mask: F2,
    ) -> I:  # fmt: skip
        """Move the bodies, and set the positions of their atoms.

        It completes the previous step if `ends`, and begins this one if `begins`, so a whole step
        can be one pass.  If it gathers, force and torque of bodies with all atoms on this rank are
        summed here, and DROPS or KEEPS says whether they are stored.  `part` selects the bodies:
        ALL, UNSHARED or SHARED; the loop is called for UNSHARED before SHARED.

        Returns:
            as `gather`, or 0.
        """
        wrong, blocks, block = 0, layout.blocks, layout.block
        for k in range(blocks.shape[0] - 1):
            if part != ALL and blocks[k, 2] != (part == UNSHARED):
                continue
            fetch_ahead(layout, k + 1, MASS, P + 4, atom_f if gathers else atom_x)
            take(layout, k, MASS, P + 4, MASS)
            if gathers and blocks[k, 2]:
                rotation_matrices(block)
                bad = gather_block(layout, k, atom_f)
                if bad or gathers == KEEPS:
                    put(layout, k, FORCE, TORQUE + 3, FORCE)
                if bad:  # leave these bodies unchanged, for the error message
                    wrong += bad
                    continue
            else:
                take(layout, k, FORCE, TORQUE + 3, FORCE)
            hold(layout, k, mask)
            take(layout, k, ROWS, ROWS + rows, BLOCK_ROWS)
            if named:
                take_names(layout, k, rank, mask)
            kind = kind_of(layout, blocks[k, 0])
            if ends:
                tail(block, kind, dt, parameters)
            if begins:
                lead(block, kind, dt, parameters)
            middle(block, kind, dt, parameters)
            put(layout, k, X, P + 4, X)
            put(layout, k, ROWS, ROWS + rows, BLOCK_ROWS)
            if not several:
                place(layout, k, atom_x)
        if not several and part != UNSHARED:
            move_to_images(layout, images, atom_x)
        return wrong

    return Loop(advance, owner)


def make_pass(
    name: str,
    does: Callable,
    until: int,
    owner: tuple[str, str],
    numbers: Kind,
    named: bool = True,
    places: bool = False,
    rows: int = 0,
) -> Loop:
    """A pass that applies one function to all bodies.

    Args:
        name: name of the loop.  does: the function, see `Operation`.
        until: row of `state` before which it reads; force and torque must be known if included.
        owner: the module that the loop belongs to, and the prefix of its name.
        numbers: the record of its parameters.
        named: see `Operation`.  places: whether to set the positions of the atoms afterwards.
        rows: number of extra rows of each body.
    """

    @untyped
    def go(
        layout: Layout, images: Images, atom_x: F2, dt: F, parameters: numbers, rank: I, mask: F2
    ):  # fmt: skip
        for k in range(layout.blocks.shape[0] - 1):
            take(layout, k, MASS, until, MASS)
            if until > FORCE:
                hold(layout, k, mask)
            take(layout, k, ROWS, ROWS + rows, BLOCK_ROWS)
            if named:
                take_names(layout, k, rank, mask)
            does(layout.block, kind_of(layout, layout.blocks[k, 0]), dt, parameters)
            put(layout, k, X, P + 4, X)
            put(layout, k, ROWS, ROWS + rows, BLOCK_ROWS)
            if places:
                place(layout, k, atom_x)
        if places:
            move_to_images(layout, images, atom_x)

    go.__name__ = name
    return Loop(go, owner)
