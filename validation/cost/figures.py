"""The figure of `cost`, from its summary."""

from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from ..pages.figures import INK, MARKS, PALE, message, whiskers
from ..scenes.integrators import OURS
from .criteria import place

FIXES = OURS, "rigid/nve", "rigid/nve/small", "shake"
MEASURES = {"modify_ratio": "time in the fix", "loop_ratio": "whole step"}


def scenes(summary: dict) -> Figure | None:
    """Times of ours over those of LAMMPS's fixes, a line by scene, size and number of ranks."""
    points = [point for point in summary.get("points", []) if _ratios(point, "modify_ratio")]
    if not points:
        return None
    size = 9.5, 1.3 + 0.3 * len(points)
    figure, axes = plt.subplots(1, 2, figsize=size, layout="constrained", sharey=True)
    for axis, (key, title) in zip(axes, MEASURES.items()):
        axis.axvline(1, color=INK, lw=0.8)
        for height, point in enumerate(points):
            for (name, ratio), shift in zip(_ratios(point, key).items(), (-0.2, 0, 0.2)):
                colour, marker = MARKS[name]
                style = {"color": colour, "marker": marker, "ms": 5, "capsize": 2}
                median, reach = whiskers([ratio])
                label = name if name not in axis.get_legend_handles_labels()[1] else None
                axis.errorbar(median, height + shift, xerr=reach, label=label, ls="", **style)
        axis.set(xscale="log", xlabel=f"{title}: ours over this fix's")
        axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.grid(axis="x", color=PALE, lw=0.4)
    axes[0].set_yticks(range(len(points)), [place(point) for point in points])
    axes[0].invert_yaxis()
    axes[0].legend(frameon=False, fontsize=8.5, loc="lower left")
    message(figure, "Ours over LAMMPS's fixes: left of 1 ours is faster")
    return figure


def _ratios(point, key):
    """{rival: ours over it}."""
    found = {row["name"]: row.get(key) for row in point["integrators"]}
    return {name: found[name] for name in FIXES if found.get(name)}
