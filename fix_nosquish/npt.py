"""NPT: rigid bodies at constant temperature and pressure.

`NVT`, and a box that changes every so many steps: see `cell`.
"""

import numpy as np

from . import cell
from .cell import EVERY, NUMBERS, P_START, P_STOP, RATE, SPACE, UNIT
from .command import Command
from .compiled import F1, L1, Cell
from .errors import RunError
from .langevin import Langevin
from .nvt import NVT
from .rescaling import Rescaling

AXES = "xyz"
COUPLED = {"xyz": (0, 0, 0), "xy": (0, 0, 2), "yz": (0, 1, 1), "xz": (0, 1, 0), "none": (0, 1, 2)}
COMPRESSIBILITY = 4.6e-5  # of water, 1/atm
# atm that the unit of pressure is
_PER_ATM = {
    "real": 1.0, "metal": 1 / 1.01325, "si": 1 / 101325.0, "cgs": 1 / 1013250.0,
    "electron": 1 / 101325.0,
}  # fmt: skip


class NPT(NVT):
    """fix python/move "fix_nosquish.NPT GROUP BODYSTYLE temp ... iso PSTART PSTOP PDAMP ...".

    Besides the words of `NVT` it takes those of `keywords`.  All atoms of the system are in its
    bodies, or points.

    Raises:
        RunError: for words that do not go together, for atoms that are left out, and where a face
            of the box is not periodic.
    """

    keywords = (*NVT.keywords, "iso", "aniso", "x", "y", "z", "couple", "every", "compressibility")
    respa = False
    modules = (cell.__name__,)

    def __new__(cls, ptr, words):
        if cls is NPT:
            langevin = Command.parse(words, cls.keywords).thermostat == "langevin"
            cls = LangevinNPT if langevin else RescalingNPT
        return super().__new__(cls, ptr, words)

    @property
    def method(self):
        return f"{super().method}, and stochastic cell rescaling"

    @property
    def every(self):
        return self.command.every

    def cell_loops(self, cells):
        return [cell.virial_about_centres.bind_to(cells)], [cell.rescale_cell.bind_to(cells)]

    def own_parameters(self):
        self._refuse()
        return super().own_parameters()

    def _refuse(self):
        """Raise an error for a system whose box this fix cannot change; collective."""
        lammps = self.lammps
        if self.host.set_box is None:
            raise RunError(
                "a LAMMPS's own fix python/move tells no virial and takes no new box: install this "
                "package where its plugin serves, or use fix_nosquish.NVT",
                everywhere=True,
            )
        outside = self.communicator.count(len(lammps.groups) - len(self.bodies.index))
        if outside:
            raise RunError(
                f"{outside} atoms are in no body, and would stay where they are when the box "
                "changes: give their group to keyword points",
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

    def own_cells(self):
        lammps, command, numbers = self.lammps, self.command, np.zeros(NUMBERS)
        for k, axis in enumerate(AXES):
            if words := command.pressure_along(axis):
                start, stop, damping = (lammps.number(word) for word in words)
                self._refuse_unless_positive("PDAMP", damping)
                numbers[[P_START + k, P_STOP + k]] = start / lammps.nktv2p, stop / lammps.nktv2p
        if command.compressibility:
            compressibility = lammps.number(command.compressibility)
        elif lammps.units in _PER_ATM:
            compressibility = COMPRESSIBILITY * _PER_ATM[lammps.units]
        else:
            raise RunError(
                f"keyword compressibility is missing: with units {lammps.units} it has no default",
                everywhere=True,
            )
        numbers[RATE] = compressibility * lammps.nktv2p / damping
        numbers[[UNIT, EVERY, SPACE]] = lammps.mvv2e, self.every, lammps.dimension == 3
        return super().own_cells() | {
            "barostat": Cell(F1, numbers),
            "axes": Cell(L1, self.axes),
            "cell_sums": Cell(F1, np.zeros(6)),
            "forces_virial": Cell(F1, self.host.forces_virial),
            "new_box": Cell(F1, np.zeros(9)),
            "set_box": Cell(L1, self.host.set_box),
        }


class LangevinNPT(NPT, Langevin):
    """`NPT` with keyword thermostat langevin."""


class RescalingNPT(NPT, Rescaling):
    """`NPT` with keyword thermostat csvr or nh."""
