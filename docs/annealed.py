"""Langevin's thermostat with ten times the friction in the first tenth of a run."""

from fix_nosquish import of_fix_line
from fix_nosquish.integrators.langevin import Langevin
from fix_nosquish.integrators.nvt import NVT
from fix_nosquish.loops.compiled import F, I, inlined, record


@inlined
def anneal(mpi, parameters, state, dt, gained):
    early = parameters.step < parameters.until
    parameters.rate = (10.0 if early else 1.0) * parameters.late_rate
    return 0


class Annealed(Langevin):
    numbers = record("Annealed", Langevin.numbers, late_rate=F, until=I)
    acts = anneal

    def extra_parameters(self, run):
        begin, (*_, rate) = run.lammps.step, self.ensemble.temperature()
        return {"late_rate": rate, "until": begin + (run.host.last_step - begin) // 10}


class AnnealedNVT(NVT):
    thermostats = NVT.thermostats | {"langevin": Annealed}


__getattr__ = of_fix_line(AnnealedNVT)
