"""What breaks on a user's script: longer steps, a run in two parts, other numbers of ranks.

Each is a number with a bound for each integrator, as ``check`` has them.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..compare.errors import failure
from ..experiment import Done, Point, Trajectory, perform
from ..own import shapes
from ..own.system import Own
from ..running import machine, run
from ..running.store import Store
from ..scenes.integrators import Integrator
from ..statistics import measures
from ..statistics.check import Check

LONGER = 2.0, 4.0, 8.0  # times the script's step
STEPS = 400  # of a run with a longer step
PART = 20  # steps of each half of a run in two parts; and of one on other ranks
# of a body's room: rounding grows by some powers of ten in so few steps, and no further
NEAR = 1e-6
# of the temperature: a step that heats by more in so few steps is none to use
HEATS = 0.2
TITLES = {
    "step": f"Longer steps, {STEPS} of them",
    "parts": f"{PART} and {PART} steps in two runs, held against {2 * PART} in one",
    "ranks": f"{PART} steps on one rank, held against two",
}


class Planned(NamedTuple):
    """A run of an integrator: numbers of steps, the step over the script's, and more of its job."""

    runs: list[int]
    factor: float = 1.0
    more: tuple[str, ...] = ()
    ranks: int = 1


ONE, TWO, RANKS = "in one", "in two", "on 2 ranks"
PLAN = {
    ONE: Planned([PART, PART]),
    TWO: Planned([PART], more=(f"run {PART}",)),
    RANKS: Planned([PART], ranks=2),
    **{f"{factor:g} times the step": Planned([STEPS], factor) for factor in LONGER},
}
TOTAL = sum(sum(planned.runs) for planned in PLAN.values())  # steps of an integrator


def _trajectory(
    own: Own, integrator: Integrator, what: str, out: Path, silence: float
) -> Trajectory:
    """A run; one with a longer step is of a ladder of these."""
    runs, factor, more, ranks = PLAN[what]
    name, dt = _name(integrator, what), factor * own.scene.dt
    how: dict = {"dt": dt, "every": max(1, runs[0] // 40), "more": more, "ranks": ranks}
    how |= {"silence": silence, "origin": machine.origin(own.scene, integrator)}
    job = partial(run.job, own.scene, integrator, out / "runs" / name, runs, **how)
    point = Point(integrator.name, dt) if factor > 1 else None
    return Trajectory(name, f"{integrator.label}, {what}", job, point)


def _name(integrator: Integrator, what: str) -> str:
    return f"{run.folder_name(integrator.name)}/{what.replace(' ', '-')}"


def stress(
    own: Own, some: Sequence[Integrator], out: Path, silence: float, meter: run.Meter
) -> dict:
    """All of it, as plain data: ``checks`` and circumstances."""
    summary = machine.circumstances() | {"title": own.scene.title, "notes": own.notes}
    every = [
        _trajectory(own, integrator, what, out, silence) for integrator in some for what in PLAN
    ]
    judge = partial(failure, temperature=shapes.temperature(own), boltzmann=own.said["boltzmann"])
    done = perform(every, Store(out, "stress.script"), meter, judge=judge)
    checks = [check.plain() for integrator in some for check in _checks(own, integrator, done)]
    return summary | {"checks": checks, "interrupted": done.interrupted}


def _checks(own: Own, integrator: Integrator, done: Done) -> Iterator[Check]:
    yield from _steps(own, integrator, done)
    jobs = [done.jobs.get(_name(integrator, what)) for what in (ONE, TWO, RANKS)]
    whole, *others = (run.collect(job.directory) if job else None for job in jobs)
    for part, other, frame in zip(("parts", "ranks"), others, (-1, 1)):
        if not (whole and other):  # a Ctrl-C came before
            continue
        error = whole.error or other.error
        if not (whole.positions and other.positions):
            yield Check(part, integrator.label, "ends (1)", 1, high=0, note=error or "")
            continue
        here, there = whole.positions, other.positions
        apart = measures.largest_distance(here.x[frame], there.x[-1], there.cell, here.periodic)
        if not np.isfinite(apart):
            note = "positions are no numbers"
            yield Check(part, integrator.label, "ends (1)", 1, high=0, note=note)
            continue
        what = "distance of the ends, of a body's room"
        note = "the run depends on it; with random numbers of LAMMPS's it always does"
        yield Check(part, integrator.label, what, apart / own.room, high=NEAR, note=note)


def _steps(own: Own, integrator: Integrator, done: Done) -> Iterator[Check]:
    at = shapes.temperature(own)
    for factor in LONGER:
        name = _name(integrator, f"{factor:g} times the step")
        if name not in done.jobs:
            return
        dt = f"{factor * own.scene.dt:g} {own.units.time}"
        if why := done.failed.get(name):
            what = f"ends or heats with {dt} (1)"
            yield Check("step", integrator.label, what, 1, high=0, note=why)
            return  # longer ones, too
        kelvin = run.collect(done.jobs[name].directory).thermo["Temp"]
        mean = measures.mean(kelvin[len(kelvin) // 4 :])
        off = abs(mean.value - (at if own.found.state.temp else kelvin[0]))
        sized = mean._replace(value=off).times(1 / at)
        what = f"change of the temperature with {dt}, of it"
        note = "it heats, or its temperature had not settled"
        yield Check.of("step", integrator.label, what, sized, high=HEATS, note=note)
