"""``breaks``: its words, and what they run."""

from argparse import Namespace

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "breaks",
        run,
        help="what users report as broken in LAMMPS's rigid fixes, beside ours",
        description="Measure the defects of LAMMPS's rigid fixes that the README names, and the "
        "same with ours, each a number that is small where all is well. Writes a table to the "
        "terminal and summary.json, table.csv and a self-contained report.html, in some minutes of "
        "one core.",
        epilog="Exit status: 0 if ours passes all, 1 if it does not, 130 after Ctrl-C, which keeps "
        "the cases that are complete.",
    )
    parser.add_argument(
        "cases",
        nargs="*",
        type=command_line.one_of("case", _cases),
        metavar="CASE",
        help="which (default: all)",
    )
    command_line.out(parser, "results/breaks")


def _cases():
    from .plan import CASES  # heavy: not for --help

    return CASES


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from ..pages import console
    from ..running import machine
    from . import measure, plan, report  # heavy: not for --help

    out, screen = command_line.folder(arguments), console.console()
    names = command_line.chosen(plan.CASES, arguments.cases)
    summary = machine.circumstances()
    with console.Meter(screen, len(names) * len(plan.FIXES), "cases") as meter:
        rows, interrupted = measure.breaks(names, out, meter)
    summary |= {"interrupted": interrupted, "rows": rows}
    report.write(summary, out)
    report.show(screen, summary, out)
    ours = [row for row in rows if row["integrator"] == plan.OUR_LABEL]
    return command_line.status(interrupted, any(row["verdict"] != "pass" for row in ours))
