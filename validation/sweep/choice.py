"""Which measured point of a sweep is the fastest that is accurate enough.  Pure functions; nothing
between two points is guessed.

A point is one integrator with one time step, as ``measure`` tells it in plain data.  Targets are a
dictionary from measure to the largest error that is good enough, in the measure's unit.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from validation.scenes.integrators import OURS  # a tie goes to it: this package's, without keywords
from validation.statistics.check import Check
from validation.statistics.estimate import Estimate

if TYPE_CHECKING:  # it reads inputs, which only a checkout has
    from validation.sweep.plan import Measured

# these say whether something is right, or not; they are no errors that a shorter step makes smaller
CHECKS = "convergence", "ke_distribution", "pv_equipartition", "helix"
DECADES = 3.0  # a ladder of targets that spans more has one rung in each decade, else three
Targets = Mapping[str, float]


@dataclass(frozen=True)
class Choice:
    """The fastest way to reach the targets."""

    targets: Targets
    # the simplest of the fastest and those that tie with it; None if none meets all targets for
    # sure; see also `_plain`
    best: Measured | None
    # that meets all targets for sure with the smallest least run time
    fastest: Measured | None = None
    # the others that do, and whose least run time is not above its median, from the fastest
    ties: tuple[Measured, ...] = ()
    # those as fast as the best one of which there is no telling, or which are not timed
    perhaps: tuple[Measured, ...] = ()
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


def bound(point: Measured, measure: str) -> float:
    """What an error is at most for sure: value + its 95 % margin; infinite if it is not known."""
    found = _known(point, measure)
    most = found.value + found.margin if found else math.inf
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


def choose(points: Iterable[Measured], targets: Targets) -> Choice:
    """The `Choice` among points."""
    verdicts = [(point, meets(point, targets)) for point in points]
    good = sorted((point for point, met in verdicts if met and point["cost"]), key=_by_cost)
    usual = good[0]["cost"]["median"] if good and good[0]["cost"] else math.inf
    unsure = [point for point, met in verdicts if met is None or (met and not point["cost"])]
    perhaps = [one for one in unsure if not one["cost"] or least(one) <= usual]
    tied = [point for point in good if least(point) <= usual]
    best = _plain(min(tied, key=_by_words, default=None), perhaps, targets)
    ties = tuple(point for point in tied if point is not best)
    perhaps = sorted((point for point in perhaps if point is not best), key=_by_cost)
    return Choice(dict(targets), best, good[0] if good else None, ties, tuple(perhaps))


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
        if same and point["cost"] and meets(point, targets) is None and as_good(point):
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
    """The points that no other one beats in both run time and `bound`, from the fastest: those that
    are chosen for some target; none of `CHECKS`."""
    found, lowest = [], math.inf
    timed = [point for point in points if point["cost"] and measure not in CHECKS]
    for point in sorted(timed, key=_by_cost):
        if bound(point, measure) < lowest:
            found.append(point)
            lowest = bound(point, measure)
    return found


def ladder(points: Sequence[Measured], measure: str) -> list[float]:
    """Targets over which the choice changes, 1, 2, 5 times powers of ten, or these powers alone:
    from the last one that no point meets for sure to the first one that the fastest point of the
    `front` meets, without those below the `resolution`."""
    lowest = resolution(points, measure)
    return [rung for rung in _rungs(points, measure) if rung >= lowest]


def _rungs(points, measure):
    bounds = [most for point in front(points, measure) if (most := bound(point, measure)) > 0]
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
