"""``stress``: its words, and what they run."""

from argparse import ArgumentTypeError, Namespace
from collections.abc import Collection

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "stress",
        run,
        help="what breaks, where: time step, heat, cold, odd bodies, ranks, what users report",
        description="Run cases that some integrator does not bear with fix_nosquish's schemes and "
        "LAMMPS's own fixes, each judged by a number against a bound. After a Ctrl-C the same "
        "command goes on; cases that the output folder has from other times are shown too. The "
        "same command in several processes at once shares the cases among them.",
        epilog="Exit status: 0 if ours has no blow-up that a LAMMPS fix survives, 1 if it has, "
        "130 after Ctrl-C.",
    )
    parser.add_argument(
        "cases",
        nargs="*",
        type=_case,
        metavar="CASE",
        help="which (default: all); --list names them",
    )
    parser.add_argument(
        "--list", action="store_true", help="name all cases, with their physics, and end"
    )
    command_line.short_or_full(
        parser,
        "one and a half to three hours of one core; start it once for each core to share the cases",
    )
    command_line.only_of(
        parser,
        _names,
        "integrators, as the table of --list names them (default: all that a case is run with)",
    )
    command_line.silence(parser, 300.0)
    command_line.out(parser, "results/stress", short=True)
    command_line.launch(parser)


def _case(word):
    from .cases import CASES  # heavy: not for --help

    if word not in CASES:
        raise ArgumentTypeError(f"there is no case {word}: choose from {', '.join(CASES)}")
    return word


def _names() -> Collection[str]:
    from .measure import COMPARED  # heavy: not for --help

    return COMPARED


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from .. import pages
    from ..pages import console
    from . import measure, report  # heavy: not for --help
    from .cases import CASES

    screen = console.console()
    if arguments.list:
        report.list_cases(screen, CASES)
        return 0
    command_line.need_scenes()
    names, full, only = command_line.chosen(CASES, arguments.cases), arguments.full, arguments.only
    out = command_line.folder(arguments, not full)
    rows = measure.plan(CASES, names, full, only)
    with console.Meter(screen, len(rows), "rows") as meter:
        summary = measure.stress(CASES, names, out, full, arguments.silence, meter, only)
    breaks, _ = measure.worse(summary["cases"]).values()
    said = report.said(summary)
    pages.write(said, summary, out)
    pages.show(screen, said, summary, out)
    return command_line.status(summary["interrupted"], bool(breaks))
