"""What breaks on a user's script: longer steps, a run in two parts, other numbers of ranks.

Each is a number with a bound for each integrator, as ``check`` has them.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console

from ..compare.errors import failure
from ..own import shapes
from ..own.system import Own
from ..pages import report
from ..running import machine, run
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


def stress(
    own: Own, some: Sequence[Integrator], out: Path, silence: float, meter: run.Meter
) -> dict:
    """All of it, as plain data: ``checks`` and circumstances."""
    summary = machine.circumstances() | {"title": own.scene.title, "notes": own.notes}
    checks, interrupted = _checks(own, some, out, silence, meter)
    return summary | {"checks": [one.plain() for one in checks], "interrupted": interrupted}


def _checks(own, some, out, silence, meter) -> tuple[list[Check], bool]:
    checks: list[Check] = []
    try:
        for one in some:
            runner = _Runner(own, one, out, silence, meter)
            for found in (_steps(runner), _parts(runner), _ranks(runner)):
                checks += found
    except KeyboardInterrupt:
        return checks, True
    return checks, False


class _Runner:
    def __init__(self, own, one, out, silence, meter):
        self.own, self.one, self.out = own, one, out
        self.silence, self.meter = silence, meter

    def do(self, name, runs, factor=1.0, ranks=1, more=()) -> run.Result:
        """Do a job, or take over what is there."""
        own, label = self.own, f"{self.one.label}, {name}"
        how: dict = {"dt": factor * own.scene.dt, "every": max(1, runs[0] // 40), "ranks": ranks}
        how |= {"silence": self.silence, "origin": machine.origin(own.scene, self.one)}
        folder = self.out / "runs" / run.folder_name(self.one.name) / name.replace(" ", "-")
        self.meter.begin(label, 1)
        job = run.job(own.scene, self.one, folder, runs, more=more, **how)
        result = run.once(job, failures=True)
        self.meter.end(result.error)
        if result.interrupted:
            raise KeyboardInterrupt
        return result

    def apart(self, first: run.Result, second: run.Result) -> float | None:
        """Largest distance of the ends, over a body's room; None if one has none."""
        if first.error or second.error or not (first.positions and second.positions):
            return None
        here, there = first.positions, second.positions
        box = here.cell, here.periodic
        return float(measures.largest_distance(here.x[-1], there.x[-1], *box)) / self.own.room


def _steps(runner) -> Iterator[Check]:
    own, at = runner.own, shapes.temperature(runner.own)
    for factor in LONGER:
        result = runner.do(f"{factor:g} times the step", [STEPS], factor)
        why = failure(result, shapes.temperature(own), own.said["boltzmann"])
        dt = f"{factor * own.scene.dt:g} {own.units.time}"
        what = f"change of the temperature with {dt}, of it"
        if why:
            yield Check(
                "step", runner.one.label, f"ends or heats with {dt} (1)", 1, high=0, note=why
            )
            return  # longer ones, too
        kelvin = result.thermo["Temp"]
        mean = measures.mean(kelvin[len(kelvin) // 4 :])
        off = abs(mean.value - (at if own.found.state.temp else kelvin[0]))
        note = "it heats, or its temperature had not settled"
        sized = mean._replace(value=off).times(1 / at)
        yield Check.of("step", runner.one.label, what, sized, high=HEATS, note=note)


def _parts(runner) -> Iterator[Check]:
    whole = runner.do("in one", [2 * PART])
    more = (f"run {PART}",)
    parts = runner.do("in two", [PART], more=more)
    yield _near(runner, "parts", "distance of the ends, of a body's room", whole, parts)


def _ranks(runner) -> Iterator[Check]:
    first, second = (runner.do(f"on {n} ranks", [PART], ranks=n) for n in (1, 2))
    yield _near(runner, "ranks", "distance of the ends, of a body's room", first, second)


def _near(runner, part, what, first, second) -> Check:
    value = runner.apart(first, second)
    note = (
        first.error
        or second.error
        or "the run depends on it; with random numbers of LAMMPS's it always does"
    )
    if value is None:
        return Check(part, runner.one.label, "ends (1)", 1, high=0, note=note)
    return Check(part, runner.one.label, what, value, high=NEAR, note=note)


def write(summary: dict, out: Path) -> None:
    """Write all files into a folder."""
    files = {"table": report.of_checks(summary["checks"])}
    report.write(summary, out, files, "check.html", titles=TITLES, shown=[])


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the numbers, and what does not hold."""
    report.show_checks(console, summary["checks"], TITLES)
    report.end(console, summary, out)
