"""The paper's figures 2a, 2b and 3 from ``paper``'s energies, and some of what they depend on."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from ..pages.figures import INK, OTHERS, OURS, PALE, THIRD, Drawn, draw_each
from ..running.trajectory import Series
from ..scenes import SCENES
from ..statistics.estimate import SURE, Estimate
from .measure import BEGINNING, Found, gear_pairs
from .plan import AVERAGE_MEASURE, DIMER_DT, DT, SMALL_DT, TEMPERATURE

POINTS = 400  # of a curve
RUNNING = 30  # windows of a running mean in the length of a curve
# label, colours of curve and running mean
TWO = {"nosquish": ("NO_SQUISH", OURS, INK), "matubayasi-nakahara": ("reference 12", OTHERS, THIRD)}
FIGURE_2A, FIGURE_2B = (
    {prefix.format(name): how for name, how in TWO.items()} for prefix in ("dimer-{}-1", "water-{}")
)
FIGURE_3 = {"peptide-nosquish": "(a) NO_SQUISH", "peptide-shake": "(b) SHAKE"}
SHOWN = *FIGURE_2A, *FIGURE_2B, *FIGURE_3


def thin(one: Series) -> tuple[np.ndarray, np.ndarray]:
    """Time in ps and Delta E, at most `POINTS` samples, evenly picked."""
    pick = np.unique(np.linspace(0, len(one.total) - 1, min(POINTS, len(one.total))).astype(int))
    return one.time[pick], _relative(one, one.total[pick])


def _relative(one, energy):
    return (energy - one.total.mean()) / abs(one.total.mean())


def _running_mean(one):
    """Time in ps and the mean of Delta E in a window about it."""
    window = max(1, len(one.total) // RUNNING)
    kernel, pick = np.full(window, 1 / window), slice(None, None, max(1, window // 10))
    time, energy = (np.convolve(x, kernel, "valid")[pick] for x in (one.time, one.total))
    return time, _relative(one, energy)


def draw(found: Found, summary: dict, out: Path) -> list[tuple[Path, str]]:
    """All figures that there are numbers for: list of (PNG path, caption)."""
    figures = figure_2a, figure_2b, figure_3, gear, force_field, helix
    return draw_each(figures, out, found, summary)


def _has(found, name):
    return name in found and len(found[name].total) > 1


def _figure_2(found, curves, told):
    """A panel with curves of Delta E and their running means; ``curves`` as `FIGURE_2A`."""
    shown = [(found[name], *how) for name, how in curves.items() if _has(found, name)][::-1]
    if not shown:
        return None
    figure, axis = plt.subplots(figsize=(7.5, 3.2), layout="constrained")
    for one, label, colour, _ in shown:
        time, error = thin(one)
        axis.plot(time, error * 1e6, label=label, lw=0.5, alpha=0.5, color=colour)
    for one, label, _, colour in shown:
        time, error = _running_mean(one)
        axis.plot(time, error * 1e6, label=f"{label}, running mean", lw=1.8, color=colour)
    axis.set(xlabel="t (ps)", ylabel="ΔE(t) × 10$^{6}$")
    axis.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1, 0.98))
    return figure, told


def figure_2a(found: Found, summary: dict) -> Drawn:
    """The dimer."""
    told = (
        f"Figure 2a again: {SCENES['dimer'].title}, Δt = {DIMER_DT:g} fs; energy conservation "
        "measure of NO_SQUISH and reference 12 from the same start, the first of several. What "
        "both do from step to step is the force splitting's; they differ in the slow wander, the "
        f"running mean (windows of a {RUNNING}th of the time)."
    )
    return _figure_2(found, FIGURE_2A, told)


def figure_2b(found: Found, summary: dict) -> Drawn:
    """The liquid."""
    told = (
        f"Figure 2b again: {SCENES['water'].title}, Δt = {DT:g} fs; energy conservation measure "
        "of NO_SQUISH and reference 12, and running means."
    )
    return _figure_2(found, FIGURE_2B, told)


def figure_3(found: Found, summary: dict) -> Drawn:
    """The peptide."""
    panels = [(found[name], label) for name, label in FIGURE_3.items() if _has(found, name)]
    if not panels:
        return None
    size: dict = {"figsize": (7.5, 0.8 + 1.7 * len(panels)), "layout": "constrained"}
    figure, axes = plt.subplots(len(panels), sharex=True, sharey=True, squeeze=False, **size)
    paper, told = AVERAGE_MEASURE * 1e5, f"the paper's average, {AVERAGE_MEASURE:g}"
    for axis, (one, label), colour in zip(axes[:, 0], panels, (OURS, OTHERS)):
        time, error = thin(one)
        axis.axhspan(-paper, paper, color=PALE, alpha=0.5, lw=0, label=told)
        axis.plot(time, error * 1e5, lw=0.7, color=colour)
        axis.set_title(label, loc="left", fontsize=10)
    axes[0, 0].legend(loc="lower right", bbox_to_anchor=(1, 1), frameon=False)
    axes[-1, 0].set_xlabel("t (ps)")
    figure.supylabel("ΔE(t) × 10$^5$", fontsize=10)
    return figure, (
        f"Figure 3 again: {SCENES['peptide'].title}, {TEMPERATURE['peptide']:g} K, "
        f"Δt = {DT:g} fs. Grey: the average measure that the paper reports, ±{AVERAGE_MEASURE:g}."
    )


def gear(found: Found, summary: dict) -> Drawn:
    """How far the energy goes with Gear's scheme and with NO_SQUISH."""
    scenes = gear_pairs({name: one for name, one in found.items() if not one.error})
    if not scenes:
        return None
    size: dict = {"figsize": (2 + 4 * len(scenes), 3.2), "layout": "constrained"}
    figure, axes = plt.subplots(1, len(scenes), squeeze=False, **size)
    for axis, (scene, pairs) in zip(axes[0], scenes.items()):
        for series, label, colour in zip(zip(*pairs), ("NO_SQUISH", "Gear"), (OURS, THIRD)):
            count = min(len(one.total) for one in series)
            changes = [one.total[:count] - one.total[0] for one in series]
            pick = np.unique(np.geomspace(1, count - 1, POINTS).astype(int))
            change, time = np.sqrt(np.mean(np.square(changes), axis=0)), series[0].time
            axis.loglog(time[pick] - time[0], change[pick], lw=0.8, color=colour, label=label)
        title = f"{scene}, {series[0].trajectory.dt:g} fs, {len(pairs)} starts"
        axis.set_title(title, loc="left", fontsize=10)
        axis.set_xlabel("t (ps)")
    axes[0, 0].set_ylabel("E(t) − E(0), rms (kcal/mol)")
    axes[0, 0].legend(frameon=False)
    return figure, (
        "Root mean square over the starts of the energy's change, counted from behind the first "
        f"{BEGINNING} steps, in which Gear's scheme finds its derivatives and its energy jumps. It "
        "is of higher order, and better at first; its drift comes through where the curves cross."
    )


def force_field(found: Found, summary: dict) -> Drawn:
    """What the force field alone does to the energy, in the time of the run at the usual step."""
    rows = [row for row in summary["force_field"] if "variance" in row]
    variances = [Estimate.of(row["variance"]) for row in rows]
    if not rows:
        return None
    figure, axis = plt.subplots(figsize=(8, 0.9 + 0.4 * len(rows)), layout="constrained")
    parts, margins = zip(*((one.value, one.margin) for one in variances))
    bars: dict = {"color": OTHERS, "ecolor": INK, "height": 0.6, "capsize": 3}
    axis.barh(range(len(rows)), parts, xerr=margins, **bars)
    span = f"{rows[0]['usual_ps']:.4g} ps"
    whole = f"whole variance at {DT:g} fs, {span}"
    axis.axvline(rows[0]["usual_variance"], color=OURS, label=whole)
    axis.legend(frameon=False)
    axis.set_yticks(range(len(rows)), [row["name"] for row in rows])
    axis.invert_yaxis()
    axis.set_xlabel("variance of the energy (kcal/mol)²")
    return figure, (
        "The force field's own part: fluctuation and random walk of the peptide scene's energy "
        f"with NO_SQUISH at {SMALL_DT:g} fs, with what is said at the left changed, and what they "
        f"come to in {span}, with its {SURE} interval."
    )


def helix(found: Found, summary: dict) -> Drawn:
    """The helix against time."""
    if not summary["helix"]:
        return None
    figure, axes = plt.subplots(2, 1, figsize=(9, 4), sharex=True, layout="constrained")
    for (name, path), colour in zip(summary["helix"].items(), (OURS, OTHERS, THIRD)):
        how = {"color": colour, "lw": 0.9, "label": name.removeprefix("peptide-")}
        for axis, key in zip(axes, ("helical", "rmsd")):
            axis.plot(path["time"], path[key], **how)
    axes[0].set_ylabel("helical residues")
    axes[1].set(xlabel="t (ps)", ylabel="RMSD (Å)")
    axes[0].legend(frameon=False, ncols=3)
    return figure, (
        "The peptide: residues that are alpha helix by DSSP, and the backbone's distance from its "
        "start."
    )
