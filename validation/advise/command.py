"""``advise``: its words, and what they run."""

import argparse
from argparse import Namespace
from pathlib import Path

from validation import command_line
from validation.sweep.command import scenes


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "advise",
        run,
        help="which integrator and time step reach a wished accuracy the fastest",
        description="Print, of the points that a sweep has measured, the fastest one whose errors "
        "are all below the targets, what it costs, what is as fast, the longest good step of every "
        "integrator, and the lines for the input script.",
        epilog="Exit status: 0 if some point meets the targets with its 95 % margins, 1 if none "
        "does, 2 if there is no sweep, no such scene or measure.",
    )
    scene = command_line.one_of("scene", scenes)
    parser.add_argument("scene", type=scene, metavar="SCENE", help="a scene of the sweep")
    parser.add_argument(
        "--target",
        nargs="+",
        type=_target,
        required=True,
        metavar="MEASURE=VALUE",
        help="largest errors, in the measures' units, as in energy_sd=0.5 drift=0.01; "
        "an unknown measure lists all",
    )
    text = "folder of the sweep (default results/sweep, else the one that comes with this checkout)"
    parser.add_argument("--from", type=Path, dest="folder", metavar="DIR", help=text)


def _target(word):
    measure, found, value = word.partition("=")
    if not found:
        raise argparse.ArgumentTypeError(f"{word}: MEASURE=VALUE is expected")
    return measure, command_line.positive(value)


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from validation.advise.report import advise, load  # heavy: not for --help
    from validation.pages.console import console

    try:
        met = advise(console(), *load(arguments.folder), arguments.scene, dict(arguments.target))
    except LookupError as error:
        arguments.parser.exit(2, f"{error}\n")
    return int(not met)
