"""From ``paper``'s numbers to files and the terminal: summary.json, table.csv, claims.csv,
series.csv, figures, report.html."""

from pathlib import Path

import pandas as pd
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from validation.pages.page import page, save
from validation.pages.said import Figure, Said, of_checks
from validation.paper.figures import SHOWN, draw, thin
from validation.paper.measure import TITLES, Found
from validation.paper.plan import AVERAGE_MEASURE, LIQUID, STATEMENTS
from validation.statistics import check
from validation.statistics.estimate import Estimate

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
    save(summary, out)
    titles = [f"{title} ({unit or 'ratio'})" for _, title, unit in COLUMNS]
    table = [
        [row["name"], row["integrator"], row["dt"], f"{row['ps']:g}"]
        + [cell(row, key) for key, _, _ in COLUMNS]
        + [row["error"] or "ok"]
        for row in summary["rows"]
    ]
    head = ["trajectory", "integrator", "dt (fs)", "length (ps)", *titles, "status"]
    pd.DataFrame(table, columns=head).to_csv(out / "table.csv", index=False)
    check.write(summary["checks"], out / "claims.csv")
    series = [
        (name, f"{time:.6g}", f"{error:.4g}")
        for name in found
        if name in SHOWN
        for time, error in zip(*thin(found[name]))
    ]
    head = ["trajectory", "t (ps)", "Delta E"]
    pd.DataFrame(series, columns=head).to_csv(out / "series.csv", index=False)
    values = {"titles": TITLES, "columns": COLUMNS, "cell": cell}
    values |= {"summary": summary, "aim": AVERAGE_MEASURE, "liquid": LIQUID}
    page("paper.html", out / "report.html", draw(found, summary, out), **values)


def cell(row: dict, key: str) -> str:
    """A row's entry as text."""
    value = row.get(key)
    if value is None:
        return "–"
    return Estimate.of(value).text() if isinstance(value, dict) else f"{value:.1e}"


def show(console: Console, summary: dict, out: Path) -> None:
    """Print trajectories and claims."""
    table = Table(title="Trajectories", title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    table.add_column("trajectory", overflow="fold")
    for title in "Δt, fs", "ps", *(f"{title}\n{unit}" for _, title, unit in COLUMNS):
        table.add_column(title, justify="right")
    for row in summary["rows"]:
        cells = (cell(row, key) for key, _, _ in COLUMNS)
        name = "✗ " * bool(row["error"]) + row["name"]
        table.add_row(name, f"{row['dt']:g}", f"{row['ps']:g}", *cells)
    console.print(table)
    check.show(console, summary["checks"], TITLES)
    for row in summary["rows"]:
        if row["error"]:
            console.print(f"✗ {row['name']}: {row['error']}", markup=False, soft_wrap=True)
    if summary["interrupted"]:
        console.print("Interrupted: the same command goes on from here.")
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)


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
