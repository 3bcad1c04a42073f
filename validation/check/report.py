"""From a check of a script to files and the terminal."""

from pathlib import Path

from rich.console import Console

from ..own import counted
from ..pages import report
from ..pages.said import Table
from ..scenes.units import UNITS
from .measure import STEPS, TITLES

KINDS = (
    "bodies of types",
    "number",
    "atoms",
    "shape",
    "freedom",
    "mass",
    "size",
    "moments",
    "turn",
)


def tables(summary: dict) -> list[Table]:
    """Kinds of bodies, and what integrators make of the start."""
    units = UNITS[summary["units"]]
    rows = [
        [
            *(one["name"], f"{one['number']:,}", str(one["atoms"]), one["shape"]),
            *(str(one["freedom"]), f"{one['mass']:.4g}", f"{one['size']:.4g}"),
            *(" ".join(f"{value:.4g}" for value in one["moments"]), f"{one['angle']:.2g} rad"),
        ]
        for one in summary["kinds"]
    ]
    heads = (
        "integrator",
        f"temperature, {units.temperature}",
        "degrees of freedom",
        f"pressure, {units.pressure}",
        f"potential energy, {units.energy}",
        f"range of its energy in {STEPS} steps, {units.energy}",
        "status",
    )
    keys = "temperature", "freedom", "pressure", "potential", "change"
    starts = [
        [one["label"]]
        + [f"{one[key]:.6g}" if key in one else "–" for key in keys]
        + [one["error"] or "ok"]
        for one in summary["integrators"]
    ]
    title = f"Kinds of bodies; the turn is in one step of {summary['dt']:g} {units.time}"
    return [
        Table.of(title, KINDS, rows),
        Table.of("What each integrator makes of the start", heads, starts),
    ]


def told(summary: dict) -> list[str]:
    """What is to be said of the last table, and of the suffix, in sentences."""
    uncounted = [one["label"] for one in summary["integrators"] if one["uncounted"]]
    return [*counted.left_out(uncounted), *summary["suffix"]]


def write(summary: dict, out: Path) -> None:
    """Write all files into a folder."""
    files = {"table": report.of_checks(summary["checks"])}
    values: dict = {"titles": TITLES, "shown": tables(summary), "told": told(summary)}
    report.write(summary, out, files, "check.html", **values)


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the tables, what does not hold and what to do."""
    first, last = (
        (one.title, one.columns, [[cell.text for cell in row] for row in one.rows])
        for one in tables(summary)
    )
    report.table(console, *first, (KINDS[0], "shape", "moments"))
    report.show_checks(console, summary["checks"], TITLES)
    report.table(console, *last, ("integrator", "status"))
    for line in told(summary):
        console.print(line, markup=False, soft_wrap=True)
    report.end(console, summary, out)
