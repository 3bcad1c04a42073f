"""The bodies of a fix from run to run: made of the atoms as a run begins, and updated in it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..bodies import infile, templates, turnover
from ..bodies.bodies import Bodies
from ..bodies.build import BuildReport, Built, Recipe, build, nothing
from ..bodies.membership import Membership
from ..bodies.shapes import ShapeCorrection
from ..bodies.species import compare
from ..errors import refuse
from ..host.hosts import Host
from . import switches
from .masses import MassWatch
from .rotation import Rotation


@dataclass
class MadeBodies:
    """The bodies of a run.

    Attributes:
        bodies: the `Bodies`.  report: on how they were made.  masses: the `MassWatch`.
        switches: what keywords force and torque say of them.
        started: whether the integrator's rows of them have been set.
    """

    bodies: Bodies
    report: BuildReport
    masses: MassWatch
    switches: list[switches.Choice]
    started: bool = False


class BodyMaker:
    """Makes the bodies of a fix, and has them from run to run; all methods are collective.

    Args:
        host: see `fix.Fix`.
        membership: which atom is in which body.
        rotation: how the bodies rotate.
        path: the infile; None for none.  counts_from_one: whether it counts bodies from 1.
        extra_rows: how many values the integrator adds to those of each body.
        oriented: whether atoms of this atom style can have an orientation.

    Attributes:
        infile, counts_from_one: path, counts_from_one.
        rotation: see above.
        made: the `MadeBodies`; None before the first run, and if one could not begin.
        ran: whether a run has begun.
    """

    def __init__(
        self,
        host: Host,
        membership: Membership,
        rotation: Rotation,
        path: str | None,
        counts_from_one: bool,
        extra_rows: int,
        oriented: bool,
    ) -> None:
        self._host, self._membership, self.rotation = host, membership, rotation
        self._lammps, self._ranks = membership.lammps, membership.communicator
        self.infile, self.counts_from_one = path, counts_from_one
        self._extra_rows, self._oriented = extra_rows, oriented
        self.made: MadeBodies | None = None
        self.ran = False

    @property
    def keeps_bodies(self) -> bool:
        """Whether more is known of some bodies than their atoms tell."""
        return bool(self.infile or (self.made and len(self.made.report.prescribed_ids)))

    @property
    def goes_on(self) -> bool:
        """Whether the next run has the bodies of the last one."""
        return self.ran and (not self._membership.command.reinit or self.keeps_bodies)

    @property
    def last(self) -> Bodies | None:
        """The bodies of the last run, None before the first one.

        Raises:
            RunError: on all ranks, if they are gone.
        """
        refuse(
            self.made is None and self.ran and not self.infile,
            "the bodies of the last run are gone, because this one could not begin: "
            "unfix this fix and define it again",
        )
        return self.made.bodies if self.made else None

    def shapes(self) -> np.ndarray | None:
        """Shapes and orientations of LAMMPS's atoms; see `hosts.Host.shapes`."""
        return self._host.shapes(len(self._lammps.groups)) if self._oriented else None

    def _recipe(self, find_prescribed: Callable | None = None, keeps_shapes: bool = True) -> Recipe:
        read = partial(infile.read, self.infile, self.counts_from_one) if self.infile else nothing
        return Recipe(
            self._membership,
            self.shapes(),
            self._oriented,
            find_prescribed or read,
            self._extra_rows,
            keeps_shapes=keeps_shapes and not self.infile,
        )

    def build_of(self, previous: Bodies | None) -> Callable[[], Built]:
        """What builds bodies of the atoms as they are.

        Args:
            previous: the bodies of the last run, if some of their shapes are kept; else None.  They
                may be freed before it is called, because there may be no memory for both.
        """
        former = None if previous is None else self._host.previous(previous, self._lammps)
        return partial(build, self._recipe(keeps_shapes=previous is not None), former)

    def next_bodies(self) -> Bodies:
        """The bodies that a run would make of the atoms as they are now."""
        self._membership.find_groups()
        self._host.point()
        return self.build_of(self.last if self.ran else None)().bodies

    def decide(self) -> None:
        """Decide which bodies atoms are in that came since the fix was defined."""
        self._membership.find_groups()
        self._host.point()
        self._host.refuse_changes(self._membership)
        self._membership.decide()

    def make(self, free_last: Callable[[], None]) -> MadeBodies:
        """Make the bodies of a run of the atoms as they are.

        Args:
            free_last: frees the memory of the last run.
        """
        membership, last = self._membership, self.last
        ids, wrench = (last.id, last.wrench.copy()) if last else (np.empty(0), np.empty((6, 0)))
        build_bodies = self.build_of(last if self.ran else None)
        self._host.carry(self._lammps, None)
        self.made = last = None
        free_last()
        bodies, report, correction = build_bodies()
        self.rotation.choose(bodies, self._ranks, self._host)
        # a rerun is of the atoms as they are in the file, which has rounded positions
        bodies.tolerates_shifts = membership.command.reinit and "rerun" in self._host.command[:1]
        self._restore_shapes(correction, bodies.tolerates_shifts)
        if np.array_equal(np.sort(ids), np.sort(bodies.id)):
            # commands like write_data compute no forces
            bodies.wrench[:, np.argsort(bodies.id)] = wrench[:, np.argsort(ids)]
        self._have_carried(bodies)
        if correction.new:
            report.warnings += compare(bodies, membership)
        masses = MassWatch(bodies, self._lammps, self._ranks)
        chosen = switches.choices(membership.command, self._ranks, bodies)
        self.made = MadeBodies(bodies, report, masses, chosen)
        refuse(  # with the bodies there, for a run with other velocities
            not np.isfinite(report.kinetic),
            "the velocities of the bodies' atoms are too large, or no numbers: their kinetic "
            "energy is not finite. Look at what has set them (velocity, read_data)",
        )
        return self.made

    def _have_carried(self, bodies: Bodies) -> None:
        """Have LAMMPS take these bodies along with their atoms."""
        bodies.bind(self._membership)
        bodies.update_box(self._lammps.box)
        self._host.carry(self._lammps, bodies)
        self._host.point()
        bodies.note()
        self._host.noted()

    def _restore_shapes(self, correction: ShapeCorrection, loose: bool) -> None:
        """Put atoms where the shape that their body keeps has them, and log it."""
        if correction.text and not loose:
            self._lammps.x[correction.atoms] += correction.shift
            self._host.log(correction.text)
        if correction.turned:
            self._host.log(
                f"{correction.turned} particles were turned with their bodies, which something has "
                "moved between the runs (an orientation that 'set' gave them there is dropped)\n"
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
