"""NPT: rigid bodies at constant temperature and pressure.

`NVT`, and a box that changes every so many steps: by stochastic cell rescaling, see `crescale`, or
by a piston, see `mtk`.
"""

from ..host.command import Command
from .constant_pressure import ConstantPressure
from .crescale import StochasticCell
from .langevin import Langevin
from .nvt import NVT
from .rescaling import Rescaling


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


class LangevinNPT(StochasticCell, NPT, Langevin):
    """`NPT` with keyword thermostat langevin."""


class RescalingNPT(StochasticCell, NPT, Rescaling):
    """`NPT` with keyword thermostat csvr or nh."""
