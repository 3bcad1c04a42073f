"""``long``: its words, and what they run."""

from argparse import Namespace

from .. import command_line

INTEGRATORS = ["nosquish", "rigid/nve", "rigid"]


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "long",
        run,
        help="a free body for 10^7 steps: energy, momenta, shape",
        description="Run one body without forces for very many steps with fix_nosquish.NVE, "
        "rigid/nve and rigid, at a short and at a practical time step, and draw what becomes of "
        "energy, momenta and shape. A run that is complete in the output folder is not done again.",
    )
    command_line.number(parser, "--steps", 10_000_000, "N", "of each run")
    command_line.only(parser, INTEGRATORS, default=INTEGRATORS)
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/long-run")
    command_line.launch(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from ..pages import console
    from . import measure, report  # heavy: not for --help

    out, screen = command_line.folder(arguments), console.console()
    names, steps = arguments.only, arguments.steps
    with console.Meter(screen, len(measure.ANGLES) * len(names) * steps) as meter:
        summary, series = measure.long_run(out, steps, names, meter, arguments.silence)
    report.write(summary, series, out)
    report.show(screen, summary, out)
    failed = any(row["error"] for row in summary["runs"])
    return command_line.status(summary["interrupted"], failed)
