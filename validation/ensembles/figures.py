"""The figure of ``ensembles``."""

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from validation.ensembles.criteria import BOUNDS, MOLECULE
from validation.ensembles.plan import REFERENCE, SCHEMES
from validation.pages.figures import INK, OTHERS, OURS, PALE, THIRD, Drawn
from validation.statistics.estimate import SURE, Estimate

STYLES = {  # of schemes: colour, marker
    "langevin-5": (OURS, "o"),
    "langevin-20": ("#2fa37c", "D"),
    "csvr": ("#8a8f2a", "s"),
    "nh": ("#c3b84c", "X"),
    "rigid/nvt/small": (OTHERS, "s"),
    "rigid+langevin": ("#2f4b7c", "^"),
    "shake+langevin": ("#7a5195", "v"),
    "nosquish+langevin": (THIRD, "P"),
}
LINEAR = 0.02  # kcal/mol a molecule up to which the axis is linear
TICKS = 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5
BESIDE = 0.06  # fs between marks of schemes, so that none hides another


def bias(summary: dict) -> Drawn:
    """Bias of the mean potential energy against the time step."""
    known: dict[str, list[tuple[float, Estimate]]] = {}
    for row in summary["rows"]:
        if row.get("bias"):
            known.setdefault(row["scheme"], []).append((row["dt"], Estimate.of(row["bias"])))
    if not known:
        return None
    figure, axis = plt.subplots(figsize=(8.5, 5.2), layout="constrained")
    axis.axhline(0, color=INK, lw=0.8)
    steps = sorted({dt for points in known.values() for dt, _ in points})
    for one in BOUNDS:
        if one.part == "potential" and one.scheme == REFERENCE.scheme and one.dt in steps:
            _bound(axis, one.dt, one.within)
    for name in SCHEMES:
        points = sorted(known.get(name, []))
        if points:
            colour, marker = STYLES[name]
            aside = BESIDE * (list(SCHEMES).index(name) - (len(SCHEMES) - 1) / 2)
            axis.errorbar(
                [dt + aside for dt, _ in points],
                [one.value for _, one in points],
                [one.margin for _, one in points],
                color=colour, marker=marker, ms=5, lw=1.1, elinewidth=1.1, capsize=2.5,
                label=SCHEMES[name].label,
            )  # fmt: skip
    ticks = [sign * one for one in TICKS for sign in (-1, 1)]
    axis.set_yscale("symlog", linthresh=LINEAR, linscale=1.5)
    axis.set_yticks([0, *ticks], ["0", *(f"{one:+g}" for one in ticks)])
    axis.minorticks_off()
    reach = max(abs(one.value) + one.margin for some in known.values() for _, one in some)
    low = min(one.value - one.margin for some in known.values() for _, one in some)
    axis.set_ylim(min(1.2 * low, -1.2 * LINEAR), max(1.2 * reach, 1.2 * LINEAR))
    axis.set_xticks(steps, [f"{dt:g}" for dt in steps])
    axis.set(xlabel="time step (fs)", ylabel=f"bias of the mean potential energy\n({MOLECULE})")
    axis.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure, (
        f"Distance of the mean potential energy from that of {REFERENCE.label}; whiskers: {SURE} "
        f"intervals, the reference's included. The axis is linear up to ±{LINEAR:g} and "
        f"logarithmic beyond. Shaded: the bounds of {SCHEMES[REFERENCE.scheme].label}."
    )


def _bound(axis: Axes, dt: float, within: float) -> None:
    """Shade what is allowed at a step."""
    half = 0.5 * BESIDE * len(SCHEMES) + BESIDE
    axis.fill_between([dt - half, dt + half], -within, within, color=PALE, alpha=0.4, lw=0)
