"""The command lines of the verbs: types of arguments, shared options, exit status."""

import argparse
import math
import shlex
import shutil
import sys
import tempfile
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from . import INPUTS

INTERRUPTED = 130  # exit status after Ctrl-C
Verbs: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"  # it has no public name
T = TypeVar("T")


class Script(str):
    """An argument that is the path of a user's script."""


class Parser(argparse.ArgumentParser):
    """The parser of a verb; refuses unknown names of integrators, see `add_only`."""

    def parse_known_args(self, *words: Any, **more: Any) -> Any:
        """Parse, then check what depends on several arguments: argparse's types see one only."""
        arguments, unknown = super().parse_known_args(*words, **more)
        values = vars(arguments)
        items = [item for value in values.values() if isinstance(value, list) for item in value]
        script = any(isinstance(item, Script) for item in (*items, *values.values()))
        if not script and "run_number" in values:
            refuse_options(arguments, OF_SCRIPTS, "is for a script of your own")
        if values.get("only") and "integrators" in values and not script:
            known = arguments.integrators()
            for name in (name for name in arguments.only if known and name not in known):
                self.error(
                    f"argument --only: there is no integrator {name}: choose from "
                    f"{', '.join(known)}"
                )
        return arguments, unknown


def add_verb(
    verbs: Verbs, name: str, function: Callable[[argparse.Namespace], int], **texts: Any
) -> argparse.ArgumentParser:
    """Add a verb; ``function`` runs it with the parsed arguments and returns the exit status."""
    parser = verbs.add_parser(name, **texts)
    parser.set_defaults(function=function, parser=parser)
    return parser


OF_SCRIPTS = "variables", "fix", "group", "bodies", "run_number"  # what `add_script_options` adds
# options that are not called as their values
OPTION_NAMES = {"variables": "-var", "run_number": "--run", "folder": "--from", "earlier": "--from"}


def refuse_options(arguments: argparse.Namespace, names: Collection[str], why: str) -> None:
    """Exit with a message if an option is given; ``names``: of the attributes of its values."""
    parser = arguments.parser
    for name in names:
        if getattr(arguments, name, None) not in (None, parser.get_default(name)):
            parser.error(f"{OPTION_NAMES.get(name, f'--{name}')} {why}")


def exit_status(interrupted: bool, failed: bool) -> int:
    """The exit status."""
    return INTERRUPTED if interrupted else int(failed)


def in_order(names: Collection[str], wanted: Collection[str] | None) -> list[str]:
    """The wanted ones of ``names``, in the order of these; all if none is named."""
    return [name for name in names if name in (wanted or names)]


def positive_integer(word: str) -> int:
    """A type of argparse: a positive integer."""
    value = int(word)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{word}: a positive whole number is expected")
    return value


def positive_number(word: str) -> float:
    """A type of argparse: a positive number."""
    value = float(word)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{word}: a positive number is expected")
    return value


def positive_integers(words: str) -> tuple[int, ...]:
    """A type of argparse: positive integers, separated by commas."""
    return tuple(positive_integer(word) for word in words.split(","))


def positive_numbers(words: str) -> tuple[float, ...]:
    """A type of argparse: positive numbers, separated by commas."""
    return tuple(positive_number(word) for word in words.split(","))


def add_number(
    parser: argparse.ArgumentParser, option: str, default: float, metavar: str, text: str
) -> None:
    """Add an option with a positive number; an integer if the default is one."""
    parser.add_argument(
        option,
        type=positive_integer if isinstance(default, int) else positive_number,
        default=default,
        metavar=metavar,
        help=f"{text} (default %(default){'s' if isinstance(default, int) else 'g'})",
    )


def add_ranks(parser: argparse.ArgumentParser, default: int = 2, of: str = "each run") -> None:
    """Add the option --ranks."""
    add_number(parser, "--ranks", default, "N", f"MPI ranks of {of}")


def add_only(
    parser: Any, known: Callable[[], Collection[str]], text: str = "integrators, by name"
) -> None:
    """Add the option --only.

    Args:
        known: returns the names of the scenes' integrators, for `Parser`.  Those of a script are
            not known before it is read: see `select`.
    """
    parser.add_argument("--only", nargs="+", metavar="NAME", help=text)
    parser.set_defaults(integrators=known)


def select(known: Mapping[str, T], wanted: Collection[str] | None) -> list[T]:
    """The integrators that --only names, by name or label; all if it names none.

    Raises:
        SystemExit: there is no such integrator.
    """
    labels = {name: getattr(item, "label", name) for name, item in known.items()}
    names = {label: name for name, label in labels.items()} | {name: name for name in known}
    for word in wanted or ():
        if word not in names:
            choices = ", ".join(
                name if label == name else f'{name} ("{label}")' for name, label in labels.items()
            )
            print(f"there is no integrator {word}: choose from {choices}", file=sys.stderr)
            raise SystemExit(2)  # like the parser
    return [known[name] for name in in_order(known, [names[word] for word in wanted or names])]


def require_scenes() -> None:
    """Exit if there are no built-in scenes.

    Raises:
        SystemExit: this is no checkout.
    """
    if not INPUTS.exists():
        raise SystemExit(
            "the built-in scenes come with a checkout of the repository only: run this there, or "
            "give a LAMMPS input script to a verb that takes one"
        )


def is_script(word: str, known: Callable[[], Collection[str]]) -> bool:
    """Whether an argument is the path of a script, not the name of a scene.

    Args:
        known: returns the scenes' names; called only in a checkout.
    """
    return not INPUTS.exists() or word not in known()


def _is_path(word: str) -> bool:
    return "." in word or "/" in word or Path(word).is_file()


def scene_or_script_type(known: Callable[[], Collection[str]]) -> Callable[[str], str]:
    """A type of argparse: the name of a scene, or the path of a LAMMPS input script.

    Args:
        known: returns the scenes' names; called only if there is an argument.
    """

    def scene_or_script(word):
        if not is_script(word, known):
            return word
        if not _is_path(word):
            require_scenes()
            raise argparse.ArgumentTypeError(
                f"there is no scene {word}, and no input script: choose from {', '.join(known())}"
            )
        return Script(word)

    return scene_or_script


def add_script(parser: argparse.ArgumentParser) -> None:
    """Add the argument of verbs that take a script only."""

    def path(word):
        if not _is_path(word):
            raise argparse.ArgumentTypeError(f"there is no input script {word}")
        return Script(word)

    parser.add_argument("scene", type=path, metavar="SCRIPT", help="a LAMMPS input script")


def add_script_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that select what is rigid in a user's script."""
    group = parser.add_argument_group("for a script of your own")
    group.add_argument(
        *("-var", "--var"),
        dest="variables",
        nargs="+",
        action="append",
        metavar="WORD",
        help="set a variable of the script, as LAMMPS's option -var does",
    )
    for option, metavar, help in (
        ("--fix", "ID", "the fix to replace, if several could be meant"),
        ("--group", "GROUP", "the group of the rigid atoms, if no fix defines it"),
        ("--bodies", "WORDS", 'what forms one body in it: molecule, or "custom i_NAME"'),
    ):
        more: dict = {"action": "append"} if option == "--fix" else {}
        group.add_argument(option, metavar=metavar, help=help, **more)
    group.add_argument(
        "--run",
        type=positive_integer,
        default=1,
        metavar="N",
        dest="run_number",
        help="use the N-th run with rigid bodies; earlier runs are executed (default 1)",
    )


def add_targets(parser: argparse.ArgumentParser, text: str, **more: Any) -> None:
    """Add the option --target: names with values."""

    def target(word):
        measure, equals, value = word.partition("=")
        if not equals:
            raise argparse.ArgumentTypeError(f"{word}: MEASURE=VALUE is expected")
        return measure, math.inf if value == "none" else positive_number(value)

    parser.add_argument(
        "--target", nargs="+", type=target, metavar="MEASURE=VALUE", help=text, **more
    )


def add_launch(parser: argparse.ArgumentParser) -> None:
    """Add the option --launch."""

    def command(words):
        program, *_ = shlex.split(words) or [""]
        if "{ranks}" not in words:
            raise argparse.ArgumentTypeError(
                f'{words}: {{ranks}} is missing, the number of ranks, as in "srun -n {{ranks}}"'
            )
        if not shutil.which(program):
            raise argparse.ArgumentTypeError(f"{words}: there is no program {program}")
        return words

    parser.add_argument(
        "--launch",
        type=command,
        metavar="COMMAND",
        help='command that starts the ranks of a run, such as "srun -n {ranks}" (default: mpirun)',
    )


def add_silence(parser: argparse.ArgumentParser, default: float) -> None:
    """Add the option --silence."""
    add_number(
        parser, "--silence", default, "S", "end a run that has written nothing for S seconds"
    )


def add_length(parser: argparse.ArgumentParser, full: str) -> None:
    """Add the options --short, the default, and --full."""
    length = parser.add_mutually_exclusive_group()
    length.add_argument(
        "--short", action="store_true", help="a few minutes, for a first look (the default)"
    )
    length.add_argument("--full", action="store_true", help=full)


def add_out(parser: argparse.ArgumentParser, default: str, short: bool = False) -> None:
    """Add the option --out; ``short``: whether --short has another default."""
    other = f"; --short: {default}-short" if short else ""
    parser.set_defaults(usual=default)
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help=f"output folder (default {default}{other})"
    )


def output_folder(arguments: argparse.Namespace, short: bool = False) -> Path:
    """The output folder, which is created."""
    return make_folder(arguments, arguments.out or Path(arguments.usual + "-short" * short))


def make_folder(arguments: argparse.Namespace, path: Path) -> Path:
    """A folder, which is created.

    Raises:
        SystemExit: it cannot be created, or written to.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        arguments.parser.exit(
            2, f"output folder {path}: {error.strerror}: give another folder by --out\n"
        )
    return path
