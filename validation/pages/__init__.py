"""The only renderer: a verb returns a `Said`; `write` and `show` make files, page and terminal
output.

A verb's ``report.py`` has one function, ``said(summary) -> Said``.  It uses only the plain data of
the summary.json, so that page and tables can be recreated from the file.
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
