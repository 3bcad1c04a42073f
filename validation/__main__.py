"""Command line: ``python -m validation VERB ...``, from the checkout."""

import argparse
import signal
import sys
from pathlib import Path

from validation.integrators import INTEGRATORS
from validation.scenes import SCENES


def main(words=None):
    """Parse the command line and run its verb; the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m validation",
        description="Compare fix_nosquish with LAMMPS's own rigid and constraint fixes.",
    )
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    _add_compare(verbs)
    _add_long(verbs)
    arguments = parser.parse_args(words)
    return arguments.function(arguments)


def _add_compare(verbs):
    parser = verbs.add_parser(
        "compare",
        help="the same start with ours and with LAMMPS's fixes: accuracy and cost",
        description="Run the same start with fix_nosquish.NVE and with LAMMPS's own fixes. "
        "Writes a table to the terminal and summary.json, table.csv, series.csv, figures, a "
        "self-contained report.html and every run's log to the output folder. Ctrl-C keeps what "
        "is computed.",
        epilog="Exit status: 0 if all integrators finished, 1 if one failed (its row says why), "
        "130 after Ctrl-C.",
    )
    parser.add_argument("scene", choices=SCENES, help="what is simulated: %(choices)s")
    parser.add_argument("--ranks", type=_whole, default=2, metavar="N",
                        help="MPI ranks of each run (default %(default)s)")
    parser.add_argument("--steps", type=_whole, default=1500, metavar="N",
                        help="length of each trajectory (default %(default)s)")
    parser.add_argument("--dt", type=_positive, default=2.0, metavar="FS",
                        help="time step in fs (default %(default)s)")
    parser.add_argument("--only", nargs="+", choices=INTEGRATORS, metavar="NAME",
                        default=list(INTEGRATORS), help="integrators, of: %(choices)s")
    parser.add_argument("--rounds", type=_whole, default=3, metavar="N",
                        help="timed segments of each integrator (default %(default)s)")
    parser.add_argument("--segment", type=_whole, default=200, metavar="N",
                        help="steps of a timed segment (default %(default)s)")
    parser.add_argument("--silence", type=_positive, default=120.0, metavar="S",
                        help="give a run up that wrote nothing for S seconds (default %(default)g)")
    parser.add_argument("--out", type=Path, metavar="DIR",
                        help="output folder (default results/compare-SCENE)")
    parser.set_defaults(function=_compare)


def _compare(arguments):
    from validation import compare, console, figures, report  # heavy: not for --help

    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends its children as Ctrl-C does
    scene = SCENES[arguments.scene]
    integrators = [INTEGRATORS[name] for name in INTEGRATORS if name in arguments.only]
    out = arguments.out or Path("results") / f"compare-{scene.name}"
    out.mkdir(parents=True, exist_ok=True)
    screen = console.console()
    each = arguments.steps + arguments.rounds * (compare.WARM_UP + arguments.segment)
    with console.Meter(screen, len(integrators) * each) as meter:
        summary, series = compare.compare(
            scene, integrators, out, ranks=arguments.ranks, steps=arguments.steps,
            dt=arguments.dt, rounds=arguments.rounds, segment=arguments.segment,
            silence=arguments.silence, meter=meter,
        )
    report.write(summary, series, figures.draw(summary, series, out), out)
    console.show(screen, summary, out)
    if summary["interrupted"]:
        return 130
    return int(any(row["error"] for row in summary["integrators"]))


def _add_long(verbs):
    parser = verbs.add_parser(
        "long",
        help="a free body for 10^7 steps: energy, momenta, shape",
        description="Run one body without forces for very many steps with fix_nosquish.NVE, rigid/nve and rigid, at a short "
        "and at a practical time step, and draw what becomes of energy, momenta and shape. A run that is complete "
        "in the output folder is not done again.",
    )
    parser.add_argument("--steps", type=_whole, default=10_000_000, metavar="N", help="of each run (default %(default)s)")
    parser.add_argument("--only", nargs="+", choices=("nosquish", "rigid/nve", "rigid"), metavar="NAME",
                        default=["nosquish", "rigid/nve", "rigid"], help="integrators, of: %(choices)s")
    parser.add_argument("--silence", type=_positive, default=120.0, metavar="S",
                        help="give a run up that wrote nothing for S seconds (default %(default)g)")
    parser.add_argument("--out", type=Path, metavar="DIR", default=Path("results/long-run"), help="output folder (default %(default)s)")
    parser.set_defaults(function=_long)


def _long(arguments):
    from validation import console, longrun  # heavy: not for --help

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    screen = console.console()
    arguments.out.mkdir(parents=True, exist_ok=True)
    with console.Meter(screen, 2 * len(arguments.only) * arguments.steps) as meter:
        rows, series = longrun.long_run(arguments.out, arguments.steps, arguments.only, meter, arguments.silence)
    longrun.show(screen, rows)
    screen.print(f"figure: {longrun.draw(rows, series, arguments.out)}")
    return 130 if any(row["error"] == "interrupted" for row in rows) else int(any(row["error"] for row in rows))


def _whole(word):
    value = int(word)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{word}: a positive whole number is expected")
    return value


def _positive(word):
    value = float(word)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{word}: a positive number is expected")
    return value


if __name__ == "__main__":
    sys.exit(main())
