"""The steps with a piston, for the thermostats of this package."""

from . import mtk
from .csvr import Csvr
from .langevin import Langevin
from .nose_hoover import NoseHoover

for thermostat in Langevin, Csvr, NoseHoover:
    mtk.put_in(thermostat, __name__)
Mtk = mtk.Mtk
