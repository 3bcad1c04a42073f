"""The common style of figures: colours for the colour-blind, and labels at the lines.

A figure shows at most five lines that matter, has its message as its title (`message`), and labels
its lines at their ends (`label_ends`) instead of in a legend.
"""

from collections.abc import Sequence

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Okabe and Ito's colours (jfly.uni-koeln.de/color), which the colour-blind can distinguish
BLUE, ORANGE, GREEN, RED, PURPLE, SKY = (
    *("#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9"),
)
OURS, INK, PALE, MISSED = BLUE, "#333333", "#bdbdbd", "#b00000"
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

MARKS = {  # integrator: colour and marker
    "nosquish": (BLUE, "o"),
    "rigid/nve": (ORANGE, "s"),
    "rigid": (SKY, "D"),
    "rigid/nve/small": (GREEN, "^"),
    "rigid/small": (INK, "<"),
    "shake": (RED, "v"),
    "rattle": (PURPLE, "P"),
    "ilves": (PURPLE, "X"),
}
LINE = 9.0  # height of a label, in points


def message(figure: Figure, text: str) -> None:
    """Set the message of a figure as its title, from the left edge."""
    figure.suptitle(text, x=0.01, ha="left", fontsize=12, fontweight="bold")


def label_ends(axis: Axes, ends: Sequence[tuple[float, float, str, str]]) -> None:
    """Label lines at their right ends, without overlap.

    Args:
        ends: (x, y, text, colour) of each line; call this after limits and scales are set.
    """
    figure = axis.figure
    assert isinstance(figure, Figure)
    figure.draw_without_rendering()
    step = LINE * figure.dpi / 72 * 1.25
    left, bottom = axis.transAxes.transform((0, 0))
    right, top = axis.transAxes.transform((1, 1))
    at = [(axis.transData.transform((x, y)), text, colour) for x, y, text, colour in ends]
    at.sort(key=lambda end: end[0][1])
    places = [place[1] for place, *_ in at]
    for index in range(1, len(places)):
        places[index] = max(places[index], places[index - 1] + step)
    over = max(0.0, places[-1] - top + step / 2) if places else 0.0
    for (place, text, colour), y in zip(at, places):
        share = (y - over - bottom) / (top - bottom)
        end = ((place[0] - left) / (right - left), (place[1] - bottom) / (top - bottom))
        arrow = {"arrowstyle": "-", "color": PALE, "lw": 0.6, "shrinkA": 0, "shrinkB": 3}
        axis.annotate(
            *(text, end, (1.03, share)),
            xycoords="axes fraction", textcoords="axes fraction", arrowprops=arrow,
            color=colour, fontsize=LINE, va="center", annotation_clip=False,
        )  # fmt: skip


def panels(
    count: int, columns: int, width: float, height: float, more: float, **shared
) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels in columns, and their axes; width and height of each in
    inches."""
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
