"""From LAMMPS's examples to files and the terminal."""

from pathlib import Path

import numpy as np
from rich.console import Console

from ..pages import report

COLUMNS = (
    *("example", "fixes", "steps", "verdict", "begin", "pressure", "falls", "growth", "whole"),
    *("outside", "starts", "note"),
)
SHOWN = "example", "verdict", "begin", "pressure", "falls", "whole", "outside"
HEADS = (
    *("input", "result", "first steps", "pressure there", "falls at half the step"),
    *("all steps", "means outside 95 %"),
)


def cells(row: dict) -> dict:
    """A row's cells, as text."""
    made = {name: row.get(name, "") for name in COLUMNS}
    made["fixes"] = "; ".join(row["fixes"])
    made["steps"] = " ".join(map(str, row["steps"]))
    for name in (name for name in ("growth", "whole") if name in row):
        made[name] = f"{np.max(row[name]):.1e}"
    if "begin" in row:
        made["begin"], made["pressure"] = (f"{max(row['begin'][k::2]):.1e}" for k in (0, 1))
        made["falls"] = " ".join(f"{one:.2g}" for one in row["falls"])
    if row.get("columns"):
        made["outside"] = f"{len(row['outside'])} of {row['columns']}"
    return made


def write(summary: dict, out: Path) -> None:
    """Write summary.json and table.csv into a folder.

    Args:
        summary: plain data: ``rows`` as of ``measure.examples``, and the circumstances.
    """
    report.write(summary, out, {"table": report.frame(map(cells, summary["rows"]), COLUMNS)})


def show(console: Console, summary: dict, out: Path) -> None:
    """Print a row for each input, and what is to be said of it."""
    made = [cells(row) for row in summary["rows"]]
    rows = [[str(row[name] or "–") for name in SHOWN] for row in made]
    report.table(console, "LAMMPS's examples", HEADS, rows, HEADS[:2])
    notes = [f"{row['example']}: {row['note']}" for row in summary["rows"] if row["note"]]
    report.end(console, summary, out, notes, "table.csv")
