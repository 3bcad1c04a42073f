"""Where the rest of a trial's time goes: to a long run of the step that it pays for most.

Short runs of all steps tell which are far too long, how large the errors of the others may be, and
how noisy they are.  From that follows of each step the chance that a run of it for the rest of the
time finds it good for sure.  The time goes to the step with the largest chance times gain in speed.

It is then judged by that run alone, which leaves out as much as the short runs lasted: what chose
the step does not judge it, so its margins are those of a single step, not of one of several.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from scipy import special

from validation.own import trial
from validation.own.system import Own
from validation.own.targets import MEANS, judged, steps_of_cost
from validation.running import run
from validation.running.store import Store
from validation.statistics.estimate import Estimate, margin
from validation.sweep.choice import before_bad, least

FIRST = 0.5  # of the time of all runs, for the short ones
WORTH = 1.5  # times what counts of the short runs, at least
FOLDER = "longer"  # of the runs


class Plan(NamedTuple):
    """A step to which the time could go.

    Attributes:
        row: of the step.
        noise: standard errors of the short run, by target.
        again: whether the run that means are held against is done as long, too.
        time: of the run, in the script's units.
        times: what counts of it, over what counts of the short one.
    """

    row: Any
    noise: Mapping[str, float]
    again: bool
    time: float
    times: float


def total() -> int:
    """Runs that a meter counts, at most."""
    return 2


def plan(own: Own, summary: Mapping[str, Any], seconds: float) -> Plan | None:
    """What is run for so many s; None if nothing is worth it, as when the fastest step that may be
    good is known to be."""
    wanted = summary["targets"]
    asked = [row | {"cost": row["rough"]} for row in summary["points"] if row["asked"]]
    best = trial.chosen(asked, wanted, trial.level(asked)).fastest
    rows: list[Any] = before_bad(asked, wanted)
    rows = [
        row
        for row in rows
        if judged(row, wanted) == wanted and wanted.keys() <= row["by_itself"].keys()
    ]
    if best:
        rows = [row for row in rows if least(row) < least(best)]
    plans = []
    for row in rows:
        noise = _noise(row, summary["points"], wanted)
        for again in (False, True)[: 1 if MEANS.isdisjoint(wanted) else 2]:
            plans.append(_plan(own, summary, seconds, row, noise, again))
    plans = [one for one in plans if one.times >= WORTH]
    known = least(best) if best else math.inf
    return max(plans, key=lambda one: pays(one, wanted, known), default=None)


def _noise(row, rows, wanted) -> dict[str, float]:
    """Standard errors of a row's own run.

    Those of means are about the same at all steps of an integrator, and a run as short as these
    tells them badly: the median of all is taken.  Else the step would be chosen whose noise is the
    most underrated.
    """
    found = {name: row["by_itself"][name]["error"] for name in wanted}
    for name in wanted.keys() & {"temperature", *MEANS}:
        alike = [one for one in rows if one["integrator"] == row["integrator"]]
        told = [one["by_itself"][name]["error"] for one in alike if name in one["by_itself"]]
        found[name] = statistics.median(told)
    return found


def _plan(own, summary, seconds, row, noise, again) -> Plan:
    held = [one for one in summary["points"] if one["is_reference"]]
    some = [row, *(held if again else [])]
    each = sum(one["rough"]["median"] for one in some) / steps_of_cost(own, 1.0)
    short, long = summary["time"], (seconds - len(some) * trial.startup(own)) / each
    counts = long - max(trial.SETTLES * long, short)
    return Plan(row, noise, again, long, counts / ((1 - trial.SETTLES) * short))


def pays(plan: Plan, wanted: Mapping[str, float], known: float = math.inf) -> tuple[float, float]:
    """The chance that the run finds the step good for sure, times how much faster it is; and for
    those that have none how far error bars are from a target, in parts of it.

    Args:
        known: cost of the fastest step that is known to be good.
    """
    chance, room = 1.0, math.inf
    for name, most in wanted.items():
        error = Estimate.of(plan.row["errors"][name])
        noise = plan.noise[name] * _shrinks(plan, name)
        left = most - margin(noise)
        spread = math.hypot(error.error, noise)
        room = min(room, left / most)
        if left <= 0:
            chance = 0.0
        elif spread:
            above, below = ((side * left - error.value) / spread for side in (1, -1))
            chance *= float(special.ndtr(above) - special.ndtr(below))
        elif error.value > left:
            chance = 0.0
    return chance * (1 / least(plan.row) - 1 / known), room


def _shrinks(plan: Plan, name: str) -> float:
    """The noise of the long run over that of the short one.

    That of a slope goes as the length to -3/2.  Of what is held against another run, half of the
    variance is that run's.
    """
    if name == "drift":
        return plan.times**-1.5
    if name in MEANS and not plan.again:
        return math.sqrt((1 + 1 / plan.times) / 2)
    return plan.times**-0.5


def long_run(
    own: Own,
    tried: trial.Trial,
    seconds: float,
    out: Path,
    ranks: int,
    silence: float,
    meter: run.Meter,
) -> None:
    """Run what pays most, and judge all again.

    Args:
        tried: is changed.
        seconds: that are left.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """
    best = plan(own, tried.summary, seconds)
    if best is None:
        return
    tried.alone = trial.Point(own.integrators[best.row["integrator"]], best.row["dt"])
    some = [*(tried.every[:1] if best.again else []), tried.alone]
    how = FOLDER, tried.summary["time"], out, ranks, silence, meter
    tried.found |= runs(own, some, best.time, *how)
    tried.judge(own)


def runs(
    own: Own,
    some: Sequence[trial.Point],
    time: float,
    folder: str,
    left_out: float,
    out: Path,
    ranks: int,
    silence: float,
    meter: run.Meter,
) -> dict[trial.Point, trial.Done]:
    """Runs of points, each of the same time, in the script's units.

    Args:
        folder: name of theirs.
        left_out: of the time, at the beginning, if it is more than the usual part.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """
    lengths, folders = trial.lengths_of(own, time, some), out / "runs" / folder
    settles = max(trial.SETTLES, left_out / time)
    jobs = {one.name: trial.job(own, one, folders, lengths, ranks, silence) for one in some}
    names = {one.name: one for one in some}
    for name in Store(out / "records" / folder, __name__).shared(names):
        trial.one_run(own, names[name], jobs[name], meter)
    return {one: trial.done(own, one, jobs[one.name], lengths, settles) for one in some}
