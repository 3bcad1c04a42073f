"""From a comparison to files and the terminal."""

import csv

from rich.box import SIMPLE_HEAD
from rich.table import Table

from validation.compare.figures import draw
from validation.pages.page import page, save
from validation.pages.tables import Column, busy, cell
from validation.statistics.estimate import Estimate

COLUMNS = (
    Column(
        "energy_sd",
        "sd of energy",
        "kcal/mol",
        "estimate",
        "Standard deviation of the total energy of the whole box about its mean. "
        "± is the half width of its 95 % interval, correlation in time included; so it is in the next columns. "
        "It says so where the energy drifts: then this number grows with the length of the run.",
    ),
    Column(
        "energy_sd_line",
        "sd about its line",
        "kcal/mol",
        "estimate",
        "The same about the straight line through the energy: what is left of it without its drift.",
    ),
    Column(
        "drift",
        "energy drift",
        "kcal/mol/ps",
        "estimate",
        "Slope of the total energy, the mean of those of seven stretches of the run. If it is smaller "
        "than what stands beside it, it is not distinguishable from zero.",
    ),
    Column("temperature", "temperature", "K", "estimate", "Mean of LAMMPS's temp."),
    Column(
        "pressure",
        "pressure",
        "atm",
        "estimate",
        "Mean of LAMMPS's press. LAMMPS's rigid fixes average the constraint virial over two "
        "half steps.",
    ),
    Column(
        "distance",
        "distance",
        "Å",
        "number",
        "Largest distance of any atom, nearest image, from the same atom with rigid/nve "
        "after the first steps ({distance_after_steps} of them). Two methods that are exact up "
        "to rounding differ by rounding that the chaotic motion has amplified; two that differ "
        "in their time discretisation, as rigid/nve and shake do, differ by far more.",
    ),
    Column(
        "rigidity",
        "rigidity",
        "Å",
        "number",
        "Largest change, from the start to the end of the run, of any distance within a body.",
    ),
    Column(
        "modify",
        "Modify",
        "µs/step",
        "spread",
        "Time in the fixes (row Modify of LAMMPS's timing table, average over ranks). Median "
        "[minimum–maximum] of {timing_rounds} segments of {timing_steps} steps, run in turn with "
        "those of the other integrators.",
    ),
    Column(
        "modify_ratio",
        "vs rigid/nve",
        "ratio",
        "spread",
        "The same over that of rigid/nve in the same round.",
    ),
    Column("loop", "loop", "ms/step", "spread", "Wall time of a whole step in the same segments."),
)


def status(row):
    """In words: whether the row is complete, and if not, why."""
    if not row["error"]:
        return "ok"
    done = f" after {row['steps']} steps" if row["steps"] else ""
    return f"{row['error']}{done}"


def write(summary, series, out):
    """Write all files of a comparison into the folder ``out``.

    Args:
        summary: plain data.
        series: integrator name to thermo table.
    """
    save(summary, out)
    _write_table(summary, out / "table.csv")
    _write_series(series, out / "series.csv")
    _write_page(summary, draw(summary, series, out), out / "report.html")


def _write_table(summary, path):
    parts = {"estimate": ("value", "margin"), "spread": ("median", "min", "max")}
    header, picks = ["integrator"], []
    for column in COLUMNS:
        for part in parts.get(column.kind, (None,)):
            suffix = f" {part}" if part not in (None, "value") else ""
            header.append(f"{column.title}{suffix} ({column.unit})")
            picks.append((column.key, part))
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*header, "status"])
        for row in summary["integrators"]:
            values = [
                "" if row.get(key) is None else Estimate.of(row[key]).margin if part == "margin"
                else row[key][part] if part else row[key] for key, part in picks
            ]  # fmt: skip
            writer.writerow([row["label"], *values, status(row)])


def _write_series(series, path):
    """Thermo samples of all integrators, one row each."""
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        names = list(next(iter(series.values()), {"Step": []}))
        writer.writerow(["integrator", *names])
        for name, table in series.items():
            for values in zip(*(table[column] for column in names)):
                writer.writerow([name, int(values[0]), *(f"{value:.12g}" for value in values[1:])])


def _write_page(summary, figures, path):
    page(
        "compare.html", path, figures,
        summary=summary,
        columns=COLUMNS,
        meanings=[column.meaning.format(**summary["settings"]) for column in COLUMNS],
        cell=cell,
        status=status,
        busy=busy(summary),
    )  # fmt: skip


def show(console, summary, out):
    """Print the table, failures and where the files are."""
    table = Table(title=summary["title"], title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    table.add_column("integrator", overflow="fold")
    for column in COLUMNS:
        table.add_column(f"{column.title}\n{column.unit}", justify="right", overflow="fold")
    for row in summary["integrators"]:
        style = "bold" if row["name"] == "nosquish" else None
        cells = (cell(row, column, short=True) for column in COLUMNS)
        table.add_row(("✗ " if row["error"] else "") + row["label"], *cells, style=style)
    console.print(table)
    for row in summary["integrators"]:
        if row["error"]:
            console.print(f"✗ {row['label']}: {status(row)}", markup=False, soft_wrap=True)
    for line in (busy(summary), "Interrupted." if summary["interrupted"] else None):
        if line:
            console.print(line, soft_wrap=True)
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)
