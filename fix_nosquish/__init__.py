"""fix_nosquish: rigid bodies in LAMMPS by the NO_SQUISH integrator of Miller et al. (2002).

In an input script:

    fix 1 water nosquish/nve molecule

or, where LAMMPS has only its own fix python/move,

    fix 1 water python/move "fix_nosquish.NVE water molecule"

`INTEGRATORS` has the others.  With the second form LAMMPS looks up the attribute
`NVE water molecule` of this module; it gets the class named by the first word, with the line bound
to it.
"""

import sys
from collections.abc import Callable, Collection
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import TYPE_CHECKING, Any

from .errors import RunError

if TYPE_CHECKING:  # a name of the package costs no import of numpy
    import numpy as np

__version__ = "0.1.0"
INTEGRATORS = {
    "NVE": "nve",
    "NVT": "nvt",
    "NPT": "npt",
    "NPH": "nph",
    "HMC": "hmc",
    "FIRE": "fire",
}  # class: its module in `integrators`, which is imported when a fix line names the class


def __getattr__(name: str) -> Callable:
    return _bound(_integrator(_class_in(name, INTEGRATORS)), name)


def of_fix_line(*classes: type) -> Callable[[str], Any]:
    """What a module with integrators has as ``__getattr__``, so that a fix line finds them.

    Args:
        classes: the module's integrators.
    """
    named = {one.__name__: one for one in classes}

    def find(name: str) -> Any:
        if name == "__path__":  # so that what has a point goes on to `_Finder`
            return []
        if name.startswith("__"):
            raise AttributeError(name)
        return _bound(named[_class_in(name, named, classes[0].__module__)], name)

    return find


def of_style(style: str, words: Collection[str] = ()) -> Any:
    """The integrator of a fix style of the plugin, such as nosquish/nve, or of one of LAMMPS's that
    it replaces, such as rigid/nve, with these words."""
    from .host import rigid_fixes

    if name := rigid_fixes.plain(style):
        return _integrator(rigid_fixes.integrator(name, words))
    return _integrator({name.lower(): name for name in INTEGRATORS}[style.rpartition("/")[2]])


def _integrator(name: str) -> Any:
    module = __import__(f"{__name__}.integrators.{INTEGRATORS[name]}", fromlist=[name])
    return getattr(module, name)


def _bound(kind: type, text: str) -> Callable:
    """What LAMMPS calls with its pointer, to make the integrator of a line in quotes."""
    from .host.command import Line

    return lambda ptr: kind(ptr, Line.quoted(text))


def _class_in(text: str, known: Collection[str], module: str = __name__) -> str:
    """The first of the words, if it is one of the known classes of a module."""
    words = text.split()
    variable = next((word for word in words if "$" in word), None)
    if variable:
        name = variable.split("{")[-1].split("}")[0].strip("$")
        raise RunError(
            f"LAMMPS puts no variable's value inside quotes, where '{variable}' stands. Write the "
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


def body_table(lmp: Any, fix_id: str) -> "np.ndarray":
    """The rigid bodies of a fix as they are now, in a run or between runs, as a numpy array.

    Args:
        lmp: the `lammps` object, or the pointer that LAMMPS hands to Python.
        fix_id: the ID of the fix.
    Returns:
        structured array (n,) of the bodies that are counted on this rank, each body being on one
        rank; `output.table` says what is in it, in which frames and units.
    Raises:
        RunError: if there is no such fix of this package, or no run yet.
    """
    from .integrators.nve import NVE

    return NVE.of_fix(lmp, fix_id).table()


def rigid_bodies(lmp: Any, fix_id: str) -> Any:
    """The `Bodies` of a fix, to hand in external forces by their method `add_force`.

    Args, Raises: as of `body_table`.
    """
    from .integrators.nve import NVE

    return NVE.of_fix(lmp, fix_id).reports.made(forces=False)


class _UpToPoint(ModuleType):
    """The words of a fix line up to a decimal point.

    LAMMPS's own fix python/move takes what stands before the last point for a module's name, and
    what is behind it for an attribute.
    """

    def __getattr__(self, rest: str) -> Any:
        if rest.startswith("__"):
            raise AttributeError(rest)
        return self._found(f"{self.__name__}.{rest}")

    def __call__(self, ptr: Any) -> Any:
        """Make the integrator of another line, which ends here."""
        return self._found(self.__name__)(ptr)

    @staticmethod
    def _found(line: str) -> Any:
        place, space, words = line.partition(" ")
        module, _, name = place.rpartition(".")
        return sys.modules[module].__getattr__(f"{name}{space}{words}")


class _Finder(Loader):
    """Finds `_UpToPoint` as a module of what the first point of a fix line stands behind."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        module = name.partition(" ")[0].rpartition(".")[0]
        if " " in name and hasattr(sys.modules.get(module), "__getattr__"):
            return ModuleSpec(name, self, is_package=True)
        return None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return _UpToPoint(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        pass


sys.meta_path.insert(0, _Finder())
