"""What all figures share: one style, colours that the colour-blind can tell, labels at the lines.

A figure shows at most five lines that matter, has its message as its title (`message`), and labels
its lines where they end (`label_ends`) instead of in a legend.
"""

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..statistics.measures import Spread

OURS, OTHERS, THIRD, INK, PALE = "#0b6e4f", "#5b7db1", "#c06c3e", "#333333", "#bdbdbd"
STYLE: dict = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "savefig.dpi": 150,
    "savefig.bbox": "tight",
}

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
# Okabe and Ito's colours (jfly.uni-koeln.de/color), by what is drawn; each has a marker, too
BLUE, ORANGE, GREEN, RED, PURPLE, SKY = (
    *("#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9"),
)
FAMILIES = {  # of schemes: colour and marker
    "ours": (BLUE, "o"),
    "rigid/nve": (ORANGE, "s"),
    "rigid/nve/small": (GREEN, "^"),
    "shake": (RED, "v"),
    "other": (PURPLE, "D"),
}
LINE = 9.0  # points that a label needs in height


def message(figure: Figure, text: str) -> None:
    """What a figure says, as its title, from the left edge."""
    figure.suptitle(text, x=0.01, ha="left", fontsize=12, fontweight="bold")


def label_ends(axis: Axes, ends: Sequence[tuple[float, float, str, str]]) -> None:
    """Labels right of an axis for lines that end at these places, apart from each other.

    Args:
        ends: of each line (x, y, text, colour); call it when limits and scales are set.
    """
    figure = axis.figure
    assert isinstance(figure, Figure)
    figure.draw_without_rendering()
    step = LINE * figure.dpi / 72 * 1.25
    left, bottom = axis.transAxes.transform((0, 0))
    right, top = axis.transAxes.transform((1, 1))
    at = [(axis.transData.transform((x, y)), text, colour) for x, y, text, colour in ends]
    at.sort(key=lambda one: one[0][1])
    places = [place[1] for place, *_ in at]
    for index in range(1, len(places)):
        places[index] = max(places[index], places[index - 1] + step)
    over = max(0.0, places[-1] - top + step / 2) if places else 0.0
    for (place, text, colour), y in zip(at, places):
        share = (y - over - bottom) / (top - bottom)
        end = ((place[0] - left) / (right - left), (place[1] - bottom) / (top - bottom))
        arrow = {"arrowstyle": "-", "color": colour, "lw": 0.6, "shrinkA": 0, "shrinkB": 3}
        axis.annotate(
            *(text, end, (1.03, share)),
            xycoords="axes fraction", textcoords="axes fraction", arrowprops=arrow,
            color=colour, fontsize=LINE, va="center", annotation_clip=False,
        )  # fmt: skip


def whiskers(spreads: Sequence[Spread]) -> tuple[np.ndarray, np.ndarray]:
    """Medians of spreads, and how far minimum and maximum are from them, as for errorbar."""
    median, low, high = np.transpose([(one["median"], one["min"], one["max"]) for one in spreads])
    return median, np.array([median - low, high - median])


def bars(
    axis: Axes,
    labels: Sequence[str],
    spreads: Sequence[Spread],
    texts: Sequence[str],
    colours: str | Sequence[str],
) -> None:
    """Horizontal bars from the top: medians, whiskers from minimum to maximum, texts behind."""
    places = np.arange(len(labels))
    median, reach = whiskers(spreads)
    low, high = median - reach[0], median + reach[1]
    axis.barh(places, median, color=colours, height=0.64)
    axis.errorbar(median, places, xerr=reach, fmt="none", ecolor=INK, capsize=2, lw=1)
    for place, top, text in zip(places, high, texts):
        behind: dict = {"textcoords": "offset points", "va": "center", "fontsize": 8.5}
        axis.annotate(text, (max(top, 0), place), (6, 0), **behind)
    axis.set_yticks(places, labels)
    axis.tick_params(axis="y", length=0)
    axis.invert_yaxis()
    axis.locator_params(axis="x", nbins=6)
    axis.set_xlim(min(0, 1.1 * low.min()), 1.35 * max(high.max(), 1e-3))


def panels(
    count: int, columns: int, width: float, height: float, more: float, **shared
) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels in columns, and their axes: each so wide and high (in.)."""
    columns = min(columns, count)
    lines = -(-count // columns)
    size = columns * width, more + lines * height
    figure, axes = plt.subplots(
        lines, columns, figsize=size, squeeze=False, layout="constrained", **shared
    )
    for axis in axes.flat[count:]:
        axis.set_visible(False)
        axes[lines - 2, columns - 1].tick_params(labelbottom=True)
    return figure, list(axes.flat[:count])
