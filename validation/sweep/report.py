"""From a sweep's summary to files and to the terminal."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.console import Console

from ..choice import Measured, fastest, front, least
from ..pages import report
from ..running import whole
from ..statistics.estimate import SURE, Estimate
from ..statistics.measures import Spread
from .figures import MAIN, draw
from .plan import MESH, SAMPLED

PARTS = "min", "median", "max"
ONE_START = (
    "there is one start, so timings of one process only: how run times scatter among processes is "
    "not known, and others may be as fast"
)
UNTOLD = (
    "A run time has its median beside it and no margin, for it is the least of its repeats: what "
    "disturbs a run only makes it longer. Nor has a ratio of two of them. Nor have bond and angle, "
    "for they are the largest error of all frames, not a mean."
)


def write(summary: dict, out: Path) -> None:
    """Write all files into the folder ``out``, of a summary as `gathered` gives it."""
    ways, fronts = _ways(summary), _fronts(summary)
    figures: list[tuple[Path, str]] = []
    places = {}
    for name, drawn in draw(summary, out).items():
        places[name] = range(len(figures), len(figures) + len(drawn))
        figures += drawn
    values: dict = {one.__name__: one for one in (named, names, seconds, error_of, over, unit_of)}
    values |= {"places": places, "fronts": fronts, "mesh": MESH, "least": SAMPLED}
    values |= {"ways": {name: distinct(some) for name, some in ways.items()}}
    values |= {"one_start": ONE_START, "untold": UNTOLD}
    files = {name: report.frame(rows) for name, rows in tables(summary).items()}
    report.write(summary, out, files, "sweep.html", figures, **values)


def tables(summary: dict) -> dict[str, list[dict]]:
    """The rows of points.csv and of fastest.csv."""
    measures, scenes, fronts = summary["measures"], summary["scenes"], _fronts(summary)
    points = [
        _point_row(measures, fronts[name], name, point)
        for name, scene in scenes.items()
        for point in scene["points"]
    ]
    ways = [_way_row(measures, name, *way) for name, some in _ways(summary).items() for way in some]
    return {"points": points, "fastest": ways}


def gathered(summary: dict, out: Path) -> dict:
    """The summary of a sweep with the scenes that earlier sweeps of the same code left in the
    folder ``out``; each keeps when it was ``swept``.

    Of a scene that was swept twice with the same lengths from the same starts, the sweep that knows
    more runs stays, so not one that was interrupted before it had come to them.
    """
    swept = {key: summary[key] for key in ("command", "date", "interrupted")}
    scenes = {name: scene | {"swept": swept} for name, scene in summary["scenes"].items()}
    lengths = dict(summary["lengths"])
    earlier = whole.read(out / "summary.json") or {}
    alike = all(earlier.get(key) == summary[key] for key in ("code", "versions"))
    if alike and earlier["machine"]["cpu"] == summary["machine"]["cpu"]:
        for name in earlier["scenes"]:
            if name not in scenes or _stays(earlier, summary, name):
                scenes[name], lengths[name] = earlier["scenes"][name], earlier["lengths"][name]
    return summary | {"scenes": scenes, "lengths": lengths}


def _stays(earlier, summary, name):
    """Whether an earlier summary's scene stays in the place of a new one's."""
    old, new = ((one["scenes"][name], one["lengths"][name]) for one in (earlier, summary))
    same = all(old[0][key] == new[0][key] for key in ("begun", "ranks")) and old[1] == new[1]
    runs, now = (sum(point["starts"] for point in scene["points"]) for scene, _ in (old, new))
    return (same and runs > now) or (not new[0]["points"] and not new[0]["error"])


def named(point: Measured) -> str:
    """An integrator with its time step, as text."""
    return f"{point['label']}, {point['dt']:g} fs"


def names(points: Sequence[Measured], most: int | None = None) -> str:
    """Several of these; of many the first ``most``, and how many more."""
    more = len(points) - (most or len(points))
    return "; ".join(map(named, points[:most])) + (f" and {more} more" if more > 0 else "")


def distinct(ways: Sequence[tuple]) -> list[tuple]:
    """Rows of ``choice.fastest`` without those that say the same point again, for a target that is
    easier to reach."""
    kept: list[tuple] = []
    for row in ways:
        if not (kept and row[2].best and kept[-1][0] == row[0] and kept[-1][2].best == row[2].best):
            kept.append(row)
    return kept


def seconds(cost: Spread | None) -> str:
    """A run time per ns as text: the least, and the median where it differs in what is shown."""
    if cost is None:
        return "–"
    both = (cost["min"], cost["median"])
    least, usual = (f"{one:,.0f}" if one >= 100 else f"{one:.3g}" for one in both)
    return least if least == usual else f"{least} ({usual})"


def error_of(point: Measured, measure: str) -> str:
    """An error of a point as text."""
    found = point["errors"].get(measure)
    if found is None:
        return "–"
    return f"{found['value']:.3g} ± ?" if found["error"] is None else Estimate.of(found).text()


def over(ours: Measured | None, fastest: Measured | None) -> str:
    """How many times the fastest one's run time ours takes, as text."""
    return f"{least(ours) / least(fastest):.2f}" if ours and fastest else "–"


def unit_of(measure: Mapping) -> str:
    """The unit of a measure in brackets, or nothing."""
    return f" ({measure['unit']})" if measure["unit"] else ""


def _ways(summary):
    """{scene: what `choice.fastest` says of it}"""
    return {
        name: fastest(scene["points"], scene["measures"])
        for name, scene in summary["scenes"].items()
    }


def _fronts(summary):
    """{scene: {measure: (integrator, dt) of the points that no other one beats in both run time and
    error}}"""
    return {
        name: {
            measure: {(one["integrator"], one["dt"]) for one in front(scene["points"], measure)}
            for measure in scene["measures"]
        }
        for name, scene in summary["scenes"].items()
    }


def _times(spread, what):
    return {f"{what} {part} (s/ns)": spread[part] if spread else None for part in PARTS}


def _point_row(measures, fronts, scene, point):
    """A row of points.csv."""
    row = {"scene": scene, "integrator": point["integrator"], "label": point["label"]}
    row |= {"dt (fs)": point["dt"], "steps": point["steps"], "sampled (ps)": point["ps"]}
    row |= {key: point[key] for key in ("starts", "failures")}
    row |= {"status": point["failed"] or "ok"}
    row |= _times(point["cost"], "wall") | _times(point["cpu"], "CPU")
    for name, measure in measures.items():
        found = point["errors"].get(name, {})
        row[f"{name}{unit_of(measure)}"] = found.get("value")
        # the largest of all frames has none
        margin = Estimate.of(found).margin if found.get("error") else None
        row[f"{name} margin{unit_of(measure)}"] = margin
    here = point["integrator"], point["dt"]
    row["unbeaten in"] = " ".join(name for name, those in fronts.items() if here in those)
    return row | {"command": point["command"]}


def _way_row(measures, scene, measure, target, choice, ours):
    """A row of fastest.csv."""
    best, own = choice.best or {}, ours.best or {}
    found = best["errors"][measure] if best else {}
    row = {"scene": scene, "measure": measure, "unit": measures[measure]["unit"], "target": target}
    row |= {"verdict": choice.verdict, "use": best.get("label"), "dt (fs)": best.get("dt")}
    row |= _times(best.get("cost"), "wall") | {"value": found.get("value")}
    row |= {"margin": Estimate.of(found).margin if found else None}
    row |= {"a tie with": names(choice.ties), "no telling": names(choice.perhaps)}
    row |= {"ours": own.get("label"), "ours dt (fs)": own.get("dt")}
    return row | {
        # ours may be sure among its own points, and not among all: then there is no fastest
        "ours / fastest": (
            least(ours.best) / least(choice.fastest) if ours.best and choice.fastest else None
        )
    }


def show(console: Console, summary: dict, out: Path) -> None:
    """Print for each scene what each integrator's steps came to, and the fastest ways."""
    failures: list[str] = []
    for name, scene in summary["scenes"].items():
        failures += _show_integrators(console, name, scene, summary["measures"])
        _show_fastest(console, name, scene, summary["measures"])
        if scene["starts"] < 2:
            console.print(f"{name}: {ONE_START}", soft_wrap=True)
        if scene["error"]:
            failures.append(f"{name}: {scene['error']}")
    report.end(console, summary, out, failures)


def _show_integrators(console, name, scene, measures):
    """Print a row for each integrator; which of them fail, and why."""
    main = [measure for measure in MAIN if measure in scene["measures"]][:1]
    heads = ["integrator", "steps, fs", "fails from, fs", "longest step\ns per ns"]
    heads += [f"{one}\n{measures[one]['unit']}" for one in main]
    points, rows, styles, failures = sorted(scene["points"], key=lambda one: one["dt"]), [], [], []
    for key in dict.fromkeys(point["integrator"] for point in points):
        own = [point for point in points if point["integrator"] == key]
        good = [point for point in own if not point["failed"]]
        bad = next((point for point in own if point["failed"]), None)
        steps = f"{good[0]['dt']:g} – {good[-1]['dt']:g}" if good else "none"
        cells = [own[0]["label"], steps, f"{bad['dt']:g}" if bad else "–"]
        longest = good[-1:]
        cells += [seconds(one["cost"]) for one in longest] or ["–"]
        cells += [error_of(one, measure) for one in longest for measure in main] or ["–"] * len(
            main
        )
        rows.append(cells)
        styles.append("bold" if own[0]["ours"] else None)
        failures += [f"{name}, {named(bad)}: {bad['failed']}"] if bad else []
    report.table(console, f"{name}: {scene['title']}", heads, rows, styles=styles)
    return failures


def _show_fastest(console, name, scene, measures):
    heads = ["error of", "below", "use", "s per ns", "a tie with", "ours / fastest"]
    rows, styles, before = [], [], None
    for measure, target, choice, ours in distinct(fastest(scene["points"], scene["measures"])):
        best = choice.best
        title = f"{measure}{unit_of(measures[measure])}" if measure != before else ""
        before = measure
        doubt = choice.verdict + (f": {names(choice.perhaps, 2)}" if choice.perhaps else "")
        words = [named(best), seconds(best["cost"])] if best else [doubt, "–"]
        styles.append(("bold" if best["ours"] else None) if best else "dim")
        rest = names(choice.ties, 2), over(ours.best, choice.fastest)
        rows.append([title, f"{target:g}", *words, *rest])
    title = f"{name}: fastest way to an error, sure by {SURE}"
    report.table(console, title, heads, rows, ("error of", "use", "a tie with"), styles)
