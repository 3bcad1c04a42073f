"""From the points of ``engines`` to files and the terminal."""

from pathlib import Path

from rich.console import Console

from ..ensembles.lengths import beside_tables
from ..pages import points
from ..pages.points import Part
from ..pages.said import Figure, Said, of_checks
from ..pages.tables import Column
from ..sampling.measure import BY_KEY
from ..sampling.report import of_limit
from .criteria import TITLES
from .figures import bias
from .measure import OBSERVED

COLUMNS = (
    *(Column(f"biases {key}", BY_KEY[key].title, BY_KEY[key].unit, "estimate") for key in OBSERVED),
    Column("clock", "clock", "s/ps"),
)


def parts(summary: dict) -> list[Part]:
    """The table."""
    rows = [
        row | {f"biases {key}": one for key, one in row["biases"].items()}
        for row in summary["rows"]
    ]
    return [Part("Bias, from the limit of small steps", COLUMNS, rows)]


def limits(summary: dict) -> list[str]:
    """The limits of small steps: LAMMPS's, and those of each engine's own points."""
    told = {"LAMMPS": summary["known"]["limits"]} | summary["limits"]
    return [
        of_limit(f"{engine}, {BY_KEY[key].title}", one)
        for engine, own in told.items()
        for key, one in own.items()
    ]


def _told(summary):
    return beside_tables(summary, TITLES, limits(summary))


def write(summary: dict, out: Path) -> None:
    """Write summary.json, table.csv, checks.csv, the figure and report.html into a folder.

    Args:
        summary: plain data: ``rows``, ``limits``, ``checks``, settings and circumstances.
    """
    (part,) = made = parts(summary)
    table = points.frame(part.rows, part.columns)
    points.write(summary, out, table, "engines.html", [bias], made, **_told(summary))


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the points, the limits, the checks, what failed and where the files are."""
    points.show(console, summary, out, parts(summary), **_told(summary))


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    noun = "statements about averages in other engines"
    figures = [Figure("bias.png", "Bias of averages in other engines against the time step.")]
    return of_checks(summary, TITLES, noun, lines=limits(summary), figures=figures)
