"""Whether an advised step bears out: runs ten times as long, with it and with a longer one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from ..choice import Measured, meets
from ..own.system import Own
from ..running import run
from ..statistics.estimate import SURE, Estimate
from . import rest, trial
from .targets import MEANS, judged

LONGER = 10.0  # times as long as the runs by which it was chosen
FURTHER = 1.5  # times the advised step, which should not do, or more than was told would
FOLDER = "confirmed"


def total() -> int:
    """Runs that a meter counts, at most."""
    return 3


def confirm(
    own: Own,
    tried: trial.Trial,
    best: Mapping,
    out: Path,
    ranks: int,
    silence: float,
    meter: run.Meter,
) -> dict:
    """Run the advised integrator with the advised and with a longer step, each ten times as long as
    before; and so the run that means are held against, if there are any.

    Args:
        best: the trial's row that is advised.

    Returns:
        ``time`` of each run, and ``points``: the rows.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """
    one, how = own.integrators[best["integrator"]], (out, ranks, silence, meter)
    some = [trial.Point(one, factor * best["dt"]) for factor in (1.0, FURTHER)]
    found = rest.runs(own, some, LONGER * best["time"], FOLDER, best["time"], *how)
    held = tried.every[0]
    if held not in some and not MEANS.isdisjoint(tried.summary["targets"]):
        before = best["held"] or tried.summary["time"]
        found |= rest.runs(own, [held], LONGER * before, FOLDER, before, *how)
    return {"time": LONGER * best["time"], "points": rest.rows(own, tried, some, found)}


def points(summary: Mapping) -> list[Measured]:
    """The rows of the runs ten times as long that say whether an advised step bears out."""
    found = summary.get("confirmed")
    return found["points"] if found else []


def holds(summary: Mapping) -> bool | None:
    """Whether the advised step is within the targets in a run ten times as long; None if there is
    no telling, or no such run."""
    found = points(summary)
    return meets(found[0], judged(found[0], summary["targets"])) if found else None


def said(summary: Mapping, unit: str) -> Iterator[str]:
    """What is to be said of these runs."""
    found = points(summary)
    if not found:
        return
    words = {
        True: "is within the targets",
        False: "is not within the targets",
        None: "may be within the targets or not",
    }
    for one in found:
        wanted = judged(one, summary["targets"])
        step = f"{one['dt']:g} {unit}, in a run {LONGER:g} times as long"
        if one["failed"]:
            yield f"{step}, fails: {one['failed']}."
            continue
        errors = (
            f"{name} {Estimate.of(one['errors'][name]).text()} (at most {most:g})"
            for name, most in wanted.items()
            if name in one["errors"]
        )
        verdict = words[meets(one, wanted)]
        yield f"{step}, {verdict}, by {SURE}: {', '.join(errors)}."
