"""Figures of a script's trial."""

from pathlib import Path

import numpy as np

from ..pages.figures import INK, MARKS, OURS, Drawn, draw_each, panels
from ..scenes.units import UNITS
from ..statistics.estimate import Estimate

MORE = ("#5b7db1", "s"), ("#c06c3e", "^"), ("#7a5195", "v"), ("#9db4d6", "D"), ("#bfa5cf", "P")


def draw(summary: dict, out: Path) -> list[tuple[Path, str]]:
    """All figures that there are numbers for: see `draw_each`."""
    return draw_each((errors, cost), out, summary)


def _styles(names):
    others = iter(MORE * 3)
    return {
        name: (OURS, "o") if name == "nosquish" else MARKS.get(name) or next(others)
        for name in names
    }


def errors(summary: dict) -> Drawn:
    """Each error against the step, with its target."""
    points = [one for one in summary["points"] if not one["failed"]]
    wanted = [name for name in summary["targets"] if any(name in one["errors"] for one in points)]
    if not wanted:
        return None
    time = UNITS[summary["units"]].time
    labels = {one["integrator"]: one["label"] for one in points}
    styles = _styles(labels)
    columns = min(2, len(wanted))
    figure, axes = panels(len(wanted), columns, 5.0, 2.8, 0.6)
    for axis, name in zip(axes, wanted):
        most = summary["targets"][name]
        axis.axhspan(-most, most, color="#e6f2ee", zorder=0)
        for number, (key, label) in enumerate(labels.items()):
            own = [one for one in points if one["integrator"] == key and name in one["signed"]]
            if not own:
                continue
            found = [Estimate.of(one["signed"][name]) for one in own]
            margins = [one.margin if np.isfinite(one.margin) else 0.0 for one in found]
            shift = 1 + 0.012 * (number - len(labels) / 2)
            colour, marker = styles[key]
            axis.errorbar(
                [one["dt"] * shift for one in own], [one.value for one in found], yerr=margins,
                color=colour, marker=marker, ms=5, lw=1, capsize=2, label=label,
            )  # fmt: skip
        axis.axhline(0, color=INK, lw=0.6)
        unit = summary["about"][name]["unit"]
        axis.set_title(f"{name}, {unit}".strip(", "), loc="left", fontsize=10, fontweight="bold")
        axis.set_xlabel(f"step ({time})")
    handles = axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=2, frameon=False, fontsize=8.5)
    return figure, (
        "Errors against the time step, with 95 % margins. The band is the target: a point is good "
        "for sure if it is inside with its margin."
    )


def cost(summary: dict) -> Drawn:
    """Cost against the step."""
    points = [one for one in summary["points"] if one["rough"]]
    if not points:
        return None
    labels = {one["integrator"]: one["label"] for one in points}
    styles = _styles(labels)
    figure, (axis,) = panels(1, 1, 7, 3.2, 0.2)
    for key, label in labels.items():
        own = [one for one in points if one["integrator"] == key]
        colour, marker = styles[key]
        rough = [one["rough"]["min"] for one in own]
        axis.plot([one["dt"] for one in own], rough, color=colour, lw=1, ls=":")
        timed = [one for one in own if one["cost"]]
        axis.plot(
            [one["dt"] for one in timed], [one["cost"]["min"] for one in timed],
            color=colour, marker=marker, ms=5, lw=1, label=label,
        )  # fmt: skip
    axis.set(xscale="log", yscale="log", xlabel=f"step ({UNITS[summary['units']].time})")
    axis.set_ylabel(f"s per {summary['ns']}")
    axis.legend(frameon=False, fontsize=8.5)
    return figure, (
        "Cost on this machine. Points: timed in turn, without samples, the least of some rounds. "
        "Dotted: the runs themselves, with samples, the least of their parts."
    )
