"""The error of averages, of bias and of noise, that a scheme with a step gives for its time.

All schemes move the same molecules from the same starts.  Biases are distances from the limit of
small steps that schemes of the same distribution share (`limit`), or from what theory knows.  Noise
is what one independent sample costs.  Where a scheme is at two states the ratio of its
distributions is known without any reference (`structure.between_states`).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from ..experiment import Point
from ..running import json_files, machine, run
from ..scenes import FS_PER_PS
from ..statistics import limit, measures, structure
from ..statistics.estimate import Estimate
from . import openmm_engine, rivals
from .criteria import LEAST_ERRORS
from .observables import BY_KEY, CONFIGURATIONS, OBSERVABLES, Table
from .plan import KINETIC, LAMMPS, SAMPLED, Plan, Runs, start_name, table
from .schemes import Scheme

# of each of two states independent samples, as fewer cannot tell a slope, and how many are taken
# for an independent one, as physical_validation has bins to fill (it counts independent ones)
LEAST_SAMPLES, DENSER = 50, 4
# of a row: numbers of each observable
NESTED = "means", "biases", "remembers", "noise", "faster", "seconds"
KNOWN = Point("known", 0.0)  # what stands for a limit that another command has found


@dataclass
class Numbers:
    """What a start of a point gave, or all of them together.

    Attributes:
        means: of observables.
        remembers: of each, ps of an independent sample; of a square only with all starts.
        variances: of each, of a sample.
        vectors: of squares, the autocovariances of the components, (components, lags).
        apart: ps between samples.
        state: samples that are held against those of another state, at constant pressure.
        far: standard deviations between the distribution of the bodies' kinetic energy and the
            canonical one, see `structure.distribution`.
        loop: s of a step with its samples.
    """

    means: dict[str, Estimate]
    remembers: dict[str, Estimate]
    variances: dict[str, float]
    vectors: dict[str, np.ndarray] = field(default_factory=dict)
    apart: float = 0.0
    state: structure.Sampled | None = None
    far: float | None = None
    loop: float = 0.0

    def noise(self, key: str) -> Estimate:
        """Variance of a mean times ps."""
        return self.remembers[key].times(self.variances[key])


@dataclass
class Results:
    """What the runs gave: of each point the numbers of its starts, by their numbers, why one
    failed, and s of a core for a ps without samples, in each round."""

    numbers: dict[Point, dict[int, Numbers]] = field(default_factory=dict)
    errors: dict[Point, str] = field(default_factory=dict)
    costs: dict[Point, list[float]] = field(default_factory=dict)

    @property
    def good(self) -> list[Point]:
        """Points of which no start failed."""
        return [point for point in self.numbers if point not in self.errors]


def sample(
    runs: Runs, points: Collection[Point], known: Mapping[str, Mapping], meter: run.Meter
) -> dict:
    """Run what is not there yet, and measure; points that earlier commands of the same lengths
    have left in the folder are measured, too.

    Several processes of the same command share the runs.

    Args:
        known: limits of small steps, by observable, that are taken in the place of the runs' own,
            see `known_limits`.

    Returns:
        plain data: circumstances, settings, and what `summarize` gives.
    """
    plan, lengths, found = runs.plan, runs.lengths, Results()
    done = runs.perform(points, meter)
    lost = {n: why for n in runs.starts if (why := done.failed.get(start_name(n)))}
    if len(lost) == lengths.starts:
        found.errors |= dict.fromkeys(points, f"all starts failed, start 1: {lost[1]}")
    every = plan.ordered([*points, *runs.left()])
    for point in every:
        for start in runs.starts:
            job = runs.job(point, start)
            if point not in found.errors and run.is_there(job, failures=True):
                _measure(found, plan, point, start, job)
    interrupted = _timed(found, runs, meter, not done.interrupted)
    summary = machine.circumstances()
    summary["versions"] |= machine.worker_versions(done.versions)
    if any(plan.schemes[point.scheme].engine for point in found.good):
        summary["versions"] |= openmm_engine.versions()
    return summary | {
        "scene": plan.scene.name,
        "title": plan.scene.title,
        "interrupted": done.interrupted or interrupted,
        "lost": lost,
        "bodies": plan.scene.unit,
        "temperature": plan.temperature,
        "known": [point._asdict() for point in plan.known],
        "settings": asdict(lengths) | {"settle": lengths.settle, "sampled_fs": SAMPLED},
        **summarize(found, runs, every, known),
    }


def known_limits(folder: Path, scene: str) -> dict:
    """The limits of small steps that another command has found of the same scene.

    Raises:
        SystemExit: it has left nothing there, or of another scene.
    """
    summary = json_files.read(folder / "summary.json") or {}
    if summary.get("scene") != scene or not summary.get("limits"):
        raise SystemExit(f"{folder} has no limit of small steps of the scene {scene}")
    return summary["limits"]


def _measure(found: Results, plan: Plan, point: Point, start: int, job: run.Job) -> None:
    """The numbers of a run that is there, or why it has none."""
    result, samples = table(job)
    if result.error:
        found.errors.setdefault(point, result.error)
        return
    numbers = of_series(samples, plan, plan.schemes[point.scheme])
    last = result.timings[-1]
    numbers.loop = last.seconds / last.steps
    found.numbers.setdefault(point, {})[start] = numbers


def _timed(found: Results, runs: Runs, meter: run.Meter, time: bool) -> bool:
    """What a ps of each point costs; whether a Ctrl-C came.

    Args:
        time: whether to time what no earlier command has.
    """
    # of LAMMPS, from the first start that a point has
    first = {
        point: next(iter(found.numbers[point].items()))
        for point in found.good
        if not runs.plan.schemes[point.scheme].engine
    }
    loops = {point: (start, numbers.loop) for point, (start, numbers) in first.items()}
    try:
        found.costs = runs.costs(loops, meter, time)
    except KeyboardInterrupt:
        return True
    return False


def of_series(samples: Table, plan: Plan, scheme: Scheme) -> Numbers:
    """A run's numbers."""
    apart = float(np.median(np.diff(samples["Time"]))) / 1e3
    numbers = Numbers({}, {}, {}, apart=apart)
    for observable in OBSERVABLES:
        x = observable.of(samples, plan, scheme)
        if x is None:
            continue
        numbers.means[observable.key] = measures.mean(x)
        numbers.variances[observable.key] = float(np.var(x, ddof=1))
        if observable.vector:
            vector = np.stack([samples[name] for name in observable.vector], axis=1)
            numbers.vectors[observable.key] = measures.autocovariance(vector)
        else:
            numbers.remembers[observable.key] = measures.autocorrelation(x).times(apart)
    if scheme.pressure is not None:
        values = thin(samples["PotEng"], samples["Volume"], times=DENSER)
        numbers.state = structure.Sampled(scheme.temperature, scheme.pressure, values)
    if scheme.reach and KINETIC in samples:
        (kinetic,), bodies = thin(samples[KINETIC]), plan.scene.unit
        others = scheme.held + 3 * bodies - plan.turning
        numbers.far = structure.distribution(kinetic, scheme.temperature, bodies, others)
    return numbers


def thin(*series: np.ndarray, times: int = 1) -> np.ndarray:
    """So many times the samples, (series, samples), that are independent in each of the series."""
    apart = max(map(measures.statistical_inefficiency, series))
    return np.stack(series)[:, :: int(np.ceil(apart / times))]


def pool(starts: Sequence[Numbers]) -> Numbers:
    """The means over starts; of a vector's components all starts together tell the memory."""

    def over(name: str) -> dict[str, Estimate]:
        some = [getattr(numbers, name) for numbers in starts]
        return {key: measures.mean_of_starts([one[key] for one in some]) for key in some[0]}

    variances = [numbers.variances for numbers in starts]
    means = {key: float(np.mean([one[key] for one in variances])) for key in variances[0]}
    made = Numbers(over("means"), over("remembers"), means)
    for key in starts[0].vectors:
        components = np.concatenate([numbers.vectors[key] for numbers in starts])
        memory = measures.autocorrelation_of_square(components)
        made.remembers[key] = memory.times(starts[0].apart)
    states = [numbers.state for numbers in starts if numbers.state]
    if states:
        values = np.hstack([state.values for state in states])
        made.state = states[0]._replace(values=values)
    return made


# ---- rows

Fits = Mapping[str, limit.Fit]  # by observable


def summarize(
    found: Results, runs: Runs, points: Sequence[Point], known: Mapping[str, Mapping]
) -> dict:
    """Rows of the points that were run, and the limits that they are held against; plain data.

    Args:
        known: see `sample`.

    Returns:
        ``rows``, see `_row`; ``limits``, see `limit_as_dict`; ``goals``, see `rivals.compare`.
    """
    means = {point: pool([*found.numbers[point].values()]) for point in found.good}
    fits = fit_limits(means, runs.plan, known)
    rows = [
        _row(point, found, runs, means, fits)
        for point in points
        if point in means or point in found.errors
    ]
    limits = {key: limit_as_dict(fit) for key, fit in fits.items()}
    goals = rivals.compare(rows, LEAST_ERRORS)
    return {"rows": rows, "limits": limits, "goals": goals}


def fit_limits(means: Mapping[Point, Numbers], plan: Plan, known: Mapping[str, Mapping]) -> Fits:
    """The limits of observables that LAMMPS's points determine."""
    fits = {key: _fit(means, key, plan, known) for key in CONFIGURATIONS}
    return {key: fit for key, fit in fits.items() if fit is not None}


def _fit(means, key, plan, known) -> limit.Fit | None:
    """The common limit of an observable, of LAMMPS's schemes that share it."""
    some = {point: numbers.means[key] for point, numbers in means.items() if key in numbers.means}
    if key in known:  # as if it were a point by itself
        return limit.Fit(some | {KNOWN: Estimate.of(known[key])}, {KNOWN: 1.0})
    steps = {point: (point.scheme, point.dt) for point in some}
    reaches = {
        name: scheme.reach
        for name, scheme in plan.schemes.items()
        if scheme.reach and not scheme.engine
    }
    return limit.fit(some, steps, reaches)


def limit_as_dict(fit: limit.Fit) -> dict:
    """A limit as plain data: its number, how well the points agree with it, and their weights."""
    told = {"chi2": fit.chi2, "left": fit.freedom, "probability": fit.probability}
    points = [[*point, weight] for point, weight in fit.weights.items() if abs(weight) > 1e-6]
    return fit.limit.plain() | told | {"agrees": fit.agrees, "points": points}


def _row(
    point: Point, found: Results, runs: Runs, means: Mapping[Point, Numbers], fits: Fits
) -> dict:
    """A point's row.

    Returns:
        plain data: what it is, and by observable ``means``; ``biases``, in the observables' units;
        ``remembers``, ps of an independent sample.  ``deviation``: of a state beside the first, see
        `structure.between_states`.  ``distribution``: of the kinetic energy, over starts.
        ``clock``: of another engine, s by the clock for a ps.  The others are of `_spent` and of
        `rivals.compare`.
    """
    plan, error = runs.plan, found.errors.get(point)
    scheme = plan.schemes[point.scheme]
    row: dict = {
        "scheme": scheme.name,
        "label": scheme.label,
        "engine": scheme.engine or LAMMPS,
        "ours": scheme.ours,
        "dt": point.dt,
        "lines": runs.lines(point),
        "starts": 0 if error else len(found.numbers[point]),
        "error": error,
    }
    row |= {name: {} for name in NESTED}
    row |= dict.fromkeys(("deviation", "distribution", "clock", "cost", "slowest", "sample"))
    if error:
        return row
    numbers, biases = means[point], _biases(point, plan, means, fits)
    row["means"], row["biases"], row["remembers"] = (
        {key: one.plain() for key, one in some.items()}
        for some in (numbers.means, biases, numbers.remembers)
    )
    row["slowest"] = slowest(numbers)
    row["deviation"] = deviation(point, plan, means)
    far = [start.far for start in found.numbers[point].values() if start.far is not None]
    row["distribution"] = measures.spread(far) if far else None
    if scheme.engine:
        loops = [start.loop for start in found.numbers[point].values()]
        row["clock"] = measures.spread(loop * FS_PER_PS / point.dt for loop in loops)
    if point in found.costs:
        row |= _spent(numbers, found.costs[point], {key: _unit(key, fits) for key in biases})
    return row


def _biases(point, plan, means, fits) -> dict[str, Estimate]:
    """Of each observable, in its units."""
    scheme, found = plan.schemes[point.scheme], {}
    for key, mean in means[point].means.items():
        exact = BY_KEY[key].exact(plan, scheme)
        if exact is not None:
            found[key] = measures.difference(mean, Estimate(exact))
        elif key in fits and not scheme.first:  # the limit is that of the first state
            found[key] = fits[key].bias(point).times(_unit(key, fits))
    return found


def _unit(key: str, limits: Mapping[str, limit.Fit]) -> float:
    """Of biases of an observable, over that of its mean."""
    return 100 / limits[key].limit.value if BY_KEY[key].relative else 1.0


def _spent(numbers: Numbers, costs: Sequence[float], units: Mapping[str, float]) -> dict:
    """What a point's averages cost.

    Args:
        units: of biases of observables, over those of their means.

    Returns:
        plain data: ``cost``, s of one core for a ps, over rounds that were timed in turn;
        ``sample``, s of a core for an independent sample of the slowest observable; ``noise``, of
        each observable the variance of its mean times s of a core, in the unit of biases squared.
    """
    cost, spent = float(np.median(costs)), {}
    for key in (key for key in CONFIGURATIONS if key in units):
        spent[key] = numbers.noise(key).times(cost * units[key] ** 2).plain()
    sample = numbers.remembers[slowest(numbers)].times(cost)
    return {"cost": measures.spread(costs), "sample": sample.plain(), "noise": spent}


def slowest(numbers: Numbers) -> str:
    """The observable of configurations whose independent samples take the longest."""
    some = {key: one for key, one in numbers.remembers.items() if key in CONFIGURATIONS}
    return max(some, key=lambda key: some[key].value)


def deviation(point: Point, plan: Plan, means: Mapping[Point, Numbers]) -> dict | None:
    """How far the distributions of a point at another state, and of the first state's, are from
    what the states demand, in standard deviations."""
    first = means.get(Point(plan.schemes[point.scheme].first, point.dt))
    states = [one.state for one in (first, means[point]) if one and one.state]
    if len(states) < 2 or min(state.values.shape[1] for state in states) < LEAST_SAMPLES * DENSER:
        return None
    found = structure.between_states(*states)
    return None if found is None else Estimate(found).plain()
