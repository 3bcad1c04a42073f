"""The bias that a thermostat or a barostat gives to what is sampled at a time step.

All schemes move the same molecules from the same starts.  The bias of a mean is its distance from
that of this package's Langevin thermostat at a step so short that a step twice as long gives the
same within errors.  At constant pressure two states are compared as well: the ratio of their
distributions is known without any reference.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from ..running import machine, rounds, run
from ..scenes import FS_PER_PS
from ..scenes.units import BOLTZMANN
from ..statistics import measures, structure
from ..statistics.estimate import Estimate, combined
from . import plan, runs, schemes
from .lengths import SAMPLED, Lengths, Point, ordered
from .plan import REFERENCES, SCHEMES, STARTER, TEMPERATURE, beside_which
from .schemes import Scheme

DEGREES = 3  # of freedom of a molecule's translation, and of its rotation
ATM = 68568.415  # atm Angstrom^3 in a kcal/mol, LAMMPS's
FINE = 1e5  # compressibilities are in 1e-5/atm
# of each of two states independent samples, as fewer cannot tell a slope, and how many are taken
# for an independent one, as physical_validation has bins to fill (it counts independent ones)
LEAST_SAMPLES, DENSER = 50, 4

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
    found, batch = Found(), _runs(lengths, out, silence)
    made = batch.do([one for _, one in plan.names(points, lengths)], meter, __name__)
    if made.error:
        found.errors |= dict.fromkeys(points, made.error)
    every = ordered([*points, *plan.points(dt=plan.KNOWN_STEPS)], SCHEMES)
    for point, one in plan.names(every, lengths):
        job = batch.job(one)
        if point not in found.errors and run.is_there(job, failures=True):
            _measure(found, point, job)
    scene = batch.scene
    summary = machine.circumstances() | {"scene": scene.name, "title": scene.title}
    summary["versions"] |= machine.worker_versions(made.versions)
    summary |= {"interrupted": made.interrupted, "molecules": scene.unit, "lost": made.failed}
    summary |= {"temperature": TEMPERATURE, "references": [one._asdict() for one in REFERENCES]}
    summary["settings"] = asdict(lengths) | {"settle": lengths.settle, "sampled_fs": SAMPLED}
    return summary, rows(found, every)


def _runs(lengths: Lengths, out: Path, silence: float) -> runs.Runs:
    """All runs of these lengths."""
    scene = plan.scene()

    def more(scheme: Scheme, dt: float, folder: Path) -> list[str]:
        columns = "econserve", "vol", "density", *schemes.prints(scheme)
        return [*schemes.moves(scheme, scene), *run.thermo(*columns)]

    return runs.Runs(scene, STARTER, lengths, out / "runs" / lengths.folder, silence, more)


def _measure(found: Found, point: Point, job: run.Job) -> None:
    """The numbers of a run that is there, or why it has none."""
    result, table = runs.table(job)
    if result.error:
        found.errors.setdefault(point, result.error)
        return
    scheme, timing = SCHEMES[point.scheme], rounds.timing(job, result)
    numbers = of_series(table, plan.scene().unit, scheme)
    numbers["cost"] = Estimate(runs.cost(timing.loop or 0.0, timing.cpu, point.dt))
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
    if schemes.ALL_PRINT in table:
        moves, half = table[schemes.ALL_PRINT], DEGREES * molecules * BOLTZMANN / 2
        translation, rotation = moves / half, (table["KinEng"] - moves) / half
    else:
        translation, rotation = (table[name] for name in schemes.OURS_PRINTS)
    (kinetic,) = thinned(table["KinEng"])
    far = structure.distribution(kinetic, scheme.temperature, molecules, scheme.held)
    found = {
        "potential": measures.mean(table["PotEng"]).times(1 / molecules),
        "temperature": measures.mean(table["Temp"]),
        "translation": measures.mean(translation),
        "rotation": measures.mean(rotation),
        "apart": measures.mean(translation - rotation),
        "pressure": measures.mean(
            table["Press"] + of_momentum(scheme.held, scheme.temperature, table["Volume"])
        ),
        "drift": measures.drift(table["Time"] / FS_PER_PS, table["Econserve"]),
        "distribution": Estimate(far),
    }
    if scheme.pressure is not None:
        found["pressure_bias"] = measures.mean(table["Press"] - scheme.pressure)
        found["density"] = measures.mean(table["Density"])
        found["volume"] = measures.mean(table["Volume"])
        found["compressibility"] = compressibility(table["Volume"], scheme.temperature)
    return found


def of_momentum(held: int, temperature: float, volume: float | np.ndarray) -> float | np.ndarray:
    """The pressure that so many degrees of freedom of the total momentum would have, atm: a scheme
    that keeps it at zero lacks this, and one that does not has it.  ``volume`` in Angstrom^3."""
    return held * BOLTZMANN * temperature / (3 * volume) * ATM


def thinned(*series: np.ndarray, times: int = 1) -> np.ndarray:
    """So many times the samples, (series, samples), that are independent in each of the series."""
    apart = max(map(measures.statistical_inefficiency, series))
    return np.stack(series)[:, :: int(np.ceil(apart / times))]


def compressibility(volumes: np.ndarray, temperature: float) -> Estimate:
    """var(V) / (kT <V>), of a series in Angstrom^3; 1e-5/atm."""
    unit = FINE / (BOLTZMANN * ATM * temperature * np.mean(volumes))
    return measures.mean(measures.squares(volumes)).times(unit)


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
            other = beside_which(point)
            if other in means and other not in found.errors and other != point:
                vars(row).update(compared(point, means, found.samples))
        made.append(row)
    return made


def compared(
    point: Point, means: Mapping[Point, Numbers], samples: Mapping[Point, list[structure.Sampled]]
) -> Numbers:
    """The numbers of a point beside its other one."""
    both = beside_which(point), point
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
