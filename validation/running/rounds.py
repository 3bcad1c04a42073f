"""Runs timed in turn, each a fresh process on the same start, in another order in each round.

A change in the machine's load then affects all of them alike, numbers of one round compare like
with like, and no run has the advantage of its place.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..statistics import measures
from . import run
from .run import Meter

KIB_PER_MIB = 1024
SETUPS = 2  # `run 0` before the steps: the first one also reads or compiles code
SEGMENTS = 3  # timed segments of a process
LEAST = 40  # steps of a segment: the last one writes output, and every tenth or so re-neighbours


@dataclass(frozen=True)
class Lengths:
    """Steps of a process: untimed ones first, then segments."""

    warm_up: int
    segment: int
    segments: int

    @property
    def runs(self) -> list[int]:
        """The list of a job's runs."""
        return [self.warm_up] + [self.segment] * self.segments


@dataclass(frozen=True)
class Timing:
    """What a completed run took: medians of the segments after the warm-up, if it has several.

    Attributes:
        modify, loop, sections: us per step, of LAMMPS's timing table.
        spent: us of CPU time per step, the mean over ranks.
        cpu: the smallest share of a core in a segment, in percent.
        steps: of each segment.
        setups: s of each `run 0`.
        memory: KiB of each rank at most.
        versions: what the worker says of itself.
    """

    modify: float | None = None
    loop: float | None = None
    spent: float | None = None
    cpu: float | None = None
    sections: dict = field(default_factory=dict)
    steps: list = field(default_factory=list)
    setups: list = field(default_factory=list)
    memory: list = field(default_factory=list)
    versions: dict = field(default_factory=dict)

    @property
    def setup(self) -> float:
        """s of the last `run 0`."""
        return self.setups[-1]

    @property
    def peak(self) -> float:
        """MiB of the rank with the most memory."""
        return max(self.memory) / KIB_PER_MIB


def lengths(loop: float, seconds: float) -> Lengths:
    """Segments that last so long.

    Args:
        loop: s of a step.
        seconds: of a segment; at least `LEAST` steps, and if those last longer, fewer segments.
    """
    segment = max(LEAST, round(seconds / loop))
    segments = min(SEGMENTS, max(1, round(SEGMENTS * seconds / (segment * loop))))
    return Lengths(max(3, min(1000, segment // 5)), segment, segments)


def calibrate(make: Callable[[list[int]], run.Job]) -> float:
    """s of a step of the job ``make(runs)``.

    Raises:
        RuntimeError: it fails; the message says why.
        KeyboardInterrupt: after a Ctrl-C.
    """
    steps = LEAST
    while True:
        result = run.run(make([3, steps]))
        if result.interrupted:
            raise KeyboardInterrupt
        if result.error:
            raise RuntimeError(result.error)
        loop = result.timings[-1].seconds
        if loop > 0.05 or steps >= 10000:
            return loop / steps
        steps = min(10000, int(0.2 * steps / max(loop, 1e-6)))


def in_turn(
    labels: dict[str, str], make: Callable[[str, int], run.Job], rounds: int, meter: Meter
) -> tuple[dict[str, list[Timing]], dict[str, str], bool]:
    """Run the jobs ``make(name, round)`` of all names in each round; one that fails is not run
    again.

    Returns:
        (timings, errors, interrupted): the `Timing` of each round and why it failed, by name, and
        whether a Ctrl-C ended it all.
    """
    timings: dict[str, list[Timing]] = {name: [] for name in labels}
    errors: dict[str, str] = {}
    for number, order in enumerate(orders([*labels], rounds), 1):
        for name in order:
            if name in errors:
                continue
            meter.begin(f"{labels[name]}, {number}/{rounds}", 1)
            job = make(name, number)
            result = run.run(job)
            error = result.error or run.no_number(result.thermo)
            meter.end(error)
            if result.interrupted:
                return timings, errors, True
            if error:
                errors[name] = error
            else:
                timings[name].append(timing(job, result))
    return timings, errors, False


def orders(names: Sequence[str], rounds: int) -> Iterator[list[str]]:
    """The order of names in each round: a new random one, then its reverse.

    Any two are in both orders equally often, so an effect of the place cancels in their ratio.
    With an odd number of rounds one is left, whose order differs from one invocation to the next.
    """
    random, order = np.random.default_rng(), [*names]
    for number in range(rounds):
        order = order[::-1] if number % 2 else [names[k] for k in random.permutation(len(names))]
        yield order


def timing(job: run.Job, result: run.Result) -> Timing:
    """What is kept of a completed run."""
    segments = result.timings[job.setups + (len(job.runs) > 1) :]
    names = segments[0].sections if segments else ()

    def median(section: str = "") -> float | None:
        seconds = [
            segment.sections[section] if section else segment.seconds for segment in segments
        ]
        times = [spent / segment.steps for spent, segment in zip(seconds, segments)]
        return float(np.median(times)) * 1e6 if times else None

    shares = [segment.cpu for segment in segments if segment.cpu is not None]
    spent = [
        1e4 * segment.cpu * segment.seconds / segment.steps
        for segment in segments
        if segment.cpu is not None
    ]
    return Timing(
        modify=median("Modify") if "Modify" in names else None,
        loop=median(),
        spent=float(np.median(spent)) if spent else None,
        cpu=min(shares, default=None),
        sections={name: median(name) for name in names},
        steps=[segment.steps for segment in segments],
        setups=result.seconds.get("setups", []),
        memory=result.memory,
        versions=result.versions,
    )


def spread(rounds: list[Timing], key: str) -> measures.Spread | None:
    """Median, minimum and maximum over rounds of one of their numbers; None if there is none."""
    return _spread(value for timing in rounds if (value := getattr(timing, key)) is not None)


def ratio(ours: list[Timing], theirs: list[Timing], key: str) -> measures.Spread | None:
    """Spread of ours over theirs, each pair of one round; None if there is no pair."""
    pairs = [(getattr(a, key), getattr(b, key)) for a, b in zip(ours, theirs)]
    return _spread(a / b for a, b in pairs if a is not None and b)


def difference(
    first: list[Timing], second: list[Timing], key: str, times: float = 1.0
) -> measures.Spread | None:
    """Spread of the first minus the second, each pair of one round; None if there is no pair."""
    pairs = [(getattr(a, key), getattr(b, key)) for a, b in zip(first, second)]
    return _spread((a - b) * times for a, b in pairs if a is not None and b is not None)


def _spread(values: Iterable[float]) -> measures.Spread | None:
    known = list(values)
    return measures.spread(known) if known else None
