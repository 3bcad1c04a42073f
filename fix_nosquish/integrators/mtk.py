"""A piston: the pressure drives the box, and with it the centres of mass.

Martyna, Tobias and Klein, J. Chem. Phys. 101, 4177 (1994), for the bodies' translation.  With the
strain rate e of axis k, which coupled axes share, the sum S of the strain rates over the axes, N
translational degrees of freedom, and the inertia W,

    dR_k/dt = V_k + e R_k          M dV_k/dt = F_k - (e + S / N) M V_k
    W de/dt = sum over its axes of  virial_k - P_k volume + sum M V_k^2 + sum M V^2 / N

A tilt also has a strain rate: for xy, of x with y.  Its virial is the force along x times the
position along y, and only the shear itself changes velocities.  If tilts change, S is a weighted
sum over the axes.

Each term depends on positions or on velocities, so the step can be time-symmetric, B A D A B:

    B   F_k acts on the bodies, virial_k - P_k volume on e
    D   half of the strain, sum M V_k^2 + sum M V^2 / N acts on e, half of the strain; each half is
        a strain of the axes and, on the inner side, a strain of the tilts

The piston's thermostat acts in the middle of D.  The box therefore has the correct distribution
even if its fast oscillation is badly resolved.  Nose-Hoover chains and velocity rescaling also act
on the bodies there; the Langevin thermostat acts on the bodies after D.

The kinetic energy that drives the piston is that in the middle of the step, like the temperature.
The piston moves every `box_every` steps, by the time of all these steps at once.
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
from ..loops.compiled import F1, L1, Cell, F, I, Loop, inlined, loop, record, untyped
from ..motion.block import COUNTED, LANES, MASS, Images, V, X, three
from ..motion.periodic import PeriodicBox
from ..motion.step import Operation, Scheme
from ..ranks.mpi import Mpi, add_up
from ..run.run import Run
from ..run.thermo import Thermo
from ..run.thermo import freedom as degrees_of_freedom
from .barostat import Barostat
from .nose_hoover import NoseHoover
from .nve import NVE
from .rescaling import REST
from .thermostat import Steps, Thermostat, part_of_run, set_temperature

PistonNumbers: Any = record(
    "PistonNumbers",
    BarostatNumbers,
    inertia=(F, 6),  # of each strain rate, 0 for unused ones
    freedom=F,  # translational degrees of freedom
    virial=(F, 6),  # molecular virial
    heavier=F,  # mass of the first thermostat of its chain / mass of the others
)
Piston: Any = record(
    "Piston",
    rates=(F, 6),  # strain rates
    work=F,  # done against the pressure
    inertia_kt=F,  # k T from which the inertia was computed
)
# for each tilt: axis of the displacement, and axis of the position to which it is proportional
FIRST, SECOND = (0, 0, 1), (1, 2, 2)
STRAINS = {
    "along": (F, 6),  # twice this rank's translational kinetic energy tensor
    "slow": (F, 3),  # factors of velocities, and the shear after them
    "slow_shear": (F, 3),
    "strain": (F, 3),  # the same for positions, and the centre of the strain
    "strain_shear": (F, 3),
    "centres": (F, 3),
    "shears": I,  # whether tilts change
}


class PistonBox(NamedTuple):
    """The box of a piston: see `cell.ChangingBox`."""

    barostat: PistonNumbers
    forces_virial: F1
    new_box: F1
    set_box: L1
    flip_box: L1
    piston: Piston


@inlined
def measure_along(block, kind, dt, parameters):
    """Add twice the translational kinetic energy tensor (xx yy zz xy xz yz) to `along`."""
    sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for b in range(LANES):
        x, y, z = three(block, V, b)
        sums = add_motion(sums, block[COUNTED, b] * block[MASS, b], x, y, z)
    for k in range(COMPONENTS):
        parameters.along[k] += sums[k]


@inlined
def dilate(block, kind, dt, parameters):
    """Apply the strain to the centres of mass, and the factors and shear to their velocities."""
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
    """Change the strain rates by the virial and the target pressure for a time dt."""
    barostat, volume = cell.barostat, volume_of(box, cell.barostat)
    axes, rates = barostat.axes, cell.piston.rates
    for k in range(COMPONENTS):
        if axes[k] >= 0:
            force = barostat.virial[k] - pressure_now(barostat, k, part) * volume
            rates[axes[k]] += dt * force / barostat.inertia[axes[k]]


@inlined
def strain(parameters, cell, box, part, dt):
    """Update the factors, and the kinetic energies, by the strain rates of the axes."""
    barostat, total, against, volume = cell.barostat, 0.0, 0.0, volume_of(box, cell.barostat)
    axes, rates, weighted = barostat.axes, cell.piston.rates, 0.0
    along = motion_of(barostat.total)
    for k in range(3):
        volume *= barostat.stretch[k]
        if axes[k] >= 0:
            total += rates[axes[k]]
            weighted += barostat.weight[k] * rates[axes[k]]
            against += pressure_now(barostat, k, part) * rates[axes[k]]
    for k in range(3):
        rate = rates[axes[k]] if axes[k] >= 0 else 0.0
        factor, longer = exp(-dt * (rate + weighted / barostat.freedom)), exp(dt * rate)
        parameters.slow[k] *= factor
        along[k] *= factor * factor
        barostat.stretch[k] *= longer
        if barostat.tilted:  # a stretch after a shear is a different shear after the stretch
            stretch_shear(barostat.shear, k, longer)
            stretch_shear(parameters.slow_shear, k, factor)
            for n in range(3):
                along[XY + n] *= factor if FIRST[n] == k or SECOND[n] == k else 1.0
    expansion = dt * total
    longer = (
        dt * (1.0 + 0.5 * expansion) if abs(expansion) < 1e-7 else (exp(expansion) - 1.0) / total
    )
    cell.piston.work += against * volume * longer


@inlined
def stretch_shear(shear, axis, factor):
    """Convert a shear before the stretch of an axis to the equivalent shear after it."""
    for n in range(3):
        if FIRST[n] == axis:
            shear[n] *= factor
        if SECOND[n] == axis:
            shear[n] /= factor


@inlined
def tilt(parameters, cell, box, part, dt):
    """Update the shears, and the kinetic energies, by the strain rates of the tilts."""
    barostat, rates = cell.barostat, cell.piston.rates
    axes, along = barostat.axes, motion_of(barostat.total)
    xy = dt * rates[axes[XY]] if axes[XY] >= 0 else 0.0
    xz = dt * rates[axes[XZ]] if axes[XZ] >= 0 else 0.0
    yz = dt * rates[axes[YZ]] if axes[YZ] >= 0 else 0.0
    volume = volume_of(box, barostat)
    for k in range(3):
        volume *= barostat.stretch[k]
    against = xy * pressure_now(barostat, XY, part) + xz * pressure_now(barostat, XZ, part)
    cell.piston.work += (against + yz * pressure_now(barostat, YZ, part)) * volume
    both = 0.5 * xy * yz  # second-order term of the matrix exponential
    add_shear(barostat.shear, xy, xz + both, yz)
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
    """Compose a shear with another one, of these off-diagonal elements, that acts after it."""
    shear[1] += xz + xy * shear[2]
    shear[0] += xy
    shear[2] += yz


@inlined
def push_by_motion(cell, dt):
    """Change the strain rates by the kinetic energies for a time dt."""
    barostat, rates = cell.barostat, cell.piston.rates
    axes, along = barostat.axes, motion_of(barostat.total)
    shared = (along[0] + along[1] + along[2]) / barostat.freedom
    for k in range(COMPONENTS):
        if axes[k] >= 0:
            force = barostat.unit * (along[k] + barostat.weight[k] * shared)
            rates[axes[k]] += dt * force / barostat.inertia[axes[k]]


@inlined
def begin_move(mpi, parameters, due, cell, box, part, dt):
    """The first half of letter D, if a change of the box is due in this step.

    Returns:
        the change of twice the kinetic energy.
    """
    barostat, gained = cell.barostat, 0.0
    along = motion_of(barostat.total)
    for k in range(3):
        parameters.slow[k] = parameters.strain[k] = 1.0
        parameters.slow_shear[k] = parameters.strain_shear[k] = 0.0
    if due:
        half, count = 0.5 * dt * barostat.box_every, COMPONENTS if barostat.tilted else 3
        push(cell, box, part, half)
        add_up(mpi, parameters.along[0:count], along[0:count])
        for k in range(3):
            gained -= along[k]
            barostat.stretch[k], barostat.shear[k] = 1.0, 0.0
        strain(parameters, cell, box, part, half)
        if barostat.tilted:
            tilt(parameters, cell, box, part, half)
        push_by_motion(cell, half)
        for k in range(3):
            gained += along[k]
    for k in range(COMPONENTS):
        parameters.along[k] = 0.0
    return gained


@inlined
def end_move(parameters, due, cell, box, shift, part, dt):
    """The second half of letter D, and the change of the box, if it is due in this step.

    Returns:
        as `stretch_box`.
    """
    barostat, factor = cell.barostat, parameters.factor[0]
    if due:
        for k in range(COMPONENTS):
            motion_of(barostat.total)[k] *= factor * factor
        half = 0.5 * dt * barostat.box_every
        push_by_motion(cell, half)
        if barostat.tilted:
            tilt(parameters, cell, box, part, half)
        strain(parameters, cell, box, part, half)
        if stretch_box(cell, box, shift) < 0:
            return OUT_OF_BOUNDS
        for k in range(3):
            parameters.strain[k] = barostat.stretch[k]
            parameters.strain_shear[k] = barostat.shear[k]
            parameters.centres[k] = barostat.centre[k]
    return 0


@loop
def see_virial(mpi: Mpi, steps: Steps, dt: F, cell: PistonBox, box: PeriodicBox):
    """Compute the molecular virial of the new forces; if the box has just changed, complete B."""
    barostat = cell.barostat
    spread = spread_of(barostat.total)
    add_up(mpi, spread_of(barostat.sums), spread)
    for k in range(COMPONENTS):
        barostat.virial[k] = cell.forces_virial[k] - spread[k]
    if barostat.open:
        part = part_of_run(steps)
        push(cell, box, part, 0.5 * dt * barostat.box_every)
        barostat.open = 0


# ---------------------------------------------------------------- with a thermostat

# of each thermostat, and of `Thermostat` for none
_STEPS: dict[type[Thermostat], tuple[Scheme, Loop]] = {}


def _step(thermostat: type[Thermostat], owner: tuple[str, str]) -> tuple[Scheme, Loop]:
    """The step B A D O A B with a thermostat, or B A D A B without one, and the loop before D.

    Args:
        owner: the module that the loops belong to, and the prefix of their names.
    """
    letters, operations, measures = "B A D A B", NVE.operations, measure_along
    if letter := thermostat.operation:
        letters = "B A D O A B"
        operations = {**operations, "O": letter._replace(prepared=False, measures=None)}
        measures = _both(letter.measures) if letter.measures else measures
    dilation = Operation(dilate, prepared=True, measures=measures)
    scheme = Scheme(
        owner,
        letters,
        {**operations, "D": dilation},
        record(owner[1], thermostat.numbers, **STRAINS),
        work=thermostat.work,
        ends=(NVE.scheme.lead, NVE.scheme.tail),
    )
    return scheme, _preparing_loop(thermostat, scheme.numbers, owner)


def _both(measures: Callable) -> Callable:
    """The `measures` of a thermostat combined with that of the piston."""

    @inlined
    def both(block, kind, dt, parameters):
        measures(block, kind, dt, parameters)
        measure_along(block, kind, dt, parameters)

    return both


def _preparing_loop(thermostat: type[Thermostat], numbers: Any, owner: tuple[str, str]) -> Loop:
    """The loop before letters D and O."""
    acts, on_piston = thermostat.acts, thermostat.on_piston

    @untyped
    def prepares(
        mpi: Mpi, images: Images, parameters: numbers, dt: F, steps: Steps, cell: PistonBox,
        box: PeriodicBox, thermostat_state: F1,
    ) -> I:  # fmt: skip
        """Move the piston, if the box changes, and set the parameters of letters D and O.

        Returns:
            as `stretch_box`, and as the thermostat's `acts`.
        """
        due, part = is_due(steps.step, cell), set_temperature(parameters, steps)
        gained = begin_move(mpi, parameters, due, cell, box, part, dt)
        bursts = due and not is_in_bounds(cell.barostat)
        if due:
            on_piston(mpi, parameters, cell, thermostat_state, dt)
        error = acts(mpi, parameters, thermostat_state, dt, gained)
        moved = end_move(parameters, due, cell, box, images.shift, part, dt)
        return moved if bursts else min(error, moved)  # report the box: it also breaks chains

    return Loop(prepares, owner)


class Mtk(Barostat):
    """Keyword barostat mtk.

    Attributes:
        piston: its state, as a record.
    """

    method, numbers = ", and the piston of Martyna, Tobias and Klein", PistonNumbers
    state_size, forces_known = Piston.dtype.itemsize // 8, see_virial

    @classmethod
    def step_with(cls, thermostat: type[Thermostat], module: str) -> tuple[Scheme, Loop]:
        if thermostat not in _STEPS:
            _STEPS[thermostat] = _step(thermostat, (module, f"{thermostat.__qualname__}Piston"))
        return _STEPS[thermostat]

    @property
    def piston(self) -> Any:
        return Piston.of(self.state)

    def kind_of_state(self) -> tuple:
        return "mtk", *self.axes

    def box_lists(self, cells: dict[str, Cell], moving: list) -> dict[str, list]:
        return {"after_motion": moving}

    def extra_parameters(self, run: Run) -> dict[str, Any]:
        return super().extra_parameters(run) | {"shears": self.flips}

    def _heat(self, run: Run) -> float:
        """The k T of the piston's inertia: of the highest temperature of the run; without a
        thermostat, of the bodies at the start of their first run, or LAMMPS's default if they are
        at rest; collective."""
        lammps = run.lammps
        if self.ensemble.thermostat:
            return lammps.boltz * max(self.ensemble.temperature()[:2])
        if not self.piston.inertia_kt:
            kelvin = run.thermo.energies().temperature
            if not lammps.running:  # write_restart, perhaps before velocities are set
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

    def new_parameters(self, run: Run) -> np.record:
        parameters, d, axes = super().new_parameters(run), run.lammps.dimension, self.axes
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
            parameters.inertia[group] = (axes == group).sum() / d * inertia * slower**2
        parameters.rate, parameters.freedom = 1.0 / damping, freedom
        parameters.heavier = np.count_nonzero(parameters.inertia)
        if replaces and isinstance(self.ensemble.thermostat, NoseHoover):
            # The chain of fix rigid has masses d^2 and 1, times k T PDAMP^2; only half of its
            # friction acts, and it uses the mean energy of the axes as that of the piston.  These
            # masses damp a fast piston equally, and keep its energy at k T.
            parameters.rate = 1.0 / (shortest * np.sqrt(2 * np.count_nonzero(axes[:3] >= 0)))
            parameters.heavier = 2 * d * d
        return parameters

    def extra_cells(self, run: Run) -> dict[str, Cell]:
        return super().extra_cells(run) | {"piston": Cell(Piston, self.piston)}

    def with_energy(self, scalar: float) -> float:
        """The scalar plus the work against the pressure and the energy of the piston."""
        moving = 0.5 * (self.parameters.inertia * self.piston.rates**2).sum()
        return scalar + self.piston.work + moving


def _slower(freedom: float, thermo: Thermo) -> float:
    """The period of the box with LAMMPS's fix rigid divided by that here, for the same PDAMP;
    collective.

    There the inertia includes the rotational degrees of freedom, each axis has the whole inertia,
    and the pressure acts for half of each step.

    Args:
        freedom: the degrees of freedom in the inertia here.
    """
    bodies, d = thermo.bodies, thermo.lammps.dimension
    of_bodies = degrees_of_freedom(bodies, d)[bodies.sharers.owned].sum()
    every = thermo.ranks.total(np.array([of_bodies]))[0]
    return np.sqrt(2 * d * (every + d) / (freedom + d))
