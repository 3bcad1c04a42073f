"""Which measured point of a sweep is the fastest that is accurate enough.  Pure functions; nothing between two points is guessed.

A point is one integrator with one time step, as plain data (see ``sweep``); of it are used ``integrator``, ``dt`` (fs), ``failed``, ``ours``,
``lines`` (of the input script), ``cost`` (min and median of its run time, s per simulated ns; None if not timed), ``errors`` (measure to value and
standard error) and ``without`` (measures that do not apply to it).
Targets are a dictionary from measure to the largest error that is good enough, in the measure's unit.
"""

import math
import statistics
from dataclasses import dataclass

from validation.check import Check
from validation.measures import margin

# these say whether something is right, or not; they are no errors that a shorter step makes smaller
CHECKS = "convergence", "ke_distribution", "pv_equipartition", "helix"
DEFAULT = "nosquish"  # the integrator that a tie goes to: this package's, without keywords
DECADES = 3.0  # a ladder of targets that spans more has one rung in each decade, else three


@dataclass(frozen=True)
class Choice:
    """The fastest way to reach the targets.

    Attributes:
        targets: measure to what its error has to be below.
        best: the simplest of the ``fastest`` and those that tie with it; None if none meets all targets for sure.  Where that is this package's
            with keywords, its default at the same step is, if its errors are not above the variant's within that one's error bars: it may not meet the targets for sure itself.
        fastest: the point that meets all targets for sure and has the smallest least run time.
        ties: further points that tie with it, from the fastest: they meet all targets for sure, and their least run time is not above its median.
        perhaps: points of which there is no telling whether they meet the targets, or which are not timed, as fast as the best one or faster.
        resolved: whether the targets are not below the `resolution`.
    """

    targets: dict
    best: dict | None
    fastest: dict | None = None
    ties: tuple = ()
    perhaps: tuple = ()
    resolved: bool = True

    @property
    def verdict(self):
        """``met``; else ``cannot tell`` if some point may meet the targets, and ``not met`` if none does; or that they are not resolved."""
        if not self.resolved:
            return "not resolved by this sampling"
        return "met" if self.best else "cannot tell" if self.perhaps else "not met"


def margin_of(found):
    """The 95 % margin of an error that is known."""
    return margin(found["error"], found.get("freedom"))


def bound(point, measure):
    """What an error is at most for sure: value + its 95 % margin; infinite if the point failed, or if one of the two is not known."""
    found = point["errors"].get(measure)
    if point["failed"] or found is None or found["error"] is None:
        return math.inf
    most = found["value"] + margin_of(found)
    return most if math.isfinite(most) else math.inf


def meets(point, targets):
    """Whether all errors of a point are within the targets.

    Returns:
        True if they are with their 95 % margins, False if one less its margin is above or does not apply or the point failed, None if there is no telling.
    """
    if point["failed"] or not targets.keys().isdisjoint(point.get("without", ())):
        return False
    verdicts = [
        _within(point["errors"].get(measure), target) for measure, target in targets.items()
    ]
    return False if False in verdicts else None if None in verdicts else True


def _within(found, target):
    if found is None or found["error"] is None:
        return None
    return Check("", "", "", **found, high=target).holds


def choose(points, targets):
    """The `Choice` among points."""
    verdicts = [(point, meets(point, targets)) for point in points]
    good = sorted((point for point, met in verdicts if met and point["cost"]), key=_by_cost)
    usual = good[0]["cost"]["median"] if good else math.inf
    perhaps = [
        point for point, met in verdicts
        if (met is None or met and not point["cost"]) and (not point["cost"] or point["cost"]["min"] <= usual)
    ]  # fmt: skip
    tied = [point for point in good if point["cost"]["min"] <= usual]
    best = _plain(min(tied, key=_by_words, default=None), perhaps, targets)
    perhaps = [point for point in perhaps if point is not best]
    ties = [point for point in tied if point is not best]
    return Choice(
        dict(targets),
        best,
        good[0] if good else None,
        tuple(ties),
        tuple(sorted(perhaps, key=_by_cost)),
    )


def _plain(best, perhaps, targets):
    """The default in the place of its variant with keywords, where no error of it is above the variant's: a keyword has to be seen to help."""
    if best is None or not best["ours"] or best["integrator"] == DEFAULT:
        return best
    for point in perhaps:
        if (
            point["integrator"] == DEFAULT
            and point["dt"] == best["dt"]
            and point["cost"]
            and meets(point, targets) is None
        ):
            if all(
                measure in point["errors"]
                and point["errors"][measure]["value"] <= bound(best, measure)
                for measure in targets
            ):
                return point
    return best


def ours(points, targets):
    """The `Choice` among this package's own points."""
    return choose([point for point in points if point["ours"]], targets)


def each(points, targets):
    """The `Choice` of each integrator among its own points, by its name."""
    names = dict.fromkeys(point["integrator"] for point in points)
    return {
        name: choose([point for point in points if point["integrator"] == name], targets)
        for name in names
    }


def nearest(points, targets):
    """The point that is the least above the targets, and how many times its worst `bound` is above; None if no point has all these errors."""
    excess = [
        (max(bound(point, measure) / target for measure, target in targets.items()), point)
        for point in points
    ]
    factor, point = min(excess, key=lambda pair: pair[0], default=(math.inf, None))
    return (point, factor) if factor < math.inf else None


def is_zero(point, measure):
    """Whether a point's error cannot be told from zero by its 95 % margin; not if it is not known."""
    found = point["errors"].get(measure)
    return (
        not point["failed"]
        and found is not None
        and found["error"] is not None
        and found["value"] < margin_of(found)
    )


def resolution(points, measure):
    """What errors that cannot be told from zero are at most, their median; 0 if there are none.  Which of these is below a smaller target is chance."""
    return statistics.median(
        [bound(point, measure) for point in points if is_zero(point, measure)] or [0.0]
    )


def front(points, measure):
    """The points that no other one beats in both run time and `bound`, from the fastest: those that are chosen for some target; none of `CHECKS`."""
    found, least = [], math.inf
    for point in sorted(
        (point for point in points if point["cost"] and measure not in CHECKS), key=_by_cost
    ):
        if bound(point, measure) < least:
            found.append(point)
            least = bound(point, measure)
    return found


def ladder(points, measure):
    """Targets over which the choice changes: 1, 2, 5 times powers of ten, or these powers alone.

    From the last one that no point meets for sure to the first one that the fastest point of the `front` meets, without those below the `resolution`.
    """
    least = resolution(points, measure)
    return [rung for rung in _rungs(points, measure) if rung >= least]


def _rungs(points, measure):
    bounds = [
        most for most in (bound(point, measure) for point in front(points, measure)) if most > 0
    ]
    if not bounds:
        return []
    first, last = math.log10(min(bounds)), math.log10(max(bounds))
    digits = (1,) if last - first > DECADES else (1, 2, 5)
    rungs = [
        float(f"{digit}e{power}")
        for power in range(math.floor(first) - 1, math.ceil(last) + 2)
        for digit in digits
    ]
    low = max(rung for rung in rungs if rung < min(bounds))
    high = min(rung for rung in rungs if rung >= max(bounds))
    return [rung for rung in rungs if low <= rung <= high]


def fastest(points, measures):
    """For each of the measures, a `Choice` for each rung of its `ladder`: list of (measure, target, `Choice`, that of `ours`).

    A target below the `resolution` is there once, without a best point.
    """
    found = []
    for measure in measures:
        resolved = ladder(points, measure)
        below = [rung for rung in _rungs(points, measure) if rung not in resolved]
        for target in below[-1:]:
            none = Choice({measure: target}, None, resolved=False)
            found.append((measure, target, none, none))
        found += [
            (measure, target, choose(points, {measure: target}), ours(points, {measure: target}))
            for target in resolved
        ]
    return found


def _by_words(point):
    """From the simplest: this package's default, then what takes the fewest words in an input script; of equal ones the fastest first."""
    return point["integrator"] != DEFAULT, len(" ".join(point["lines"]).split()), _by_cost(point)


def _by_cost(point):
    """From the fastest; of equal ones the longer step first, then by name; those that are not timed last."""
    return point["cost"]["min"] if point["cost"] else math.inf, -point["dt"], point["integrator"]
