"""From the checks of ``published`` to files and the terminal."""

from pathlib import Path

from rich.console import Console

from ..pages import report
from ..pages.figures import draw_each
from ..pages.said import Figure, Said, Table, of_checks
from ..statistics.check import VERDICTS
from ..statistics.estimate import margin
from .figures import spread
from .measure import ORIGINS, SOURCE, TEMPERATURE, THEIR_ERROR, TITLES, WITHIN


def write(summary: dict, out: Path) -> None:
    """Write all files of a summary: ``checks``, ``interrupted`` and the circumstances."""
    values = {"titles": TITLES, "source": SOURCE, "origins": ORIGINS, "temperature": TEMPERATURE}
    values |= {"their_margin": margin(THEIR_ERROR)}
    tables = {"table": report.of_checks(summary["checks"])}
    figures = draw_each((spread,), out, summary["checks"])
    report.write(summary, out, tables, "published.html", figures, **values)


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the checks."""
    report.show_checks(console, summary["checks"], TITLES)
    report.end(console, summary, out)


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    part = f"{100 * WITHIN:g} %"
    noun = f"statements that the energy's spread is within {part} of that of others"
    origins = Table.of("Where each number comes from", "number, from", ORIGINS.items())
    figures = [Figure("spread.png", f"Beside {SOURCE}.")]
    return of_checks(summary, TITLES, noun, VERDICTS, best=[origins], figures=figures)
