"""Where integrators break: cases with a number each, run with fix_nosquish's schemes and with
LAMMPS's rigid and constraint fixes.

A case is a function of a `Stand` and a length that runs LAMMPS and gives a `Number`; `stability`
runs cases with integrators, row by row.  A row keeps what was measured, from each start; it is
judged against the bounds of ``criteria`` whenever it is shown.  Several processes may run with the
same output folder: one alone has a case, and what it saves has the others' rows in it.
"""

import json
import shlex
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import NAME
from ..running import machine, run, store, whole
from ..running.run import Meter, Result
from ..scenes import SCENES, Scene
from ..scenes.integrators import INTEGRATORS, SWEPT, Integrator
from ..statistics import measures
from ..statistics.check import Check
from ..statistics.estimate import CONFIDENCE, Estimate, margin
from . import criteria
from .criteria import Criterion

BROKEN = {"blow-up", "cannot run"}
SURVIVED = {"pass", "fail", "cannot tell"}
LOST = {"fail", "blow-up"}
_WORDS = {True: "pass", False: "fail", None: "cannot tell"}

# in the order of the table's columns
# the paper's other schemes, here to be compared with: not made for speed
SLOW = ("matubayasi-nakahara", "gear")
_RIGID = "rigid/nve", "rigid/nve/small", "rigid", "rigid/small"
_HELD = "shake 1e-4", "shake 1e-6", "shake 1e-8", "rattle 1e-4", "rattle 1e-8"
COMPARED = {"nosquish": INTEGRATORS["nosquish"]}
COMPARED |= {name: SWEPT[name.replace(" ", "-")] for name in (*SLOW, *_RIGID, *_HELD)}
# without those that are much like another
FEW = tuple(name for name in COMPARED if name not in ("rigid/small", "shake 1e-6", "rattle 1e-8"))
LESS = " (reference 12 and Gear: a tenth of that)"
# why a number has the error bar that it has, or none
LINE = "standard error of the mean slope of seven stretches of the run, from their scatter"
EXTREME = (
    "none: the largest of all deviations in runs that give the same each time, of which no mean is "
    "taken"
)


@dataclass(frozen=True)
class Number:
    """What a case measures."""

    value: float  # in the case's unit
    error: float = 0.0  # its standard error, or how finely it was looked for
    note: str = ""  # what else there is to say, as which part of the case the number is of
    freedom: float | None = None  # degrees of freedom of the error; None for many
    # of a case with several criteria, the number of each, by name; ``value`` is then the largest of
    # them, each over its bound
    parts: dict[str, float] | None = None

    @classmethod
    def of(cls, estimate: Estimate, note: str = "") -> "Number":
        """An estimate with a note."""
        return cls(float(estimate.value), float(estimate.error), note, estimate.freedom)


def of_parts(parts: Mapping[str, float], note: str) -> Number:
    """The `Number` of a case with several criteria, each with a bound from above, by name."""
    parts = {name: float(value) for name, value in parts.items()}
    return Number(_largest(parts), note=note, parts=parts)


def _largest(parts):
    return float(max(value / criteria.CRITERIA[name].bound for name, value in parts.items()))


def the_one(numbers: Sequence[Number]) -> Number:
    """Of a case with one start."""
    return numbers[0]


def mean_of_starts(numbers: Sequence[Number]) -> Number:
    """Their mean, with the error that their scatter tells and how finely each was looked for."""
    mean = measures.of_few([one.value for one in numbers])
    looked = float(np.mean([one.error for one in numbers])), None
    return Number.of(Estimate(mean.value, *measures.combined(mean[1:], looked)), _told(numbers))


def lowest_of_starts(numbers: Sequence[Number]) -> Number:
    """The lowest, with how finely it was looked for."""
    return replace(min(numbers, key=lambda one: one.value), note=_told(numbers))


def drift_of_starts(numbers: Sequence[Number]) -> Number:
    """|mean| of rates that may have either sign; the errors are those of the lines."""
    error = measures.combined(*((one.error / len(numbers), one.freedom) for one in numbers))
    mean = abs(np.mean([one.value for one in numbers]))
    return Number.of(Estimate(mean, *error), _told(numbers))


def _told(numbers):
    notes = [one.note for one in numbers if one.note]
    return (f"{len(numbers)} starts: " if len(numbers) > 1 else "") + "; ".join(notes)


class BlowUp(Exception):
    """A run that broke: what it said, and after which step."""


class CannotRun(Exception):
    """Why an integrator is not run on a case."""


@dataclass(frozen=True)
class Case:
    """A situation that some integrator does not bear."""

    name: str  # on the command line and of its folder
    physics: str  # what happens, in a sentence
    criterion: str  # the number, in words
    bars: str  # what the number's error is, or why there is none
    measure: Callable[["Stand", Any], Number]
    short: Any  # lengths; what they count is the function's own
    full: Any
    few: tuple[str, ...] = FEW  # names of the integrators with --short
    tenth: tuple[str, ...] = ()  # names of those with a tenth of the length with --full
    # how many at least and at most, between which a row gets more until its verdict is sure
    starts: tuple[int, int] = (1, 1)
    together: Callable[[Sequence[Number]], Number] = the_one  # of the starts, the row's
    # whether all starts have to hold, of which there are to be `ENOUGH_STARTS` to say so
    every: bool = False
    bounds: dict[str, Criterion] | None = None  # by name, other than those that name the case

    @classmethod
    def of(cls, name: str, physics: str, short: Any, full: Any, **more) -> Callable:
        """A decorator that makes a case of its measure."""
        return lambda measure: cls(name, physics, measure=measure, short=short, full=full, **more)

    @property
    def criteria(self) -> dict[str, Criterion]:
        """All that bound its numbers, by name."""
        return criteria.of_case(self.name) if self.bounds is None else self.bounds

    @property
    def judged(self) -> list[Criterion]:
        """The criteria that give the verdict."""
        return [one for one in self.criteria.values() if not one.inner]

    @property
    def _bound(self):
        """Of the number: its criterion's, or that each part is below its own."""
        return self.judged[0] if len(self.judged) == 1 else criteria.EACH

    @property
    def inner(self) -> dict[str, float]:
        """Bounds that what is measured follows from."""
        found = {key: one.bound for key, one in self.criteria.items() if one.inner}
        return found | {"rounding": criteria.rounding(1)}

    @property
    def low(self) -> float | None:
        """The bound from below, or None."""
        return self._bound.within()[0]

    @property
    def high(self) -> float | None:
        """The bound from above, or None."""
        return self._bound.within()[1]

    @property
    def unit(self) -> str:
        """Of the number; empty for a ratio."""
        return self._bound.unit

    @property
    def bound(self) -> str:
        """The bound as text."""
        return f"≥ {self.low:g}" if self.high is None else f"≤ {self.high:g}"

    def length(self, full: bool, integrator: str | None = None) -> Any:
        """Of a full atlas or of a short one, with an integrator's name."""
        if not full:
            return self.short
        return self.full // 10 if integrator in self.tenth else self.full

    def integrators(self, full: bool) -> list[str]:
        """Names of the integrators that it is run with."""
        return [name for name in COMPARED if full or name in self.few]

    def number(self, numbers: Sequence[Number]) -> Number:
        """The row's `Number`, of its starts'; of one with parts by the bounds of today."""
        found = self.together(numbers)
        return replace(found, value=_largest(found.parts)) if found.parts else found

    @property
    def looks(self) -> list[int]:
        """Numbers of starts at which a row may have enough: the least, doubled again and again, and
        the most."""
        least, most = self.starts
        doubled = (least * 2**k for k in range(most.bit_length()))
        return [*(number for number in doubled if number < most), most]

    def verdict(self, numbers: Sequence[Number]) -> str:
        """pass, fail, or cannot tell where the interval of the starts' number reaches over the
        bound, or there are too few that hold.  Each of the `looks` is a chance to be sure by
        chance: so intervals are wider, of 95 % for all looks together."""
        one = self.number(numbers)
        confidence = 1 - (1 - CONFIDENCE) / len(self.looks)
        wider = margin(1.0, one.freedom, confidence) / margin(1.0, one.freedom)
        number = one.value, one.error * wider, *self._bound.within()
        holds = Check(self.name, "", self.criterion, *number, freedom=one.freedom).holds
        few = self.every and len(numbers) < criteria.ENOUGH_STARTS
        return _WORDS[None if holds and few else holds]


@dataclass
class Stand:
    """Where a case is run with one integrator."""

    case: Case
    integrator: Integrator
    folder: Path  # of this case with this integrator; the case's own files may stand in its parent
    silence: float  # s without a sign of life after which a run is given up
    meter: Meter
    ranks: int = 1  # of scenes that are worth more than one
    start: int = 0  # which of the starts, from 0, of a case that has several
    seconds: float = field(default=0.0)  # that steps have taken

    def run(self, scene: Scene, label: str, runs: list[int], **how) -> tuple[Result, Path]:
        """As `attempt`, but a `BlowUp`, too, if it broke later or its energy is not finite."""
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
        """Do the runs, or take over what is there.

        Args:
            label: of the run's folder.
            more: LAMMPS commands before the first run; ``{folder}`` is the run's.
            files: what the run follows from beside the scene.
            by: another integrator than the stand's.
            how: as ``run.job`` has it.

        Returns:
            the result, which may have broken after its first line of output, and its folder.

        Raises:
            CannotRun, BlowUp: if it is refused, or broke, before the first step.
            KeyboardInterrupt: after a Ctrl-C.
        """
        integrator = by or self.integrator
        if not integrator.can_run(scene):
            why = "there is no cluster of bonds and angles that holds these bodies"
            raise CannotRun(f"{integrator.label}: {why}")
        folder = (self.folder / run.folder_name(label)).resolve()
        more = [line.format(folder=folder) for line in more]
        origin = machine.origin(scene, integrator, *files)
        how = {"silence": self.silence, "keeps": "nothing", "origin": origin, "more": more, **how}
        job = run.job(scene, integrator, folder, runs, **how)
        total = sum(runs) + sum(int(line.split()[1]) for line in more if line.startswith("run "))

        def at(step):
            self.meter.at(min(1.0, step / max(1, total)))

        result = run.once(job, at, failures=True)
        self.seconds += sum(one.seconds for one in result.timings)
        if result.interrupted:
            raise KeyboardInterrupt
        if result.error and "Step" not in result.thermo:
            raise (CannotRun if "ERROR" in result.error else BlowUp)(result.error)
        return result, folder


class Rows:
    """All rows of an output folder, by names of case and integrator; rows of another atlas in the
    folder ``take`` stand in for those that are not there."""

    def __init__(
        self, cases: Mapping[str, Case], out: Path, full: bool, take: Path | None = None
    ) -> None:
        self.cases, self.out, self.full = cases, out, full
        self.store = store.Store(out / "rows", "stability.cases")
        self.scenes = [machine.contents(scene.folder) for scene in SCENES.values()]
        self.taken = self._of(take) if take else {}

    def _of(self, folder):
        """Rows of another atlas's summary, without those of other lengths or inner bounds."""
        found, summary = {}, whole.read(folder / "summary.json")
        if summary is None:
            raise SystemExit(f"{folder} has no summary.json of the verb stability")
        for told in summary["cases"]:
            if (case := self.cases.get(told["name"])) is None:
                continue
            for row in told["rows"]:
                length = json.loads(json.dumps(case.length(self.full, row["integrator"])))
                if row["inner"] == case.inner and row["length"] == length:
                    found[case.name, row["integrator"]] = row
        return found

    def place(self, case: str, integrator: str) -> tuple[str, str]:
        """A row's name in the store and its origin: code, length and inner bounds."""
        found = self.cases[case]
        settings = found.length(self.full, integrator), found.inner, self.scenes
        return f"{case}/{run.folder_name(integrator)}", self.store.origin(*settings)

    def kept(self, case: str, integrator: str) -> dict | None:
        """The row that is in this folder, or None."""
        found = self.store.kept(*self.place(case, integrator))
        return found and found["record"]

    def all(self) -> dict[tuple[str, str], dict]:
        """Those that are here or stand in, and have the least number of starts."""
        both = ((case, name) for case in self.cases for name in COMPARED)
        rows = {key: self.kept(*key) or self.taken.get(key) for key in both}
        return {
            (case, name): row
            for (case, name), row in rows.items()
            if row and (row["ended"] or len(row["numbers"]) >= self.cases[case].starts[0])
        }

    def save(self, summary: dict, row: dict | None = None, case: str = "") -> None:
        """Keep a row, if one is given, and write the summary of all that there are, other
        processes' too."""
        with self.store.locked("summary"):
            if row:
                place = self.place(case, row["integrator"])
                self.store.keep(*place, row, _enough(self.cases[case], row))
            _fill(summary, self.cases, self.all())
            whole.write(self.out / "summary.json", summary)


def stability(
    cases: Mapping[str, Case],
    names: Collection[str],
    out: Path,
    full: bool,
    silence: float,
    meter: Meter,
    only: Collection[str] | None = None,
    starts: int | None = None,
    take: Path | None = None,
) -> dict:
    """Run what is not there yet; another process may run other cases into the same folder
    meanwhile.

    Args:
        cases: all that there are.  names: of those to run.
        full: whether with full lengths.
        silence: s without a sign of life after which a run is given up.
        only: names of integrators; None for all that the cases name.
        starts: how many at least, of cases that have several; None for as many as each needs.
        take: see `Rows`; what is taken is judged anew and not run.

    Returns:
        plain data: ``cases``, each with its ``rows``; ``summary``, see `told`; circumstances.
    """
    summary = machine.circumstances() | {"interrupted": False, "full": full, "cases": []}
    rows = Rows(cases, out, full, take)
    try:
        for case in rows.store.shared(names):
            for _, name in plan(cases, [case], full, only):
                meter.begin(f"{case}, {COMPARED[name].label}", 1)
                known, ended = rows.kept(case, name), None
                if known or (case, name) not in rows.taken:
                    stand = Stand(cases[case], COMPARED[name], out / "runs" / case, silence, meter)
                    for row in grown(stand, name, full, known, starts):
                        rows.save(summary, row, case)
                        ended = row["ended"] and row["ended"][1]
                meter.end(ended)
    except KeyboardInterrupt:
        summary["interrupted"] = True
    rows.save(summary)
    return summary


def plan(
    cases: Mapping[str, Case], names: Iterable[str], full: bool, only: Collection[str] | None = None
) -> list[tuple[str, str]]:
    """(case, integrator), names, in the order in which they run."""
    wanted = {name: only or cases[name].integrators(full) for name in names}
    return [(name, one) for name, those in wanted.items() for one in COMPARED if one in those]


def grown(
    stand: Stand, name: str, full: bool, row: dict | None = None, starts: int | None = None
) -> Iterator[dict]:
    """Run a case with an integrator, of that name in `COMPARED`; its row, as far as it is known, as
    plain data without verdict, after each start that it did not have yet.  The stand is in the
    case's folder, and gets one there."""
    case, length = stand.case, stand.case.length(full, name)
    stand.ranks = 1 if full else 2  # in full, cases side by side make the better use of cores
    stand.folder /= run.folder_name(name)
    stand.folder.mkdir(parents=True, exist_ok=True)
    words = ["stability", case.name, "--only", name, "--full" if full else "--short"]
    row = row or {
        "integrator": name,
        "label": stand.integrator.label,
        "kind": stand.integrator.kind,
        "numbers": [],
        "ended": None,
        "length": length,
        "inner": case.inner,
        "seconds": 0.0,
        "versions": machine.versions() | {"package": machine.package_hash()[:12]},
        "command": shlex.join(["python", "-m", NAME, *words]),
    }
    while not _enough(case, row, starts):
        stand.start, before = len(row["numbers"]), stand.seconds
        row = row | {"date": machine.now()} | _measured(stand, length, row["numbers"])
        row["seconds"] += stand.seconds - before
        yield row


def _enough(case, row, starts=None):
    """Whether a row needs no more starts: what is asked for, or at one of the looks a verdict that
    is sure."""
    count, (least, most) = len(row["numbers"]), case.starts
    if row["ended"] or count >= most:
        return True
    if starts:
        return count >= max(least, starts)
    return count in case.looks and verdict(case, row) != "cannot tell"


def _measured(stand, length, before):
    """What one start more adds to a row."""
    try:
        with np.errstate(all="ignore"):  # what breaks, overflows: the number tells
            number = stand.case.measure(stand, length)
        if not np.isfinite(number.value):
            raise BlowUp(f"not finite; {number.note}")
        estimate = Estimate(number.value, number.error, number.freedom)
        return {"numbers": [*before, asdict(number) | estimate.plain()]}
    except BlowUp as found:
        return {"ended": ["blow-up", str(found)]}
    except CannotRun as found:
        return {"ended": ["cannot run", str(found)]}
    # what a broken trajectory does to its analysis (LinAlgError is a ValueError)
    except (ValueError, IndexError, ArithmeticError) as found:
        return {"ended": ["blow-up", f"analysis: {type(found).__name__}: {found}"]}


def _numbers(row):
    return [Number(**one) for one in row["numbers"]]


def verdict(case: Case, row: dict) -> str:
    """A row's verdict, by the bounds of today."""
    return row["ended"][0] if row["ended"] else case.verdict(_numbers(row))


def judged(case: Case, row: dict) -> dict:
    """A row with its number, verdict and note, by the bounds of today."""
    number = None if row["ended"] else case.number(_numbers(row))
    note = number.note if number else row["ended"][1]
    found = {key: number and getattr(number, key) for key in ("value", "error", "freedom")}
    return row | found | {"verdict": verdict(case, row), "note": note}


def _fill(summary, cases, rows):
    """Put the rows into the summary, and what they say."""
    full, summary["cases"] = summary["full"], []
    for case in cases.values():
        mine = [judged(case, rows[case.name, one]) for one in COMPARED if (case.name, one) in rows]
        if not mine:
            continue
        shown = ("name", "physics", "criterion", "bound", "low", "high", "unit", "bars")
        found = {key: getattr(case, key) for key in shown}
        found |= {"length": case.length(full), "integrators": case.integrators(full)}
        bounds = [{"quantity": one.quantity, "text": one.text()} for one in case.criteria.values()]
        summary["cases"].append(found | {"criteria": bounds, "rows": mine})
    summary["summary"] = told(summary["cases"])
    named = [case["name"] for case in summary["cases"]]
    words = [*(named if len(named) < len(cases) else []), "--full" if full else "--short"]
    summary["command"] = shlex.join(["python", "-m", NAME, "stability", *words])


def told(cases: Sequence[dict]) -> list[dict]:
    """What all rows together say: dictionaries of ``what``, ``holds`` (None: cannot tell, as ours
    has not run) and ``where``, names of cases; of these, plain data, count ``rows`` and
    ``integrators``, the names of those that each is to be run with."""
    found, ours, theirs, lost = {}, {}, {}, {}
    for case in cases:
        name, rows = case["name"], case["rows"]
        found[name] = {row["integrator"]: row["verdict"] for row in rows}
        kinds = ("rigid", "constraints")
        theirs[name] = {row["verdict"] for row in rows if row["kind"] in kinds}
        if "nosquish" in found[name]:
            ours[name] = found[name]["nosquish"]
        if set(case["integrators"]) <= set(found[name]):
            lost[name] = {one for one, verdict in found[name].items() if verdict in LOST}

    def line(what, where, unknown=()):
        holds = not where and (None if unknown else True)
        return {"what": what, "holds": holds, "where": where or list(unknown)}

    unknown = [name for name in found if name not in ours]
    worse = [name for name, one in ours.items() if one in BROKEN and theirs[name] & SURVIVED]
    behind = [name for name, one in ours.items() if one != "pass" and "pass" in theirs[name]]
    blunt = [name for name, by in lost.items() if not by]
    old = [name for name, by in lost.items() if by == {"gear"}]
    return [
        line("Ours has no blow-up that any LAMMPS fix survives", worse, unknown),
        line("Ours passes what any LAMMPS fix passes", behind, unknown),
        line("Each case has an integrator that fails or breaks", blunt),
        line("Each case has one that fails or breaks beside Gear", blunt + old),
    ]
