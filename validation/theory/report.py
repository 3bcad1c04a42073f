"""From the checks of `theory` to files and the terminal: summary.json, table.csv, figures,
report.html."""

import matplotlib.pyplot as plt
import numpy as np

from validation.pages.figures import INK, OTHERS, OURS, PALE, THIRD, draw_each
from validation.pages.page import page, save
from validation.pages.said import Figure, Said, of_checks
from validation.statistics import check

TITLES = {
    "reversal": "Forward and back",
    "symplectic": "Symplectic property (2.42)",
    "conserved": "Conserved quantity (2.37), (2.51)",
    "mrot": "Inner steps of the rotor",
    "recursion": "Recursion relation (2.30)",
    "loops": "The compiled loops",
}
LEAST = 1e-17  # shown for a zero


def write(summary, out):
    """Write all files into the folder ``out``.

    Args:
        summary: plain data: ``checks``, ``data`` (what the figures show, by part), ``interrupted``
            and the circumstances.
    """
    save(summary, out)
    check.write(summary["checks"], out / "table.csv")
    figures = draw_each((reversal, symplectic, conserved, mrot, recursion), out, summary["data"])
    page("theory.html", out / "report.html", figures, summary=summary, titles=TITLES)  # fmt: skip


def show(console, summary, out):
    """Print the checks."""
    check.show(console, summary["checks"], TITLES)
    if summary["interrupted"]:
        console.print("Interrupted.")
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)


def reversal(data):
    """Distance from the start against the number of steps, one panel for shake, one for rattle, one
    for all others."""
    found = data.get("reversal")
    if not found:
        return None, ""
    rows = [row for row in found["runs"] if not row["error"]]
    figure, axes = plt.subplots(1, 3, figsize=(13, 5.4), sharey=True, layout="constrained")
    free = [row for row in rows if row["tolerance"] is None]
    for axis, title, shown in (
        (axes[0], "without a tolerance", free),
        *(
            (axis, name, [row for row in rows if row["name"] == name])
            for axis, name in zip(axes[1:], ("shake", "rattle"))
        ),
    ):
        shades = plt.get_cmap("tab10" if shown is free else "viridis")(
            np.arange(len(shown)) if shown is free else np.linspace(0, 0.9, len(shown))
        )
        for row, shade in zip(shown, shades):
            ours, small = row["name"] == "NVE", row["name"].endswith("small")
            axis.loglog(found["steps"], np.maximum(row["distance"], LEAST), color=OURS if ours else shade, lw=2.4 if ours else 1.4,
                        ls=(0, (2, 2)) if small else "-", label=row["label"])  # fmt: skip
        axis.set_title(title, loc="left")
        axis.set_xlabel("steps forward, and as many back")
        if shown:
            axis.legend(
                frameon=False, fontsize=8, ncols=2, loc="upper left", bbox_to_anchor=(-0.05, -0.14)
            )
    axes[0].set_ylabel("distance from the start (Å)")
    return figure, (
        f"The furthest atom's distance from its start after so many steps of {found['dt_fs']:g} fs, velocities reversed, and as many steps, "
        "in LAMMPS: the dimer. What rounding leaves grows as the motion is chaotic: after some thousand steps nothing comes back."
    )


def symplectic(data):
    """The defect against the time step, and that of SHAKE against its tolerance."""
    found = data.get("symplectic")
    if not found:
        return None, ""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for name, colour in ("NO_SQUISH", OURS), ("reference 12", OTHERS):
        left.loglog(
            found["dt_fs"],
            np.maximum(found["defect"][name], LEAST),
            "o-",
            color=colour,
            label=f"{name}: |J g⁻¹ Jᵀ − g⁻¹|",
        )
        left.loglog(
            found["dt_fs"],
            np.maximum(found["volume"][name], LEAST),
            "x",
            color=colour,
            ls=":",
            label=f"{name}: |det J − 1|",
        )
    left.set_xlabel("Δt (fs)")
    right.loglog(
        found["tolerance"],
        found["shake"],
        "o-",
        color=THIRD,
        label="SHAKE/RATTLE in Python: |Jᵀ g J − g|",
    )
    right.invert_xaxis()
    right.set_xlabel("tolerance")
    for axis in left, right:
        axis.legend(frameon=False, fontsize=8)
    return figure, (
        "One step of the dimer. Left: the symplectic property (2.42), and the volume of phase space. Right: the former, of atoms whose distances "
        "a model of SHAKE and RATTLE in Python keeps."
    )


def conserved(data):
    """The spread of H, with and without its corrections, against the time step."""
    found = data.get("conserved")
    if not found:
        return None, ""
    words = {
        "": "H",
        "force": "H + Δt² H⁽²⁾, force only",
        "rotor": "H + Δt² H⁽²⁾, rotor only",
        "both": "H + Δt² H⁽²⁾",
    }
    dt = np.array(found["dt_fs"])
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for axis, scheme, complete in zip(axes, ("NO_SQUISH", "free rotor"), ("both", "rotor")):
        for which, values in found["spread"][scheme].items():
            colour = (
                INK
                if which == ""
                else OURS
                if which == complete
                else OTHERS
                if which == "force"
                else THIRD
            )
            axis.loglog(
                dt,
                values,
                "o-",
                color=colour,
                lw=4 if which == "" else 1.5,
                label=words["both"] if which == complete else words[which],
            )
        for which, order in ("", 2), (complete, 4):
            axis.loglog(
                dt,
                found["spread"][scheme][which][0] * (dt / dt[0]) ** order,
                color=PALE,
                lw=1,
                zorder=0,
            )
        axis.set_title(
            {"NO_SQUISH": "dimer, NO_SQUISH", "free rotor": "free rotors"}[scheme], loc="left"
        )
        axis.set_xlabel("Δt (fs)")
        axis.legend(frameon=False, fontsize=8)
    axes[0].set_ylabel("spread (kcal/mol)")
    return (
        figure,
        "Root mean square of the change since the start, along trajectories of the same length. Pale: Δt² and Δt⁴ through the first point.",
    )


def mrot(data):
    """The free rotor's error against m_rot."""
    found = data.get("mrot")
    if not found:
        return None, ""
    inner, error = np.array(found["mrot"]), found["error"]
    figure, axis = plt.subplots(figsize=(5, 4), layout="constrained")
    axis.loglog(inner, error[0] / inner**2, color=PALE, lw=1, label="∝ 1/m_rot²")
    axis.loglog(inner, error, "o", color=OURS, label="fix_nosquish.rotor")
    axis.set_xlabel("m_rot")
    axis.set_ylabel("largest error of q")
    axis.legend(frameon=False)
    return figure, (
        f"Free rotors with the dimer's moments at {found['temperature']:g} K, Δt = {found['dt_fs']:g} fs, against the exact top in "
        "Jacobi's elliptic functions."
    )


def recursion(data):
    """Energy against time, where a conserved quantity exists and where it does not."""
    found = data.get("recursion")
    if not found:
        return None, ""
    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    time = np.array(found["time"])
    for (name, values), colour in zip(found["energy"].items(), (OURS, THIRD)):
        axis.plot(time, np.array(values) - values[0], color=colour, label=name)
    axis.plot(
        time, found["gain"] * time, color=INK, lw=1, ls=":", label="Δt² × average of G⁽¹⁾·∇H⁽⁰⁾"
    )
    axis.set_xlabel("time")
    axis.set_ylabel("H − its start")
    axis.legend(frameon=False)
    return figure, (
        "Two oscillators (m = ω = 1) by velocity Verlet, and by a scheme that adds to the force one of order Δt² without potential. That scheme is "
        "reversible and keeps phase-space volume, too, but (2.30) cannot be met, and the energy drifts at the rate that (2.30) tells."
    )


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    captions = {
        "reversal.png": "Distance from the start after N steps and back.",
        "conserved.png": "Spread of the energy and of the conserved quantity.",
    }
    figures = [Figure(*one) for one in captions.items()]
    return of_checks(summary, TITLES, "numbers that the paper's theory bounds", figures=figures)
