"""Velocities of the bodies' atoms: set by the bodies' motion, and taken from what changes them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..bodies.bodies import Bodies
from ..bodies.build import BuildReport
from ..bodies.particles import particles_of
from ..box import deform
from ..errors import refuse
from ..host.hosts import OtherFix
from ..host.lammps import Lammps
from ..motion import step
from ..ranks.communicator import Alone
from .other_fixes import TEMPER, Swaps

ROUNDING = 1e-9  # of a kinetic energy: the part that a projection on rigid motion may take
# of what a thermostat adds to velocities: the part that is not rigid motion, above which it is
# examined; and the squared cosine between it and the velocities, below which it is not a factor
# (1 for a factor, 1/2 for velocities that are drawn anew)
_LEAST_SHARE, _ALONG = 0.05, 0.75


def is_projected(removed: float, kinetic: float) -> bool:
    """Whether more of this kinetic energy was removed, to have rigid motion, than by rounding."""
    return removed > ROUNDING * kinetic


class AtomVelocities:
    """The velocities of bodies' atoms.

    Args:
        bodies, lammps: whose atoms these are.  ranks: the `Communicator` or `ALONE`.
        report: on the bodies, with those of which more is known than their atoms; None for `set`.
        shapes: gives the shapes of LAMMPS's atoms, see `hosts.Host.shapes`.
        remaps: whether they change where atoms cross a face, as with remap v of fix deform.
    """

    def __init__(
        self,
        bodies: Bodies,
        lammps: Lammps,
        ranks: Alone,
        report: BuildReport | None = None,
        shapes: Callable[[], np.ndarray | None] = lambda: None,
        remaps: bool = False,
    ) -> None:
        self._bodies, self._lammps, self._ranks = bodies, lammps, ranks
        self._report, self._shapes, self._remaps = report, shapes, remaps

    def set_in_body(self) -> None:
        """Give the atoms the velocities of their body, in whatever image of it an atom is."""
        atom_v = self._lammps.v  # before a first run no cell points there
        step.set_velocities.bind_to(self._bodies.cells, atom_v=atom_v)()

    def added(self, remapped: bool = True) -> np.ndarray | None:
        """What others have added to the velocities that the bodies give their atoms, (m, 3); None
        if that is zero on all ranks; collective.

        Args:
            remapped: whether velocities are those of the images in which atoms are.
        """
        bodies, v = self._bodies, self._lammps.v
        expected = np.empty_like(v)
        step.set_velocities.bind_to(bodies.cells, atom_v=expected)()
        if self._remaps and remapped:
            deform.add_image_velocities.bind_to(bodies.cells, atom_v=expected, sign=1.0)()
        added = v[bodies.index] - expected[bodies.index]
        return added if self._ranks.any(added.any()) else None

    def take(self) -> np.ndarray:
        """Have the bodies move as their atoms do, except those of which more is known; collective.

        Returns:
            (2,) the kinetic energy of this rank's atoms before and of its bodies now, without those
            of which more is known.
        """
        bodies, lammps, particles = self._bodies, self._lammps, None
        prescribed = np.isin(bodies.id, self._report.prescribed_ids if self._report else ())
        before = bodies.kinetic_of_atoms(lammps)
        if bodies.spin:
            particles = particles_of(lammps, self._shapes(), bodies.index)
            before = before + particles.kinetic()
        bodies.take_velocities(lammps, particles, prescribed, bodies.momenta()[:, prescribed])
        after = bodies.kinetic()[:, bodies.sharers.owned & ~prescribed]
        return np.array([before[~prescribed[bodies.body]].sum(), after.sum()])

    def take_late(self) -> np.ndarray:
        """As `take`, in a run; returns the sums over all ranks, in LAMMPS's units."""
        if self._remaps:
            atom_v = self._lammps.v
            deform.add_image_velocities.bind_to(self._bodies.cells, atom_v=atom_v, sign=-1.0)()
        return self._lammps.mvv2e * self._ranks.total(self.take())

    def share_of_noise(self, added: np.ndarray, lost: float) -> float:
        """The part of what was added to the velocities, (m, 3), that is not rigid motion, as an
        energy; 0 if it is little, or if they were multiplied by a factor; collective.

        What factors lose, for example on some atoms of a body, is of second order in the time step;
        noise loses as much as it adds.

        Args:
            lost: the kinetic energy of `added` that is not rigid motion.
        """
        index = self._bodies.index
        mass, v = self._lammps.masses[index, None], self._lammps.v[index] - added
        sums = [(mass * part).sum() for part in (v * added, added**2, v**2 * (added != 0))]
        along, square, of_changed = self._ranks.total(np.array(sums))
        share = 2.0 * lost / (self._lammps.mvv2e * square)
        is_noise = share > _LEAST_SHARE and along**2 < _ALONG * square * of_changed
        return share if is_noise else 0.0


@dataclass
class LostEnergy:
    """Kinetic energy that other fixes gave in a run and that was not rigid motion.

    Attributes:
        total: its sum.  least: the sum up to which it is rounding.  logged: whether the log has
            said that bodies take velocities over.
    """

    total: float = 0.0
    least: float = 0.0
    logged: bool = False

    def report(self) -> str:
        """A line for the log at the end of a run; empty if nothing was lost."""
        if not self.total > self.least:
            return ""
        return (
            f"In this run {self.total:.6g} of the kinetic energy that other fixes "
            "gave was no rigid motion, and is lost\n"
        )


def take_changes(
    due: list[OtherFix | Swaps], velocities: AtomVelocities, remapped: bool
) -> tuple[float, float] | None:
    """Have the bodies take over velocities that these fixes may have changed; collective.

    Args:
        due: the fixes that have acted at the end of the step.
        remapped: see `AtomVelocities.added`.
    Returns:
        the kinetic energy of the atoms before and of the bodies now; None if nothing was changed.
    Raises:
        RunError: for a thermostat that counts its heat and gives each atom a velocity of its own.
    """
    added = velocities.added(remapped) if due else None
    if added is None:
        return None
    before, now = velocities.take_late()
    counting = [fix for fix in due if fix.counts_heat]
    if counting and is_projected(before - now, before):
        # one that scales velocities has counted its heat to first order
        share = velocities.share_of_noise(added, before - now)
        refuse(
            share,
            f"fix {counting[0].id} (style {counting[0].style}) gives each atom of the rigid bodies "
            f"a velocity of its own, and {share:.2g} of that is no rigid motion, but counts as "
            "heat: the bodies would be too cold. Use a thermostat of this package (fix "
            "nosquish/nvt, nosquish/npt), fix langevin, or one that scales velocities, such as "
            "temp/csvr",
        )
    return before, now


def report_of_changes(
    at: int, due: list[OtherFix | Swaps], energies: tuple[float, float], excepted: str
) -> str:
    """A line for the log: bodies took over the velocities that these fixes gave atoms.

    Args:
        energies: see `take_changes`.  excepted: which bodies do not, in parentheses.
    """
    before, now = energies
    names = " or ".join(fix.id for fix in due)
    names = names if due[0].id == TEMPER else f"fix {names}"
    lost = f"; {before - now:.4g} of the kinetic energy {before:.8g} was none, and is lost"
    lost = lost if is_projected(before - now, before) else ""
    return (
        f"The velocities of the bodies' atoms were changed at the end of step {at} (by "
        f"{names}): the bodies take them over, as rigid motion{excepted}{lost}\n"
    )
