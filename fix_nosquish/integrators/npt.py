"""NPT: rigid bodies at constant temperature and pressure; see `constant_pressure`."""

from ..host.command import Command
from .constant_pressure import WITH_TEMPERATURE


class NPT:
    """fix ID group nosquish/npt BODYSTYLE temp ... iso PSTART PSTOP PDAMP ...

    Besides the words of `NVT` it takes those of `keywords`.  It makes what has the thermostat and
    the barostat.
    """

    keywords = WITH_TEMPERATURE

    def __init_subclass__(cls):
        raise TypeError("NPT only chooses a class: derive from a class of npt_crescale or npt_mtk")

    def __new__(cls, ptr, line):
        command = Command.parse(line, cls.keywords)
        if command.barostat == "mtk":
            from . import npt_mtk as module
        else:
            from . import npt_crescale as module
        langevin = command.thermostat == "langevin"
        return (module.LangevinNPT if langevin else module.RescalingNPT)(ptr, line)
