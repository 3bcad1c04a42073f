"""``advise``: its words, and what they run."""

from argparse import Namespace
from pathlib import Path

from .. import command_line
from ..sweep.command import scenes
from ..trial import words as trial

BUDGET = 8.0  # minutes, of a script


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "advise",
        run,
        help="which integrator and time step reach a wished accuracy the fastest",
        description="Print, of the points that a sweep has measured, the fastest one whose errors "
        "are all below the targets, what it costs, what is as fast, the longest good step of every "
        "integrator, and the lines for the input script. A script of yours is run first, with its "
        "step and longer ones.",
        epilog="Exit status: 0 if some point meets the targets with its 95 % margins, 1 if none "
        "does or --confirm finds that it does not, 2 if there is no sweep, no such scene or "
        "measure.",
    )
    scene = command_line.scene_or_script(scenes)
    help = "a scene of the sweep, or a LAMMPS input script of yours, which is tried now"
    parser.add_argument("scene", type=scene, metavar="SCENE", help=help)
    command_line.targets(
        parser,
        "largest errors, in the measures' units, as in energy_sd=0.5 drift=0.01; an unknown "
        "measure lists all; of a script by default drift, temperature, energy, density and rdf as "
        "far as it has them",
    )
    text = "folder of the sweep (default results/sweep, else the one that comes with this checkout)"
    parser.add_argument("--from", type=Path, dest="folder", metavar="DIR", help=text)
    command_line.own(parser)
    trial.options(parser, BUDGET, "results/advise-SCRIPT", confirms=True)


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    if command_line.is_script(arguments.scene, scenes):
        command_line.refuse(arguments, ["folder"], "is for a scene: a script is tried now")
        return trial.run(arguments, arguments.scene, BUDGET, many=False)
    from ..pages.console import console
    from .report import advise, load  # heavy: not for --help

    if not arguments.target:
        arguments.parser.error("of a scene, --target is needed")
    why = "is for a script: a scene's sweep has run already"
    names = "budget", "steps", "confirm", "only", "ranks", "silence", "out", "launch"
    command_line.refuse(arguments, names, why)
    try:
        met = advise(console(), *load(arguments.folder), arguments.scene, dict(arguments.target))
    except LookupError as error:
        arguments.parser.exit(2, f"{error}\n")
    return int(not met)
