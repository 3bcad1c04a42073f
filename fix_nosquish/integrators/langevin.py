"""Langevin thermostat: friction and noise on each body separately, exact for any time step.

    v   <- c v   + sqrt((1 - c^2) k T / M)   xi
    L_k <- c L_k + sqrt((1 - c^2) k T I_k)   xi_k       c = exp(-dt / TDAMP)

with independent standard normal deviates xi, and the angular momentum L in the principal frame.
The vector xi_k is drawn in the space frame.  It therefore does not depend on the axes of equal
moments, nor on the signs of axes, which may change in a restart.
"""

from math import exp, sqrt

from ..loops.compiled import inlined
from ..motion.block import (
    BLOCK_ROWS,
    COUNTED,
    FREE,
    LANES,
    MASS,
    MOMENT,
    NUMBER,
    PLANAR,
    POINT,
    P,
    Q,
    V,
    four,
    three,
    write,
)  # fmt: skip
from ..motion.frames import angular_momentum, quaternion_momentum, rotation_matrix, to_body
from ..motion.philox import normal_pair, words
from ..motion.step import Operation
from .thermostat import BODY, Thermostat, thermalise_piston

NOISE, HEAT, WORK = BLOCK_ROWS, BLOCK_ROWS + 6, 7  # rows of a block: six deviates; heat


@inlined
def draw(block, parameters, second):
    """Draw normal deviates for each body: four in rows NOISE, or the next two if `second`."""
    number, key_1 = 2 * parameters.draw + second, parameters.key_1 | BODY
    for b in range(LANES):
        w0, w1, w2, w3 = words(block[NUMBER, b], parameters.step, number, parameters.key_0, key_1)
        write(block, NOISE + 4 * second, b, normal_pair(w0, w1))
        if not second:
            write(block, NOISE + 2, b, normal_pair(w2, w3))


@inlined
def thermalise(block, kind, dt, parameters):
    """Apply friction and noise for a time dt to translation and rotation."""
    keep = exp(-parameters.rate * dt)
    lost, noise = 1.0 - keep, sqrt((1.0 - keep * keep) * parameters.kt)
    draw(block, parameters, 0)
    for b in range(LANES):
        mass, (x, y, z), (a1, a2, a3) = block[MASS, b], three(block, V, b), three(block, NOISE, b)
        (f1, f2, f3), push = three(block, FREE, b), noise / sqrt(mass)
        u = x + f1 * (push * a1 - lost * x)
        v = y + f2 * (push * a2 - lost * y)
        w = z + f3 * (push * a3 - lost * z)
        write(block, V, b, (u, v, w))
        block[HEAT, b] = 0.5 * mass * ((u * u + v * v + w * w) - (x * x + y * y + z * z))
    if kind != POINT:
        draw(block, parameters, 1)
        about = 0.0 if kind == PLANAR else 1.0  # axes 1 and 2
        for b in range(LANES):
            q, (i1, i2, i3) = four(block, Q, b), three(block, MOMENT, b)
            x, y, z = three(block, NOISE + 3, b)
            a1, a2, a3 = to_body(rotation_matrix(q), x, y, z)
            l1, l2, l3 = angular_momentum(q, four(block, P, b))
            free = block[FREE + 3, b]
            n1 = l1 + free * about * (noise * sqrt(i1) * a1 - lost * l1)
            n2 = l2 + free * about * (noise * sqrt(i2) * a2 - lost * l2)
            n3 = l3 + free * (noise * sqrt(i3) * a3 - lost * l3)
            write(block, P, b, quaternion_momentum(q, n1, n2, n3))
            heat = (n1 * n1 - l1 * l1) / i1 if i1 > 0.0 else 0.0
            heat += (n2 * n2 - l2 * l2) / i2 if i2 > 0.0 else 0.0
            heat += (n3 * n3 - l3 * l3) / i3 if i3 > 0.0 else 0.0
            block[HEAT, b] += 0.5 * heat
    heat = 0.0
    for b in range(LANES):
        heat += block[COUNTED, b] * block[HEAT, b]
    parameters.heat += heat


class Langevin(Thermostat):
    """Keyword thermostat langevin."""

    operation, work = Operation(thermalise, prepared=True), WORK
    on_piston = thermalise_piston
    method = "Langevin's thermostat"
    keeps_momentum, takes_zero = False, True
