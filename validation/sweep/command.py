"""``sweep``: its words, and what they run."""

from argparse import Namespace
from collections.abc import Collection

from .. import command_line
from ..scenes.integrators import SWEPT
from ..trial import words as trial

SCRIPT_BUDGET = 30.0  # minutes, of a script


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "sweep",
        run,
        help="error against run time: every integrator with every time step",
        description="Run ours, the comparison schemes and LAMMPS's rigid, shake and rattle fixes "
        "with time steps from very short to beyond what is stable, from the same equilibrated "
        "starts, and draw their errors against their run times. After a Ctrl-C the same command "
        "goes on: what was measured with the same code, input and settings is not measured again. "
        "With the same code and budget, the output folder gathers scenes, integrators and steps; "
        "with another budget a scene is measured anew, in the old one's place.",
        epilog="A step that is too long fails; that is a result. Exit status: 0 if each integrator "
        "has a step that does not fail, 1 if one has none, 130 after Ctrl-C.",
    )
    scene = command_line.scene_or_script(scenes)
    text = "what to simulate (default: all; --short: the small ones), or a script of yours"
    parser.add_argument("scenes", nargs="*", type=scene, metavar="SCENE", help=text)
    command_line.ranks(parser, 1, "what is larger than the dimer")
    text = (
        "how long all scenes may take on one core, by what a step nominally costs; of scenes "
        "that are named each has its part of it (default: five hours; --short: some minutes)"
    )
    parser.add_argument("--budget", type=command_line.positive, metavar="MINUTES", help=text)
    text = "fewer time steps, some minutes in all, for a first look"
    parser.add_argument("--short", action="store_true", help=text)
    text = f"integrators, of: {', '.join(SWEPT)} (default all)"
    command_line.only_of(parser, lambda: SWEPT, text)
    text = "time steps in fs, or the script's units (default: the scene's)"
    parser.add_argument("--steps", type=command_line.positives, metavar="FS,FS", help=text)
    text = "of a script: largest errors that are good enough, as in energy=0.05 drift=0.01"
    command_line.targets(parser, text)
    text = (
        "give a run up that wrote nothing for S seconds, as fixes do that hang when they blow up "
        "(default 120; --short: 30)"
    )
    parser.add_argument("--silence", type=command_line.positive, metavar="S", help=text)
    command_line.out(parser, "results/sweep", short=True)
    command_line.own(parser)
    command_line.launch(parser)


def scenes() -> Collection[str]:
    """Names of what can be swept."""
    from .plan import SCENES  # heavy: not for --help

    return SCENES


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    scripts = [one for one in arguments.scenes if command_line.is_script(one, scenes)]
    if scripts:
        if len(arguments.scenes) > 1:
            arguments.parser.error("a script of your own is swept alone")
        command_line.refuse(arguments, ["short"], "is for scenes: of a script say --budget")
        return trial.run(arguments, scripts[0], SCRIPT_BUDGET, many=True)
    why = "is for a script: 'advise' holds a scene's sweep against targets"
    command_line.refuse(arguments, ["target"], why)
    command_line.need_scenes()
    from ..pages import console
    from . import measure, plan, report  # heavy: not for --help

    short = arguments.short
    wanted = arguments.scenes or (plan.SHORT_SCENES if short else None)
    names = command_line.chosen(plan.SCENES, wanted)
    try:
        lengths = plan.lengths(names, short, arguments.budget)
        only = command_line.chosen_of({name: name for name in SWEPT}, arguments.only)
        points = plan.points(names, short, arguments.only and only, arguments.steps)
    except ValueError as error:
        arguments.parser.error(str(error))
    out = command_line.folder(arguments, short)
    silence = arguments.silence or (30.0 if short else 120.0)
    screen = console.console()
    with console.Meter(screen, plan.total(points, lengths), "runs") as meter:
        summary = measure.sweep(points, lengths, out, meter, arguments.ranks, silence, short)
    failed: dict[tuple, bool] = {}  # of each integrator with each scene, whether all its steps did
    for name, scene in summary["scenes"].items():
        for point in scene["points"]:
            key = name, point["integrator"]
            failed[key] = failed.get(key, True) and bool(point["failed"])
    summary = report.gathered(summary, out)
    report.write(summary, out)
    report.show(screen, summary, out)
    return command_line.status(summary["interrupted"], not failed or any(failed.values()))
