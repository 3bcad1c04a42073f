"""Command line: ``python -m validation VERB ...``."""

import argparse
import signal
import sys
from importlib import import_module
from pathlib import Path


def main(words: list[str] | None = None) -> int:
    """Parse the command line and run its verb; the exit status."""
    arguments = parser().parse_args(words)
    # SIGTERM ends the verb's children as Ctrl-C does
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    return arguments.function(arguments)


def parser() -> argparse.ArgumentParser:
    """The command line's parser: what it accepts can be run, so far as that is known before."""
    parser = argparse.ArgumentParser(
        prog="python -m validation",
        description="Compare fix_nosquish with LAMMPS's own rigid and constraint fixes.",
    )
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")
    for file in sorted(Path(__file__).parent.glob("*/command.py")):
        import_module(f"validation.{file.parent.name}.command").add(verbs)
    return parser


if __name__ == "__main__":
    sys.exit(main())
