"""Command line: ``python -m validation VERB ...``, from the checkout."""

import argparse
import signal
import sys
from pathlib import Path

from validation.integrators import BENCHMARKED, INTEGRATORS, SWEPT
from validation.scenes import SCENES

COMPARED = [name for name, scene in SCENES.items() if scene.units == "real"]
PARTS = *SCENES, "passes", "start", "memory"
SHORT = "nosquish", "rigid/nve", "rigid/nve/small", "shake"


def main(words=None):
    """Parse the command line and run its verb; the exit status."""
    arguments = parser().parse_args(words)
    signal.signal(
        signal.SIGTERM, signal.default_int_handler
    )  # ends the verb's children as Ctrl-C does
    return arguments.function(arguments)


def parser():
    """The command line's parser: what it accepts can be run, so far as that is known without running it."""
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
    _add_published(verbs)
    _add_report(verbs)
    _add_sweep(verbs)
    _add_advise(verbs)
    _add_stability(verbs)
    _add_breaks(verbs)
    return parser


def _one_of(kind, known):
    """A type of argparse: a word among those that ``known()`` gives when one is asked for, as names can be slow to find."""

    def word(text):
        if text not in (names := known()):
            raise argparse.ArgumentTypeError(
                f"there is no {kind} {text}: choose from {', '.join(names)}"
            )
        return text

    return word


def _swept():
    from validation.sweep_plan import SCENES as swept  # heavy: not for --help

    return swept


def _cases():
    from validation.stability_cases import CASES  # heavy: not for --help

    return CASES


def _compared():
    from validation.stability import COMPARED  # heavy: not for --help

    return COMPARED


def _theorems():
    from validation.theory import PARTS as theorems  # heavy: not for --help

    return theorems


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
    parser.add_argument(
        "--ranks",
        type=_whole,
        default=2,
        metavar="N",
        help="MPI ranks of each run (default %(default)s)",
    )
    parser.add_argument(
        "--steps",
        type=_whole,
        default=1500,
        metavar="N",
        help="length of each trajectory (default %(default)s)",
    )
    parser.add_argument(
        "--dt", type=_positive, metavar="FS", help="time step in fs (default: the scene's)"
    )
    parser.add_argument(
        "--only",
        nargs="+",
        choices=INTEGRATORS,
        metavar="NAME",
        default=list(INTEGRATORS),
        help="integrators, of: %(choices)s",
    )
    parser.add_argument(
        "--rounds",
        type=_whole,
        default=3,
        metavar="N",
        help="timed segments of each integrator (default %(default)s)",
    )
    parser.add_argument(
        "--segment",
        type=_whole,
        default=200,
        metavar="N",
        help="steps of a timed segment (default %(default)s)",
    )
    _add_silence(parser, 120.0)
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="output folder (default results/compare-SCENE)"
    )
    parser.set_defaults(function=_compare)


def _compare(arguments):
    from validation import compare, console, figures, report  # heavy: not for --help

    scene = SCENES[arguments.scene]
    integrators = [
        one for name, one in INTEGRATORS.items() if name in arguments.only and one.can_run(scene)
    ]
    out = arguments.out or Path("results") / f"compare-{scene.name}"
    out.mkdir(parents=True, exist_ok=True)
    screen = console.console()
    each = arguments.steps + arguments.rounds * (compare.WARM_UP + arguments.segment)
    with console.Meter(screen, len(integrators) * each) as meter:
        summary, series = compare.compare(
            scene,
            integrators,
            out,
            ranks=arguments.ranks,
            steps=arguments.steps,
            dt=arguments.dt or scene.dt,
            rounds=arguments.rounds,
            segment=arguments.segment,
            silence=arguments.silence,
            meter=meter,
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
    parser.add_argument(
        "--steps",
        type=_whole,
        default=10_000_000,
        metavar="N",
        help="of each run (default %(default)s)",
    )
    parser.add_argument(
        "--only",
        nargs="+",
        choices=("nosquish", "rigid/nve", "rigid"),
        metavar="NAME",
        default=["nosquish", "rigid/nve", "rigid"],
        help="integrators, of: %(choices)s",
    )
    _add_silence(parser, 120.0)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        default=Path("results/long-run"),
        help="output folder (default %(default)s)",
    )
    parser.set_defaults(function=_long)


def _long(arguments):
    from validation import console, longrun  # heavy: not for --help

    screen = console.console()
    arguments.out.mkdir(parents=True, exist_ok=True)
    with console.Meter(screen, 2 * len(arguments.only) * arguments.steps) as meter:
        rows, series = longrun.long_run(
            arguments.out, arguments.steps, arguments.only, meter, arguments.silence
        )
    longrun.show(screen, rows)
    screen.print(f"figure: {longrun.draw(rows, series, arguments.out)}")
    return (
        130
        if any(row["error"] == "interrupted" for row in rows)
        else int(any(row["error"] for row in rows))
    )


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
    parser.add_argument(
        "parts",
        nargs="*",
        type=_one_of("part", lambda: PARTS),
        metavar="PART",
        help=f"what to measure, of: {', '.join(PARTS)} (default: all)",
    )
    parser.add_argument(
        "--ranks",
        type=_wholes,
        default=(1, 2),
        metavar="N,N",
        help="numbers of MPI ranks (default 1,2)",
    )
    parser.add_argument(
        "--sizes",
        type=_wholes,
        metavar="N,N",
        help=f"numbers of molecules of the water (default {','.join(map(str, SCENES['water'].sizes))}; --short: the first)",
    )
    parser.add_argument(
        "--only",
        nargs="+",
        choices=BENCHMARKED,
        metavar="NAME",
        help=f"integrators, of: %(choices)s (default all; --short: {' '.join(SHORT)})",
    )
    parser.add_argument(
        "--rounds",
        type=_whole,
        metavar="N",
        help="turns of each integrator (default 5; --short: 2)",
    )
    parser.add_argument(
        "--seconds",
        type=_positive,
        metavar="S",
        help="length of a timed segment (default 1; --short: 0.2)",
    )
    parser.add_argument(
        "--short", action="store_true", help="some minutes in all, for a first look"
    )
    parser.add_argument("--again", action="store_true", help="measure anew what is there already")
    _add_silence(parser, 300.0)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="output folder (default results/bench; --short: results/bench-short)",
    )
    parser.set_defaults(function=_bench)


def _bench(arguments):
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
    rows = [
        *(row for point in summary["points"] for row in point["integrators"]),
        *summary["passes"],
        *summary["starts"],
    ]
    return int(any(row["error"] for row in rows))


def _add_scaling(verbs):
    parser = verbs.add_parser(
        "scaling",
        help="what ranks send each other, counted, and what that would cost on many",
        description="Count what the fixes hand to MPI in a step of water with 1,000 molecules on each rank, and what that would cost on up to "
        "100,000 ranks, by a model. Writes counts.csv, model.csv, summary.json, a figure and a self-contained report.html. Needs a C compiler.",
    )
    parser.add_argument(
        "--ranks",
        type=_wholes,
        default=(1, 2, 4, 8, 16),
        metavar="N,N",
        help="numbers of MPI ranks (default 1,2,4,8,16)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("results/scaling"),
        metavar="DIR",
        help="output folder (default %(default)s)",
    )
    parser.set_defaults(function=_scaling)


def _scaling(arguments):
    from fix_nosquish import kernels
    from validation import console, machine, scaling, scaling_report  # heavy: not for --help

    out, screen = arguments.out, console.console()
    out.mkdir(parents=True, exist_ok=True)
    runs = len(scaling.COMPARED) * (len(arguments.ranks) + len({*arguments.ranks, 27}))
    with console.Meter(screen, runs * (scaling.WARM_UP + scaling.STEPS)) as meter:
        rows = scaling.scaling(out, arguments.ranks, meter)
    links = [scaling.NETWORK, scaling.link()]
    summary = machine.circumstances() | {
        "interrupted": any(row["error"] == "interrupted" for row in rows), "steps": scaling.STEPS, "carried": kernels.OF_BODY + kernels.ROWS, "counts": rows,
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
    parser.add_argument(
        "parts",
        nargs="*",
        type=_one_of("part", _theorems),
        metavar="PART",
        help="what to measure, of: reversal (in LAMMPS), symplectic, conserved, mrot, recursion (default: all)",
    )
    _add_silence(parser, 120.0)
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("results/theory"),
        metavar="DIR",
        help="output folder (default %(default)s)",
    )
    parser.set_defaults(function=_theory)


def _theory(arguments):
    from validation import console, machine, theory, theory_report  # heavy: not for --help

    parts = [part for part in theory.PARTS if part in (arguments.parts or theory.PARTS)]
    out, screen = arguments.out, console.console()
    out.mkdir(parents=True, exist_ok=True)
    with console.Meter(screen, sum(theory.PARTS[part][1] for part in parts), "pieces") as meter:
        checks, data, interrupted = theory.theory(parts, out, meter, arguments.silence)
    summary = machine.circumstances() | {
        "interrupted": interrupted,
        "checks": [check.plain() for check in checks],
        "data": data,
    }
    theory_report.write(summary, out)
    theory_report.show(screen, summary, out)
    return 130 if interrupted else int(not all(check.holds for check in checks))


def _add_paper(verbs):
    parser = verbs.add_parser(
        "paper",
        help="the paper's test problems again: figures 2 and 3, and what it says of them",
        description="Run the water dimer, liquid water and the peptide of Miller et al. (2002) with NO_SQUISH, the paper's reference 12, Gear's "
        "scheme and LAMMPS's own fixes, draw the paper's figures and check its statements. Writes summary.json, table.csv, claims.csv, series.csv, "
        "figures and a self-contained report.html. Ctrl-C keeps what is computed, and the same command goes on from there. "
        "Parts can run side by side; the command for all of them then takes over what is there.",
        epilog="Exit status: 0 if all trajectories but Gear's are complete, 1 if one is not, 130 after Ctrl-C. Also 0 where statements do not hold: what is "
        "judged is the paper's statements, not the code.",
    )
    parser.add_argument(
        "parts",
        nargs="*",
        metavar="PART",
        help="only the trajectory of this name, or those whose names begin so: dimer, water, peptide, force-field, "
        "water-nosquish ... (default: all)",
    )
    length = parser.add_mutually_exclusive_group()
    length.add_argument(
        "--short", action="store_true", help="some minutes in all, for a first look (the default)"
    )
    length.add_argument(
        "--full",
        action="store_true",
        help="the paper's lengths, but half of its 6,000 ps of liquid: a night",
    )
    parser.add_argument(
        "--liquid", type=_positive, metavar="PS", help="length of the liquid's trajectories"
    )
    parser.add_argument(
        "--ranks",
        type=_whole,
        default=2,
        metavar="N",
        help="MPI ranks of what is larger than the dimer (default %(default)s)",
    )
    _add_silence(parser, 300.0)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="output folder (default results/paper; --short: results/paper-short)",
    )
    parser.set_defaults(function=_paper, parser=parser)


def _paper(arguments):
    from dataclasses import asdict, replace

    from validation import console, paper, paper_claims, paper_report  # heavy: not for --help

    lengths = paper.FULL if arguments.full else paper.SHORT
    if arguments.liquid:
        lengths = replace(lengths, liquid=arguments.liquid)
    out, screen = (
        arguments.out or Path("results") / ("paper" if arguments.full else "paper-short"),
        console.console(),
    )
    plan = list(paper.plan(lengths, arguments.ranks, out / "runs"))
    names, wanted = {one.name for one in plan}, set()
    for part in arguments.parts or ("",):
        found = {part} & names or {name for name in names if name.startswith(part)}
        if not found:
            arguments.parser.error(f"no trajectory's name begins with {part}")
        wanted |= found
    chosen = [one for one in plan if one.name in wanted]
    (out / "runs").mkdir(parents=True, exist_ok=True)
    with console.Meter(screen, sum(one.steps for one in chosen)) as meter:
        found, circumstances = paper.paper(
            out / "runs", chosen, arguments.ranks, arguments.silence, meter
        )
    summary = circumstances | {"lengths": asdict(lengths)} | paper_claims.judge(found)
    paper_report.write(summary, found, out)
    paper_report.show(screen, summary, out)
    if summary["interrupted"]:
        return 130
    return int(any(one.error for one in found.values() if one.trajectory.integrator.name != "gear"))


def _add_published(verbs):
    parser = verbs.add_parser(
        "published",
        help="the energy's spread in water at 1 to 4 fs beside published numbers",
        description="Run water with a smooth cutoff at 1, 2, 3 and 4 fs and hold the standard deviation of its energy against that of Silveira and "
        "Abreu (2019). Writes a table to the terminal and summary.json, table.csv, a figure and a self-contained report.html to the output folder. Ctrl-C "
        "keeps what is computed, and the same command goes on from there.",
        epilog="Exit status: 0 if no number is outside of its bounds by its 95 % margin, 1 if one is or is missing, 130 after Ctrl-C.",
    )
    parser.add_argument(
        "--time",
        type=_positive,
        default=48.0,
        metavar="PS",
        help="length of each trajectory (default %(default)g)",
    )
    parser.add_argument(
        "--ranks",
        type=_whole,
        default=2,
        metavar="N",
        help="MPI ranks of each run (default %(default)s)",
    )
    _add_silence(parser, 120.0)
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("results/published"),
        metavar="DIR",
        help="output folder (default %(default)s)",
    )
    parser.set_defaults(function=_published)


def _published(arguments):
    from validation import check, console, machine, published  # heavy: not for --help

    out, screen = arguments.out, console.console()
    out.mkdir(parents=True, exist_ok=True)
    with console.Meter(screen, published.total(arguments.time)) as meter:
        found, interrupted = published.published(
            out / "runs", arguments.time, arguments.ranks, arguments.silence, meter
        )
    made = published.checks(found)
    summary = machine.circumstances() | {
        "interrupted": interrupted,
        "time": arguments.time,
        "checks": [one.plain() for one in made],
    }
    published.write(summary, made, out)
    check.show(screen, summary["checks"], published.TITLES)
    screen.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)
    return 130 if interrupted else int(any(one.holds is False or one.value is None for one in made))


def _add_report(verbs):
    parser = verbs.add_parser(
        "report",
        help="all results on one page, to mail",
        description="Gather what sweep, stability, bench, theory, paper, published, compare, long and scaling have left into one self-contained HTML page: "
        "what is best for which scene, what breaks where, what it costs. Results that are not in the folder are taken from those committed in validation/results.",
        epilog="Exit status: 0 if the page is written, 130 after a Ctrl-C in the runs of --short, which writes the page of what there is.",
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
        help="first run sweep --short and stability --short, where DIR has no results of these verbs: a quarter of an hour",
    )
    parser.set_defaults(function=_report)


def _report(arguments):
    from validation import console, overview_report  # heavy: not for --help

    screen, out, interrupted = (
        console.console(),
        arguments.out or arguments.results / "report.html",
        False,
    )
    for verb in overview_report.SHORT if arguments.short else ():
        if not interrupted and not overview_report.has(arguments.results, verb):
            interrupted = overview_report.run_short(verb, arguments.results / f"{verb}-short")
    out.parent.mkdir(parents=True, exist_ok=True)
    sections = overview_report.gather(arguments.results)
    overview_report.write(sections, out)
    for section in sections:
        for line in section.warnings:
            screen.print(f"{section.name}: {line}", markup=False, soft_wrap=True)
    screen.print(f"page: {out}, {out.stat().st_size / 1e6:.1f} MB", soft_wrap=True)
    return 130 if interrupted else 0


def _add_sweep(verbs):
    parser = verbs.add_parser(
        "sweep",
        help="error against run time: every integrator with every time step",
        description="Run ours, the comparison schemes and LAMMPS's rigid, shake and rattle fixes with time steps from very short to beyond what is "
        "stable, from the same equilibrated starts, and draw their errors against their run times. Writes tables to the terminal and summary.json, "
        "points.csv, fastest.csv, figures and a self-contained report.html to the output folder. Ctrl-C keeps what is measured, and the same command "
        "goes on from there: what was measured with the same code, input and settings is not measured again. Swept one after the other with the "
        "same code and budget, the output folder gathers scenes, integrators and steps; with another budget a scene is measured anew, in the old one's "
        "place.",
        epilog="A step that is too long fails; that is a result. Exit status: 0 if each integrator has a step that does not fail, 1 if one has none, "
        "130 after Ctrl-C.",
    )
    parser.add_argument(
        "scenes",
        nargs="*",
        type=_one_of("scene", _swept),
        metavar="SCENE",
        help="what to simulate (default: all; --short: the small ones)",
    )
    parser.add_argument(
        "--ranks",
        type=_whole,
        default=1,
        metavar="N",
        help="MPI ranks of what is larger than the dimer (default %(default)s)",
    )
    parser.add_argument(
        "--budget",
        type=_positive,
        metavar="MINUTES",
        help="how long all scenes may take on one core, by what a step nominally costs; of scenes that are named each has its part of "
        "it (default: five hours; --short: some minutes)",
    )
    parser.add_argument(
        "--short",
        action="store_true",
        help="fewer time steps, some minutes in all, for a first look",
    )
    parser.add_argument(
        "--only",
        nargs="+",
        choices=SWEPT,
        metavar="NAME",
        help="integrators, of: %(choices)s (default all)",
    )
    parser.add_argument(
        "--steps", type=_positives, metavar="FS,FS", help="time steps in fs (default: the scene's)"
    )
    parser.add_argument(
        "--silence",
        type=_positive,
        metavar="S",
        help="give a run up that wrote nothing for S seconds, as fixes do that hang when they blow up (default 120; --short: 30)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="output folder (default results/sweep; --short: results/sweep-short)",
    )
    parser.set_defaults(function=_sweep, parser=parser)


def _sweep(arguments):
    from validation import console, sweep, sweep_report  # heavy: not for --help

    short = arguments.short
    names = [
        name
        for name in sweep.SCENES
        if name in (arguments.scenes or (sweep.SHORT_SCENES if short else sweep.SCENES))
    ]
    try:
        lengths = sweep.lengths(names, short, arguments.budget)
        points = sweep.points(names, short, arguments.only, arguments.steps)
    except ValueError as error:
        arguments.parser.error(str(error))
    out, screen = (
        arguments.out or Path("results") / ("sweep-short" if short else "sweep"),
        console.console(),
    )
    out.mkdir(parents=True, exist_ok=True)
    with console.Meter(screen, sweep.total(points, lengths), "runs") as meter:
        summary = sweep.sweep(
            points,
            lengths,
            out,
            meter,
            arguments.ranks,
            arguments.silence or (30.0 if short else 120.0),
            short,
        )
    swept = [
        (name, point) for name, scene in summary["scenes"].items() for point in scene["points"]
    ]
    summary = sweep_report.gathered(summary, out)
    sweep_report.write(summary, out)
    sweep_report.show(screen, summary, out)
    if summary["interrupted"]:
        return 130
    good = {(name, point["integrator"]) for name, point in swept if not point["failed"]}
    return int(not swept or any((name, point["integrator"]) not in good for name, point in swept))


def _add_advise(verbs):
    parser = verbs.add_parser(
        "advise",
        help="which integrator and time step reach a wished accuracy the fastest",
        description="Print, of the points that a sweep has measured, the fastest one whose errors are all below the targets, what it costs, what is "
        "as fast, the longest good step of every integrator, and the lines for the input script.",
        epilog="Exit status: 0 if some point meets the targets with its 95 % margins, 1 if none does, 2 if there is no sweep, no such scene or "
        "measure.",
    )
    parser.add_argument(
        "scene", type=_one_of("scene", _swept), metavar="SCENE", help="a scene of the sweep"
    )
    parser.add_argument(
        "--target",
        nargs="+",
        type=_target,
        required=True,
        metavar="MEASURE=VALUE",
        help="largest errors, in the measures' units, as in energy_sd=0.5 drift=0.01; an unknown measure lists all",
    )
    parser.add_argument(
        "--from",
        type=Path,
        dest="folder",
        metavar="DIR",
        help="folder of the sweep (default results/sweep, else the one that comes with this checkout)",
    )
    parser.set_defaults(function=_advise, parser=parser)


def _advise(arguments):
    from validation import advise, console  # heavy: not for --help

    try:
        met = advise.advise(
            console.console(),
            *advise.load(arguments.folder),
            arguments.scene,
            dict(arguments.target),
        )
    except LookupError as error:
        arguments.parser.exit(2, f"{error}\n")
    return int(not met)


def _target(word):
    measure, found, value = word.partition("=")
    if not found:
        raise argparse.ArgumentTypeError(f"{word}: MEASURE=VALUE is expected")
    return measure, _positive(value)


def _positives(words):
    return tuple(_positive(word) for word in words.split(","))


def _add_stability(verbs):
    parser = verbs.add_parser(
        "stability",
        help="where integrators break: time step, heat, cold, odd bodies, contact, ranks, long runs",
        description="Run cases that some integrator does not bear with fix_nosquish's schemes and LAMMPS's own fixes, each judged by a number against "
        "a bound. Writes a matrix to the terminal and summary.json, table.csv, a figure and a self-contained report.html. Ctrl-C keeps what is there, "
        "and the same command goes on from there; cases run at other times with the same code and lengths are shown too, those of other code or lengths "
        "are kept and not shown. The same command in several processes at once shares the cases among them.",
        epilog="Exit status: 0 if ours has no blow-up that a LAMMPS fix survives, 1 if it has, 130 after Ctrl-C.",
    )
    parser.add_argument(
        "cases",
        nargs="*",
        type=_one_of("case", _cases),
        metavar="CASE",
        help="which (default: all); --list names them",
    )
    parser.add_argument(
        "--list", action="store_true", help="name all cases, with their physics, and end"
    )
    length = parser.add_mutually_exclusive_group()
    length.add_argument(
        "--short", action="store_true", help="some minutes in all, for a first look (the default)"
    )
    length.add_argument(
        "--full",
        action="store_true",
        help="one and a half to three hours of one core; start it once for each core to share the cases",
    )
    parser.add_argument(
        "--only",
        nargs="+",
        type=_one_of("integrator", _compared),
        metavar="NAME",
        help="integrators, as the table of --list names them (default: all that a case is run with)",
    )
    parser.add_argument(
        "--starts",
        type=int,
        metavar="N",
        help="at least N starts where a case has several (default: until the verdict is sure, "
        "or there are as many as the case may have)",
    )
    parser.add_argument(
        "--take",
        type=Path,
        metavar="DIR",
        help="rows of the atlas in DIR stand in for those that are not in the output folder: "
        "they are judged by the bounds of today and not run again",
    )
    _add_silence(parser, 300.0)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="output folder (default results/stability; --short: results/stability-short)",
    )
    parser.set_defaults(function=_stability)


def _stability(arguments):
    from validation import console, stability, stability_report  # heavy: not for --help
    from validation.stability_cases import CASES

    screen = console.console()
    if arguments.list:
        stability_report.list_cases(screen, CASES)
        return 0
    names, full = [name for name in CASES if name in (arguments.cases or CASES)], arguments.full
    out = arguments.out or Path("results") / ("stability" if full else "stability-short")
    out.mkdir(parents=True, exist_ok=True)
    with console.Meter(
        screen, len(stability.plan(CASES, names, full, arguments.only)), "rows"
    ) as meter:
        summary = stability.stability(CASES, names, out, full, arguments.silence, meter, arguments.only,
                                      arguments.starts, arguments.take)  # fmt: skip
    stability_report.write(summary, out)
    stability_report.show(screen, summary, out)
    if summary["interrupted"]:
        return 130
    return int(summary["summary"][0]["holds"] is False)


def _add_breaks(verbs):
    parser = verbs.add_parser(
        "breaks",
        help="what users report as broken in LAMMPS's rigid fixes, beside ours",
        description="Measure the defects of LAMMPS's rigid fixes that the README names, and the same with ours, each a number that is small where all is "
        "well. Writes a table to the terminal and summary.json, table.csv and a self-contained report.html, in some minutes of one core.",
        epilog="Exit status: 0 if ours passes all, 1 if it does not, 130 after Ctrl-C, which keeps the cases that are complete.",
    )
    parser.add_argument(
        "cases",
        nargs="*",
        type=_one_of("case", _defects),
        metavar="CASE",
        help="which (default: all)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        default=Path("results/breaks"),
        help="output folder (default %(default)s)",
    )
    parser.set_defaults(function=_breaks)


def _defects():
    from validation.breaks import CASES  # heavy: not for --help

    return CASES


def _breaks(arguments):
    import tempfile

    from validation import breaks, breaks_report, console, machine  # heavy: not for --help

    out, screen = arguments.out, console.console()
    out.mkdir(parents=True, exist_ok=True)
    names, summary = (
        [name for name in breaks.CASES if name in (arguments.cases or breaks.CASES)],
        machine.circumstances(),
    )
    with (
        console.Meter(screen, len(names) * len(breaks.FIXES), "cases") as meter,
        tempfile.TemporaryDirectory() as folder,
    ):
        rows, interrupted = breaks.breaks(names, Path(folder), meter)
    summary |= {"interrupted": interrupted, "rows": rows}
    breaks_report.write(summary, out)
    breaks_report.show(screen, summary, out)
    return (
        130
        if interrupted
        else int(
            any(row["verdict"] != "pass" for row in rows if row["integrator"] == breaks.OUR_LABEL)
        )
    )


def _add_silence(parser, default):
    parser.add_argument(
        "--silence",
        type=_positive,
        default=default,
        metavar="S",
        help="give a run up that wrote nothing for S seconds (default %(default)g)",
    )


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
