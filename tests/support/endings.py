"""Runs that end with an error: molecules and classes for them, and how they have to end."""

import os
import re
import time
from pathlib import Path

SECONDS = 60  # for a run that ends on its first steps, on a slow machine; longer is a hang

BENT = """an L of three atoms

3 atoms

Coords

1 0.0 0.0 0.0
2 0.6 0.0 0.0
3 0.0 0.4 0.0

Types

1 1
2 1
3 1
"""

LINEAR = """carbon dioxide

3 atoms

Coords

1 0 0 0
2 1.16 0 0
3 -1.16 0 0

Types

1 1
2 2
3 2
"""

# Classes that do, when LAMMPS calls them, what no input script can.
# a class that the plugin takes, and which does nothing
PLAIN = """
from fix_nosquish.structs import HOOKS

class Plain:
    line = template = restart_state = replacement_notice = array_rows = None
    restart_file = flips = needs_energy = couples = carries = box_every = array_columns = 0
    vector_extensive = False,

    def __getattr__(self, name):
        if name in HOOKS or name in ("define_bodies", "let_go"):
            return lambda *arguments: 0
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
"""

SPOIL = (
    PLAIN
    + """
from ctypes import c_double
from fix_nosquish.host.command import Line
from fix_nosquish.host.lammps import Lammps
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.run.fix import fix_of

class NoMass(Plain):
    mass = 0.0
    def __init__(self, ptr):
        lammps = Lammps(ptr)
        table = lammps.lib.lammps_extract_atom(lammps.handle, b"mass")
        (c_double * 2).from_address(table)[1] = self.mass

class NegativeMass(NoMass):
    mass = -1.0

def BreaksOnOneRank(ptr):
    made = fix_of(NVE, ptr, Line.quoted("NVE all molecule output 1 table.csv"))
    fix = getattr(made, "fix", made)  # LAMMPS's own fix has a driver of it
    def breaking(method):
        def broken(*arguments):
            method(*arguments)
            if fix.ranks.rank == fix.ranks.size - 1 and fix.lammps.step == 3:
                raise ValueError("no such luck")
        return broken
    fix.run_action, fix.final_integrate = breaking(fix.run_action), breaking(fix.final_integrate)
    return made
"""
)


def processes_in(folder):
    """Of each process whose working directory is this folder, by its number: the number of its
    parent, and its command line."""
    results = {}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if Path(os.readlink(process / "cwd")) == folder:
                parent = int((process / "stat").read_text().rsplit(")", 1)[1].split()[1])
                command = (process / "cmdline").read_text().replace("\0", " ")
                results[int(process.name)] = parent, command
        except OSError:
            pass  # ended meanwhile, or another user's
    return results


def assert_ended(run, expected, folder):
    """Assert that a run failed with one LAMMPS error that contains all of these texts, and that
    none of its processes is left in the folder."""
    errors = [line for line in run.screen.splitlines() if line.startswith("ERROR")]
    assert run.code != 0, f"the run went on:\n{run.screen}"
    assert len(errors) == 1, f"{len(errors)} messages:\n{run.screen}"
    missing = [words for words in expected if words not in errors[0]]
    assert not missing, f"no {missing} in the message:\n{errors[0]}"
    assert not re.search(r"\(fix_nosquish\S*:\d+\)", run.screen), "it names a source of the plugin"
    for _ in range(20):
        if not processes_in(folder):
            return
        time.sleep(0.1)
    raise AssertionError(f"still running: {processes_in(folder)}")
