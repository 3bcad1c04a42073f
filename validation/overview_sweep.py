"""What a sweep says to the report of all verbs: what to use for each scene, how sure that is, and what it costs."""

import math
from dataclasses import dataclass

from validation import goals, sweep_choice, sweep_figures, sweep_report
from validation.check import SURE
from validation.overview_pieces import Cell, Figure, Said, Table, sortable
from validation.sweep_errors import BOLTZMANN
from validation.sweep_plan import SWEEPS

FEW = 3  # points that are named
# An ordinary accuracy: the total energy scatters by this part of the kinetic energy's own scatter at the scene's temperature, kT √(f/2), so that
# averages do not feel it; and of no drift is it sure that a ns would heat by a tenth.
ORDINARY, DRIFT = 0.01, 0.1  # of that scatter; kT per ns and degree of freedom


def say(summary):
    """What to use for each scene, and the fastest way to every error."""
    scenes, measures = summary["scenes"], summary["measures"]
    points = [point for scene in scenes.values() for point in scene["points"]]
    ways = [_way(name, scene, measures[way[0]], way) for name, scene in scenes.items()
            for way in sweep_report.distinct(sweep_choice.fastest(scene["points"], scene["measures"]))]  # fmt: skip
    failed = sum(bool(point["failed"]) for point in points)
    broken = [f"{name}: {scene['error']}" for name, scene in scenes.items() if scene.get("error")]
    missing = [
        f"{name}: not measured; this adds it: python -m validation sweep {name}."
        for name in SWEEPS
        if name not in scenes
    ]
    columns = (
        "scene",
        "wanted",
        "use",
        "wall s per ns, least (median)",
        "ours / fastest",
        "how sure",
    )
    advice = {name: _advice(name, scene) for name, scene in scenes.items()}
    head = ("scene", "use", "sd of energy, kcal/mol", "wanted below", "drift, kT per ns and degree of freedom", "s per ns, least (median)", "how sure",
            "ours / fastest")  # fmt: skip
    return Said(
        [*missing,
         f"Ordinary accuracy is wanted: the total energy's standard deviation is below {100 * ORDINARY:g} % of the kinetic energy's, kT √(f/2), sure by {SURE}.",
         f"What drifts by more than {DRIFT:g} kT per ns and degree of freedom, as sure, is out.",
         f"For another accuracy: python -m validation advise {next(iter(scenes), 'water')} --target energy_sd=0.1."],
        [f"{len(points)} points (an integrator with a time step), {goals.ranks_of(summary['ranks'])}; {failed} failed.", *broken],
        [Table("Fastest way to every error", columns, ways), _points(summary)],
        [Figure(f"{name}.png", f"{scene['title']}. {sweep_figures.READ}") for name, scene in scenes.items()],
        [Table("What to use for an ordinary accuracy", head, [one.cells for one in advice.values()])],
        extent=_swept(summary),
        short=[one.short for one in sorted(advice.values(), key=lambda one: not one.tie)],
        commands=list(dict.fromkeys(scene["swept"]["command"] for scene in scenes.values())),
    )  # fmt: skip


def _swept(summary):
    """How many starts of what length each scene has."""
    told = []
    for name, scene in summary["scenes"].items():
        good = [point for point in scene["points"] if not point["failed"]]
        told += (
            [f"{name} {scene['bodies']:,} bodies, {_starts(good)} of {_lengths(good)}"]
            if good
            else []
        )
    return "; ".join(told)


def _lengths(points):
    """How long they ran: few steps are as many as a number needs, many are no more than there is time for."""
    times = sorted({f"{point['ps']:.3g}" for point in points}, key=float)
    return f"{times[0]} to {times[-1]} ps" if len(times) > 1 else f"{times[0]} ps"


def _starts(points):
    """From how many starts: fewer of some points where a sweep was interrupted."""
    counts = [point["starts"] for point in points] or [0]
    few, many = min(counts), max(counts)
    return f"{few} to {many} starts" if few < many else f"{many} start{'s' if many != 1 else ''}"


@dataclass(frozen=True)
class Advice:
    """What to use for a scene: a row's cells, a sentence, and whether ours ties with fixes of LAMMPS."""

    cells: list
    short: str
    tie: bool = False


def _advice(name, scene):
    """The `Advice` for a scene at an ordinary accuracy: what that costs, and how sure it is."""

    def nothing(words, why, target=math.nan):
        wanted = Cell(f"{target:g}" if target == target else "–", target)
        return Advice([Cell(name), Cell(words), Cell("–", math.nan), wanted, *[Cell("–", math.nan)] * 2, Cell(why), Cell("–", math.nan)],
                      f"{_title(name)}: {words}. {why}")  # fmt: skip

    if not scene["degrees_of_freedom"]:
        return nothing(
            "cannot tell",
            f"No run is complete{': ' * bool(scene.get('error'))}{scene.get('error') or ''}.",
        )
    target = float(
        f"{ORDINARY * BOLTZMANN * SWEEPS[name].temperature * math.sqrt(scene['degrees_of_freedom'] / 2):.2g}"
    )
    points, targets = (
        [
            point
            for point in scene["points"]
            if sweep_choice.meets(point, {"drift": DRIFT}) is not False
        ],
        {"energy_sd": target},
    )
    choice, own = sweep_choice.choose(points, targets), sweep_choice.ours(points, targets)
    best = choice.best
    if not best:
        return nothing(
            choice.verdict,
            f"No step has for sure a standard deviation of the energy below {target:g} kcal/mol without a drift.",
            target,
        )
    drift = sweep_report.error_of(best, "drift") if "drift" in best["errors"] else "–"
    drift += " (no telling)" * (sweep_choice.meets(best, {"drift": DRIFT}) is None and drift != "–")
    sure = (
        f"{_sure(points, targets, choice)}; {_starts([best])} of {_lengths([best])}"
        + f": {sweep_report.ONE_START}" * (best["starts"] < 2)
    )
    cells = [
        Cell(name), Cell(sweep_report.named(best)), Cell(sweep_report.error_of(best, "energy_sd"), best["errors"]["energy_sd"]["value"]),
        Cell(f"{target:g}", target), Cell(drift, sortable(best["errors"].get("drift"))),
        Cell(sweep_report.seconds(best["cost"]), best["cost"]["min"]), Cell(sure),
        Cell(sweep_report.over(own.best, choice.fastest) if own.best else own.verdict, _ratio(own.best, choice.fastest)),
    ]  # fmt: skip
    return Advice(cells, *_in_short(name, points, targets, choice, own))


def _ratio(one, other):
    """How many times the run time of the other one takes; not a number if there is none."""
    return one["cost"]["min"] / other["cost"]["min"] if one and other else math.nan


def _in_short(name, points, targets, choice, own):
    """A sentence on a scene, and whether it is a tie of ours with fixes of LAMMPS."""
    best = choice.best
    theirs = [
        one.best
        for one in sweep_choice.each(points, targets).values()
        if one.best and not _of_us(one.best)
    ]
    rival = min(theirs, key=lambda point: point["cost"]["min"], default=None)
    tied = [point for point in choice.ties if not _of_us(point)]
    if best["ours"] and tied:
        return (
            f"{_title(name)}: a tie. Ours and {_kinds(tied)} are accurate enough with the same run time; {best['dt']:g} fs is a good step.",
            True,
        )
    if best["ours"]:
        how = (
            f"{rival['label']} takes {_ratio(rival, best):.2g} times as long"
            if rival
            else "no fix of LAMMPS reaches it for sure"
        )
        return f"{_title(name)}: use {sweep_report.named(best)}; {how}.", False
    how = (
        f"ours takes {_ratio(own.best, choice.fastest):.2g} times as long"
        if own.best
        else f"ours: {own.verdict}"
    )
    return f"{_title(name)}: use {sweep_report.named(best)}; {how}.", False


def _of_us(point):
    """Whether a scheme is one of this package's, the older ones too."""
    return "python/move" in " ".join(point["lines"])


def _kinds(points):
    """Names of fixes, each once, without their tolerances."""
    names = list(dict.fromkeys(point["label"].split()[0] for point in points))
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]


def _title(name):
    return name.capitalize()


def _sure(points, targets, choice):
    """How sure it is that a choice is the fastest, against what is not ours if it is, whatever its mrot."""
    best = choice.best

    def rival(point):
        return point["integrator"] != best["integrator"] and not (point["ours"] and best["ours"])

    others = [
        one.best
        for one in sweep_choice.each(points, targets).values()
        if one.best and rival(one.best)
    ]
    second = min(others, key=lambda point: point["cost"]["min"], default=None)
    rivals, maybe = list(filter(rival, choice.ties)), list(filter(rival, choice.perhaps))
    if rivals:
        sure = f"a tie with {sweep_report.names(rivals, FEW)}"
    elif second:
        longer = second["cost"]["min"] / best["cost"]["min"]
        sure = f"{'clear' if best['starts'] > 1 else 'ahead'}, {second['label']} takes {longer:.2f} times as long"
    else:
        sure = "nothing else reaches it for sure"
    return sure + (f"; no telling of {sweep_report.names(maybe, FEW)}" if maybe else "")


def _way(scene, data, words, way):
    """A row: who is the fastest, how long that takes, how much longer ours takes, and how sure that is."""
    measure, target, choice, own = way
    title = words["title"].replace("the horizon", f"{SWEEPS[scene].horizon:g} fs")
    wanted = [Cell(scene), Cell(f"{title} ≤ {target:g} {words['unit']}".strip())]
    best, ours = choice.best, own.best
    if not best:
        return [*wanted, Cell("–"), Cell("–", math.nan), Cell("–", math.nan), Cell(choice.verdict)]
    ratio = ours["cost"]["min"] / choice.fastest["cost"]["min"] if ours else math.nan
    return [*wanted, Cell(sweep_report.named(best)), Cell(sweep_report.seconds(best["cost"]), best["cost"]["min"]),
            Cell(sweep_report.over(ours, choice.fastest) if ours else own.verdict, ratio),
            Cell(_sure(data["points"], {measure: target}, choice))]  # fmt: skip


def _points(summary):
    """All points of a sweep."""
    measures, rows = summary["measures"], []
    for name, scene in summary["scenes"].items():
        for point in scene["points"]:
            cost = point["cost"]
            rows.append([
                Cell(name), Cell(point["label"]), Cell(f"{point['dt']:g}", point["dt"]),
                Cell(sweep_report.seconds(cost), cost["min"] if cost else math.nan),
                *(Cell(sweep_report.error_of(point, measure), sortable(point["errors"].get(measure))) for measure in measures),
                Cell(point["failed"] or "ok"), Cell(point["command"]),
            ])  # fmt: skip
    titles = (f"{one['title']}{sweep_report.unit_of(one)}" for one in measures.values())
    return Table(
        "All points",
        ("scene", "integrator", "Δt, fs", "s per ns", *titles, "status", "command"),
        rows,
    )
