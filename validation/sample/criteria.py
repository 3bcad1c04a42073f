"""The bounds of ``sample``, all in one place, and what is held against them.

They were set before the data: the errors that users accept today at 2 fs, of hybrid Monte Carlo a
smaller one, and a cost that was set as a goal.
"""

from collections.abc import Iterator, Mapping

from ..statistics.check import Check
from ..statistics.estimate import Estimate
from .plan import LEAST

# of biases, in the observables' units; 25 atm change the density of water by 0.1 %
BOUNDS = {"potential": 0.006, "pressure": 25.0, "torque": 1.0, "density": 0.2}
WITHOUT_BIAS = {"potential": 0.004}  # of hybrid Monte Carlo, which has no error of the step
UNITS = {
    "potential": "kcal/mol a molecule",
    "pressure": "atm",
    "torque": "%",
    "density": "%",
    "temperature": "K",
    "apart": "K",
    "deviation": "sd",
}
NAMES = {
    "potential": "bias of the mean potential energy",
    "pressure": "bias of the mean pressure",
    "torque": "bias of the mean squared torque",
    "density": "bias of the mean density",
    "temperature": "mean of temp less the thermostat's",
    "apart": "temperature of translation less that of rotation",
    "deviation": "slope of the ratio of distributions less the exact one",
}
WATERS = "water", "pressure"  # scenes of which temperatures are judged
# of the thermostat's temperature, and K between those of translation and rotation
TEMPERATURE = 0.01
APART = {
    "langevin-5": {4.0: 1.5, 6.0: 4.0},
    "langevin-20": {4.0: 0.5, 6.0: 1.0},
    "npt-langevin": {4.0: 1.5, 6.0: 4.0},
}
STATES = 2.0  # standard deviations: a right scheme is within them in 19 of 20 cases
KNOWN = 0.5  # largest margin of a cost that is held against a bound, over the cost
LESS = 5.0  # times that an independent sample is to cost less than what users have today
TITLES = {
    "bias": "Averages within the bounds",
    "cost": "Cost of an independent sample",
    "limit": "The same forces have the same limit",
    "temperature": "Printed temperature",
    "equipartition": "Printed temperatures of translation and of rotation",
    "states": "Enthalpies at two temperatures, volumes at two pressures",
    # of committed results only, whose checks are kept
    "potential": "Bias of the mean potential energy",
    "trial": "The same bias beside that of a trial",
    "pressure": "Bias of the mean pressure",
    "density": "Bias of the mean density",
    "compressibility": "Compressibility from two pressures and from fluctuations",
}


def checks(summary: Mapping) -> list[Check]:
    """What is held against the bounds, of runs that are long enough to tell their own errors: ours
    at longer steps than those of today, and other engines."""
    if summary["settings"]["time"] < LEAST:
        return []
    today, made = summary["known"][0]["dt"], []
    for row in summary["rows"]:
        longer = row["ours"] and row["dt"] > today
        if not row["error"] and (longer or row["engine"] in summary["others"]):
            averages = [*_averages(row, summary)]
            made += averages
            if all(check.holds is not False for check in averages):
                # samples of something else are not worth their cost
                made += _cost(row)
    return made


def _averages(row: Mapping, summary: Mapping) -> Iterator[Check]:
    exact = row["scheme"].startswith("hmc")
    bounds = [
        ("bias", key, most) for key, most in (BOUNDS | WITHOUT_BIAS if exact else BOUNDS).items()
    ]
    if summary["scene"] in WATERS:
        bounds.append(("temperature", "temperature", TEMPERATURE * summary["temperature"]))
        apart = APART.get(row["scheme"], {}).get(row["dt"])
        bounds += [("equipartition", "apart", apart)] if apart else []
    bounds.append(("states", "deviation", STATES))
    numbers = row["biases"] | {"deviation": row["deviation"]}
    for part, key, within in bounds:
        if numbers.get(key):
            ends: dict = {"low": -within, "high": within, "unit": UNITS[key]}
            yield Check.of(part, _subject(row), NAMES[key], Estimate.of(numbers[key]), **ends)


def _cost(row: Mapping) -> Iterator[Check]:
    for scheme, less in row["less"].items():
        found = Estimate.of(less)
        # times that are known to a factor only are far from normal: their margins judge nothing
        if found.margin <= KNOWN * found.value:
            what = f"times less than with {scheme}, of the slowest observable"
            yield Check.of("cost", _subject(row), what, found, low=LESS)


def _subject(row: Mapping) -> str:
    return f"{row['label']}, {row['dt']:g} fs"
