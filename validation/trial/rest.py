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

from ..choice import least
from ..own import shapes
from ..own.system import Own
from ..running import run
from ..running.store import Store
from ..statistics.estimate import Estimate, margin
from . import trial
from .targets import MEANS, judged, steps_of_cost

FIRST = 0.5  # of the time of all steps, for the short runs
CHOICE = 3  # points: among fewer there is none
SHARE = 0.5  # of what may go wrong, for steps that short runs name
GAIN = 0.9  # of the cost of the fastest step that is known to be good: one that is worth a run
WORTH = 1.5  # times what counts of the short runs, at least
FOLDER = "longer"  # of the runs
FRAMED = frozenset(("temperature", "rdf"))  # targets that frames tell


class Plan(NamedTuple):
    """A step to which the time could go.

    Attributes:
        row: of the step.
        wanted: the targets that it has errors of.
        noise: standard errors of the short run, by target.
        again: whether the run that means are held against is done as long, too.
        time: of the run, in the script's units.
        times: what counts of it, over what counts of the short one.
        frames: of it, over those of the short one that are independent.
    """

    row: Any
    wanted: Mapping[str, float]
    noise: Mapping[str, float]
    again: bool
    time: float
    times: float
    frames: float


def total() -> int:
    """Runs that a meter counts, at most."""
    return 2


def plan(own: Own, summary: Mapping[str, Any], seconds: float) -> Plan | None:
    """What is run for so many s; None if nothing is worth it, as when the fastest step that may be
    good is known to be."""
    wanted = summary["targets"]
    asked = trial.roughly(row for row in summary["points"] if row["asked"])
    told = [row for row in asked if judged(row, wanted) == wanted]
    if not told:  # nobody knows their energy
        wanted = judged(asked[0], wanted) if asked else {}
    known = least_known(told or asked, wanted, summary["level"])
    rows = trial.able(told or asked, wanted)
    # short runs may not tell g(r): then the others decide, and a long one tells it
    lost = {"rdf"} & wanted.keys() if 2 * sum(map(_tells_g, rows)) < len(rows) else set()
    wanted = {name: most for name, most in wanted.items() if name not in lost}
    rows = [
        row
        for row in rows
        if wanted and wanted.keys() <= row["by_itself"].keys() & row["errors"].keys()
    ]
    plans = []
    for row in rows:
        if least(row) < GAIN * known:
            alike = [one for one in told or asked if one["integrator"] == row["integrator"]]
            noise = _noise(row, alike, wanted)
            frames = statistics.median(one["independent"] for one in alike if one["independent"])
            for again in (True,) if lost else _choices(wanted):
                plans.append(_plan(own, summary, seconds, row, wanted, noise, frames, again))
    plans = [one for one in plans if one.times >= WORTH]
    return max(plans, key=lambda one: pays(one, known), default=None)


def _tells_g(row) -> bool:
    return "rdf" in row["errors"]


def least_known(rows: Sequence[Any], wanted: Mapping[str, float], level: float) -> float:
    """The cost of the fastest step that short runs name; infinite if there is none."""
    best = trial.chosen(rows, wanted, level).fastest
    return least(best) if best else math.inf


def _choices(wanted) -> tuple[bool, ...]:
    """Whether the run that means are held against may be, or has to be, as long.

    Densities and potential energies go on to settle for long: the same part of a run counts.
    """
    if not wanted.keys().isdisjoint(MEANS - {"rdf"}):
        return (True,)
    return (False, True) if "rdf" in wanted else (False,)


def _noise(row, alike, wanted) -> dict[str, float]:
    """Standard errors of a row's own run.

    Those of means are about the same at all steps of an integrator, and a run as short as these
    tells them badly: the median of all is taken.  Else the step would be chosen whose noise is the
    most underrated.
    """
    found = {name: row["by_itself"][name]["error"] for name in wanted}
    for name in wanted.keys() & (FRAMED | MEANS):
        known = (one["by_itself"].get(name) for one in alike)
        found[name] = statistics.median(one["error"] for one in known if one)
    return found


def _plan(own, summary, seconds, row, wanted, noise, frames, again) -> Plan:
    held = [one for one in summary["points"] if one["is_reference"]]
    some = [row, *(held if again else [])]
    each = sum(one["rough"]["median"] for one in some) / steps_of_cost(own, 1.0)
    short, long = summary["time"], (seconds - len(some) * trial.startup(own)) / each
    counts = long - max(trial.SETTLES * long, short)
    times = counts / ((1 - trial.SETTLES) * short)
    kept = trial.frames_of(own, long, row["dt"]) * counts / long
    return Plan(row, wanted, noise, again, long, times, kept / frames)


def pays(plan: Plan, known: float = math.inf) -> tuple[float, float]:
    """The chance that the run finds the step good for sure, times how much faster it is; and for
    those that have none how far error bars are from a target, in parts of it.

    Args:
        known: cost of the fastest step that is known to be good.
    """
    chance, room = 1.0, math.inf
    for name, most in plan.wanted.items():
        error = Estimate.of(plan.row["errors"][name])
        if name in MEANS and not plan.again:  # the short runs tell it, or nothing does
            chance *= error.value + error.margin <= most
            continue
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

    That of a slope goes as the length to -3/2.  What comes from frames has less noise if there are
    more of them.
    """
    if name == "drift":
        return plan.times**-1.5
    return (min(plan.times, plan.frames) if name in FRAMED else plan.times) ** -0.5


def long_run(
    own: Own,
    tried: trial.Trial,
    seconds: float,
    out: Path,
    ranks: int,
    silence: float,
    meter: run.Meter,
) -> None:
    """Run what pays most, and put its row in the place of its short run's.

    Short runs are held against a short run, and a long one against a long one: so what is still
    settling after the start is the same in both.  If there is no other long one, the errors of
    means stay those that the short runs tell.

    Args:
        tried: its ``points`` are changed.
        seconds: that are left.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """
    summary, held = tried.summary, tried.every[0]
    best = plan(own, summary, seconds)
    if best is None:
        return
    one = trial.Point(own.integrators[best.row["integrator"]], best.row["dt"])
    some = [*([held] if best.again else []), one]
    found = runs(own, some, best.time, FOLDER, summary["time"], out, ranks, silence, meter)
    if one not in found:
        return
    row = rows(own, tried, [one], found)[0]
    row |= {"alone": True, "held": best.time if held in found else None}
    if held not in found:
        row["untold"] = best.row["untold"]
        for kind in ("errors", "signed"):
            kept = {name: one for name, one in row[kind].items() if name not in MEANS}
            row[kind] = kept | {
                name: best.row[kind][name] for name in MEANS & best.row[kind].keys()
            }
    summary["points"] = [
        row if (other["integrator"], other["dt"]) == (row["integrator"], row["dt"]) else other
        for other in summary["points"]
    ]


def rows(
    own: Own,
    tried: trial.Trial,
    some: Sequence[trial.Point],
    found: Mapping[trial.Point, trial.Done],
) -> list[dict]:
    """Rows of points, from the shortest step, by these runs alone; and by the short one that means
    are held against, if there is no other."""
    held = tried.every[0]
    every = [held, *(one for one in some if one != held)]
    newest = {**tried.found, **found}
    known = {one: newest[one] for one in every if one in newest}
    made = trial.rows(own, every, some, known, tried.summary["targets"])
    return sorted((row for row in made if row["asked"]), key=lambda row: row["dt"])


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
    turning = shapes.freedom_of_turning(own)
    return {
        one: trial.done(own, one, jobs[one.name], lengths, turning, settles)
        for one in some
        if run.is_there(jobs[one.name], failures=True)
    }
