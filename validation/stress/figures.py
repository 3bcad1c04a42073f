"""The figure of `stress`."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..pages.figures import INK, message
from ..statistics.estimate import SURE, Estimate
from .measure import ALL

# colours that differ in lightness too, and a sign each
LOOKS = {
    "pass": ("#a9c8e8", ""),
    "fail": ("#e69f00", "✗"),
    "blow-up": ("#1a1a1a", "✸"),
    "cannot tell": ("#d9cde2", "?"),
    "cannot run": ("#f2f2f2", "–"),
}
NARROW = {"fix_nosquish.NVE": "ours\n(NVE)"}
READ = (
    f"Each case's number against its bound (at the left): a longest step with its {SURE} margin; "
    "else number and margin together, which is what is judged, with < where the number is below "
    "its margin. ✗ fails, ? cannot tell, ✸ breaks (not finite, atoms lost, crash or hang), – "
    "cannot be run; empty: not run. Where each number's error comes from, or why it has none, is "
    "told case by case."
)


def matrix(cases: Sequence[dict]) -> Figure | None:
    """Cases by integrators, coloured by verdict, each with its number."""
    found = {row["integrator"]: row["label"] for case in cases for row in case["rows"]}
    shown = [name for name in ALL if name in found]
    if not shown:
        return None
    size = max(7.0, 2.6 + 0.92 * len(shown)), 2.0 + 0.42 * len(cases)
    figure, axis = plt.subplots(figsize=size, layout="constrained")
    image = np.ones((len(cases), len(shown), 3))
    for y, case in enumerate(cases):
        for row in case["rows"]:
            x, (colour, sign) = shown.index(row["integrator"]), LOOKS[row["verdict"]]
            image[y, x] = to_rgb(colour)
            ink = "white" if image[y, x].mean() < 0.5 else INK
            text = f"{sign} {tile(case, row)}".strip()
            axis.text(x, y, text, ha="center", va="center", color=ink, fontsize=8.5)
    axis.imshow(image, aspect="auto")
    names = [f"{case['name']}  {case['bound']} {case['unit']}".strip() for case in cases]
    axis.set_xticks(range(len(shown)), [narrow(found[name]) for name in shown])
    axis.set_yticks(range(len(cases)), names)
    axis.xaxis.tick_top()
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)
    for edge in np.arange(max(image.shape[:2])) + 0.5:
        axis.axvline(edge, color="white", lw=2)
        axis.axhline(edge, color="white", lw=2)
    axis.set(xlim=(-0.5, len(shown) - 0.5), ylim=(len(cases) - 0.5, -0.5))
    patches = [Patch(facecolor=colour, edgecolor=INK, lw=0.5, label=f"{name} {sign}".strip())
               for name, (colour, sign) in LOOKS.items()]  # fmt: skip
    place = {"loc": "upper left", "bbox_to_anchor": (0, -0.01), "ncols": len(LOOKS)}
    axis.legend(handles=patches, frameon=False, **place)
    message(figure, "Which integrator bears what")
    return figure


def narrow(label: str) -> str:
    """A label in several lines."""
    short = label.replace(" + nve", "").replace("/small", "/\nsmall").replace(" ", "\n")
    return NARROW.get(label, short)


def tile(case: dict, row: dict) -> str:
    """What a tile says of a number: what is judged, the number and its margin, or its margin beside
    it; so no tile looks better than another because noise came out small."""
    value, margin = row["value"], Estimate.of(row).margin
    if value is None:
        return ""
    if case["high"] is None:
        return f"{value:.3g}±{margin:.1g}" if margin else f"{value:.3g}"
    judged = abs(value) + margin
    below = "<" if value < margin else ""
    if judged == 0 or 0.01 <= judged < 99.5:
        return f"{below}{judged:.2g}"
    digit, exponent = f"{judged:.0e}".split("e")
    return f"{below}{digit}e{int(exponent)}".replace("-", "−")
