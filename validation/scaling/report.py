"""From the counts and the model of `scaling` to files and the terminal."""

from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
from rich.console import Console

from ..pages import report
from ..pages.figures import MARKS, Drawn, draw_each
from ..pages.said import Cell, Figure, Said, Table
from .measure import COUNTED

COUNTS = "decomposition", "integrator", "ranks", "bodies", *COUNTED
MODEL = "link", "decomposition", "integrator", "ranks", "bodies", "seconds"


def write(summary: dict, out: Path) -> None:
    """Write all files of a summary (see `measure.scaling`) into the folder ``out``."""
    counts = [row for row in summary["counts"] if not row["error"]]
    tables = {
        "counts": report.frame(counts, COUNTS),
        "model": report.frame(summary["model"], MODEL),
    }
    figures = draw_each((scaling,), out, tables, summary["links"][0]["name"])
    report.write(summary, out, tables, "scaling.html", figures)


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the counts."""
    words = "decomposition", "integrator"
    cells = [
        [f"{row[key]:.4g}" if key in COUNTED else str(row[key]) for key in COUNTS]
        for row in summary["counts"]
        if not row["error"]
    ]
    title = "Handed to MPI by the fixes, per rank and step"
    report.table(console, title, COUNTS, cells, words)
    failed = [row for row in summary["counts"] if row["error"]]
    failures = [
        f"{row['integrator']}, {row['decomposition']}, {row['ranks']} ranks: {row['error']}"
        for row in failed
    ]
    report.end(console, summary, out, failures)


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    counted = [row for row in summary["counts"] if not row["error"]]
    lines = []
    for cut in dict.fromkeys(row["decomposition"] for row in counted):
        most, rows = _most([row for row in counted if row["decomposition"] == cut])
        each = (
            f"{row['integrator']} {row['messages']:.1f} messages of {row['bytes']:,.0f} bytes in "
            f"all and {row['collectives']:.2f} collective calls with "
            f"{row['collective_bytes']:,.0f} bytes"
            for row in rows
        )
        lines.append(f"A rank hands to MPI in a step, {most} ranks, {cut}s: {'; '.join(each)}.")
    bricks = [row for row in summary["model"] if row["decomposition"] == "brick"]
    for link in (link["name"] for link in summary["links"]):
        most, rows = _most([row for row in bricks if row["link"] == link])
        told = ", ".join(f"{row['integrator']} {row['seconds'] * 1e6:,.1f} µs" for row in rows)
        if rows:
            where = f"By the model, {most:,} ranks, bricks, a link {link}"
            lines.append(f"{where}: {told} a step.")
    rows = []
    for row in counted:
        numbers = (Cell.number(row[key], ",.2f") for key in COUNTED)
        ranks = Cell(f"{row['ranks']}", row["ranks"])
        rows.append([row["decomposition"], row["integrator"], ranks, *numbers])
    head = "cut, fix, ranks, messages, bytes, collectives, collective bytes"
    caption = "Per rank and step: bytes counted, and time by the model."
    return Said(
        lines=lines,
        tables=[Table.of("Counted, per rank and step", head, rows)],
        figures=[Figure("scaling.png", caption)],
    )


def _most(rows):
    """The largest number of ranks, and the rows with so many."""
    most = max((row["ranks"] for row in rows), default=0)
    return most, [row for row in rows if row["ranks"] == most]


def scaling(tables: dict[str, pd.DataFrame], link: str) -> Drawn:
    """Bytes per rank and step, and the model's time, against the number of ranks."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
    counts, model = tables["counts"], tables["model"]
    counts = counts.assign(value=counts["bytes"] + counts["collective_bytes"])
    model = model[model["link"] == link].assign(value=lambda rows: rows["seconds"] * 1e6)
    for rows, axis in (counts, left), (model, right):
        known = rows[rows["value"] > 0].groupby(["decomposition", "integrator"], sort=False)
        for (decomposition, name), some in known:
            colour, mark = MARKS[str(name)]
            style = {
                "color": colour,
                "marker": mark,
                "ls": "--" if decomposition == "slab" else "-",
            }
            axis.loglog(some["ranks"], some["value"], label=f"{name}, {decomposition}", **style)
        axis.set_xlabel("ranks")
    left.set_ylabel("bytes per rank and step")
    right.set_ylabel("µs per step, by the model")
    right.legend(frameon=False, fontsize=8)
    return figure, "Per rank and step: bytes counted (left), time by the model (right)."
