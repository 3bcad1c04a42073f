"""The verb ``cost``: its command line, and what it runs."""

from argparse import Namespace

from .. import command_line
from ..scenes import SCENES
from ..scenes.integrators import BENCHMARKED
from . import plan

SHORT = "nosquish", "rigid/nve", "rigid/nve/small", "shake"


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.add_verb(
        verbs,
        "cost",
        run,
        help="measure the cost of the fix: time, memory, messages and start-up",
        description="Time fix nosquish/nve and LAMMPS's own fixes on the same starts, in turn, and "
        "count the bytes that they pass to MPI (which needs a C compiler). Writes tables to the "
        "terminal, and summary.json, CSV files and report.html to the output folder. "
        "After Ctrl-C the same command continues. What was measured with the same code, input and "
        "settings is not measured again.",
        epilog="Exit status: 0 if all integrators finished, 1 if one failed (its row says why), "
        "130 after Ctrl-C.",
    )
    parser.add_argument(
        "parts",
        nargs="*",
        type=command_line.scene_or_script_type(lambda: plan.PARTS),
        metavar="PART",
        help=f"any of {', '.join(plan.PARTS)} (default: all), or a script of yours",
    )
    sizes, ranks = (",".join(map(str, many)) for many in (SCENES["water"].sizes, plan.COUNTED_ON))
    for option, kind, metavar, help in (
        (
            "--ranks",
            command_line.positive_integers,
            "N,N",
            f"MPI ranks (default 1,2; for messages {ranks})",
        ),
        (
            "--sizes",
            command_line.positive_integers,
            "N,N",
            f"molecules (default {sizes}; --short: first)",
        ),
        ("--rounds", command_line.positive_integer, "N", "repetitions (default 5; --short: 2)"),
        (
            "--seconds",
            command_line.positive_number,
            "S",
            "of a timed segment (default 1; --short: 0.2)",
        ),
    ):
        parser.add_argument(option, type=kind, metavar=metavar, help=help)
    command_line.add_only(
        parser,
        lambda: BENCHMARKED,
        f"integrators, of: {', '.join(BENCHMARKED)} (default all; --short: {' '.join(SHORT)})",
    )
    parser.add_argument("--short", action="store_true", help="a few minutes, for a first look")
    command_line.add_silence(parser, 300.0)
    command_line.add_out(parser, "results/cost", short=True)
    command_line.add_script_options(parser)
    command_line.add_launch(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; return the exit status."""
    from .. import pages
    from ..pages import console
    from ..running import store
    from ..user_script import loader
    from . import measure, report  # heavy: not for --help

    parts, short = arguments.parts, arguments.short
    scripts = [part for part in parts if command_line.is_script(part, lambda: plan.PARTS)]
    if not parts:
        command_line.require_scenes()
    if scripts and len(parts) > 1:
        arguments.parser.error("a script of your own is measured alone")
    how = arguments.rounds or (2 if short else 5), arguments.seconds or (0.2 if short else 1.0)
    ranks, script = arguments.ranks or (1, 2), None
    if scripts:
        options, out = loader.parse_options(arguments, scripts[0], short)
    else:
        out = command_line.output_folder(arguments, short)
    with store.alone(out):
        if scripts:
            loaded = loader.load(options, out, ranks[0], arguments.silence)
            integrators = command_line.select(loaded.integrators, arguments.only)
            names = tuple(integrator.name for integrator in integrators)
            points = [plan.Point(options.name, n, loaded.bodies, names, *how) for n in ranks]
            script = loaded.scene, integrators
        else:
            points = _points(arguments, how)
        screen = console.console()
        with console.Meter(screen, sum(point.turns for point in points), "runs") as meter:
            summary = measure.cost(points, measure.Call(out, meter, arguments.silence, script))
    result = report.describe(summary)
    pages.publish(screen, result, summary, out)
    return command_line.exit_status(summary["interrupted"], bool(result.failures))


def _points(arguments: Namespace, how: tuple[int, float]) -> list[plan.Point]:
    """The points of the built-in scenes, in so many rounds of segments of so many s."""
    short, parts = arguments.short, arguments.parts or plan.PARTS
    names = tuple(command_line.in_order(BENCHMARKED, arguments.only or (SHORT if short else None)))
    sizes = arguments.sizes or SCENES["water"].sizes[: 1 if short else None]
    points = plan.points(parts, arguments.ranks or ((1, 2) if short else None), sizes, names, *how)
    if not points:
        arguments.parser.error(f"messages are counted of {', '.join(plan.COMPARED)}")
    return points
