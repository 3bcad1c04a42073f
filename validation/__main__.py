"""Command line: ``python -m validation VERB ...``, from the checkout."""

import argparse
import signal
import sys
from pathlib import Path

from validation.integrators import BENCHMARKED, INTEGRATORS
from validation.scenes import SCENES

COMPARED = [name for name, scene in SCENES.items() if scene.units == "real"]
PARTS = *SCENES, "passes", "start", "memory"
SHORT = "nosquish", "rigid/nve", "rigid/nve/small", "shake"


def main(words=None):
    """Parse the command line and run its verb; the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m validation",
        description="Compare fix_nosquish with LAMMPS's own rigid and constraint fixes.",
    )
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    _add_compare(verbs)
    _add_long(verbs)
    _add_bench(verbs)
    _add_scaling(verbs)
    _add_paper(verbs)
    _add_theory(verbs)
    arguments = parser.parse_args(words)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends the verb's children as Ctrl-C does
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
    parser.add_argument("scene", choices=COMPARED, help="what is simulated: %(choices)s")
    parser.add_argument("--ranks", type=_whole, default=2, metavar="N",
                        help="MPI ranks of each run (default %(default)s)")
    parser.add_argument("--steps", type=_whole, default=1500, metavar="N",
                        help="length of each trajectory (default %(default)s)")
    parser.add_argument("--dt", type=_positive, metavar="FS", help="time step in fs (default: the scene's)")
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

    scene = SCENES[arguments.scene]
    integrators = [one for name, one in INTEGRATORS.items() if name in arguments.only and one.can_run(scene)]
    out = arguments.out or Path("results") / f"compare-{scene.name}"
    out.mkdir(parents=True, exist_ok=True)
    screen = console.console()
    each = arguments.steps + arguments.rounds * (compare.WARM_UP + arguments.segment)
    with console.Meter(screen, len(integrators) * each) as meter:
        summary, series = compare.compare(
            scene, integrators, out, ranks=arguments.ranks, steps=arguments.steps,
            dt=arguments.dt or scene.dt, rounds=arguments.rounds, segment=arguments.segment,
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

    screen = console.console()
    arguments.out.mkdir(parents=True, exist_ok=True)
    with console.Meter(screen, 2 * len(arguments.only) * arguments.steps) as meter:
        rows, series = longrun.long_run(arguments.out, arguments.steps, arguments.only, meter, arguments.silence)
    longrun.show(screen, rows)
    screen.print(f"figure: {longrun.draw(rows, series, arguments.out)}")
    return 130 if any(row["error"] == "interrupted" for row in rows) else int(any(row["error"] for row in rows))


def _add_bench(verbs):
    parser = verbs.add_parser(
        "bench",
        help="what ours and LAMMPS's fixes cost: time, memory, messages",
        description="Time fix_nosquish.NVE and LAMMPS's own fixes on the same starts, in turn. Writes tables to the terminal and summary.json, "
        "table.csv, passes.csv, goals.csv, figures and a self-contained report.html to the output folder. Ctrl-C keeps what is measured, and the "
        "same command goes on from there: what was measured with the same code, input and settings is not measured again. Measured in "
        "parts, the output folder gathers them: all scenes of the same code and input are shown.",
        epilog="Exit status: 0 if all integrators finished, 1 if one failed (its row says why), 130 after Ctrl-C.",
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"what to measure, of: {', '.join(PARTS)} (default: all)")
    parser.add_argument("--ranks", type=_wholes, default=(1, 2), metavar="N,N", help="numbers of MPI ranks (default 1,2)")
    parser.add_argument("--sizes", type=_wholes, metavar="N,N",
                        help=f"numbers of molecules of the water (default {','.join(map(str, SCENES['water'].sizes))}; --short: the first)")
    parser.add_argument("--only", nargs="+", choices=BENCHMARKED, metavar="NAME",
                        help=f"integrators, of: %(choices)s (default all; --short: {' '.join(SHORT)})")
    parser.add_argument("--rounds", type=_whole, metavar="N", help="turns of each integrator (default 5; --short: 2)")
    parser.add_argument("--seconds", type=_positive, metavar="S", help="length of a timed segment (default 1; --short: 0.2)")
    parser.add_argument("--short", action="store_true", help="some minutes in all, for a first look")
    parser.add_argument("--again", action="store_true", help="measure anew what is there already")
    parser.add_argument("--silence", type=_positive, default=300.0, metavar="S",
                        help="give a run up that wrote nothing for S seconds (default %(default)g)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder (default results/bench; --short: results/bench-short)")
    parser.set_defaults(function=_bench, parser=parser)


def _bench(arguments):
    unknown = [part for part in arguments.parts if part not in PARTS]
    if unknown:
        arguments.parser.error(f"there is no part {unknown[0]}: choose from {', '.join(PARTS)}")
    from validation import bench, bench_figures, bench_report, console  # heavy: not for --help

    short = arguments.short
    only = arguments.only or (SHORT if short else BENCHMARKED)
    settings = bench.Settings(
        integrators=tuple(name for name in BENCHMARKED if name in only),
        rounds=arguments.rounds or (2 if short else 5),
        seconds=arguments.seconds or (0.2 if short else 1.0),
        silence=arguments.silence,
    )
    sizes = arguments.sizes or SCENES["water"].sizes[: 1 if short else None]
    points = bench.points(arguments.parts or PARTS, arguments.ranks, sizes, settings)
    out = arguments.out or Path("results") / ("bench-short" if short else "bench")
    out.mkdir(parents=True, exist_ok=True)
    screen = console.console()
    with console.Meter(screen, sum(point.turns for point in points), "runs") as meter:
        summary = bench.bench(points, out, arguments.again, meter)
    bench_report.write(summary, bench_figures.draw(summary, out), out)
    bench_report.show(screen, summary, out)
    if summary["interrupted"]:
        return 130
    rows = [*(row for point in summary["points"] for row in point["integrators"]), *summary["passes"], *summary["starts"]]
    return int(any(row["error"] for row in rows))


def _add_scaling(verbs):
    parser = verbs.add_parser(
        "scaling",
        help="what ranks send each other, counted, and what that would cost on many",
        description="Count what the fixes hand to MPI in a step of water with 1,000 molecules on each rank, and what that would cost on up to "
        "100,000 ranks, by a model. Writes counts.csv, model.csv, summary.json, a figure and a self-contained report.html. Needs a C compiler.",
    )
    parser.add_argument("--ranks", type=_wholes, default=(1, 2, 4, 8, 16), metavar="N,N", help="numbers of MPI ranks (default 1,2,4,8,16)")
    parser.add_argument("--out", type=Path, default=Path("results/scaling"), metavar="DIR", help="output folder (default %(default)s)")
    parser.set_defaults(function=_scaling)


def _scaling(arguments):
    from validation import console, machine, scaling, scaling_report  # heavy: not for --help

    out, screen = arguments.out, console.console()
    out.mkdir(parents=True, exist_ok=True)
    runs = len(scaling.COMPARED) * (len(arguments.ranks) + len({*arguments.ranks, 27}))
    with console.Meter(screen, runs * (scaling.WARM_UP + scaling.STEPS)) as meter:
        rows = scaling.scaling(out, arguments.ranks, meter)
    links = [scaling.NETWORK, scaling.link()]
    summary = machine.circumstances() | {
        "interrupted": any(row["error"] == "interrupted" for row in rows), "steps": scaling.STEPS, "counts": rows,
        "links": [link._asdict() for link in links],
        "model": [{"link": link.name, **row} for link in links for row in scaling.model(rows, link)],
    }  # fmt: skip
    scaling_report.write(summary, out)
    scaling_report.show(screen, summary, out)
    return 130 if summary["interrupted"] else int(any(row["error"] for row in rows))


def _add_theory(verbs):
    parser = verbs.add_parser(
        "theory",
        help="what the paper proves, measured: reversible, symplectic, a conserved quantity",
        description="Measure what section II of Miller et al. (2002) proves, each statement a number between bounds. Writes a table to the terminal "
        "and summary.json, table.csv, figures and a self-contained report.html to the output folder.",
        epilog="Exit status: 0 if all numbers are within their bounds, 1 if not, 130 after Ctrl-C, which keeps the parts that are complete.",
    )
    parser.add_argument("parts", nargs="*", metavar="PART",
                        help="what to measure, of: reversal (in LAMMPS), symplectic, conserved, mrot, recursion (default: all)")
    parser.add_argument("--silence", type=_positive, default=120.0, metavar="S",
                        help="give a run up that wrote nothing for S seconds (default %(default)g)")
    parser.add_argument("--out", type=Path, default=Path("results/theory"), metavar="DIR", help="output folder (default %(default)s)")
    parser.set_defaults(function=_theory, parser=parser)


def _theory(arguments):
    from validation import console, machine, theory, theory_report  # heavy: not for --help

    unknown = [part for part in arguments.parts if part not in theory.PARTS]
    if unknown:
        arguments.parser.error(f"there is no part {unknown[0]}: choose from {', '.join(theory.PARTS)}")
    parts = [part for part in theory.PARTS if part in (arguments.parts or theory.PARTS)]
    out, screen = arguments.out, console.console()
    out.mkdir(parents=True, exist_ok=True)
    with console.Meter(screen, sum(theory.PARTS[part][1] for part in parts), "pieces") as meter:
        checks, data, interrupted = theory.theory(parts, out, meter, arguments.silence)
    summary = machine.circumstances() | {"interrupted": interrupted, "checks": [check.plain() for check in checks], "data": data}
    theory_report.write(summary, out)
    theory_report.show(screen, summary, out)
    return 130 if interrupted else int(not all(check.holds for check in checks))


def _add_paper(verbs):
    parser = verbs.add_parser(
        "paper",
        help="the paper's test problems again: figures 2 and 3, and what it says of them",
        description="Run the water dimer, liquid water and the peptide of Miller et al. (2002) with NO_SQUISH, the paper's reference 12, Gear's "
        "scheme and LAMMPS's own fixes, draw the paper's figures and check its statements. Writes summary.json, table.csv, claims.csv, series.csv, "
        "figures and a self-contained report.html. Ctrl-C keeps what is computed, and the same command goes on from there.",
        epilog="Exit status: 0 if all trajectories but Gear's are complete, 1 if one is not, 130 after Ctrl-C.",
    )
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--short", action="store_true", help="some minutes in all, for a first look (the default)")
    length.add_argument("--full", action="store_true", help="the paper's lengths, but half of its 6,000 ps of liquid: a night")
    parser.add_argument("--liquid", type=_positive, metavar="PS", help="length of the liquid's trajectories")
    parser.add_argument("--ranks", type=_whole, default=2, metavar="N", help="MPI ranks of what is larger than the dimer (default %(default)s)")
    parser.add_argument("--silence", type=_positive, default=300.0, metavar="S",
                        help="give a run up that wrote nothing for S seconds (default %(default)g)")
    parser.add_argument("--out", type=Path, metavar="DIR", help="output folder (default results/paper; --short: results/paper-short)")
    parser.set_defaults(function=_paper)


def _paper(arguments):
    from dataclasses import asdict, replace

    from validation import console, paper, paper_claims, paper_report  # heavy: not for --help

    lengths = paper.FULL if arguments.full else paper.SHORT
    if arguments.liquid:
        lengths = replace(lengths, liquid=arguments.liquid)
    out, screen = arguments.out or Path("results") / ("paper" if arguments.full else "paper-short"), console.console()
    (out / "runs").mkdir(parents=True, exist_ok=True)
    with console.Meter(screen, paper.steps_of(lengths, arguments.ranks, out / "runs")) as meter:
        found, circumstances = paper.paper(out / "runs", lengths, arguments.ranks, arguments.silence, meter)
    summary = circumstances | {"lengths": asdict(lengths)} | paper_claims.judge(found)
    paper_report.write(summary, found, out)
    paper_report.show(screen, summary, out)
    if summary["interrupted"]:
        return 130
    return int(any(one.error for one in found.values() if one.trajectory.integrator.name != "gear"))


def _wholes(words):
    return tuple(_whole(word) for word in words.split(","))


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
