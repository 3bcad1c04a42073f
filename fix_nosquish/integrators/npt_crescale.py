"""NPT with keyword barostat crescale: a thermostat and a box that is rescaled; see `crescale`."""

from .constant_pressure import WITH_TEMPERATURE
from .crescale import StochasticCell
from .langevin import Langevin
from .rescaling import Rescaling


class LangevinNPT(StochasticCell, Langevin):
    """`NPT` with keyword thermostat langevin."""

    keywords = WITH_TEMPERATURE


class RescalingNPT(StochasticCell, Rescaling):
    """`NPT` with keyword thermostat csvr or nh."""

    keywords = WITH_TEMPERATURE
