"""LAMMPS's commands as text: words, and what they do.  No LAMMPS."""

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

# a run begins, or something that LAMMPS does step by step
RUNS = frozenset(
    (
        *("run", "minimize", "rerun", "temper", "temper/grem", "temper/npt", "neb", "neb/spin"),
        *("prd", "tad", "hyper"),
    )
)
WITHOUT_TIME = frozenset(
    ("minimize", "rerun", "neb", "neb/spin")
)  # of these, in which no time passes
OUTPUT = "thermo_style", "thermo_modify"  # the harness has output of its own
# of a thermo_modify, each with a word behind it: what is computed; others say how it is printed
THERMO_COMPUTES = "temp", "press", "lost", "lost/bond"
SUFFIX = "/nosquish"  # ends a style that has replaced LAMMPS's own, by the suffix nosquish
_WORD = re.compile(r'"""(.*?)"""|"([^"]*)"|\'([^\']*)\'|(\S+)', re.S)


def split_words(line: str) -> list[str]:
    """The words of a command, without quotes."""
    return ["".join(found.groups("")) for found in _WORD.finditer(line)]


def join_words(words: Iterable[str]) -> str:
    """The command with these words, with quotes where LAMMPS needs them."""
    return " ".join(map(_quoted, words))


def _quoted(word: str) -> str:
    if word and not re.search(r"[\s\"'#$&]", word):
        return word
    alone = (mark for mark in "\"'" if mark not in word and "\n" not in word)
    mark = next(alone, '"""')
    return f"{mark}{word}{mark}"


def with_actual_style(line: str, styles: Mapping[str, str]) -> str:
    """The command of a fix with the style that LAMMPS gave it, where it is one of fix_nosquish by
    the suffix nosquish.

    Args:
        styles: by ID, as LAMMPS tells them.
    """
    words = split_words(line)
    style = styles.get(words[1], "") if words[0] == "fix" else ""
    return join_words((*words[:3], style, *words[4:])) if style.endswith(SUFFIX) else line


def thermo_settings(commands: Iterable[str]) -> dict[str, str]:
    """The settings of `THERMO_COMPUTES`, in order; a ``thermo_style`` resets them."""
    found: dict[str, str] = {}
    for word, *rest in map(split_words, commands):
        if word == "thermo_style":
            found = {}
        elif word == "thermo_modify":
            for key, value in pairwise(rest):
                if key in THERMO_COMPUTES:
                    found.pop(key, None)  # the later one comes behind the others
                    found[key] = value
    return found


def advances_time(words: Sequence[str], step: int) -> bool:
    """Whether time passes in a command of `RUNS` that comes at this step: not in ``run 0``."""
    word, *rest = words
    if word != "run":
        return word not in WITHOUT_TIME
    return int(rest[0]) > step * ("upto" in rest)


def commands_between(line: str) -> list[str]:
    """The commands that ``run N every M`` does between the parts of a run."""
    word, *rest = split_words(line)
    at = rest.index("every") + 2 if word == "run" and "every" in rest else len(rest)
    return [] if rest[at:] == ["NULL"] else rest[at:]
