"""The figures of ``sample``: their docstrings are their captions."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from ..pages.figures import BLUE, GREEN, INK, ORANGE, PURPLE, RED, SKY, label_ends, message, panels
from ..statistics.estimate import Estimate
from ..statistics.precision import BiasAndNoise
from . import answers
from .criteria import BOUNDS
from .observables import BY_KEY, warmer

# of these, and of the best of the others
STYLES = (ORANGE, "v"), (GREEN, "s"), (BLUE, "o"), (SKY, "D"), (PURPLE, "P"), (RED, "^"), (INK, "X")
PER_DAY = 86.4  # ns, of 1 s per ps
WARM = 4.0  # K, up to which the axis of a temperature is linear
LINEAR = 4  # bounds up to which the axis of a bias is linear: steps that are too long go far beyond
TIMES = np.geomspace(1e1, 1e6, 201)  # s of a core


def precision(summary: Mapping) -> Figure | None:
    """Total error of averages, from bias and noise, against CPU time. Each line is a scheme, with
    its best step at each time; numbers at the marks are steps in fs. The error of a bias counts as
    bias, because these runs cannot exclude it. Dashed: the bounds."""

    def draw(axis: Axes, key: str, rows: list[dict], colour: str, marker: str):
        numbers = ((row["biases"][key], row["noise"][key]) for row in rows)
        errors = np.array([BiasAndNoise(*map(Estimate.of, both)).error(TIMES) for both in numbers])
        best = np.argmin(errors, axis=0)
        line = errors[best, np.arange(len(TIMES))]
        axis.plot(TIMES, line, color=colour, lw=1.6)
        for at in np.flatnonzero(np.diff(best, prepend=-1)):
            axis.plot(TIMES[at], line[at], marker, color=colour, ms=5)
            _name_step(axis, rows[best[at]], TIMES[at], line[at], colour)
        return TIMES[-1], line[-1]

    def scale(axis: Axes, key: str) -> None:
        axis.set(xscale="log", yscale="log", xlabel="CPU time (s)")
        axis.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter(NullFormatter())

    title = "speed-up at the same error of U/N, over {rival}:\n{gain}"
    return _panels(summary, "noise", "total error", title, draw, scale)


def bias(summary: Mapping) -> Figure | None:
    """Distance of averages from the limit of small steps, against the time step. Bars: 95 %
    intervals, which include the error of the limit. Dashed: the bounds. The axis is linear up to 4
    times a bound, and logarithmic beyond."""

    def draw(axis: Axes, key: str, rows: list[dict], colour: str, marker: str):
        values = [Estimate.of(row["biases"][key]) for row in rows]
        return _bars(axis, [row["dt"] for row in rows], values, colour, marker)

    def scale(axis: Axes, key: str) -> None:
        axis.axhline(-BOUNDS[key], color=INK, lw=0.8, ls="--")
        _log_beyond(axis, LINEAR * BOUNDS[key])
        axis.set_xlabel("time step (fs)")

    title = "U/N is off by {bias} kcal/mol"
    return _panels(summary, "biases", "bias", title, draw, scale)


def temperature(summary: Mapping) -> Figure | None:
    """The bias of the mean potential energy as a temperature, divided by the heat capacity, against
    the speed: right and near zero is better. Numbers at the marks are steps in fs. Bars: 95 %
    intervals. The axis is linear up to 4 K, and logarithmic beyond."""
    limits = summary["limits"]
    warm = {
        (row["scheme"], row["dt"]): change
        for row in summary["rows"]
        if row["cost"] and (change := warmer(row["biases"], limits))
    }
    if not warm:
        return None
    rows = [row for row in summary["rows"] if (row["scheme"], row["dt"]) in warm]
    figure, (axis,) = panels(1, 1, 9.0, 3.6, 0.6)
    ends = []
    for line, style in zip(_lines(rows, summary["known"]), STYLES):
        speeds = [PER_DAY / row["cost"]["median"] for row in line]
        values = [warm[row["scheme"], row["dt"]] for row in line]
        ends.append((*_bars(axis, speeds, values, *style), line[0]["label"], style[0]))
        for row, speed, value in zip(line, speeds, values):
            _name_step(axis, row, speed, value.value, style[0])
    axis.axhline(0, color=INK, lw=0.8)
    _log_beyond(axis, WARM)
    axis.set(xlabel="speed (ns/day, one core)", ylabel="error of the energy (K)")
    for of_energy in answers.table([summary]).rows[:1]:
        off = warmer({"potential": of_energy["bias"]}, limits)
        where = f"{of_energy['scene']}, {of_energy['dt']:g} fs"
        message(figure, f"{where}: the energy is off by {off.text()} K" if off else "")
    label_ends(axis, ends)
    return figure


def _log_beyond(axis: Axes, linear: float) -> None:
    """Make the axis of values logarithmic beyond the linear range, if there are any."""
    if max(map(abs, axis.get_ylim())) > linear:
        axis.set_yscale("symlog", linthresh=linear)


def _name_step(axis: Axes, row: Mapping, x: float, y: float, colour: str) -> None:
    """Write a row's step beside its mark."""
    where: dict = {"textcoords": "offset points", "xytext": (4, 4), "fontsize": 8}
    axis.annotate(f"{row['dt']:g}", (x, y), color=colour, **where)


def _bars(
    axis: Axes, x: Sequence[float], values: Sequence[Estimate], colour: str, marker: str
) -> tuple[float, float]:
    """A line of values with their 95 % intervals; its end."""
    middle = [estimate.value for estimate in values]
    how: dict = {"marker": marker, "ms": 5, "lw": 1.2, "capsize": 2}
    axis.errorbar(x, middle, [estimate.margin for estimate in values], color=colour, **how)
    return x[-1], middle[-1]


def _panels(
    summary: Mapping, part: str, what: str, title: str, draw: Callable, scale: Callable
) -> Figure | None:
    """Draw a panel for each observable with a bound, and a line for each of `_lines`.

    Args:
        part: key of the numbers in a row.
        what: their name; ``title``: the message on their value at the answer's step.
        draw: draws a line, and returns its end.
        scale: sets the scales of an axis.
    """
    lines = _lines([row for row in summary["rows"] if row[part]], summary["known"])
    keys = [key for key in BOUNDS if any(key in row[part] for rows in lines for row in rows)]
    if not keys:
        return None
    figure, axes = panels(len(keys), 1, 9.0, 3.0, 0.6)
    ends: dict[Axes, list] = {axis: [] for axis in axes}
    for key, axis in zip(keys, axes):
        for rows, (colour, marker) in zip(lines, STYLES):
            if line := [row for row in rows if key in row[part]]:
                end = draw(axis, key, line, colour, marker)
                ends[axis].append((*end, line[0]["label"], colour))
        axis.axhline(BOUNDS[key], color=INK, lw=0.8, ls="--")
        scale(axis, key)
        axis.set_ylabel(f"{what} of {BY_KEY[key].title}\n({BY_KEY[key].unit})")
    for row in answers.table([summary]).rows[:1]:  # of the energy
        words = {
            "gain": answers.speed_up(row["gain"]),
            "rival": f"{row['rival']} at {row['rival dt']:g} fs",
            "bias": Estimate.of(row["bias"]).text(),
        }
        message(figure, f"{row['scene']}, {row['dt']:g} fs: {title.format(**words)}")
    for axis, labels in ends.items():
        label_ends(axis, labels)
    return figure


def _lines(rows: list[dict], known: list[Mapping]) -> list[list[dict]]:
    """The rows of what users have today, and of the other schemes, from the least noise on."""

    def noise(scheme: str) -> float:
        known = [row["noise"] for row in by_scheme[scheme] if "potential" in row["noise"]]
        return min((average["potential"]["value"] for average in known), default=np.inf)

    by_scheme: dict[str, list[dict]] = {}
    for row in rows:
        by_scheme.setdefault(row["scheme"], []).append(row)
    today = [point["scheme"] for point in known if point["scheme"] in by_scheme]
    return [by_scheme[scheme] for scheme in (*today, *sorted(by_scheme.keys() - today, key=noise))]
