"""The figures of ``ensembles``."""

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from ..pages.figures import INK, OTHERS, OURS, PALE, THIRD, Drawn
from ..statistics.estimate import SURE, Estimate
from .criteria import BOUNDS, MOLECULE
from .lengths import Point
from .plan import REFERENCES, SCHEMES, beside_which, label, reference

STYLES = {  # of schemes: colour, marker
    "langevin-5": (OURS, "o"),
    "langevin-20": ("#2fa37c", "D"),
    "langevin-20-equal": ("#5ab4d6", "d"),
    "csvr": ("#8a8f2a", "s"),
    "nh": ("#c3b84c", "X"),
    "rigid/nvt/small": (OTHERS, "s"),
    "rigid+langevin": ("#2f4b7c", "^"),
    "shake+langevin": ("#7a5195", "v"),
    "nosquish+langevin": (THIRD, "P"),
    "npt-langevin": (OURS, "o"),
    "npt-csvr": ("#8a8f2a", "s"),
    "npt-mtk": ("#c3b84c", "X"),
    "shake+npt": ("#7a5195", "v"),
    "rigid/npt/small": (OTHERS, "s"),
}
LINEAR = 0.02  # kcal/mol a molecule up to which the axis is linear
TICKS = 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5
BESIDE = 0.06  # fs between marks of schemes, so that none hides another


def bias(summary: dict) -> Drawn:
    """Bias of the mean potential energy against the time step, at constant volume."""
    what = f"bias of the mean potential energy\n({MOLECULE})"
    drawn, known = _against_step(summary, "bias", REFERENCES[0], what)
    if drawn is None:
        return None
    (axis,) = drawn.axes
    ticks = [sign * one for one in TICKS for sign in (-1, 1)]
    axis.set_yscale("symlog", linthresh=LINEAR, linscale=1.5)
    axis.set_yticks([0, *ticks], ["0", *(f"{one:+g}" for one in ticks)])
    axis.minorticks_off()
    reach = max(abs(one.value) + one.margin for one in known)
    low = min(one.value - one.margin for one in known)
    axis.set_ylim(min(1.2 * low, -1.2 * LINEAR), max(1.2 * reach, 1.2 * LINEAR))
    return drawn, _caption("mean potential energy", REFERENCES[0]) + (
        f" The axis is linear up to ±{LINEAR:g} and logarithmic beyond."
    )


def density(summary: dict) -> Drawn:
    """Bias of the mean density against the time step, at constant pressure."""
    what = "bias of the mean density (%)"
    drawn, _ = _against_step(summary, "density_bias", REFERENCES[1], what)
    return (drawn, _caption("mean density", REFERENCES[1])) if drawn else None


def _against_step(
    summary: dict, key: str, limit: Point, what: str
) -> tuple[Figure | None, list[Estimate]]:
    """A number of the rows against the time step, with the bounds of the reference's scheme, and
    all these numbers; None if there is none."""
    known: dict[str, list[tuple[float, Estimate]]] = {}
    for row in summary["rows"]:
        if row.get(key) and beside_which(Point(row["scheme"], row["dt"])) == limit:
            known.setdefault(row["scheme"], []).append((row["dt"], Estimate.of(row[key])))
    if not known:
        return None, []
    figure, axis = plt.subplots(figsize=(8.5, 5.2), layout="constrained")
    axis.axhline(0, color=INK, lw=0.8)
    steps = sorted({dt for points in known.values() for dt, _ in points})
    names = [name for name in STYLES if reference(SCHEMES[name]) == limit]
    for one in BOUNDS:
        if one.key == key and one.scheme == limit.scheme and one.dt in steps:
            half = 0.5 * BESIDE * len(names) + BESIDE
            ends = [one.dt - half, one.dt + half]
            axis.fill_between(ends, -one.within, one.within, color=PALE, alpha=0.4, lw=0)
    for i, name in enumerate(names):
        points = sorted(known.get(name, []))
        if points:
            colour, marker = STYLES[name]
            aside = BESIDE * (i - (len(names) - 1) / 2)
            axis.errorbar(
                [dt + aside for dt, _ in points],
                [one.value for _, one in points],
                [one.margin for _, one in points],
                color=colour, marker=marker, ms=5, lw=1.1, elinewidth=1.1, capsize=2.5,
                label=SCHEMES[name].label,
            )  # fmt: skip
    axis.set_xticks(steps, [f"{dt:g}" for dt in steps])
    axis.set(xlabel="time step (fs)", ylabel=what)
    axis.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure, [one for points in known.values() for _, one in points]


def _caption(what: str, limit: Point) -> str:
    return (
        f"Distance of the {what} from that of {label(limit)}; whiskers: {SURE} intervals, the "
        f"reference's included. Shaded: the bounds of {SCHEMES[limit.scheme].label}."
    )
