"""What ``ensembles`` runs: a scene, thermostats with their time steps, lengths."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

from validation.command_line import chosen
from validation.scenes import Scene, smooth_water, steps
from validation.scenes.integrators import Integrator, constrained, nosquish, rigid

TEMPERATURE, WARM = 298.0, 308.0  # K
PRESSURE, PRESSED = 1.0, 400.0  # atm
# states at constant pressure: ends of a scheme's name and label, temperature, pressure. From the
# first to the others it is as far as physical_validation advises: the tips of the distributions
# are some two standard deviations apart, which are 35 kcal/mol of an enthalpy, 1.1 % of a volume
STATES = (
    ("", "", TEMPERATURE, PRESSURE),
    (f"-{WARM:g}K", f", {WARM:g} K", WARM, PRESSURE),
    (f"-{PRESSED:g}atm", f", {PRESSED:g} atm", TEMPERATURE, PRESSED),
)
DAMPING, STRONG = 200.0, 50.0  # fs; friction of 5/ps and of 20/ps
PRESSURE_DAMPING = 500.0  # fs
STEPS = 2.0, 4.0, 6.0, 8.0  # fs
STATES_STEPS = 2.0, 6.0  # of states that are compared with the first
LIMIT_STEPS = 1.0, 2.0  # of LAMMPS's barostats, which have to agree in the limit only
MOMENT, EQUAL_STEPS = 6, (4.0, 8.0, 12.0)  # amu Angstrom^2 about each axis; its points
KNOWN_STEPS = 1.0, *STEPS, EQUAL_STEPS[-1]  # of which an output folder may have points
SHORT_STEPS = 4.0, 8.0
SAMPLED = 24.0  # fs between samples: all of `KNOWN_STEPS` divide it
FULL_TIME, SHORT_TIME = 300.0, 2.0  # ps of a point
SETTLES, SETTLE = 0.1, 10.0  # of a point's time, and ps at most, that are left out before it
BEGIN, BEGIN_STEP = 20.0, 2.0  # ps and fs of a run that makes a start
FIRST_SEED = 7100
SEED = "SEED"  # in a scheme's lines

# the forces of LAMMPS's thermostat, and the energy that they give, for any integrator
BATH = f"fix bath {{group}} langevin {TEMPERATURE:g} {TEMPERATURE:g} {DAMPING:g} {SEED} tally yes"


@dataclass(frozen=True)
class Scheme:
    """A thermostat with its integrator, with or without a barostat, at one state.

    Attributes:
        integrator: its lines have `SEED` where a start's own number goes.
        held: degrees of freedom of the total momentum, where the scheme keeps it at zero.
        temperature: K.
        pressure: atm; None at constant volume.
        first: name of the same scheme at the first of `STATES`, if this is at another one.
        steps: fs, of the points that are run if no other steps are asked for.
    """

    integrator: Integrator
    held: int = 0
    temperature: float = TEMPERATURE
    pressure: float | None = None
    first: str = ""
    steps: tuple[float, ...] = STEPS

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
        return any(f"fix_nosquish.{one}" in self.integrator.lines[-1] for one in ("NVT", "NPT"))

    @property
    def reference(self) -> "Point":
        """What stands for the limit of small steps: biases are the distances from it."""
        return REFERENCES[self.pressure is not None]

    def seeded(self, start: int) -> Integrator:
        """With the random numbers of a start, from 1."""
        lines = (line.replace(SEED, str(FIRST_SEED + start)) for line in self.integrator.lines)
        return replace(self.integrator, lines=tuple(lines))


def _state(
    damping: float = DAMPING, temperature: float = TEMPERATURE, pressure: float | None = None
) -> str:
    """The state in the words of a fix: this package's and LAMMPS's are the same."""
    words = f" temp {temperature:g} {temperature:g} {damping:g}"
    if pressure is None:
        return words
    return f"{words} iso {pressure:g} {pressure:g} {PRESSURE_DAMPING:g}"


def _nvt(
    name: str, label: str, words: str, damping: float = DAMPING, held: int = 0, **more
) -> Scheme:
    """This package's thermostat, in the middle of the step."""
    one = nosquish(name, label, f"{_state(damping)} thermostat {words}", "NVT")
    return Scheme(one, held, **more)


def _npt(name: str, label: str, words: str, held: int = 0) -> Iterator[Scheme]:
    """This package's thermostat and barostat, at all states."""
    for ending, said, temperature, pressure in STATES:
        line = f"{_state(DAMPING, temperature, pressure)} thermostat {words}"
        one = nosquish(name + ending, label + said, line, "NPT")
        first, steps = (name, STATES_STEPS) if ending else ("", STEPS)
        yield Scheme(one, held, temperature, pressure, first, steps)


def _kicked(name: str, label: str, integrator: Integrator) -> Scheme:
    """Fix langevin, beside an integrator of constant energy."""
    lines = (BATH, *integrator.lines)
    return Scheme(replace(integrator, name=name, label=label, lines=lines))


def _rigid(style: str, pressure: float | None = None, **more) -> Scheme:
    """LAMMPS's rigid bodies with chains."""
    one, words = rigid(style), _state(pressure=pressure)
    lines = tuple(line + words for line in one.lines)
    return Scheme(replace(one, lines=lines), held=3, pressure=pressure, **more)


def _constrained_npt() -> Scheme:
    one = constrained("shake", "1e-6")
    # LAMMPS wants shake first here
    lines = *one.lines[1:], "fix 1 {group} npt" + _state(pressure=PRESSURE)
    one = replace(one, name="shake+npt", label="shake + fix npt", lines=lines)
    return Scheme(one, held=3, pressure=PRESSURE, steps=LIMIT_STEPS)


SCHEMES = {
    scheme.name: scheme
    for scheme in (
        _nvt("langevin-5", "NVT langevin 5/ps", f"langevin seed {SEED}"),
        _nvt("langevin-20", "NVT langevin 20/ps", f"langevin seed {SEED}", STRONG),
        _nvt(
            "langevin-20-equal", f"NVT langevin 20/ps, moments of {MOMENT} amu Å²",
            f"langevin seed {SEED} moments equal {MOMENT}", STRONG, steps=EQUAL_STEPS,
        ),
        _nvt("csvr", "NVT csvr", f"csvr seed {SEED}", held=3),
        _nvt("nh", "NVT nh", "nh", held=3),
        _rigid("rigid/nvt/small"),
        _kicked("rigid+langevin", "rigid/nve/small + langevin", rigid("rigid/nve/small")),
        _kicked("shake+langevin", "shake + langevin", constrained("shake", "1e-6")),
        _kicked("nosquish+langevin", "fix_nosquish.NVE + langevin", nosquish("", "")),
        *_npt("npt-langevin", "NPT langevin 5/ps", f"langevin seed {SEED}"),
        *_npt("npt-csvr", "NPT csvr", f"csvr seed {SEED}", held=3),
        *_npt("npt-mtk", "NPT nh, mtk", "nh barostat mtk", held=3),
        _constrained_npt(),
        _rigid("rigid/npt/small", PRESSURE, steps=LIMIT_STEPS),
    )
}  # fmt: skip
STARTER = SCHEMES["langevin-20"]  # makes the starts


class Point(NamedTuple):
    """A scheme's name, and a time step in fs."""

    scheme: str
    dt: float

    @property
    def label(self) -> str:
        """For the terminal."""
        return f"{SCHEMES[self.scheme].label}, {self.dt:g} fs"

    @property
    def other(self) -> "Point":
        """The one that it is compared with: the first state at the same step, or the reference."""
        scheme = SCHEMES[self.scheme]
        return Point(scheme.first, self.dt) if scheme.first else scheme.reference


REFERENCES = Point("langevin-5", 1.0), Point("npt-langevin", 1.0)  # of volume, of pressure
BESIDE = 2.0  # fs; a point of the references' schemes that tells how near to the limit they are


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


def points(only: Collection[str] | None = None, dt: Collection[float] | None = None) -> list[Point]:
    """What is measured, in the order in which it runs: what is wanted, and before each what it is
    compared with.

    Args:
        only: names of schemes; None is all.
        dt: time steps, fs; None is each scheme's own.
    """
    found = [
        Point(name, one)
        for name in chosen(SCHEMES, only)
        for one in sorted(dt or SCHEMES[name].steps)
    ]
    return list(dict.fromkeys(point for one in found for point in (one.other, one)))


def ordered(points: Collection[Point]) -> list[Point]:
    """Each once, by scheme and step."""
    return sorted(set(points), key=lambda one: (list(SCHEMES).index(one.scheme), one.dt))


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
