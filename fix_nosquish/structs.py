"""What the C++ of the plugin and Python share: structures, flags and constants.

This file is their only definition.  `setup.py` compiles the plugin with the header that `header`
returns.
"""

import ctypes
import zlib
from collections.abc import Mapping
from enum import IntEnum, IntFlag, auto
from typing import Any, NamedTuple


class Text(ctypes.c_char_p):
    """A text as an argument of a function: str in Python."""

    @classmethod
    def from_param(cls, text: str) -> Any:
        return super().from_param(text.encode())


class Type(NamedTuple):
    """A type in C++, with {} in place of the name that is declared, and in ctypes.

    Attributes:
        argument: in ctypes, as an argument of a function; None if it is the same.
    """

    cpp: str
    python: Any
    argument: Any = None


INT = Type("int32_t {}", ctypes.c_int32)
LONG = Type("int64_t {}", ctypes.c_int64)
DOUBLE = Type("double {}", ctypes.c_double)
TEXT = Type("const char *{}", ctypes.c_char_p)
WORD = Type("const char *{}", ctypes.c_char_p, Text)
PLACE = Type("void *{}", ctypes.c_void_p)
# addresses of numbers, which Python sees as integers
INTS = Type("int32_t *{}", ctypes.c_void_p)
LONGS = Type("int64_t *{}", ctypes.c_void_p, ctypes.POINTER(ctypes.c_int64))
DOUBLES = Type("double *{}", ctypes.c_void_p, ctypes.POINTER(ctypes.c_double))
NUMBERS = Type("double *{}", ctypes.c_void_p)
NOTHING = Type("void {}", None)


def address_of(struct: str) -> Type:
    """The address of a structure."""
    return Type(f"{struct} *{{}}", ctypes.c_void_p)


def function(result: Type, *arguments: Type) -> Type:
    """A pointer to a function."""
    declared = ", ".join(kind.cpp.format("").strip() for kind in arguments)
    kinds = [kind.argument or kind.python for kind in arguments]
    return Type(result.cpp.format(f"(*{{}})({declared})"), ctypes.CFUNCTYPE(result.python, *kinds))


def of_fix(result: Type, *arguments: Type) -> Type:
    """A pointer to a function of the fix, whose first argument is `Bridge.fix`."""
    return function(result, PLACE, *arguments)


def each(kind: Any, names: str) -> dict[str, Any]:
    """Fields of one type; their names are separated by spaces."""
    return dict.fromkeys(names.split(), kind)


class Outcome(IntEnum):
    """What a hook returns."""

    BROKEN = 0  # left by a callback that was interrupted
    DONE = 1
    FAILED_ALIKE = 2  # on all ranks
    FAILED_HERE = 3  # perhaps on this rank only


class When(IntFlag):
    """What holds in a step: conditions for actions of `run.schedule`."""

    # in one step; the host finds these
    CALLED = auto()  # Python begins it
    SHOWN = auto()  # something may read velocities at its end
    VIRIAL_ASKED = auto()  # LAMMPS needs its virial
    TABLE = auto()  # Python writes a table at its end
    ENERGY = auto()  # Python takes the potential energy at its end
    MOVES_BOX = auto()  # the box changes in it
    PRESSURE = auto()  # its forces are those before or after a change of the box
    OTHER_BOX = auto()  # the box is not the one that the passes know
    # in a whole run, or until an action changes it; the host keeps these
    LATE = auto()  # other fixes may change velocities at the end of a step
    SEEN = auto()  # the atoms' velocities are those of the bodies at the end of the last step
    MID_STEP = auto()  # the atoms' velocities at the end of a step are those of its middle
    LEVELS = auto()  # run_style respa
    WATCHED = auto()  # another fix may change the box, and bodies do not move with it
    LOOKS = auto()  # Python has something to do where atoms are followed
    RESETS = auto()  # the next step has another length
    GATHERS = auto()  # forces on bodies are summed once more when the next step begins


class OtherFix(NamedTuple):
    """Another fix of the simulation; in C++ the struct FixDescription."""

    id: str
    style: str
    groupbit: int
    time_integrate: bool  # it moves the atoms of its group
    between: bool  # it is called between initial_integrate and final_integrate
    end_of_step: bool  # it is called at the end of every nevery-th step
    nevery: int
    integrates: bool  # it is called in initial_integrate or final_integrate
    box_change: bool  # it changes the box
    called: bool  # it is called in steps
    constrains: bool  # it removes degrees of freedom, and does not integrate
    has_energy: bool  # it knows the energy of its forces
    energy_in_pe: bool  # fix_modify energy adds it to the potential energy
    post_force: bool  # it may change forces
    has_virial: bool  # it knows the virial of its forces
    virial_in_press: bool  # fix_modify virial adds it to the pressure
    moves: bool  # it may change positions before the forces of a step, and does not integrate
    varies: bool  # it may depend on variables

    def has(self, groups: Any) -> Any:
        """Whether atoms are in its group, (n,) bool, from the bits of their groups, (n,) uint32."""
        return groups & (self.groupbit & 0xFFFFFFFF) != 0


IN_NO_BODY = -1  # the origin of an atom, see exchange.h
UNDECIDED = -(2**62)  # in place of the ID of an atom's body: the atom is newer than the membership
OUT = -(2**61)  # the same, if the atom is in no body; the ID of a body is larger
CONSTANTS = {"IN_NO_BODY": IN_NO_BODY, "UNDECIDED": UNDECIDED}

# cells for LAMMPS's arrays, by the kinds and names that they have in loops
CELLS = {
    **each("F2", "atom_x atom_v atom_f atom_torque atom_omega atom_angmom atom_mu atom_virial"),
    **each("F2", "clusters counted_f arrived"),  # see clusters.h, pressure.h, exchange.h
    **each("F1", "atom_mass type_mass virial"),
    **each("I1", "groups type"),
    **each("L1", "origins membership"),
}

# A loop that is bound to cells; it returns 0 if all is well. A list of passes ends with no loop.
PASS = {"loop": function(LONG, LONGS), "cells": LONGS}

# An action of the schedule, see `run.schedule.Action`. A list of actions ends with phases 0.
ACTION = {
    "phases": LONG,  # a bit for each phase of the bodies in which it applies
    "when": LONG,  # bits of When that must be set
    "unless": LONG,  # bits of When that must not be set
    "passes": address_of("Pass"),  # null if Python does it, or there is nothing to do
    "number": LONG,  # by which Python knows it; -1 if it has nothing to do
    "then": LONG,  # the next phase, -1 if it does not change
    "sets": LONG,  # bits of When that it sets
    "clears": LONG,  # bits of When that it clears
}

DATA = {
    # how Python has made the instance, an Outcome; if it failed, and if a hook fails:
    "outcome": INT,
    "message": Type("char {}[4096]", ctypes.c_char * 4096),
    "argument": INT,  # of LAMMPS's fix command, that is wrong; -1 for none
    # set by Python: what the instance declares, see `_announce` in plugin/bridge.py
    "flips": INT,  # it may choose other box vectors of the same lattice
    "needs_energy": INT,  # it needs the potential energy
    "couples": INT,  # it exchanges energy with a reservoir
    "restart_file": INT,  # it writes a file beside restart files
    "carries": INT,  # how many numbers go with an atom to another rank
    "box_every": INT,  # it changes the box after steps that are multiples of this; 0: never
    "restart_size": INT,  # how many numbers it has in restart files
    "restart_state": DOUBLES,
    "kept_bodies": DOUBLES,  # in restart files, (kept_rows, 3): see bodies/membership.py
    "kept_rows": INT,
    "template_id": TEXT,  # of the molecules that other fixes insert; null for none
    "vector_size": INT,  # of f_ID
    "vector_extensive": INTS,
    "array_columns": INT,  # of f_ID
    "array_rows": INT,  # -1 if they are not known in the constructor
    # set by Python: its bodies; an address that it lends ends in `_release` of plugin/bridge.py
    "body": INTS,  # of each local atom, -1 for none; null while unknown
    "masstotal": DOUBLES,  # of each body
    **each(LONGS, "body_of displace state"),  # cells of the bodies; null if there are none
    "array": DOUBLES,  # the global array; null after a hook or a pass
    "min_dof": INT,  # how many coordinates of bodies a minimization has
    "rotor": INT,  # 1 or 0: the rotation is exact or not, whatever the bodies; -1: they decide
    "changes": LONG,  # how many times passes have changed the bodies
    # the fix
    **each(PLACE, "fix lammps"),
    **each(TEXT, "fix_id group"),
    "line": TEXT,  # the fix line from the style on, a word a line
    "virial": DOUBLES,
    "vflag": INT,  # the virial that LAMMPS needs in this step
    **each(LONGS, "next_output begin_step end_step"),  # addresses of LAMMPS's numbers of steps
    "last_step": LONGS,  # of the run, whatever its keywords start and stop
    "world": INT,  # of a partition (lmp -partition), from 0 on
    "dmax": DOUBLE,  # of min_modify, in a minimization; else 0
    "ghost_velocity": INT,  # ghost atoms have velocities in this run
    "scalar_pressure": INT,  # kspace has only the mean pressure of all axes in this run
    "inserted": DOUBLES,  # (insertions, 10) molecules, see host/hosts.py
    "insertions": INT,
    # the schedule (run/schedule.py)
    "phase": INT,
    "facts": LONG,  # bits of When that hold for longer than a step
    "begins": LONG,  # the next step that Python begins, -1 for none
    "energy_step": LONG,  # the next step at whose end Python needs the energy, -1 for none
    "velocities_every": INT,  # velocities are read at the end of multiples of this; 0: never
    "table_every": INT,  # a table is written at the end of multiples of this; 0: never
    # lists of actions at the hooks; null if there is nothing to do
    **each(address_of("Action"), "at_setup at_begin at_exchange at_neighbor at_end"),
    "at_deform": address_of("Action"),  # after another fix has changed the box
    "at_flipped": address_of("Action"),  # and after it has chosen other vectors of the lattice
    # boxes that change
    "forces_virial": DOUBLES,  # of all ranks, without this fix, where the box changes next
    "deformed_box": DOUBLES,  # lo, hi, xy, xz, yz for passes deform and flipped
    "rate": DOUBLES,  # LAMMPS's h_rate: xx yy zz yz xz xy
    "remap_group": INT,  # the bit of the group of fix deform remap v, or 0
    "arrays": address_of("Arrays"),
    "held": INT,  # the bit of the group that moves with the box if shake holds some of it, or 0
    "counts": INT,  # fill counted_f, and leave shake and rattle out of the virial
    # external forces (fix_modify external)
    "pushes": INT,  # set by Python: call push when the forces of a step are known
    "words": TEXT,  # set by Python: the variables that it needs, separated by spaces
    **each(INT, "counts_energy counts_virial"),  # set by Python: what LAMMPS counts of them
    "values": DOUBLES,  # of the words, one after the other
    "sizes": INTS,  # how many values each word has: 0 for one that is for all bodies
    "external_sums": DOUBLES,  # set by Python: of these forces, the virial on this rank
}

FUNCTIONS = {
    "log": of_fix(NOTHING, WORD),
    "nth_fix": of_fix(INT, INT, PLACE),  # FixDescription, no id for this fix; 0 after the last
    "command": of_fix(TEXT),  # the words of the last command
    "removed_freedom": of_fix(LONG, WORD, WORD),  # by another fix, in a group
    "begin_step_of": of_fix(NOTHING, WORD),  # initial_integrate of another fix
    "pair_style": of_fix(INT, WORD),  # whether one that begins with this is in use
    "gravity": of_fix(LONG, WORD),  # address of another fix's acceleration, or 0
    "point": of_fix(NOTHING),  # set the cells for LAMMPS's arrays
    "set_array_rows": of_fix(NOTHING, INT),
    "now": of_fix(LONG),  # bits of When
    "potential": of_fix(DOUBLE),  # the potential energy of the last forces, alike on all ranks
    "request_energy": of_fix(NOTHING, LONG),  # have LAMMPS compute it in this step
    "go_back": of_fix(INT),  # displace atoms by their velocities, compute forces; 0 for an error
    "set_box": of_fix(LONG, DOUBLES),  # lo, hi, xy, xz, yz
    # and the multiples of vectors that were added: a to b, a to c, b to c
    "flip_box": of_fix(LONG, DOUBLES),
    "find_clusters": of_fix(LONG),  # fill the cell clusters
    "particles": of_fix(INT, NUMBERS),  # 7 of each local atom, see particles.h; 0 if unknown
    "orient_atom": of_fix(LONG, LONG, DOUBLES),  # set the orientation of a particle
    "molecule": of_fix(INT, INT, NUMBERS),  # 13 of a template, see templates.h; 0 if unknown
}

# methods of `run.fix.Fix`, by their names; null when it is gone.  They return an Outcome.  If the
# last argument is LONGS or DOUBLES, the method returns one int or float, or several, for this place
HOOKS = {
    "init": function(INT),
    "setup": function(INT, INT),
    "post_neighbor": function(INT),
    "initial_integrate": function(INT, INT),
    "final_integrate": function(INT),
    "initial_integrate_respa": function(INT, INT, INT, INT),  # vflag, ilevel, iloop
    "final_integrate_respa": function(INT, INT, INT),  # ilevel, iloop
    "end_of_step": function(INT),  # only with run_style respa
    "reset_dt": function(INT),
    "post_run": function(INT),
    "run_action": function(INT, LONG, LONG),  # the number of an action, and what its pass returned
    # a minimization; the arrays are of min_dof numbers
    "min_store": function(INT),
    "min_step": function(INT, DOUBLE, LONG),  # alpha, address of the direction
    "min_force": function(INT, LONG),  # address of the forces
    "max_alpha": function(INT, LONG, DOUBLES),  # address of the direction
    "modify_external": function(INT, TEXT),  # the words after fix_modify external
    "push": function(INT),
    "write_restart_file": function(INT, TEXT),
    "keep_bodies": function(INT),  # set kept_bodies on rank 0
    "write_restart": function(INT),  # set restart_state
    "zero_momentum": function(INT),
    "zero_rotation": function(INT),
    "reset_target": function(INT, DOUBLE),
    "rows_of_rank": function(INT, TEXT, INT, LONGS),  # words, groupbit; address and number of rows
    "dof": function(INT, INT, LONGS),  # igroup
    "compute_scalar": function(INT, DOUBLES),
    "compute_vector": function(INT, INT, DOUBLES),
    "compute_array": function(INT, INT, INT, DOUBLES),
}

STRUCTS: dict[str, Mapping[str, Type]] = {
    "Arrays": {name: Type(f"{kind} {{}}", None) for name, kind in CELLS.items()},
    "FixDescription": {
        name: TEXT if kind is str else INT for name, kind in OtherFix.__annotations__.items()
    },
    "Pass": PASS,
    "Action": ACTION,
    "Bridge": {
        "checksum": INT,  # of this definition
        **DATA,
        **FUNCTIONS,
        **HOOKS,
        "release": function(NOTHING, PLACE),  # of the bridge: the fix ends
    },
}


def _fields(struct: str) -> list[tuple[str, Any]]:
    return [(name, kind.python) for name, kind in STRUCTS[struct].items()]


class FixDescription(ctypes.Structure):
    """What the plugin tells of another fix."""

    _fields_ = _fields("FixDescription")


class Action(ctypes.Structure):
    """An action of the schedule in C++."""

    _fields_ = _fields("Action")


class Bridge(ctypes.Structure):
    """What a fix of the plugin shares with its Python instance."""

    _fields_ = _fields("Bridge")


def _declarations() -> str:
    lines = ["// made by setup.py from fix_nosquish/structs.py, which explains the fields"]
    lines += ["#pragma once", '#include "cell.h"']
    outcomes = [f"{outcome.name} = {outcome.value}" for outcome in Outcome]
    bits = [f"{bit.name} = {bit.bit_length() - 1}" for bit in When]
    lines += [f"enum Outcome {{ {', '.join(outcomes)} }};", f"enum When {{ {', '.join(bits)} }};"]
    lines += [f"constexpr int64_t {name} = {value}LL;" for name, value in CONSTANTS.items()]
    for struct, fields in STRUCTS.items():
        declared = [f"  {kind.cpp.format(name)};" for name, kind in fields.items()]
        lines += [f"struct {struct} {{", *declared, "};"]
    return "\n".join(lines)


CHECKSUM = zlib.crc32(_declarations().encode()) & 0x7FFFFFFF  # a plugin has that of its header


def header() -> str:
    """The C++ header of these definitions."""
    return f"{_declarations()}\nconstexpr int32_t CHECKSUM = {CHECKSUM};\n"
