"""``check``: its words, and what they run."""

from argparse import Namespace

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "check",
        run,
        help="before a long run of a script of yours: its bodies, its step, what does not fit",
        description="Look at a LAMMPS input script before its long run: which bodies there are, "
        "their shapes and moments, whether the step is safe for the fastest rotation and the "
        "stiffest force, whether groups, exclusions and fixes fit, and what each integrator makes "
        "of the start. No file of yours is written to.",
        epilog="Exit status: 0 if all numbers are within their bounds, 1 if not, 130 after Ctrl-C.",
    )
    command_line.script(parser)
    command_line.ranks(parser, 1)
    command_line.silence(parser, 60.0)
    command_line.out(parser, "results/check-SCRIPT")
    command_line.own(parser)
    command_line.launch(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from ..own import system
    from ..pages import console
    from ..running import store
    from . import measure, report  # heavy: not for --help

    ask, out = system.begin(arguments, arguments.scene)
    with store.alone(out):
        own = system.take(ask, out, arguments.ranks, arguments.silence)
        screen = console.console()
        with console.Meter(screen, len(own.integrators) * measure.STEPS) as meter:
            summary = measure.check(own, out, arguments.ranks, arguments.silence, meter)
    report.write(summary, out)
    report.show(screen, summary, out)
    lost = any(one["verdict"] == "does not hold" for one in summary["checks"])
    return command_line.status(summary["interrupted"], lost)
