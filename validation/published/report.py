"""From the checks of ``published`` to files and the terminal."""

from pathlib import Path

from rich.console import Console

from validation.pages.figures import draw_each
from validation.pages.page import page, save
from validation.pages.said import VERDICTS, Figure, Said, Table, of_checks
from validation.published.figures import spread
from validation.published.measure import ORIGINS, SOURCE, TEMPERATURE, THEIR_ERROR, TITLES, WITHIN
from validation.statistics import check
from validation.statistics.estimate import margin


def write(summary: dict, made: list[check.Check], out: Path) -> None:
    """Write summary.json, table.csv, the figure and report.html into a folder.

    Args:
        summary: plain data: ``checks``, ``interrupted`` and the circumstances.
    """
    save(summary, out)
    check.write(summary["checks"], out / "table.csv")
    values = {"titles": TITLES, "source": SOURCE, "origins": ORIGINS, "temperature": TEMPERATURE}
    values |= {"summary": summary, "their_margin": margin(THEIR_ERROR)}
    page("published.html", out / "report.html", draw_each((spread,), out, made), **values)


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the checks, and where the files are."""
    check.show(console, summary["checks"], TITLES)
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    part = f"{100 * WITHIN:g} %"
    noun = f"statements that the energy's spread is within {part} of that of others"
    origins = Table.of("Where each number comes from", "number, from", ORIGINS.items())
    figures = [Figure("spread.png", f"Beside {SOURCE}.")]
    return of_checks(summary, TITLES, noun, VERDICTS, best=[origins], figures=figures)
