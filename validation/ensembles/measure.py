"""The bias that a thermostat gives to what is sampled at a time step.

All schemes move the same molecules from the same starts.  The bias of a mean is its distance from
that of this package's Langevin thermostat at a step so short that a step twice as long gives the
same within errors.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from validation.ensembles import plan
from validation.ensembles.plan import REFERENCE, SCHEMES, STARTER, TEMPERATURE, Lengths, Point
from validation.running import machine, rounds, run
from validation.running.store import Store
from validation.scenes import FS_PER_PS, Scene
from validation.scenes.starts import from_dump, to_dump
from validation.statistics import measures, structure
from validation.statistics.estimate import Estimate
from validation.sweep.errors import BOLTZMANN

DEGREES = 3  # of freedom of a molecule's translation, and of its rotation
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
            last is translation less rotation.  pressure, pressure_bias: atm.  drift: of the
            effective energy, kcal/mol/ps in all.
        cost: s of one core for a ps, over starts.
        distribution: standard deviations between the kinetic energy's distribution and the
            canonical one (physical_validation), over starts.
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


@dataclass
class Found:
    """What the runs gave: of each point the numbers of its starts, and why one failed."""

    numbers: dict[Point, list[Numbers]] = field(default_factory=dict)
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
    scene, folder, found = plan.scene(), out / "runs", Found()
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
    every = list(dict.fromkeys([*points, *plan.points()]))
    for name, point, start in plan.names(every, lengths):
        if point in found.errors:
            continue
        job = _job(scene, folder, name, point, start, lengths, silence)
        if run.is_there(job, failures=True):
            _measure(found, point, job)
    summary = machine.circumstances() | {"scene": scene.name, "title": scene.title}
    summary["versions"] |= machine.worker_versions(found.versions)
    summary |= {"interrupted": found.interrupted, "molecules": scene.unit}
    summary |= {"temperature": TEMPERATURE, "reference": REFERENCE._asdict()}
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
    more += run.thermo("econserve", *prints)
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
    numbers = of_series(table, plan.scene().unit, scheme.held)
    numbers["cost"] = cost(timing.loop or 0.0, timing.cpu, point.dt)
    found.numbers.setdefault(point, []).append(numbers)


def of_series(table: Mapping[str, np.ndarray], molecules: int, held: int = 0) -> Numbers:
    """A run's numbers.

    Args:
        table: columns of LAMMPS's output, (samples,), after the part that is left out.
        held: degrees of freedom that the total momentum has not.
    """
    if ALL_PRINT in table:
        moves, half = table[ALL_PRINT], DEGREES * molecules * BOLTZMANN / 2
        translation, rotation = moves / half, (table["KinEng"] - moves) / half
    else:
        translation, rotation = (table[name] for name in OURS_PRINTS)
    kinetic = table["KinEng"]
    independent = kinetic[:: int(np.ceil(measures.statistical_inefficiency(kinetic)))]
    far = structure.distribution(independent, TEMPERATURE, molecules, held)
    return {
        "potential": measures.mean(table["PotEng"]).times(1 / molecules),
        "temperature": measures.mean(table["Temp"]),
        "translation": measures.mean(translation),
        "rotation": measures.mean(rotation),
        "apart": measures.mean(translation - rotation),
        "pressure": measures.mean(table["Press"]),
        "drift": measures.drift(table["Time"] / FS_PER_PS, table["Econserve"]),
        "distribution": Estimate(far),
    }


def cost(loop: float, cpu: float | None, dt: float) -> Estimate:
    """s of one core for a ps.

    Args:
        loop: us of a step by the clock.  cpu: percent of a core that the run had.  dt: fs.
    """
    return Estimate(loop * 1e-6 * FS_PER_PS / dt * (100.0 if cpu is None else cpu) / 100)


def pooled(starts: Sequence[Numbers]) -> Numbers:
    """The means over starts, whose scatter tells their errors; one start's own errors."""
    if len(starts) == 1:
        return {name: one for name, one in starts[0].items() if name not in SPREAD}
    return {
        name: measures.of_few([one[name].value for one in starts])
        for name in starts[0]
        if name not in SPREAD
    }


def rows(found: Found, points: Iterable[Point]) -> list[Row]:
    """A row for each of the points that was run, biases included."""
    made, means = [], {point: pooled(some) for point, some in found.numbers.items()}
    limit = None if REFERENCE in found.errors else means.get(REFERENCE)
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
            vars(row).update(biases(means[point], limit) if limit and point != REFERENCE else {})
        made.append(row)
    return made


def biases(numbers: Numbers, limit: Numbers) -> Numbers:
    """How far means are from those of the reference."""
    return {
        "bias": measures.difference(numbers["potential"], limit["potential"]),
        "pressure_bias": measures.difference(numbers["pressure"], limit["pressure"]),
    }
