"""All that ``advise`` and ``sweep`` measure of a script: short runs, a long one, costs, skins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ..choice import level_of_each
from ..own.system import Own
from ..running import run
from . import confirm, lists, report, rest, timed, trial

LATE = 1.5  # of the time that runs may take: then no further one begins


def total(points: Sequence[trial.Point], many: bool, confirms: bool) -> int:
    """Runs that a meter counts, about; see `measure`."""
    some = trial.total(points) + timed.total(points) + lists.total(many)
    return some + (not many) * rest.total() + confirms * confirm.total()


def measure(
    own: Own,
    points: Sequence[trial.Point],
    wanted: Mapping[str, float],
    minutes: float,
    many: bool,
    confirms: bool,
    out: Path,
    ranks: int,
    silence: float,
    meter: run.Meter,
) -> dict:
    """All of it, as plain data; after a Ctrl-C what is complete.

    Args:
        points: of `trial.points`.
        wanted: of `targets.targets`.
        minutes: that all may take but what ``confirms``.
        many: whether all points run for as long as they can, and none is advised.
        confirms: whether the advised step runs for longer.
    """
    how = out, ranks, silence, meter
    all_runs = 60 * minutes * (1 - lists.share(many)) - timed.seconds(own, points)
    all_runs = max(all_runs, trial.LEAST_PART * 60 * minutes)
    starts = trial.startup(own) * (1 + len(points))
    parts = not many and len(points) >= rest.CHOICE
    short = starts + rest.FIRST * max(0.0, all_runs - starts) if parts else all_runs
    tried = trial.trial(own, points, short, LATE * all_runs, *how, wanted)
    summary = tried.summary
    summary["minutes"] = minutes
    summary["level"] = level_of_each(
        ({"integrator": one.integrator.name} for one in points), rest.SHARE if parts else 1.0
    )
    if summary["interrupted"]:
        return summary
    try:
        if parts and not summary["late"]:
            rest.long_run(own, tried, all_runs - tried.seconds, *how)
        timed.time(own, timed.candidates(summary), *how)
        best = report.answer(summary)[0].best
        if best and not many:
            summary["lists"] = lists.tried(own, best, minutes, *how)
            if confirms:
                report.write(summary, out)  # whatever becomes of the longer runs
                summary["confirmed"] = confirm.confirm(own, tried, best, *how)
    except KeyboardInterrupt:
        summary["interrupted"] = True
    return summary
