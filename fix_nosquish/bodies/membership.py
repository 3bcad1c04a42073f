"""Which atoms form which body, according to the fix line."""

from typing import NamedTuple, cast

import numpy as np

from ..errors import refuse
from ..host.command import Command
from ..host.lammps import Lammps
from ..ranks.communicator import Ranks
from ..ranks.lookup import find, look_up
from ..structs import OUT, UNDECIDED

FLEXIBLE = 2**52  # a flexible atom's ID is this plus its tag; IDs of bodies are smaller
_LEAST_ID = -(2**53)  # IDs travel as floating-point numbers
_UNKNOWN = -(2**60)  # the ID of a body whose ID the rule does not give
_MOST = 2**26  # rows of 24 bytes in one of LAMMPS's restart records


class PreviousBodies(NamedTuple):
    """The previous bodies of LAMMPS's atoms on this rank.

    Attributes:
        known: (natoms,) bool, which atoms were in a body.
        natoms: (natoms,) number of atoms of the body.
        q: (4, natoms) quaternion of the body.
        displace: (rows, natoms) the atom's column of `Bodies.displace`.
        followed: whether LAMMPS moved these data with the atoms; else atoms are matched by ID.
    """

    known: np.ndarray
    natoms: np.ndarray
    q: np.ndarray
    displace: np.ndarray
    followed: bool


class Membership:
    """Which body each of this rank's atoms belongs to.

    The rule of the fix line assigns atoms to bodies when the fix is defined.  The body ID moves
    with the atom, in the cell `membership`.  Atoms that are added later are assigned by the same
    rule when bodies are made.

    Args:
        lammps, communicator, command: see the attributes.

    Attributes:
        lammps: the `Lammps` that has the atoms.
        communicator: the `Communicator` of its ranks, or `ALONE`.
        command: the `Command`, which is the fix line.
        variable: name of the atom-style variable that identifies bodies; "" if there is none.
        masks: bits of `lammps.groups` by name.  By the rule, an atom is in a body if its groups
            have a bit of fix_group and a bit of body_groups, and flexible if they have a bit of
            flexible.
        left_out: number of atoms that have the molecule-ID of a body but are not in the groups, as
            the fix was defined.

    Raises:
        RunError: on all ranks, for a group or variable that does not exist.
    """

    def __init__(self, lammps: Lammps, communicator: Ranks, command: Command) -> None:
        self.lammps, self.communicator, self.command = lammps, communicator, command
        self._of_bodies = command.arguments if command.style == "group" else (command.group,)
        self._of_atoms = (command.flexible,) if command.flexible else ()
        self._groups = tuple(dict.fromkeys((command.group, *self._of_bodies, *self._of_atoms)))
        for group in self._groups:
            refuse(
                not lammps.has("group", group),
                f"there is no group '{group}': define it before the fix",
            )
        custom = command.arguments[0] if command.style == "custom" else ""
        self.variable = custom[2:] if custom[:1] == "v" else ""
        refuse(
            self.variable and not lammps.has("variable", self.variable),
            f"there is no variable '{self.variable}' (custom {custom}): define it before the fix",
        )
        self.find_groups()

    def find_groups(self) -> None:
        """Find the groups' bits, because LAMMPS reuses bits of deleted groups.  A deleted group has
        no bit, so it contains no atom that is added later."""
        has, bit = self.lammps.has, self.lammps.group_bit
        bits = {group: bit(group) if has("group", group) else 0 for group in self._groups}
        self._bits = [bits[group] for group in self._of_bodies]
        masks = {
            "fix_group": bits[self.command.group],
            "body_groups": np.bitwise_or.reduce(self._bits),
            "flexible": sum(bits[group] for group in self._of_atoms),
        }
        self.masks = {name: np.uint32(mask).view(np.int32).item() for name, mask in masks.items()}

    @property
    def assigned(self) -> np.ndarray:
        """The assignment of each of this rank's atoms, (natoms,): the ID of its body, `FLEXIBLE`,
        `OUT` or `UNDECIDED`."""
        return self.lammps.cells["membership"].array

    def atoms(self) -> np.ndarray:
        """Indices of this rank's atoms that are in bodies, or flexible."""
        return np.flatnonzero(self.assigned > OUT)

    def define(self, listed: np.ndarray) -> None:
        """Assign all atoms when the fix is defined; collective.

        Args:
            listed: (n, 3) exceptions from a restart file: atom ID, entry of `assigned`, and entry
                by the rule when the file was written; the first row has the total number of atoms
                in column 1.
        Raises:
            RunError: on all ranks, if the rule gives a different entry now; see also `ids`.
        """
        assigned, tags = self.assigned, self.lammps.tags.astype(np.int64)
        assigned[:] = UNDECIDED
        natoms = [*listed[:, 1], self.lammps.natoms][0]
        refuse(
            natoms != self.lammps.natoms,
            f"the restart file has bodies that the fix line does not tell, of {natoms:.0f} atoms, "
            f"and there are {self.lammps.natoms} atoms: define this fix before atoms are created "
            "or deleted; to replicate them, or to have bodies decided anew, give it another ID",
        )
        place = find(listed[:, 0].astype(np.int64), tags)
        here, now = place >= 0, self._by_rule(self._current_values())
        _, assigned[here], then = listed[place[here]].T
        self.communicator.refuse(
            (now[here] != then) & (now[here] != assigned[here]),
            lambda k: (
                f"atom {tags[here][k]} is not the one of the restart file, or has another "
                "molecule-ID, value or group than there, so its body is not known: define this fix "
                "before what changes these, or with another ID for bodies that are decided anew"
            ),
        )
        self.decide()
        assigned[assigned == UNDECIDED] = OUT
        self.left_out = self._count_left_out()

    def _count_left_out(self) -> int:
        """The number of atoms in no body with the molecule-ID of a body, of style molecule;
        collective."""
        out = self.assigned == OUT
        if self.command.style != "molecule" or not self.communicator.any(out.any()):
            return 0
        molecules, which = np.unique(self._values()[out], return_inverse=True)
        bodies = np.unique(self.assigned[self.assigned > OUT])
        known = look_up(self.communicator, bodies, np.ones((len(bodies), 1), int), molecules)
        return self.communicator.count((known[which] > 0).sum())

    def decide(self) -> None:
        """Assign the atoms in the fix line's groups that were added since; collective.

        Raises:
            RunError: on all ranks, see `ids`.
        """
        ids, assigned = self.ids(), self.assigned
        assigned[:] = np.where(ids > FLEXIBLE, FLEXIBLE, ids)

    def ids(self) -> np.ndarray:
        """The body ID of each atom, (natoms,), with added atoms assigned by the rule; collective.

        A flexible atom has a unique ID; atoms in no body have `OUT` or `UNDECIDED`.

        Raises:
            RunError: on all ranks, for an added atom that is in two bodies or in one that is
                complete, and if the molecule-ID, value or variable does not exist.
        """
        ids, by_rule = self.assigned.copy(), self._by_rule(None)
        added = np.flatnonzero((ids == UNDECIDED) & (by_rule != OUT))
        if self.communicator.any(len(added)):
            if self.command.style in ("molecule", "custom"):
                by_rule = self._by_rule(self._values())
            ids[added] = by_rule[added]
            self._refuse(added, ids[added])
            self._number_anew(ids, added)
        return np.where(ids == FLEXIBLE, FLEXIBLE + self.lammps.tags.astype(np.int64), ids)

    def _refuse(self, added: np.ndarray, ids: np.ndarray) -> None:
        """Raise an error if added atoms cannot be in their bodies; collective.

        Args:
            added: (n,) their indices.  ids: (n,) their entries, see `assigned`.
        """
        groups, tags = self.lammps.groups[added], self.lammps.tags[added]
        rigid, flexible = (some[added] for some in self._rigid_and_flexible())
        inside = np.array([groups & bit != 0 for bit in self._bits])
        names, refuse_atoms, name = np.array(self._of_bodies), self.communicator.refuse, self.name
        refuse_atoms(
            rigid & flexible,
            lambda k: (
                f"atom {tags[k]} is in a rigid body, and in group "
                f"'{self.command.flexible}' of keyword flexible: leave it out of one of them"
            ),
        )
        refuse_atoms(
            rigid & (inside.sum(axis=0) > 1),
            lambda k: (
                f"atom {tags[k]} is in more than one body: it is in "
                f"the groups {' and '.join(names[inside[:, k]])}; use groups without common atoms"
            ),
        )
        refuse_atoms(
            rigid & ((ids < _LEAST_ID) | (ids >= FLEXIBLE)),
            lambda k: f"{name(ids[k])} has too large an ID: less than 2^52 is possible",
        )

    def _number_anew(self, ids: np.ndarray, added: np.ndarray) -> None:
        """Renumber added bodies whose ID by the rule belongs to an existing body.  This occurs if
        the atoms of that body have since got other IDs, for example by reset_atoms mol; collective.

        Args:
            ids: (natoms,) see `assigned`; changed in place.
            added: (n,) indices of the added atoms.
        Raises:
            RunError: on all ranks, if only some atoms of that body have got another ID.
        """
        gathered, assigned = self.communicator.gather_to_all, self.assigned
        now, known = self._by_rule(self._current_values()), (assigned > OUT) & (assigned < FLEXIBLE)
        renamed = gathered(np.unique(assigned[known & (assigned != now) & (now > _UNKNOWN)]))
        clashes = np.isin(ids[added], renamed)
        if not self.communicator.any(clashes.any()):
            return  # so that insertion in a run does not gather all IDs
        self.communicator.refuse(
            clashes & np.isin(ids[added], gathered(np.unique(now[known]))),
            lambda k: (
                f"atom {self.lammps.tags[added[k]]} came into {self.name(ids[added[k]])}, some of "
                "whose atoms were given another ID since this fix was defined: give new bodies "
                "IDs that no body of this fix has, or unfix this fix and define it again"
            ),
        )
        taken = np.unique(gathered(ids[added[clashes]]))
        bodies = (ids > OUT) & (ids < FLEXIBLE)
        highest = gathered(ids[bodies].max(initial=0, keepdims=True)).max()
        which = added[clashes]
        ids[which] = highest + 1 + np.searchsorted(taken, ids[which])

    def _rigid_and_flexible(self) -> tuple[np.ndarray, np.ndarray]:
        """Which of this rank's atoms are in bodies and which are flexible by the rule, (natoms,)
        bool each."""
        in_fix, in_bodies, flexible = (
            self.lammps.groups.view(np.int32) & mask != 0 for mask in self.masks.values()
        )
        return in_fix & in_bodies, flexible

    def _by_rule(self, values: np.ndarray | None) -> np.ndarray:
        """The assignment of each atom by the rule at present, (natoms,), see `assigned`.

        Args:
            values: (natoms,) molecule-IDs or custom values; None for `_UNKNOWN`.
        """
        (rigid, flexible), groups = self._rigid_and_flexible(), self.lammps.groups
        ids: np.ndarray | int = _UNKNOWN if values is None else values
        if self.command.style == "single":
            ids = 1
        elif self.command.style == "group":
            ids = 1 + np.argmax([groups & bit != 0 for bit in self._bits], axis=0)
        return np.where(rigid, ids, np.where(flexible, FLEXIBLE, OUT))

    def _current_values(self) -> np.ndarray | None:
        """The atoms' molecule-IDs or custom values, (natoms,); None if there are none, or if they
        are from a variable, which is evaluated only once."""
        style, lammps = self.command.style, self.lammps
        if style == "molecule":
            return lammps.per_atom("molecule", lammps.tagint)
        integers = style == "custom" and not self.variable
        return lammps.per_atom(self.command.arguments[0], np.int32) if integers else None

    def _values(self) -> np.ndarray:
        """The molecule-IDs or custom values that identify bodies, (natoms,) int64; collective.

        Raises:
            RunError: on all ranks, if they do not exist.
        """
        if self.variable:
            values = np.trunc(self.lammps.variable(self.variable, self.command.group))
            rigid, _ = self._rigid_and_flexible()
            self.communicator.refuse(
                rigid & (self.assigned == UNDECIDED) & ~np.isfinite(values),
                lambda k: (
                    f"variable {self.variable} is not finite for every atom of the group, "
                    "so it cannot tell bodies apart"
                ),
            )
            return np.where(np.abs(values) < FLEXIBLE, values, FLEXIBLE).astype(np.int64)
        style, values = self.command.style, self._current_values()
        what = (
            "molecule-IDs, which this atom style does not have: "
            "use atom_style molecular or full, or another body style"
            if style == "molecule"
            else f"{self.command.arguments[0]}: define it with fix property/atom before the fix"
        )
        self.communicator.agree(None if values is not None else f"body style {style} needs {what}")
        return cast(np.ndarray, values).astype(np.int64)

    def changes(self) -> str:
        """How many atoms have changed group, molecule-ID or value since they were assigned, for
        messages; "" for none; collective."""
        assigned, style = self.assigned, self.command.style
        now = self._by_rule(self._current_values())
        in_same_body = (now == _UNKNOWN) & (assigned > OUT) & (assigned < FLEXIBLE)
        changed = (assigned != now) & (assigned != UNDECIDED) & ~in_same_body
        value = f"value of {' '.join(self.command.arguments)} or " if style == "custom" else ""
        value = "molecule-ID or " if style == "molecule" else value
        count = self.communicator.count(changed.sum())
        return f"with another {value}group: {count}" if count else ""

    def exceptions(self) -> np.ndarray | None:
        """The atoms whose assignment differs from the rule, for a restart file: (n, 3), see
        `define`, on rank 0; None on other ranks, and if there are none; collective."""
        assigned, communicator = self.assigned, self.communicator
        now = self._by_rule(self._current_values())
        which = (assigned != now) & (assigned != UNDECIDED)
        bodies = communicator.gather_to_all(np.unique(assigned[which & (assigned > OUT)]))
        which |= np.isin(assigned, bodies)  # whole bodies, so that the IDs in use are known
        many = communicator.count(which.sum())
        refuse(
            many > _MOST,
            f"the restart file has room for {_MOST} atoms whose bodies the fix line does not tell: "
            "use body style molecule",
        )
        rows = communicator.gather(np.array([self.lammps.tags, assigned, now], float).T[which])
        head = np.array([[0.0, self.lammps.natoms, 0.0]])
        return np.concatenate([head, rows]) if many and rows is not None else None

    def name(self, body: int) -> str:
        """The body of this ID in the user's terms, for messages."""
        style, arguments = self.command.style, self.command.arguments
        if self.command.flexible and body > FLEXIBLE:
            return f"atom {body - FLEXIBLE} (keyword flexible)"
        if style == "molecule":
            return f"the body of molecule {body}"
        if style == "custom":
            return f"the body of {arguments[0]} = {body}"
        return f"the body of group {arguments[body - 1] if arguments else self.command.group}"
