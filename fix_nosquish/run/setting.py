"""What a fix has for all of its runs."""

from dataclasses import dataclass
from typing import Any

from ..bodies.membership import Membership
from ..host.command import Command
from ..host.hosts import Host
from ..host.lammps import Lammps
from ..ranks.communicator import Ranks
from .external import ExternalForces
from .integrator import Integrator
from .log import FixLog
from .making import BodyMaker
from .output import BodyFile


@dataclass
class Setting:
    """What a fix has for all of its runs.

    Attributes:
        lammps, ranks, host: LAMMPS, its `Communicator` or `ALONE`, and what calls the fix.
        command: the words of the fix line.
        integrator: what declares the step.
        membership: which atom is in which body.
        maker: makes the bodies, and has them from run to run.
        external: external forces on them.
        log: the lines that the log has.
        number: of the fix, see `registry.Registered`.
        rigid_flag: whether pair styles may ask for the bodies' masses, as those of grains do.
        table: the file of keyword output, None as long as there is none.
        parameters: the record of the integrator's parameters, of the last run that could begin;
            None before it.
        pending_half_kick: with `mid_step`, the time step of the half kick that is left to the next
            run's first step: 0.0 for none, None if it is that of this step.
    """

    lammps: Lammps
    ranks: Ranks
    host: Host
    command: Command
    integrator: Integrator
    membership: Membership
    maker: BodyMaker
    external: ExternalForces
    log: FixLog
    number: int
    rigid_flag: bool
    table: BodyFile | None = None
    parameters: Any = None
    pending_half_kick: float | None = None

    @property
    def box_every(self) -> int:
        """`Part.box_every` of the part that changes the box; 0 if none does."""
        return max((part.box_every for part in self.integrator.parts), default=0)

    @property
    def needs_energy(self) -> bool:
        """Whether one of the integrator's parts has `Part.needs_energy`."""
        return any(part.needs_energy for part in self.integrator.parts)
