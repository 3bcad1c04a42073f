"""The figure of ``long``."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from validation.long.measure import ANGLES, BOUND, NAMES, QUANTITIES
from validation.pages.figures import INK, OTHERS, OURS, STYLE, THIRD


def draw(rows, series, out):
    """Relative errors against steps, log-log, a column for each time step; path of the PNG."""
    colours = dict(zip(NAMES, (OURS, OTHERS, THIRD)))
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            len(QUANTITIES),
            len(ANGLES),
            figsize=(10, 9),
            sharex=True,
            sharey="row",
            layout="constrained",
        )
        for row in rows:
            errors = series[f"{row['label']}, {row['step']} step"]
            column = list(ANGLES).index(row["step"])
            for axis, key in zip(axes[:, column], QUANTITIES):
                # the largest error so far: what a user has to reckon with
                worst = np.maximum.accumulate(np.abs(errors[key]))
                axis.loglog(
                    errors["steps"][1:],
                    np.maximum(worst[1:], 1e-17),
                    color=colours[row["name"]],
                    label=row["label"],
                )
        for line, (key, what) in zip(axes, QUANTITIES.items()):
            line[0].set_ylabel(what)
            for axis in line:
                axis.axhline(BOUND, color=INK, lw=0.8, ls=":")
        for axis, (kind, angle) in zip(axes[0], ANGLES.items()):
            axis.set_title(f"{kind} step: {angle:g} rad", loc="left")
        axes[0, 0].legend(frameon=False)
        figure.supxlabel("steps")
        figure.supylabel("largest relative error so far")
        path = Path(out) / "long-run.png"
        figure.savefig(path)
        plt.close(figure)
    return path
