"""``published``: its words, and what they run."""

from argparse import Namespace

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "published",
        run,
        help="the energy's spread in water at 1 to 4 fs beside published numbers",
        description="Run water with a smooth cutoff at 1, 2, 3 and 4 fs and hold the standard "
        "deviations of its energy and of its shadow energy against those of Silveira and Abreu "
        "(2019). Writes a table to the "
        "terminal and summary.json, table.csv, a figure and a self-contained report.html to the "
        "output folder. Ctrl-C keeps what is computed, and the same command goes on from there.",
        epilog="Exit status: 0 if no number is outside of its bounds by its 95 % margin, 1 if one "
        "is or is missing, 130 after Ctrl-C.",
    )
    command_line.number(parser, "--time", 48.0, "PS", "length of each trajectory")
    command_line.ranks(parser)
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/published")
    command_line.launch(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    command_line.need_scenes()
    from ..pages import console
    from ..running import machine
    from . import measure, report  # heavy: not for --help

    out, screen = command_line.folder(arguments), console.console()
    with console.Meter(screen, measure.total(arguments.time)) as meter:
        found, interrupted = measure.published(
            out / "runs", arguments.time, arguments.ranks, arguments.silence, meter
        )
    made = measure.checks(found)
    summary = machine.circumstances() | {
        "interrupted": interrupted,
        "time": arguments.time,
        "checks": [one.plain() for one in made],
    }
    report.write(summary, out)
    report.show(screen, summary, out)
    return command_line.status(
        interrupted, any(one.holds is False or one.value is None for one in made)
    )
