"""Experiments of the verbs.

A *point* is a scheme at a time step.  A *trajectory* is one run of a point from one start.
`perform` runs the trajectories without results.  An `Observable` is measured in them.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from .running import run
from .running.store import Store
from .statistics.estimate import Estimate


class Point(NamedTuple):
    """A scheme's name, and a time step in fs (in the script's units, of a user's script)."""

    scheme: str
    dt: float


@dataclass(frozen=True)
class Trajectory:
    """One run of a point from one start.

    Attributes:
        name: of its folder, in that of the experiment.
        label: for the terminal.
        job: returns its job, once the file of its start exists.
        point: that is run; None for a run that creates a start.
        start: name of the trajectory that creates its start; empty for none.
    """

    name: str
    label: str
    job: Callable[[], run.Job]
    point: Point | None = None
    start: str = ""


@dataclass(frozen=True)
class Observable:
    """A measured quantity.

    Attributes:
        key: in summaries.
        title, unit: for tables and figures.
        of: its estimate from a verb's record of a trajectory; None if the record has none.
    """

    key: str
    title: str
    unit: str
    of: Callable[[Any], Estimate | None]


@dataclass
class Outcome:
    """The outcome of an experiment.

    Attributes:
        jobs: of the trajectories that have ended, by name.
        failed: why trajectories failed, by name.
        left_out: names of those that were not run, because their start or the same scheme at the
            same or a shorter step has failed.
        versions: LAMMPS's, by name.
        interrupted: whether Ctrl-C was pressed.
    """

    jobs: dict[str, run.Job] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    left_out: set[str] = field(default_factory=set)
    versions: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False


def perform(
    trajectories: Collection[Trajectory],
    store: Store,
    meter: run.Meter,
    *,
    judge: Callable[[run.Result], str | None] = lambda result: result.error,
    ladders: bool = True,
) -> Outcome:
    """Run the trajectories without results.

    Processes with the same command share the trajectories, through locks in the store's folder.
    Trajectories that create starts come first.  A run that LAMMPS or a fix has ended with a message
    is a result, and not run again.

    Args:
        trajectories: in the order in which they run; the shorter steps of a scheme come first.
        judge: returns why a result is a failure, or None; wrong numbers are a failure, too. By
            default a run is one if LAMMPS or a fix has ended it.
        ladders: whether a scheme that has failed is left out at longer steps.

    Returns:
        the outcome; after Ctrl-C, of what had ended before.
    """
    outcome, every = Outcome(), list(trajectories)
    starts = [trajectory for trajectory in every if trajectory.point is None]
    points = [trajectory for trajectory in every if trajectory.point is not None]
    try:
        for stage in starts, points:
            by_name = {trajectory.name: trajectory for trajectory in stage}
            for name in store.shared(by_name):
                trajectory = by_name[name]
                needed = [other for other in every if _needs(trajectory, other, ladders)]
                if any(_has_failed(other, outcome, judge) for other in needed):
                    outcome.left_out.add(name)
                else:
                    _run(trajectory, outcome, meter, judge)
    except KeyboardInterrupt:
        outcome.interrupted = True
    return outcome


def _needs(trajectory: Trajectory, other: Trajectory, ladders: bool) -> bool:
    """Whether a trajectory is useless if another one has failed."""
    if other.name == trajectory.start:
        return True
    if not ladders or other is trajectory or trajectory.point is None or other.point is None:
        return False
    scheme, dt = trajectory.point
    return other.point.scheme == scheme and other.point.dt <= dt


def _has_failed(trajectory: Trajectory, outcome: Outcome, judge) -> bool:
    """Whether a trajectory has failed, here or in another process."""
    if trajectory.name not in outcome.jobs:
        job = trajectory.job()
        if run.is_there(job, failures=True):
            _end(trajectory.name, job, run.collect(job.directory), outcome, judge)
    return trajectory.name in outcome.failed


def _run(trajectory: Trajectory, outcome: Outcome, meter: run.Meter, judge) -> None:
    """Run a trajectory, or take its stored result."""
    job = trajectory.job()
    meter.begin(trajectory.label, sum(job.runs))
    result = run.once(job, meter.at, failures=True)
    meter.end(result.error)
    if result.interrupted:
        raise KeyboardInterrupt
    _end(trajectory.name, job, result, outcome, judge)


def _end(name: str, job: run.Job, result: run.Result, outcome: Outcome, judge) -> None:
    outcome.jobs[name] = job
    outcome.versions |= result.versions
    if why := judge(result):
        outcome.failed[name] = why
