"""The bias of averages in water, of engines that users turn to, at several time steps.

An engine that has the scene's forces is held against the limit of small steps of LAMMPS's runs, as
`sampling` has found it.  One with other forces is held against its own limit.
"""

from collections.abc import Collection, Mapping
from dataclasses import asdict
from pathlib import Path

from ..ensembles.lengths import SAMPLED, Lengths, Point, ordered
from ..ensembles.measure import of_momentum
from ..running import machine, run, whole
from ..sampling.measure import told_limit
from ..statistics import limit, measures
from ..statistics.estimate import Estimate
from . import plan
from .engine import Samples
from .plan import CASE, SCHEMES, Scheme
from .runs import Runs
from .water import of_scene

OBSERVED = "potential", "pressure"  # of `sampling`
BESIDE = "langevin-5", "langevin-20", "shake+langevin"  # of `sampling`, in the figure


def versions(some: Collection[Point]) -> dict[str, str]:
    """Of the engines of these points, by name.

    Raises:
        SystemExit: one is not here.
    """
    found = {}
    for engine in dict.fromkeys(SCHEMES[one.scheme].engine for one in some):
        version = engine.version()
        if version is None:
            others = [name for name, one in SCHEMES.items() if one.engine != engine]
            raise SystemExit(
                f"{engine.name} is not installed. Install it by: {engine.install}\n"
                f"Or leave it out by: --only {' '.join(others)}"
            )
        found[engine.name] = version
    return found


def known_limit(folder: Path) -> dict:
    """What `sampling` has left in a folder of the same water: ``command``, ``limits``, ``rows``.

    Raises:
        SystemExit: it has left nothing there, or of another scene.
    """
    summary = whole.read(folder / "summary.json")
    if summary is None:
        raise SystemExit(f"{folder} has no summary.json of the verb sampling")
    limits = {key: one for key, one in summary.get("limits", {}).items() if key in OBSERVED}
    if summary.get("scene") != CASE.name or not limits:
        raise SystemExit(f"{folder} has no limit of the scene {CASE.name}, made by sampling")
    rows = [row for row in summary["rows"] if row["scheme"] in BESIDE and not row["error"]]
    return {"command": summary["command"], "limits": limits, "rows": rows}


def engines(
    points: Collection[Point],
    lengths: Lengths,
    out: Path,
    known: Mapping,
    meter: run.Meter,
    silence: float,
) -> dict:
    """Run what is not there yet, and measure; points that earlier commands of the same lengths
    have left in the folder are measured, too, if their engine is here.

    Several processes of the same command share the runs.

    Args:
        known: see `known_limit`.
        silence: s without a sign of life after which a run is given up.

    Returns:
        plain data: circumstances, settings, rows, limits.
    """
    folder = out / "runs" / lengths.folder
    every = with_left(points, folder)
    here = versions(every)
    some = Runs(of_scene(CASE.scene), folder, here, silence)
    wanted = {
        name: (_label(point, lengths, name), SCHEMES[point.scheme].engine, course)
        for name, point, course in plan.courses(points, lengths)
    }
    interrupted = some.do(wanted, meter)
    found: dict[Point, list[Samples]] = {}
    errors: dict[Point, str] = {}
    for name, point, course in plan.courses(every, lengths):
        samples, error = some.found(name, SCHEMES[point.scheme].engine, course)
        if samples:
            found.setdefault(point, []).append(samples)
        if error:
            errors.setdefault(point, error)
    summary = machine.circumstances()
    summary["versions"] |= here
    return summary | {
        "scene": CASE.name,
        "title": CASE.scene.title,
        "interrupted": interrupted,
        "bodies": CASE.scene.unit,
        "temperature": CASE.temperature,
        "settings": asdict(lengths)
        | {"settle": lengths.settle, "sampled_fs": plan.SPARSE * SAMPLED},
        "known": {"command": known["command"], "limits": known["limits"]},
        "beside": [
            _beside(row) for row in known["rows"] if row["dt"] <= max(one.dt for one in every)
        ],
        **told(found, errors, every, lengths, some, known["limits"]),
    }


def with_left(points: Collection[Point], folder: Path) -> list[Point]:
    """The points, and those of which the folder has records, if their engine is here."""
    left = set()
    for path in folder.glob("start-*/*-fs-*.json"):
        name, _, dt = path.stem.rpartition("-")[0].removesuffix("-fs").rpartition("-")
        if name in SCHEMES:
            left.add(Point(name, float(dt)))
    engines = {SCHEMES[one.scheme].engine for one in left}
    here = {one for one in engines if one.version() is not None}
    found = [one for one in left if SCHEMES[one.scheme].engine in here]
    return ordered([*points, *found], SCHEMES)


def _label(point: Point, lengths: Lengths, name: str) -> str:
    label = f"{SCHEMES[point.scheme].label}, {point.dt:g} fs"
    return label + f", {name.partition('/')[0]}" * (lengths.starts > 1)


def _beside(row: Mapping) -> dict:
    """A row of `sampling`, for the figure."""
    biases = {key: one for key, one in row["biases"].items() if key in OBSERVED}
    return {key: row[key] for key in ("scheme", "label", "dt")} | {"biases": biases}


def told(
    found: Mapping[Point, list[Samples]],
    errors: Mapping[Point, str],
    points: Collection[Point],
    lengths: Lengths,
    some: Runs,
    known: Mapping[str, Mapping],
) -> dict:
    """Rows of the points that were run, and the limits; plain data.

    Returns:
        ``rows``; ``limits``, of each engine those of its own points; ``apart``, of each engine with
        the scene's forces how far these are from LAMMPS's.
    """
    good = {
        point: _means(starts, SCHEMES[point.scheme], lengths.runs(point.dt)[0], some)
        for point, starts in found.items()
        if point not in errors
    }
    fits = _fits(good)
    rows = [
        _row(point, found, good, errors, fits, lengths, some, known)
        for point in points
        if point in good or point in errors
    ]
    apart = {
        engine: {
            key: measures.difference(fit.limit, Estimate.of(known[key])).plain()
            for key, fit in own.items()
            if key in known
        }
        for engine, own in fits.items()
        if any(one.same for one in SCHEMES.values() if one.engine.name == engine)
    }
    limits = {
        engine: {key: told_limit(fit) for key, fit in own.items()} for engine, own in fits.items()
    }
    return {"rows": rows, "limits": limits, "apart": apart}


def _row(
    point: Point,
    found: Mapping[Point, list[Samples]],
    good: Mapping[Point, Mapping[str, Estimate]],
    errors: Mapping[Point, str],
    fits: Mapping[str, Mapping[str, limit.Fit]],
    lengths: Lengths,
    some: Runs,
    known: Mapping[str, Mapping],
) -> dict:
    """The row of one point, as `told` has it; ``good`` are the means of those that are complete."""
    scheme = SCHEMES[point.scheme]
    engine, course = scheme.engine, plan.course(point, lengths, 1)
    row: dict = {
        "scheme": scheme.name,
        "label": scheme.label,
        "engine": engine.name,
        "ours": False,
        "dt": point.dt,
        "lines": engine.words(course, some.water),
        "starts": 0,
        "error": errors.get(point),
        "means": {},
        "biases": {},
        "clock": None,
    }
    if point in good:
        starts, ps = found[point], course.steps * point.dt / 1e3
        biases = _biases(point, good, fits, known)
        row["starts"] = len(starts)
        row["means"] = {key: one.plain() for key, one in good[point].items()}
        row["biases"] = {key: one.plain() for key, one in biases.items()}
        row["clock"] = measures.spread([one.seconds / ps for one in starts])
    return row


def _means(
    starts: Collection[Samples], scheme: Scheme, settle: int, some: Runs
) -> dict[str, Estimate]:
    """Means over the samples of all starts, without the steps that are left out."""
    missing = of_momentum(scheme.held, CASE.temperature, float(some.water.box.prod()))
    found: dict[str, list[Estimate]] = {key: [] for key in OBSERVED}
    for one in starts:
        kept = one.step >= settle
        found["potential"].append(measures.mean(one.potential[kept] / some.water.molecules))
        found["pressure"].append(measures.mean(one.pressure[kept] + missing))
    return {key: measures.of_starts(means) for key, means in found.items()}


def _fits(means: Mapping[Point, Mapping[str, Estimate]]) -> dict[str, dict[str, limit.Fit]]:
    """Of each engine the limits that its own points tell."""
    models = {name: one.model for name, one in SCHEMES.items()}
    found: dict[str, dict[str, limit.Fit]] = {}
    for engine in dict.fromkeys(SCHEMES[point.scheme].engine.name for point in means):
        of = [point for point in means if SCHEMES[point.scheme].engine.name == engine]
        steps = {point: (point.scheme, point.dt) for point in of}
        for key in OBSERVED:
            fit = limit.fit({point: means[point][key] for point in of}, steps, models)
            if fit is not None:
                found.setdefault(engine, {})[key] = fit
    return found


def _biases(point, means, fits, known) -> dict[str, Estimate]:
    """From LAMMPS's limit with the scene's forces, else from the engine's own."""
    scheme = SCHEMES[point.scheme]
    if scheme.same:
        return {
            key: measures.difference(mean, Estimate.of(known[key]))
            for key, mean in means[point].items()
            if key in known
        }
    return {key: fit.bias(point) for key, fit in fits.get(scheme.engine.name, {}).items()}
