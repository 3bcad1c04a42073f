"""The box is changed by another fix, as by fix deform: bodies move with it and keep their shapes.

Each body's centre keeps its place in units of the box vectors, as with LAMMPS's fix rigid.
"""

from .block import Images, Layout, Q, X, take
from .cell import three_of
from .compiled import F1, F2, loop
from .migration import Box
from .step import move_to_images, place


@loop
def deform(layout: Layout, images: Images, box: Box, told_box: F1, atom_x: F2):
    """Move the bodies into the box that LAMMPS has now, and place their atoms.

    Args:
        told_box: (9,) its lowest and highest coordinates, its tilts xy, xz, yz.
    """
    h, inverse, lo, state, shift = box.h, box.inverse, box.lo, layout.state, images.shift
    xx, yy, zz = (
        told_box[3] - told_box[0],
        told_box[4] - told_box[1],
        told_box[5] - told_box[2],
    )
    xy, xz, yz = three_of(told_box, 6)
    for b in range(state.shape[1]):
        x, y, z = state[X, b] - lo[0], state[X + 1, b] - lo[1], state[X + 2, b] - lo[2]
        u = inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z
        v, w = inverse[1, 1] * y + inverse[1, 2] * z, inverse[2, 2] * z
        state[X, b] = told_box[0] + xx * u + xy * v + xz * w
        state[X + 1, b] = told_box[1] + yy * v + yz * w
        state[X + 2, b] = told_box[2] + zz * w
    for a in range(images.aways[0]):
        x, y, z = three_of(shift[a], 0)
        u = inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z
        v, w = inverse[1, 1] * y + inverse[1, 2] * z, inverse[2, 2] * z
        shift[a, 0], shift[a, 1], shift[a, 2] = xx * u + xy * v + xz * w, yy * v + yz * w, zz * w
    h[0, 0], h[0, 1], h[0, 2], h[1, 1], h[1, 2], h[2, 2] = xx, xy, xz, yy, yz, zz
    inverse[0, 0], inverse[1, 1], inverse[2, 2] = 1.0 / xx, 1.0 / yy, 1.0 / zz
    inverse[0, 1], inverse[1, 2] = -xy / (xx * yy), -yz / (yy * zz)
    inverse[0, 2] = (xy * yz - xz * yy) / (xx * yy * zz)
    for k in range(3):
        lo[k] = told_box[k]
    for k in range(layout.blocks.shape[0] - 1):
        take(layout, k, X, Q + 4, X)
        place(layout, k, atom_x)
    move_to_images(layout, images, atom_x)
