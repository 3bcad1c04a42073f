"""NPT: rigid bodies at constant temperature and pressure.

`NVT`, and every so many steps the box follows the pressure, in the middle of the step beside the
thermostat, B A C O A B: forces are computed anew before they are used again.  See `cell`.
"""

import numpy as np

from .cell import (
    BAROSTAT,
    CELL_END,
    P_START,
    P_STOP,
    RATE_OF_CELL,
    SPACE,
    UNIT,
    measure_motion,
    rescale_cell,
    stretch,
    virial_about_centres,
)
from .command import Command
from .compiled import F1, L1, Cell, F, I, loop
from .errors import RunError
from .langevin import Langevin
from .migration import Box
from .mpi import Mpi
from .nvt import NVT, prepare
from .rescaling import Rescaling, rescale_by_chains, rescale_stochastically, use_factors
from .step import Operation

WITH_CELL = "B A C O A B"
MOVES_CELL = Operation(stretch, prepared=True, measures=measure_motion)


@loop
def move_cell(
    mpi: Mpi, parameters: F1, cell_dt: F, step: L1, begin_step: L1, end_step: L1,
    cell_sums: F1, forces_virial: F1, barostat: F1, axes: L1, box: Box, shift: F2, new_box: F1,
    setter: L1,
):  # fmt: skip
    """The box, and the temperature of Langevin's thermostat."""
    part = prepare(parameters, step, begin_step, end_step)
    rescale_cell(
        mpi, parameters, cell_sums, forces_virial, barostat, axes, box, shift, new_box, setter,
        part, cell_dt,
    )  # fmt: skip


@loop
def move_cell_and_rescale(
    mpi: Mpi, parameters: F1, cell_dt: F, step: L1, begin_step: L1, end_step: L1,
    cell_sums: F1, forces_virial: F1, barostat: F1, axes: L1, box: Box, shift: F2, new_box: F1,
    setter: L1, dt: F, sums: F1, separate: I, chains: F1, chained: I,
) -> I:  # fmt: skip
    """The box, and the factors of a thermostat that scales all velocities."""
    part = prepare(parameters, step, begin_step, end_step)
    rescale_cell(
        mpi, parameters, cell_sums, forces_virial, barostat, axes, box, shift, new_box, setter,
        part, cell_dt,
    )  # fmt: skip
    add_up_energies(mpi, parameters, sums)
    sums[0] = cell_sums[0] + cell_sums[1] + cell_sums[2]
    join(sums, separate)
    if chained:
        found = rescale_by_chains(parameters, sums, chains, dt)
    else:
        found = rescale_stochastically(parameters, sums, dt)
    use_factors(mpi, parameters, sums, separate)
    return found
