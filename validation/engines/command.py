"""``engines``: its words, and what they run."""

import argparse
from pathlib import Path

from .. import RESULTS, command_line

KNOWN = "sampling-water"


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "engines",
        run,
        help="the bias of averages in OpenMM and GROMACS, beside LAMMPS's",
        description="Run the water of the verb sampling with thermostats of OpenMM and of GROMACS, "
        "at 1 to 8 fs. Hold mean potential energy and pressure against the limit of small steps. "
        "OpenMM has the same forces as LAMMPS, so the limit is LAMMPS's. GROMACS's forces end "
        "otherwise, so the limit is its own. Ctrl-C keeps each run that is complete, and the same "
        "command goes on from there. With the same length the output folder gathers schemes, "
        "steps and starts. The same command, started several times, shares the runs.",
        epilog="OpenMM: pip install 'fix_nosquish[engines]'. GROMACS: apt-get install gromacs. A "
        "scheme that fails is a result. Exit status: 0, 1 if no run succeeds or an engine is not "
        "installed, 130 after Ctrl-C.",
    )
    command_line.short_or_full(parser, "300 ps of each point: two days of one core")
    text = "length of each point (default 300, --short 10)"
    parser.add_argument("--ps", type=command_line.positive, metavar="PS", help=text)
    text = "time steps in fs (default each scheme's own)"
    parser.add_argument("--dt", type=command_line.positives, metavar="FS,FS", help=text)
    text = "schemes, by name; an unknown one lists all"
    parser.add_argument("--only", nargs="+", metavar="NAME", help=text)
    command_line.number(parser, "--starts", 1, "N", "runs of each point, with other random numbers")
    text = f"folder of the verb sampling, for LAMMPS's limit (default the committed {KNOWN})"
    parser.add_argument(
        "--from", type=Path, dest="known", metavar="DIR", default=RESULTS / KNOWN, help=text
    )
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/engines", short=True)


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; the exit status."""
    command_line.need_scenes()
    from ..ensembles.lengths import Lengths
    from ..pages import console
    from . import criteria, measure, plan, report  # heavy: not for --help

    short = not arguments.full
    names = [one.name for one in command_line.chosen_of(plan.SCHEMES, arguments.only)]
    points = plan.points(names, arguments.dt)
    measure.versions(points)
    known = measure.known_limit(arguments.known)
    out = command_line.folder(arguments, short)
    lengths = Lengths(arguments.ps or plan.TIMES[short], arguments.starts)
    screen = console.console()
    with console.Meter(screen, plan.total(points, lengths)) as meter:
        summary = measure.engines(points, lengths, out, known, meter, arguments.silence)
    summary["checks"] = [one.plain() for one in criteria.checks(summary)]
    report.write(summary, out)
    report.show(screen, summary, out)
    failed = all(row["error"] for row in summary["rows"])
    return command_line.status(summary["interrupted"], failed)
