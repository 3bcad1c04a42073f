"""Which integrator is which fix's: those of one LAMMPS know each other."""

import weakref
from itertools import count
from typing import TYPE_CHECKING, Any

from ..errors import RunError
from ..host.lammps import pointer

if TYPE_CHECKING:
    from .integrator import Integrator

_all: "weakref.WeakSet[Integrator]" = weakref.WeakSet()
_numbers = count()


def enter(integrator: "Integrator") -> None:
    """Have the others find it."""
    _all.add(integrator)


def next_number() -> int:
    """A number for an integrator, alike on all ranks."""
    return next(_numbers)


def of_lammps(handle: int) -> "list[Integrator]":
    """Those that a fix of this LAMMPS drives, in an order alike on all ranks: not one whose making
    failed, nor one whose fix is gone, that somebody still holds."""
    found = [one for one in _all if one.host and one.lammps.handle == handle]
    return sorted(found, key=lambda one: one.number)


def of_fix(lmp: Any, fix_id: str) -> "Integrator":
    """The integrator of a LAMMPS that the fix of this ID drives.

    Args:
        lmp: the `lammps` object, or the pointer that LAMMPS hands to Python.
    Raises:
        RunError: if there is none.
    """
    found = of_lammps(pointer(getattr(lmp, "lmp", lmp)))
    for one in found:
        # LAMMPS's own fix tells no ID
        if one.host.fix_id == fix_id or (one.host.fix_id is None and len(found) == 1):
            return one
    if found and found[0].host.fix_id is None:
        raise RunError(
            "a LAMMPS's own fix python/move does not tell which of several fixes has the ID "
            f"{fix_id}: use the keyword output of each",
            everywhere=True,
        )
    raise RunError(f"there is no fix {fix_id} of fix_nosquish", everywhere=True)
