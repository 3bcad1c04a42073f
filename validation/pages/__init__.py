"""The only renderer: a verb returns a `Report`; `publish` makes files, page and terminal
output.

A verb's ``report.py`` has one function, ``describe(summary) -> Report``.  It uses only the plain
data of the summary.json, so that page and tables can be recreated from the file.
"""

from .contents import Cell, Column, Figure, Report, Table, digits, ranks_of
from .rendering import (
    Section,
    draw,
    frame,
    markdown,
    page,
    publish,
    show,
    show_table,
    write,
    write_tables,
)

__all__ = [
    "Cell",
    "Column",
    "Figure",
    "Report",
    "Section",
    "Table",
    "digits",
    "draw",
    "frame",
    "markdown",
    "page",
    "publish",
    "ranks_of",
    "show",
    "show_table",
    "write",
    "write_tables",
]
