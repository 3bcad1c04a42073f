"""The bodies of a run: made of the atoms as it begins, and added and removed in it."""

from collections.abc import Callable
from functools import partial

import numpy as np

from ..bodies import infile, templates, turnover
from ..bodies.bodies import Bodies
from ..bodies.build import BuildReport, Built, Recipe, build, nothing
from ..bodies.membership import Membership, PreviousBodies
from ..bodies.shapes import ShapeCorrection
from ..errors import refuse
from ..host.hosts import Host
from ..host.lammps import Lammps
from ..ranks.communicator import Alone


class BodyMaker:
    """Makes the bodies of a fix; all methods are collective.

    Args:
        lammps, ranks, host: see `fix.Fix`.
        membership: which atom is in which body.
        path: the infile; None for none.  counts_from_one: whether it counts bodies from 1.
        own_rows: how many values of its own the integrator has for each body.
        oriented: whether atoms of this atom style can have an orientation.
    """

    def __init__(
        self,
        lammps: Lammps,
        ranks: Alone,
        host: Host,
        membership: Membership,
        path: str | None,
        counts_from_one: bool,
        own_rows: int,
        oriented: bool,
    ) -> None:
        self._lammps, self._ranks, self._host = lammps, ranks, host
        self._membership, self._path, self._own_rows = membership, path, own_rows
        self._counts, self._oriented = counts_from_one, oriented

    def shapes(self) -> np.ndarray | None:
        """Shapes and orientations of LAMMPS's atoms; see `hosts.Host.shapes`."""
        return self._host.shapes(len(self._lammps.groups)) if self._oriented else None

    def _recipe(self, find_prescribed: Callable | None = None, keeps_shapes: bool = True) -> Recipe:
        of_file = partial(infile.read, self._path, self._counts) if self._path else nothing
        return Recipe(
            self._membership,
            self.shapes(),
            self._oriented,
            find_prescribed or of_file,
            self._own_rows,
            keeps_shapes=keeps_shapes and not self._path,
        )

    def _previous(self, bodies: Bodies | None) -> PreviousBodies | None:
        return None if bodies is None else self._host.previous(bodies, self._lammps)

    def of_atoms_now(self, previous: Bodies | None) -> Bodies:
        """The bodies that a run would make of the atoms as they are now.

        Args:
            previous: those of the last run; None before the first one.
        """
        self._membership.find_groups()
        self._host.point()
        recipe = self._recipe(keeps_shapes=previous is not None)
        return build(recipe, self._previous(previous)).bodies

    def decide(self) -> None:
        """Decide which bodies atoms are in that came since the fix was defined."""
        self._membership.find_groups()
        self._host.point()
        self._host.refuse_changes(self._membership)
        self._membership.decide()

    def prepare(self, previous: Bodies | None) -> Callable[[], Built]:
        """What makes the bodies of a run, of the atoms as they are.

        The bodies of the last run may be dropped before it is called, because there may be no
        memory for both.
        """
        former = self._previous(previous)
        recipe = self._recipe(keeps_shapes=previous is not None)
        self._host.carry(self._lammps, None)
        return partial(build, recipe, former)

    def keep(self, bodies: Bodies) -> None:
        """Have LAMMPS take these bodies along with their atoms."""
        bodies.bind(self._membership)
        bodies.update_box(self._lammps.box)
        self._host.carry(self._lammps, bodies)
        self._host.point()
        bodies.note()
        self._host.noted()

    def restore_shapes(self, kept: ShapeCorrection, loose: bool) -> None:
        """Put atoms where the shape that their body keeps has them, and log it."""
        if kept.text and not loose:
            self._lammps.x[kept.atoms] += kept.shift
            self._host.log(kept.text)
        if kept.turned:
            self._host.log(
                f"{kept.turned} particles were turned with their bodies, which something has moved "
                "between the runs (an orientation that 'set' gave them there is dropped)\n"
            )

    def update(self, bodies: Bodies, report: BuildReport) -> list[str]:
        """Add and remove bodies whose atoms came or are gone in a run.

        Args:
            report: on the bodies; new ones of which more is known than their atoms are added.
        Returns:
            lines for the log.
        """
        molecules = templates.inserted(self._host, self._ranks)
        find_prescribed = partial(templates.read, molecules) if molecules else nothing
        lines, prescribed = turnover.update_bodies(bodies, self._recipe(find_prescribed))
        report.prescribed_ids = np.union1d(report.prescribed_ids, prescribed)
        return lines


def refuse_infinite(report: BuildReport) -> None:
    """End the run if velocities of atoms are too large, or not finite; all ranks know it."""
    refuse(
        not np.isfinite(report.kinetic),
        "the velocities of the bodies' atoms are too large, or no numbers: their kinetic "
        "energy is not finite. Look at what has set them (velocity, read_data)",
    )


def take_wrenches(bodies: Bodies, ids: np.ndarray, wrench: np.ndarray) -> None:
    """Give bodies the force and torque (6, n) that bodies of these IDs (n,) had before, if they are
    the same ones: commands like write_data compute no forces."""
    if np.array_equal(np.sort(ids), np.sort(bodies.id)):
        bodies.wrench[:, np.argsort(bodies.id)] = wrench[:, np.argsort(ids)]
