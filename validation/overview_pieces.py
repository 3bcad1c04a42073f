"""What the report of all verbs is made of: sentences, tables and figures."""

import math
from dataclasses import dataclass, field

STYLES = {"holds": "holds", "does not hold": "does-not-hold", "cannot tell": "cannot-tell", "pass": "holds", "fail": "does-not-hold",
          "blow-up": "does-not-hold", "ends": "does-not-hold", "met": "holds", "not met": "does-not-hold", "not measured": "cannot-tell"}  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """Text of a table, the number that it is sorted by (None: by the text; not a number: last), and the verdict that colours it (empty: the text)."""

    text: str
    value: float | None = None
    verdict: str = ""

    @property
    def style(self):
        """The page's class for the verdict."""
        return STYLES.get(self.verdict or self.text, "")


@dataclass(frozen=True)
class Table:
    """Rows of `Cell` under headings."""

    title: str
    columns: tuple[str, ...]
    rows: list


@dataclass(frozen=True)
class Figure:
    """A figure to show: its file in the results' folder, its caption, and the paper's words that stand beside it."""

    file: str
    caption: str
    words: str = ""


@dataclass(frozen=True)
class Said:
    """What a summary says.

    Attributes:
        headlines: sentences for the top of the page.
        best: `Table` and `Figure` for the top of the page.
        lines: further sentences.
        tables: list of `Table`.
        figures: list of `Figure`.
        commands: what makes these results; None takes the summary's own.
        extent: how long the runs were, in words.
        short: what is known for sure, in a sentence or two, for the first lines of the page.
    """

    headlines: list = field(default_factory=list)
    lines: list = field(default_factory=list)
    tables: list = field(default_factory=list)
    figures: list = field(default_factory=list)
    best: list = field(default_factory=list)
    commands: list | None = None
    extent: str = ""
    short: list = field(default_factory=list)


def sortable(value):
    """The number that a value, or an estimate's or a spread's dictionary, is sorted by; not a number if there is none."""
    return (
        math.nan
        if value is None
        else value.get("median", value.get("value"))
        if isinstance(value, dict)
        else value
    )
