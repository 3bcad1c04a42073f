"""NVT: rigid bodies at constant temperature; see `thermostat`."""

from collections.abc import Mapping

import numpy as np

from ..run.run import Run
from .csvr import Csvr
from .ensemble import TEMPERATURE, Ensemble
from .langevin import Langevin
from .nose_hoover import NoseHoover
from .thermostat import Thermostat

# by the value of keyword thermostat; the first one is the default
THERMOSTATS: dict[str, type[Thermostat]] = {"langevin": Langevin, "csvr": Csvr, "nh": NoseHoover}


class NVT(Ensemble):
    """fix ID group nosquish/nvt BODYSTYLE temp TSTART TSTOP TDAMP ..."""

    keywords = TEMPERATURE
    thermostats: Mapping[str, type[Thermostat]] = THERMOSTATS
    values: Mapping[str, bool] = {"shadow": True}

    def extra_values(self, run: Run) -> tuple[float, ...]:
        """(dt^2 / 24) (sum of F^2 / M + sum of T_k^2 / I_k), over bodies and their principal axes:
        the configurational part of the shadow Hamiltonian's second-order term; collective."""
        bodies, lammps = run.completed_bodies(), run.lammps
        torque = bodies.principal_torque()
        turns = np.divide(
            torque**2, bodies.moment, out=np.zeros_like(torque), where=bodies.moment > 0
        )
        squares = (bodies.acting_wrench[:3] ** 2).sum(axis=0) / bodies.mass + turns.sum(axis=0)
        total = run.ranks.total(np.array([squares[bodies.sharers.owned].sum()]))[0]
        return ((lammps.ftm2v * lammps.dt) ** 2 * lammps.mvv2e * total / 24.0,)
