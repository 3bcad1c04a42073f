"""Read LAMMPS log text: thermo tables, timing tables, error messages."""

import re
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

_LOOP = re.compile(r"^Loop time of (\S+) on (\d+) procs for (\d+) steps with (\d+) atoms", re.M)


class Columns(dict[str, np.ndarray]):
    """Thermo output by column; the error for a missing column lists those that exist."""

    def __missing__(self, name: str) -> np.ndarray:
        raise KeyError(f"the output has no column {name}: it has {', '.join(self) or 'none'}")


def thermo(text: str) -> Columns:
    """Thermo output of all runs in a log as one table.

    Args:
        text: the log, complete or cut off anywhere.

    Returns:
        column name to array.  A step printed twice (end of one run, start of
        the next) appears once.  Empty if nothing was printed.  Where runs print different
        columns, there are all of them, with NaN in the steps that lack one.
    """
    columns: list[str] = []
    names: dict[str, None] = {}
    rows: dict[float, dict[str, float]] = {}
    inside = False
    for line in text.splitlines(keepends=True):
        words = line.split()
        if words[:1] == ["Step"]:
            columns, inside = words, True
            names |= dict.fromkeys(columns)
        elif line.startswith("Loop time"):
            inside = False
        elif inside and len(words) == len(columns) and line.endswith("\n"):
            try:
                row = [float(word) for word in words]
            except ValueError:  # a warning between the rows
                continue
            rows.setdefault(row[0], {}).update(zip(columns, row))
    return Columns(
        (name, np.array([row.get(name, np.nan) for row in rows.values()])) for name in names
    )


@dataclass(frozen=True)
class Loop:
    """LAMMPS's timing of a completed run.

    Attributes:
        seconds: of all steps.
        cpu: percent of a core that each rank had; None if not printed.
        sections: s, the average over ranks of each row of the breakdown (Pair, Kspace, Modify ...).
        late: lists of neighbours that may have been built too late, LAMMPS's dangerous builds; None
            if it has not looked.
    """

    seconds: float
    ranks: int
    steps: int
    atoms: int
    cpu: float | None
    sections: dict[str, float]
    late: int | None = None


def timings(text: str) -> list[Loop]:
    """Timing of every completed run in a log."""
    matches = list(_LOOP.finditer(text))
    ends = [match.start() for match in matches[1:]] + [len(text)]
    result = []
    for match, end in zip(matches, ends):
        block = text[match.end() : end]
        cpu, sections = re.search(r"^([\d.]+)% CPU use", block, re.M), {}
        late = re.search(r"^Dangerous builds = (\d+)", block, re.M)
        for name, cells in re.findall(r"^(\w+) +\|(.*)\n", block, re.M):
            with suppress(ValueError):  # the heading
                sections[name] = float(cells.split("|")[1])
        ranks, steps, atoms = map(int, match.groups()[1:])
        usage, builds = cpu and float(cpu.group(1)), late and int(late.group(1))
        result.append(Loop(float(match.group(1)), ranks, steps, atoms, usage, sections, builds))
    return result


# LAMMPS's defaults of the command neighbor
SKINS = {"real": 2.0, "metal": 2.0, "electron": 2.0, "si": 0.001, "cgs": 0.1, "lj": 0.3}


@dataclass(frozen=True)
class Lists:
    """How the last run has made neighbour lists.

    Attributes:
        skin, style: of the command neighbor, or LAMMPS's defaults.
        cutoff: the largest distance in a list.
        sized: whether the size of bins was given.
    """

    skin: float
    style: str
    cutoff: float
    sized: bool


def lists(text: str) -> Lists | None:
    """See `Lists`; None if there were none, or if the skin is not known."""
    cutoffs = re.findall(r"^ *master list distance cutoff = (\S+)", text, re.M)
    units = re.findall(r"^units\s+(\w+)", text, re.M)
    usual = SKINS.get(units[-1] if units else "lj")
    settings = re.findall(r"^neighbor\s+([\d.eE+-]+)\s+(\w+)", text, re.M) or (
        [(usual, "bin")] if usual else []
    )
    if not cutoffs or not settings:
        return None
    skin, style = settings[-1]
    return Lists(
        float(skin),
        style,
        float(cutoffs[-1]),
        bool(re.search(r"^neigh_modify\s.*\bbinsize\s", text, re.M)),
    )


def error(text: str) -> str | None:
    """The first error message in a log, or None."""
    match = re.search(r"^ERROR.*", text, re.M)
    return match.group(0) if match else None
