"""LAMMPS's commands as text: their words, and their effects.  Without LAMMPS."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import pairwise

# commands that begin a run, or act step by step
RUNS = frozenset(
    (
        *("run", "minimize", "rerun", "temper", "temper/grem", "temper/npt", "neb", "neb/spin"),
        *("prd", "tad", "hyper"),
    )
)
WITHOUT_TIME = frozenset(("minimize", "rerun", "neb", "neb/spin"))  # of these
OUTPUT = "thermo_style", "thermo_modify"  # the harness has its own output
# keywords of thermo_modify, each with one argument, that change what is computed
THERMO_COMPUTES = "temp", "press", "lost", "lost/bond"
SUFFIX = "/nosquish"  # end of a style that the suffix nosquish has substituted for LAMMPS's own
RIGID_COMPUTES = "ke/rigid", "erotate/rigid", "rigid/local"  # they read a rigid fix
REPORTING_FIXES = "ave/", "print", "vector"  # beginnings of styles that change no atom
_WORD = re.compile(r'"""(.*?)"""|"([^"]*)"|\'([^\']*)\'|(\S+)', re.S)


def split_words(line: str) -> list[str]:
    """The words of a command, without quotes."""
    return ["".join(match.groups("")) for match in _WORD.finditer(line)]


def join_words(words: Iterable[str]) -> str:
    """The command with these words, quoted where LAMMPS needs it."""
    return " ".join(map(_quoted, words))


def _quoted(word: str) -> str:
    if word and not re.search(r"[\s\"'#$&]", word):
        return word
    usable = (mark for mark in "\"'" if mark not in word and "\n" not in word)
    mark = next(usable, '"""')
    return f"{mark}{word}{mark}"


def with_actual_style(line: str, styles: Mapping[str, str]) -> str:
    """The command with the style that the suffix nosquish has given its fix.

    Args:
        styles: of all fixes by ID, as LAMMPS reports them.
    """
    words = split_words(line)
    style = styles.get(words[1], "") if words[0] == "fix" else ""
    return join_words((*words[:3], style, *words[4:])) if style.endswith(SUFFIX) else line


def thermo_settings(commands: Iterable[str]) -> dict[str, str]:
    """The settings of `THERMO_COMPUTES`, in order; a ``thermo_style`` resets them."""
    settings: dict[str, str] = {}
    for word, *rest in map(split_words, commands):
        if word == "thermo_style":
            settings = {}
        elif word == "thermo_modify":
            for key, value in pairwise(rest):
                if key in THERMO_COMPUTES:
                    settings.pop(key, None)  # the order is that of the last settings
                    settings[key] = value
    return settings


def advances_time(words: Sequence[str], step: int) -> bool:
    """Whether a command of `RUNS` at this step advances the time: ``run 0`` does not."""
    word, *rest = words
    if word != "run":
        return word not in WITHOUT_TIME
    return int(rest[0]) > step * ("upto" in rest)


def commands_between(line: str) -> list[str]:
    """The commands that ``run N every M`` executes between the parts of the run."""
    word, *rest = split_words(line)
    first = rest.index("every") + 2 if word == "run" and "every" in rest else len(rest)
    return [] if rest[first:] == ["NULL"] else rest[first:]


def rigid_reports(commands: Iterable[str], ids: Collection[str]) -> list[str]:
    """The computes of rigid bodies that read fixes with these IDs, and the commands that use them
    for output: computes, variables, and fixes that average or print.

    Empty if a command that acts on atoms uses one of them, because it cannot be removed.
    """
    lines = [line for line in commands if split_words(line)[0] not in OUTPUT]
    reports: dict[str, str] = {}  # how others refer to them by command: c_ID, v_NAME, f_ID
    while True:  # a variable may come before what it reads
        more = {line: name for line in lines if line not in reports
                and (name := _reads_rigid(line, ids, reports.values())) is not None}  # fmt: skip
        if "" in more.values():
            return []
        if not more:
            return [line for line in lines if line in reports]
        reports |= more


def _reads_rigid(line: str, ids: Collection[str], names: Collection[str]) -> str | None:
    """How other commands refer to what this one defines, if it reads rigid fixes with these IDs or
    anything with these names; empty if it does more than report; None if it reads none of them."""
    words = split_words(line)
    kind = words[0].removesuffix("_modify")
    style = words[3] if len(words) > 3 else ""
    direct = kind == "compute" and style.startswith(RIGID_COMPUTES) and {*ids} & {*words[4:]}
    modifies = kind != words[0] and f"{kind[0]}_{words[1]}" in names
    if not direct and not modifies and not {*names} & {*re.findall(r"\b[cvf]_\w+", line)}:
        return None
    acts = kind == "fix" and not modifies and not style.startswith(REPORTING_FIXES)
    return "" if acts or kind not in ("compute", "variable", "fix") else f"{kind[0]}_{words[1]}"
