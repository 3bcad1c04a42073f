"""The answer to the reader's question, from the summaries of `sample`: for each scene how long a
step, what it gains beside the best rival at its best step, and at what error.

The step is the longest one at which no average is known to be off by more than its bound.  It is
chosen by the biases alone, and the rival is the one that needs the least time: so the choice does
not make the gain look larger than it is.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

from ..pages import Column, Table
from ..sample.criteria import BOUNDS
from ..statistics.check import Check
from ..statistics.estimate import Estimate, combined, margin

NAMES = {  # observable: name and unit
    "potential": ("U/N", "kcal/mol"),
    "torque": ("squared torque", "%"),
    "pressure": ("pressure", "atm"),
}
GAINS = "potential", "torque"  # noises that are compared
SCENES = "water", "peptide", "benzene", "co2"  # in this order, and others behind them
WRITTEN = {"co2": "CO₂"}
COLUMNS = (
    Column("scene", "scene", kind="text"),
    Column("scheme", "ours", kind="text"),
    Column("dt", "step", "fs", "number"),
    Column("bias potential", "error of U/N", "kcal/mol", "estimate"),
    Column("bias torque", "error of squared torque", "%", "estimate"),
    Column("sure", "known to be within bounds", kind="text"),
    Column("rival", "best rival", kind="text"),
    Column("rival dt", "its step", "fs", "number"),
    Column("ps", "a ps takes", "times less", "interval"),
    Column("gain potential", "the same precision of U/N takes", "times less", "interval"),
    Column("gain torque", "that of squared torque", "times less", "interval"),
    Column("command", "command", kind="code"),
)


def is_sample(summary: Mapping) -> bool:
    """Whether a summary has points beside a limit of small steps, timed in turn."""
    if not {"scene", "known", "limits", "rows"} <= summary.keys():
        return False
    return any(set(GAINS) <= row["noise"].keys() for row in summary["rows"])


def table(summaries: Iterable[Mapping]) -> Table:
    """A row for each scene."""
    rows = [row for summary in _ordered(summaries) if (row := _answer(summary))]
    bounds = ", ".join(f"{name} {BOUNDS[key]:g} {unit}" for key, (name, unit) in NAMES.items())
    return Table(
        "How long a step, what it gains, at what error",
        COLUMNS,
        rows,
        note="Errors are the distances from the limit of small steps, with their 95 % margin. The "
        "step is the longest one at which none of them is known to be larger than its bound "
        f"({bounds}). Times are CPU times, with 95 % intervals; “a ps” has its range over rounds. "
        "The rival is chosen by the same rule, and needs the least time for U/N.",
    )


def _ordered(summaries):
    """The longest summary of each scene, in the order of `SCENES`."""
    longest: dict[str, Mapping] = {}
    for summary in filter(is_sample, summaries):
        other = longest.get(summary["scene"])
        if other is None or _sampled(summary) >= _sampled(other):
            longest[summary["scene"]] = summary
    known = longest.values()
    return sorted(known, key=lambda summary: [*SCENES, summary["scene"]].index(summary["scene"]))


def _sampled(summary):
    """ps of each point, of all starts."""
    return summary["settings"]["time"] * summary["settings"]["starts"]


def _answer(summary):
    """The row of a scene; None if no point, or no rival, is within the bounds."""
    timed = [row for row in summary["rows"] if set(GAINS) <= row["noise"].keys()]
    points = [row for row in timed if _not_off(row)]
    own = [row for row in points if row["ours"]]
    rivals = [row for row in points if not row["ours"]]
    if not own or not rivals:
        return None
    best = min(own, key=lambda row: (-row["dt"], -len(_sure(row)), row["cost"]["median"]))
    rival = min(rivals, key=lambda row: row["noise"]["potential"]["value"])
    ours, theirs = best["cost"], rival["cost"]
    ps = {
        "value": theirs["median"] / ours["median"],
        "low": theirs["min"] / ours["max"],
        "high": theirs["max"] / ours["min"],
    }
    scene = WRITTEN.get(summary["scene"], summary["scene"])
    row = {
        "scene": scene,
        "scheme": best["label"],
        "dt": best["dt"],
        "ps": ps,
        "sure": ", ".join(_sure(best)) or "none",
        "rival": rival["label"],
        "rival dt": rival["dt"],
        **{f"bias {key}": best["biases"][key] for key in GAINS},
        **{f"gain {key}": _times(rival["noise"][key], best["noise"][key]) for key in GAINS},
    }
    return row | {"cost": best["cost"], "command": summary["command"]}


def _within(row):
    """Checks of a row's biases against the bounds."""
    biases = {key: Estimate.of(row["biases"][key]) for key in NAMES if key in row["biases"]}
    return {
        key: Check.of("", row["label"], key, bias, low=-BOUNDS[key], high=BOUNDS[key])
        for key, bias in biases.items()
    }


def _sure(row):
    """Names of the averages that are known to be within their bounds."""
    return [NAMES[key][0] for key, check in _within(row).items() if check.holds]


def _not_off(row):
    return not row["error"] and all(check.holds is not False for check in _within(row).values())


def _times(theirs, ours):
    """The ratio of two noises with its 95 % interval; their logarithms are taken as normal."""
    both = Estimate.of(theirs), Estimate.of(ours)
    wide = margin(*combined(*((one.error / one.value, one.freedom) for one in both)))
    value = both[0].value / both[1].value
    return {"value": value, "low": value * math.exp(-wide), "high": value * math.exp(wide)}


def sentences(rows: Sequence[Mapping]) -> list[str]:
    """What the page begins with."""
    told = []
    for row in rows:
        errors, gains = [], []
        for key in GAINS:
            name, unit = NAMES[key]
            errors.append(f"{name} {Estimate.of(row[f'bias {key}']).text()} {unit}")
            gains.append(f"{name} {gain(row[f'gain {key}'])}")
        told.append(
            f"{row['scene'][0].upper()}{row['scene'][1:]}: {row['dt']:g} fs with {row['scheme']}. "
            f"CPU time for the same statistical error, beside {row['rival']} at "
            f"{row['rival dt']:g} fs: {', '.join(gains)}. Error of the step: {', '.join(errors)}; "
            f"known to be within the bounds: {row['sure']}."
        )
    return told


def gain(ratio: Mapping) -> str:
    """How much less time ours takes, in words that its interval allows."""
    if ratio["low"] > 1:
        return f"{_ends(ratio)} times less"
    if ratio["high"] < 1:
        ends = {"value": "value", "low": "high", "high": "low"}
        return f"{_ends({key: 1 / ratio[other] for key, other in ends.items()})} times MORE"
    return f"the same as far as these runs can tell: {_ends(ratio)} times less"


def _ends(ratio):
    return f"{ratio['value']:.2g} (95 % CI {ratio['low']:.2g}–{ratio['high']:.2g})"


def defeats(rows: Sequence[Mapping]) -> list[str]:
    """Where ours is not known to need less time than the best rival."""
    return [
        f"{row['scene']}, {NAMES[key][0]}: beside {row['rival']} at {row['rival dt']:g} fs, "
        f"{gain(row[f'gain {key}'])}"
        for row in rows
        for key in GAINS
        if row[f"gain {key}"]["low"] <= 1
    ]


def kept(summaries: Iterable[Mapping]) -> dict[tuple[str, str], str]:
    """For the table of releases: {(scene, number): text}."""
    found = {}
    for row in table(summaries).rows:
        scene = row["scene"]
        found[scene, "step, fs"] = f"{row['dt']:g}"
        for key in GAINS:
            name, unit = NAMES[key]
            found[scene, f"error of {name}, {unit}"] = Estimate.of(row[f"bias {key}"]).text()
            what = "CPU time for {} beside the best rival, times less"
            found[scene, what.format(name)] = _ends(row[f"gain {key}"])
        found[scene, "CPU time of a ps, s"] = f"{row['cost']['median']:.3g}"
    return found


def figure(summaries: Iterable[Mapping]) -> dict:
    """Data of the interactive figure: of each scene and observable its points.

    ``x`` is the CPU time of a ps in s, ``y`` the bias over its bound and ``m`` the margin of that.
    """
    found: dict = {}
    for summary in _ordered(summaries):
        best = _answer(summary) or {}
        for key, (name, unit) in NAMES.items():
            scene = WRITTEN.get(summary["scene"], summary["scene"])
            found.setdefault(scene, {})[name] = [
                {
                    "scheme": row["label"],
                    "dt": row["dt"],
                    "ours": row["ours"],
                    "best": (row["label"], row["dt"]) == (best.get("scheme"), best.get("dt")),
                    "x": row["cost"]["median"],
                    "y": bias.value / BOUNDS[key],
                    "m": bias.margin / BOUNDS[key],
                    "text": f"{bias.text()} {unit}",
                }
                for row in summary["rows"]
                if row["cost"] and not row["error"] and key in row["biases"]
                for bias in [Estimate.of(row["biases"][key])]
            ]
    return found
