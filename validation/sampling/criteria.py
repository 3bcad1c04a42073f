"""The bounds of ``sampling``, all in one place, and what is held against them.

They are the errors that users accept today at 2 fs, and a cost that was set as a goal before the
data.
"""

from collections.abc import Iterator, Mapping

from validation.ensembles.lengths import LEAST
from validation.statistics.check import Check
from validation.statistics.estimate import Estimate

# of biases, in the observables' units: kcal/mol a molecule, atm, %
BOUNDS = {"potential": 0.006, "pressure": 25.0, "torque": 1.0}
UNITS = {"potential": "kcal/mol a molecule", "pressure": "atm", "torque": "%"}
NAMES = {
    "potential": "bias of the mean potential energy",
    "pressure": "bias of the mean pressure",
    "torque": "bias of the mean squared torque",
}
KNOWN = 0.5  # largest margin of a cost that is held against a bound, over the cost
LESS = 5.0  # times that an independent sample is to cost less than what users have today
TITLES = {"bias": "Averages within the bounds", "cost": "Cost of an independent sample"}


def checks(summary: Mapping) -> list[Check]:
    """What is held against the bounds: our points, at longer steps than those of today."""
    if summary["settings"]["time"] < LEAST:
        return []
    today = summary["known"][0]["dt"]
    rows = [row for row in summary["rows"] if row["ours"] and row["dt"] > today]
    return [one for row in rows if not row["error"] for one in _of(row)]


def _of(row: Mapping) -> Iterator[Check]:
    subject, wrong = f"{row['label']}, {row['dt']:g} fs", False
    for key, most in BOUNDS.items():
        if key in row["biases"]:
            found, ends = Estimate.of(row["biases"][key]), {"low": -most, "high": most}
            check = Check.of("bias", subject, NAMES[key], found, **ends, unit=UNITS[key])
            wrong |= check.holds is False
            yield check
    if wrong:
        return  # samples of something else are not worth their cost
    for scheme, less in row["less"].items():
        found = Estimate.of(less)
        # times that are known to a factor only are far from normal: their margins judge nothing
        if found.margin <= KNOWN * found.value:
            what = f"times less than with {scheme}, of the slowest observable"
            yield Check.of("cost", subject, what, found, low=LESS)
