"""Matplotlib figures from a benchmark's summary."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter

from ..pages.figures import (
    INK,
    MARKS,
    MISSED,
    OTHERS,
    OURS,
    PALE,
    Drawn,
    bars,
    draw_each,
    panels,
    whiskers,
)
from ..pages.tables import ranks_of
from .goals import place


def draw(summary: dict, out: Path) -> list[tuple[Path, str]]:
    """All figures that there are numbers for: see `figures.draw_each`."""
    return draw_each((size, goals, scenes, passes), out, summary)


def _text(value):
    """Three digits, never as 1e+03."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def size(summary: dict) -> Drawn:
    """Modify per 1,000 molecules against their number, a panel for each number of ranks."""
    points = [point for point in summary["points"] if point["scene"] == "water"]
    sizes = sorted({point["bodies"] for point in points})
    ranks = sorted({point["ranks"] for point in points})
    if len(sizes) < 2:
        return None
    figure, axes = panels(len(ranks), len(ranks), 5, 5, 0, sharex=True, sharey=True)
    for axis, number in zip(axes, ranks):
        _sizes(axis, [point for point in points if point["ranks"] == number])
        axis.set(xscale="log", yscale="log", xlabel="molecules")
        axis.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.yaxis.set_major_formatter("{x:g}")
        axis.grid(axis="y", color=PALE, lw=0.4)
        axis.set_xticks(sizes, [f"{n:,}" for n in sizes])
        axis.minorticks_off()
        axis.set_title(ranks_of(number), loc="left", fontsize=10, fontweight="bold")
    axes[0].set_ylabel("time in Modify (µs per step and 1,000 molecules)")
    shown = axes[-1].get_legend_handles_labels()
    figure.legend(*shown, loc="outside right upper", frameon=False, fontsize=8.5)
    return figure, (
        "TIP3P water: time in the fixes per 1,000 molecules, medians, whiskers from minimum to "
        "maximum. The dotted line is the time in which the memory moves what must move."
    )


def _sizes(axis, points):
    """Points on one number of ranks, in order of size."""
    every = [(point["bodies"], row) for point in points for row in point["integrators"]]
    for name, (colour, marker) in MARKS.items():
        rows = [(n, row) for n, row in every if row["name"] == name and row.get("modify_per_1000")]
        if rows:
            median, reach = whiskers([row["modify_per_1000"] for _, row in rows])
            wide = {"lw": 2.2, "ms": 7, "zorder": 3} if name == "nosquish" else {"lw": 1.2, "ms": 5}
            style = wide | {"color": colour, "marker": marker, "capsize": 2}
            bodies, label = [n for n, _ in rows], rows[0][1]["label"]
            axis.errorbar(bodies, median, yerr=reach, label=label, **style)
    known = [point for point in points if "bound" in point]
    bodies = [point["bodies"] for point in known]
    bound = [point["bound"] / point["bodies"] * 1000 for point in known]
    if known:
        axis.plot(
            bodies, bound, color=INK, ls=":", marker="_", lw=1, label="what the memory allows"
        )


def goals(summary: dict) -> Drawn:
    """Measured ratios beside their goals."""
    rows = [goal for goal in summary["goals"] if goal["measured"]]
    if not rows:
        return None
    figure, axis = plt.subplots(figsize=(9.5, 1.0 + 0.27 * len(rows)), layout="constrained")
    axis.axvline(1, color=INK, lw=1)
    ends = "median", "min", "max"
    shares = [[goal["measured"][key] / goal["limit"] for key in ends] for goal in rows]
    beside: dict = {"xycoords": ("axes fraction", "data"), "va": "center", "fontsize": 8}
    for height, (goal, (median, low, high)) in enumerate(zip(rows, shares)):
        colour = OURS if goal["met"] else MISSED
        axis.plot([low, high], [height, height], color=colour, lw=1.2)
        axis.plot(median, height, "o", color=colour, ms=6)
        text = f"{_text(goal['measured']['median'])} (at most {goal['limit']:g})"
        axis.annotate(text, (1.02, height), color=colour, **beside)
    words = [f"{goal['where']}: {goal['what']}" for goal in rows]
    axis.set_yticks(range(len(rows)), words, fontsize=8)
    axis.tick_params(axis="y", length=0)
    axis.set(xscale="log", ylim=(len(rows) - 0.4, -0.6))
    axis.set_xlim(min(0.8, np.min(shares) * 0.9), max(1.25, np.max(shares) * 1.1))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xlabel("measured over the goal's limit: left of 1 it is met")
    return figure, (
        "Each goal that was measured: the median, a line from minimum to maximum, the number "
        "itself and the goal."
    )


def scenes(summary: dict) -> Drawn:
    """Modify of each scene and integrator, a panel for each."""
    rows = {
        place(point): [row for row in point["integrators"] if row.get("modify")]
        for point in summary["points"]
    }
    rows = {title: some for title, some in rows.items() if some}
    if not rows:
        return None
    figure, axes = panels(len(rows), 2, 5.4, 2.5, 0.3)
    for axis, (title, some) in zip(axes, rows.items()):
        texts = [
            _text(row["modify"]["median"])
            + (f"  ({row['modify_ratio']['median']:.2f})" if row.get("modify_ratio") else "")
            for row in some
        ]
        colours = [OURS if row["kind"] == "ours" else OTHERS for row in some]
        bars(axis, [row["label"] for row in some], [row["modify"] for row in some], texts, colours)
        axis.set_title(title, loc="left", fontsize=9.5, fontweight="bold")
    figure.supxlabel("time in LAMMPS's Modify (µs per step)", fontsize=10)
    return figure, (
        "Time in the fixes of each scene: medians, whiskers from minimum to maximum; in brackets "
        "ours over it."
    )


def passes(summary: dict) -> Drawn:
    """Cost of the optional passes."""
    rows = [row for row in summary["passes"] if row.get("cost")]
    if not rows:
        return None
    figure, axis = plt.subplots(figsize=(8.5, 0.9 + 0.4 * len(rows)), layout="constrained")
    texts = [f"{_text(row['cost']['median'])}  (of {_text(row['with']['median'])})" for row in rows]
    bars(axis, [row["name"] for row in rows], [row["cost"] for row in rows], texts, OURS)
    axis.axvline(0, color=INK, lw=0.8)
    axis.set_xlabel("Modify with the pass less that without (µs per step)")
    return figure, (
        "What each optional pass costs where something needs it, in brackets of how much in all; "
        "where nothing does, it is left out."
    )
