"""Boxes that other fixes change: which of them bodies follow, and what ends a run.

    what changes the box            with                 what happens
    deform with remap x, and        nosquish/nve,        the centres of mass move with the box
    press/berendsen                 nosquish/nvt         (`followed_box`, list "deform" of passes)
    deform with remap v             nosquish/nve         a body gets another velocity at a face
                                    others               refused as a run begins (`refuse_remap`)
    deform with remap none          all                  LAMMPS tells no other fix: the run ends at
                                                         the next re-neighboring (`BoxWatch`)
    these, with run_style respa or  all                  the run ends with the step (`BoxWatch`)
    LAMMPS's own fix python/move
    npt, press/langevin, ...        all                  refused as a run begins (`why_not`)
    any                             nosquish/npt, /nph   refused by LAMMPS: our barostats claim
                                                         all axes (`plugin/declaration.h`)
    any                             nosquish/hmc         refused: `OtherFixes.without_energy`
    box/relax                       minimize             refused: `beginning`

In a run with remap v, `plugin/box.h` ends it if the rates change.
"""

from collections.abc import Sequence

import numpy as np

from ..bodies.bodies import Bodies
from ..bodies.membership import Membership
from ..errors import refuse
from ..host.command import Command
from ..host.hosts import Host, OtherFix
from ..host.lammps import Box, Lammps

# fixes that report a change of the box to rigid fixes, as fix deform does with remap x or v
REPORTING = "deform", "press/berendsen"
# what to do with bodies that have keyword force or torque, in a box that changes
WITH_SWITCHES = (
    "keywords force and torque are for a box that does not change. Leave bodies that do not move "
    "at all out of the fix, because atoms that no fix integrates stay where they are; for bodies "
    "that press on a fluid keep the box (fix nvt), and add the pressure's force to them (fix "
    "addforce)"
)


def why_not(fix: OtherFix, command: Command, has_barostat: bool) -> str | None:
    """Why a fix cannot change the box of a run of ours, or None.

    Args:
        command: of our fix.  has_barostat: whether our fix changes the box, too.
    """
    elsewhere = fix.style.startswith((*REPORTING, "box/relax"))
    if not fix.box_change or elsewhere or has_barostat:
        return None
    instead = (
        "use fix nosquish/npt or fix nosquish/nph instead, whose keyword flexible GROUP "
        "also moves atoms that are in no body"
    )
    return (
        f"fix {fix.id} (style {fix.style}) changes the box, and bodies do not move with it: "
        f"{WITH_SWITCHES if command.force or command.torque else instead}"
    )


def followed_box(
    host: Host, changing: Sequence[OtherFix], *, has_barostat: bool, levels: bool
) -> np.ndarray | None:
    """The box that other fixes change, if bodies follow it; else None.

    Args:
        changing: these fixes.  has_barostat: whether our fix changes the box.
        levels: whether the run has the levels of run_style respa.
    """
    reported = changing and all(fix.style.startswith(REPORTING) for fix in changing)
    return host.deformed_box if reported and not has_barostat and not levels else None


def refuse_remap(supported: bool, name: str, membership: Membership, remap_group: int) -> None:
    """End the run if bodies cannot get another velocity at faces, as with remap v; collective.

    Args:
        supported: whether the integrator of this name supports it.
        remap_group: the bit of the group of fix deform.
    """
    refuse(
        not supported,
        "fix deform has remap v, with which bodies get another velocity at periodic faces: "
        f"{name} does not support it. Use fix nosquish/nve, and fix langevin with fix_modify "
        "temp for a temperature",
    )
    groups, bit = membership.lammps.groups[membership.atoms()], remap_group & 0xFFFFFFFF
    refuse(
        membership.communicator.any((groups & bit == 0).any()),
        "fix deform has remap v for a group that lacks atoms of the bodies: give it group all",
    )


class BoxWatch:
    """The box of a run, as the bodies know it: where they move with it they know the new one.

    Any other change ends the run: at the end of the step where another fix `may_change` the box
    and bodies cannot follow (with run_style respa, with LAMMPS's own fix python/move, or beside a
    fix that does not tell them), else where atoms are followed (fix deform with remap none, or a
    change between runs with reinit no or infile), and where a run with 'pre no' begins.

    Args:
        bodies: their cells have the box that they know.
        lammps: the `Lammps`.
        may_change: whether another fix may change the box without bodies that move with it.
        has_barostat: whether this fix changes the box itself, so that any change is right.
    """

    def __init__(
        self, bodies: Bodies, lammps: Lammps, may_change: bool, has_barostat: bool
    ) -> None:
        self._bodies, self._lammps, self._has_barostat = bodies, lammps, has_barostat
        self.may_change = may_change
        self._box: Box | None = None

    def refuse_change(self, held: bool | np.ndarray = True) -> None:
        """End the run if one of the box vectors that are held, (3,) bool, has changed: where LAMMPS
        re-neighbors only the periodic ones, because shrink-wrapped faces may move.

        Raises:
            RunError: on all ranks.
        """
        box = self._lammps.box
        if box is self._box or self._has_barostat:
            return
        refuse(
            ((box.h != self._bodies.cells["h"].array) & held).any(),
            f"the box has changed by step {self._lammps.step}, and bodies do not move "
            "with it. In a run use fix nosquish/npt, fix nosquish/nph, or fix deform with "
            "remap x (with fix nosquish/nve also v) and run_style verlet, each with this package's "
            "plugin; between runs any "
            "command may change the box, with reinit yes and without infile or 'pre no'",
        )
        self._box = box
