"""Nose-Hoover chains: Martyna, Tuckerman, Tobias and Klein, Mol. Phys. 87, 1117 (1996)."""

from math import exp
from typing import Any

from ..loops.compiled import inlined
from ..run.run import Run
from .rescaling import Rescaling, scaling_by
from .thermostat import instability, note_heat

_W = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
SUZUKI_YOSHIDA = _W, 1.0 - 2.0 * _W, _W  # fractions of a step of the chain
# return value if the factor of a chain, or its inverse, exceeds MOST
UNSTABLE, MOST = -4, 1000.0
LENGTH = 3  # of a chain, by default
STEPS = 20  # time steps per TDAMP with which chains are stable


@inlined
def move_chain(chain, n, twice, degrees, heavier, kt, rate, dt):
    """Advance a chain of n thermostats by dt, with a symmetric splitting.

    Args:
        chain: (2 n,) positions, then velocities.
        twice: twice the kinetic energy.
        heavier: mass of the first thermostat divided by that of each other one.
    Returns:
        the factor of the velocities.
    """
    factor, second = 1.0, kt / (rate * rate)  # the mass of all but the first
    for part in SUZUKI_YOSHIDA:
        h = part * dt
        for turn in range(2):
            for i in range(n):
                j = n - 1 - i if turn == 0 else i
                if j == 0:
                    force = (twice * factor * factor - degrees * kt) / (heavier * second)
                else:
                    before = second * (heavier if j == 1 else 1.0)
                    force = (before * chain[n + j - 1] * chain[n + j - 1] - kt) / second
                slow = exp(-0.25 * h * chain[n + j + 1]) if j < n - 1 else 1.0
                chain[n + j] = slow * (slow * chain[n + j] + 0.5 * h * force)
            if turn == 0:
                factor *= exp(-h * chain[n])
                for j in range(n):
                    chain[j] += h * chain[n + j]
    return factor


@inlined
def factor_of_chain(parameters, state, k, dt):
    """Martyna, Tuckerman, Tobias and Klein, Mol. Phys. 87, 1117 (1996), eqs. 26-29.

    Returns:
        the factor, and 0 or UNSTABLE.
    """
    length, degrees = parameters.chain, parameters.degrees[k]
    factor = move_chain(
        state[k * length : (k + 1) * length], length // 2, parameters.energies[k],
        degrees, degrees, parameters.kt, parameters.rate, dt,
    )  # fmt: skip
    return factor, 0 if 1.0 / MOST < factor < MOST else UNSTABLE


@inlined
def move_chain_of_piston(mpi, parameters, cell, state, dt):
    """Apply the chain to the strain rates, for the whole time of a change of the box."""
    barostat, rates, twice, degrees = cell.barostat, cell.piston.rates, 0.0, 0.0
    for group in range(rates.size):
        twice += barostat.inertia[group] * rates[group] * rates[group] / barostat.unit
        degrees += 1.0 if barostat.inertia[group] > 0.0 else 0.0
    chain, time = state[2 * parameters.chain :], dt * barostat.box_every
    factor = move_chain(
        chain, chain.size // 2, twice, degrees, barostat.heavier, parameters.kt, barostat.rate, time
    )
    for group in range(rates.size):
        before = rates[group]
        rates[group] = factor * before
        note_heat(mpi, parameters, barostat, group, before, rates[group])


class NoseHoover(Rescaling):
    """Keyword thermostat nh.

    Its state is (chains, 2, tchain), positions and velocities of each chain: of translation and of
    rotation, or of both and an unused one, and of a piston.
    """

    acts, on_piston = scaling_by(factor_of_chain), move_chain_of_piston
    method, reversible = "Nose-Hoover chains", True
    keywords = "tchain", "separate"

    @property
    def length(self) -> int:
        """The number of thermostats in a chain."""
        return self.command.tchain or LENGTH

    @property
    def state_size(self) -> int:
        return 2 * self.length * (3 if self.ensemble.has_piston else 2)

    def kind_of_state(self) -> tuple:
        return self.length, self.command.separate

    def extra_parameters(self, run: Run) -> dict[str, Any]:
        return {**super().extra_parameters(run), "chain": 2 * self.length}

    def failure(self, found: int, run: Run) -> str:
        if found != UNSTABLE:
            return ""
        dt, damping = run.lammps.dt, run.lammps.number(self.command.temp[2])
        longer = (
            f"Give a TDAMP of at least {STEPS * dt:g}, or start"
            if damping < STEPS * dt
            else "Start"
        )
        return instability(
            run,
            "the Nose-Hoover chains are unstable",
            f"TDAMP {damping:g} is {damping / dt:.3g} time steps. {longer} from velocities of "
            "nearly this temperature",
        )
