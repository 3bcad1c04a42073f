"""NVT: rigid bodies at constant temperature; see `constant_temperature`."""

from ..host.command import Command
from .constant_temperature import ConstantTemperature


class NVT:
    """fix ID group nosquish/nvt BODYSTYLE temp TSTART TSTOP TDAMP ...

    Besides the words of `NVE` it takes those of `keywords`.  It makes what has the thermostat:
    `Langevin` or `Rescaling`.
    """

    keywords = ConstantTemperature.keywords

    def __init_subclass__(cls):
        raise TypeError("NVT only chooses a class: derive from Langevin or Rescaling")

    def __new__(cls, ptr, line):
        if Command.parse(line, cls.keywords).thermostat == "langevin":
            from .langevin import Langevin as chosen
        else:
            from .rescaling import Rescaling as chosen
        return chosen(ptr, line)
