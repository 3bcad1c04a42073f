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

from collections.abc import Callable
from math import exp
from typing import Any, NamedTuple

import numpy as np

from ..box.cell import (
    COMPONENTS,
    OUT_OF_BOUNDS,
    XX,
    XY,
    XZ,
    YY,
    YZ,
    BarostatNumbers,
    add_motion,
    is_due,
    is_in_bounds,
    motion_of,
    pressure_now,
    shear_rows,
    spread_of,
    stretch_box,
    three_of,
    volume_of,
)  # fmt: skip
from ..errors import refuse
from ..loops.compiled import F1, L1, Cell, F, I, Loop, inlined, loop, record
from ..motion.block import COUNTED, LANES, MASS, Images, V, X, three
from ..motion.periodic import PeriodicBox
from ..motion.step import Operation, Scheme
from ..ranks.mpi import Mpi, add_up
from ..run.thermo import Thermo
from ..run.thermo import freedom as degrees_of_freedom
from .barostat import Barostat
from .nve import NVE
from .rescaling import REST
from .thermostat import Steps, Thermostat, part_of_run, prepare

PistonNumbers = record(
    "PistonNumbers",
    BarostatNumbers,
    inertia=(F, 6),  # of each rate of strain, 0 where there is none
    freedom=F,  # degrees of freedom of translation
    virial=(F, 6),  # the molecular one
    heavier=F,  # the first thermostat of its chain, as a multiple of the others' mass
)
Piston = record(
    "Piston",
    rates=(F, 6),  # of strain
    work=F,  # done against the pressure
    inertia_kt=F,  # the k T that the inertia is of
)
# of each tilt: the axis along which it moves what is further along the second one
FIRST, SECOND = (0, 0, 1), (1, 2, 2)
STRAINS = {
    "along": (F, 6),  # twice this rank's kinetic energy along each axis, and with each tilt
    "slow": (F, 3),  # factors of velocities, and what shears them then
    "slow_shear": (F, 3),
    "strain": (F, 3),  # the same of positions, and the points from which these count
    "strain_shear": (F, 3),
    "centres": (F, 3),
    "shears": I,  # whether tilts change
}


class PistonBox(NamedTuple):
    """What changes the box: see `cell.ChangingBox`."""

    barostat: PistonNumbers
    forces_virial: F1
    new_box: F1
    set_box: L1
    flip_box: L1
    piston: Piston


@inlined
def measure_along(block, kind, dt, parameters):
    """Add twice the kinetic energies of translation along each axis, and with each tilt."""
    sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for b in range(LANES):
        x, y, z = three(block, V, b)
        sums = add_motion(sums, block[COUNTED, b] * block[MASS, b], x, y, z)
    for k in range(COMPONENTS):
        parameters.along[k] += sums[k]


@inlined
def dilate(block, kind, dt, parameters):
    """Strain the centres of mass, and slow their velocities down."""
    for k in range(3):
        longer, centre = parameters.strain[k] - 1.0, parameters.centres[k]
        slow = parameters.slow[k]
        for b in range(LANES):
            block[X + k, b] += longer * (block[X + k, b] - centre)
            block[V + k, b] *= slow
    if parameters.shears:
        _, y0, z0 = three_of(parameters.centres)
        shear_rows(block, X, LANES, three_of(parameters.strain_shear), y0, z0)
        shear_rows(block, V, LANES, three_of(parameters.slow_shear), 0.0, 0.0)


@inlined
def push(cell, box, part, dt):
    """The forces act on the rates of strain for dt."""
    numbers, volume = cell.barostat, volume_of(box, cell.barostat)
    axes, rates = numbers.axes, cell.piston.rates
    for k in range(COMPONENTS):
        if axes[k] >= 0:
            force = numbers.virial[k] - pressure_now(numbers, k, part) * volume
            rates[axes[k]] += dt * force / numbers.inertia[axes[k]]


@inlined
def strain(parameters, cell, box, part, dt):
    """Change the factors, and the kinetic energies with them, by what the axes' rates do."""
    numbers, total, against, volume = cell.barostat, 0.0, 0.0, volume_of(box, cell.barostat)
    axes, rates, weighted = numbers.axes, cell.piston.rates, 0.0
    along = motion_of(numbers.total)
    for k in range(3):
        volume *= numbers.stretch[k]
        if axes[k] >= 0:
            total += rates[axes[k]]
            weighted += numbers.weight[k] * rates[axes[k]]
            against += pressure_now(numbers, k, part) * rates[axes[k]]
    for k in range(3):
        rate = rates[axes[k]] if axes[k] >= 0 else 0.0
        factor, longer = exp(-dt * (rate + weighted / numbers.freedom)), exp(dt * rate)
        parameters.slow[k] *= factor
        along[k] *= factor * factor
        numbers.stretch[k] *= longer
        if numbers.tilted:  # what acts after a shear makes it another one
            stretch_shear(numbers.shear, k, longer)
            stretch_shear(parameters.slow_shear, k, factor)
            for n in range(3):
                along[XY + n] *= factor if FIRST[n] == k or SECOND[n] == k else 1.0
    much = dt * total
    longer = dt * (1.0 + 0.5 * much) if abs(much) < 1e-7 else (exp(much) - 1.0) / total
    cell.piston.work += against * volume * longer


@inlined
def stretch_shear(shear, axis, factor):
    """What a shear is when it acts after an axis is stretched, not before."""
    for n in range(3):
        if FIRST[n] == axis:
            shear[n] *= factor
        if SECOND[n] == axis:
            shear[n] /= factor


@inlined
def tilt(parameters, cell, box, part, dt):
    """Change the shears, and the kinetic energies with them, by what the tilts' rates do."""
    numbers, rates = cell.barostat, cell.piston.rates
    axes, along = numbers.axes, motion_of(numbers.total)
    xy = dt * rates[axes[XY]] if axes[XY] >= 0 else 0.0
    xz = dt * rates[axes[XZ]] if axes[XZ] >= 0 else 0.0
    yz = dt * rates[axes[YZ]] if axes[YZ] >= 0 else 0.0
    volume = volume_of(box, numbers)
    for k in range(3):
        volume *= numbers.stretch[k]
    against = xy * pressure_now(numbers, XY, part) + xz * pressure_now(numbers, XZ, part)
    cell.piston.work += (against + yz * pressure_now(numbers, YZ, part)) * volume
    both = 0.5 * xy * yz  # of the exponential
    add_shear(numbers.shear, xy, xz + both, yz)
    xy, xz, yz = -xy, both - xz, -yz
    add_shear(parameters.slow_shear, xy, xz, yz)
    xx, yy, zz = three_of(along)
    of_xy, of_xz, of_yz = three_of(along[XY:])
    along[XX] = xx + xy * xy * yy + xz * xz * zz + 2.0 * (xy * of_xy + xz * of_xz + xy * xz * of_yz)
    along[YY] = yy + yz * yz * zz + 2.0 * yz * of_yz
    along[XY] = of_xy + xy * yy + xz * of_yz + yz * (of_xz + xy * of_yz + xz * zz)
    along[XZ] = of_xz + xy * of_yz + xz * zz
    along[YZ] = of_yz + yz * zz


@inlined
def add_shear(shear, xy, xz, yz):
    """Have another shear, 1 and these above the diagonal, act after the first one."""
    shear[1] += xz + xy * shear[2]
    shear[0] += xy
    shear[2] += yz


@inlined
def push_by_motion(cell, dt):
    """The kinetic energies act on the rates of strain for dt."""
    numbers, rates = cell.barostat, cell.piston.rates
    axes, along = numbers.axes, motion_of(numbers.total)
    shared = (along[0] + along[1] + along[2]) / numbers.freedom
    for k in range(COMPONENTS):
        if axes[k] >= 0:
            force = numbers.unit * (along[k] + numbers.weight[k] * shared)
            rates[axes[k]] += dt * force / numbers.inertia[axes[k]]


@inlined
def begin_move(mpi, parameters, due, cell, box, part, dt):
    """The first half of letter D, if the box changes in this step: if that is due.

    Returns:
        by how much twice the kinetic energy changes.
    """
    numbers, gained = cell.barostat, 0.0
    along = motion_of(numbers.total)
    for k in range(3):
        parameters.slow[k] = parameters.strain[k] = 1.0
        parameters.slow_shear[k] = parameters.strain_shear[k] = 0.0
    if due:
        half, count = 0.5 * dt * numbers.box_every, COMPONENTS if numbers.tilted else 3
        push(cell, box, part, half)
        add_up(mpi, parameters.along[0:count], along[0:count])
        for k in range(3):
            gained -= along[k]
            numbers.stretch[k], numbers.shear[k] = 1.0, 0.0
        strain(parameters, cell, box, part, half)
        if numbers.tilted:
            tilt(parameters, cell, box, part, half)
        push_by_motion(cell, half)
        for k in range(3):
            gained += along[k]
    for k in range(COMPONENTS):
        parameters.along[k] = 0.0
    return gained


@inlined
def end_move(parameters, due, cell, box, shift, part, dt):
    """The second half of letter D, if the box changes in this step, and the box itself.

    Returns:
        as `stretch_box`.
    """
    numbers, factor = cell.barostat, parameters.factor[0]
    if due:
        for k in range(COMPONENTS):
            motion_of(numbers.total)[k] *= factor * factor
        half = 0.5 * dt * numbers.box_every
        push_by_motion(cell, half)
        if numbers.tilted:
            tilt(parameters, cell, box, part, half)
        strain(parameters, cell, box, part, half)
        if stretch_box(cell, box, shift) < 0:
            return OUT_OF_BOUNDS
        for k in range(3):
            parameters.strain[k] = numbers.stretch[k]
            parameters.strain_shear[k] = numbers.shear[k]
            parameters.centres[k] = numbers.centre[k]
    return 0


@loop
def see_virial(mpi: Mpi, steps: Steps, dt: F, cell: PistonBox, box: PeriodicBox):
    """The molecular virial of the new forces; these act on a piston that has just moved."""
    numbers = cell.barostat
    spread = spread_of(numbers.total)
    add_up(mpi, spread_of(numbers.sums), spread)
    for k in range(COMPONENTS):
        numbers.virial[k] = cell.forces_virial[k] - spread[k]
    if numbers.open:
        part = part_of_run(steps)
        push(cell, box, part, 0.5 * dt * numbers.box_every)
        numbers.open = 0


# ---------------------------------------------------------------- with a thermostat

# of each step at constant volume, the one with a piston, and of each thermostat the loop before it
_SCHEMES: dict[Scheme | None, Scheme] = {}
_PREPARES: dict[type[Thermostat], Loop] = {}


def put_in(thermostat: type[Thermostat], module: str) -> None:
    """Make the loops of the step B A D O A B with a thermostat, or of B A D A B with none.

    Args:
        thermostat: what is derived from `Thermostat`, or this itself for none.
        module: the name of the one that the loops belong to.
    """
    owner = module, f"{thermostat.__qualname__}Piston"
    letters, operations, measures = "B A D A B", NVE.operations, measure_along
    of_volume = None
    if letter := thermostat.operation:
        letters, of_volume = "B A D O A B", thermostat.scheme
        operations = {**operations, "O": letter._replace(prepared=False, measures=None)}
        measures = _both(letter.measures) if letter.measures else measures
    if of_volume not in _SCHEMES:
        dilation = Operation(dilate, prepared=True, measures=measures)
        _SCHEMES[of_volume] = Scheme(
            owner,
            letters,
            {**operations, "D": dilation},
            record(owner[1], thermostat.numbers, **STRAINS),
            work=thermostat.work,
            ends=(NVE.scheme.lead, NVE.scheme.tail),
        )
    _PREPARES[thermostat] = _prepares(thermostat, _SCHEMES[of_volume].numbers, owner)


def _both(measures: Callable) -> Callable:
    """What measures for a thermostat, and for the piston."""

    @inlined
    def both(block, kind, dt, parameters):
        measures(block, kind, dt, parameters)
        measure_along(block, kind, dt, parameters)

    return both


def _prepares(thermostat: type[Thermostat], numbers: Any, owner: tuple[str, str]) -> Loop:
    """The loop before letters D and O."""
    acts, on_piston = thermostat.acts, thermostat.on_piston

    def prepares(
        mpi: Mpi, images: Images, parameters: numbers, dt: F, steps: Steps, cell: PistonBox,
        box: PeriodicBox, own_state: F1,
    ) -> I:  # fmt: skip
        """Move the piston, if the box changes, and find what letters D and O take.

        Returns:
            as `stretch_box`, and as the thermostat's `acts`.
        """
        due, part = is_due(steps.step, cell), prepare(parameters, steps)
        gained = begin_move(mpi, parameters, due, cell, box, part, dt)
        bursts = due and not is_in_bounds(cell.barostat)
        if due:
            on_piston(mpi, parameters, cell, own_state, dt)
        wrong = acts(mpi, parameters, own_state, dt, gained)
        moved = end_move(parameters, due, cell, box, images.shift, part, dt)
        return moved if bursts else min(wrong, moved)  # a box that bursts upsets chains, too

    return loop(prepares, owner)


class Mtk(Barostat):
    """Keyword barostat mtk.

    Attributes:
        piston: its state, as a record.
    """

    method, of_numbers = ", and the piston of Martyna, Tobias and Klein", PistonNumbers
    state_size = Piston.dtype.itemsize // 8

    def step_with(self, thermostat: type[Thermostat]) -> tuple[Scheme, Loop]:
        of_volume = thermostat.scheme if thermostat.operation else None
        return _SCHEMES[of_volume], _PREPARES[thermostat]

    @property
    def piston(self) -> Any:
        return Piston.of(self.state)

    def kind_of_state(self) -> list:
        return ["mtk", *self.axes]

    def extra_lists(self, run: Any, cells: dict[str, Cell]) -> dict[str, list]:
        seen, moved = self.loops_of_others(run, cells)
        pressure = [self.virial_of_bodies(cells), *seen, see_virial.bind_to(cells)]
        return super().extra_lists(run, cells) | {"pressure": pressure, "after_motion": moved}

    def extra_parameters(self, run: Any) -> dict[str, Any]:
        return super().extra_parameters(run) | {"shears": self.flips}

    def _heat(self, run: Any) -> float:
        """The k T that the piston's inertia is of: of the highest temperature of the run; without a
        thermostat, of the bodies as their first run begins, or LAMMPS's choice if they are at
        rest; collective."""
        lammps = run.lammps
        if self.ensemble.thermostat:
            return lammps.boltz * max(self.ensemble.temperature()[:2])
        if not self.piston.inertia_kt:
            kelvin = run.thermo.energies().temperature
            if not lammps.running:  # but a file is written, perhaps before they move
                return lammps.boltz * kelvin
            usual = 1.0 if lammps.units == "lj" else 300.0
            if not kelvin > REST * usual:
                kelvin = usual
                run.host.log(
                    "WARNING: the bodies are at rest, and their temperature would set the piston's "
                    f"inertia: it is that for a temperature of {usual:g}, as in fix rigid/nph\n"
                )
            self.piston.inertia_kt = lammps.boltz * kelvin
        return self.piston.inertia_kt

    def new_numbers(self, run: Any) -> np.record:
        numbers, d, axes = super().new_numbers(run), run.lammps.dimension, self.axes
        freedom = self.ensemble.momentum.degrees()[0]
        refuse(
            not freedom > 0,
            "no centre of mass can move against another, so there is no pressure for the "
            "piston: use more bodies, or thermostat langevin",
        )
        replaces, shortest = self.command.line.replaces, self.damping(run.lammps)
        damping = shortest * (_slower(freedom, run.thermo) if replaces else 1.0)
        inertia = (freedom + d) * self._heat(run) * damping**2
        for group in range(COMPONENTS):
            slower = self.dampings[group] / shortest
            numbers.inertia[group] = (axes == group).sum() / d * inertia * slower**2
        numbers.rate, numbers.freedom = 1.0 / damping, freedom
        numbers.heavier = np.count_nonzero(numbers.inertia)
        if replaces and self.command.thermostat == "nh":
            # The chain of fix rigid has masses d^2 and 1, times k T PDAMP^2, half of its friction
            # acts, and it takes the mean energy of the axes as that of the piston.  These masses
            # slow a fast piston down alike, and keep its energy at k T.
            numbers.rate = 1.0 / (shortest * np.sqrt(2 * np.count_nonzero(axes[:3] >= 0)))
            numbers.heavier = 2 * d * d
        return numbers

    def extra_cells(self, run: Any) -> dict[str, Cell]:
        return super().extra_cells(run) | {"piston": Cell(Piston, self.piston)}

    def with_energy(self, scalar: float) -> float:
        """With the work against the pressure and the energy of the piston."""
        moving = 0.5 * (self.numbers.inertia * self.piston.rates**2).sum()
        return scalar + self.piston.work + moving


def _slower(freedom: float, thermo: Thermo) -> float:
    """How much longer the period of the box is with LAMMPS's fix rigid, for the same PDAMP;
    collective.

    Its inertia counts the rotation, each axis has all of it, and it is pushed for half of each
    step.

    Args:
        freedom: the degrees of freedom that the inertia counts here.
    """
    bodies, d = thermo.bodies, thermo.lammps.dimension
    of_bodies = degrees_of_freedom(bodies, d)[bodies.sharers.owned].sum()
    every = thermo.ranks.total(np.array([of_bodies]))[0]
    return np.sqrt(2 * d * (every + d) / (freedom + d))
