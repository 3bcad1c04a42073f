"""The verb ``claims``: its command line, and what it runs."""

from argparse import ArgumentTypeError, Namespace

from .. import command_line

# module of a list: its name on the command line and of its folder
LISTS = ("theory", "paper", "published")


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.add_verb(
        verbs,
        "claims",
        run,
        help="test statements of the paper and of this package, each by a number",
        description="Test statements about the integrator, each by a number that must be within "
        "bounds: what section II of Miller et al. (2002) proves (theory), its test problems "
        "(paper), and the fluctuations of the energy in water beside published numbers (published)."
        " Each list writes a folder with summary.json, tables and report.html. After "
        "Ctrl-C the same command continues. Several processes with the same command share the "
        "runs.",
        epilog="Exit status: 0 if all statements about this package hold, 1 if not, 130 after "
        "Ctrl-C. Statements of the paper may fail, because they are not about this code.",
    )
    parser.add_argument(
        "lists",
        nargs="*",
        type=_list,
        metavar="LIST[/PART]",
        help=f"any of {', '.join(LISTS)}, or a part of one by the beginning of its name, such as "
        "theory/reversal or paper/dimer (default: all)",
    )
    command_line.add_length(parser, "as long as the committed results: some days")
    parser.add_argument(
        "--time",
        type=command_line.positive_number,
        metavar="PS",
        help="length of the trajectories of published, and of the liquid in paper",
    )
    command_line.add_ranks(parser, of="the runs of paper and published")
    command_line.add_silence(parser, 300.0)
    command_line.add_out(parser, "results")
    command_line.add_launch(parser)


def _list(word):
    name, _, _ = word.partition("/")
    if name not in LISTS:
        raise ArgumentTypeError(f"there is no list {name}: choose from {', '.join(LISTS)}")
    return word


def run(arguments: Namespace) -> int:
    """Run the verb; return the exit status."""
    from .. import pages
    from ..pages import console
    from . import measure, plan, report  # heavy: not for --help

    command_line.require_scenes()
    wanted: dict[str, list[str]] = {}
    for word in arguments.lists or LISTS:
        name, _, part = word.partition("/")
        wanted.setdefault(name, []).append(part)
    if not {"paper", "published"} & wanted.keys():
        command_line.refuse_options(arguments, ("time", "ranks"), "is for paper and published")
    out, screen, failed = command_line.output_folder(arguments), console.console(), False
    for name, parts in wanted.items():
        short = "-short" * (not arguments.full and not arguments.out)
        how = arguments.full, arguments.time, arguments.ranks, arguments.silence
        bench, claims = plan.Bench(out / f"{name}{short}", *how, set()), report.claims_of(name)
        for part in parts:
            names = {
                simulation.name
                for simulation in claims.plan(bench)
                if simulation.name.startswith(part)
            }
            if not names:
                arguments.parser.error(f"nothing of {name} has a name that begins with {part}")
            bench.names |= names
        with console.Meter(screen, measure.total(claims, bench)) as bench.meter:
            summary = measure.measure(name, claims, bench)
        pages.publish(screen, report.describe(summary), summary, bench.out)
        failed |= measure.wrong(claims, summary)
        if summary["interrupted"]:
            break
    return command_line.exit_status(summary["interrupted"], failed)
