"""The figure of the stability atlas."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch

from ..pages.figures import INK, Drawn
from ..statistics.estimate import SURE, Estimate
from .measure import COMPARED

# colours that differ in lightness too, and a sign each
LOOKS = {
    "pass": ("#3b7dbf", "", "blue"),
    "fail": ("#e69f00", "✗", "yellow"),
    "blow-up": ("#1a1a1a", "✸", "red"),
    "cannot tell": ("#c9b8d6", "?", "magenta"),
    "cannot run": ("#f2f2f2", "–", "bright_black"),
}
SHADES = 6.0  # decades from the bound at which a colour is full
NARROW = {"fix_nosquish.NVE": "ours\n(NVE)"}
READ = (
    f"Each case's number against its bound (at the left): a longest step with its {SURE} margin; "
    "else number and margin together, which is what is judged, with < where the number is below "
    "its margin; the paler the nearer to the bound. ✗ fails, ? cannot tell, ✸ breaks (not finite, "
    "atoms lost, crash or hang), – cannot be run; empty: not run. Where each number's error comes "
    "from, or why it has none, is told case by case."
)


def columns(summary: dict) -> dict[str, str]:
    """Names and labels of the integrators that have rows."""
    found = {row["integrator"]: row["label"] for case in summary["cases"] for row in case["rows"]}
    return {name: found[name] for name in COMPARED if name in found}


def by_integrator(case: dict) -> dict[str, dict]:
    """A case's rows."""
    return {row["integrator"]: row for row in case["rows"]}


def signed(row: dict, text: str) -> str:
    """The sign of a row's verdict, and a text."""
    return f"{LOOKS[row['verdict']][1]} {text}".strip()


def narrow(label: str) -> str:
    """A label in several lines."""
    short = label.replace(" + nve", "").replace("/small", "/\nsmall").replace(" ", "\n")
    return NARROW.get(label, short)


def matrix(summary: dict) -> Drawn:
    """Cases by integrators, coloured by verdict, each with its number."""
    shown, cases = columns(summary), summary["cases"]
    if not cases:
        return None
    size = max(7.0, 2.6 + 0.92 * len(shown)), 2.0 + 0.42 * len(cases)
    figure, axis = plt.subplots(figsize=size, layout="constrained")
    image = np.ones((len(cases), len(shown), 3))
    for y, case in enumerate(cases):
        rows = by_integrator(case)
        for x, name in enumerate(shown):
            if name in rows:
                image[y, x], ink, text = _tile(case, rows[name])
                axis.text(x, y, text, ha="center", va="center", color=ink, fontsize=8.5)
    axis.imshow(image, aspect="auto")
    names = [f"{case['name']}  {case['bound']} {case['unit']}".strip() for case in cases]
    axis.set_xticks(range(len(shown)), [narrow(label) for label in shown.values()])
    axis.set_yticks(range(len(cases)), names)
    axis.xaxis.tick_top()
    axis.set_xticks(np.arange(len(shown) - 1) + 0.5, minor=True)
    axis.set_yticks(np.arange(len(cases) - 1) + 0.5, minor=True)
    axis.grid(which="minor", color="white", lw=2)
    axis.tick_params(which="both", length=0)
    axis.spines[:].set_visible(False)
    for label in axis.get_xticklabels():
        label.set_fontweight("bold" if label.get_text().startswith("ours") else "normal")
    patches = [
        Patch(facecolor=colour, edgecolor=INK, lw=0.5, label=f"{name} {sign}".strip())
        for name, (colour, sign, _) in LOOKS.items()
    ]
    axis.legend(
        handles=patches,
        loc="upper left",
        bbox_to_anchor=(0, -0.01),
        ncols=len(LOOKS),
        frameon=False,
    )
    return figure, READ


def _brief(x):
    """A positive number in few characters."""
    if x == 0 or 0.01 <= x < 99.5:
        return f"{x:.2g}"
    digit, exponent = f"{x:.0e}".split("e")
    return f"{digit}e{int(exponent)}".replace("-", "−")


def _tile(case, row):
    """Colour of a tile, of its text, and the text."""
    colour, sign, _ = LOOKS[row["verdict"]]
    full, value, unsure = np.array(to_rgb(colour)), row["value"], Estimate.of(row).margin
    if value is None:
        return full, "white" if full.mean() < 0.5 else INK, sign
    if case["high"] is None:  # a time step is not far off in decades
        judged, times = value - unsure, SHADES
        text = f"{value:.3g}±{unsure:.1g}" if unsure else f"{value:.3g}"
    else:
        judged, times = abs(value) + unsure, 1.0
        text = ("<" if value < unsure else "") + _brief(judged)
    bound = case["low"] if case["high"] is None else case["high"]
    decades = times * abs(np.log10(judged / bound)) if judged > 0 else np.inf
    strength = 0.45 + 0.55 * min(1.0, decades / SHADES)
    shade = 1 - strength * (1 - full) if row["verdict"] in ("pass", "fail") else full
    return shade, "white" if shade @ (0.299, 0.587, 0.114) < 0.55 else INK, signed(row, text)
