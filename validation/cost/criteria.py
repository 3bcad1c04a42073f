"""What the package is to reach, as data, and whether the numbers of `cost` show it."""

from collections.abc import Iterable, Iterator

from ..pages import ranks_of
from ..statistics import measures
from ..statistics.check import Check

TITLES = {"goal": "Limits that we set ourselves, on means over the rounds"}
RIVALS = "rigid/nve", "rigid/nve/small", "shake"
WATER: dict[
    tuple[int, int], tuple[float, ...]
] = {  # bodies, ranks: the time in the fix, over each rival's
    (1000, 1): (0.20, 0.10, 0.35),
    (10648, 1): (0.20, 0.10, 0.35),
    (1000, 2): (0.20, 0.15, 0.45),
    (10648, 2): (0.20, 0.15, 0.45),
    (100000, 2): (0.25, 0.25, 0.50),
}
OTHERS: dict[str, tuple[float, ...]] = {
    "big": (0.5, 0.5),
    "mixed": (0.5, 0.5),
}  # the same, for scenes of any size
START = 0.5  # s on one core that a start takes more than LAMMPS alone


def checks(points: Iterable[dict], starts: Iterable[dict]) -> list[dict]:
    """What was measured beside its limits, of `Check.plain`.

    Args:
        points, starts: of a summary of `cost`.
    """
    found = [check for point in points for check in _of(point)]
    for start in starts:
        if start["ranks"] == 1 and "added" in start:
            wall = start["added"]["wall"]
            found.append(_check("start, 1 core", "more than LAMMPS alone", wall, START, "s"))
    return [check.plain() for check in found]


def _of(point: dict) -> Iterator[Check]:
    limits = OTHERS.get(point["scene"], ())
    if point["scene"] == "water":
        limits = WATER.get((point["bodies"], point["ranks"]), ())
    ratios = {row["name"]: row.get("modify_ratio") for row in point["integrators"]}
    for rival, most in zip(RIVALS, limits):
        if ratios.get(rival):
            yield _check(place(point), f"time in the fix over that of {rival}", ratios[rival], most)
    if fastest(point):
        yield _check(
            place(point), "whole step over that with the fastest rigid fix", fastest(point), 1.0
        )


def _check(subject, what, spread, most, unit=""):
    """The check of the mean over the rounds, with Student's t for their scatter."""
    found = measures.of_few(spread["values"])
    return Check.of("goal", subject, what, found, high=most, unit=unit)


def fastest(point: dict) -> dict | None:
    """The ratio of a whole step with ours to that with the fastest of LAMMPS's rigid fixes."""
    ratios = (row.get("loop_ratio") for row in point["integrators"] if row["kind"] == "rigid")
    return max(filter(None, ratios), key=lambda ratio: ratio["median"], default=None)


def place(point: dict) -> str:
    """Scene, bodies and ranks of a point, in words."""
    return f"{point['scene']} {point['bodies']:,}, {ranks_of(point['ranks'])}"
