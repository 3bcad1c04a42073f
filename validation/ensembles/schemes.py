"""Thermostats and barostats with their integrators, for `ensembles` and `sampling`."""

import re
from dataclasses import dataclass, replace

from ..scenes import Scene
from ..scenes.integrators import Integrator, nosquish, rigid

FIRST_SEED = 7100
SEED = "SEED"  # in a scheme's lines
# the kinetic energy of the molecules' centres, of any integrator
MOVES = (
    "compute molecules {group} chunk/atom molecule",
    "compute centres {group} temp/chunk molecules kecom",
    "variable moves equal sum(c_centres[1])",
)
OURS_PRINTS, ALL_PRINT = ("f_1[3]", "f_1[4]"), "v_moves"


@dataclass(frozen=True)
class Scheme:
    """A thermostat with its integrator, with or without a barostat, at one state.

    Attributes:
        integrator: its lines have `SEED` where a start's own number goes.
        held: degrees of freedom of the total momentum, where the scheme keeps it at zero.
        temperature: K.
        pressure: atm; None at constant volume.
        first: name of the same scheme at the first state, if this is at another one.
        steps: fs, of the points that are run if no other steps are asked for.
        whole: whether it moves all atoms, those in no body, too.
        stride: steps between two that have configurations of the right distribution.
    """

    integrator: Integrator
    held: int = 0
    temperature: float = 298.0
    pressure: float | None = None
    first: str = ""
    steps: tuple[float, ...] = ()
    whole: bool = False
    stride: int = 1

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
        return bool(re.search(r"nosquish[/.](nvt|npt|hmc)\b", self.integrator.lines[-1], re.I))

    def seeded(self, start: int) -> Integrator:
        """With the random numbers of a start, from 1."""
        lines = (line.replace(SEED, str(FIRST_SEED + start)) for line in self.integrator.lines)
        return replace(self.integrator, lines=tuple(lines))


def state(
    temperature: float,
    damping: float,
    pressure: float | None = None,
    pressure_damping: float = 0.0,
) -> str:
    """A state in the words of a fix: this package's and LAMMPS's are the same."""
    words = f" temp {temperature:g} {temperature:g} {damping:g}"
    if pressure is None:
        return words
    return f"{words} iso {pressure:g} {pressure:g} {pressure_damping:g}"


def nvt(name: str, label: str, at: str, words: str, **more) -> Scheme:
    """This package's thermostat, in the middle of the step, at a `state`."""
    return Scheme(nosquish(name, label, f"{at} thermostat {words}", "NVT"), **more)


def bath(temperature: float, damping: float, group: str = "{group}") -> str:
    """The forces of LAMMPS's thermostat, and the energy that they give, for any integrator."""
    words = f"langevin {temperature:g} {temperature:g} {damping:g} {SEED} tally yes"
    return f"fix bath {group} {words}"


def beside(name: str, label: str, integrator: Integrator, *lines: str, **more) -> Scheme:
    """An integrator of constant energy, with these lines before its own."""
    one = replace(integrator, name=name, label=label, lines=(*lines, *integrator.lines))
    return Scheme(one, **more)


def chains(style: str, at: str, **more) -> Scheme:
    """LAMMPS's rigid bodies with chains, at a `state`."""
    one = rigid(style)
    return Scheme(replace(one, lines=tuple(line + at for line in one.lines)), held=3, **more)


def moves(scheme: Scheme, scene: Scene) -> list[str]:
    """LAMMPS commands for what a scheme does not print itself of translation."""
    return [] if scheme.ours else [line.format(group=scene.group) for line in MOVES]


def prints(scheme: Scheme) -> tuple[str, ...]:
    """Columns of translation and rotation."""
    return OURS_PRINTS if scheme.ours else (ALL_PRINT,)
