"""What a class can ask of the fix that drives it."""

from typing import NamedTuple


class OtherFix(NamedTuple):
    """A fix of the same simulation."""

    id: str
    style: str
    groupbit: int
    time_integrate: bool  # it moves the atoms of its group
    between: bool  # it is called between initial_integrate and final_integrate
    end_of_step: bool  # it is called at the end of every nevery-th step
    nevery: int


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

    def log(self, text):
        """Print text on LAMMPS's screen and in its log file; ranks other than 0 print nothing."""
        self._bridge.log(self._bridge.fix, text.encode())

    def fixes(self):
        """List all other fixes, as OtherFix, in the order in which LAMMPS calls them."""
        return [OtherFix(*facts) for facts in self._bridge.other_fixes()]

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
