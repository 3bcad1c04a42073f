"""What a sweep measures: which scenes with which steps and integrators, for how long, and what a budget allows."""

from dataclasses import dataclass
from math import ceil, floor, log10

from validation import paper, paper_peptide
from validation.integrators import SWEPT
from validation.rounds import LEAST
from validation.scenes import SCENES as ALL

BUDGET, SHORT_BUDGET = 600.0, 6.0  # minutes
FINER = 16  # the reference's step is the smallest one over this
TIMED = 0.05  # s of a timed segment at least, as far as the nominal cost is right
FRAMES = 20  # of a run
SAMPLES = 5000  # of a run at most
OURS = "nosquish"
# what --short leaves out: mrot 2, tolerances, and fixes of one integrator in another distribution of the work
SHORT = OURS, "nosquish-4", "matubayasi-nakahara", "gear", "rigid/nve", "rigid/nve/small", "rigid", "shake-1e-4", "shake-1e-8", "rattle-1e-4"

COMMON = ("energy_sd", "drift", "paper", "position", "orientation", "potential", "equipartition")
HELD = ("bond", "angle")
PHYSICAL = ("convergence", "ke_distribution", "pv_equipartition")


@dataclass(frozen=True)
class Sweep:
    """What is swept of a scene.

    Attributes:
        scene: a ``Scene``.
        steps: time steps, fs; all divide ``horizon``.  short_steps: of --short.
        starts: their number.  short_starts: of --short.
        measures: names in ``MEASURES`` that apply; nothing else is computed.
        horizon: fs after which positions and orientations are compared.
        fine: fs; a shorter step does as many steps as this one.
        apart: ps between one start and the next, at the scene's usual step.
        sampled: fs between samples; more, if these were two steps or less, or more than ``SAMPLES``.
        law: fs up to which averages are taken to go with dt^2.
        seconds: of a step on one core, and ``startup``: of a run without steps, nominal; only budgets follow from them.
        weight: share of the budget.
        temperature: K.
        short_bodies: a smaller start for --short.
    """

    scene: object
    steps: tuple[float, ...]
    short_steps: tuple[float, ...]
    starts: int
    short_starts: int
    measures: tuple[str, ...]
    horizon: float
    fine: float
    apart: float
    sampled: float
    law: float
    seconds: float
    startup: float
    weight: float
    temperature: float
    short_bodies: int | None = None

    @property
    def with_reference(self):
        """Whether something is held against a reference solution."""
        return not {"position", "orientation"}.isdisjoint(self.measures)

    def steps_of(self, short):
        """Time steps, fs."""
        return self.short_steps if short else self.steps

    def bodies(self, short):
        """Number of bodies."""
        return (self.short_bodies if short else None) or self.scene.unit

    @property
    def several(self):
        """Whether more than one rank makes sense: not for a scene of two bodies."""
        return self.scene.unit > 100


SWEEPS = {
    "dimer": Sweep(
        ALL["dimer"], (0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.5, 2.0, 3.0, 4.0), (0.2, 0.4, 0.8, 2.0, 4.0), 8, 2, (*COMMON, *HELD, "convergence"),
        horizon=60.0, fine=0.1, apart=60.0, sampled=6.0, law=0.6, seconds=2e-6, startup=0.8, weight=3.0, temperature=paper.TEMPERATURE["dimer"],
    ),
    "water": Sweep(
        ALL["water"], (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0), (1.0, 2.0, 4.0, 8.0, 12.0), 4, 1,
        (*COMMON, "pressure", "g_oo", *HELD, *PHYSICAL),
        horizon=120.0, fine=1.0, apart=2.0, sampled=12.0, law=4.0, seconds=20e-3, startup=1.2, weight=7.0, temperature=paper.TEMPERATURE["water"],
        short_bodies=512,
    ),
    "peptide": Sweep(
        paper_peptide.scene(), (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0), (1.0, 2.0, 4.0, 8.0), 4, 1,
        (*COMMON, "pressure", "helix", *HELD, *PHYSICAL),
        horizon=120.0, fine=1.0, apart=2.0, sampled=12.0, law=4.0, seconds=30e-3, startup=2.0, weight=10.0, temperature=paper.TEMPERATURE["peptide"],
    ),
}  # fmt: skip
SCENES = tuple(SWEEPS)
SHORT_SCENES = "dimer", "water"


@dataclass(frozen=True)
class Point:
    """A scene's name, an ``Integrator``, a time step in fs."""

    scene: str
    integrator: object
    dt: float


@dataclass(frozen=True)
class Lengths:
    """How much is done of a scene.

    Attributes:
        starts: their number.
        time: ps of the sampled part of a run; less where the step is shorter than ``Sweep.fine``.
        minutes: what all of it may take.  budget: of which this is a part.
    """

    starts: int
    time: float
    minutes: float
    budget: float


@dataclass(frozen=True)
class Parts:
    """A run, one part after the other, in steps: to the horizon; a timed segment; the sampled part, frame by frame; another timed segment.

    So what disturbs one of the two timed segments may spare the other.

    Attributes:
        horizon: steps to it.  timed: of a timed segment.  frame: between two frames.  every: between two samples.
    """

    horizon: int
    timed: int
    frame: int
    every: int

    @property
    def begin(self):
        """Step of the first sample."""
        return self.horizon + self.timed

    @property
    def end(self):
        """Step of the last sample."""
        return self.begin + FRAMES * self.frame

    @property
    def runs(self):
        """The list of a job's runs."""
        return [self.horizon, self.timed, *(FRAMES * [self.frame]), self.timed]

    @property
    def overhead(self):
        """Steps without samples."""
        return self.horizon + 2 * self.timed

    @property
    def samples(self):
        """The next step with thermodynamic output, in the words of LAMMPS's variables: nothing within the first and the timed runs but their ends."""
        parts = {
            f"(step<{self.horizon})": f"{self.horizon}",
            f"(step>={self.horizon})*(step<{self.begin})": f"{self.begin}",
            f"(step>={self.begin})*(step<{self.end})": f"stride({self.begin},{self.end},{self.every})",
            f"(step>={self.end})": f"stride({self.end},{sum(self.runs)},{self.timed})",
        }
        return "+".join(f"{when}*{step}" for when, step in parts.items())

    at_horizon = 1  # in a run's positions
    frames = slice(2, 3 + FRAMES)  # in its positions
    segments = 1, 2 + FRAMES  # in its timings


def parts(swept, dt, time):
    """The ``Parts`` of a run of so many ps with a time step in fs."""
    steps = time * paper.FS_PER_PS / max(dt, swept.fine)
    every = max(2, round(swept.sampled / dt), ceil(steps / SAMPLES))
    return Parts(round(swept.horizon / dt), max(LEAST, round(TIMED / swept.seconds)), every * max(1, ceil(steps / every / FRAMES)), every)


def points(names, short=False, only=None, steps=None):
    """What is measured, in the order in which it runs from each start.

    Args:
        names: of ``SCENES``.
        short: whether with the steps and integrators of --short.
        only: names in ``SWEPT``; None is all.
        steps: fs; None is the scene's own.
    """
    names_of = only or (SHORT if short else SWEPT)
    return [
        Point(name, SWEPT[one], dt)
        for name in names
        for dt in sorted(steps or SWEEPS[name].steps_of(short))
        for one in SWEPT
        if one in names_of and SWEPT[one].can_run(SWEEPS[name].scene)
    ]


def lengths(names, short=False, budget=None):
    """How much is done of each scene, so that all of them are done in about the budget.

    The scenes share it by their weights, whether they are named or not, so that they can be swept one by one into the same folder.  What a step
    and a start cost is taken from `Sweep`, not measured: the same budget gives the same runs.

    Args:
        names: of ``SCENES``.
        short: whether with the steps and integrators of --short.
        budget: minutes of all scenes (of --short: of ``SHORT_SCENES``); None is ``BUDGET`` or ``SHORT_BUDGET``.

    Returns:
        dict: name to ``Lengths``.
    """
    budget = budget or (SHORT_BUDGET if short else BUDGET)
    whole = sum(SWEEPS[name].weight for name in (SHORT_SCENES if short else SCENES))
    return {name: _lengths(name, short, budget, budget * SWEEPS[name].weight / whole) for name in names}


def _lengths(name, short, budget, minutes):
    swept = SWEEPS[name]
    starts = swept.short_starts if short else swept.starts
    scene_points = points([name], short)
    cost = swept.seconds * swept.bodies(short) / swept.scene.unit
    reference = FINER * swept.horizon / min(swept.steps_of(short)) if swept.with_reference else 0
    first = starts * (2 * swept.startup + cost * (reference + swept.apart * paper.FS_PER_PS / swept.scene.dt))
    fixed = sum(swept.startup + cost * parts(swept, point.dt, 0).overhead for point in scene_points)
    each = sum(cost * paper.FS_PER_PS / max(point.dt, swept.fine) for point in scene_points)
    time = max((60 * minutes - first - starts * fixed) / (starts * each), FRAMES * 2 * swept.sampled / paper.FS_PER_PS)
    return Lengths(starts, _two_digits(time), minutes, budget)


def _two_digits(value):
    """A positive number rounded down to two digits, so that it does not depend on how a budget was rounded."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return round(floor(value / unit * (1 + 1e-9)) * unit, 12)


def total(points, lengths):
    """How many runs there are."""
    return sum(lengths[point.scene].starts for point in points) + sum(2 * lengths[name].starts for name in {point.scene for point in points})
