"""From a benchmark's summary to files and the terminal."""

from collections.abc import Iterable
from pathlib import Path

from rich.console import Console

from validation.bench import bandwidth
from validation.bench.goals import ranks_of
from validation.pages import report
from validation.pages.tables import Column, busy, cell, numbers

COLUMNS = (
    Column("modify", "Modify", "µs/step"),
    Column("modify_per_1000", "Modify", "µs/step/1,000 bodies"),
    Column("modify_ratio", "ours / it", "Modify"),
    Column("loop", "loop", "µs/step"),
    Column("loop_ratio", "ours / it", "loop"),
    Column("setup", "setup", "ms"),
    Column("first_setup", "first setup", "ms"),
    Column("memory", "memory", "MiB/rank"),
)
_SENT = "messages", "bytes", "collectives", "collective_bytes"
MESSAGE_COLUMNS = tuple(
    Column(f"{scope}{key}", "bytes in these" if key == "collective_bytes" else key, unit)
    for key in _SENT
    for scope, unit in (("", "/step"), ("fix_", "/step in fixes"), ("more_", "/step more"))
)
# what fits into the terminal
TERMINAL = {one.key for one in COLUMNS} - {"first_setup"} | {f"more_{key}" for key in _SENT[:3]}
PASS_COLUMNS = (
    Column("cost", "cost", "µs/step"),
    Column("with", "with it", "µs/step"),
    Column("without", "without", "µs/step"),
)
STARTS = {
    "plain": "LAMMPS with fix nve",
    "later": "ours, compiled before",
    "later_added": "  more than LAMMPS alone",
    "first": "ours, first use",
    "first_added": "  more than LAMMPS alone",
}
MET = {True: "met", False: "not met", None: "not measured"}
STYLES = {True: "green", False: "red", None: "dim"}


def status(row: dict) -> str:
    """In words: whether the row is complete, and if not, why."""
    return row["error"] or "ok"


def title(point: dict) -> str:
    """Of a scene's table."""
    bodies = f"{point['bodies']:,} {'body' if point['bodies'] == 1 else 'bodies'}"
    return f"{point['scene']}, {bodies}, {ranks_of(point['ranks'])}"


def verdict(goal: dict) -> tuple[str, str]:
    """A goal's number, and whether it is met."""
    return spread(goal["measured"]), MET[goal["met"]]


def spread(value: dict | None) -> str:
    """Median [minimum–maximum] as text, to three digits."""
    if value is None:
        return "–"
    ends = (value[key] for key in ("median", "min", "max"))
    median, low, high = (f"{end:.0f}" if abs(end) >= 100 else f"{end:.3g}" for end in ends)
    return f"{median} [{low}–{high}]"


def used(columns: Iterable[Column], point: dict) -> list[Column]:
    """Those that have a number; of few bodies there are no thousands."""
    known = {key for row in point["integrators"] for key, value in row.items() if value is not None}
    if point["bodies"] < 1000:
        known.discard("modify_per_1000")
    return [column for column in columns if column.key in known]


def write(summary: dict, figures: list, out: Path) -> None:
    """Write all files of a benchmark into the folder ``out``.

    Args:
        summary: plain data (see `measure.bench`), with the goals.
        figures: list of (PNG path, caption).
    """
    where = "scene", "bodies", "ranks"
    scenes = [
        {key: point[key] for key in where}
        | {"integrator": row["label"], **numbers(row, (*COLUMNS, *MESSAGE_COLUMNS))}
        | {"status": status(row)}
        for point in summary["points"]
        for row in point["integrators"]
    ]
    passes = [
        {"pass": row["name"], **{key: row[key] for key in ("when", *where)}}
        | {**numbers(row, PASS_COLUMNS), "status": status(row)}
        for row in summary["passes"]
    ]
    goals = [
        {"where": goal["where"], "what": goal["what"], "at most": goal["limit"]}
        | {key: (goal["measured"] or {}).get(key) for key in ("median", "min", "max")}
        | {"met": MET[goal["met"]]}
        for goal in summary["goals"]
    ]
    tables = {"table": scenes, "passes": passes, "goals": goals}
    tables = {name: report.frame(rows) for name, rows in tables.items()}
    # with those of collectives it is too wide
    sent = [one for one in MESSAGE_COLUMNS if one.key not in ("collectives", "collective_bytes")]
    columns = {"columns": COLUMNS, "message_columns": sent, "pass_columns": PASS_COLUMNS}
    words = {"title": title, "status": status, "verdict": verdict, "starts": STARTS, "busy": busy}
    cells = {"used": used, "cell": cell, "spread": spread, "ranks_of": ranks_of}
    values = columns | words | cells | {"traffic": bandwidth}
    report.write(summary, out, tables, "bench.html", figures, **values)


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the tables, failures and where the files are."""
    failures = []
    for point in summary["points"]:
        columns = [one for one in used((*COLUMNS, *MESSAGE_COLUMNS), point) if one.key in TERMINAL]
        report.integrators(console, title(point), columns, point["integrators"])
        if busy(point):
            console.print(busy(point), soft_wrap=True)
        failures += [
            f"{title(point)}, {row['label']}: {row['error']}"
            for row in point["integrators"]
            if row["error"]
        ]
    heads = ["pass", *(one.head for one in PASS_COLUMNS)]
    cells = [
        [f"{row['name']}: {row['error'] or row['when']}", *(cell(row, one) for one in PASS_COLUMNS)]
        for row in summary["passes"]
    ]
    report.table(console, "Optional passes: Modify with the pass less that without", heads, cells)
    for start in summary["starts"]:
        known = [(words, start[key]) for key, words in STARTS.items() if key in start]
        cells = [[words, spread(times["wall"]), spread(times["cpu"])] for words, times in known]
        report.table(console, f"Start, {ranks_of(start['ranks'])}, s", ["", "wall", "CPU"], cells)
        failures += [f"start: {start['error']}"] * bool(start["error"])
    heads = ["where", "what", "at most", "measured", ""]
    cells = [
        [goal["where"], goal["what"], f"{goal['limit']:g}", *verdict(goal)]
        for goal in summary["goals"]
    ]
    styles = [STYLES[goal["met"]] for goal in summary["goals"]]
    report.table(console, "Goals", heads, cells, ("where", "what", "", "measured"), styles)
    report.end(console, summary, out, failures)
