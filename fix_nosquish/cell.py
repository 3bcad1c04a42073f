"""Stochastic cell rescaling: the box, and with it the centres of mass, follow the pressure.

Bernetti and Bussi, J. Chem. Phys. 153, 114107 (2020), for the whole box or for some of its axes
together (Del Tatto et al., Appl. Sci. 12, 1139 (2022)).  With lambda = sqrt(V), for d coupled axes

    d lambda = -(beta d lambda / 6 tau) (P_0 - P - k T / 2 V) dt + sqrt(beta k T d / 6 tau) dW

Centres of mass are stretched with the box, velocities by the inverse; shapes stay.  So P is the
molecular pressure: of the bodies' translation, and the virial of the forces on their centres.
"""

from math import sqrt

from .block import COUNTED, LANES, MASS, Layout, Q, V, X, at, take, three
from .compiled import F1, F2, L1, Cell, F, I, address, call, inlined, loop
from .migration import Box
from .mpi import DOUBLE, Mpi, add_up
from .nvt import ALL_BODIES, COMMON, DRAW, KEY_0, KEY_1, KT, STEP
from .philox import normal_pair, words
from .step import displaced, rotation_matrices

# parameters, behind those of any thermostat: factors of the three axes, the point that stays;
# twice the kinetic energy along each axis, and the virial of forces about the bodies' centres, of
# this rank
STRETCH, FIXED, MOTION, SPREAD, CELL_END = (COMMON + 6 + 3 * k for k in range(5))
# numbers of the barostat: pressure at begin and end, as energies in a volume; compressibility over
# damping time; mass times velocity squared as an energy
P_START, P_STOP, RATE_OF_CELL, UNIT, BAROSTAT = 0, 3, 6, 7, 8
FIRST_OF_CELL = 3 * 1024 * 1024  # random numbers of the system that are the barostat's


@inlined
def measure_motion(block, kind, dt, parameters):
    """Add twice the bodies' kinetic energy along each axis."""
    for k in range(3):
        energy = 0.0
        for b in range(LANES):
            energy += block[COUNTED, b] * block[MASS, b] * block[V + k, b] * block[V + k, b]
        parameters[MOTION + k] += energy


@inlined
def stretch(block, kind, dt, parameters):
    """Stretch the place of the centres, and shrink their velocities."""
    for k in range(3):
        factor, fixed = parameters[STRETCH + k], parameters[FIXED + k]
        for b in range(LANES):
            block[X + k, b] = fixed + factor * (block[X + k, b] - fixed)
            block[V + k, b] /= factor


@loop
def virial_about_centres(layout: Layout, atom_f: F2, parameters: F1):
    """The virial of the forces on this rank's atoms about their bodies' centres."""
    block, blocks, rounds, d = layout.block, layout.blocks, layout.rounds, layout.displace
    for k in range(3):
        parameters[SPREAD + k] = 0.0
    for k in range(blocks.shape[0] - 1):
        take(layout, k, Q, Q + 4, Q)
        rotation_matrices(block)
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            for b in range(rounds[r + 1] - rounds[r]):
                j = rounds[r] + b
                i = at(layout.index[at(j)])
                x, y, z = displaced(block, b, d, j)
                parameters[SPREAD] += x * atom_f[i, 0]
                parameters[SPREAD + 1] += y * atom_f[i, 1]
                parameters[SPREAD + 2] += z * atom_f[i, 2]


@inlined
def find_stretch(parameters, sums, forces_virial, barostat, axes, box, part, dt):
    """The factors of the axes, by the energies along them and the virial, (3,) each in sums."""
    h, kt = box.h, parameters[KT] * barostat[UNIT]
    volume, rate = h[0, 0] * h[1, 1] * h[2, 2], barostat[RATE_OF_CELL]
    step, number = int(parameters[STEP]), int(parameters[DRAW])
    key_0, key_1 = int(parameters[KEY_0]), int(parameters[KEY_1]) | ALL_BODIES
    for k in range(3):
        parameters[STRETCH + k] = 1.0
    for group in range(3):
        count, pressure, goal = 0, 0.0, 0.0
        for k in range(3):
            if axes[k] == group:
                count += 1
                virial = forces_virial[k] - sums[3 + k]
                pressure += (sums[k] * barostat[UNIT] + virial) / volume
                goal += barostat[P_START + k]
                goal += part * (barostat[P_STOP + k] - barostat[P_START + k])
        if count > 0:
            w0, w1, _, _ = words(float(FIRST_OF_CELL + group), step, number, key_0, key_1)
            noise, _ = normal_pair(w0, w1)
            root, strength = sqrt(volume), rate * count * dt / 6.0
            excess = (goal - pressure) / count - 0.5 * kt / volume
            root += -strength * root * excess + sqrt(strength * kt) * noise
            factor = root * root / volume
            volume = root * root
            if count == 2:
                factor = sqrt(factor)
            elif count == 3:
                factor = factor ** (1.0 / 3.0)
            for k in range(3):
                if axes[k] == group:
                    parameters[STRETCH + k] = factor


@inlined
def set_box(parameters, box, shift, new_box, setter):
    """Stretch the box about its centre, with all that follows from it, and tell LAMMPS."""
    h, inverse, lo = box.h, box.inverse, box.lo
    for k in range(3):
        factor, fixed = parameters[STRETCH + k], lo[k]
        for i in range(3):
            fixed += 0.5 * h[k, i]
        parameters[FIXED + k] = fixed
        edge = factor * h[k, k]
        lo[k] = fixed + factor * (lo[k] - fixed)
        for i in range(3):
            h[k, i] *= factor
            inverse[i, k] /= factor
        for i in range(shift.shape[0]):
            shift[i, k] *= factor
        new_box[k], new_box[3 + k] = lo[k], lo[k] + edge
        h[k, k] = new_box[3 + k] - lo[k]
    new_box[6], new_box[7], new_box[8] = h[0, 1], h[0, 2], h[1, 2]
    call(setter[0], setter[1], address(new_box))


@inlined
def rescale_cell(
    mpi, parameters, cell_sums, forces_virial, barostat, axes, box, shift, new_box, setter, part, dt
):
    """Stretch the box and tell LAMMPS; the energies along the axes, in cell_sums, are those after
    it."""
    add_up(mpi, DOUBLE, parameters[MOTION : MOTION + 6], cell_sums)
    for k in range(3):
        parameters[MOTION + k] = 0.0
    find_stretch(parameters, cell_sums, forces_virial, barostat, axes, box, part, dt)
    set_box(parameters, box, shift, new_box, setter)
    for k in range(3):
        cell_sums[k] /= parameters[STRETCH + k] * parameters[STRETCH + k]
