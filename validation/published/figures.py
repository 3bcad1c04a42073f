"""The figure of ``published``."""

import matplotlib.pyplot as plt

from validation.pages.figures import OTHERS, OURS
from validation.published.measure import ALL, PUBLISHED, THEIR_ERROR, WITHIN
from validation.statistics.check import Check
from validation.statistics.estimate import SURE, margin


def spread(made: list[Check]) -> tuple[plt.Figure | None, str]:
    """The figure: ours over theirs against the time step."""
    known = [one for one in made if one.value is not None and one.subject != ALL]
    if not known:
        return None, ""
    figure, axis = plt.subplots(figsize=(5.5, 3.6), layout="constrained")
    axis.axhspan(1 - WITHIN, 1 + WITHIN, color=OTHERS, alpha=0.15, lw=0)
    axis.axhline(1.0, color=OTHERS, lw=0.8)
    points = [(float(one.subject.split()[0]), one.value, one.margin) for one in known]
    dt, over, bars = zip(*points)
    axis.errorbar(dt, over, bars, fmt="o", color=OURS, capsize=3)
    what = "standard deviation of the energy,\nfix_nosquish.NVE over published"
    axis.set(xlabel="time step (fs)", ylabel=what)
    axis.set_xticks(list(PUBLISHED), [f"{dt:g}" for dt in PUBLISHED])
    theirs = f"± {100 * margin(THEIR_ERROR):.1f} %"
    return figure, (
        f"Error bars: {SURE} intervals, of both together (theirs alone: {theirs}); shaded: within "
        f"{100 * WITHIN:g} %."
    )
