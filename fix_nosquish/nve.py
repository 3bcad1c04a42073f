"""NVE: rigid bodies at constant energy, one step of eq. 2.53 of Miller et al. (2002).

Velocity Verlet for the centres of mass, and for the rotation half a kick, the free rotation, exact
or split into rotations about one axis at a time, and half a kick.
"""

from typing import ClassVar

from .integrator import Integrator
from .operations import free_motion, kick, rotate_rotors
from .step import Operation


class NVE(Integrator):
    """fix python/move "fix_nosquish.NVE GROUP BODYSTYLE ...": NO_SQUISH at constant energy."""

    splitting = "B A B"
    operations: ClassVar = {
        "A": Operation(free_motion(rotate_rotors), moves=True, exact=True),
        "B": Operation(kick),
    }
    method, splits = "NO_SQUISH", True
