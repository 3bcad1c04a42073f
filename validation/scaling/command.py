"""``scaling``: its words, and what they run."""

from argparse import Namespace

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "scaling",
        run,
        help="what ranks send each other, counted, and what that would cost on many",
        description="Count what the fixes hand to MPI in a step of water with 1,000 molecules on "
        "each rank, and what that would cost on up to 100,000 ranks, by a model. Writes "
        "counts.csv, model.csv, summary.json, a figure and a self-contained report.html. "
        "Needs a C compiler. Ctrl-C keeps what is counted, and the same command goes on from "
        "there.",
    )
    help, kind = "numbers of MPI ranks (default 1,2,4,8,16)", command_line.wholes
    parser.add_argument("--ranks", type=kind, default=(1, 2, 4, 8, 16), metavar="N,N", help=help)
    command_line.out(parser, "results/scaling")
    command_line.launch(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    command_line.need_scenes()
    from ..pages import console
    from . import measure, report  # heavy: not for --help

    out, screen = command_line.folder(arguments), console.console()
    cases = measure.cases(arguments.ranks)
    with console.Meter(screen, len(cases) * (measure.WARM_UP + measure.STEPS)) as meter:
        summary = measure.scaling(cases, out, meter)
    report.write(summary, out)
    report.show(screen, summary, out)
    failed = any(row["error"] for row in summary["counts"])
    return command_line.status(summary["interrupted"], failed)
