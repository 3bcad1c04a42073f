"""Neighbour lists at the advised step: long steps rebuild them every few steps, so a wider skin or
smaller bins may save time."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from ..experiment import Point
from ..running import lammps_log, rounds, run
from .case import Case
from .plan import OTHER_LISTS, ROUNDS, Settings

WIDER = 1.5  # times the script's skin; a narrower one could miss pairs
BINS = 1 / 3  # of the neighbour cutoff; LAMMPS takes a half
SAVES = 0.98  # largest ratio of times, in each round: smaller savings could be noise
LATEST = 2  # times the planned time; if steps take longer than that, nothing is timed
AS_IT_IS = "as it is"


def measure(
    case: Case, point: Point, settings: Settings, startup: float, meter: run.Meter
) -> list[dict]:
    """Time other lists in turn with those of the script.

    Args:
        startup: s until a run's first step.

    Returns:
        for each: ``lines`` to add to the script, and ``ratio``, the `Spread` of the time per step
        over that with the script's lists. Only settings that ran in all rounds; none if the time
        does not suffice.

    Raises:
        RuntimeError: the script's own lists fail.
        KeyboardInterrupt: after a Ctrl-C.
    """
    folder = settings.out / "runs" / "lists"

    def job(name: str, lines: Sequence[str], runs: list[int]) -> run.Job:
        return run.job(
            replace(case.scene, setup=(*case.scene.setup, *lines)),
            case.integrators[point.scheme],
            folder / run.folder_name(name),
            runs,
            dt=point.dt,
            every=0,
            ranks=settings.ranks,
            silence=settings.silence,
            keeps="nothing",
        )

    if not settings.for_lists:
        return []
    meter.begin("neighbour lists", 1)
    try:
        step = rounds.calibrate(lambda runs: job(AS_IT_IS, (), runs))
    except RuntimeError as error:
        meter.end(str(error))
        raise
    meter.end(None)
    log = folder / run.folder_name(AS_IT_IS) / "log.lammps"
    lines = {AS_IT_IS: ()} | _others(lammps_log.lists(log.read_text(errors="replace")))
    each = settings.for_lists / ROUNDS / (1 + OTHER_LISTS)
    runs = rounds.lengths(step, max(each - startup, 0.0) / rounds.SEGMENTS).runs
    if startup + step * sum(runs) > LATEST * each:
        return []
    timings, errors, cut = rounds.in_turn(
        {name: f"neighbour lists, {name}" for name in lines},
        lambda name, number: job(name, lines[name], runs),
        ROUNDS,
        meter,
    )
    if cut:
        raise KeyboardInterrupt
    if AS_IT_IS in errors:
        raise RuntimeError(errors[AS_IT_IS])
    timed = timings.pop(AS_IT_IS)
    ratios = {name: rounds.ratio(timings[name], timed, "loop") for name in timings.keys() - errors}
    return [{"lines": [*lines[name]], "ratio": ratios[name]} for name in lines if name in ratios]


def _others(lists: lammps_log.Lists | None) -> dict[str, tuple[str, ...]]:
    """A wider skin, smaller bins, and both, where LAMMPS bins atoms and the script does not set the
    bin size."""
    if lists is None or lists.style != "bin" or lists.sized:
        return {}
    wider = f"neighbor {WIDER * lists.skin:g} bin"
    smaller = f"neigh_modify binsize {BINS * lists.cutoff:.3g}"
    return {wider: (wider,), smaller: (smaller,), f"{wider} and {smaller}": (wider, smaller)}


def advise(measured: Sequence[Mapping]) -> Iterator[str]:
    """Advise the fastest lists of those that were faster than the script's in all rounds."""
    if not measured:
        return
    good = [row for row in measured if row["ratio"]["max"] < SAVES]
    if not good:
        yield (
            "Neighbour lists with a wider skin or smaller bins were not faster than yours in all "
            f"of {ROUNDS} rounds."
        )
        return
    best = min(good, key=lambda row: row["ratio"]["median"])
    less, least, most = (100 * (1 - best["ratio"][key]) for key in ("median", "max", "min"))
    yield (
        f"These neighbour lists reduce the time per step by {less:.0f} % ({least:.0f} to "
        f"{most:.0f} % in {ROUNDS} rounds). Put the lines in place of your own:"
    )
    yield from (f"    {line}" for line in best["lines"])
