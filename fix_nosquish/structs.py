"""What C++ and Python share. plugin/bridge.h is its only definition, which this module reads."""

import ctypes
import re
import zlib
from enum import IntEnum
from pathlib import Path
from typing import Any

_HEADER = Path(__file__).with_name("plugin").joinpath("bridge.h").read_bytes()
CHECKSUM = zlib.crc32(_HEADER) & 0x7FFFFFFF  # the plugin has that of the file it was compiled with
_TEXT = re.sub(r"//.*|/\*(.|\n)*?\*/", "", _HEADER.decode())

_PLAIN: dict[str, Any] = {
    "void": None,
    "int": ctypes.c_int,
    "int32_t": ctypes.c_int32,
    "int64_t": ctypes.c_int64,
    "double": ctypes.c_double,
    "char": ctypes.c_char,
    "char *": ctypes.c_char_p,
}
_ARGUMENTS = _PLAIN | {f"{name} *": ctypes.POINTER(_PLAIN[name]) for name in ("int64_t", "double")}
_DECLARATION = re.compile(r"^(?:const )?(\w+(?: \*)?) ?(?:\(\*)?(\w+)\)?(?:\[(\d+)\])?(\(.*\))?$")


def _declared(struct: str) -> list[tuple[str, str, str, str]]:
    """A struct's fields: of each its type, its name, a count in brackets, and the arguments of a
    function in parentheses."""
    (body,) = re.findall(rf"struct {struct} \{{\n(.*?)\n\}};", _TEXT, re.DOTALL)
    found = []
    for line in filter(None, map(str.strip, body.split(";"))):
        kind, names = line.removeprefix("const ").split(" ", 1)
        several = [line] if "(" in line else [f"{kind} {name}" for name in names.split(", ")]
        found += [_DECLARATION.findall(one)[0] for one in several]
    return found


def _fields_of(struct: str) -> list[tuple[str, Any]]:
    """A struct's fields: of each its name and its type, c_void_p for the address of an array."""
    fields = []
    for kind, name, count, taken in _declared(struct):
        of = _PLAIN.get(kind, ctypes.c_void_p)
        if count:
            of = of * int(count)
        if taken:
            arguments = [
                one for text in taken[1:-1].split(", ") for one in _DECLARATION.findall(text)
            ]
            kinds = [_ARGUMENTS.get(kind, ctypes.c_void_p) for kind, *_ in arguments]
            of = ctypes.CFUNCTYPE(of, *kinds)
        fields.append((name, of))
    return fields


def _number(enum: str, name: str) -> int:
    """The number that C++ has for this name."""
    (number,) = re.findall(rf"enum {enum} \{{[^}}]*\b{name} = (\d+)", _TEXT)
    return int(number)


class Outcome(IntEnum):
    """What a hook returns."""

    DONE = _number("Outcome", "DONE")
    FAILED_ALIKE = _number("Outcome", "FAILED_ALIKE")
    FAILED_HERE = _number("Outcome", "FAILED_HERE")


class FixFacts(ctypes.Structure):
    """What is to be known of another fix."""

    _fields_ = _fields_of("FixFacts")


class Action(ctypes.Structure):
    """What is done at a hook: see `run.schedule.Action`."""

    _fields_ = _fields_of("Action")


class Bridge(ctypes.Structure):
    """What the plugin's fix shares with the Python of its instance."""

    _fields_ = _fields_of("Bridge")


# the hooks, by the names of the class's methods: functions that take neither the fix nor the bridge
HOOKS: dict[str, Any] = {
    name: kind
    for name, kind in _fields_of("Bridge")
    if getattr(kind, "_argtypes_", (ctypes.c_void_p,))[:1] != (ctypes.c_void_p,)
}

# the cells for LAMMPS's arrays, in order: of each its name and its kind's, as loops have them
CELLS = {name: kind for kind, name, *_ in _declared("Arrays")}
