"""Which fix of this package has which ID: the fixes of one LAMMPS know each other."""

import weakref
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from ..bodies.membership import Membership
from ..errors import RunError, refuse
from ..host.command import Line
from ..host.hosts import Host
from ..host.lammps import Lammps, pointer
from .external import ExternalForces

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
    membership: Membership
    external: ExternalForces

    @property
    def table_path(self) -> str | None:
        """The file of keyword output; None as long as there is none."""

    @property
    def keeps_bodies(self) -> bool:
        """Whether more is known of some bodies than their atoms tell."""
        return False

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


class Sibling(NamedTuple):
    """Another fix of this package.

    Attributes:
        comes_first: whether it was defined before this one.
        table_path: the file of its keyword output; None for none.
        keeps_bodies: whether more is known of some of its bodies than their atoms tell.
    """

    fix_id: str | None
    line: Line
    comes_first: bool
    membership: Membership
    external: ExternalForces
    host: Host
    table_path: str | None
    keeps_bodies: bool


def siblings_of(handle: int, number: int) -> list[Sibling]:
    """The other fixes of this package in a LAMMPS, in an order alike on all ranks.

    Args:
        handle: of the LAMMPS.  number: of the fix that asks.
    """
    return [
        Sibling(
            one.host.fix_id, one.line, one.number < number, one.membership,
            one.external, one.host, one.table_path, one.keeps_bodies,
        )
        for one in of_lammps(handle)
        if one.number != number
    ]  # fmt: skip


def of_lammps(handle: int) -> list[Registered]:
    """The fixes of a LAMMPS, in an order alike on all ranks: without one that could not be made,
    and that somebody still holds."""
    found = [one for one in _all if one.host and one.lammps.handle == handle]
    return sorted(found, key=lambda one: one.number)


def of_fix(lmp: Any, fix_id: str) -> Any:
    """The `fix.Fix` of this ID.

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
        "LAMMPS's own fix python/move does not tell which of several fixes has the ID "
        f"{fix_id}: use the keyword output of each",
    )
    raise RunError(f"there is no fix {fix_id} of fix_nosquish", everywhere=True)


def refuse_shared_atoms(siblings: list[Sibling], line: Line, membership: Membership) -> None:
    """End the run if an atom of the bodies is in a body of another fix, too; collective."""
    atoms, problem = membership.atoms(), None
    for one in siblings:
        one.host.point()  # its run may not have begun yet
        both = np.intersect1d(one.membership.atoms(), atoms)
        if len(both):
            lines = (one.line, line) if one.comes_first else (line, one.line)
            names = " and ".join(f'"{each.prefix}{each.text}"' for each in lines)
            problem = (
                f"atom {membership.lammps.tags[both[0]]} is claimed by two fixes: "
                f"{names}. An atom can be in one body only: "
                "use groups without common atoms"
            )
    membership.communicator.agree(problem)
