"""``claims``: its words, and what they run."""

from argparse import ArgumentTypeError, Namespace

from .. import command_line

# module of a list: its name on the command line, and of its folder
LISTS = ("theory", "paper", "published")


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "claims",
        run,
        help="does what the paper and we say hold? each statement a number between bounds",
        description="Measure what is said of the integrator, each statement a number between "
        "bounds: what section II of Miller et al. (2002) proves (theory), its test problems "
        "(paper), and the energy's spread in water beside published numbers (published). "
        "Each list has a folder of its own with summary.json, tables, figures and report.html. "
        "Ctrl-C keeps what is complete, and the same command goes on from there. Processes with "
        "the same command share the runs.",
        epilog="Exit status: 0 if all is measured and what is said of ours holds, 1 if not, 130 "
        "after Ctrl-C. Statements of the paper may fail: they are not the code's.",
    )
    parser.add_argument(
        "lists",
        nargs="*",
        type=_list,
        metavar="LIST[/PART]",
        help=f"lists, of: {', '.join(LISTS)}; with what a part's name begins with, as theory/"
        "reversal or paper/dimer, only that (default: all)",
    )
    command_line.short_or_full(parser, "as long as the committed results: some days")
    parser.add_argument(
        "--time",
        type=command_line.positive,
        metavar="PS",
        help="length of the trajectories of paper's liquid, and of published",
    )
    command_line.ranks(parser, of="the runs of paper and published")
    command_line.silence(parser, 300.0)
    command_line.out(parser, "results")
    command_line.launch(parser)


def _list(word):
    name, _, _ = word.partition("/")
    if name not in LISTS:
        raise ArgumentTypeError(f"there is no list {name}: choose from {', '.join(LISTS)}")
    return word


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    from .. import pages
    from ..pages import console
    from . import measure, plan, report  # heavy: not for --help

    command_line.need_scenes()
    wanted: dict[str, list[str]] = {}
    for word in arguments.lists or LISTS:
        name, _, part = word.partition("/")
        wanted.setdefault(name, []).append(part)
    if not {"paper", "published"} & wanted.keys():
        command_line.refuse(arguments, ("time", "ranks"), "is for paper and published")
    out, screen, failed = command_line.folder(arguments), console.console(), False
    for name, parts in wanted.items():
        short = "-short" * (not arguments.full and not arguments.out)
        how = arguments.full, arguments.time, arguments.ranks, arguments.silence
        bench, claims = plan.Bench(out / f"{name}{short}", *how, set()), report.claims_of(name)
        for part in parts:
            found = {one.name for one in claims.plan(bench) if one.name.startswith(part)}
            if not found:
                arguments.parser.error(f"nothing of {name} has a name that begins with {part}")
            bench.names |= found
        with console.Meter(screen, measure.total(claims, bench)) as bench.meter:
            summary = measure.measure(name, claims, bench)
        said = report.said(summary)
        pages.write(said, summary, bench.out)
        pages.show(screen, said, summary, bench.out)
        failed |= measure.wrong(claims, summary)
        if summary["interrupted"]:
            break
    return command_line.status(summary["interrupted"], failed)
