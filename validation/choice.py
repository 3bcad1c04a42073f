"""Which measured point of a sweep is the fastest that is accurate enough.  Pure functions; nothing
between two points is guessed.

The one that is named has been chosen by its error, among several.  So that it is within the targets
in 95 % of cases all the same, points are judged by wider margins the more faster ones there are
that could have been named, see `levels`; or each integrator's from the shortest step on, see
`from_the_shortest`.

A point is one integrator with one time step, as ``measure`` tells it in plain data.  Targets are a
dictionary from measure to the largest error that is good enough, in the measure's unit.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypedDict

from .scenes.integrators import OURS  # a tie goes to it: this package's, without keywords
from .statistics.check import Check
from .statistics.estimate import CONFIDENCE, Estimate, margin
from .statistics.measures import Spread

# these say whether something is right, or not; they are no errors that a shorter step makes smaller
CHECKS = "convergence", "ke_distribution", "pv_equipartition", "helix"
DECADES = 3.0  # a ladder of targets that spans more has one rung in each decade, else three
Targets = Mapping[str, float]


class Measured(TypedDict):
    """What a sweep, or a trial, knows of an integrator with a time step, as plain data."""

    integrator: str  # name
    label: str
    ours: bool  # whether it is this package's, whatever its keywords
    lines: list[str]  # of an input script
    dt: float  # fs
    steps: int
    ps: float  # sampled, from each start
    starts: int
    failed: str | None  # why
    failures: int  # starts that failed
    cost: Spread | None  # s per ns of the clock
    cpu: Spread | None  # and of all cores
    errors: dict[str, dict]  # measure to its ``Estimate``; an error that is None is not known
    signed: dict[str, dict]  # the same with its sign, where it has one
    without: list[str]  # measures that do not apply
    command: str  # that runs it again


@dataclass(frozen=True)
class Choice:
    """The fastest way to reach the targets."""

    targets: Targets
    # the simplest of the fastest and those that tie with it; None if none meets all targets for
    # sure; see also `_plain`
    best: Measured | None
    # that meets all targets for sure, by its level, with the smallest least run time
    fastest: Measured | None = None
    # the others that do, and whose least run time is not above its median, from the fastest
    ties: tuple[Measured, ...] = ()
    # those as fast as the best one of which there is no telling, or which are not timed
    perhaps: tuple[Measured, ...] = ()
    sure: bool = False  # whether the best one is among those that meet all targets for sure
    resolved: bool = True  # whether the targets are not below the `resolution`

    @property
    def verdict(self) -> str:
        """``met``; else ``cannot tell`` if some point may meet the targets, and ``not met`` if none
        does; or that they are not resolved."""
        if not self.resolved:
            return "not resolved by this sampling"
        return "met" if self.best else "cannot tell" if self.perhaps else "not met"


def _known(point, measure):
    """A point's error, if it has one with an error bar; else None."""
    found = point["errors"].get(measure)
    if point["failed"] or found is None or found["error"] is None:
        return None
    return Estimate.of(found)


def bound(point: Measured, measure: str, confidence: float = CONFIDENCE) -> float:
    """What an error is at most for sure: value + its margin; infinite if it is not known."""
    found = _known(point, measure)
    if found is None:
        return math.inf
    most = found.value + margin(found.error, found.freedom, confidence)
    return most if math.isfinite(most) else math.inf


def least(point: Measured) -> float:
    """The least run time, s per ns; infinite if it is not known."""
    return point["cost"]["min"] if point["cost"] else math.inf


def is_zero(point: Measured, measure: str) -> bool:
    """Whether an error is known, and cannot be told from zero by its 95 % margin."""
    found = _known(point, measure)
    return found is not None and found.value < found.margin


def meets(point: Measured, targets: Targets) -> bool | None:
    """Whether all errors of a point are within the targets: True if they are with their 95 %
    margins, False if one less its margin is above or does not apply or the point failed, None if
    there is no telling."""
    if point["failed"] or not targets.keys().isdisjoint(point.get("without", ())):
        return False
    verdicts = [_within(point["errors"].get(name), target) for name, target in targets.items()]
    return False if False in verdicts else None if None in verdicts else True


def _within(found, target):
    if found is None or found["error"] is None:
        return None
    return Check("", "", "", **found, high=target).holds


def levels(points: Iterable[Measured], targets: Targets) -> list[tuple[Measured, float]]:
    """The points that could be named, from the fastest, and the confidence that each is judged by.

    These are timed, have error bars of all targets, and are not above one for sure.  The k-th may
    pass by mistake in 5 % / (k (k + 1)) of cases: in less than 5 % all together (union bound).  The
    first one has the usual margin, for errors below zero are no mistake.
    """
    timed = [one for one in points if one["cost"] and meets(one, targets) is not False]
    able = [one for one in timed if all(math.isfinite(bound(one, name)) for name in targets)]
    able.sort(key=_by_cost)
    return [(one, _level(k)) for k, one in enumerate(able, 1)]


def _level(k: int) -> float:
    """The confidence that the k-th point is judged by, see `levels`."""
    return 1 - 2 * (1 - CONFIDENCE) / (k * (k + 1))


def passes(point: Measured, targets: Targets, level: float) -> bool:
    """Whether all errors are within the targets, by margins of this confidence."""
    return all(bound(point, name, level) <= most for name, most in targets.items())


def by_levels(points: Sequence[Measured], targets: Targets) -> list[Measured]:
    """The points within the targets for sure, from the fastest, by `levels`."""
    return [point for point, level in levels(points, targets) if passes(point, targets, level)]


def level_of_each(points: Iterable[Mapping], share: float = 1.0) -> float:
    """The confidence by which all points are judged in `from_the_shortest`; at least the usual
    one, for errors below zero are no mistake.

    Args:
        share: of the 5 %, for them.
    """
    integrators = {point["integrator"] for point in points}
    return max(CONFIDENCE, 1 - 2 * (1 - CONFIDENCE) * share / max(1, len(integrators)))


def before_bad(points: Iterable[Measured], targets: Targets) -> list[Measured]:
    """The points of each integrator up to the first step that is not within the targets for sure,
    from the shortest."""
    found: list[Measured] = []
    bad = set()
    for point in sorted(points, key=lambda point: point["dt"]):
        if meets(point, targets) is False:
            bad.add(point["integrator"])
        elif point["integrator"] not in bad:
            found.append(point)
    return found


def from_the_shortest(points: Sequence[Measured], targets: Targets, level: float) -> list[Measured]:
    """The points within the targets for sure, from the fastest, where errors grow with the step.

    Of an integrator a step is judged only if all shorter ones are within the targets.  So at most
    one mistake of each can begin, in 5 % of cases over the number of integrators (a fixed sequence
    of tests, and a union bound).  Where longer steps tell the errors of shorter ones, this names
    longer steps than `levels`; not where all steps have the same noise, and it is nearly as large
    as a target.

    Args:
        level: see `level_of_each`.
    """
    good = []
    for name in {point["integrator"]: None for point in points}:
        own = [point for point in points if point["integrator"] == name]
        for point in sorted(own, key=lambda point: point["dt"]):
            if not passes(point, targets, level):
                break
            if point["cost"]:
                good.append(point)
    return sorted(good, key=_by_cost)


def choose(
    points: Iterable[Measured],
    targets: Targets,
    within: Callable[[Sequence[Measured], Targets], list[Measured]] = by_levels,
) -> Choice:
    """The `Choice` among points; ``within`` tells those that are within the targets for sure."""
    points = list(points)
    good = within(points, targets)
    usual = good[0]["cost"]["median"] if good and good[0]["cost"] else math.inf
    passed = {id(point) for point in good}
    unsure = [one for one in points if id(one) not in passed and meets(one, targets) is not False]
    perhaps = [one for one in unsure if not one["cost"] or least(one) <= usual]
    tied = [point for point in good if least(point) <= usual]
    best = _plain(min(tied, key=_by_words, default=None), perhaps, targets)
    ties = tuple(point for point in tied if point is not best)
    sure = best is not None and id(best) in passed
    perhaps = sorted((point for point in perhaps if point is not best), key=_by_cost)
    fastest = good[0] if good else None
    return Choice(dict(targets), best, fastest, ties, tuple(perhaps), sure)


def _plain(best, perhaps, targets):
    """The default in the place of its variant with keywords, at the same step, where no error of it
    is above the variant's within that one's error bars: a keyword has to be seen to help.  It may
    not meet the targets for sure itself."""
    if best is None or not best["ours"] or best["integrator"] == OURS:
        return best

    def as_good(point):
        errors = point["errors"]
        return all(key in errors and errors[key]["value"] <= bound(best, key) for key in targets)

    for point in perhaps:
        same = point["integrator"] == OURS and point["dt"] == best["dt"]
        if same and point["cost"] and as_good(point):
            return point
    return best


def ours(points: Iterable[Measured], targets: Targets) -> Choice:
    """The `Choice` among this package's own points."""
    return choose([point for point in points if point["ours"]], targets)


def each(points: Sequence[Measured], targets: Targets) -> dict[str, Choice]:
    """The `Choice` of each integrator among its own points, by its name."""
    found: dict[str, list[Measured]] = {}
    for point in points:
        found.setdefault(point["integrator"], []).append(point)
    return {name: choose(own, targets) for name, own in found.items()}


def nearest(points: Iterable[Measured], targets: Targets) -> tuple[Measured, float] | None:
    """The point that is the least above the targets, and how many times its worst `bound` is above;
    None if no point has all these errors."""
    excess = [(max(bound(one, key) / most for key, most in targets.items()), one) for one in points]
    factor, point = min(excess, key=lambda pair: pair[0], default=(math.inf, None))
    return (point, factor) if point and factor < math.inf else None


def resolution(points: Iterable[Measured], measure: str) -> float:
    """What errors that cannot be told from zero are at most, their median; 0 if there are none.
    Which of these is below a smaller target is chance."""
    zero = [bound(point, measure) for point in points if is_zero(point, measure)]
    return statistics.median(zero or [0.0])


def front(points: Iterable[Measured], measure: str) -> list[Measured]:
    """The points that no other one beats in both run time and the smallest target that they meet
    for sure, from the fastest; none of `CHECKS`."""
    return [point for point, _ in _front(points, measure)]


def _front(points, measure):
    """The `front`, each point with the smallest target that it meets for sure.

    That follows from its level, see `levels`: the larger a target is, the more of the faster points
    could be named, and the wider is the margin.
    """
    found, lowest = [], math.inf
    faster: list[float] = []  # what the errors of faster points are at least for sure
    timed = [point for point in points if point["cost"] and measure not in CHECKS]
    for point in sorted(timed, key=_by_cost):
        most, before = bound(point, measure), -math.inf
        while before < most < lowest:
            before = most
            most = bound(point, measure, _level(1 + sum(least <= most for least in faster)))
        if most < lowest:
            found.append((point, most))
            lowest = most
        known = _known(point, measure)
        if known:
            faster.append(known.value - known.margin)
    return found


def ladder(points: Sequence[Measured], measure: str) -> list[float]:
    """Targets over which the choice changes, 1, 2, 5 times powers of ten, or these powers alone:
    from the last one that no point meets for sure to the first one that the fastest point of the
    `front` meets, without those below the `resolution`."""
    lowest = resolution(points, measure)
    return [rung for rung in _rungs(points, measure) if rung >= lowest]


def _rungs(points, measure):
    bounds = [most for _, most in _front(points, measure) if most > 0]
    if not bounds:
        return []
    first, last = math.log10(min(bounds)), math.log10(max(bounds))
    digits = (1,) if last - first > DECADES else (1, 2, 5)
    powers = range(math.floor(first) - 1, math.ceil(last) + 2)
    rungs = [float(f"{digit}e{power}") for power in powers for digit in digits]
    low = max(rung for rung in rungs if rung < min(bounds))
    high = min(rung for rung in rungs if rung >= max(bounds))
    return [rung for rung in rungs if low <= rung <= high]


def fastest(
    points: Sequence[Measured], measures: Iterable[str]
) -> list[tuple[str, float, Choice, Choice]]:
    """For each rung of each measure's `ladder` (measure, target, `Choice`, that of `ours`); a
    target below the `resolution` is there once, without a best point."""
    found = []
    for measure in measures:
        resolved = ladder(points, measure)
        below = [rung for rung in _rungs(points, measure) if rung not in resolved]
        for target in (*below[-1:], *resolved):
            wanted = {measure: target}
            choices = choose(points, wanted), ours(points, wanted)
            if target not in resolved:
                choices = (Choice(wanted, None, resolved=False),) * 2
            found.append((measure, target, *choices))
    return found


def _by_words(point):
    """From the simplest: this package's default, then what takes the fewest words in an input
    script; of equal ones the fastest first."""
    return point["integrator"] != OURS, len(" ".join(point["lines"]).split()), _by_cost(point)


def _by_cost(point):
    """From the fastest; of equal ones the longer step first, then by name; untimed ones last."""
    return least(point), -point["dt"], point["integrator"]
