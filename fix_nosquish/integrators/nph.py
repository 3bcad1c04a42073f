"""NPH: rigid bodies at constant pressure and enthalpy, with a piston; see `mtk`."""

from collections.abc import Mapping

from .barostat import PRESSURE
from .ensemble import Ensemble
from .mtk import Mtk
from .thermostat import EnsemblePart


class NPH(Ensemble):
    """fix ID group nosquish/nph BODYSTYLE iso PSTART PSTOP PDAMP ..."""

    keywords = PRESSURE
    barostats: Mapping[str, type[EnsemblePart]] = {"mtk": Mtk}
