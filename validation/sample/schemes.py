"""The schemes of `sample`: each is an entry of a list in one of the functions below.

`Scheme` lists the fields of an entry.  `constant_volume` creates those of a scene from what its
`Bodies` allow, `at_pressure` those with barostats.  Those of other engines are in the engines'
files.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from ..scenes.integrators import Integrator, constrained, nosquish, rigid
from .engine import Engine

FIRST_SEED = 7100  # precedes those of the starts
SEED = "SEED"  # placeholder in a scheme's lines
DAMPING, STRONG = 200.0, 50.0  # fs; friction of 5/ps and 20/ps
PRESSURE_DAMPING = 500.0  # fs
HYBRID = 10  # steps of a trajectory of hybrid Monte Carlo
PRESSURE = 1.0  # atm
# states at constant pressure: ends of a scheme's name and label, temperature above the first
# state's, K, and pressure, atm.  The distance from the first to the others is what
# physical_validation advises: the maxima of the distributions are about two standard deviations
# apart, which are 35 kcal/mol of an enthalpy, 1.1 % of a volume
STATES = (
    ("", "", 0.0, PRESSURE),
    ("-308K", ", 308 K", 10.0, PRESSURE),
    ("-400atm", ", 400 atm", 0.0, 400.0),
)
# the bodies' torques must not include a thermostat's forces, so fix store/force comes before it
RAW = "fix raw {group} store/force"


class Moments(NamedTuple):
    """A choice of moments of inertia: ends of a scheme's name and fix line."""

    name: str = ""
    words: str = ""


class Thermostat(NamedTuple):
    """A thermostat of this package.

    Attributes:
        damping: fs.
        words: after ``thermostat`` on the fix line.
        reach: see `Scheme`, with the molecules' own moments.
        held, refined: see `Scheme`.
    """

    name: str
    damping: float
    words: str
    reach: float | None = 6.0
    held: int = 3
    refined: bool = False


OWN, OF_STEP = Moments(), Moments("-step", " moments step")
EQUAL, SCALED = (2.0, 3.0, 6.0, 9.0), (2.0, 4.0, 6.0)  # amu Angstrom^2 of water; factors of others
# our schemes that run by default
USUAL = (
    *("langevin-5", "langevin-20", "csvr", "nh"),
    *("langevin-5-equal-6", "langevin-20-equal-6", "langevin-2-equal-9", "langevin-20-step"),
    *("langevin-5-scale-4", "langevin-20-scale-4", "langevin-2-scale-6"),
)


def _thermostats() -> Iterator[Thermostat]:
    """Yield Langevin thermostats by their friction in 1/ps, and those of the total kinetic energy
    by their inverse damping time."""
    for rate in (0.5, 1.0, 2.0, 5.0, 20.0):
        words, reach = f"langevin seed {SEED}", 8.0 if rate == 20.0 else 6.0
        yield Thermostat(f"langevin-{rate:g}", 1e3 / rate, words, reach, held=0)
    noise = f"csvr seed {SEED}"
    yield Thermostat("csvr", DAMPING, noise)
    yield Thermostat("nh", DAMPING, "nh")
    # a refined average has no error of second order, so its limit of small steps is another
    more: dict = {"reach": None, "refined": True}
    yield Thermostat("csvr-refined", 20.0, noise, **more)
    yield Thermostat("nh-refined", 100.0, "nh", **more)


THERMOSTATS = [*_thermostats()]


@dataclass(frozen=True)
class Scheme(Integrator):
    """An integrator with its thermostat, with or without a barostat, at one state.

    Its lines have `SEED` in place of a start's seed.

    Attributes:
        steps: fs, of the points that run by default.
        usual: whether it runs if no scheme is named.
        reach: fs, the longest step whose error the terms of the limit's fit can describe; infinite
            for a scheme without error of the step, None if its limit differs from that of the
            scene's other schemes.
        held: degrees of freedom of the total momentum, if the scheme keeps it at zero.
        temperature: K.
        pressure: atm; None at constant volume.
        first: name of the same scheme at the first state, if this is at another one.
        refined: whether averages are refined ones, see `statistics.refined`.
        whole: whether it moves all atoms, including those in no body.
        stride: steps between two configurations of the correct distribution.
        engine: that runs it; None for LAMMPS.
        friction: 1/ps, of another engine's thermostat, which is its line; for one that scales
            velocities, its inverse time constant.
    """

    steps: tuple[float, ...] = ()
    usual: bool = True
    reach: float | None = None
    held: int = 0
    temperature: float = 298.0
    pressure: float | None = None
    first: str = ""
    refined: bool = False
    whole: bool = False
    stride: int = 1
    engine: Engine | None = None
    friction: float = 0.0

    @classmethod
    def of(cls, integrator: Integrator, before: tuple[str, ...] = (), **more: Any) -> "Scheme":
        """An integrator as a scheme.

        Args:
            before: lines before its own.
            more: attributes, also those of the integrator.
        """
        return cls(**vars(integrator) | {"lines": (*before, *integrator.lines)} | more)

    @property
    def ours(self) -> bool:
        """Whether it is this package's."""
        return self.kind == "ours"

    def seeded(self, seed: int) -> "Scheme":
        """The scheme with the random numbers of a seed."""
        return replace(self, lines=tuple(line.replace(SEED, str(seed)) for line in self.lines))


def by_name(schemes: Iterable[Scheme]) -> dict[str, Scheme]:
    """The schemes by name, as scenes have them."""
    return {scheme.name: scheme for scheme in schemes}


def state(temperature: float, damping: float, pressure: float | None = None) -> str:
    """A state as words of a fix, which are the same for this package and LAMMPS."""
    words = f" temp {temperature:g} {temperature:g} {damping:g}"
    if pressure is None:
        return words
    return f"{words} iso {pressure:g} {pressure:g} {PRESSURE_DAMPING:g}"


def _label(style: str, words: str, damping: float) -> str:
    """A scheme's label: the words after ``thermostat`` as on the fix line, without the seed."""
    kind, *rest = words.replace(f" seed {SEED}", "").split(maxsplit=1)
    return ", ".join([f"nosquish/{style} {kind}", f"TDAMP {damping:g} fs", *rest])


def ours(name: str, label: str, words: str, style: str, **more: Any) -> Scheme:
    """A scheme of this package."""
    return Scheme.of(nosquish(name, label, words, style), **more)


@dataclass(frozen=True)
class Bodies:
    """Properties of a scene's bodies that decide its schemes at constant volume.

    Attributes:
        temperature: K.
        flexible: keyword of ours for atoms that are in no body.
        rest: group of these; empty for none.
        everywhere: group of all atoms that move.
        shake: whether fix shake can constrain the molecules, and ``alike`` whether it then makes
            them as rigid as bodies: else its averages differ, even in the limit.
        equal: whether moments that are equal about all axes are useful, else those of the molecules
            are scaled.
        heavy: by mass of hydrogens, the LAMMPS commands that set all masses.
        longest: fs.
    """

    temperature: float
    flexible: str = ""
    rest: str = ""
    everywhere: str = "{group}"
    shake: bool = False
    alike: bool = True
    equal: bool = False
    heavy: Mapping[float, tuple[str, ...]] = field(default_factory=dict)
    longest: float = 14.0

    @property
    def moments(self) -> list[Moments]:
        """The choices of moments of inertia, larger ones after smaller ones."""
        if self.equal:
            return [_equal(size) for size in EQUAL]
        return [Moments(f"-scale-{times:g}", f" moments scale {times:g}") for times in SCALED]


def _equal(size: float) -> Moments:
    """Moments of this size about all axes, amu Angstrom^2."""
    return Moments(f"-equal-{size:g}", f" moments equal {size:g}")


def constant_volume(bodies: Bodies) -> dict[str, Scheme]:
    """All schemes of LAMMPS at constant volume."""
    return by_name(
        replace(
            scheme,
            temperature=bodies.temperature,
            steps=tuple(dt for dt in scheme.steps if dt <= bodies.longest),
        )
        for scheme in (*_nosquish(bodies), *_rigid(bodies), *_constrained(bodies))
    )


def _nosquish(bodies: Bodies) -> list[Scheme]:
    """Return ours: each thermostat in the middle of the step with each choice of moments of
    inertia, and hybrid Monte Carlo."""
    # larger moments that depend on the step are only for such molecules
    choices = (OWN, *bodies.moments, *[OF_STEP] * bodies.equal)
    schemes = [
        _middle(bodies, thermostat, moments) for thermostat in THERMOSTATS for moments in choices
    ]
    chance = f" temp {bodies.temperature:g} steps {HYBRID} seed {SEED}"
    exact: dict = {"style": "HMC", "stride": HYBRID, "reach": math.inf}
    # with many bodies no long step is accepted without larger moments
    for moments, steps in ((OWN, (2.0, 4.0, 6.0)), (bodies.moments[-1], (8.0, 10.0))):
        label = f"nosquish/hmc, {HYBRID} steps{',' * bool(moments.words)}{moments.words}"
        schemes.append(
            ours(f"hmc{moments.name}", label, chance + moments.words, steps=steps, **exact)
        )
    lines = [(*scheme.lines[:-1], scheme.lines[-1] + bodies.flexible) for scheme in schemes]
    return [
        replace(scheme, lines=commands, whole=bool(bodies.rest))
        for scheme, commands in zip(schemes, lines)
    ]


def _middle(bodies: Bodies, thermostat: Thermostat, moments: Moments) -> Scheme:
    """A scheme with a thermostat in the middle of the step, and a choice of moments."""
    long = moments is not OWN
    steps = (4.0, 8.0, 10.0, 12.0, 14.0) if long else (1.0, 2.0, 4.0, 6.0, 8.0, 10.0)
    # if the moments depend on the step, so does the limit of small steps
    reach = thermostat.reach and thermostat.reach + 4.0 * long
    if moments is OF_STEP:
        reach = None
    name = thermostat.name + moments.name
    return ours(
        name,
        _label("nvt", thermostat.words + moments.words, thermostat.damping)
        + ", refined" * thermostat.refined,
        f"{state(bodies.temperature, thermostat.damping)} thermostat {thermostat.words}"
        f"{moments.words}",
        "NVT",
        steps=steps,
        reach=reach,
        held=thermostat.held,
        refined=thermostat.refined,
        usual=name in USUAL,
    )


def _rigid(bodies: Bodies) -> list[Scheme]:
    """LAMMPS's rigid fixes."""
    usual = state(bodies.temperature, DAMPING)
    chains, small = rigid("rigid/nvt/small"), rigid("rigid/nve/small")
    lines = (chains.lines[0] + usual, *[f"fix rest {bodies.rest} nvt{usual}"] * bool(bodies.rest))
    # as long as ours, in liquids without the fast motions of hydrogens
    steps = (0.5, 1.0, 2.0, 3.0, 4.0) if bodies.shake else (2.0, 4.0, 6.0, 8.0, 10.0, 14.0)
    whole = bool(bodies.rest)
    name, label = "rigid+langevin", "rigid/nve/small + langevin"
    return [
        # it counts three degrees of freedom more than a system without momentum has
        Scheme.of(chains, lines=lines, held=3, steps=steps, whole=whole),
        Scheme.of(small, _kicks(bodies), name=name, label=label, steps=steps, reach=4.0),
    ]


def _kicks(bodies: Bodies) -> tuple[str, str]:
    """The forces of LAMMPS's thermostat, and the energy that they add, for any integrator."""
    words = f"{bodies.temperature:g} {bodies.temperature:g} {DAMPING:g} {SEED} tally yes"
    return RAW, f"fix bath {bodies.everywhere} langevin {words}"


def _constrained(bodies: Bodies) -> list[Scheme]:
    """Schemes with shake: atoms as points, with LAMMPS's thermostats."""
    if not bodies.shake:
        return []
    shake, usual, kicks = (
        _shake(bodies.everywhere),
        state(bodies.temperature, DAMPING),
        _kicks(bodies),
    )
    light: dict = {"steps": (0.5, 1.0, 2.0, 3.0, 4.0, 6.0), "reach": 4.0}
    chains = f"fix 1 {bodies.everywhere} nvt{usual}", shake.lines[1]
    csvr = (f"fix bath {bodies.everywhere} temp/csvr{usual.removeprefix(' temp')} {SEED}",)
    label = "shake + langevin"
    schemes = [
        Scheme.of(shake, kicks, name="shake+langevin", label=label, **light),
        Scheme.of(shake, name="shake+nvt", label="shake + nvt", lines=chains, held=3, **light),
        Scheme.of(shake, csvr, name="shake+csvr", label="shake + csvr", held=3, **light),
        *(
            Scheme.of(
                shake, (*lines, *kicks), name=f"shake-{mass:g}+langevin",
                label=f"{label}, hydrogens of {mass:g} amu",
                steps=(2.0, 3.0, 4.0, 5.0, 6.0, 7.0), reach=6.0,
            )
            for mass, lines in bodies.heavy.items()
        ),
    ]  # fmt: skip
    return [
        replace(scheme, whole=True, reach=scheme.reach if bodies.alike else None)
        for scheme in schemes
    ]


def _shake(group: str) -> Integrator:
    """Fix nve and fix shake of a group of atoms."""
    shake = constrained("shake", "1e-6")
    return replace(shake, lines=tuple(line.replace("{group}", group) for line in shake.lines))


def at_pressure(temperature: float) -> dict[str, Scheme]:
    """This package's barostats, at all `STATES`, and LAMMPS's at short steps: these need to agree
    only in the limit of small steps."""
    at, shake, chains = (
        state(temperature, DAMPING, PRESSURE),
        _shake("{group}"),
        rigid("rigid/npt/small"),
    )
    short: dict = {"held": 3, "temperature": temperature, "pressure": PRESSURE}
    short |= {"steps": (1.0, 2.0), "reach": 2.0}
    lines = shake.lines[1], f"fix 1 {{group}} npt{at}"  # LAMMPS requires shake first here
    return by_name(
        [
            *_barostats(temperature),
            Scheme.of(shake, name="shake+npt", label="shake + fix npt", lines=lines, **short),
            Scheme.of(chains, lines=(chains.lines[0] + at,), **short),
        ]
    )


def _barostats(temperature: float) -> Iterator[Scheme]:
    """Yield this package's barostats."""
    middle, larger = f"langevin seed {SEED}", _equal(6.0)
    for name, words, damping, held, reach, states in (
        ("npt-langevin", middle, DAMPING, 0, 6.0, STATES),
        ("npt-langevin-20", middle, STRONG, 0, 8.0, STATES[:1]),
        (f"npt-langevin-20{larger.name}", middle + larger.words, STRONG, 0, 12.0, STATES[:1]),
        ("npt-csvr", f"csvr seed {SEED}", DAMPING, 3, 6.0, STATES),
        ("npt-mtk", "nh barostat mtk", DAMPING, 3, 6.0, STATES),
    ):
        for ending, suffix, warmer, pressure in states:
            first: dict = {"steps": (2.0, 4.0, 6.0, 8.0), "reach": reach}
            other: dict = {"steps": (2.0, 6.0), "first": name}
            yield ours(
                name + ending,
                _label("npt", words, damping) + suffix,
                f"{state(temperature + warmer, damping, pressure)} thermostat {words}",
                "NPT",
                held=held,
                pressure=pressure,
                temperature=temperature + warmer,
                **other if ending else first,
            )
