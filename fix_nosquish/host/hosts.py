"""What the two hosts of a fix, this package's plugin and LAMMPS's own fix python/move, have in
common."""

from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from ..structs import OtherFix


class Phase(IntEnum):
    """Progress of the bodies within a run."""

    NEW = 0  # a run begins: its first forces are not known yet
    SET = 1  # a step is complete
    HALF = 2  # a step has begun; its forces are not known yet
    WAITING = 3  # its forces are known, and its end is done in the next step
    OVER = 4  # the run is over: only the input script changes velocities now


class Host:
    """LAMMPS's fix, as Python sees it. The defaults are for a LAMMPS that does not provide the
    facts.

    Attributes:
        fix_id, group: IDs of the fix and of its group; None if not known.
        world: number of the partition's world (lmp -partition), 0 for the first one.
        phase: a `Phase`.
        facts: the bits of `When` that hold for longer than a step.
        vflag: which virial LAMMPS requests in this step; 0 for none.
        changes: a number that changes when bodies change without a call of Python.
        dmax: the setting of command min_modify in a minimization, 0.0 in a run.
        min_dof: number of the bodies' coordinates in a minimization.
        ghost_velocity: whether ghost atoms carry velocities (``comm_modify vel yes``).
        scalar_pressure: whether only the mean over the axes of the long-range pressure is known,
            as with kspace_style msm.
        next_output: the next step in which LAMMPS writes output; None if not known.
        begins: the next step that Python begins, by its method `begin_trajectory`; -1 for none.
        energy_step: the next step at whose end Python needs the potential energy; -1 for none.
        last_step: the last step of the run.
        span: (1,) int64 each, first and last step of the run; None if not known.
        box_every: the box changes in the steps after multiples of this number, 0 for never.
        held: bit of the group whose atoms move with the box, if a fix shake or rattle constrains
            some of them; else 0.
        counts: whether the cell `counted_f` gets the forces before those of fixes in steps that
            tally the pressure; the virial then excludes the forces of shake and rattle.
        find_clusters: (2,) address of a function that fills the cell `clusters` for these atoms,
            and its argument; set_box calls it before it changes the box.  None without function.
        orient_atom: (2,) int64, address of a function that sets an atom's orientation, and its
            first argument; the others are the atom's index and the address of a quaternion.
            None without function.
        deformed_box: (9,) input of the passes `deform` and `flipped`; None where LAMMPS does not
            call them.
        rate: (6,) rates of change of the box vectors' components by fix deform, xx yy zz yz xz xy.
        remap_group: bit of the group whose velocities change at periodic faces by these rates, as
            with its remap v; 0 for none.
        pushes: whether the method `push` is called when the forces of a step are known.
        external_sums: (7,) energy of external forces and their virial on this rank (xx yy zz xy xz
            yz), for LAMMPS; None where LAMMPS does not read them.
        rotor: whether the rotation is exact (1) or split (0), where the present bodies would
            choose otherwise, else -1; stored in restart files.
    """

    fix_id: str | None
    group: str | None
    world: int
    phase: int
    facts: int
    vflag: int
    changes: int
    dmax: float
    min_dof: int
    ghost_velocity: bool
    scalar_pressure: bool
    next_output: int | None
    begins: int
    energy_step: int
    last_step: int
    span: tuple | None
    box_every: int
    held: int
    counts: int
    forces_virial: np.ndarray | None
    set_box: np.ndarray | None
    flip_box: np.ndarray | None
    find_clusters: np.ndarray | None
    deformed_box: np.ndarray | None
    rate: np.ndarray | None
    remap_group: int
    orient_atom: np.ndarray | None
    pushes: int
    external_sums: np.ndarray | None
    rotor: int

    def need(self, feature: str) -> None:
        """Raise an error if this host lacks a feature, a key of `own_fix.MISSING`."""

    def previous(self, bodies: Any, lammps: Any) -> Any:
        """Each atom's role in the bodies of the last run: see `Bodies.as_previous`."""
        return bodies.as_previous(lammps)

    def refuse_changes(self, membership: Any) -> None:
        """Raise an error if atoms were added, lost or renumbered and LAMMPS did not report it;
        collective.

        Args:
            membership: the `Membership` that was determined when the fix was defined.
        """

    @property
    def command(self) -> Sequence[str]:
        """The words of LAMMPS's last command; () if not known."""
        return ()

    @property
    def energy(self) -> float:
        """The potential energy of the last forces, the same on all ranks; valid at the start and at
        the end of a step."""
        raise NotImplementedError

    def log(self, text: str) -> None:
        """Print lines on LAMMPS's screen and in its log; collective."""

    def fixes(self) -> list[OtherFix] | None:
        """All other fixes, in the order in which LAMMPS calls them; None if not known."""

    def shapes(self, natoms: int) -> np.ndarray | None:
        """Shape and orientation of each of LAMMPS's atoms on this rank.

        Returns:
            (natoms, 7) three numbers and a quaternion: principal moments of an ellipsoid or a
            triangle; length of a line, 0, 0; 0 for others.  None if not known.
        """

    def inserted(self) -> np.ndarray:
        """The molecules that other fixes have inserted as rigid bodies since the last call.

        Returns:
            (k, 10) for each: highest atom ID before it, number of its atoms on this rank, index of
            the molecule in the template, velocity, and orientation as a quaternion.
        """
        return np.empty((0, 10))

    @property
    def kept_bodies(self) -> np.ndarray:
        """The bodies in the restart file, (n, 3); see `Membership.define`."""
        return np.empty((0, 3))

    def keep_bodies(self, rows: np.ndarray | None) -> None:
        """Write these rows of rank 0, as of `kept_bodies`, to the restart file."""

    def molecule(self, number: int) -> np.ndarray | None:
        """Properties of a molecule of the template, (13,): geometric centre, mass, centre of mass
        and inertia tensor (xx yy zz yz xz xy), NaN where not known; None if nothing is known."""

    def removed_freedom(self, fix_id: str, group: str) -> int:
        """Degrees of freedom that another fix removes from a group of atoms; collective."""
        return 0

    def moved_by(self, fix_id: str, x: np.ndarray) -> np.ndarray:
        """Which atoms another fix would move at the start of a step if all of them were elsewhere,
        (n,) bool; collective.  It is tried on x, LAMMPS's positions (n, 3), which are then
        restored."""
        return np.zeros(len(x), bool)

    def pair_style(self, first: str) -> bool:
        """Whether a pair style whose name begins with this is used, also in a hybrid."""
        return False

    def gravity(self, fix_id: str) -> np.ndarray | None:
        """The current acceleration by another fix, (3,); None if it gives none."""

    def ask_for(self, words: Sequence[str], *, energy: bool, virial: bool) -> None:
        """Have LAMMPS evaluate these words, v_NAME, when it calls `push`, and include the energy
        and the virial of external forces."""

    def values(self) -> list[np.ndarray]:
        """The current values of the words of `ask_for`, in this order: arrays (n,) or ()."""
        return []

    def advice(self, removed: int) -> Sequence[str]:
        """Lines for the log: what to add to the input so that temp and press are right."""
        return ()

    def cut_cluster(self) -> int:
        """The ID of an atom of `held` on this rank that is constrained together with atoms outside
        that group, 0 if there is none; collective."""
        return 0

    def set_bodies(self, body: np.ndarray | None, mass: np.ndarray | None) -> None:
        """Lend LAMMPS the body of each atom and the mass of each body; None, None ends the loan."""

    def lend_array(self, rows: np.ndarray) -> None:
        """Lend LAMMPS the rows that ``compute_array`` returns, valid until the bodies change."""

    def set_array_rows(self, n: int) -> None:
        """Set the number of rows that ``compute_array`` returns."""

    def carry(self, lammps: Any, bodies: Any) -> None:
        """Have LAMMPS migrate the data of these bodies with their atoms; None, None ends this."""

    def point(self) -> None:
        """Point the cells of `lammps.Lammps` at LAMMPS's current arrays; collective."""

    def noted(self) -> None:
        """Note that the cell of origins is up to date with the present atoms."""

    def now(self) -> int:
        """The facts about this step, bits of `When`."""
        raise NotImplementedError

    def set_schedule(
        self, lists: dict | None, *, velocities_every: int = 0, table_every: int = 0
    ) -> None:
        """Follow the schedule from now on, with these lists of passes.

        Args:
            lists: see `passes`; None before the run has lists.
            velocities_every, table_every: interval, in steps, at whose ends something may read the
                atoms' velocities, or Python writes a table; 0 for never.
        """

    def go_back(self) -> None:
        """Move the bodies' atoms by the displacements stored in place of their velocities, and
        compute the forces there; collective."""
