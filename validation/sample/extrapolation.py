"""``sample --to-zero``: averages of one scheme in the limit of small steps, from long ones.

`limit.extrapolate` fits the means.  The variance of U0 comes mostly from the shortest step.  For a
given longest step, the variance at equal cost is smallest if the shortest step is about a third of
the longest one and gets nine tenths of the time.  So the default steps are a third, two thirds and
all of the longest one; the one in the middle shows whether the square of the step suffices.
"""

from collections.abc import Collection, Mapping, Sequence
from math import floor, hypot, inf

import numpy as np
from matplotlib.figure import Figure as Drawing

from ..experiment import Point
from ..pages import Cell, Column, Figure, Report, Table
from ..pages.figures import BLUE, INK, message, panels
from ..statistics import limit
from ..statistics.estimate import CONFIDENCE, SURE, Estimate
from .observables import BY_KEY, CONFIGURATIONS
from .plan import Plan

TOLD = 0.5  # largest error by terms that the steps cannot determine, relative to that by noise
BESIDE = 1.0  # fs, step of a run for comparison of the cost
HALF = 0.5  # fs, to which default steps are rounded
NOTES = {
    "at zero": "U₀ of U(h) = U₀ + a h² + b h⁴ + c h⁶, fitted to the means at all steps. Of what "
    f"the longest step is off, {limit.SHARE:g} is taken for the size of the term in h⁴, and "
    f"{limit.SHARE**2:.2g} for that of h⁶: these are standard errors of terms that are zero. So "
    "the interval has what the means do not tell of them. This holds up to two thirds of the step "
    "at which the scheme fails.",
    "terms": "h²: a line in the square of the step agrees with the means. h⁴: it does not "
    f"({SURE}), and the term in h⁴ is needed. refused: the means fit no such series.",
    "χ²": "Of the means beside the fit, with the degrees of freedom that are left. A fit is "
    "refused where it is so large by chance in one of twenty commands at most.",
    "fewer steps": f"Steps of a run at {BESIDE:g} fs with the same error, over those of these "
    "runs. Of the time somewhat less: at long steps lists of neighbours are built more often.",
}


def points(plan: Plan, only: Sequence[str] | None, steps: Collection[float] | None) -> list[Point]:
    """The points to run: one scheme, by default the first of this package's (the script's own if it
    is one), at ``steps`` (fs) or the default ones.

    Raises:
        SystemExit: there is not exactly one scheme, or its averages are no series in the step.
    """
    ours = (name for name, scheme in plan.schemes.items() if scheme.ours)
    names = only or [next(ours, plan.known[0].scheme)]
    if len(names) > 1:
        raise SystemExit(f"--to-zero takes one scheme, not {', '.join(names)}")
    scheme = plan.schemes[names[0]]
    if any("moments step" in line for line in scheme.lines):
        raise SystemExit(
            f"{scheme.label}: with 'moments step' the moments of inertia depend on the step, so "
            "the averages are no series in it: give fixed moments, such as 'moments equal 6'"
        )
    if scheme.refined or scheme.reach == inf:
        raise SystemExit(
            f"{scheme.label}: its averages have no error in the square of the step, so "
            "--to-zero does not apply"
        )
    longest = plan.longest or min(scheme.reach or inf, max(scheme.steps))
    dts = sorted(set(steps or default_steps(longest)))
    if len(dts) < 2:
        raise SystemExit("--to-zero needs two steps or more: --dt FS,FS")
    return [Point(names[0], dt) for dt in dts]


def default_steps(longest: float) -> tuple[float, ...]:
    """The default steps, fs: rounded down, unless they are very short."""
    return tuple(
        floor(dt / HALF) * HALF if longest >= 3 * HALF else dt
        for dt in (longest * part / 3 for part in (1, 2, 3))
    )


def extrapolate(rows: Sequence[Mapping], time: float) -> dict[str, dict]:
    """Averages at step zero, by observable, except for a pressure that a barostat controls.

    Args:
        rows: of `measure.summarize`, of one scheme.
        time: ps of each start.

    Returns:
        plain data: the number and its interval at zero, if there is one, or ``why`` there is none;
        ``means``, pairs of steps and numbers; ``chi2``, ``left`` and ``probability`` of the fit,
        and whether ``h4`` is needed; ``wide``, whether the steps leave it largely undetermined;
        ``curve``, factors of powers of the square of the step over that of the longest; ``fewer``,
        ratio of the steps of a run at `BESIDE` to those of this.
    """
    good = {row["dt"]: row for row in rows if not row["error"]}
    averages: dict[str, dict] = {}
    for key in CONFIGURATIONS:
        means = {dt: row["means"][key] for dt, row in good.items() if key in row["means"]}
        controlled = key == "pressure" and any("density" in row["means"] for row in good.values())
        if means and not controlled:
            fit = limit.extrapolate({dt: Estimate.of(mean) for dt, mean in means.items()})
            averages[key] = {"means": [*means.items()], "why": "only one step tells a mean"}
            if fit:
                starts = {dt: row["starts"] for dt, row in good.items()}
                averages[key] |= _of_fit(
                    fit, {dt: time * starts[dt] for dt in means if dt in fit.points}
                )
    for average in averages.values():
        if average.get("left") and average["probability"] * len(averages) < 1 - CONFIDENCE:
            average["why"] = "the means fit no series in the square of the step"
    return averages


def _of_fit(fit: limit.Fit, times: Mapping[float, float]) -> dict:
    """The part of `extrapolate` from a fit, with ps of each step."""
    line = limit.extrapolate({dt: fit.points[dt] for dt in times}, powers=1)
    assert line is not None
    parts = {key: weight * fit.points[key].normal_error for key, weight in fit.weights.items()}
    noise = hypot(*(parts[dt] for dt in times))
    size = [fit.points[dt].normal_error ** 2 * time for dt, time in times.items()]
    steps, beside = sum(time / dt for dt, time in times.items()), np.mean(size) / BESIDE
    return fit.limit.plain() | {
        "chi2": fit.chi2,
        "left": fit.freedom,
        "probability": fit.probability,
        "h4": not line.agrees,
        "wide": hypot(*(parts[key] for key in parts.keys() - times.keys())) > TOLD * noise,
        "curve": fit.terms,
        "fewer": float(beside / fit.limit.normal_error**2 / steps),
        "why": None,
    }


# ---- report


def describe(summary: Mapping) -> Report:
    """The report on averages at step zero."""
    zero, rows = summary["zero"], summary["rows"]
    settings, lines = summary["settings"], {row["label"]: row["lines"] for row in rows}
    starts = f"{settings['starts']} start" + "s" * (settings["starts"] != 1)
    length = f"{settings['time']:g} ps of each step from {starts}"
    label, words = next(iter(lines.items()), ("No run has ended", []))
    return Report(
        f"Averages at step zero: {summary['title']}",
        "What are averages in the limit of small steps?",
        " ".join(_answer(key, average) for key, average in zero.items())
        or "No run tells an average.",
        lines=[f"{label}, {length}, after {settings['settle']:g} ps of equilibration."]
        + [
            f"{BY_KEY[key].title}: these steps leave open how large the term in h⁴ is, and much of "
            f"the interval is for this: add a step, at best about {average['means'][0][0] / 2:.2g} "
            "fs (--dt)."
            for key, average in zero.items()
            if not average["why"] and average["wide"]
        ],
        tables=[_table(zero)] if zero else [],
        figures=[
            Figure("to-zero", lambda: figure(summary), " ".join((figure.__doc__ or "").split()))
        ],
        notes=NOTES | {"input": " / ".join(words)},
        failures=[
            f"{row['label']}, {row['dt']:g} fs: {row['error']}" for row in rows if row["error"]
        ],
    )


def unit(key: str) -> str:
    """The unit of a mean."""
    return BY_KEY[key].of_mean if BY_KEY[key].relative else BY_KEY[key].unit


def _answer(key: str, average: Mapping) -> str:
    title = BY_KEY[key].title
    if not average["why"]:
        return f"{title}: {Estimate.of(average).text()} {unit(key)}".strip() + "."
    steps, chi2, advice = ", ".join(f"{dt:g}" for dt, _ in average["means"]), "", "add steps"
    if "chi2" in average:
        chi2 = f" (χ² is {average['chi2']:.1f} with {average['left']} degrees of freedom)"
        advice = "leave out the longest step"
    return f"{title}: no number, for {average['why']} at {steps} fs{chi2}: {advice} (--dt)."


def _table(zero: Mapping[str, Mapping]) -> Table:
    dts = sorted({dt for average in zero.values() for dt, _ in average["means"]})
    columns = [
        Column("title", "average", kind="text"),
        Column("unit", "unit", kind="text"),
        *(Column(f"{dt:g}", f"{dt:g} fs", kind="estimate") for dt in dts),
        Column("zero", "at zero", kind="estimate"),
        Column("terms", "terms", kind="verdict"),
        Column("chi2", "χ²", kind="text"),
        Column("fewer", "fewer steps", "times", "number", ".2g"),
    ]
    rows = []
    for key, average in zero.items():
        row: dict = {"title": BY_KEY[key].title, "unit": unit(key), "terms": "refused"}
        row |= {f"{dt:g}": mean for dt, mean in average["means"]}
        if "chi2" in average:
            row["chi2"] = Cell(f"{average['chi2']:.1f} ({average['left']})", average["chi2"])
        if not average["why"]:
            row |= {
                "zero": average,
                "terms": "h⁴" if average["h4"] else "h²",
                "fewer": average["fewer"],
            }
        rows.append(row)
    return Table("Averages", columns, rows, "averages")


def figure(summary: Mapping) -> Drawing | None:
    """Averages against the square of the step, and the fit. Whiskers: 95 % intervals, at zero that
    of the limit."""
    averages = {key: average for key, average in summary["zero"].items() if not average["why"]}
    if not averages:
        return None
    drawn, axes = panels(len(averages), 3, 3.6, 2.8, 0.5)
    for (key, average), axis in zip(averages.items(), axes):
        steps = np.array([dt for dt, _ in average["means"]])
        means = [Estimate.of(mean) for _, mean in average["means"]]
        x = np.linspace(0, 1, 101)
        axis.plot(
            x * steps.max() ** 2, np.polynomial.Polynomial(average["curve"])(x), color=BLUE, lw=1.2
        )
        how: dict = {"fmt": "o", "ms": 5, "lw": 1.2, "capsize": 2}
        values, margins = [mean.value for mean in means], [mean.margin for mean in means]
        axis.errorbar(steps**2, values, margins, color=BLUE, **how)
        axis.errorbar([0], [average["value"]], [Estimate.of(average).margin], color=INK, **how)
        axis.set(
            xlabel="step² (fs²)", ylabel=f"{BY_KEY[key].title} ({unit(key)})".replace(" ()", "")
        )
    message(drawn, f"Step zero: {_answer(*next(iter(averages.items())))[:-1]}")
    return drawn
