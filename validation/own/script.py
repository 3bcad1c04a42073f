"""LAMMPS's input language as text: lines, words, and what a command does to files.  No LAMMPS."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

# a run begins, or something that LAMMPS does step by step
RUNS = frozenset(
    (
        *("run", "minimize", "rerun", "temper", "temper/grem", "temper/npt", "neb", "neb/spin"),
        *("prd", "tad", "hyper"),
    )
)
# of these, in which no time passes
STILL = frozenset(("minimize", "rerun", "neb", "neb/spin"))
# they only tell, or write: they are neither done nor kept
TOLD = frozenset(
    (
        *("print", "echo", "log", "info", "timer", "restart", "dump", "dump_modify", "undump"),
        *("write_data", "write_dump", "write_restart", "write_coeff", "group2ndx"),
        *("pair_write", "bond_write", "angle_write", "dihedral_write"),
    )
)
# their effect is in the state of the atoms, which runs begin with, or the harness says it anew
DONE = frozenset(
    (
        *RUNS,
        *("velocity", "displace_atoms", "shell"),
        *("thermo", "thermo_style", "thermo_modify", "timestep", "reset_timestep"),
    )
)
# of a thermo_modify, each with a word behind it: what is computed; others say how it is printed
COMPUTED = "temp", "press", "lost", "lost/bond"
# they change the atoms or the box, by where atoms are
CHANGES = frozenset(
    (
        *("set", "create_atoms", "delete_atoms", "create_bonds", "delete_bonds", "change_box"),
        *("replicate", "read_dump", "reset_atoms", "reset_atom_ids"),
    )
)
# what they do depends on where atoms are
PLACED = CHANGES | {"group", "fix", "compute"}
# fixes that remember where atoms were when they were made
REMEMBERS = "spring/self", "store/state", "move", "recenter", "tmd", "poems", "rigid"
# they write a file at once, in the place of the word of this number
WRITES = {"write_data": 1, "write_restart": 1, "write_coeff": 1, "group2ndx": 1, "write_dump": 3}
IS_FILE = re.compile(r"(?<![\w.])is_file\(([^()]+)\)")
# they only read the files that they name, so a link is enough
READS = frozenset(("read_data", "read_restart", "read_dump", "molecule", "include", "jump"))


class Word(NamedTuple):
    """A word without its quotes, and with them."""

    text: str
    quoted: str


_WORD = re.compile(
    r'"""(?P<triple>.*?)"""|"(?P<double>[^"]*)"|\'(?P<single>[^\']*)\'|(?P<plain>[^\s]+)', re.S
)


def _word(match: re.Match) -> Word:
    text = next(one for one in match.groups() if one is not None)
    return Word(text, match.group(0))


def words(line: str) -> list[Word]:
    """The words of a command."""
    return [*map(_word, _WORD.finditer(line))]


def with_words(line: str, changed: Callable[[Word], str]) -> str:
    """A command with other words; ``changed`` gives each with its quotes."""
    return _WORD.sub(lambda match: changed(_word(match)), line)


def texts(line: str) -> list[str]:
    """The words of a command, without quotes."""
    return [word.text for word in words(line)]


def computed(commands: Iterable[str]) -> dict[str, str]:
    """What the commands say of `COMPUTED`, in order; a ``thermo_style`` forgets what was before."""
    found: dict[str, str] = {}
    for word, *rest in map(texts, commands):
        if word == "thermo_style":
            found = {}
        elif word == "thermo_modify":
            for key, value in pairwise(rest):
                if key in COMPUTED:
                    found.pop(key, None)  # the later one comes behind the others
                    found[key] = value
    return found


def takes_time(line: str, step: int) -> bool:
    """Whether time passes in a command of `RUNS` that stands at this step: not in ``run 0``."""
    word, *rest = texts(line)
    if word != "run":
        return word not in STILL
    return int(rest[0]) > step * ("upto" in rest)


def remembers(line: str) -> bool:
    """Whether a command makes something that depends on where atoms are then, to the end."""
    word, *rest = texts(line)
    if word == "fix":
        return rest[2].startswith(REMEMBERS)
    if word == "group":
        return rest[1] in ("region", "variable")
    return word in CHANGES


def without_step(line: str) -> str:
    """A command ``read_dump`` that leaves the counter of steps as it is; others as they are."""
    found = words(line)
    if found[0].text != "read_dump" or any(one.text == "timestep" for one in found):
        return line
    told = [one.quoted for one in found]
    at = told.index("format") if "format" in told else len(told)  # which LAMMPS wants last
    return " ".join((*told[:at], "timestep no", *told[at:]))


def lines(text: str) -> Iterator[str]:
    """Whole commands of a file: continued lines together, without comments and empty lines."""
    kept = ""
    for line in re.split(r"\r\n|\r|\n", text):  # other ends of lines stand in Latin-1 comments
        kept += line
        bare = kept.rstrip()
        if kept.count('"""') % 2:
            kept += "\n"
            continue
        if bare.endswith("&"):
            kept = bare[:-1] + " "
            continue
        command, kept = without_comment(kept).strip(), ""
        if command:
            yield command
    if command := without_comment(kept).strip():
        yield command


def without_comment(line: str) -> str:
    """A command without what stands behind a # that is in no quotes."""
    for match in re.finditer(r'""".*?"""|"[^"]*"|\'[^\']*\'|#', line, re.S):
        if match.group(0) == "#":
            return line[: match.start()]
    return line


class Branch(NamedTuple):
    """A condition of the command ``if``, as text with quotes (None: of ``else``), and commands."""

    condition: str | None
    commands: list[str]


def branches(found: Sequence[Word]) -> list[Branch]:
    """What the words of an ``if`` say.

    Raises:
        ValueError: they are no ``if``.
    """
    if len(found) < 4 or found[2].text != "then":
        raise ValueError("if: expected a condition, 'then' and commands")
    result = [Branch(found[1].quoted, [])]
    position = 3
    while position < len(found):
        word = found[position]
        if word.quoted == "elif" and position + 1 < len(found):
            position += 1
            result.append(Branch(found[position].quoted, []))
        elif word.quoted == "else":
            result.append(Branch(None, []))
        else:
            result[-1].commands.append(word.text)
        position += 1
    return result


def written_at(line: str) -> int | None:
    """Which word of a command names the file that it writes at once; None if it writes none."""
    found = words(line)
    at = WRITES.get(found[0].text)
    if found[0].text == "write_dump" and texts(line)[2:3] in (["image"], ["movie"]):
        return None  # nothing reads a picture
    if found[0].text == "print":
        names = [i for i, one in enumerate(found) if one.quoted in ("file", "append")]
        at = names[0] + 1 if names else None
    return at if at is not None and at < len(found) else None


def appends(line: str) -> bool:
    """Whether a command of `written_at` adds to a file."""
    return line.startswith("print") and any(one.quoted == "append" for one in words(line))


def written_later(line: str) -> list[str]:
    """Names of the files that a command has LAMMPS write as it goes on, or the shell."""
    word, *rest = texts(line)
    if word == "dump":
        return rest[4:5]
    if word == "restart":  # LAMMPS puts the step behind a single name
        names = [one for one in rest[1:3] if one not in ("fileper", "nfile")]
        return names if len(names) > 1 else [one if "*" in one else f"{one}.*" for one in names]
    if word == "shell" and rest[:1] in (["cp"], ["mv"]):
        return rest[-1:]
    if word == "fix":
        return [name for key, name in pairwise(rest) if key in ("file", "append")]
    at = written_at(line)
    return [] if at is None else [texts(line)[at]]


def done_between(line: str) -> list[str]:
    """The commands that ``run N every M`` does between the parts of a run."""
    word, *rest = texts(line)
    at = rest.index("every") + 2 if word == "run" and "every" in rest else len(rest)
    return [] if rest[at:] == ["NULL"] else rest[at:]


def without_files(command: str) -> str:
    """A fix that writes no file: the words ``file NAME`` and ``append NAME`` are left out."""
    found = words(command)
    if len(found) < 4 or found[0].text != "fix":
        return command
    style = found[3].text
    if not style.startswith("ave/") and style not in ("print", "vector"):
        return command
    kept, skip = [], False
    for word in found:
        if skip:
            skip = False
        elif word.quoted in ("file", "append"):
            skip = True
        else:
            kept.append(word.quoted)
    return " ".join(kept)
