"""``bench``: its words, and what they run."""

from argparse import Namespace

from .. import command_line
from ..scenes import SCENES
from ..scenes.integrators import BENCHMARKED

PARTS = *SCENES, "passes", "start", "memory"
SHORT = "nosquish", "rigid/nve", "rigid/nve/small", "shake"


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "bench",
        run,
        help="what ours and LAMMPS's fixes cost: time, memory, messages",
        description="Time fix_nosquish.NVE and LAMMPS's own fixes on the same starts, in turn. "
        "Writes tables to the terminal and summary.json, table.csv, passes.csv, goals.csv, figures "
        "and a self-contained report.html to the output folder. Ctrl-C keeps what is measured, and "
        "the same command goes on from there: what was measured with the same code, input and "
        "settings is not measured again. Measured in parts, the output folder gathers them: all of "
        "the same code and input is shown.",
        epilog="Exit status: 0 if all integrators finished, 1 if one failed (its row says why), "
        "130 after Ctrl-C.",
    )
    help = f"what to measure, of: {', '.join(PARTS)} (default: all), or a script of yours"
    part = command_line.scene_or_script(lambda: PARTS)
    parser.add_argument("parts", nargs="*", type=part, metavar="PART", help=help)
    sizes = ",".join(map(str, SCENES["water"].sizes))
    for option, kind, metavar, help in (
        ("--ranks", command_line.wholes, "N,N", "numbers of MPI ranks (default 1,2)"),
        ("--sizes", command_line.wholes, "N,N", f"of molecules (default {sizes}; --short: first)"),
        ("--rounds", command_line.whole, "N", "turns of each (default 5; --short: 2)"),
        ("--seconds", command_line.positive, "S", "of a timed segment (default 1; --short: 0.2)"),
    ):
        parser.add_argument(option, type=kind, metavar=metavar, help=help)
    names = ", ".join(BENCHMARKED)
    help = f"integrators, of: {names} (default all; --short: {' '.join(SHORT)})"
    command_line.only_of(parser, lambda: BENCHMARKED, help)
    for option, help in (
        ("--short", "some minutes in all, for a first look"),
        ("--again", "measure anew what is there already"),
    ):
        parser.add_argument(option, action="store_true", help=help)
    command_line.silence(parser, 300.0)
    command_line.out(parser, "results/bench", short=True)
    command_line.own(parser)
    command_line.launch(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from ..own import system
    from ..pages import console
    from ..running import store
    from . import figures, goals, measure, plan, report  # heavy: not for --help

    scripts = [one for one in arguments.parts if command_line.is_script(one, lambda: PARTS)]
    if not arguments.parts:
        command_line.need_scenes()
    if scripts and len(arguments.parts) > 1:
        arguments.parser.error("a script of your own is measured alone")
    short = arguments.short
    rounds = arguments.rounds or (2 if short else 5)
    seconds = arguments.seconds or (0.2 if short else 1.0)
    ranks = arguments.ranks or (1, 2)
    if scripts:
        ask, out = system.begin(arguments, scripts[0], short)
    else:
        out = command_line.folder(arguments, short)
    with store.alone(out):
        if scripts:
            own = system.take(ask, out, ranks[0], arguments.silence)
            integrators = command_line.chosen_of(own.integrators, arguments.only)
            names = tuple(one.name for one in integrators)
            points = [plan.Point(ask.name, n, own.bodies, names, rounds, seconds) for n in ranks]
        else:
            known = {name: name for name in BENCHMARKED}
            names = tuple(
                command_line.chosen_of(known, arguments.only or (SHORT if short else None))
            )
            sizes = arguments.sizes or SCENES["water"].sizes[: 1 if short else None]
            points = plan.points(arguments.parts or PARTS, ranks, sizes, names, rounds, seconds)
        screen = console.console()
        with console.Meter(screen, sum(point.turns for point in points), "runs") as meter:
            how = out, arguments.again, meter, arguments.silence
            summary = (
                measure.own(own.scene, integrators, points, *how)
                if scripts
                else measure.bench(points, *how)
            )
    judged = [] if scripts else goals.judge(summary["points"], summary["starts"])
    summary["goals"] = judged
    report.write(summary, figures.draw(summary, out), out)
    report.show(screen, summary, out)
    rows = [
        *(row for point in summary["points"] for row in point["integrators"]),
        *summary["passes"],
        *summary["starts"],
    ]
    return command_line.status(summary["interrupted"], any(row["error"] for row in rows))
