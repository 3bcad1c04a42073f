"""``theory``: its words, and what they run."""

from argparse import Namespace

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "theory",
        run,
        help="what the paper proves, measured: reversible, symplectic, a conserved quantity",
        description="Measure what section II of Miller et al. (2002) proves, each statement a "
        "number between bounds. Writes a table to the terminal and summary.json, table.csv, "
        "figures and a self-contained report.html to the output folder.",
        epilog="Exit status: 0 if all numbers are within their bounds, 1 if not, 130 after Ctrl-C, "
        "which keeps the parts that are complete.",
    )
    parser.add_argument(
        "parts",
        nargs="*",
        type=command_line.one_of("part", _parts),
        metavar="PART",
        help="what to measure, of: reversal (in LAMMPS), symplectic, conserved, mrot, rotors, "
        "recursion, loops (default: all)",
    )
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/theory")
    command_line.launch(parser)


def _parts():
    from .measure import PARTS  # heavy: not for --help

    return PARTS


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    command_line.need_scenes()
    from ..pages import console
    from ..running import machine
    from . import measure, report  # heavy: not for --help

    parts = command_line.chosen(measure.PARTS, arguments.parts)
    out, screen = command_line.folder(arguments), console.console()
    with console.Meter(screen, sum(measure.PARTS[part][1] for part in parts), "pieces") as meter:
        checks, data, interrupted = measure.theory(parts, out, meter, arguments.silence)
    summary = machine.circumstances() | {
        "interrupted": interrupted,
        "checks": [check.plain() for check in checks],
        "data": data,
    }
    report.write(summary, out)
    report.show(screen, summary, out)
    return command_line.status(interrupted, not all(check.holds for check in checks))
