"""The experiment that every verb is a plan of.

A *point* is a scheme at a time step. A *trajectory* is one run of a point from one start. `perform`
runs the trajectories that are not there yet, and `Observable` says what is measured of them.
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
        name: of its folder, below the experiment's.
        label: for the terminal.
        job: makes its job when its turn comes, for the file of its start is made before.
        point: whose run it is; None for one that makes a start.
        start: name of the trajectory that makes its start; empty for none.
    """

    name: str
    label: str
    job: Callable[[], run.Job]
    point: Point | None = None
    start: str = ""


@dataclass(frozen=True)
class Observable:
    """What is measured.

    Attributes:
        key: its name in summaries.
        title, unit: for tables and figures.
        of: its estimate, of what a verb keeps of a trajectory; None where that does not tell it.
    """

    key: str
    title: str
    unit: str
    of: Callable[[Any], Estimate | None]


@dataclass
class Outcome:
    """What became of trajectories.

    Attributes:
        jobs: of those that have ended, by name.
        failed: why some failed, by name.
        left_out: names of those that were not run, because the trajectory that makes their start
            has failed, or their scheme with a step that is not longer.
        versions: what LAMMPS says of itself.
        interrupted: whether a Ctrl-C came.
    """

    jobs: dict[str, run.Job] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    left_out: set[str] = field(default_factory=set)
    versions: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False


def failure(result: run.Result) -> str | None:
    """Why a result is none, if LAMMPS or a fix ended its run."""
    return result.error


def perform(
    trajectories: Collection[Trajectory],
    store: Store,
    meter: run.Meter,
    *,
    judge: Callable[[run.Result], str | None] = failure,
    ladders: bool = True,
) -> Outcome:
    """Run what is not there yet, and say what became of each trajectory.

    Processes with the same command share the trajectories, through locks in the store's folder.
    Trajectories that make starts come before the others. A run that LAMMPS or a fix has ended with
    a message is a result, which is kept and not run again.

    Args:
        trajectories: in the order in which they run; the shorter steps of a scheme come first.
        judge: why a result is none, or None; a run that goes on with wrong numbers has failed, too.
        ladders: whether a scheme that has failed is left out at that step and longer ones.

    Returns:
        after a Ctrl-C, what had ended before it.
    """
    done, every = Outcome(), list(trajectories)
    starts = [trajectory for trajectory in every if trajectory.point is None]
    points = [trajectory for trajectory in every if trajectory.point is not None]
    try:
        for stage in starts, points:
            by_name = {trajectory.name: trajectory for trajectory in stage}
            for name in store.shared(by_name):
                trajectory = by_name[name]
                needed = [one for one in every if _needs(trajectory, one, ladders)]
                if any(_has_failed(one, done, judge) for one in needed):
                    done.left_out.add(name)
                else:
                    _run(trajectory, done, meter, judge)
    except KeyboardInterrupt:
        done.interrupted = True
    return done


def _needs(trajectory: Trajectory, other: Trajectory, ladders: bool) -> bool:
    """Whether a trajectory is of no use if another one has failed."""
    if other.name == trajectory.start:
        return True
    if not ladders or other is trajectory or trajectory.point is None or other.point is None:
        return False
    scheme, dt = trajectory.point
    return other.point.scheme == scheme and other.point.dt <= dt


def _has_failed(trajectory: Trajectory, done: Outcome, judge) -> bool:
    """Whether a trajectory has failed, here or in another process."""
    if trajectory.name not in done.jobs:
        job = trajectory.job()
        if run.is_there(job, failures=True):
            _end(trajectory.name, job, run.collect(job.directory), done, judge)
    return trajectory.name in done.failed


def _run(trajectory: Trajectory, done: Outcome, meter: run.Meter, judge) -> None:
    """Run a trajectory, or take over what is there, with its progress shown."""
    job = trajectory.job()
    meter.begin(trajectory.label, sum(job.runs))
    result = run.once(job, meter.at, failures=True)
    meter.end(result.error)
    if result.interrupted:
        raise KeyboardInterrupt
    _end(trajectory.name, job, result, done, judge)


def _end(name: str, job: run.Job, result: run.Result, done: Outcome, judge) -> None:
    done.jobs[name] = job
    done.versions |= result.versions
    if why := judge(result):
        done.failed[name] = why
