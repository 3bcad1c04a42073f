"""Matplotlib figures from a benchmark's summary."""

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from validation.figures import INK, OTHERS, OURS, PALE, THIRD, draw_each  # noqa: E402
from validation.goals import ranks_of  # noqa: E402

MARKS = {  # integrator: colour, marker; pale ones are variants of the one before
    "nosquish": (OURS, "o"),
    "rigid/nve": (OTHERS, "s"),
    "rigid": ("#9db4d6", "s"),
    "rigid/nve/omp": ("#2f4b7c", "s"),
    "rigid/omp": ("#b9c6de", "D"),
    "rigid/nve/small": (THIRD, "^"),
    "rigid/small": ("#e0b08f", "^"),
    "rigid/small/omp": ("#8c4a25", "^"),
    "shake": ("#7a5195", "v"),
    "rattle": ("#bfa5cf", "v"),
}
MISSED = "#b00000"


def _text(value):
    """Three digits, never as 1e+03."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def draw(summary, out):
    """All figures that there are numbers for: see `figures.draw_each`."""
    return draw_each((size, goals, scenes, passes), out, summary)


def size(summary):
    """Modify per 1,000 molecules of water against their number, a panel for each number of ranks."""
    points = [point for point in summary["points"] if point["scene"] == "water"]
    ranks = sorted({point["ranks"] for point in points})
    if len({point["bodies"] for point in points}) < 2:
        return None, ""
    figure, axes = plt.subplots(
        1,
        len(ranks),
        figsize=(1.2 + 4.6 * len(ranks), 5),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    for axis, number in zip(axes[0], ranks):
        here = sorted(
            (point for point in points if point["ranks"] == number),
            key=lambda point: point["bodies"],
        )
        for name, (colour, marker) in MARKS.items():
            rows = [
                (point["bodies"], row)
                for point in here
                for row in point["integrators"]
                if row["name"] == name and row.get("modify_per_1000")
            ]
            if not rows:
                continue
            bodies = [bodies for bodies, _ in rows]
            median, low, high = (
                np.array([row["modify_per_1000"][key] for _, row in rows])
                for key in ("median", "min", "max")
            )
            style = dict(lw=2.2, ms=7, zorder=3) if name == "nosquish" else dict(lw=1.2, ms=5)
            axis.errorbar(
                bodies,
                median,
                yerr=[median - low, high - median],
                color=colour,
                marker=marker,
                capsize=2,
                label=rows[0][1]["label"],
                **style,
            )
        bound = [
            (point["bodies"], point["bound"] / point["bodies"] * 1000)
            for point in here
            if "bound" in point
        ]
        if bound:
            axis.plot(
                *zip(*bound), color=INK, ls=":", marker="_", lw=1, label="what the memory allows"
            )
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.yaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
        axis.yaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda y, _: f"{y:g}"))
        axis.grid(axis="y", color=PALE, lw=0.4)
        axis.set_xticks(
            sorted({point["bodies"] for point in points}),
            [f"{n:,}" for n in sorted({point["bodies"] for point in points})],
        )
        axis.minorticks_off()
        axis.set_title(ranks_of(number), loc="left", fontsize=10, fontweight="bold")
        axis.set_xlabel("molecules")
    axes[0, 0].set_ylabel("time in Modify (µs per step and 1,000 molecules)")
    figure.legend(
        *axes[0, -1].get_legend_handles_labels(),
        loc="outside right upper",
        frameon=False,
        fontsize=8.5,
    )
    return figure, (
        "TIP3P water: time in the fixes per 1,000 molecules, medians, whiskers from minimum to maximum. The dotted line is the time in which "
        "the memory moves what must move."
    )


def goals(summary):
    """Measured ratios beside their goals."""
    rows = [goal for goal in summary["goals"] if goal["measured"]]
    if not rows:
        return None, ""
    figure, axis = plt.subplots(figsize=(9.5, 1.0 + 0.27 * len(rows)), layout="constrained")
    places = np.arange(len(rows))
    share = np.array(
        [
            [goal["measured"][key] / goal["limit"] for key in ("median", "min", "max")]
            for goal in rows
        ]
    )
    axis.axvline(1, color=INK, lw=1)
    for place, goal, (median, low, high) in zip(places, rows, share):
        colour = OURS if goal["met"] else MISSED
        axis.plot([low, high], [place, place], color=colour, lw=1.2)
        axis.plot(median, place, "o", color=colour, ms=6)
        text = f"{_text(goal['measured']['median'])} (at most {goal['limit']:g})"
        axis.annotate(
            text,
            (1.02, place),
            xycoords=("axes fraction", "data"),
            va="center",
            fontsize=8,
            color=colour,
        )
    axis.set_yticks(places, [f"{goal['where']}: {goal['what']}" for goal in rows], fontsize=8)
    axis.tick_params(axis="y", length=0)
    axis.set_xscale("log")
    axis.set_xlim(min(0.8, share.min() * 0.9), max(1.25, share.max() * 1.1))
    axis.set_ylim(len(rows) - 0.4, -0.6)
    axis.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda x, _: f"{x:g}"))
    axis.xaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    axis.set_xlabel("measured over the goal's limit: left of 1 it is met")
    return (
        figure,
        "Each goal that was measured: the median, a line from minimum to maximum, the number itself and the goal.",
    )


def scenes(summary):
    """Modify of each scene and integrator, a panel for each."""
    points = [
        point
        for point in summary["points"]
        if any(row.get("modify") for row in point["integrators"])
    ]
    if not points:
        return None, ""
    columns = min(2, len(points))
    lines = -(-len(points) // columns)
    figure, axes = plt.subplots(
        lines,
        columns,
        figsize=(5.4 * columns, 0.3 + 2.5 * lines),
        squeeze=False,
        layout="constrained",
    )
    for axis in axes.flat[len(points) :]:
        axis.set_visible(False)
    for axis, point in zip(axes.flat, points):
        rows = [row for row in point["integrators"] if row.get("modify")]
        places = np.arange(len(rows))
        median, low, high = (
            np.array([row["modify"][key] for row in rows]) for key in ("median", "min", "max")
        )
        axis.barh(
            places,
            median,
            color=[OURS if row["kind"] == "ours" else OTHERS for row in rows],
            height=0.66,
        )
        axis.errorbar(
            median,
            places,
            xerr=[median - low, high - median],
            fmt="none",
            ecolor=INK,
            capsize=2,
            lw=1,
        )
        for place, row, top in zip(places, rows, high):
            ratio = row.get("modify_ratio")
            text = _text(row["modify"]["median"]) + (f"  ({ratio['median']:.2f})" if ratio else "")
            axis.annotate(
                text, (top, place), (5, 0), textcoords="offset points", va="center", fontsize=8
            )
        axis.set_yticks(places, [row["label"] for row in rows], fontsize=8)
        axis.tick_params(axis="y", length=0)
        axis.invert_yaxis()
        axis.set_xlim(0, high.max() * 1.35)
        axis.set_title(
            f"{point['scene']} {point['bodies']:,}, {ranks_of(point['ranks'])}",
            loc="left",
            fontsize=9.5,
            fontweight="bold",
        )
    figure.supxlabel("time in LAMMPS's Modify (µs per step)", fontsize=10)
    return (
        figure,
        "Time in the fixes of each scene: medians, whiskers from minimum to maximum; in brackets ours over it.",
    )


def passes(summary):
    """Cost of the optional passes."""
    rows = [row for row in summary["passes"] if row.get("cost")]
    if not rows:
        return None, ""
    figure, axis = plt.subplots(figsize=(8.5, 0.9 + 0.4 * len(rows)), layout="constrained")
    places = np.arange(len(rows))
    median, low, high = (
        np.array([row["cost"][key] for row in rows]) for key in ("median", "min", "max")
    )
    axis.barh(places, median, color=OURS, height=0.6)
    axis.errorbar(
        median, places, xerr=[median - low, high - median], fmt="none", ecolor=INK, capsize=3, lw=1
    )
    for place, row, top in zip(places, rows, high):
        text = f"{_text(row['cost']['median'])}  (of {_text(row['with']['median'])})"
        axis.annotate(
            text, (max(top, 0), place), (6, 0), textcoords="offset points", va="center", fontsize=9
        )
    axis.axvline(0, color=INK, lw=0.8)
    axis.set_yticks(places, [row["name"] for row in rows])
    axis.tick_params(axis="y", length=0)
    axis.invert_yaxis()
    axis.set_xlim(min(0, low.min() * 1.1), max(high.max(), 1e-3) * 1.3)
    axis.set_xlabel("Modify with the pass less that without (µs per step)")
    return (
        figure,
        "What each optional pass costs where something needs it, in brackets of how much in all; where nothing does, it is left out.",
    )
