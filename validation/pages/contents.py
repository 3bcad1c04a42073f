"""The report of a verb: one description, from which `rendering` makes the terminal's tables, CSV
files and pages.

Rows are plain data, as in summary.json, so that everything can be recreated from a committed file.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from matplotlib.figure import Figure as Drawing

from ..statistics.check import CHECK_COLUMNS, VERDICTS, bound, measured
from ..statistics.estimate import SURE, Estimate

NOTHING = "–"
STYLES = {  # styles of verdicts, on pages and in the terminal, with their words
    "good": ("holds", "pass", "met", "agrees"),
    "bad": ("does not hold", "fail", "blow-up", "ends", "not met", "refused"),
    "open": ("cannot tell", "not measured", "cannot run"),
}
PARTS = {  # endings of a value's headings in a CSV file, by kind
    "spread": {" median": "median", " min": "min", " max": "max"},
    "interval": {"": "value", " low": "low", " high": "high"},
}
MARGINS = (
    f"± is the half width of the {SURE} interval. A number without it is computed, not sampled. "
    "A number holds, or does not, only if all of its interval is within the bounds, or outside."
)


class Cell(NamedTuple):
    """A cell with a text other than that of its column's kind.

    Attributes:
        sort: the number by which it is sorted; None sorts by its text.
        verdict: sets its colour, one of `STYLES`' words.
    """

    text: str
    sort: float | None = None
    verdict: str = ""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        key: of its values in the rows.
        title, unit: of its heading.
        kind: type of the values; None, or no value, is an empty cell of any kind.

            ========  ============================================================
            estimate  value, error, freedom: shown with its 95 % margin; ``note`` is appended
            spread    median, min and max of repeats
            interval  value, low, high, of which None is infinite
            number    shown in ``form``
            text      text, or several lines of it; a `Cell` where it needs a colour
            verdict   text that has the colour of `STYLES`
            code      lines of input
            ========  ============================================================
        form: how a number is formatted.
        wide: whether the terminal leaves the column out.
    """

    key: str
    title: str
    unit: str = ""
    kind: str = "spread"
    form: str = "g"
    wide: bool = False

    @property
    def heading(self) -> str:
        """The heading in a file, and in the documentation."""
        return f"{self.title} ({self.unit})" if self.unit else self.title

    def cell(self, row: Mapping, short: bool = False) -> Cell:
        """A row's entry; ``short`` leaves out the range of a spread."""
        value = row.get(self.key)
        if value is None or isinstance(value, Cell):
            return Cell(NOTHING) if value is None else value
        if self.kind == "estimate":
            return Cell(f"{Estimate.of(value).text()}{value.get('note', '')}", value["value"])
        if self.kind == "spread":
            median, low, high = (digits(value[part]) for part in PARTS["spread"].values())
            return Cell(median if short else f"{median} [{low}–{high}]", value["median"])
        if self.kind == "interval":
            middle, low, high = (digits(value[part]) for part in PARTS["interval"].values())
            return Cell(f"{middle} ({low}–{high})", value["value"])
        if self.kind == "number":
            return Cell(f"{value:{self.form}}", value)
        lines = [value] if isinstance(value, str) else value
        text = "\n".join(map(str, lines)) if isinstance(lines, (list, tuple)) else str(lines)
        return Cell(text, verdict=text if self.kind == "verdict" else "")

    def entries(self, row: Mapping) -> dict[str, Any]:
        """A row's cells of a CSV file, by heading; None is empty."""
        value, unit = row.get(self.key), f" ({self.unit})" if self.unit else ""
        if self.kind == "estimate":
            known = Estimate.of(value) if value else None
            entries = {"": known and known.value, " margin": known and known.margin}
        elif self.kind in PARTS:
            entries = {end: value and value[part] for end, part in PARTS[self.kind].items()}
        else:
            entries = {"": value.text if isinstance(value, Cell) else value}
        return {f"{self.title}{end}{unit}": number for end, number in entries.items()}


def digits(value: float | None, significant: int = 3) -> str:
    """Format a number with so many digits, never as 1e+03; None is infinite."""
    if value is None:
        return "∞"
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.{significant}g}"


@dataclass(frozen=True)
class Table:
    """A table: rows by columns.

    Attributes:
        title: its heading; a table without title is written to its file only.
        rows: plain data by the columns' keys.  ``ours`` (true) highlights a row, ``error`` marks
            it as failed.
        file: name of the CSV file with all columns, without .csv; empty for none.
        note: a sentence below it.
        long: whether the page folds it, and the terminal leaves it out.
    """

    title: str
    columns: Sequence[Column]
    rows: Sequence[Mapping]
    file: str = ""
    note: str = ""
    long: bool = False

    @property
    def shown(self) -> list[Column]:
        """The columns that have an entry."""
        return [
            column
            for column in self.columns
            if any(row.get(column.key) is not None for row in self.rows)
        ]

    @classmethod
    def of(
        cls, title: str, headings: str | Iterable[str], rows: Iterable[Iterable], **more
    ) -> "Table":
        """A table of text, numbers and `Cell`; ``headings`` in one text are split at commas."""
        heads = headings.split(", ") if isinstance(headings, str) else headings
        return cls(
            title,
            [Column(str(place), head, kind="text") for place, head in enumerate(heads)],
            [{str(place): cell for place, cell in enumerate(row)} for row in rows],
            **more,
        )


@dataclass(frozen=True)
class Figure:
    """A figure.

    Attributes:
        name: of its file, without .png.
        draw: draws it, in the style of `figures`; returns None if there is nothing to draw.
        caption: how to read it; its message is its title.
        words: quotation of a source, shown beside it.
    """

    name: str
    draw: Callable[[], Drawing | None]
    caption: str
    words: str = ""


@dataclass(frozen=True)
class Report:
    """The report of a verb on its results.

    Attributes:
        title: heading.
        question: the reader's.
        answer: a sentence or two, as far as the data allow.
        lines: further sentences.
        checks: numbers with bounds, of `Check.plain`; ``parts`` are their headings in order, and
            ``checks_file`` is their CSV file.
        notes: meaning of terms and columns, and how it was measured.
        failures: what ended with an error, by name.
        commands: that repeat these results; empty: the summary's own.
        defeats: where ours is worse than another, with numbers; shown on the page of all results.
    """

    title: str
    question: str
    answer: str
    lines: Sequence[str] = ()
    tables: Sequence[Table] = ()
    figures: Sequence[Figure] = ()
    checks: Sequence[Mapping] = ()
    parts: Mapping[str, str] = field(default_factory=dict)
    checks_file: str = "checks"
    notes: Mapping[str, str] = field(default_factory=dict)
    failures: Sequence[str] = ()
    commands: Sequence[str] = ()
    defeats: Sequence[str] = ()

    @property
    def all_tables(self) -> list[Table]:
        """Its tables, and those of its checks: one for each part, and that of the file."""
        heads = ("subject", "of"), ("what", "number"), ("value", "measured"), ("bound", "bound")
        columns = [Column(*head, kind="text") for head in heads]
        columns += [
            Column("verdict", "verdict", kind="verdict"),
            Column("why", "why", kind="text", wide=True),
        ]
        tables = [*self.tables]
        for part, title in self.parts.items():
            rows = [_of_check(check) for check in self.checks if check["part"] == part]
            tables += [Table(title, columns, rows)] * bool(rows)
        if self.checks:
            exported = [
                {**check, "margin": Estimate.of(check).margin or None} for check in self.checks
            ]
            tables.append(
                Table(
                    "",
                    [Column(key, key, kind="text") for key in CHECK_COLUMNS],
                    exported,
                    self.checks_file,
                )
            )
        return tables

    @property
    def open_checks(self) -> dict[str, list[str]]:
        """Checks that do not hold, and open ones, each with its numbers."""
        return {
            verdict: [
                f"{check['subject']}: {check['what']}: {measured(check)}, bound {bound(check)}"
                + (f" ({check['note']})" if check["note"] else "")
                for check in self.checks
                if check["verdict"] == verdict
            ]
            for verdict in VERDICTS[1:]
        }


def _of_check(check: Mapping) -> dict:
    """A row of a table of checks."""
    number = Cell(measured(check), check["value"])
    why = "; ".join(text for text in (check["source"], check["note"]) if text)
    words = {key: check[key] for key in ("subject", "what", "verdict")}
    return words | {"value": number, "bound": bound(check), "why": why}


def ranks_of(number: int) -> str:
    """'1 rank', '2 ranks'."""
    return f"{number} rank" + "s" * (number != 1)
