"""Classes of a user's that do or tell what no input script can."""

import numpy as np

from support.sampling import thermo

# tells what a barostat has of LAMMPS's forces, and that with the constraints' virial it is LAMMPS's
TELLS = """
from fix_nosquish import of_fix_line
from fix_nosquish.integrators.nph import NPH

class Tells(NPH):
    def post_run(self):
        super().post_run()
        virial = self.host.forces_virial + self.communicator.total(self.virial)
        numbers = " ".join(f"{number:.17g}" for number in virial * self.lammps.nktv2p)
        self.host.log(f"VIRIAL {numbers}\\n")

__getattr__ = of_fix_line(Tells)
"""


def assert_lammps_virial(run):
    """The last virial that a class of TELLS has told is that of compute pressure, c_f."""
    logged = np.array(run.log.rsplit("VIRIAL ", 1)[1].split("\n")[0].split(), float)
    last = run.thermo[-1]
    theirs = np.array([last[f"c_f[{k}]"] for k in range(1, 7)]) * last["Volume"]
    np.testing.assert_allclose(logged, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())


VIRIAL_LINES = "compute f all pressure NULL virial\n" + thermo("elong vol c_f[*]", 1)
# integrators whose tests of trajectories say what is asked here
MINE = """
from fix_nosquish import of_fix_line
from fix_nosquish.integrators.hmc import HMC

class Rejects(HMC):
    def take_energy(self):
        self._before = -1e300
        return super().take_energy()

class Turns(HMC):
    def take_energy(self):
        self.bodies.v[:] *= -1
        self.bodies.p[:] *= -1
        self._before = 1e300
        return super().take_energy()

__getattr__ = of_fix_line(Rejects, Turns)
"""
