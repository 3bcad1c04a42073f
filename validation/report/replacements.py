"""Replacements for the usual lines, by system: speed and error of both, from the summaries of
`sample` and `cost`."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from ..pages import Column, Table, digits
from ..sample.figures import PER_DAY
from ..sample.observables import warmer
from ..statistics.estimate import Estimate

TITLE = "What to type, how fast it is, and its error"
COLUMNS = (
    Column("system", "you run", kind="text"),
    Column("usual", "instead of", kind="text"),
    Column("lines", "you type", kind="code"),
    Column("times", "speed-up", kind="text"),
    Column("speed", "ns/day before → now", "one core", "text"),
    Column("warmer", "energy error before → now", "K", "text"),
    Column("pressure", "pressure error before → now", "atm", "text"),
)
NOTE = (
    "± is the 95 % confidence interval: if it includes zero, no error was found. "
    "The speed-up is that of simulated time, from CPU times. For the same error of an average it "
    "can be smaller, because noise counts, too. "
    "Rows were measured on different machines, so compare speeds within a row only. "
    "The energy error is the change of temperature that would shift the mean potential energy as "
    'much. "Averages" are energies, pressure and structure: a damping time of 50 fs and larger '
    "moments of inertia (keyword moments) slow down the motion. For diffusion and spectra use the "
    "line for dynamics."
)
NONE = "not measured"


class Swap(NamedTuple):
    """Points of `sample`, scheme and step in fs: the usual one, and its replacement."""

    system: str
    scene: str
    usual: tuple[str, float]
    ours: tuple[str, float]


SWAPS = (
    Swap("water, averages", "water", ("shake+langevin", 2.0), ("langevin-20-equal-6", 12.0)),
    Swap("water, dynamics", "water", ("rigid/nvt/small", 4.0), ("csvr", 4.0)),
    Swap("CO₂", "co2", ("rigid/nvt/small", 14.0), ("nh", 14.0)),
    Swap("benzene", "benzene", ("rigid/nvt/small", 14.0), ("nh", 14.0)),
    Swap("peptide in water, averages", "peptide", ("shake+langevin", 2.0), ("langevin-20", 4.0)),
)
AT_CONSTANT_ENERGY = (  # scene of `cost` on one rank, and its usual integrator
    ("colloids, NVE", "mixed", "rigid/nve"),
    ("water, NVE", "water", "shake"),
)


def table(summaries: Iterable[Mapping]) -> Table:
    """A row for each system in these results."""
    known = list(summaries)
    return Table(TITLE, COLUMNS, [*_samples(known), *_costs(known)], note=NOTE)


def _samples(summaries: Sequence[Mapping]) -> Iterator[dict]:
    for swap in SWAPS:
        for summary in summaries:
            rows = summary.get("rows", ()) if summary.get("scene") == swap.scene else ()
            points = {(row.get("scheme"), row["dt"]): row for row in rows if row.get("cost")}
            if swap.usual in points and swap.ours in points:
                yield _sampled(swap.system, points[swap.usual], points[swap.ours], summary)
                break


def _sampled(system, usual, ours, summary):
    both = usual, ours
    costs = [row["cost"]["median"] for row in both]
    return {
        "system": system,
        "usual": f"{usual['label']}, {usual['dt']:g} fs",
        "lines": [native(ours["lines"][-1]), f"timestep {ours['dt']:g}"],
        "speed": " → ".join(digits(PER_DAY / cost) for cost in costs),
        "times": digits(costs[0] / costs[1], 2),
        "warmer": _changes(*(warmer(row["biases"], summary["limits"]) for row in both)),
        "pressure": _changes(*map(_pressed, both)),
    }


def _changes(*estimates):
    """The estimates before and now, as text."""
    return " → ".join(one.text() for one in estimates) if all(estimates) else NONE


def _pressed(row):
    """The error of the pressure, if it was measured."""
    known = row["biases"].get("pressure")
    return known and Estimate.of(known)


def native(line: str) -> str:
    """Convert a quoted fix line of the results to the form that users type."""
    return (
        re.sub(
            r'python/move "fix_nosquish\.(\w+) \w+ (.*)"',
            lambda match: f"nosquish/{match[1].lower()} {match[2]}",
            line,
        )
        .replace(" thermostat langevin", "")
        .replace(" points flexible", " flexible rest")
        .replace("SEED", "4928")
    )


def _costs(summaries: Sequence[Mapping]) -> Iterator[dict]:
    for system, scene, usual in AT_CONSTANT_ENERGY:
        for summary in summaries:
            for point in summary.get("points", ()):
                if (point.get("scene"), point.get("ranks")) == (scene, 1):
                    yield from _timed(system, point, usual)
                    break


def _timed(system, point, usual):
    known = {row["name"]: row for row in point["integrators"]}
    ours, ratio = known["nosquish"], known.get(usual, {}).get("loop_ratio")
    if ratio:
        ends = [digits(1 / ratio[part]) for part in ("median", "max", "min")]
        yield {
            "system": system,
            "usual": known[usual]["label"],
            "lines": native(ours["lines"][-1]),
            "speed": NONE,
            "times": f"{ends[0]} ({ends[1]}–{ends[2]})",
            "warmer": NONE,
            "pressure": NONE,
        }
