"""The verb ``check``: its command line, and what it runs."""

from argparse import Namespace

from .. import command_line

PARTS = "water", "CH3", "NH3", "rings", "XH"


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.add_verb(
        verbs,
        "check",
        run,
        help="look at your script before a long run, and find parts that can be rigid",
        description="Look at a LAMMPS input script before a long run. It reports the bodies, "
        "their shapes and moments; whether the time step is short enough for the fastest rotation "
        "and the stiffest force; whether groups, exclusions and fixes match; and whether each "
        "integrator can run the start. With --rigid it finds parts of molecules that can be rigid, "
        "by bonds and masses, and writes the lines that make them so. In a script with a rigid fix "
        "it gives the bodies of a kind one shape. Your files are not changed.",
        epilog="Exit status: 0 if all numbers are known and within their bounds and an integrator "
        "can run the start (with --rigid: if parts were found), 1 if not, 130 after Ctrl-C.",
    )
    command_line.add_script(parser)
    parser.add_argument(
        "--rigid",
        nargs="*",
        choices=PARTS,
        metavar="PART",
        help="find parts that can be rigid, of: %(choices)s (default all but XH, which is any "
        "heavy atom with its hydrogens, for steps of about 4 fs)",
    )
    command_line.add_number(
        parser,
        "--tolerance",
        0.01,
        "X",
        "largest relative error of temperatures that is good enough",
    )
    command_line.add_ranks(parser, 1)
    command_line.add_silence(parser, 60.0)
    command_line.add_out(parser, "results/check-SCRIPT")
    command_line.add_script_options(parser)
    command_line.add_launch(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; return the exit status."""
    from .. import pages
    from ..pages import console
    from ..running import store
    from ..user_script import loader
    from . import measure, report, rigid  # heavy: not for --help

    options, out = loader.parse_options(arguments, arguments.scene)
    with store.alone(out):
        if arguments.rigid is not None:
            counts, lines = rigid.write_bodies(
                options, out, arguments.silence, arguments.rigid or PARTS[:-1]
            )
            print("Found: " + ", ".join(f"{number:,} × {name}" for name, number in counts.items()))
            print("\n".join(lines))
            return int(not any(counts.values()))
        script = loader.load(options, out, arguments.ranks, arguments.silence, lambda note: None)
        screen = console.console()
        with console.Meter(screen, len(script.integrators) * measure.STEPS) as meter:
            summary = measure.check(
                script, out, arguments.ranks, arguments.silence, meter, arguments.tolerance
            )
    pages.publish(screen, report.describe(summary), summary, out)
    return command_line.exit_status(summary["interrupted"], not report.is_sound(summary))
