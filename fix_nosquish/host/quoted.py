"""The quoted fix line: how fix python/move finds a class in a module.

For

    fix 1 water python/move "fix_nosquish.NVT water molecule temp 295 295 100 seed 9"

LAMMPS's own fix python/move imports the module before the last '.', gets the attribute whose name
is the rest of the text, and calls it with its pointer.  It does not support arguments of a class.
Therefore the `__getattr__` of a module with integrators, created by `line_lookup`, accepts a class
with arguments.  The text must have no other '.', or Python finds no such module.  The plugin's
fix python/move splits the line at the first space instead, so numbers may have a decimal point.
"""

from collections.abc import Callable, Collection
from typing import Any

from ..errors import RunError


def line_lookup(
    module: str, names: Collection[str], find: Callable[[str], Callable[[Any, Any], Any]]
) -> Callable[[str], Any]:
    """The `__getattr__` of a module with integrators.

    Args:
        module: name of the module.
        names: names of the classes.
        find: returns, for the name of a class, a function (ptr, line) that makes the fix.
    """

    def getattr_of_module(text: str) -> Any:
        """A function from LAMMPS's pointer to the integrator of a line."""
        if text.startswith("__"):
            raise AttributeError(text)
        make = find(_class_name(text, names, module))
        from .command import Line

        return lambda ptr: make(ptr, Line.quoted(text, f"{module}."))

    return getattr_of_module


def _class_name(text: str, names: Collection[str], module: str) -> str:
    """The first word of a line, if it is one of these classes.

    Raises:
        RunError: if it is not, or if the line contains a variable.
        AttributeError: if it is not, and is the only word.
    """
    words = text.split()
    variable = next((word for word in words if "$" in word), None)
    if variable:
        name = variable.split("{")[-1].split("}")[0].strip("$")
        raise RunError(
            f"LAMMPS does not substitute variables inside quotes: '{variable}'. Write the "
            "line without quotes, as fix ID GROUP nosquish/nvt ..., or, for a number or a file "
            f"name, v_{name if name.isidentifier() else 'NAME'}",
            everywhere=True,
        )
    if not words or words[0] not in names:
        first = " ".join(words[:1])
        problem = (
            f"there is no integrator '{first}' in {module}: expected one of {', '.join(names)}"
        )
        raise RunError(problem, everywhere=True) if len(words) > 1 else AttributeError(problem)
    return words[0]
