"""``examples``: its words, and what they run."""

from argparse import Namespace
from pathlib import Path

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "examples",
        run,
        help="LAMMPS's own examples with -sf nosquish beside its rigid fixes",
        description="Run LAMMPS's examples that have a rigid fix, once with LAMMPS's own and once "
        "with '-sf nosquish', on 1 and 2 ranks, and compare every column that they print: the "
        "first steps to rounding, then means with 95 %% intervals. Nothing in the inputs is "
        "changed but output and the number of steps.",
        epilog="Exit status: 0 if all agree or are refused by a message, 1 if not, 130 after "
        "Ctrl-C, which keeps the runs that are complete.",
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="LAMMPS's folder examples")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="words in the inputs' names")
    parser.add_argument("--quick", action="store_true", help="200 steps, two starts")
    command_line.number(parser, "--steps", 10000, "N", "steps of a script's runs together, at most")
    command_line.number(parser, "--starts", 4, "N", "starts, where runs part")
    command_line.number(parser, "--seconds", 4.0, "S", "of a run with LAMMPS's own fix, at most")
    command_line.out(parser, "results/examples")
    command_line.launch(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from ..pages import console
    from ..running import machine, store
    from . import measure, plan, report, runs  # heavy: not for --help

    found = plan.found(arguments.folder)
    only = arguments.only or [""]
    chosen = [one for name, one in found.items() if any(word in name for word in only)]
    if not chosen:
        arguments.parser.error(f"no input with a rigid fix in {arguments.folder}")
    out, screen = command_line.folder(arguments), console.console()
    steps, starts = (200, 2) if arguments.quick else (arguments.steps, arguments.starts)
    lengths = runs.Lengths(steps, starts, arguments.seconds)
    summary = machine.circumstances() | {"steps": steps, "starts": starts}
    with store.alone(out), console.Meter(screen, len(chosen), "inputs") as meter:
        rows, interrupted = measure.examples(chosen, out, lengths, meter)
    summary |= {"interrupted": interrupted, "rows": rows}
    report.write(summary, out)
    report.show(screen, summary, out)
    wrong = any(row["verdict"] not in measure.GOOD for row in rows)
    return command_line.status(interrupted, wrong)
