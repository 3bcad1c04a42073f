"""How often verdicts of `compare` are wrong: runs with known errors, noise of any kind, and starts
out of equilibrium, through all that is made of them."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation.compare import case as cases
from validation.compare import choice, errors
from validation.compare.errors import Numbers, Series
from validation.experiment import Point
from validation.scenes.integrators import OURS
from validation.statistics import measures

STEPS = 1.0, 1.5, 2.0, 3.0, 4.0, 6.0
SAMPLES, BINS, EVERY = 400, 40, 12
POINTS = [Point(name, dt) for dt in STEPS for name in (OURS, "other")]
HELD = POINTS[0]
CASE = cases.Case(
    word="synthetic",
    scene=SimpleNamespace(units="lj", dt=1.0),
    integrators={},
    reference=OURS,
    usual=(),
    steps=STEPS,
    temperature=1.0,
    boltzmann=1.0,
    bath=True,
)
TARGETS = {"drift": 1e-3, "temperature": 0.01, "energy": 0.2, "potential": 0.05, "density": 0.005,
           "rdf": 0.03}  # fmt: skip


class World:
    """Runs whose errors are known: so many ``sizes`` of the target at a step of 3.

    Args:
        size: of the error, in targets.
        slow: part of the noise that is slow, and its correlation time in lengths of a run.
        settles: how far the first start is from equilibrium, in noises of a run's mean, at once
            and after one run.
        shape: of the error against the step.
    """

    def __init__(self, random, size, slow=(0.0, 0.1), settles=0.0, noise=0.3,
                 lasts=1.0, shape=lambda dt: dt**2 / 9):  # fmt: skip
        self.random, self.size, self.slow, self.settles = random, size, slow, settles
        self.noise, self.lasts, self.shape = noise, lasts, shape

    def error(self, name, point):
        return TARGETS[name] * self.size * self.shape(point.dt)

    def series(self, number, columns=()):
        """Noise of which a run's mean has a standard deviation of about 1, (samples, columns); what
        settles goes on from start to start."""
        part, time = self.slow
        shape = (number, *columns)
        fast = self.random.normal(size=shape) * np.sqrt(number)
        kept = np.exp(-1 / (time * number))
        first, *more = self.random.normal(size=shape)
        driven = np.concatenate([[first], np.sqrt(1 - kept**2) * np.array(more)])
        slow = signal.lfilter([1], [1, -kept], driven, axis=0)
        return np.sqrt(1 - part**2) * fast + part * slow

    def settling(self, start):
        times = start - 1 + np.linspace(0, 1, SAMPLES)
        return self.settles * np.exp(-times / self.lasts)

    def run(self, point, start):
        """`Numbers` of a run."""
        noise = {name: self.noise * most for name, most in TARGETS.items()}
        step = EVERY * np.arange(SAMPLES)
        kept = self.kept(point, step * point.dt)
        settling = self.settling(start)

        def mean(name, more=1.0):
            off = self.error(name, point) + noise[name] * (self.series(SAMPLES) + more * settling)
            return off

        thermo = {
            "Step": step,
            "TotEng": kept,
            "Econserve": kept,
            "KinEng": 10 + self.random.normal(size=SAMPLES),
            "Temp": np.ones(SAMPLES),
            "PotEng": -5 + mean("potential"),
            "Density": 1 + mean("density"),
        }
        made = Series(thermo, SimpleNamespace(count=1), range(1), point.dt)
        estimates = {one.key: one.of(made) for one in errors.observables(CASE)}
        kinds = [measures.mean(mean("temperature")) for _ in range(2)]
        curve = np.sqrt(2) * np.sin(np.linspace(0, 6 * np.pi, BINS, endpoint=False))
        off = self.series(20, (BINS,)).mean(axis=0) * noise["rdf"]
        off += noise["rdf"] * settling.mean() * np.roll(curve, 3)
        return Numbers(estimates, kinds, 1 + self.error("rdf", point) * curve + off)

    def kept(self, point, time):
        """The energy that is to be kept: noise whose changes are those of the step, and a drift."""
        change = self.error("energy", point)
        slope = self.error("drift", point) * 20 / CASE.ns  # of 20 degrees of freedom
        return change * self.random.normal(size=SAMPLES) + slope * time

    def verdicts(self):
        """Of each target (point, verdict, whether the error is within it)."""
        found = {point: {start: self.run(point, start) for start in (1, 2)} for point in POINTS}
        told = errors.errors(CASE, found, HELD)
        for point, own in told.items():
            for name, most in TARGETS.items():
                known = {name: choice.size(own[name])} if name in own else {}
                met = choice.meets({"failed": None, "errors": known}, {name: most})
                yield name, point, met, self.error(name, point) <= most
