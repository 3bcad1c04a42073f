"""From a benchmark's summary to files and the terminal."""

from collections.abc import Iterable
from pathlib import Path

from rich.console import Console

from .. import COMMAND
from ..pages import report
from ..pages.said import NONE, Cell, Figure, Said, Table
from ..pages.tables import FREE, Column, busy, cell, numbers, ranks_of
from ..scenes.integrators import INTEGRATORS, OURS
from . import bandwidth

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
_USUAL = "rigid/nve", "rigid/nve/small", "shake"
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
    rows = {"table": scenes, "passes": passes, "goals": goals}
    tables = {name: report.frame(some) for name, some in rows.items()}
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


def say(summary: dict) -> Said:
    """For the report of all verbs: times against the fixes of LAMMPS, and the goals."""
    best, rows = [], []
    whole: dict[str, float] = {}
    slow: dict[str, float] = {}
    for point in summary["points"]:
        where, found = title(point), {row["name"]: row for row in point["integrators"]}
        rigid = (row.get("loop_ratio") for row in found.values() if row["kind"] == "rigid")
        fastest = max(filter(None, rigid), key=lambda ratio: ratio["median"], default=None)
        if found[OURS].get("modify"):
            whole |= {where: fastest["median"]} if fastest else {}
            ratios = [found.get(name, {}).get("modify_ratio") for name in _USUAL]
            best.append([where, *map(_spread, (found[OURS]["modify"], *ratios, fastest))])
        keys = "modify", "modify_ratio", "loop", "loop_ratio"
        for row in found.values():
            cells = (_spread(row.get(key)) for key in keys)
            rows.append([where, row["label"], *cells, row["error"] or "ok"])
        shares = [row["cpu"] for row in found.values() if row.get("cpu") is not None]
        slow[where] = min(shares, default=FREE)
    headlines, short = _whole(whole)
    late = [where for where, share in slow.items() if share < FREE]
    if late:
        worst = min(late, key=lambda where: slow[where])
        headlines.append(
            f"The machine was busy, in {len(late)} of {len(slow)} rows below: of a core a rank had "
            f"as little as {slow[worst]:.0f} % ({worst}); times are too long there, and ratios "
            "hold only where their ranges are narrow."
        )
    usual = (f"ours / {INTEGRATORS[name].label}" for name in _USUAL)
    head = "bodies, ranks", "ours, µs a step", *usual, "whole step, ours / the fastest rigid fix"
    what = "Time in the fixes (LAMMPS's Modify) and of the whole step; below 1 ours is the faster;"
    figures = {
        "size.png": "Time in LAMMPS's Modify against the number of molecules.",
        "scenes.png": "Time in LAMMPS's Modify of each scene.",
    }
    columns = "where", "integrator", "Modify, µs/step", "ours / it, Modify", "loop, µs/step"
    return Said(
        headlines,
        _met_and_starts(summary),
        [_goals(summary), Table.of("Times", [*columns, "ours / it, loop", "status"], rows)],
        [Figure(*figure) for figure in figures.items()],
        [Table.of(f"{what} median [minimum–maximum] of rounds", head, best)],
        commands=_bench_commands(summary),
        short=short,
    )


def _whole(whole):
    """A headline, and what is said in short, of the time of a whole step over the fastest fix's."""
    if not whole:
        return [], []
    (least, _), *_, (most, _) = sorted(whole.items(), key=lambda one: one[1])
    headline = (
        f"A whole step with ours takes {whole[least]:.2f} ({least}) to {whole[most]:.2f} ({most}) "
        "times that with the fastest of LAMMPS's rigid fixes."
    )
    water = [ratio for where, ratio in whole.items() if where.startswith("water")]
    if not water:
        return [headline], [headline]
    return [headline], [
        f"A whole step of water takes {min(water):.2f} to {max(water):.2f} times that with the "
        f"fastest of LAMMPS's rigid fixes; over all scenes {whole[least]:.2f} to {whole[most]:.2f}."
    ]


def _met_and_starts(summary):
    met = [goal["met"] for goal in summary["goals"] if goal["met"] is not None]
    told = f"Of the goals {sum(met)} are met, of {len(met)} that were measured; each is in the"
    lines = [f"{told} first table."]
    for start in summary["starts"]:
        if "first" in start and "later_added" in start:
            first, later = (spread(start[key]["wall"]) for key in ("first", "later_added"))
            told = f"Start, {ranks_of(start['ranks'])}: a first use takes {first} s, a later"
            lines.append(f"{told} one {later} s more than LAMMPS alone.")
    return lines


def _goals(summary):
    rows = []
    for goal in summary["goals"]:
        numbers = Cell.number(goal["limit"]), _spread(goal["measured"])
        rows.append([goal["where"], goal["what"], *numbers, MET[goal["met"]]])
    return Table.of("Goals", "where, what, at most, measured, verdict", rows)


def _bench_commands(summary):
    """What measures all of it: the summary's own command is the last of several parts."""
    points = summary["points"]
    parts = [*dict.fromkeys(point["scene"] for point in points)]
    others = {"passes": "passes", "start": "starts", "memory": "memory"}
    parts += [verb for verb, key in others.items() if summary[key]]
    values = {
        "--sizes": {point["bodies"] for point in points if point["scene"] == "water"},
        "--ranks": {point["ranks"] for point in points},
    }
    parts += [f"{word} {','.join(map(str, sorted(some)))}" for word, some in values.items() if some]
    return [" ".join([f"{COMMAND} bench", *parts])]


def _spread(value):
    return Cell(spread(value), NONE.value if value is None else value["median"])
