"""The skeleton of a verb's report: files in its output folder, and what the terminal shows.

A verb's ``report.py`` has two functions: ``write`` makes its tables and calls `write`, and ``show``
prints by `table` and closes with `end`.  Its ``say`` is what the page of all verbs has of it; a
long one is in ``section.py``.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pandas as pd
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..running import whole
from ..statistics.check import CHECK_COLUMNS, VERDICTS, bound, measured
from ..statistics.estimate import SURE, Estimate
from .page import page
from .tables import Column, cell


def write(
    summary: dict,
    out: Path,
    tables: Mapping[str, pd.DataFrame],
    template: str | None = None,
    figures: Sequence[tuple[Path, str]] = (),
    **values,
) -> None:
    """Write summary.json, a CSV file of each table, and report.html if there is a template.

    Args:
        summary: plain data; the template has it under this name.
        out: the folder.
        tables: name of the file, without .csv, to its content (see `frame`).
        template: its name in ``templates``.
        figures: of the page: (PNG path, caption).
        values: what else the template uses.
    """
    whole.write(out / "summary.json", summary)
    write_tables(out, tables)
    if template:
        page(template, out / "report.html", figures, summary=summary, **values)


def write_tables(out: Path, tables: Mapping[str, pd.DataFrame]) -> None:
    """Write a CSV file of each table into the folder ``out``."""
    for name, content in tables.items():
        content.to_csv(out / f"{name}.csv", index=False)


def frame(rows: Iterable[Mapping], columns: Sequence[str] | None = None) -> pd.DataFrame:
    """A table of rows by column; None is an empty cell, and no other number's form changes by it.

    Args:
        columns: those that are kept, in this order; None keeps all.
    """
    made = pd.DataFrame(list(rows), dtype=object)
    return made if columns is None else made.reindex(columns=list(columns))


def of_checks(checks: Iterable[Mapping]) -> pd.DataFrame:
    """The table of checks, of `Check.plain`; where there is no margin its cell is empty."""
    rows = ({**one, "margin": Estimate.of(one).margin or None} for one in checks)
    return frame(rows, CHECK_COLUMNS)


def table(
    console: Console,
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str | Text]],
    left: Sequence[str] | None = None,
    styles: Iterable[str | None] | None = None,
) -> None:
    """Print a table; nothing if it has no rows.

    Args:
        left: columns of words, the first one if None; the others are of numbers.
        styles: of each row, as ``bold``.
    """
    words = columns[:1] if left is None else left
    made = Table(
        title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    for column in columns:
        made.add_column(column, justify="left" if column in words else "right", overflow="fold")
    cells = list(rows)
    for row, style in zip(cells, styles or [None] * len(cells)):
        made.add_row(*(Text(one) if isinstance(one, str) else one for one in row), style=style)
    if cells:
        console.print(made)


def integrators(
    console: Console, title: str, columns: Sequence[Column], rows: Sequence[dict]
) -> None:
    """Print a table with a row for each integrator, by its ``label``; ours in bold."""
    cells = [
        ["✗ " * bool(row["error"]) + row["label"], *(cell(row, one, short=True) for one in columns)]
        for row in rows
    ]
    styles = ["bold" if row["name"] == "nosquish" else None for row in rows]
    table(console, title, ["integrator", *(one.head for one in columns)], cells, styles=styles)


def show_checks(console: Console, checks: Sequence[Mapping], titles: Mapping[str, str]) -> None:
    """Print checks, of `Check.plain`: a table for each part, then how many hold, and notes.

    Args:
        titles: part to its heading.
    """
    heads = ["of", "number", "measured", "bound", "verdict"]
    for part, title in titles.items():
        rows = [
            [one["subject"], one["what"], measured(one), bound(one), one["verdict"]]
            for one in checks
            if one["part"] == part
        ]
        table(console, title, heads, rows, ("of", "number", "verdict"))
    verdicts = [one["verdict"] for one in checks]
    counts = ", ".join(f"{verdicts.count(word)} × {word}" for word in VERDICTS)
    console.print(f"{counts} (± and verdicts: {SURE} intervals)")
    for one in checks:
        if one["verdict"] not in ("", "holds") and one["note"]:
            told = f"{one['subject']}, {one['what']}: {one['note']}"
            console.print(told, markup=False, soft_wrap=True)


def end(
    console: Console,
    summary: dict,
    out: Path,
    failures: Iterable[str] = (),
    file: str = "report.html",
) -> None:
    """Print what failed, that a Ctrl-C ended the verb, and where the files are."""
    for failure in failures:
        console.print(f"✗ {failure}", markup=False, soft_wrap=True)
    if summary.get("interrupted"):
        console.print("Interrupted: the same command goes on from here.")
    console.print(f"{out}/{file} and the numbers beside it", markup=False, soft_wrap=True)
