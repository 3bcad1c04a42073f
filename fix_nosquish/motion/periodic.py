"""The geometry of a periodic box: its vectors and its periodic images."""

from math import floor
from typing import NamedTuple

from ..loops.compiled import F1, F2, F, inlined
from .block import ATOM, IMAGE, OWN, Q, V, X, at, take, three, write
from .step import apply_matrices, rotation_matrices


class PeriodicBox(NamedTuple):
    """The periodic box in the loops.

    Attributes:
        h, inverse: (3, 3) box vectors in columns, upper triangular; the inverse matrix.
        lo, periodic: (3,) origin; 1.0 along periodic directions, else 0.0.
        near: largest distance of an atom from its position in the body.
        rate: (6,) velocity of the box vectors (xx yy zz yz xz xy), by which the velocities of
            periodic images differ; zero unless another fix deforms the box with remap v.
    """

    h: F2
    inverse: F2
    lo: F1
    periodic: F1
    near: F
    rate: F1


@inlined
def invert(h, inverse):
    """Compute the inverse of the upper triangular h; entries below the diagonal are not set."""
    xx, yy, zz, xy, xz, yz = h[0, 0], h[1, 1], h[2, 2], h[0, 1], h[0, 2], h[1, 2]
    inverse[0, 0], inverse[1, 1], inverse[2, 2] = 1.0 / xx, 1.0 / yy, 1.0 / zz
    inverse[0, 1], inverse[1, 2] = -xy / (xx * yy), -yz / (yy * zz)
    inverse[0, 2] = (xy * yz - xz * yy) / (xx * yy * zz)


@inlined
def fractional(inverse, x, y, z):
    """The fractional coordinates of a vector."""
    return (
        inverse[0, 0] * x + inverse[0, 1] * y + inverse[0, 2] * z,
        inverse[1, 1] * y + inverse[1, 2] * z,
        inverse[2, 2] * z,
    )


@inlined
def cartesian(h, u, v, w):
    """The Cartesian vector of these fractional coordinates."""
    return h[0, 0] * u + h[0, 1] * v + h[0, 2] * w, h[1, 1] * v + h[1, 2] * w, h[2, 2] * w


@inlined
def reflag(images, row, xy, xz, yz):
    """Convert image flags to the new box vectors after a flip: three rows from `row` on."""
    for b in range(images.shape[1]):
        images[row + 1, b] -= yz * images[row + 2, b]
        images[row, b] -= xy * images[row + 1, b] + xz * images[row + 2, b]


@inlined
def image_velocity(rate, n1, n2, n3):
    """The velocity of the image n1, n2, n3 box vectors away, relative to the image 0, 0, 0."""
    return (
        rate[0] * n1 + rate[5] * n2 + rate[4] * n3,
        rate[1] * n2 + rate[3] * n3,
        rate[2] * n3,
    )


@inlined
def take_into_box(state, box):
    """Wrap the bodies into the box, and update their image flags."""
    h, inverse, lo, periodic = box.h, box.inverse, box.lo, box.periodic
    for b in range(state.shape[1]):
        x, y, z = three(state, X, b)
        u, v, w = fractional(inverse, x - lo[0], y - lo[1], z - lo[2])
        n1, n2, n3 = periodic[0] * floor(u), periodic[1] * floor(v), periodic[2] * floor(w)
        if n1 != 0.0 or n2 != 0.0 or n3 != 0.0:
            vectors = (n1, n2, n3)
            away, faster = cartesian(h, n1, n2, n3), image_velocity(box.rate, n1, n2, n3)
            for k in range(3):
                state[X + k, b] -= away[k]
                state[V + k, b] -= faster[k]
                state[IMAGE + k, b] += vectors[k]


@inlined
def find_images(layout, images, box, atom_x, off):
    """Find the atoms that LAMMPS stores in another periodic image than their body.

    Args:
        images: the `Images`; atoms beyond their length are counted, but not stored.
        off: (2,) output: the largest distance (along an axis) of an atom from its position in the
            body, and its entry of index.
    Returns:
        the number of these atoms.
    """
    block, blocks, rounds, count = layout.block, layout.blocks, layout.rounds, 0
    h, inverse, periodic = box.h, box.inverse, box.periodic
    away, shift = images.away, images.shift
    off[0], off[1] = 0.0, 0.0
    for k in range(blocks.shape[0] - 1):
        take(layout, k, X, X + 3, X)
        take(layout, k, Q, Q + 4, Q)
        rotation_matrices(block)
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            j = rounds[r]
            apply_matrices(block, X, j, rounds[r + 1], layout.displace)
            for b in range(rounds[r + 1] - j):
                i = at(layout.index[at(j + b)])
                for c in range(3):
                    block[ATOM + c, b] = atom_x[i, c] - block[ATOM + c, b]
            for b in range(rounds[r + 1] - j):
                x, y, z = three(block, ATOM, b)
                u, v, w = fractional(inverse, x, y, z)
                n1, n2 = periodic[0] * floor(u + 0.5), periodic[1] * floor(v + 0.5)
                write(block, OWN, b, cartesian(h, n1, n2, periodic[2] * floor(w + 0.5)))
            for b in range(rounds[r + 1] - j):
                (x, y, z), (sx, sy, sz) = three(block, ATOM, b), three(block, OWN, b)
                if sx != 0.0 or sy != 0.0 or sz != 0.0:
                    if count < away.size:
                        away[count] = j + b
                        shift[count, 0], shift[count, 1], shift[count, 2] = sx, sy, sz
                    count += 1
                far = max(abs(x - sx), max(abs(y - sy), abs(z - sz)))
                if not far <= off[0]:
                    off[0], off[1] = far, j + b
    return count
