"""The bounds of ``sample``, and the checks against them.

They were set before the data: the errors that users accept today at 2 fs, a smaller one for hybrid
Monte Carlo, and a goal for the cost.
"""

from collections.abc import Iterator, Mapping

from ..statistics.check import Check
from ..statistics.estimate import Estimate
from . import rivals
from .observables import BY_KEY, OBSERVABLES
from .plan import LEAST

# of biases, in the observables' units; 25 atm change the density of water by 0.1 %
BOUNDS = {"potential": 0.006, "pressure": 25.0, "torque": 1.0, "density": 0.2}
RELATIVE = 1.0  # %, of averages without their own bound
# errors that are not worth more time, even if a rival's is smaller: see `rivals`
LEAST_ERRORS = {
    observable.key: RELATIVE for observable in OBSERVABLES if observable.relative
} | BOUNDS
WITHOUT_BIAS = {"potential": 0.004}  # for hybrid Monte Carlo, which has no error of the step
DEVIATION = "slope of the ratio of distributions less the exact one", "sd"
# numbers that are not the bias of the mean in their title
NAMES = {
    "potential": "bias of the mean potential energy",
    "temperature": "mean of temp less the thermostat's",
    "apart": "temperature of translation less that of rotation",
}
WATERS = "water", "pressure"  # scenes whose temperatures are checked
# of the thermostat's temperature, and K between those of translation and rotation
TEMPERATURE = 0.01
APART = {
    "langevin-5": {4.0: 1.5, 6.0: 4.0},
    "langevin-20": {4.0: 0.5, 6.0: 1.0},
    "npt-langevin": {4.0: 1.5, 6.0: 4.0},
}
STATES = 2.0  # standard deviations: a correct scheme is within them in 19 of 20 cases
FASTER = 4.0  # least speed-up over the best rival, at the same error
TITLES = {
    "bias": "Averages within the bounds",
    "cost": "Time to the same error, beside the best rival",
    "limit": "The same forces have the same limit",
    "temperature": "Printed temperature",
    "equipartition": "Printed temperatures of translation and of rotation",
    "states": "Enthalpies at two temperatures, volumes at two pressures",
    # only in committed results, whose checks are kept
    "potential": "Bias of the mean potential energy",
    "trial": "The same bias beside that of a trial",
    "pressure": "Bias of the mean pressure",
    "density": "Bias of the mean density",
    "compressibility": "Compressibility from two pressures and from fluctuations",
}


def checks(summary: Mapping) -> list[Check]:
    """The checks of runs that are long enough to estimate their errors: of ours at longer steps
    than those in use today, and of other engines."""
    if summary["settings"]["time"] < LEAST:
        return []
    today = summary["known"][0]["dt"]
    results: list[Check] = []
    for row in summary["rows"]:
        longer = row["ours"] and row["dt"] > today
        if not row["error"] and (longer or row["engine"] in summary["others"]):
            results += _averages(row, summary)
    return [*results, *_gains(summary)]


def _averages(row: Mapping, summary: Mapping) -> Iterator[Check]:
    of_biases = BOUNDS | (WITHOUT_BIAS if row["scheme"].startswith("hmc") else {})
    bounds = [("bias", key, most) for key, most in of_biases.items()]
    if summary["scene"] in WATERS:
        bounds.append(("temperature", "temperature", TEMPERATURE * summary["temperature"]))
        apart = APART.get(row["scheme"], {}).get(row["dt"])
        bounds += [("equipartition", "apart", apart)] if apart else []
    bounds.append(("states", "deviation", STATES))
    numbers = row["biases"] | {"deviation": row["deviation"]}
    for part, key, within in bounds:
        if numbers.get(key):
            what, unit = _named(key)
            yield Check.of(
                part,
                _subject(row),
                what,
                Estimate.of(numbers[key]),
                low=-within,
                high=within,
                unit=unit,
            )


def _named(key: str) -> tuple[str, str]:
    """The description of a number with bounds, and its unit."""
    if key not in BY_KEY:
        return DEVIATION
    observable = BY_KEY[key]
    return NAMES.get(key, f"bias of the mean {observable.title}"), observable.unit


def _gains(summary: Mapping) -> Iterator[Check]:
    """Yield checks of the point with the best speed-ups over the rivals."""
    best = rivals.best(summary["rows"]) or {"faster": {}}
    for key, gain in best["faster"].items():
        goal = summary["goals"][key]
        yield Check.of(
            "cost",
            _subject(best),
            f"{BY_KEY[key].title}: times less time than {goal['label']} at {goal['dt']:g} fs",
            rivals.estimate(gain, FASTER),
            low=FASTER,
        )


def _subject(row: Mapping) -> str:
    return f"{row['label']}, {row['dt']:g} fs"
