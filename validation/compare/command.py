"""``compare``: its words, and what they run."""

from argparse import Namespace

from .. import command_line
from ..scenes import SCENES
from ..scenes.integrators import INTEGRATORS, REFERENCE


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
    kind = command_line.scene_or_script(lambda: _SCENES)
    help = f"what is simulated: {', '.join(_SCENES)}, or a LAMMPS input script of yours"
    parser.add_argument("scene", type=kind, metavar="SCENE", help=help)
    command_line.ranks(parser)
    command_line.number(parser, "--steps", 1500, "N", "length of each trajectory")
    help = "time step, in fs or the script's units (default: the scene's)"
    parser.add_argument("--dt", type=command_line.positive, metavar="DT", help=help)
    help = f"integrators, of: {', '.join(INTEGRATORS)}; of a script as its table names them"
    command_line.only_of(parser, lambda: INTEGRATORS, help)
    command_line.number(parser, "--rounds", 3, "N", "timed segments of each integrator")
    command_line.number(parser, "--segment", 200, "N", "steps of a timed segment")
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/compare-SCENE")
    command_line.own(parser)
    command_line.launch(parser)


_SCENES = [name for name, scene in SCENES.items() if scene.units == "real"]


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from ..own import shifted, system
    from ..pages import console
    from ..running import store
    from . import measure, report  # heavy: not for --help

    script = command_line.is_script(arguments.scene, lambda: _SCENES)
    if script:
        ask, out = system.begin(arguments, arguments.scene)
    else:
        arguments.usual = arguments.usual.replace("SCENE", arguments.scene)
        out = command_line.folder(arguments)
    with store.alone(out):
        if script:
            own = shifted.shifted(system.take(ask, out, arguments.ranks, arguments.silence))
            scene, known, reference = own.scene, own.integrators, own.reference
            told: dict = {"ensemble": own.found.state.ensemble, "notes": own.notes}
        else:
            scene, reference, told = SCENES[arguments.scene], REFERENCE, {}
            known = {name: one for name, one in INTEGRATORS.items() if one.can_run(scene)}
        integrators = command_line.chosen_of(known, arguments.only)
        timing = arguments.rounds, arguments.segment, arguments.silence
        dt = arguments.dt or scene.dt
        settings = measure.Settings(
            arguments.ranks, arguments.steps, dt, *timing, reference=reference, **told
        )
        screen = console.console()
        total = len(integrators) * (settings.steps + settings.timing_rounds)
        with console.Meter(screen, total) as meter:
            summary, series = measure.compare(scene, integrators, out, settings, meter)
    report.write(summary, series, out)
    report.show(screen, summary, out)
    return command_line.status(
        summary["interrupted"], any(row["error"] for row in summary["integrators"])
    )
