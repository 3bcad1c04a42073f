"""What ``sample`` runs: starts, schemes with time steps from each start, and timed runs."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ..experiment import Outcome, Point, Trajectory, perform
from ..running import machine, rounds, run
from ..running.starts import from_dump, to_dump
from ..running.store import Store
from ..scenes import FS_PER_PS, Scene, steps
from .engine import EngineRun, of_scene
from .schemes import FIRST_SEED, RAW, Scheme

SAMPLED = 24.0  # fs between samples, or the nearest multiple of the step
SETTLES, SETTLE = 0.1, 10.0  # equilibration: part of a point's time, and ps at most
BEGIN = 20.0  # ps at most of a run that creates a start
LEAST = 20.0  # ps of a point: in shorter runs, blocks are as short as the correlation time
TOO_LONG = 5  # in units of the longest default step: beyond, atoms are lost at once
BEGIN_STEP = 2.0  # fs at most, in a run that creates a start
SPARSE = 2  # ratio of other engines' sampling intervals: OpenMM's pressure costs two steps
ROUNDS, SECONDS = 3, 0.5  # of timed runs; s of each of their segments
TIMED = "timed"  # folder of these runs, and name of their records
TIMES = {False: 300.0, True: 20.0}  # ps of a point, by whether it is --short
SHORT = {  # points of --short, where the scene has the scheme
    "langevin-20": (2.0, 4.0, 8.0),
    "langevin-20-equal-6": (8.0, 12.0),
    "langevin-20-scale-4": (8.0, 12.0),
    "rigid/nvt/small": (2.0,),
    "rigid+langevin": (2.0, 4.0),
    "shake+langevin": (1.0, 2.0, 4.0),
    "npt-langevin": (2.0, 4.0, 6.0),
    "npt-langevin-400atm": (6.0,),
    "rigid/npt/small": (2.0,),
    "shake+npt": (1.0, 2.0),
}
DIPOLE = "c_dipole[1]", "c_dipole[2]", "c_dipole[3]"
KINETIC, MOVES, TORQUE = "c_kinetic", "v_moves", "v_torque"
# of fix nosquish/nvt, for refined averages: kinetic energies and temperatures of both motions, and
# the part of the shadow Hamiltonian
MOTIONS, SHADOW = (("f_1[1]", "f_1[3]"), ("f_1[2]", "f_1[4]")), "f_1[5]"
REFINED = *MOTIONS[0], *MOTIONS[1], SHADOW
# the kinetic energy of the bodies, that of their centres, and their torques, for any integrator;
# {1} to {3} are the parts of an atom's force
BODIES = (
    "compute molecules {group} chunk/atom molecule",
    "compute centres {group} temp/chunk molecules kecom",
    "variable moves equal sum(c_centres[1])",
    "compute kinetic {group} ke",
    "compute place {group} property/atom xu yu zu",
    "compute middle {group} com/chunk molecules",
    "compute middles {group} chunk/spread/atom molecules c_middle[*]",
    *(
        f"variable torque{i} atom (c_place[{j}]-c_middles[{j}])*{{{k}}}"
        f"-(c_place[{k}]-c_middles[{k}])*{{{j}}}"
        for i, j, k in ((1, 2, 3), (2, 3, 1), (3, 1, 2))
    ),
    "compute torques {group} reduce/chunk molecules sum v_torque1 v_torque2 v_torque3",
    "variable torques vector c_torques[1]^2+c_torques[2]^2+c_torques[3]^2",
    "variable torque equal sum(v_torques)",
)
FORCES = ("fx", "fy", "fz"), ("f_raw[1]", "f_raw[2]", "f_raw[3]")


@dataclass(frozen=True)
class Lengths:
    """Length of the runs of each point from each start, ps, the number of starts, and the seed
    that precedes those of the starts."""

    time: float
    starts: int = 1
    seed: int = FIRST_SEED

    @property
    def folder(self) -> str:
        """Folder of the runs; runs of other lengths or starts have other folders."""
        return f"{self.time:.12g}-ps" + f"-{self.seed}" * (self.seed != FIRST_SEED)

    def seed_of(self, start: int) -> int:
        """The seed of a start, from 1."""
        return self.seed + start

    @property
    def settle(self) -> float:
        """Length of the equilibration, ps."""
        return min(SETTLE, SETTLES * self.time)

    @property
    def begin(self) -> float:
        """Length of a run that creates a start, ps."""
        return min(BEGIN, self.time)

    def runs(self, dt: float, stride: int = 1) -> list[int]:
        """The steps of equilibration, and of sampling: multiples of ``stride``."""
        return [at_least_one(ps, stride * dt) * stride for ps in (self.settle, self.time)]

    def every(self, dt: float, scheme: Scheme) -> int:
        """The steps between samples: at least eight samples a run; one step for refined
        averages."""
        if scheme.refined:
            return 1
        stride = scheme.stride
        sampled = self.runs(dt, stride)[1] // stride
        return stride * max(1, min(round(SAMPLED / (stride * dt)), sampled // 8))


def at_least_one(time: float, dt: float) -> int:
    """The number of steps of dt (fs) in a time (ps), at least one."""
    return max(1, steps(time, dt))


@dataclass(frozen=True)
class Plan:
    """A scene at its temperature, what is run, and what is measured.

    Attributes:
        schemes: by name.
        starter: creates the starts.
        known: points that users run today, for comparison of costs.
        turning: degrees of freedom of all rotation; 0 if temperatures of translation and rotation
            are not measured.
        dipole: whether the total dipole is measured.
        longest: the longest step of an extrapolation, fs; 0 for the scheme's reach.
    """

    scene: Scene
    temperature: float
    schemes: Mapping[str, Scheme]
    starter: Scheme
    known: tuple[Point, ...]
    turning: int = 0
    dipole: bool = False
    longest: float = 0.0

    def refuse_long(self, dt: Collection[float]) -> None:
        """Refuse time steps, fs, at which nothing is stable.

        Raises:
            SystemExit: one is longer than `TOO_LONG` times the longest default step.
        """
        longest = TOO_LONG * max(step for scheme in self.schemes.values() for step in scheme.steps)
        if max(dt, default=0.0) > longest:
            raise SystemExit(
                f"--dt {max(dt):g}: {max(dt):g} fs is too long for a step: nothing is stable here "
                f"beyond {longest:g} fs"
            )

    def label(self, point: Point) -> str:
        """The label of a point, for tables and the terminal."""
        return f"{self.schemes[point.scheme].label}, {point.dt:g} fs"

    def points(
        self,
        only: Collection[str] | None = None,
        dt: Collection[float] | None = None,
        short: bool = False,
    ) -> list[Point]:
        """The points to measure, in the order in which they run; a point at another state comes
        after that at the first one.

        Args:
            only: names of schemes; None is all of LAMMPS, or with ``short`` those of `SHORT`.
            dt: time steps, fs; None is each scheme's own, or with ``short`` that of `SHORT`.
        """
        names = [name for name in self.schemes if name in (only or self.schemes)]
        usual = {name: scheme.steps for name, scheme in self.schemes.items()}
        if short:
            usual |= {name: dts for name, dts in SHORT.items() if name in usual}
        if not only:
            usual = {name: usual[name] for name in names if self.schemes[name].usual}
            names = [*usual]
            names = [name for name in names if not short or name in SHORT] or names
        firsts = [(name, self.schemes[name].first or name) for name in names]
        points = [
            Point(scheme, step)
            for name, first in firsts
            for step in sorted(dt or usual[name])
            for scheme in (first, name)
        ]
        return list(dict.fromkeys(points))

    def ordered(self, points: Collection[Point]) -> list[Point]:
        """The points, once each, by scheme and step."""
        places = {name: place for place, name in enumerate(self.schemes)}
        return sorted(set(points), key=lambda point: (places[point.scheme], point.dt))

    def prints(self, scheme: Scheme) -> list[str]:
        """The LAMMPS commands of a run for the columns that are measured."""
        lines, columns = [], ["vol", "density", *self.scene.columns]
        if self.turning:
            forces = FORCES[RAW in scheme.lines]
            lines += [_filled(line, self.scene.group, forces) for line in BODIES]
            columns += [KINETIC, MOVES, TORQUE]
        if scheme.refined:
            columns += REFINED
        if self.dipole:
            lines += [f"variable dipole{i} atom q*c_place[{i}]" for i in (1, 2, 3)]
            lines += ["compute dipole all reduce sum v_dipole1 v_dipole2 v_dipole3"]
            columns += DIPOLE
        return [*lines, *run.thermo(*columns), *self.scene.output]


def _filled(line: str, group: str, forces: Collection[str]) -> str:
    """A command with its words in braces replaced; LAMMPS's own braces stay."""
    for name, word in {"group": group, **dict(zip("123", forces))}.items():
        line = line.replace(f"{{{name}}}", word)
    return line


@dataclass(frozen=True)
class Runs:
    """Runs in a folder.

    Attributes:
        silence: s without output after which a run is given up.
        fewer: whether steps other than the shortest run from half of the starts only.
    """

    plan: Plan
    lengths: Lengths
    folder: Path
    silence: float
    fewer: bool = False

    @property
    def store(self) -> Store:
        """Records of the runs, beside their files."""
        return Store(self.folder)

    @property
    def starts(self) -> range:
        """The numbers of the starts."""
        return range(1, self.lengths.starts + 1)

    def starts_of(self, point: Point, points: Collection[Point]) -> range:
        """The numbers of the starts from which one of these points runs."""
        longer = point.dt > min(other.dt for other in points)
        return self.starts[: -(-self.lengths.starts // 2)] if self.fewer and longer else self.starts

    def trajectories(self, points: Collection[Point]) -> list[Trajectory]:
        """The runs that create starts, then all points from each start in turn."""
        trajectories = [
            Trajectory(start_name(n), f"start {n}", partial(self.start, n)) for n in self.starts
        ]
        for n in self.starts:
            suffix = f", start {n}" * (len(self.starts) > 1)
            for point in (point for point in points if n in self.starts_of(point, points)):
                job, label = partial(self.job, point, n), self.plan.label(point) + suffix
                trajectories.append(Trajectory(_name(n, point), label, job, point, start_name(n)))
        return trajectories

    def perform(self, points: Collection[Point], meter: run.Meter) -> Outcome:
        """Run what has no result; a scheme that fails at a step may succeed at a longer one."""
        return perform(self.trajectories(points), self.store, meter, ladders=False)

    def steps(self, points: Collection[Point]) -> int:
        """The number of steps of all runs together."""
        return len(self.starts) * self._begin + sum(
            len(self.starts_of(point, points))
            * sum(self.lengths.runs(point.dt, self.plan.schemes[point.scheme].stride))
            for point in points
        )

    def left(self) -> list[Point]:
        """The points with runs in the folder."""
        names = {run.folder_name(name): name for name in self.plan.schemes}
        points = []
        for path in self.folder.glob("start-*/*-fs/job.json"):
            name, _, dt = path.parent.name.removesuffix("-fs").rpartition("-")
            if name in names:
                points.append(Point(names[name], float(dt)))
        return points

    def all_starts(self) -> range:
        """The numbers of the starts, and of those that commands with more starts have left."""
        left = (int(path.name.partition("-")[2]) for path in self.folder.glob("start-*"))
        return range(1, max([self.lengths.starts, *left]) + 1)

    def start(self, number: int) -> run.Job:
        """The run that creates a start."""
        seeded = self.plan.starter.seeded(self.lengths.seed_of(number))
        return run.job(
            self._of(seeded, self.plan.scene),
            seeded,
            self.folder / start_name(number),
            [self._begin],
            dt=self._step,
            every=max(1, self._begin // 100),
            keeps="nothing",
            silence=self.silence,
            more=to_dump(self._dump(number), self._begin),
            origin=machine.origin(self.plan.scene, seeded),
        )

    def job(self, point: Point, start: int) -> run.Job:
        """The run of a point from a start."""
        scheme, folder = self.plan.schemes[point.scheme], self.folder / _name(start, point)
        runs, every = (
            self.lengths.runs(point.dt, scheme.stride),
            self.lengths.every(point.dt, scheme),
        )
        if scheme.engine:
            return self._engine_job(point, start, folder, runs, SPARSE * every)
        return self._job(point, start, folder, runs, every, self.plan.prints(scheme))

    def lines(self, point: Point) -> list[str]:
        """The input of a point, for the page."""
        scheme = self.plan.schemes[point.scheme]
        if scheme.engine:
            return scheme.engine.words(self.job(point, 1).input)
        return scheme.commands(self.plan.scene)

    def costs(
        self, loops: Mapping[Point, tuple[int, float]], meter: run.Meter, time: bool
    ) -> dict[Point, list[float]]:
        """The CPU time per ps, s, in each round.  Points are timed in turn, without samples except
        for those of refined averages.  A point that fails has none.

        Args:
            loops: for each point the start from which it is timed, and roughly the s per step.
            time: whether to time points without a stored cost.

        Raises:
            KeyboardInterrupt: after Ctrl-C, or if there is no stored cost and ``time`` is False.
        """
        names = {_name(start, point): point for point, (start, _) in loops.items()}

        def make(name: str, number: int) -> run.Job:
            point = names[name]
            (start, loop), scheme = loops[point], self.plan.schemes[point.scheme]
            counts, stride = rounds.lengths(loop, SECONDS).runs, scheme.stride
            runs = [-(-count // stride) * stride for count in counts]
            folder = self.folder / TIMED / f"{name}-{number}"
            if scheme.engine:  # which tells the time of all its steps only
                return self._engine_job(point, start, folder, [sum(runs)], sum(runs))
            prints = run.thermo("vol", *REFINED) if scheme.refined else []
            return self._job(point, start, folder, runs, int(scheme.refined), prints)

        def measure() -> dict[str, list[float]]:
            if not time:
                raise KeyboardInterrupt
            labels = {name: f"{self.plan.label(point)}, timed" for name, point in names.items()}
            timings, _, interrupted = rounds.in_turn(labels, make, ROUNDS, meter)
            if interrupted:
                raise KeyboardInterrupt
            return {
                name: [cost(timing.loop or 0.0, timing.cpu, names[name].dt) for timing in times]
                for name, times in timings.items()
            }

        jobs = {name: make(name, 0) for name in names}
        origins = {name: [job.commands, job.origin] for name, job in jobs.items()}
        with self.store.locked(TIMED):
            stored = self.store.once(TIMED, self.store.origin(ROUNDS, SECONDS, origins), measure)
        return {names[name]: times for name, times in stored.items() if times}

    def _job(
        self, point: Point, start: int, folder: Path, runs: list[int], every: int, more: list[str]
    ) -> run.Job:
        """A run of LAMMPS; it begins with zero momentum, because some schemes conserve it."""
        scheme = self.plan.schemes[point.scheme].seeded(self.lengths.seed_of(start))
        dump = self._dump(start)
        begun = from_dump(
            self.plan.scene, dump, self._begin, box=self.plan.starter.pressure is not None
        )
        rest = f"velocity {'all' if scheme.whole else begun.group} zero linear"
        begun = self._of(scheme, replace(begun, setup=(*begun.setup, rest)))
        return run.job(
            begun,
            scheme,
            folder,
            runs,
            dt=point.dt,
            every=every,
            keeps="nothing",
            silence=self.silence,
            more=more,
            origin=machine.origin(self.plan.scene, scheme, dump),
        )

    def _engine_job(
        self, point: Point, start: int, folder: Path, runs: list[int], every: int
    ) -> run.Job:
        """A run of another engine."""
        scheme = self.plan.schemes[point.scheme]
        assert scheme.engine
        how = scheme.lines[0], self.plan.temperature, scheme.friction, point.dt
        return scheme.engine.job(
            EngineRun(*how, runs, every, self.lengths.seed_of(start)),
            of_scene(self.plan.scene),
            folder,
            self.silence,
        )

    @property
    def _step(self) -> float:
        """The time step of starts, fs: not above the scene's own, which a user's script may
        need."""
        return min(BEGIN_STEP, self.plan.scene.dt)

    @property
    def _begin(self) -> int:
        """The number of steps of a start."""
        return at_least_one(self.lengths.begin, self._step)

    def _dump(self, start: int) -> Path:
        return (self.folder / start_name(start) / "state.dump").resolve()

    @staticmethod
    def _of(scheme: Scheme, scene: Scene) -> Scene:
        return replace(scene, others=()) if scheme.whole else scene


def start_name(number: int) -> str:
    """The folder of a start."""
    return f"start-{number}/start"


def _name(start: int, point: Point) -> str:
    """The folder of a point's run from a start."""
    return f"start-{start}/{run.folder_name(point.scheme)}-{point.dt:g}-fs"


def table(job: run.Job) -> tuple[run.Result, dict[str, np.ndarray]]:
    """The result of a run, and its samples after equilibration by column; none after an error."""
    result = run.collect(job.directory)
    sampled = result.thermo.get("Step", np.empty(0)) >= job.runs[0]
    samples = {name: values[sampled] for name, values in result.thermo.items()}
    if not result.error and not all(np.isfinite(values).all() for values in samples.values()):
        result.error = "energy is not finite"
    return result, {} if result.error else samples


def cost(loop: float, cpu: float | None, dt: float) -> float:
    """The CPU time per ps, s.

    Args:
        loop: wall time per step, us.  cpu: CPU use, percent.  dt: fs.
    """
    return loop * 1e-6 * FS_PER_PS / dt * (100.0 if cpu is None else cpu) / 100
