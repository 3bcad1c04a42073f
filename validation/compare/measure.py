"""The same start with every integrator: energy, thermodynamics, trajectory, cost.

First each integrator runs the whole trajectory; then short segments are timed in turn.
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ..own import counted
from ..running import machine, rounds, run
from ..scenes import Scene
from ..scenes.integrators import REFERENCE, Integrator
from ..scenes.units import UNITS
from ..statistics import measures
from ..statistics.estimate import Estimate, plain

DISTANCE_STEPS = 100  # after so many steps trajectories are compared
WARM_UP = 20  # steps before a timed segment


@dataclass(frozen=True)
class Settings:
    """How to compare; ``dt_fs`` is in the scene's units, ``silence`` in s, after which a run is
    given up."""

    ranks: int
    steps: int
    dt_fs: float
    timing_rounds: int
    timing_steps: int
    silence: float
    sample_every_steps: int = 10
    discarded_fraction: float = 0.05  # of the run, that energies and averages leave out
    reference: str = REFERENCE
    ensemble: str = "nve"
    notes: tuple[str, ...] = ()  # what was found in a script

    @property
    def distance_after_steps(self) -> int:
        """After so many trajectories are compared."""
        return min(DISTANCE_STEPS, self.steps)


@dataclass
class Row:
    """An integrator's numbers, in the units of the report; None where not measured."""

    name: str
    label: str
    lines: list[str]
    error: str | None = "not started"
    steps: int = 0
    uncounted: bool = False  # LAMMPS's econserve says nothing of its energy: see `own.counted`
    energy_sd: Estimate | None = None
    energy_sd_line: Estimate | None = None
    drift: Estimate | None = None
    temperature: Estimate | None = None
    pressure: Estimate | None = None
    density: Estimate | None = None
    rigidity: float | None = None
    distance: float | None = None
    modify: measures.Spread | None = None
    loop: measures.Spread | None = None
    cpu: float | None = None
    modify_ratio: measures.Spread | None = None
    loop_ratio: measures.Spread | None = None


def compare(
    scene: Scene, integrators: list[Integrator], out: Path, settings: Settings, meter: run.Meter
) -> tuple[dict, dict]:
    """Run, measure, summarise.

    Args:
        out: folder for the runs' files.

    Returns:
        (summary, series): all numbers as plain data, and a dict of integrator name to its thermo
        table.  A Ctrl-C leaves what there is, with ``summary["interrupted"]`` set.
    """
    done: dict[str, run.Result] = {}

    def job(one, runs, part="", **more):
        folder = out / "runs" / run.folder_name(one.name) / part
        common: dict = {"dt": settings.dt_fs, "ranks": settings.ranks, "silence": settings.silence}
        return run.job(scene, one, folder, runs, **common, **more)

    first = settings.distance_after_steps
    lengths = [first] + [settings.steps - first] * (settings.steps > first)
    for one in integrators:
        meter.begin(one.label, settings.steps)
        how = {"every": settings.sample_every_steps, "origin": machine.origin(scene, one)}
        done[one.name] = result = run.once(job(one, lengths, **how), meter.at)
        meter.end(result.error)
        if result.interrupted:
            break
    interrupted = any(result.interrupted for result in done.values())
    known = {one.name: one for one in integrators if not interrupted and not done[one.name].error}
    labels = {name: f"{one.label}, timing" for name, one in known.items()}

    def turn(name, number):
        return job(known[name], [WARM_UP, settings.timing_steps], f"timing-{number}", every=0)

    timed, errors, stopped = rounds.in_turn(labels, turn, settings.timing_rounds, meter)
    summary = machine.circumstances() | {"scene": scene.name, "title": scene.title}
    summary |= {"interrupted": interrupted or stopped, "settings": asdict(settings)}
    summary["settings"] |= {"distance_after_steps": first, "units": scene.units}
    rows = {}
    for one in integrators:
        rows[one.name] = Row(one.name, one.label, one.commands(scene))
        rows[one.name].uncounted = counted.wrongly(one)
    for name, result in done.items():
        summary["versions"].update(machine.worker_versions(result.versions))
        many = UNITS[scene.units].many
        _trajectory(rows[name], result, done.get(settings.reference), settings, many)
        _cost(rows[name], timed.get(name, []), timed.get(settings.reference, []))
        if name in errors and not rows[name].error:
            rows[name].error = f"while timed: {errors[name]}"
    summary["integrators"] = [plain(vars(row)) for row in rows.values()]
    return summary, {name: result.thermo for name, result in done.items() if result.thermo}


def _trajectory(
    row: Row, result: run.Result, reference: run.Result | None, settings: Settings, many: float
) -> None:
    """Energy and averages over the part of the series that is kept; the atoms' places."""
    row.error = result.error
    if result.thermo:
        _thermodynamics(row, result.thermo, settings.discarded_fraction * settings.steps, many)
        if not row.error and row.steps < settings.steps:
            row.error = "energy is not finite"
    if result.positions:
        own = result.positions
        box = own.cell, own.periodic
        pairs = measures.body_pairs(own.bodies)
        ends = own.cells[0], own.periodic, own.cells[-1]
        row.rigidity = float(measures.rigidity_error(own.x[0], own.x[-1], pairs, *ends))
        if reference and reference.positions:
            there = reference.positions.x[1]
            row.distance = float(measures.largest_distance(own.x[1], there, *box))


def conserved(thermo: dict) -> np.ndarray:
    """The energy that the integrator is to keep: with what thermostats and barostats have given,
    where that was asked for."""
    return thermo.get("Econserve", thermo["TotEng"])


def _thermodynamics(row: Row, thermo: dict, begin: float, many: float) -> None:
    finite = np.isfinite(conserved(thermo))
    until = len(finite) if finite.all() else int(np.argmin(finite))
    step = thermo["Step"][:until]
    row.steps = int(step[-1]) if until else 0
    kept = np.flatnonzero(step >= begin)
    if len(kept) < 8:  # too few for an error
        return
    time, energy = thermo["Time"][kept], conserved(thermo)[kept]
    if not row.uncounted:
        row.energy_sd = measures.standard_deviation(energy)
        row.energy_sd_line = measures.about_line(time, energy)
        row.drift = measures.drift(time / many, energy)
    row.temperature = measures.mean(thermo["Temp"][kept])
    row.pressure = measures.mean(thermo["Press"][kept])
    if "Density" in thermo:
        row.density = measures.mean(thermo["Density"][kept])


def _cost(row: Row, own: list[rounds.Timing], reference: list[rounds.Timing]) -> None:
    """Modify and loop time per step: spread over the timed segments, and ratios."""
    row.modify = rounds.spread(own, "modify")
    row.loop = rounds.spread(own, "loop", 1e-3)
    row.cpu = rounds.least_cpu(own)
    row.modify_ratio = rounds.ratio(own, reference, "modify")
    row.loop_ratio = rounds.ratio(own, reference, "loop")
