"""Limits of stability: cases with a number each, run with fix_nosquish's schemes and with LAMMPS's
rigid and constraint fixes.

A case is a function of a `Runner` and a length that runs LAMMPS and returns a `Number`; `stress`
runs cases with integrators, row by row.  A row stores the numbers of each start, and is judged
against the bounds of ``criteria`` each time it is shown.  Several processes may run with the same
output folder: a case is locked by one of them, and each summary has the rows of all.
"""

import shlex
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import COMMAND
from ..running import json_files, machine, run
from ..running.run import Meter, Result
from ..running.store import Store
from ..scenes import SCENES, Scene
from ..scenes.integrators import CONSTRAINING, INTEGRATORS, OURS, SWEPT, Integrator
from ..statistics.check import Check
from ..statistics.estimate import CONFIDENCE, Estimate, combined, margin
from . import criteria
from .criteria import Criterion

BROKEN = {"blow-up", "cannot run"}
SURVIVED = {"pass", "fail", "cannot tell"}
_WORDS = {True: "pass", False: "fail", None: "cannot tell"}

# in the order of the table's columns
_RIGID = "rigid/nve", "rigid/nve/small", "rigid", "rigid/small"
_TOLERANCES = {"shake": ("1e-4", "1e-6", "1e-8"), "rattle": ("1e-4", "1e-8"), "ilves": ("1e-8",)}
_HELD = [f"{style} {tolerance}" for style in CONSTRAINING for tolerance in _TOLERANCES[style]]
COMPARED = {
    "nosquish": INTEGRATORS["nosquish"],
    **{name: SWEPT[name.replace(" ", "-")] for name in (*_RIGID, *_HELD)},
}
ALL = tuple(COMPARED)
# without those that are similar to another
FEW = "nosquish", "rigid/nve", "rigid/nve/small", "rigid", "shake 1e-8", "rattle 1e-4"
EXTREME, REPORTED = "extreme", "reported"  # parts: by physics; by what users report as broken
# the origin of a number's error bar, or why there is none
LINE = "standard error of the slope of a line, by the noise about it and the largest random walk"
EXACT = (
    "none: the largest of all deviations in runs that give the same each time, of which no mean is "
    "taken"
)


@dataclass(frozen=True)
class Number:
    """Result of a case.

    Attributes:
        value: in the case's unit.
        error: its standard error, or the resolution of a search.
        note: further information, such as the part of the case that gave the number.
        freedom: degrees of freedom of the error; None for many.
        parts: number of each criterion, by name, if there are several; ``value`` is then the
            largest of them, each relative to its bound.
    """

    value: float
    error: float = 0.0
    note: str = ""
    freedom: float | None = None
    parts: dict[str, float] | None = None

    @classmethod
    def of(cls, estimate: Estimate, note: str = "") -> "Number":
        """An estimate with a note."""
        return cls(float(estimate.value), float(estimate.error), note, estimate.freedom)


def of_parts(parts: Mapping[str, float], note: str) -> Number:
    """The `Number` of a case with several criteria, each with an upper bound, by name."""
    parts = {name: float(value) for name, value in parts.items()}
    return Number(_largest(parts), note=note, parts=parts)


def _largest(parts: Mapping[str, float]) -> float:
    return float(max(value / criteria.CRITERIA[name].bound for name, value in parts.items()))


def of_starts(numbers: Sequence[Number]) -> Number:
    """|mean| of rates of either sign; the errors are those of the line fits."""
    parts = ((number.error / len(numbers), number.freedom) for number in numbers)
    mean = abs(np.mean([number.value for number in numbers]))
    notes = "; ".join(number.note for number in numbers if number.note)
    several = f"{len(numbers)} starts: " if len(numbers) > 1 else ""
    return Number.of(Estimate(mean, *combined(*parts)), several + notes)


class BlowUp(Exception):
    """A run that failed: its message, and the last step."""


class CannotRun(Exception):
    """The reason why an integrator is not run on a case."""


@dataclass(frozen=True)
class Case:
    """A situation that some integrators do not survive.

    Attributes:
        name: on the command line and of its folder.
        physics: what happens, in a sentence.
        criterion: the number, in words.
        bars: meaning of the number's error, or why there is none.
        measure: returns the number, from a runner and a length.
        short, full: lengths, in a unit of the function.
        compared: names of the integrators to run; with --short those of `FEW`.
        starts: largest number of starts: a row gets more until its verdict is significant.
        bounds: names of criteria, other than those that name the case.
        part: `EXTREME` or `REPORTED`.
    """

    name: str
    physics: str
    criterion: str
    bars: str
    measure: Callable[["Runner", Any], Number]
    short: Any
    full: Any
    compared: tuple[str, ...] = ALL
    starts: int = 1
    bounds: dict[str, Criterion] | None = None
    part: str = EXTREME

    @classmethod
    def of(cls, name: str, physics: str, short: Any, full: Any, **more) -> Callable:
        """A decorator that makes a case of its measure."""
        return lambda measure: cls(name, physics, measure=measure, short=short, full=full, **more)

    @property
    def criteria(self) -> dict[str, Criterion]:
        """All criteria for its numbers, by name."""
        return self.bounds or {
            key: criterion
            for key, criterion in criteria.CRITERIA.items()
            if self.name in criterion.cases.split()
        }

    @property
    def bound(self) -> Criterion:
        """The bound of the number: of its criterion, or that each part is below its own."""
        judges = [criterion for criterion in self.criteria.values() if not criterion.inner]
        return judges[0] if len(judges) == 1 else criteria.EACH

    @property
    def inner(self) -> dict[str, float]:
        """Bounds that the measured number depends on."""
        bounds = {
            name: criterion.bound for name, criterion in self.criteria.items() if criterion.inner
        }
        return bounds | {"rounding": criteria.rounding(1)}

    def length(self, full: bool) -> Any:
        """The length of a full run or of a short one."""
        return self.full if full else self.short

    def integrators(self, full: bool) -> list[str]:
        """The names of the integrators to run."""
        return [name for name in self.compared if full or name in FEW]

    def number(self, numbers: Sequence[Number]) -> Number:
        """The row's `Number` from those of its starts; one with parts by the current bounds."""
        if self.starts > 1:
            return of_starts(numbers)
        parts = numbers[0].parts
        return replace(numbers[0], value=_largest(parts)) if parts else numbers[0]

    @property
    def looks(self) -> list[int]:
        """Numbers of starts at which a row may have enough: 1, doubled each time."""
        return [2**k for k in range(self.starts.bit_length())]

    def verdict(self, numbers: Sequence[Number]) -> str:
        """Return pass, fail, or cannot tell if the interval of the number contains the bound.  Each
        of the `looks` is a test, so the intervals are those of 95 % for all looks together."""
        result = self.number(numbers)
        confidence = 1 - (1 - CONFIDENCE) / len(self.looks)
        wider = margin(1.0, result.freedom, confidence) / margin(1.0, result.freedom)
        number = result.value, result.error * wider, *self.bound.within()
        return _WORDS[Check("", "", "", *number, freedom=result.freedom).holds]


@dataclass
class Runner:
    """The place where a case is run with one integrator.

    Attributes:
        folder: of this case with this integrator; files of the case may be in its parent.
        silence: s without a sign of life after which a run is given up.
        ranks: for scenes that are worth more than one.
        start: index of the start, from 0, of a case that has several.
        seconds: time of all steps.
    """

    case: Case
    integrator: Integrator
    folder: Path
    silence: float
    meter: Meter
    ranks: int = 1
    start: int = 0
    seconds: float = 0.0

    def run(self, scene: Scene, label: str, runs: list[int], **how) -> tuple[Result, Path]:
        """Same as `attempt`, but also raise `BlowUp` if it failed later or its energy is not
        finite."""
        result, folder = self.attempt(scene, label, runs, **how)
        steps = result.thermo.get("Step", np.zeros(1))
        if result.error:
            raise BlowUp(f"after step {steps[-1]:.0f}: {result.error}")
        finite = np.isfinite(result.thermo.get("TotEng", np.zeros(1)))
        if not finite.all():
            raise BlowUp(f"energy not finite, by step {steps[np.argmin(finite)]:.0f}")
        return result, folder

    def attempt(
        self,
        scene: Scene,
        label: str,
        runs: list[int],
        *,
        more: Iterable[str] = (),
        files: Iterable[Path] = (),
        by: Integrator | None = None,
        **how,
    ) -> tuple[Result, Path]:
        """Do the runs, or use existing results.

        Args:
            label: of the run's folder.
            more: LAMMPS commands before the first run; ``{folder}`` is the run's.
            files: files besides the scene that the run depends on.
            by: another integrator than the runner's.
            how: arguments of ``run.job``.

        Returns:
            the result, which may have failed after its first line of output, and its folder.

        Raises:
            CannotRun: the integrator does not support such bodies.
            BlowUp: LAMMPS refused it, or it failed before the first step.
            KeyboardInterrupt: after a Ctrl-C.
        """
        integrator = by or self.integrator
        if not integrator.can_run(scene):
            why = "there is no cluster of bonds and angles that holds these bodies"
            raise CannotRun(f"{integrator.label}: {why}")
        folder = (self.folder / run.folder_name(label)).resolve()
        lines = [line.replace("{folder}", str(folder)) for line in more]
        origin = machine.origin(scene, integrator, *files)
        how = {"silence": self.silence, "keeps": "nothing", "origin": origin, "more": lines, **how}
        job = run.job(scene, integrator, folder, runs, **how)
        total = sum(runs) + sum(int(line.split()[1]) for line in lines if line.startswith("run "))
        share = 1 / max(1, total)
        result = run.once(job, lambda step: self.meter.at(min(1.0, step * share)), failures=True)
        self.seconds += sum(timing.seconds for timing in result.timings)
        if result.interrupted:
            raise KeyboardInterrupt
        if result.error and "Step" not in result.thermo:
            raise BlowUp(result.error)
        return result, folder


class Rows:
    """All rows of an output folder, by names of case and integrator."""

    def __init__(self, cases: Mapping[str, Case], out: Path, full: bool) -> None:
        self.cases, self.out, self.full = cases, out, full
        self.store = Store(out / "rows")
        self.scenes = [machine.contents(scene.folder) for scene in SCENES.values()]

    def place(self, case: str, integrator: str) -> tuple[str, str]:
        """A row's name in the store and its origin: code, length and inner bounds."""
        entry = self.cases[case]
        settings = entry.length(self.full), entry.inner, self.scenes
        return f"{case}/{run.folder_name(integrator)}", self.store.origin(*settings)

    def load(self, case: str, integrator: str) -> dict | None:
        """The row that was measured with this code, or None."""
        record = self.store.load(*self.place(case, integrator))
        return record and record["record"]

    def save(self, case: str, row: dict) -> None:
        """Store a row, as far as it is known."""
        self.store.save(*self.place(case, row["integrator"]), row, _enough(self.cases[case], row))

    def summary(self) -> dict:
        """All rows of the folder, including those of other processes.  A row that was not measured
        with this code is read from the folder's summary.json, if it has the same length and inner
        bounds: each row states the code of its measurement."""
        stored = (json_files.read(self.out / "summary.json") or {}).get("cases", ())
        before = {(case["name"], row["integrator"]): row for case in stored for row in case["rows"]}
        summaries = []
        for case in self.cases.values():
            rows = [self.load(case.name, name) or before.get((case.name, name)) for name in ALL]
            shown = [judge(case, row) for row in rows if row and self._is_of(case, row)]
            if shown:
                summaries.append(_plain(case, self.full) | {"rows": shown})
        named = [case["name"] for case in summaries if len(summaries) < len(self.cases)]
        words = ["stress", *named, "--full" if self.full else "--short"]
        return {"full": self.full, "cases": summaries, "command": shlex.join([COMMAND, *words])}

    def _is_of(self, case: Case, row: dict) -> bool:
        """Whether a row has a result of this length and these inner bounds."""
        same = row["length"], row["inner"]
        measured = bool(row["ended"] or row["numbers"])
        return measured and same == (case.length(self.full), case.inner)


def _plain(case: Case, full: bool) -> dict:
    """A case without its rows, as plain data."""
    low, high = case.bound.within()
    sign, value = ("≥", low) if high is None else ("≤", high)
    words = {key: getattr(case, key) for key in ("name", "part", "physics", "criterion", "bars")}
    bounds = [
        {"quantity": criterion.quantity, "text": criterion.text()}
        for criterion in case.criteria.values()
    ]
    numbers = {"bound": f"{sign} {value:g}", "low": low, "high": high, "unit": case.bound.unit}
    runs = {"length": case.length(full), "integrators": case.integrators(full)}
    return words | numbers | runs | {"criteria": bounds}


def stress(
    cases: Mapping[str, Case],
    names: Collection[str],
    out: Path,
    full: bool,
    silence: float,
    meter: Meter,
    only: Collection[str] | None = None,
) -> dict:
    """Run what has no result yet; other processes may run other cases in the same folder.

    Args:
        cases: all cases.  names: of those to run.
        full: whether with full lengths.
        silence: s without a sign of life after which a run is given up.
        only: names of integrators; None for all that the cases name.

    Returns:
        plain data: ``cases``, each with its ``rows``; circumstances.
    """
    interrupted, circumstances = False, machine.circumstances()
    rows = Rows(cases, out, full)
    try:
        for case in rows.store.shared(names):
            for _, name in plan(cases, [case], full, only):
                meter.begin(f"{case}, {COMPARED[name].label}", 1)
                runner = Runner(cases[case], COMPARED[name], out / "runs" / case, silence, meter)
                ended = None
                for row in run_starts(runner, name, full, rows.load(case, name)):
                    rows.save(case, row)
                    ended = row["ended"] and row["ended"][1]
                meter.end(ended)
    except KeyboardInterrupt:
        interrupted = True
    return circumstances | {"interrupted": interrupted} | rows.summary()


def plan(
    cases: Mapping[str, Case], names: Iterable[str], full: bool, only: Collection[str] | None = None
) -> list[tuple[str, str]]:
    """Names (case, integrator), in the order in which they run."""
    planned = (
        (case, name) for case in names for name in cases[case].integrators(full or bool(only))
    )
    return [(case, name) for case, name in planned if not only or name in only]


def run_starts(runner: Runner, name: str, full: bool, row: dict | None = None) -> Iterator[dict]:
    """Run a case with an integrator of that name in `COMPARED`.  After each new start yield the
    row, as far as it is known, as plain data without verdict.  The runner has the folder of the
    case, and gets a folder there."""
    case, length = runner.case, runner.case.length(full)
    runner.ranks = 1 if full else 2  # with full lengths, parallel cases use the cores better
    runner.folder /= run.folder_name(name)
    runner.folder.mkdir(parents=True, exist_ok=True)
    words = ["stress", case.name, "--only", name, "--full" if full else "--short"]
    row = row or {
        "integrator": name,
        "label": runner.integrator.label,
        "kind": runner.integrator.kind,
        "numbers": [],
        "ended": None,
        "length": length,
        "inner": case.inner,
        "seconds": 0.0,
        "versions": machine.versions() | {"package": machine.package_hash()[:12]},
        "command": shlex.join([COMMAND, *words]),
    }
    while not _enough(case, row):
        runner.start, before = len(row["numbers"]), runner.seconds
        row = row | {"date": machine.now()} | _measured(runner, length, row["numbers"])
        row["seconds"] += runner.seconds - before
        yield row


def _enough(case: Case, row: dict) -> bool:
    """Whether a row needs no more starts: its verdict is significant at one of the looks."""
    count = len(row["numbers"])
    if row["ended"] or count >= case.starts:
        return True
    return count in case.looks and judge(case, row)["verdict"] != "cannot tell"


def _measured(runner: Runner, length: Any, before: list[dict]) -> dict:
    """What one more start adds to a row."""
    try:
        with np.errstate(all="ignore"):  # runs that fail overflow: the number shows it
            number = runner.case.measure(runner, length)
        if not np.isfinite(number.value):
            raise BlowUp(f"not finite; {number.note}")
        estimate = Estimate(number.value, number.error, number.freedom)
        return {"numbers": [*before, asdict(number) | estimate.plain()]}
    except BlowUp as error:
        return {"ended": ["blow-up", str(error)]}
    except CannotRun as error:
        return {"ended": ["cannot run", str(error)]}
    # the analysis of a failed trajectory raises these (in new numpys a LinAlgError is a ValueError)
    except (ValueError, IndexError, ArithmeticError, np.linalg.LinAlgError) as error:
        return {"ended": ["blow-up", f"analysis: {type(error).__name__}: {error}"]}


def judge(case: Case, row: dict) -> dict:
    """A row with its number, verdict and note, by the current bounds."""
    if row["ended"]:
        verdict, note = row["ended"]
        result = {"value": None, "error": None, "freedom": None, "note": note}
        return row | result | {"verdict": verdict}
    numbers = [Number(**plain) for plain in row["numbers"]]
    number = asdict(case.number(numbers))
    result = {key: number[key] for key in ("value", "error", "freedom", "note")}
    return row | result | {"verdict": case.verdict(numbers)}


def find_defeats(cases: Sequence[dict]) -> dict[str, list[str]]:
    """Where ours is worse than LAMMPS's fixes: names of cases by kind of failure."""
    kinds: dict[str, list[str]] = {
        "Ours breaks where a LAMMPS fix does not": [],
        "Ours does not pass what a LAMMPS fix passes": [],
    }
    breaks, behind = kinds.values()
    for case in cases:
        theirs = {row["verdict"] for row in case["rows"] if row["kind"] != "ours"}
        for row in (row for row in case["rows"] if row["integrator"] == OURS):
            if row["verdict"] in BROKEN and theirs & SURVIVED:
                breaks.append(case["name"])
            if row["verdict"] != "pass" and "pass" in theirs:
                behind.append(case["name"])
    return kinds
