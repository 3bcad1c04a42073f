"""The report of ``compare``: which step to use, how certain that is, and what it costs."""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial

from ..pages import Column, Figure, Report, Table, digits, ranks_of
from ..scenes.units import UNITS
from ..statistics.estimate import CONFIDENCE, SURE, Estimate, margin
from ..user_script import thermostat
from . import choice, figures, lists
from .choice import Choice, Measured, bound, cost, meets, near_failure, nearest

FOUR_OF_FIVE = 0.84  # standard errors from the mean to the 80 % quantile of a normal distribution
SPARE = 2.0  # factor of an estimated budget: error bars are estimates, which change with the time
LEAST_ROOM = 0.25  # least distance between error and target, relative, when a budget is estimated
FAR = 100  # times a budget: estimates of larger ones, from few samples, are chance
VERDICTS = {True: "met", False: "not met", None: "cannot tell"}
FEW = 4  # points that are listed
NEAR = 3.0  # ratio of an error's upper end to its target, beyond which nothing is said of a step
BUSY = 90.0  # percent of a core; below it the machine was busy
FASTER = 0.95  # largest ratio of costs that is worth mentioning
NOTES = {
    "CPU time": "Of all cores, in steps without output: the median of parts of all runs. It is the "
    "same number in the answer, the tables and the figure.",
    "drift, energy": "Of the energy that the integrator conserves, which includes that of "
    "thermostats and barostats.",
    "potential, density, rdf": "Compared with the reference, from the same starts.",
    "noise": "All runs are from the same two starts. The scatter from start to start is the noise, "
    "whatever its correlation time.",
}


class Answer:
    """The conclusions from a summary's points.

    Attributes:
        points: the requested points.
        candidates: those with the script's kind of thermostat; all if there is none.
        choice: among these.  averages: the `Choice` among all, for averages only.
        usual: the script's own line at its own step; None if it was not measured.
    """

    def __init__(self, summary: Mapping) -> None:
        self.summary, self.wanted = summary, summary["targets"]
        self.every: list[Measured] = summary["points"]
        self.points = [point for point in self.every if point["asked"]]
        own, timed = summary.get("usual"), [point for point in self.every if point["cpu"]]
        at_own = (x for x in timed if own == {"integrator": x["integrator"], "dt": x["dt"]})
        self.usual = next(at_own, None)
        self.thermostat = summary.get("thermostat")
        self.candidates = choice.same_thermostat(self.points, self.thermostat)
        self.choice, self.averages = self.among(self.candidates), self.among(self.points)
        self.targets = self.choice.targets
        self.unit = UNITS[summary["units"]].time

    def among(self, points: Sequence[Measured]) -> Choice:
        """The `Choice` among some of the points."""
        return choice.choose(points, self.wanted, self.summary["level"])

    def verdict(self, point: Measured) -> str:
        """The verdict of a row, by the rule that gives the answer."""
        if point["failed"]:
            return "fail"
        if not self.targets:
            return VERDICTS[None]
        points = [point] if point not in self.points else self.points
        met = choice.verdicts(points, self.targets, self.summary["level"])
        return VERDICTS[met[points.index(point)]]

    def named(self, points: Sequence[Measured]) -> str:
        """Points with their steps, as text; if there are many, the first ones."""
        shown = (f"{point['label']}, {point['dt']:g} {self.unit}" for point in points[:FEW])
        return "; ".join(shown) + f" and {len(points) - FEW} more" * (len(points) > FEW)

    @property
    def nearest(self) -> Measured | None:
        """The candidate that exceeds the targets least, of those whose verdict is open if there are
        any, and of those that save time if there are any; None if none comes near (`NEAR`)."""
        measurable = [x for x in self.candidates if self.targets.keys().isdisjoint(x["without"])]
        able = [point for point in measurable if self.verdict(point) == VERDICTS[None]]
        most = FASTER * cost(self.usual) if self.usual else 0.0
        faster = [point for point in able if cost(point) < most]
        near = (
            nearest(points, self.targets) for points in (faster, able or measurable) if self.targets
        )
        return next((found[0] for found in near if found and found[1] < NEAR), None)

    def within(self, point: Measured) -> str:
        """A point's errors with their targets, as text."""
        return ", ".join(
            f"{name} {_text(point, name)} (at most {most:g})" for name, most in self.targets.items()
        )

    def why_not(self, point: Measured) -> str:
        """Explain why a point is not within the targets."""
        if point["failed"]:
            return f"it fails ({point['failed']})"
        wide = {name: _text(point, name) for name, most in self.targets.items()
                if meets(point, {name: most}) is False}  # fmt: skip
        return "too much of " + ", ".join(f"{name}: {text}" for name, text in wide.items())

    @property
    def minutes(self) -> int | None:
        """Estimate the minutes that decide the open points; None if none is open, or no length up
        to `FAR` times the present one decides."""
        factors = []
        for point in [] if self.choice.best else self.choice.perhaps:
            alike = [other for other in self.points if other["integrator"] == point["integrator"]]
            before = [point] if point["alone"] else [x for x in alike if x["dt"] <= point["dt"]]
            how = CONFIDENCE if point["alone"] else self.summary["level"]
            factors.append(max(_above(x, *target, how) for x in before
                               for target in self.targets.items()))  # fmt: skip
        # the least that helps is a few more runs
        longer = max(2.0, SPARE * min(factors, default=math.inf))
        if longer > FAR:
            return None
        return math.ceil(float(f"{self.summary['minutes'] * longer:.2g}"))


def _text(point: Measured, name: str) -> str:
    estimate = point["errors"].get(name)
    return Estimate.of(estimate).text() if estimate else "–"


def _above(point: Measured, name: str, most: float, confidence: float) -> float:
    """How many times longer a run must be so that in four of five cases its error bar does not
    reach across the target.

    The bar of a mean is proportional to length^(-1/2), that of a slope without a random walk to
    length^(-3/2).  The noise is subtracted from the error.  An error as large as the target or
    larger may be noise, too: `LEAST_ROOM`.  Infinite if no length suffices.
    """
    if not math.isfinite(bound(point, name)):
        return math.inf
    estimate = Estimate.of(point["errors"][name])
    seen = math.sqrt(max(estimate.value**2 - estimate.error**2, 0.0))
    room = max(most - seen, LEAST_ROOM * most)
    power = 2 / 3 if name == "drift" else 2
    return (
        (margin(estimate.error, estimate.freedom, confidence) + FOUR_OF_FIVE * estimate.error)
        / room
    ) ** power


def answered(summary: Mapping) -> dict:
    """The conclusions, for the summary's file."""
    answer = Answer(summary)
    best = answer.choice.best
    return {
        "answer": [_answer(answer), *_lines(answer)],
        "minutes_that_tell": answer.minutes,
        "advised": best and {key: best[key] for key in ("integrator", "label", "dt")},
    }


def describe(summary: Mapping) -> Report:
    """The report: the answer, the points, and a figure of the error against the run time."""
    answer = Answer(summary)
    wanted = ", ".join(f"{name} ≤ {most:g} {summary['about'][name]['unit']}".strip()
                       for name, most in answer.wanted.items())  # fmt: skip
    first = {point["integrator"]: point for point in reversed(summary["points"]) if point["failed"]}
    alike: dict[str, list[str]] = {}
    for point in first.values():
        alike.setdefault(str(point["failed"]), []).append(point["label"])
    return Report(
        title=summary["title"],
        question=f"Which integrator and time step reach this the fastest: {wanted}?",
        answer=_answer(answer),
        lines=[*_lines(answer)],
        tables=_tables(answer),
        figures=[Figure("cost", partial(figures.cost, summary), figures.READ)],
        notes=NOTES
        | {name: _about(target) for name, target in summary["about"].items()}
        | ({"the script": " ".join(summary["notes"])} if summary["notes"] else {}),
        defeats=[*_defeats(answer)],
        failures=[f"{', '.join(labels)}: {why}" for why, labels in alike.items()],
    )


def _defeats(answer: Answer) -> Iterator[str]:
    """Name each integrator that reaches the targets sooner than ours, with its best step."""
    best, ties = answer.choice.best, answer.choice.ties
    if best is None or best["ours"] or any(point["ours"] for point in ties):
        return
    ours = answer.among([point for point in answer.points if point["ours"]]).best
    times = f"ours takes {cost(ours) / cost(best):.2g} times as long" if ours else "ours does not"
    yield f"{answer.summary['title']}: {answer.named([best])} reaches the targets; {times}."


def _about(target: Mapping) -> str:
    """Describe a target, and the reason for its default."""
    what = f"{target['what']}, {target['unit']}".strip(", ")
    usual = f"By default {target['default']:g}: " if target["default"] else ""
    return f"{what}. {usual}{target['why']}."


def _answer(answer: Answer) -> str:
    summary, chosen = answer.summary, answer.choice
    if not answer.points:
        return "No run is complete yet."
    if not answer.targets:
        return "None of the targets can be measured with these integrators."
    if best := chosen.best:
        spent = f"{_cost(best)} s of CPU time per {summary['ns']}"
        return (
            f"{best['label']} with a step of {best['dt']:g} {answer.unit}: {spent}, on "
            f"{ranks_of(summary['ranks'])}{_speed_up(answer, best)}. "
            f"Within the targets, with {SURE} confidence: {answer.within(best)}."
        )
    if chosen.perhaps:
        minutes = answer.minutes
        longer = f"About --budget {minutes} (minutes) would decide."
        if minutes is None:
            longer = (
                f"By these runs, {FAR} times this --budget would not decide. Larger targets may "
                "(--target)."
            )
        return (
            f"Not sure: no step is within the targets with {SURE} confidence, but these may be: "
            f"{answer.named(chosen.perhaps)}. Their error bars, or those of shorter steps, reach "
            f"across a target. {longer}"
        )
    if all(point["failed"] for point in answer.points):
        return f"All runs failed, also with the shortest step: {answer.points[0]['failed']}"
    shortest = min(point["dt"] for point in answer.points)
    return (
        f"No step that was tried is within the targets. Try shorter ones: --steps "
        f"{shortest / 2:g},{shortest / 4:g}. Or the start is not in equilibrium, or "
        "the forces are discontinuous at the cutoff."
    )


def _speed_up(answer: Answer, best: Measured) -> str:
    """The time saved relative to the script's own line at its own step, if that was measured."""
    usual = answer.usual
    if usual is None or usual is best:
        return ""
    return (
        f", {cost(usual) / cost(best):.2g} times as fast as your "
        f"{usual['label'].removeprefix('yours: ')} at {usual['dt']:g} {answer.unit} "
        f"({_cost(usual)} s)"
    )


def _lines(answer: Answer) -> Iterator[str]:
    """Yield further sentences, and the lines for the input script."""
    unit = answer.unit
    lost = set(answer.wanted) - set(answer.targets)
    others = [point for point in answer.points if set(answer.wanted) & set(point["without"])]
    if others:
        measures = " and ".join(name for name in answer.wanted if name in others[0]["without"])
        labels = ", ".join(dict.fromkeys(point["label"] for point in others))
        yield f"For {labels}, {measures} cannot be measured: {answer.summary['why']}."
    if lost and answer.targets:
        yield f"The answer is therefore by {', '.join(answer.targets)} only."
    if "rdf" in answer.targets and not any("rdf" in point["errors"] for point in answer.points):
        yield (
            "The error of g(r) is not known, because too few runs are complete. --target rdf=none "
            "gives an answer without it."
        )
    alone = [point for point in answer.points if point["alone"]]
    if alone:
        runs = ", ".join(f"{answer.named([x])}, for {x['time']:.3g} {unit}" for x in alone)
        yield (
            f"All steps ran for {answer.summary['time']:.3g} {unit} from each start. The rest of "
            f"the time went to a long run, by which its step is judged: {runs}."
        )
    best = answer.choice.best
    near = None if best else answer.nearest
    yield from _beside(answer, best) if best else _nearest(answer, near)
    yield from _busy(answer)
    if answer.points and answer.targets:
        yield choice.RULE
    shown = best or (answer.choice.perhaps and near)
    if shown:
        yield from shown["lost"]
        yield f"{shown['place']}, and the script's timestep{'' if best else ', to try it'}:"
        yield from (f"    {line}" for line in _input(shown))
        yield from lists.advise(answer.summary.get("neighbour_lists", ()))
    if answer.thermostat:
        yield from _thermostats(answer, answer.thermostat)


def _busy(answer: Answer) -> Iterator[str]:
    """Warn if other work used part of the cores."""
    shares = [share for point in answer.points if (share := point.get("share")) is not None]
    if shares and min(shares) < BUSY:
        yield (
            f"The machine was busy: a rank had as little as {min(shares):.0f} % of a core. This "
            "makes CPU times somewhat longer, and wall times much longer."
        )


def _thermostats(answer: Answer, original: Mapping) -> Iterator[str]:
    """Explain which thermostat is kept, and what another one could gain."""
    best, other = answer.choice.best, answer.averages.best
    kinds = {point["thermostat"] for point in answer.points}
    if original["kind"] not in kinds:
        labels = " and ".join(thermostat.of_averages(kind) for kind in kinds)
        yield f"Your thermostat was not compared. This is another one: {labels}."
        return
    yield thermostat.describe(original)
    if other and other["thermostat"] != original["kind"]:
        if best is None or cost(other) < FASTER * cost(best):
            gain = f", {cost(best) / cost(other):.2g} times as fast" if best else ""
            yield (
                f"For averages only: {answer.named([other])}{gain}. This is another thermostat, "
                f"{thermostat.of_averages(other['thermostat'])}. In place of your fix:"
            )
            yield from (f"    {line}" for line in _input(other))
    elif kinds == {original["kind"]}:
        yield (
            "Integrators with other thermostats were not compared, because they change dynamics. "
            "If you need averages only, compare them by --only all."
        )


def _input(best: Measured) -> list[str]:
    """The lines for the input script."""
    return [*best["lines"], f"timestep {best['dt']:g}"]


def _nearest(answer: Answer, near: Measured | None) -> Iterator[str]:
    """If no point is met: name the one that is nearest."""
    held = [point for point in answer.every if point["is_reference"] and not point["failed"]]
    if held and answer.targets and meets(held[0], answer.targets) is False:
        yield (
            f"Even with {held[0]['dt']:g} {answer.unit} there is {answer.why_not(held[0])}: this "
            "is not an error of the time step. Is the start in equilibrium, and are the forces "
            "continuous at the cutoff?"
        )
    if near:
        yield (
            f"The nearest: {answer.named([near])}{_speed_up(answer, near)}: {answer.within(near)}."
        )


def _beside(answer: Answer, best: Measured) -> Iterator[str]:
    """Name alternatives to the best one: longer steps, ties, and others that may be as good."""
    unit = answer.unit
    longer = [
        point
        for point in answer.points
        if point["integrator"] == best["integrator"] and point["dt"] > best["dt"]
    ]
    bad = [point for point in longer if meets(point, answer.targets) is False]
    near = [point for point in near_failure(answer.points) if point in longer and point not in bad]
    open_ = [point for point in longer if point not in bad and point not in near]
    if not longer:
        yield (
            "This was the longest step that was tried. A longer one may be good enough, too: "
            f"--steps {1.5 * best['dt']:g},{2 * best['dt']:g}"
        )
    elif open_:
        steps = ", ".join(f"{point['dt']:g}" for point in open_)
        yield (
            f"{steps} {unit} may be good enough, too. Fewer steps and a larger --budget decide on "
            f"them sooner: --steps {best['dt']:g},{min(point['dt'] for point in open_):g}"
        )
    elif bad:
        first = min(bad, key=lambda point: point["dt"])
        yield f"With {first['dt']:g} {unit}: {answer.why_not(first)}."
    if near:
        steps = ", ".join(f"{point['dt']:g}" for point in near)
        yield (
            f"{steps} {unit} is too close to a step that fails to be named: a rare event may end a "
            "longer run there."
        )
    if ties := answer.choice.ties:
        yield f"As fast, within the spread of the timings: {answer.named(ties)}."
    others = [point for point in answer.choice.perhaps if point["integrator"] != best["integrator"]]
    if others:
        yield f"As fast or faster, if they are within the targets: {answer.named(others)}."


def _cost(point: Measured) -> str:
    return digits(point["cpu"]["median"]) if point["cpu"] else "–"


def _tables(answer: Answer) -> list[Table]:
    """Tables of each integrator's fastest step within the targets, and of all points."""
    summary, nearest_of = answer.summary, []
    for name in dict.fromkeys(point["integrator"] for point in answer.points):
        mine = [point for point in answer.points if point["integrator"] == name]
        chosen = answer.among(mine)
        near = nearest(mine, chosen.targets) if chosen.targets else None
        nearest_of.append(chosen.best or (near[0] if near else mine[0]))
    measures = [
        name
        for name in summary["about"]
        if any(name in point["errors"] for point in summary["points"])
    ]
    return [
        Table(
            "Each integrator's fastest step within the targets, else the nearest",
            _columns(answer, [name for name in measures if name in answer.wanted]),
            [_shown(answer, point) for point in nearest_of],
        ),
        Table(
            "All points",
            [
                *_columns(answer, measures),
                Column("integrator", "integrator", kind="text", wide=True),
                Column("starts", "starts", kind="number"),
                Column("failures", "failures", kind="number", wide=True),
                Column("time", "sampled", answer.unit, kind="number"),
                Column("cost", "elapsed", f"s/{summary['ns']}", wide=True),
                Column("status", "status", kind="text", wide=True),
            ],
            [_shown(answer, point) for point in answer.every],
            file="points",
            long=True,
        ),
    ]


def _columns(answer: Answer, measures: Sequence[str]) -> list[Column]:
    summary, unit, about = answer.summary, answer.unit, answer.summary["about"]
    return [
        Column("label", "label", kind="text"),
        Column("dt", "dt", unit, kind="number"),
        Column("cpu", "CPU time", f"s/{summary['ns']}"),
        *(Column(f"of {name}", name, about[name]["unit"], kind="estimate") for name in measures),
        Column("verdict", "verdict", kind="verdict"),
    ]


def _shown(answer: Answer, point: Measured) -> dict:
    """A row of a table."""
    errors = {f"of {name}": error for name, error in point["errors"].items()}
    return {
        **point,
        **errors,
        "verdict": answer.verdict(point),
        "status": point["failed"] or "ok",
        "error": point["failed"],
    }
