"""What a class can ask of the fix that drives it."""

from ctypes import c_int, cast
from typing import NamedTuple

import numpy as np

from ..atoms import array


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
        self._note, self._keep = bridge.note, bridge.keep  # ctypes makes a function at each access

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
        self._bridge.body, self._bridge.masstotal = (None if array is None else array.ctypes.data for array in (body, mass))

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

    def go_alone(self, look_every, step, neighbor):
        """Have the fix leave out calls of this class from now on, until ``call_always``.

        final_integrate is not called on steps without output, virial and multiples of look_every (0: of none); the fix then
        is ``waiting``, and the next initial_integrate has to do both.

        Args:
            step: passes that the fix does instead of such an initial_integrate, or None; each a loop that is bound (see
                `compiled.Loop.bind`), which returns 0 if all is well (if not, the class is called), or an exchange (see
                `sharing.Sharers.passes`).
            neighbor: the same instead of post_neighbor, as long as LAMMPS's arrays and box stay as they are, or None.
        """
        from .bridge import passes

        bridge, self._passes = self._bridge, [each and passes(each) for each in (step, neighbor)]
        bridge.step, bridge.neighbor = (each and cast(each[0], type(bridge.step)) for each in self._passes)
        self._keep(bridge.fix)
        bridge.may_wait, bridge.look_every = True, look_every

    def call_always(self):
        """Have the fix call every method of the class again."""
        self._bridge.may_wait, self._bridge.step, self._bridge.neighbor = False, None, None
        self._passes = None

    def note(self, index):
        """Have LAMMPS take along with each of these atoms, wherever it moves them, where it is now.

        The class asks for it with an attribute ``follows_atoms``, true when the instance is made.

        Args:
            index: (m,) int32, contiguous: indices of atoms of this rank, places 0 to m - 1 of a list; of other
                atoms nothing is noted.
        Raises:
            AttributeError: if the class has not asked for it.
        """
        self._need_origins()
        self._note(self._bridge.fix, len(index), index.ctypes.data)

    def origins(self):
        """Where the atoms of this rank were when ``note`` was last called.

        Returns:
            (natoms,) int64, rank << 32 | place for an atom that was in that rank's list, -1 for another one:
            a view, of use until LAMMPS moves atoms.
        Raises:
            AttributeError: as ``note``.
        """
        self._need_origins()
        return array(self._bridge.origins, (self._natoms.value,), np.int64)

    def _need_origins(self):
        if not self._bridge.follows_atoms:
            raise AttributeError("note() and origins() are for classes with an attribute follows_atoms, true when the instance is made")
