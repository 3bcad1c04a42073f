"""Which fix of this package has which ID: the fixes of one LAMMPS know each other."""

import weakref
from itertools import count
from typing import Any

import numpy as np

from ..bodies.membership import Membership
from ..errors import RunError, refuse
from ..host.command import Line
from ..host.hosts import Host
from ..host.lammps import Lammps, pointer
from .setting import Setting

_all: "weakref.WeakSet[Registered]" = weakref.WeakSet()
_numbers = count()


class Registered:
    """A fix of this package, as the others of its LAMMPS know it.

    Attributes:
        number: in the order in which the fixes of a process are made; alike on all ranks.
    """

    lammps: Lammps
    host: Host
    line: Line
    number: int
    setting: Setting

    def register(self) -> None:
        """Let the others find it."""
        self.number = next(_numbers)
        _all.add(self)

    def let_go(self) -> None:
        """The fix is gone, and LAMMPS's memory that this object knew with it."""
        name = f"fix {self.host.fix_id} ({self.line.name})"
        _all.discard(self)
        self.__dict__ = {"_gone": name}

    def __getattr__(self, name: str) -> Any:
        gone = self.__dict__.get("_gone")
        if gone is None or name[:2] == "__":
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        raise RunError(
            f"{gone} no longer exists (unfix, or its LAMMPS was closed): read what you need before "
            "that, or use a fix that exists",
            everywhere=True,
        )


def siblings_of(handle: int, number: int) -> list[Setting]:
    """The `Setting`s of the other fixes of a LAMMPS, in an order alike on all ranks.

    Args:
        handle: of the LAMMPS.  number: of the fix that asks.
    """
    return [fix.setting for fix in of_lammps(handle) if fix.number != number]


def of_lammps(handle: int) -> list[Registered]:
    """The fixes of a LAMMPS, in an order alike on all ranks: without one that could not be made,
    and that somebody still holds."""
    fixes = (fix for fix in _all if fix.host and fix.lammps.handle == handle)
    return sorted(fixes, key=lambda fix: fix.number)


def of_fix(lmp: Any, fix_id: str) -> Any:
    """The `fix.Fix` of this ID.

    Args:
        lmp: the `lammps` object, or the pointer that LAMMPS hands to Python.
    Raises:
        RunError: if there is none.
    """
    fixes = of_lammps(pointer(getattr(lmp, "lmp", lmp)))
    for fix in fixes:
        # LAMMPS's own fix tells no ID
        if fix.host.fix_id == fix_id or (fix.host.fix_id is None and len(fixes) == 1):
            return fix
    refuse(
        fixes and fixes[0].host.fix_id is None,
        "LAMMPS's own fix python/move does not tell which of several fixes has the ID "
        f"{fix_id}: use the keyword output of each",
    )
    raise RunError(f"there is no fix {fix_id} of fix_nosquish", everywhere=True)


def refuse_shared_atoms(
    siblings: list[Setting], number: int, line: Line, membership: Membership
) -> None:
    """End the run if an atom of the bodies is in a body of another fix, too; collective.

    Args:
        siblings: the other fixes of this package.  number, line: of this one.
    """
    atoms, problem = membership.atoms(), None
    for sibling in siblings:
        sibling.host.point()  # its run may not have begun yet
        both = np.intersect1d(sibling.membership.atoms(), atoms)
        if len(both):
            lines = (sibling.command.line, line)
            names = " and ".join(
                f'"{each.prefix}{each.text}"'
                for each in (lines if sibling.number < number else lines[::-1])
            )
            problem = (
                f"atom {membership.lammps.tags[both[0]]} is claimed by two fixes: "
                f"{names}. An atom can be in one body only: "
                "use groups without common atoms"
            )
    membership.communicator.agree(problem)
