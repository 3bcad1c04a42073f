"""What is held against bounds: those of `sampling`, of points at any step, and of the limits."""

from collections.abc import Mapping

from ..ensembles.lengths import LEAST
from ..sampling.criteria import BOUNDS, NAMES, UNITS
from ..statistics.check import Check
from ..statistics.estimate import Estimate

TITLES = {
    "limit": "The same forces have the same limit",
    "bias": "Averages within the bounds",
}


def checks(summary: Mapping) -> list[Check]:
    """The checks; none of points that are too short to tell their own errors."""
    if summary["settings"]["time"] < LEAST:
        return []
    made = []
    for engine, apart in summary["apart"].items():
        for key, one in apart.items():
            made.append(_of("limit", engine, NAMES[key].replace("bias", "limit"), key, one))
    for row in summary["rows"]:
        for key, one in row["biases"].items():
            made.append(_of("bias", f"{row['label']}, {row['dt']:g} fs", NAMES[key], key, one))
    return made


def _of(part: str, subject: str, what: str, key: str, found: Mapping) -> Check:
    most = BOUNDS[key]
    ends: dict = {"low": -most, "high": most, "unit": UNITS[key]}
    return Check.of(part, subject, what, Estimate.of(found), **ends)
