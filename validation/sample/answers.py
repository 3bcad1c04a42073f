"""The answer to the reader's question, from the summaries of `sample`: for each scene our best
point compared with the rivals, and its speed-up at the same error of each average."""

from collections.abc import Iterable, Mapping, Sequence

from ..pages import Column, Table, digits
from ..statistics.estimate import Estimate
from . import rivals
from .criteria import BOUNDS
from .observables import BY_KEY

SCENES = "water", "tip4p", "peptide", "benzene", "co2"  # in this order, others after them
WRITTEN = {"tip4p": "TIP4P/2005", "co2": "CO₂"}
COLUMNS = (
    Column("scene", "scene", kind="text"),
    Column("scheme", "ours", kind="text"),
    Column("dt", "step", "fs", "number"),
    Column("average", "average", kind="text"),
    Column("goal", "error to reach", kind="number", form=".3g"),
    Column("bias", "bias", kind="estimate"),
    Column("unit", "unit", kind="text"),
    Column("rival", "best rival", kind="text"),
    Column("rival dt", "its step", "fs", "number"),
    Column("gain", "speed-up", "95 % CI", "interval"),
)
NOTE = (
    "The speed-up is the CPU time of the best rival divided by ours, until bias² + variance is "
    "twice the square of the error to reach. This error is the upper end of the 95 % interval of "
    "the rival's bias, and at least a bound that was set before the data were taken. For each "
    "average, the best rival is the one of LAMMPS's fixes, at its best step, that takes the least "
    "time. Ours is one scheme and step for all averages of a liquid: the one whose smallest "
    "speed-up is the largest. 0 means that our bias is too large, or may be."
)


def table(summaries: Iterable[Mapping]) -> Table:
    """A row for each average of each scene."""
    return Table(
        "Speed-up at the same error",
        COLUMNS,
        [row for summary in _ordered(summaries) for row in _answers(summary)],
        note=NOTE,
    )


def _ordered(summaries):
    """The summary with the best point of each scene, in the order of `SCENES`."""
    ranked = sorted(filter(_best, summaries), key=lambda summary: rivals.gains(_best(summary)))
    known = {summary["scene"]: summary for summary in ranked}.values()  # the last of each
    return sorted(known, key=lambda summary: [*SCENES, summary["scene"]].index(summary["scene"]))


def _best(summary):
    """Our best point; None for a summary without points that are timed together with a rival's."""
    return rivals.best(summary["rows"]) if summary.get("goals") else None


def _name(summary):
    return WRITTEN.get(summary["scene"], summary["scene"])


def _answers(summary):
    """The rows of a scene."""
    best = _best(summary)
    for key, gain in best["faster"].items():
        goal = summary["goals"][key]
        yield {
            "scene": _name(summary),
            "scheme": best["label"],
            "dt": best["dt"],
            "average": BY_KEY[key].title,
            "goal": goal["error"],
            "unit": BY_KEY[key].unit,
            "bias": best["biases"][key],
            "rival": goal["label"],
            "rival dt": goal["dt"],
            "gain": gain,
            "cost": best["cost"],
        }


def sentences(rows: Sequence[Mapping]) -> list[str]:
    """A sentence for each scene."""
    gains_by_scheme: dict[tuple, list[str]] = {}
    for row in rows:
        gains_by_scheme.setdefault((row["scene"], row["scheme"], row["dt"]), []).append(
            f"{row['average']} {speed_up(row['gain'])}"
        )
    return [
        f"{scene[0].upper()}{scene[1:]}: {scheme} at {dt:g} fs. Speed-up at the same error, over "
        f"the best of LAMMPS's fixes at its best step: {', '.join(gains)}."
        for (scene, scheme, dt), gains in gains_by_scheme.items()
    ]


def speed_up(gain: Mapping) -> str:
    """Format the rival's time divided by ours, with its interval."""
    value, low, high = (digits(gain[name], 2) for name in ("value", "low", "high"))
    return f"{value} (95 % CI {low}–{high})"


def defeats(rows: Sequence[Mapping]) -> list[str]:
    """Name where ours is not significantly faster than the best rival."""
    return [
        f"{row['scene']}, {row['average']}: speed-up {speed_up(row['gain'])} over {row['rival']} "
        f"at {row['rival dt']:g} fs"
        for row in rows
        if row["gain"]["low"] is not None and row["gain"]["low"] <= 1
    ]


def figure(summaries: Iterable[Mapping]) -> dict:
    """The data of the interactive figure: the points of each scene and observable.

    ``x`` is the CPU time per ps in s, ``y`` the bias over its bound and ``m`` the margin of that.
    """
    data: dict = {}
    for summary in _ordered(summaries):
        best = _best(summary)
        for key, bound in BOUNDS.items():
            points = [
                {
                    "scheme": row["label"],
                    "dt": row["dt"],
                    "ours": row["ours"],
                    "best": row is best,
                    "x": row["cost"]["median"],
                    "y": bias.value / bound,
                    "m": bias.margin / bound,
                    "text": f"{bias.text()} {BY_KEY[key].unit}",
                }
                for row in summary["rows"]
                if row["cost"] and not row["error"] and key in row["biases"]
                for bias in [Estimate.of(row["biases"][key])]
            ]
            if points:
                data.setdefault(_name(summary), {})[BY_KEY[key].title] = points
    return data
