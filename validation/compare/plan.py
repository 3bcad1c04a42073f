"""The plan: points, lengths, and the jobs of the runs.

Short runs of all points, from two starts: the scene's own, and one that a run of the reference
creates.  The scatter of a point's runs gives the noise that a single run does not show.
"""

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from ..experiment import Point, Trajectory
from ..running import machine, rounds, run, starts
from .case import SPAN, Case

STARTS = 2
FRAMES, APART = 200, 12  # frames of a run; steps between them if it is long
ATOMS, FEW = 6_000_000, 20  # most atoms in all frames of a run; but at least so many frames
SETTLES = 0.25  # fraction of the frames that is left out
PARTS, MANY = (8, 4, 2), 8000  # samples of the energy in `SPAN`; most in all if several
LEAST = 400  # steps of a run
BENCHMARK = 0.1  # fraction of the time for timing steps
TIMED = 0.1, 1.0  # least and most s of a timed segment
STARTUP = 3.0  # s until a run's first step, about, with few atoms
LISTS = 0.2  # fraction of all time for neighbour lists, if starting up leaves time for steps
OTHER_LISTS, ROUNDS = 3, 3  # settings timed beside the script's; rounds
LEAST_PART = 0.2  # least fraction of all time for steps, however long starting up takes
SHORT, LONG = "short", "longer"  # folders of runs


@dataclass(frozen=True)
class Settings:
    """Settings of the runs.

    Attributes:
        out: output folder.
        minutes: total time, planned from the time of a step when it is measured.
        silence: s without a sign of life after which a run is given up.
    """

    out: Path
    minutes: float
    ranks: int = 1
    silence: float = 120.0

    @property
    def for_lists(self) -> float:
        """Time for `lists`, s."""
        share = LISTS * 60 * self.minutes
        return share if share > 2 * STARTUP * ROUNDS * (1 + OTHER_LISTS) else 0.0

    @property
    def for_points(self) -> float:
        """Time for the points' runs, s."""
        return 60 * self.minutes - self.for_lists


class Machine(NamedTuple):
    """Cost of a run here: s per step, s until the first step, and the number of atoms."""

    step: float
    startup: float
    atoms: int


@dataclass(frozen=True)
class Lengths:
    """Lengths of runs: ``time`` of each in the scene's units, with at most ``frames`` frames.

    Sampling stops the run every few steps, which takes time: ``benchmark`` are the steps of the
    runs after it, without output, from which costs are measured.
    """

    time: float
    frames: int
    span: float  # of the energy changes
    benchmark: list[int] = field(default_factory=list)

    @property
    def sample(self) -> float:
        """Time between two samples of the energy: the span, or a part of it."""
        parts = next((count for count in PARTS if count * self.time <= MANY * self.span), 1)
        return min(self.span / parts, self.time / self.frames)

    def every(self, dt: float) -> int:
        """Steps between two samples."""
        return max(1, round(self.sample / dt))

    def runs(self, dt: float) -> list[int]:
        """The numbers of steps between frames."""
        samples = math.ceil(self.time / self.frames / self.sample * (1 - 1e-9))
        return [samples * self.every(dt)] * max(FEW, round(self.time / (samples * self.sample)))


def points(
    case: Case, only: Collection[str], steps: Sequence[float] | None
) -> tuple[list[Point], Point]:
    """The points of integrators with these names, from the shortest steps; and the reference of
    means: the reference integrator with the shortest step, or with half of it if it is the only
    one."""
    names = [name for name in case.integrators if name in only]
    dts = sorted(steps or case.steps)
    held = Point(case.reference, dts[0] if len(dts) > 1 else dts[0] / 2)
    return [Point(name, dt) for dt in dts for name in names], held


def calibrated(case: Case, settings: Settings, held: Point, meter: run.Meter) -> Machine:
    """The current cost of a run on this machine.

    Raises:
        SystemExit: the reference cannot begin.
        KeyboardInterrupt: after a Ctrl-C.
    """
    folder = settings.out / "runs" / "calibration"

    def make(runs):
        return run.job(
            case.scene,
            case.integrators[held.scheme],
            folder,
            runs,
            dt=held.dt,
            every=0,
            ranks=settings.ranks,
            keeps="nothing",
            silence=settings.silence,
        )

    meter.begin("a step's time", 1)
    try:
        step = rounds.calibrate(make)
    except RuntimeError as error:
        raise SystemExit(f"{case.scene.title}: {held.scheme}: {error}") from None
    meter.end(None)
    atoms = run.collect(folder).timings[-1].atoms
    return Machine(step, STARTUP + 2e-5 * atoms, atoms)


def time_of(points: Iterable[Point], machine: Machine, seconds: float) -> float:
    """The length of each of these runs, in the scene's units, if together they take so many s."""
    each = [1 / point.dt for point in points]
    left = max(LEAST_PART * seconds, seconds - len(each) * machine.startup)
    return left / (machine.step * sum(each))


def benchmark(machine: Machine, seconds: float) -> list[int]:
    """The numbers of steps of runs that together take about so many s, the first one untimed."""
    least, most = TIMED
    return rounds.lengths(machine.step, min(max(least, seconds / rounds.SEGMENTS), most)).runs


def lengths(case: Case, points: Collection[Point], machine: Machine, time: float) -> Lengths:
    """The lengths of the runs of points, with as many frames as the longest step and the memory
    allow."""
    longest = max(point.dt for point in points)
    time = max(time, LEAST * longest / 4, LEAST * case.scene.dt)
    most = max(FEW, ATOMS // machine.atoms)
    frames = min(most, max(FRAMES, int(time / longest / APART)))
    return Lengths(time, frames, SPAN * case.scene.dt)


def trajectories(
    case: Case,
    points: Iterable[Point],
    short: Lengths,
    settings: Settings,
    numbers: Iterable[int] = range(1, 1 + STARTS),
    longer: Lengths | None = None,
) -> list[Trajectory]:
    """The run that creates the second start, and the runs of points from each start in turn.

    Args:
        short: lengths of the short runs, which separate the starts.
        numbers: of the starts.
        longer: lengths of these runs, if they are not short ones.
    """
    how = (SHORT, short) if longer is None else (LONG, longer)
    last = sum(short.runs(case.scene.dt))
    return [_makes_start(case, short, settings)] + [
        _trajectory(case, point, *how, settings, number, last)
        for number in numbers
        for point in points
    ]


def name_of(folder: str, point: Point, number: int) -> str:
    """The name of the trajectory of a point from a start."""
    return f"{folder}/{run.folder_name(point.scheme)}/{point.dt:g}/{number}"


def _state(settings: Settings) -> Path:
    """The path of the dump that is the second start."""
    return (settings.out / "runs" / "start" / "state.dump").resolve()


def _makes_start(case: Case, lengths: Lengths, settings: Settings) -> Trajectory:
    integrator, steps = case.integrators[case.reference], sum(lengths.runs(case.scene.dt))

    def job() -> run.Job:
        return run.job(
            case.scene,
            integrator,
            settings.out / "runs" / "start",
            [steps],
            dt=case.scene.dt,
            every=lengths.every(case.scene.dt),
            keeps="nothing",
            more=starts.to_dump(_state(settings), steps),
            origin=machine.origin(case.scene, integrator),
            ranks=settings.ranks,
            silence=settings.silence,
        )

    return Trajectory("start", f"{integrator.label}, the second start", job)


def _trajectory(case, point, folder, lengths, settings, number, last) -> Trajectory:
    """The run of a point from a start; ``last``: step of the dump that is the second one."""
    integrator, state = case.integrators[point.scheme], _state(settings)
    name = name_of(folder, point, number)

    def job() -> run.Job:
        scene, files = case.scene, []
        if number > 1:
            begin = starts.read(state, last, scene.dimension, box=True)
            scene, files = replace(scene, setup=(*scene.setup, begin)), [state]
        job = run.job(
            scene,
            integrator,
            settings.out / "runs" / name,
            lengths.runs(point.dt),
            dt=point.dt,
            every=lengths.every(point.dt),
            keeps="motion",
            origin=machine.origin(case.scene, integrator, *files),
            ranks=settings.ranks,
            silence=settings.silence,
        )
        return replace(job, benchmark=lengths.benchmark)

    return Trajectory(
        name,
        f"{integrator.label}, {point.dt:g} {case.time}, start {number}",
        job,
        point,
        start="start" * (number > 1),
    )
