"""What the steps of a trial cost that could be advised: timed in turn, without samples."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..choice import least, meets
from ..own.system import Own
from ..running import rounds, run
from ..statistics import measures
from . import trial, turns
from .targets import judged, steps_of_cost

ROUNDS, SECONDS = 3, 0.5  # s of each segment of a round
# what is timed costs so many times the fastest good one at most, by the runs; else so many points
SLOWER, FASTEST = 1.25, 4


def total(some: Sequence[trial.Point]) -> int:
    """Runs that a meter counts, at most."""
    return ROUNDS * min(len(some), FASTEST)


def seconds(own: Own, some: Sequence[trial.Point]) -> float:
    """Time for it, about."""
    return total(some) * (trial.startup(own) + (1 + rounds.SEGMENTS) * SECONDS)


def candidates(summary: Mapping) -> list[Any]:
    """The rows that could be advised, by what the runs themselves took."""
    wanted = summary["targets"]
    rows = [row for row in summary["points"] if row["asked"]]
    best = trial.chosen(trial.roughly(rows), wanted, summary["level"]).fastest
    near = {id(row) for row in trial.near_failure(rows)}
    found = []
    for row in (one for one in rows if id(one) not in near):
        own = judged(row, wanted)
        if row["rough"] and own and meets(row, own) is not False:
            found.append(row)
    found.sort(key=lambda row: row["rough"]["min"])
    if best is None:
        return found[:FASTEST]
    return [row for row in found if row["rough"]["min"] <= SLOWER * least(best)]


def time(
    own: Own, rows: Sequence[Any], out: Path, ranks: int, silence: float, meter: run.Meter
) -> None:
    """Give rows their costs.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """
    if not rows:
        return
    by_name, some = {}, {}
    for row in rows:
        one = trial.Point(own.integrators[row["integrator"]], row["dt"])
        runs = rounds.lengths(row["rough"]["min"] / steps_of_cost(own, one.dt), SECONDS).runs
        label = f"{row['label']}, {row['dt']:g} {own.units.time}, timed"
        by_name[one.name] = row
        some[one.name] = turns.Timed(label, one.integrator, one.dt, runs)
    found = turns.loops(own, "timed", some, ROUNDS, out, ranks, silence, meter)
    for name, row in by_name.items():
        if found[name]:
            steps = steps_of_cost(own, row["dt"])
            row["cost"] = measures.spread(loop * steps for loop in found[name])
