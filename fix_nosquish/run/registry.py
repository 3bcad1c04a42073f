"""Which integrator is which fix's: those of one LAMMPS know each other."""

import weakref
from itertools import count
from typing import TYPE_CHECKING, Any, cast

from ..errors import RunError, refuse
from ..host.hosts import Host
from ..host.lammps import Lammps, pointer

if TYPE_CHECKING:
    from .integrator import Integrator

_all: "weakref.WeakSet[Integrator]" = weakref.WeakSet()
_numbers = count()


def of_lammps(handle: int) -> "list[Integrator]":
    """Those that a fix of this LAMMPS drives, in an order alike on all ranks: not one whose making
    failed, that somebody still holds."""
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
    refuse(
        found and found[0].host.fix_id is None,
        "a LAMMPS's own fix python/move does not tell which of several fixes has the ID "
        f"{fix_id}: use the keyword output of each",
    )
    raise RunError(f"there is no fix {fix_id} of fix_nosquish", everywhere=True)


class Registered:
    """What the integrators of a process know of each other.

    Attributes:
        number: of the integrators of a process, in the order of their making; alike on all ranks.
    """

    lammps: Lammps
    host: Host
    name: str
    of_fix = staticmethod(of_fix)

    def register(self) -> None:
        """Have the others find it."""
        self.number = next(_numbers)
        _all.add(cast("Integrator", self))

    @property
    def mates(self) -> list["Integrator"]:
        """All integrators of this LAMMPS, this one among them, in an order alike on all ranks."""
        return of_lammps(self.lammps.handle)

    def let_go(self) -> None:
        """The fix is gone, and what this object knew of LAMMPS's memory with it."""
        name = f"fix {self.host.fix_id} ({self.name})"
        _all.discard(cast("Integrator", self))
        self.__dict__ = {"_gone": name}

    def __getattr__(self, name: str) -> Any:
        gone = self.__dict__.get("_gone")
        if gone is None or name[:2] == "__":
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        raise RunError(
            f"{gone} no longer exists (unfix, or its LAMMPS was closed): read what you need before "
            "that, or use the integrator of a fix that exists",
            everywhere=True,
        )
