"""The bounds of ``ensembles``, all in one place, and what is held against them.

They were set before the data: from what users need of a mean energy and a pressure, and from a
trial of the same thermostats in another program.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from validation.ensembles.plan import SCHEMES, STEPS, TEMPERATURE, Point
from validation.statistics.check import Check
from validation.statistics.estimate import Estimate, combined

OURS = "langevin-5", "langevin-20", "csvr", "nh"
MOLECULE = "kcal/mol a molecule"
TITLES = {
    "potential": "Bias of the mean potential energy",
    "trial": "The same bias beside that of a trial",
    "temperature": "Printed temperature",
    "equipartition": "Printed temperatures of translation and of rotation",
    "pressure": "Bias of the mean pressure",
}


class Bound(NamedTuple):
    """A row's number, and how far from ``around`` it may be at a point."""

    part: str
    key: str  # in `measure.Row`
    what: str
    unit: str
    scheme: str
    dt: float
    within: float
    around: float = 0.0


def _bounds(
    part: str, key: str, what: str, unit: str, within: dict[str, dict[float, float]], around=0.0
) -> list[Bound]:
    """Of {scheme: {fs: how far}}."""
    return [
        Bound(part, key, what, unit, scheme, dt, most, around)
        for scheme, those in within.items()
        for dt, most in those.items()
    ]


BOUNDS = [
    *_bounds(
        "potential", "bias", "bias of the mean potential energy", MOLECULE,
        {"langevin-5": {4.0: 0.010, 6.0: 0.018, 8.0: 0.025},
         "langevin-20": dict.fromkeys((4.0, 6.0, 8.0), 0.010)},
    ),
    *_bounds(
        "temperature", "temperature", "mean of temp", "K",
        dict.fromkeys(OURS, dict.fromkeys(STEPS, 0.01 * TEMPERATURE)), TEMPERATURE,
    ),
    *_bounds(
        "equipartition", "apart", "temperature of translation less that of rotation", "K",
        {"langevin-5": {4.0: 1.5, 6.0: 4.0}, "langevin-20": {4.0: 0.5, 6.0: 1.0}},
    ),
    *_bounds(
        "pressure", "pressure_bias", "bias of the mean pressure", "atm",
        dict.fromkeys(OURS, dict.fromkeys((2.0, 4.0, 6.0), 25.0)),
    ),
]  # fmt: skip

# bias of the mean potential energy, kcal/mol a molecule, that the trial found, and its standard
# error: one number for all, the middle of the 0.003 to 0.006 that they have
TRIAL = {
    "langevin-5": {2.0: -0.003, 4.0: -0.005, 6.0: -0.014, 8.0: -0.020},
    "langevin-20": {6.0: -0.003, 8.0: -0.006},
    "csvr": {4.0: -0.004, 6.0: -0.011, 8.0: -0.032},
}
TRIAL_ERROR, APART = 0.0045, 2.0  # how many standard errors of both together they may be apart
LEAST = 20.0  # ps of a point: of a shorter one blocks are as short as the energy remembers
TOO_SHORT = (
    f"Nothing is held against bounds, for points of less than {LEAST:g} ps do not tell their own "
    "errors."
)
TRIED = "a trial with 512 TIP3P molecules, a reaction field, 180 to 400 ps and one start a point"


Rows = Mapping[Point, Mapping[str, Any]]  # of each point that was run its `measure.Row` by name


def checks(rows: Rows, time: float) -> list[Check]:
    """What is held against the bounds, of points of so many ps; nothing if these are too few."""
    return [*_judged(rows), *_tried(rows)] if time >= LEAST else []


def _judged(rows: Rows) -> Iterator[Check]:
    for one in BOUNDS:
        if (row := rows.get(Point(one.scheme, one.dt))) is not None:
            ends = {"low": one.around - one.within, "high": one.around + one.within}
            note = "" if row.get(one.key) else row.get("error") or "there is no reference"
            yield Check.of(
                one.part, _subject(one.scheme, one.dt), one.what, row.get(one.key),
                **ends, unit=one.unit, note=note,
            )  # fmt: skip


def _tried(rows: Rows) -> Iterator[Check]:
    what = "distance from the trial's bias, in standard errors of both"
    for scheme, those in TRIAL.items():
        for dt, theirs in those.items():
            if (row := rows.get(Point(scheme, dt))) is None:
                continue
            found = row.get("bias")
            distance, note = _distance(found, theirs) if found else (None, row.get("error") or "")
            more = {"high": APART, "note": note, "source": TRIED}
            yield Check.of("trial", _subject(scheme, dt), what, distance, **more)


def _distance(found: Estimate, theirs: float) -> tuple[float | None, str]:
    """Standard errors between two biases, and what to say; None if ours is less sure than theirs:
    a run that is short enough agrees with anything."""
    error, _ = combined(found[1:], (TRIAL_ERROR, None))
    told = f"{found.text()} beside {theirs:+.3f} {MOLECULE}"
    if found.error > TRIAL_ERROR:
        return None, f"{told}: run longer, for the trial's standard error is {TRIAL_ERROR:g}"
    return abs(found.value - theirs) / error, told


def _subject(scheme: str, dt: float) -> str:
    return f"{SCHEMES[scheme].label}, {dt:g} fs"
