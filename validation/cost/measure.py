"""What ours and LAMMPS's own fixes cost: time, memory, messages, the optional passes, the start.

A point that was measured with the same package, code, inputs and settings is not measured again.
The summary also has what earlier calls have left in the folder, of the same package and inputs.
"""

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from ..running import counting, lammps_log, machine, rounds, run, starts, startup
from ..running.rounds import Timing
from ..running.store import Store
from ..scenes import INPUTS, SCENES, Scene
from ..scenes.integrators import BENCHMARKED, FREE, OURS, Integrator, nosquish
from ..statistics import measures
from . import bandwidth, messages
from .plan import PASSES, Pass, Point

MESH = "1e-4"  # usual, where there is one: here accuracy of the energy does not matter
COUNTED = 50  # steps whose messages are counted; atoms that nothing holds do not come too far in it
GROUPS = {  # part: of the summary, where its rows are, and by what they are sorted
    "passes": ("passes", ()),
    "start": ("starts", ("ranks",)),
    "memory": ("memory", ("processes",)),
    "messages": ("counts", ("decomposition", "ranks")),
    "link": ("links", ()),
}
OF_SCENES = "points", ("bodies", "ranks")
Script = tuple[Scene, Sequence[Integrator]]


class Cut(KeyboardInterrupt):
    """A Ctrl-C; ``rows`` are what was measured by then."""

    def __init__(self, rows: list[dict]) -> None:
        self.rows = rows


@dataclass(frozen=True)
class Call:
    """Where a point's runs are, what shows them, and what they are of.

    Attributes:
        out: output folder.
        silence: s without a sign of life after which a run is given up.
        script: scene and integrators of a user's script; None for the harness's own.
    """

    out: Path
    meter: run.Meter
    silence: float = 300.0
    script: Script | None = None


def cost(wanted: Iterable[Point], call: Call, again: bool = False) -> dict:
    """Measure the points that are not there yet, and collect all that is.

    Args:
        again: whether to measure anew what is there.

    Returns:
        summary: plain data, complete or not: ``interrupted`` says that a Ctrl-C ended it.
    """
    store, summary = Store(call.out / "records", "cost.measure"), machine.circumstances()
    summary |= {"interrupted": False} | {name: [] for name, _ in (OF_SCENES, *GROUPS.values())}
    cpu, records = summary["machine"]["cpu"], {}
    for point in wanted:
        origin = store.origin(point, call.script, cpu, files=point.inputs)
        kept = None if again else store.kept(point.name, origin)
        if kept:
            call.meter.begin(f"{point.name}, of {kept['date']}", point.turns)
            call.meter.end(None)
        record = {
            "part": point.part,
            "cpu": cpu,
            "begin": machine.now(),
            "load": os.getloadavg()[0],
        }
        record |= {"inputs": _inputs(folder.name for folder in point.inputs)}
        make = partial(_record, point, call, record)
        try:
            records[point.name] = store.once(point.name, origin, make, again)
        except Cut as end:
            records[point.name] = record | {"rows": end.rows, "complete": False}
        except KeyboardInterrupt:
            records[point.name] = record | {"rows": []}
        else:
            continue
        summary["interrupted"] = True
        break
    if not call.script:
        records = {name: kept["record"] for name, kept in store.alike().items()} | records
    _collect(summary, records.values())
    return summary


def _record(point: Point, call: Call, record: dict) -> dict:
    others: dict[str, Callable] = {
        "passes": _passes, "start": _start, "memory": _memory, "messages": _messages, "link": _link,
    }  # fmt: skip
    rows = others.get(point.part, _scene)(point, call)
    return record | {"rows": rows, "end": machine.now(), "complete": True}


def _collect(summary: dict, records: Iterable[dict]) -> None:
    """Add the records' rows to a summary, and what follows from several."""
    for record in records:
        # times of another processor are not held beside this one's
        here = record["cpu"] == summary["machine"]["cpu"]
        if here and record["inputs"] == _inputs(record["inputs"]):
            when = {key: record.get(key) for key in ("begin", "end", "load", "complete")}
            group, _ = GROUPS.get(record["part"], OF_SCENES)
            summary[group] += [row | when for row in record["rows"]]
    for group, keys in (OF_SCENES, *GROUPS.values()):
        summary[group].sort(key=lambda row: [row[key] for key in keys])
    known = list(SCENES)
    summary["points"].sort(
        key=lambda row: known.index(row["scene"]) if row["scene"] in known else 0
    )
    for point in summary["points"]:
        summary["versions"].update(machine.worker_versions(point["versions"]))
    _relate_to_memory(summary)
    if summary["counts"]:
        fields = messages.Link._fields
        own = [messages.Link(*(row[key] for key in fields)) for row in summary["links"]]
        links = [messages.NETWORK, *own]
        summary["links"] = [link._asdict() for link in links]
        summary["model"] = [
            {"link": link.name, **row}
            for link in links
            for row in messages.model(summary["counts"], link)
        ]


def _inputs(names: Iterable[str]) -> dict[str, str]:
    """Hashes of folders of inputs."""
    return {name: machine.contents(INPUTS / name) for name in names}


def _relate_to_memory(summary: dict) -> None:
    """The time that the memory allows for what must move, and ours over it."""
    rates = {row["processes"]: row["best"] * 1e9 for row in summary["memory"]}
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


def _scene(point: Point, call: Call) -> list[dict]:
    """All integrators in turn; then, on several ranks, their messages."""
    if call.script:
        scene, integrators = call.script
    else:
        scene = starts.of_size(SCENES[point.part], point.bodies, call.out / "starts").on_mesh(MESH)
        integrators = [BENCHMARKED[name] for name in point.integrators]
    label = f"{point.part} {point.bodies:,} on {point.ranks}"
    folder = call.out / "runs" / point.name
    record: dict = {"scene": point.part, "title": scene.subject or scene.title}
    record |= {"bodies": point.bodies, "ranks": point.ranks, "dt": scene.dt, "units": scene.units}
    record |= {"integrators": [], "atoms": None, "versions": {}}

    def job(one, runs, part="calibration", setups=0):
        directory = folder / f"{run.folder_name(one.name)}-{part}"
        how = {"ranks": point.ranks, "silence": call.silence, "keeps": "nothing", "setups": setups}
        return run.job(scene, one, directory, runs, dt=scene.dt, every=0, **how)

    lengths = rounds.lengths(_calibrated(integrators, job, record), point.seconds)
    # what moves freely moves for some steps only: nothing keeps its atoms apart
    runs = dict.fromkeys(point.integrators, lengths.runs) | {FREE.name: [3]}
    every = {one.name: one for one in (*integrators, FREE)}
    labels = {name: f"{label}, {one.label}" for name, one in every.items()}

    def turn(name, number):
        return job(every[name], runs[name], str(number), rounds.SETUPS)

    found, errors, cut = rounds.in_turn(labels, turn, point.rounds, call.meter)
    counts: dict[str, list[dict]] = {}
    if point.ranks > 1 and not cut:
        counted = [one for one in every.values() if one.name not in errors]
        jobs = {one.name: job(one, [3, COUNTED], "messages") for one in counted}
        counts, cut = _counts(jobs, labels, folder / "counts", call.meter)
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
    record["atoms"] = _atoms_in_bodies(folder)
    if cut:
        raise Cut([record])
    return [record]


def _calibrated(integrators, job, record):
    """s of a step, of the first integrator that runs: ours, unless it fails."""
    for one in integrators:
        step = rounds.calibrate(partial(job, one))
        if isinstance(step, float):
            return step
        if step.interrupted:
            raise Cut([record])
    return 1.0


def _numbers(own: list[Timing], ours: list[Timing], free: list[Timing], bodies: int) -> dict:
    """An integrator's numbers, spreads over its rounds; None for those that were not measured."""
    rivals = [] if own is ours else ours
    return {
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


def _counts(
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
    for key in messages.COUNTED if own else ():
        found[key] = measures.spread(rank[key] / COUNTED for rank in own or ())
        found[f"fix_{key}"] = measures.spread(rank[f"fix_{key}"] / COUNTED for rank in own or ())
        if free:
            more = ((a[key] - b[key]) / COUNTED for a, b in zip(own or (), free))
            found[f"more_{key}"] = measures.spread(more)
    return found


def _atoms_in_bodies(folder: Path) -> int | None:
    """How many atoms the bodies have, as the log of a rigid fix says; None if none does."""
    logs = (log.read_text(errors="replace") for log in sorted(folder.glob("*/log.lammps")))
    found = map(lammps_log.atoms_in_bodies, logs)
    return next((number for number in found if number is not None), None)


def _passes(point: Point, call: Call) -> list[dict]:
    rows: list[dict] = []
    for index, one in enumerate(PASSES):
        row, cut = _pass(one, (call.out / "runs" / "passes" / str(index)).resolve(), point, call)
        rows.append(row)
        if cut:
            raise Cut(rows)
    return rows


def _pass(one: Pass, folder: Path, point: Point, call: Call) -> tuple[dict, bool]:
    """Time a pass's two runs in turn: its row, and whether a Ctrl-C ended it."""
    scene = SCENES[one.scene].of_size(one.bodies)
    scene = replace(scene, setup=(*one.before, *scene.setup))
    how: dict = {"dt": scene.dt, "every": 0, "ranks": one.ranks, "keeps": "nothing"}
    how |= {"silence": call.silence}

    def job(name, runs):
        words, more = (one.words, one.more) if name == "with" else ("", one.less)
        ours = nosquish(OURS, "fix_nosquish.NVE", words)
        table = f"variable table string {folder / name}/bodies.csv"
        ours = replace(ours, lines=(table, *ours.lines)) if "v_table" in words else ours
        return run.job(scene, ours, folder / name, runs, more=more, **how)

    row = {key: getattr(one, key) for key in ("name", "when", "scene", "bodies", "ranks")}
    loop = rounds.calibrate(lambda runs: job("without", runs))
    if not isinstance(loop, float):
        return row | {"error": loop.error}, loop.interrupted
    runs, names = rounds.lengths(loop, point.seconds).runs, ("without", "with")
    labels = {name: f"{one.name[:18]}, {name}" for name in names}
    found, errors, cut = rounds.in_turn(
        labels, lambda name, _: job(name, runs), point.rounds, call.meter
    )
    shares = rounds.least_cpu(timing for times in found.values() for timing in times)
    row |= {"error": next(iter(errors.values()), None), "cpu": shares}
    row |= {"lines": {name: job(name, runs).commands for name in names}}
    row |= {name: rounds.spread(found[name], "modify") for name in names}
    cost = rounds.difference(found["with"], found["without"], "modify")
    return row | {"cost": cost}, cut


def _start(point: Point, call: Call) -> list[dict]:
    ours, folder = BENCHMARKED[OURS], call.out / "runs" / "start"
    how = folder, point.ranks, point.rounds, call.meter
    return [startup.measure(SCENES["water"], ours, *how)]


def _memory(point: Point, call: Call) -> list[dict]:
    call.meter.begin(f"memory, {point.ranks} process(es)", 1)
    row = bandwidth.measure(point.ranks)
    call.meter.end(None)
    return [row]


def _messages(point: Point, call: Call) -> list[dict]:
    where = call.out / "runs" / "messages"
    return messages.count(point.ranks, point.cut, where, call.meter, call.silence)


def _link(point: Point, call: Call) -> list[dict]:
    call.meter.begin("link between two ranks", 1)
    found = messages.link()._asdict()
    call.meter.end(None)
    return [found]
