"""Work-precision diagrams of a sweep: error against run time, both logarithmic, a line for each
integrator through its time steps."""

import itertools
import textwrap
from collections.abc import Iterable
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

from ..choice import Measured, bound, is_zero
from ..pages.figures import MARKS, MISSED, PALE, draw_each
from ..scenes.integrators import OURS
from ..statistics.estimate import SURE, Estimate
from .plan import SHORT

MAIN = "energy_sd", "drift", "paper"  # the first of these that a scene has is its main figure
SHOWN = SHORT  # in all panels; tolerances and mrot have one of their own
VARIED = OURS, "shake", "rattle"  # beginnings of the names in that panel
TOLD = 0.25  # of a panel's points have to be told from zero, else it shows noise and is left out
_PHYSICS = ("convergence", "ke_distribution", "pv_equipartition")
GROUPS = {  # measures, by the title; in lower case the name of the file
    "Energy": ("energy_sd", "energy_sd_line", "drift", "paper"),
    "Trajectory": ("position", "orientation"),
    "Thermodynamics": ("potential", "equipartition", "pressure", *_PHYSICS),
    "Structure": ("g_oo", "helix"),
    "Constraints": ("bond", "angle"),
}
# the beginning of an integrator's name: colour, marker
FAMILIES = MARKS | {"matubayasi-nakahara": ("#3d9fb0", "P"), "gear": ("#a6a11f", "X")}
# of one family, in turn
DASHES = ("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (4, 1.2, 1, 1.2)), (0, (7, 2)), (0, (1, 3)))
READ = (
    f"Left and down is better. Whiskers: the error's {SURE} interval; run time from the least of "
    "its repeats, where the point stands, to their median. A pale point with an arrow is what an "
    f"error is at most (the end of its {SURE} interval) where it cannot be told from zero; a "
    "hollow point has no known error bar."
)
TIME = "run time (s per simulated ns)"
BESIDE = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "frameon": False, "fontsize": 8.5}


def draw(summary: dict, out: Path) -> dict[str, list[tuple[Path, str]]]:
    """All figures that there are numbers for: of each scene (PNG path, caption), the main figure
    first."""
    scenes, measures = summary["scenes"], summary["measures"]
    looks = styles(point for scene in scenes.values() for point in scene["points"])
    return {
        name: draw_each(_of_scene(name, scene, measures, looks), out)
        for name, scene in scenes.items()
    }


def styles(points: Iterable[Measured]) -> dict[str, dict]:
    """How each integrator is drawn, alike in all panels and scenes: name to keywords of matplotlib.

    The beginning of the name says colour and marker; dashes tell those with the same beginning
    apart, from the first that occurs.
    """
    found: dict[str, dict] = {}
    used: dict[str, int] = {}
    spare = itertools.cycle(("#6b6b6b", marker) for marker in "*hp<>d")
    for point in points:
        name = point["integrator"]
        if name in found:
            continue
        family = max((one for one in FAMILIES if name.startswith(one)), key=len, default=name)
        colour, marker = FAMILIES[family] if family in FAMILIES else next(spare)
        turn = used[family] = used.get(family, -1) + 1
        found[name] = {"color": colour, "marker": marker, "label": point["label"]}
        found[name] |= {"ls": DASHES[turn % len(DASHES)], "lw": 1.2, "ms": 5, "zorder": 3}
        if name == OURS:
            found[name] |= {"lw": 2.2, "ms": 6.5, "zorder": 4}
    return found


def _of_scene(name, scene, measures, looks):
    """Functions for `draw_each`: the main figure, one for each group of measures that some point
    has, and one of tolerances and mrot."""
    points = _shown(scene)
    known = [one for one in scene["measures"] if any(_drawn(point, one) for point in points)]

    def named(stem, function, *data):
        def figure():
            return function(name, *data, measures, looks)

        figure.__name__ = stem
        return figure

    main = next((measure for measure in MAIN if measure in known), None)
    if main:
        yield named(name, _main, scene, main)
    for title, members in GROUPS.items():
        shown = [measure for measure in members if measure in known]
        told = [measure for measure in shown if _is_told(points, measure)]
        if told and told != [main]:
            noise = [one for one in shown if one not in told]
            yield named(f"{name}-{title.lower()}", _group, points, title, told, noise)
    varied = [point for point in scene["points"] if point["integrator"].startswith(VARIED)]
    if any(_drawn(point, main) and point["integrator"] not in SHOWN for point in varied):
        yield named(f"{name}-parameters", _parameters, varied, main)


def _shown(scene):
    """Points of the integrators that are `SHOWN`; of all if there are none."""
    return [point for point in scene["points"] if point["integrator"] in SHOWN] or scene["points"]


def _is_told(points, measure):
    """Whether enough of the points that have a measure can be told from zero."""
    drawn = [point for point in points if _drawn(point, measure)]
    return sum(not is_zero(point, measure) for point in drawn) >= TOLD * len(drawn)


def _main(name, scene, measure, measures, looks):
    """A panel, and above it the time steps of each integrator: its good ones, and the shortest that
    fails."""
    points = _shown(scene)
    rows = _by_integrator(points)
    heights = [0.5 + 0.17 * len(rows), 5.6]
    figure, (top, axis) = plt.subplots(
        2, 1, figsize=(10.5, sum(heights)), layout="constrained", height_ratios=heights
    )
    _panel(axis, points, measure, looks, dts=True)
    for place, (key, row) in enumerate(rows.items()):
        good = [point["dt"] for point in row if not point["failed"]]
        bad = [point["dt"] for point in row if point["failed"]][:1]
        top.plot(good, [place] * len(good), "|-", color=looks[key]["color"], ms=4, lw=1)
        top.plot(bad, [place] * len(bad), "x", color=MISSED, ms=5)
    top.set(xscale="log", ylim=(len(rows) - 0.5, -0.5))
    steps = sorted({point["dt"] for point in points})
    top.set_xticks(steps, [f"{dt:g}" for dt in steps], fontsize=8)
    top.minorticks_off()
    top.set_yticks(range(len(rows)), [looks[key]["label"] for key in rows], fontsize=8)
    top.tick_params(axis="y", length=0)
    told = "time steps (fs); a cross: fails (crash, blow-up or hang)"
    top.set_title(told, loc="left", fontsize=9, pad=3)
    title, unit = (measures[measure][key] for key in ("title", "unit"))
    axis.set(xlabel=TIME, ylabel=textwrap.fill(f"{title} ({unit})" if unit else title, 70))
    axis.legend(**BESIDE)
    differs = scene.get("differs")
    return figure, (
        f"{scene['title']}: {title} against run time, a line for each integrator through its time "
        f"steps; the numbers are some of these, in fs. {READ} Above, each integrator's good steps "
        f"and the shortest that fails."
        + (f" {differs[0].upper()}{differs[1:]}." if differs else "")
    )


def _group(name, points, title, shown, noise, measures, looks):
    """A panel for each measure."""
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    size = 2.4 + 4.2 * max(2, columns), 3.8 * lines
    figure, axes = plt.subplots(
        lines, columns, figsize=size, squeeze=False, sharex=True, layout="constrained"
    )
    for axis in axes.flat[len(shown) :]:
        axis.set_visible(False)
    handles: dict = {}
    for axis, measure in zip(axes.flat, shown):
        _panel(axis, points, measure, looks)
        heading = textwrap.fill(measures[measure]["title"], 44)
        axis.set_title(heading, loc="left", fontsize=9, fontweight="bold")
        axis.set(xlabel=TIME, ylabel=measures[measure]["unit"])
        axis.tick_params(labelbottom=True)
        handles |= dict(zip(*reversed(axis.get_legend_handles_labels())))
    place: dict = {"loc": "outside right upper", "frameon": False, "fontsize": 8.5}
    figure.legend(list(handles.values()), list(handles), **place)
    left = f" Not drawn, for less than {TOLD:.0%} of the points can be told from zero: "
    left = f"{left}{', '.join(noise)}." if noise else ""
    return figure, f"{name}, {title.lower()}: errors against run time. {READ}{left}"


def _parameters(name, points, measure, measures, looks):
    """Ours with each mrot, and shake and rattle with each tolerance: the error times the square of
    the run time, which dt does not change if it is ~ dt^2."""
    scaled = []
    for point in (one for one in points if _drawn(one, measure)):
        error, square = dict(point["errors"][measure]), point["cost"]["min"] ** 2
        error |= {key: error[key] and error[key] * square for key in ("value", "error")}
        scaled.append(point | {"errors": {measure: error}})
    figure, axis = plt.subplots(figsize=(10.5, 5), layout="constrained")
    _panel(axis, scaled, measure, looks)
    title = measures[measure]["title"]
    axis.set(xlabel=TIME, ylabel=textwrap.fill(f"{title} × (run time)²", 60))
    axis.legend(**BESIDE)
    return figure, (
        f"{name}, mrot and tolerances: {title} times the square of the run time, which is level "
        "where the error goes with the square of the time step. Lower is better at the same run "
        "time."
    )


def _panel(axis, points, measure, looks, dts=False):
    """Lines of all integrators; ``dts``: the points of ours and the longest steps of the others
    with their time steps."""
    axis.set(xscale="log", yscale="log")
    drawn = [point for point in points if _drawn(point, measure)]
    heights = (_height(point, measure) for point in drawn)
    floor = min((height for height in heights if height > 0), default=1.0) / 2
    reach = []
    for key, row in _by_integrator(drawn).items():
        reach += _line(axis, row, measure, looks[key], floor)
        for point in row[0 if key == OURS else -1 :] if dts else ():
            style = {"textcoords": "offset points", "color": looks[key]["color"]}
            style |= {"xytext": (5, 4), "ha": "left", "va": "bottom", "fontsize": 7}
            if key == OURS:
                style |= {"xytext": (-5, -5), "ha": "right", "va": "top", "fontsize": 8.5}
            style["fontweight"] = "bold" if key == OURS else "normal"
            place = point["cost"]["min"], max(_height(point, measure), floor)
            axis.annotate(f"{point['dt']:g}", place, **style)
    low, high = max(min(reach), floor / 5), max(reach)
    margin = max(1.3, (high / low) ** 0.06)
    axis.set_ylim(low / margin, high * margin)
    axis.grid(color=PALE, lw=0.4)
    for side in axis.xaxis, axis.yaxis:
        low, high = side.get_view_interval()
        digits = (1, 2, 5) if high / low < 300 else (1,)
        side.set_major_locator(matplotlib.ticker.LogLocator(subs=digits, numticks=9))
        side.set_major_formatter(_tick)
        side.set_minor_formatter(matplotlib.ticker.NullFormatter())


def _line(axis, row, measure, look, floor):
    """One integrator's points, from the shortest step, those that can be told from zero joined; the
    lowest and highest ends of its whiskers."""
    x, usual = (np.array([point["cost"][key] for point in row]) for key in ("min", "median"))
    y = np.array([max(_height(point, measure), floor) for point in row])
    limit = np.array([is_zero(point, measure) for point in row])
    hollow = np.array([point["errors"][measure]["error"] is None for point in row])
    margin = np.array([Estimate.of(point["errors"][measure]).margin for point in row])
    margin[limit | hollow] = 0.0
    down = np.minimum(margin, 0.9 * y)
    axis.plot(x, np.where(limit, np.nan, y), **look)
    points = look | {"ls": "none", "label": None}
    for those, style in (limit, points | {"alpha": 0.5}), (~limit, points):
        right = [np.zeros(those.sum()), usual[those] - x[those]]
        bars = {"yerr": [down[those], margin[those]], "xerr": right}
        axis.errorbar(x[those], y[those], capsize=1.5, elinewidth=0.8, **bars, **style)
    axis.plot(x[hollow], y[hollow], **points | {"mfc": "white", "zorder": 5})
    below = matplotlib.transforms.offset_copy(axis.transData, axis.figure, y=-6, units="points")
    arrow = {"marker": matplotlib.markers.CARETDOWN, "ms": 4.5, "alpha": 0.7, "transform": below}
    axis.plot(x[limit], y[limit], **points | arrow)
    return [*(y - down), *(y + margin)]


def _tick(value, _):
    if 1e-3 <= value < 1e6:
        return f"{value:g}"
    return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")


def _by_integrator(points):
    """{integrator: its points, from the shortest step}"""
    found: dict[str, list[Measured]] = {point["integrator"]: [] for point in points}
    for point in sorted(points, key=lambda point: point["dt"]):
        found[point["integrator"]].append(point)
    return found


def _drawn(point, measure):
    return not point["failed"] and point["cost"] is not None and measure in point["errors"]


def _height(point, measure):
    """Where a point stands: its error, or what that is at most if it cannot be told from zero."""
    return bound(point, measure) if is_zero(point, measure) else point["errors"][measure]["value"]
