"""The cost of ours and of LAMMPS's own fixes: time, memory, messages, start-up.

A point that was measured with the same package, code, inputs and settings is not measured again.
"""

import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from ..running import machine, message_counts, rounds, run, starts, startup
from ..running.rounds import Timing
from ..running.store import Store
from ..scenes import SCENES, Scene
from ..scenes.integrators import BENCHMARKED, FREE, OURS, Integrator
from .plan import Point

MESH = "1e-4"  # the usual accuracy of PPPM: here that of the energy does not matter
COUNTED = 50  # steps whose messages are counted; free atoms do not move too far in them
# forces of the water for counting messages: a mesh would send its own, and take time
WITHOUT_MESH = (
    "kspace_style none",
    "pair_style lj/charmm/coul/charmm 8.0 10.0",
    "pair_modify mix arithmetic",
    "pair_coeff 1 1 0.1521 3.1505742268338603",
    "pair_coeff 2 2 0.046 0.4000135244450124",
)
SENT = "messages", "bytes", "collectives", "collective_bytes"
GROUPS = {"start": "starts", "messages": "counts"}  # of the summary; of other parts ``points``


class Cut(KeyboardInterrupt):
    """A Ctrl-C; ``rows`` were measured before it."""

    def __init__(self, rows: list[dict]) -> None:
        self.rows = rows


@dataclass(frozen=True)
class Call:
    """The subject of the measurement, and its output folder.

    Attributes:
        out: output folder.
        silence: s without a sign of life after which a run is given up.
        script: scene and integrators of a user's script; None for the harness's own.
    """

    out: Path
    meter: run.Meter
    silence: float = 300.0
    script: tuple[Scene, Sequence[Integrator]] | None = None


def cost(wanted: Iterable[Point], call: Call) -> dict:
    """Measure the points that have no result yet.

    Returns:
        summary: plain data, complete or not: ``interrupted`` says that a Ctrl-C ended it.
    """
    store, summary = Store(call.out / "records"), machine.circumstances()
    summary |= {"interrupted": False, "points": [], "starts": [], "counts": []}
    for point in wanted:
        origin = store.origin(point, call.script, summary["machine"]["cpu"], files=point.inputs)
        if stored := store.load(point.name, origin):
            call.meter.begin(f"{point.name}, of {stored['date']}", point.turns)
            call.meter.end(None)
        begun = {"begin": machine.now(), "load": os.getloadavg()[0]}
        try:
            record = store.once(point.name, origin, partial(_record, point, call, begun))
        except KeyboardInterrupt as end:
            rows = end.rows if isinstance(end, Cut) else []
            record = begun | {"rows": rows, "complete": False}
            summary["interrupted"] = True
        when = {key: record.get(key) for key in ("begin", "end", "load", "complete")}
        summary[GROUPS.get(point.part, "points")] += [row | when for row in record["rows"]]
        if summary["interrupted"]:
            break
    for row in summary["points"]:
        summary["versions"].update(machine.worker_versions(row["versions"]))
    return summary


def _record(point: Point, call: Call, begun: dict) -> dict:
    measure = {"start": _start, "messages": _messages}.get(point.part, _scene)
    return begun | {"rows": measure(point, call), "end": machine.now(), "complete": True}


def _scene(point: Point, call: Call) -> list[dict]:
    """Measure all integrators in turn; without rounds count their messages."""
    if call.script:
        scene, integrators = call.script
    else:
        scene = starts.of_size(SCENES[point.scene], point.bodies, call.out / "starts").on_mesh(MESH)
        integrators = [BENCHMARKED[name] for name in point.integrators]
        if point.part == "messages":
            scene = replace(scene, setup=(*scene.setup, *WITHOUT_MESH))
    folder = call.out / "runs" / point.name
    record: dict = {
        "scene": point.part,
        "title": scene.subject or scene.title,
        "bodies": point.bodies,
        "ranks": point.ranks,
        "dt": scene.dt,
        "units": scene.units,
        "integrators": [],
        "versions": {},
    }

    def job(integrator, runs, part="calibration", setups=0):
        return run.job(
            scene,
            integrator,
            folder / f"{run.folder_name(integrator.name)}-{part}",
            runs,
            dt=scene.dt,
            every=0,
            ranks=point.ranks,
            silence=call.silence,
            keeps="nothing",
            setups=setups,
        )

    lengths = rounds.lengths(_calibrated(integrators, job) if point.rounds else 1.0, point.seconds)
    # free atoms move for a few steps only, because nothing keeps them apart
    runs = dict.fromkeys(point.integrators, lengths.runs) | {FREE.name: [3]}
    every = {integrator.name: integrator for integrator in (*integrators, FREE)}
    label = f"{point.part} {point.bodies:,} on {point.ranks}"
    labels = {name: f"{label}, {integrator.label}" for name, integrator in every.items()}

    def turn(name, number):
        return job(every[name], runs[name], str(number), rounds.SETUPS)

    by_name, errors, cut = rounds.in_turn(labels, turn, point.rounds, call.meter)
    sent: dict[str, dict] = {}
    if not point.rounds:
        jobs = {name: job(every[name], [3, COUNTED], "messages") for name in point.integrators}
        sent, cut = _counts(jobs, labels, errors, folder / "counts", call.meter)
    if cut:
        short = [name for name in by_name if len(by_name[name]) < point.rounds]
        errors = dict.fromkeys(short, run.INTERRUPTED) | errors
    for name in point.integrators:
        row = {key: getattr(every[name], key) for key in ("name", "label", "kind")}
        row |= {
            "lines": every[name].commands(scene),
            "error": errors.get(name),
            **_numbers(by_name[name], by_name.get(OURS, []), by_name[FREE.name]),
        }
        record["integrators"].append(row | sent.get(name, {}))
    versions = [timing.versions for timings in by_name.values() for timing in timings]
    record |= {"steps": asdict(lengths), "versions": versions[0] if versions else {}}
    if cut:
        raise Cut([record])
    return [record]


def _calibrated(integrators, job):
    """s per step of the first integrator that runs: ours, unless it fails."""
    for integrator in integrators:
        with suppress(RuntimeError):
            return rounds.calibrate(partial(job, integrator))
    return 1.0


def _numbers(timings: list[Timing], ours: list[Timing], free: list[Timing]) -> dict:
    """An integrator's numbers, spreads over its rounds; None for those not measured."""
    rivals = [] if timings is ours else ours
    return {
        "modify": rounds.spread(timings, "modify"),
        "modify_ratio": rounds.ratio(rivals, timings, "modify"),
        "loop": rounds.spread(timings, "loop"),
        "loop_ratio": rounds.ratio(rivals, timings, "loop"),
        "spent": rounds.spread(timings, "spent"),
        "spent_ratio": rounds.ratio(rivals, timings, "spent"),
        "cpu": min((timing.cpu for timing in timings if timing.cpu is not None), default=None),
        "setup": rounds.difference(timings, free, "setup", 1e3),
        "memory": rounds.difference(timings, free, "peak"),
    }


def _counts(
    jobs: dict[str, run.Job],
    labels: dict[str, str],
    errors: dict[str, str],
    folder: Path,
    meter: run.Meter,
) -> tuple[dict[str, dict], bool]:
    """Count what fixes pass to MPI in a step of each job, mean over the ranks; and whether a Ctrl-C
    ended it.  Failures are added to ``errors``."""
    sent: dict[str, dict] = {}
    for name in jobs:
        meter.begin(f"{labels[name]}, messages", 1)
        result = run.run(jobs[name], environment=message_counts.environment(folder))
        meter.end(result.error)
        if result.interrupted:
            return sent, True
        if result.error:
            errors[name] = result.error
        else:
            ranks = message_counts.read(folder)
            sent[name] = {
                key: sum(rank[f"fix_{key}"] for rank in ranks) / COUNTED / len(ranks)
                for key in SENT
            }
    return sent, False


def _messages(point: Point, call: Call) -> list[dict]:
    """Count what the fixes pass to MPI, for each integrator."""
    try:
        (record,), cut = _scene(point, call), False
    except Cut as end:
        (record,), cut = end.rows, True
    rows = []
    for row in record["integrators"]:
        sent = {key: row[key] for key in SENT if key in row}
        where = {"decomposition": "brick", "integrator": row["name"], "ranks": point.ranks}
        if sent or row["error"]:
            rows.append({**where, "bodies": point.bodies, "error": row["error"], **sent})
    if cut:
        raise Cut(rows)
    return rows


def _start(point: Point, call: Call) -> list[dict]:
    ours, folder = BENCHMARKED[OURS], call.out / "runs" / "start"
    how = folder, point.ranks, point.rounds, call.meter
    return [startup.measure(SCENES["water"], ours, *how)]
