"""What the package is to reach, as data, and whether a benchmark's numbers show it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Goal:
    """An upper bound of one measured number.

    Attributes:
        scene, bodies, ranks: where it is measured; None holds for each that is measured.
        number: key in a scene's row: ``modify_ratio`` and ``loop_ratio`` (ours over that of ``against``),
            ``modify`` (us per step) and ``bound_ratio`` (time over that which the memory allows) of ours.
        against: integrator; None for numbers of ours alone.
        limit: largest value that meets the goal.
    """

    scene: str | None
    bodies: int | None
    ranks: int | None
    number: str
    against: str | None
    limit: float


_WATER = (
    # bodies, ranks, vs rigid/nve, rigid/nve/small, shake
    (1000, 1, 0.20, 0.10, 0.35),
    (10648, 1, 0.20, 0.10, 0.35),
    (1000, 2, 0.20, 0.15, 0.45),
    (10648, 2, 0.20, 0.15, 0.45),
    (100000, 2, 0.25, 0.25, 0.50),
)
_RIVALS = "rigid/nve", "rigid/nve/small", "shake"

GOALS = (
    *(
        Goal("water", bodies, ranks, "modify_ratio", rival, limit)
        for bodies, ranks, *limits in _WATER
        for rival, limit in zip(_RIVALS, limits)
    ),
    *(Goal(scene, None, None, "modify_ratio", rival, 0.5) for scene in ("big", "mixed") for rival in _RIVALS[:2]),
    Goal("dimer", 2, 1, "modify", None, 5.0),
    Goal("water", 100000, None, "bound_ratio", None, 2.5),
    *(Goal(None, None, None, "loop_ratio", rival, 1.0) for rival in ("rigid/nve", "rigid/nve/small", "rigid", "rigid/small",
                                                                    "rigid/nve/omp", "rigid/omp", "rigid/small/omp")),
)  # fmt: skip

FIRST_USE, LATER_START = (
    15.0,
    0.5,
)  # s on one core: a first use, and what a later start adds to LAMMPS's own

WORDS = {
    "modify_ratio": "Modify, ours over {}",
    "loop_ratio": "loop, ours over {}",
    "modify": "Modify, µs per step",
    "bound_ratio": "Modify over the memory's bound",
}


def judge(points, starts):
    """Each goal beside what was measured.

    Args:
        points: records of scenes (see ``bench.ScenePoint``).
        starts: records of ``startup.measure``.

    Returns:
        list of dict: ``where``, ``what``, ``limit``, ``measured`` (median, min, max; None: not measured), ``met``
        (of the median; None: not measured).  Of the loop only the fastest rival counts, the one with the largest ratio.
    """
    judged = []
    for goal in GOALS:
        matching = [point for point in points if _matches(goal, point)]
        for point in matching:
            row = next(
                (
                    row
                    for row in point["integrators"]
                    if row["name"] == (goal.against or "nosquish")
                ),
                {},
            )
            judged.append(
                _judged(
                    goal,
                    f"{point['scene']} {point['bodies']:,}, {ranks_of(point['ranks'])}",
                    row.get(goal.number),
                )
            )
        if not matching and goal.scene:
            where = " ".join([goal.scene, *([f"{goal.bodies:,}"] if goal.bodies else [])])
            judged.append(
                _judged(goal, where + (f", {ranks_of(goal.ranks)}" if goal.ranks else ""), None)
            )
    judged = _slowest_loops(judged)
    one = next((start for start in starts if start["ranks"] == 1), {})
    for what, limit, key in (
        ("first use, wall s", FIRST_USE, "first"),
        ("later start, wall s more than LAMMPS", LATER_START, "later_added"),
    ):
        judged.append(_verdict("start, 1 rank, 1 core", what, limit, one.get(key, {}).get("wall")))
    return judged


def ranks_of(number):
    """'1 rank', '2 ranks'."""
    return f"{number} rank" + "s" * (number != 1)


def _matches(goal, point):
    return all(
        wanted in (None, point[key])
        for key, wanted in (("scene", goal.scene), ("bodies", goal.bodies), ("ranks", goal.ranks))
    )


def _judged(goal, where, measured):
    found = _verdict(where, WORDS[goal.number].format(goal.against), goal.limit, measured)
    return found | {"number": goal.number}


def _verdict(where, what, limit, measured):
    return {
        "where": where,
        "what": what,
        "limit": limit,
        "measured": measured,
        "met": measured and measured["median"] <= limit,
        "number": None,
    }


def _slowest_loops(judged):
    """Of the ratios of loops at one place only the largest: the fastest of LAMMPS's fixes is what counts."""
    kept = [one for one in judged if one["number"] != "loop_ratio"]
    places = {}
    for one in judged:
        if one["number"] == "loop_ratio" and one["measured"]:
            other = places.setdefault(one["where"], one)
            if one["measured"]["median"] > other["measured"]["median"]:
                places[one["where"]] = one
    return kept + list(places.values())
