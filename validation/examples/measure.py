"""Comparing every column that LAMMPS's examples print, with its own fixes and with ours."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..running import run
from ..statistics.estimate import CONFIDENCE, margin
from .known import KNOWN
from .plan import DENSE, Example, plain
from .runs import OURS, THEIRS, Lengths, Runs

RANKS = 1, 2
CLOCKS = "CPU", "T/CPU", "S/CPU", "CPULeft", "Elapsed"
# what LAMMPS's rigid fixes say of the pressure has an impulse in a run's first step, and an error
# of first order in the step in all others
PRESSURE = re.compile(r"Press|P[xyz]{2}$|Enthalpy")
ROUNDING = 1e-9  # of a column, after twenty steps: 1e-16 grows by 10 in two or three of them
NOISE = 1e-9  # of a run's largest value: a column that is smaller in the first steps is zero there
TOGETHER = 1e-3  # of a column: two runs are one trajectory, and need no other starts
# at half the step an error of order 1/2 (noise that one lacks in a half step) falls by 1.41, of
# order 1 by 2, of order 2 by 4; what is wrong does not fall
FALLS = 1.25
GOOD = "agrees", "known", "refused", "not with theirs"


def examples(
    chosen: Sequence[Example], out: Path, lengths: Lengths, meter: run.Meter
) -> tuple[list[dict], bool]:
    """Run examples, those runs that the output folder does not have.

    Returns:
        plain data, a row for each example; whether a Ctrl-C ended it.
    """
    simulate, rows = Runs(out, lengths), []
    for example in chosen:
        meter.begin(example.name, 1)
        try:
            rows.append(row(example, simulate, len(chosen)))
        except KeyboardInterrupt:
            meter.end("interrupted")
            return rows, True
        meter.end(None if rows[-1]["verdict"] in GOOD else rows[-1]["note"])
    return rows, False


def row(example: Example, simulate: Runs, count: int) -> dict:
    """What comes of an example, one of ``count``, on 1 and 2 ranks: a verdict, numbers, a note."""
    first, steps = simulate.first(example)
    text = example.copy(steps, simulate.every(example))
    theirs = [first, simulate(example, text, THEIRS, 2, "0")]
    ours = [simulate(example, text, OURS, ranks, "0") for ranks in RANKS]
    styles = [" ".join(words[3:]) for words in example.fixes]
    found: dict = {"example": example.name, "fixes": list(dict.fromkeys(styles))}
    found |= {"said": ours[0]["said"], "steps": steps, "note": ""}
    failed, bad = _errors(theirs), _errors(ours)
    if failed:
        return found | {"verdict": "not with theirs", "note": failed[0], "ours": bad[:1]}
    if bad:
        told = len(bad) == len(RANKS) and all(one.startswith("ERROR") for one in bad)
        return found | {"verdict": "refused" if told else "crash", "note": bad[0]}
    unlike = [name for one, other in zip(theirs, ours) for name in _unlike(one, other)]
    if unlike:
        note = f"not the same tables: {', '.join(dict.fromkeys(unlike))}"
        return found | {"verdict": "differs", "note": note}
    return found | _compared(example, simulate, steps, theirs, ours, count)


def _most(apart):
    """The largest difference of a column that is no pressure."""
    return max((motion for motion, _ in apart.values()), default=0.0)


def _errors(records):
    return [one["error"] for one in records if one["error"]]


def _compared(example, simulate, steps, theirs, ours, count):
    at, (words, *_) = example.first, example.fixes
    number: dict = {"growth": _most(beginning(theirs[0], theirs[1], at))}
    if "langevin" not in words[4:]:  # whose noise is another
        number["begin"], number["falls"] = _beginnings(example, simulate, steps, ours)
    starts = [list(zip(theirs, ours))]
    number["whole"] = max(_most(_apart(*both)) for pair in starts[0] for both in _tables(*pair))
    parted = number["whole"] > TOGETHER
    for start in range(1, simulate.lengths.starts) if parted else ():
        text = example.copy(steps, simulate.every(example), start)
        one, other = (simulate(example, text, which, 1, str(start)) for which in (THEIRS, OURS))
        if not (one["error"] or other["error"] or _unlike(one, other)):
            starts.append([(one, other)])
    number |= {"starts": len(starts), "columns": 0, "outside": [], "far": []}
    number |= means(starts, at, count) if parted else {}
    wrong = [f"the mean of {', '.join(number['far'])}"] * bool(number["far"])
    wrong += ["the first steps"] * any(one < FALLS for one in number.get("falls", ()))
    if wrong:
        why = KNOWN.get(example.name)
        verdict = "known" if why else "differs"
        return number | {"verdict": verdict, "note": " and ".join(wrong), "why": why}
    return number | {"verdict": "agrees"}


def _beginnings(example, simulate, steps, ours):
    """How far the first steps are apart, (motion, pressure) on 1 and on 2 ranks, from LAMMPS's
    rigid/nve in the place of rigid; and by how much what is more than rounding falls at half the
    step, on 1 rank."""
    at, nve = example.first, plain(example.fixes[0])
    without = f"f_{example.fixes[0][1]}" if nve else None  # rigid/nve says another thing by it
    text = example.beginning(steps, simulate.every(example), 1, nve)
    theirs = [simulate(example, text, THEIRS, ranks, "begin") for ranks in RANKS]
    whole = ours[0]["tables"][at]
    least = {name: NOISE * max(map(abs, values)) for name, values in whole.items()}
    begins = [beginning(*pair, at, without, least=least) for pair in zip(theirs, ours)]
    found = [max(one, default=0.0) for begin in begins for one in zip(*begin.values())]
    if max(found) <= ROUNDING:
        return found, []
    finer = [_finer(example, simulate, steps, which) for which in (THEIRS, OURS)]
    usual = beginning(theirs[0], ours[0], at, without, of=np.median, least=least)
    half = beginning(finer[0], finer[1], at, without, 2, np.median, least)
    return found, [
        max(one) / max(1e-300, *other)
        for most, one, other in zip(found, zip(*usual.values()), zip(*half.values()))
        if most > ROUNDING
    ]


def _finer(example, simulate, steps, which):
    nve = which == THEIRS and plain(example.fixes[0])
    text = example.beginning(steps, simulate.every(example), 2, nve)
    return simulate(example, text, which, 1, "finer")


def _unlike(theirs, ours):
    """Columns that one of two runs does not have, or that one has more tables."""
    both = list(zip(theirs["tables"], ours["tables"]))
    if len(both) < max(len(theirs["tables"]), len(ours["tables"])):
        return [f"{len(ours['tables'])} of {len(theirs['tables'])} runs"]
    return [name for one, other in both for name in {*one} ^ {*other}]


def _tables(theirs, ours):
    """Pairs of tables, of the rows that both have."""
    for one, other in zip(theirs["tables"], ours["tables"]):
        rows = min(len(one["Step"]), len(other["Step"]))
        yield tuple({name: table[name][:rows] for name in table} for table in (one, other))


def beginning(theirs, ours, at, without=None, finer=1, of=np.max, least=None) -> dict[str, tuple]:
    """How far two runs are apart in the first steps of a table: see `_apart`."""
    pair = list(_tables(theirs, ours))[at]
    some = slice(0, DENSE * finer + 1, finer)
    one, other = ({name: table[name][some] for name in table} for table in pair)
    return _apart(one, other, without, of, least)


def _apart(theirs, ours, without=None, of=np.max, least=None) -> dict[str, tuple]:
    """The difference of each column, ``of`` all rows, in units of its largest value, or of one in
    ``least``: a pair, of which one is 0, that of motion for a pressure, which has no first row, and
    else that of pressure."""
    apart = {}
    for name in (name for name in theirs if name not in (*CLOCKS, "Step", without)):
        kind = bool(PRESSURE.match(name))
        one, other = np.array([theirs[name], ours[name]])[:, kind:]
        size = np.max(np.abs([one, other]), initial=(least or {}).get(name, 0.0)) or 1.0
        far = float(of(np.abs(one - other)) / size) if len(one) else 0.0
        far = far if np.isfinite(far) else np.inf
        apart[name] = (0.0, far) if kind else (far, 0.0)
    return apart


def means(starts: list[list[tuple]], at: int, count: int = 1) -> dict:
    """Whether means of all columns agree, over the rest of each run: differences from the same
    start, averaged over its pairs of runs, whose 95 % interval has zero in it.

    Of pressures the error that LAMMPS's have in the first steps of table ``at`` is no difference.

    Returns:
        ``columns``: how many there are; ``outside``: those outside of their interval; ``far``:
        those outside of the one in which all columns of ``count`` such comparisons are in 95 %.
    """
    differences: dict[str, list] = {}
    least: dict[str, float] = {}
    for pairs in starts:
        of_start: dict[str, list] = {}
        for theirs, ours in pairs:
            known = beginning_of_pressures(theirs, ours, at)
            for key, far, size in _of_pair(theirs, ours):
                of_start.setdefault(key, []).append(far)
                here = max(TOGETHER * size, known.get(key.partition(" ")[0], 0.0))
                least[key] = max(least.get(key, 0.0), here)
        for key, some in of_start.items():
            differences.setdefault(key, []).append(float(np.mean(some)))

    def outside(confidence):
        return [key for key, some in differences.items() if _off(some, confidence) > least[key]]

    of_all = 1 - (1 - CONFIDENCE) / max(1, count * len(differences))
    found = {"outside": outside(CONFIDENCE), "far": outside(of_all)}
    return {"columns": len(differences)} | found


def _of_pair(theirs, ours):
    """Of each column: its name with the run, the difference of means, the largest value."""
    for number, (one, other) in enumerate(_tables(theirs, ours), 1):
        for name in (name for name in one if name not in (*CLOCKS, "Step")):
            some, others = (np.array(table[name])[DENSE + 1 :] for table in (one, other))
            if len(some):
                far = float(np.mean(others) - np.mean(some))
                yield f"{name} of run {number}", far, float(np.max(np.abs(some)))


def _off(values, confidence):
    """The size of a mean that an interval of this confidence does not have in it; else 0."""
    mean, error = abs(np.mean(values)), np.std(values, ddof=1) / np.sqrt(len(values))
    inside = mean <= margin(float(error), len(values) - 1, confidence)
    return 0.0 if inside else float(np.nan_to_num(mean, nan=np.inf))


def beginning_of_pressures(theirs: dict, ours: dict, at: int) -> dict[str, float]:
    """Twice the largest difference of each pressure in the first steps of a table, where the runs
    are one trajectory."""
    one, other = list(_tables(theirs, ours))[at]
    one, other = ({name: table[name][: DENSE + 1] for name in table} for table in (one, other))
    if _most(_apart(one, other)) > TOGETHER:
        return {}
    names = [name for name in one if PRESSURE.match(name)]
    apart = {name: np.abs(np.subtract(one[name], other[name]))[1:] for name in names}
    return {name: 2 * float(np.max(some, initial=0.0)) for name, some in apart.items()}
