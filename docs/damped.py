"""Rigid bodies with friction, whose rotations go about axes 1, 2, 3, 2, 1."""

from math import exp

from fix_nosquish import of_fix_line
from fix_nosquish.block import LANES, MOMENT, P, Q, V, four, three, write
from fix_nosquish.compiled import inlined
from fix_nosquish.nve import NVE, Operation
from fix_nosquish.operations import PARAMETERS, free_motion
from fix_nosquish.rotor import permute_1, permute_2, permute_3, rotation


@inlined
def rotate(block, dt, mrot):
    for b in range(LANES):
        q, p, half = four(block, Q, b), four(block, P, b), 0.5 * dt
        i1, i2, i3 = three(block, MOMENT, b)
        q, p = rotation(q, p, permute_1(q), permute_1(p), 0.25 / i1, half, False)
        q, p = rotation(q, p, permute_2(q), permute_2(p), 0.25 / i2, half, False)
        q, p = rotation(q, p, permute_3(q), permute_3(p), 0.25 / i3, dt, False)
        q, p = rotation(q, p, permute_2(q), permute_2(p), 0.25 / i2, half, False)
        q, p = rotation(q, p, permute_1(q), permute_1(p), 0.25 / i1, half, False)
        write(block, Q, b, q + p)  # rows P follow Q


@inlined
def friction(block, kind, dt, parameters):
    for row in (V, V + 1, V + 2, P, P + 1, P + 2, P + 3):
        for b in range(LANES):
            block[row, b] *= exp(-parameters[PARAMETERS] * dt)


class Damped(NVE):
    splitting, method = "B A O A B", "NO_SQUISH with friction"
    motion = Operation(free_motion(rotate), moves=True)
    operations = NVE.operations | {"A": motion, "O": Operation(friction)}
    own_parameters = staticmethod(lambda: (0.01,))  # 1 / time


__getattr__ = of_fix_line(Damped)
