"""What ours and LAMMPS's own fixes cost: time, memory, messages, the optional passes, the start.

The benchmark is made of points, each measured as a whole and kept in a file: a scene of one size on one
number of ranks, with all integrators in turn; the optional passes; the start; the memory.  A point that
was measured with the same code, input and settings is not measured again.  The summary also has the scenes that
earlier calls have left in the folder, if they are of the same code and input.
"""

import hashlib
import json
import os
from dataclasses import dataclass

from validation import (
    bandwidth,
    counting,
    goals,
    lammps_log,
    machine,
    measures,
    passes,
    rounds,
    run,
    starts,
    startup,
)
from validation.integrators import BENCHMARKED, FREE
from validation.machine import contents, package_hash
from validation.scenes import SCENES

OURS = "nosquish"
MESH = "1e-4"  # usual, where there is one: here accuracy of the energy does not matter
COUNTED = 50  # steps whose messages are counted; atoms that nothing holds do not come too far in it
KIB_PER_MIB = 1024


@dataclass(frozen=True)
class Settings:
    """How to measure.

    Attributes:
        integrators: names in ``BENCHMARKED``.
        rounds: how often each integrator has its turn.
        seconds: of a timed segment.
        silence: s without a sign of life after which a run is given up.
    """

    integrators: tuple[str, ...]
    rounds: int
    seconds: float
    silence: float = 300.0


@dataclass(frozen=True)
class ScenePoint:
    """A scene of one size on one number of ranks, with all integrators that can run it."""

    scene: str
    bodies: int
    ranks: int
    settings: Settings

    @property
    def name(self):
        """Of the point and its file."""
        return f"{self.scene}-{self.bodies}-{self.ranks}"

    @property
    def integrators(self):
        """Those that can run the scene."""
        every = (BENCHMARKED[name] for name in self.settings.integrators)
        return [one for one in every if one.can_run(SCENES[self.scene])]

    @property
    def turns(self):
        """Runs that the meter counts."""
        several = len(self.integrators) + 1
        return several * (self.settings.rounds + (self.ranks > 1))

    def input(self):
        """What is measured, plain data; by whom and how often is in `origin`."""
        scene = SCENES[self.scene]
        return [
            contents(scene.folder),
            scene.setup,
            scene.others,
            scene.dt,
            MESH,
            COUNTED,
            rounds.SETUPS,
            rounds.SEGMENTS,
            rounds.LEAST,
        ]

    def origin(self):
        """All that the result follows from, beside the package: plain data."""
        return [
            self.input(),
            [one.commands(SCENES[self.scene]) for one in self.integrators],
            self.settings.rounds,
            self.settings.seconds,
        ]

    def measure(self, folder, meter):
        """Run everything.

        Args:
            folder: of the whole benchmark.
            meter: a ``console.Meter``.

        Returns:
            (record, interrupted): plain data; ``integrators`` has a row for each.
        """
        scene = self._start(folder)
        runs_folder = folder / "runs" / self.name
        label = f"{self.scene} {self.bodies:,} on {self.ranks}"

        def job(one, runs, name, **more):
            directory = runs_folder / f"{run.folder_name(one.name)}-{name}"
            return run.job(scene, one, directory, runs, dt=scene.dt, every=0, ranks=self.ranks, silence=self.settings.silence,
                           positions=False, **more)  # fmt: skip

        everyone = [*self.integrators, FREE]
        record = {
            "scene": self.scene, "title": scene.subject or scene.title, "bodies": self.bodies, "ranks": self.ranks,
            "dt": scene.dt, "units": scene.units,
        }  # fmt: skip
        loop = 1.0
        for one in self.integrators:  # ours, unless it fails
            found = rounds.calibrate(lambda runs: job(one, runs, "calibration"))
            if isinstance(found, float):
                loop = found
                break
            if found.interrupted:
                return record | {"integrators": []}, True
        lengths = rounds.lengths(loop, self.settings.seconds)
        record["steps"] = {
            "warm_up": lengths.warm_up,
            "segment": lengths.segment,
            "segments": lengths.segments,
        }

        jobs = {
            one.name: (
                f"{label}, {one.label}",
                # what moves freely moves for some steps only: nothing keeps its atoms apart
                lambda number, one=one: job(
                    one, lengths.runs if one is not FREE else [3], str(number), setups=rounds.SETUPS
                ),
            )
            for one in everyone
        }
        found, errors, interrupted = rounds.in_turn(jobs, self.settings.rounds, meter)
        counts = {}
        if self.ranks > 1 and not interrupted:
            for one in everyone:
                if one.name not in errors:
                    meter.begin(f"{label}, {one.label}, messages", 1)
                    environment = counting.environment(runs_folder / "counts")
                    result = run.run(job(one, [3, COUNTED], "messages"), environment=environment)
                    meter.end(result.error)
                    if result.interrupted:
                        interrupted = True
                        break
                    if not result.error:
                        counts[one.name] = counting.read(runs_folder / "counts")
        record["atoms"] = _atoms_in_bodies(runs_folder)
        record["versions"] = next(
            (one["versions"] for times in found.values() for one in times), {}
        )
        record["free"] = found[FREE.name]
        record["integrators"] = [
            self._row(one, scene, found, errors.get(one.name), counts, record["atoms"], interrupted)
            for one in self.integrators
        ]
        return record, interrupted

    def _start(self, folder):
        """The scene of this size; builds its data file if there is none yet."""
        return starts.of_size(SCENES[self.scene], self.bodies, folder / "starts").on_mesh(MESH)

    def _row(self, one, scene, found, error, counts, atoms, interrupted):
        """All numbers of one integrator; those that could not be measured are not there."""
        own, ours, free = found[one.name], found[OURS] if OURS in found else [], found[FREE.name]
        row = {
            "name": one.name,
            "label": one.label,
            "kind": one.kind,
            "lines": one.commands(scene),
            "steps": 0,
            "rounds": own,
        }
        row["error"] = error or (
            "interrupted" if interrupted and len(own) < self.settings.rounds else None
        )
        for key in "modify", "loop":
            row[key] = rounds.spread(own, key)
        if row["modify"]:
            row["modify_per_1000"] = measures.spread(
                value / self.bodies * 1000 for value in row["modify"]["values"]
            )
            row["cpu"] = min((one["cpu"] for one in own if "cpu" in one), default=None)
        if one.name != OURS:
            for key in "modify", "loop":
                row[f"{key}_ratio"] = rounds.ratio(ours, own, key)
        row["setup"] = _in_ms(rounds.difference(own, free, lambda one: one["setups"][-1]))
        row["first_setup"] = _in_ms(
            rounds.difference(own, free, lambda one: one["define"] + one["setups"][0])
        )
        row["memory"] = rounds.difference(own, free, lambda one: max(one["memory"]) / KIB_PER_MIB)
        row["memory_in_all"] = (
            measures.spread(max(one["memory"]) / KIB_PER_MIB for one in own) if own else None
        )
        if one.name in counts:
            for key in "messages", "bytes", "collectives", "collective_bytes":
                row[key] = measures.spread(rank[key] / COUNTED for rank in counts[one.name])
                row[f"fix_{key}"] = measures.spread(
                    rank[f"fix_{key}"] / COUNTED for rank in counts[one.name]
                )
                if FREE.name in counts:
                    pairs = zip(counts[one.name], counts[FREE.name])
                    row[f"more_{key}"] = measures.spread(
                        (a[key] - b[key]) / COUNTED for a, b in pairs
                    )
        return row


@dataclass(frozen=True)
class PassesPoint:
    """The cost of each optional pass."""

    settings: Settings
    name = "passes"

    @property
    def turns(self):
        """Runs that the meter counts."""
        return 2 * self.settings.rounds * len(passes.OPTIONAL)

    def origin(self):
        """All that the result follows from, beside the package: plain data."""
        inputs = [
            contents(SCENES[name].folder) for name in sorted({one.scene for one in passes.OPTIONAL})
        ]
        return [inputs, repr(passes.OPTIONAL), self.settings.rounds, self.settings.seconds]

    def measure(self, folder, meter):
        """Run everything: (record, interrupted)."""
        rows, interrupted = [], False
        for index, optional in enumerate(passes.OPTIONAL):
            row, interrupted = passes.measure(optional, folder / "runs" / "passes" / str(index), count=self.settings.rounds,
                                              seconds=self.settings.seconds, silence=self.settings.silence, meter=meter)  # fmt: skip
            rows.append(row)
            if interrupted:
                break
        return {"passes": rows}, interrupted


@dataclass(frozen=True)
class StartPoint:
    """What a start costs, on one number of ranks."""

    ranks: int
    settings: Settings

    @property
    def name(self):
        """Of the point and its file."""
        return f"start-{self.ranks}"

    @property
    def rounds(self):
        """A first use takes long: fewer of them."""
        return min(3, self.settings.rounds)

    @property
    def turns(self):
        """Runs that the meter counts."""
        return 3 * self.rounds

    def origin(self):
        """All that the result follows from, beside the package: plain data."""
        return [contents(SCENES["water"].folder), SCENES["water"].setup, self.rounds]

    def measure(self, folder, meter):
        """Run everything: (record, interrupted)."""
        record = startup.measure(
            SCENES["water"],
            BENCHMARKED[OURS],
            folder / "runs" / "start",
            self.ranks,
            self.rounds,
            meter,
        )
        return {"start": record}, False


@dataclass(frozen=True)
class MemoryPoint:
    """How fast this machine's memory is, with as many processes as ranks."""

    ranks: int
    turns = 1

    @property
    def name(self):
        """Of the point and its file."""
        return f"memory-{self.ranks}"

    def origin(self):
        """All that the result follows from, beside the package: plain data."""
        return [machine.describe()["cpu"], bandwidth.ELEMENTS, bandwidth.REPEATS]

    def measure(self, folder, meter):
        """Measure: (record, interrupted)."""
        meter.begin(f"memory, {self.ranks} process(es)", 1)
        record = bandwidth.measure(self.ranks)
        meter.end(None)
        return {"memory": record}, False


def points(parts, ranks, sizes, settings):
    """The points of these parts.

    Args:
        parts: names of scenes, ``passes``, ``start``, ``memory``.
        ranks: numbers of ranks.
        sizes: numbers of molecules of the water; other scenes have one size.
        settings: ``Settings``.
    """
    found = []
    for part in parts:
        for number in ranks:
            if part == "start":
                found.append(StartPoint(number, settings))
            elif part == "memory":
                found.append(MemoryPoint(number))
            elif part != "passes":
                own = sizes if SCENES[part].cutter else SCENES[part].sizes
                found += [ScenePoint(part, bodies, number, settings) for bodies in own]
        if part == "passes":
            found.append(PassesPoint(settings))
    return found


def bench(wanted, out, again, meter):
    """Measure the points that are not there yet, and collect all.

    Args:
        wanted: list of points.
        out: folder for everything.
        again: whether to measure anew what is there.
        meter: a ``console.Meter`` over the sum of the points' ``turns``.

    Returns:
        summary: plain data, complete or not: ``interrupted`` says that a Ctrl-C ended it.
    """
    (out / "measured").mkdir(parents=True, exist_ok=True)
    code = package_hash()
    summary = machine.circumstances() | {
        "interrupted": False,
        "points": [], "passes": [], "starts": [], "memory": [],
    }  # fmt: skip
    for point in wanted:
        path = out / "measured" / f"{point.name}.json"
        mark = _hash([code, machine.versions(), point.origin()])
        kept = json.loads(path.read_text()) if path.exists() else {}
        if again or kept.get("mark") != mark or not kept["complete"]:
            if summary["interrupted"]:
                continue
            kept = {
                "mark": mark,
                "complete": False,
                "begin": machine.now(),
                "load": os.getloadavg()[0],
            }
            try:
                record, interrupted = point.measure(out, meter)
            except KeyboardInterrupt:
                summary["interrupted"] = True
                continue
            kept |= {"complete": not interrupted, "end": machine.now(), "record": record}
            if isinstance(point, ScenePoint):
                kept["input"] = _hash([code, machine.versions(), point.input()])
            path.write_text(json.dumps(kept, ensure_ascii=False) + "\n")
            summary["interrupted"] |= interrupted
        else:
            meter.begin(f"{point.name}, of {kept['begin']}", point.turns)
            meter.end(None)
        _file_away(kept, summary)
    for path in sorted((out / "measured").glob("*.json")):
        kept = json.loads(path.read_text())
        if (
            path.stem in {point.name for point in wanted}
            or not kept["complete"]
            or "input" not in kept
        ):
            continue
        point = ScenePoint(*(kept["record"][key] for key in ("scene", "bodies", "ranks")), None)
        if kept["input"] == _hash([code, machine.versions(), point.input()]):
            _file_away(kept, summary)
    summary["points"].sort(
        key=lambda point: ([*SCENES].index(point["scene"]), point["bodies"], point["ranks"])
    )
    _relate_to_memory(summary)
    summary["goals"] = goals.judge(summary["points"], summary["starts"])
    return summary


def _hash(data):
    return hashlib.sha256(json.dumps(data).encode()).hexdigest()


def _file_away(kept, summary):
    """Put a point's record where it belongs."""
    record, times = kept["record"], {key: kept[key] for key in ("begin", "end", "load")}
    if "integrators" in record:
        summary["versions"].update(
            machine.worker_versions(record["versions"]) if "versions" in record else {}
        )
        summary["points"].append(record | times | {"complete": kept["complete"]})
    elif "passes" in record:
        summary["passes"] += [row | times for row in record["passes"]]
    elif "start" in record:
        summary["starts"].append(record["start"] | times)
    else:
        summary["memory"].append(record["memory"] | times)


def _relate_to_memory(summary):
    """The time that the memory allows for what must move, and ours over it."""
    rates = {one["processes"]: one["best"] * 1e9 for one in summary["memory"]}
    for point in summary["points"]:
        ours = next((row for row in point["integrators"] if row["name"] == OURS), {})
        if point.get("atoms"):
            point["bytes_per_step"] = bandwidth.bytes_per_step(point["bodies"], point["atoms"])
        if point["ranks"] in rates and "bytes_per_step" in point:
            bound = point["bytes_per_step"] / point["ranks"] / rates[point["ranks"]] * 1e6
            point["bound"] = bound
            if ours.get("modify"):
                ours["bound_ratio"] = measures.spread(
                    value / bound for value in ours["modify"]["values"]
                )


def _atoms_in_bodies(folder):
    """How many atoms the bodies have, as the log of a rigid fix says; None if none does."""
    for log in sorted(folder.glob("*/log.lammps")):
        found = lammps_log.atoms_in_bodies(log.read_text(errors="replace"))
        if found is not None:
            return found
    return None


def _in_ms(seconds):
    return measures.spread(value * 1e3 for value in seconds["values"]) if seconds else None
