"""From the checks of `theory` to files and the terminal."""

from pathlib import Path

from rich.console import Console

from ..pages import report
from ..pages.said import Figure, Said, of_checks
from .figures import draw

TITLES = {
    "reversal": "Forward and back",
    "symplectic": "Symplectic property (2.42)",
    "conserved": "Conserved quantity (2.37), (2.51)",
    "mrot": "Inner steps of the rotor",
    "rotors": "The free rotation, split and exact",
    "recursion": "Recursion relation (2.30)",
    "loops": "The compiled loops",
}


def write(summary: dict, out: Path) -> None:
    """Write all files into a folder.

    Args:
        summary: plain data: ``checks``, ``data`` (what the figures show, by part), ``interrupted``
            and the circumstances.
    """
    tables = {"table": report.of_checks(summary["checks"])}
    figures = draw(summary["data"], out)
    report.write(summary, out, tables, "theory.html", figures, titles=TITLES)


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the checks."""
    report.show_checks(console, summary["checks"], TITLES)
    report.end(console, summary, out)


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    captions = {
        "reversal.png": "Distance from the start after N steps and back.",
        "conserved.png": "Spread of the energy and of the conserved quantity.",
    }
    figures = [Figure(*one) for one in captions.items()]
    return of_checks(summary, TITLES, "numbers that the paper's theory bounds", figures=figures)
