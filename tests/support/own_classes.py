"""Classes of a user's that do or tell what no input script can."""

import numpy as np

from support.sampling import thermo

# tells what a barostat has of LAMMPS's forces, and that with the constraints' virial it is LAMMPS's
TELLS = """
from fix_nosquish import of_fix_line
from fix_nosquish.integrators.nph import NPH

find = of_fix_line(NPH)

def __getattr__(text):
    if text.startswith("__"):
        return find(text)

    def made(ptr):
        fix = find(text.replace("Tells", "NPH"))(ptr)
        post_run = fix.post_run

        def tells():
            post_run()
            virial = fix.host.forces_virial + fix.ranks.total(fix.virial)
            numbers = " ".join(f"{number:.17g}" for number in virial * fix.lammps.nktv2p)
            fix.host.log(f"VIRIAL {numbers}\\n")

        fix.post_run = tells
        return fix

    return made
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
from fix_nosquish.integrators.hmc import HMC, Trajectory

class Rejected(Trajectory):
    def end_trajectory(self, run):
        self._before = -1e300
        super().end_trajectory(run)

class Turned(Trajectory):
    def end_trajectory(self, run):
        run.bodies.v[:] *= -1
        run.bodies.p[:] *= -1
        self._before = 1e300
        super().end_trajectory(run)

class Rejects(HMC):
    def __init__(self, command, dimension):
        super().__init__(command, dimension)
        self.parts = [Rejected(command.steps, self.restart_record)]

class Turns(HMC):
    def __init__(self, command, dimension):
        super().__init__(command, dimension)
        self.parts = [Turned(command.steps, self.restart_record)]

__getattr__ = of_fix_line(Rejects, Turns)
"""
