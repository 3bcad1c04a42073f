"""NPH: rigid bodies at constant pressure and enthalpy, with a piston; see `mtk`."""

from collections.abc import Mapping
from typing import Any

from . import mtk
from .barostat import PRESSURE
from .ensemble import Ensemble
from .thermostat import Thermostat

mtk.put_in(Thermostat, __name__)


class NPH(Ensemble):
    """fix ID group nosquish/nph BODYSTYLE iso PSTART PSTOP PDAMP ..."""

    keywords = PRESSURE
    barostats: Mapping[str, Any] = {"mtk": mtk.Mtk}
