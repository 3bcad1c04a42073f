"""What a sweep measures: which scenes with which steps and integrators, for how long, and what a
budget allows."""

from bisect import bisect
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import ceil

from ..running.rounds import LEAST
from ..scenes import FS_PER_PS, TEMPERATURE, Scene
from ..scenes import SCENES as ALL
from ..scenes import peptide as paper_peptide
from ..scenes.integrators import OURS, SWEPT, Integrator

BUDGET, SHORT_BUDGET = 290.0, 7.0  # minutes
FINER = 16  # the reference's step is the smallest one over this
TIMED = 0.2  # s of a timed segment at least, as far as the nominal cost is right
SAMPLED = 250  # steps of the sampled part at least: what fails late has time to
FRAMES = 25  # of a run
SAMPLES = 5000  # of a run at most
# ps of a sampled part, any of these
TIMES = [float(f"{digits}e{power}") for power in range(-2, 6) for digits in range(10, 100)]
SHORT_TIME = 0.1  # ps of it at least, of --short
# accuracy of PPPM: an integrator's error is measured, not the mesh's.  With 1e-5 the energy of the
# peptide at 0.5 fs wanders in 4 ps by 0.072 kcal/mol; with 1e-6 by 0.026, with 1e-7 by 0.022
MESH = "1e-6"
# --short leaves out mrot, tolerances, and fixes that only distribute the work otherwise
_RIGID = "rigid/nve", "rigid/nve/small", "rigid"
_HELD = "shake-1e-4", "shake-1e-8", "rattle-1e-4"
SHORT = (OURS, "matubayasi-nakahara", "gear", *_RIGID, *_HELD)

ENERGY = ("energy_sd", "energy_sd_line", "drift", "paper")
COMMON = (*ENERGY, "position", "orientation", "potential", "equipartition")
# held against a solution, or limits, of ours and the rigid fixes
AGAINST = ("position", "orientation", "potential", "equipartition", "pressure")
HELD = ("bond", "angle")
PHYSICAL = ("convergence", "ke_distribution", "pv_equipartition")


@dataclass(frozen=True)
class Sweep:
    """What is swept of a scene."""

    scene: Scene
    steps: tuple[float, ...]  # time steps, fs; all divide ``horizon``
    starts: int  # their number
    measures: tuple[str, ...]  # names in ``MEASURES`` that apply; nothing else is computed
    bodies: int  # their number
    # s of a step on one core, and of a run without steps, nominal: only budgets follow from them
    seconds: float
    startup: float
    horizon: float = 60.0  # fs after which positions and orientations are compared
    fine: float = 1.0  # fs; a shorter step does as many steps as this one
    apart: float = 2.0  # ps between one start and the next, at the scene's usual step
    sampled: float = 5.0  # fs between samples; at least two steps, and at most `SAMPLES` samples
    least: float = 1.0  # ps of the sampled part at least
    law: float = 4.0  # fs up to which averages are taken to go with dt^2
    # what shake and rattle hold otherwise than the rigid fixes, in a sentence; then nothing of
    # theirs is held `AGAINST` numbers of ours
    differs: str | None = None

    @property
    def temperature(self) -> float:
        """K."""
        return TEMPERATURE[self.scene.name]

    def same(self, integrator: Integrator) -> bool:
        """Whether an integrator holds the same bodies as ours."""
        return not (self.differs and integrator.kind == "constraints")

    def measures_of(self, integrator: Integrator) -> list[str]:
        """Names of the measures that apply to an integrator."""
        return [name for name in self.measures if self.same(integrator) or name not in AGAINST]


def _on_mesh(scene: Scene) -> Scene:
    """The scene with PPPM of the accuracy `MESH`."""
    subject = scene.subject and f"{scene.subject}, PPPM {MESH}"
    return replace(scene.on_mesh(MESH), title=f"{scene.title}, PPPM {MESH}", subject=subject)


_DIMER = Sweep(
    ALL["dimer"],
    (0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.5, 2.0, 3.0, 4.0),
    4,
    (*COMMON, *HELD, "convergence"),
    ALL["dimer"].unit,
    seconds=2e-6,
    startup=0.8,
)
_WATER = Sweep(
    _on_mesh(ALL["water"]),
    (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 10.0, 12.0),
    4,
    (*COMMON, "pressure", "g_oo", *HELD, *PHYSICAL),
    bodies=512,
    seconds=13e-3,
    startup=1.2,
)
_PEPTIDE = Sweep(
    _on_mesh(paper_peptide.scene()),
    (0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 10.0),
    2,
    (*COMMON, "pressure", "helix", *HELD, *PHYSICAL),
    ALL["peptide"].unit,
    seconds=40e-3,
    startup=2.0,
    differs="shake and rattle leave the H-X-H angles of CH3 and NH3 free, so they move another "
    "model: their trajectories and averages are not held against those of rigid groups",
)
_DIMER = replace(_DIMER, fine=0.1, apart=60.0, sampled=6.0, least=100.0, law=0.6)
SWEEPS = {"dimer": _DIMER, "water": _WATER, "peptide": _PEPTIDE}
# of --short: steps, starts
_SHORT = {
    "dimer": ((0.2, 0.4, 0.8, 2.0, 4.0), 2),
    "water": ((1.0, 2.0, 4.0, 7.5, 12.0), 1),
    "peptide": ((1.0, 2.0, 4.0, 7.5), 1),
}
SHORT_SWEEPS = {
    name: replace(SWEEPS[name], steps=steps, starts=starts, least=SHORT_TIME)
    for name, (steps, starts) in _SHORT.items()
}
SCENES = tuple(SWEEPS)
SHORT_SCENES = "dimer", "water"


@dataclass(frozen=True)
class Point:
    """A scene's name, an integrator, a time step in fs."""

    scene: str
    integrator: Integrator
    dt: float


@dataclass(frozen=True)
class Lengths:
    """How much is done of a scene."""

    starts: int  # their number
    # ps of the sampled part of a run; less where the step is shorter than ``Sweep.fine``, more
    # where that were less than ``SAMPLED`` steps
    time: float
    minutes: float  # that all of it may take
    budget: float  # of which this is a part


@dataclass(frozen=True)
class Parts:
    """Steps of a run: to the horizon; of a timed segment; of the sampled part, frame by frame; of
    another timed segment, as what disturbs one may spare the other."""

    horizon: int
    timed: int
    frame: int  # between two frames
    every: int  # between two samples

    at_horizon = 1  # in a run's positions
    frames = slice(2, 3 + FRAMES)  # in its positions
    segments = 1, 2 + FRAMES  # in its timings

    @property
    def begin(self) -> int:
        """Step of the first sample."""
        return self.horizon + self.timed

    @property
    def end(self) -> int:
        """Step of the last sample."""
        return self.begin + FRAMES * self.frame

    @property
    def runs(self) -> list[int]:
        """Steps of a job's runs."""
        return [self.horizon, self.timed, *(FRAMES * [self.frame]), self.timed]

    @property
    def samples(self) -> str:
        """The next step with thermodynamic output, in the words of LAMMPS's variables: nothing
        within the first and the timed runs but their ends."""
        at, begin, end = self.horizon, self.begin, self.end
        return (
            f"(step<{at})*{at}+(step>={at})*(step<{begin})*{begin}"
            f"+(step>={begin})*(step<{end})*stride({begin},{end},{self.every})"
            f"+(step>={end})*stride({end},{sum(self.runs)},{self.timed})"
        )


def sweeps(short: bool) -> dict[str, Sweep]:
    """What is swept of each scene."""
    return SHORT_SWEEPS if short else SWEEPS


def parts(swept: Sweep, dt: float, time: float) -> Parts:
    """The run of so many ps, or ``SAMPLED`` steps if these are longer, with a time step in fs."""
    steps = max(SAMPLED, time * FS_PER_PS / max(dt, swept.fine))
    every = max(2, round(swept.sampled / dt), ceil(steps / SAMPLES))
    timed = max(LEAST, round(TIMED / swept.seconds))
    return Parts(round(swept.horizon / dt), timed, every * ceil(steps / every / FRAMES), every)


def points(
    names: Iterable[str],
    short: bool = False,
    only: Sequence[str] | None = None,
    steps: Sequence[float] | None = None,
) -> list[Point]:
    """What is measured, in the order in which it runs from each start, with integrators of these
    names and these time steps, fs; None is the scene's own.

    Raises:
        ValueError: a step does not divide a scene's horizon.
    """
    found = []
    for name in names:
        swept = sweeps(short)[name]
        for dt in sorted(steps or swept.steps):
            if abs(swept.horizon / dt - round(swept.horizon / dt)) > 1e-6:
                raise ValueError(
                    f"{dt:g} fs does not divide the {swept.horizon:g} fs after which trajectories "
                    f"of the {name} are compared"
                )
            those = (SWEPT[one] for one in SWEPT if one in (only or (SHORT if short else SWEPT)))
            found += [Point(name, one, dt) for one in those if one.can_run(swept.scene)]
    return found


def lengths(
    names: Iterable[str], short: bool = False, budget: float | None = None
) -> dict[str, Lengths]:
    """How much is done of each scene, so that all of them are done within the budget, minutes, by
    the nominal costs: the same budget gives the same runs.

    The scenes share it as they would the least budget, whether they are named or not, so that they
    can be swept one by one into the same folder.

    Raises:
        ValueError: the budget is too little; the message says how much it has to be.
    """
    budget = budget or (SHORT_BUDGET if short else BUDGET)
    least = {name: minutes(name, short, one.least) for name, one in sweeps(short).items()}
    whole = sum(least[name] for name in (SHORT_SCENES if short else SCENES))
    if budget < whole:
        raise ValueError(
            f"{budget:g} minutes are too little for runs of the least length: {ceil(whole)} are "
            "needed"
        )
    found = {}
    for name in names:
        part = budget * least[name] / whole
        time = TIMES[bisect(TIMES, part * (1 + 1e-9), key=partial(minutes, name, short)) - 1]
        found[name] = Lengths(sweeps(short)[name].starts, time, part, budget)
    return found


def minutes(name: str, short: bool, time: float) -> float:
    """What a scene costs, nominal, with sampled parts of so many ps."""
    swept = sweeps(short)[name]
    steps = swept.apart * FS_PER_PS / swept.scene.dt + FINER * swept.horizon / min(swept.steps)
    runs = [sum(parts(swept, point.dt, time).runs) for point in points([name], short)]
    seconds = (2 + len(runs)) * swept.startup + (steps + sum(runs)) * swept.seconds
    return swept.starts * seconds / 60


def total(points: Iterable[Point], lengths: Mapping[str, Lengths]) -> int:
    """How many runs there are: of the points, and of each start two, itself and its reference."""
    points = list(points)
    runs = [point.scene for point in points] + 2 * list({point.scene for point in points})
    return sum(lengths[name].starts for name in runs)
