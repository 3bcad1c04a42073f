"""Stochastic cell rescaling: the box, and with it the centres of mass, follow the pressure.

Bernetti and Bussi, J. Chem. Phys. 153, 114107 (2020), for the whole box or for some of its axes
together (Del Tatto et al., Appl. Sci. 12, 1139 (2022)).  With lambda = sqrt(V), for d coupled axes

    d lambda = -(beta d lambda / 6 tau) (P_0 - P - k T / 2 V) dt + sqrt(beta k T d / 6 tau) dW

Centres of mass are stretched with the box, velocities by the inverse; shapes stay.  So P is the
molecular pressure: of the bodies' translation, and the virial of the forces on their centres.

It is done every so many steps, when the bodies have moved and before their forces are computed: no
force of the old box acts in the new one.
"""

from math import sqrt
from typing import NamedTuple

from .block import HOME, MASS, Images, Layout, Q, V, X, at, take
from .compiled import F1, F2, L1, F, I, address, call, inlined, loop
from .migration import Box
from .mpi import DOUBLE, Mpi, add_up
from .nvt import KT, OF_BAROSTAT, prepare, words_of_all
from .philox import normal_pair
from .step import displaced, move_to_images, place, rotation_matrices

# numbers of a barostat: pressure at the begin and the end of the run, as energies in a volume;
# compressibility over damping time; mass times velocity squared as an energy; steps between two
# changes; 1.0 in three dimensions, 0.0 in two; of this rank, twice the kinetic energy along each
# axis, and the virial of forces about the bodies' centres; factors of the axes, and the centre; 1.0
# once a factor was out of bounds
P_START, P_STOP, RATE, UNIT, EVERY, SPACE, MOTION, SPREAD, STRETCH, CENTRE, BROKEN, NUMBERS = (
    0, 3, 6, 7, 8, 9, 10, 13, 16, 19, 22, 23,
)  # fmt: skip
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
def find_stretch(parameters, cell, box, part, dt):
    """The factors of the axes for dt, by the kinetic energies and virials along them."""
    kt, numbers = parameters[KT] * cell.barostat[UNIT], cell.barostat
    volume = volume_of(box, numbers)
    for k in range(3):
        numbers[STRETCH + k] = 1.0
    for group in range(3):
        count, excess = 0, 0.0
        for k in range(3):
            if cell.axes[k] == group:
                count += 1
                energy = cell.cell_sums[k] * numbers[UNIT]
                energy += cell.forces_virial[k] - cell.cell_sums[3 + k]
                excess += pressure_now(numbers, k, part) - energy / volume
        if count > 0:
            w0, w1, _, _ = words_of_all(parameters, OF_BAROSTAT + group)
            noise, _ = normal_pair(w0, w1)
            root, strength = sqrt(volume), numbers[RATE] * count * dt / 6.0
            root -= strength * root * (excess / count - 0.5 * kt / volume)
            root += sqrt(strength * kt) * noise
            factor, volume = root * root / volume, root * root
            if count == 2:
                factor = sqrt(factor)
            elif count == 3:
                factor = factor ** (1.0 / 3.0)
            for k in range(3):
                if cell.axes[k] == group:
                    numbers[STRETCH + k] = factor


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
    return 0


@loop
def rescale_cell(
    mpi: Mpi, layout: Layout, images: Images, atom_x: F2, parameters: F1, dt: F, rank: I,
    step: L1, begin_step: L1, end_step: L1, cell: Barostat, box: Box,
) -> I:  # fmt: skip
    """Change the box, stretch the centres of mass with it, and place the atoms anew.

    Returns:
        as `stretch_box`.
    """
    state, numbers = layout.state, cell.barostat
    for k in range(3):
        numbers[MOTION + k] = 0.0
        for b in range(state.shape[1]):
            if state[HOME, b] == rank:
                numbers[MOTION + k] += state[MASS, b] * state[V + k, b] * state[V + k, b]
    add_up(mpi, DOUBLE, numbers[MOTION : MOTION + 6], cell.cell_sums)
    part = prepare(parameters, step, begin_step, end_step)
    find_stretch(parameters, cell, box, part, dt * numbers[EVERY])
    if stretch_box(cell, box, images.shift) < 0:
        return OUT_OF_BOUNDS
    for k in range(3):
        factor, centre = numbers[STRETCH + k], numbers[CENTRE + k]
        for b in range(state.shape[1]):
            state[X + k, b] = centre + factor * (state[X + k, b] - centre)
            state[V + k, b] /= factor
    for k in range(layout.blocks.shape[0] - 1):
        take(layout, k, MASS, Q + 4, MASS)
        place(layout, k, atom_x)
    move_to_images(layout, images, atom_x)
    return 0
