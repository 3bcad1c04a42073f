"""From the runs of ``long`` to files and the terminal."""

from pathlib import Path

import numpy as np
import pandas as pd
from rich.box import SIMPLE_HEAD
from rich.table import Table

from validation.long.figures import draw
from validation.long.measure import BOUND, QUANTITIES
from validation.pages.page import save
from validation.running import machine
from validation.statistics.estimate import Estimate


def write(rows, series, out) -> Path:
    """Write summary.json, table.csv and the figure into the folder ``out``; the figure's path."""
    save(machine.circumstances() | {"bound": BOUND, "runs": rows}, out)
    flat = [dict(row) for row in rows]
    for row in flat:
        if "energy_drift" in row:
            drift = Estimate.of(row["energy_drift"])
            row |= {"energy_drift": drift.value, "energy_drift_margin": drift.margin}
    pd.DataFrame(flat).to_csv(Path(out) / "table.csv", index=False, float_format="%.3g")
    return draw(rows, series, out)


def show(console, rows):
    """Print the table; ± is the half width of the 95 % interval."""
    table = Table(
        title=f"Largest relative error of a free body (bound {BOUND:g})",
        title_justify="left",
        box=SIMPLE_HEAD,
    )
    for column in (
        "integrator",
        "turn a step, rad",
        "steps",
        *QUANTITIES.values(),
        "drift of energy in the run",
        "µs/step",
    ):
        table.add_column(column, justify="left" if column == "integrator" else "right")
    for row in rows:
        if "steps" in row:
            table.add_row(
                row["label"], f"{row['angle']:g}", f"{row['steps']:,}", *(f"{row[key]:.1e}" for key in QUANTITIES),
                f"{row['energy_drift']['value']:.1e} ± {Estimate.of(row['energy_drift']).margin:.0e}" if "energy_drift" in row else "–", f"{row.get('us_per_step', np.nan):.1f}",
            )  # fmt: skip
        if row["error"]:
            console.print(f"✗ {row['label']}: {row['error']}", markup=False)
    console.print(table)
