"""What to run for a wished accuracy: the answer of a sweep that was done before."""

import json
import shlex
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from .. import NAME, RESULTS
from ..choice import Targets, choose, each, least, meets, nearest, ours, resolution
from ..own.finding import native
from ..pages import report
from ..statistics.estimate import SURE
from ..sweep.report import ONE_START, error_of, named, names, over, seconds

FOLDERS = (Path("results/sweep"), RESULTS / "sweep")  # looked into in this order
LONGER = 4  # times as long halves an error
UNSURE = (
    "the error bar, which is wider for a choice among several, reaches across the target, or it or "
    "the run time is not known"
)


def load(folder: Path | None = None) -> tuple[dict, Path]:
    """The summary of the sweep in a folder, by default the first of `FOLDERS` that has one, and
    that folder.

    Raises:
        LookupError: there is none; the message says by which command it is made.
    """
    folders = [folder] if folder else FOLDERS
    found = next((path for path in folders if (path / "summary.json").exists()), folders[0])
    command = shlex.join(["python", "-m", NAME, "sweep", "--out", str(found)])
    try:
        return json.loads((found / "summary.json").read_text()), found
    except OSError as error:
        raise LookupError(
            f"no sweep in {found}; this makes one, in some hours (with --short in some minutes): "
            f"{command}"
        ) from error
    except json.JSONDecodeError as error:
        raise LookupError(
            f"{found / 'summary.json'} is not complete ({error}); this writes it anew: {command}"
        ) from error


def again(summary: dict, folder: Path, name: str, times: int = 1) -> str:
    """The command that sweeps a scene into that folder, as the rest was; ``times`` as long, into
    one of its own."""
    folder = FOLDERS[0] if folder == FOLDERS[-1] else folder
    scenes = summary["scenes"]
    known = [scenes[name]] if name in scenes else list(scenes.values())[:1]
    words = ["python", "-m", NAME, "sweep", name]
    words += ["--short"] * any("--short" in one["swept"]["command"] for one in known)
    lengths = summary["lengths"]
    if one := lengths.get(name) or next(iter(lengths.values()), None):
        words += ["--budget", f"{times * one['budget']:.10g}"]
    return shlex.join([*words, "--out", str(folder) if times == 1 else f"{folder}-{times}-times"])


def scene_of(summary: dict, folder: Path, name: str, targets: Targets) -> dict:
    """The swept scene of that name.

    Raises:
        LookupError: it is not in the sweep, or one of the targets' measures is not among its own.
    """
    if name not in summary["scenes"]:
        raise LookupError(
            f"scene {name} is not in the sweep in {folder} (there: "
            f"{', '.join(summary['scenes']) or 'none'}); this measures it: "
            f"{again(summary, folder, name)}"
        )
    scene = summary["scenes"][name]
    for measure in targets:
        if measure not in scene["measures"]:
            known = "".join(f"\n  {key:<16} {_title(summary, key)}" for key in scene["measures"])
            raise LookupError(f"scene {name} has no measure {measure}; it has{known}")
    return scene


def advise(console: Console, summary: dict, folder: Path, name: str, targets: Targets) -> bool:
    """Print which integrator and time step reach the targets the fastest in a scene of a sweep, and
    what else there is to know; whether some point meets the targets.

    Raises:
        LookupError: see `scene_of`.
    """
    scene = scene_of(summary, folder, name, targets)
    points, choice = scene["points"], choose(scene["points"], targets)

    def say(lines):
        for line in lines:
            console.print(line, markup=False, soft_wrap=True)

    say([f"{name}: {scene['title']}", *_circumstances(summary, scene, targets)])
    if choice.best:
        say([*_met(choice, targets), _of_ours(choice, points, targets)])
    else:
        say(_not_met(choice, points, targets, again(summary, folder, name, LONGER)))
    _show_each(console, points, targets)
    if choice.best:
        lines = f"timestep {choice.best['dt']:g}", *map(native, choice.best["lines"])
        say(["In the input script:", *(f"    {line}" for line in lines)])
        say([f"This point again: {choice.best['command']}"])
    return choice.best is not None


def _circumstances(summary, scene, targets) -> Iterator[str]:
    """Where and for how long it was swept, and what is wanted."""
    yield (
        f"Swept {scene['swept']['date']} on {scene['ranks']} rank(s) of "
        f"{summary['machine']['cpu']}; run times are this machine's: the least of the repeats, and "
        "their median in brackets."
    )
    sampled = [point["starts"] * point["ps"] for point in scene["points"] if not point["failed"]]
    if sampled:
        yield (
            f"Errors and averages are of {min(sampled):.3g} to {max(sampled):.3g} ps a point: what "
            "lasts longer is not known from here."
        )
    if scene["swept"]["interrupted"]:
        yield "The sweep was interrupted: points may be missing."
    for measure, most in targets.items():
        lowest = resolution(scene["points"], measure)
        if most < lowest:
            yield (
                f"Not resolved by this sampling: half of the points whose {measure} cannot be "
                f"told from zero are only known to be below {lowest:.2g} or more; which one is "
                "below the target for sure is chance."
            )
    wanted = "; ".join(f"{_title(summary, key)} below {most:g}" for key, most in targets.items())
    yield f"Wanted, sure by {SURE}: {wanted}\n"


def _met(choice, targets) -> Iterator[str]:
    best = choice.best
    yield f"{best['label']} with a time step of {best['dt']:g} fs: {seconds(best['cost'])} s per ns"
    for measure, most in targets.items():
        yield f"    {measure} {error_of(best, measure)}, wanted {most:g}"
    if not choice.sure:
        yield (
            "Its own error bar reaches across a target; but no error of it is above the error bar "
            f"of {named(choice.fastest)}, which is below for sure."
        )
    if choice.ties:
        yield f"A tie: as fast, within the spread of the timings, {names(choice.ties)}."
    elif best["starts"] > 1:
        yield "No other one is as fast."
    if best["starts"] < 2:
        yield f"But {ONE_START}."
    if choice.perhaps:
        yield f"Perhaps good enough and as fast, but {UNSURE}: {names(choice.perhaps, 4)}."


def _not_met(choice, points, targets, longer) -> Iterator[str]:
    if choice.perhaps:
        yield f"Cannot tell: {UNSURE}: {names(choice.perhaps, 4)}."
        yield (
            f"Longer runs tell; this takes {LONGER} times as long, for half the error, and goes to "
            f"a folder of its own: {longer}"
        )
    else:
        yield "No point of the sweep reaches this."
    near = nearest(points, targets)
    if near:
        told = (
            f"{key} {error_of(near[0], key)} (wanted {most:g})" for key, most in targets.items()
        )
        above = f"with its {SURE} margin {_above(near[1])}"
        yield f"The nearest one: {named(near[0])}, {above}: {', '.join(told)}."
    else:
        yield "No point that did not fail has all these errors, with error bars."


def _of_ours(choice, points, targets):
    own = ours(points, targets)
    if own.best is choice.best:
        return "This is ours."
    if own.best:
        times = over(own.best, choice.fastest)
        return f"Ours: {named(own.best)}, {times} times the run time of the fastest."
    near = nearest([point for point in points if point["ours"]], targets)
    text = "Ours: cannot tell" if own.perhaps else "Ours: none reaches this"
    return text + (f"; the nearest one, {named(near[0])}, is {_above(near[1])}." if near else ".")


def _above(factor):
    if factor <= 1:
        return "within the targets"
    if factor < 2:
        return f"{100 * (factor - 1):.2g} % above the target"
    return f"{factor:.3g} times the target"


def _show_each(console, points, targets):
    """Print a row for each integrator, from the fastest."""
    heads = ["integrator", "step, fs", "s per ns", *targets, ""]
    rows, styles = [], []

    def time(pair):
        return least(pair[1].best) if pair[1].best else float("inf")

    for key, choice in sorted(each(points, targets).items(), key=time):
        own = [point for point in points if point["integrator"] == key]
        point, _ = (choice.best, 1) if choice.best else nearest(own, targets) or (None, 1)
        if point:
            verdict = {True: "met", False: "not met", None: "cannot tell"}[meets(point, targets)]
            errors = (error_of(point, measure) for measure in targets)
            cells = [f"{point['dt']:g}", seconds(point["cost"]), *errors, verdict]
        else:
            why = "failed" if all(one["failed"] for one in own) else "not measured"
            cells = [*["–"] * (2 + len(targets)), why]
        rows.append([own[0]["label"], *cells])
        styles.append("bold" if point and point["ours"] else None if choice.best else "dim")
    title = "Each integrator's fastest step that reaches this, else the nearest"
    report.table(console, title, heads, rows, ("integrator", ""), styles)


def _title(summary, key):
    measure = summary["measures"][key]
    return f"{measure['title']}, {measure['unit']}" if measure["unit"] else measure["title"]
