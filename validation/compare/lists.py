"""Neighbour lists for the step that is advised: long steps build them more often than short ones,
so a wider skin or smaller bins may take less time."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ..experiment import Point
from ..running import rounds, run
from ..statistics.measures import Spread
from .case import Case
from .plan import STARTUP, Settings

SKINS = {"real": 3.0, "metal": 3.0, "lj": 0.45, "electron": 3.0}  # 1.5 times LAMMPS's defaults
BINS = 2 / 3  # of the size that LAMMPS takes, which is half of the longest distance in a list
ROUNDS = 3
AS_IT_IS = "as it is"
_BINSIZE = re.compile(r"^ *binsize = ([^,\s]+), bins", re.M)


def measure(case: Case, point: Point, settings: Settings, meter: run.Meter) -> list[dict]:
    """Time other lists in turn with those of the script.

    Returns:
        of each ``lines``, what they add to the script, and ``ratio``, the `Spread` of their time
        per step over that of the script's lists. None if the time does not suffice, if LAMMPS
        makes no bins, or if a run fails.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """
    folder = settings.out / "runs" / "lists"

    def job(name: str, lines: Sequence[str], runs: list[int]) -> run.Job:
        scene = replace(case.scene, setup=(*case.scene.setup, *lines))
        how: dict = {"ranks": settings.ranks, "silence": settings.silence, "keeps": "nothing"}
        return run.job(
            scene, case.integrators[point.scheme], folder / run.folder_name(name), runs,
            dt=point.dt, every=0, **how,
        )  # fmt: skip

    usual = SKINS.get(case.scene.units)
    seconds = settings.for_lists / ROUNDS / (1 + len(_others(1.0, 1.0))) - STARTUP
    if usual is None or seconds <= 0:
        return []
    meter.begin("neighbour lists", 1)
    step = rounds.calibrate(lambda runs: job(AS_IT_IS, (), runs))
    meter.end(None if isinstance(step, float) else step.error)
    if not isinstance(step, float):
        if step.interrupted:
            raise KeyboardInterrupt
        return []
    size = _binsize(folder / run.folder_name(AS_IT_IS))
    lines = {AS_IT_IS: ()} | (_others(usual, size) if size else {})
    runs = rounds.lengths(step, seconds / rounds.SEGMENTS).runs
    labels = {name: f"neighbour lists, {name}" for name in lines}
    found, _, cut = rounds.in_turn(
        labels, lambda name, number: job(name, lines[name], runs), ROUNDS, meter
    )
    if cut:
        raise KeyboardInterrupt
    timed = found.pop(AS_IT_IS)
    ratios = {name: rounds.ratio(own, timed, "loop") for name, own in found.items()}
    return [{"lines": [*lines[name]], "ratio": one} for name, one in ratios.items() if one]


def _others(skin: float, size: float) -> dict[str, tuple[str, ...]]:
    wider, smaller = f"neighbor {skin:g} bin", f"neigh_modify binsize {BINS * size:.3g}"
    both = wider, smaller
    return {wider: (wider,), smaller: (smaller,), " and ".join(both): both}


def _binsize(folder: Path) -> float | None:
    """The size of bins that LAMMPS told in a run's log."""
    told = _BINSIZE.findall((folder / "log.lammps").read_text())
    return float(told[-1]) if told else None


def said(found: Sequence[Mapping]) -> Iterator[str]:
    """What is advised: the fastest lists, if they were faster than the script's in all rounds."""
    best = min(found, key=lambda one: one["ratio"]["median"], default=None)
    if best is None:
        return
    ratio: Spread = best["ratio"]
    if ratio["max"] >= 1:
        yield "Neither a wider skin nor smaller bins of neighbour lists save time."
        return
    less, least, most = (100 * (1 - ratio[key]) for key in ("median", "max", "min"))
    yield f"With these lines too a step takes {less:.0f} % ({least:.0f} to {most:.0f}) less time:"
    yield from (f"    {line}" for line in best["lines"])
