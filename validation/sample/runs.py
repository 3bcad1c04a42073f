"""The runs of a plan: its starts, its points from each start, and what a ps of each point costs."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ..experiment import Done, Point, Trajectory, perform
from ..running import machine, rounds, run
from ..running.starts import from_dump, to_dump
from ..running.store import Store
from ..scenes import FS_PER_PS, Scene
from .engine import Course
from .plan import Lengths, Plan, at_least_one
from .schemes import FIRST_SEED, Scheme
from .shifted import of_scene

BEGIN_STEP = 2.0  # fs of a run that makes a start, at most
SPARSE = 2  # times as far apart are samples of other engines: OpenMM's pressure takes two steps
ROUNDS, SECONDS = 3, 0.5  # of what is timed in turn; s of each of its segments
TIMED = "timed"  # folder of these runs, and what is kept of them


@dataclass(frozen=True)
class Runs:
    """Runs in a folder.

    Attributes:
        silence: s without a sign of life after which a run is given up.
    """

    plan: Plan
    lengths: Lengths
    folder: Path
    silence: float

    @property
    def store(self) -> Store:
        """What is kept of them beside their own files."""
        return Store(self.folder, "sample.measure")

    @property
    def starts(self) -> range:
        """Their numbers."""
        return range(1, self.lengths.starts + 1)

    def trajectories(self, points: Collection[Point]) -> list[Trajectory]:
        """The starts, all points from the first one, then all from the next one."""
        made = [
            Trajectory(start_name(n), f"start {n}", partial(self.start, n)) for n in self.starts
        ]
        for n in self.starts:
            said = f", start {n}" * (len(self.starts) > 1)
            for point in points:
                job, label = partial(self.job, point, n), self.plan.label(point) + said
                made.append(Trajectory(_name(n, point), label, job, point, start_name(n)))
        return made

    def perform(self, points: Collection[Point], meter: run.Meter) -> Done:
        """Run what is not there yet; a scheme that fails at a step may hold at a longer one."""
        return perform(self.trajectories(points), self.store, meter, ladders=False)

    def steps(self, points: Collection[Point]) -> int:
        """All steps of all runs together."""
        strides = ((point.dt, self.plan.schemes[point.scheme].stride) for point in points)
        each = sum(sum(self.lengths.runs(dt, stride)) for dt, stride in strides)
        return len(self.starts) * (self._begin + each)

    def left(self) -> list[Point]:
        """Points of which the folder has runs."""
        names = {run.folder_name(name): name for name in self.plan.schemes}
        found = []
        for path in self.folder.glob("start-*/*-fs/job.json"):
            name, _, dt = path.parent.name.removesuffix("-fs").rpartition("-")
            if name in names:
                found.append(Point(names[name], float(dt)))
        return found

    def start(self, number: int) -> run.Job:
        """The run that makes a start."""
        seeded, runs = self.plan.starter.seeded(number), [self._begin]
        more = to_dump(self._dump(number), self._begin)
        how: dict = {"dt": self._step, "every": max(1, self._begin // 100), "keeps": "nothing"}
        how |= {"silence": self.silence, "more": more}
        how |= {"origin": machine.origin(self.plan.scene, seeded)}
        directory = self.folder / start_name(number)
        return run.job(self._of(seeded, self.plan.scene), seeded, directory, runs, **how)

    def job(self, point: Point, start: int) -> run.Job:
        """The run of a point from a start."""
        scheme, folder = self.plan.schemes[point.scheme], self.folder / _name(start, point)
        runs = self.lengths.runs(point.dt, scheme.stride)
        every = self.lengths.every(point.dt, scheme.stride)
        if scheme.engine:
            how = scheme.lines[0], self.plan.temperature, scheme.friction, point.dt
            course = Course(*how, runs, SPARSE * every, FIRST_SEED + start)
            return scheme.engine.job(course, of_scene(self.plan.scene), folder, self.silence)
        more = self.plan.prints(scheme, every, point.dt, folder)
        return self._job(point, start, folder, runs, every, more)

    def lines(self, point: Point) -> list[str]:
        """What LAMMPS, or another engine, is told of a point."""
        scheme = self.plan.schemes[point.scheme]
        if scheme.engine:
            return scheme.engine.words(self.job(point, 1).given)
        return scheme.commands(self.plan.scene)

    def costs(
        self, loops: Mapping[Point, tuple[int, float]], meter: run.Meter, time: bool
    ) -> dict[Point, list[float]]:
        """What a ps costs, s of one core: points are timed in turn, without samples, in some
        rounds.  One that fails has none.

        Args:
            loops: of each point the start that it is timed from, and about how many s a step takes.
            time: whether to time what no earlier command has.

        Raises:
            KeyboardInterrupt: after a Ctrl-C, or if nothing is kept that may not be timed.
        """
        names = {_name(start, point): point for point, (start, _) in loops.items()}

        def make(name: str, number: int, runs: list[int] | None = None) -> run.Job:
            point = names[name]
            start, loop = loops[point]
            stride = self.plan.schemes[point.scheme].stride
            if runs is None:
                runs = rounds.lengths(loop, SECONDS).runs
                runs = [-(-steps // stride) * stride for steps in runs]
            folder = self.folder / TIMED / f"{name}-{number}"
            return self._job(point, start, folder, runs, 0, [])

        def measure() -> dict[str, list[float]]:
            if not time:
                raise KeyboardInterrupt
            labels = {name: f"{self.plan.label(point)}, timed" for name, point in names.items()}
            found, _, interrupted = rounds.in_turn(labels, make, ROUNDS, meter)
            if interrupted:
                raise KeyboardInterrupt
            return {
                name: [cost(one.loop or 0.0, one.cpu, names[name].dt) for one in times]
                for name, times in found.items()
            }

        jobs = {name: make(name, 0, [0]) for name in names}
        origins = {name: [job.commands, job.origin] for name, job in jobs.items()}
        with self.store.locked(TIMED):
            origin = self.store.origin(ROUNDS, SECONDS, origins)
            found = self.store.once(TIMED, origin, measure)
        return {names[name]: times for name, times in found.items() if times}

    def _job(
        self, point: Point, start: int, folder: Path, runs: list[int], every: int, more: list[str]
    ) -> run.Job:
        """A run of LAMMPS; its momentum is zero, for some schemes keep it."""
        scheme, dump = self.plan.schemes[point.scheme].seeded(start), self._dump(start)
        begun = from_dump(self.plan.scene, dump, self._begin)
        rest = f"velocity {'all' if scheme.whole else begun.group} zero linear"
        begun = self._of(scheme, replace(begun, setup=(*begun.setup, rest)))
        files = [dump] if dump.exists() else []  # else LAMMPS says so
        how: dict = {"dt": point.dt, "every": every, "keeps": "nothing", "silence": self.silence}
        how |= {"more": more, "origin": machine.origin(self.plan.scene, scheme, *files)}
        return run.job(begun, scheme, folder, runs, **how)

    @property
    def _step(self) -> float:
        """fs, of starts: not above the scene's own step, which a user's script may need."""
        return min(BEGIN_STEP, self.plan.scene.dt)

    @property
    def _begin(self) -> int:
        """Steps of a start."""
        return at_least_one(self.lengths.begin, self._step)

    def _dump(self, start: int) -> Path:
        return (self.folder / start_name(start) / "state.dump").resolve()

    @staticmethod
    def _of(scheme: Scheme, scene: Scene) -> Scene:
        return replace(scene, others=()) if scheme.whole else scene


def start_name(number: int) -> str:
    """Of the folder of a start."""
    return f"start-{number}/start"


def _name(start: int, point: Point) -> str:
    """Of the folder of a point's run from a start."""
    return f"start-{start}/{run.folder_name(point.scheme)}-{point.dt:g}-fs"


def table(job: run.Job) -> tuple[run.Result, dict[str, np.ndarray]]:
    """What a run has left, and its samples: of each column those after the part that is left out;
    none if there is an error in the result."""
    result = run.collect(job.directory)
    kept = result.thermo.get("Step", np.empty(0)) >= job.runs[0]
    found = {name: values[kept] for name, values in result.thermo.items()}
    if not result.error and not all(np.isfinite(values).all() for values in found.values()):
        result.error = "energy is not finite"
    return result, {} if result.error else found


def cost(loop: float, cpu: float | None, dt: float) -> float:
    """s of one core for a ps.

    Args:
        loop: us of a step by the clock.  cpu: percent of a core that the run had.  dt: fs.
    """
    return loop * 1e-6 * FS_PER_PS / dt * (100.0 if cpu is None else cpu) / 100
