"""NVE: rigid bodies at constant energy, one step of eq. 2.53 of Miller et al. (2002).

Velocity Verlet for the centres of mass, and for the rotation half a kick, the free rotation, exact
or split into rotations about one axis at a time, and half a kick.
"""

from collections.abc import Mapping

from ..host.hosts import hook
from ..motion.operations import free_motion, kick, rotate_rotors
from ..motion.step import Operation
from ..run.integrator import Integrator
from .shadow import ShadowEnergy


class NVE(Integrator):
    """fix ID group nosquish/nve BODYSTYLE ...: NO_SQUISH at constant energy."""

    splitting = "B A B"
    operations: Mapping[str, Operation] = {
        "A": Operation(free_motion(rotate_rotors), moves=True, exact=True, named=False),
        "B": Operation(kick, named=False),
    }
    method, splits, keywords = "NO_SQUISH", True, ("shadow",)
    crosses = True

    def __init__(self, ptr, line):
        super().__init__(ptr, line)
        self.shadow = ShadowEnergy(self) if self.command.shadow else None
        if self.shadow:
            if (self.splitting, self.operations) != (NVE.splitting, NVE.operations):
                raise self.command.wrong("keyword shadow is for the steps of fix nosquish/nve")
            self.needs_energy, self.take_energy = True, self.shadow.take
            self.vector_extensive = *self.vector_extensive, True

    def own_parameters(self):
        if self.shadow:
            self.shadow.begin()
        return {}

    def begin_trajectory(self):
        if self.shadow:
            self.shadow.take_start()

    @hook
    def compute_vector(self, i):
        """As of `Integrator`, and behind it the shadow energy; collective."""
        if i == len(Integrator.vector_extensive):
            return self.shadow.value
        return super().compute_vector(i)
