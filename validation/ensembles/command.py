"""``ensembles``: its words, and what they run."""

import argparse

from .. import command_line
from .plan import FULL_TIME, SCHEMES, SHORT_STEPS, SHORT_TIME


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "ensembles",
        run,
        help="what thermostats and barostats with a long step do to energies and densities",
        description="Run water at constant volume and at constant pressure with this package's "
        "thermostats and barostats and with LAMMPS's, at 1 to 8 fs, and hold mean energy, "
        "temperatures, pressure and density against those of a step of 1 fs. At constant pressure "
        "hold the distributions of two temperatures and of two pressures against each other. "
        "Writes tables to the terminal and summary.json, table.csv, checks.csv, figures and a "
        "self-contained report.html to the output folder. Ctrl-C keeps each run that is complete, "
        "and the same command goes on from there. With the same lengths the output folder gathers "
        "schemes and steps. The same command, started once for each core, shares the runs.",
        epilog="A scheme of LAMMPS that fails is a result. Exit status: 0 if no number is outside "
        "of its bounds by its 95 % margin, 1 if one is or a run of ours failed, 130 after Ctrl-C.",
    )
    command_line.short_or_full(
        parser, f"{FULL_TIME:g} ps of each point: fourteen hours of one core"
    )
    text = f"length of each point (default {FULL_TIME:g}, --short {SHORT_TIME:g})"
    parser.add_argument("--ps", type=command_line.positive, metavar="PS", help=text)
    short = ",".join(f"{one:g}" for one in SHORT_STEPS)
    text = f"time steps in fs, beside the reference (default each scheme's own; --short {short})"
    parser.add_argument("--dt", type=command_line.positives, metavar="FS,FS", help=text)
    command_line.only(parser, SCHEMES, "schemes, of: %(choices)s (default all)")
    text = (
        "independent starts; each tells its own error, and where they are further apart than that "
        "their scatter tells it, best with four or more"
    )
    command_line.number(parser, "--starts", 1, "N", text)
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/ensembles", short=True)
    command_line.launch(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; the exit status."""
    command_line.need_scenes()
    from ..pages import console
    from ..statistics.estimate import plain
    from . import criteria, measure, plan, report  # heavy: not for --help
    from .lengths import Lengths, Point

    short = not arguments.full
    out = command_line.folder(arguments, short)
    time = arguments.ps or (SHORT_TIME if short else FULL_TIME)
    lengths = Lengths(time, arguments.starts)
    points = plan.points(arguments.only, arguments.dt or (SHORT_STEPS if short else None))
    screen = console.console()
    with console.Meter(screen, plan.total(points, lengths)) as meter:
        summary, rows = measure.ensembles(points, lengths, out, meter, arguments.silence)
    made = criteria.checks({Point(row.scheme, row.dt): vars(row) for row in rows}, time)
    summary |= {"rows": [plain(vars(row)) for row in rows], "checks": [one.plain() for one in made]}
    report.write(summary, out)
    report.show(screen, summary, out)
    failed = any(one.holds is False for one in made) or any(row.ours and row.error for row in rows)
    return command_line.status(summary["interrupted"], failed)
