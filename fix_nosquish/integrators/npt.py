"""NPT: rigid bodies at constant temperature and pressure; see `thermostat` and `barostat`."""

from collections.abc import Mapping

from .barostat import PRESSURE
from .crescale import Crescale
from .ensemble import TEMPERATURE, Ensemble
from .mtk import Mtk
from .nvt import THERMOSTATS
from .thermostat import EnsemblePart, Thermostat


class NPT(Ensemble):
    """fix ID group nosquish/npt BODYSTYLE temp ... iso PSTART PSTOP PDAMP ..."""

    keywords = *TEMPERATURE, *PRESSURE, "barostat"
    thermostats: Mapping[str, type[Thermostat]] = THERMOSTATS
    barostats: Mapping[str, type[EnsemblePart]] = {"crescale": Crescale, "mtk": Mtk}
