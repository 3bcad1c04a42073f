"""What a class can ask of the fix that drives it."""

from typing import NamedTuple


class OtherFix(NamedTuple):
    """A fix of the same simulation."""

    id: str
    style: str
    groupbit: int
    time_integrate: bool  # it moves the atoms of its group
    between: bool  # it is called between initial_integrate and final_integrate


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

    @property
    def box_change(self):
        """Whether some fix changes the box; known from the start of a run, in ``init``."""
        return bool(self._bridge.box_change(self._bridge.fix))
