"""What ``ensembles`` runs: a scene, thermostats with their time steps, lengths."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

from validation.command_line import chosen
from validation.scenes import Scene, smooth_water, steps
from validation.scenes.integrators import Integrator, constrained, nosquish, rigid

TEMPERATURE = 298.0  # K
DAMPING, STRONG = 200.0, 50.0  # fs; friction of 5/ps and of 20/ps
STEPS = 2.0, 4.0, 6.0, 8.0  # fs
SHORT_STEPS = 4.0, 8.0
SAMPLED = 24.0  # fs between samples: all of `STEPS` divide it
FULL_TIME, SHORT_TIME = 300.0, 2.0  # ps of a point
SETTLES, SETTLE = 0.1, 10.0  # of a point's time, and ps at most, that are left out before it
BEGIN, BEGIN_STEP = 20.0, 2.0  # ps and fs of a run that makes a start
FIRST_SEED = 7100
SEED = "SEED"  # in a scheme's lines

# the forces of LAMMPS's thermostat, and the energy that they give, for any integrator
BATH = f"fix bath {{group}} langevin {TEMPERATURE:g} {TEMPERATURE:g} {DAMPING:g} {SEED} tally yes"


@dataclass(frozen=True)
class Scheme:
    """A thermostat with its integrator.

    Attributes:
        damping: fs.
        integrator: its lines have `SEED` where a start's own number goes.
        held: degrees of freedom of the total momentum, where the scheme keeps it at zero.
    """

    damping: float
    integrator: Integrator
    held: int = 0

    @property
    def name(self) -> str:
        """The word on the command line and in files."""
        return self.integrator.name

    @property
    def label(self) -> str:
        """How tables and figures call it."""
        return self.integrator.label

    @property
    def ours(self) -> bool:
        """Whether it is this package's thermostat."""
        return "fix_nosquish.NVT" in self.integrator.lines[-1]

    def seeded(self, start: int) -> Integrator:
        """With the random numbers of a start, from 1."""
        lines = (line.replace(SEED, str(FIRST_SEED + start)) for line in self.integrator.lines)
        return replace(self.integrator, lines=tuple(lines))


def _middle(name: str, label: str, words: str, damping: float = DAMPING, held: int = 0) -> Scheme:
    """This package's thermostat, in the middle of the step."""
    words = f" temp {TEMPERATURE:g} {TEMPERATURE:g} {damping:g} thermostat {words}"
    return Scheme(damping, nosquish(name, label, words, "NVT"), held)


def _kicked(name: str, label: str, integrator: Integrator) -> Scheme:
    """Fix langevin, beside an integrator of constant energy."""
    lines = (BATH, *integrator.lines)
    return Scheme(DAMPING, replace(integrator, name=name, label=label, lines=lines))


def _nvt() -> Scheme:
    one = rigid("rigid/nvt/small")
    words = f" temp {TEMPERATURE:g} {TEMPERATURE:g} {DAMPING:g}"
    return Scheme(DAMPING, replace(one, lines=tuple(line + words for line in one.lines)), held=3)


SCHEMES = {
    scheme.name: scheme
    for scheme in (
        _middle("langevin-5", "NVT langevin 5/ps", f"langevin seed {SEED}"),
        _middle("langevin-20", "NVT langevin 20/ps", f"langevin seed {SEED}", STRONG),
        _middle("csvr", "NVT csvr", f"csvr seed {SEED}", held=3),
        _middle("nh", "NVT nh", "nh", held=3),
        _nvt(),
        _kicked("rigid+langevin", "rigid/nve/small + langevin", rigid("rigid/nve/small")),
        _kicked("shake+langevin", "shake + langevin", constrained("shake", "1e-6")),
        _kicked("nosquish+langevin", "fix_nosquish.NVE + langevin", nosquish("", "")),
    )
}
STARTER = SCHEMES["langevin-20"]  # makes the starts


class Point(NamedTuple):
    """A scheme's name, and a time step in fs."""

    scheme: str
    dt: float

    @property
    def label(self) -> str:
        """For the terminal."""
        return f"{SCHEMES[self.scheme].label}, {self.dt:g} fs"


# biases are the distances from this one; the second tells how near it is to the limit
REFERENCE, BESIDE = Point("langevin-5", 1.0), Point("langevin-5", 2.0)


@dataclass(frozen=True)
class Lengths:
    """How much is done of each point: ps of each start, and the number of these."""

    time: float
    starts: int = 1

    @property
    def settle(self) -> float:
        """ps before it that are left out."""
        return min(SETTLE, SETTLES * self.time)

    @property
    def begin(self) -> float:
        """ps of a run that makes a start."""
        return min(BEGIN, self.time)

    def runs(self, dt: float) -> list[int]:
        """Steps that are left out, and steps that are sampled."""
        return [at_least_one(self.settle, dt), at_least_one(self.time, dt)]

    def every(self, dt: float) -> int:
        """Steps between samples: of a settled run at least eight of them."""
        return max(1, min(round(SAMPLED / dt), self.runs(dt)[1] // 8))


def at_least_one(time: float, dt: float) -> int:
    """How many steps of dt (fs) a time (ps) has; a run without any would sample nothing."""
    return max(1, steps(time, dt))


def scene() -> Scene:
    """The water that all schemes move."""
    title = "512 TIP3P molecules at 298 K and 0.997 g/cm³, smooth cutoff at 8.5 Å"
    return smooth_water("water-512", title, "water_512", "512", 512)


def points(only: Collection[str] | None = None, dt: Collection[float] = STEPS) -> list[Point]:
    """What is measured, in the order in which it runs: the reference first, whatever is wanted.

    Args:
        only: names of schemes; None is all.
        dt: time steps, fs.
    """
    found = [Point(name, one) for name in chosen(SCHEMES, only) for one in sorted(dt)]
    return list(dict.fromkeys([REFERENCE, *found]))


def names(points: Collection[Point], lengths: Lengths) -> Iterator[tuple[str, Point, int]]:
    """(name of its folder, point, start) of each run: all points from the first start, then all
    from the next one."""
    for start in range(1, lengths.starts + 1):
        for point in points:
            yield f"start-{start}/{point.scheme.replace('/', '-')}-{point.dt:g}-fs", point, start


def total(points: Collection[Point], lengths: Lengths) -> int:
    """Steps of all runs together."""
    start = at_least_one(lengths.begin, BEGIN_STEP)
    return lengths.starts * (start + sum(sum(lengths.runs(one.dt)) for one in points))
