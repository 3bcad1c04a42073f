"""What all figures share: colours, marks, style, and how they are drawn into a folder."""

from collections.abc import Callable, Iterable
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt

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


def draw_each(functions: Iterable[Callable], out: Path, *data) -> list[tuple[Path, str]]:
    """Draw figures into a folder, each by a function of the data that gives (figure or None,
    caption).

    Returns:
        list of (PNG path, caption).
    """
    made = []
    with plt.rc_context(STYLE):
        for function in functions:
            figure, caption = function(*data)
            if figure is not None:
                path = Path(out) / f"{function.__name__}.png"
                figure.savefig(path)
                plt.close(figure)
                made.append((path, caption))
    return made
