"""The verb ``report``: its command line, and what it runs."""

from argparse import Namespace
from pathlib import Path

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.add_verb(
        verbs,
        "report",
        run,
        help="write all results to one page",
        description="Write the results of the other verbs to one self-contained HTML page. It "
        "begins with the answer: which time step, what it gains, and at what error. Results that "
        "are not in the folder are taken from those committed in validation/results.",
    )
    parser.add_argument(
        "--results",
        type=Path,
        default=Path("results"),
        metavar="DIR",
        help="folder with the results (default %(default)s)",
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="folder of the page (default: that of --results)"
    )


def run(arguments: Namespace) -> int:
    """Run the verb; return the exit status."""
    command_line.require_scenes()
    from ..pages import console
    from . import report  # heavy: not for --help

    folder = command_line.make_folder(arguments, arguments.out or arguments.results)
    screen, out = console.console(), folder / "report.html"
    sections, problems = report.gather(arguments.results)
    report.write(sections, problems, out)
    for problem in problems:
        screen.print(problem, markup=False, soft_wrap=True)
    screen.print(f"page: {out}, {out.stat().st_size / 1e6:.1f} MB", soft_wrap=True)
    return 0
