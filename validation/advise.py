"""What to run for a wished accuracy: the answer of a sweep that was done before."""

import json
import shlex
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.table import Table

from validation.check import SURE
from validation.sweep_choice import choose, each, meets, nearest, ours, resolution
from validation.sweep_report import ONE_START, error_of, named, names, over, seconds

FOLDERS = (
    Path("results/sweep"),
    Path(__file__).parent / "results" / "sweep",
)  # looked into in this order
LONGER = 4  # times as long halves an error
UNSURE = "the error bar reaches across the target, or is not known, or the run time is not"


def load(folder=None):
    """The summary of the sweep in a folder, by default the first of `FOLDERS` that has one, and that folder.

    Raises:
        LookupError: there is none; the message says by which command it is made.
    """
    folders = [folder] if folder else FOLDERS
    found = next((path for path in folders if (path / "summary.json").exists()), folders[0])
    command = shlex.join(["python", "-m", "validation", "sweep", "--out", str(found)])
    try:
        return json.loads((found / "summary.json").read_text()), found
    except OSError as error:
        raise LookupError(
            f"no sweep in {found}; this makes one, in some hours (with --short in some minutes): {command}"
        ) from error
    except json.JSONDecodeError as error:
        raise LookupError(
            f"{found / 'summary.json'} is not complete ({error}); this writes it anew: {command}"
        ) from error


def again(summary, folder, name, times=1):
    """The command that sweeps a scene into that folder, as the rest of it was swept; ``times`` as long, into a folder of its own."""
    known = summary["scenes"].get(name) or next(
        iter(summary["scenes"].values()), {"swept": {"command": ""}}
    )
    words = [
        "python",
        "-m",
        "validation",
        "sweep",
        name,
        *["--short"] * ("--short" in known["swept"]["command"]),
    ]
    budget = next((one["budget"] for one in summary["lengths"].values()), None)
    words += ["--budget", f"{times * budget:.10g}"] * (budget is not None)
    return shlex.join([*words, "--out", str(folder) if times == 1 else f"{folder}-{times}-times"])


def scene_of(summary, folder, name, targets):
    """The swept scene of that name.

    Raises:
        LookupError: it is not in the sweep, or one of the targets' measures is not among its own.
    """
    if name not in summary["scenes"]:
        there, place = (
            ", ".join(summary["scenes"]) or "none",
            FOLDERS[0] if folder == FOLDERS[-1] else folder,
        )
        raise LookupError(
            f"scene {name} is not in the sweep in {folder} (there: {there}); this measures it: {again(summary, place, name)}"
        )
    scene = summary["scenes"][name]
    for measure in targets:
        if measure not in scene["measures"]:
            known = "".join(f"\n  {key:<16} {_title(summary, key)}" for key in scene["measures"])
            raise LookupError(f"scene {name} has no measure {measure}; it has{known}")
    return scene


def advise(console, summary, folder, name, targets):
    """Print which integrator and time step reach the targets the fastest, and what else there is to know.

    Args:
        console: where to.
        summary: of a sweep.  folder: where it is.
        name: of a scene in it.
        targets: measure to the largest error, see ``sweep_choice``.

    Returns:
        whether some point meets the targets.

    Raises:
        LookupError: see `scene_of`.
    """
    scene = scene_of(summary, folder, name, targets)
    points, choice = scene["points"], choose(scene["points"], targets)
    own = ours(points, targets)

    def say(text):
        console.print(text, markup=False, soft_wrap=True)

    say(f"{name}: {scene['title']}")
    say(f"Swept {scene['swept']['date']} on {scene['ranks']} rank(s) of {summary['machine']['cpu']}; run times are this machine's: the least of the "
        "repeats, and their median in brackets.")  # fmt: skip
    sampled = [point["starts"] * point["ps"] for point in points if not point["failed"]]
    if sampled:
        say(
            f"Errors and averages are of {min(sampled):.3g} to {max(sampled):.3g} ps a point: what lasts longer is not known from here."
        )
    if scene["swept"]["interrupted"]:
        say("The sweep was interrupted: points may be missing.")
    for measure, most in targets.items():
        if most < (least := resolution(points, measure)):
            say(f"Not resolved by this sampling: half of the points whose {measure} cannot be told from zero are only known to be below {least:.2g} or more; "
                "which one is below the target for sure is chance.")  # fmt: skip
    wanted = "; ".join(f"{_title(summary, key)} below {most:g}" for key, most in targets.items())
    say(f"Wanted, sure by {SURE}: {wanted}\n")
    if choice.best:
        _say_best(say, choice, targets)
        say(_of_ours(own, choice, points, targets))
    else:
        _say_none(
            say,
            choice,
            points,
            targets,
            again(summary, FOLDERS[0] if folder == FOLDERS[-1] else folder, name, LONGER),
        )
    console.print(_table(points, targets))
    if choice.best:
        say("In the input script:")
        for line in (f"timestep {choice.best['dt']:g}", *choice.best["lines"]):
            say(f"    {line}")
        say(f"This point again: {choice.best['command']}")
    return choice.best is not None


def _say_best(say, choice, targets):
    best = choice.best
    say(f"{best['label']} with a time step of {best['dt']:g} fs: {seconds(best['cost'])} s per ns")
    for measure, most in targets.items():
        say(f"    {measure} {error_of(best, measure)}, wanted {most:g}")
    if not meets(best, targets):
        say(
            f"Its own error bar reaches across a target; but no error of it is above the error bar of {named(choice.fastest)}, which is below for sure."
        )
    if choice.ties:
        say(f"A tie: as fast, within the spread of the timings, {names(choice.ties)}.")
    elif best["starts"] > 1:
        say("No other one is as fast.")
    if best["starts"] < 2:
        say(f"But {ONE_START}.")
    if choice.perhaps:
        say(f"Perhaps good enough and as fast, but {UNSURE}: {names(choice.perhaps, 4)}.")


def _say_none(say, choice, points, targets, longer):
    if choice.perhaps:
        say(f"Cannot tell: {UNSURE}: {names(choice.perhaps, 4)}.")
        say(
            f"Longer runs tell; this takes {LONGER} times as long, for half the error, and goes to a folder of its own: {longer}"
        )
    else:
        say("No point of the sweep reaches this.")
    near = nearest(points, targets)
    if near:
        point, factor = near
        errors = ", ".join(
            f"{measure} {error_of(point, measure)} (wanted {most:g})"
            for measure, most in targets.items()
        )
        say(f"The nearest one: {named(point)}, with its {SURE} margin {_above(factor)}: {errors}.")
    else:
        say("No point that did not fail has all these errors, with error bars.")


def _of_ours(own, choice, points, targets):
    if own.best is choice.best:
        return "This is ours."
    if own.best:
        return f"Ours: {named(own.best)}, {over(own.best, choice.fastest)} times the run time of the fastest."
    near = nearest([point for point in points if point["ours"]], targets)
    text = "Ours: cannot tell" if own.perhaps else "Ours: none reaches this"
    return text + (f"; the nearest one, {named(near[0])}, is {_above(near[1])}." if near else ".")


def _above(factor):
    if factor <= 1:
        return "within the targets"
    return (
        f"{100 * (factor - 1):.2g} % above the target"
        if factor < 2
        else f"{factor:.3g} times the target"
    )


def _table(points, targets):
    """The fastest point of each integrator that meets the targets; else the nearest."""
    title = "Each integrator's fastest step that reaches this, else the nearest"
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    table.add_column("integrator", overflow="fold")
    for head in "step, fs", "s per ns", *targets:
        table.add_column(head, justify="right")
    table.add_column("")
    choices = each(points, targets)
    for key, choice in sorted(
        choices.items(),
        key=lambda pair: pair[1].best["cost"]["min"] if pair[1].best else float("inf"),
    ):
        own = [point for point in points if point["integrator"] == key]
        near = None if choice.best else nearest(own, targets)
        point = choice.best or near and near[0]
        if point is None:
            why = "failed" if all(one["failed"] for one in own) else "not measured"
            table.add_row(own[0]["label"], *["–"] * (2 + len(targets)), why, style="dim")
            continue
        verdict = {True: "met", False: "not met", None: "cannot tell"}[meets(point, targets)]
        table.add_row(own[0]["label"], f"{point['dt']:g}", seconds(point["cost"]), *(error_of(point, measure) for measure in targets), verdict,
                      style="bold" if point["ours"] else None if choice.best else "dim")  # fmt: skip
    return table


def _title(summary, key):
    measure = summary["measures"][key]
    return f"{measure['title']}, {measure['unit']}" if measure["unit"] else measure["title"]
