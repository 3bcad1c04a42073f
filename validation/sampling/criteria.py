"""The bounds of ``sampling``, all in one place, and what is held against them.

They are the errors that users accept today at 2 fs, of hybrid Monte Carlo a smaller one, and a cost
that was set as a goal before the data.  Of the water that ``ensembles`` has, the bounds of
thermostats there are held here, too: many schemes tell the limit of small steps better than one run
with a very short step.
"""

from collections.abc import Iterator, Mapping

from ..ensembles import criteria as ensembles
from ..ensembles import plan
from ..ensembles.lengths import LEAST, Point
from ..statistics import measures
from ..statistics.check import Check
from ..statistics.estimate import Estimate

# of biases, in the observables' units: kcal/mol a molecule, atm, %
BOUNDS = {"potential": 0.006, "pressure": 25.0, "torque": 1.0}
WITHOUT_BIAS = {"potential": 0.004}  # of hybrid Monte Carlo, which has no error of the step
UNITS = {"potential": "kcal/mol a molecule", "pressure": "atm", "torque": "%"}
NAMES = {
    "potential": "bias of the mean potential energy",
    "pressure": "bias of the mean pressure",
    "torque": "bias of the mean squared torque",
}
KNOWN = 0.5  # largest margin of a cost that is held against a bound, over the cost
LESS = 5.0  # times that an independent sample is to cost less than what users have today
TITLES = {
    "bias": "Averages within the bounds",
    "cost": "Cost of an independent sample",
    **ensembles.TITLES,
}


def checks(summary: Mapping) -> list[Check]:
    """What is held against the bounds: our points, at longer steps than those of today."""
    if summary["settings"]["time"] < LEAST:
        return []
    today = summary["known"][0]["dt"]
    good = [row for row in summary["rows"] if not row["error"]]
    made = [one for row in good if row["ours"] and row["dt"] > today for one in _of(row)]
    if summary["title"] == plan.TITLE:
        there = {
            Point(row["scheme"], row["dt"]): _as_there(row, summary["temperature"])
            for row in good
            if row["scheme"] in plan.SCHEMES
        }
        known = {(one.subject, one.what, one.high) for one in made}
        made += [
            one
            for one in ensembles.checks(there, summary["settings"]["time"])
            if (one.subject, one.what, one.high) not in known
        ]
    return made


def _as_there(row: Mapping, temperature: float) -> dict[str, Estimate | None]:
    """A row's numbers by the names that they have in ``ensembles``; no bias without a limit.

    Translation and rotation have as many degrees of freedom.  Their noises are taken as independent
    of each other, as they are where each has its own: no other scheme has a bound of ``apart``.
    """
    biases = {key: Estimate.of(one) for key, one in row["biases"].items()}
    there = {"bias": biases.get("potential"), "pressure_bias": biases.get("pressure")}
    moves, turns = biases["translation"], biases["rotation"]
    apart = measures.difference(moves, turns)
    middle = Estimate(temperature + (moves.value + turns.value) / 2, *apart.times(0.5)[1:])
    return there | {"temperature": middle, "apart": apart}


def _of(row: Mapping) -> Iterator[Check]:
    subject, wrong = f"{row['label']}, {row['dt']:g} fs", False
    bounds = BOUNDS | WITHOUT_BIAS if row["scheme"].startswith("hmc") else BOUNDS
    for key, most in bounds.items():
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
