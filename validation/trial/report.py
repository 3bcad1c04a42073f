"""From a trial of a script's integrators and steps to an answer, files and the terminal."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from ..choice import Choice, before_bad, bound, meets, nearest
from ..own import counted
from ..pages import report
from ..pages.said import Table
from ..pages.tables import ranks_of
from ..scenes.units import UNITS
from ..statistics.estimate import CONFIDENCE, SURE, Estimate, margin
from . import confirm, errors, lists, trial
from .figures import draw
from .targets import ENERGIES, judged

EACH = "Each integrator's fastest step"
FOUR_OF_FIVE = 0.84  # standard errors above the mean, below which a normal variable is so often
LEAST_ROOM = 0.25  # of a target, between it and the error that is counted on in telling a budget
FAR = 100  # times a budget: what is told of one so much larger, by few samples, is chance
MORE = 10  # times a budget, that is tried then
SKINS = "Skins of the neighbour lists, with the advised step"


def answer(summary: dict) -> tuple[Choice, list[str], list[str]]:
    """The fastest point within the targets, what is to be said of it, and lines for the script."""
    wanted, time = summary["targets"], UNITS[summary["units"]].time
    points, rest = _asked(summary)
    choice = _chosen(summary, points, wanted)
    told = [*_late(summary), *_untold(summary)]
    if points or not rest:
        told += _told(summary, points, choice, wanted, time)
    told += _uncounted(summary, rest, wanted, time, alone=not points)
    told += confirm.said(summary, time)
    return choice, told, _lines(summary, choice)


def _chosen(summary, points, targets) -> Choice:
    return trial.chosen(points, targets, summary["level"])


def _asked(summary) -> tuple[list, list]:
    """The points that were asked for: those with all targets, and those whose energy says
    nothing."""
    wanted, asked = summary["targets"], [one for one in summary["points"] if one["asked"]]
    if not any(one["cost"] for one in asked):  # of a Ctrl-C
        asked = trial.roughly(asked)
    points = [one for one in asked if judged(one, wanted) == wanted]
    return points, [one for one in asked if judged(one, wanted) != wanted]


def _late(summary) -> Iterator[str]:
    if summary["late"]:
        yield (
            "The budget was over before all steps were tried: it is small, or the machine is "
            "busier than when it began. The same command goes on."
        )


def _untold(summary) -> Iterator[str]:
    """Why nothing is said of g(r), where it is a target."""
    if "rdf" not in summary["targets"]:
        return
    time, asked = UNITS[summary["units"]].time, [one for one in summary["points"] if one["asked"]]
    told = {
        why: [one for one in asked if one["untold"] and one["untold"]["why"] == why]
        for why in (errors.SETTLING, errors.SHORT, errors.ERRATIC)
    }
    if told[errors.SETTLING]:
        yield (
            "The start is not in equilibrium: the mean potential energy changes within the run "
            "that means are held against. So g(r) cannot be decided. Equilibrate first, and take "
            "the later run by --run N."
        )
    if points := told[errors.SHORT]:
        yield (
            f"Runs of {points[0]['time']:.3g} {time} are shorter than {2 * errors.LEAST} "
            f"correlation times of g(r), so it cannot be decided. {_of_length(points, time)}"
        )
    if points := told[errors.ERRATIC]:
        steps = ", ".join(f"{one:g}" for one in sorted({one["dt"] for one in points}))
        yield (
            f"With {steps} {time} the error of g(r) does not follow the step, so it is noise, and "
            f"g(r) cannot be decided. {_of_length(points, time)}"
        )


def _of_length(points, time) -> str:
    """How long runs have to be to tell g(r)."""
    long = min(max(2.0, one["untold"]["longer"]) * one["time"] for one in points)
    return f"Runs of about {float(f'{long:.2g}'):g} {time} should tell."


def _uncounted(summary, points, wanted, time, alone) -> Iterator[str]:
    """Of those whose energy says nothing, the fastest that is good by the other targets; if they
    are ``alone``, also what to do where none is."""
    if not points:
        return
    labels = ", ".join(dict.fromkeys(one["label"] for one in points))
    lost = " and ".join(name for name in ENERGIES if name in wanted)
    yield f"Of {labels} nobody knows {lost}: {counted.WHY}."
    rest = judged(points[0], wanted)
    choice = _chosen(summary, points, rest) if rest else None
    if choice and choice.best:
        best = choice.best
        yield (
            f"But for that, {best['label']} with {best['dt']:g} {time} is within the targets: "
            f"{_within(best, rest)}. It takes {_cost(best)} s per {summary['ns']}."
        )
    elif choice and alone:
        yield f"What follows is by {', '.join(rest)} only."
        yield from _none(summary, points, choice, rest, time)
    elif alone:
        yield (
            "Nothing else is a target, so there is no answer. Give one that they tell (--target "
            "temperature=VALUE), or try integrators whose energy is counted (--only)."
        )


def _told(summary, points, choice, wanted, time) -> Iterator[str]:
    best = choice.best
    if best is None:
        yield from _none(summary, points, choice, wanted, time)
        return
    sure = f"Sure by {SURE}" if choice.sure else "Not sure by itself"
    yield (
        f"{best['label']} with a step of {best['dt']:g} {time}: {_cost(best)} s per "
        f"{summary['ns']}, on {ranks_of(summary['ranks'])}. {sure}: {_within(best, wanted)}."
    )
    yield from _judged_alone(summary, points, time)
    longer = [
        one for one in points if one["integrator"] == best["integrator"] and one["dt"] > best["dt"]
    ]
    bad = [one for one in longer if meets(one, wanted) is False]
    unknown = [one for one in longer if one in choice.perhaps and one not in bad]
    if not longer:
        yield (
            "This was the longest step that was tried: a longer one may be fine, too. Try it: "
            f"--steps {1.5 * best['dt']:g},{2 * best['dt']:g}"
        )
    elif unknown:
        some = ", ".join(f"{one['dt']:g}" for one in unknown)
        yield (
            f"Whether {some} {time} would do cannot be told from runs so short: a larger --budget "
            "tells."
        )
    elif bad:
        first = min(bad, key=lambda one: one["dt"])
        yield f"With {first['dt']:g} {time}: {_why_not(first, wanted)}."
    near = [one for one in trial.near_failure(points) if one in longer and one not in bad]
    if near:
        steps = ", ".join(f"{one['dt']:g}" for one in near)
        yield (
            f"{steps} {time} is too near to a step that fails to be named: what ends a run is rare "
            "there, and a longer one meets it."
        )
    if choice.ties:
        yield f"As fast, within the spread of the timings: {_named(choice.ties, time)}."
    others = [
        one for one in choice.perhaps if one["integrator"] != best["integrator"] and one["cost"]
    ]
    if others:
        yield f"As fast or faster, if they are within the targets: {_named(others, time)}."
    if tried := summary.get("lists"):
        yield _skin(tried)


def _judged_alone(summary, points, time) -> Iterator[str]:
    for one in points:
        if one["alone"]:
            yield (
                f"All steps ran for {summary['time']:.3g} {time}. The rest of the time went to "
                f"{one['label']}, {one['dt']:g} {time}: a run of {one['time']:.3g} {time}, which "
                "alone judges it."
            )


def _named(points, time) -> str:
    return "; ".join(f"{one['label']}, {one['dt']:g} {time}" for one in points[:4])


def _skin(tried) -> str:
    found, first = lists.fastest(tried), tried[0]["command"]
    if found is None:
        return f"A wider skin of the neighbour lists is not faster for sure than {first}."
    return (
        f"With {found['command']} in the place of {first} a step takes {_ratio(found)} of its "
        "time: longer steps need new lists sooner."
    )


def _ratio(one) -> str:
    return f"{one['median']:.2f} ({one['min']:.2f} to {one['max']:.2f})"


def _none(summary, points, choice, wanted, time):
    if not points:
        yield "No run is complete, so nothing is known yet."
        return
    if choice.perhaps:
        some = _named(choice.perhaps, time)
        yield (
            f"Not sure: no step is within the targets by {SURE}, but these may be: {some}. Their "
            "error bars, or those of shorter steps, reach across a target. "
            f"{_longer(summary, points, choice.perhaps, wanted)}"
        )
        yield from _judged_alone(summary, points, time)
        yield from _resolved(summary, points, choice.perhaps, wanted, time)
    else:
        yield (
            "No step that was tried is within the targets. Try shorter ones: --steps "
            f"{summary['dt'] / 2:g},{summary['dt'] / 4:g}. Or look at 'check' first: a start that "
            "is not in equilibrium drifts at any step."
        )
    held = next((one for one in summary["points"] if one["is_reference"]), None)
    if held and not held["failed"] and meets(held, wanted) is False:
        yield (
            f"Even with {held['dt']:g} {time} there is {_why_not(held, wanted)}: this is no error "
            "of the step. Is the start in equilibrium, and do forces end at their cutoff without a "
            "jump? --run N takes a later run of the script."
        )
    near = nearest(before_bad(points, wanted) or points, wanted)
    if near:
        one = near[0]
        alone = ""
        if meets(one, wanted):
            alone = (
                f" Of it alone this is sure by {SURE}; as one of several, or with all shorter "
                "steps of its integrator, it is not."
            )
        yield f"The nearest: {one['label']}, {one['dt']:g} {time}: {_within(one, wanted)}.{alone}"


def _longer(summary, points, perhaps, wanted) -> str:
    minutes = _telling(summary, points, perhaps, wanted)
    other = "a target that short runs can tell: --target NAME=VALUE"
    if minutes is None:
        return f"Give {other}."
    if minutes > FAR * summary["minutes"]:
        return (
            "Runs so short do not tell how long it takes: try about "
            f"--budget {MORE * summary['minutes']:g} first, in so many minutes. Or give {other}."
        )
    return f"About --budget {minutes} tells, in so many minutes. Or give {other}."


def _telling(summary, points, perhaps, wanted) -> int | None:
    """Minutes that tell whether one of the points is within the targets, as errors are now."""
    factors = []
    for one in perhaps:
        own = [point for point in points if point["integrator"] == one["integrator"]]
        before, level = [point for point in own if point["dt"] <= one["dt"]], summary["level"]
        if one["alone"]:
            before, level = [one], CONFIDENCE
        each = [_above(point, name, most, level) for point in before
                for name, most in wanted.items()]  # fmt: skip
        factors += [max(each)] * all(map(math.isfinite, each))
    if not factors:
        return None
    # the least that helps is some runs more
    return math.ceil(float(f"{summary['minutes'] * max(2.0, min(factors)):.2g}"))


def _minutes(summary) -> int | None:
    """Minutes that tell what `answer` cannot; None where it can, or where no run tells it."""
    wanted, (points, rest) = summary["targets"], _asked(summary)
    if rest and not points:
        points, wanted = rest, judged(rest[0], wanted)
    choice = _chosen(summary, points, wanted) if wanted else None
    if choice is None or choice.best or not choice.perhaps:
        return None
    minutes = _telling(summary, points, choice.perhaps, wanted)
    return minutes if minutes and minutes <= FAR * summary["minutes"] else None


def _above(point, name, most, confidence) -> float:
    """How many times longer runs have an error bar that does not reach across the target, in four
    of five cases.

    The bar of a mean goes as the run's length to -1/2, that of a slope, whose noise does not
    wander, to -3/2.  Of the error the noise is taken off.  What is as large as the target or larger
    may be noise, too: `LEAST_ROOM`.  Infinite if no length tells.
    """
    if name == "rdf" and point["untold"]:
        return point["untold"]["longer"] or math.inf
    if not math.isfinite(bound(point, name)):
        return math.inf
    one = Estimate.of(point["errors"][name])
    seen = math.sqrt(max(one.value**2 - one.error**2, 0.0))
    room = max(most - seen, LEAST_ROOM * most)
    power = 2 / 3 if name == "drift" else 2
    return ((margin(one.error, one.freedom, confidence) + FOUR_OF_FIVE * one.error) / room) ** power


def _resolved(summary, points, perhaps, wanted, time) -> Iterator[str]:
    """The answer without the target that no run is long enough for, if it is only one."""
    hidden = {
        name: min(bound(one, name) for one in perhaps)
        for name, most in wanted.items()
        if all(bound(one, name) > most for one in perhaps)
    }
    rest = {name: most for name, most in wanted.items() if name not in hidden}
    best = _chosen(summary, points, rest).best if len(hidden) == 1 and rest else None
    if best:
        name, least = next(iter(hidden.items()))
        told = f"Runs so short cannot tell {name} below {least:.2g}."
        if not math.isfinite(least):
            told = f"It takes another step of the same integrator to tell {name}."
        if any(one["untold"] for one in perhaps if name == "rdf"):
            told = "Nothing is known of g(r)."
        yield (
            f"{told} But for that, {best['label']} with {best['dt']:g} {time} is the fastest "
            f"within the targets, by {SURE}: {_within(best, rest)}."
        )


def _within(point, wanted) -> str:
    told = []
    for name, most in wanted.items():
        found = point["errors"].get(name)
        told.append(f"{name} {Estimate.of(found).text() if found else '–'} (at most {most:g})")
    return ", ".join(told)


def _why_not(point, wanted) -> str:
    if point["failed"]:
        return f"it fails ({point['failed']})"
    return "too much of " + ", ".join(
        f"{name}: {Estimate.of(point['errors'][name]).text()}"
        for name, most in wanted.items()
        if point["errors"].get(name)
        and point["errors"][name]["value"] - Estimate.of(point["errors"][name]).margin > most
    )


def _cost(point) -> str:
    """The least time: what else the machine does makes the others longer."""
    cost, rough = point["cost"], point["rough"]
    if cost and cost != rough:
        return f"{cost['min']:.3g}"
    return f"≈ {rough['min']:.2g}" if rough else "–"


def _lines(summary, choice) -> list[str]:
    best, skin = choice.best, lists.fastest(summary.get("lists", ()))
    more = [skin["command"]] if skin else []
    return [*best["lines"], f"timestep {best['dt']:g}", *more] if best else []


def _place(best) -> str:
    """Where the lines stand in the script."""
    return f"{best['place']}, and of the script's timestep:"


def instead(choice: Choice, lines: Sequence[str]) -> list[str]:
    """The lines for the script, with what goes for them."""
    best: Any = choice.best
    return [_place(best), *(f"    {line}" for line in lines), *best["lost"]] if best else []


def tables(summary: dict) -> list[Table]:
    """Each integrator's longest good step, and all points."""
    wanted, units = summary["targets"], UNITS[summary["units"]]
    points = trial.roughly(one for one in summary["points"] if one["asked"])
    columns = [*(f"{name}, ≤ {most:g}" for name, most in wanted.items()), ""]
    heads = ("integrator", f"step, {units.time}", f"s per {summary['ns']}", *columns)
    longest = []
    for name in dict.fromkeys(one["integrator"] for one in points):
        mine = [one for one in points if one["integrator"] == name]
        some = judged(mine[0], wanted)
        near = nearest(mine, some) if some else None
        one = _chosen(summary, mine, some).best or (near[0] if near else mine[0])
        longest.append(_row(one, wanted))
    every = []
    for one in summary["points"]:
        first, step, *more = _row(one, wanted)
        every.append([first, step, f"{one['time']:.3g}" if one["time"] else "–", *more])
    skins = [(one["command"], _ratio(one)) for one in summary.get("lists", ())]
    longer = [_row(one, wanted) for one in trial.roughly(confirm.points(summary))]
    found = [
        Table.of(f"{EACH} within the targets, else the nearest", heads, longest),
        Table.of(
            "All that was run; the first is what means are held against",
            (*heads[:2], f"run, {units.time}", *heads[2:]),
            every,
        ),
        Table.of(SKINS, ("LAMMPS's command", "time of a step, in parts of the first"), skins),
        Table.of(f"{confirm.LONGER:g} times as long", heads, longer),
    ]
    return [one for one in found if one.rows]


def _row(point, wanted):
    some = judged(point, wanted)
    met = meets(point, some) if some else None
    verdict = {True: "met", False: "not met", None: "cannot tell"}[met]
    if some != wanted and met is not None:
        verdict += " by the rest"
    errors = (point["errors"].get(name) for name in wanted)
    texts = [Estimate.of(one).text() if one else "–" for one in errors]
    if point["failed"]:
        verdict = f"fails at {point['failed']}"
    elif point["is_reference"]:
        verdict = f"reference, {verdict}" if point["asked"] else "reference"
    return [point["label"], f"{point['dt']:g}", _cost(point), *texts, verdict]


def _numbers(point, wanted) -> dict:
    """A row of a file."""
    return {
        "integrator": point["label"],
        "step": point["dt"],
        "run": point["time"],
        "cost": point["cost"] and point["cost"]["min"],
        "cost with samples": point["rough"] and point["rough"]["min"],
        **{
            name + part: (getattr(Estimate.of(found), key) if found else None)
            for name in wanted
            for found in [point["errors"].get(name)]
            for part, key in (("", "value"), (" margin", "margin"))
        },
        "failed": point["failed"],
        "verdict": _row(point, wanted)[-1],
    }


def write(summary: dict, out: Path) -> None:
    """Write all files into a folder."""
    choice, told, lines = answer(summary)
    wanted = summary["targets"]
    best: Any = choice.best
    values: dict = {"told": told, "lines": lines, "shown": tables(summary)}
    values |= {"place": best and _place(best), "lost": best and best["lost"]}
    figures = draw(summary, out)
    files = {"table": report.frame(_numbers(one, wanted) for one in summary["points"])}
    if longer := confirm.points(summary):
        files["confirmed"] = report.frame(_numbers(one, wanted) for one in longer)
    else:
        (out / "confirmed.csv").unlink(missing_ok=True)  # of another answer
    minutes = _minutes(summary)
    said: dict = {"answer": [*told, *lines], "minutes_that_tell": minutes, "advised": None}
    if choice.best:
        said["advised"] = {key: choice.best[key] for key in ("integrator", "label", "dt")}
    report.write(summary | said, out, files, "own.html", figures, **values)


def show(console: Console, summary: dict, out: Path) -> bool:
    """Print the answer; whether there is one."""
    for first in tables(summary)[:1]:  # none of a Ctrl-C before the first run
        cells = [[cell.text for cell in row] for row in first.rows]
        report.table(console, first.title, first.columns, cells, ("integrator", ""))
    choice, told, lines = answer(summary)
    for line in told:
        console.print(line, markup=False, soft_wrap=True)
    for line in instead(choice, lines):
        console.print(line, markup=False, soft_wrap=True)
    report.end(console, summary, out)
    return choice.best is not None and confirm.holds(summary) is not False
