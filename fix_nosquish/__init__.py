"""fix_nosquish: rigid bodies in LAMMPS by the NO_SQUISH integrator of Miller et al. (2002).

In an input script:

    fix 1 water python/move "fix_nosquish.NVE water molecule"

`INTEGRATORS` has the others.

LAMMPS looks up the attribute `NVE water molecule` of this module; it gets the class
named by the first word, with the words bound to it.
"""

import sys
from collections.abc import Callable, Collection
from contextlib import suppress
from functools import partial
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
    "MatubayasiNakahara": "matubayasi_nakahara",
    "Gear": "gear",
}  # class: its module in `integrators`, which is imported when a fix line names the class


def __getattr__(name: str) -> partial:
    name_of_class = _class_in(name, INTEGRATORS)
    place = f"{__name__}.integrators.{INTEGRATORS[name_of_class]}"
    module = __import__(place, fromlist=[name_of_class])
    return partial(getattr(module, name_of_class), words=name)


def of_fix_line(*classes: type) -> Callable[[str], partial]:
    """What a module with integrators has as ``__getattr__``, so that a fix line finds them.

    Args:
        classes: the module's integrators.
    """
    named = {one.__name__: one for one in classes}

    def find(name: str) -> partial:
        if name.startswith("__"):
            raise AttributeError(name)
        return partial(named[_class_in(name, named, classes[0].__module__)], words=name)

    return find


def _class_in(text: str, known: Collection[str], module: str = __name__) -> str:
    """The first of the words, if it is one of the known classes of a module."""
    words = text.split()
    variable = next((word for word in words if "$" in word), None)
    if variable:
        name = variable.split("{")[-1].split("}")[0].strip("$")
        raise RunError(
            f"LAMMPS puts no variable's value inside quotes, where '{variable}' stands. For a "
            f"number or a file name write v_{name if name.isidentifier() else 'NAME'}. Give a "
            "group one name of its own (group NAME union ...), or have the quotes and all words in "
            "a variable, one text for each value: variable WORDS index '\"fix_nosquish.NVE water "
            "molecule mrot 1\"' '\"fix_nosquish.NVE water molecule mrot 2\"' (or lmp -var WORDS "
            "'\"...\"'), and write python/move ${WORDS}",
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


class _PointInWords:
    """Explains what happened when LAMMPS takes a number's point for the end of the module's name,
    if nothing before it is wrong."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> None:
        if name.startswith(__name__ + ".") and " " in name:
            from .host.command import Command, Unfinished

            text = name.removeprefix(__name__ + ".")
            own = getattr(__getattr__(_class_in(text, INTEGRATORS)).func, "keywords", ())
            with suppress(Unfinished):  # the rest of it is behind the point
                Command.parse(text.rpartition(" ")[0], own)
            raise RunError(
                f"the words of the fix line hold a point (after '{text}'), "
                "at which LAMMPS cuts them: write real numbers without one (3e2, 25e-1) "
                "or as a variable (v_NAME), files as a string-style variable (v_NAME)",
                everywhere=True,
            )


sys.meta_path.insert(0, _PointInWords)
