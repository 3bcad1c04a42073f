"""Where the rest of a trial's time goes: to the step that promises to be the fastest good one.

Short runs of all steps tell which are far too long, and which one may be the fastest that is good.
It and the next shorter and longer ones then run for the rest of the time.  The step is judged by
its long run alone, which leaves out as much as the short runs lasted: what chose it does not judge
it, so its margins are those of a single step, not of one of several.  Together the three tell the
errors of shorter steps, too, in case it is not good.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from validation.own import trial
from validation.own.system import Own
from validation.own.targets import MEANS, judged, steps_of_cost
from validation.running import run
from validation.running.store import Store
from validation.statistics.estimate import Estimate
from validation.sweep.choice import before_bad, least, nearest, simplest

FIRST = 0.35  # of the time of all runs, for the short ones
WORTH = 1.5  # times as long as these, at least
FOLDER = "longer"  # of the runs


def total() -> int:
    """Runs that a meter counts, at most."""
    return 4


def promises(row: Mapping[str, Any], wanted: Mapping[str, float]) -> bool:
    """Whether a step would be within the targets if its errors were what is seen of them, without
    their noise."""
    errors = row["errors"]
    return not row["failed"] and all(
        name in errors and seen(Estimate.of(errors[name])) <= most for name, most in wanted.items()
    )


def seen(error: Estimate) -> float:
    """An error's size, without its noise."""
    return math.sqrt(max(error.value**2 - error.error**2, 0.0))


def promising(rows: Sequence[Any], wanted: Mapping[str, float]) -> Any:
    """The row of the step that is worth more time; None if there is none, or one that is as fast is
    good already.

    Args:
        rows: of `trial.rows`, that are asked for.
    """
    rows = [row | {"cost": row["rough"]} for row in rows]
    best = trial.chosen(rows, wanted, trial.level(rows)).best
    able: list[Any] = [
        row for row in before_bad(rows, wanted) if row["cost"] and judged(row, wanted) == wanted
    ]
    if best and not any(least(row) < least(best) for row in able):
        return None
    able = [row for row in able if not row["is_reference"]]  # means are held against its run
    good = [row for row in able if promises(row, wanted)]
    if good:
        return simplest(good)
    near = nearest(able, wanted)
    return near and near[0]


def more(
    own: Own,
    tried: trial.Trial,
    seconds: float,
    out: Path,
    ranks: int,
    silence: float,
    meter: run.Meter,
) -> None:
    """Run the step that promises most, and its neighbours, for the rest of the time; and judge all
    again.

    Args:
        tried: is changed.
        seconds: that are left.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """
    summary, wanted = tried.summary, tried.summary["targets"]
    asked = [row for row in summary["points"] if row["asked"]]
    best = promising(asked, wanted)
    if best is None:
        return
    rows = neighbours(asked, best)
    if any(_hidden(best, name, wanted[name]) for name in MEANS & {*wanted}):
        held = next(row for row in summary["points"] if row["is_reference"])
        rows = [held, *(row for row in rows if row is not held)]
    each = sum(row["rough"]["median"] for row in rows) / steps_of_cost(own, 1.0)
    time = (seconds - len(rows) * trial.startup(own)) / each
    if time < WORTH * summary["time"]:
        return
    some = [_point(own, row) for row in rows]
    how = FOLDER, summary["time"], out, ranks, silence, meter
    tried.found |= runs(own, some, time, *how)
    tried.alone = _point(own, best)
    tried.judge(own)


def _hidden(best, name, most) -> bool:
    """Whether noise of the run that a mean is held against, half of its variance, hides whether the
    step is within a target."""
    error = Estimate.of(best["errors"][name])
    return seen(error) + error.margin / math.sqrt(2) > most


def neighbours(rows: Sequence[Any], best: Mapping[str, Any]) -> list[Any]:
    """The row, and those of its integrator with the next shorter and longer step, if these run."""
    own = [row for row in rows if row["integrator"] == best["integrator"] and not row["failed"]]
    own.sort(key=lambda row: row["dt"])
    at = [row["dt"] for row in own].index(best["dt"])
    return own[max(0, at - 1) : at + 2]


def _point(own, row) -> trial.Point:
    return trial.Point(own.integrators[row["integrator"]], row["dt"])


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
