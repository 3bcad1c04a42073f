"""``sample``: its words, and what they run."""

import argparse
from collections.abc import Collection
from pathlib import Path

from .. import command_line

DEFAULT = "water"


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "sample",
        run,
        help="what averages cost with their error, of thermostats, barostats and other engines",
        description="Run a scene at constant temperature, or at constant pressure, with this "
        "package's thermostats and barostats, with LAMMPS's, and with those of other engines, at "
        "0.5 to 14 fs. Hold averages against the limit of small steps that they share, and tell "
        "what an independent sample costs. From both, draw the total error, of bias and noise, "
        "against the time that is spent. Ctrl-C keeps each run that is complete, and the same "
        "command goes on from there. With the same lengths the output folder gathers schemes and "
        "steps. The same command, started once for each core, shares the runs.",
        epilog="Other engines run where --only names their schemes. OpenMM: pip install "
        "'fix_nosquish[engines]'. GROMACS: apt-get install gromacs. A scheme that fails is a "
        "result. Exit status: 0, 1 if no run succeeds, if --to-zero refuses an average, or if an "
        "engine is not installed, 130 after Ctrl-C.",
    )
    scene = command_line.scene_or_script(scenes)
    text = f"what to simulate (default {DEFAULT}), or a script of yours"
    parser.add_argument("scene", nargs="?", type=scene, default=DEFAULT, metavar="SCENE", help=text)
    command_line.short_or_full(parser, "300 ps of each point: a day of one core for water")
    text = "length of each point (default 300, --short 20)"
    parser.add_argument("--ps", type=command_line.positive, metavar="PS", help=text)
    text = "time steps in fs (default each scheme's own)"
    parser.add_argument("--dt", type=command_line.positives, metavar="FS,FS", help=text)
    text = "schemes, by name; an unknown one lists all"
    parser.add_argument("--only", nargs="+", metavar="NAME", help=text)
    text = "independent starts; each tells its own error"
    command_line.number(parser, "--starts", 1, "N", text)
    text = "averages of one scheme in the limit of small steps, from two long steps or more, by "
    text += "default from a third, two thirds and all of what the forces allow"
    parser.add_argument("--to-zero", action="store_true", help=text)
    text = "folder of another command for the same scene, whose limit of small steps is taken"
    parser.add_argument("--from", type=Path, dest="limits", metavar="DIR", help=text)
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/sample-SCENE", short=True)
    command_line.own(parser)
    command_line.launch(parser)


def scenes() -> Collection[str]:
    """Names of the scenes."""
    from .scenes import SCENES  # heavy: not for --help

    return SCENES


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; the exit status."""
    from .. import pages  # heavy: not for --help
    from ..own import system
    from ..pages import console
    from . import criteria, engine, measure, report, to_zero
    from .plan import TIMES, Lengths, Runs
    from .scenes import SCENES, of_script

    short = not arguments.full
    if command_line.is_script(arguments.scene, scenes):
        ask, out = system.begin(arguments, arguments.scene, short)
        plan = of_script(system.take(ask, out, 1, arguments.silence))
    else:
        arguments.usual = arguments.usual.replace("SCENE", arguments.scene)
        out = command_line.folder(arguments, short)
        plan = SCENES[arguments.scene](out)
    only = arguments.only and [
        scheme.name for scheme in command_line.chosen_of(plan.schemes, arguments.only)
    ]
    if arguments.to_zero:
        command_line.refuse(arguments, ["limits"], "is for biases, which --to-zero does not tell")
        points = to_zero.points(plan, only, arguments.dt)
    else:
        points = plan.points(only, arguments.dt, short)
    engine.versions(plan.schemes[point.scheme].engine for point in points)
    known = measure.known_limits(arguments.limits, plan.scene.name) if arguments.limits else {}
    lengths = Lengths(arguments.ps or TIMES[short], arguments.starts)
    folder = out / "runs" / lengths.folder
    runs = Runs(plan, lengths, folder, arguments.silence, fewer=arguments.to_zero)
    screen = console.console()
    with console.Meter(screen, runs.steps(points)) as meter:
        summary = measure.sample(runs, points, known, meter)
    summary["checks"] = [check.plain() for check in criteria.checks(summary)]
    failed = all(row["error"] for row in summary["rows"])
    if arguments.to_zero:
        summary["rows"] = [row for row in summary["rows"] if row["scheme"] == points[0].scheme]
        summary["zero"] = to_zero.told(summary["rows"], lengths.time)
        failed = failed or any(one["why"] for one in summary["zero"].values())
    said = to_zero.said(summary) if arguments.to_zero else report.said(summary)
    pages.write(said, summary, out)
    pages.show(screen, said, summary, out)
    return command_line.status(summary["interrupted"], failed)
