"""The paper's figures 2a, 2b and 3 from ``paper``'s energies, and two of what they depend on."""

import matplotlib.pyplot as plt
import numpy as np

from validation.figures import INK, OTHERS, OURS, PALE, draw_each
from validation.paper import AVERAGE_MEASURE, DIMER_DT, DT, SMALL_DT

POINTS = 400  # of a curve


def thin(one):
    """Time in ps and Delta E, at most `POINTS` samples, evenly picked."""
    pick = np.unique(np.linspace(0, len(one.total) - 1, min(POINTS, len(one.total))).astype(int))
    return one.time[pick], (one.total[pick] - one.total.mean()) / abs(one.total.mean())


def draw(found, summary, out):
    """All figures that there are numbers for: list of (PNG path, caption)."""
    return draw_each((figure_2a, figure_2b, figure_3, force_field, helix), out, found, summary)


def _against_time(found, curves, power):
    """A panel with curves of Delta E, or None; ``curves`` is name, label, style of each."""
    shown = [(found[name], label, style) for name, label, style in curves if _has(found, name)]
    if not shown:
        return None
    figure, axis = plt.subplots(figsize=(7.5, 2.6), layout="constrained")
    for one, label, style in shown:
        time, error = thin(one)
        axis.plot(time, error * 10**power, label=label, lw=0.7, **style)
    axis.set_xlabel("t (ps)")
    axis.set_ylabel(f"ΔE(t) × 10$^{{{power}}}$")
    axis.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1, 0.97))
    return figure


def _has(found, name):
    return name in found and len(found[name].total) > 1


TWO = {"nosquish": ("NO_SQUISH", {"color": OURS}), "matubayasi-nakahara": ("reference 12", {"color": OTHERS, "ls": ":"})}


def figure_2a(found, summary):
    """The dimer."""
    curves = [(f"dimer-{name}-1", *how) for name, how in reversed(TWO.items())]
    return _against_time(found, curves, 6), (
        f"Figure 2a again: the light water dimer (m_H = 0.1 amu), Δt = {DIMER_DT:g} fs; energy conservation measure of NO_SQUISH and reference 12 "
        "from the same start, the first of several."
    )


def figure_2b(found, summary):
    """The liquid."""
    curves = [(f"water-{name}", *how) for name, how in reversed(TWO.items())]
    return _against_time(found, curves, 6), (
        f"Figure 2b again: 1,000 TIP3P molecules, 295 K, 1 g/cm³, Δt = {DT:g} fs; energy conservation measure of NO_SQUISH and reference 12."
    )


def figure_3(found, summary):
    """The peptide."""
    panels = [(name, label) for name, label in (("nosquish", "(a) NO_SQUISH"), ("shake", "(b) SHAKE")) if _has(found, f"peptide-{name}")]
    if not panels:
        return None, ""
    figure, axes = plt.subplots(len(panels), 1, figsize=(7.5, 0.8 + 1.7 * len(panels)), sharex=True, sharey=True, squeeze=False, layout="constrained")
    for axis, (name, label) in zip(axes[:, 0], panels):
        time, error = thin(found[f"peptide-{name}"])
        axis.axhspan(-AVERAGE_MEASURE * 1e5, AVERAGE_MEASURE * 1e5, color=PALE, alpha=0.5, lw=0)
        axis.plot(time, error * 1e5, lw=0.7, color=OURS if name == "nosquish" else OTHERS)
        axis.set_title(label, loc="left", fontsize=10)
    axes[-1, 0].set_xlabel("t (ps)")
    figure.supylabel("ΔE(t) × 10$^5$", fontsize=10)
    return figure, f"Figure 3 again: the helical peptide in water, 300 K, Δt = {DT:g} fs. Grey: the average measure that the paper reports, ±1e-5."


def force_field(found, summary):
    """What is left at a small step."""
    rows = summary["force_field"]
    if not rows:
        return None, ""
    figure, axis = plt.subplots(figsize=(8, 0.9 + 0.4 * len(rows)), layout="constrained")
    places = np.arange(len(rows))
    axis.barh(places, [row["sd"] for row in rows], xerr=[row["error"] for row in rows], color=OTHERS, ecolor=INK, height=0.6, capsize=3)
    for row in rows[:1]:
        if "usual_sd" in row:
            axis.axvline(row["usual_sd"], color=OURS, label=f"at {DT:g} fs, over as long")
            axis.legend(frameon=False)
    axis.set_yticks(places, [row["name"] for row in rows])
    axis.invert_yaxis()
    axis.set_xlabel("sd of the energy (kcal/mol)")
    return (
        figure,
        f"The force field's own part: sd of the peptide scene's energy with NO_SQUISH at {SMALL_DT:g} fs, with what is said at the left changed.",
    )


def helix(found, summary):
    """The helix against time."""
    if not summary["helix"]:
        return None, ""
    figure, axes = plt.subplots(2, 1, figsize=(9, 4), sharex=True, layout="constrained")
    for (name, path), colour in zip(summary["helix"].items(), (OURS, OTHERS, "#c06c3e")):
        for axis, key in zip(axes, ("helical", "rmsd")):
            axis.plot(path["time"], path[key], color=colour, lw=0.9, label=name.removeprefix("peptide-"))
    axes[0].set_ylabel("helical residues")
    axes[1].set_ylabel("RMSD (Å)")
    axes[1].set_xlabel("t (ps)")
    axes[0].legend(frameon=False, ncols=3)
    return figure, "The peptide: residues that are alpha helix by DSSP, and the backbone's distance from its start."
