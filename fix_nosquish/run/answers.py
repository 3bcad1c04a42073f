"""What LAMMPS and its users ask of the bodies, at any time from the first run on."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from ..bodies import extended
from ..host import rigid_fixes
from ..host.command import Command
from ..host.hosts import Host, hook
from ..host.lammps import Lammps
from ..motion.block import ROWS
from ..ranks import migration
from ..ranks.communicator import Alone, Communicator
from . import output
from . import velocities as velocities_of
from .external import External
from .reports import Reports
from .switches import Switches

if TYPE_CHECKING:
    from .integrator import Integrator


class Answers:
    """What LAMMPS asks an `integrator.Integrator`, by hooks and when its fix is made."""

    command: Command
    lammps: Lammps
    communicator: Communicator | Alone
    host: Host
    reports: Reports
    external: External
    switches: Switches
    rows: int
    kept: int
    oriented: bool

    @property
    def carries(self) -> int:
        """How many numbers go with an atom to another rank."""
        of_body = ROWS + self.rows + self.kept + 3 * bool(self.command.moments)
        return migration.OF_BODY + of_body + (extended.ROWS if self.oriented else extended.ORIENT)

    @property
    def story(self) -> str | None:
        """Lines for the log, if it takes the place of one of LAMMPS's rigid fixes; else None."""
        return rigid_fixes.story(cast(str, self.host.fix_id), self.command)  # native: it has one

    vector_extensive: tuple[bool, ...] = True, True, False, False
    array_columns = 15

    @hook
    def dof(self, group: int) -> int:
        """Degrees of freedom that the bodies take from LAMMPS's group of this number;
        collective."""
        return self.reports.removed_freedom(group)

    @hook
    def compute_scalar(self) -> float:
        """Temperature of the bodies; collective.

        It is of all components, whether force and torque act on them or not; in the place of a fix
        rigid of those that these act on, as there.
        """
        if self.command.line.replaces and (self.command.force or self.command.torque):
            return self.reports.temperature_of(
                lambda bodies: cast(np.ndarray, self.switches.mask(bodies))  # not all acts
            )
        return self.reports.energies().temperature

    @hook
    def compute_vector(self, i: int) -> float:
        """Kinetic energy of translation and of rotation, temperature of each, and behind them the
        integrator's own; collective."""
        own = i - len(Answers.vector_extensive)
        return self.reports.energies()[i] if own < 0 else self.own_values()[own]

    def own_values(self) -> Sequence[float]:
        """Values of f_ID[i] behind those of all integrators, of which `vector_extensive` says
        whether each counts the bodies; collective."""
        return ()

    @hook
    def compute_array(self, i: int, j: int) -> float:
        """Value j of body i: see `output.global_array`; collective."""
        rows = self.reports.array()
        self.host.lend_array(rows)
        return rows[i, j]

    @hook
    def rows_of_rank(self, words: str, groupbit: int) -> tuple[int, int]:
        """What compute rigid/local says of the bodies: see `output.rows_of_rank`; collective.

        Args:
            words: the values, with a space between.  groupbit: of the compute's group.
        Returns:
            the address of the rows, which stay until the next call, and how many there are.
        """
        bodies = self.reports.made()
        self._rows = output.rows_of_rank(
            bodies, self.lammps, self.communicator, words.split(), groupbit
        )
        return self._rows.ctypes.data, len(self._rows)

    @hook
    def zero_momentum(self) -> None:
        """Stop the bodies' translation, between runs; collective."""
        velocities_of.zero(cast("Integrator", self), "v")

    @hook
    def zero_rotation(self) -> None:
        """Stop the bodies' rotation, between runs; collective."""
        velocities_of.zero(cast("Integrator", self), "p")

    @hook
    def write_restart_file(self, name: str) -> None:
        """LAMMPS writes a restart file: keep bodies of which more is known than their atoms beside
        it; collective."""
        self.reports.write_restart_file(name)

    def table(self) -> np.ndarray:
        """The bodies that are counted on this rank as they are now: see `output.table`."""
        return self.reports.table()

    @hook
    def modify_external(self, words: str) -> None:
        """The words of fix_modify behind external."""
        self.external.read(words)
