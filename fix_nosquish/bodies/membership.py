"""Which atoms form which body, as the fix line says it."""

from typing import NamedTuple, cast

import numpy as np

from ..errors import RunError
from ..host.command import Command
from ..host.lammps import Lammps
from ..ranks.communicator import Alone

FLEXIBLE = 2**52  # a flexible atom's ID is this plus its tag; IDs of bodies are smaller


class Former(NamedTuple):
    """What LAMMPS's atoms on this rank were in bodies.

    Attributes:
        known: (natoms,) bool, which atoms were in a body.
        id, natoms: (natoms,) the body's ID and number of atoms.
        q: (4, natoms) its quaternion.
        displace: (rows, natoms) the atom's column of `Bodies.displace`.
        followed: whether LAMMPS took all that along with the atoms; else their IDs found them.
    """

    known: np.ndarray
    id: np.ndarray
    natoms: np.ndarray
    q: np.ndarray
    displace: np.ndarray
    followed: bool


class Membership:
    """Which body each of this rank's atoms belongs to, as the fix line says it.

    Args:
        lammps, communicator, command: see the attributes.

    Attributes:
        lammps: the `Lammps` that has the atoms.
        communicator: the `Communicator` of its ranks, or `ALONE`.
        command: the `Command`, which is the fix line.
        variable: name of the atom-style variable that tells bodies apart; "" if none does.
        masks: bits of `lammps.groups` by name.  An atom is in a body if its groups have some bit of
            fix_group and some of body_groups.  It is flexible if they have some bit of flexible.

    Raises:
        RunError: on all ranks, for a group or variable that is not there.
    """

    def __init__(self, lammps: Lammps, communicator: Alone, command: Command) -> None:
        self.lammps, self.communicator, self.command = lammps, communicator, command
        of_bodies = command.arguments if command.style == "group" else (command.group,)
        of_atoms = (command.flexible,) if command.flexible else ()
        for group in (command.group, *of_bodies, *of_atoms):
            if not lammps.has("group", group):
                raise RunError(
                    f"there is no group '{group}': define it before the fix", everywhere=True
                )
        custom = command.arguments[0] if command.style == "custom" else ""
        self.variable = custom[2:] if custom[:1] == "v" else ""
        if self.variable and not lammps.has("variable", self.variable):
            raise RunError(
                f"there is no variable '{self.variable}' (custom {custom}): "
                "define it before the fix",
                everywhere=True,
            )
        self._bits = [lammps.group_bit(group) for group in of_bodies]
        bits = {
            "fix_group": lammps.group_bit(command.group),
            "body_groups": np.bitwise_or.reduce(self._bits),
            "flexible": sum(lammps.group_bit(group) for group in of_atoms),
        }
        self.masks = {name: np.uint32(some).view(np.int32).item() for name, some in bits.items()}

    def atoms(self) -> np.ndarray:
        """Indices of this rank's atoms that are in bodies, or flexible."""
        return np.flatnonzero(np.logical_or(*self._rigid_and_flexible()))

    def _rigid_and_flexible(self) -> tuple[np.ndarray, np.ndarray]:
        """Which of this rank's atoms are in bodies, and which are flexible, (natoms,) bool each."""
        one, other, flexible = (
            self.lammps.groups.view(np.int32) & mask != 0 for mask in self.masks.values()
        )
        return one & other, flexible

    def body_ids(self, atoms: np.ndarray, former: Former | None = None) -> np.ndarray:
        """The ID of the body of each of these atoms, or its own if it is flexible; collective.

        Args:
            atoms: (m,) their indices.
            former: what the atoms were in bodies; see `_by_variable`.
        Returns:
            (m,) int64.
        Raises:
            RunError: on all ranks, for an atom that is both, and where the body style's IDs are not
                there.
        """
        rigid, flexible = (which[atoms] for which in self._rigid_and_flexible())
        tags = self.lammps.tags[atoms].astype(np.int64)
        ids = FLEXIBLE + tags
        ids[rigid] = self._ids_of_bodies(atoms[rigid], former)
        self.communicator.refuse(
            rigid & flexible,
            lambda k: (
                f"atom {tags[k]} is in a rigid body, and in group "
                f"'{self.command.flexible}' of keyword flexible: leave it out of one of them"
            ),
        )
        return ids

    def _ids_of_bodies(self, atoms: np.ndarray, former: Former | None) -> np.ndarray:
        """As `body_ids`, of atoms in bodies."""
        style, arguments, lammps = self.command.style, self.command.arguments, self.lammps
        if style == "single":
            return np.ones(len(atoms), np.int64)
        if style == "group":
            return self._by_group(atoms)
        if self.variable:
            return self._by_variable(atoms, former)
        if style == "molecule":
            values = lammps.per_atom("molecule", lammps.tagint)
            what = (
                "molecule-IDs, which this atom style does not have: "
                "use atom_style molecular or full, or another body style"
            )
        else:
            values = lammps.per_atom(arguments[0], np.int32)
            what = f"{arguments[0]}: define it with fix property/atom before the fix"
        self.communicator.agree(None if values is not None else f"body style {style} needs {what}")
        return cast(np.ndarray, values)[atoms].astype(np.int64)

    def _by_group(self, atoms: np.ndarray) -> np.ndarray:
        """As `body_ids`: a body is what is in a group of the fix line, and they count from 1."""
        groups = self.lammps.groups[atoms]
        inside = np.array([groups & bit != 0 for bit in self._bits])
        names = np.array(self.command.arguments)
        self.communicator.refuse(
            inside.sum(axis=0) > 1,
            lambda k: (
                f"atom {self.lammps.tags[atoms[k]]} is in more than one body: it is in "
                f"the groups {' and '.join(names[inside[:, k]])}; use groups without common atoms"
            ),
        )
        return 1 + np.argmax(inside, axis=0)

    def _by_variable(self, atoms: np.ndarray, former: Former | None) -> np.ndarray:
        """As `body_ids`: an atom that was in a body stays in it.

        The variable may depend on what moves, and fix rigid reads it once only.  With LAMMPS's own
        fix python/move it is not known which atoms were in which body.
        """
        if former is not None and former.followed:
            ids, known = former.id[atoms], former.known[atoms]
        else:
            ids, known = np.zeros(len(atoms), np.int64), np.zeros(len(atoms), bool)
        if self.communicator.any(not known.all()):
            values = np.trunc(self.lammps.variable(self.variable, self.command.group))[atoms]
            self.communicator.refuse(
                ~known & ~np.isfinite(values),
                lambda k: (
                    f"variable {self.variable} is not finite for every atom of the group, "
                    "so it cannot tell bodies apart"
                ),
            )
            ids = np.where(known, ids, np.where(known, 0, values).astype(np.int64))
        return ids

    def name(self, body: int) -> str:
        """How a user would name the body of this ID."""
        style, arguments = self.command.style, self.command.arguments
        if self.command.flexible and body > FLEXIBLE:
            return f"atom {body - FLEXIBLE} (keyword flexible)"
        if style == "molecule":
            return f"the body of molecule {body}"
        if style == "custom":
            return f"the body of {arguments[0]} = {body}"
        return f"the body of group {arguments[body - 1] if arguments else self.command.group}"
