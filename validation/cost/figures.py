"""Figures of `cost`, from its summary."""

from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from ..pages import ranks_of
from ..pages.figures import (
    FAMILIES,
    INK,
    PALE,
    label_ends,
    message,
    panels,
    whiskers,
)
from ..scenes.integrators import OURS
from .criteria import place

FIXES = {OURS: "ours", "rigid/nve": "rigid/nve", "rigid/nve/small": "rigid/nve/small"}
FIXES |= {"shake": "shake"}  # name of an integrator: its family
MEASURES = {"modify_ratio": "time in the fix", "loop_ratio": "whole step"}


def size(summary: dict) -> Figure | None:
    """Modify per 1,000 molecules of water against their number, a panel by number of ranks."""
    points = [point for point in summary.get("points", []) if point["scene"] == "water"]
    sizes = sorted({point["bodies"] for point in points})
    ranks = sorted({point["ranks"] for point in points})
    if len(sizes) < 2:
        return None
    figure, axes = panels(len(ranks), len(ranks), 5, 3.6, 0.4, sharex=True, sharey=True)
    for axis in axes:
        axis.set(xscale="log", yscale="log", xlabel="molecules")
        axis.grid(axis="y", color=PALE, lw=0.4)
    ends = [
        (axis, _sizes(axis, [point for point in points if point["ranks"] == number]))
        for axis, number in zip(axes, ranks)
    ]
    for axis, number in zip(axes, ranks):
        axis.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.yaxis.set_major_formatter("{x:g}")
        axis.set_xticks(sizes, [f"{n:,}" for n in sizes])
        axis.minorticks_off()
        axis.set_title(ranks_of(number), loc="left", fontsize=10)
    axes[0].set_ylabel("µs per step and 1,000 molecules")
    message(figure, "Water: time in the fix per 1,000 molecules")
    for axis, some in ends:
        label_ends(axis, some)
    return figure


def _sizes(axis, points):
    """Lines of points on one number of ranks, in order of size; where they end."""
    ends = []
    for name, family in FIXES.items():
        colour, marker = FAMILIES[family]
        rows = [
            (point["bodies"], row)
            for point in points
            for row in point["integrators"]
            if row["name"] == name and row.get("modify_per_1000")
        ]
        if rows:
            median, reach = whiskers([row["modify_per_1000"] for _, row in rows])
            bodies = [number for number, _ in rows]
            axis.errorbar(bodies, median, yerr=reach, color=colour, marker=marker, ms=5, capsize=2)
            ends.append((bodies[-1], median[-1], family, colour))
    known = [point for point in points if "bound" in point]
    if known:
        bodies = [point["bodies"] for point in known]
        bound = [point["bound"] / point["bodies"] * 1000 for point in known]
        axis.plot(bodies, bound, color=INK, ls=":", lw=1)
        ends.append((bodies[-1], bound[-1], "the memory allows", INK))
    return ends


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
            for (family, ratio), shift in zip(_ratios(point, key).items(), (-0.2, 0, 0.2)):
                colour, marker = FAMILIES[family]
                style = {"color": colour, "marker": marker, "ms": 5, "capsize": 2}
                median, reach = whiskers([ratio])
                label = family if family not in axis.get_legend_handles_labels()[1] else None
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
    """{family of a rival: ours over it}."""
    found = {row["name"]: row.get(key) for row in point["integrators"]}
    return {family: found[name] for name, family in FIXES.items() if found.get(name)}


def scaling(summary: dict) -> Figure | None:
    """Bytes per rank and step, and the model's time, against the number of ranks, for bricks."""
    counts = [row for row in summary.get("counts", []) if not row["error"]]
    if not counts:
        return None
    link = summary["links"][0]["name"]
    model = [row for row in summary["model"] if row["link"] == link]
    figure, axes = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
    what = (
        (counts, "bytes per rank and step", lambda row: row["bytes"] + row["collective_bytes"]),
        (model, "µs per step, by the model", lambda row: 1e6 * row["seconds"]),
    )
    ends = []
    for axis, (rows, title, value) in zip(axes, what):
        ends.append(_bricks(axis, rows, value))
        axis.set(xscale="log", yscale="log", xlabel="ranks", title=title)
        axis.grid(axis="y", color=PALE, lw=0.4)
    message(figure, "What ranks send each other, 1,000 molecules per rank, cut into bricks")
    for axis, some in zip(axes, ends):
        label_ends(axis, some)
    return figure


def _bricks(axis, rows, value):
    """Lines of the fixes; where they end."""
    ends = []
    for name, family in FIXES.items():
        some = [
            (row["ranks"], value(row))
            for row in rows
            if row["decomposition"] == "brick" and row["integrator"] == name and value(row) > 0
        ]
        if some:
            colour, marker = FAMILIES[family]
            axis.plot(*zip(*some), color=colour, marker=marker, ms=5)
            ends.append((*some[-1], family, colour))
    return ends
