"""``stress``: its words, and what they run."""

from argparse import Namespace
from collections.abc import Collection
from pathlib import Path
from typing import Any

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "stress",
        run,
        help="what breaks, where: time step, heat, cold, odd bodies, ranks, what users report",
        description="Run cases that some integrator does not bear with fix_nosquish's schemes and "
        "LAMMPS's own fixes, each judged by a number against a bound; or a script of yours with "
        "longer steps, in parts and on other ranks. After a Ctrl-C the same command goes on; cases "
        "that the output folder has from other times are shown too. The same command in several "
        "processes at once shares the cases among them.",
        epilog="Exit status: 0 if ours has no blow-up that a LAMMPS fix survives, 1 if it has, "
        "130 after Ctrl-C.",
    )
    case = command_line.scene_or_script(_cases)
    text = "which (default: all); --list names them; or a LAMMPS input script of yours"
    parser.add_argument("cases", nargs="*", type=case, metavar="CASE", help=text)
    text = "name all cases, with their physics, and end"
    parser.add_argument("--list", action="store_true", help=text)
    full = (
        "one and a half to three hours of one core; start it once for each core to share the cases"
    )
    command_line.short_or_full(parser, full)
    text = "integrators, as the table of --list names them (default: all that a case is run with)"
    command_line.only_of(parser, _names, text)
    command_line.silence(parser, 300.0)
    command_line.out(parser, "results/stress", short=True)
    command_line.own(parser)
    command_line.launch(parser)


def _cases() -> Collection[str]:
    from .cases import CASES  # heavy: not for --help

    return CASES


def _names() -> Collection[str]:
    from .measure import COMPARED  # heavy: not for --help

    return COMPARED


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from .. import pages
    from ..pages import console
    from . import measure, report  # heavy: not for --help
    from .cases import CASES

    screen = console.console()
    if arguments.list:
        report.list_cases(screen, CASES)
        return 0
    scripts = [word for word in arguments.cases if command_line.is_script(word, _cases)]
    if scripts:
        summary, out, bad = _script(arguments, scripts[0], screen)
    else:
        command_line.need_scenes()
        command_line.chosen_of({name: name for name in _names()}, arguments.only)
        names, full = command_line.chosen(CASES, arguments.cases), arguments.full
        out = command_line.folder(arguments, not full)
        rows = measure.plan(CASES, names, full, arguments.only)
        silence, only = arguments.silence, arguments.only
        with console.Meter(screen, len(rows), "rows") as meter:
            summary = measure.stress(CASES, names, out, full, silence, meter, only)
        breaks, _ = measure.worse(summary["cases"]).values()
        bad = bool(breaks)
    said = report.said(summary)
    pages.write(said, summary, out)
    pages.show(screen, said, summary, out)
    return command_line.status(summary["interrupted"], bad)


def _script(arguments: Namespace, path: str, screen: Any) -> tuple[dict, Path, bool]:
    """Try a user's script: the summary, its folder, and whether ours breaks other than by a longer
    step."""
    from ..own import system  # heavy: not for --help
    from ..pages import console
    from ..running import store
    from . import script

    if len(arguments.cases) > 1:
        arguments.parser.error("a script of your own is tried alone")
    command_line.refuse(arguments, ("full",), "is for the cases, not for a script")
    ask, out = system.begin(arguments, path)
    with store.alone(out):
        own = system.take(ask, out, 1, arguments.silence)
        system.refuse_ramps(own)
        some = command_line.chosen_of(own.integrators, arguments.only)
        with console.Meter(screen, len(some) * script.TOTAL) as meter:
            summary = script.stress(own, some, out, arguments.silence, meter)
    ours = {integrator.label for integrator in some if integrator.kind == "ours"}
    lost = [check for check in summary["checks"] if check["verdict"] == "does not hold"]
    bad = any(check["subject"] in ours and check["part"] != "step" for check in lost)
    return summary, out, bad
