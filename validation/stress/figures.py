"""The figure of `stress`."""

from collections.abc import Sequence

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from ..pages.figures import INK, message
from ..scenes.integrators import OURS
from .measure import ALL

# colours that also differ in lightness, with a sign each
LOOKS = {
    "pass": ("#a9c8e8", ""),
    "fail": ("#e69f00", "✗"),
    "blow-up": ("#1a1a1a", "✸"),
    "cannot tell": ("#d9cde2", "?"),
    "cannot run": ("#f2f2f2", "–"),
}
READ = (
    "Each row is a case with its bound, each column an integrator. ✗ fails, ? cannot tell, ✸ "
    "breaks (not finite, atoms lost, crash or hang), – cannot run; blank: not measured."
)


def matrix(cases: Sequence[dict]) -> Figure | None:
    """Draw cases by integrators, coloured by verdict."""
    label_of = {row["integrator"]: row["label"] for case in cases for row in case["rows"]}
    shown = [name for name in ALL if name in label_of]
    if not shown:
        return None
    size = 2.4 + 0.62 * len(shown), 2.2 + 0.3 * len(cases)
    figure, axis = plt.subplots(figsize=size, layout="constrained")
    for y, case in enumerate(cases):
        for row in case["rows"]:
            x, (colour, sign) = shown.index(row["integrator"]), LOOKS[row["verdict"]]
            axis.add_patch(Rectangle((x - 0.48, y - 0.46), 0.96, 0.92, color=colour))
            axis.text(
                x,
                y,
                sign,
                ha="center",
                va="center",
                color="white" if row["verdict"] == "blow-up" else INK,
            )
    names = [f"{case['name']}  {case['bound']} {case['unit']}".strip() for case in cases]
    axis.set_xticks(
        range(len(shown)),
        ["ours" if name == OURS else label_of[name].replace(" + nve", "") for name in shown],
        rotation=45,
        ha="left",
    )
    axis.set_yticks(range(len(cases)), names)
    axis.xaxis.tick_top()
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)
    axis.set(xlim=(-0.5, len(shown) - 0.5), ylim=(len(cases) - 0.5, -0.5))
    patches = [Patch(facecolor=colour, edgecolor=INK, lw=0.5, label=f"{name} {sign}".strip())
               for name, (colour, sign) in LOOKS.items()]  # fmt: skip
    figure.legend(handles=patches, loc="outside lower left", ncols=len(LOOKS), frameon=False)
    message(figure, "Extreme cases: which integrator passes")
    return figure
