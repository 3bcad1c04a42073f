"""NPT: rigid bodies at constant temperature and pressure; see `thermostat` and `barostat`."""

from collections.abc import Mapping
from typing import Any

from .barostat import PRESSURE
from .ensemble import TEMPERATURE, Ensemble
from .nvt import THERMOSTATS


class NPT(Ensemble):
    """fix ID group nosquish/npt BODYSTYLE temp ... iso PSTART PSTOP PDAMP ..."""

    keywords = *TEMPERATURE, *PRESSURE, "barostat", "compressibility"
    thermostats: Mapping[str, Any] = THERMOSTATS
    barostats: Mapping[str, Any] = {"crescale": "crescale.Crescale", "mtk": "npt_mtk.Mtk"}

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        from .npt_mtk import mtk  # with those of the package first

        for one in cls.thermostats.values():
            if isinstance(one, type):
                mtk.put_in(one, cls.__module__)
