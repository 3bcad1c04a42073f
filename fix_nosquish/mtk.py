"""A piston: the box, and with it the centres of mass, move as the pressure drives them.

Martyna, Tobias and Klein, J. Chem. Phys. 101, 4177 (1994), for the bodies' translation.  With the
rate of strain e of axis k, which several axes may share, S their sum over the axes, N degrees of
freedom of translation, and the inertia W,

    dR_k/dt = V_k + e R_k          M dV_k/dt = F_k - (e + S / N) M V_k
    W de/dt = sum over its axes of  virial_k - P_k volume + sum M V_k^2 + sum M V^2 / N

Each term depends on positions or on velocities, so the step can be symmetric in time, B A D A B:

    B   F_k acts on the bodies, virial_k - P_k volume on e
    D   half of the strain, sum M V_k^2 + sum M V^2 / N acts on e, half of the strain

The piston's thermostat acts in the middle of D: so the box has the right distribution even where
its own oscillation, which is fast at a given arrangement of the bodies, is badly resolved.  Chains
and velocity rescaling act there on the bodies, too; Langevin's thermostat acts on these behind D.

The kinetic energy that drives the piston is that of the step's middle, as the temperature is.
Every so many steps the piston moves, for all of their time at once.
"""

from math import exp, sqrt
from typing import NamedTuple

import numpy as np

from . import cell
from .block import COUNTED, LANES, MASS, V, X
from .cell import (
    CENTRE,
    EVERY,
    NUMBERS,
    OPEN,
    OUT_OF_BOUNDS,
    RATE,
    SPREAD,
    STRETCH,
    UNIT,
    Barostat,
    pressure_now,
    stretch_box,
    volume_of,
)  # fmt: skip
from .compiled import F1, L1, Cell, F, inlined, loop
from .constant_pressure import ConstantPressure
from .errors import RunError
from .hosts import hook
from .migration import Box
from .mpi import DOUBLE, RANK, Mpi, add_up
from .nvt import COMMON, HEAT, KT, OF_BAROSTAT, part_of_run, words_of_all
from .operations import PARAMETERS
from .philox import normal_pair
from .step import Operation

# numbers behind those of `cell`: the inertia of each rate of strain, 0 where there is none; degrees
# of freedom of translation; the molecular virial
INERTIA, FREEDOM, VIRIAL, MTK_NUMBERS = NUMBERS, NUMBERS + 3, NUMBERS + 4, NUMBERS + 7
# the piston: rates of strain; the work done against the pressure; the k T that its inertia is of
WORK, INERTIA_KT, PISTON = 3, 4, 5
Piston = NamedTuple("Piston", [*Barostat.__annotations__.items(), ("piston", F1)])
# parameters behind those of all thermostats: twice this rank's kinetic energy along each axis;
# factors of velocities, of positions, and the points from which these count
ALONG, SLOW, STRAIN, CENTRES, BEHIND = range(COMMON + 6, COMMON + 21, 3)


@inlined
def measure_along(block, kind, dt, parameters):
    """Add twice the kinetic energies of translation along each axis to the sums."""
    for k in range(3):
        energy = 0.0
        for b in range(LANES):
            energy += block[COUNTED, b] * block[MASS, b] * block[V + k, b] * block[V + k, b]
        parameters[ALONG + k] += energy


@inlined
def dilate(block, kind, dt, parameters):
    """Strain the centres of mass, and slow their velocities down."""
    for k in range(3):
        longer, centre = parameters[STRAIN + k] - 1.0, parameters[CENTRES + k]
        for b in range(LANES):
            block[X + k, b] += longer * (block[X + k, b] - centre)
            block[V + k, b] *= parameters[SLOW + k]


DILATION = Operation(dilate, prepared=True, measures=measure_along)


@inlined
def push(cell, box, part, dt):
    """The forces act on the rates of strain for dt."""
    numbers, volume = cell.barostat, volume_of(box, cell.barostat)
    for k in range(3):
        if cell.axes[k] >= 0:
            force = numbers[VIRIAL + k] - pressure_now(numbers, k, part) * volume
            cell.piston[cell.axes[k]] += dt * force / numbers[INERTIA + cell.axes[k]]


@inlined
def is_due(step, cell):
    """Whether the box changes in this step."""
    return (step[0] - 1) % int(cell.barostat[EVERY]) == 0


@inlined
def strain(parameters, cell, box, part, dt):
    """Change the factors, and the kinetic energies with them, by what the rates of strain do."""
    numbers, total, against, volume = cell.barostat, 0.0, 0.0, volume_of(box, cell.barostat)
    for k in range(3):
        volume *= numbers[STRETCH + k]
        if cell.axes[k] >= 0:
            total += cell.piston[cell.axes[k]]
            against += pressure_now(numbers, k, part) * cell.piston[cell.axes[k]]
    for k in range(3):
        rate = cell.piston[cell.axes[k]] if cell.axes[k] >= 0 else 0.0
        factor = exp(-dt * (rate + total / numbers[FREEDOM]))
        parameters[SLOW + k] *= factor
        cell.cell_sums[k] *= factor * factor
        numbers[STRETCH + k] *= exp(dt * rate)
    much = dt * total
    longer = dt * (1.0 + 0.5 * much) if abs(much) < 1e-7 else (exp(much) - 1.0) / total
    cell.piston[WORK] += against * volume * longer


@inlined
def push_by_motion(cell, dt):
    """The kinetic energies act on the rates of strain for dt."""
    numbers, along = cell.barostat, cell.cell_sums
    shared = (along[0] + along[1] + along[2]) / numbers[FREEDOM]
    for k in range(3):
        if cell.axes[k] >= 0:
            force = numbers[UNIT] * (along[k] + shared)
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
    if is_due(step, cell):
        half = 0.5 * dt * numbers[EVERY]
        push(cell, box, part, half)
        add_up(mpi, DOUBLE, parameters[ALONG : ALONG + 3], along[0:3])
        for k in range(3):
            gained -= along[k]
            numbers[STRETCH + k] = 1.0
        strain(parameters, cell, box, part, half)
        push_by_motion(cell, half)
        for k in range(3):
            gained += along[k]
    for k in range(3):
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
        for k in range(3):
            cell.cell_sums[k] *= factor * factor
        half = 0.5 * dt * numbers[EVERY]
        push_by_motion(cell, half)
        strain(parameters, cell, box, part, half)
        if stretch_box(cell, box, shift) < 0:
            return OUT_OF_BOUNDS
        for k in range(3):
            parameters[STRAIN + k] = numbers[STRETCH + k]
            parameters[CENTRES + k] = numbers[CENTRE + k]
    return 0


@inlined
def thermalise_piston(mpi, parameters, step, cell, dt):
    """Friction and noise on the rates of strain, if the box changes in this step."""
    numbers = cell.barostat
    if is_due(step, cell):
        keep = exp(-numbers[RATE] * dt * numbers[EVERY])
        for group in range(3):
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
    if mpi.interface[RANK] == 0:
        given = 0.5 * numbers[INERTIA + group] * (after * after - before * before)
        parameters[HEAT] += given / numbers[UNIT]


@loop
def see_virial(mpi: Mpi, step: L1, begin_step: L1, end_step: L1, dt: F, cell: Piston, box: Box):
    """The molecular virial of the new forces; these act on a piston that has just moved."""
    numbers = cell.barostat
    add_up(mpi, DOUBLE, numbers[SPREAD : SPREAD + 3], cell.cell_sums[0:3])
    for k in range(3):
        numbers[VIRIAL + k] = cell.forces_virial[k] - cell.cell_sums[k]
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
        return [cell.virial_about_centres.bind_to(cells), see_virial.bind_to(cells)], []

    def own_parameters(self):
        own = super().own_parameters()
        return (*own, *(0.0,) * (BEHIND - PARAMETERS - len(own)))

    def heat(self):
        """The k T that the piston's inertia is of: of the highest temperature of the run."""
        return self.lammps.boltz * max(self.temperature()[:2])

    def own_numbers(self):
        numbers, d, axes = super().own_numbers(), self.lammps.dimension, self.axes
        damping, freedom = self.damping, self.degrees()[0]
        if not freedom > 0:
            raise RunError(
                "no centre of mass can move against another, so there is no pressure for the "
                "piston: use more bodies, or thermostat langevin",
                everywhere=True,
            )
        inertia = (freedom + d) * self.heat() * damping**2
        for group in range(3):
            numbers[INERTIA + group] = (axes == group).sum() / d * inertia
        numbers[RATE], numbers[FREEDOM] = 1.0 / damping, freedom
        self._inertia = numbers[INERTIA : INERTIA + 3]
        return numbers

    def own_cells(self):
        return super().own_cells() | {"piston": Cell(F1, self.piston)}

    @hook
    def compute_scalar(self):
        """As `NVT`, with the work against the pressure and the energy of the piston; collective."""
        others = super().compute_scalar()
        return others + self.piston[WORK] + 0.5 * (self._inertia * self.piston[:3] ** 2).sum()
