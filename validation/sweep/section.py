"""What a sweep says to the report of all verbs: what to use for each scene, how sure that is, and
what it costs."""

import math
from dataclasses import dataclass

from .. import COMMAND
from ..choice import choose, each, fastest, least, meets, ours
from ..pages.said import NONE, Cell, Figure, Said, Table, sortable
from ..pages.tables import ranks_of
from ..scenes.units import BOLTZMANN
from ..statistics.estimate import SURE
from .figures import READ
from .plan import SWEEPS
from .report import (
    ONE_START,
    distinct,
    error_of,
    named,
    names,
    over,
    seconds,
    unit_of,
)

FEW = 3  # points that are named
# An ordinary accuracy: the total energy scatters by this part of the kinetic energy's own scatter
# at the scene's temperature, kT √(f/2), so that averages do not feel it; and of no drift is it sure
# that a ns would heat by a tenth.
ORDINARY, DRIFT = 0.01, 0.1  # of that scatter; kT per ns and degree of freedom


def say(summary: dict) -> Said:
    """What to use for each scene, and the fastest way to every error."""
    scenes, add = summary["scenes"], f"not measured; this adds it: {COMMAND} sweep"
    points = [point for scene in scenes.values() for point in scene["points"]]
    failed = sum(bool(point["failed"]) for point in points)
    missing = [f"{name}: {add} {name}." for name in SWEEPS if name not in scenes]
    advice = [_advice(name, scene) for name, scene in scenes.items()]
    ranks, some = ranks_of(summary["ranks"]), next(iter(scenes), "water")
    head = (
        *("scene", "use", "sd of energy, kcal/mol", "wanted below"),
        *("drift, kT per ns and degree of freedom", "s per ns, least (median)"),
        *("how sure", "ours / fastest"),
    )
    return Said(
        [
            *missing,
            "Ordinary accuracy is wanted: the total energy's standard deviation is below "
            f"{100 * ORDINARY:g} % of the kinetic energy's, kT √(f/2), sure by {SURE}.",
            f"What drifts by more than {DRIFT:g} kT per ns and degree of freedom, as sure, is out.",
            f"For another accuracy: {COMMAND} advise {some} --target energy_sd=0.1.",
        ],
        [
            f"{len(points)} points (an integrator with a time step), {ranks}; {failed} failed.",
            *(f"{name}: {scene['error']}" for name, scene in scenes.items() if scene.get("error")),
        ],
        [_ways(summary), _points(summary)],
        [Figure(f"{name}.png", f"{scene['title']}. {READ}") for name, scene in scenes.items()],
        [Table.of("What to use for an ordinary accuracy", head, [one.cells for one in advice])],
        extent=_swept(summary),
        short=[one.short for one in sorted(advice, key=lambda one: not one.tie)],
        commands=list(dict.fromkeys(scene["swept"]["command"] for scene in scenes.values())),
    )


def _swept(summary):
    """How many starts of what length each scene has."""
    told = []
    for name, scene in summary["scenes"].items():
        good = [point for point in scene["points"] if not point["failed"]]
        if good:
            told.append(f"{name} {scene['bodies']:,} bodies, {_extent(good)}")
    return "; ".join(told)


def _extent(points):
    """From how many starts, and how long: fewer starts of some points where a sweep was
    interrupted; few steps are as many as a number needs, many no more than there is time for."""
    counts = [point["starts"] for point in points] or [0]
    few, many = min(counts), max(counts)
    starts = f"{few} to {many} starts" if few < many else f"{many} start{'s' * (many != 1)}"
    times = sorted({f"{point['ps']:.3g}" for point in points}, key=float)
    return f"{starts} of {' to '.join(dict.fromkeys((times[0], times[-1])))} ps"


@dataclass(frozen=True)
class Advice:
    """What to use for a scene: a row's cells, a sentence, and whether ours ties with fixes of
    LAMMPS."""

    cells: list
    short: str
    tie: bool = False


def _nothing(name, words, why, target=NONE.value):
    """The `Advice` where there is none."""
    wanted = NONE if math.isnan(target) else Cell.number(target)
    cells = [name, words, NONE, wanted, NONE, NONE, why, NONE]
    return Advice(cells, f"{name.capitalize()}: {words}. {why}")


def _advice(name, scene):
    """The `Advice` for a scene at an ordinary accuracy: what that costs, and how sure it is."""
    if not scene["degrees_of_freedom"]:
        why = f"No run is complete{': ' * bool(scene.get('error'))}{scene.get('error') or ''}."
        return _nothing(name, "cannot tell", why)
    heat = BOLTZMANN * SWEEPS[name].temperature
    target = float(f"{ORDINARY * heat * math.sqrt(scene['degrees_of_freedom'] / 2):.2g}")
    drifts = {"drift": DRIFT}
    points = [one for one in scene["points"] if meets(one, drifts) is not False]
    targets = {"energy_sd": target}
    choice, own = choose(points, targets), ours(points, targets)
    best = choice.best
    if not best:
        why = "No step has for sure a standard deviation of the energy below"
        why = f"{why} {target:g} kcal/mol without a drift."
        return _nothing(name, choice.verdict, why, target)
    drift = error_of(best, "drift") if "drift" in best["errors"] else "–"
    drift += " (no telling)" * (meets(best, drifts) is None and drift != "–")
    sure = f"{_sure(points, targets, choice)}; {_extent([best])}"
    sure += f": {ONE_START}" * (best["starts"] < 2)
    times = over(own.best, choice.fastest) if own.best else own.verdict
    energy = best["errors"]["energy_sd"]["value"]
    cells = [
        name,
        named(best),
        Cell(error_of(best, "energy_sd"), energy),
        Cell.number(target),
        Cell(drift, sortable(best["errors"].get("drift"))),
        _cost(best),
        sure,
        Cell(times, _ratio(own.best, choice.fastest)),
    ]
    told, tie = _in_short(points, targets, choice, own)
    return Advice(cells, f"{name.capitalize()}: {told}", tie)


def _cost(point):
    return Cell(seconds(point["cost"]), least(point) if point["cost"] else NONE.value)


def _ratio(one, other):
    """How many times the run time of the other one takes; not a number if there is none."""
    return least(one) / least(other) if one and other else NONE.value


def _rival(points, targets, counts):
    """The fastest way of another integrator that ``counts``; None if there is none."""
    ways = (one.best for one in each(points, targets).values())
    return min((one for one in ways if one and counts(one)), key=least, default=None)


def _in_short(points, targets, choice, own):
    """What to use, in words, and whether it is a tie of ours with fixes of LAMMPS."""
    best = choice.best
    tied = [point for point in choice.ties if not _of_us(point)]
    if best["ours"] and tied:
        told = f"a tie. Ours and {_kinds(tied)} are accurate enough with the same run time;"
        return f"{told} {best['dt']:g} fs is a good step.", True
    if best["ours"]:
        rival, how = _rival(points, targets, lambda one: not _of_us(one)), "no fix of LAMMPS"
        how = f"{how} reaches it for sure"
        if rival:
            how = f"{rival['label']} takes {_ratio(rival, best):.2g} times as long"
    elif own.best:
        how = f"ours takes {_ratio(own.best, choice.fastest):.2g} times as long"
    else:
        how = f"ours: {own.verdict}"
    return f"use {named(best)}; {how}.", False


def _of_us(point):
    """Whether a scheme is one of this package's, the older ones too."""
    lines = " ".join(point["lines"])
    return "nosquish" in lines


def _kinds(points):
    """Names of fixes, each once, without their tolerances."""
    *names, last = dict.fromkeys(point["label"].split()[0] for point in points)
    return f"{', '.join(names)} and {last}" if names else last


def _sure(points, targets, choice):
    """How sure it is that a choice is the fastest, against what is not ours if it is, whatever its
    mrot."""
    best = choice.best

    def rival(point):
        return point["integrator"] != best["integrator"] and not (point["ours"] and best["ours"])

    rivals, maybe = list(filter(rival, choice.ties)), list(filter(rival, choice.perhaps))
    sure = "nothing else reaches it for sure"
    if rivals:
        sure = f"a tie with {names(rivals, FEW)}"
    elif second := _rival(points, targets, lambda one: rival(one) and one not in choice.perhaps):
        apart = least(second) > best["cost"]["median"]
        lead = ("clear" if best["starts"] > 1 else "ahead") if apart else "about as fast"
        sure = f"{lead}, {second['label']} takes {_ratio(second, best):.2f} times as long"
    if not choice.sure:
        sure = f"it may miss this by its error bar, {named(choice.fastest)} does not; {sure}"
    return sure + (f"; no telling of {names(maybe, FEW)}" if maybe else "")


def _ways(summary):
    """Who is the fastest way to every error, how long that takes, how much longer ours takes, and
    how sure that is."""
    rows = []
    for name, scene in summary["scenes"].items():
        ways = fastest(scene["points"], scene["measures"])
        for measure, target, choice, own in distinct(ways):
            words = summary["measures"][measure]
            what = words["title"].replace("the horizon", f"{SWEEPS[name].horizon:g} fs")
            wanted = [name, f"{what} ≤ {target:g} {words['unit']}".strip()]
            best = choice.best
            if not best:
                rows.append([*wanted, "–", NONE, NONE, choice.verdict])
                continue
            times = over(own.best, choice.fastest) if own.best else own.verdict
            ratio = Cell(times, _ratio(own.best, choice.fastest))
            sure = _sure(scene["points"], {measure: target}, choice)
            rows.append([*wanted, named(best), _cost(best), ratio, sure])
    head = "scene", "wanted", "use", "wall s per ns, least (median)", "ours / fastest", "how sure"
    return Table.of("Fastest way to every error", head, rows)


def _points(summary):
    """All points of a sweep."""
    measures, rows = summary["measures"], []
    for name, scene in summary["scenes"].items():
        for point in scene["points"]:
            errors = (
                Cell(error_of(point, one), sortable(point["errors"].get(one))) for one in measures
            )
            where = name, point["label"], Cell.number(point["dt"]), _cost(point)
            rows.append([*where, *errors, point["failed"] or "ok", point["command"]])
    titles = (f"{one['title']}{unit_of(one)}" for one in measures.values())
    head = "scene", "integrator", "Δt, fs", "s per ns", *titles, "status", "command"
    return Table.of("All points", head, rows)
