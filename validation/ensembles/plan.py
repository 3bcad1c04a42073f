"""What ``ensembles`` runs: a scene, thermostats with their time steps, lengths."""

from collections.abc import Collection, Iterator
from dataclasses import replace

from ..command_line import chosen
from ..scenes import Scene, smooth_water
from ..scenes.integrators import Integrator, constrained, nosquish, rigid
from .lengths import Lengths, One, Point, folder
from .schemes import SEED, Scheme, bath, beside, chains, nvt, state

TEMPERATURE, WARM = 298.0, 308.0  # K
PRESSURE, PRESSED = 1.0, 400.0  # atm
TITLE = "512 TIP3P molecules at 298 K and 0.997 g/cm³, smooth cutoff at 8.5 Å"
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
MOMENTS_STEPS = 6.0, 8.0, 12.0  # fs; points of moments that the step chooses
# of which an output folder may have points; all divide `lengths.SAMPLED`
KNOWN_STEPS = 1.0, *STEPS, EQUAL_STEPS[-1]
SHORT_STEPS = 4.0, 8.0
FULL_TIME, SHORT_TIME = 300.0, 2.0  # ps of a point
_BATH = bath(TEMPERATURE, DAMPING)


def _state(
    damping: float = DAMPING, temperature: float = TEMPERATURE, pressure: float | None = None
) -> str:
    return state(temperature, damping, pressure, PRESSURE_DAMPING)


def _nvt(name: str, label: str, words: str, damping: float = DAMPING, **more) -> Scheme:
    return nvt(name, label, _state(damping), words, **{"steps": STEPS, **more})


def _npt(name: str, label: str, words: str, held: int = 0) -> Iterator[Scheme]:
    """This package's thermostat and barostat, at all states."""
    for ending, said, temperature, pressure in STATES:
        line = f"{_state(DAMPING, temperature, pressure)} thermostat {words}"
        one = nosquish(name + ending, label + said, line, "NPT")
        first, steps = (name, STATES_STEPS) if ending else ("", STEPS)
        yield Scheme(one, held, temperature, pressure, first, steps)


def _kicked(name: str, label: str, integrator: Integrator) -> Scheme:
    """Fix langevin, beside an integrator of constant energy."""
    return beside(name, label, integrator, _BATH, steps=STEPS)


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
        _nvt(
            "langevin-20-step", "NVT langevin 20/ps, moments of the step",
            f"langevin seed {SEED} moments step", STRONG, steps=MOMENTS_STEPS,
        ),
        _nvt("csvr", "NVT csvr", f"csvr seed {SEED}", held=3),
        _nvt("nh", "NVT nh", "nh", held=3),
        chains("rigid/nvt/small", _state(), steps=STEPS),
        _kicked("rigid+langevin", "rigid/nve/small + langevin", rigid("rigid/nve/small")),
        _kicked("shake+langevin", "shake + langevin", constrained("shake", "1e-6")),
        _kicked("nosquish+langevin", "fix_nosquish.NVE + langevin", nosquish("", "")),
        *_npt("npt-langevin", "NPT langevin 5/ps", f"langevin seed {SEED}"),
        *_npt("npt-csvr", "NPT csvr", f"csvr seed {SEED}", held=3),
        *_npt("npt-mtk", "NPT nh, mtk", "nh barostat mtk", held=3),
        _constrained_npt(),
        chains(
            "rigid/npt/small", _state(pressure=PRESSURE), pressure=PRESSURE, steps=LIMIT_STEPS
        ),
    )
}  # fmt: skip
STARTER = SCHEMES["langevin-20"]  # makes the starts


REFERENCES = Point("langevin-5", 1.0), Point("npt-langevin", 1.0)  # of volume, of pressure
BESIDE = 2.0  # fs; a point of the references' schemes that tells how near to the limit they are


def label(point: Point) -> str:
    """A point, for tables and the terminal."""
    return f"{SCHEMES[point.scheme].label}, {point.dt:g} fs"


def beside_which(point: Point) -> Point:
    """What a point is compared with: the first state at the same step, or the reference."""
    scheme = SCHEMES[point.scheme]
    return Point(scheme.first, point.dt) if scheme.first else reference(scheme)


def reference(scheme: Scheme) -> Point:
    """What stands for the limit of small steps: biases are the distances from it."""
    return REFERENCES[scheme.pressure is not None]


def scene() -> Scene:
    """The water that all schemes move."""
    return smooth_water("water-512", TITLE, "water_512", "512", 512)


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
    return list(dict.fromkeys(point for one in found for point in (beside_which(one), one)))


def names(points: Collection[Point], lengths: Lengths) -> Iterator[tuple[Point, One]]:
    """(point, run) of each run: all points from the first start, then all from the next one."""
    for start in range(1, lengths.starts + 1):
        for point in points:
            scheme = SCHEMES[point.scheme]
            yield point, One(folder(start, *point), label(point), scheme, point.dt, start)


def total(points: Collection[Point], lengths: Lengths) -> int:
    """Steps of all runs together."""
    return lengths.total((SCHEMES[one.scheme], one.dt) for one in points)
