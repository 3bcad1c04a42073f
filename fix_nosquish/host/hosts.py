"""The two hosts of a fix, this package's plugin and LAMMPS's own fix python/move: what they have in
common."""

from collections.abc import Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from ..structs import OtherFix


class Phase(IntEnum):
    """Where in a run the bodies are."""

    NEW = 0  # a run begins: its first forces are not known
    SET = 1  # a step is done
    HALF = 2  # a step has begun, and its forces are not known
    WAITING = 3  # its forces are known, and its end is left to the next step
    OVER = 4  # the run is over: what changes velocities now is a script


class Host:
    """LAMMPS's fix, as Python sees it; answers here are those of a LAMMPS that does not tell.

    Attributes:
        fix_id, group: the fix's ID and its group; None if that is not known.
        world: a number for the world of a partition (lmp -partition), 0 for the first one.
        phase: a `Phase`.
        facts: the bits of `When` that hold for longer than a step.
        vflag: what virial LAMMPS asks for in this step; 0 for none.
        changes: a number that changes when bodies do without Python.
        dmax: that of command min_modify in a minimization, 0.0 in a run.
        min_dof: how many coordinates of the bodies a minimization has.
        ghost_velocity: whether ghost atoms carry velocities (``comm_modify vel yes``).
        scalar_pressure: whether of the long-range forces only the mean pressure of all axes is
            known, as with kspace_style msm.
        next_output: the next step for which LAMMPS writes something; None if that is not known.
        begins: the next step that Python begins, by its method `begin_trajectory`; -1 for none.
        energy_step: the next step at whose end Python needs the potential energy; -1 for none.
        last_step: the last step of the run.
        span: (1,) int64 each, the steps at which the run begins and ends; None if not known.
        changes_box: in the steps after the multiples of this the box changes, 0 for never.
        held: the bit of the group whose atoms move with the box, if a fix shake or rattle holds
            some of them; else 0.
        counts: whether the cell `counted_f` is filled in steps that tally the pressure, with the
            forces before those of fixes; what shake and rattle do is then left out of the virial.
        find_clusters: (2,) address of a function that fills the cell `clusters` of these atoms, and
            its argument; set_box does so before it changes the box.  None where LAMMPS has none.
        orient_atom: (2,) int64, the address of a function that gives an atom an orientation, and
            its first argument; those behind are the atom's index and the address of a quaternion.
            None where LAMMPS has none.
        deformed_box: (9,) what the passes `deform` and `flipped` take; None where LAMMPS does not
            call them.
        rate: (6,) how fast the box vectors' components change by fix deform, xx yy zz yz xz xy.
        remap_group: the bit of the group whose velocities change at periodic faces by these rates,
            as with its remap v; 0 for none.
        pushes: whether the method `push` is to be called when the forces of a step are known.
        told: (7,) the energy of external forces, and their virial on this rank (xx yy zz xy xz
            yz), for LAMMPS; None where LAMMPS does not take them.
        rotor: whether the rotation is exact (1) or split (0) where the bodies that there are would
            choose otherwise, else -1; restart files keep it.
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
    changes_box: int
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
    told: np.ndarray | None
    rotor: int

    def need(self, feature: str) -> None:
        """Raise an error if this host lacks a feature: a key of `own_fix.MISSING`."""

    def previous(self, bodies: Any, lammps: Any) -> Any:
        """What each of LAMMPS's atoms was in bodies of the last run: see `Bodies.as_previous`."""
        return bodies.as_previous(lammps)

    def refuse_changes(self, membership: Any) -> None:
        """Raise an error if atoms came, left or got other IDs and LAMMPS did not tell; collective.

        Args:
            membership: the `Membership` that was decided when the fix was defined.
        """

    @property
    def command(self) -> Sequence[str]:
        """The words of LAMMPS's last command; none where they are not known."""
        return ()

    @property
    def energy(self) -> float:
        """The potential energy of the last forces, the same on all ranks, as a step begins or at
        the end of that one."""
        raise NotImplementedError

    def log(self, text: str) -> None:
        """Print lines on LAMMPS's screen and in its log; collective."""

    def fixes(self) -> list[OtherFix] | None:
        """All other fixes, in the order in which LAMMPS calls them; None if they are not known."""

    def shapes(self, natoms: int) -> np.ndarray | None:
        """Shape and orientation of each of LAMMPS's atoms on this rank.

        Returns:
            (natoms, 7) three numbers and a quaternion: principal moments of an ellipsoid or a
            triangle; length of a line, 0, 0; 0 for others. None where they cannot be known.
        """

    def inserted(self) -> np.ndarray:
        """The molecules that other fixes have inserted as rigid bodies since this was last asked.

        Returns:
            (k, 10) of each the highest ID of an atom before it, how many atoms it got on this rank,
            which of the template's molecules it is, its velocity, and how it was turned: a
            quaternion.
        """
        return np.empty((0, 10))

    @property
    def kept_bodies(self) -> np.ndarray:
        """What a restart file has of the bodies, (n, 3); see `Membership.define`."""
        return np.empty((0, 3))

    def keep_bodies(self, rows: np.ndarray | None) -> None:
        """Have these rows of rank 0, as of `kept_bodies`, in the restart file that is written."""

    def molecule(self, number: int) -> np.ndarray | None:
        """A molecule of the template: its geometric centre, mass, centre of mass and tensor of
        inertia (xx yy zz yz xz xy), (13,), with no number for what is not known; None where nothing
        is."""

    def removed_freedom(self, fix_id: str, group: str) -> int:
        """Degrees of freedom that another fix takes from a group of atoms; collective."""
        return 0

    def moved_by(self, fix_id: str, x: np.ndarray) -> np.ndarray:
        """Which atoms another fix would move at the begin of a step if it found all of them
        elsewhere, (n,) bool, by trying: x, LAMMPS's places of this rank's atoms, (n, 3), is then as
        it was; collective."""
        return np.zeros(len(x), bool)

    def pair_style(self, first: str) -> bool:
        """Whether a pair style whose name begins with this is in use, perhaps in a hybrid style."""
        return False

    def gravity(self, fix_id: str) -> np.ndarray | None:
        """The acceleration that another fix gives, (3,), as it is at any time; None if none."""

    def definition(self, word: str) -> str:
        """What v_NAME is, as LAMMPS's command info tells it, or the style of the compute of c_ID;
        empty if there is none, or if its group is dynamic."""
        return ""

    def ask_for(self, words: Sequence[str], *, energy: bool, virial: bool) -> None:
        """Have LAMMPS tell what these words, variables and columns, are when it calls `push`, and
        have it count the energy and the virial of external forces."""

    def values(self) -> list[np.ndarray]:
        """What the words of `ask_for` are now: of each an array, (n,) or (), in this order."""
        return []

    def advice(self, removed: int) -> Sequence[str]:
        """Lines for the log, on what to add to the input so that temp and press are right."""
        return ()

    def cut_cluster(self) -> int:
        """The ID of an atom of `held` on this rank with which others are held that are not in that
        group, 0 if there is none; collective."""
        return 0

    def set_bodies(self, body: np.ndarray | None, mass: np.ndarray | None) -> None:
        """Lend LAMMPS the body of each atom and the mass of each body; None, None ends that."""

    def lend_array(self, rows: np.ndarray) -> None:
        """Lend LAMMPS all rows that ``compute_array`` gives now, as long as the bodies stay so."""

    def set_array_rows(self, n: int) -> None:
        """Tell LAMMPS how many rows ``compute_array`` gives now."""

    def carry(self, lammps: Any, bodies: Any) -> None:
        """Have LAMMPS take along, with atoms of these bodies, what is to be known of them;
        None, None for no more."""

    def point(self) -> None:
        """Point the cells of `lammps.Lammps` at LAMMPS's arrays as they are; collective."""

    def noted(self) -> None:
        """Where each atom is, is in the cell of origins now."""

    def now(self) -> int:
        """The facts about this step, bits of `When`."""
        raise NotImplementedError

    def follow_schedule(
        self, lists: dict | None, *, velocities_every: int = 0, table_every: int = 0
    ) -> None:
        """Follow the schedule from now on, and do these lists of passes.

        Args:
            lists: see `passes`; None for none, before the run has them.
            velocities_every, table_every: every how many steps something may read the atoms'
                velocities, or Python writes a table, at the step's end; 0 for never.
        """

    def go_back(self) -> None:
        """Move the bodies' atoms by what is in place of their velocities, and compute the forces
        there; collective."""
