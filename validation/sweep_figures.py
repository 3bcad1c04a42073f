"""Work-precision diagrams of a sweep: error against run time, both logarithmic, a line for each integrator through its time steps."""

import itertools
import textwrap

import matplotlib
import matplotlib.pyplot as plt
import numpy as np

from validation.bench_figures import MARKS, MISSED
from validation.check import SURE
from validation.figures import PALE, draw_each
from validation.sweep_choice import bound, is_zero, margin_of
from validation.sweep_plan import OURS, SHORT

MAIN = "energy_sd", "drift", "paper"  # the first of these that a scene has is its main figure
SHOWN = SHORT  # in all panels; tolerances and mrot have one of their own
VARIED = OURS, "shake", "rattle"  # beginnings of the names in that panel
TOLD = 0.25  # of a panel's points have to be told from zero, else it shows noise and is left out
GROUPS = {  # name of the file: (title, measures)
    "energy": ("Energy", ("energy_sd", "energy_sd_line", "drift", "paper")),
    "trajectory": ("Trajectory", ("position", "orientation")),
    "thermodynamics": (
        "Thermodynamics",
        (
            "potential",
            "equipartition",
            "pressure",
            "convergence",
            "ke_distribution",
            "pv_equipartition",
        ),
    ),
    "structure": ("Structure", ("g_oo", "helix")),
    "constraints": ("Constraints", ("bond", "angle")),
}
FAMILIES = MARKS | {
    "matubayasi-nakahara": ("#3d9fb0", "P"),
    "gear": ("#a6a11f", "X"),
}  # the beginning of an integrator's name: colour, marker
DASHES = (
    "-",
    (0, (4, 1.5)),
    (0, (1, 1.2)),
    (0, (4, 1.2, 1, 1.2)),
    (0, (7, 2)),
    (0, (1, 3)),
)  # of one family, in turn
READ = (
    f"Left and down is better. Whiskers: the error's {SURE} interval; run time from the least of its repeats, where the point stands, to their "
    f"median. A pale point with an arrow is what an error is at most (the end of its {SURE} interval) where it cannot be told from zero; a hollow point "
    "has no known error bar."
)


def draw(summary, out):
    """All figures that there are numbers for: {scene: list of (PNG path, caption)}, the main figure first."""
    looks = styles(point for scene in summary["scenes"].values() for point in scene["points"])
    return {
        name: draw_each(_of_scene(name, scene, summary["measures"], looks), out)
        for name, scene in summary["scenes"].items()
    }


def styles(points):
    """How each integrator is drawn, alike in all panels and scenes: name to keywords of matplotlib.

    The beginning of the name says colour and marker; dashes tell those with the same beginning apart, from the first that occurs.
    """
    found, used = {}, {}
    spare = itertools.cycle(("#6b6b6b", marker) for marker in "*hp<>d")
    for point in points:
        name = point["integrator"]
        if name not in found:
            family = max(
                (start for start in FAMILIES if name.startswith(start)), key=len, default=name
            )
            colour, marker = FAMILIES[family] if family in FAMILIES else next(spare)
            turn = used[family] = used.get(family, -1) + 1
            bold = dict(lw=2.2, ms=6.5, zorder=4) if name == OURS else dict(lw=1.2, ms=5, zorder=3)
            found[name] = (
                dict(
                    color=colour, marker=marker, ls=DASHES[turn % len(DASHES)], label=point["label"]
                )
                | bold
            )
    return found


def _of_scene(name, scene, measures, looks):
    """Functions for `draw_each`: the main figure, one for each group of measures that some point has, and one of tolerances and mrot."""
    points = _shown(scene)
    known = [
        measure for measure in scene["measures"] if any(_drawn(point, measure) for point in points)
    ]

    def named(stem, function, *data):
        def figure():
            return function(*data)

        figure.__name__ = stem
        return figure

    main = next((measure for measure in MAIN if measure in known), None)
    if main:
        yield named(name, _main, name, scene, main, measures, looks)
    for group, (title, members) in GROUPS.items():
        shown = [measure for measure in members if measure in known]
        told = [measure for measure in shown if _is_told(points, measure)]
        if told and told != [main]:
            yield named(
                f"{name}-{group}",
                _group,
                name,
                points,
                title,
                told,
                [one for one in shown if one not in told],
                measures,
                looks,
            )
    varied = [point for point in scene["points"] if point["integrator"].startswith(VARIED)]
    if any(_drawn(point, main) and point["integrator"] not in SHOWN for point in varied):
        yield named(f"{name}-parameters", _parameters, name, varied, main, measures, looks)


def _shown(scene):
    """Points of the integrators that are `SHOWN`; of all if there are none."""
    return [point for point in scene["points"] if point["integrator"] in SHOWN] or scene["points"]


def _is_told(points, measure):
    """Whether enough of the points that have a measure can be told from zero."""
    drawn = [point for point in points if _drawn(point, measure)]
    return sum(not is_zero(point, measure) for point in drawn) >= TOLD * len(drawn)


def _main(name, scene, measure, measures, looks):
    """A panel, and above it the time steps of each integrator: its good ones, and the shortest that fails."""
    points = _shown(scene)
    rows = _by_integrator(points)
    height = 0.5 + 0.17 * len(rows)
    figure, (top, axis) = plt.subplots(
        2, 1, figsize=(10.5, 5.6 + height), layout="constrained", height_ratios=[height, 5.6]
    )
    _panel(axis, points, measure, looks, dts=True)
    for place, (key, row) in enumerate(rows.items()):
        good = [point["dt"] for point in row if not point["failed"]]
        bad = [point["dt"] for point in row if point["failed"]][:1]
        top.plot(good, [place] * len(good), "|-", color=looks[key]["color"], ms=4, lw=1)
        top.plot(bad, [place] * len(bad), "x", color=MISSED, ms=5)
    top.set_ylim(len(rows) - 0.5, -0.5)
    top.set_xscale("log")
    steps = sorted({point["dt"] for point in points})
    top.set_xticks(steps, [f"{dt:g}" for dt in steps], fontsize=8)
    top.minorticks_off()
    top.set_yticks(range(len(rows)), [looks[key]["label"] for key in rows], fontsize=8)
    top.tick_params(axis="y", length=0)
    top.set_title(
        "time steps (fs); a cross: fails (crash, blow-up or hang)", loc="left", fontsize=9, pad=3
    )
    axis.set_xlabel("run time (s per simulated ns)")
    axis.set_ylabel(_axis_title(measures[measure]))
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8.5)
    return figure, (
        f"{scene['title']}: {measures[measure]['title']} against run time, a line for each integrator through its time steps; the numbers are some "
        f"of these, in fs. {READ} Above, each integrator's good steps and the shortest that fails.{_differs(scene)}"
    )


def _differs(scene):
    differs = scene.get("differs")
    return f" {differs[0].upper()}{differs[1:]}." if differs else ""


def _group(name, points, title, shown, noise, measures, looks):
    """A panel for each measure."""
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    figure, axes = plt.subplots(
        lines,
        columns,
        figsize=(2.4 + 4.2 * max(2, columns), 3.8 * lines),
        squeeze=False,
        sharex=True,
        layout="constrained",
    )
    for axis in axes.flat[len(shown) :]:
        axis.set_visible(False)
    handles = {}
    for axis, measure in zip(axes.flat, shown):
        _panel(axis, points, measure, looks, dts=False)
        axis.set_title(
            textwrap.fill(measures[measure]["title"], 44), loc="left", fontsize=9, fontweight="bold"
        )
        axis.set_ylabel(measures[measure]["unit"])
        axis.set_xlabel("run time (s per simulated ns)")
        axis.tick_params(labelbottom=True)
        handles |= dict(zip(*reversed(axis.get_legend_handles_labels())))
    figure.legend(
        handles.values(), handles.keys(), loc="outside right upper", frameon=False, fontsize=8.5
    )
    left = (
        f" Not drawn, for less than {TOLD:.0%} of the points can be told from zero: {', '.join(noise)}."
        if noise
        else ""
    )
    return figure, f"{name}, {title.lower()}: errors against run time. {READ}{left}"


def _parameters(name, points, measure, measures, looks):
    """Ours with each mrot, and shake and rattle with each tolerance: the error times the square of the run time, which dt does not change if it is ~ dt^2."""
    scaled = [
        point | {"errors": {measure: point["errors"][measure] | {
            key: value and value * point["cost"]["min"] ** 2 for key, value in point["errors"][measure].items() if key in ("value", "error")}}}
        for point in points if _drawn(point, measure)
    ]  # fmt: skip
    figure, axis = plt.subplots(figsize=(10.5, 5), layout="constrained")
    _panel(axis, scaled, measure, looks, dts=False)
    axis.set_xlabel("run time (s per simulated ns)")
    axis.set_ylabel(textwrap.fill(f"{measures[measure]['title']} × (run time)²", 60))
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8.5)
    return figure, (
        f"{name}, mrot and tolerances: {measures[measure]['title']} times the square of the run time, which is level where the error goes with the square "
        f"of the time step. Lower is better at the same run time."
    )


def _panel(axis, points, measure, looks, dts):
    """Lines of all integrators; ``dts``: the points of ours and the longest steps of the others with their time steps."""
    axis.set_xscale("log")
    axis.set_yscale("log")
    floor = (
        min(
            (
                y
                for point in points
                if _drawn(point, measure) and (y := _height(point, measure)) > 0
            ),
            default=1.0,
        )
        / 2
    )
    reach = []
    for key, row in _by_integrator(points).items():
        row = [point for point in row if _drawn(point, measure)]
        if row:
            reach += _line(axis, row, measure, looks[key], floor)
        if dts:
            ours = key == OURS
            for point in row[0 if ours else -1 :]:
                below = dict(xytext=(-5, -5), ha="right", va="top", fontweight="bold", fontsize=8.5)
                style = below if ours else dict(xytext=(5, 4), ha="left", va="bottom", fontsize=7)
                place = point["cost"]["min"], max(_height(point, measure), floor)
                axis.annotate(
                    f"{point['dt']:g}",
                    place,
                    textcoords="offset points",
                    color=looks[key]["color"],
                    **style,
                )
    low, high = max(min(reach), floor / 5), max(reach)
    margin = max(1.3, (high / low) ** 0.06)
    axis.set_ylim(low / margin, high * margin)
    axis.grid(color=PALE, lw=0.4)
    for side in axis.xaxis, axis.yaxis:
        low, high = side.get_view_interval()
        side.set_major_locator(
            matplotlib.ticker.LogLocator(subs=(1, 2, 5) if high / low < 300 else (1,), numticks=9)
        )
        side.set_major_formatter(_tick)
        side.set_minor_formatter(matplotlib.ticker.NullFormatter())


def _line(axis, row, measure, look, floor):
    """One integrator's points, from the shortest step, those that can be told from zero joined; the lowest and highest ends of its whiskers."""
    x, usual = (np.array([point["cost"][key] for point in row]) for key in ("min", "median"))
    y = np.array([max(_height(point, measure), floor) for point in row])
    limit, hollow = (
        np.array([test(point, measure) for point in row]) for test in (is_zero, _is_unknown)
    )
    margin = np.where(
        limit | hollow,
        0.0,
        [
            0.0 if unknown else margin_of(point["errors"][measure])
            for point, unknown in zip(row, hollow)
        ],
    )
    down = np.minimum(margin, 0.9 * y)
    axis.plot(x, np.where(limit, np.nan, y), **look)
    points = look | {"ls": "none", "label": None}
    for those, style in (limit, points | {"alpha": 0.5}), (~limit, points):
        bars = {
            "yerr": [down[those], margin[those]],
            "xerr": [np.zeros(those.sum()), usual[those] - x[those]],
        }
        axis.errorbar(x[those], y[those], capsize=1.5, elinewidth=0.8, **bars, **style)
    axis.plot(x[hollow], y[hollow], **points | {"mfc": "white", "zorder": 5})
    below = matplotlib.transforms.offset_copy(axis.transData, axis.figure, y=-6, units="points")
    axis.plot(
        x[limit],
        y[limit],
        **points
        | {"marker": matplotlib.markers.CARETDOWN, "ms": 4.5, "alpha": 0.7, "transform": below},
    )
    return [*(y - down), *(y + margin)]


def _tick(value, _):
    return (
        f"{value:g}"
        if 1e-3 <= value < 1e6
        else f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")
    )


def _by_integrator(points):
    """{integrator: its points, from the shortest step}"""
    found = {}
    for point in sorted(points, key=lambda point: point["dt"]):
        found.setdefault(point["integrator"], []).append(point)
    return {point["integrator"]: found[point["integrator"]] for point in points}


def _drawn(point, measure):
    return not point["failed"] and point["cost"] is not None and measure in point["errors"]


def _is_unknown(point, measure):
    return point["errors"][measure]["error"] is None


def _height(point, measure):
    """Where a point stands: its error, or what that is at most if it cannot be told from zero."""
    return bound(point, measure) if is_zero(point, measure) else point["errors"][measure]["value"]


def _axis_title(measure):
    return textwrap.fill(
        f"{measure['title']} ({measure['unit']})" if measure["unit"] else measure["title"], 70
    )
