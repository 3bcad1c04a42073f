"""The figure of ``published``."""

import matplotlib.pyplot as plt

from ..pages.figures import OTHERS, OURS, Drawn
from ..statistics.estimate import SURE, Estimate, margin
from .measure import ALL, PUBLISHED, THEIR_ERROR, WITHIN


def spread(checks: list[dict]) -> Drawn:
    """Ours over theirs against the time step, of checks as plain data."""
    known = [one for one in checks if one["part"] == "spread" and one["subject"] != ALL]
    known = [one for one in known if one["value"] is not None]
    if not known:
        return None
    figure, axis = plt.subplots(figsize=(5.5, 3.6), layout="constrained")
    axis.axhspan(1 - WITHIN, 1 + WITHIN, color=OTHERS, alpha=0.15, lw=0)
    axis.axhline(1.0, color=OTHERS, lw=0.8)
    dt = [float(one["subject"].split()[0]) for one in known]
    over, bars = zip(*((one["value"], Estimate.of(one).margin) for one in known))
    axis.errorbar(dt, over, bars, fmt="o", color=OURS, capsize=3)
    what = "standard deviation of the energy,\nfix_nosquish.NVE over published"
    axis.set(xlabel="time step (fs)", ylabel=what)
    axis.set_xticks(list(PUBLISHED), [f"{dt:g}" for dt in PUBLISHED])
    theirs = f"± {100 * margin(THEIR_ERROR):.1f} %"
    return figure, (
        f"Error bars: {SURE} intervals, of both together (theirs alone: {theirs}); shaded: within "
        f"{100 * WITHIN:g} %."
    )
