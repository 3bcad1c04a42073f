"""The one renderer: a verb gives a `Said`, and `write` and `show` make files, page and terminal.

A verb's ``report.py`` has one function, ``said(summary) -> Said``.  What it says follows from the
plain data of its summary.json alone, so that page and tables can be made again from the file.
"""

from .contents import Cell, Column, Figure, Said, Table, digits, ranks_of
from .rendering import Section, draw, frame, markdown, page, show, show_table, write, write_tables

__all__ = [
    "Cell",
    "Column",
    "Figure",
    "Said",
    "Section",
    "Table",
    "digits",
    "draw",
    "frame",
    "markdown",
    "page",
    "ranks_of",
    "show",
    "show_table",
    "write",
    "write_tables",
]
