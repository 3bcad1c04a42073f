"""NVT: rigid bodies at constant temperature; see `thermostat`."""

from collections.abc import Mapping
from typing import Any

from .ensemble import TEMPERATURE, Ensemble

# by the words of keyword thermostat: modules of this package, and their classes
THERMOSTATS = {"langevin": "langevin.Langevin", "csvr": "csvr.Csvr", "nh": "nose_hoover.NoseHoover"}


class NVT(Ensemble):
    """fix ID group nosquish/nvt BODYSTYLE temp TSTART TSTOP TDAMP ..."""

    keywords = TEMPERATURE
    thermostats: Mapping[str, Any] = THERMOSTATS
