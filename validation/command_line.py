"""What the verbs' command lines share: types of words, options, and how a verb ends."""

import argparse
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
    """A word of the command line that is the path of a script of one's own."""


class Parser(argparse.ArgumentParser):
    """Of a verb: refuses names of integrators that its scenes do not have, see `add_only`."""

    def parse_known_args(self, *words: Any, **more: Any) -> Any:
        """As of argparse, whose types look at a word before those behind it are known."""
        found, unknown = super().parse_known_args(*words, **more)
        values = vars(found)
        given = [one for some in values.values() if isinstance(some, list) for one in some]
        script = any(isinstance(one, Script) for one in (*given, *values.values()))
        if not script and "run_number" in values:
            refuse_options(found, OF_SCRIPTS, "is for a script of your own")
        if values.get("only") and "integrators" in values and not script:
            known = found.integrators()
            for one in (one for one in found.only if known and one not in known):
                told = f"there is no integrator {one}: choose from {', '.join(known)}"
                self.error(f"argument --only: {told}")
        return found, unknown


def add_verb(
    verbs: Verbs, name: str, function: Callable[[argparse.Namespace], int], **texts: Any
) -> argparse.ArgumentParser:
    """The parser of a verb, which ``function`` of the parsed arguments runs to its exit status."""
    parser = verbs.add_parser(name, **texts)
    parser.set_defaults(function=function, parser=parser)
    return parser


OF_SCRIPTS = "variables", "fix", "group", "bodies", "run_number"  # what `add_script_options` adds
# options of other names
SPELT = {"variables": "-var", "run_number": "--run", "folder": "--from", "limits": "--from"}


def refuse_options(arguments: argparse.Namespace, names: Collection[str], why: str) -> None:
    """End with a message if an option is given; ``names`` are those of the options' values."""
    parser = arguments.parser
    for name in names:
        if getattr(arguments, name, None) not in (None, parser.get_default(name)):
            parser.error(f"{SPELT.get(name, f'--{name}')} {why}")


def exit_status(interrupted: bool, failed: bool) -> int:
    """The exit status."""
    return INTERRUPTED if interrupted else int(failed)


def in_order(names: Collection[str], wanted: Collection[str] | None) -> list[str]:
    """Those of ``names`` that are wanted, in their own order; all if none is named."""
    return [name for name in names if name in (wanted or names)]


def positive_integer(word: str) -> int:
    """A positive whole number."""
    value = int(word)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{word}: a positive whole number is expected")
    return value


def positive_number(word: str) -> float:
    """A positive number."""
    value = float(word)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{word}: a positive number is expected")
    return value


def positive_integers(words: str) -> tuple[int, ...]:
    """Positive whole numbers with commas between them."""
    return tuple(positive_integer(word) for word in words.split(","))


def positive_numbers(words: str) -> tuple[float, ...]:
    """Positive numbers with commas between them."""
    return tuple(positive_number(word) for word in words.split(","))


def add_number(
    parser: argparse.ArgumentParser, option: str, default: float, metavar: str, text: str
) -> None:
    """An option with a positive number: a whole one if the default is."""
    kind = positive_integer if isinstance(default, int) else positive_number
    parser.add_argument(
        option,
        type=kind,
        default=default,
        metavar=metavar,
        help=f"{text} (default %(default){'s' if isinstance(default, int) else 'g'})",
    )


def add_ranks(parser: argparse.ArgumentParser, default: int = 2, of: str = "each run") -> None:
    """The option --ranks."""
    add_number(parser, "--ranks", default, "N", f"MPI ranks of {of}")


def add_only(
    parser: Any, known: Callable[[], Collection[str]], text: str = "integrators, by name"
) -> None:
    """The option --only, of scenes with ``known()`` integrators, at which `Parser` looks, and of a
    script, whose integrators are not known before it is read: see `select`."""
    parser.add_argument("--only", nargs="+", metavar="NAME", help=text)
    parser.set_defaults(integrators=known)


def select(known: Mapping[str, T], wanted: Collection[str] | None) -> list[T]:
    """Those of the integrators that --only names, by name or label; all if it names none.

    Raises:
        SystemExit: one has no such name.
    """
    labels = {name: getattr(one, "label", name) for name, one in known.items()}
    names = {label: name for name, label in labels.items()} | {name: name for name in known}
    for one in wanted or ():
        if one not in names:
            told = (
                name if label == name else f'{name} ("{label}")' for name, label in labels.items()
            )
            print(f"there is no integrator {one}: choose from {', '.join(told)}", file=sys.stderr)
            raise SystemExit(2)  # as of words that the parser refuses
    some = {names[one] for one in wanted or names}
    return [one for name, one in known.items() if name in some]


def require_scenes() -> None:
    """Let nothing begin that needs built-in scenes, where there are none.

    Raises:
        SystemExit: this is no checkout.
    """
    if not INPUTS.exists():
        raise SystemExit(
            "the built-in scenes come with a checkout of the repository only: run this there, or "
            "give a LAMMPS input script to a verb that takes one"
        )


def is_script(word: str, known: Callable[[], Collection[str]]) -> bool:
    """Whether a word of the command line is a script's path, and no scene's name, of ``known()``,
    which is called only where there are scenes."""
    return not INPUTS.exists() or word not in known()


def _is_path(word: str) -> bool:
    return "." in word or "/" in word or Path(word).is_file()


def scene_or_script_type(known: Callable[[], Collection[str]]) -> Callable[[str], str]:
    """A type of argparse: the name of a scene, or the path of a LAMMPS input script.

    ``known()``, the scenes' names, is called when a word is there only.
    """

    def word(text):
        own = is_script(text, known)
        if own and not _is_path(text):
            require_scenes()
            raise argparse.ArgumentTypeError(
                f"there is no scene {text}, and no input script: choose from {', '.join(known())}"
            )
        return Script(text) if own else text

    return word


def add_script(parser: argparse.ArgumentParser) -> None:
    """The argument that is a script of one's own, of verbs that have no scenes."""

    def word(text):
        if not _is_path(text):
            raise argparse.ArgumentTypeError(f"there is no input script {text}")
        return Script(text)

    parser.add_argument("scene", type=word, metavar="SCRIPT", help="a LAMMPS input script")


def add_script_options(parser: argparse.ArgumentParser) -> None:
    """The options that say more of a script of one's own."""
    group = parser.add_argument_group("for a script of your own")
    help = "set a variable of the script, as LAMMPS's option -var does"
    group.add_argument(
        *("-var", "--var"), dest="variables", nargs="+", action="append", metavar="WORD", help=help
    )
    for option, metavar, help in (
        ("--fix", "ID", "the fix to replace, if it could be one of several"),
        ("--group", "GROUP", "the group of the rigid atoms, if no fix names it"),
        ("--bodies", "WORDS", 'what forms one body in it: molecule, or "custom i_NAME"'),
    ):
        more: dict = {"action": "append"} if option == "--fix" else {}
        group.add_argument(option, metavar=metavar, help=help, **more)
    help = "use the N-th run with rigid bodies; earlier runs are executed (default 1)"
    group.add_argument(
        "--run", type=positive_integer, default=1, metavar="N", dest="run_number", help=help
    )


def add_targets(parser: argparse.ArgumentParser, text: str, **more: Any) -> None:
    """The option --target, names with values."""

    def target(word):
        measure, found, value = word.partition("=")
        if not found:
            raise argparse.ArgumentTypeError(f"{word}: MEASURE=VALUE is expected")
        return measure, positive_number(value)

    parser.add_argument(
        "--target", nargs="+", type=target, metavar="MEASURE=VALUE", help=text, **more
    )


def add_launch(parser: argparse.ArgumentParser) -> None:
    """The option --launch."""

    def command(words):
        program, *_ = shlex.split(words) or [""]
        if "{ranks}" not in words:
            told = '{ranks} is missing, the number of ranks, as in "srun -n {ranks}"'
            raise argparse.ArgumentTypeError(f"{words}: {told}")
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
    """The option --silence."""
    add_number(
        parser, "--silence", default, "S", "end a run that has written nothing for S seconds"
    )


def add_length(parser: argparse.ArgumentParser, full: str) -> None:
    """The options --short, the default, and --full."""
    length = parser.add_mutually_exclusive_group()
    length.add_argument(
        "--short", action="store_true", help="a few minutes, for a first look (the default)"
    )
    length.add_argument("--full", action="store_true", help=full)


def add_out(parser: argparse.ArgumentParser, default: str, short: bool = False) -> None:
    """The option --out; with ``short`` another default for --short, see `output_folder`."""
    other = f"; --short: {default}-short" if short else ""
    parser.set_defaults(usual=default)
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help=f"output folder (default {default}{other})"
    )


def output_folder(arguments: argparse.Namespace, short: bool = False) -> Path:
    """The output folder, which is made."""
    return make_folder(arguments, arguments.out or Path(arguments.usual + "-short" * short))


def make_folder(arguments: argparse.Namespace, found: Path) -> Path:
    """A folder, which is made.

    Raises:
        SystemExit: it cannot be made, or written to.
    """
    try:
        found.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=found):
            pass
    except OSError as error:
        told = f"{error.strerror}: give another folder by --out"
        arguments.parser.exit(2, f"output folder {found}: {told}\n")
    return found
