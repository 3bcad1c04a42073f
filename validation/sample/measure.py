"""Bias, noise and cost of averages with each scheme and step.

All schemes move the same molecules from the same starts.  Biases are distances from the limit of
small steps that schemes of the same distribution share (`limit`), or from exact values.  Noise is
the cost of an independent sample.  For a scheme at two states the ratio of the distributions is
known exactly (`structure.between_states`).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from ..experiment import Point
from ..running import json_files, machine, run
from ..statistics import limit, measures, structure
from ..statistics.estimate import Estimate
from ..user_script.candidates import YOURS
from . import engine, rivals
from .criteria import LEAST_ERRORS
from .observables import BY_KEY, CONFIGURATIONS, OBSERVABLES, Table
from .plan import KINETIC, SAMPLED, Plan, Runs, start_name, table
from .schemes import FIRST_SEED, Scheme

# number of independent samples that each of two states needs, and of samples used per independent
# one, because physical_validation bins them
LEAST_SAMPLES, DENSER = 50, 4
LAMMPS = "LAMMPS"  # its limit is that of the scene's own forces
# keys of a row with numbers of each observable
NESTED = "means", "biases", "remembers", "noise", "faster", "seconds"


@dataclass
class Numbers:
    """Averages of a point from one start, or from all.

    Attributes:
        means: of observables.
        remembers: by observable, ps per independent sample; of a square only with all starts.
        variances: by observable, of a sample.
        vectors: of squares, the autocovariances of the components, (components, lags).
        apart: ps between samples.
        state: samples to compare with those of another state, at constant pressure.
        far: standard deviations between the distribution of the bodies' kinetic energy and the
            canonical one, see `structure.distribution`.
        loop: s per step, with samples.
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
        """The variance of a mean times the length of the run, ps."""
        return self.remembers[key].times(self.variances[key])


@dataclass
class Results:
    """Results of all runs.

    Attributes:
        numbers: averages by point and number of the start.
        errors: why a start of a point has failed.
        costs: CPU time per ps without samples, s, in each round.
    """

    numbers: dict[Point, dict[int, Numbers]] = field(default_factory=dict)
    errors: dict[Point, str] = field(default_factory=dict)
    costs: dict[Point, list[float]] = field(default_factory=dict)

    @property
    def good(self) -> list[Point]:
        """Points without a failed start."""
        return [point for point in self.numbers if point not in self.errors]


def sample(
    runs: Runs, points: Collection[Point], earlier: Mapping[Point, Mapping], meter: run.Meter
) -> dict:
    """Run what has no result yet, and measure, also the points and starts of earlier commands with
    the same lengths in the folder.

    Several processes with the same command share the runs.

    Args:
        earlier: rows of another command, see `earlier_rows`.

    Returns:
        plain data: circumstances, settings, and what `summarize` gives.
    """
    plan, lengths, results = runs.plan, runs.lengths, Results()
    done = runs.perform(points, meter)
    lost = {n: why for n in runs.starts if (why := done.failed.get(start_name(n)))}
    if len(lost) == lengths.starts:
        results.errors |= dict.fromkeys(points, f"all starts failed, start 1: {lost[1]}")
    every, starts = plan.ordered([*points, *runs.left()]), runs.all_starts()
    for point in every:
        for start in starts:
            job = runs.job(point, start)
            if point not in results.errors and run.is_there(job, failures=True):
                _measure(results, plan, point, start, job)
    interrupted = _timed(results, runs, meter, not done.interrupted)
    summary = machine.circumstances()
    engines = (plan.schemes[point.scheme].engine for point in results.good)
    summary["versions"] |= machine.worker_versions(done.versions) | engine.versions(engines)
    return summary | {
        "scene": plan.scene.name,
        "title": plan.scene.title,
        "interrupted": done.interrupted or interrupted,
        "lost": lost,
        "bodies": plan.scene.unit,
        "temperature": plan.temperature,
        "known": [point._asdict() for point in plan.known],
        "settings": asdict(lengths)
        | {"starts": len(starts), "settle": lengths.settle, "sampled_fs": SAMPLED},
        **summarize(results, runs, every, earlier),
    }


def earlier_rows(folder: Path, runs: Runs) -> dict[Point, dict]:
    """The rows of another command for the same scene, from other starts.

    Raises:
        SystemExit: the folder has none, or of another scene, or some from the same starts, or of
            another integrator of a script's own.
    """
    scene, lengths = runs.plan.scene.name, runs.lengths
    summary = json_files.read(folder / "summary.json") or {}
    if summary.get("scene") != scene or not summary.get("rows"):
        raise SystemExit(f"{folder} has no averages of the scene {scene}")
    seed, starts = summary["settings"].get("seed", FIRST_SEED), summary["settings"]["starts"]
    if lengths.seed - starts < seed < lengths.seed + lengths.starts:
        raise SystemExit(
            f"{folder} has averages from the same starts, which would count twice: give another "
            f"--seed, such as {seed + 1000}"
        )
    rows = {Point(row["scheme"], row["dt"]): row for row in summary["rows"] if not row["error"]}
    for point, row in rows.items():
        if point.scheme != YOURS or YOURS not in runs.plan.schemes:
            continue  # other names say what they are
        if row["lines"] != runs.lines(point):
            raise SystemExit(
                f"{folder} has averages of another fix of the script: {'; '.join(row['lines'])}"
            )
    return rows


def _measure(results: Results, plan: Plan, point: Point, start: int, job: run.Job) -> None:
    """Store the averages of a completed run, or why it failed."""
    result, samples = table(job)
    if result.error:
        results.errors.setdefault(point, result.error)
        return
    numbers = of_series(samples, plan, plan.schemes[point.scheme])
    last = result.timings[-1]
    numbers.loop = last.seconds / last.steps
    results.numbers.setdefault(point, {})[start] = numbers


def _timed(results: Results, runs: Runs, meter: run.Meter, time: bool) -> bool:
    """Store the cost of each point; return whether Ctrl-C was pressed.

    Args:
        time: whether to time points without a stored cost.
    """
    # from the first start that a point has
    first = {point: next(iter(results.numbers[point].items())) for point in results.good}
    loops = {point: (start, numbers.loop) for point, (start, numbers) in first.items()}
    try:
        results.costs = runs.costs(loops, meter, time)
    except KeyboardInterrupt:
        return True
    return False


def of_series(samples: Table, plan: Plan, scheme: Scheme) -> Numbers:
    """The averages of a run."""
    apart = float(np.median(np.diff(samples["Time"]))) / 1e3
    numbers = Numbers({}, {}, {}, apart=apart)
    for observable in OBSERVABLES:
        x = observable.of(samples, plan, scheme)
        if x is None:
            continue
        numbers.means[observable.key] = measures.mean(x)
        numbers.variances[observable.key] = float(np.var(x, ddof=1))
        if observable.vector:
            numbers.vectors[observable.key] = measures.autocovariance(
                np.stack([samples[name] for name in observable.vector], axis=1)
            )
        else:
            numbers.remembers[observable.key] = measures.autocorrelation(x).times(apart)
    if scheme.pressure is not None:
        numbers.state = structure.Sampled(
            scheme.temperature,
            scheme.pressure,
            thin(samples["PotEng"], samples["Volume"], times=DENSER),
        )
    if scheme.reach and KINETIC in samples:
        (kinetic,), bodies = thin(samples[KINETIC]), plan.scene.unit
        numbers.far = structure.distribution(
            kinetic, scheme.temperature, bodies, scheme.held + 3 * bodies - plan.turning
        )
    return numbers


def thin(*series: np.ndarray, times: int = 1) -> np.ndarray:
    """Samples, (series, samples), of which one in ``times`` is independent in all series."""
    apart = max(map(measures.statistical_inefficiency, series))
    return np.stack(series)[:, :: int(np.ceil(apart / times))]


def pool(starts: Sequence[Numbers]) -> Numbers:
    """Means over starts; correlation times of vectors from the components of all starts."""

    def over(name: str) -> dict[str, Estimate]:
        estimates = [getattr(numbers, name) for numbers in starts]
        return {
            key: measures.mean_of_starts([estimate[key] for estimate in estimates])
            for key in estimates[0]
        }

    variances = [numbers.variances for numbers in starts]
    means = {key: float(np.mean([variance[key] for variance in variances])) for key in variances[0]}
    pooled = Numbers(over("means"), over("remembers"), means)
    for key in starts[0].vectors:
        memory = measures.autocorrelation_of_square(
            np.concatenate([numbers.vectors[key] for numbers in starts])
        )
        pooled.remembers[key] = memory.times(starts[0].apart)
    states = [numbers.state for numbers in starts if numbers.state]
    if states:
        pooled.state = states[0]._replace(values=np.hstack([state.values for state in states]))
    return pooled


# ---- rows

Fits = Mapping[str, Mapping[str, limit.Fit]]  # of each engine, of each observable


def summarize(
    results: Results, runs: Runs, points: Sequence[Point], earlier: Mapping[Point, Mapping]
) -> dict:
    """Rows of the points that were run, and the limits that they are compared with; plain data.

    Args:
        earlier: see `sample`.  Their means count as further starts, those of other points for the
            limits only.

    Returns:
        ``rows``, see `_row`; ``limits`` of the scene's forces, and ``others``, of each other engine
        the limits of its own points, see `limit_as_dict`; ``goals``, see `rivals.compare`.
    """
    means = {point: pool([*results.numbers[point].values()]) for point in results.good}
    before = {
        point: {key: Estimate.of(mean) for key, mean in row["means"].items()}
        for point, row in earlier.items()
    }
    for point in means.keys() & before.keys():
        for key in means[point].means.keys() & before[point].keys():
            both = means[point].means[key], before[point][key]
            means[point].means[key] = measures.weighted_mean(both)
    own = {point: numbers.means for point, numbers in means.items()}
    fits = fit_limits(before | own, runs.plan)
    rows = [
        _row(point, results, runs, means, fits, earlier.get(point, {}).get("starts", 0))
        for point in points
        if point in means or point in results.errors
    ]
    lammps, *others = (
        (name, {key: limit_as_dict(fit) for key, fit in by_key.items()})
        for name, by_key in fits.items()
    )
    return {
        "rows": rows,
        "limits": lammps[1],
        "others": dict(others),
        "goals": rivals.compare(rows, LEAST_ERRORS),  # adds to the rows
    }


def fit_limits(means: Mapping[Point, Mapping[str, Estimate]], plan: Plan) -> Fits:
    """The limits of observables that each engine's points determine, LAMMPS's first."""
    schemes = (plan.schemes[point.scheme] for point in means if point.scheme in plan.schemes)
    names = dict.fromkeys([LAMMPS, *map(_engine, schemes)])
    return {
        name: {
            key: fit for key in CONFIGURATIONS if (fit := _fit(means, key, plan, name)) is not None
        }
        for name in names
    }


def _engine(scheme: Scheme) -> str:
    return scheme.engine.name if scheme.engine else LAMMPS


def _fit(means, key, plan, engine) -> limit.Fit | None:
    """The limit of an observable that an engine's schemes share."""
    of_points = {point: averages[key] for point, averages in means.items() if key in averages}
    steps = {point: (point.scheme, point.dt) for point in of_points}
    reaches = {
        name: scheme.reach
        for name, scheme in plan.schemes.items()
        if scheme.reach and _engine(scheme) == engine
    }
    return limit.fit(of_points, steps, reaches)


def limit_as_dict(fit: limit.Fit) -> dict:
    """A limit as plain data: the estimate, the agreement of the points, and their weights."""
    quality = {"chi2": fit.chi2, "left": fit.freedom, "probability": fit.probability}
    points = [[*point, weight] for point, weight in fit.weights.items() if abs(weight) > 1e-6]
    return fit.limit.plain() | quality | {"agrees": fit.agrees, "points": points}


def _row(
    point: Point,
    results: Results,
    runs: Runs,
    means: Mapping[Point, Numbers],
    fits: Fits,
    earlier: int,
) -> dict:
    """A point's row, with this number of earlier starts.

    Returns:
        plain data: what it is, and by observable ``means``; ``biases``, in the observables' units;
        ``remembers``, ps per independent sample.  ``deviation``: from the first state, see
        `structure.between_states`.  ``distribution``: of the kinetic energy, over starts.
        The others are of `_spent` and of `rivals.compare`.
    """
    plan, error = runs.plan, results.errors.get(point)
    scheme = plan.schemes[point.scheme]
    row: dict = {
        "scheme": scheme.name,
        "label": scheme.label,
        "engine": _engine(scheme),
        "ours": scheme.ours,
        "dt": point.dt,
        "lines": runs.lines(point),
        "starts": 0 if error else len(results.numbers[point]) + earlier,
        "error": error,
    }
    row |= {name: {} for name in NESTED}
    row |= dict.fromkeys(("deviation", "distribution", "cost", "slowest", "sample"))
    if error:
        return row
    numbers, biases = means[point], _biases(point, plan, means, fits)
    row["means"], row["biases"], row["remembers"] = (
        {key: estimate.plain() for key, estimate in estimates.items()}
        for estimates in (numbers.means, biases, numbers.remembers)
    )
    row["slowest"] = slowest(numbers)
    row["deviation"] = deviation(point, plan, means)
    far = [start.far for start in results.numbers[point].values() if start.far is not None]
    row["distribution"] = measures.spread(far) if far else None
    if point in results.costs:
        row |= _spent(
            numbers, results.costs[point], {key: _unit(key, fits[LAMMPS]) for key in biases}
        )
    return row


def _biases(point, plan, means, fits) -> dict[str, Estimate]:
    """The bias of each observable, in its units."""
    scheme, biases = plan.schemes[point.scheme], {}
    same = scheme.engine is None or scheme.engine.same
    limits = fits[LAMMPS if same else _engine(scheme)]
    for key, mean in means[point].means.items():
        exact = BY_KEY[key].exact(plan, scheme)
        if exact is not None:
            biases[key] = measures.difference(mean, Estimate(exact))
        elif key in limits and not scheme.first:  # the limit is that of the first state
            biases[key] = limits[key].bias(point).times(_unit(key, limits))
    return biases


def _unit(key: str, limits: Mapping[str, limit.Fit]) -> float:
    """The unit of an observable's biases over that of its mean."""
    return 100 / limits[key].limit.value if BY_KEY[key].relative else 1.0


def _spent(numbers: Numbers, costs: Sequence[float], units: Mapping[str, float]) -> dict:
    """The cost of a point's averages.

    Args:
        units: of biases of observables, over those of their means.

    Returns:
        plain data: ``cost``, CPU time per ps, s, over rounds that were timed in turn; ``sample``,
        CPU time per independent sample of the slowest observable; ``noise``, by observable the
        variance of its mean times CPU time, in the unit of biases squared.
    """
    cost, spent = float(np.median(costs)), {}
    for key in (key for key in CONFIGURATIONS if key in units):
        spent[key] = numbers.noise(key).times(cost * units[key] ** 2).plain()
    sample = numbers.remembers[slowest(numbers)].times(cost)
    return {"cost": measures.spread(costs), "sample": sample.plain(), "noise": spent}


def slowest(numbers: Numbers) -> str:
    """The observable of configurations with the longest correlation time."""
    times = {key: time for key, time in numbers.remembers.items() if key in CONFIGURATIONS}
    return max(times, key=lambda key: times[key].value)


def deviation(point: Point, plan: Plan, means: Mapping[Point, Numbers]) -> dict | None:
    """The deviation of a point at another state and of the first state from the exact ratio of
    their distributions, in standard deviations; None if it cannot be estimated."""
    first = means.get(Point(plan.schemes[point.scheme].first, point.dt))
    states = [numbers.state for numbers in (first, means[point]) if numbers and numbers.state]
    if len(states) < 2 or min(state.values.shape[1] for state in states) < LEAST_SAMPLES * DENSER:
        return None
    distance = structure.between_states(*states)
    return None if distance is None else Estimate(distance).plain()
