"""One run with OpenMM, in a process of its own: ``python openmm_worker.py JOB``.

The job is a JSON file, and has all numbers and OpenMM's expression of the forces, in OpenMM's units
(nm, ps, kJ/mol, g/mol).  Each line that comes out has a step, the potential energy and the
pressure, in kJ/mol and bar.  An error of OpenMM's is said behind them, and the exit status is 1.
"""

import json
import sys
from pathlib import Path

import openmm


def system(job: dict) -> openmm.System:
    """Rigid three-site molecules with the job's forces, and a barostat that only tells the
    pressure: it never changes the box."""
    made = openmm.System()
    made.setDefaultPeriodicBoxVectors(*(tuple(row) for row in job["box"]))
    force = openmm.CustomNonbondedForce(job["energy"])
    force.setNonbondedMethod(openmm.CustomNonbondedForce.CutoffPeriodic)
    force.setCutoffDistance(job["cutoff"])
    force.setUseSwitchingFunction(False)
    for name in job["parameters"]:
        force.addPerParticleParameter(name)
    for first in range(0, len(job["x"]), 3):
        for mass, values in zip(job["mass"], job["values"]):
            made.addParticle(mass)
            force.addParticle(values)
        for (i, j), length in zip(((0, 1), (0, 2), (1, 2)), job["lengths"]):
            made.addConstraint(first + i, first + j, length)
            force.addExclusion(first + i, first + j)
    made.addForce(force)
    barostat = openmm.MonteCarloBarostat(1.0, job["temperature"], 0)
    made.addForce(barostat)
    return made


def context(job: dict) -> openmm.Context:
    """At the job's start, with velocities of its temperature."""
    integrator = openmm.LangevinMiddleIntegrator(job["temperature"], job["friction"], job["dt"])
    integrator.setConstraintTolerance(job["tolerance"])
    integrator.setRandomNumberSeed(job["seed"])
    platform = openmm.Platform.getPlatformByName(job["platform"])
    how = {"Threads": "1"} if job["platform"] == "CPU" else {}
    made = openmm.Context(system(job), integrator, platform, how)
    made.setPositions([openmm.Vec3(*row) for row in job["x"]])
    made.setVelocitiesToTemperature(job["temperature"], job["seed"])
    return made


def main(job: dict) -> None:
    """Do the run."""
    place = context(job)
    barostat = next(
        one for one in place.getSystem().getForces() if isinstance(one, openmm.MonteCarloBarostat)
    )
    for step in range(0, job["steps"] + 1, job["every"]):
        if step:
            place.getIntegrator().step(job["every"])
        energy = place.getState(getEnergy=True).getPotentialEnergy()._value
        pressure = barostat.computeCurrentPressure(place)._value
        print(step, repr(energy), repr(pressure), flush=True)


if __name__ == "__main__":
    try:
        main(json.loads(Path(sys.argv[1]).read_text()))
    except openmm.OpenMMException as error:
        sys.exit(f"ERROR: {error}")
