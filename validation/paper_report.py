"""From ``paper``'s numbers to files and the terminal: summary.json, table.csv, claims.csv, series.csv, figures, report.html."""

import csv

from rich.box import SIMPLE_HEAD
from rich.table import Table

from validation import check
from validation.check import number
from validation.paper import AVERAGE_MEASURE, LIQUID
from validation.paper_claims import TITLES
from validation.paper_figures import SHOWN, draw, thin
from validation.report import page, save

COLUMNS = (  # key, heading, unit
    ("temperature", "temperature", "K"), ("sd", "sd of energy", "kcal/mol"), ("sd_line", "sd about its line", "kcal/mol"), ("measure", "average measure", ""), ("drift", "drift", "kcal/mol/ps"),
    ("rigidity", "rigidity", "Å"),
)  # fmt: skip


def write(summary, found, out):
    """Write all files into the folder ``out``.

    Args:
        summary: circumstances, ``lengths`` and all that ``paper_claims.judge`` gives, as plain data.
        found: name to ``paper.Series``.
    """
    save(summary, out)
    with open(out / "table.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            [
                "trajectory",
                "integrator",
                "dt (fs)",
                "length (ps)",
                *(f"{title} ({unit or 'ratio'})" for _, title, unit in COLUMNS),
                "status",
            ]
        )
        for row in summary["rows"]:
            cells = [cell(row, key) for key, _, _ in COLUMNS]
            writer.writerow(
                [
                    row["name"],
                    row["integrator"],
                    row["dt"],
                    f"{row['ps']:g}",
                    *cells,
                    row["error"] or "ok",
                ]
            )
    check.write(summary["checks"], out / "claims.csv")
    with open(out / "series.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["trajectory", "t (ps)", "Delta E"])
        for name, one in found.items():
            if name in SHOWN:
                writer.writerows(
                    (name, f"{time:.6g}", f"{error:.4g}") for time, error in zip(*thin(one))
                )
    page("paper.html", out / "report.html", draw(found, summary, out), summary=summary, titles=TITLES, columns=COLUMNS, cell=cell, number=number,
         measured=check.measured, bound=check.bound, sure=check.SURE, aim=AVERAGE_MEASURE, liquid=LIQUID)  # fmt: skip


def cell(row, key):
    """A row's entry as text."""
    value = row.get(key)
    if value is None:
        return "–"
    return number(**value) if isinstance(value, dict) else f"{value:.1e}"


def show(console, summary, out):
    """Print trajectories and claims."""
    table = Table(title="Trajectories", title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    table.add_column("trajectory", overflow="fold")
    for title in "Δt, fs", "ps", *(f"{title}\n{unit}" for _, title, unit in COLUMNS):
        table.add_column(title, justify="right")
    for row in summary["rows"]:
        table.add_row(
            ("✗ " if row["error"] else "") + row["name"],
            f"{row['dt']:g}",
            f"{row['ps']:g}",
            *(cell(row, key) for key, _, _ in COLUMNS),
        )
    console.print(table)
    check.show(console, summary["checks"], TITLES)
    for row in summary["rows"]:
        if row["error"]:
            console.print(f"✗ {row['name']}: {row['error']}", markup=False, soft_wrap=True)
    if summary["interrupted"]:
        console.print("Interrupted: the same command goes on from here.")
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)
