"""Velocities of the bodies' atoms: set by the bodies' motion, and taken from what changes them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..bodies.bodies import Bodies
from ..bodies.build import BuildReport
from ..bodies.particles import particles_of
from ..box import deform
from ..host.hosts import OtherFix
from ..host.lammps import Lammps
from ..motion import step
from ..ranks.communicator import Ranks
from .other_fixes import TEMPER, Swaps

ROUNDING = 1e-9  # of a kinetic energy: the part that a projection on rigid motion may take


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
        ranks: Ranks,
        report: BuildReport | None = None,
        shapes: Callable[[], np.ndarray | None] = lambda: None,
        remaps: bool = False,
    ) -> None:
        self._bodies, self._lammps, self._ranks = bodies, lammps, ranks
        self._report, self._shapes, self._remaps = report, shapes, remaps

    def set_in_body(self) -> None:
        """Give the atoms the velocities of their body, in whatever image of it an atom is."""
        # before a first run no cell points to LAMMPS's velocities
        step.set_velocities.bind_to(self._bodies.cells, atom_v=self._lammps.v)()

    def were_changed(self, remapped: bool) -> bool:
        """Whether atoms have other velocities than the bodies give them; collective.

        Args:
            remapped: whether velocities are those of the images in which atoms are.
        """
        bodies, v = self._bodies, self._lammps.v
        expected = np.empty_like(v)
        step.set_velocities.bind_to(bodies.cells, atom_v=expected)()
        if self._remaps and remapped:
            deform.add_image_velocities.bind_to(bodies.cells, atom_v=expected, sign=1.0)()
        return self._ranks.any((v != expected)[bodies.index].any())

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


def report_of_changes(
    at: int, due: list[OtherFix | Swaps], before: float, now: float, excepted: str
) -> str:
    """A line for the log: bodies took over the velocities that these fixes gave atoms.

    Args:
        before, now: the kinetic energy of the atoms, and of the bodies afterwards.
        excepted: which bodies do not, in parentheses.
    """
    names = " or ".join(fix.id for fix in due)
    names = names if due[0].id == TEMPER else f"fix {names}"
    lost = f"; {before - now:.4g} of the kinetic energy {before:.8g} was none, and is lost"
    lost = lost if is_projected(before - now, before) else ""
    return (
        f"The velocities of the bodies' atoms were changed at the end of step {at} (by "
        f"{names}): the bodies take them over, as rigid motion{excepted}{lost}\n"
    )
