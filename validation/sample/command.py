"""The verb ``sample``: its command line, and what it runs."""

import argparse
from collections.abc import Collection
from pathlib import Path

from .. import command_line

DEFAULT = "water"


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.add_verb(
        verbs,
        "sample",
        run,
        help="measure bias, noise and cost of averages, also with other engines",
        description="Run a scene at constant temperature, or at constant pressure, with this "
        "package's thermostats and barostats, with LAMMPS's, and with those of other engines, at "
        "0.5 to 14 fs. Compare averages with their common limit of small steps, and measure what "
        "an independent sample costs. Bias and noise give the total error as a function of CPU "
        "time. After Ctrl-C the same command continues. Commands with the same run lengths and "
        "folder add schemes, steps and starts to it. Several processes with the same command share "
        "the runs.",
        epilog="Other engines run only if --only names their schemes. OpenMM: pip install "
        "'fix_nosquish[engines]'. GROMACS: apt-get install gromacs. A scheme that fails is a "
        "result. Exit status: 0, 1 if no run succeeds, if --to-zero refuses an average, or if an "
        "engine is not installed, 130 after Ctrl-C.",
    )
    parser.add_argument(
        "scene",
        nargs="?",
        type=command_line.scene_or_script_type(scenes),
        default=DEFAULT,
        metavar="SCENE",
        help=f"a scene (default {DEFAULT}), or a LAMMPS input script of yours",
    )
    command_line.add_length(parser, "300 ps per scheme and step: a day of one core for water")
    parser.add_argument(
        "--ps",
        type=command_line.positive_number,
        metavar="PS",
        help="length for each scheme and step (default 300, --short 20)",
    )
    parser.add_argument(
        "--dt",
        type=command_line.positive_numbers,
        metavar="FS,FS",
        help="time steps in fs (default: those of each scheme)",
    )
    parser.add_argument(
        "--only", nargs="+", metavar="NAME", help="schemes by name; an unknown name lists all"
    )
    command_line.add_number(parser, "--starts", 1, "N", "independent starts")
    parser.add_argument(
        "--seed", type=command_line.positive_integer, metavar="SEED", help="for other starts"
    )
    parser.add_argument(
        "--to-zero",
        action="store_true",
        help="extrapolate the averages of one scheme to step zero, from two or more long steps "
        "(by default the longest that the forces allow, two thirds and a third of it)",
    )
    parser.add_argument(
        "--from",
        type=Path,
        dest="earlier",
        metavar="DIR",
        help="count the averages of another command for the same scene, in this folder, as those "
        "of further starts",
    )
    command_line.add_silence(parser, 120.0)
    command_line.add_out(parser, "results/sample-SCENE", short=True)
    command_line.add_script_options(parser)
    command_line.add_launch(parser)


def scenes() -> Collection[str]:
    """The names of the scenes."""
    from .scenes import SCENES  # heavy: not for --help

    return SCENES


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; return the exit status."""
    from .. import pages  # heavy: not for --help
    from ..pages import console
    from ..user_script import loader
    from . import criteria, engine, extrapolation, measure, report
    from .plan import TIMES, Lengths, Runs
    from .scenes import SCENES, of_script
    from .schemes import FIRST_SEED

    short = not arguments.full
    if command_line.is_script(arguments.scene, scenes):
        options, out = loader.parse_options(arguments, arguments.scene, short)
        plan = of_script(loader.load(options, out, 1, arguments.silence))
    else:
        arguments.usual = arguments.usual.replace("SCENE", arguments.scene)
        out = command_line.output_folder(arguments, short)
        plan = SCENES[arguments.scene](out)
    only = arguments.only and [
        scheme.name for scheme in command_line.select(plan.schemes, arguments.only)
    ]
    plan.refuse_long(arguments.dt or ())
    if arguments.to_zero:
        command_line.refuse_options(
            arguments, ["earlier"], "is for biases, which --to-zero does not tell"
        )
        points = extrapolation.points(plan, only, arguments.dt)
    else:
        points = plan.points(only, arguments.dt, short)
    engine.versions(plan.schemes[point.scheme].engine for point in points)
    lengths = Lengths(arguments.ps or TIMES[short], arguments.starts, arguments.seed or FIRST_SEED)
    runs = Runs(
        plan, lengths, out / "runs" / lengths.folder, arguments.silence, fewer=arguments.to_zero
    )
    earlier = measure.earlier_rows(arguments.earlier, runs) if arguments.earlier else {}
    screen = console.console()
    with console.Meter(screen, runs.steps(points)) as meter:
        summary = measure.sample(runs, points, earlier, meter)
    summary["checks"] = [check.plain() for check in criteria.checks(summary)]
    failed = all(row["error"] for row in summary["rows"])
    if arguments.to_zero:
        summary["rows"] = [row for row in summary["rows"] if row["scheme"] == points[0].scheme]
        summary["zero"] = extrapolation.extrapolate(summary["rows"], lengths.time)
        failed = failed or any(average["why"] for average in summary["zero"].values())
    pages.publish(
        screen,
        extrapolation.describe(summary) if arguments.to_zero else report.describe(summary),
        summary,
        out,
    )
    return command_line.exit_status(summary["interrupted"], failed)
