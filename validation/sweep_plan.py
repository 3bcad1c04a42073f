"""What a sweep measures: which scenes with which steps and integrators, for how long, and what a budget allows."""

from bisect import bisect
from dataclasses import dataclass, replace
from math import ceil

from validation import paper, paper_peptide
from validation.integrators import SWEPT
from validation.rounds import LEAST
from validation.scenes import SCENES as ALL

BUDGET, SHORT_BUDGET = 290.0, 7.0  # minutes
FINER = 16  # the reference's step is the smallest one over this
TIMED = 0.2  # s of a timed segment at least, as far as the nominal cost is right
SAMPLED = 250  # steps of the sampled part at least: what fails late has time to
FRAMES = 25  # of a run
SAMPLES = 5000  # of a run at most
TIMES = [
    float(f"{digits}e{power}") for power in range(-2, 6) for digits in range(10, 100)
]  # ps of a sampled part, any of these
SHORT_TIME = 0.1  # ps of it at least, of --short
# accuracy of PPPM: an integrator's error is measured, not the mesh's.  With 1e-5 the energy of the peptide at 0.5 fs wanders in 4 ps
# by 0.072 kcal/mol; with 1e-6 by 0.026, with 1e-7 by 0.022
MESH = "1e-6"
OURS = "nosquish"
# what --short leaves out: mrot, tolerances, and fixes of one integrator in another distribution of the work
SHORT = (
    OURS,
    "matubayasi-nakahara",
    "gear",
    "rigid/nve",
    "rigid/nve/small",
    "rigid",
    "shake-1e-4",
    "shake-1e-8",
    "rattle-1e-4",
)

COMMON = (
    "energy_sd",
    "energy_sd_line",
    "drift",
    "paper",
    "position",
    "orientation",
    "potential",
    "equipartition",
)
AGAINST = (
    "position",
    "orientation",
    "potential",
    "equipartition",
    "pressure",
)  # held against a solution, or limits, of ours and the rigid fixes
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
        bodies: their number.
        horizon: fs after which positions and orientations are compared.
        fine: fs; a shorter step does as many steps as this one.
        apart: ps between one start and the next, at the scene's usual step.
        sampled: fs between samples; more, if these were two steps or less, or more than ``SAMPLES``.
        least: ps of the sampled part at least, but for --short.
        law: fs up to which averages are taken to go with dt^2.
        seconds: of a step on one core, and ``startup``: of a run without steps, nominal; only budgets follow from them.
        temperature: K.
        differs: what shake and rattle hold otherwise than the rigid fixes, in a sentence; then nothing of theirs is held ``AGAINST`` numbers of ours.
    """

    scene: object
    steps: tuple[float, ...]
    short_steps: tuple[float, ...]
    starts: int
    short_starts: int
    measures: tuple[str, ...]
    bodies: int
    horizon: float
    fine: float
    apart: float
    sampled: float
    least: float
    law: float
    seconds: float
    startup: float
    temperature: float
    differs: str | None = None

    def same(self, integrator):
        """Whether an integrator holds the same bodies as ours."""
        return not (self.differs and integrator.kind == "constraints")

    def measures_of(self, integrator):
        """Names of the measures that apply to an integrator."""
        return [name for name in self.measures if self.same(integrator) or name not in AGAINST]

    @property
    def with_reference(self):
        """Whether something is held against a reference solution."""
        return not {"position", "orientation"}.isdisjoint(self.measures)

    def steps_of(self, short):
        """Time steps, fs."""
        return self.short_steps if short else self.steps

    def starts_of(self, short):
        """Number of starts."""
        return self.short_starts if short else self.starts

    @property
    def several(self):
        """Whether more than one rank makes sense: not for a scene of two bodies."""
        return self.bodies > 100


def _on_mesh(scene):
    """The scene with PPPM of the accuracy `MESH`."""
    return replace(
        scene.on_mesh(MESH),
        title=f"{scene.title}, PPPM {MESH}",
        subject=scene.subject and f"{scene.subject}, PPPM {MESH}",
    )


SWEEPS = {
    "dimer": Sweep(
        ALL["dimer"], (0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.5, 2.0, 3.0, 4.0), (0.2, 0.4, 0.8, 2.0, 4.0), 4, 2, (*COMMON, *HELD, "convergence"),
        bodies=ALL["dimer"].unit, horizon=60.0, fine=0.1, apart=60.0, sampled=6.0, least=100.0, law=0.6, seconds=2e-6, startup=0.8,
        temperature=paper.TEMPERATURE["dimer"],
    ),
    "water": Sweep(
        _on_mesh(ALL["water"]), (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 10.0, 12.0), (1.0, 2.0, 4.0, 7.5, 12.0), 4, 1,
        (*COMMON, "pressure", "g_oo", *HELD, *PHYSICAL),
        bodies=512, horizon=60.0, fine=1.0, apart=2.0, sampled=5.0, least=1.0, law=4.0, seconds=13e-3, startup=1.2,
        temperature=paper.TEMPERATURE["water"],
    ),
    "peptide": Sweep(
        _on_mesh(paper_peptide.scene()), (0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 10.0), (1.0, 2.0, 4.0, 7.5), 2, 1,
        (*COMMON, "pressure", "helix", *HELD, *PHYSICAL),
        bodies=ALL["peptide"].unit, horizon=60.0, fine=1.0, apart=2.0, sampled=5.0, least=1.0, law=4.0, seconds=40e-3, startup=2.0,
        temperature=paper.TEMPERATURE["peptide"],
        differs="shake and rattle leave the H-X-H angles of CH3 and NH3 free, so they move another model: their trajectories and averages are not held "
        "against those of rigid groups",
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
        time: ps of the sampled part of a run; less where the step is shorter than ``Sweep.fine``, more where that were less than ``SAMPLED`` steps.
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
    """The ``Parts`` of a run of so many ps, or ``SAMPLED`` steps if these are longer, with a time step in fs."""
    steps = max(SAMPLED, time * paper.FS_PER_PS / max(dt, swept.fine))
    every = max(2, round(swept.sampled / dt), ceil(steps / SAMPLES))
    return Parts(
        round(swept.horizon / dt),
        max(LEAST, round(TIMED / swept.seconds)),
        every * ceil(steps / every / FRAMES),
        every,
    )


def points(names, short=False, only=None, steps=None):
    """What is measured, in the order in which it runs from each start.

    Args:
        names: of ``SCENES``.
        short: whether with the steps and integrators of --short.
        only: names in ``SWEPT``; None is all.
        steps: fs; None is the scene's own.

    Raises:
        ValueError: a step does not divide a scene's horizon.
    """
    names_of = only or (SHORT if short else SWEPT)
    for name, dt in ((name, dt) for name in names for dt in steps or ()):
        number = SWEEPS[name].horizon / dt
        if abs(number - round(number)) > 1e-6:
            raise ValueError(
                f"{dt:g} fs does not divide the {SWEEPS[name].horizon:g} fs after which trajectories of the {name} are compared"
            )
    return [
        Point(name, SWEPT[one], dt)
        for name in names
        for dt in sorted(steps or SWEEPS[name].steps_of(short))
        for one in SWEPT
        if one in names_of and SWEPT[one].can_run(SWEEPS[name].scene)
    ]


def lengths(names, short=False, budget=None):
    """How much is done of each scene, so that all of them are done within the budget, as far as the nominal costs are right.

    The scenes share it as they would the least budget, whether they are named or not, so that they can be swept one by one into the same folder.  What
    a step and a start cost is taken from `Sweep`, not measured: the same budget gives the same runs.

    Args:
        names: of ``SCENES``.
        short: whether with the steps and integrators of --short.
        budget: minutes of all scenes (of --short: of ``SHORT_SCENES``); None is ``BUDGET`` or ``SHORT_BUDGET``.

    Returns:
        dict: name to ``Lengths``.

    Raises:
        ValueError: the budget is too little for runs of the least length; the message says how much it has to be.
    """
    budget = budget or (SHORT_BUDGET if short else BUDGET)
    least = {
        name: minutes(name, short, SHORT_TIME if short else SWEEPS[name].least) for name in SCENES
    }
    whole = sum(least[name] for name in (SHORT_SCENES if short else SCENES))
    if budget < whole:
        raise ValueError(
            f"{budget:g} minutes are too little for runs of the least length: {ceil(whole)} are needed"
        )
    found = {}
    for name in names:
        part = budget * least[name] / whole
        time = TIMES[
            bisect(TIMES, part * (1 + 1e-9), key=lambda time: minutes(name, short, time)) - 1
        ]
        found[name] = Lengths(SWEEPS[name].starts_of(short), time, part, budget)
    return found


def minutes(name, short, time):
    """What a scene costs, nominal, with sampled parts of so many ps."""
    swept = SWEEPS[name]
    steps = swept.apart * paper.FS_PER_PS / swept.scene.dt + (
        FINER * swept.horizon / min(swept.steps_of(short)) if swept.with_reference else 0
    )
    runs = [sum(parts(swept, point.dt, time).runs) for point in points([name], short)]
    return (
        swept.starts_of(short)
        * ((2 + len(runs)) * swept.startup + (steps + sum(runs)) * swept.seconds)
        / 60
    )


def total(points, lengths):
    """How many runs there are."""
    return sum(lengths[point.scene].starts for point in points) + sum(
        2 * lengths[name].starts for name in {point.scene for point in points}
    )
