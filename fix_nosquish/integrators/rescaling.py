"""Thermostats that scale all velocities; `csvr` and `nose_hoover` compute the factors.

Both use the kinetic energy of all bodies in the middle of the step, by one sum over the ranks.
They find one factor for velocities and angular momenta, or one for each.  Exact free motion
conserves this energy, so it is known in advance, and A O A is done as one motion.
"""

from collections.abc import Callable, Iterator
from typing import Any, ClassVar

import numpy as np

from ..loops.compiled import F, I, inlined, record
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
from ..motion.step import Operation
from ..ranks.mpi import add_up
from ..run.run import Run
from .nve import NVE
from .thermostat import Bath, Thermostat

Scales: Any = record(
    "Scales",
    Bath,
    degrees=(F, 2),  # degrees of freedom of translation and rotation, or of both and 0
    # twice the kinetic energies, in mass times velocity squared: of this rank's bodies, of all
    twice=(F, 2),
    energies=(F, 2),
    separate=I,  # whether there are two factors, or one
    chain=I,  # size of the state of each Nose-Hoover chain
)
MOVES, TURNS, WORK = BLOCK_ROWS, BLOCK_ROWS + 1, 2  # rows of a block: twice a body's energies
LEAST = 1e-100  # replaces a mean of zero
REST = 1e-20  # kinetic energy / kT per degree of freedom up to which a body is at rest
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
    """Multiply active velocities and angular momenta by these factors."""
    for k in range(3):
        for b in range(LANES):
            block[V + k, b] *= 1.0 + block[FREE + k, b] * (moves - 1.0)
    if kind != POINT:
        for k in range(4):
            for b in range(LANES):
                block[P + k, b] *= 1.0 + block[FREE + 3, b] * (turns - 1.0)


@inlined
def scale(block, kind, dt, parameters):
    """Multiply velocities and angular momenta by the factors of the step."""
    scale_by(block, kind, parameters.factor[0], parameters.factor[1])


@inlined
def move_and_scale(block, kind, dt, parameters):
    """Free motion for half of the time, `scale`, and free motion for the other half.

    Free motion with momenta scaled by f equals free motion for f times the time.  Both halves are
    therefore one free motion, with the mean of the momenta before and after the scaling.
    """
    factor = parameters.factor
    moves, turns = mean_with_one(factor[0]), mean_with_one(factor[1])
    scale_by(block, kind, moves, turns)
    move(block, kind, dt, parameters)
    scale_by(block, kind, factor[0] / moves, factor[1] / turns)


@inlined
def mean_with_one(factor):
    """The mean of a factor and 1, nonzero so that it can be a divisor."""
    mean = 0.5 * (1.0 + factor)
    return mean if mean != 0.0 else LEAST


def scaling_by(factor_of: Callable) -> Callable:
    """A `Thermostat.acts` that sets the factors of the step.

    Args:
        factor_of: an inlined function (parameters, state, k, dt) that returns the factor of the
            velocities of motion k, of any sign, and 0 or the value that ends the run.  dt is the
            whole step.  parameters.energies[k] is twice the kinetic energy, never 0, in mass times
            velocity squared as is parameters.kt, and parameters.degrees[k] the degrees of freedom.
            The heat is counted here.
    """

    @inlined
    def acts(mpi, parameters, state, dt, gained):
        energies, factor, heat = parameters.energies, parameters.factor, 0.0
        add_up(mpi, parameters.twice, energies)
        parameters.twice[0], parameters.twice[1] = 0.0, 0.0
        if not parameters.separate:
            energies[0], energies[1] = energies[0] + energies[1], 0.0
        energies[0] += gained
        for k in range(2):
            factor[k] = 1.0
            degrees = parameters.degrees[k]
            # a motion at rest cannot be scaled: the thermostat waits
            if degrees > 0.0 and energies[k] > REST * degrees * parameters.kt:
                factor[k], error = factor_of(parameters, state, k, dt)
                if error:
                    return error
            heat += 0.5 * energies[k] * (factor[k] * factor[k] - 1.0)
        if mpi.rank == 0:
            parameters.heat += heat
        if not parameters.separate:
            factor[1] = factor[0]
        return 0

    return acts


class Rescaling(Thermostat):
    """A thermostat that scales velocities; a derived class sets `acts` by `scaling_by`, and
    `keywords` if it draws no random numbers."""

    operation = Operation(scale, prepared=True, measures=measure)
    merged: ClassVar[Operation | None] = Operation(
        move_and_scale, moves=True, prepared=True, measures=measure, exact=True
    )
    numbers, work, keywords = Scales, WORK, ("seed", "separate")

    def extra_parameters(self, run: Run) -> dict[str, Any]:
        return {"degrees": self._degrees(), "separate": self.command.separate}

    def extra_warnings(self, run: Run) -> Iterator[str]:
        """Also a warning of motions at rest at the start of a run: in an ideal gas they would stay
        at rest."""
        yield from super().extra_warnings(run)
        parameters, moving = run.parameters, run.thermo.energies()
        energies, names = (moving.translation, moving.rotation), ("translation", "rotation")
        if not self.command.separate:
            energies, names = (moving.kinetic, 0.0), ("motion", "")
        heat = REST * run.lammps.mvv2e * parameters.kt
        for name, energy, degrees in zip(names, energies, parameters.degrees, strict=True):
            if degrees > 0 and not 2.0 * energy > degrees * heat:
                yield (
                    f"WARNING: the bodies have no {name} that {self.method} could scale: it waits "
                    "until forces give them one. "
                    "Give them velocities (velocity ... create), or use thermostat langevin"
                )

    def _degrees(self) -> np.ndarray:
        """Degrees of freedom of the two thermostats, (2,); collective."""
        degrees = self.ensemble.momentum.degrees()
        return degrees if self.command.separate else np.array([degrees.sum(), 0.0])

    def bodies_changed(self, run: Run) -> None:
        run.parameters.degrees = self._degrees()
