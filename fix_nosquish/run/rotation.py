"""How the free rotation is computed: exactly, or split into rotations about one axis each."""

from collections.abc import Mapping

from ..bodies.bodies import Bodies
from ..host.command import Command
from ..host.hosts import Host
from ..motion.operations import EXACT
from ..motion.step import Operation
from ..ranks.communicator import Ranks


class Rotation:
    """The rotation of a fix's bodies; the first bodies that rotate decide, and later ones follow.

    Args:
        command: the fix line.
        operations: of the integrator.  splits: whether it can split the rotation.
    Raises:
        RunError: if the words ask for a rotation that the integrator does not have.
    Attributes:
        exact: whether the rotation is exact.
    """

    def __init__(self, command: Command, operations: Mapping[str, Operation], splits: bool) -> None:
        self._command, self._splits = command, splits
        self._can_be_exact = any(operation.exact for operation in operations.values())
        self.exact = self._chosen = False
        name = command.line.name
        if command.rotor == "split" and not splits:
            raise command.wrong(
                "keywords mrot and order, and rotor split, are for integrators that split the "
                f"rotation, which {name} does not"
            )
        if command.rotor == "exact" and not self._can_be_exact:
            raise command.wrong(
                f"keyword rotor exact is for the rotation of fix nosquish/nve, not that of {name}"
            )

    def choose(self, bodies: Bodies, ranks: Ranks, host: Host) -> None:
        """Choose whether the rotation is exact; collective.

        A restart file keeps a choice that is not the default of the bodies which there are
        (host.rotor).
        """
        default = self._default(bodies, ranks)
        if not self._chosen:
            restarted = host.rotor >= 0 and self._depends_on(bodies)
            self.exact = bool(host.rotor) if restarted else default
            self._chosen = ranks.any(bodies.rotors > 0)
        host.rotor = -1 if self.exact == default else int(self.exact)

    def _depends_on(self, bodies: Bodies) -> bool:
        """Whether neither the words nor the class say how the rotation is computed."""
        return self._can_be_exact and self._splits and not (self._command.rotor or bodies.planar)

    def _default(self, bodies: Bodies, ranks: Ranks) -> bool:
        """Whether the rotation is exact for these bodies; collective.

        By default that of symmetric tops is, whose axes may be chosen in more than one way.
        """
        rotor = self._command.rotor
        if not self._depends_on(bodies):
            always = self._can_be_exact and not (self._splits or bodies.planar)
            return rotor == "exact" or (always and not rotor)
        moment = bodies.moment[:, : bodies.rotors]
        equal = (moment[0] == moment[1]) | (moment[1] == moment[2])
        return not ranks.any(not equal.all())

    @property
    def inner_steps(self) -> int:
        """The parameter mrot of operations: inner rotor steps, or `EXACT`."""
        return EXACT if self.exact else self._command.mrot
