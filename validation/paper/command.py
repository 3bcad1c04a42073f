"""``paper``: its words, and what they run."""

from argparse import Namespace
from dataclasses import asdict, replace

from .. import command_line


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "paper",
        run,
        help="the paper's test problems again: figures 2 and 3, and what it says of them",
        description="Run the water dimer, liquid water and the peptide of Miller et al. (2002) "
        "with NO_SQUISH, the paper's reference 12, Gear's scheme and LAMMPS's own fixes, draw the "
        "paper's figures and check its statements. Writes summary.json, table.csv, claims.csv, "
        "series.csv, figures and a self-contained report.html. Ctrl-C keeps what is computed, and "
        "the same command goes on from there. Parts can run side by side; the command for all of "
        "them then takes over what is there.",
        epilog="Exit status: 0 if all trajectories but Gear's are complete, 1 if one is not, 130 "
        "after Ctrl-C. Also 0 where statements do not hold: what is judged is the paper's "
        "statements, not the code.",
    )
    parser.add_argument(
        "parts",
        nargs="*",
        metavar="PART",
        help="only the trajectory of this name, or those whose names begin so: dimer, water, "
        "peptide, force-field, water-nosquish ... (default: all)",
    )
    command_line.short_or_full(
        parser, "the paper's lengths, but half of its 6,000 ps of liquid: a night"
    )
    parser.add_argument(
        "--liquid",
        type=command_line.positive,
        metavar="PS",
        help="length of the liquid's trajectories",
    )
    command_line.ranks(parser, of="what is larger than the dimer")
    command_line.silence(parser, 300.0)
    command_line.out(parser, "results/paper", short=True)
    command_line.launch(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    command_line.need_scenes()
    from ..pages import console
    from . import measure, plan, report  # heavy: not for --help

    lengths = plan.FULL if arguments.full else plan.SHORT
    if arguments.liquid:
        lengths = replace(lengths, liquid=arguments.liquid)
    out = command_line.folder(arguments, not arguments.full)
    screen, runs = console.console(), out / "runs"
    all_of_them = {one.name: one for one in plan.plan(lengths, arguments.ranks, runs)}
    wanted: set[str] = set()
    for part in arguments.parts or ("",):
        found = {part} & all_of_them.keys() or {one for one in all_of_them if one.startswith(part)}
        if not found:
            arguments.parser.error(f"no trajectory's name begins with {part}")
        wanted |= found
    chosen = [one for name, one in all_of_them.items() if name in wanted]
    runs.mkdir(parents=True, exist_ok=True)
    how = arguments.ranks, arguments.silence
    with console.Meter(screen, sum(one.steps for one in chosen)) as meter:
        series, circumstances = plan.paper(runs, chosen, *how, meter)
    summary = circumstances | {"lengths": asdict(lengths)} | measure.judge(series)
    report.write(summary, series, out)
    report.show(screen, summary, out)
    failed = (one for one in series.values() if one.error)
    judged = any(one.trajectory.integrator.name != "gear" for one in failed)
    return command_line.status(summary["interrupted"], judged)
