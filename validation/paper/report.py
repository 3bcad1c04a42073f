"""From ``paper``'s numbers to files and the terminal."""

from pathlib import Path

from rich.console import Console

from ..pages import report
from ..pages.said import Figure, Said, of_checks
from ..statistics.estimate import Estimate
from .figures import SHOWN, draw, thin
from .measure import TITLES, Found
from .plan import AVERAGE_MEASURE, LIQUID, STATEMENTS

COLUMNS = (  # key, heading, unit
    ("temperature", "temperature", "K"),
    ("sd", "sd of energy", "kcal/mol"),
    ("sd_line", "sd about its line", "kcal/mol"),
    ("measure", "average measure", ""),
    ("drift", "drift", "kcal/mol/ps"),
    ("rigidity", "rigidity", "Å"),
)


def write(summary: dict, found: Found, out: Path) -> None:
    """Write all files into a folder.

    Args:
        summary: circumstances, ``lengths`` and all that ``measure.judge`` gives, as plain data.
    """
    table = [
        {"trajectory": row["name"], "integrator": row["integrator"], "dt (fs)": row["dt"]}
        | {"length (ps)": f"{row['ps']:g}"}
        | {f"{title} ({unit or 'ratio'})": cell(row, key) for key, title, unit in COLUMNS}
        | {"status": row["error"] or "ok"}
        for row in summary["rows"]
    ]
    series = [
        {"trajectory": name, "t (ps)": f"{time:.6g}", "Delta E": f"{error:.4g}"}
        for name in found
        if name in SHOWN
        for time, error in zip(*thin(found[name]))
    ]
    tables = {"table": report.frame(table), "claims": report.of_checks(summary["checks"])}
    tables["series"] = report.frame(series, ("trajectory", "t (ps)", "Delta E"))
    values = {"titles": TITLES, "columns": COLUMNS, "cell": cell}
    values |= {"aim": AVERAGE_MEASURE, "liquid": LIQUID}
    report.write(summary, out, tables, "paper.html", draw(found, summary, out), **values)


def cell(row: dict, key: str) -> str:
    """A row's entry as text."""
    value = row.get(key)
    if value is None:
        return "–"
    return Estimate.of(value).text() if isinstance(value, dict) else f"{value:.1e}"


def show(console: Console, summary: dict, out: Path) -> None:
    """Print trajectories and claims."""
    heads = ["trajectory", "Δt, fs", "ps", *(f"{title}\n{unit}" for _, title, unit in COLUMNS)]
    rows = [
        ["✗ " * bool(row["error"]) + row["name"], f"{row['dt']:g}", f"{row['ps']:g}"]
        + [cell(row, key) for key, _, _ in COLUMNS]
        for row in summary["rows"]
    ]
    report.table(console, "Trajectories", heads, rows)
    report.show_checks(console, summary["checks"], TITLES)
    failures = [f"{row['name']}: {row['error']}" for row in summary["rows"] if row["error"]]
    report.end(console, summary, out, failures)


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    failed = [f"{row['name']}: {row['error']}" for row in summary["rows"] if row["error"]]
    lines = [f"Not complete: {'; '.join(failed)}."] * bool(failed)
    figures = [
        Figure(
            f"figure_{name}.png",
            f"Figure {name}, run again. The paper says of its own:",
            STATEMENTS[scene],
        )
        for name, scene in {"2a": "dimer", "2b": "liquid", "3": "peptide"}.items()
    ]
    noun = "numbers that bear on what the paper says of its test problems"
    return of_checks(summary, TITLES, noun, lines=lines, figures=figures)
