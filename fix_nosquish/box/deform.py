"""A box deformed by another fix, such as fix deform; bodies keep their shapes.

With remap x the centre of mass of each body keeps its fractional coordinates, as with LAMMPS's fix
rigid.  With remap v bodies keep their positions, and periodic images move relative to each other:
a body that crosses a face gets the velocity of its image there (`periodic.take_into_box`).
"""

from math import floor

from ..loops.compiled import F1, F2, F, I, inlined, loop
from ..motion.block import IMAGE, Images, Layout, X
from ..motion.periodic import (
    PeriodicBox,
    cartesian,
    fractional,
    image_velocity,
    invert,
    reflag,
)  # fmt: skip
from ..motion.step import move_to_images, place_all
from ..ranks.arrangement import OF_BODY
from .cell import three_of

SAME_LATTICE = 1e-9  # tolerance of a tilt for the same lattice, as a fraction of a box vector


@inlined
def edges(deformed_box):
    """The edge lengths of a box along x, y and z; for deformed_box see `deform`."""
    return (
        deformed_box[3] - deformed_box[0],
        deformed_box[4] - deformed_box[1],
        deformed_box[5] - deformed_box[2],
    )


@inlined
def image_numbers(inverse, shift, a):
    """The shift of an atom's image in numbers of box vectors.

    Args:
        a: index of the atom in `Images.away`.
    """
    x, y, z = three_of(shift[a])
    u, v, w = fractional(inverse, x, y, z)
    return floor(u + 0.5), floor(v + 0.5), floor(w + 0.5)


@inlined
def set_box(images, box, deformed_box):
    """Set the box to LAMMPS's present box.

    The shift of an atom in another image than its body keeps its numbers of box vectors.
    """
    h, shift = box.h, images.shift
    for a in range(shift.shape[0]):
        shift[a, 0], shift[a, 1], shift[a, 2] = image_numbers(box.inverse, shift, a)
    h[0, 0], h[1, 1], h[2, 2] = edges(deformed_box)
    h[0, 1], h[0, 2], h[1, 2] = three_of(deformed_box[6:])
    invert(h, box.inverse)
    for k in range(3):
        box.lo[k] = deformed_box[k]
    for a in range(shift.shape[0]):
        n1, n2, n3 = three_of(shift[a])
        shift[a, 0], shift[a, 1], shift[a, 2] = cartesian(h, n1, n2, n3)


@loop
def move_with_box(layout: Layout, images: Images, box: PeriodicBox, deformed_box: F1, atom_x: F2):
    """Map the bodies to LAMMPS's present box, and set the positions of their atoms.

    Args:
        deformed_box: (9,) lowest and highest coordinates, tilts xy, xz, yz.
    """
    lo, state = box.lo, layout.state
    for b in range(state.shape[1]):
        x, y, z = state[X, b] - lo[0], state[X + 1, b] - lo[1], state[X + 2, b] - lo[2]
        state[X, b], state[X + 1, b], state[X + 2, b] = fractional(box.inverse, x, y, z)
    set_box(images, box, deformed_box)
    for b in range(state.shape[1]):
        x, y, z = cartesian(box.h, state[X, b], state[X + 1, b], state[X + 2, b])
        state[X, b], state[X + 1, b], state[X + 2, b] = lo[0] + x, lo[1] + y, lo[2] + z
    place_all(layout, images, atom_x)


@loop
def move_images(layout: Layout, images: Images, box: PeriodicBox, deformed_box: F1, atom_x: F2):
    """Set the box to LAMMPS's present box without moving the bodies; atoms in another image than
    their body move with that image."""
    for a in range(images.away.size):
        for c in range(3):
            atom_x[layout.index[images.away[a]], c] -= images.shift[a, c]
    set_box(images, box, deformed_box)
    move_to_images(layout, images, atom_x)


@loop
def add_image_velocities(layout: Layout, images: Images, box: PeriodicBox, atom_v: F2, sign: F):
    """Add the velocity of the image to each atom in another image than its body.

    Args:
        sign: 1.0, or -1.0 to subtract it.
    """
    for a in range(images.away.size):
        i = layout.index[images.away[a]]
        n1, n2, n3 = image_numbers(box.inverse, images.shift, a)
        vx, vy, vz = image_velocity(box.rate, n1, n2, n3)
        atom_v[i, 0] += sign * vx
        atom_v[i, 1] += sign * vy
        atom_v[i, 2] += sign * vz


@loop
def flipped(layout: Layout, images: Images, box: PeriodicBox, deformed_box: F1, arrived: F2) -> I:
    """Set the box to LAMMPS's present box, if its vectors span the same lattice.

    In a flip LAMMPS adds integer multiples of the vector a to b (xy) and to c (xz), and of b to c
    (yz).  Image flags of bodies are converted to the new vectors, including those of bodies that
    have just arrived from another rank.

    Returns:
        1 if the lattice differs, in which case the box is unchanged; else 0.
    """
    h = box.h
    xx, yy, zz = edges(deformed_box)
    if xx != h[0, 0] or yy != h[1, 1] or zz != h[2, 2]:
        return 1
    u, v = (deformed_box[6] - h[0, 1]) / xx, (deformed_box[8] - h[1, 2]) / yy
    xy, yz = floor(u + 0.5), floor(v + 0.5)
    w = (deformed_box[7] - h[0, 2] - yz * h[0, 1]) / xx
    xz = floor(w + 0.5)
    if not max(abs(u - xy), max(abs(v - yz), abs(w - xz))) < SAME_LATTICE:
        return 1
    reflag(layout.state, IMAGE, xy, xz, yz)
    reflag(arrived.T, OF_BODY + IMAGE, xy, xz, yz)
    set_box(images, box, deformed_box)
    return 0
