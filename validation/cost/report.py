"""The report of `cost`."""

import numpy as np

from ..pages import Column, Report, Table, digits, ranks_of
from ..scenes.integrators import INTEGRATORS, OURS
from ..statistics import measures
from ..statistics.estimate import SURE
from . import measure

WHERE = (
    Column("scene", "scene", kind="text"),
    Column("bodies", "bodies", kind="number", form=","),
    Column("ranks", "ranks", kind="number"),
)
STATUS = Column("status", "status", kind="text", wide=True)
TIMES = (
    Column("modify", "Modify", "µs/step"),
    Column("modify_ratio", "ours / it", "Modify", "interval"),
    Column("spent", "CPU time", "µs/step"),
    Column("spent_ratio", "ours / it", "CPU time", "interval"),
    Column("loop", "loop", "µs/step"),
    Column("loop_ratio", "ours / it", "loop", "interval"),
    Column("setup", "setup", "ms"),
    Column("memory", "memory", "MiB/rank"),
)
CUT = (
    Column("decomposition", "decomposition", kind="text"),
    Column("integrator", "integrator", kind="text"),
    Column("ranks", "ranks", kind="number", form=","),
    Column("bodies", "bodies", kind="number", form=","),
)
COUNTS = (*CUT, *(Column(key, key, kind="number", form=",.4g") for key in measure.SENT))
STARTS = {
    "plain": "LAMMPS with fix nve",
    "ours": "ours",
    "added": "ours, more than LAMMPS alone",
}
FASTEST = "the fastest of LAMMPS's rigid fixes"
FREE = 90.0  # least CPU use of a rank, percent of a core
RATIOS = "modify_ratio", "spent_ratio", "loop_ratio"
USUAL = "rigid/nve", "rigid/nve/small", "shake"
NOTES = {
    "Modify": "Time in all fixes, also those that solve charges: row Modify of LAMMPS's timing "
    "table, average over ranks. Median [minimum–maximum] over the rounds, as in the columns that "
    "follow.",
    "ours / it": f"The time of nosquish/nve divided by that of this integrator, both of the "
    f"same round: geometric mean with the {SURE} confidence interval, from the scatter between "
    "rounds. Below 1 ours is faster.",
    "CPU time": "CPU time of a whole step, mean over ranks. Other work on the machine changes it "
    "little.",
    "loop": "Wall time of a whole step.",
    "setup": "Wall time of `run 0`, less that of a run whose atoms move freely (fix nve/noforce). "
    "It is the second `run 0` of a process: the first one also reads or compiles code.",
    "memory": "Peak resident memory of the rank with the most, less that of a run whose atoms move "
    "freely. That of ours includes Python's packages.",
    "start": "A process that reads 1,000 molecules, defines the fix and does one step. The CPU "
    "time is that of all ranks.",
    "handed to MPI": "Counted in 50 steps with re-neighbouring, with 1,000 molecules of water on "
    "each rank, cut into bricks. Counts do not depend on the machine. What travels with atoms that "
    "change ranks is part of LAMMPS's own messages and is not counted.",
    "rounds": "Each timing is that of a separate process. The order is random, and in every second "
    "round it is reversed.",
}


def describe(summary: dict) -> Report:
    """The report: times relative to LAMMPS's fixes, memory, messages, start-up."""
    points = summary.get("points", [])
    lines = _busy(points)
    started = [
        f"On {ranks_of(start['ranks'])} a start takes {_seconds(start['added']['wall']).text} s "
        "more than LAMMPS alone."
        for start in summary.get("starts", [])
        if "added" in start
    ]
    sentences = filter(None, (_step_times(points), *started[:1], _message_counts(summary)))
    answer = " ".join(sentences) or "Nothing was measured."
    tables = [_best(points), _every(points), _starts(summary)]
    title = "What it costs"
    if not points:
        title += ": messages" if summary.get("counts") else ": start-up"
    return Report(
        title,
        "What do rigid bodies cost: time in the fix and of a step, memory, messages, start-up?",
        answer,
        lines=[*lines, *started[1:]],
        tables=[*(table for table in tables if table.rows), _messages(summary)],
        notes=NOTES,
        failures=_failures(summary),
        commands=summary.get("commands", ()),
        defeats=_defeats(points),
    )


def interval(ratios: dict | None) -> dict | None:
    """The geometric mean of ratios, one from each round, with its 95 % confidence interval: plain
    data for a `Column` of this kind; None for fewer than two rounds."""
    if not ratios or len(ratios["values"]) < 2:
        return None
    mean = measures.mean_of_few(np.log(ratios["values"]))
    ends = (mean.value, mean.value - mean.margin, mean.value + mean.margin)
    value, low, high = (float(end) for end in np.exp(ends))
    return {"value": value, "low": low, "high": high}


def fastest(point: dict) -> dict | None:
    """The ratio of a whole step's time with ours to that with the fastest of LAMMPS's rigid fixes,
    as an interval: of CPU times, or of wall times if results have no CPU times."""
    rows = [row for row in point["integrators"] if row["kind"] == "rigid"]
    ratios = (interval(row.get("spent_ratio") or row.get("loop_ratio")) for row in rows)
    return max(filter(None, ratios), key=lambda ratio: ratio["value"], default=None)


def place(point: dict) -> str:
    """Scene, bodies and ranks of a point, in words."""
    return f"{point['scene']} {point['bodies']:,}, {ranks_of(point['ranks'])}"


def _ratio(ratio):
    value, low, high = (digits(ratio[key]) for key in ("value", "low", "high"))
    return f"{value} ({SURE} CI {low}–{high})"


def _step_times(points):
    """Describe the time of a whole step; empty if it was not measured."""
    ratios = [(ratio, place(point)) for point in points if (ratio := fastest(point))]
    if not ratios:
        return ""
    ratios.sort(key=lambda pair: pair[0]["value"])
    slower = sum(ratio["low"] > 1 for ratio, _ in ratios)
    faster = sum(ratio["high"] < 1 for ratio, _ in ratios)
    ends = dict.fromkeys(f"{_ratio(ratio)} for {where}" for ratio, where in (ratios[0], ratios[-1]))
    return (
        f"Time of a whole step relative to {FASTEST}: {' to '.join(ends)}. Ours is significantly "
        f"faster in {faster} of {len(ratios)} cases, and significantly slower in {slower}."
    )


def _defeats(points):
    """Name where a whole step takes significantly longer than with the fastest of LAMMPS's rigid
    fixes."""
    return [
        f"{place(point)}: a step takes {_ratio(ratio)} times as long as one with {FASTEST}"
        for point in points
        if (ratio := fastest(point)) and ratio["low"] > 1
    ]


def _busy(points):
    """Warn if a rank had less than a core."""
    shares = [
        (row["cpu"], place(point))
        for point in points
        for row in point["integrators"]
        if row.get("cpu") is not None
    ]
    least, where = min(shares, default=(FREE, ""))
    if least >= FREE:
        return []
    return [
        f"The machine was busy: a rank had as little as {least:.0f} % of a core ({where}). Wall "
        "times are too long then. Compare CPU times."
    ]


def _best(points):
    """Compare ours with the usual fixes, a row for each scene, size and number of ranks."""
    columns = [
        *WHERE,
        Column("own", "ours", "µs/step"),
        *(
            Column(f"{name}_ratio", f"ours / {INTEGRATORS[name].label}", "Modify", "interval")
            for name in USUAL
        ),
        Column("whole_ratio", "ours / the fastest rigid fix", "whole step", "interval"),
    ]
    rows = []
    for point in points:
        by_name = {row["name"]: row for row in point["integrators"]}
        if by_name.get(OURS, {}).get("modify"):
            ratios = {
                f"{name}_ratio": interval(by_name.get(name, {}).get("modify_ratio"))
                for name in USUAL
            }
            row = point | ratios | {"whole_ratio": fastest(point)}
            rows.append(row | {"own": by_name[OURS]["modify"]})
    return Table("Time in the fix (LAMMPS's Modify), and of the whole step", columns, rows)


def _every(points):
    """All numbers of all integrators."""
    keys = [column.key for column in WHERE]
    rows = [
        {**row, **{key: point[key] for key in keys}, "status": row["error"] or "ok"}
        | {key: interval(row.get(key)) for key in RATIOS}
        | {"ours": row["kind"] == "ours"}
        for point in points
        for row in point["integrators"]
    ]
    columns = (*WHERE, Column("label", "integrator", kind="text"), *TIMES, STATUS)
    return Table("All integrators", columns, rows, "table", long=len(points) > 2)


def _starts(summary):
    rows = [
        [ranks_of(start["ranks"]), words, *map(_seconds, (times["wall"], times["cpu"]))]
        for start in summary.get("starts", [])
        for key, words in STARTS.items()
        if (times := start.get(key))
    ]
    return Table.of("Start, seconds", "ranks, start, wall, CPU", rows)


def _seconds(spread):
    """Format the median with minimum and maximum."""
    return Column("spread", "").cell({"spread": spread})


def _messages(summary):
    """A table of what the fixes pass to MPI."""
    return Table(
        "Handed to MPI by the fixes, per rank and step",
        COUNTS,
        [row for row in summary.get("counts", []) if not row["error"]],
        "counts",
    )


def _message_counts(summary):
    """Describe the messages, as counted on the most ranks."""
    counts = [row for row in summary.get("counts", []) if not row["error"]]
    most = max((row["ranks"] for row in counts), default=0)
    each = "; ".join(
        f"{row['integrator']} {row['messages'] + row['collectives']:.1f} messages and collective "
        f"calls of {row['bytes'] + row['collective_bytes']:,.0f} bytes"
        for row in counts
        if row["ranks"] == most
    )
    return f"On {most} ranks each rank hands to MPI per step: {each}." * bool(counts)


def _failures(summary):
    """What ended with an error."""
    failed = [
        (f"{place(point)}, {row['label']}", row["error"])
        for point in summary.get("points", [])
        for row in point["integrators"]
    ]
    failed += [
        (f"start, {ranks_of(row['ranks'])}", row["error"]) for row in summary.get("starts", [])
    ]
    failed += [
        (f"{row['decomposition']}, {ranks_of(row['ranks'])}, {row['integrator']}", row["error"])
        for row in summary.get("counts", [])
    ]
    return [f"{name}: {error}" for name, error in failed if error]
