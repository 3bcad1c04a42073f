"""What ``engines`` runs: the thermostats of each engine with their time steps."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from ..command_line import chosen
from ..ensembles.lengths import Lengths, Point, folder
from ..ensembles.schemes import FIRST_SEED
from ..sampling.plan import CASES
from ..statistics.limit import Model
from . import with_gromacs, with_openmm
from .engine import Course, Engine

CASE = CASES["water"](Path())  # of `sampling`; it writes nothing
TIMES = {False: 300.0, True: 10.0}  # ps of a point, by whether it is --short
SPARSE = (
    2  # times as far apart as those of `sampling` samples are: OpenMM's pressure takes two steps
)


@dataclass(frozen=True)
class Scheme:
    """A thermostat of an engine.

    Attributes:
        name: the word on the command line and in files.
        label: for tables and figures.
        engine: that has it.
        thermostat: the engine's word.
        friction: 1/ps, see `Course`.
        steps: fs, of the points that are run if no other steps are asked for.
        model: how its means depend on the step.
        held: degrees of freedom of the total momentum that it keeps at zero.
        same: whether its forces are the scene's, as LAMMPS has them.
    """

    name: str
    label: str
    engine: Engine
    thermostat: str
    friction: float
    steps: tuple[float, ...]
    model: Model
    held: int = 0
    same: bool = False


_OPENMM, _GROMACS = with_openmm.ENGINE, with_gromacs.ENGINE
_MIDDLE = "LangevinMiddleIntegrator"
_LONG, _SHORT = (1.0, 2.0, 4.0, 6.0, 8.0), (1.0, 2.0, 4.0, 6.0)
SCHEMES: Mapping[str, Scheme] = {
    one.name: one
    for one in (
        Scheme(
            *("openmm-langevin-5", "OpenMM LangevinMiddle 5/ps", _OPENMM, _MIDDLE, 5.0, _LONG),
            *(Model(6.0), 0, True),
        ),
        Scheme(
            *("openmm-langevin-20", "OpenMM LangevinMiddle 20/ps", _OPENMM, _MIDDLE, 20.0, _LONG),
            *(Model(8.0), 0, True),
        ),
        Scheme("gromacs-sd", "GROMACS sd 5/ps", _GROMACS, "sd", 5.0, _SHORT, Model(6.0)),
        Scheme(
            *("gromacs-v-rescale", "GROMACS v-rescale 0.2 ps", _GROMACS, "v-rescale", 5.0, _SHORT),
            *(Model(6.0), 3),
        ),
    )
}


def points(only: Collection[str] | None, dt: Collection[float] | None) -> list[Point]:
    """What is run, in the order in which it runs.

    Args:
        only: names of schemes; None is all.
        dt: time steps, fs; None is each scheme's own.
    """
    names = chosen(list(SCHEMES), only)
    return [Point(name, one) for name in names for one in sorted(dt or SCHEMES[name].steps)]


def courses(some: Collection[Point], lengths: Lengths) -> Iterator[tuple[str, Point, Course]]:
    """(name, point, course) of each run: all points from the first start, then all from the
    next."""
    for start in range(1, lengths.starts + 1):
        for point in some:
            yield folder(start, *point), point, course(point, lengths, start)


def course(point: Point, lengths: Lengths, start: int) -> Course:
    """A point's run with the random numbers of a start, from 1."""
    scheme, dt = SCHEMES[point.scheme], point.dt
    how = scheme.thermostat, CASE.temperature, scheme.friction, dt
    every = SPARSE * lengths.every(dt)
    return Course(*how, sum(lengths.runs(dt)), every, FIRST_SEED + start)


def total(some: Collection[Point], lengths: Lengths) -> int:
    """Steps of all runs together."""
    return sum(one.steps for *_, one in courses(some, lengths))
