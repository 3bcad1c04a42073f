"""Andersen's thermostat of translation: at random times all velocities get a new part."""

from math import exp, sqrt

from fix_nosquish import of_fix_line
from fix_nosquish.integrators.nvt import NVT
from fix_nosquish.integrators.thermostat import BODY, Bath, Thermostat, words_of_all
from fix_nosquish.loops.compiled import F, I, inlined, record
from fix_nosquish.motion.block import COUNTED, FREE, LANES, MASS, NUMBER, V, three, write
from fix_nosquish.motion.philox import normal_pair, words
from fix_nosquish.motion.step import Operation

Collisions = record("Collisions", Bath, part=F, happens=I)


@inlined
def decide(mpi, parameters, state, dt, gained):
    """Before letter O, once a step: whether there is a collision; alike on all ranks."""
    chance, _, _, _ = words_of_all(parameters, 0)
    parameters.happens = chance < (1.0 - exp(-parameters.rate * dt)) * 4294967296.0
    state[0] += parameters.happens
    return 0


@inlined
def collide(block, kind, dt, parameters):
    """Letter O."""
    given, lost = 0.0, 1.0 - sqrt(1.0 - parameters.part * parameters.part)
    if parameters.happens:
        step, draw, key = parameters.step, parameters.draw, parameters.key_1 | BODY
        for b in range(LANES):
            w0, w1, w2, w3 = words(block[NUMBER, b], step, draw, parameters.key_0, key)
            (x, y, z), (f1, f2, f3) = three(block, V, b), three(block, FREE, b)
            (a1, a2), (a3, _) = normal_pair(w0, w1), normal_pair(w2, w3)
            new = parameters.part * sqrt(parameters.kt / block[MASS, b])
            u, v = x + f1 * (new * a1 - lost * x), y + f2 * (new * a2 - lost * y)
            w = z + f3 * (new * a3 - lost * z)
            write(block, V, b, (u, v, w))
            more = u * u + v * v + w * w - x * x - y * y - z * z
            given += block[COUNTED, b] * 0.5 * block[MASS, b] * more
    parameters.heat += given


class Andersen(Thermostat):
    operation, acts = Operation(collide, prepared=True), decide
    numbers, state_size = Collisions, 1  # of its state: how many collisions there were
    method, keeps_momentum = "Andersen's thermostat", False

    def extra_parameters(self, run):
        part = run.number("part")
        if not 0.0 < part <= 1.0:
            raise self.command.wrong(f"keyword part is {part:g}, and must be above 0 and at most 1")
        return {"part": part}


class AndersenNVT(NVT):
    thermostats = {"andersen": Andersen}
    extra_keywords = {"part": "the part of a velocity that a collision makes new"}
    values = NVT.values | {"collisions": False}

    def extra_values(self, run):
        return *super().extra_values(run), self.thermostat.state[0]


__getattr__ = of_fix_line(AndersenNVT)
