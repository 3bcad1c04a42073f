"""The figures of ``sample``."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..pages.figures import INK, OTHERS, OURS, PALE, THIRD, Drawn, panels
from ..statistics.estimate import SURE, Estimate
from ..statistics.precision import Worth
from .criteria import BOUNDS
from .observables import BY_KEY, CONFIGURATIONS

BESIDE = 0.06  # fs between marks of schemes, so that none hides another
STYLES = {  # of schemes: colour, marker; others have a colour of their place
    "langevin-5": (OURS, "o"),
    "langevin-20": ("#2fa37c", "D"),
    "langevin-20-equal": ("#5ab4d6", "d"),
    "csvr": ("#8a8f2a", "s"),
    "nh": ("#c3b84c", "X"),
    "rigid/nvt/small": (OTHERS, "s"),
    "rigid+langevin": ("#2f4b7c", "^"),
    "shake+langevin": ("#7a5195", "v"),
    "langevin-5-equal": ("#1b6ca8", "p"),
    "langevin-5-scaled": ("#1b6ca8", "p"),
    "langevin-20-scaled": ("#5ab4d6", "d"),
    "hmc": (INK, "*"),
    "hmc-equal": ("#7d8597", "*"),
    "hmc-scaled": ("#7d8597", "*"),
    "shake+nvt": ("#bfa5cf", "<"),
    "shake+csvr": ("#d45087", ">"),
    "shake-3+langevin": (THIRD, "P"),
    "shake-4+langevin": ("#e0b08f", "h"),
    "openmm-langevin-5": ("#b5651d", "p"),
    "openmm-langevin-20": ("#e8a25c", "h"),
    "gromacs-sd": ("#1f4e9e", "P"),
    "gromacs-v-rescale": ("#b00000", "X"),
}
LINEAR = 4  # bounds up to which the axis of a bias is linear: steps that are too long go far beyond
TIMES = np.geomspace(1e1, 1e6, 201)  # s of a core


def precision(summary: dict) -> Drawn:
    """The total error of each average against the time that is spent: of each scheme the best of
    its steps at any time."""
    made = _panels(summary)
    if made is None or not any(row["noise"] for row in summary["rows"]):
        return None
    figure, axes, by_scheme = made
    for key, axis in axes.items():
        for i, (scheme, rows) in enumerate(by_scheme.items()):
            timed = [row for row in rows if key in row["noise"]]
            errors = {row["dt"]: _worth(row, key).error(TIMES) for row in timed}
            if not errors:
                continue
            steps, values = list(errors), np.array(list(errors.values()))
            best = np.argmin(values, axis=0)
            line = values[best, np.arange(len(TIMES))]
            colour, marker = _style(scheme, i)
            axis.plot(TIMES, line, color=colour, lw=1.6, label=rows[0]["label"])
            for at in np.flatnonzero(np.diff(best, prepend=-1)):
                axis.plot(TIMES[at], line[at], marker, color=colour, ms=4)
                text = f"{steps[best[at]]:g}"
                where: dict = {"textcoords": "offset points", "xytext": (3, 3)}
                axis.annotate(text, (TIMES[at], line[at]), color=colour, fontsize=7.5, **where)
        if key in BOUNDS:
            axis.axhline(BOUNDS[key], color=INK, lw=0.8, ls="--")
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_xlabel("time of one core (s)")
        axis.set_ylabel(f"total error of {BY_KEY[key].title}\n({BY_KEY[key].unit})")
    _legend(figure, axes)
    return figure, (
        "Total error, of bias and noise, of averages against the time that one core spends. Of "
        "each scheme the best step at each time, in fs at the marks. The error of a bias counts "
        "as bias: it is what these runs cannot exclude. Dashed: the bounds."
    )


def bias(summary: dict) -> Drawn:
    """Bias of each average against the time step."""
    made = _panels(summary)
    if made is None:
        return None
    figure, axes, by_scheme = made
    for key, axis in axes.items():
        axis.axhline(0, color=INK, lw=0.8)
        if key in BOUNDS:
            axis.axhspan(-BOUNDS[key], BOUNDS[key], color=PALE, alpha=0.4, lw=0)
            known = [Estimate.of(row["biases"][key]) for row in summary["rows"] if _has(row, key)]
            if max(abs(one.value) + one.margin for one in known) > LINEAR * BOUNDS[key]:
                axis.set_yscale("symlog", linthresh=LINEAR * BOUNDS[key])
        for i, (scheme, rows) in enumerate(by_scheme.items()):
            some = [(row["dt"], Estimate.of(row["biases"][key])) for row in rows if _has(row, key)]
            colour, marker = _style(scheme, i)
            if some:
                axis.errorbar(
                    [dt + BESIDE * (i - len(by_scheme) / 2) for dt, _ in some],
                    [one.value for _, one in some],
                    [one.margin for _, one in some],
                    color=colour, marker=marker, ms=4.5, lw=1.1, elinewidth=1.1, capsize=2,
                    label=rows[0]["label"],
                )  # fmt: skip
        axis.set_xlabel("time step (fs)")
        axis.set_ylabel(f"bias of {BY_KEY[key].title}\n({BY_KEY[key].unit})")
    _legend(figure, axes)
    return figure, (
        f"Distance of averages from the limit of small steps that schemes share; whiskers: {SURE} "
        "intervals, the limit's error and its correlation with the point included. Shaded: the "
        f"bounds. Where there is one, the axis is linear up to {LINEAR} times it."
    )


def _panels(summary: dict) -> tuple[Figure, dict[str, Axes], dict[str, list[dict]]] | None:
    """A panel for each observable of which biases are known, and the rows of each scheme; None if
    there is none."""
    by_scheme: dict[str, list[dict]] = {}
    for row in summary["rows"]:
        by_scheme.setdefault(row["scheme"], []).append(row)
    keys = [key for key in CONFIGURATIONS if any(_has(row, key) for row in summary["rows"])]
    if not keys:
        return None
    figure, axes = panels(len(keys), 3, 4.4, 3.6, 1.0)
    return figure, dict(zip(keys, axes)), by_scheme


def _has(row: dict, key: str) -> bool:
    return key in row["biases"]


def _worth(row: dict, key: str) -> Worth:
    return Worth(Estimate.of(row["biases"][key]), Estimate.of(row["noise"][key]))


def _style(scheme: str, place: int) -> tuple[str, str]:
    return STYLES.get(scheme, (f"C{place % 10}", "o"))


def _legend(figure: Figure, axes: dict[str, Axes]) -> None:
    """One for all panels."""
    found: dict = {}
    for axis in axes.values():
        handles, labels = axis.get_legend_handles_labels()
        found |= dict(zip(labels, handles))
    figure.legend(found.values(), found.keys(), frameon=False, loc="outside lower center", ncols=3)
