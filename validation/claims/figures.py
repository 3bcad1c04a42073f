"""Figures of the claims, each of a summary."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ..pages.figures import BLUE, GREEN, INK, ORANGE, PALE, PURPLE, RED, label_ends, message

LEAST = 1e-17  # shown for a zero
POINTS = 400  # of a curve
# what is drawn of the paper's trajectories
DIMER = {"dimer-nosquish-1": "NO_SQUISH", "dimer-matubayasi-nakahara-1": "reference 12"}
LIQUID = {"water-nosquish": "NO_SQUISH", "water-matubayasi-nakahara": "reference 12"}
PEPTIDE = {"peptide-nosquish": "NO_SQUISH", "peptide-shake": "SHAKE"}
CURVES = *DIMER, *LIQUID, *PEPTIDE


def picked(count: int) -> np.ndarray:
    """Which of so many samples a curve has."""
    return np.unique(np.linspace(0, count - 1, min(POINTS, count)).astype(int))


def reversal(summary: dict) -> Figure | None:
    """Distance from the start against the number of steps."""
    if not (found := summary["data"].get("reversal")):
        return None
    colours = {
        "fix_nosquish.NVE": BLUE,
        "rigid/nve": ORANGE,
        "rigid": GREEN,
        "shake 1e-4 + nve": RED,
        "Gear": PURPLE,
    }
    figure, axis = plt.subplots(figsize=(7, 4), layout="constrained")
    axis.set(xscale="log", yscale="log", xlabel="steps forward, and as many back")
    axis.set_ylabel("distance from the start (Å)")
    message(figure, "Forward and back: how far from the start")
    ends = []
    for row in found["runs"]:
        label = row["label"]
        if (colour := colours.get(label)) and not row["error"]:
            distance = np.maximum(row["distance"], LEAST)
            axis.plot(found["steps"], distance, "o-", ms=3, color=colour)
            ends.append((found["steps"][-1], distance[-1], label, colour))
    label_ends(axis, ends)
    return figure


def _curves(summary, names, told, power) -> Figure | None:
    """A panel of Delta E for each trajectory, of those that there are."""
    curves = summary.get("curves", {})
    shown = {label: curves[name] for name, label in names.items() if name in curves}
    if not shown:
        return None
    figure, axes = plt.subplots(
        len(shown),
        sharex=True,
        sharey=True,
        squeeze=False,
        figsize=(7.5, 0.8 + 1.7 * len(shown)),
        layout="constrained",
    )
    for axis, (label, curve), colour in zip(axes[:, 0], shown.items(), (BLUE, ORANGE)):
        axis.plot(curve["time"], np.array(curve["error"]) * 10**power, lw=0.6, color=colour)
        axis.plot(
            curve["time_running"], np.array(curve["error_running"]) * 10**power, color=INK, lw=1.6
        )
        axis.set_title(label, loc="left", fontsize=10)
    axes[-1, 0].set_xlabel("t (ps)")
    figure.supylabel(f"ΔE(t) × 10$^{power}$", fontsize=10)
    message(figure, told)
    return figure


def figure_2a(summary: dict) -> Figure | None:
    """The dimer."""
    return _curves(summary, DIMER, "Figure 2a again: the dimer's energy, and its running mean", 6)


def figure_2b(summary: dict) -> Figure | None:
    """The liquid."""
    return _curves(summary, LIQUID, "Figure 2b again: that of liquid water", 6)


def figure_3(summary: dict) -> Figure | None:
    """The peptide."""
    figure = _curves(summary, PEPTIDE, "Figure 3 again: that of the peptide in water", 5)
    for axis in figure.axes if figure else ():
        axis.axhspan(-1, 1, color=PALE, alpha=0.5, lw=0)
    return figure
