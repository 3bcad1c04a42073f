"""The skin of neighbour lists that makes a script the fastest with the step that is advised.

Atoms cross the skin in fewer of the longer steps, and lists are built anew more often.  A wider
skin than the script's may then be faster.  How much it gains depends on pair styles, cutoffs and
ranks, so it is measured: runs with each skin, in turn.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypedDict

from ..own.script import texts
from ..own.system import Own
from ..running import rounds, run
from ..statistics import measures
from . import turns
from .targets import NS

FACTORS = 1.0, 1.5, 2.0  # of the script's skin
ROUNDS = 4
SHARE = 0.2  # of the budget for this
LEAST = 100  # steps of a timed segment: in fewer, one more new list is too much of the time
SKINS = {"lj": 0.3, "si": 0.001, "cgs": 0.1, "micro": 0.1, "nano": 0.1}  # LAMMPS's, by units
USUAL = 2.0  # with other units


class Tried(TypedDict):
    """A skin.

    Attributes:
        command: LAMMPS's, for this skin, in the script's units.
        median, min, max: over rounds, of a step's time in parts of that with the script's skin.
    """

    command: str
    median: float
    min: float
    max: float


def skin_of(own: Own) -> tuple[float, str]:
    """The script's skin, and the word behind it."""
    found = [one for one in map(texts, (*own.scene.setup, *own.scene.then)) if one[0] == "neighbor"]
    if found:
        return float(found[-1][1]), found[-1][2]
    return SKINS.get(own.scene.units, USUAL), "bin"


def total(many: bool = False) -> int:
    """Runs that a meter counts; none for ``many`` integrators, of which none is advised."""
    return 0 if many else ROUNDS * len(FACTORS)


def share(many: bool = False) -> float:
    """Of the budget, for this; as for `total`."""
    return 0.0 if many else SHARE


def tried(
    own: Own, best: Mapping, minutes: float, out: Path, ranks: int, silence: float, meter: run.Meter
) -> list[Tried]:
    """Time each skin; one that fails is left out, and all are where steps take too long for it.

    Args:
        best: the point that is advised, a row of `trial.trial`.
        minutes: the whole budget.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """
    integrator, dt = own.integrators[best["integrator"]], best["dt"]
    skin, style = skin_of(own)
    loop = best["cost"]["min"] * dt / NS.get(own.scene.units, 1e3)
    seconds = SHARE * 60 * minutes / total() / rounds.SEGMENTS
    if seconds < LEAST * loop:
        return []
    runs = rounds.lengths(loop, seconds).runs
    commands = [_command(f"{factor * skin:g}", style) for factor in FACTORS]
    some = {
        one.split()[1]: turns.Timed(f"{one}, {dt:g} {own.units.time}", integrator, dt, runs, (one,))
        for one in commands
    }
    found = turns.loops(own, "lists", some, ROUNDS, out, ranks, silence, meter)
    usual, *_ = found.values()
    made = []
    for command, times in zip(commands, found.values()):
        ratios = [one / first for one, first in zip(times, usual)]
        if ratios:
            ratio = measures.spread(ratios)
            low, median, high = (ratio[name] for name in ("min", "median", "max"))
            made.append(Tried(command=command, median=median, min=low, max=high))
    return made


def _command(skin: str, style: str) -> str:
    return f"neighbor {skin} {style}"


def fastest(some: Sequence[Tried]) -> Tried | None:
    """The skin whose steps are shorter than the script's in each round; None if there is none."""
    better = [one for one in some if one["max"] < 1]
    return min(better, key=lambda one: one["median"], default=None)
