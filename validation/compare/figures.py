"""Figures of a comparison."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from ..pages.figures import OTHERS, OURS, PALE, Drawn, bars, draw_each, panels
from ..scenes.units import UNITS
from ..statistics.estimate import SURE, Estimate, rounded
from .measure import conserved


def draw(summary: dict, series: dict, out: Path) -> list[tuple[Path, str]]:
    """All figures of a comparison that there are numbers for: see `draw_each`."""
    return draw_each((energy, cost), out, summary, series)


def _colour(row):
    return OURS if row["name"] == "nosquish" else OTHERS


def energy(summary: dict, series: dict) -> Drawn:
    """Total energy minus its start against time, one panel for each integrator."""
    rows = [row for row in summary["integrators"] if row["name"] in series]
    if not rows:
        return None
    settings = summary["settings"]
    begin = settings["discarded_fraction"] * settings["steps"]
    units = UNITS[settings.get("units", "real")]
    curves = [_curve(series[row["name"]], begin, units.many) for row in rows]
    reach = [np.abs(error).max() for _, error, _ in curves if len(error)]
    limit = 1.15 * min(max(reach), 2.5 * np.median(reach)) if reach else 1.0
    columns = min(2, len(rows))
    figure, axes = panels(len(rows), 2, 10 / columns, 1.45, 1.0, sharex=True, sharey=True)
    for axis, row, curve in zip(axes, rows, curves):
        _panel(axis, row, curve, limit, units)
    axes[0].set_ylim(-limit, limit)
    figure.supxlabel(f"time ({units.long})", fontsize=10)
    figure.supylabel(f"energy that is kept − its start ({units.energy})", fontsize=10)
    return figure, (
        f"Change of the total energy, {settings['dt_fs']:g} {units.time} steps, all panels on the "
        "same scale; zero is the mean of the first ten samples kept. The pale start is left out of "
        f"all averages. ± is the half width of the {SURE} interval."
    )


def _curve(table, begin, many):
    """Time, change of energy, and which samples are kept."""
    energy = conserved(table)
    finite = np.isfinite(energy)
    time, total = table["Time"][finite] / many, energy[finite]
    used = table["Step"][finite] >= begin
    return time, total - (total[used][:10].mean() if used.any() else total[:1].sum()), used


def _panel(axis, row, curve, limit, units):
    time, error, used = curve
    axis.axhline(0, color=PALE, lw=1, zorder=0)
    axis.plot(time[~used], error[~used], color=PALE, lw=1)
    axis.plot(time[used], error[used], color=_colour(row), lw=0.9)
    axis.set_title(row["label"], loc="left", fontsize=10, fontweight="bold", pad=3)
    if row.get("energy_sd"):
        sd, slope = Estimate.of(row["energy_sd"]), Estimate.of(row["drift"])
        note = f"sd {sd.value:.3g}, drift {rounded(slope.value, slope.margin)} per {units.long}"
        axis.set_title(note, loc="right", fontsize=8.5, pad=3)
    notes = ["not completed"] * bool(row["error"])
    notes += ["leaves the frame"] * bool(len(error) and np.abs(error).max() > limit)
    axis.text(0.99, 0.05, ", ".join(notes), transform=axis.transAxes, ha="right", color="#b00")


def cost(summary: dict, series: dict) -> Drawn:
    """Time in Modify: median, minimum and maximum of the timed segments."""
    rows = [row for row in summary["integrators"] if row.get("modify")]
    if not rows:
        return None
    rows.sort(key=lambda row: row["modify"]["median"])
    figure, axis = plt.subplots(figsize=(8.5, 0.9 + 0.45 * len(rows)), layout="constrained")
    texts = [
        f"{row['modify']['median']:.0f}"
        + (f"  ({row['modify_ratio']['median']:.2f}×)" if row.get("modify_ratio") else "")
        for row in rows
    ]
    labels, spreads = [row["label"] for row in rows], [row["modify"] for row in rows]
    bars(axis, labels, spreads, texts, [_colour(row) for row in rows])
    axis.set_xlabel("time in LAMMPS's Modify (µs per step)")
    settings = summary["settings"]
    return figure, (
        f"Time in the fixes on {settings['ranks']} rank(s): median of {settings['timing_rounds']} "
        "interleaved segments, whiskers from minimum to maximum; in brackets the ratio to "
        f"{settings['reference']}."
    )
