"""Runs of thermostats with their time steps, from common starts, for `ensembles` and `sampling`."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..running import machine, rounds, run
from ..running.starts import from_dump, to_dump
from ..running.store import Store
from ..scenes import FS_PER_PS, Scene
from .lengths import Lengths, One, at_least_one, step_of_starts
from .schemes import Scheme

ROUNDS, SECONDS = 3, 0.5  # of what is timed in turn; s of each of its segments
TIMED = "timed"  # folder of these runs, and what is kept of them


@dataclass
class Done:
    """What became of runs: why starts failed, by number, and ``error``, if all did; versions;
    whether a Ctrl-C came."""

    failed: dict[int, str] = field(default_factory=dict)
    error: str | None = None
    versions: dict[str, str] = field(default_factory=dict)
    interrupted: bool = False


@dataclass(frozen=True)
class Runs:
    """The runs of a scene.

    Attributes:
        scene: that all schemes move.
        starter: makes the starts.
        folder: of all runs.
        silence: s without a sign of life after which a run is given up.
        more: LAMMPS commands of a scheme's run with a step in a folder: what it prints.
    """

    scene: Scene
    starter: Scheme
    lengths: Lengths
    folder: Path
    silence: float
    more: Callable[[Scheme, float, Path], list[str]]

    def do(self, wanted: Collection[One], meter: run.Meter, module: str) -> Done:
        """Do the starts and the runs that are not there yet; several processes share them.

        A start that fails has no runs, and the others have theirs.

        Args:
            module: of the harness, that measures.
        """
        store, done = Store(self.folder, module), Done()
        starts = {f"start-{n}/start": n for n in range(1, self.lengths.starts + 1)}
        try:
            for name in store.shared(starts):
                number = starts[name]
                made = self._do(done, f"start {number}", self.start(number), meter)
                if made.error:
                    done.failed[number] = made.error
            if len(done.failed) == len(starts):
                done.error = f"all starts failed, start 1: {done.failed[1]}"
            good = {one.name: one for one in wanted if one.start not in done.failed}
            for name in store.shared(good):
                one = good[name]
                label = one.label + f", start {one.start}" * (self.lengths.starts > 1)
                self._do(done, label, self.job(one), meter)
        except KeyboardInterrupt:
            done.interrupted = True
        return done

    @staticmethod
    def _do(done: Done, label: str, job: run.Job, meter: run.Meter) -> run.Result:
        """Run a job, or take it over, with its progress shown."""
        meter.begin(label, sum(job.runs))
        result = run.once(job, meter.at, failures=True)
        meter.end(result.error)
        done.versions |= result.versions
        if result.interrupted:
            raise KeyboardInterrupt
        return result

    def start(self, number: int) -> run.Job:
        """The run that makes a start."""
        directory, one = self.folder / f"start-{number}" / "start", self.starter.seeded(number)
        dt = step_of_starts(self.scene)
        runs = [at_least_one(self.lengths.begin, dt)]
        more = to_dump(self._dump(number), runs[0])
        how: dict = {"dt": dt, "every": max(1, runs[0] // 100), "keeps": "nothing"}
        how |= {"silence": self.silence, "more": more, "origin": machine.origin(self.scene, one)}
        return run.job(self._of(self.starter, self.scene), one, directory, runs, **how)

    def costs(
        self, loops: Mapping[One, float], meter: run.Meter, module: str, time: bool = True
    ) -> dict[str, list[float]]:
        """What a ps costs, s of one core, by the run's name: runs are timed in turn, without
        samples, in some rounds.  One that fails has none.

        Args:
            loops: the runs, and about how many s a step of each takes.
            module: of the harness, that measures.
            time: whether to time what no earlier command has.

        Raises:
            KeyboardInterrupt: after a Ctrl-C, or if nothing is kept that may not be timed.
        """
        by_name, origins = {one.name: one for one in loops}, {}
        for one in loops:
            job = self._job(one, self.folder / TIMED, [0], 0, [])
            origins[one.name] = [job.commands, job.origin]

        def make(name: str, number: int) -> run.Job:
            one = by_name[name]
            stride = one.scheme.stride
            runs = rounds.lengths(loops[one], SECONDS).runs
            runs = [-(-steps // stride) * stride for steps in runs]
            return self._job(one, self.folder / TIMED / f"{name}-{number}", runs, 0, [])

        def measure() -> dict[str, list[float]]:
            if not time:
                raise KeyboardInterrupt
            labels = {name: f"{one.label}, timed" for name, one in by_name.items()}
            found, _, interrupted = rounds.in_turn(labels, make, ROUNDS, meter)
            if interrupted:
                raise KeyboardInterrupt
            return {
                name: [cost(one.loop or 0.0, one.cpu, by_name[name].dt) for one in times]
                for name, times in found.items()
            }

        store = Store(self.folder, module)
        with store.locked(TIMED):
            return store.once(TIMED, store.origin(ROUNDS, SECONDS, origins), measure)

    def job(self, one: One) -> run.Job:
        """The run of a point from a start; its momentum is zero, for some schemes keep it."""
        scheme, dt, directory = one.scheme, one.dt, self.folder / one.name
        runs = self.lengths.runs(dt, scheme.stride)
        every = self.lengths.every(dt, scheme.stride)
        return self._job(one, directory, runs, every, self.more(scheme, dt, directory))

    def _job(
        self, one: One, directory: Path, runs: list[int], every: int, more: list[str]
    ) -> run.Job:
        scheme, dt, dump = one.scheme, one.dt, self._dump(one.start)
        seeded = scheme.seeded(one.start)
        last = at_least_one(self.lengths.begin, step_of_starts(self.scene))
        begun = from_dump(self.scene, dump, last)
        moved = "all" if scheme.whole else self.scene.group
        rest = f"velocity {moved} zero linear"
        begun = self._of(scheme, replace(begun, setup=(*begun.setup, rest)))
        how: dict = {"dt": dt, "every": every, "keeps": "nothing"}
        files = [dump] if dump.exists() else []  # else LAMMPS says so
        how |= {"silence": self.silence, "more": more}
        how |= {"origin": machine.origin(self.scene, seeded, *files)}
        return run.job(begun, seeded, directory, runs, **how)

    def _dump(self, start: int) -> Path:
        return (self.folder / f"start-{start}" / "start" / "state.dump").resolve()

    @staticmethod
    def _of(scheme: Scheme, scene: Scene) -> Scene:
        return replace(scene, others=()) if scheme.whole else scene


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
