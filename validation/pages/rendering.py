"""Rendering of a `contents.Report` to files, the terminal, and pages that need no other file."""

import base64
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import jinja2
import matplotlib.pyplot as plt
import pandas as pd
from PIL import Image
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table as Lines
from rich.text import Text

from ..running import json_files, machine
from .contents import MARGINS, STYLES, Report, Table
from .figures import STYLE

TEMPLATES = Path(__file__).parent / "templates"
COLOURS = {"good": "green", "bad": "red", "open": "dim"}  # in the terminal
PALETTE = 256  # colours of a PNG; lines and text need no more
FOLDED = 40  # rows; the page folds longer tables
GUTTER = (0, 1, 0, 0)  # of the terminal's tables


class Section(NamedTuple):
    """A summary's section of a page; ``name`` is its anchor, ``folder`` has its figures."""

    report: Report
    summary: dict
    folder: Path
    name: str = ""


def publish(console: Console, report: Report, summary: dict, out: Path) -> None:
    """`write` the files of a verb's results, and `show` them."""
    write(report, summary, out)
    show(console, report, summary, out)


def write(report: Report, summary: dict, out: Path) -> None:
    """Write summary.json, CSV files, figures and report.html into the folder ``out``."""
    json_files.write(out / "summary.json", summary)
    write_tables(report, out)
    draw(report, out)
    page(out / "report.html", report.title, [Section(report, summary, out)])


def write_tables(report: Report, out: Path) -> None:
    """Write the CSV files; a table without rows has none."""
    for table in report.all_tables:
        path = out / f"{table.file}.csv"
        if table.file and table.rows:
            frame(table).to_csv(path, index=False)
        elif table.file:
            path.unlink(missing_ok=True)


def frame(table: Table) -> pd.DataFrame:
    """All columns of a table; None is an empty cell, and does not change the format of numbers."""
    headings = [heading for column in table.columns for heading in column.entries({})]
    rows = [
        {
            heading: value
            for column in table.columns
            for heading, value in column.entries(row).items()
        }
        for row in table.rows
    ]
    return pd.DataFrame(rows, columns=headings, dtype=object)


def draw(report: Report, out: Path) -> None:
    """Draw the figures; if there is nothing to draw, the figure of an earlier command is
    removed."""
    with plt.rc_context(STYLE):
        for figure in report.figures:
            path, drawn = out / f"{figure.name}.png", figure.draw()
            if drawn is None:
                path.unlink(missing_ok=True)
                continue
            buffer = io.BytesIO()
            drawn.savefig(buffer)
            plt.close(drawn)
            with Image.open(buffer) as image:
                few = image.convert("RGB").quantize(PALETTE, kmeans=1, dither=Image.Dither.NONE)
            few.save(path, optimize=True)


def style_of(verdict: str) -> str:
    """The style of a verdict; empty if it has none."""
    return next((style for style, words in STYLES.items() if verdict in words), "")


def page(
    path: Path,
    title: str,
    sections: Sequence[Section],
    template: str = "page.html",
    **head,
) -> None:
    """Write a page of sections.

    Args:
        template: ``page.html``, or another one of `TEMPLATES` that fills its head from ``head``.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}
    environment.globals |= {
        "style_of": style_of,
        "package": machine.package,
        "margins": MARGINS,
        "folded": FOLDED,
        "picture": _picture,
    }
    path.write_text(
        environment.get_template(template).render(title=title, sections=sections, **head)
    )


def _picture(section: Section, name: str) -> str | None:
    """The data of a figure; None if it does not exist."""
    path = section.folder / f"{name}.png"
    return base64.b64encode(path.read_bytes()).decode() if path.exists() else None


def show(console: Console, report: Report, summary: dict, out: Path) -> None:
    """Print the question, the answer, tables, checks, failures and where the files are."""

    def tell(text, style=None):
        console.print(text, style=style, markup=False, soft_wrap=True)

    tell(report.title, "bold")
    tell(report.question)
    tell(report.answer, "bold")
    for table in report.all_tables:
        if table.title and not table.long:
            show_table(console, table)
    for verdict, names in report.open_checks.items():
        for name in names:
            tell(f"{verdict}: {name}", COLOURS[style_of(verdict)])
    if report.checks:
        tell(MARGINS)
    for line in report.lines:
        tell(line)
    for failure in report.failures:
        tell(f"✗ {failure}")
    if summary.get("interrupted"):
        tell("Interrupted: the same command goes on from here.")
    tell(f"{out}/report.html and the numbers beside it")


def show_table(console: Console, table: Table) -> None:
    """Print a table; nothing if it has no rows."""
    grid = Lines(
        title=table.title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, padding=GUTTER
    )
    columns = [column for column in table.shown if not column.wide]
    for column in columns:
        words = column is columns[0] or column.kind in ("text", "verdict", "code")
        grid.add_column(
            f"{column.title}\n{column.unit}" if column.unit else column.title,
            justify="left" if words else "right",
            overflow="fold",
        )
    for row in table.rows:
        cells = [column.cell(row, short=True) for column in columns]
        texts = [Text(cell.text, COLOURS.get(style_of(cell.verdict), "")) for cell in cells]
        if row.get("error"):
            texts[0] = Text("✗ ") + texts[0]
        grid.add_row(*texts, style="bold" if row.get("ours") else None)
    if table.rows:
        console.print(grid)
        if table.note:
            console.print(table.note, markup=False, soft_wrap=True)


def markdown(table: Table, keys: Iterable[str] = ()) -> str:
    """Format a table for the documentation, with the columns of these keys; by default all."""
    columns = [column for column in table.shown if not keys or column.key in set(keys)]

    def line(cells):
        return (
            "| "
            + " | ".join(column.replace("|", "\\|").replace("\n", "<br>") for column in cells)
            + " |"
        )

    heads = line(
        f"{column.title}, {column.unit}" if column.unit else column.title for column in columns
    )

    def text(column, row):
        cell = column.cell(row).text
        return (
            "\n".join(f"`{part}`" for part in cell.split("\n")) if column.kind == "code" else cell
        )

    rows = [line(text(column, row) for column in columns) for row in table.rows]
    return "\n".join([heads, "|" + "---|" * len(columns), *rows])
