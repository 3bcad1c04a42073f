"""Speed-up over the best rival, at the same error of an average.

The rivals fix the error of each average: E is the smallest upper end of the 95 % interval of |bias|
among them, and at least its bound.  A point's time is that until bias^2 + variance = 2 E^2, where a
rival with this bias has equal noise.  The best rival takes the least time.  A bias significantly
above E fails, however long the run.
"""

from collections.abc import Mapping, Sequence
from math import inf, sqrt

from ..statistics.estimate import Estimate, margin
from ..statistics.precision import BiasAndNoise, Interval, seconds, times
from .observables import CONFIGURATIONS

NEVER, NOT_AT_ALL = Interval(inf, inf, inf), Interval(0.0, 0.0, 0.0)


def compare(rows: Sequence[dict], bounds: Mapping[str, float]) -> dict[str, dict]:
    """Add to each row the times that its averages take.

    Args:
        rows: of `measure.summarize`, plain data.
        bounds: of the biases of observables, in their units.

    Returns:
        by observable ``error``, E in the unit of biases, and the best rival's ``label``, ``dt``,
        ``seconds``.  Rows get ``seconds``, s of one core to E, and ``faster``, the best rival's
        time over this; 0 where a point fails.
    """
    goals = {}
    for row in rows:
        row["seconds"], row["faster"] = {}, {}
    for key in CONFIGURATIONS:
        timed = [row for row in rows if key in row["noise"] and key in row["biases"]]
        rivals = [
            row for row in timed if not row["ours"] and row.get("engine", "LAMMPS") == "LAMMPS"
        ]
        if rivals:
            goals[key] = _compare(key, timed, rivals, bounds.get(key, 0.0))
    return goals


def best(rows: Sequence[Mapping]) -> Mapping | None:
    """Our point with the largest smallest gain, then the largest second smallest, and so on; None
    if there is none.

    The gains select it, so they are slightly too large, by less than their intervals.
    """
    return max([row for row in rows if row["ours"] and row["faster"]], key=gains, default=None)


def gains(row: Mapping) -> list[float]:
    """The gains of a point, from the smallest."""
    return sorted(map(_value, row["faster"].values()))  # infinite: the rival never does


def _value(interval: Mapping) -> float:
    return inf if interval["value"] is None else interval["value"]


def estimate(gain: Mapping, bound: float) -> Estimate:
    """A gain with its margin towards a bound; None if the interval is open there."""
    value, low, high = (gain[name] for name in ("value", "low", "high"))
    if value is None or (value < bound and high is None):
        return Estimate(None)
    return Estimate(value, (value - low if value >= bound else high - value) / margin(1.0))


def _compare(key: str, rows: Sequence[dict], rivals: Sequence[dict], bound: float) -> dict:
    biases = [Estimate.of(row["biases"][key]) for row in rivals]
    error = max(bound, min(abs(bias.value) + bias.margin for bias in biases))
    aim = sqrt(2) * error
    for row in rows:
        spent = NEVER if _fails(row, key, error) else seconds(_bias_and_noise(row, key), aim)
        row["seconds"][key] = spent.plain()
    best = min(rivals, key=lambda row: _value(row["seconds"][key]))
    for row in rows:
        if row is not best:
            gain = times(_bias_and_noise(best, key), _bias_and_noise(row, key), aim)
            row["faster"][key] = (NOT_AT_ALL if _fails(row, key, error) else gain).plain()
    return {
        "error": error,
        "label": best["label"],
        "dt": best["dt"],
        "seconds": best["seconds"][key],
    }


def _fails(row: Mapping, key: str, error: float) -> bool:
    bias = Estimate.of(row["biases"][key])
    return abs(bias.value) - bias.margin > error


def _bias_and_noise(row: Mapping, key: str) -> BiasAndNoise:
    return BiasAndNoise(Estimate.of(row["biases"][key]), Estimate.of(row["noise"][key]))
