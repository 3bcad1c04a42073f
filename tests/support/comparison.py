"""Rows as the verb compare has them."""

from validation.statistics import measures
from validation.statistics.estimate import Estimate


def row(dt, name="nosquish", cost=(1.0,), **errors):
    """A row with errors of (value, standard error)."""
    told = {key: Estimate(*one).plain() for key, one in errors.items()}
    return {
        **{"integrator": name, "label": name, "dt": dt, "lines": [f"fix 1 all {name} molecule"]},
        **{"failed": None, "failures": 0, "starts": 2, "time": 100.0, "ours": "nos" in name},
        **{"is_reference": False, "asked": True, "alone": False, "without": []},
        **{"share": 100.0, "thermostat": None},
        **{
            **dict.fromkeys(("cost", "cpu"), None if cost is None else measures.spread(cost)),
            "place": "These lines replace fix 1 (nve)",
        },
        **{"errors": told, "signed": told, "by_itself": told, "lost": []},
    }
