"""What all figures share: colours, marks, style, and how they are drawn into a folder."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

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
Drawn = tuple[Figure, str] | None  # a figure and its caption, or None where there is none to draw


def draw_each(
    functions: Iterable[Callable[..., Drawn]], out: Path, *data
) -> list[tuple[Path, str]]:
    """Draw figures into a folder: list of (PNG path, caption).

    Where there is none to draw, that of an earlier command is removed.

    Args:
        functions: each gives `Drawn` of the data; its name is the file's.
    """
    made = []
    with plt.rc_context(STYLE):
        for function in functions:
            figure, caption = function(*data) or (None, "")
            path = Path(out) / f"{function.__name__}.png"
            if figure is None:
                path.unlink(missing_ok=True)
            else:
                figure.savefig(path)
                plt.close(figure)
                made.append((path, caption))
    return made


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
