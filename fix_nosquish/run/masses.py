"""The masses of the bodies' atoms: a change in a run ends it."""

import numpy as np

from ..bodies.bodies import Bodies
from ..errors import refuse
from ..host.lammps import Lammps
from ..ranks.communicator import Ranks
from .other_fixes import OtherFixes

_ROUNDING = 1e-9  # of a total mass
PHI = 0.5 * (5**0.5 - 1)  # multiples of it are spread over [0, 1)
# fixes that change types of atoms, and so perhaps their masses
_OF_TYPES = "set", "atom/swap", "atom_swap", "bond/react", "sgcmc", "mol/swap"


class MassWatch:
    """The masses of the bodies' atoms, which bodies keep.

    Masses, and the positions of atoms, are compared at the end of each run that has other fixes, so
    none of these changes them unseen.  Where another fix may change masses they are also compared
    each time atoms are followed after a re-neighboring.  Positions are also compared where a step
    begins after a fix that has acted at the end of the last one (`Run.take_late_velocities`).

    Args:
        bodies, lammps: whose atoms these are.  ranks: the `Communicator` or `ALONE`.
    """

    def __init__(self, bodies: Bodies, lammps: Lammps, ranks: Ranks) -> None:
        self._bodies, self._lammps, self._ranks = bodies, lammps, ranks
        self.note()

    def note(self) -> None:
        """Atoms have the masses of now, whatever they were before; collective."""
        self._mass = self._sums()

    def refuse_change(self) -> None:
        """End the run if the bodies' atoms have other masses than noted; collective.

        Raises:
            RunError: on all ranks.
        """
        now, before = self._sums(), self._mass
        refuse(
            (abs(now - before) > _ROUNDING * before).any(),
            f"atoms of the bodies have other masses by step {self._lammps.step} than when the run "
            f"began ({now[0]:.9g} in all, and {before[0]:.9g}): bodies keep their masses in a "
            "run. Change masses and types of atoms between runs (fix adapt, fix set and fix "
            "atom/swap do so in one)",
        )

    def _sums(self) -> np.ndarray:
        """The mass of all bodies' atoms, and with a weight for each, so that no two swap masses
        unseen, (2,); collective."""
        mass = self._lammps.masses[self._bodies.index]
        weighted = mass @ (1 + self._bodies.tag * PHI % 1)
        return self._ranks.total(np.array([mass.sum(), weighted]))


def masses_may_change(fixes: OtherFixes, lammps: Lammps) -> bool:
    """Whether another fix is one of those that change masses or types of atoms."""
    adapts = ("adapt",) if lammps.setting("rmass_flag") > 0 else ()
    return any(fix.style.startswith(_OF_TYPES + adapts) for fix in fixes)
