"""The bias that a thermostat or a barostat gives to what is sampled at a time step.

All schemes move the same molecules from the same starts.  The bias of a mean is its distance from
that of this package's Langevin thermostat at a step so short that a step twice as long gives the
same within errors.  At constant pressure two states are compared as well: the ratio of their
distributions is known without any reference.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from validation.ensembles import plan
from validation.ensembles.plan import (
    REFERENCES,
    SCHEMES,
    STARTER,
    TEMPERATURE,
    Lengths,
    Point,
    Scheme,
)
from validation.running import machine, rounds, run
from validation.running.store import Store
from validation.scenes import FS_PER_PS, Scene
from validation.scenes.starts import from_dump, to_dump
from validation.statistics import measures, structure
from validation.statistics.estimate import Estimate, combined
from validation.sweep.errors import BOLTZMANN

DEGREES = 3  # of freedom of a molecule's translation, and of its rotation
ATM = 68568.415  # atm Angstrom^3 in a kcal/mol, LAMMPS's
FINE = 1e5  # compressibilities are in 1e-5/atm
# of each of two states independent samples, as fewer cannot tell a slope, and how many are taken
# for an independent one, as physical_validation has bins to fill (it counts independent ones)
LEAST_SAMPLES, DENSER = 50, 4
# the kinetic energy of the molecules' centres, of any integrator
MOVES = (
    "compute molecules {group} chunk/atom molecule",
    "compute centres {group} temp/chunk molecules kecom",
    "variable moves equal sum(c_centres[1])",
)
OURS_PRINTS, ALL_PRINT = ("f_1[3]", "f_1[4]"), "v_moves"

Numbers = dict[str, Estimate]  # of a run, by the names in `Row`
SPREAD = "cost", "distribution"  # of these a row has a spread over starts (`measures.spread`)


@dataclass
class Row:
    """A point's numbers; None where it has none.

    Attributes:
        potential, bias: kcal/mol a molecule.  temperature, translation, rotation, apart: K; the
            last is translation less rotation.  pressure, pressure_bias: atm; at constant pressure
            the bias is the distance from the barostat's.  drift: of the effective energy,
            kcal/mol/ps in all.
        cost: s of one core for a ps, over starts.
        distribution: standard deviations between the kinetic energy's distribution and the
            canonical one (physical_validation), over starts.
        density: g/cm^3.  density_bias: percent.  volume: Angstrom^3.
        compressibility: from the volume's fluctuations, 1e-5/atm.
        deviation: of a state beside the first, see `structure.between_states`.
        two_pressures, fluctuations: of a pressure beside the first, the compressibility from both
            mean volumes, and the mean of those from fluctuations at both; 1e-5/atm.
    """

    scheme: str
    label: str
    ours: bool
    dt: float
    lines: list[str]
    starts: int = 0
    error: str | None = None
    potential: Estimate | None = None
    bias: Estimate | None = None
    temperature: Estimate | None = None
    translation: Estimate | None = None
    rotation: Estimate | None = None
    apart: Estimate | None = None
    pressure: Estimate | None = None
    pressure_bias: Estimate | None = None
    drift: Estimate | None = None
    cost: measures.Spread | None = None
    distribution: measures.Spread | None = None
    density: Estimate | None = None
    density_bias: Estimate | None = None
    volume: Estimate | None = None
    compressibility: Estimate | None = None
    deviation: Estimate | None = None
    two_pressures: Estimate | None = None
    fluctuations: Estimate | None = None


@dataclass
class Found:
    """What the runs gave: of each point the numbers of its starts, at constant pressure their
    samples, and why one failed."""

    numbers: dict[Point, list[Numbers]] = field(default_factory=dict)
    samples: dict[Point, list[structure.Sampled]] = field(default_factory=dict)
    errors: dict[Point, str] = field(default_factory=dict)
    versions: dict = field(default_factory=dict)
    interrupted: bool = False


def ensembles(
    points: Collection[Point], lengths: Lengths, out: Path, meter: run.Meter, silence: float
) -> tuple[dict, list[Row]]:
    """Run what is not there yet, and measure; points that earlier commands of the same lengths
    have left in the folder are measured, too.

    Several processes of the same command share the runs.

    Args:
        silence: s without a sign of life after which a run is given up.

    Returns:
        (summary, rows): circumstances and settings as plain data; a row for each point.
    """
    scene, folder, found = plan.scene(), out / "runs" / lengths.folder, Found()
    store = Store(folder, __name__)
    wanted = {name: (point, start) for name, point, start in plan.names(points, lengths)}
    starts = {f"start-{number}/start": number for number in range(1, lengths.starts + 1)}
    try:
        for name in store.shared(starts):
            job = _start(scene, folder / name, starts[name], lengths, silence)
            made = _do(found, f"start {starts[name]}", job, meter)
            if made.error:
                found.errors |= dict.fromkeys(points, f"start {starts[name]}: {made.error}")
        for name in store.shared(wanted if not found.errors else ()):
            point, start = wanted[name]
            label = point.label + f", start {start}" * (lengths.starts > 1)
            _do(found, label, _job(scene, folder, name, point, start, lengths, silence), meter)
    except KeyboardInterrupt:
        found.interrupted = True
    every = plan.ordered([*points, *plan.points(dt=plan.KNOWN_STEPS)])
    for name, point, start in plan.names(every, lengths):
        if point in found.errors:
            continue
        job = _job(scene, folder, name, point, start, lengths, silence)
        if run.is_there(job, failures=True):
            _measure(found, point, job)
    summary = machine.circumstances() | {"scene": scene.name, "title": scene.title}
    summary["versions"] |= machine.worker_versions(found.versions)
    summary |= {"interrupted": found.interrupted, "molecules": scene.unit}
    summary |= {"temperature": TEMPERATURE, "references": [one._asdict() for one in REFERENCES]}
    summary["settings"] = asdict(lengths) | {"settle": lengths.settle, "sampled_fs": plan.SAMPLED}
    return summary, rows(found, every)


def _do(found: Found, label: str, job: run.Job, meter: run.Meter) -> run.Result:
    """Run a job, or take it over, with its progress shown."""
    meter.begin(label, sum(job.runs))
    result = run.once(job, meter.at, failures=True)
    meter.end(result.error)
    found.versions |= result.versions
    if result.interrupted:
        raise KeyboardInterrupt
    return result


def _dump(folder: Path, start: int) -> Path:
    return (folder / f"start-{start}" / "start" / "state.dump").resolve()


def _start(scene: Scene, directory: Path, start: int, lengths: Lengths, silence: float) -> run.Job:
    """The run that makes a start."""
    runs = [plan.at_least_one(lengths.begin, plan.BEGIN_STEP)]
    one = STARTER.seeded(start)
    more = to_dump((directory / "state.dump").resolve(), runs[0])
    how: dict = {"dt": plan.BEGIN_STEP, "every": max(1, runs[0] // 100), "keeps": "nothing"}
    how |= {"silence": silence, "more": more, "origin": machine.origin(scene, one)}
    return run.job(scene, one, directory, runs, **how)


def _job(
    scene: Scene,
    folder: Path,
    name: str,
    point: Point,
    start: int,
    lengths: Lengths,
    silence: float,
) -> run.Job:
    """The run of a point from a start; its momentum is zero, for some schemes keep it."""
    scheme, dump = SCHEMES[point.scheme], _dump(folder, start)
    one = scheme.seeded(start)
    begun = from_dump(scene, dump, plan.at_least_one(lengths.begin, plan.BEGIN_STEP))
    rest = f"velocity {scene.group} zero linear"
    begun = replace(begun, setup=(*begun.setup, rest))
    prints = OURS_PRINTS if scheme.ours else (ALL_PRINT,)
    more = [line.format(group=scene.group) for line in MOVES] if not scheme.ours else []
    more += run.thermo("econserve", "vol", "density", *prints)
    how: dict = {"dt": point.dt, "every": lengths.every(point.dt), "keeps": "nothing"}
    files = [dump] if dump.exists() else []  # else LAMMPS says so
    how |= {"silence": silence, "more": more, "origin": machine.origin(scene, one, *files)}
    return run.job(begun, one, folder / name, lengths.runs(point.dt), **how)


def _measure(found: Found, point: Point, job: run.Job) -> None:
    """The numbers of a run that is there, or why it has none."""
    result = run.collect(job.directory)
    kept = result.thermo.get("Step", np.empty(0)) >= job.runs[0]
    table = {name: values[kept] for name, values in result.thermo.items()}
    if not result.error and not all(np.isfinite(values).all() for values in table.values()):
        result.error = "energy is not finite"
    if result.error:
        found.errors.setdefault(point, result.error)
        return
    scheme, timing = SCHEMES[point.scheme], rounds.timing(job, result)
    numbers = of_series(table, plan.scene().unit, scheme)
    numbers["cost"] = cost(timing.loop or 0.0, timing.cpu, point.dt)
    found.numbers.setdefault(point, []).append(numbers)
    if scheme.pressure is not None:
        values = thinned(table["PotEng"], table["Volume"], times=DENSER)
        one = structure.Sampled(scheme.temperature, scheme.pressure, values)
        found.samples.setdefault(point, []).append(one)


def of_series(table: Mapping[str, np.ndarray], molecules: int, scheme: Scheme) -> Numbers:
    """A run's numbers.

    Args:
        table: columns of LAMMPS's output, (samples,), after the part that is left out.
    """
    if ALL_PRINT in table:
        moves, half = table[ALL_PRINT], DEGREES * molecules * BOLTZMANN / 2
        translation, rotation = moves / half, (table["KinEng"] - moves) / half
    else:
        translation, rotation = (table[name] for name in OURS_PRINTS)
    (kinetic,) = thinned(table["KinEng"])
    far = structure.distribution(kinetic, scheme.temperature, molecules, scheme.held)
    found = {
        "potential": measures.mean(table["PotEng"]).times(1 / molecules),
        "temperature": measures.mean(table["Temp"]),
        "translation": measures.mean(translation),
        "rotation": measures.mean(rotation),
        "apart": measures.mean(translation - rotation),
        "pressure": measures.mean(table["Press"]),
        "drift": measures.drift(table["Time"] / FS_PER_PS, table["Econserve"]),
        "distribution": Estimate(far),
    }
    if scheme.pressure is not None:
        found["pressure_bias"] = measures.mean(table["Press"] - scheme.pressure)
        found["density"] = measures.mean(table["Density"])
        found["volume"] = measures.mean(table["Volume"])
        found["compressibility"] = compressibility(table["Volume"], scheme.temperature)
    return found


def thinned(*series: np.ndarray, times: int = 1) -> np.ndarray:
    """So many times the samples, (series, samples), that are independent in each of the series."""
    apart = max(map(measures.statistical_inefficiency, series))
    return np.stack(series)[:, :: int(np.ceil(apart / times))]


def compressibility(volumes: np.ndarray, temperature: float) -> Estimate:
    """var(V) / (kT <V>), of a series in Angstrom^3; 1e-5/atm."""
    sd = measures.standard_deviation(volumes)
    unit = FINE / (BOLTZMANN * ATM * temperature * np.mean(volumes))
    return Estimate(sd.value**2, 2 * sd.value * sd.error, sd.freedom).times(unit)


def cost(loop: float, cpu: float | None, dt: float) -> Estimate:
    """s of one core for a ps.

    Args:
        loop: us of a step by the clock.  cpu: percent of a core that the run had.  dt: fs.
    """
    return Estimate(loop * 1e-6 * FS_PER_PS / dt * (100.0 if cpu is None else cpu) / 100)


def pooled(starts: Sequence[Numbers]) -> Numbers:
    """The means over starts, see `measures.of_starts`."""
    return {
        name: measures.of_starts([one[name] for one in starts])
        for name in starts[0]
        if name not in SPREAD
    }


def rows(found: Found, points: Iterable[Point]) -> list[Row]:
    """A row for each of the points that was run, biases included."""
    made, means = [], {point: pooled(some) for point, some in found.numbers.items()}
    for point in points:
        if point not in means and point not in found.errors:
            continue
        scheme, error = SCHEMES[point.scheme], found.errors.get(point)
        lines = scheme.integrator.commands(plan.scene())
        row = Row(scheme.name, scheme.label, scheme.ours, point.dt, lines, error=error)
        if not error:
            starts = found.numbers[point]
            vars(row).update(means[point], starts=len(starts))
            for name in SPREAD:
                vars(row)[name] = measures.spread(one[name].value for one in starts)
            if point.other in means and point.other not in found.errors and point.other != point:
                vars(row).update(compared(point, means, found.samples))
        made.append(row)
    return made


def compared(
    point: Point, means: Mapping[Point, Numbers], samples: Mapping[Point, list[structure.Sampled]]
) -> Numbers:
    """The numbers of a point beside its other one."""
    both = point.other, point
    low, high = (means[one] for one in both)
    if not SCHEMES[point.scheme].first:
        return biases(high, low)
    made = {}
    first, second = (
        samples[one][0]._replace(values=np.hstack([start.values for start in samples[one]]))
        for one in both
    )
    if min(one.values.shape[1] for one in (first, second)) >= LEAST_SAMPLES * DENSER:
        deviation = structure.between_states(first, second)
        made = {} if deviation is None else {"deviation": Estimate(deviation)}
    if apart := second.pressure - first.pressure:
        made |= of_two_pressures(low, high, apart)
    return made


def biases(numbers: Numbers, limit: Numbers) -> Numbers:
    """How far means are from those of the reference."""
    made = {"bias": measures.difference(numbers["potential"], limit["potential"])}
    if "density" in limit:
        ratio = measures.quotient(numbers["density"], limit["density"])
        return made | {"density_bias": Estimate(ratio.value - 1, *ratio[1:]).times(100.0)}
    return made | {"pressure_bias": measures.difference(numbers["pressure"], limit["pressure"])}


def of_two_pressures(low: Numbers, high: Numbers, apart: float) -> Numbers:
    """Compressibilities from pressures that are so many atm apart.

    -d ln <V> / dP is the compressibility from fluctuations, at any pressure.  So its mean over the
    interval, here that of the ends, is the slope between them.
    """
    volumes = low["volume"], high["volume"]
    parts = ((one.error / one.value, one.freedom) for one in volumes)
    slope = Estimate(float(np.log(volumes[0].value / volumes[1].value)), *combined(*parts))
    halves = [one["compressibility"].times(0.5) for one in (low, high)]
    mean = Estimate(halves[0].value + halves[1].value, *combined(*(one[1:] for one in halves)))
    return {"two_pressures": slope.times(FINE / apart), "fluctuations": mean}
