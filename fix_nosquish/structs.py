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

_TYPES = {
    "int": ctypes.c_int,
    "int32_t": ctypes.c_int32,
    "int64_t": ctypes.c_int64,
    "double": ctypes.c_double,
    "void": None,
}
_POINTERS = {
    "char": ctypes.c_char_p,
    **{name: ctypes.POINTER(_TYPES[name]) for name in ("int32_t", "int64_t", "double")},
}
_FUNCTION = re.compile(r"(const char \*|\w+ )\(\*(\w+)\)\((.*)\)")
_FIELDS = re.compile(r"(?:const )?(\w+) (.*)")
_FIELD = re.compile(r"(\*?)(\w+)(?:\[(\d+)\])?")


def _declared(struct: str) -> list[tuple[str, str, str]]:
    """A struct's fields: of each the text that declares it, its type's name and its own."""
    (body,) = re.findall(rf"struct {struct} \{{\n(.*?)\n\}};", _TEXT, re.DOTALL)
    found = []
    for line in filter(None, map(str.strip, body.split(";"))):
        if function := _FUNCTION.fullmatch(line):
            found.append((line, "function", function[2]))
        else:
            ((kind, names),) = _FIELDS.findall(line)
            found += [(f"{kind} {name}", kind, name.strip("*")) for name in names.split(", ")]
    return found


def _type(declaration: str) -> Any:
    """The type in a declaration of one field."""
    if function := _FUNCTION.fullmatch(declaration):
        result, _, arguments = function.groups()
        gives = ctypes.c_char_p if "*" in result else _TYPES[result.strip()]
        return ctypes.CFUNCTYPE(gives, *(_type(one) for one in arguments.split(", ") if one))
    ((kind, name),) = _FIELDS.findall(declaration)
    ((star, _, count),) = _FIELD.findall(name)
    if count:
        return ctypes.c_char * int(count)
    return _POINTERS.get(kind, ctypes.c_void_p) if star else _TYPES[kind]


def _fields_of(struct: str) -> list[tuple[str, Any]]:
    return [(name.partition("[")[0], _type(text)) for text, _, name in _declared(struct)]


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
CELLS = {name: kind for _, kind, name in _declared("Arrays")}
