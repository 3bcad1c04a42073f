"""Which atoms form which body, as the fix line says it."""

import numpy as np

from .errors import RunError


class Membership:
    """Which body each of this rank's atoms belongs to, as the fix line says it.

    Args:
        lammps: the `Lammps`.  communicator: the `Communicator` or `ALONE`.  command: the `Command`.

    Attributes:
        variable: name of the atom-style variable that tells bodies apart, if one does.
        before: (natoms,) int64 and bool: the IDs of the bodies that the atoms were in, and which
            atoms were in one; None: none was.
    """

    before = None

    def __init__(self, lammps, communicator, command):
        self.lammps, self.communicator, self.command = lammps, communicator, command
        for group in (command.group, *(command.arguments if command.style == "group" else ())):
            if not lammps.has("group", group):
                raise RunError(
                    f"there is no group '{group}': define it before the fix", everywhere=True
                )
        custom = command.arguments[0] if command.style == "custom" else ""
        self.variable = custom[2:] if custom[:1] == "v" else None
        if self.variable and not lammps.has("variable", self.variable):
            raise RunError(
                f"there is no variable '{self.variable}' (custom {custom}): "
                "define it before the fix",
                everywhere=True,
            )
        self.bit = lammps.group_bit(command.group)
        self.bits = (
            [lammps.group_bit(g) for g in command.arguments]
            if command.style == "group"
            else [self.bit]
        )
        # an atom is in a body if its groups have some bit of both
        self.masks = (
            np.array([self.bit, np.bitwise_or.reduce(self.bits)], np.uint32).view(np.int32).tolist()
        )

    def atoms(self):
        """Indices of this rank's atoms that are in bodies."""
        groups = self.lammps.groups.view(np.int32)
        return np.flatnonzero((groups & self.masks[0] != 0) & (groups & self.masks[1] != 0))

    def bodies(self, atoms):
        """The body ID of each of these atoms, (n,) int64; collective for v_NAME."""
        style, arguments = self.command.style, self.command.arguments
        if style == "single":
            return np.ones(len(atoms), np.int64)
        if style == "molecule":
            values = self.lammps.per_atom("molecule", self.lammps.tagint)
            what = (
                "molecule-IDs, which this atom style does not have: "
                "use atom_style molecular or full, or another body style"
            )
        elif self.variable:
            return self._by_variable(atoms)
        elif style == "custom":
            values = self.lammps.per_atom(arguments[0], np.int32)
            what = f"{arguments[0]}: define it with fix property/atom before the fix"
        else:
            groups = self.lammps.groups[atoms]
            inside = np.array([groups & bit != 0 for bit in self.bits])
            if (inside.sum(axis=0) > 1).any():
                tag = self.lammps.tags[atoms[inside.sum(axis=0) > 1][0]]
                both = [g for g, i in zip(arguments, inside[:, inside.sum(axis=0) > 1][:, 0]) if i]
                raise RunError(
                    f"atom {tag} is in more than one body: it is in the groups "
                    f"{' and '.join(both)}; use groups without common atoms"
                )
            return 1 + np.argmax(inside, axis=0)
        if values is None:
            raise RunError(f"body style {style} needs {what}")
        return values[atoms].astype(np.int64)

    def _by_variable(self, atoms):
        """As `bodies`: an atom that was in a body stays in it, because the variable may be of what
        moves, as fix rigid reads it once only."""
        ids, known = (
            (of_all[atoms] for of_all in self.before)
            if self.before
            else (np.zeros(len(atoms), np.int64), np.zeros(len(atoms), bool))
        )
        if self.communicator.any(not known.all()):
            values = np.trunc(self.lammps.variable(self.variable, self.command.group))[atoms]
            if not np.isfinite(values[~known]).all():
                raise RunError(
                    f"variable {self.variable} is not finite for every atom of the group, "
                    "so it cannot tell bodies apart"
                )
            ids = np.where(known, ids, np.where(known, 0, values).astype(np.int64))
        return ids

    def name(self, body):
        """How a user would name a body."""
        if self.command.style == "group":
            return f"the body of group {self.command.arguments[body - 1]}"
        if self.command.style == "single":
            return f"the body of group {self.command.group}"
        if self.command.style == "molecule":
            return f"the body of molecule {body}"
        return f"the body of {self.command.arguments[0]} = {body}"
