"""What integrators at constant pressure have in common: the words for it, and what they refuse.

How the box follows the pressure is said by `crescale` and `mtk`.
"""

import numpy as np

from . import cell
from .cell import EVERY, MOST, NUMBERS, OUT_OF_BOUNDS, P_START, P_STOP, SPACE, UNIT
from .command import PRESSURES
from .compiled import F1, L1, Cell
from .errors import RunError
from .nvt import NVT

AXES = "xyz"
# parts of PDAMP that the time between two changes of the box is, and at most is without a warning:
# a box that follows the fast fluctuations of a liquid's pressure in long jumps is too restless
PARTS, FEWEST_PARTS = 50, 20
COUPLED = {"xyz": (0, 0, 0), "xy": (0, 0, 2), "yz": (0, 1, 1), "xz": (0, 1, 0), "none": (0, 1, 2)}


class ConstantPressure(NVT):
    """An integrator whose box changes every so many steps.

    All atoms of the system are in its bodies, or points.

    Attributes:
        numbers: how many numbers its barostat has; see `cell`.

    Raises:
        RunError: for words that do not go together, for atoms that are left out, and where a face
            of the box is not periodic.
    """

    keywords = (*PRESSURES, "couple", "every")
    modules, numbers = (cell.__name__,), NUMBERS
    respa, every = False, 1

    def own_parameters(self):
        self._refuse()
        self._choose_every()
        return super().own_parameters()

    def _choose_every(self):
        """Say in which steps the box changes."""
        dt, damping = self.lammps.dt, self.damping
        usual = min(damping / (PARTS * dt) + 1e-9, 2.0**31 - 1.0)
        self.every = self.command.every or max(1, int(usual))
        self.host.changes_box = self.every
        parts = damping / (self.every * dt)
        self.own_warnings = ()
        if self.command.every and parts < FEWEST_PARTS:
            self.own_warnings = (
                f"WARNING: the box changes {parts:.3g} times in PDAMP: with fewer than "
                f"{FEWEST_PARTS} volumes fluctuate too much, and with barostat mtk a run may "
                "break. Give keyword every a smaller number, or leave it out",
            )

    def complaint(self, found):
        if found == OUT_OF_BOUNDS:
            return (
                f"an axis of the box would change by more than a factor of {MOST:g} at once by "
                f"step {self.lammps.step}: the pressure is far from the one asked for, or PDAMP "
                "is too short. Bring the system near this pressure at constant volume or with a "
                "longer PDAMP first, or give keyword every a smaller number"
            )
        return super().complaint(found)

    def _refuse(self):
        """Raise an error for a system whose box this fix cannot change; collective."""
        lammps = self.lammps
        if self.host.set_box is None:
            raise RunError(
                "a LAMMPS's own fix python/move tells no virial and takes no new box: install this "
                "package where its plugin serves, or use fix_nosquish.NVT or NVE",
                everywhere=True,
            )
        outside = self.communicator.count(len(lammps.groups) - len(self.bodies.index))
        if outside:
            raise RunError(
                f"{outside} atoms are in no body, and would stay where they are when the box "
                "changes: give their group to keyword points",
                everywhere=True,
            )
        flat = {"z", "xz", "yz"} & {*self.command.pressure, self.command.couple}
        if lammps.dimension == 2 and flat:
            raise RunError(
                f"in two dimensions the box has no length along z: leave out {flat.pop()}",
                everywhere=True,
            )
        if self.command.force or self.command.torque:
            raise RunError(
                "keywords force and torque are for a box that does not change", everywhere=True
            )
        for axis, group, periodic in zip(AXES, self.axes, lammps.box.periodic, strict=True):
            if group >= 0 and not periodic:
                raise RunError(
                    f"there is no pressure along {axis}, which is not periodic: name other axes",
                    everywhere=True,
                )

    @property
    def axes(self):
        """Which axes change together, (3,): see `cell.Barostat`."""
        command = self.command
        coupled = COUPLED["xyz" if "iso" in command.pressure else command.couple]
        axes = [
            group if command.pressure_along(axis) else -1
            for axis, group in zip(AXES, coupled, strict=True)
        ]
        return np.array(axes if self.lammps.dimension == 3 else [*axes[:2], -1])

    @property
    def damping(self):
        """PDAMP, which is one for all axes."""
        words = next(iter(self.command.pressure.values()))
        damping = self.lammps.number(words[2])
        self._refuse_unless_positive("PDAMP", damping)
        return damping

    def own_numbers(self):
        """The numbers of the barostat, (n,): see `cell`."""
        lammps, numbers = self.lammps, np.zeros(self.numbers)
        for k, axis in enumerate(AXES):
            if words := self.command.pressure_along(axis):
                start, stop = (lammps.number(word) for word in words[:2])
                numbers[[P_START + k, P_STOP + k]] = start / lammps.nktv2p, stop / lammps.nktv2p
        numbers[[UNIT, EVERY, SPACE]] = lammps.mvv2e, self.every, lammps.dimension == 3
        return numbers

    def own_cells(self):
        return super().own_cells() | {
            "barostat": Cell(F1, self.own_numbers()),
            "axes": Cell(L1, self.axes),
            "cell_sums": Cell(F1, np.zeros(6)),
            "forces_virial": Cell(F1, self.host.forces_virial),
            "new_box": Cell(F1, np.zeros(9)),
            "set_box": Cell(L1, self.host.set_box),
        }
