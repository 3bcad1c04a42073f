"""Thermostats that scale the velocities of all bodies: stochastic velocity rescaling, and chains.

Both know the kinetic energy of all bodies in the middle of the step, which is one sum over the
ranks, and find one factor for all velocities and angular momenta, or one for each.  Free motion
keeps this energy, if it is exact: so it is known before, and A O A is one motion.
"""

from math import exp, log, sqrt

import numpy as np

from ..loops.compiled import F1, L1, Cell, F, I, inlined, loop, record
from ..motion.block import (
    BLOCK_ROWS,
    COUNTED,
    FREE,
    LANES,
    MASS,
    MOMENT,
    POINT,
    P,
    Q,
    V,
    four,
    three,
)  # fmt: skip
from ..motion.frames import angular_momentum, angular_velocity
from ..motion.philox import minus_log, normal_pair
from ..motion.step import Operation
from ..ranks.mpi import DOUBLE, RANK, Mpi, add_up
from .constant_temperature import (
    OF_THERMOSTATS,
    Bath,
    ConstantTemperature,
    prepare,
    words_of_all,
)
from .nve import NVE

Scales = record(
    "Scales",
    Bath,
    degrees=(F, 2),  # of freedom, of translation and of rotation, or of both and of none
    twice=(F, 2),  # the kinetic energies of this rank's bodies
    factor=(F, 2),  # for their velocities
)
MOVES, TURNS, WORK = BLOCK_ROWS, BLOCK_ROWS + 1, 2  # rows of a block: twice a body's energies
_W = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
SUZUKI_YOSHIDA = _W, 1.0 - 2.0 * _W, _W  # parts of a step of the chain
LEAST = 1e-100  # in place of a mean that is zero
# what a loop returns for a factor of a chain, or its inverse, that is larger than this
UNSTABLE, MOST = -4, 1000.0
STEPS = 20  # in TDAMP, with which chains are stable
move = NVE.operations["A"].does


@inlined
def measure(block, kind, dt, parameters):
    """Add twice the kinetic energies of the bodies to the sums."""
    for b in range(LANES):
        (x, y, z), (f1, f2, f3) = three(block, V, b), three(block, FREE, b)
        block[MOVES, b] = block[MASS, b] * (f1 * x * x + f2 * y * y + f3 * z * z)
        block[TURNS, b] = 0.0
    if kind != POINT:
        for b in range(LANES):
            q, p, (i1, i2, i3) = four(block, Q, b), four(block, P, b), three(block, MOMENT, b)
            l1, l2, l3 = angular_momentum(q, p)
            w1, w2, w3 = angular_velocity(q, p, i1, i2, i3)
            block[TURNS, b] = block[FREE + 3, b] * (l1 * w1 + l2 * w2 + l3 * w3)
    moves = turns = 0.0
    for b in range(LANES):
        moves += block[COUNTED, b] * block[MOVES, b]
        turns += block[COUNTED, b] * block[TURNS, b]
    parameters.twice[0] += moves
    parameters.twice[1] += turns


@inlined
def scale_by(block, kind, moves, turns):
    """Multiply velocities and angular momenta by these factors."""
    for k in range(3):
        for b in range(LANES):
            block[V + k, b] *= 1.0 + block[FREE + k, b] * (moves - 1.0)
    if kind != POINT:
        for k in range(4):
            for b in range(LANES):
                block[P + k, b] *= 1.0 + block[FREE + 3, b] * (turns - 1.0)


@inlined
def scale(block, kind, dt, parameters):
    """Multiply velocities and angular momenta by their factors."""
    scale_by(block, kind, parameters.factor[0], parameters.factor[1])


@inlined
def move_and_scale(block, kind, dt, parameters):
    """Free motion for half of the time, `scale`, and free motion for the other half.

    Free motion with f times the momenta is that with the momenta in f times the time.  So both
    halves are one, with the mean of the momenta before and behind.
    """
    factor = parameters.factor
    moves, turns = mean_with_one(factor[0]), mean_with_one(factor[1])
    scale_by(block, kind, moves, turns)
    move(block, kind, dt, parameters)
    scale_by(block, kind, factor[0] / moves, factor[1] / turns)


@inlined
def mean_with_one(factor):
    """The mean of this and 1; not zero, so that it can be divided by."""
    mean = 0.5 * (1.0 + factor)
    return mean if mean != 0.0 else LEAST


@inlined
def add_up_energies(mpi, parameters, sums, separate):
    """Twice the kinetic energies of all bodies on all ranks."""
    add_up(mpi, DOUBLE, parameters.twice, sums)
    parameters.twice[0], parameters.twice[1] = 0.0, 0.0
    if not separate:
        sums[0], sums[1] = sums[0] + sums[1], 0.0


@inlined
def use_factors(mpi, parameters, sums, separate):
    """Note the energy that the factors give, on rank 0, and have one factor serve both motions."""
    given = 0.0
    for k in range(2):
        given += 0.5 * sums[k] * (parameters.factor[k] * parameters.factor[k] - 1.0)
    if mpi.interface[RANK] == 0:
        parameters.heat += given
    if not separate:
        parameters.factor[1] = parameters.factor[0]


# ---------------------------------------------------------------- stochastic velocity rescaling


@inlined
def normal_and_uniform(parameters, attempt):
    """A normal number, and minus the logarithm of a uniform one."""
    w0, w1, w2, _ = words_of_all(parameters, attempt)
    return normal_pair(w0, w1)[0], minus_log(w2)


@inlined
def sum_of_squares(parameters, n, attempt):
    """The sum of the squares of n independent normal numbers: of one of them, if n is odd, and
    twice a number of the gamma distribution (Marsaglia and Tsang, ACM Trans. Math. Softw. 26, 363,
    2000)."""
    result, pairs = 0.0, n // 2
    if n % 2:
        x, _ = normal_and_uniform(parameters, attempt)
        result = x * x
    d = pairs - 1.0 / 3.0
    while pairs > 0:
        attempt += 1
        x, e = normal_and_uniform(parameters, attempt)
        v = 1.0 + x / sqrt(9.0 * d)
        v = v * v * v
        if v > 0.0 and -e < 0.5 * x * x + d - d * v + d * log(v):
            result += 2.0 * d * v
            pairs = 0
    return result


@inlined
def rescale(mpi, parameters, dt, sums, separate):
    """Bussi, Donadio and Parrinello, J. Chem. Phys. 126, 014101 (2007), eq. A7.

    Returns:
        -1 if there is no kinetic energy to scale, else 0.
    """
    keep = exp(-parameters.rate * dt)
    for k in range(2):
        degrees, parameters.factor[k] = parameters.degrees[k], 1.0
        if degrees > 0.0:
            if not sums[k] > 0.0:
                return -1
            first = OF_THERMOSTATS[k]
            ratio = (1.0 - keep) * parameters.kt / sums[k]
            x, _ = normal_and_uniform(parameters, first)
            others = sum_of_squares(parameters, int(degrees) - 1, first + 1)
            square = keep + ratio * (x * x + others) + 2.0 * x * sqrt(keep * ratio)
            sign = 1.0 if x + sqrt(keep / ratio) >= 0.0 else -1.0
            parameters.factor[k] = sign * sqrt(square)
    use_factors(mpi, parameters, sums, separate)
    return 0


@loop
def stochastic_rescaling(
    mpi: Mpi,
    parameters: Scales,
    dt: F,
    step: L1,
    begin_step: L1,
    end_step: L1,
    sums: F1,
    separate: I,
) -> I:
    """The factors of a step: see `rescale`."""
    prepare(parameters, step, begin_step, end_step)
    add_up_energies(mpi, parameters, sums, separate)
    return rescale(mpi, parameters, dt, sums, separate)


# ---------------------------------------------------------------- Nose-Hoover chains


@inlined
def move_chain(chain, n, twice, degrees, kt, rate, dt):
    """Advance a chain of n thermostats by dt, symmetrically.

    Args:
        chain: (2 n,) positions, then velocities.
        twice: twice the kinetic energy.
    Returns:
        the factor for velocities.
    """
    factor, second = 1.0, kt / (rate * rate)  # the mass of all but the first, `degrees` times that
    for part in SUZUKI_YOSHIDA:
        h = part * dt
        for turn in range(2):
            for i in range(n):
                j = n - 1 - i if turn == 0 else i
                if j == 0:
                    force = (twice * factor * factor - degrees * kt) / (degrees * second)
                else:
                    before = second * (degrees if j == 1 else 1.0)
                    force = (before * chain[n + j - 1] * chain[n + j - 1] - kt) / second
                slow = exp(-0.25 * h * chain[n + j + 1]) if j < n - 1 else 1.0
                chain[n + j] = slow * (slow * chain[n + j] + 0.5 * h * force)
            if turn == 0:
                factor *= exp(-h * chain[n])
                for j in range(n):
                    chain[j] += h * chain[n + j]
    return factor


@inlined
def move_chains(mpi, parameters, dt, sums, separate, chains):
    """Martyna, Tuckerman, Tobias and Klein, Mol. Phys. 87, 1117 (1996), eqs. 26-29.

    Returns:
        as `rescale`, and UNSTABLE.
    """
    length = chains.size // 2
    for k in range(2):
        degrees, parameters.factor[k] = parameters.degrees[k], 1.0
        if degrees > 0.0:
            if not sums[k] > 0.0:
                return -1
            parameters.factor[k] = move_chain(
                chains[k * length : (k + 1) * length], length // 2, sums[k], degrees,
                parameters.kt, parameters.rate, dt,
            )  # fmt: skip
            if not 1.0 / MOST < parameters.factor[k] < MOST:
                return UNSTABLE
    use_factors(mpi, parameters, sums, separate)
    return 0


@loop
def nose_hoover(
    mpi: Mpi, parameters: Scales, dt: F, step: L1, begin_step: L1, end_step: L1, sums: F1,
    separate: I, chains: F1,
) -> I:  # fmt: skip
    """The factors of a step: see `move_chains`."""
    prepare(parameters, step, begin_step, end_step)
    add_up_energies(mpi, parameters, sums, separate)
    return move_chains(mpi, parameters, dt, sums, separate, chains)


class Rescaling(ConstantTemperature):
    """`NVT` with keyword thermostat csvr or nh."""

    operations = NVE.operations | {
        "A": Operation(move_and_scale, moves=True, prepared=True, measures=measure, exact=True),
    }  # fmt: skip
    splitting, work, splits, numbers = "B A B", WORK, False, Scales
    unprepared = (
        "the bodies are at rest, so there is no velocity to scale: give them velocities first "
        "(velocity ... create), or use thermostat langevin"
    )
    chains, number_of_chains = None, 2  # of translation and of rotation, or of both and of none

    @property
    def chained(self):
        """Whether the thermostats are chains."""
        return self.command.thermostat == "nh"

    def complaint(self, found):
        if found == UNSTABLE:
            dt, damping = self.lammps.dt, self.lammps.number(self.command.temp[2])
            return (
                f"the Nose-Hoover chains are unstable at step {self.lammps.step}: TDAMP "
                f"{damping:g} is {damping / dt:.3g} time steps. Give a TDAMP of at least "
                f"{STEPS * dt:g}, or start from velocities of nearly this temperature"
            )
        return super().complaint(found)

    @property
    def backwards(self):
        return self.chained and not self.every

    @property
    def method(self):
        kind = "Nose-Hoover chains" if self.chained else "stochastic velocity rescaling"
        return f"NO_SQUISH with {kind} in the middle of the step"

    @property
    def prepares(self):
        return nose_hoover if self.chained else stochastic_rescaling

    def own_state(self):
        if self.chains is None:
            length = 2 * self.command.tchain * self.number_of_chains
            self.chains = np.zeros(length if self.chained else 0)
        return self.chains

    def own_parameters(self):
        return {**super().own_parameters(), "degrees": self._degrees(), "factor": 1.0}

    def _degrees(self):
        """Degrees of freedom of each of the two thermostats; collective."""
        degrees = self.degrees()
        return degrees if self.command.separate else np.array([degrees.sum(), 0.0])

    def turned_over(self):
        self.parameters.degrees = self._degrees()

    def own_cells(self):
        cells = super().own_cells() | {
            "sums": Cell(F1, np.zeros(2)), "separate": Cell(I, self.command.separate),
        }  # fmt: skip
        return cells | ({"chains": Cell(F1, self.chains)} if self.chained else {})
