"""The figure of ``long``."""

import numpy as np

from ..pages.figures import INK, MARKS, Drawn, panels
from .measure import ANGLES, BOUND, QUANTITIES


def long_run(summary: dict, series: dict) -> Drawn:
    """Relative errors against steps, log-log, a column for each time step."""
    lines, columns = len(QUANTITIES), len(ANGLES)
    figure, flat = panels(lines * columns, columns, 5, 2.25, 0, sharex=True, sharey="row")
    axes = np.array(flat).reshape(lines, columns)
    for row in summary["runs"]:
        errors = series.get((row["name"], row["step"]))
        if errors is None:
            continue
        style = {"color": MARKS[row["name"]][0], "label": row["label"]}
        for axis, key in zip(axes[:, list(ANGLES).index(row["step"])], QUANTITIES):
            # the largest error so far: what a user has to reckon with
            worst = np.maximum.accumulate(np.abs(errors[key]))
            axis.loglog(errors["steps"][1:], np.maximum(worst[1:], 1e-17), **style)
    for line, what in zip(axes, QUANTITIES.values()):
        line[0].set_ylabel(what)
        for axis in line:
            axis.axhline(BOUND, color=INK, lw=0.8, ls=":")
    for axis, (kind, angle) in zip(axes[0], ANGLES.items()):
        axis.set_title(f"{kind} step: {angle:g} rad", loc="left")
    axes[0, 0].legend(frameon=False)
    figure.supxlabel("steps")
    figure.supylabel("largest relative error so far")
    return figure, "The largest relative error so far against the steps."
