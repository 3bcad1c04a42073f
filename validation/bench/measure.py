"""What ours and LAMMPS's own fixes cost: time, memory, messages, the optional passes, the start.

A point that was measured with the same package, code, inputs and settings is not measured again.
The summary also has what earlier calls have left in the folder, of the same package and inputs.
"""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from ..running import counting, lammps_log, machine, rounds, run, starts, startup
from ..running.rounds import Timing
from ..running.store import Store
from ..scenes import INPUTS, SCENES, Scene
from ..scenes.integrators import BENCHMARKED, FREE, OURS, Integrator, nosquish
from ..statistics import measures
from . import bandwidth
from .plan import OPTIONAL, Optional, Point

MESH = "1e-4"  # usual, where there is one: here accuracy of the energy does not matter
COUNTED = 50  # steps whose messages are counted; atoms that nothing holds do not come too far in it
Measured = tuple[list[dict], bool]  # rows of the summary, and whether a Ctrl-C cut them short


class Cut(KeyboardInterrupt):
    """A Ctrl-C; ``record`` is what was measured by then."""

    def __init__(self, record: dict) -> None:
        self.record = record


def bench(
    wanted: Iterable[Point], out: Path, again: bool, meter: run.Meter, silence: float = 300.0
) -> dict:
    """Measure the points that are not there yet, and collect all that is.

    Args:
        out: folder for everything.
        again: whether to measure anew what is there.
        silence: s without a sign of life after which a run is given up.

    Returns:
        summary: plain data, complete or not: ``interrupted`` says that a Ctrl-C ended it.
    """
    store, summary = _store(out), _summary()
    cpu = summary["machine"]["cpu"]
    records, summary["interrupted"] = _each(
        {point: store.origin(point, cpu, files=point.folders) for point in wanted},
        lambda point: _record(point, out, meter, silence),
        store, again, meter,
    )  # fmt: skip
    earlier = {name: kept["record"] for name, kept in store.alike().items()}
    for record in (earlier | records).values():
        # times of another processor are not held beside this one's
        if record["cpu"] == cpu and record["inputs"] == _inputs(record["inputs"]):
            summary[record["group"]] += record["rows"]
    order = list(SCENES)
    summary["points"].sort(key=lambda one: (order.index(one["scene"]), one["bodies"], one["ranks"]))
    summary["starts"].sort(key=lambda one: one["ranks"])
    summary["memory"].sort(key=lambda one: one["processes"])
    for point in summary["points"]:
        summary["versions"].update(machine.worker_versions(point["versions"]))
    _relate_to_memory(summary)
    return summary


def _store(out: Path) -> Store:
    return Store(out / "records", "bench.measure")


def _summary() -> dict:
    """Before anything is measured."""
    return machine.circumstances() | {"points": [], "passes": [], "starts": [], "memory": []}


def _each(
    origins: Mapping[Point, str],
    measure: Callable[[Point], dict],
    store: Store,
    again: bool,
    meter: run.Meter,
) -> tuple[dict[str, dict], bool]:
    """Records of points by name, and whether a Ctrl-C cut them short.

    Args:
        origins: what each record follows from.
        measure: makes a record of a point, or raises `Cut` with a part of it.
    """
    records = {}
    for point, origin in origins.items():
        kept = None if again else store.kept(point.name, origin)
        if kept:
            meter.begin(f"{point.name}, of {kept['date']}", point.turns)
            meter.end(None)
        try:
            records[point.name] = store.once(point.name, origin, partial(measure, point), again)
        except Cut as end:
            records[point.name] = end.record
            return records, True
        except KeyboardInterrupt:
            return records, True
    return records, False


def _record(point: Point, out: Path, meter: run.Meter, silence: float) -> dict:
    begin = {"begin": machine.now(), "load": os.getloadavg()[0]}
    others = {
        "passes": ("passes", _passes),
        "start": ("starts", _start),
        "memory": ("memory", _memory),
    }
    group, measure = others.get(point.part, ("points", _scene))
    rows, cut = measure(point, out, meter, silence)
    times = begin | {"end": machine.now(), "complete": not cut}
    inputs = _inputs(folder.name for folder in point.folders)
    record = {
        "group": group,
        "inputs": inputs,
        "cpu": machine.describe()["cpu"],
        "rows": [row | times for row in rows],
    }
    if cut:
        raise Cut(record)
    return record


def _inputs(names: Iterable[str]) -> dict[str, str]:
    """Hashes of folders of inputs."""
    return {name: machine.contents(INPUTS / name) for name in names}


def _relate_to_memory(summary: dict) -> None:
    """The time that the memory allows for what must move, and ours over it."""
    rates = {one["processes"]: one["best"] * 1e9 for one in summary["memory"]}
    for point in summary["points"]:
        if not point["atoms"]:
            continue
        moved = bandwidth.bytes_per_step(point["bodies"], point["atoms"])
        point["bytes_per_step"] = moved
        if point["ranks"] in rates:
            point["bound"] = bound = moved / point["ranks"] / rates[point["ranks"]] * 1e6
            for row in point["integrators"]:
                if row["name"] == OURS and row["modify"]:
                    values = row["modify"]["values"]
                    row["bound_ratio"] = measures.spread(value / bound for value in values)


def own(
    scene: Scene,
    integrators: Sequence[Integrator],
    points: Iterable[Point],
    out: Path,
    again: bool,
    meter: run.Meter,
    silence: float,
) -> dict:
    """As `bench`, of a user's script.

    Args:
        scene, integrators: of ``own.system``.
        points: with the script's name as ``part``.
        out, again, silence: as of `bench`.
    """
    store, summary = _store(out), _summary()

    def measure(point):
        begin = {"begin": machine.now(), "load": os.getloadavg()[0]}
        (row,), cut = _timed(scene, integrators, point, out, meter, silence)
        row |= begin | {"end": machine.now(), "complete": not cut}
        if cut:
            raise Cut(row)
        return row

    what = scene, integrators, summary["machine"]["cpu"]
    origins = {point: store.origin(point, *what) for point in points}
    records, summary["interrupted"] = _each(origins, measure, store, again, meter)
    summary["points"] += records.values()
    return summary


def _scene(point: Point, out: Path, meter: run.Meter, silence: float) -> Measured:
    """Of one of the harness's own."""
    scene = starts.of_size(SCENES[point.part], point.bodies, out / "starts").on_mesh(MESH)
    return _timed(
        scene, [BENCHMARKED[name] for name in point.integrators], point, out, meter, silence
    )


def _timed(
    scene: Scene,
    integrators: Sequence[Integrator],
    point: Point,
    out: Path,
    meter: run.Meter,
    silence: float,
) -> Measured:
    """All integrators in turn; then, on several ranks, their messages."""
    folder, label = out / "runs" / point.name, f"{point.part} {point.bodies:,} on {point.ranks}"
    record: dict = {
        "scene": point.part,
        "title": scene.subject or scene.title,
        "bodies": point.bodies,
    }
    record |= {"ranks": point.ranks, "dt": scene.dt, "units": scene.units, "integrators": []}

    def job(one, runs, part="calibration", setups=0):
        directory = folder / f"{run.folder_name(one.name)}-{part}"
        how = {"ranks": point.ranks, "silence": silence, "keeps": "nothing", "setups": setups}
        return run.job(scene, one, directory, runs, dt=scene.dt, every=0, **how)

    loop = 1.0
    for one in integrators:  # ours, unless it fails
        step = rounds.calibrate(partial(job, one))
        if isinstance(step, float):
            loop = step
            break
        if step.interrupted:
            return [record | {"atoms": None, "versions": {}}], True
    lengths = rounds.lengths(loop, point.seconds)
    # what moves freely moves for some steps only: nothing keeps its atoms apart
    runs = dict.fromkeys(point.integrators, lengths.runs) | {FREE.name: [3]}
    every = {one.name: one for one in (*integrators, FREE)}
    labels = {name: f"{label}, {one.label}" for name, one in every.items()}

    def turn(name, number):
        return job(every[name], runs[name], str(number), rounds.SETUPS)

    found, errors, cut = rounds.in_turn(labels, turn, point.rounds, meter)
    counts: dict[str, list[dict]] = {}
    if point.ranks > 1 and not cut:
        counted = [one for one in every.values() if one.name not in errors]
        jobs = {one.name: job(one, [3, COUNTED], "messages") for one in counted}
        counts, cut = _messages(jobs, labels, folder / "counts", meter)
    if cut:
        short = [name for name in found if len(found[name]) < point.rounds]
        errors = dict.fromkeys(short, run.INTERRUPTED) | errors
    for name in point.integrators:
        row = {key: getattr(every[name], key) for key in ("name", "label", "kind")}
        row |= {"lines": every[name].commands(scene), "error": errors.get(name)}
        row |= _numbers(found[name], found.get(OURS, []), found[FREE.name], point.bodies)
        record["integrators"].append(row | _sent(counts.get(name), counts.get(FREE.name)))
    versions = [timing.versions for timings in found.values() for timing in timings]
    record |= {"steps": asdict(lengths), "versions": versions[0] if versions else {}}
    record |= {"free": [asdict(one) for one in found[FREE.name]], "atoms": _atoms_in_bodies(folder)}
    return [record], cut


def _numbers(own: list[Timing], ours: list[Timing], free: list[Timing], bodies: int) -> dict:
    """An integrator's numbers, spreads over its rounds; None for those that were not measured."""
    rivals = [] if own is ours else ours
    return {
        "rounds": [asdict(one) for one in own],
        "modify": rounds.spread(own, "modify"),
        "modify_per_1000": rounds.spread(own, "modify", 1000 / bodies),
        "modify_ratio": rounds.ratio(rivals, own, "modify"),
        "loop": rounds.spread(own, "loop"),
        "loop_ratio": rounds.ratio(rivals, own, "loop"),
        "cpu": rounds.least_cpu(own),
        "setup": rounds.difference(own, free, "setup", 1e3),
        "first_setup": rounds.difference(own, free, "first_setup", 1e3),
        "memory": rounds.difference(own, free, "peak"),
        "memory_in_all": rounds.spread(own, "peak"),
    }


def _messages(
    jobs: dict[str, run.Job], labels: dict[str, str], folder: Path, meter: run.Meter
) -> tuple[dict[str, list[dict]], bool]:
    """What each rank has sent in each job; and whether a Ctrl-C ended it all."""
    counts: dict[str, list[dict]] = {}
    for name, job in jobs.items():
        meter.begin(f"{labels[name]}, messages", 1)
        result = run.run(job, environment=counting.environment(folder))
        meter.end(result.error)
        if result.interrupted:
            return counts, True
        if not result.error:
            counts[name] = counting.read(folder)
    return counts, False


def _sent(own: list[dict] | None, free: list[dict] | None) -> dict:
    """Spreads over the ranks of what each sends in a step: in all, by fixes, more than freely."""
    found: dict[str, measures.Spread] = {}
    if not own:
        return found
    for key in "messages", "bytes", "collectives", "collective_bytes":
        found[key] = measures.spread(rank[key] / COUNTED for rank in own)
        found[f"fix_{key}"] = measures.spread(rank[f"fix_{key}"] / COUNTED for rank in own)
        if free:
            more = ((a[key] - b[key]) / COUNTED for a, b in zip(own, free))
            found[f"more_{key}"] = measures.spread(more)
    return found


def _atoms_in_bodies(folder: Path) -> int | None:
    """How many atoms the bodies have, as the log of a rigid fix says; None if none does."""
    logs = (log.read_text(errors="replace") for log in sorted(folder.glob("*/log.lammps")))
    found = map(lammps_log.atoms_in_bodies, logs)
    return next((number for number in found if number is not None), None)


def _passes(point: Point, out: Path, meter: run.Meter, silence: float) -> Measured:
    rows = []
    for index, optional in enumerate(OPTIONAL):
        folder = (out / "runs" / "passes" / str(index)).resolve()
        row, cut = _pass(optional, folder, point, meter, silence)
        rows.append(row)
        if cut:
            return rows, True
    return rows, False


def _pass(
    optional: Optional, folder: Path, point: Point, meter: run.Meter, silence: float
) -> tuple[dict, bool]:
    """Time a pass's two runs in turn: its row, and whether a Ctrl-C ended it."""
    scene = SCENES[optional.scene].of_size(optional.bodies)
    scene = replace(scene, setup=(*optional.before, *scene.setup))

    def job(name, runs):
        words, more = (optional.words, optional.more) if name == "with" else ("", optional.less)
        ours = _ours(words, folder / name)
        how: dict = {"ranks": optional.ranks, "silence": silence}
        how |= {"dt": scene.dt, "every": 0, "keeps": "nothing", "more": more}
        return run.job(scene, ours, folder / name, runs, **how)

    row = {key: getattr(optional, key) for key in ("name", "when", "scene", "bodies", "ranks")}
    loop = rounds.calibrate(lambda runs: job("without", runs))
    if not isinstance(loop, float):
        return row | {"error": loop.error}, loop.interrupted
    runs, names = rounds.lengths(loop, point.seconds).runs, ("without", "with")
    labels = {name: f"{optional.name[:18]}, {name}" for name in names}
    found, errors, cut = rounds.in_turn(
        labels, lambda name, _: job(name, runs), point.rounds, meter
    )
    shares = rounds.least_cpu(one for times in found.values() for one in times)
    row |= {"error": next(iter(errors.values()), None), "cpu": shares}
    row |= {"lines": {name: job(name, runs).commands for name in names}}
    row |= {name: rounds.spread(found[name], "modify") for name in names}
    cost = rounds.difference(found["with"], found["without"], "modify")
    return row | {"cost": cost}, cut


def _ours(words: str, directory: Path) -> Integrator:
    ours = nosquish(OURS, "fix_nosquish.NVE", words)
    table = f"variable table string {directory}/bodies.csv"
    return replace(ours, lines=(table, *ours.lines)) if "v_table" in words else ours


def _start(point: Point, out: Path, meter: run.Meter, silence: float) -> Measured:
    ours, folder = BENCHMARKED[OURS], out / "runs" / "start"
    row = startup.measure(SCENES["water"], ours, folder, point.ranks, point.rounds, meter)
    return [row], False


def _memory(point: Point, out: Path, meter: run.Meter, silence: float) -> Measured:
    meter.begin(f"memory, {point.ranks} process(es)", 1)
    row = bandwidth.measure(point.ranks)
    meter.end(None)
    return [row], False
