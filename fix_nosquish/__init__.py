"""fix_nosquish: rigid bodies in LAMMPS by the NO_SQUISH integrator of Miller et al. (2002).

In an input script:

    fix 1 water nosquish/nve molecule

or, where LAMMPS has only its own fix python/move,

    fix 1 water python/move "fix_nosquish.NVE water molecule"

`INTEGRATORS` has the others.  With the second form LAMMPS asks this module for an attribute of the
name `NVE water molecule`: see `host.quoted`.
"""

from collections.abc import Callable, Collection
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from .host import quoted
from .version import VERSION

if TYPE_CHECKING:  # a name of the package costs no import of numpy
    import numpy as np

    from .bodies.bodies import Bodies

__version__ = VERSION
INTEGRATORS = {
    "NVE": "nve",
    "NVT": "nvt",
    "NPT": "npt",
    "NPH": "nph",
    "HMC": "hmc",
}  # class: its module in `integrators`, which is imported when a fix line names the class


def _maker(kind: type) -> Callable[[Any, Any], Any]:
    """A function (ptr, line) that makes the fix of an integrator."""
    from .run.fix import fix_of

    return partial(fix_of, kind)


def _integrator(name: str) -> type:
    return getattr(import_module(f"{__name__}.integrators.{INTEGRATORS[name]}"), name)


# what LAMMPS's fix python/move gets for the words of a fix line
__getattr__ = quoted.line_lookup(__name__, INTEGRATORS, lambda name: _maker(_integrator(name)))


def of_fix_line(*classes: type) -> Callable[[str], Any]:
    """The ``__getattr__`` of a module with integrators, so that a fix line finds them.

    Args:
        classes: the module's integrators.
    """
    names = {kind.__name__: kind for kind in classes}
    return quoted.line_lookup(classes[0].__module__, names, lambda name: _maker(names[name]))


def of_style(style: str, words: Collection[str] = ()) -> Any:
    """The integrator of a fix style of the plugin, such as nosquish/nve, or of one of LAMMPS's that
    it replaces, such as rigid/nve, with these words."""
    from .host import rigid_fixes

    if name := rigid_fixes.plain(style):
        return _integrator(rigid_fixes.integrator(name, words))
    return _integrator(style.removesuffix("/small").rpartition("/")[2].upper())


def fix_of_style(style: str, words: Collection[str] = ()) -> Callable[[Any, Any], Any]:
    """A function (ptr, line) that makes the fix of a style of the plugin, with these words."""
    return _maker(of_style(style, words))


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
    return _of_fix(lmp, fix_id).table()


def rigid_bodies(lmp: Any, fix_id: str) -> "Bodies":
    """The `Bodies` of a fix, to hand in external forces by their method `add_force`.

    Args, Raises: as of `body_table`.
    """
    return _of_fix(lmp, fix_id).completed_bodies(forces=False)


def _of_fix(lmp: Any, fix_id: str) -> Any:
    from .run.registry import of_fix

    return of_fix(lmp, fix_id)
