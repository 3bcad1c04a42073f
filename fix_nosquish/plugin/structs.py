"""What C++ and Python share, from bridge.h: `Bridge`, `FixFacts`, `Pass`, the enums' values."""

import ctypes
import re
import zlib
from pathlib import Path

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
_FIELD = re.compile(r"(?:const )?(\w+) (\*?)(\w+)(?:\[(\d+)\])?")


def _type(text):
    """The type of a declaration, and its name."""
    if function := _FUNCTION.fullmatch(text):
        result, name, arguments = function.groups()
        taken = [_type(argument)[0] for argument in arguments.split(", ") if argument]
        gives = ctypes.c_char_p if "*" in result else _TYPES[result.strip()]
        return ctypes.CFUNCTYPE(gives, *taken), name
    kind, star, name, count = _FIELD.fullmatch(text).groups()
    if count:
        return ctypes.c_char * int(count), name
    return (_POINTERS.get(kind, ctypes.c_void_p) if star else _TYPES[kind]), name


def _read(text):
    """The structs, as classes, and the enums' values, by name."""
    text = re.sub(r"//.*|/\*(.|\n)*?\*/", "", text)
    found = {}
    for name, values in re.findall(r"enum (\w+) \{(.*?)\};", text, re.DOTALL):
        names = [value.split()[0] for value in values.split(",")]
        found[name.upper()] = names
        found |= {value: k for k, value in enumerate(names)}
    for name, fields in re.findall(r"struct (\w+) \{\n(.*?)\n\};", text, re.DOTALL):
        types = [_type(line.strip()) for line in fields.split(";") if line.strip()]
        found[name] = type(
            name, (ctypes.Structure,), {"_fields_": [(name, kind) for kind, name in types]}
        )
    return found


_header = Path(__file__).with_name("bridge.h").read_bytes()
CHECKSUM = zlib.crc32(_header) & 0x7FFFFFFF  # the plugin has that of the file it was compiled with
globals().update(_read(_header.decode()))
