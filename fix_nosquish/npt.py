"""NPT: rigid bodies at constant temperature and pressure.

`NVT`, and a box that changes every so many steps: by stochastic cell rescaling, see `cell`, or by a
piston, see `mtk`.
"""

from . import cell
from .cell import NUMBERS, RATE
from .command import Command
from .constant_pressure import ConstantPressure
from .errors import RunError
from .langevin import Langevin
from .nvt import NVT
from .rescaling import Rescaling

COMPRESSIBILITY = 4.6e-5  # of water, 1/atm
# atm that the unit of pressure is
_PER_ATM = {
    "real": 1.0, "metal": 1 / 1.01325, "si": 1 / 101325.0, "cgs": 1 / 1013250.0,
    "electron": 1 / 101325.0,
}  # fmt: skip


class NPT(ConstantPressure):
    """fix python/move "fix_nosquish.NPT GROUP BODYSTYLE temp ... iso PSTART PSTOP PDAMP ...".

    Besides the words of `NVT` it takes those of `keywords`.  It makes an instance of the class that
    has the thermostat and the barostat.
    """

    keywords = (*NVT.keywords, *ConstantPressure.keywords, "barostat", "compressibility")

    def __new__(cls, ptr, words):
        if cls is NPT:
            command = Command.parse(words, cls.keywords)
            langevin = command.thermostat == "langevin"
            if command.barostat == "mtk":
                from . import npt_mtk

                cls = npt_mtk.LangevinNPT if langevin else npt_mtk.RescalingNPT
            else:
                cls = LangevinNPT if langevin else RescalingNPT
        return super().__new__(cls, ptr, words)


class StochasticCell(ConstantPressure):
    """What an integrator with stochastic cell rescaling has besides its thermostat."""

    numbers, modules = NUMBERS, (cell.__name__,)

    @property
    def method(self):
        return f"{super().method}, and stochastic cell rescaling"

    def cell_loops(self, cells):
        return [cell.virial_about_centres.bind_to(cells)], [cell.rescale_cell.bind_to(cells)]

    def own_numbers(self):
        numbers, lammps = super().own_numbers(), self.lammps
        if self.command.compressibility:
            compressibility = lammps.number(self.command.compressibility)
        elif lammps.units in _PER_ATM:
            compressibility = COMPRESSIBILITY * _PER_ATM[lammps.units]
        else:
            raise RunError(
                f"keyword compressibility is missing: with units {lammps.units} it has no default",
                everywhere=True,
            )
        numbers[RATE] = compressibility * lammps.nktv2p / self.damping
        return numbers


class LangevinNPT(StochasticCell, NPT, Langevin):
    """`NPT` with keyword thermostat langevin."""


class RescalingNPT(StochasticCell, NPT, Rescaling):
    """`NPT` with keyword thermostat csvr or nh."""
