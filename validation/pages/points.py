"""Schemes at time steps: their tables on the terminal, and what their page has (``points.html``).

A row is plain data with ``scheme``, ``label``, ``dt``, ``ours``, ``lines``, ``starts``, ``error``
and the numbers of the columns.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from rich.console import Console

from . import report
from .figures import draw_each
from .tables import Column, cell, numbers


class Part(NamedTuple):
    """A table: its title, its columns and its rows."""

    title: str
    columns: Sequence[Column]
    rows: Sequence[dict]


def label(row: Mapping[str, Any]) -> str:
    """A row's scheme and step."""
    return f"{row['label']}, {row['dt']:g} fs"


def frame(rows: Iterable[dict], columns: Iterable[Column]) -> pd.DataFrame:
    """The table of all rows."""
    columns = tuple(columns)
    return report.frame(
        {"scheme": row["label"], "step (fs)": row["dt"], "starts": row["starts"]}
        | numbers(row, columns)
        | {"status": row["error"] or "ok"}
        for row in rows
    )


def write(
    summary: dict,
    out: Path,
    table: pd.DataFrame,
    template: str,
    figures: Sequence,
    parts: Sequence[Part],
    **values,
) -> None:
    """Write summary.json, table.csv, checks.csv, figures and report.html into a folder.

    Args:
        summary: plain data: ``rows``, ``checks``, settings and circumstances.
        table: see `frame`.
        figures: functions of the summary that draw them.
        parts: tables of the page.
        values: what else the template uses; ``titles``, ``limits`` and ``too_short`` are of all.
    """
    files = {"table": table, "checks": report.of_checks(summary["checks"])}
    drawn = draw_each(figures, out, summary)
    values |= {"parts": parts, "cell": cell, "label": label}
    report.write(summary, out, files, template, drawn, **values)


def show(
    console: Console,
    summary: dict,
    out: Path,
    parts: Sequence[Part],
    *,
    titles: Mapping[str, str],
    limits: Iterable[str],
    too_short: str,
    hidden: Collection[str] = (),
) -> None:
    """Print the tables, the limits, the checks, what failed and where the files are.

    Args:
        titles: of the parts of the checks.
        limits: sentences about what means are held against.
        too_short: why nothing is held against bounds; empty where something is.
        hidden: keys of columns that the terminal has no room for.
    """
    for title, columns, rows in parts:
        shown, cells = [one for one in columns if one.key not in hidden], []
        for row in rows:
            name = "✗ " * bool(row["error"]) + row["label"]
            step = f"{row['dt']:g}"
            cells.append([name, step, *(cell(row, one, short=True) for one in shown)])
        heads = ["scheme", "step\nfs", *(one.head for one in shown)]
        styles = ["bold" if row["ours"] else None for row in rows]
        report.table(console, f"{summary['title']}. {title}", heads, cells, styles=styles)
    for line in limits:
        console.print(line, soft_wrap=True)
    if too_short:
        console.print(too_short, soft_wrap=True)
    else:
        report.show_checks(console, summary["checks"], titles)
    failures = [f"{label(row)}: {row['error']}" for row in summary["rows"] if row["error"]]
    report.end(console, summary, out, failures)
