"""The plan of `cost`: points, each measured and stored as a whole."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..scenes import SCENES
from ..scenes.integrators import BENCHMARKED

PARTS = *SCENES, "start", "messages"
# default ranks for messages; of 27 each has its full 26 neighbours
COUNTED_ON = 1, 2, 4, 8, 16, 27
COMPARED = "nosquish", "rigid/nve", "rigid/nve/small"  # integrators whose messages are counted
PER_RANK = SCENES["water"].unit  # molecules per rank, for messages


@dataclass(frozen=True)
class Point:
    """A scene of one size on so many ranks, the start-up on so many, or its messages.

    Attributes:
        part: name of a scene or script, ``start`` or ``messages``.
        rounds: turns of each integrator, and ``seconds`` of a timed segment; without rounds
            only messages are counted.
    """

    part: str
    ranks: int
    bodies: int = 0
    integrators: tuple[str, ...] = ()
    rounds: int = 0
    seconds: float = 0.0

    @property
    def name(self) -> str:
        """Name of its record."""
        words = self.part, self.bodies, self.ranks
        return "-".join(str(word) for word in words if word)

    @property
    def scene(self) -> str:
        """Name of its scene."""
        return self.part if self.part not in ("start", "messages") else "water"

    @property
    def turns(self) -> int:
        """Number of runs, for a meter."""
        if self.part == "start":
            return 2 * (self.rounds + 1)
        return (len(self.integrators) + 1) * self.rounds or len(self.integrators)

    @property
    def inputs(self) -> list[Path]:
        """Folders of its inputs; none for a script, whose record depends on all of it."""
        return [SCENES[self.scene].folder] if self.scene in SCENES else []


def points(
    parts: Iterable[str],
    ranks: tuple[int, ...] | None,
    sizes: Iterable[int],
    integrators: Sequence[str],
    rounds: int,
    seconds: float,
) -> list[Point]:
    """The points of these parts; ``sizes`` are those of the water, other scenes have one."""
    planned, few = [], ranks or (1, 2)
    for part in parts:
        if part == "start":
            planned += [Point(part, number, rounds=rounds) for number in few]
        elif part == "messages":
            able = tuple(name for name in COMPARED if name in integrators)
            many = (ranks or COUNTED_ON) if able else ()
            planned += [Point(part, number, number * PER_RANK, able) for number in many]
        else:
            scene = SCENES[part]
            able = tuple(name for name in integrators if BENCHMARKED[name].can_run(scene))
            planned += [
                Point(part, number, size, able, rounds, seconds)
                for size, number in itertools.product(sizes if scene.cutter else scene.sizes, few)
            ]
    return planned
