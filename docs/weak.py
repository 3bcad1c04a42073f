"""Berendsen's thermostat: the kinetic energy relaxes to that of the temperature, without noise."""

from math import sqrt

from fix_nosquish import of_fix_line
from fix_nosquish.integrators.nvt import NVT
from fix_nosquish.integrators.rescaling import Rescaling, scaling_by
from fix_nosquish.loops.compiled import inlined


@inlined
def relax(parameters, state, k, dt):
    """The factor of all velocities, and 0 because nothing can go wrong."""
    target = parameters.degrees[k] * parameters.kt  # twice the kinetic energy
    change = parameters.rate * dt * (target / parameters.energies[k] - 1.0)
    return sqrt(max(0.0, 1.0 + change)), 0


class Berendsen(Rescaling):
    acts, keywords = scaling_by(relax), ("separate",)
    method = "Berendsen's thermostat"


class BerendsenNVT(NVT):
    thermostats = {"berendsen": Berendsen}


__getattr__ = of_fix_line(BerendsenNVT)
