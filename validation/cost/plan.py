"""What `cost` measures: points, each measured as a whole and kept."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..scenes import SCENES
from ..scenes.integrators import BENCHMARKED

PARTS = *SCENES, "start", "messages"
# ranks of the messages, if no others are named; on 27 each has its full 26 neighbours
COUNTED_ON = 1, 2, 4, 8, 16, 27
COMPARED = "nosquish", "rigid/nve", "rigid/nve/small"  # by their messages
PER_RANK = SCENES["water"].unit  # molecules, of the messages


@dataclass(frozen=True)
class Point:
    """A scene of one size on so many ranks, the start on so many, or its messages.

    Attributes:
        part: name of a scene or script, ``start`` or ``messages``.
        rounds: how often each integrator has its turn, and ``seconds`` of a timed segment; without
            rounds messages are counted only.
    """

    part: str
    ranks: int
    bodies: int = 0
    integrators: tuple[str, ...] = ()
    rounds: int = 0
    seconds: float = 0.0

    @property
    def name(self) -> str:
        """Of its record."""
        words = self.part, self.bodies, self.ranks
        return "-".join(str(word) for word in words if word)

    @property
    def scene(self) -> str:
        """Name of its scene."""
        return self.part if self.part not in ("start", "messages") else "water"

    @property
    def turns(self) -> int:
        """Runs that a meter counts."""
        if self.part == "start":
            return 2 * (self.rounds + 1)
        return (len(self.integrators) + 1) * self.rounds or len(self.integrators)

    @property
    def inputs(self) -> list[Path]:
        """Folders of its inputs; none of a script, which a record follows from as a whole."""
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
    found, few = [], ranks or (1, 2)
    for part in parts:
        if part == "start":
            found += [Point(part, number, rounds=rounds) for number in few]
        elif part == "messages":
            able = tuple(name for name in COMPARED if name in integrators)
            many = (ranks or COUNTED_ON) if able else ()
            found += [Point(part, number, number * PER_RANK, able) for number in many]
        else:
            scene = SCENES[part]
            able = tuple(name for name in integrators if BENCHMARKED[name].can_run(scene))
            own = sizes if scene.cutter else scene.sizes
            found += [
                Point(part, number, size, able, rounds, seconds)
                for number, size in itertools.product(few, own)
            ]
    return found
