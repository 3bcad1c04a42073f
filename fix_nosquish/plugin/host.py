"""What a class can ask of the fix that drives it."""

from ctypes import c_int, cast
from typing import NamedTuple

import numpy as np

from ..compiled import array
from .passes import passes


class OtherFix(NamedTuple):
    """A fix of the same simulation."""

    id: str
    style: str
    groupbit: int
    time_integrate: bool  # it moves the atoms of its group
    between: bool  # it is called between initial_integrate and final_integrate
    end_of_step: bool  # it is called at the end of every nevery-th step
    nevery: int
    final_integrate: bool  # it is called where final_integrate is
    box_change: bool  # it changes the box


class Host:
    """The fix as its class sees it; set as ``host`` on an instance that has this attribute.

    Attributes:
        fix_id: The fix's ID.
        group: Name of the fix's group.
    """

    def __init__(self, bridge):
        self.fix_id = bridge.fix_id.decode()
        self.group = bridge.group.decode()
        self._bridge = bridge
        self._next_output = bridge.next_output.contents
        self._natoms = c_int.from_address(bridge.nlocal)
        self._note, self._keep, self._point = (
            bridge.note,
            bridge.keep,
            bridge.point,
        )  # ctypes makes a function at each access

    def log(self, text):
        """Print text on LAMMPS's screen and in its log file; ranks other than 0 print nothing."""
        self._bridge.log(self._bridge.fix, text.encode())

    def fixes(self):
        """List all other fixes, as OtherFix, in the order in which LAMMPS calls them."""
        return [OtherFix(*facts) for facts in self._bridge.other_fixes()]

    @property
    def next_output(self):
        """The next step for which LAMMPS writes something: thermodynamics, a dump or a restart file."""
        return self._next_output.value

    @property
    def ghost_velocity(self):
        """Whether ghost atoms carry velocities (``comm_modify vel yes``)."""
        return bool(self._bridge.ghost_velocity(self._bridge.fix))

    @property
    def creates_velocities(self):
        """Whether ``velocity ... create`` is the command that LAMMPS has begun last."""
        return bool(self._bridge.creates_velocities(self._bridge.fix))

    def removed_freedom(self, fix_id, group):
        """Degrees of freedom that another fix takes from a group of atoms, which it does not move by itself; collective.

        Args:
            fix_id, group: The IDs of that fix and of the group.
        """
        return self._bridge.removed_freedom(self._bridge.fix, fix_id.encode(), group.encode())

    def atoms_moved(self):
        """Whether LAMMPS has re-neighboured unsaid: never, there is a hook for it."""
        return False

    def set_bodies(self, body, mass):
        """Lend LAMMPS the bodies of this rank, which it looks up if the class has ``rigid_flag``; None, None takes them back.

        Args:
            body: (natoms,) int32, contiguous, the body of each atom here, -1 for none.
            mass: float64, contiguous, of each body.
        """
        self._lent = body, mass
        self._bridge.body, self._bridge.masstotal = (
            None if array is None else array.ctypes.data for array in (body, mass)
        )

    def set_array_rows(self, n):
        """Tell LAMMPS how many rows ``compute_array`` gives now; of further rows LAMMPS reads zeros.

        Until the first call it is the attribute ``array_rows`` that the instance has when it is made.
        Without that attribute the number counts as variable, which fix ave/time does not accept.
        """
        self._bridge.set_array_rows(self._bridge.fix, int(n))

    @property
    def waiting(self):
        """Whether the end of the last step waits for the next one (see ``go_alone``); set it to False when it is done."""
        return bool(self._bridge.waiting)

    @waiting.setter
    def waiting(self, value):
        self._bridge.waiting = value

    def go_alone(self, look_every, step, following):
        """Have the fix leave out calls of this class from now on, until ``call_always``.

        final_integrate is not called on steps without output, virial and multiples of look_every (0: of none); the fix then
        is ``waiting``, and the next initial_integrate has to do both.

        A pass is a loop that is bound (see `compiled.Loop.bind`), which returns 0 if all is well (if not, the class is called), or
        what `sharing` has for messages.

        Args:
            step: passes that the fix does instead of such an initial_integrate, or None.
            following: what it does instead of post_neighbor, as long as the box stays as it is, or None; all ranks the same.
                A tuple: the pass that finds the atoms; the `sharing.Agreement`; passes that follow them if some have moved on
                any rank, after which the atoms are noted anew; the pass that is done in any case; and passes that conclude it
                if some have moved, when all went well on all ranks.
        Raises:
            AttributeError: for following, if nothing is to be carried.
        """
        bridge = self._bridge
        if following:
            self._need_carried()
            first, agreement, moved, always, last = following
            following = [first, agreement, *moved, always, *last]
            bridge.moving = len(moved)
        self._passes = [each and passes(each) for each in (step, following)]
        bridge.step, bridge.neighbor = (
            each and cast(each[0], type(bridge.step)) for each in self._passes
        )
        bridge.may_wait, bridge.look_every = True, look_every

    def call_always(self):
        """Have the fix call every method of the class again."""
        self._bridge.may_wait, self._bridge.step, self._bridge.neighbor = False, None, None
        self._passes = None

    def keep_box(self):
        """Have the fix do what follows the atoms by itself as long as the box is as it is now."""
        self._keep(self._bridge.fix)

    def note(self, index=None):
        """Have LAMMPS take along with each of these atoms, wherever it moves them, where it is now.

        The class asks for it with an attribute ``follows_atoms``, true when the instance is made.

        Args:
            index: (m,) int32, contiguous: indices of atoms of this rank, places 0 to m - 1 of a list; of other
                atoms nothing is noted.  None: the atoms of the bodies that it is to ``carry``.
        Raises:
            AttributeError: if the class has not asked for it.
        """
        self._need_origins()
        if index is None:
            index = self._carried.index
        self._note(self._bridge.fix, len(index), index.ctypes.data)

    def carry(self, lammps, bodies):
        """Have LAMMPS take along, with atoms of these bodies that go to another rank, what that rank needs to know of them.

        The class asks for it with an attribute ``carries``, the number of numbers that go with an atom (see `kernels.OF_BODY`).

        Args:
            lammps: the `Lammps` whose cells ``point`` sets.  bodies: the `Bodies`; None, None for no more.
        """
        self._carried, bridge = bodies, self._bridge
        bridge.arrays = lammps and lammps.table.ctypes.data
        for name, of_bodies in (
            ("index", "index"),
            ("body_of", "body"),
            ("d", "d"),
            ("state", "state"),
        ):
            setattr(bridge, name, None if bodies is None else bodies.cells[of_bodies].address)

    def point(self, cells):
        """Point the cells of ``carry`` at LAMMPS's arrays as they are, and at the atoms' ``origins``.

        There an atom that came from another rank with what was carried has -2 minus its row in the cell ``arrived``; a row has
        the atom's origin, its column of the bodies' d, its body's column of their state.

        Raises:
            AttributeError: if nothing is to be carried.
        """
        self._need_carried()
        self._point(self._bridge.fix)

    def origins(self):
        """Where the atoms of this rank were when ``note`` was last called.

        Returns:
            (natoms,) int64, rank << 32 | place for an atom that was in that rank's list, -1 for another one:
            a view, of use until LAMMPS moves atoms.  (For atoms that came with what was carried see ``point``.)
        Raises:
            AttributeError: as ``note``.
        """
        self._need_origins()
        return array(self._bridge.origins, (self._natoms.value,), np.int64)

    def _need_carried(self):
        if not (self._bridge.carries and self._bridge.arrays):
            raise AttributeError(
                "a class that follows its atoms in passes has an attribute carries, and calls carry() before"
            )

    def _need_origins(self):
        if not self._bridge.follows_atoms:
            raise AttributeError(
                "note() and origins() are for classes with an attribute follows_atoms, true when the instance is made"
            )
