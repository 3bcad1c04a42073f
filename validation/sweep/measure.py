"""Error against run time: every integrator with every time step on the same starts.

A point is a scene, an integrator and a time step.  It is run once from each start, and a run serves
all measures: first to the horizon, where its bodies are compared with those of a reference
solution; then a sampled part, and before and after it timed segments without output.  The starts
take turns (all points from the first one, then all from the second), so that repeats of a point are
far apart in time.  A run that is complete, or that LAMMPS or a fix has ended with a message, or
that hung, is not done again, unless its code or input changed.  Steps longer than one that failed
are not run.  Of a scene's usual points also those are measured that are not asked for and whose
runs are in the folder, so that averages and g(r) are held against all that there is.
"""

import hashlib
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from .. import NAME
from ..choice import Measured
from ..running import machine, run, starts, store
from ..running.trajectory import Trajectory
from ..scenes import FS_PER_PS
from ..scenes.integrators import OURS, SWEPT
from ..statistics import measures
from . import errors
from .plan import FINER, Lengths, Point, parts, points, sweeps

# kinetic energy of the bodies' centres, and of the atoms about them: from the atoms, so alike for
# all integrators
KINETIC = (
    "compute bodies all chunk/atom {bodies}",
    "compute kinetic all temp/chunk bodies kecom internal com yes",
    "variable translation equal sum(c_kinetic[1])",
    "variable rotation equal sum(c_kinetic[2])",
    *run.thermo("v_translation", "v_rotation"),
)


def sweep(
    points: Sequence[Point],
    lengths: Mapping[str, Lengths],
    out: Path,
    meter: run.Meter,
    ranks: int = 1,
    silence: float = 300.0,
    short: bool = False,
) -> dict:
    """Run everything that is not there yet, and measure.

    Args:
        points, lengths: what is asked for, see ``plan``.
        ranks: of what is larger than the dimer.
        silence: s without a sign of life after which a run is given up.

    Returns:
        plain data; after a Ctrl-C with what was complete, and ``interrupted`` true.
    """
    summary = machine.circumstances() | {
        # as it is now, not as it is when all has run
        "code": store.Store(out, "sweep.measure").base,
        "interrupted": False,
        "ranks": ranks,
        "lengths": {name: asdict(one) for name, one in lengths.items()},
        "measures": errors.MEASURES,
        "scenes": {},
    }
    for name in dict.fromkeys(point.scene for point in points):
        asked = [point for point in points if point.scene == name]
        one = _Scene(name, asked, lengths[name], meter, ranks, silence, short)
        try:
            one.measure(out)
        except KeyboardInterrupt:
            summary["interrupted"] = True
        summary["scenes"][name] = one.summary()
        if summary["interrupted"]:
            break
    return summary


class _Scene:
    """The runs of one scene, and what is known of them so far."""

    def __init__(self, name, asked, lengths, meter, ranks, silence, short):
        self.name, self.asked, self.lengths, self.swept = name, asked, lengths, sweeps(short)[name]
        places = {one: place for place, one in enumerate(SWEPT)}
        self.points = sorted(
            {*asked, *points([name], short)}, key=lambda one: (one.dt, places[one.integrator.name])
        )
        self.meter, self.silence, self.short = meter, silence, short
        self.ranks = ranks if self.swept.bodies > 2 else 1  # more make no sense for the dimer
        self.scene = self.swept.scene
        self.finest = min(*self.swept.steps, *(point.dt for point in asked)) / FINER
        self.found: dict[Point, list[errors.Numbers]] = {point: [] for point in self.points}
        # why, from each start that failed
        self.failures: dict[Point, list[str]] = {point: [] for point in self.points}
        self.error = None  # why there is nothing
        self.begun = None  # hash of the starts
        self.freedom = None  # degrees of it

    def measure(self, out: Path) -> None:
        """Run and measure all points, until a Ctrl-C."""
        self.scene = starts.of_size(self.scene, self.swept.bodies, out / "starts")
        self.folder = out / "runs" / (f"{self.name}-short" if self.short else self.name)
        dumps = self._starts()
        for start, dump in enumerate(dumps, 1):
            reference = self._reference(start, dump)
            if reference.error:
                self.error = f"no reference: {reference.error}"
                return
            for point in self.points:
                if self._failed(point) is None:
                    self._run(point, start, dump, reference)

    def _starts(self):
        """Of each start (dump, step); none where one cannot be made."""
        dt = self.swept.scene.dt
        apart = round(self.swept.apart * FS_PER_PS / dt)
        trajectory = Trajectory(
            name="starts",
            label=f"{self.name}, starts",
            scene=self.scene,
            integrator=SWEPT[OURS],
            dt=dt,
            steps=self.lengths.starts * apart,
            every=100,
            ranks=self.ranks,
            piece=apart,
        )
        dumps = []
        for job in trajectory.jobs(self.folder, self.silence):
            result = self._once(trajectory.label, job)
            if result.error:
                self.error = f"no start: {result.error}"
                return []
            dumps.append(((Path(job.directory) / "state.dump").resolve(), apart))
        self.begun = hashlib.sha256(b"".join(dump.read_bytes() for dump, _ in dumps)).hexdigest()
        return dumps

    def _reference(self, start, dump):
        point, steps = Point(self.name, SWEPT[OURS], self.finest), self.swept.horizon / self.finest
        job = self._job(point, dump, [round(steps)], f"reference/{start}", ["thermo 100"])
        return self._once(f"{self.name} {start}, reference", job)

    def _failed(self, point):
        """The shortest step with which its integrator has failed, of those that are not longer; or
        None."""
        failed = (one for one, why in self.failures.items() if why)
        alike = (one.dt for one in failed if one.integrator is point.integrator)
        return min((dt for dt in alike if dt <= point.dt), default=None)

    def _run(self, point, start, dump, reference):
        one, integrator = parts(self.swept, point.dt, self.lengths.time), point.integrator
        more = [line.format(bodies=self.scene.bodies) for line in KINETIC]
        more += [f"variable sample equal {one.samples}", "thermo v_sample"]
        name = f"{run.folder_name(integrator.name)}/{point.dt:g}-fs/{start}"
        job = self._job(point, dump, one.runs, name, more)
        if point in self.asked:
            label = f"{self.name} {start}, {integrator.label}, {point.dt:g} fs"
            result = self._once(label, job)
        elif run.is_there(job, failures=True):
            result = run.collect(job.directory)
        else:
            return
        why = errors.failure(result, self.swept.temperature)
        if why:
            self.failures[point].append(why)
            return
        asked = self.swept.measures_of(integrator)
        numbers = errors.of_run(result, reference, point.dt, one, asked)
        self.found[point].append(numbers)
        if self.swept.same(integrator):
            self.freedom = numbers.freedom

    def _job(self, point, dump, runs, name, more):
        files = [dump[0]] if dump[0].exists() else []  # else LAMMPS says so
        return run.job(
            starts.from_dump(self.scene, *dump),
            point.integrator,
            self.folder / name,
            runs,
            dt=point.dt,
            every=0,
            ranks=self.ranks,
            silence=self.silence,
            more=more,
            origin=machine.origin(self.scene, point.integrator, *files),
            keeps="motion",
        )

    def _once(self, label, job):
        self.meter.begin(label, 1)
        result = run.once(job, failures=True)
        self.meter.end(result.error)
        if result.interrupted:
            raise KeyboardInterrupt
        return result

    def summary(self) -> dict:
        """Plain data: the scene and its points, as far as they were measured."""
        failed = {point: self._failed(point) for point in self.points}
        good = {one: found for one, found in self.found.items() if found and failed[one] is None}
        limits = errors.limits(good, self.swept)
        known = errors.of_points(good, limits, self.swept)
        sized = self.scene.unit != self.swept.scene.unit
        return {
            "title": f"{self.scene.unit:,} {self.scene.subject}" if sized else self.scene.title,
            "bodies": self.scene.unit,
            "degrees_of_freedom": self.freedom,
            "ranks": self.ranks,
            "measures": list(self.swept.measures),
            "starts": self.lengths.starts,
            "begun": self.begun,
            "differs": self.swept.differs,
            "error": self.error,
            "limits": {name: errors.pooled(limit).plain() for name, limit in limits.items()},
            "points": [
                self._row(point, failed[point], *known.get(point, ({}, {})))
                for point in self.points
                if point in good or failed[point] is not None
            ],
        }

    def _row(self, point, fails, errors, signed) -> Measured:
        found, failures, integrator = self.found[point], self.failures[point], point.integrator
        one = parts(self.swept, point.dt, self.lengths.time)
        asked = self.swept.measures_of(integrator)
        good = found if fails is None else []
        cost = [seconds for numbers in good for seconds in numbers.cost]
        cpu = [seconds for numbers in good for seconds in numbers.cpu]
        return {
            "integrator": integrator.name,
            "label": integrator.label,
            "ours": integrator.kind == "ours" and OURS in integrator.name,
            "lines": integrator.commands(self.scene),
            "dt": point.dt,
            "steps": sum(one.runs),
            "ps": (one.end - one.begin) * point.dt / FS_PER_PS,
            "starts": len(found) + len(failures),
            "failed": None if fails is None else [*failures, f"fails with {fails:g} fs"][0],
            "failures": len(failures),
            "cost": measures.spread(cost) if cost else None,
            "cpu": measures.spread(cpu) if cpu else None,
            "errors": errors,
            "signed": signed,
            "without": [name for name in self.swept.measures if name not in asked],
            "command": self._command(point),
        }

    def _command(self, point):
        """That runs this point from the same starts, and the reference, elsewhere; what is held
        against other points needs these too."""
        short = ["--short"] if self.short else []
        words = ["python", "-m", NAME, "sweep", self.name, *short, "--ranks"]
        words += [str(self.ranks), "--budget", f"{self.lengths.budget:.10g}", "--only"]
        words += [point.integrator.name, "--steps", f"{point.dt:g}", "--out", "results/sweep-point"]
        return shlex.join(words)
