"""``compare``: its words, and what they run."""

from argparse import Namespace

from validation import command_line
from validation.scenes import SCENES
from validation.scenes.integrators import INTEGRATORS


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "compare",
        run,
        help="the same start with ours and with LAMMPS's fixes: accuracy and cost",
        description="Run the same start with fix_nosquish.NVE and with LAMMPS's own fixes. "
        "Writes a table to the terminal and summary.json, table.csv, series.csv, figures, a "
        "self-contained report.html and every run's log to the output folder. Ctrl-C keeps what "
        "is computed, and the same command goes on from there.",
        epilog="Exit status: 0 if all integrators finished, 1 if one failed (its row says why), "
        "130 after Ctrl-C.",
    )
    scenes = [name for name, scene in SCENES.items() if scene.units == "real"]
    parser.add_argument("scene", choices=scenes, help="what is simulated: %(choices)s")
    command_line.ranks(parser)
    command_line.number(parser, "--steps", 1500, "N", "length of each trajectory")
    help, dt = "time step in fs (default: the scene's)", command_line.positive
    parser.add_argument("--dt", type=dt, metavar="FS", help=help)
    command_line.only(parser, INTEGRATORS, default=list(INTEGRATORS))
    command_line.number(parser, "--rounds", 3, "N", "timed segments of each integrator")
    command_line.number(parser, "--segment", 200, "N", "steps of a timed segment")
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/compare-SCENE")


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from validation.compare import measure, report  # heavy: not for --help
    from validation.pages import console

    scene = SCENES[arguments.scene]
    integrators = [
        one for name, one in INTEGRATORS.items() if name in arguments.only and one.can_run(scene)
    ]
    arguments.usual = arguments.usual.replace("SCENE", scene.name)
    out = command_line.folder(arguments)
    timing = arguments.rounds, arguments.segment, arguments.silence
    dt = arguments.dt or scene.dt
    settings = measure.Settings(arguments.ranks, arguments.steps, dt, *timing)
    screen = console.console()
    total = len(integrators) * (settings.steps + settings.timing_rounds)
    with console.Meter(screen, total) as meter:
        summary, series = measure.compare(scene, integrators, out, settings, meter)
    report.write(summary, series, out)
    report.show(screen, summary, out)
    return command_line.status(
        summary["interrupted"], any(row["error"] for row in summary["integrators"])
    )
