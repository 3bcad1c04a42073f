"""Runs of thermostats with their time steps, from common starts, for `ensembles` and `sampling`."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from validation.ensembles.lengths import BEGIN_STEP, Lengths, One, at_least_one
from validation.ensembles.schemes import Scheme
from validation.running import machine, run
from validation.running.store import Store
from validation.scenes import FS_PER_PS, Scene
from validation.scenes.starts import from_dump, to_dump


@dataclass
class Done:
    """What became of runs: why starts failed, by number; versions; whether a Ctrl-C came."""

    failed: dict[int, str] = field(default_factory=dict)
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

        Args:
            module: of the harness, that measures.
        """
        store, done = Store(self.folder, module), Done()
        starts = {f"start-{n}/start": n for n in range(1, self.lengths.starts + 1)}
        by_name = {one.name: one for one in wanted}
        try:
            for name in store.shared(starts):
                number = starts[name]
                made = self._do(done, f"start {number}", self.start(number), meter)
                if made.error:
                    done.failed[number] = f"start {number}: {made.error}"
            for name in store.shared(by_name if not done.failed else ()):
                one = by_name[name]
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
        runs = [at_least_one(self.lengths.begin, BEGIN_STEP)]
        more = to_dump(self._dump(number), runs[0])
        how: dict = {"dt": BEGIN_STEP, "every": max(1, runs[0] // 100), "keeps": "nothing"}
        how |= {"silence": self.silence, "more": more, "origin": machine.origin(self.scene, one)}
        return run.job(self._of(self.starter, self.scene), one, directory, runs, **how)

    def job(self, one: One) -> run.Job:
        """The run of a point from a start; its momentum is zero, for some schemes keep it."""
        scheme, dt, dump = one.scheme, one.dt, self._dump(one.start)
        seeded, directory = scheme.seeded(one.start), self.folder / one.name
        begun = from_dump(self.scene, dump, at_least_one(self.lengths.begin, BEGIN_STEP))
        rest = f"velocity {self.scene.group} zero linear"
        begun = self._of(scheme, replace(begun, setup=(*begun.setup, rest)))
        more = self.more(scheme, dt, directory)
        how: dict = {"dt": dt, "every": self.lengths.every(dt, scheme.stride), "keeps": "nothing"}
        files = [dump] if dump.exists() else []  # else LAMMPS says so
        how |= {"silence": self.silence, "more": more}
        how |= {"origin": machine.origin(self.scene, seeded, *files)}
        return run.job(begun, seeded, directory, self.lengths.runs(dt, scheme.stride), **how)

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
