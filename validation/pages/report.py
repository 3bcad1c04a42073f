"""The skeleton of a verb's report: files in its output folder, and what the terminal shows.

A verb's ``report.py`` has two functions: ``write`` makes its tables and calls `write`, and ``show``
prints by `table` and closes with `end`.
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pandas as pd
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from validation.pages.page import page, save
from validation.pages.tables import Column, cell


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
    save(summary, out)
    for name, content in tables.items():
        content.to_csv(Path(out) / f"{name}.csv", index=False)
    if template:
        page(template, Path(out) / "report.html", figures, summary=summary, **values)


def frame(rows: Iterable[Mapping], columns: Sequence[str] | None = None) -> pd.DataFrame:
    """A table of rows by column; None is an empty cell, and no other number's form changes by it.

    Args:
        columns: those that are kept, in this order; None keeps all.
    """
    return pd.DataFrame(list(rows), columns=columns, dtype=object)


def table(
    console: Console,
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    left: Sequence[str] | None = None,
    styles: Iterable[str | None] | None = None,
) -> None:
    """Print a table; nothing if it has no rows.

    Args:
        left: columns of words, the first one if None; the others are of numbers.
        styles: of each row, as ``bold``.
    """
    words = columns[:1] if left is None else left
    made = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    for column in columns:
        made.add_column(column, justify="left" if column in words else "right", overflow="fold")
    cells = list(rows)
    for row, style in zip(cells, styles or [None] * len(cells)):
        made.add_row(*map(escape, row), style=style)
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
