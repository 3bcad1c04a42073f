"""``report``: its words, and what they run."""

from argparse import Namespace
from pathlib import Path

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "report",
        run,
        help="all results on one page, to mail",
        description="Gather what the other verbs have left into one self-contained HTML page: what "
        "is best for which scene, what breaks where, what it costs. It takes sweep, stability, "
        "breaks, theory, paper, published, ensembles, sampling, engines, compare and "
        "long. Results that are not in the folder are taken from those committed in "
        "validation/results.",
        epilog="Exit status: 0 if the page is written, 130 after a Ctrl-C in the runs of --short, "
        "which writes the page of what there is.",
    )
    parser.add_argument(
        "--results",
        type=Path,
        default=Path("results"),
        metavar="DIR",
        help="folder of the results' folders (default %(default)s)",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="the page (default DIR/report.html)"
    )
    parser.add_argument(
        "--short",
        action="store_true",
        help="first run sweep --short and stability --short, where DIR has no results of these "
        "verbs: a quarter of an hour",
    )


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    command_line.need_scenes()
    from ..pages import console
    from . import report  # heavy: not for --help

    screen, out = console.console(), arguments.out or arguments.results / "report.html"
    command_line.made(arguments, out.parent)
    interrupted = False
    for verb in report.SHORT if arguments.short else ():
        if not interrupted and not report.has(arguments.results, verb):
            interrupted = report.run_short(verb, arguments.results / f"{verb}-short")
    sections = report.gather(arguments.results)
    report.write(sections, out)
    for section in sections:
        for line in section.warnings:
            screen.print(f"{section.name}: {line}", markup=False, soft_wrap=True)
    screen.print(f"page: {out}, {out.stat().st_size / 1e6:.1f} MB", soft_wrap=True)
    return command_line.status(interrupted, False)
