"""How long the runs of `ensembles` and `sampling` are, and how each is called."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from ..scenes import Scene, steps
from .schemes import Scheme

SAMPLED = 24.0  # fs between samples, or as near to it as a step allows
SETTLES, SETTLE = 0.1, 10.0  # of a point's time, and ps at most, that are left out before it
BEGIN, BEGIN_STEP = 20.0, 2.0  # ps and fs of a run that makes a start
LEAST = 20.0  # ps of a point: of a shorter one blocks are as short as the energy remembers


@dataclass(frozen=True)
class Lengths:
    """How much is done of each point: ps of each start, and the number of these."""

    time: float
    starts: int = 1

    @property
    def folder(self) -> str:
        """Of its runs: those of another length stay beside them."""
        return f"{self.time:.12g}-ps"

    @property
    def settle(self) -> float:
        """ps before it that are left out."""
        return min(SETTLE, SETTLES * self.time)

    @property
    def begin(self) -> float:
        """ps of a run that makes a start."""
        return min(BEGIN, self.time)

    def runs(self, dt: float, stride: int = 1) -> list[int]:
        """Steps that are left out, and steps that are sampled: multiples of ``stride``."""
        return [at_least_one(one, stride * dt) * stride for one in (self.settle, self.time)]

    def every(self, dt: float, stride: int = 1) -> int:
        """Steps between samples: of a settled run at least eight of them."""
        sampled = self.runs(dt, stride)[1] // stride
        return stride * max(1, min(round(SAMPLED / (stride * dt)), sampled // 8))

    def total(self, points: Iterable[tuple[Scheme, float]], begin_step: float = BEGIN_STEP) -> int:
        """Steps of all runs together, of schemes with time steps; ``begin_step`` of starts, fs."""
        start = at_least_one(self.begin, begin_step)
        each = sum(sum(self.runs(dt, scheme.stride)) for scheme, dt in points)
        return self.starts * (start + each)


def too_short(time: float) -> str:
    """Why nothing is held against bounds, of points with that many ps; empty where something is."""
    if time >= LEAST:
        return ""
    return (
        f"Nothing is held against bounds, for points of less than {LEAST:g} ps do not tell their "
        "own errors."
    )


def beside_tables(summary: Mapping, titles: Mapping[str, str], limits: Collection[str]) -> dict:
    """What is told of points beside their tables, as `points.write` and `points.show` take it: the
    sentences about limits, and why starts are in no average."""
    failed = summary.get("lost", {}).items()  # a former summary does not tell
    lost = (f"No average has start {number}, which failed: {why}." for number, why in failed)
    time = summary["settings"]["time"]
    return {"titles": titles, "limits": [*limits, *lost], "too_short": too_short(time)}


def step_of_starts(scene: Scene) -> float:
    """fs: not above the scene's own step, which a user's script may need."""
    return min(BEGIN_STEP, scene.dt)


def at_least_one(time: float, dt: float) -> int:
    """How many steps of dt (fs) a time (ps) has; a run without any would sample nothing."""
    return max(1, steps(time, dt))


class Point(NamedTuple):
    """A scheme's name, and a time step in fs."""

    scheme: str
    dt: float


class One(NamedTuple):
    """A run: where its files go, what the terminal calls it, and what it is."""

    name: str
    label: str
    scheme: Scheme
    dt: float
    start: int


def ordered(points: Collection[Point], schemes: Iterable[str]) -> list[Point]:
    """Points, once each, by scheme and step."""
    places = {name: place for place, name in enumerate(schemes)}
    return sorted(set(points), key=lambda one: (places[one.scheme], one.dt))


def folder(start: int, scheme: str, dt: float) -> str:
    """Of a run's files."""
    return f"start-{start}/{scheme.replace('/', '-')}-{dt:g}-fs"
