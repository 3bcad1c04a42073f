"""What the package is to reach, as data, and whether the numbers of `cost` show it."""

from typing import NamedTuple

from ..pages import ranks_of
from ..scenes.integrators import OURS


class Goal(NamedTuple):
    """An upper bound of one measured number.

    Attributes:
        scene, bodies, ranks: where it is measured; None: anywhere.
        number: key of an integrator's row; ``against`` is the integrator.
        limit: largest median that meets the goal.
    """

    scene: str | None
    bodies: int | None
    ranks: int | None
    number: str
    against: str
    limit: float


_RIVALS = "rigid/nve", "rigid/nve/small", "shake"
_LOOPS = (*_RIVALS[:2], "rigid", "rigid/small", "rigid/nve/omp", "rigid/omp", "rigid/small/omp")
_WATER = {  # bodies, ranks: ours over rigid/nve, rigid/nve/small, shake
    (1000, 1): (0.20, 0.10, 0.35),
    (10648, 1): (0.20, 0.10, 0.35),
    (1000, 2): (0.20, 0.15, 0.45),
    (10648, 2): (0.20, 0.15, 0.45),
    (100000, 2): (0.25, 0.25, 0.50),
}
GOALS = [
    *(
        Goal("water", *where, "modify_ratio", rival, limit)
        for where, limits in _WATER.items()
        for rival, limit in zip(_RIVALS, limits)
    ),
    *(
        Goal(scene, None, None, "modify_ratio", rival, 0.5)
        for scene in ("big", "mixed")
        for rival in _RIVALS[:2]
    ),
    Goal("dimer", 2, 1, "modify", OURS, 5.0),
    Goal("water", 100000, None, "bound_ratio", OURS, 2.5),
    *(Goal(None, None, None, "loop_ratio", rival, 1.0) for rival in _LOOPS),
]
# s on one core: a first use, and what a later start adds to LAMMPS's own
STARTS = (
    ("first use, wall s", 15.0, "first"),
    ("later start, wall s more than LAMMPS", 0.5, "later_added"),
)
WORDS = {
    "modify_ratio": "Modify, ours over {}",
    "loop_ratio": "loop, ours over {}",
    "modify": "Modify, µs per step",
    "bound_ratio": "Modify over the memory's bound",
}


def judge(points: list[dict], starts: list[dict]) -> list[dict]:
    """Each goal beside what was measured.

    Args:
        points, starts: of a summary of `cost`.

    Returns:
        of each ``where``, ``what``, ``limit``, ``measured`` (median, min, max; None: not measured)
        and ``met`` (by the median; None: not measured).  Of the loop only the fastest rival counts,
        the one with the largest ratio.
    """
    judged: list[dict] = []
    loops: dict[str, list[dict]] = {}
    for goal in GOALS:
        for where, measured in _measured(goal, points).items():
            what = WORDS[goal.number].format(goal.against)
            found = _judged(where, what, goal.limit, measured, goal.number)
            if goal.number != "loop_ratio":
                judged.append(found)
            elif measured:
                loops.setdefault(where, []).append(found)
    judged += [max(some, key=lambda found: found["measured"]["median"]) for some in loops.values()]
    alone = next((start for start in starts if start["ranks"] == 1), {})
    for what, limit, key in STARTS:
        wall = alone.get(key, {}).get("wall")
        judged.append(_judged("start, 1 rank, 1 core", what, limit, wall))
    return judged


def _measured(goal, points):
    """{place of a point: the goal's number there}."""
    found = {}
    for point in points:
        at = (point[key] for key in ("scene", "bodies", "ranks"))
        if all(wanted in (None, value) for wanted, value in zip(goal[:3], at)):
            rows = {row["name"]: row for row in point["integrators"]}
            found[place(point)] = rows.get(goal.against, {}).get(goal.number)
    if found or not goal.scene:
        return found
    where = f"{goal.scene} {goal.bodies:,}" if goal.bodies else goal.scene
    return {f"{where}, {ranks_of(goal.ranks)}" if goal.ranks else where: None}


def _judged(where, what, limit, measured, number=None):
    met = measured and measured["median"] <= limit
    goal = {"where": where, "what": what, "limit": limit}
    return goal | {"measured": measured, "met": met, "number": number}


def place(point: dict) -> str:
    """Scene, bodies and ranks of a point, in words."""
    return f"{point['scene']} {point['bodies']:,}, {ranks_of(point['ranks'])}"
