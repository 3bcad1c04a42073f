"""LAMMPS's own examples with a rigid fix: which they are, and the copies that are run.

A copy differs from its input by nothing but output and length: more digits and more rows are
printed, and a run of many steps ends after fewer, with its ramps (``start``, ``stop``) as long as
they were.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

DENSE = 20  # steps at the start of a run of which each is printed
ROWS = 100  # about so many rows are printed of the rest
ROW = "examples_row"  # a variable: the step of the next row
DIGITS = "thermo_modify format float %.15g"
CONTINUED = re.compile(r"&[ \t]*\n")
TABLES = "run", "minimize"  # commands that print a table
# whole numbers of four and more digits there are seeds, but where rows are averaged
SEEDED = re.compile(r"\s*(velocity|create_atoms|fix\s+\S+\s+\S+\s+(?!ave/))")
SEED = re.compile(r"(?<![\w.+-])\d{4,}(?![\w.])")


@dataclass(frozen=True)
class Example:
    """An input script, with its name below the folder of examples."""

    name: str
    path: Path

    @property
    def commands(self) -> list[str]:
        """Its lines, of which one that is continued is one."""
        return CONTINUED.sub(" ", self.path.read_text(errors="replace")).splitlines()

    @property
    def fixes(self) -> list[list[str]]:
        """The words of its rigid fixes."""
        return [words for words in map(_words, self.commands) if _rigid(words)]

    @property
    def runs(self) -> int:
        """How many tables it prints."""
        return sum(_words(line)[:1] in _TABLES for line in self.commands)

    @property
    def first(self) -> int:
        """The table of the first run with a rigid fix, counted from 0."""
        words = [_words(line) for line in self.commands]
        at = next(place for place, some in enumerate(words) if _rigid(some))
        return sum(some[:1] in _TABLES for some in words[:at])

    @property
    def files(self) -> list[Path]:
        """All files of its folder."""
        return sorted(one for one in self.path.parent.iterdir() if one.is_file())

    def copy(
        self, steps: Sequence[int], every: int, start: int = 0, seconds: float | None = None
    ) -> str:
        """What is run.

        Args:
            steps: of each run at most.
            every: steps from one row to the next, behind the first ones.
            start: another number gives other seeds; 0 those of the input.
            seconds: of each run at most; then LAMMPS ends it.
        """
        lines, left = [*_head(every)], [*steps]
        for line in self.commands:
            words = _words(line)
            if start and SEEDED.match(line):
                line = SEED.sub(lambda found: str(int(found[0]) + 1000 * start), line)
            if words[:1] in _TABLES:
                if seconds:
                    lines.append(f"timer timeout 0:{int(seconds):02} every 10")
                lines.append(_cut(words, left.pop(0)))
            else:
                lines += _output(words) or [line]
        return "\n".join(lines) + "\n"

    def beginning(self, steps: Sequence[int], every: int, finer: int, nve: bool) -> str:
        """The copy to the first steps with a rigid fix.

        Args:
            finer: steps there for one of the input.
            nve: whether rigid/nve takes the place of rigid, which moves bodies by another scheme.
        """
        lines, left = [*_head(every, finer)], [*steps][: self.first + 1]
        for line in self.commands:
            words = _words(line)
            if nve and _rigid(words) and plain(words):
                line = re.sub(r"(\srigid)(?=/small\s|\s)", r"\1/nve", line, count=1)
            if words[:1] in _TABLES and len(left) == 1:
                last = _cut(words, left[0] and DENSE, finer)
                return "\n".join([*lines, f"timestep $(dt/{finer})", last]) + "\n"
            if words[:1] in _TABLES:
                lines.append(_cut(words, left.pop(0)))
            else:
                lines += _output(words) or [line]
        raise ValueError(f"{self.name} has no run with its rigid fix")


_TABLES = [[one] for one in TABLES]


def plain(words: Sequence[str]) -> bool:
    """Whether a rigid fix is rigid or rigid/small."""
    return words[3] in ("rigid", "rigid/small")


def found(folder: Path) -> dict[str, Example]:
    """The inputs below a folder that have a rigid fix, by name."""
    paths = sorted(one for one in folder.rglob("in.*") if one.is_file())
    made = (Example(one.relative_to(folder).as_posix(), one) for one in paths)
    return {one.name: one for one in made if one.fixes}


def _words(line: str) -> list[str]:
    return line.partition("#")[0].split()


def _rigid(words) -> bool:
    return len(words) > 3 and words[0] == "fix" and words[3].split("/")[0] == "rigid"


def _head(every, finer=1):
    dense = DENSE * finer
    later = f"(floor(step/{every})+1)*{every}"
    return [
        f'variable {ROW} equal "(step<{dense})*(step+1)+(step>={dense})*{later}"',
        f"thermo v_{ROW}",
        DIGITS,
    ]


def _output(words):
    """What stands in the place of a command of output; None for any other."""
    if words[:1] == ["thermo"]:
        return [f"thermo v_{ROW}"]
    return [" ".join(words), DIGITS] if words[:1] == ["thermo_style"] else None


def _cut(words, steps, finer=1) -> str:
    """A run of at most so many steps, each of which is made of ``finer`` ones."""
    if words[0] != "run" or not words[1].isdigit():
        return " ".join(words)
    whole = int(words[1])
    count = min(whole, steps) * finer
    ramps = f"start $(step) stop $(step+{whole * finer})" if count < whole * finer else ""
    return " ".join(["run", str(count), ramps, *words[2:]])
