"""Command line: ``nosquish VERB ...``."""

import argparse
import signal
import sys
from importlib import import_module
from pathlib import Path

from . import COMMAND, NAME
from .command_line import INTERRUPTED, Parser


def main(words: list[str] | None = None) -> int:
    """Parse the command line and run its verb; the exit status."""
    arguments, unknown = parser().parse_known_args(words)
    if unknown:  # argparse itself would show how all verbs are used, not this one
        arguments.parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    # they do as Ctrl-C does, which a shell has what it starts in the background ignore; nohup has
    # it ignore the terminal's end, too
    for number in signal.SIGTERM, signal.SIGHUP:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    if hasattr(arguments, "launch"):
        from .running import machine, run  # heavy: not for --help

        machine.refuse_bundled_mpi()
        run.launch_by(arguments.launch)
    try:
        return arguments.function(arguments)
    except KeyboardInterrupt:  # between two runs, or while a script is read
        print("Interrupted.", file=sys.stderr)
        return INTERRUPTED


def process() -> None:
    """Be a process: run the command line's verb, and end with its status."""
    try:
        status = main()
    except KeyboardInterrupt:  # a second signal, while `main` told of the first
        status = INTERRUPTED
    # the status is known: a further signal, while Python ends, would end it with another one
    for number in signal.SIGINT, signal.SIGTERM, signal.SIGHUP:
        signal.signal(number, signal.SIG_IGN)
    sys.exit(status)


def parser() -> argparse.ArgumentParser:
    """The command line's parser: what it accepts can be run, so far as that is known before."""
    parser = argparse.ArgumentParser(
        prog=COMMAND,
        description="Compare fix_nosquish with LAMMPS's own rigid and constraint fixes.",
    )
    verbs = parser.add_subparsers(dest="verb", required=True, parser_class=Parser)
    for file in sorted(Path(__file__).parent.glob("*/command.py")):
        try:
            module = import_module(f".{file.parent.name}.command", NAME)
        except ModuleNotFoundError as error:  # of a package of the extra, or of ours
            raise SystemExit(
                f"{COMMAND}: {error}: pip install 'fix_nosquish[validation]' installs what it needs"
            ) from error
        if hasattr(module, "add"):
            module.add(verbs)
        else:
            print(f"{file} has no function add(verbs), so it is no verb", file=sys.stderr)
    return parser


if __name__ == "__main__":
    process()
