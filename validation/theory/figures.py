"""Figures of ``theory``, each of what its part gives as data."""

import functools
from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from ..pages.figures import INK, OTHERS, OURS, PALE, THIRD, Drawn, draw_each

LEAST = 1e-17  # shown for a zero
SMALL: dict = {"frameon": False, "fontsize": 8}  # a legend


def draw(data: dict, out: Path) -> list[tuple[Path, str]]:
    """All figures of the parts that there are: see `draw_each`."""
    every = reversal, symplectic, conserved, mrot, rotors, recursion
    return draw_each(map(_of_part, every), out, data)


def _of_part(draws: Callable[[dict], Drawn]) -> Callable[[dict], Drawn]:
    """A part's figure, or none if the part was not measured."""

    @functools.wraps(draws)
    def drawn(data: dict) -> Drawn:
        return draws(data) if draws.__name__ in data else None

    return drawn


def reversal(data: dict) -> Drawn:
    """Distance from the start against the number of steps, one panel for shake, one for rattle, one
    for all others."""
    found = data["reversal"]
    rows = [row for row in found["runs"] if not row["error"]]
    free = [row for row in rows if row["tolerance"] is None]
    panels = {"without a tolerance": free}
    panels |= {name: [row for row in rows if row["name"] == name] for name in ("shake", "rattle")}
    figure, axes = plt.subplots(1, 3, figsize=(13, 5.4), sharey=True, layout="constrained")
    for axis, (title, shown) in zip(axes, panels.items()):
        shades = plt.get_cmap("viridis")(np.linspace(0, 0.9, len(shown)))
        if shown is free:
            shades = plt.get_cmap("tab10")(np.arange(len(shown)))
        for row, shade in zip(shown, shades):
            how = {"color": shade, "lw": 1.4, "label": row["label"]}
            how |= {"color": OURS, "lw": 2.4} if row["name"] == "NVE" else {}
            how |= {"ls": (0, (2, 2))} if row["name"].endswith("small") else {}
            axis.loglog(found["steps"], np.maximum(row["distance"], LEAST), **how)
        axis.set_title(title, loc="left")
        axis.set_xlabel("steps forward, and as many back")
        if shown:
            axis.legend(**SMALL, ncols=2, loc="upper left", bbox_to_anchor=(-0.05, -0.14))
    axes[0].set_ylabel("distance from the start (Å)")
    return figure, (
        f"The furthest atom's distance from its start after so many steps of {found['dt_fs']:g} "
        "fs, velocities reversed, and as many steps, in LAMMPS: the dimer. What rounding leaves "
        "grows as the motion is chaotic: after some thousand steps nothing comes back."
    )


def symplectic(data: dict) -> Drawn:
    """The defect against the time step, and that of SHAKE against its tolerance."""
    found = data["symplectic"]
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for name, colour in ("NO_SQUISH", OURS), ("reference 12", OTHERS):
        for key, what, how in (
            ("defect", "|J g⁻¹ Jᵀ − g⁻¹|", {"marker": "o"}),
            ("volume", "|det J − 1|", {"marker": "x", "ls": ":"}),
        ):
            values = np.maximum(found[key][name], LEAST)
            left.loglog(found["dt_fs"], values, color=colour, label=f"{name}: {what}", **how)
    left.set_xlabel("Δt (fs)")
    label = "SHAKE/RATTLE in Python: |Jᵀ g J − g|"
    right.loglog(found["tolerance"], found["shake"], "o-", color=THIRD, label=label)
    right.invert_xaxis()
    right.set_xlabel("tolerance")
    for axis in left, right:
        axis.legend(**SMALL)
    return figure, (
        "One step of the dimer. Left: the symplectic property (2.42), and the volume of phase "
        "space. Right: the former, of atoms whose distances a model of SHAKE and RATTLE in Python "
        "keeps."
    )


def conserved(data: dict) -> Drawn:
    """The spread of H, with and without its corrections, against the time step."""
    found = data["conserved"]
    whole, dt = "H + Δt² H⁽²⁾", np.array(found["dt_fs"])
    words = {"": "H", "force": f"{whole}, force only", "rotor": f"{whole}, rotor only"}
    colours = {"": INK, "force": OTHERS, "rotor": THIRD}
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for axis, scheme, title, complete in (
        (axes[0], "NO_SQUISH", "dimer, NO_SQUISH", "both"),
        (axes[1], "free rotor", "free rotors", "rotor"),
    ):
        spread = found["spread"][scheme]
        for which, values in spread.items():
            how = {"color": OURS, "label": whole}
            if which != complete:
                how = {"color": colours[which], "label": words[which]}
            axis.loglog(dt, values, "o-", lw=1.5 if which else 4, **how)
        for which, order in ("", 2), (complete, 4):
            law = spread[which][0] * (dt / dt[0]) ** order
            axis.loglog(dt, law, color=PALE, lw=1, zorder=0)
        axis.set_title(title, loc="left")
        axis.set_xlabel("Δt (fs)")
        axis.legend(**SMALL)
    axes[0].set_ylabel("spread (kcal/mol)")
    return figure, (
        "Root mean square of the change since the start, along trajectories of the same length. "
        "Pale: Δt² and Δt⁴ through the first point."
    )


def mrot(data: dict) -> Drawn:
    """The free rotor's error against m_rot."""
    found = data["mrot"]
    inner, error = np.array(found["mrot"]), found["error"]
    figure, axis = plt.subplots(figsize=(5, 4), layout="constrained")
    axis.loglog(inner, error[0] / inner**2, color=PALE, lw=1, label="∝ 1/m_rot²")
    axis.loglog(inner, error, "o", color=OURS, label="fix_nosquish.motion.rotor")
    axis.set(xlabel="m_rot", ylabel="largest error of q")
    axis.legend(frameon=False)
    return figure, (
        f"Free rotors with the dimer's moments at {found['temperature']:g} K, "
        f"Δt = {found['dt_fs']:g} fs, against the exact top in Jacobi's elliptic functions."
    )


def rotors(data: dict) -> Drawn:
    """The error of the free rotation against how far a body turns in a step."""
    found = data["rotors"]
    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    shades = plt.get_cmap("viridis")(np.linspace(0, 0.8, len(found["error"])))
    for (name, error), shade in zip(found["error"].items(), shades):
        cost = found["cost"][name]["median"]
        how = {"color": OURS, "lw": 2.4} if name == "exact" else {"color": shade}
        axis.loglog(found["angles"], error, marker="o", label=f"{name}: {cost:.2f}", **how)
    axis.set_xticks(found["angles"], [f"{angle:g}" for angle in found["angles"]])
    axis.minorticks_off()
    axis.set(xlabel="turn in a step (rad, rms)", ylabel="error of the orientation (rad, rms)")
    axis.legend(**SMALL, title="time of a step, of the split one's", title_fontsize=8)
    return figure, (
        f"Free bodies with water's moments in the compiled loops, after {found['total']:g} rad, "
        "against the exact top in Jacobi's elliptic functions. At 298 K water turns by "
        f"{found['thermal']:.3f} rad in 1 fs. A step is the whole pass: forces of the atoms, "
        "kicks, motion, places."
    )


def recursion(data: dict) -> Drawn:
    """Energy against time, where a conserved quantity exists and where it does not."""
    found = data["recursion"]
    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    time, law = np.array(found["time"]), "Δt² × average of G⁽¹⁾·∇H⁽⁰⁾"
    for (name, values), colour in zip(found["energy"].items(), (OURS, THIRD)):
        axis.plot(time, np.array(values) - values[0], color=colour, label=name)
    axis.plot(time, found["gain"] * time, color=INK, lw=1, ls=":", label=law)
    axis.set(xlabel="time", ylabel="H − its start")
    axis.legend(frameon=False)
    return figure, (
        "Two oscillators (m = ω = 1) by velocity Verlet, and by a scheme that adds to the force "
        "one of order Δt² without potential. That scheme is reversible and keeps phase-space "
        "volume, too, but (2.30) cannot be met, and the energy drifts at the rate that (2.30) "
        "tells."
    )
