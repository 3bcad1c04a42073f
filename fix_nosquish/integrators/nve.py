"""NVE: rigid bodies at constant energy, one step of eq. 2.53 of Miller et al. (2002).

Velocity Verlet for the centres of mass.  For the rotation: a half kick of the quaternion momentum,
free rotation, exact or split into rotations about one axis at a time, and another half kick.
"""

from collections.abc import Mapping

from ..motion.operations import free_motion, kick, rotate_rotors
from ..motion.step import Operation
from ..run.integrator import Integrator


class NVE(Integrator):
    """fix ID group nosquish/nve BODYSTYLE ...: NO_SQUISH at constant energy."""

    splitting = "B A B"
    operations: Mapping[str, Operation] = {
        "A": Operation(free_motion(rotate_rotors), moves=True, exact=True, named=False),
        "B": Operation(kick, named=False),
    }
    method, splits, supports_remap_v = "NO_SQUISH", True, True
