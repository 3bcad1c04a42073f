"""From a benchmark's summary to files: summary.json, table.csv, passes.csv, goals.csv, report.html; and to the terminal."""

import csv

from rich.box import SIMPLE_HEAD
from rich.table import Table

from validation import bandwidth, report
from validation.goals import ranks_of
from validation.report import Column, save

COLUMNS = (
    Column(
        "modify", "Modify", "µs/step", "spread",
        "Time in the fixes (row Modify of LAMMPS's timing table, average over ranks), of a step. Median [minimum–maximum] over the "
        "rounds, as in the columns that follow.",
    ),
    Column("modify_per_1000", "Modify", "µs/step/1,000 bodies", "spread", "The same, for each 1,000 bodies."),
    Column("modify_ratio", "ours / it", "Modify", "spread", "Modify of fix_nosquish.NVE over that of this integrator, both of one round."),
    Column("loop", "loop", "µs/step", "spread", "Wall time of a whole step."),
    Column("loop_ratio", "ours / it", "loop", "spread", "The loop of fix_nosquish.NVE over that of this integrator, both of one round."),
    Column(
        "setup", "setup", "ms", "spread",
        "Wall time of `run 0`, in which bodies are made of the atoms and the forces are computed once, less that of a run whose atoms "
        "move freely (fix nve/noforce), both of one round. It is the second `run 0` of a process.",
    ),
    Column(
        "first_setup", "first setup", "ms", "spread",
        "The command of the fix and the first `run 0` of a process, less the same of atoms that move freely: what reads compiled code too.",
    ),
    Column(
        "memory", "memory", "MiB/rank", "spread",
        "Peak resident memory of the rank with the most, less that of a run whose atoms move freely. Of ours Python's packages are part.",
    ),
)  # fmt: skip

_OF_RANK = "of a rank; median [minimum–maximum] over the ranks"
MESSAGE_COLUMNS = tuple(
    Column(f"{scope}{key}", name, unit, "spread", meaning)
    for key, name, whole in (
        ("messages", "messages", f"Messages that are sent to other ranks, {_OF_RANK}"),
        ("bytes", "bytes", f"Data of these messages, {_OF_RANK}"),
        (
            "collectives",
            "collectives",
            f"Calls in which all ranks take part, like MPI_Allreduce, {_OF_RANK}",
        ),
        ("collective_bytes", "bytes in these", f"Data that goes into these, {_OF_RANK}"),
    )
    for scope, unit, meaning in (
        ("", "/step", f"{whole}: of all of LAMMPS."),
        ("fix_", "/step in fixes", f"{whole}: of the fixes, as in Modify."),
        (
            "more_",
            "/step more",
            f"{whole}: of all of LAMMPS, less those of a run whose atoms move freely.",
        ),
    )
)
TERMINAL = (
    "modify",
    "modify_per_1000",
    "modify_ratio",
    "loop",
    "loop_ratio",
    "setup",
    "memory",
    "more_messages",
    "more_bytes",
    "more_collectives",
)  # keys of the columns that fit there

PASS_COLUMNS = (
    Column("cost", "cost", "µs/step", "spread", ""),
    Column("with", "with it", "µs/step", "spread", ""),
    Column("without", "without", "µs/step", "spread", ""),
)

MET = {True: "met", False: "not met", None: "not measured"}


def status(row):
    """In words: whether the row is complete, and if not, why."""
    return row["error"] or "ok"


def title(point):
    """Of a scene's table."""
    return f"{point['scene']}, {point['bodies']:,} {'body' if point['bodies'] == 1 else 'bodies'}, {ranks_of(point['ranks'])}"


def verdict(goal):
    """A goal's number and whether it is met: (text, word)."""
    return spread(goal["measured"]), MET[goal["met"]]


def spread(value):
    """Median [minimum–maximum] as text, to three digits."""
    if value is None:
        return "–"
    median, low, high = (
        f"{value[key]:.0f}" if abs(value[key]) >= 100 else f"{value[key]:.3g}"
        for key in ("median", "min", "max")
    )
    return f"{median} [{low}–{high}]"


def used(columns, point):
    """Those of the columns in which some integrator has a number; of few bodies there are no thousands."""
    return [
        column for column in columns
        if any(row.get(column.key) is not None for row in point["integrators"]) and (column.key != "modify_per_1000" or point["bodies"] >= 1000)
    ]  # fmt: skip


def write(summary, figures, out):
    """Write all files of a benchmark into the folder ``out``.

    Args:
        summary: plain data (see ``bench.bench``).
        figures: list of (PNG path, caption).
    """
    save(summary, out)
    _write_csv(
        out / "table.csv", ("scene", "bodies", "ranks", "integrator"), (*COLUMNS, *MESSAGE_COLUMNS),
        (((point["scene"], point["bodies"], point["ranks"], row["label"]), row) for point in summary["points"] for row in point["integrators"]),
    )  # fmt: skip
    _write_csv(
        out / "passes.csv", ("pass", "when", "scene", "bodies", "ranks"), PASS_COLUMNS,
        (((row["name"], row["when"], row["scene"], row["bodies"], row["ranks"]), row) for row in summary["passes"]),
    )  # fmt: skip
    with open(out / "goals.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["where", "what", "at most", "median", "min", "max", "met"])
        for goal in summary["goals"]:
            measured = (
                [goal["measured"][key] for key in ("median", "min", "max")]
                if goal["measured"]
                else ["", "", ""]
            )
            writer.writerow(
                [goal["where"], goal["what"], goal["limit"], *measured, MET[goal["met"]]]
            )
    report.page(
        "bench.html", out / "report.html", figures, summary=summary, columns=COLUMNS, used=used, pass_columns=PASS_COLUMNS,
        message_columns=[column for column in MESSAGE_COLUMNS if column.key not in ("collectives", "collective_bytes")],  # else too wide
        cell=report.cell, status=status, title=title, verdict=verdict, busy=report.busy, ranks_of=ranks_of, traffic=bandwidth.PASSES,
        starts=STARTS, spread=spread,
    )  # fmt: skip


def _write_csv(path, names, columns, rows):
    parts = "median", "min", "max"
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(
            [
                *names,
                *(f"{column.title} {part} ({column.unit})" for column in columns for part in parts),
                "status",
            ]
        )
        for words, row in rows:
            numbers = [
                row[column.key][part] if row.get(column.key) else ""
                for column in columns
                for part in parts
            ]
            writer.writerow([*words, *numbers, status(row)])


def show(console, summary, out):
    """Print the tables, failures and where the files are."""
    for point in summary["points"]:
        columns = [
            column for column in used((*COLUMNS, *MESSAGE_COLUMNS), point) if column.key in TERMINAL
        ]
        table = _table(title(point), "integrator", columns)
        for row in point["integrators"]:
            cells = (report.cell(row, column, short=True) for column in columns)
            table.add_row(
                ("✗ " if row["error"] else "") + row["label"],
                *cells,
                style="bold" if row["kind"] == "ours" else None,
            )
        console.print(table)
        for row in point["integrators"]:
            if row["error"]:
                console.print(f"✗ {row['label']}: {status(row)}", markup=False, soft_wrap=True)
        if report.busy(point):
            console.print(report.busy(point), soft_wrap=True)
    if summary["passes"]:
        table = _table(
            "Optional passes: Modify with the pass less that without", "pass", PASS_COLUMNS
        )
        for row in summary["passes"]:
            cells = (report.cell(row, column) for column in PASS_COLUMNS)
            table.add_row(f"{row['name']}: {row['error'] or row['when']}", *cells)
        console.print(table)
    for start in summary["starts"]:
        table = Table(
            title=f"Start, {ranks_of(start['ranks'])}, s",
            title_justify="left",
            title_style="bold",
            box=SIMPLE_HEAD,
        )
        for name in "", "wall", "CPU":
            table.add_column(name)
        for key, words in STARTS.items():
            if key in start:
                table.add_row(words, *(spread(start[key][kind]) for kind in ("wall", "cpu")))
        console.print(table)
        if start["error"]:
            console.print(f"✗ {start['error']}", markup=False, soft_wrap=True)
    table = Table(title="Goals", title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    for name in "where", "what", "at most", "measured", "":
        table.add_column(name, justify="right" if name == "at most" else "left")
    for goal in summary["goals"]:
        number, word = verdict(goal)
        style = {True: "green", False: "red", None: "dim"}[goal["met"]]
        table.add_row(goal["where"], goal["what"], f"{goal['limit']:g}", number, word, style=style)
    console.print(table)
    if summary["interrupted"]:
        console.print("Interrupted: the same command goes on from here.")
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)


STARTS = {
    "plain": "LAMMPS with fix nve",
    "later": "ours, compiled before",
    "later_added": "  more than LAMMPS alone",
    "first": "ours, first use",
    "first_added": "  more than LAMMPS alone",
}


def _table(text, first, columns):
    table = Table(title=text, title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    table.add_column(first, overflow="fold")
    for column in columns:
        table.add_column(f"{column.title}\n{column.unit}", justify="right", overflow="fold")
    return table
