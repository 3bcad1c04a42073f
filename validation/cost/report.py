"""What `cost` says of its summary."""

from functools import partial

from ..pages import Cell, Column, Figure, Said, Table, digits, ranks_of
from ..pages.tables import FREE
from ..scenes.integrators import INTEGRATORS, OURS
from . import figures
from .criteria import place

WHERE = (
    Column("scene", "scene", kind="text"),
    Column("bodies", "bodies", kind="number", form=","),
    Column("ranks", "ranks", kind="number"),
)
STATUS = Column("status", "status", kind="text", wide=True)
SENT = {
    "messages": "messages",
    "bytes": "bytes",
    "collectives": "collectives",
    "collective_bytes": "bytes in these",
}
TIMES = (
    Column("modify", "Modify", "µs/step"),
    Column("modify_per_1000", "Modify", "µs/step/1,000 bodies", wide=True),
    Column("modify_ratio", "ours / it", "Modify"),
    Column("loop", "loop", "µs/step"),
    Column("loop_ratio", "ours / it", "loop"),
    Column("setup", "setup", "ms"),
    Column("first_setup", "first setup", "ms", wide=True),
    Column("memory", "memory", "MiB/rank"),
    *(
        Column(f"{scope}{key}", title, unit, wide=scope != "more_" or "collective_" in key)
        for key, title in SENT.items()
        for scope, unit in (("", "/step"), ("fix_", "/step in fixes"), ("more_", "/step more"))
    ),
)
PASSES = (
    Column("name", "pass", kind="text"),
    Column("when", "when", kind="text"),
    *WHERE,
    Column("cost", "cost", "µs/step"),
    Column("with", "with it", "µs/step", wide=True),
    Column("without", "without", "µs/step", wide=True),
    STATUS,
)
GOALS = (
    Column("where", "where", kind="text"),
    Column("what", "what", kind="text"),
    Column("limit", "at most", kind="number"),
    *(Column(key, key, kind="number", form=".3g") for key in ("median", "min", "max")),
    Column("met", "met", kind="verdict"),
)
CUT = (
    Column("decomposition", "decomposition", kind="text"),
    Column("integrator", "integrator", kind="text"),
    Column("ranks", "ranks", kind="number", form=","),
    Column("bodies", "bodies", kind="number", form=","),
)
COUNTS = (*CUT, *(Column(key, key, kind="number", form=",.4g") for key in SENT))
MODEL = (
    Column("link", "link", kind="text"),
    *CUT,
    Column("seconds", "seconds", kind="number", form=".2e"),
)
MET = {True: "met", False: "not met", None: "not measured"}
STARTS = {
    "plain": "LAMMPS with fix nve",
    "later": "ours, compiled before",
    "later_added": "ours, compiled before, more than LAMMPS alone",
    "first": "ours, first use",
    "first_added": "ours, first use, more than LAMMPS alone",
}
USUAL = "rigid/nve", "rigid/nve/small", "shake"
NOTES = {
    "Modify": "Time in the fixes: row Modify of LAMMPS's timing table, average over ranks. Median "
    "[minimum–maximum] over the rounds, as in the columns that follow.",
    "ours / it": "The time of fix_nosquish.NVE divided by that of this integrator, both of the "
    "same round; below 1 ours is faster.",
    "loop": "Wall time of a whole step.",
    "setup": "Wall time of `run 0`, less that of a run whose atoms move freely (fix nve/noforce). "
    "It is the second `run 0` of a process; the first one is in the column “first setup”.",
    "memory": "Peak resident memory of the rank with the most, less that of a run whose atoms move "
    "freely. That of ours includes Python's packages.",
    "messages, bytes": "Sent to other ranks per rank and step: by all of LAMMPS; “in fixes”, as in "
    "Modify; “more” than a run whose atoms move freely. Counted in 50 steps with re-neighbouring.",
    "optional passes": "Modify with the pass less Modify without it. A pass that nothing needs is "
    "left out, and costs nothing.",
    "start": "A process that reads 1,000 molecules, defines the fix and does one step. The CPU "
    "time is that of all ranks. A first use has a copy of the package with nothing compiled.",
    "handed to MPI": "Counted with 1,000 molecules of water on each rank, cut into slabs (two "
    "neighbours) or bricks (up to 26). Counts do not depend on the machine. What travels with "
    "atoms that change ranks is part of LAMMPS's own messages and is not counted.",
    "model": "No measurement: a message takes the link's latency, its bytes the bandwidth, one "
    "after the other; a collective call takes log2(ranks) messages. rigid/nve sums force and "
    "torque of all bodies on all ranks, 48 bytes per body. Computation is left out.",
    "rounds": "Each timing is that of a process of its own, in turns (A B C A B C …).",
}


def said(summary: dict) -> Said:
    """What the fix costs: times against LAMMPS's fixes, memory, messages, start."""
    points = summary.get("points", [])
    answer, lines = _whole(points)
    lines += _busy(points)
    sent, started = _handed(summary), _started(summary)
    told = [answer, *started[:1], *sent[:1]]
    answer = " ".join(filter(None, told)) or "Nothing was measured."
    tables = [_best(points), _every(points), _passes(summary), _starts(summary), _goals(summary)]
    drawn = {
        "size": "Dotted: the time in which the memory moves the bytes that a step must move.",
        "scenes": "Medians; bars from minimum to maximum. Left of 1 ours is faster.",
        "scaling": "Left: counted. Right: a model of the counted messages, not a measurement.",
    }
    return Said(
        "What it costs",
        "What do rigid bodies cost: time in the fix and of a step, memory, messages, start-up?",
        answer,
        lines=[*lines, *started[1:], *sent[1:]],
        tables=[*(table for table in tables if table.rows), *_messages(summary)],
        figures=[
            Figure(name, partial(getattr(figures, name), summary), caption)
            for name, caption in drawn.items()
        ],
        notes=NOTES,
        failures=_failures(summary),
        commands=summary.get("commands", ()),
    )


def _fastest(point):
    """The ratio of a whole step with ours to that with the fastest of LAMMPS's rigid fixes."""
    ratios = (row.get("loop_ratio") for row in point["integrators"] if row["kind"] == "rigid")
    return max(filter(None, ratios), key=lambda ratio: ratio["median"], default=None)


def _whole(points):
    """What is said of the time of a whole step: an answer, and further lines."""
    ratios = {place(point): ratio["median"] for point in points if (ratio := _fastest(point))}
    if not ratios:
        return "", []
    least, most = min(ratios, key=ratios.__getitem__), max(ratios, key=ratios.__getitem__)
    every = (
        f"A whole step with ours takes {ratios[least]:.2f} ({least}) to {ratios[most]:.2f} ({most})"
        " times as long as one with the fastest of LAMMPS's rigid fixes."
    )
    water = [ratio for where, ratio in ratios.items() if where.startswith("water")]
    if not water:
        return every, []
    told = f"A step of water takes {min(water):.2f} to {max(water):.2f} times as long as one with "
    return f"{told}the fastest of LAMMPS's rigid fixes.", [every]


def _busy(points):
    """A warning if a rank had less than a core."""
    shares = {
        place(point): min(
            (row["cpu"] for row in point["integrators"] if row.get("cpu")), default=FREE
        )
        for point in points
    }
    late = [where for where, share in shares.items() if share < FREE]
    if not late:
        return []
    worst = min(late, key=lambda where: shares[where])
    return [
        f"The machine was busy in {len(late)} of {len(shares)} rows: a rank had as little as "
        f"{shares[worst]:.0f} % of a core ({worst}). Times are too long there, and only ratios "
        "with a narrow range can be trusted."
    ]


def _best(points):
    """Ours beside the usual fixes, a row for each scene, size and number of ranks."""
    columns = [*WHERE, Column("own", "ours", "µs/step")]
    columns += [Column(name, f"ours / {INTEGRATORS[name].label}", "Modify") for name in USUAL]
    columns += [Column("whole", "ours / the fastest rigid fix", "whole step")]
    rows = []
    for point in points:
        found = {row["name"]: row for row in point["integrators"]}
        if found.get(OURS, {}).get("modify"):
            ratios = {name: found.get(name, {}).get("modify_ratio") for name in USUAL}
            row = {**point, "own": found[OURS]["modify"], **ratios, "whole": _fastest(point)}
            rows.append(row)
    return Table("Time in the fix (LAMMPS's Modify), and of the whole step", columns, rows)


def _every(points):
    """All numbers of all integrators."""
    keys = [column.key for column in WHERE]
    rows = [
        {**row, **{key: point[key] for key in keys}, "status": row["error"] or "ok"}
        | {"ours": row["kind"] == "ours"}
        for point in points
        for row in point["integrators"]
    ]
    columns = (*WHERE, Column("label", "integrator", kind="text"), *TIMES, STATUS)
    return Table("All integrators", columns, rows, "table", long=len(points) > 2)


def _passes(summary):
    rows = [{**row, "status": row["error"] or "ok"} for row in summary.get("passes", [])]
    return Table("Optional passes", PASSES, rows, "passes")


def _starts(summary):
    rows = [
        [ranks_of(start["ranks"]), words, *map(_seconds, (times["wall"], times["cpu"]))]
        for start in summary.get("starts", [])
        for key, words in STARTS.items()
        if (times := start.get(key))
    ]
    return Table.of("Start, seconds", "ranks, start, wall, CPU", rows)


def _started(summary):
    """What is said of the start."""
    return [
        f"On {ranks_of(start['ranks'])} a first use takes {_seconds(start['first']['wall']).text} "
        f"s, a later start {_seconds(start['later_added']['wall']).text} s more than LAMMPS alone."
        for start in summary.get("starts", [])
        if "first" in start and "later_added" in start
    ]


def _seconds(spread):
    """Median with minimum and maximum."""
    median, low, high = (digits(spread[part]) for part in ("median", "min", "max"))
    return Cell(f"{median} [{low}–{high}]", spread["median"])


def _goals(summary):
    rows = [
        {**goal, **(goal["measured"] or {}), "met": MET[goal["met"]]}
        for goal in summary.get("goals", [])
    ]
    return Table("Limits that we set ourselves", GOALS, rows, "goals", long=True)


def _messages(summary):
    """What the fixes hand to MPI, and the model."""
    counts = [row for row in summary.get("counts", []) if not row["error"]]
    title = "Handed to MPI by the fixes, per rank and step"
    modelled = "The same on many ranks, by a model"
    return [
        Table(title, COUNTS, counts, "counts"),
        Table(modelled, MODEL, summary.get("model", []), "model", long=True),
    ]


def _handed(summary):
    """What is said of the messages: counted on the most ranks, and by the model."""
    lines = []
    counts = [row for row in summary.get("counts", []) if not row["error"]]
    for cut in dict.fromkeys(row["decomposition"] for row in counts):
        most, rows = _most([row for row in counts if row["decomposition"] == cut])
        each = "; ".join(
            f"{row['integrator']} {row['messages']:.1f} messages of {row['bytes']:,.0f} bytes and "
            f"{row['collectives']:.2f} collective calls of {row['collective_bytes']:,.0f} bytes"
            for row in rows
        )
        lines.append(f"On {most} ranks ({cut}s) each rank hands to MPI per step: {each}.")
    for link in summary.get("links", []):
        rows = [row for row in summary["model"] if row["link"] == link["name"]]
        most, rows = _most([row for row in rows if row["decomposition"] == "brick"])
        each = ", ".join(f"{row['integrator']} {row['seconds'] * 1e6:,.1f} µs" for row in rows)
        if rows:
            lines.append(f"By the model, on {most:,} ranks {link['name']}: {each} per step.")
    return lines


def _most(rows):
    """The largest number of ranks, and the rows with so many."""
    most = max((row["ranks"] for row in rows), default=0)
    return most, [row for row in rows if row["ranks"] == most]


def _failures(summary):
    """What ended with an error."""
    failed = [
        (f"{place(point)}, {row['label']}", row["error"])
        for point in summary.get("points", [])
        for row in point["integrators"]
    ]
    failed += [(row["name"], row["error"]) for row in summary.get("passes", [])]
    failed += [
        (f"start, {ranks_of(row['ranks'])}", row["error"]) for row in summary.get("starts", [])
    ]
    failed += [
        (f"{row['decomposition']}, {ranks_of(row['ranks'])}, {row['integrator']}", row["error"])
        for row in summary.get("counts", [])
    ]
    return [f"{name}: {error}" for name, error in failed if error]
