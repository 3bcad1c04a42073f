"""The measurement: short runs of all points, then a long run of the most promising one."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

from scipy import special

from ..experiment import Outcome, Point, Trajectory, perform
from ..running import machine, run
from ..running.lammps_log import Loop
from ..running.store import Store
from ..scenes.integrators import OURS
from ..statistics import measures
from ..statistics.estimate import Estimate, margin
from ..user_script import thermostat
from . import errors, lists, plan
from .case import MEANS, Case, about
from .choice import (
    Choice,
    Measured,
    Targets,
    choose,
    cost,
    level_of_each,
    passes,
    same_thermostat,
    size,
)
from .plan import LONG, SETTLES, SHORT, STARTS, Lengths, Machine, Settings

FIRST = 0.5  # fraction of the time for the short runs
CHOICE = 3  # least number of points for a long run: with fewer, the short runs get all of the time
TRIES = 3  # long runs, each after one that fails
SHARE = 0.5  # fraction of the error probability for steps that short runs select
GAIN = 0.9  # largest cost of a step worth a long run, over that of the fastest good one


@dataclass
class Runs:
    """Outcome of the runs.

    Attributes:
        numbers: results of good runs, by point and start.
        timings: of steps without output after the runs, by point.
        failed: why the runs of a point failed.
    """

    numbers: dict[Point, dict[int, errors.Numbers]] = field(default_factory=dict)
    timings: dict[Point, list[Loop]] = field(default_factory=dict)
    failed: dict[Point, list[str]] = field(default_factory=dict)

    def fails(self, point: Point) -> str | None:
        """Why a point failed, at its step or at a shorter one of its integrator."""
        shorter = [
            other for other in self.failed if other.scheme == point.scheme and other.dt <= point.dt
        ]
        first = min(shorter, key=lambda other: other.dt, default=None)
        return f"{first.dt:g}: {self.failed[first][0]}" if first else None

    def judge(self, case: Case) -> None:
        """Attribute failures at steps above the stability limit to the step."""
        cause = f"the step is too long (unstable above about {case.unstable:.2g} {case.time}): "
        for point, why in self.failed.items():
            if point.dt > case.unstable and not why[0].startswith(cause):
                self.failed[point] = [cause + message for message in why]


class Prepared(NamedTuple):
    """A comparison that is ready to run: points, reference of means, and lengths of runs on this
    machine."""

    case: Case
    settings: Settings
    targets: Targets
    points: list[Point]
    held: Point
    here: Machine
    lengths: Lengths

    @property
    def every(self) -> list[Point]:
        """All points, the reference of means first."""
        return list(dict.fromkeys([self.held, *self.points]))

    @property
    def parts(self) -> bool:
        """Whether part of the time is for a long run."""
        return len(self.points) >= CHOICE

    @property
    def level(self) -> float:
        """The confidence for a step that short runs select."""
        names = (point.scheme for point in self.points)
        return level_of_each(names, SHARE if self.parts else 1.0)

    @property
    def steps(self) -> int:
        """Approximate number of steps of all runs together."""
        short = STARTS * sum(sum(self.lengths.runs(point.dt)) for point in self.every)
        return round(short / (FIRST if self.parts else 1.0))


def prepare(
    case: Case,
    points: list[Point],
    held: Point,
    targets: Targets,
    settings: Settings,
    meter: run.Meter,
) -> Prepared:
    """Measure the time of a step, unless the same command already has, and plan the runs.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """
    store = _store(settings)
    origin = store.origin(case.scene, settings.minutes, settings.ranks, points, held)
    with store.locked("plan"):
        make = partial(plan.calibrated, case, settings, held, meter)
        here = Machine(**store.once("plan", origin, lambda: make()._asdict()))
    part = FIRST if len(points) >= CHOICE else 1.0
    runs = [Point(case.reference, case.scene.dt), *STARTS * [held, *points]]
    seconds = part * settings.for_points
    time = plan.time_of(runs, here, (1 - plan.BENCHMARK) * seconds)
    timed = plan.benchmark(here, plan.BENCHMARK * seconds / len(runs))
    lengths = replace(plan.lengths(case, [held, *points], here, time), benchmark=timed)
    return Prepared(case, settings, targets, points, held, here, lengths)


def compare(prepared: Prepared, meter: run.Meter) -> dict:
    """Run what has no result yet, and return the summary as plain data; after a Ctrl-C that of the
    complete runs."""
    case = prepared.case
    summary = _summary(prepared)
    done = _perform(
        prepared,
        plan.trajectories(case, prepared.every, prepared.lengths, prepared.settings),
        meter,
    )
    summary["interrupted"] = done.interrupted
    summary["versions"] |= machine.worker_versions(done.versions)
    runs = collected(prepared, done)
    rows = _rows(prepared, runs)
    for _ in range(TRIES if prepared.parts else 0):
        best = None if summary["interrupted"] else choose_long_run(prepared, rows)
        if best is None:
            break
        long, row = run_longer(prepared, best, runs, meter)
        summary["interrupted"] = long.interrupted
        rows = [row if row and known is best.row else known for known in rows]
        if not (row and row["failed"]):  # a run that fails ends early, and leaves time for another
            break
    summary["points"] = rows
    summary["neighbour_lists"] = [] if summary["interrupted"] else _lists(prepared, summary, meter)
    return summary


def _choice(prepared: Prepared, rows: Sequence[Measured]) -> Choice:
    """The `Choice` among the requested points, with the script's thermostat."""
    return choose(
        same_thermostat([row for row in rows if row["asked"]], prepared.case.thermostat),
        prepared.targets,
        prepared.level,
    )


def _lists(prepared: Prepared, summary: dict, meter: run.Meter) -> list[dict]:
    """`lists.measure` of the advised point."""
    best = _choice(prepared, summary["points"]).best
    if best is None:
        return []
    case, settings, store = prepared.case, prepared.settings, _store(prepared.settings)
    point = Point(best["integrator"], best["dt"])
    make = partial(lists.measure, case, point, settings, prepared.here.startup, meter)
    origin = store.origin(
        case.scene, case.integrators[point.scheme], point.dt, settings.minutes, settings.ranks
    )
    try:
        with store.locked("lists"):
            return store.once("lists", origin, lambda: {"found": make()})["found"]
    except RuntimeError:  # the meter has shown it; the next command tries again
        return []
    except KeyboardInterrupt:
        summary["interrupted"] = True
        return []


def _summary(prepared: Prepared) -> dict:
    case = prepared.case
    return machine.circumstances() | {
        "title": case.scene.title,
        "scene": case.scene.name,
        "notes": list(case.notes),
        "units": case.scene.units,
        "ns": case.name_of_ns,
        "ranks": prepared.settings.ranks,
        "dt": case.scene.dt,
        "bodies": case.scene.unit,
        "reference": prepared.held.dt,
        "targets": dict(prepared.targets),
        "about": about(case),
        "unknown": {name: list(lost) for name, lost in case.unknown.items()},
        "why": case.why,
        "thermostat": case.thermostat,
        "usual": case.script and {"integrator": case.script.reference, "dt": case.scene.dt},
        "minutes": prepared.settings.minutes,
        "time": prepared.lengths.time,
        "level": prepared.level,
    }


def _perform(prepared: Prepared, trajectories: Sequence[Trajectory], meter: run.Meter) -> Outcome:
    return perform(
        trajectories,
        _store(prepared.settings),
        meter,
        judge=partial(
            errors.failure,
            temperature=prepared.case.temperature,
            boltzmann=prepared.case.boltzmann,
        ),
    )


def _store(settings: Settings) -> Store:
    return Store(settings.out / "records")


def collected(
    prepared: Prepared, done: Outcome, folder: str = SHORT, settles: float = SETTLES
) -> Runs:
    """The outcome of the points' runs in a folder, from each start.

    Args:
        settles: fraction of each run that is left out.
    """
    runs, case = Runs(), prepared.case
    for point in prepared.every:
        for number in range(1, 1 + STARTS):
            name = plan.name_of(folder, point, number)
            if name in done.failed:
                runs.failed.setdefault(point, []).append(done.failed[name])
            elif name in done.jobs:
                result = run.collect(done.jobs[name].directory)
                by_start = runs.numbers.setdefault(point, {})
                by_start[number] = errors.numbers(case, point.dt, result, settles)
                runs.timings.setdefault(point, []).extend(result.benchmark[1:])
    runs.judge(case)
    return runs


def _rows(prepared: Prepared, runs: Runs) -> list[Measured]:
    """A row for each point that has run, or whose integrator fails at the same or a shorter
    step."""
    good = {point: numbers for point, numbers in runs.numbers.items() if not runs.fails(point)}
    signed = errors.errors(prepared.case, good, prepared.held)
    alone = errors.errors(prepared.case, good, prepared.held, by_itself=True)
    rows = []
    for point in prepared.every:
        if point in good or runs.fails(point):
            estimates = signed.get(point, {}), alone.get(point, {})
            rows.append(row(prepared, point, runs, prepared.lengths.time, *estimates))
    return rows


def row(
    prepared: Prepared,
    point: Point,
    runs: Runs,
    time: float,
    signed: Mapping[str, Estimate],
    by_itself: Mapping[str, Estimate],
) -> Measured:
    """The row of a point, whose runs have this time."""
    case, fails = prepared.case, runs.fails(point)
    integrator = case.integrators[point.scheme]
    timings = [] if fails else runs.timings.get(point, [])
    wall = [loop.seconds / loop.steps * case.ns / point.dt for loop in timings]
    shares = [100.0 if loop.cpu is None else loop.cpu for loop in timings]
    cpu = [
        loop.ranks * share / 100 * seconds for loop, share, seconds in zip(timings, shares, wall)
    ]
    signed, by_itself = ({} if fails else estimates for estimates in (signed, by_itself))
    failures = runs.failed.get(point, [])
    lines, place, lost = case.written(integrator)
    return {
        "integrator": integrator.name,
        "label": integrator.label,
        "ours": integrator.kind == "ours" and OURS in integrator.name,
        "thermostat": thermostat.kind_of(integrator.lines),
        "lines": lines,
        "place": place,
        "lost": lost,
        "dt": point.dt,
        "starts": len(runs.numbers.get(point, ())) + len(failures),
        "time": time,
        "failed": fails,
        "failures": len(failures),
        "is_reference": point == prepared.held,
        "asked": point in prepared.points,
        "alone": False,
        "cost": measures.spread(wall) if wall else None,
        "cpu": measures.spread(cpu) if cpu else None,
        "share": sum(shares) / len(shares) if shares else None,
        "errors": {name: size(estimate) for name, estimate in signed.items()},
        "signed": {name: estimate.plain() for name, estimate in signed.items()},
        "by_itself": {name: size(estimate) for name, estimate in by_itself.items()},
        "without": list(case.unknown.get(point.scheme, ())),
    }


class Plan(NamedTuple):
    """A long run of one point, for the rest of the time.

    Attributes:
        row: row of the point.
        targets: targets by which it is judged.
        again: whether the reference runs as long, too: if the short runs cannot measure the means.
        time: of the run, in the scene's units.
        times: length that counts, over that of the short runs.
    """

    row: Measured
    targets: Targets
    again: bool
    time: float
    times: float

    @property
    def point(self) -> Point:
        """The point of the row."""
        return Point(self.row["integrator"], self.row["dt"])


def choose_long_run(prepared: Prepared, rows: Sequence[Measured]) -> Plan | None:
    """The long run to do: of the point with the largest probability that the run confirms it, times
    its gain in speed.  None if no point may be good and is faster than the fastest one known to be
    good."""
    choice = _choice(prepared, rows)
    known = cost(choice.fastest) if choice.fastest else math.inf
    plans = [
        _plan(prepared, row, choice.targets)
        for row in choice.perhaps
        if cost(row) < GAIN * known and choice.targets.keys() - MEANS <= row["by_itself"].keys()
    ]
    plans = [candidate for candidate in plans if candidate.times > 0]
    return max(plans, key=lambda candidate: expected_gain(candidate, known), default=None)


def _plan(prepared: Prepared, row: Measured, targets: Targets) -> Plan:
    held, short = prepared.held, prepared.lengths.time
    point = Point(row["integrator"], row["dt"])
    means = {name: most for name, most in targets.items() if name in MEANS}
    again = not passes(row, means) and point != held
    long = plan.time_of(
        [point, *([held] if again else [])],
        prepared.here,
        (1 - FIRST) * prepared.settings.for_points,
    )
    counts = long - max(SETTLES * long, short)
    return Plan(row, targets, again, long, counts / ((1 - SETTLES) * short * row["starts"]))


def expected_gain(plan: Plan, known: float = math.inf) -> tuple[float, float]:
    """The probability that the run confirms the point, times its speed-up; and for points without
    one the distance between error bars and a target, relative to it.

    Args:
        known: cost of the fastest point that is known to be good.
    """
    chance, room = 1.0, math.inf
    for name, most in plan.targets.items():
        if name in MEANS:  # a long run may measure what short runs cannot
            continue
        error = Estimate.of(plan.row["errors"][name])
        # the noise of a slope is proportional to length^(-3/2)
        noise = plan.row["by_itself"][name]["error"] * plan.times ** (
            -1.5 if name == "drift" else -0.5
        )
        left, spread = most - margin(noise), math.hypot(error.error, noise)
        room = min(room, left / most)
        if left <= 0 or not spread > 0:
            chance *= 0 < left >= error.value
            continue
        above, below = ((side * left - error.value) / spread for side in (1, -1))
        chance *= float(special.ndtr(above) - special.ndtr(below))
    return chance * (1 / cost(plan.row) - 1 / known), room


def run_longer(
    prepared: Prepared, best: Plan, short: Runs, meter: run.Meter
) -> tuple[Outcome, Measured | None]:
    """Run a plan: its outcome, and the point's row by this run alone; None if there is none.

    It begins with the last start, and leaves out as much time as the short runs, which selected the
    point, lasted: the selection must not bias the judgement.  Means are compared with a reference
    that is as long, or stay those of the short runs, if there is none or if it needs other steps.
    """
    case, point, held = prepared.case, best.point, prepared.held
    points = [point, *([held] if best.again else [])]
    lengths = plan.lengths(case, points, prepared.here, best.time)
    lengths = replace(lengths, benchmark=prepared.lengths.benchmark)
    settles = max(SETTLES, prepared.lengths.time / lengths.time)
    how = case, points, prepared.lengths, prepared.settings, [STARTS], lengths
    done = _perform(prepared, plan.trajectories(*how), meter)
    runs = collected(prepared, done, LONG, settles)
    runs.timings[point] = short.timings.get(point, []) + runs.timings.get(point, [])
    if point not in runs.numbers and point not in runs.failed:
        return done, None
    estimates = errors.errors(case, runs.numbers, held, True, short.numbers, best.times * STARTS)
    means = {
        name: Estimate.of(estimate)
        for name, estimate in best.row["signed"].items()
        if name in MEANS
    }
    signed = means | estimates.get(point, {}) if best.again else estimates.get(point, {}) | means
    return done, row(prepared, point, runs, lengths.time, signed, signed) | {"alone": True}
