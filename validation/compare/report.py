"""From a comparison to files and the terminal."""

from pathlib import Path

import pandas as pd
from rich.console import Console

from validation.compare.figures import draw
from validation.pages import report
from validation.pages.said import Cell, Figure, Said, Table, sortable
from validation.pages.tables import Column, busy, cell, numbers, ranks_of
from validation.statistics.estimate import SURE, Estimate

COLUMNS = (
    Column("energy_sd", "sd of energy", "kcal/mol", "estimate"),
    Column("energy_sd_line", "sd about its line", "kcal/mol", "estimate"),
    Column("drift", "energy drift", "kcal/mol/ps", "estimate"),
    Column("temperature", "temperature", "K", "estimate"),
    Column("pressure", "pressure", "atm", "estimate"),
    Column("distance", "distance", "Å", "number"),
    Column("rigidity", "rigidity", "Å", "number"),
    Column("modify", "Modify", "µs/step"),
    Column("modify_ratio", "vs rigid/nve", "ratio"),
    Column("loop", "loop", "ms/step"),
)


def status(row: dict) -> str:
    """In words: whether the row is complete, and if not, why."""
    if not row["error"]:
        return "ok"
    return row["error"] + (f" after {row['steps']} steps" if row["steps"] else "")


def write(summary: dict, series: dict, out: Path) -> None:
    """Write all files of a comparison, as of `measure.compare`, into the folder ``out``."""
    rows = [
        {"integrator": row["label"], **numbers(row, COLUMNS), "status": status(row)}
        for row in summary["integrators"]
    ]
    samples = [
        pd.DataFrame({"integrator": name, **table}).astype({"Step": int}).set_index("integrator")
        for name, table in series.items()
    ]
    every = pd.concat(samples) if samples else pd.DataFrame()
    every.to_csv(out / "series.csv", float_format="%.12g")
    values = {"columns": COLUMNS, "cell": cell, "status": status, "busy": busy(summary)}
    summary = summary | {"units": {one.key: one.unit for one in COLUMNS}}
    tables, figures = {"table": report.frame(rows)}, draw(summary, series, out)
    report.write(summary, out, tables, "compare.html", figures, **values)


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the table, failures and where the files are."""
    report.integrators(console, summary["title"], COLUMNS, summary["integrators"])
    if busy(summary):
        console.print(busy(summary), soft_wrap=True)
    failures = [f"{row['label']}: {status(row)}" for row in summary["integrators"] if row["error"]]
    report.end(console, summary, out, failures)


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    rows, settings = summary["integrators"], summary["settings"]
    known = [row for row in rows if row.get("energy_sd")]
    told = ", ".join(f"{row['label']} {Estimate.of(row['energy_sd']).text()}" for row in known)
    span = f"{settings['steps']:,} steps of {settings['dt_fs']:g} fs"
    where = f"{summary['title']}, {span}, {ranks_of(settings['ranks'])}"
    what = "standard deviation of the energy in kcal/mol"
    lines = [f"{where}: {what}: {told or 'none was measured'}."]
    drifts = ((row["label"], Estimate.of(row["drift"])) for row in known)
    sure = [f"{label} {one.text()}" for label, one in drifts if abs(one.value) > one.margin]
    lines.append(f"Energy drifts for sure ({SURE}), kcal/mol/ps: {', '.join(sure) or 'none'}.")
    failed = [f"{row['label']}: {status(row)}" for row in rows if row["error"]]
    lines += [f"Failed: {'; '.join(failed)}."] * bool(failed)
    lines += filter(None, [busy(summary)])
    table = [
        [row["label"]]
        + [Cell(cell(row, one), sortable(row.get(one.key))) for one in COLUMNS]
        + [status(row)]
        for row in rows
    ]
    head = "integrator", *(f"{one.title}, {one.unit}" for one in COLUMNS), "status"
    figure = Figure("energy.png", "Change of the total energy, on one scale.")
    return Said(lines=lines, tables=[Table.of("All columns", head, table)], figures=[figure])
