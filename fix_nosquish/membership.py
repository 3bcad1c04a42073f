"""Which atoms form which body, as the fix line says it."""

import numpy as np

from .errors import RunError


class Membership:
    """Which body each of this rank's atoms belongs to, as the fix line says it.

    Args:
        lammps: the `Lammps`.  command: the `Command`.
    """

    def __init__(self, lammps, command):
        self.lammps, self.command = lammps, command
        for group in (command.group, *(command.arguments if command.style == "group" else ())):
            if not lammps.has("group", group):
                raise RunError(f"there is no group '{group}': define it before the fix", everywhere=True)
        if command.style == "custom":
            name = command.arguments[0]
            if name[0] == "v" and not lammps.has("variable", name[2:]):
                raise RunError(f"there is no variable '{name[2:]}' (custom {name}): define it before the fix", everywhere=True)
        self.bit = lammps.group_bit(command.group)
        self.bits = [lammps.group_bit(g) for g in command.arguments] if command.style == "group" else [self.bit]
        # an atom is in a body if its groups have some bit of both
        self.masks = np.array([self.bit, np.bitwise_or.reduce(self.bits)], np.uint32).view(np.int32).tolist()

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
            what = "molecule-IDs, which this atom style does not have: use atom_style molecular or full, or another body style"
        elif style == "custom" and arguments[0][0] == "v":
            values = np.trunc(self.lammps.variable(arguments[0][2:], self.command.group))
            if not np.isfinite(values[atoms]).all():
                raise RunError(f"variable {arguments[0][2:]} is not finite for every atom of the group, so it cannot tell bodies apart")
            what = "an atom-style variable"
        elif style == "custom":
            values = self.lammps.per_atom(arguments[0], np.int32)
            what = f"{arguments[0]}: define it with fix property/atom before the fix"
        else:
            groups = self.lammps.groups[atoms]
            inside = np.array([groups & bit != 0 for bit in self.bits])
            if (inside.sum(axis=0) > 1).any():
                tag = self.lammps.tags[atoms[inside.sum(axis=0) > 1][0]]
                both = [g for g, i in zip(arguments, inside[:, inside.sum(axis=0) > 1][:, 0]) if i]
                raise RunError(f"atom {tag} is in more than one body: it is in the groups {' and '.join(both)}; use groups without common atoms")
            return 1 + np.argmax(inside, axis=0)
        if values is None:
            raise RunError(f"body style {style} needs {what}")
        return values[atoms].astype(np.int64)

    def name(self, body):
        """How a user would name a body."""
        if self.command.style == "group":
            return f"the body of group {self.command.arguments[body - 1]}"
        if self.command.style == "single":
            return f"the body of group {self.command.group}"
        if self.command.style == "molecule":
            return f"the body of molecule {body}"
        return f"the body of {self.command.arguments[0]} = {body}"
