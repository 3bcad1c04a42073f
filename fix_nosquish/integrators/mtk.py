"""A piston: the box, and with it the centres of mass, move as the pressure drives them.

Martyna, Tobias and Klein, J. Chem. Phys. 101, 4177 (1994), for the bodies' translation.  With the
rate of strain e of axis k, which several axes may share, S their sum over the axes, N degrees of
freedom of translation, and the inertia W,

    dR_k/dt = V_k + e R_k          M dV_k/dt = F_k - (e + S / N) M V_k
    W de/dt = sum over its axes of  virial_k - P_k volume + sum M V_k^2 + sum M V^2 / N

A tilt has a rate of strain, too: for xy, of x with y.  Its force is the one along x times the place
along y, and there is no drag but the shear's own.  Where tilts change, S weights the axes.

Each term depends on positions or on velocities, so the step can be symmetric in time, B A D A B:

    B   F_k acts on the bodies, virial_k - P_k volume on e
    D   half of the strain, sum M V_k^2 + sum M V^2 / N acts on e, half of the strain; a half of the
        strain is one of the axes, and one of the tilts on the inner side of it

The piston's thermostat acts in the middle of D: so the box has the right distribution even where
its own oscillation, which is fast at a given arrangement of the bodies, is badly resolved.  Chains
and velocity rescaling act there on the bodies, too; Langevin's thermostat acts on these behind D.

The kinetic energy that drives the piston is that of the step's middle, as the temperature is.
Every so many steps the piston moves, for all of their time at once.
"""

from math import exp, sqrt
from typing import NamedTuple

import numpy as np

from ..box.cell import (
    CENTRE,
    COMPONENTS,
    EVERY,
    NUMBERS,
    OPEN,
    OUT_OF_BOUNDS,
    RATE,
    SHEAR,
    SPREAD,
    STRETCH,
    TILT_SPREAD,
    TILTED,
    UNIT,
    WEIGHT,
    XX,
    XY,
    XZ,
    YY,
    YZ,
    Barostat,
    add_motion,
    is_due,
    pressure_now,
    shear_rows,
    stretch_box,
    three_of,
    volume_of,
)  # fmt: skip
from ..errors import RunError
from ..host.hosts import hook
from ..loops.compiled import F1, L1, Cell, F, inlined, loop
from ..motion.block import COUNTED, LANES, MASS, V, X, three
from ..motion.operations import PARAMETERS
from ..motion.periodic import PeriodicBox
from ..motion.philox import normal_pair
from ..motion.step import Operation
from ..ranks.mpi import Mpi, add_up
from ..run import thermo
from .constant_pressure import ConstantPressure
from .constant_temperature import COMMON, HEAT, KT, OF_BAROSTAT, part_of_run, words_of_all

# numbers behind those of `cell`: the inertia of each rate of strain, 0 where there is none; degrees
# of freedom of translation; the molecular virial
INERTIA, FREEDOM, VIRIAL, MTK_NUMBERS = NUMBERS, NUMBERS + 6, NUMBERS + 7, NUMBERS + 13
# the piston: rates of strain; the work done against the pressure; the k T that its inertia is of
PV, INERTIA_KT, PISTON = COMPONENTS, COMPONENTS + 1, COMPONENTS + 2
Piston = NamedTuple("Piston", [*Barostat.__annotations__.items(), ("piston", F1)])
# parameters behind those of all thermostats: twice this rank's kinetic energy along each axis, and
# with each tilt; factors of velocities, and what shears them then; the same of positions, and the
# points from which these count; 1.0 if tilts change, else 0.0
ALONG, SLOW, STRAIN, CENTRES, SHEARS = (
    COMMON + 6, COMMON + 12, COMMON + 18, COMMON + 24, COMMON + 27,
)  # fmt: skip


@inlined
def measure_along(block, kind, dt, parameters):
    """Add twice the kinetic energies of translation along each axis, and with each tilt."""
    sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for b in range(LANES):
        x, y, z = three(block, V, b)
        sums = add_motion(sums, block[COUNTED, b] * block[MASS, b], x, y, z)
    for k in range(COMPONENTS):
        parameters[ALONG + k] += sums[k]


@inlined
def dilate(block, kind, dt, parameters):
    """Strain the centres of mass, and slow their velocities down."""
    for k in range(3):
        longer, centre = parameters[STRAIN + k] - 1.0, parameters[CENTRES + k]
        for b in range(LANES):
            block[X + k, b] += longer * (block[X + k, b] - centre)
            block[V + k, b] *= parameters[SLOW + k]
    if parameters[SHEARS] > 0.0:
        _, y0, z0 = three_of(parameters, CENTRES)
        shear_rows(block, X, LANES, three_of(parameters, STRAIN + XY), y0, z0)
        shear_rows(block, V, LANES, three_of(parameters, SLOW + XY), 0.0, 0.0)


DILATION = Operation(dilate, prepared=True, measures=measure_along)


@inlined
def push(cell, box, part, dt):
    """The forces act on the rates of strain for dt."""
    numbers, volume = cell.barostat, volume_of(box, cell.barostat)
    for k in range(COMPONENTS):
        if cell.axes[k] >= 0:
            force = numbers[VIRIAL + k] - pressure_now(numbers, k, part) * volume
            cell.piston[cell.axes[k]] += dt * force / numbers[INERTIA + cell.axes[k]]


@inlined
def strain(parameters, cell, box, part, dt):
    """Change the factors, and the kinetic energies with them, by what the axes' rates do."""
    numbers, total, against, volume = cell.barostat, 0.0, 0.0, volume_of(box, cell.barostat)
    weighted, tilted = 0.0, numbers[TILTED] > 0.0
    for k in range(3):
        volume *= numbers[STRETCH + k]
        if cell.axes[k] >= 0:
            total += cell.piston[cell.axes[k]]
            weighted += numbers[WEIGHT + k] * cell.piston[cell.axes[k]]
            against += pressure_now(numbers, k, part) * cell.piston[cell.axes[k]]
    for k in range(3):
        rate = cell.piston[cell.axes[k]] if cell.axes[k] >= 0 else 0.0
        factor, longer = exp(-dt * (rate + weighted / numbers[FREEDOM])), exp(dt * rate)
        parameters[SLOW + k] *= factor
        cell.cell_sums[k] *= factor * factor
        numbers[STRETCH + k] *= longer
        if tilted:  # what acts after a shear makes it another one
            stretch_shear(numbers, SHEAR, k, longer)
            stretch_shear(parameters, SLOW + XY, k, factor)
            for n in range(XY, COMPONENTS):
                cell.cell_sums[n] *= factor if first_axis(n) == k or second_axis(n) == k else 1.0
    much = dt * total
    longer = dt * (1.0 + 0.5 * much) if abs(much) < 1e-7 else (exp(much) - 1.0) / total
    cell.piston[PV] += against * volume * longer


@inlined
def first_axis(tilt):
    """The axis along which a tilt moves what is further along its second one."""
    return 1 if tilt == YZ else 0


@inlined
def second_axis(tilt):
    """The second axis of a tilt."""
    return 1 if tilt == XY else 2


@inlined
def stretch_shear(numbers, at, axis, factor):
    """What a shear is when it acts after an axis is stretched, not before."""
    for n in range(XY, COMPONENTS):
        if first_axis(n) == axis:
            numbers[at + n - XY] *= factor
        if second_axis(n) == axis:
            numbers[at + n - XY] /= factor


@inlined
def tilt(parameters, cell, box, part, dt):
    """Change the shears, and the kinetic energies with them, by what the tilts' rates do."""
    numbers, along, rates = cell.barostat, cell.cell_sums, cell.piston
    xy = dt * rates[cell.axes[XY]] if cell.axes[XY] >= 0 else 0.0
    xz = dt * rates[cell.axes[XZ]] if cell.axes[XZ] >= 0 else 0.0
    yz = dt * rates[cell.axes[YZ]] if cell.axes[YZ] >= 0 else 0.0
    volume = volume_of(box, numbers)
    for k in range(3):
        volume *= numbers[STRETCH + k]
    against = xy * pressure_now(numbers, XY, part) + xz * pressure_now(numbers, XZ, part)
    cell.piston[PV] += (against + yz * pressure_now(numbers, YZ, part)) * volume
    both = 0.5 * xy * yz  # of the exponential
    add_shear(numbers, SHEAR, xy, xz + both, yz)
    xy, xz, yz = -xy, both - xz, -yz
    add_shear(parameters, SLOW + XY, xy, xz, yz)
    xx, yy, zz = three_of(along, XX)
    of_xy, of_xz, of_yz = three_of(along, XY)
    along[XX] = xx + xy * xy * yy + xz * xz * zz + 2.0 * (xy * of_xy + xz * of_xz + xy * xz * of_yz)
    along[YY] = yy + yz * yz * zz + 2.0 * yz * of_yz
    along[XY] = of_xy + xy * yy + xz * of_yz + yz * (of_xz + xy * of_yz + xz * zz)
    along[XZ] = of_xz + xy * of_yz + xz * zz
    along[YZ] = of_yz + yz * zz


@inlined
def add_shear(numbers, at, xy, xz, yz):
    """Have a shear, 1 and these above the diagonal, act after the one that is in numbers."""
    numbers[at + 1] += xz + xy * numbers[at + 2]
    numbers[at] += xy
    numbers[at + 2] += yz


@inlined
def push_by_motion(cell, dt):
    """The kinetic energies act on the rates of strain for dt."""
    numbers, along = cell.barostat, cell.cell_sums
    shared = (along[0] + along[1] + along[2]) / numbers[FREEDOM]
    for k in range(COMPONENTS):
        if cell.axes[k] >= 0:
            force = numbers[UNIT] * (along[k] + numbers[WEIGHT + k] * shared)
            cell.piston[cell.axes[k]] += dt * force / numbers[INERTIA + cell.axes[k]]


@inlined
def begin_move(mpi, parameters, step, cell, box, part, dt):
    """The first half of letter D, if the box changes in this step.

    Returns:
        by how much twice the kinetic energy changes.
    """
    numbers, along, gained = cell.barostat, cell.cell_sums, 0.0
    for k in range(3):
        parameters[SLOW + k] = parameters[STRAIN + k] = 1.0
        parameters[SLOW + XY + k] = parameters[STRAIN + XY + k] = 0.0
    if is_due(step, cell):
        half, count = 0.5 * dt * numbers[EVERY], COMPONENTS if numbers[TILTED] > 0.0 else 3
        push(cell, box, part, half)
        add_up(mpi, parameters[ALONG : ALONG + count], along[0:count])
        for k in range(3):
            gained -= along[k]
            numbers[STRETCH + k], numbers[SHEAR + k] = 1.0, 0.0
        strain(parameters, cell, box, part, half)
        if numbers[TILTED] > 0.0:
            tilt(parameters, cell, box, part, half)
        push_by_motion(cell, half)
        for k in range(3):
            gained += along[k]
    for k in range(COMPONENTS):
        parameters[ALONG + k] = 0.0
    return gained


@inlined
def end_move(parameters, step, cell, box, shift, part, dt, factor):
    """The second half of letter D, if the box changes in this step, and the box itself.

    Args:
        factor: what a thermostat has multiplied the velocities by in between.
    Returns:
        as `stretch_box`.
    """
    numbers = cell.barostat
    if is_due(step, cell):
        for k in range(COMPONENTS):
            cell.cell_sums[k] *= factor * factor
        half = 0.5 * dt * numbers[EVERY]
        push_by_motion(cell, half)
        if numbers[TILTED] > 0.0:
            tilt(parameters, cell, box, part, half)
        strain(parameters, cell, box, part, half)
        if stretch_box(cell, box, shift) < 0:
            return OUT_OF_BOUNDS
        for k in range(3):
            parameters[STRAIN + k] = numbers[STRETCH + k]
            parameters[STRAIN + XY + k] = numbers[SHEAR + k]
            parameters[CENTRES + k] = numbers[CENTRE + k]
    return 0


@inlined
def thermalise_piston(mpi, parameters, step, cell, dt):
    """Friction and noise on the rates of strain, if the box changes in this step."""
    numbers = cell.barostat
    if is_due(step, cell):
        keep = exp(-numbers[RATE] * dt * numbers[EVERY])
        for group in range(COMPONENTS):
            inertia, before = numbers[INERTIA + group], cell.piston[group]
            if inertia > 0.0:
                w0, w1, _, _ = words_of_all(parameters, OF_BAROSTAT + group)
                noise, _ = normal_pair(w0, w1)
                heat = parameters[KT] * numbers[UNIT]
                spread = sqrt((1.0 - keep * keep) * heat / inertia)
                cell.piston[group] = keep * before + spread * noise
                note_heat(mpi, parameters, numbers, group, before, cell.piston[group])


@inlined
def note_heat(mpi, parameters, numbers, group, before, after):
    """Note, on rank 0, the energy that a thermostat gives to a rate of strain."""
    if mpi.rank == 0:
        given = 0.5 * numbers[INERTIA + group] * (after * after - before * before)
        parameters[HEAT] += given / numbers[UNIT]


@loop
def see_virial(
    mpi: Mpi, step: L1, begin_step: L1, end_step: L1, dt: F, cell: Piston, box: PeriodicBox
):
    """The molecular virial of the new forces; these act on a piston that has just moved."""
    numbers, tilted = cell.barostat, cell.barostat[TILTED] > 0.0
    count = TILT_SPREAD + 3 - SPREAD if tilted else 3
    add_up(mpi, numbers[SPREAD : SPREAD + count], cell.cell_sums[0:count])
    for k in range(3):
        numbers[VIRIAL + k] = cell.forces_virial[k] - cell.cell_sums[k]
        if tilted:
            of_tilt = cell.cell_sums[TILT_SPREAD - SPREAD + k]
            numbers[VIRIAL + XY + k] = cell.forces_virial[XY + k] - of_tilt
    if numbers[OPEN] > 0.0:
        part = part_of_run(step, begin_step, end_step)
        push(cell, box, part, 0.5 * dt * numbers[EVERY])
        numbers[OPEN] = 0.0


class Mtk(ConstantPressure):
    """What an integrator with a piston has besides its thermostat.

    Attributes:
        piston: (PISTON,), see above; the begin of its own state.
    """

    numbers = MTK_NUMBERS
    piston = _state = None

    @property
    def method(self):
        return f"{super().method}, and the piston of Martyna, Tobias and Klein"

    @property
    def own_words(self):
        return (*super().own_words, type(self).__name__, *self.axes)

    def own_state(self):
        if self._state is None:
            others = super().own_state()
            self._state = np.zeros(PISTON + len(others))
            self.piston = self._state[:PISTON]
            if len(others):
                self.chains = self._state[PISTON:]
        return self._state

    def cell_loops(self, cells):
        seen, _ = self.loops_of_others(cells)
        return [self.virial_of_bodies(cells), *seen, see_virial.bind_to(cells)], []

    def loops_behind(self, cells):
        return self.loops_of_others(cells)[1]

    def own_parameters(self):
        own = super().own_parameters()
        return (*own, *(0.0,) * (SHEARS - PARAMETERS - len(own)), float(self.flips))

    def heat(self):
        """The k T that the piston's inertia is of: of the highest temperature of the run."""
        return self.lammps.boltz * max(self.temperature()[:2])

    def own_numbers(self):
        numbers, d, axes = super().own_numbers(), self.lammps.dimension, self.axes
        freedom = self.degrees()[0]
        if not freedom > 0:
            raise RunError(
                "no centre of mass can move against another, so there is no pressure for the "
                "piston: use more bodies, or thermostat langevin",
                everywhere=True,
            )
        damping = self.damping * (self._slower(freedom) if self.command.line.replaces else 1.0)
        inertia = (freedom + d) * self.heat() * damping**2
        for group in range(COMPONENTS):
            numbers[INERTIA + group] = (axes == group).sum() / d * inertia
        numbers[RATE], numbers[FREEDOM] = 1.0 / damping, freedom
        self._inertia = numbers[INERTIA : INERTIA + COMPONENTS]
        return numbers

    def _slower(self, freedom):
        """How much longer the period of the box is with LAMMPS's fix rigid, for the same PDAMP;
        collective.

        Its inertia counts the rotation, each axis has all of it, and it is pushed for half of each
        step.

        Args:
            freedom: the degrees of freedom that the inertia counts here.
        """
        bodies, d = self.bodies, self.lammps.dimension
        of_bodies = thermo.freedom(bodies, d)[bodies.sharers.owned].sum()
        every = self.communicator.total(np.array([of_bodies]))[0]
        return np.sqrt(2 * d * (every + d) / (freedom + d))

    def own_cells(self):
        return super().own_cells() | {"piston": Cell(F1, self.piston)}

    @hook
    def compute_scalar(self):
        """As `NVT`, with the work against the pressure and the energy of the piston; collective."""
        others = super().compute_scalar()
        return (
            others + self.piston[PV] + 0.5 * (self._inertia * self.piston[:COMPONENTS] ** 2).sum()
        )
