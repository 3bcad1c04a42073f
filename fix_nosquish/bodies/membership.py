"""Which atoms form which body, as the fix line says it."""

import numpy as np

from ..errors import RunError

POINTS = 2**52  # a point's ID is this more than that of its atom; bodies have smaller ones


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
        named = command.group, *(command.arguments if command.style == "group" else ())
        for group in (*named, *([command.points] if command.points else [])):
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
        points = lammps.group_bit(command.points) if command.points else 0
        # an atom is in a body if its groups have some bit of the first two; of the third: a point
        masks = [self.bit, np.bitwise_or.reduce(self.bits), points]
        self.masks = np.array(masks, np.uint32).view(np.int32).tolist()

    def atoms(self):
        """Indices of this rank's atoms that are in bodies, or points."""
        return np.flatnonzero(np.logical_or(*self._rigid_and_points()))

    def _rigid_and_points(self):
        """Which of this rank's atoms are in bodies, and which are points."""
        one, other, points = (self.lammps.groups.view(np.int32) & mask != 0 for mask in self.masks)
        return one & other, points

    def bodies(self, atoms):
        """The ID of the body of each of these atoms, or of the point that it is, (n,) int64;
        collective for v_NAME.

        Raises:
            RunError: for an atom that is both, and where the body style's IDs are not there.
        """
        rigid, points = (which[atoms] for which in self._rigid_and_points())
        tags = self.lammps.tags[atoms].astype(np.int64)
        ids = POINTS + tags
        ids[rigid] = self._bodies(atoms[rigid])
        if (rigid & points).any():
            raise RunError(
                f"atom {tags[rigid & points][0]} is in a rigid body, and in group "
                f"'{self.command.points}' of keyword points: leave it out of one of them"
            )
        return ids

    def _bodies(self, atoms):
        """As `bodies`, of atoms that are no points."""
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
        if self.command.points and body > POINTS:
            return f"atom {body - POINTS} (keyword points)"
        if self.command.style == "group":
            return f"the body of group {self.command.arguments[body - 1]}"
        if self.command.style == "single":
            return f"the body of group {self.command.group}"
        if self.command.style == "molecule":
            return f"the body of molecule {body}"
        return f"the body of {self.command.arguments[0]} = {body}"
