"""Error against run time: every integrator with every time step on the same starts.

A point is a scene, an integrator and a time step.  It is run once from each start, and a run serves all measures: first to the
horizon, where its bodies are compared with those of a reference solution; then a sampled part, and before and after it timed
segments without output.  The starts take turns (all points from the first one, then all from the second), so that
repeats of a point are far apart in time.  A run that is complete, or that LAMMPS or a fix has ended with a message, or that hung, is not done
again, unless its code or input changed.  Steps longer than one that failed are not run.  Of a scene's usual points also those are measured
that are not asked for and whose runs are in the folder, so that averages and g(r) are held against all that there is.

What is measured is in ``sweep_plan``, what the errors are in ``sweep_errors``.
"""

import hashlib
import shlex
from dataclasses import asdict
from pathlib import Path

from validation import machine, measures, paper, run, starts, sweep_errors
from validation.integrators import SWEPT
from validation.sweep_errors import MEASURES
from validation.sweep_plan import (
    BUDGET,
    FINER,
    OURS,
    SCENES,
    SHORT_BUDGET,
    SHORT_SCENES,
    SWEEPS,
    Lengths,
    Point,
    lengths,
    parts,
    points,
    total,
)

__all__ = [
    "BUDGET", "MEASURES", "SCENES", "SHORT_BUDGET", "SHORT_SCENES", "SWEEPS", "Lengths", "Point", "lengths", "points", "sweep", "total",
]  # fmt: skip

# kinetic energy of the bodies' centres, and of the atoms about them: from the atoms, so alike for all integrators
KINETIC = (
    "compute bodies all chunk/atom {bodies}",
    "compute kinetic all temp/chunk bodies kecom internal com yes",
    "variable translation equal sum(c_kinetic[1])",
    "variable rotation equal sum(c_kinetic[2])",
)
COLUMNS = "v_translation", "v_rotation"


def sweep(points, lengths, out, meter, ranks=1, silence=300.0, short=False):
    """Run everything that is not there yet, and measure.

    Args:
        points: what is asked for, see `points`.  lengths: see `lengths`.
        out: folder; runs go to its folder ``runs``.
        meter: a ``console.Meter``.
        ranks: MPI ranks of what is larger than the dimer.
        silence: s without a sign of life after which a run is given up.
        short: whether with the small starts of --short.

    Returns:
        dict: plain data; after a Ctrl-C with what was complete, and ``interrupted`` true.
    """
    summary = machine.circumstances() | {
        "code": [machine.package_hash(), machine.contents(Path(__file__).parent)],  # as it is now, not as it is when all has run
        "interrupted": False, "ranks": ranks, "lengths": {name: asdict(one) for name, one in lengths.items()}, "measures": MEASURES, "scenes": {},
    }  # fmt: skip
    for name in dict.fromkeys(point.scene for point in points):
        one = _Scene(
            name,
            [point for point in points if point.scene == name],
            lengths[name],
            meter,
            ranks,
            silence,
            short,
        )
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
        self.name, self.swept, self.asked, self.lengths = name, SWEEPS[name], asked, lengths
        self.points = sorted(
            {*asked, *points([name], short)},
            key=lambda point: (point.dt, list(SWEPT).index(point.integrator.name)),
        )
        self.meter, self.silence, self.short = meter, silence, short
        self.ranks = ranks if self.swept.several else 1
        self.scene = self.swept.scene
        self.finest = min(self.swept.steps_of(short) + tuple(point.dt for point in asked)) / FINER
        self.found = {point: [] for point in self.points}  # numbers from each start
        self.failures = {
            point: [] for point in self.points
        }  # why, from each start on which it failed
        self.error = None  # why there is nothing
        self.begun = None  # hash of the starts
        self.degrees_of_freedom = None

    def measure(self, out):
        """Run and measure all points.

        Raises:
            KeyboardInterrupt: a run was interrupted.
        """
        self.scene = starts.of_size(self.scene, self.swept.bodies, out / "starts")
        self.folder = out / "runs" / (f"{self.name}-short" if self.short else self.name)
        usual = self.swept.scene.dt
        apart = round(self.swept.apart * paper.FS_PER_PS / usual)
        trajectory = paper.Trajectory(name="starts", label=f"{self.name}, starts", scene=self.scene, integrator=SWEPT[OURS], dt=usual,
                                      steps=self.lengths.starts * apart, every=100, ranks=self.ranks, piece=apart)  # fmt: skip
        dumps = []
        for job in trajectory.jobs(self.folder, self.silence):
            result = self._once(trajectory.label, job)
            if result.error:
                self.error = f"no start: {result.error}"
                return
            dumps.append(((Path(job.directory) / "state.dump").resolve(), apart))
        self.begun = hashlib.sha256(b"".join(dump.read_bytes() for dump, _ in dumps)).hexdigest()
        for start, dump in enumerate(dumps, 1):
            reference = self._reference(start, dump) if self.swept.with_reference else None
            if reference and reference.error:
                self.error = f"no reference: {reference.error}"
                return
            for point in self.points:
                if self._failed(point) is None:
                    self._run(point, start, dump, reference)

    def _reference(self, start, dump):
        steps = round(self.swept.horizon / self.finest)
        job = self._job(
            Point(self.name, SWEPT[OURS], self.finest),
            dump,
            [steps],
            f"reference/{start}",
            ("thermo 100",),
        )
        return self._once(f"{self.name} {start}, reference", job)

    def _failed(self, point):
        """The shortest step with which its integrator has failed, of those that are not longer; or None."""
        return min(
            (
                one.dt
                for one, why in self.failures.items()
                if why and one.integrator is point.integrator and one.dt <= point.dt
            ),
            default=None,
        )

    def _run(self, point, start, dump, reference):
        one = parts(self.swept, point.dt, self.lengths.time)
        more = [
            *(line.format(bodies=self.scene.bodies) for line in KINETIC), *run.thermo(*COLUMNS),
            f"variable sample equal {one.samples}", "thermo v_sample",
        ]  # fmt: skip
        job = self._job(
            point,
            dump,
            one.runs,
            f"{run.folder_name(point.integrator.name)}/{point.dt:g}-fs/{start}",
            more,
        )
        if point in self.asked:
            result = self._once(
                f"{self.name} {start}, {point.integrator.label}, {point.dt:g} fs", job
            )
        elif run.is_there(job, failures=True):
            result = run.collect(job.directory)
        else:
            return
        why = sweep_errors.failure(result, self.swept.temperature)
        if why:
            self.failures[point].append(why)
        else:
            numbers = sweep_errors.of_run(
                result, reference, point.dt, one, self.swept.measures_of(point.integrator)
            )
            self.found[point].append(numbers)
            if self.swept.same(point.integrator):
                self.degrees_of_freedom = numbers["all"]

    def _job(self, point, dump, runs, name, more):
        scene = starts.from_dump(self.scene, *dump)
        origin = machine.origin(
            self.scene, point.integrator, *([dump[0]] if dump[0].exists() else [])
        )
        return run.job(scene, point.integrator, self.folder / name, runs, dt=point.dt, every=0, ranks=self.ranks, silence=self.silence, more=more,
                       origin=origin, motion=True)  # fmt: skip

    def _once(self, label, job):
        self.meter.begin(label, 1)
        result = run.once(job, failures=True)
        self.meter.end(result.error)
        if result.interrupted:
            raise KeyboardInterrupt
        return result

    def summary(self):
        """Plain data: the scene and its points, as far as they were measured."""
        good = {
            point: found
            for point, found in self.found.items()
            if found and self._failed(point) is None
        }
        limits = sweep_errors.limits(good, self.swept)
        errors = sweep_errors.of_points(good, limits, self.swept)
        sized = self.scene.unit != self.swept.scene.unit
        return {
            "title": f"{self.scene.unit:,} {self.scene.subject}" if sized else self.scene.title, "bodies": self.scene.unit,
            "degrees_of_freedom": self.degrees_of_freedom, "ranks": self.ranks, "measures": list(self.swept.measures),
            "starts": self.lengths.starts, "begun": self.begun, "differs": self.swept.differs, "error": self.error,
            "limits": {name: limit["all"] for name, limit in limits.items()},
            "points": [self._row(point, *errors.get(point, ({}, {}))) for point in self.points if point in good or self._failed(point) is not None],
        }  # fmt: skip

    def _row(self, point, errors, signed):
        found, failures, fails = self.found[point], self.failures[point], self._failed(point)
        one = parts(self.swept, point.dt, self.lengths.time)
        cost, cpu = (
            [value for numbers in found for value in numbers[key]] if fails is None else []
            for key in ("cost", "cpu")
        )
        return {
            "integrator": point.integrator.name, "label": point.integrator.label, "ours": point.integrator.kind == "ours" and OURS in point.integrator.name,
            "lines": point.integrator.commands(self.scene), "dt": point.dt, "steps": sum(one.runs),
            "ps": (one.end - one.begin) * point.dt / paper.FS_PER_PS, "starts": len(found) + len(failures),
            "failed": None if fails is None else failures[0] if failures else f"fails with {fails:g} fs", "failures": len(failures),
            "cost": measures.spread(cost) if cost else None, "cpu": measures.spread(cpu) if cpu else None,
            "errors": errors, "signed": signed, "without": [name for name in self.swept.measures if name not in self.swept.measures_of(point.integrator)],
            "command": self._command(point),
        }  # fmt: skip

    def _command(self, point):
        """That runs this point from the same starts, and the reference, elsewhere; what is held against other points needs these too."""
        words = ["python", "-m", "validation", "sweep", self.name, *(["--short"] if self.short else []), "--ranks", str(self.ranks),
                 "--budget", f"{self.lengths.budget:.10g}", "--only", point.integrator.name, "--steps", f"{point.dt:g}",
                 "--out", "results/sweep-point"]  # fmt: skip
        return shlex.join(words)
