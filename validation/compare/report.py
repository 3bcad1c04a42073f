"""From a comparison to files and the terminal."""

from pathlib import Path

import pandas as pd
from rich.console import Console

from ..own import counted
from ..pages import report
from ..pages.said import Cell, Figure, Said, Table, sortable
from ..pages.tables import Column, busy, cell, numbers, ranks_of
from ..scenes.units import UNITS
from ..statistics.estimate import SURE, Estimate
from .figures import draw


def columns(summary: dict) -> tuple[Column, ...]:
    """The table's, in the units of the scene."""
    settings = summary["settings"]
    units = UNITS[settings.get("units", "real")]
    made = (
        Column("energy_sd", "sd of energy", units.energy, "estimate"),
        Column("energy_sd_line", "sd about its line", units.energy, "estimate"),
        Column("drift", "energy drift", f"{units.energy}/{units.long}", "estimate"),
        Column("temperature", "temperature", units.temperature, "estimate"),
        Column("pressure", "pressure", units.pressure, "estimate"),
        Column("density", "density", "LAMMPS's", "estimate"),
        Column("distance", "distance", units.length, "number"),
        Column("rigidity", "rigidity", units.length, "number"),
        Column("modify", "Modify", "µs/step"),
        Column("modify_ratio", f"vs {settings['reference']}", "ratio"),
        Column("loop", "loop", "ms/step"),
    )
    moves = settings.get("ensemble", "nve") in ("npt", "nph")
    return tuple(one for one in made if moves or one.key != "density")


def status(row: dict) -> str:
    """In words: whether the row is complete, and if not, why."""
    if not row["error"]:
        return "ok"
    return row["error"] + (f" after {row['steps']} steps" if row["steps"] else "")


def write(summary: dict, series: dict, out: Path) -> None:
    """Write all files of a comparison, as of `measure.compare`, into the folder ``out``."""
    own = columns(summary)
    rows = [
        {"integrator": row["label"], **numbers(row, own), "status": status(row)}
        for row in summary["integrators"]
    ]
    samples = [
        pd.DataFrame({"integrator": name, **table}).astype({"Step": int}).set_index("integrator")
        for name, table in series.items()
    ]
    every = pd.concat(samples) if samples else pd.DataFrame()
    every.to_csv(out / "series.csv", float_format="%.12g")
    values = {"columns": own, "cell": cell, "status": status, "busy": busy(summary)}
    values["units"] = UNITS[summary["settings"].get("units", "real")]
    summary = summary | {"units": {one.key: one.unit for one in own}}
    tables, figures = {"table": report.frame(rows)}, draw(summary, series, out)
    report.write(summary, out, tables, "compare.html", figures, **values)


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the table, failures and where the files are."""
    report.integrators(console, summary["title"], columns(summary), summary["integrators"])
    if busy(summary):
        console.print(busy(summary), soft_wrap=True)
    failures = [f"{row['label']}: {status(row)}" for row in summary["integrators"] if row["error"]]
    report.end(console, summary, out, failures)


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    rows, settings = summary["integrators"], summary["settings"]
    known = [row for row in rows if row.get("energy_sd")]
    told = ", ".join(f"{row['label']} {Estimate.of(row['energy_sd']).text()}" for row in known)
    units, own = UNITS[settings.get("units", "real")], columns(summary)
    span = f"{settings['steps']:,} steps of {settings['dt_fs']:g} {units.time}"
    where = f"{summary['title']}, {span}, {ranks_of(settings['ranks'])}"
    what = f"standard deviation of the energy in {units.energy}"
    lines = [f"{where}: {what}: {told or 'none was measured'}."]
    drifts = ((row["label"], Estimate.of(row["drift"])) for row in known)
    sure = [f"{label} {one.text()}" for label, one in drifts if abs(one.value) > one.margin]
    lines.append(f"Energy drifts for sure ({SURE}), {own[2].unit}: {', '.join(sure) or 'none'}.")
    lines += counted.left_out([row["label"] for row in rows if row.get("uncounted")])
    failed = [f"{row['label']}: {status(row)}" for row in rows if row["error"]]
    lines += [f"Failed: {'; '.join(failed)}."] * bool(failed)
    lines += filter(None, [busy(summary)])
    table = [
        [row["label"]]
        + [Cell(cell(row, one), sortable(row.get(one.key))) for one in own]
        + [status(row)]
        for row in rows
    ]
    head = "integrator", *(f"{one.title}, {one.unit}" for one in own), "status"
    figure = Figure("energy.png", "Change of the total energy, on one scale.")
    return Said(lines=lines, tables=[Table.of("All columns", head, table)], figures=[figure])
