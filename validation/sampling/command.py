"""``sampling``: its words, and what they run."""

import argparse
from collections.abc import Collection
from pathlib import Path

from .. import command_line

DEFAULT = "water"


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "sampling",
        run,
        help="which error averages have after which run time, of thermostats with long steps",
        description="Run a scene at constant temperature with this package's thermostats and with "
        "LAMMPS's, at 0.5 to 14 fs. Hold averages against the limit of small steps that they "
        "share, and tell what an independent sample costs. From both, draw the total error, of "
        "bias and noise, against the time that is spent. Ctrl-C keeps each run that is complete, "
        "and the same command goes on from there. With the same lengths the output folder gathers "
        "schemes and steps. The same command, started once for each core, shares the runs.",
        epilog="A scheme that fails is a result. Exit status: 0, 1 if no run succeeds, 130 after "
        "Ctrl-C.",
    )
    scene = command_line.scene_or_script(scenes)
    text = f"what to simulate (default {DEFAULT}), or a script of yours"
    parser.add_argument("scenes", nargs="*", type=scene, metavar="SCENE", help=text)
    command_line.short_or_full(parser, "300 ps of each point: a day of one core for water")
    text = "length of each point (default 300, --short 20)"
    parser.add_argument("--ps", type=command_line.positive, metavar="PS", help=text)
    text = "time steps in fs (default each scheme's own)"
    parser.add_argument("--dt", type=command_line.positives, metavar="FS,FS", help=text)
    text = "schemes, by name; an unknown one lists all"
    parser.add_argument("--only", nargs="+", metavar="NAME", help=text)
    text = "independent starts; each tells its own error"
    command_line.number(parser, "--starts", 1, "N", text)
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/sampling-SCENE", short=True)
    command_line.own(parser)
    command_line.launch(parser)


def scenes() -> Collection[str]:
    """Names of the scenes."""
    from .plan import CASES  # heavy: not for --help

    return CASES


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; the exit status."""
    if not arguments.scenes:
        command_line.need_scenes()
    names = list(dict.fromkeys(arguments.scenes)) or [DEFAULT]
    if len(names) > 1 and any(command_line.is_script(one, scenes) for one in names):
        arguments.parser.error("a script of your own is run alone")
    statuses = []
    for name in names:
        statuses.append(_scene(arguments, name, len(names) > 1))
        if statuses[-1] == command_line.INTERRUPTED:
            break
    return max(statuses)


def _scene(arguments: argparse.Namespace, name: str, several: bool) -> int:
    """Run and measure a scene or a script; the exit status."""
    from ..ensembles.lengths import Lengths  # heavy: not for --help
    from ..own import system
    from ..pages import console
    from . import criteria, measure, plan, report

    short = not arguments.full
    if command_line.is_script(name, scenes):
        ask, out = system.begin(arguments, name, short)
        case = plan.of_script(system.take(ask, out, 1, arguments.silence))
    else:
        out = _folder(arguments, name, short, several)
        case = plan.CASES[name](out)
    only = arguments.only and [
        one.name for one in command_line.chosen_of(case.schemes, arguments.only)
    ]
    lengths = Lengths(arguments.ps or plan.TIMES[short], arguments.starts)
    points = case.points(only, arguments.dt, short)
    screen = console.console()
    with console.Meter(screen, case.total(points, lengths)) as meter:
        summary = measure.sampling(case, points, lengths, out, meter, arguments.silence)
    summary["checks"] = [one.plain() for one in criteria.checks(summary)]
    report.write(summary, out)
    report.show(screen, summary, out)
    failed = all(row["error"] for row in summary["rows"])
    return command_line.status(summary["interrupted"], failed)


def _folder(arguments: argparse.Namespace, name: str, short: bool, several: bool) -> Path:
    """The output folder of a scene, which is made."""
    if arguments.out:
        out = arguments.out / name if several else arguments.out
    else:
        out = Path(arguments.usual.replace("SCENE", name) + "-short" * short)
    return command_line.made(arguments, out)
