"""NPH: rigid bodies at constant pressure and enthalpy, in a box that a piston moves; see `mtk`."""

from ..errors import RunError
from ..loops.compiled import L1, F, I, loop
from ..motion.block import Images
from ..motion.periodic import PeriodicBox
from ..ranks.mpi import Mpi
from ..run.thermo import energies
from .constant_pressure import ConstantPressure
from .constant_temperature import prepare
from .mtk import DILATION, Mtk, PistonBox, Strained, begin_move, end_move
from .nve import NVE


@loop
def dilation(
    mpi: Mpi, images: Images, parameters: Strained, dt: F, step: L1, begin_step: L1, end_step: L1,
    cell: PistonBox, box: PeriodicBox,
) -> I:  # fmt: skip
    """The factors of letter D.

    Returns:
        as `stretch_box`.
    """
    part = prepare(parameters, step, begin_step, end_step)
    begin_move(mpi, parameters, step, cell, box, part, dt)
    return end_move(parameters, step, cell, box, images.shift, part, dt, 1.0)


class NPH(Mtk):
    """fix ID group nosquish/nph BODYSTYLE iso PSTART PSTOP PDAMP ..."""

    operations = NVE.operations | {"D": DILATION}
    splitting, prepares, thermostat = "B A D A B", dilation, False
    keywords = ConstantPressure.keywords

    def temperature(self):
        return 0.0, 0.0, 0.0

    def heat(self):
        if not self.piston.inertia_kt:
            kelvin = energies(self.bodies, self.communicator, self.lammps)[4]
            if not self.lammps.running:  # but a file is written, perhaps before they move
                return self.lammps.boltz * kelvin
            if not kelvin > 0:
                raise RunError(
                    "the bodies are at rest, so there is no temperature to choose the piston's "
                    "inertia by: give them velocities first (velocity ... create)",
                    everywhere=True,
                )
            self.piston.inertia_kt = self.lammps.boltz * kelvin
        return self.piston.inertia_kt
