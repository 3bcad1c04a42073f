"""What a verb says to the report of all verbs: sentences, tables and figures."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from ..statistics.check import VERDICTS, bound, measured

STYLES = {  # of the page: verdicts
    "holds": ("holds", "pass", "met"),
    "does-not-hold": ("does not hold", "fail", "blow-up", "ends", "not met"),
    "cannot-tell": ("cannot tell", "not measured"),
}


@dataclass(frozen=True)
class Cell:
    """Text of a table, the number that it is sorted by (None: by the text; not a number: last), and
    the verdict that colours it (empty: the text)."""

    text: str
    value: float | None = None
    verdict: str = ""

    @property
    def style(self) -> str:
        """The page's class for the verdict."""
        verdict = self.verdict or self.text
        return next((style for style, words in STYLES.items() if verdict in words), "")

    @classmethod
    def number(cls, value: float | None, form: str = "g") -> "Cell":
        """Of a number, or of none."""
        return NONE if value is None else cls(f"{value:{form}}", value)


NONE = Cell("–", math.nan)


@dataclass(frozen=True)
class Table:
    """Rows of `Cell` under headings."""

    title: str
    columns: tuple[str, ...]
    rows: list[list[Cell]]

    @classmethod
    def of(cls, title: str, columns: str | Iterable[str], rows: Iterable[Iterable]) -> "Table":
        """A table of text and cells; ``columns`` that are one text are split at its commas."""
        cells = [[x if isinstance(x, Cell) else Cell(x) for x in row] for row in rows]
        return cls(
            title, tuple(columns.split(", ") if isinstance(columns, str) else columns), cells
        )


@dataclass(frozen=True)
class Figure:
    """A figure to show: its file in the results' folder, its caption, and the paper's words that
    stand beside it."""

    file: str
    caption: str
    words: str = ""


@dataclass(frozen=True)
class Said:
    """What a summary says."""

    headlines: list[str] = field(default_factory=list)  # for the top of the page
    lines: list[str] = field(default_factory=list)  # further sentences
    tables: list[Table] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    best: list[Table | Figure] = field(default_factory=list)  # for the top of the page
    commands: list[str] | None = None  # what makes these results; None takes the summary's own
    extent: str = ""  # how long the runs were, in words
    # what is known for sure, in a sentence or two, for the first lines of the page
    short: list[str] = field(default_factory=list)


def sortable(value: float | Mapping | None) -> float:
    """The number that a value, or an estimate's or a spread's dictionary, is sorted by; not a
    number if there is none."""
    number = value.get("median", value.get("value")) if isinstance(value, Mapping) else value
    return math.nan if number is None else number


def of_checks(
    summary: dict, titles: dict[str, str], noun: str, shown: Sequence[str] = VERDICTS[1:], **more
) -> Said:
    """Numbers between bounds: how many hold, and those with a ``shown`` verdict.

    Args:
        titles: part to its heading.
        noun: what the numbers are.
        more: of the `Said`; ``best`` comes behind the table, ``lines`` behind the counts.
    """
    checks = [check for check in summary["checks"] if check["verdict"]]
    held, lost, unknown = (sum(one["verdict"] == word for one in checks) for word in VERDICTS)
    counts = {f"{held} hold": True, f"{lost} do not": lost, f"{unknown} cannot be told": unknown}
    told = f"Of {len(checks)} {noun} {', '.join(words for words, some in counts.items() if some)}."
    short = [told if lost or unknown else f"All {len(checks)} {noun} hold."]
    lines = []
    for part, title in titles.items():
        some = [check["verdict"] == "holds" for check in checks if check["part"] == part]
        lines += [f"{title}: {sum(some)} of {len(some)} hold."] * bool(some)
    some, every = [], []
    for one in summary["checks"]:
        part, of, what = titles[one["part"]], one["subject"], one["what"]
        number = Cell(measured(one), sortable(one["value"])), bound(one), one["verdict"]
        every.append([part, of, what, *number, one["note"]])
        some += [[part, f"{of}: {what}", *number]] * (one["verdict"] in shown)
    which = "All of them" if VERDICTS[0] in shown else "Those that do not hold, or cannot be told"
    best = Table.of(which, "of, number, measured, bound, verdict", some)
    head = "part, of, number, measured, bound, verdict, note"
    all_of_them = Table.of("All numbers", head, every)
    more = more | {"best": [best, *more.get("best", ())], "lines": lines + more.get("lines", [])}
    return Said(short, tables=[all_of_them], short=short, **more)
