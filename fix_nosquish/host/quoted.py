"""A fix line in quotes, as LAMMPS's own fix python/move looks it up in a module.

LAMMPS takes the text of

    fix 1 water python/move "fix_nosquish.NVT water molecule temp 295 295 100 seed 9"

up to its last point for the name of a module, imports it, and asks it for an attribute that is
named by all the rest.  It calls what it gets with its pointer.  It knows no words behind a class.
So a module that has integrators answers for such a name: its `__getattr__` is what `door` returns.
This package's own fix python/move asks in the same way, because it serves what is written for
LAMMPS's.
"""

import sys
from collections.abc import Callable, Collection
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from ..errors import RunError


def door(module: str, names: Collection[str], find: Callable[[str], type]) -> Callable[[str], Any]:
    """The `__getattr__` of a module that has integrators.

    Args:
        module: its name.  names: of the classes.  find: returns the class of a name.
    """

    def of_line(text: str) -> Any:
        """What makes, of LAMMPS's pointer, the integrator that a line in quotes names."""
        if text == "__path__":  # so that what has a point goes on to `_Finder`
            return []
        if text.startswith("__"):
            raise AttributeError(text)
        made = find(_class_in(text, names, module))
        from .command import Line

        return lambda ptr: made(ptr, Line.quoted(text, f"{module}."))

    return of_line


def _class_in(text: str, known: Collection[str], module: str) -> str:
    """The first of the words, if it is one of the known classes of a module."""
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
    if not words or words[0] not in known:
        first = " ".join(words[:1])
        problem = (
            f"there is no integrator '{first}' in {module}: expected one of {', '.join(known)}"
        )
        raise RunError(problem, everywhere=True) if len(words) > 1 else AttributeError(problem)
    return words[0]


class _UpToPoint(ModuleType):
    """The words of a line up to a decimal point, which LAMMPS takes for the name of a module."""

    def __getattr__(self, rest: str) -> Any:
        if rest.startswith("__"):
            raise AttributeError(rest)
        return self._answer(f"{self.__name__}.{rest}")

    def __call__(self, ptr: Any) -> Any:
        """Make the integrator of another line, which ends here."""
        return self._answer(self.__name__)(ptr)

    @staticmethod
    def _answer(line: str) -> Any:
        place, space, words = line.partition(" ")
        module, _, name = place.rpartition(".")
        return sys.modules[module].__getattr__(f"{name}{space}{words}")


class _Finder(Loader):
    """Finds an `_UpToPoint` where LAMMPS imports the words of a line."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        module = name.partition(" ")[0].rpartition(".")[0]
        if " " in name and hasattr(sys.modules.get(module), "__getattr__"):
            return ModuleSpec(name, self, is_package=True)
        return None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return _UpToPoint(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """There is nothing to execute."""


sys.meta_path.insert(0, _Finder())
