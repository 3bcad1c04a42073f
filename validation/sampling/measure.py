"""The error of averages, of bias and of noise, that a thermostat with a step gives for its time.

All schemes move the same molecules from the same starts.  Biases are distances from the limit of
small steps that schemes of the same distribution share (`limit`).  Noise is what one independent
sample costs.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from ..ensembles import runs
from ..ensembles.lengths import SAMPLED, Lengths, Point, ordered
from ..ensembles.measure import of_momentum
from ..ensembles.schemes import ALL_PRINT, OURS_PRINTS, Scheme
from ..running import machine, rounds, run
from ..scenes.units import BOLTZMANN, COULOMB
from ..statistics import limit, measures, motion, precision, structure
from ..statistics.estimate import Estimate
from . import plan
from .criteria import BOUNDS
from .plan import Case

BLOCKS = 8  # of a start's frames, for the noise of g(r)
BIN, REACH = 0.1, 0.45  # Angstrom, of g(r), and how far it goes, of the box
Table = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Observable:
    """A mean that is looked at.

    Attributes:
        key: in rows and files.
        unit: of biases; of the mean itself, if ``relative``, it has none.
        series: of a run's table, the case, the scheme: (samples,); None if it has none.
        vector: columns of the vector that it is the square of, if it is one.
        relative: whether biases are in per cent of the limit.
        known: of the case and the scheme, the limit, where theory has it; no configuration then.
    """

    key: str
    title: str
    unit: str
    series: Callable[[Table, Case, Scheme], np.ndarray | None]
    relative: bool = False
    vector: tuple[str, ...] = ()
    known: Callable[[Case, Scheme], float] | None = None


def _potential(table, case, scheme):
    return table["PotEng"] / case.scene.unit


def _capacity(table, case, scheme):
    """Of which the mean is var(U) / (kT)^2 of a body: the heat capacity of configurations."""
    return measures.squares(table["PotEng"]) / (BOLTZMANN * case.temperature) ** 2 / case.scene.unit


def _pressure(table, case, scheme):
    return table["Press"] + of_momentum(scheme.held, case.temperature, table["Volume"])


def _torque(table, case, scheme):
    return table[plan.TORQUE] / case.scene.unit if plan.TORQUE in table else None


def _dipole(table, case, scheme):
    if plan.DIPOLE[0] not in table:
        return None
    square = sum(table[one] ** 2 for one in plan.DIPOLE)
    return 4 * np.pi * COULOMB * square / (3 * table["Volume"] * BOLTZMANN * case.temperature)


def _translation(table, case, scheme):
    if OURS_PRINTS[0] in table:
        return table[OURS_PRINTS[0]]
    if ALL_PRINT not in table:
        return None
    return table[ALL_PRINT] / (3 * case.scene.unit * BOLTZMANN / 2)


def _rotation(table, case, scheme):
    if OURS_PRINTS[1] in table:
        return table[OURS_PRINTS[1]]
    if ALL_PRINT not in table:
        return None
    turns = table["c_kinetic"] - table[ALL_PRINT]
    return turns / (case.turning * BOLTZMANN / 2)


def _moving(case, scheme):
    return case.temperature * (1 - scheme.held / (3 * case.scene.unit))


MOLECULE = "kcal/mol a molecule"
OBSERVABLES = (
    Observable("potential", "U/N", MOLECULE, _potential),
    Observable("capacity", "heat capacity", "%", _capacity, relative=True),
    Observable("pressure", "pressure", "atm", _pressure),
    Observable("torque", "squared torque", "%", _torque, relative=True),
    Observable("dipole", "dipole fluctuation", "%", _dipole, True, plan.DIPOLE),
    Observable("translation", "T_trans", "K", _translation, known=_moving),
    Observable("rotation", "T_rot", "K", _rotation, known=lambda case, scheme: case.temperature),
)
BY_KEY = {one.key: one for one in OBSERVABLES}
CONFIGURATIONS = [one.key for one in OBSERVABLES if not one.known]


@dataclass
class Numbers:
    """What a start of a point gave, or all of them together.

    Attributes:
        means: of observables.
        remembers: of each, ps of an independent sample; of a square only with all starts.
        variances: of each, of a sample.
        rdf: g(r) of blocks of frames, (blocks, bins).
        vectors: of squares, the autocovariances of the components, (components, lags).
        apart: ps between samples.
    """

    means: dict[str, Estimate]
    remembers: dict[str, Estimate]
    variances: dict[str, float]
    rdf: np.ndarray | None = None
    vectors: dict[str, np.ndarray] = field(default_factory=dict)
    apart: float = 0.0

    def noise(self, key: str) -> Estimate:
        """Variance of a mean times ps."""
        return self.remembers[key].times(self.variances[key])


@dataclass
class Row:
    """A point's numbers; None where it has none.

    Attributes:
        means: of each observable, and ``biases``, in its units.
        remembers: ps of an independent sample, of each observable.
        noise: of each, variance of its mean times s of a core, see `precision.Worth`.
        rdf: rms distance of g(r) from the limit's.
        cost: s of one core for a ps, over rounds that were timed in turn.
        slowest: the observable whose independent samples take the longest, and ``sample``, s of a
            core for one of them.
        less: how many times less such a sample costs than with each known scheme.
        faster: of each observable how many times less time it takes than the first known point to
            the total error of that, see `precision.times`.
        seconds: of each observable with a bound, s of a core to a total error as large as it.
    """

    scheme: str
    label: str
    ours: bool
    dt: float
    lines: list[str]
    starts: int = 0
    error: str | None = None
    means: dict[str, dict] = field(default_factory=dict)
    biases: dict[str, dict] = field(default_factory=dict)
    remembers: dict[str, dict] = field(default_factory=dict)
    noise: dict[str, dict] = field(default_factory=dict)
    rdf: dict | None = None
    cost: measures.Spread | None = None
    slowest: str | None = None
    sample: dict | None = None
    less: dict[str, dict] = field(default_factory=dict)
    faster: dict[str, dict] = field(default_factory=dict)
    seconds: dict[str, dict] = field(default_factory=dict)


@dataclass
class Found:
    """What the runs gave: of each point the numbers of its starts, why one failed, s of a step with
    its samples, and s of a core for a ps without them, in each round."""

    numbers: dict[Point, list[Numbers]] = field(default_factory=dict)
    errors: dict[Point, str] = field(default_factory=dict)
    loops: dict[Point, float] = field(default_factory=dict)
    costs: dict[Point, list[float]] = field(default_factory=dict)


def sampling(
    case: Case,
    points: Collection[Point],
    lengths: Lengths,
    out: Path,
    meter: run.Meter,
    silence: float,
) -> dict:
    """Run what is not there yet, and measure; points that earlier commands of the same lengths
    have left in the folder are measured, too.

    Several processes of the same command share the runs.

    Args:
        silence: s without a sign of life after which a run is given up.

    Returns:
        plain data: circumstances, settings, rows, limits.
    """
    folder, found = out / "runs" / lengths.folder, Found()
    batch = runs.Runs(case.scene, case.starter, lengths, folder, silence, case.prints(lengths))
    made = batch.do([one for _, one in case.runs(points, lengths)], meter, __name__)
    if made.error:
        found.errors |= dict.fromkeys(points, made.error)
    every = ordered([*points, *_known(case, folder)], case.schemes)
    for point, one in case.runs(every, lengths):
        job = batch.job(one)
        if point not in found.errors and run.is_there(job, failures=True):
            _measure(found, case, point, job)
    interrupted = _timed(found, case, lengths, batch, meter, not made.interrupted)
    summary = machine.circumstances()
    summary["versions"] |= machine.worker_versions(made.versions)
    return summary | {
        "scene": case.name,
        "title": case.scene.title,
        "interrupted": made.interrupted or interrupted,
        "lost": made.failed,
        "bodies": case.scene.unit,
        "temperature": case.temperature,
        "known": [one._asdict() for one in case.known],
        "settings": asdict(lengths) | {"settle": lengths.settle, "sampled_fs": SAMPLED},
        **told(found, case, every),
    }


def _known(case: Case, folder: Path) -> list[Point]:
    """Points of which the folder has runs."""
    names = {name.replace("/", "-"): name for name in case.schemes}
    found = []
    for path in folder.glob("start-*/*-fs/job.json"):
        name, _, dt = path.parent.name.removesuffix("-fs").rpartition("-")
        if name in names:
            found.append(Point(names[name], float(dt)))
    return found


def _measure(found: Found, case: Case, point: Point, job: run.Job) -> None:
    """The numbers of a run that is there, or why it has none."""
    result, table = runs.table(job)
    if result.error:
        found.errors.setdefault(point, result.error)
        return
    numbers = of_series(table, case, case.schemes[point.scheme])
    if case.sites:
        numbers.rdf = of_frames(Path(job.directory) / plan.SITES, job.runs[0])
    found.numbers.setdefault(point, []).append(numbers)
    found.loops.setdefault(point, 1e-6 * (rounds.timing(job, result).loop or 0.0))


def _timed(
    found: Found, case: Case, lengths: Lengths, batch: runs.Runs, meter: run.Meter, time: bool
) -> bool:
    """What a ps of each point costs; whether a Ctrl-C came.

    Args:
        time: whether to time what no earlier command has.
    """
    good = [point for point in found.numbers if point not in found.errors]
    first = dict(reversed(list(case.runs(good, lengths))))
    loops = {first[point]: found.loops[point] for point in good}
    try:
        costs = batch.costs(loops, meter, __name__, time)
    except KeyboardInterrupt:
        return True
    found.costs = {point: costs[first[point].name] for point in good if costs[first[point].name]}
    return False


def of_series(table: Table, case: Case, scheme: Scheme) -> Numbers:
    """A run's numbers.

    Args:
        table: columns of LAMMPS's output, (samples,), after the part that is left out.
    """
    apart = float(np.median(np.diff(table["Time"]))) / 1e3
    numbers = Numbers({}, {}, {}, apart=apart)
    for one in OBSERVABLES:
        x = one.series(table, case, scheme)
        if x is None:
            continue
        numbers.means[one.key] = measures.mean(x)
        numbers.variances[one.key] = float(np.var(x, ddof=1))
        if one.vector:
            vector = np.stack([table[name] for name in one.vector], axis=1)
            numbers.vectors[one.key] = measures.autocovariance(vector)
        else:
            numbers.remembers[one.key] = measures.autocorrelation(x).times(apart)
    return numbers


def of_frames(path: Path, begin: int) -> np.ndarray | None:
    """g(r) of blocks of a run's frames, (blocks, bins); None if there are too few.

    Args:
        begin: the first step that counts.
    """
    steps, x = motion.read(path)
    x = x[steps >= begin]
    if len(x) < BLOCKS:
        return None
    with open(path) as file:
        ends = [next(file).split() for _ in range(8)][5:]
    box = np.ptp(np.array(ends, float), axis=1)
    cells = np.repeat(np.diag(box)[None], len(x), axis=0)
    reach = np.floor(REACH * box.min() / BIN) * BIN
    return structure.of_sites(x, cells, (BIN, reach), BIN, BLOCKS)


def pooled(starts: Sequence[Numbers]) -> Numbers:
    """The means over starts; of a vector's components all starts together tell the memory."""

    def over(name):
        first = getattr(starts[0], name)
        return {
            key: measures.of_starts([getattr(one, name)[key] for one in starts]) for key in first
        }

    variances = {
        key: float(np.mean([one.variances[key] for one in starts])) for key in starts[0].variances
    }
    blocks = [one.rdf for one in starts if one.rdf is not None]
    rdf = np.concatenate(blocks) if blocks else None
    numbers = Numbers(over("means"), over("remembers"), variances, rdf)
    for key in starts[0].vectors:
        components = np.concatenate([one.vectors[key] for one in starts])
        memory = measures.autocorrelation_of_square(components)
        numbers.remembers[key] = memory.times(starts[0].apart)
    return numbers


def told(found: Found, case: Case, points: Sequence[Point]) -> dict:
    """Rows of the points that were run, and the limits that they are held against; plain data."""
    means = {point: pooled(some) for point, some in found.numbers.items()}
    good = {point: one for point, one in means.items() if point not in found.errors}
    fits = {key: fit for key in CONFIGURATIONS if (fit := fitted(good, key, case)) is not None}
    biases = {point: _biases(point, good, fits, case) for point in good}
    rows = []
    for point in points:
        if point not in good and point not in found.errors:
            continue
        scheme = case.schemes[point.scheme]
        lines = scheme.integrator.commands(case.scene)
        row = Row(scheme.name, scheme.label, scheme.ours, point.dt, lines)
        row.error = found.errors.get(point)
        if not row.error:
            row.starts = len(found.numbers[point])
            _fill(row, point, good, biases, fits)
            _spend(row, point, found.costs, good, biases, fits, case)
        rows.append(vars(row))
    limits = {key: told_limit(fit) for key, fit in fits.items()}
    return {"rows": rows, "limits": limits}


def fitted(means: Mapping[Point, Numbers], key: str, case: Case) -> limit.Fit | None:
    """The common limit of an observable."""
    some = {point: one.means[key] for point, one in means.items() if key in one.means}
    steps = {point: (point.scheme, point.dt) for point in some}
    return limit.fit(some, steps, case.models)


def told_limit(fit: limit.Fit) -> dict:
    """A limit as plain data: its number, how well the points agree with it, and their weights."""
    told = {"chi2": fit.chi2, "left": fit.freedom, "probability": fit.probability}
    points = [[*point, weight] for point, weight in fit.weights.items() if abs(weight) > 1e-6]
    return fit.limit.plain() | told | {"agrees": fit.agrees, "points": points}


def _biases(point, means, fits, case) -> dict[str, Estimate]:
    """Of each observable, in its units."""
    found = {}
    for one in OBSERVABLES:
        mean = means[point].means.get(one.key)
        if mean is None:
            continue
        if one.known:
            expected = one.known(case, case.schemes[point.scheme])
            found[one.key] = measures.difference(mean, Estimate(expected))
        elif one.key in fits:
            fit = fits[one.key]
            unit = 100 / fit.limit.value if one.relative else 1.0
            found[one.key] = fit.bias(point).times(unit)
    return found


def _fill(row, point, means, biases, fits) -> None:
    """The numbers of a row, but for what they cost."""
    numbers = means[point]
    row.means = {key: one.plain() for key, one in numbers.means.items()}
    row.biases = {key: one.plain() for key, one in biases[point].items()}
    row.remembers = {key: one.plain() for key, one in numbers.remembers.items()}
    row.slowest = slowest(numbers)
    if "potential" in fits and numbers.rdf is not None:
        row.rdf = apart(point, means, fits["potential"])


def _spend(row, point, costs, means, biases, fits, case) -> None:
    """What the numbers of a row cost, if its runs were timed."""
    if point not in costs:
        return
    row.cost = measures.spread(costs[point])
    sample = _sample(means[point], costs[point])
    row.sample = sample.plain()
    for one in case.known:
        if one in costs:
            less = measures.quotient(_sample(means[one], costs[one]), sample)
            row.less[one.scheme] = less.plain()
    own = _worths(point, costs, means, biases, fits)
    row.noise = {key: one.noise.plain() for key, one in own.items()}
    for key in own.keys() & BOUNDS.keys():
        row.seconds[key] = precision.seconds(own[key], BOUNDS[key]).plain()
    known = case.known[0]
    if known in costs and known != point:
        theirs = _worths(known, costs, means, biases, fits)
        for key in own.keys() & theirs.keys():
            row.faster[key] = precision.times(theirs[key], own[key]).plain()


def slowest(numbers: Numbers) -> str:
    """The observable of configurations whose independent samples take the longest."""
    some = {key: one for key, one in numbers.remembers.items() if key in CONFIGURATIONS}
    return max(some, key=lambda one: some[one].value)


def _sample(numbers: Numbers, costs: Sequence[float]) -> Estimate:
    """s of a core for an independent sample of the slowest observable."""
    return numbers.remembers[slowest(numbers)].times(float(np.median(costs)))


def _unit(key: str, fits) -> float:
    """Of biases of an observable, over that of its mean; 0 if it is not known."""
    if not BY_KEY[key].relative:
        return 1.0
    return 100 / fits[key].limit.value if key in fits else 0.0


def _worths(point, costs, means, biases, fits) -> dict[str, precision.Worth]:
    """Bias and noise of a point's averages over configurations."""
    cost = float(np.median(costs[point]))

    def noise(key):
        return means[point].noise(key).times(cost * _unit(key, fits) ** 2)

    return {
        key: precision.Worth(biases[point][key], noise(key))
        for key in CONFIGURATIONS
        if key in biases[point]
    }


def apart(point: Point, means: Mapping[Point, Numbers], fit: limit.Fit) -> dict | None:
    """The rms distance of a point's g(r) from the limit's.

    The limit is made as that of the potential energy, of the same points with the same weights, in
    each bin.  Blocks of all these runs together are independent measurements of the difference.
    """
    parts = {one: weight for one, weight in fit.distance(point).items() if weight}
    known = {one: rdf for one in parts if (rdf := means[one].rdf) is not None}
    if len(known) < len(parts):
        return None
    number = min(map(len, known.values()))
    off = np.sum([weight * known[one][:number] for one, weight in parts.items()], axis=0)
    return measures.without_noise(off).plain()
