"""Rigid bodies with friction, whose rotations go about axes 1, 2, 3, 2, 1."""

from math import exp

from fix_nosquish import of_fix_line
from fix_nosquish.integrators.nve import NVE, Operation
from fix_nosquish.loops.compiled import F, inlined, record
from fix_nosquish.motion.block import LANES, P, V
from fix_nosquish.motion.operations import free_motion, rotation_by
from fix_nosquish.motion.rotor import permute_1, permute_2, permute_3, rotation


@inlined
def rotor(q, p, i1, i2, i3, dt, small):
    q, p = rotation(q, p, permute_1(q), permute_1(p), 0.25 / i1, 0.5 * dt, small)
    q, p = rotation(q, p, permute_2(q), permute_2(p), 0.25 / i2, 0.5 * dt, small)
    q, p = rotation(q, p, permute_3(q), permute_3(p), 0.25 / i3, dt, small)
    q, p = rotation(q, p, permute_2(q), permute_2(p), 0.25 / i2, 0.5 * dt, small)
    return rotation(q, p, permute_1(q), permute_1(p), 0.25 / i1, 0.5 * dt, small)


@inlined
def friction(block, kind, dt, parameters):
    factor = exp(-parameters.friction * dt)
    for row in (V, V + 1, V + 2, P, P + 1, P + 2, P + 3):
        for b in range(LANES):
            block[row, b] *= factor


class Damped(NVE):
    splitting, method = "B A O A B", "NO_SQUISH with friction"
    motion = Operation(free_motion(rotation_by(rotor)), moves=True, named=False)
    operations = NVE.operations | {"A": motion, "O": Operation(friction, named=False)}
    numbers = record("Friction", NVE.numbers, friction=F)

    def extra_parameters(self, run):
        return {"friction": 0.01}  # 1 / time


__getattr__ = of_fix_line(Damped)
