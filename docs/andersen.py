"""Andersen's thermostat: bodies collide with a bath, and get new velocities."""

from math import exp, sqrt

from fix_nosquish import of_fix_line
from fix_nosquish.integrators.nvt import NVT
from fix_nosquish.integrators.thermostat import BODY, Thermostat
from fix_nosquish.loops.compiled import inlined
from fix_nosquish.motion.block import COUNTED, FREE, LANES, MASS, NUMBER, V, three, write
from fix_nosquish.motion.philox import normal_pair, words
from fix_nosquish.motion.step import Operation


@inlined
def collide(block, kind, dt, parameters):
    often, key = 1.0 - exp(-parameters.rate * dt), parameters.key_1 | BODY
    given = 0.0
    for b in range(LANES):
        w0, w1, w2, w3 = words(block[NUMBER, b], parameters.step, 0, parameters.key_0, key)
        chance = words(block[NUMBER, b], parameters.step, 1, parameters.key_0, key)
        if chance[0] < often * 4294967296.0:
            (x, y, z), (f1, f2, f3) = three(block, V, b), three(block, FREE, b)
            (a1, a2), (a3, _) = normal_pair(w0, w1), normal_pair(w2, w3)
            speed = sqrt(parameters.kt / block[MASS, b])
            u, v = x + f1 * (speed * a1 - x), y + f2 * (speed * a2 - y)
            w = z + f3 * (speed * a3 - z)
            write(block, V, b, (u, v, w))
            more = u * u + v * v + w * w - x * x - y * y - z * z
            given += block[COUNTED, b] * 0.5 * block[MASS, b] * more
    parameters.heat += given


class Andersen(Thermostat):
    operation = Operation(collide, prepared=True)
    method, keeps_momentum = "Andersen's thermostat", False


class AndersenNVT(NVT):
    thermostats = NVT.thermostats | {"langevin": Andersen}


__getattr__ = of_fix_line(AndersenNVT)
