"""What the package is to reach, as data, and whether a benchmark's numbers show it."""

from dataclasses import dataclass

from ..pages.tables import ranks_of


@dataclass(frozen=True)
class Goal:
    """An upper bound of one measured number.

    Attributes:
        scene, bodies, ranks: where it is measured; None holds for each that is measured.
        number: key of an integrator's row: ``modify_ratio`` and ``loop_ratio`` (ours over that of
            ``against``), ``modify`` (us per step) and ``bound_ratio`` (time over that which the
            memory allows) of ours.
        against: integrator; None for numbers of ours alone.
        limit: largest value that meets the goal.
    """

    scene: str | None
    bodies: int | None
    ranks: int | None
    number: str
    against: str | None
    limit: float

    def holds_for(self, point: dict) -> bool:
        """Whether it is one of a scene's point."""
        keys = "scene", "bodies", "ranks"
        return all(getattr(self, key) in (None, point[key]) for key in keys)

    def measured(self, point: dict) -> dict | None:
        """Its number in a point."""
        name = self.against or "nosquish"
        rows = {row["name"]: row for row in point["integrators"]}
        return rows.get(name, {}).get(self.number)

    @property
    def where(self) -> str:
        """Where it is measured."""
        found = f"{self.scene} {self.bodies:,}" if self.bodies else f"{self.scene}"
        return f"{found}, {ranks_of(self.ranks)}" if self.ranks else found


_WATER = (
    # bodies, ranks, vs rigid/nve, rigid/nve/small, shake
    (1000, 1, 0.20, 0.10, 0.35),
    (10648, 1, 0.20, 0.10, 0.35),
    (1000, 2, 0.20, 0.15, 0.45),
    (10648, 2, 0.20, 0.15, 0.45),
    (100000, 2, 0.25, 0.25, 0.50),
)
_RIVALS = "rigid/nve", "rigid/nve/small", "shake"
_LOOPS = (*_RIVALS[:2], "rigid", "rigid/small", "rigid/nve/omp", "rigid/omp", "rigid/small/omp")
GOALS = (
    *(
        Goal("water", bodies, ranks, "modify_ratio", rival, limit)
        for bodies, ranks, *limits in _WATER
        for rival, limit in zip(_RIVALS, limits)
    ),
    *(
        Goal(scene, None, None, "modify_ratio", rival, 0.5)
        for scene in ("big", "mixed")
        for rival in _RIVALS[:2]
    ),
    Goal("dimer", 2, 1, "modify", None, 5.0),
    Goal("water", 100000, None, "bound_ratio", None, 2.5),
    *(Goal(None, None, None, "loop_ratio", rival, 1.0) for rival in _LOOPS),
)

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
        points, starts: of a benchmark's summary.

    Returns:
        of each ``where``, ``what``, ``limit``, ``measured`` (median, min, max; None: not measured)
        and ``met`` (of the median; None: not measured).  Of the loop only the fastest rival counts,
        the one with the largest ratio.
    """
    judged: list[dict] = []
    loops: dict[str, list[dict]] = {}
    for goal in GOALS:
        what = WORDS[goal.number].format(goal.against)
        matching = {place(point): goal.measured(point) for point in points if goal.holds_for(point)}
        if not matching and goal.scene:
            matching = {goal.where: None}
        for where, measured in matching.items():
            one = _judged(where, what, goal.limit, measured, goal.number)
            if goal.number != "loop_ratio":
                judged.append(one)
            elif measured:
                loops.setdefault(where, []).append(one)
    judged += [max(some, key=lambda one: one["measured"]["median"]) for some in loops.values()]
    alone = next((start for start in starts if start["ranks"] == 1), {})
    for what, limit, key in STARTS:
        wall = alone.get(key, {}).get("wall")
        judged.append(_judged("start, 1 rank, 1 core", what, limit, wall))
    return judged


def _judged(where, what, limit, measured, number=None):
    met = measured and measured["median"] <= limit
    goal = {"where": where, "what": what, "limit": limit}
    return goal | {"measured": measured, "met": met, "number": number}


def place(point: dict) -> str:
    """Scene, bodies and ranks of a point, in words."""
    return f"{point['scene']} {point['bodies']:,}, {ranks_of(point['ranks'])}"
