"""The verb ``compare``: its command line, and what it runs."""

from argparse import Namespace

from .. import command_line
from ..scenes.integrators import SWEPT

SCENES = "dimer", "water", "peptide"
BUDGET = 8.0  # minutes


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.add_verb(
        verbs,
        "compare",
        run,
        help="find the fastest integrator and time step for an accuracy",
        description="Run integrators with several time steps from the same starts, measure the "
        "error and the cost of each, and name the fastest one within the targets, with the lines "
        "for the input script. Writes summary.json, CSV files, figures and report.html to the "
        "output folder. After Ctrl-C the same command continues.",
        epilog="Exit status: 0 if a step is within the targets by its 95 % confidence intervals, "
        "1 if none is, 2 if an argument is wrong, 130 after Ctrl-C.",
    )
    parser.add_argument(
        "scene",
        type=command_line.scene_or_script_type(lambda: SCENES),
        metavar="SCENE",
        help=f"{', '.join(SCENES)}, or a LAMMPS input script of yours",
    )
    command_line.add_targets(
        parser,
        "largest acceptable errors, such as energy=0.05 drift=0.01, or rdf=none; an unknown name "
        "lists all "
        "(default: those of drift, temperature, energy, density and rdf that can be measured)",
    )
    command_line.add_only(
        parser,
        lambda: (*SWEPT, "all"),
        f"integrators by name, or all (default: ours and one more); of a scene: {', '.join(SWEPT)}",
    )
    parser.add_argument(
        "--steps",
        type=command_line.positive_numbers,
        metavar="DT,DT",
        help="time steps in fs, or in the script's units (default for a script: its own step and "
        "up to 6 times that)",
    )
    command_line.add_number(
        parser,
        "--budget",
        BUDGET,
        "MINUTES",
        "minutes for everything, estimated from the time of a step at the beginning",
    )
    command_line.add_ranks(parser, 1)
    command_line.add_silence(parser, 120.0)
    command_line.add_out(parser, "results/compare-SCENE")
    command_line.add_script_options(parser)
    command_line.add_launch(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; return the exit status."""
    from .. import pages
    from ..pages import console
    from ..user_script import atom_number, loader, pair_shift, time_step
    from . import case as cases
    from . import measure, plan, report  # slow to import: not for --help

    silence = arguments.silence
    try:
        if command_line.is_script(arguments.scene, lambda: SCENES):
            options, out = loader.parse_options(arguments, arguments.scene)
            script = loader.load(options, out, arguments.ranks, silence)
            script = pair_shift.with_shifted_pairs(atom_number.with_constant_atoms(script))
            script = time_step.with_lists_in_time(script)
            loader.refuse_ramps(script)
            case = cases.of_script(script)
        else:
            arguments.usual = arguments.usual.replace("SCENE", arguments.scene)
            out = command_line.output_folder(arguments)
            case = cases.of_scene(arguments.scene, out / "starts")
        wanted = cases.targets(case, dict(arguments.target or ()))
    except LookupError as error:
        arguments.parser.exit(2, f"{error.args[0]}\n")
    named = None if arguments.only == ["all"] else arguments.only
    names = [integrator.name for integrator in command_line.select(case.integrators, named)]
    points, held = plan.points(case, names if arguments.only else case.usual, arguments.steps)
    if held.dt > case.unstable:
        arguments.parser.exit(
            2,
            f"a step of {held.dt:g} {case.time} is too long for this system: the forces at the "
            f"start are unstable above about {case.unstable:.2g} {case.time}. Give shorter steps "
            "by --steps\n",
        )
    settings = plan.Settings(out, arguments.budget, arguments.ranks, silence)
    screen = console.console()
    with console.Meter(screen, 1) as meter:
        prepared = measure.prepare(case, points, held, wanted, settings, meter)
    with console.Meter(screen, prepared.steps) as meter:
        summary = measure.compare(prepared, meter)
    summary |= report.answered(summary)
    pages.publish(screen, report.describe(summary), summary, out)
    return command_line.exit_status(summary["interrupted"], not summary["advised"])
