"""``long``: its words, and what they run."""

from validation import command_line

INTEGRATORS = ["nosquish", "rigid/nve", "rigid"]


def add(verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "long",
        run,
        help="a free body for 10^7 steps: energy, momenta, shape",
        description="Run one body without forces for very many steps with fix_nosquish.NVE, "
        "rigid/nve and rigid, at a short and at a practical time step, and draw what becomes of "
        "energy, momenta and shape. A run that is complete in the output folder is not done again.",
    )
    command_line.number(parser, "--steps", 10_000_000, "N", "of each run")
    command_line.only(parser, INTEGRATORS, default=INTEGRATORS)
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/long-run")


def run(arguments) -> int:
    """Run the verb; the exit status."""
    from validation.long import measure, report  # heavy: not for --help
    from validation.pages import console

    screen = console.console()
    out = command_line.folder(arguments.out, "results/long-run")
    with console.Meter(screen, 2 * len(arguments.only) * arguments.steps) as meter:
        rows, series = measure.long_run(
            out, arguments.steps, arguments.only, meter, arguments.silence
        )
    figure = report.write(rows, series, out)
    report.show(screen, rows)
    screen.print(f"figure: {figure}")
    errors = [row["error"] for row in rows]
    return command_line.status("interrupted" in errors, any(errors))
