"""What ``sweep`` and ``advise`` have in common for a script of one's own."""

import argparse

from .. import command_line


def options(
    parser: argparse.ArgumentParser, budget: float, out: str, confirms: bool = False
) -> None:
    """Options for the trial of a script; ``confirms`` for --confirm."""
    group = parser.add_argument_group("for the trial of a script")
    command_line.only_of(group, tuple, "integrators, as the script's table names them")
    text = f"minutes that all may take (default {budget:g})"
    group.add_argument("--budget", type=command_line.positive, metavar="MINUTES", help=text)
    text = "time steps in the script's units (default: its own, and up to 6 times that)"
    group.add_argument("--steps", type=command_line.positives, metavar="DT,DT", help=text)
    if confirms:
        text = (
            "then run the advised step, and one 1.5 times as long, for ten times as long: up to "
            "ten budgets more"
        )
        group.add_argument("--confirm", action="store_true", help=text)
    command_line.ranks(parser, 1)
    command_line.silence(parser, 120.0)
    command_line.out(parser, out)
    command_line.launch(parser)


def run(arguments: argparse.Namespace, script: str, budget: float, many: bool) -> int:
    """Try a script's integrators and steps; the exit status.

    Args:
        script: its path.
        budget: minutes, by default.
        many: whether all integrators are tried by default.
    """
    # heavy: not for --help
    from ..own import shifted, system
    from ..pages import console
    from . import measure, report, targets, trial

    ask, out = system.begin(arguments, script)
    silence = arguments.silence or 120.0
    own = shifted.shifted(system.take(ask, out, arguments.ranks, silence))
    system.refuse_ramps(own)
    only = arguments.only and [
        one.name for one in command_line.chosen_of(own.integrators, arguments.only)
    ]
    try:
        wanted = targets.targets(own, dict(arguments.target or ()))
    except LookupError as error:
        arguments.parser.exit(2, f"{error.args[0]}\n")
    points = trial.points(own, only, arguments.steps, many)
    screen = console.console()
    minutes, confirms = arguments.budget or budget, not many and arguments.confirm
    with console.Meter(screen, measure.total(points, many, confirms), "runs") as meter:
        how = many, confirms, out, arguments.ranks, silence, meter
        summary = measure.measure(own, points, wanted, minutes, *how)
    report.write(summary, out)
    answered = report.show(screen, summary, out)
    return command_line.status(summary["interrupted"], not answered)
