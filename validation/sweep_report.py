"""From a sweep's summary to files: summary.json, points.csv, fastest.csv, figures, report.html; and to the terminal."""

import csv
import json

from rich.box import SIMPLE_HEAD
from rich.table import Table

from validation.check import SURE, number
from validation.report import page, save
from validation.sweep_choice import fastest, front, margin_of
from validation.sweep_figures import MAIN, draw
from validation.sweep_plan import MESH, SAMPLED

PARTS = "min", "median", "max"
ONE_START = "there is one start, so timings of one process only: how run times scatter among processes is not known, and others may be as fast"
UNTOLD = (
    "A run time has its median beside it and no margin, for it is the least of its repeats: what disturbs a run only makes it longer. Nor "
    "has a ratio of two of them. Nor have bond and angle, for they are the largest error of all frames, not a mean."
)


def write(summary, out):
    """Write all files into the folder ``out``.

    Args:
        summary: plain data (see `gathered`).
    """
    save(summary, out)
    _write_points(summary, out / "points.csv")
    ways = {
        name: fastest(scene["points"], scene["measures"])
        for name, scene in summary["scenes"].items()
    }
    _write_ways(summary, ways, out / "fastest.csv")
    figures, places = [], {}
    for name, drawn in draw(summary, out).items():
        places[name] = range(len(figures), len(figures) + len(drawn))
        figures += drawn
    page("sweep.html", out / "report.html", figures, places=places, summary=summary, ways={name: distinct(rows) for name, rows in ways.items()},
         fronts=_fronts(summary), sure=SURE, named=named, names=names, seconds=seconds, error_of=error_of, over=over, unit_of=unit_of,
         number=number, one_start=ONE_START, untold=UNTOLD, mesh=MESH, least=SAMPLED)  # fmt: skip


def gathered(summary, out):
    """The summary of a sweep with the scenes that earlier sweeps of the same code left in the folder ``out``; each keeps when it was ``swept``.

    The code is the package, this harness and LAMMPS.  A scene that older code has measured is left out: its runs are still there, for a new sweep of it.
    Of a scene that was swept twice with the same lengths from the same starts, the sweep that knows more runs stays: one of some points, which knows those
    of the earlier ones too, and not one that was interrupted before it had come to them.
    """
    swept = {key: summary[key] for key in ("command", "date", "interrupted")}
    scenes, lengths = (
        {name: scene | {"swept": swept} for name, scene in summary["scenes"].items()},
        summary["lengths"],
    )
    try:
        earlier = json.loads((out / "summary.json").read_text())
    except (OSError, json.JSONDecodeError):  # none, or cut off
        earlier = {}
    if all(earlier.get(key) == summary[key] for key in ("code", "versions")):
        kept = [
            name
            for name in earlier["scenes"]
            if name not in scenes or _stays(earlier, summary, name)
        ]
        scenes, lengths = (
            {**new, **{name: old[name] for name in kept}}
            for old, new in ((earlier["scenes"], scenes), (earlier["lengths"], lengths))
        )
    return summary | {"scenes": scenes, "lengths": lengths}


def _stays(earlier, summary, name):
    """Whether an earlier summary's scene stays in the place of a new one's."""
    old, new = ((one["scenes"][name], one["lengths"][name]) for one in (earlier, summary))
    same = all(old[0][key] == new[0][key] for key in ("begun", "ranks")) and old[1] == new[1]
    runs, now = (sum(point["starts"] for point in scene["points"]) for scene, _ in (old, new))
    return same and runs > now or not new[0]["points"] and not new[0]["error"]


def named(point):
    """An integrator with its time step, as text."""
    return f"{point['label']}, {point['dt']:g} fs"


def names(points, most=None):
    """Several of these; of many the first ``most``, and how many more."""
    more = len(points) - (most or len(points))
    return "; ".join(map(named, points[:most])) + (f" and {more} more" if more > 0 else "")


def distinct(ways):
    """Rows of ``sweep_choice.fastest`` without those that say the same point again, for a target that is easier to reach."""
    kept = []
    for row in ways:
        if not (kept and row[2].best and kept[-1][0] == row[0] and kept[-1][2].best == row[2].best):
            kept.append(row)
    return kept


def seconds(cost):
    """A run time per ns as text: the least, and the median where it differs in what is shown."""
    if cost is None:
        return "–"
    least, usual = (
        f"{cost[part]:,.0f}" if cost[part] >= 100 else f"{cost[part]:.3g}"
        for part in ("min", "median")
    )
    return least if least == usual else f"{least} ({usual})"


def error_of(point, measure):
    """An error of a point as text."""
    found = point["errors"].get(measure)
    if found is None:
        return "–"
    return f"{found['value']:.3g} ± ?" if found["error"] is None else number(**found)


def over(ours, fastest):
    """How many times the fastest one's run time ours takes, as text."""
    return f"{ours['cost']['min'] / fastest['cost']['min']:.2f}" if ours and fastest else "–"


def unit_of(measure):
    """The unit of a measure in brackets, or nothing."""
    return f" ({measure['unit']})" if measure["unit"] else ""


def _fronts(summary):
    """{scene: {measure: (integrator, dt) of the points that no other one beats in both run time and error}}"""
    return {
        name: {
            measure: {
                (point["integrator"], point["dt"]) for point in front(scene["points"], measure)
            }
            for measure in scene["measures"]
        }
        for name, scene in summary["scenes"].items()
    }


def _write_points(summary, path):
    measures, fronts = summary["measures"], _fronts(summary)
    with open(path, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([
            "scene", "integrator", "label", "dt (fs)", "steps", "sampled (ps)", "starts", "failures", "status",
            *(f"{what} {part} (s/ns)" for what in ("wall", "CPU") for part in PARTS),
            *(f"{name}{word}{unit_of(measure)}" for name, measure in measures.items() for word in ("", " margin")),
            "unbeaten in", "command",
        ])  # fmt: skip
        for name, scene in summary["scenes"].items():
            for point in scene["points"]:
                times = [
                    point[kind][part] if point[kind] else ""
                    for kind in ("cost", "cpu")
                    for part in PARTS
                ]
                found = (point["errors"].get(measure, {}) for measure in measures)
                errors = [
                    value
                    for one in found
                    for value in (one.get("value"), one.get("error") and margin_of(one) or None)
                ]  # the largest of all frames has none
                here = point["integrator"], point["dt"]
                writer.writerow([
                    name, point["integrator"], point["label"], point["dt"], point["steps"], point["ps"], point["starts"],
                    point["failures"], point["failed"] or "ok", *times, *("" if value is None else value for value in errors),
                    " ".join(measure for measure, points in fronts[name].items() if here in points), point["command"],
                ])  # fmt: skip


def _write_ways(summary, ways, path):
    with open(path, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["scene", "measure", "unit", "target", "verdict", "use", "dt (fs)", *(f"wall {part} (s/ns)" for part in PARTS), "value",
                         "margin", "a tie with", "no telling", "ours", "ours dt (fs)", "ours / fastest"])  # fmt: skip
        for name, rows in ways.items():
            for measure, target, choice, ours in rows:
                best, own = choice.best, ours.best
                found = best["errors"][measure] if best else {}
                writer.writerow([
                    name, measure, summary["measures"][measure]["unit"], target, choice.verdict,
                    *([best["label"], best["dt"], *(best["cost"][part] for part in PARTS)] if best else [""] * 5),
                    found.get("value", ""), margin_of(found) if found else "", names(choice.ties), names(choice.perhaps),
                    *([own["label"], own["dt"]] if own else ["", ""]), own["cost"]["min"] / choice.fastest["cost"]["min"] if own else "",
                ])  # fmt: skip


def show(console, summary, out):
    """Print for each scene what each integrator's steps came to and the fastest ways, and where the files are."""
    for name, scene in summary["scenes"].items():
        _show_integrators(console, name, scene, summary["measures"])
        _show_fastest(console, name, scene, summary["measures"])
        if scene["starts"] < 2:
            console.print(f"{name}: {ONE_START}", soft_wrap=True)
        if scene["error"]:
            console.print(f"✗ {name}: {scene['error']}", markup=False, soft_wrap=True)
    if summary["interrupted"]:
        console.print("Interrupted: the same command goes on from here.")
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)


def _show_integrators(console, name, scene, measures):
    main = next((measure for measure in MAIN if measure in scene["measures"]), None)
    table = _table(f"{name}: {scene['title']}", "integrator")
    heads = (
        "steps, fs",
        "fails from, fs",
        "longest step\ns per ns",
        *([f"{main}\n{measures[main]['unit']}"] if main else []),
    )
    for head in heads:
        table.add_column(head, justify="right")
    failures = []
    for key in dict.fromkeys(point["integrator"] for point in scene["points"]):
        row = sorted(
            (point for point in scene["points"] if point["integrator"] == key),
            key=lambda point: point["dt"],
        )
        good = [point for point in row if not point["failed"]]
        bad = next((point for point in row if point["failed"]), None)
        failures += [f"✗ {named(bad)}: {bad['failed']}"] if bad else []
        steps = f"{good[0]['dt']:g} – {good[-1]['dt']:g}" if good else "none"
        last = (
            [seconds(good[-1]["cost"]), *([error_of(good[-1], main)] if main else [])]
            if good
            else ["–"] * (len(heads) - 2)
        )
        table.add_row(
            row[0]["label"], steps, f"{bad['dt']:g}" if bad else "–", *last, style=_style(row[0])
        )
    console.print(table)
    for failure in failures:
        console.print(failure, markup=False, soft_wrap=True)


def _show_fastest(console, name, scene, measures):
    table = _table(f"{name}: fastest way to an error, sure by {SURE}", "error of")
    for head in "below", "use", "s per ns", "a tie with", "ours / fastest":
        table.add_column(
            head,
            justify="right" if head in ("below", "s per ns", "ours / fastest") else "left",
            overflow="fold",
        )
    before = None
    for measure, target, choice, ours in distinct(fastest(scene["points"], scene["measures"])):
        best = choice.best
        title = f"{measure}{unit_of(measures[measure])}" if measure != before else ""
        before = measure
        words = (
            named(best)
            if best
            else choice.verdict + (f": {names(choice.perhaps, 2)}" if choice.perhaps else "")
        )
        table.add_row(title, f"{target:g}", words, seconds(best["cost"]) if best else "–", names(choice.ties, 2), over(ours.best, choice.fastest),
                      style=_style(best) if best else "dim")  # fmt: skip
    console.print(table)


def _style(point):
    return "bold" if point["ours"] else None


def _table(title, first):
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    table.add_column(first, overflow="fold")
    return table
