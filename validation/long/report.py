"""From the runs of ``long`` to files and the terminal."""

from pathlib import Path

from rich.console import Console

from ..pages import report
from ..pages.figures import draw_each
from ..pages.said import Cell, Figure, Said, Table
from ..statistics.estimate import Estimate
from .figures import long_run
from .measure import BOUND, QUANTITIES


def write(summary: dict, series: dict, out: Path) -> None:
    """Write summary.json, table.csv and the figure into the folder ``out``."""
    rows = []
    for row in summary["runs"]:
        if drift := row.get("energy_drift"):
            known = Estimate.of(drift)
            row = row | {"energy_drift": known.value, "energy_drift_margin": known.margin}
        rows.append({k: f"{one:.3g}" if isinstance(one, float) else one for k, one in row.items()})
    report.write(summary, out, {"table": report.frame(rows)})
    for path, _ in draw_each((long_run,), out, summary, series):
        path.rename(path.with_name("long-run.png"))


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the table; ± is the half width of the 95 % interval."""
    cells = [
        [row["label"], f"{row['angle']:g}", f"{row['steps']:,}"]
        + [f"{row[key]:.1e}" for key in QUANTITIES]
        + [Estimate.of(row["energy_drift"]).text() if "energy_drift" in row else "–"]
        + [f"{row['us_per_step']:.1f}" if "us_per_step" in row else "–"]
        for row in summary["runs"]
        if "steps" in row
    ]
    heads = ["integrator", "turn a step, rad", "steps", *QUANTITIES.values()]
    heads += ["drift of energy in the run", "µs/step"]
    report.table(console, f"Largest relative error of a free body (bound {BOUND:g})", heads, cells)
    failures = [f"{row['label']}: {row['error']}" for row in summary["runs"] if row["error"]]
    report.end(console, summary, out, failures, "long-run.png")


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    lines, rows, limit = [], [], summary["bound"]
    kept: dict[bool, list[str]] = {True: [], False: []}
    for row in summary["runs"]:
        if "steps" in row:
            told = ", ".join(f"{what} {row[key]:.1e}" for key, what in QUANTITIES.items())
            where = f"{row['label']}, {row['angle']:g} rad a step, {row['steps']:,} steps"
            lines.append(f"{where}: {told}.")
            if row["step"] == "short":
                kept[all(row[key] <= limit for key in QUANTITIES)].append(row["label"])
        numbers = (Cell.number(row.get(key), ".3g") for key in ("steps", *QUANTITIES))
        angle = Cell.number(row["angle"])
        rows.append([row["label"], angle, *numbers, row["error"] or "ok"])
    told = f"with {', '.join(kept[True]) or 'none'}; not with {', '.join(kept[False]) or 'none'}."
    what = f"A free body keeps energy, both momenta and its shape to {limit:g} at the short step"
    head = "integrator", "rad a step", "steps", *QUANTITIES.values(), "status"
    return Said(
        lines=[f"{what} {told}", *lines],
        tables=[Table.of("Largest relative error", head, rows)],
        figures=[Figure("long-run.png", "Largest relative error against steps.")],
    )
