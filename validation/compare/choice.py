"""Selection of the fastest measured point that is accurate enough.  Pure functions; nothing is
interpolated between points.

One rule, `verdicts`, gives the answer and the verdict of each row.  The steps of an integrator are
tested from the shortest on, and the tests end with the first step that is not met.  Each integrator
can therefore be wrong at one step only, in 5 % of cases divided by the number of integrators (a
fixed sequence of tests, and a union bound).  A long run, ``alone``, judges only its own step.

Targets are a dictionary from measure to the largest error allowed, in its unit.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypedDict

from ..scenes.integrators import OURS  # wins ties: this package's, without keywords
from ..statistics.check import Check
from ..statistics.estimate import CONFIDENCE, SURE, Estimate, margin
from ..statistics.measures import Spread

SAFE = 1.5  # the integrator must also run at the named step times this
RULE = (
    f"Met: with {SURE} confidence, corrected for several integrators, all errors of the step and "
    "of the shorter ones are within the targets, or those of a long run of this step or a longer "
    f"one. Not met: an error of the step, or of a shorter one, is above its target with {SURE} "
    "confidence. Cannot tell: all others, and steps above two thirds of one that fails."
)
Targets = Mapping[str, float]


class Measured(TypedDict):
    """A row of results, as plain data.

    Attributes:
        ours: whether the integrator is this package's, with any keywords.
        thermostat: its kind, see `thermostat.kind_of`; absent in earlier summaries.
        lines: of an input script; ``place`` and ``lost``: see `case.Case.written`.
        time: sampled from each start, in the scene's units.
        failed: why the point failed, with the step; ``failures``: number of starts that failed.
        is_reference: whether it is the reference of means.  asked: whether it was requested.
        alone: whether a separate long run judges it.
        cost: wall time of steps without output, s per ns.  cpu: their CPU time of all cores, by
            which points are compared.  share: CPU use of each rank, percent of a core.
        errors: ``Estimate`` by measure; without error bar if there is none, or None.
        signed: the same with its sign.  by_itself: from this point's runs only.
        without: targets that its runs cannot measure.
    """

    integrator: str
    label: str
    ours: bool
    thermostat: str | None
    lines: list[str]
    place: str
    lost: list[str]
    dt: float
    starts: int
    time: float
    failed: str | None
    failures: int
    is_reference: bool
    asked: bool
    alone: bool
    cost: Spread | None
    cpu: Spread | None
    share: float | None
    errors: dict[str, dict]
    signed: dict[str, dict]
    by_itself: dict[str, dict]
    without: list[str]


@dataclass(frozen=True)
class Choice:
    """The fastest way to reach the targets.

    Attributes:
        targets: targets of the choice: those that the points' runs can measure.
        best: the simplest of the fastest point and those that tie with it; None if none is met.
        fastest: the point that is met at the lowest cost.
        ties: other points that are met, whose timings overlap with those of the fastest.
        perhaps: points as fast as the best one whose verdict is open.
    """

    targets: Targets
    best: Measured | None = None
    fastest: Measured | None = None
    ties: tuple[Measured, ...] = ()
    perhaps: tuple[Measured, ...] = ()

    @property
    def verdict(self) -> str:
        """``met``; else ``cannot tell`` if the verdict of some point is open, or ``not met``."""
        return "met" if self.best else "cannot tell" if self.perhaps else "not met"


def bound(point: Measured, measure: str, confidence: float = CONFIDENCE) -> float:
    """The upper bound of an error: value + margin; infinite if it is not known."""
    estimate = point["errors"].get(measure)
    if point["failed"] or estimate is None or estimate["error"] is None:
        return math.inf
    most = estimate["value"] + margin(estimate["error"], estimate.get("freedom"), confidence)
    return most if math.isfinite(most) else math.inf


def is_zero(point: Measured, measure: str) -> bool:
    """Whether an error is known, and not significantly different from zero (95 %)."""
    return 2 * point["errors"][measure]["value"] < bound(point, measure) < math.inf


def cost(point: Measured) -> float:
    """The median CPU time, s per ns; infinite if it is not known."""
    return point["cpu"]["median"] if point["cpu"] else math.inf


def meets(point: Measured, targets: Targets) -> bool | None:
    """Whether all errors of a point are within the targets: True if they are including their 95 %
    margins; False if one is above even less its margin, or if the point failed; else None."""
    if point["failed"]:
        return False
    errors = {name: point["errors"].get(name) or {"error": None} for name in targets}
    verdicts = [
        None if error["error"] is None else Check("", "", "", **error, high=targets[name]).holds
        for name, error in errors.items()
    ]
    return False if False in verdicts else None if None in verdicts else True


def passes(point: Measured, targets: Targets, level: float = CONFIDENCE) -> bool:
    """Whether all errors are within the targets, with margins of this confidence."""
    return all(bound(point, name, level) <= most for name, most in targets.items())


def level_of_each(integrators: Iterable[str], share: float = 1.0) -> float:
    """The confidence for each step in a sequence of tests: at least the usual one, because errors
    below zero are no mistake.

    Args:
        share: part of the 5 % that all sequences together may use.
    """
    return max(CONFIDENCE, 1 - 2 * (1 - CONFIDENCE) * share / max(1, len({*integrators})))


def verdicts(points: Sequence[Measured], targets: Targets, level: float) -> list[bool | None]:
    """For each point whether it is met, by `RULE`; None where the runs cannot tell.

    Args:
        level: see `level_of_each`.
    """
    judgements: list[bool | None] = [None] * len(points)
    order = sorted(range(len(points)), key=lambda place: points[place]["dt"])
    near = near_failure(points)
    for name in {point["integrator"]: None for point in points}:
        met, lost = True, False
        steps = [place for place in order if points[place]["integrator"] == name]
        for count, place in enumerate(steps, 1):
            point = points[place]
            if point["alone"] and passes(point, targets) and point not in near:
                for shorter in steps[:count]:
                    judgements[shorter] = True
                met, lost = True, False
                continue
            lost = lost or meets(point, targets) is False
            met = met and not point["alone"] and passes(point, targets, level)
            if lost:
                judgements[place] = False
            elif met and point not in near:
                judgements[place] = True
    return judgements


def near_failure(points: Iterable[Measured]) -> list[Measured]:
    """The points whose step is more than 1 / `SAFE` of one at which their integrator fails.

    Events that end a run, such as a broken bond, are rare at slightly shorter steps.  A run without
    one says nothing about a longer run.
    """
    points = list(points)

    def ends(name):
        failed = (
            point["dt"] for point in points if point["failed"] and point["integrator"] == name
        )
        return min(failed, default=math.inf) * (1 + 1e-9)

    return [
        point
        for point in points
        if not point["failed"] and SAFE * point["dt"] > ends(point["integrator"])
    ]


def same_thermostat(points: Sequence[Measured], thermostat: Mapping | None) -> Sequence[Measured]:
    """The points with the script's kind of thermostat; all if it has none, or if no point does.

    Args:
        thermostat: see `thermostat.of_script`.
    """
    kind = thermostat and thermostat["kind"]
    return [point for point in points if kind and point["thermostat"] == kind] or points


def choose(points: Sequence[Measured], targets: Targets, level: float) -> Choice:
    """The `Choice` among points.

    Points whose runs measure all targets count.  If there are none, all points count, by the
    targets that they measure.

    Args:
        level: see `level_of_each`.
    """
    measurable = [point for point in points if targets.keys().isdisjoint(point["without"])]
    if points and not measurable:
        lost = {name for point in points for name in point["without"]}
        targets = {name: most for name, most in targets.items() if name not in lost}
        measurable = list(points)
    judgements = verdicts(measurable, targets, level) if targets else []
    good = sorted(
        (point for point, met in zip(measurable, judgements) if met and point["cpu"]), key=_by_cost
    )
    usual = cost(good[0]) if good else math.inf
    tied = [point for point in good if point["cpu"] and point["cpu"]["min"] <= usual]
    best = min(tied, key=_by_words, default=None)
    near = near_failure(measurable)
    perhaps = [
        point
        for point, met in zip(measurable, judgements)
        if point not in near
        and point not in good
        and met is not False
        and (point["cpu"]["min"] if point["cpu"] else math.inf) <= usual
    ]
    return Choice(
        dict(targets),
        best,
        good[0] if good else None,
        tuple(point for point in tied if point is not best),
        tuple(sorted(perhaps, key=_by_cost)),
    )


def nearest(points: Iterable[Measured], targets: Targets) -> tuple[Measured, float] | None:
    """The point that exceeds the targets least, and the ratio of its worst `bound` to the target;
    None if no point has all these errors."""
    excess = [
        (max(bound(point, key) / most for key, most in targets.items()), point) for point in points
    ]
    factor, point = min(excess, key=lambda pair: pair[0], default=(math.inf, None))
    return (point, factor) if point and factor < math.inf else None


def size(estimate: Estimate) -> dict:
    """An error without its sign, as plain data."""
    return estimate._replace(value=abs(estimate.value)).plain()


def _by_words(point):
    """Sort key, simplest first: this package's default, then the fewest words in an input script;
    ties by cost."""
    return point["integrator"] != OURS, len(" ".join(point["lines"]).split()), _by_cost(point)


def _by_cost(point):
    """Sort key, fastest first; ties: the longer step, then by name.  Untimed points come last."""
    return cost(point), -point["dt"], point["integrator"]
