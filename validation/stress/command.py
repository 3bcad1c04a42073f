"""The verb ``stress``: its command line, and what it runs."""

from argparse import ArgumentTypeError, Namespace
from collections.abc import Collection

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.add_verb(
        verbs,
        "stress",
        run,
        help="find out which integrator fails in which extreme case",
        description="Run cases in which some integrator fails, with the schemes of this package "
        "and with LAMMPS's own fixes. Each case has one number and a bound. After Ctrl-C the same "
        "command continues. Cases that are already in the output folder are shown, too. Several "
        "processes with the same command share the cases.",
        epilog="Exit status: 1 if this package blows up in a case that a LAMMPS fix survives, else "
        "0; 130 after Ctrl-C.",
    )
    parser.add_argument(
        "cases",
        nargs="*",
        type=_case,
        metavar="CASE",
        help="names of cases (default: all), see --list",
    )
    parser.add_argument(
        "--list", action="store_true", help="list all cases with their physics, and exit"
    )
    command_line.add_length(
        parser,
        "up to three hours of one core; several processes with the same command share the cases",
    )
    command_line.add_only(
        parser,
        _names,
        "integrators, as named by --list (default: all that can run the case)",
    )
    command_line.add_silence(parser, 300.0)
    command_line.add_out(parser, "results/stress", short=True)
    command_line.add_launch(parser)


def _case(word):
    from .cases import CASES  # heavy: not for --help

    if word not in CASES:
        raise ArgumentTypeError(f"there is no case {word}: choose from {', '.join(CASES)}")
    return word


def _names() -> Collection[str]:
    from .measure import COMPARED  # heavy: not for --help

    return COMPARED


def run(arguments: Namespace) -> int:
    """Run the verb; return the exit status."""
    from .. import pages
    from ..pages import console
    from . import measure, report  # heavy: not for --help
    from .cases import CASES

    screen = console.console()
    if arguments.list:
        report.list_cases(screen, CASES)
        return 0
    command_line.require_scenes()
    names = command_line.in_order(CASES, arguments.cases)
    full, only = arguments.full, arguments.only
    out = command_line.output_folder(arguments, not full)
    with console.Meter(screen, len(measure.plan(CASES, names, full, only)), "rows") as meter:
        summary = measure.stress(CASES, names, out, full, arguments.silence, meter, only)
    breaks, _ = measure.find_defeats(summary["cases"]).values()
    pages.publish(screen, report.describe(summary), summary, out)
    return command_line.exit_status(summary["interrupted"], bool(breaks))
