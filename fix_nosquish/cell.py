"""The box of an integrator at constant pressure: its numbers, its pressure, and how it stretches.

The pressure is the molecular one: of the bodies' translation, and the virial of the forces on their
centres of mass.  `crescale` and `mtk` say how the box follows it.
"""

from typing import NamedTuple

from .block import Layout, Q, at, take
from .compiled import F1, F2, L1, address, call, inlined, loop
from .step import displaced, rotation_matrices

# numbers of a barostat: pressure at the begin and the end of the run, as energies in a volume;
# compressibility over damping time, of a piston 1 over it; mass times velocity squared as an
# energy; steps between two changes; 1.0 in three dimensions, 0.0 in two; of this rank, twice the
# kinetic energy along each axis, and the virial of forces about the bodies' centres; factors of the
# axes, and the centre; 1.0 once a factor was out of bounds; 1.0 while the box has changed and the
# forces behind are not known
P_START, P_STOP, RATE, UNIT, EVERY, SPACE, MOTION, SPREAD = 0, 3, 6, 7, 8, 9, 10, 13
STRETCH, CENTRE, BROKEN, OPEN, NUMBERS = 16, 19, 22, 23, 24
OUT_OF_BOUNDS = -2  # what the loops return then
MOST = 2.0  # the largest factor by which an axis may change at once, and its inverse the smallest


class Barostat(NamedTuple):
    """What changes the box.

    Attributes:
        barostat: (NUMBERS,), see above.
        axes: (3,) which axes change together: a number from 0 to 2, or -1 for one that does not.
        cell_sums: (6,) to work with.
        forces_virial: (6,) the virial of LAMMPS's forces on all ranks (xx yy zz xy xz yz).
        new_box: (9,) lowest and highest coordinates, tilts xy, xz, yz.
        set_box: (2,) address of LAMMPS's function that takes these, and its first argument.
    """

    barostat: F1
    axes: L1
    cell_sums: F1
    forces_virial: F1
    new_box: F1
    set_box: L1


@loop
def virial_about_centres(layout: Layout, atom_f: F2, barostat: F1):
    """The virial of the forces on this rank's atoms about their bodies' centres."""
    block, blocks, rounds, d = layout.block, layout.blocks, layout.rounds, layout.displace
    for k in range(3):
        barostat[SPREAD + k] = 0.0
    for k in range(blocks.shape[0] - 1):
        take(layout, k, Q, Q + 4, Q)
        rotation_matrices(block)
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            for b in range(rounds[r + 1] - rounds[r]):
                j = rounds[r] + b
                i = at(layout.index[at(j)])
                x, y, z = displaced(block, b, d, j)
                barostat[SPREAD] += x * atom_f[i, 0]
                barostat[SPREAD + 1] += y * atom_f[i, 1]
                barostat[SPREAD + 2] += z * atom_f[i, 2]


@inlined
def volume_of(box, numbers):
    """The volume of the box, in two dimensions its area."""
    return box.h[0, 0] * box.h[1, 1] * (box.h[2, 2] if numbers[SPACE] > 0.0 else 1.0)


@inlined
def pressure_now(numbers, k, part):
    """The pressure along an axis that is asked for."""
    return numbers[P_START + k] + part * (numbers[P_STOP + k] - numbers[P_START + k])


@inlined
def stretch_box(cell, box, shift):
    """Stretch the box about its centre, with all that follows from it, and tell LAMMPS.

    Returns:
        OUT_OF_BOUNDS if a factor is, or was, else 0.
    """
    h, inverse, lo, new_box = box.h, box.inverse, box.lo, cell.new_box
    for k in range(3):
        if not 1.0 / MOST < cell.barostat[STRETCH + k] < MOST:  # nor if it is not a number
            cell.barostat[BROKEN] = 1.0
    if cell.barostat[BROKEN] > 0.0:
        return OUT_OF_BOUNDS
    for k in range(3):
        factor, centre = cell.barostat[STRETCH + k], lo[k]
        for i in range(3):
            centre += 0.5 * h[k, i]
        cell.barostat[CENTRE + k] = centre
        edge = factor * h[k, k]
        lo[k] = centre + factor * (lo[k] - centre)
        for i in range(3):
            h[k, i] *= factor
            inverse[i, k] /= factor
        for i in range(shift.shape[0]):
            shift[i, k] *= factor
        new_box[k], new_box[3 + k] = lo[k], lo[k] + edge
        h[k, k] = new_box[3 + k] - lo[k]  # as LAMMPS will have it
    new_box[6], new_box[7], new_box[8] = h[0, 1], h[0, 2], h[1, 2]
    call(cell.set_box[0], cell.set_box[1], address(new_box))
    cell.barostat[OPEN] = 1.0
    return 0
