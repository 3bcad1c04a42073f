"""Figures of a comparison: error against run time, and errors against the step."""

from collections.abc import Iterable, Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETDOWNBASE
from matplotlib.ticker import LogLocator, NullFormatter

from ..pages.figures import INK, MARKS, MISSED, OURS, PALE, PURPLE, RED, SKY, message
from ..scenes import integrators
from ..scenes.units import UNITS
from ..statistics.estimate import SURE, Estimate
from .choice import Measured, bound, is_zero

MAIN = "energy_sd", "energy", "drift"  # the first available one
# drawn if there are many: variants of a scheme lie on its line
SHOWN = (integrators.OURS, "rigid/nve", "rigid", "shake-1e-8", "gear")
MORE = (PURPLE, "P"), (SKY, "X"), (RED, "v"), (INK, "D")
READ = (
    f"Further left and further down is better. Vertical bars: {SURE} interval of the error. "
    "Horizontal bars: CPU time, from the shortest repetition to the median. A pale point with an "
    "arrow is an upper bound, where the error is not significantly different from zero. Numbers "
    "are our time steps. The upper part names the lines, and shows which steps run; a cross is a "
    "step that fails."
)


def _drawn(summary: Mapping) -> list[Measured]:
    """The points to draw, from the shortest step."""
    points = [point for point in summary["points"] if point["asked"]]
    selected = [point for point in points if point["integrator"] in SHOWN]
    few = len({point["integrator"] for point in points}) <= len(SHOWN)
    return sorted(points if few or not selected else selected, key=lambda point: point["dt"])


def _styles(points: Iterable[Measured]) -> dict[str, dict]:
    """Matplotlib keywords for each integrator, by name."""
    spare, styles = iter(MORE * 9), {}
    for point in points:
        name = point["integrator"]
        if name not in styles:
            known = (OURS, "o") if point["ours"] else MARKS.get(name.partition("-")[0])
            colour, marker = known or next(spare)
            wide = 2.2 if point["ours"] else 1.2
            styles[name] = {"color": colour, "marker": marker, "lw": wide, "ms": 5}
    return styles


def _by_integrator(points: Sequence[Measured]) -> dict[str, list[Measured]]:
    rows: dict[str, list[Measured]] = {}
    for point in points:
        rows.setdefault(point["integrator"], []).append(point)
    return rows


def cost(summary: Mapping) -> Figure | None:
    """Draw the main error against run time, a line for each integrator through its steps, and above
    it which steps run."""
    points = _drawn(summary)
    good = [point for point in points if not point["failed"] and point["cpu"]]
    main = next((name for name in MAIN if any(name in point["errors"] for point in good)), None)
    if main is None:
        return None
    rows, looks = _by_integrator(points), _styles(points)
    heights = [0.5 + 0.17 * len(rows), 5.0]
    figure, (top, axis) = plt.subplots(
        2, 1, figsize=(9.0, sum(heights)), layout="constrained", height_ratios=heights
    )
    for place, (name, row) in enumerate(rows.items()):
        runs = [point["dt"] for point in row if not point["failed"]]
        fails = [point["dt"] for point in row if point["failed"]][:1]
        top.plot(runs, [place] * len(runs), "|-", color=looks[name]["color"], ms=4, lw=1)
        top.plot(fails, [place] * len(fails), "x", color=MISSED, ms=5)
    steps = sorted({point["dt"] for point in points})
    top.set(xscale="log", ylim=(len(rows) - 0.5, -0.5))
    top.set_xticks(steps, [f"{dt:g}" for dt in steps], fontsize=8)
    top.minorticks_off()
    top.set_yticks(range(len(rows)), [row[0]["label"] for row in rows.values()], fontsize=9)
    for label, name in zip(top.get_yticklabels(), rows):
        label.set_color(looks[name]["color"])
    unit = UNITS[summary["units"]].time
    top.set_title(f"time steps ({unit}); a cross: fails", loc="left", fontsize=9, pad=3)
    known = [point for point in good if main in point["errors"]]
    for name, row in _by_integrator(known).items():
        _line(axis, row, main, looks[name])
    about = summary["about"][main]
    axis.set(xscale="log", yscale="log", xlabel=f"CPU time (s per {summary['ns']})")
    axis.set_ylabel(f"{about['what'].partition(';')[0]}\n({about['unit']})", fontsize=9)
    axis.grid(color=PALE, lw=0.4)
    axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())
    message(figure, "Error against CPU time: left and down is better")
    return figure


def _line(axis: Axes, row: Sequence[Measured], measure: str, look: dict) -> None:
    """Draw one integrator's points; join those that differ significantly from zero; ours with
    steps."""
    spent = [point["cpu"] for point in row if point["cpu"]]
    least, x = np.array([(time["min"], time["median"]) for time in spent]).T
    zero = np.array([is_zero(point, measure) for point in row])
    estimates = [Estimate.of(point["errors"][measure]) for point in row]
    y = np.where(
        zero,
        [bound(point, measure) for point in row],
        np.array([estimate.value for estimate in estimates]),
    )
    margin = np.where(zero, 0.0, [estimate.margin for estimate in estimates])
    axis.plot(x, np.where(zero, np.nan, y), color=look["color"], lw=look["lw"])
    for those, alpha in (zero, 0.5), (~zero, 1.0):
        bars: dict = {
            "yerr": [np.minimum(margin, 0.9 * y)[those], margin[those]],
            "xerr": [(x - least)[those], np.zeros(those.sum())],
        }
        style = look | {"ls": "none", "alpha": alpha, "capsize": 1.5, "elinewidth": 0.8}
        axis.errorbar(x[those], y[those], **bars, **style)
    axis.plot(
        x[zero], y[zero], color=look["color"], marker=CARETDOWNBASE, ms=5, ls="none", alpha=0.7
    )
    if row[0]["ours"]:
        beside: dict = {"textcoords": "offset points", "xytext": (-5, -5), "fontsize": 8.5}
        for point, place in zip(row, zip(x, y)):
            axis.annotate(f"{point['dt']:g}", place, color=OURS, ha="right", va="top", **beside)
