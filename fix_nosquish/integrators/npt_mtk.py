"""NPT with keyword barostat mtk: a thermostat of the bodies and of the piston; see `mtk`."""

from ..box.cell import COMPONENTS, is_due
from ..loops.compiled import F1, L1, F, I, inlined, loop, record
from ..motion.block import Images
from ..motion.periodic import PeriodicBox
from ..motion.step import Operation
from ..ranks.mpi import Mpi
from .constant_pressure import WITH_TEMPERATURE
from .constant_temperature import prepare
from .langevin import Langevin, thermalise
from .mtk import (
    DILATION,
    STRAINS,
    Mtk,
    PistonBox,
    Strained,
    begin_move,
    end_move,
    measure_along,
    note_heat,
    thermalise_piston,
)  # fmt: skip
from .nve import NVE
from .rescaling import (
    Rescaling,
    Scales,
    add_up_energies,
    measure,
    move_chain,
    move_chains,
    rescale,
    scale,
)  # fmt: skip

SPLITTING = "B A D O A B"
StrainedScales = record("StrainedScales", Scales, **STRAINS)


@loop
def dilation_and_langevin(
    mpi: Mpi, images: Images, parameters: Strained, dt: F, step: L1, begin_step: L1, end_step: L1,
    cell: PistonBox, box: PeriodicBox,
) -> I:  # fmt: skip
    """The factors of letter D, and the piston's friction and noise.

    Returns:
        as `stretch_box`.
    """
    part = prepare(parameters, step, begin_step, end_step)
    begin_move(mpi, parameters, step, cell, box, part, dt)
    thermalise_piston(mpi, parameters, step, cell, dt)
    return end_move(parameters, step, cell, box, images.shift, part, dt, 1.0)


@inlined
def measure_all(block, kind, dt, parameters):
    """Add twice the kinetic energies of the bodies to the sums."""
    measure(block, kind, dt, parameters)
    measure_along(block, kind, dt, parameters)


@loop
def dilation_and_rescaling(
    mpi: Mpi, images: Images, parameters: StrainedScales, dt: F, step: L1, begin_step: L1,
    end_step: L1, cell: PistonBox, box: PeriodicBox, sums: F1, separate: I,
) -> I:  # fmt: skip
    """The factors of letters D and O, and the piston's friction and noise.

    Returns:
        as `rescale` and `stretch_box`.
    """
    part = prepare(parameters, step, begin_step, end_step)
    add_up_energies(mpi, parameters, sums, separate)
    sums[0] += begin_move(mpi, parameters, step, cell, box, part, dt)
    thermalise_piston(mpi, parameters, step, cell, dt)
    wrong = rescale(mpi, parameters, dt, sums, separate)
    factor = parameters.factor[0]
    return min(wrong, end_move(parameters, step, cell, box, images.shift, part, dt, factor))


@inlined
def move_chain_of_piston(mpi, parameters, step, cell, chain, dt):
    """The chain on the rates of strain, if the box changes in this step."""
    numbers, twice, degrees = cell.barostat, 0.0, 0.0
    if is_due(step, cell):
        for group in range(COMPONENTS):
            rate = cell.piston.rates[group]
            twice += numbers.inertia[group] * rate * rate / numbers.unit
            degrees += 1.0 if numbers.inertia[group] > 0.0 else 0.0
        kt, time = parameters.kt, dt * numbers.box_every
        factor = move_chain(chain, chain.size // 2, twice, degrees, kt, numbers.rate, time)
        for group in range(COMPONENTS):
            before = cell.piston.rates[group]
            cell.piston.rates[group] = factor * before
            note_heat(mpi, parameters, numbers, group, before, cell.piston.rates[group])


@loop
def dilation_and_chains(
    mpi: Mpi, images: Images, parameters: StrainedScales, dt: F, step: L1, begin_step: L1,
    end_step: L1, cell: PistonBox, box: PeriodicBox, sums: F1, separate: I, chains: F1,
) -> I:  # fmt: skip
    """The factors of letters D and O, and the piston's chain.

    Returns:
        as `rescale` and `stretch_box`.
    """
    part, length = prepare(parameters, step, begin_step, end_step), chains.size // 3
    add_up_energies(mpi, parameters, sums, separate)
    sums[0] += begin_move(mpi, parameters, step, cell, box, part, dt)
    move_chain_of_piston(mpi, parameters, step, cell, chains[2 * length :], dt)
    wrong = move_chains(mpi, parameters, dt, sums, separate, chains[: 2 * length])
    factor = parameters.factor[0]
    return min(wrong, end_move(parameters, step, cell, box, images.shift, part, dt, factor))


class LangevinNPT(Mtk, Langevin):
    """`NPT` with keywords thermostat langevin and barostat mtk."""

    operations = NVE.operations | {"D": DILATION, "O": Operation(thermalise)}
    splitting, prepares, keywords = SPLITTING, dilation_and_langevin, WITH_TEMPERATURE


class RescalingNPT(Mtk, Rescaling):
    """`NPT` with keywords thermostat csvr or nh, and barostat mtk."""

    operations = NVE.operations | {
        "D": DILATION._replace(measures=measure_all), "O": Operation(scale),
    }  # fmt: skip
    splitting, splits, number_of_chains, numbers = SPLITTING, True, 3, StrainedScales
    keywords = WITH_TEMPERATURE

    @property
    def prepares(self):
        return dilation_and_chains if self.chained else dilation_and_rescaling
