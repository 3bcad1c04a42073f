"""Stochastic cell rescaling: the box, and with it the centres of mass, follow the pressure.

Bernetti and Bussi, J. Chem. Phys. 153, 114107 (2020), for the whole box or for some of its axes
together (Del Tatto et al., Appl. Sci. 12, 1139 (2022)).  With lambda = sqrt(V), for d coupled axes

    d lambda = -(beta d lambda / 6 tau) (P_0 - P - k T / 2 V) dt + sqrt(beta k T d / 6 tau) dW

Centres of mass are scaled with the box, velocities by the inverse; shapes are unchanged.  P is
therefore the molecular pressure, from the translational kinetic energy of the bodies and the virial
of the forces on their centres of mass.

The box changes after the bodies have moved and before their forces are computed, so no force of the
old box acts in the new one.

The energy that a change of the box adds to the system is counted like heat.  The change of the
kinetic energy is exact.  The change of the potential energy is the work of the mean of the forces
before and after, which is correct to second order in the change.
"""

from math import log, sqrt

import numpy as np

from ..box.cell import (
    COMPONENTS,
    OUT_OF_BOUNDS,
    XY,
    ChangingBox,
    add_motion,
    motion_of,
    pressure_now,
    shear_rows,
    spread_of,
    stretch_box,
    three_of,
    undone,
    volume_of,
)  # fmt: skip
from ..errors import RunError
from ..loops.compiled import F2, Cell, F, I, inlined, loop
from ..motion.block import HOME, MASS, Images, Layout, V, X, three
from ..motion.periodic import PeriodicBox
from ..motion.philox import normal_pair
from ..motion.step import place_all
from ..ranks.mpi import Mpi, add_up
from ..run.run import Run
from .barostat import Barostat
from .thermostat import OF_BAROSTAT, Bath, Steps, set_temperature, words_of_all

COMPRESSIBILITY = 4.6e-5  # of water, 1/atm
# the unit of pressure in atm
_PER_ATM = {
    "real": 1.0, "metal": 1 / 1.01325, "si": 1 / 101325.0, "cgs": 1 / 1013250.0,
    "electron": 1 / 101325.0,
}  # fmt: skip


@inlined
def find_stretch(parameters, cell, box, part, dt):
    """Set the factors of the axes, and the shear, for a time dt, from kinetic energy and virial."""
    kt, barostat = parameters.kt * cell.barostat.unit, cell.barostat
    motion, spread = motion_of(barostat.total), spread_of(barostat.total)
    volume = volume_of(box, barostat)
    for k in range(3):
        barostat.stretch[k] = 1.0
    for group in range(3):
        count, excess, weight = 0, 0.0, 0.0
        for k in range(3):
            if barostat.axes[k] == group:
                count += 1
                energy = motion[k] * barostat.unit
                energy += cell.forces_virial[k] - spread[k]
                excess += pressure_now(barostat, k, part) - energy / volume
                weight += barostat.weight[k]
        if count > 0:
            w0, w1, _, _ = words_of_all(parameters, OF_BAROSTAT + group)
            noise, _ = normal_pair(w0, w1)
            root, strength = sqrt(volume), barostat.rate * count * dt / 6.0
            root -= strength * root * (excess / count - (weight / count - 0.5) * kt / volume)
            root += sqrt(strength * kt) * noise
            factor, volume = root * root / volume, root * root
            if count == 2:
                factor = sqrt(factor)
            elif count == 3:
                factor = factor ** (1.0 / 3.0)
            for k in range(3):
                if barostat.axes[k] == group:
                    barostat.stretch[k] = factor
    if barostat.tilted:
        find_shear(parameters, cell, box, part, kt, barostat.rate * dt / 3.0)


@inlined
def find_shear(parameters, cell, box, part, kt, strength):
    """Set the shear from the off-diagonal components of the pressure tensor."""
    barostat, volume = cell.barostat, volume_of(box, cell.barostat)
    motion, spread = motion_of(barostat.total), spread_of(barostat.total)
    for k in range(3):
        barostat.shear[k] = 0.0
        if barostat.axes[XY + k] >= 0:
            w0, w1, _, _ = words_of_all(parameters, OF_BAROSTAT + XY + k)
            noise, _ = normal_pair(w0, w1)
            energy = motion[XY + k] * barostat.unit
            energy += cell.forces_virial[XY + k] - spread[XY + k]
            excess = pressure_now(barostat, XY + k, part) - energy / volume
            barostat.shear[k] = sqrt(2.0 * strength * kt / volume) * noise - strength * excess


@inlined
def measure_motion(state, rank, barostat):
    """Set `motion_of` to the sums of this rank's bodies: twice the kinetic energy tensor."""
    sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for b in range(state.shape[1]):
        if state[HOME, b] == rank:
            x, y, z = three(state, V, b)
            sums = add_motion(sums, state[MASS, b], x, y, z)
    for k in range(COMPONENTS):
        motion_of(barostat.sums)[k] = sums[k]


@inlined
def note_work(mpi, parameters, cell):
    """Add half of the work of the forces in a change of the box to this rank's heat: called once
    with the forces before the change, and once with the forces after it."""
    barostat, tilted = cell.barostat, cell.barostat.tilted
    spread = spread_of(barostat.sums)
    x, y, z = (log(barostat.stretch[0]), log(barostat.stretch[1]), log(barostat.stretch[2]))
    xy, xz, yz = three_of(barostat.shear)
    # logarithm of shear times stretch, to second order
    tilts = (
        xy + 0.5 * xy * (y - x), xz + 0.5 * xz * (z - x) - 0.5 * xy * yz, yz + 0.5 * yz * (z - y)
    )  # fmt: skip
    axes, heat = (x, y, z), 0.0
    for k in range(3):
        heat += axes[k] * spread[k]
        if tilted:
            heat += tilts[k] * spread[XY + k]
        if mpi.rank == 0:
            heat -= axes[k] * cell.forces_virial[k]
            if tilted:
                heat -= tilts[k] * cell.forces_virial[XY + k]
    parameters.heat += 0.5 * heat / barostat.unit


@inlined
def note_motion(parameters, barostat, sign):
    """Add this rank's translational kinetic energy, times sign, to its heat."""
    x, y, z = three_of(motion_of(barostat.sums))
    parameters.heat += 0.5 * sign * (x + y + z)


@loop
def end_change(mpi: Mpi, parameters: Bath, cell: ChangingBox):
    """Complete the work of a change of the box, when the forces in the new box are known."""
    if cell.barostat.open:
        note_work(mpi, parameters, cell)
        cell.barostat.open = 0


@loop
def rescale_cell(
    mpi: Mpi, layout: Layout, images: Images, atom_x: F2, parameters: Bath, dt: F,
    steps: Steps, cell: ChangingBox, box: PeriodicBox,
) -> I:  # fmt: skip
    """Change the box, scale the centres of mass and velocities, and set the positions of atoms.

    Returns:
        as `stretch_box`.
    """
    state, barostat = layout.state, cell.barostat
    tilted = barostat.tilted
    measure_motion(state, mpi.rank, barostat)
    add_up(mpi, barostat.sums, barostat.total)
    part = set_temperature(parameters, steps)
    find_stretch(parameters, cell, box, part, dt * barostat.box_every)
    if stretch_box(cell, box, images.shift) < 0:
        return OUT_OF_BOUNDS
    note_work(mpi, parameters, cell)
    shear, bodies = three_of(barostat.shear), state.shape[1]
    if tilted:
        note_motion(parameters, barostat, -1.0)
        shear_rows(state, V, bodies, undone(shear), 0.0, 0.0)
        measure_motion(state, mpi.rank, barostat)
        note_motion(parameters, barostat, 1.0)
    for k in range(3):
        slower = 1.0 / (barostat.stretch[k] * barostat.stretch[k])
        parameters.heat += 0.5 * motion_of(barostat.sums)[k] * (slower - 1.0)
    for k in range(3):
        factor, centre = barostat.stretch[k], barostat.centre[k]
        for b in range(bodies):
            state[X + k, b] = centre + factor * (state[X + k, b] - centre)
            state[V + k, b] /= factor
    if tilted:
        shear_rows(state, X, bodies, shear, barostat.centre[1], barostat.centre[2])
    place_all(layout, images, atom_x)
    return 0


class Crescale(Barostat):
    """Keyword barostat crescale."""

    method, keywords = ", and stochastic cell rescaling", ("seed", "compressibility")
    forces_known = end_change

    def box_lists(self, cells: dict[str, Cell], moving: list) -> dict[str, list]:
        return {"cell": [rescale_cell.bind_to(cells), *moving]}

    def new_parameters(self, run: Run) -> np.record:
        parameters, lammps = super().new_parameters(run), run.lammps
        damping = self.damping(lammps)
        if self.command.compressibility:
            compressibility = lammps.number(self.command.compressibility)
            self.command.refuse_unless_positive("keyword compressibility", compressibility)
        elif lammps.units in _PER_ATM:
            compressibility = COMPRESSIBILITY * _PER_ATM[lammps.units]
        else:
            raise RunError(
                f"keyword compressibility is missing: with units {lammps.units} it has no default",
                everywhere=True,
            )
        others = self.dampings[self.dampings != damping]
        if len(others):
            raise self.command.wrong(
                f"PDAMP is {damping:g} for one axis and {others[0]:g} for another: give all "
                "axes the same, or use barostat mtk"
            )
        parameters.rate = compressibility * lammps.nktv2p / damping
        return parameters
