"""A script's integrators with its step and longer ones: what is wrong where, and what it costs.

A point is an integrator with a time step.  All begin with the same state and last the same time;
of each the first part is left out.  Means are held against those of ours with half of the script's
step.  An integrator's longer steps are left out when one has failed.

Several processes with the same command share the points, through locks in the folder.
"""

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..choice import (
    Choice,
    before_bad,
    choose,
    from_the_shortest,
    least,
    passes,
)
from ..own import counted, schemes, shapes
from ..own.system import Own
from ..running import machine, rounds, run
from ..running.store import Store
from ..scenes.integrators import OURS, Integrator
from ..statistics import measures
from ..statistics.estimate import CONFIDENCE, Estimate
from . import errors
from .targets import SPAN, about, name_of_ns, steps_of_cost

FACTORS = 1.0, 1.5, 2.0, 3.0, 4.0, 6.0  # of the script's step
FINER = 0.5  # the reference's step, of the script's
USUAL = 2  # integrators: ours and the script's, or a rigid fix of LAMMPS; the fewer share a budget
FRAMES, APART = 200, 12  # of a run, or steps between them if it is long
ATOMS, FEW = 6_000_000, 20  # in all frames of a run at most, but so many frames at least
SETTLES = 0.25  # of the frames are left out
PARTS, MANY = (8, 4, 2), 8000  # samples of the energy in `SPAN`; more than one for so many in all
LEAST = 400  # steps of a run
SAFE = 1.5  # times a step that is named, the integrator still runs
LEAST_PART = 0.2  # of the time for all, for steps, however long starts take


@dataclass(frozen=True)
class Point:
    """An integrator with a time step, in the script's units."""

    integrator: Integrator
    dt: float

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"{run.folder_name(self.integrator.name)}/{self.dt:g}"


@dataclass(frozen=True)
class Lengths:
    """How long runs are: ``time`` of each in the script's units, of so many ``frames`` at most."""

    time: float
    frames: int
    dt: float  # the script's

    @property
    def sample(self) -> float:
        """Time between two samples of the energy: `SPAN`, or a part of it."""
        span = SPAN * self.dt
        parts = next((one for one in PARTS if one * self.time <= MANY * span), 1)
        return min(span / parts, self.time / self.frames)

    def every(self, dt: float) -> int:
        """Steps between two samples."""
        return max(1, round(self.sample / dt))

    def runs(self, dt: float) -> list[int]:
        """Steps between frames."""
        samples = math.ceil(self.time / self.frames / self.sample * (1 - 1e-9))
        frames = max(FEW, round(self.time / (samples * self.sample)))
        return [samples * self.every(dt)] * frames


def points(
    own: Own, only: Sequence[str] | None, steps: Sequence[float] | None, many: bool
) -> list[Point]:
    """What is run, in this order; ``many`` for all integrators, else the usual ones."""
    known = own.integrators
    if not only:
        usual = [OURS, own.reference, "rigid/nve/small", "rigid/nvt/small", "rigid/npt/small"]
        only = [one for one in known if many or one in usual][: None if many else USUAL]
    dts = sorted(steps or (factor * own.scene.dt for factor in FACTORS))
    return [Point(known[name], dt) for dt in dts for name in only]


def reference(own: Own) -> Point:
    """What means are held against."""
    ours = next((one for one in own.integrators.values() if one.kind == "ours"), None)
    return Point(ours or own.integrators[own.reference], FINER * own.scene.dt)


def total(some: Sequence[Point]) -> int:
    """Runs that a meter counts, about."""
    return len(some) + 2


def startup(own: Own) -> float:
    """s until a run's first step, about."""
    return 3.0 + 2e-5 * len(own.found.body)


def lengths_of(own: Own, time: float, some: Iterable[Point]) -> Lengths:
    """Of runs of points, with as many frames as the longest step and the memory have room for."""
    return Lengths(time, frames_of(own, time, max(one.dt for one in some)), own.scene.dt)


def frames_of(own: Own, time: float, dt: float) -> int:
    """Frames of a run with this step, at most."""
    most = max(FEW, ATOMS // len(own.found.body))
    return min(most, max(FRAMES, int(time / dt / APART)))


class Done(NamedTuple):
    """What is kept of a run: its positions would be too much memory."""

    failed: str | None
    time: float  # in the script's units
    seconds: list[float]  # of a step, in order
    numbers: dict


@dataclass
class Trial:
    """What was run.

    Attributes:
        summary: plain data, with ``points``, a row of each point, see `rows`.
        every: the points; the first is what means are held against.
        found: the runs.
        seconds: that these take, by the time of a step when it was measured.
    """

    summary: dict
    every: Sequence[Point]
    found: dict[Point, Done]
    seconds: float = 0.0


def trial(
    own: Own,
    some: Sequence[Point],
    seconds: float,
    most: float,
    out: Path,
    ranks: int,
    silence: float,
    meter: run.Meter,
    wanted: Mapping[str, float],
) -> Trial:
    """Run what is not there yet, and measure.

    Args:
        some: of `points`.
        seconds: that all may take, by the time of a step now.
        most: s, after which no further run begins.
        wanted: of `targets.targets`.

    Returns:
        after a Ctrl-C what is complete; its summary says ``interrupted``.
    """
    held = reference(own)
    every = [held, *(one for one in some if one != held)]
    # records of lengths, which no error follows from
    store = Store(out / "records", "own.system")
    summary = _summary(own, held, ranks, wanted)
    tried = Trial(summary, every, {})
    origin = store.origin(own.scene, seconds, ranks, [one.name for one in every])
    try:
        with store.locked("plan"):
            make = partial(_plan, own, every, seconds, out, ranks, silence, meter)
            plan = store.once("plan", origin, make)
        lengths = lengths_of(own, plan["time"], every)
        summary["time"] = lengths.time
        steps = sum(lengths.time / one.dt for one in every)
        tried.seconds = startup(own) * len(every) + plan["step"] * steps
        jobs = {one: job(own, one, out / "runs", lengths, ranks, silence) for one in every}
        summary["late"] = not _run(own, jobs, store, most, meter)
    except KeyboardInterrupt:
        summary["interrupted"] = True
        if "jobs" not in locals():
            return tried
    rest = shapes.freedom_of_turning(own)
    for one, job_of_it in jobs.items():
        if run.is_there(job_of_it, failures=True):
            tried.found[one] = done(own, one, job_of_it, lengths, rest)
    summary["points"] = rows(own, every, some, tried.found, wanted)
    return tried


def _summary(own: Own, held: Point, ranks: int, wanted: Mapping[str, float]) -> dict:
    """Of a trial that has not begun."""
    return machine.circumstances() | {
        "title": own.scene.title,
        "script": Path(own.ask.script).name,
        "notes": own.notes,
        "units": own.scene.units,
        "ns": name_of_ns(own),
        "ranks": ranks,
        "dt": own.scene.dt,
        "bodies": own.bodies,
        "reference": held.dt,
        "targets": dict(wanted),
        "about": about(own, wanted),
        "interrupted": False,
        "late": False,
        "points": [],
    }


def chosen(points: Iterable[Any], wanted: Mapping[str, float], level: float) -> Choice:
    """The `Choice` among `rows`.

    It is among those that are `able`.  Of each integrator they are judged one after the other, see
    `from_the_shortest`; ``level`` is that of all integrators.  A row that a run of its own judges,
    ``alone``, is good or bad by that.
    """

    def within(some, targets):
        good = from_the_shortest([one for one in some if not one["alone"]], targets, level)
        alone = [one for one in some if one["alone"] and one["cost"]]
        good += [one for one in alone if passes(one, targets, CONFIDENCE)]
        return sorted(good, key=least)

    return choose(able(points, wanted), wanted, within)


def roughly(points: Iterable[Any]) -> list[Any]:
    """Rows, with costs of the runs themselves where there are no others."""
    return [one | {"cost": one["cost"] or one["rough"]} for one in points]


def able(points: Iterable[Any], wanted: Mapping[str, float]) -> list[Any]:
    """The rows that may be good: of each integrator those up to the first that is not good for
    sure, and those that a run of its own judges; without those that are `near_failure`."""
    points = list(points)
    kept = {id(one) for one in before_bad(points, wanted)}
    kept |= {id(one) for one in points if one["alone"]}
    kept -= {id(one) for one in near_failure(points)}
    return [one for one in points if id(one) in kept]


def near_failure(points: Iterable[Any]) -> list[Any]:
    """The rows whose step is more than 1 / `SAFE` of one with which their integrator fails.

    What ends a run, as a bond that breaks, is rare at steps that are a little shorter.  A run that
    does not see it says nothing of one that is longer.
    """
    points, ends = list(points), dict[str, float]()
    for one in points:
        if one["failed"]:
            name = one["integrator"]
            ends[name] = min(one["dt"], ends.get(name, math.inf))
    return [
        one
        for one in points
        if not one["failed"]
        and SAFE * one["dt"] > ends.get(one["integrator"], math.inf) * (1 + 1e-9)
    ]


def _plan(own, every, seconds, out, ranks, silence, meter) -> dict:
    """How long runs are, if that is not known, from the time of a step now."""
    one = every[0]
    meter.begin("a step's time", 1)

    def make(runs):
        how: dict = {"dt": one.dt, "every": 0, "ranks": ranks, "silence": silence}
        folder = out / "runs" / "calibration"
        return run.job(own.scene, one.integrator, folder, runs, keeps="nothing", **how)

    step = rounds.calibrate(make)
    meter.end(None if isinstance(step, float) else step.error)
    if not isinstance(step, float):
        if step.interrupted:
            raise KeyboardInterrupt
        raise SystemExit(f"{own.scene.subject}: {one.integrator.label}: {step.error}")
    left = max(LEAST_PART * seconds, seconds - startup(own) * len(every))
    longest = max(one.dt for one in every)
    long = left / (step * sum(1 / one.dt for one in every))
    return {"time": max(long, LEAST * longest / 4, LEAST * own.scene.dt), "step": step}


def job(
    own: Own, one: Point, folder: Path, lengths: Lengths, ranks: int, silence: float
) -> run.Job:
    """The run of a point, in a folder of its own in this one."""
    origin = machine.origin(own.scene, one.integrator)
    how: dict = {"ranks": ranks, "silence": silence, "keeps": "motion", "origin": origin}
    how |= {"dt": one.dt, "every": lengths.every(one.dt)}
    return run.job(own.scene, one.integrator, folder / one.name, lengths.runs(one.dt), **how)


def _run(own, jobs, store, most, meter) -> bool:
    """Run what is not there yet; whether nothing was left out for taking too long.

    Args:
        most: seconds, after which no further run begins.
    """
    failed: dict[Point, str | None] = {}
    names, begin = {one.name: one for one in jobs}, time.monotonic()
    for name in store.shared(names):
        if time.monotonic() - begin > most:
            return False
        one = names[name]
        if not _skipped(own, one, jobs, failed):
            failed[one] = one_run(own, one, jobs[one], meter)
    return True


def one_run(own: Own, one: Point, job: run.Job, meter: run.Meter) -> str | None:
    """Do a run if it is not there yet; None, or why it is none.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """
    meter.begin(f"{one.integrator.label}, {one.dt:g} {own.units.time}", 1)
    result = run.once(job, failures=True)
    meter.end(result.error)
    if result.interrupted:
        raise KeyboardInterrupt
    return failure(own, result)


def _skipped(own, one, jobs, failed) -> bool:
    """Whether a shorter step of the same integrator has failed, here or in another process."""
    for other, job in jobs.items():
        if other.integrator is one.integrator and other.dt < one.dt:
            if other not in failed and run.is_there(job, failures=True):
                failed[other] = failure(own, run.collect(job.directory))
            if failed.get(other):
                return True
    return False


def failure(own: Own, result: run.Result) -> str | None:
    """None, or in a line why a run is none."""
    if result.error:
        return result.error
    kelvin, at = result.thermo["Temp"], shapes.temperature(own)
    bad = ~np.isfinite(result.thermo["TotEng"]) | (kelvin > 2 * max(at, kelvin[0]))
    if not bad.any():
        return None
    step = result.thermo["Step"][bad][0]
    return f"it heats: the temperature is {kelvin[bad][0]:.4g} at step {step:.0f}"


def done(
    own: Own, one: Point, job: run.Job, lengths: Lengths, rest: int, settles: float = SETTLES
) -> Done:
    """What is kept of a point's run; ``rest`` and ``settles`` as for `errors.numbers`."""
    result = run.collect(job.directory)
    failed = failure(own, result)
    spent = [wall / steps for wall, steps in zip(result.seconds.get("runs", ()), job.runs)]
    numbers = {} if failed else errors.numbers(own, one.dt, result, settles, rest)
    return Done(failed, lengths.time, spent, numbers)


def rows(
    own: Own,
    every: Sequence[Point],
    some: Sequence[Point],
    found: Mapping[Point, Done],
    wanted: Mapping[str, float],
) -> list[dict]:
    """A row for each point, as ``validation.choice`` takes them; ``some`` are those asked for.

    Of each error there is ``errors``, which all steps of the integrator tell, and ``by_itself``,
    which its own run does.
    """
    held = every[0]
    failed = {one: done.failed for one, done in found.items()}
    numbers = {one: done.numbers for one, done in found.items() if not done.failed}
    made = []
    for one in every:
        integrator, done = one.integrator, found.get(one)
        fails = [
            f"{other.dt:g}: {failed[other]}"
            for other in every
            if other.integrator is integrator and other.dt <= one.dt and failed.get(other)
        ]
        if done is None and not fails:
            continue
        row = _row(own, one, done, fails[0] if fails else None)
        row |= {"is_reference": one == held, "asked": one in some}
        if not fails and done is not None:
            alike = {
                other.dt: said for other, said in numbers.items() if other.integrator is integrator
            }
            against = numbers.get(held), held.dt if held.integrator is integrator else 0.0
            row |= _measured(own, one, done, alike, against, wanted)
        made.append(row)
    return made


def _row(own: Own, one: Point, done: Done | None, fails: str | None) -> dict:
    """A row of `rows`, without what was measured."""
    integrator = one.integrator
    lines = [*own.found.setup, *integrator.commands(own.scene)]
    gone = dict(zip(own.found.ids, own.found.lines))
    lost = [] if integrator.then else schemes.naming(gone, own.said["commands"], lines)
    return {
        "integrator": integrator.name,
        "label": integrator.label,
        "ours": integrator.kind == "ours",
        "lines": lines,
        "place": schemes.place(gone),
        "lost": lost,  # what of the script these lines cannot have beside them
        "dt": one.dt,
        "starts": 1,
        "time": done and done.time,
        "alone": False,  # whether a run of its own judges it, see ``rest``
        "held": None,  # how long a run it is then held against, if not a short one
        "failed": fails,
        "uncounted": counted.wrongly(integrator),
        "rough": None,  # its cost by its run, with samples
        "cost": None,
        "errors": {},
        "signed": {},
        "by_itself": {},
        "independent": None,  # so many frames
        "untold": None,  # why g(r) has no error, of `errors.Untold`
    }


def _measured(
    own: Own,
    one: Point,
    done: Done,
    alike: Mapping[float, Any],
    against: tuple[Any, float],
    wanted: Mapping[str, float],
) -> dict:
    """What the run of a point adds to its row.

    Args:
        alike: of each step of its integrator the numbers of its run.
        against: the reference's numbers, and its step, 0 where that is another integrator's.
    """
    spent = np.array(done.seconds) * steps_of_cost(own, one.dt)
    parts = np.array_split(spent, 5)
    mine = {one.dt: alike[one.dt]}
    by_itself = errors.errors(own, one.integrator, one.dt, mine, *against)
    signed = by_itself | errors.of_means(own, one.dt, alike, *against)
    untold = None
    if "rdf" in wanted and against[0] is not None:
        _, untold = errors.of_g(one.dt, alike, *against)
    return {
        "rough": measures.spread(float(part.mean()) for part in parts if len(part)),
        "independent": done.numbers["independent"],
        "untold": untold and untold.plain(wanted["rdf"]),
        "signed": {name: error.plain() for name, error in signed.items()},
        "errors": _sizes(signed, wanted),
        "by_itself": _sizes(by_itself, wanted),
    }


def _sizes(signed: Mapping[str, Estimate], names: Iterable[str]) -> dict[str, dict]:
    return {
        name: signed[name]._replace(value=abs(signed[name].value)).plain()
        for name in names
        if name in signed
    }
