"""Read LAMMPS log text: thermo tables, timing tables, error messages."""

import re

import numpy as np

_LOOP = re.compile(r"^Loop time of (\S+) on (\d+) procs for (\d+) steps with (\d+) atoms", re.M)
_CPU = re.compile(r"^([\d.]+)% CPU use", re.M)
_SECTION = re.compile(r"^(\w+) +\|(.*)$", re.M)


def thermo(text: str) -> dict[str, np.ndarray]:
    """Thermo output of all runs in a log as one table.

    Args:
        text: the log, complete or cut off anywhere.

    Returns:
        dict of column name to array.  A step printed twice (end of one run, start of
        the next) appears once.  Empty if nothing was printed.
    """
    columns, rows = [], {}
    inside = False
    for line in text.splitlines(keepends=True):
        words = line.split()
        if words[:1] == ["Step"]:
            columns, inside = words, True
        elif line.startswith("Loop time"):
            inside = False
        elif inside and len(words) == len(columns) and line.endswith("\n"):
            try:
                row = [float(word) for word in words]
            except ValueError:  # a warning between the rows
                continue
            rows[row[0]] = row
    table = np.array(list(rows.values())).reshape(len(rows), len(columns))
    return dict(zip(columns, table.T))


def timings(text: str) -> list[dict]:
    """Timing of every completed run in a log.

    Returns:
        list of dict: ``loop`` (s), ``ranks``, ``steps``, ``atoms``, ``cpu`` (percent of
        a core that each rank had; None if not printed) and ``sections``, the average
        over ranks in s of each row of the breakdown (Pair, Kspace, Modify ...).
    """
    matches = list(_LOOP.finditer(text))
    ends = [match.start() for match in matches[1:]] + [len(text)]
    result = []
    for match, end in zip(matches, ends):
        loop, ranks, steps, atoms = match.groups()
        block = text[match.end() : end]
        cpu = _CPU.search(block)
        sections = {}
        for name, cells in _SECTION.findall(block):
            average = cells.split("|")[1].strip()
            try:
                sections[name] = float(average)
            except ValueError:  # the heading
                continue
        result.append(
            {
                "loop": float(loop),
                "ranks": int(ranks),
                "steps": int(steps),
                "atoms": int(atoms),
                "cpu": float(cpu.group(1)) if cpu else None,
                "sections": sections,
            }
        )
    return result


def atoms_in_bodies(text: str) -> int | None:
    """Number of atoms in rigid bodies, as ours and LAMMPS's rigid fixes write it, or None."""
    match = re.search(r"^ *\d+ rigid bodies with (\d+) atoms", text, re.M)
    return int(match.group(1)) if match else None


def error(text: str) -> str | None:
    """The first error message in a log, or None."""
    match = re.search(r"^ERROR.*", text, re.M)
    return match.group(0) if match else None
