"""Where integrators break: cases with a number each, run with fix_nosquish's schemes and with LAMMPS's rigid and constraint fixes.

A case is a function of a `Stand` and a length that runs LAMMPS and gives a `Number`; `stability` runs cases with integrators, row by row.  A row keeps
what was measured, from each start; it is judged against the bounds of ``criteria`` whenever it is shown.  Each row is kept in a file whose name has the hash of what it follows from: one that is there already is not
run again, those of other code or lengths stay and are not shown, and of a row that was interrupted the runs that are complete are taken over.
Several processes may run with the same output folder: one alone has a case, and what it saves has the others' rows in it.
"""

import fcntl
import functools
import hashlib
import json
import shlex
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from validation import criteria, machine, measures, run
from validation.check import Check
from validation.integrators import INTEGRATORS, SWEPT
from validation.report import save
from validation.scenes import SCENES

BROKEN = "blow-up", "cannot run"
SURVIVED = "pass", "fail", "cannot tell"
LOST = "fail", "blow-up"
_WORDS = {True: "pass", False: "fail", None: "cannot tell"}

# in the order of the table's columns
COMPARED = {
    "nosquish": INTEGRATORS["nosquish"],
    **{
        name: SWEPT[name]
        for name in (
            "matubayasi-nakahara",
            "gear",
            "rigid/nve",
            "rigid/nve/small",
            "rigid",
            "rigid/small",
        )
    },
    **{
        name: SWEPT[name.replace(" ", "-")]
        for name in ("shake 1e-4", "shake 1e-6", "shake 1e-8", "rattle 1e-4", "rattle 1e-8")
    },
}
# why a number has the error bar that it has, or none
LINE = "standard error of the mean slope of seven stretches of the run, from their scatter"
EXTREME = "none: the largest of all deviations in runs that give the same each time, of which no mean is taken"

SLOW = (
    "matubayasi-nakahara",
    "gear",
)  # the paper's other schemes, here to be compared with: not made for speed
LESS = " (reference 12 and Gear: a tenth of that)"
# files of this package that no row follows from; those criteria that rows follow from are told beside the code
SHOWN = "*report.py", "*figures.py", "overview*.py", "console.py", "__main__.py", "criteria.py"

# without those that are much like another
FEW = tuple(name for name in COMPARED if name not in ("rigid/small", "shake 1e-6", "rattle 1e-8"))


@dataclass(frozen=True)
class Number:
    """What a case measures.

    Attributes:
        value: in the case's unit.
        error: its standard error, or how finely it was looked for.
        freedom: degrees of freedom of the error; None for many.
        note: what else there is to say, as which part of the case the number is of.
        parts: of a case with several criteria, the number of each, by name; ``value`` is then the largest of them, each over its bound.
    """

    value: float
    error: float = 0.0
    note: str = ""
    freedom: float | None = None
    parts: dict | None = None


def of_parts(parts, note):
    """The `Number` of a case with several criteria, each with a bound from above.

    Args:
        parts: name of a criterion to a number in its unit.
    """
    return Number(
        _largest(parts), note=note, parts={name: float(value) for name, value in parts.items()}
    )


def _largest(parts):
    return float(max(value / criteria.CRITERIA[name].bound for name, value in parts.items()))


def the_one(numbers):
    """Of a case with one start."""
    return numbers[0]


def mean_of_starts(numbers):
    """Their mean, with the error that their scatter tells and how finely each was looked for."""
    mean = measures.of_few([one.value for one in numbers])
    error, freedom = measures.combined(mean[1:], (np.mean([one.error for one in numbers]), None))
    return Number(float(mean.value), float(error), _told(numbers), freedom)


def lowest_of_starts(numbers):
    """The lowest, with how finely it was looked for."""
    return replace(min(numbers, key=lambda one: one.value), note=_told(numbers))


def drift_of_starts(numbers):
    """|mean| of rates that may have either sign; the errors are those of the lines."""
    error, freedom = measures.combined(
        *((one.error / len(numbers), one.freedom) for one in numbers)
    )
    mean = float(np.mean([one.value for one in numbers]))
    return Number(abs(mean), error, _told(numbers), freedom)


def _told(numbers):
    notes = [one.note for one in numbers if one.note]
    return (f"{len(numbers)} starts: " if len(numbers) > 1 else "") + "; ".join(notes)


class BlowUp(Exception):
    """A run that broke: what it said, and after which step."""


class CannotRun(Exception):
    """Why an integrator is not run on a case."""


@dataclass(frozen=True)
class Case:
    """A situation that some integrator does not bear.

    Attributes:
        name: on the command line and of its folder.
        physics: what happens, in a sentence.
        criterion: the number, in words.
        bars: what the number's error is, or why there is none.
        measure: function of a `Stand` and a length, which gives a `Number`.
        short, full: lengths (what they count is the function's own).
        few: names of the integrators with ``--short``.
        tenth: names of those with a tenth of the length with ``--full``.
        starts: how many at least and at most, between which a row gets more until its verdict is sure.
        together: function of the starts' `Number`s that gives the row's.
        every: whether all starts have to hold, of which there are to be ``criteria.ENOUGH_STARTS`` to say so.
        criteria: name to ``Criterion``; by default those that name the case.
    """

    name: str
    physics: str
    criterion: str
    bars: str
    measure: Callable
    short: object
    full: object
    few: tuple[str, ...] = FEW
    tenth: tuple[str, ...] = ()
    starts: tuple[int, int] = (1, 1)
    together: Callable = the_one
    every: bool = False
    criteria: dict | None = None

    def __post_init__(self):
        if self.criteria is None:
            object.__setattr__(self, "criteria", criteria.of_case(self.name))

    @property
    def judged(self):
        """The criteria that give the verdict."""
        return [one for one in self.criteria.values() if not one.inner]

    @property
    def low(self):
        """The bound from below, or None."""
        return self._bounds[0]

    @property
    def high(self):
        """The bound from above, or None."""
        return self._bounds[1]

    @property
    def _bounds(self):
        return self.judged[0].within() if len(self.judged) == 1 else (None, 1.0)

    @property
    def unit(self):
        """Of the number; empty for a ratio."""
        return self.judged[0].unit if len(self.judged) == 1 else ""

    @property
    def bound(self):
        """The bound as text."""
        return f"≥ {self.low:g}" if self.high is None else f"≤ {self.high:g}"

    def length(self, full, integrator=None):
        """Of a full atlas or of a short one, with an integrator's name."""
        return (
            self.short if not full else self.full // 10 if integrator in self.tenth else self.full
        )

    def integrators(self, full):
        """Names of the integrators that it is run with."""
        return [name for name in COMPARED if full or name in self.few]

    def number(self, numbers):
        """The row's `Number`, of its starts'; of one with parts by the bounds of today."""
        found = self.together(numbers)
        return replace(found, value=_largest(found.parts)) if found.parts else found

    def verdict(self, numbers):
        """pass, fail, or cannot tell where the 95 % interval of the starts' number reaches over the bound, or there are too few that hold."""
        number = self.number(numbers)
        holds = Check(
            self.name,
            "",
            self.criterion,
            number.value,
            number.error,
            self.low,
            self.high,
            freedom=number.freedom,
        ).holds
        return _WORDS[
            None if holds and self.every and len(numbers) < criteria.ENOUGH_STARTS else holds
        ]


@dataclass
class Stand:
    """Where a case is run with one integrator.

    Attributes:
        case: a `Case`.  integrator: an ``Integrator``.
        folder: of this case with this integrator; the case's own files may stand in its parent.
        silence: s without a sign of life after which a run is given up.
        meter: a ``console.Meter``.
        ranks: of scenes that are worth more than one.
        start: which of the starts, from 0, of a case that has several.
    """

    case: Case
    integrator: object
    folder: Path
    silence: float
    meter: object
    ranks: int = 1
    start: int = 0
    seconds: float = field(default=0.0)

    def run(self, scene, label, runs, *, more=(), files=(), integrator=None, **how):
        """Do the runs, or take over what is there.

        Args:
            scene: a ``Scene``.  label: of the run's folder.  runs: numbers of steps, one after the other.
            more: LAMMPS commands before the first run; ``{folder}`` is the run's.
            files: what the run follows from beside the scene.
            integrator: another one than the stand's.
            how: as ``run.job`` has it.
        Returns:
            a ``run.Result`` that is complete, and its folder.
        Raises:
            CannotRun: if LAMMPS, the fix or the scene refuses before the first step.
            BlowUp: if it broke later, or its energy is not finite.
            KeyboardInterrupt: after a Ctrl-C.
        """
        result, folder = self.attempt(
            scene, label, runs, more=more, files=files, integrator=integrator, **how
        )
        if result.error:
            raise BlowUp(_broken(result))
        energy = result.thermo.get("TotEng", np.zeros(1))
        if not np.isfinite(energy).all():
            raise BlowUp(
                f"energy not finite, by step {result.thermo['Step'][np.argmin(np.isfinite(energy))]:.0f}"
            )
        return result, folder

    def attempt(self, scene, label, runs, *, more=(), files=(), integrator=None, **how):
        """As `run`, but a run that broke after its first line of output is a result like any other."""
        integrator = integrator or self.integrator
        if not integrator.can_run(scene):
            raise CannotRun(
                f"{integrator.label}: there is no cluster of bonds and angles that holds these bodies"
            )
        folder = (self.folder / run.folder_name(label)).resolve()
        job = run.job(scene, integrator, folder, runs, more=[line.format(folder=folder) for line in more],
                      **{"silence": self.silence, "positions": False, "origin": machine.origin(scene, integrator, *files), **how})  # fmt: skip
        total = sum(runs) + sum(int(line.split()[1]) for line in more if line.startswith("run "))
        result = run.once(
            job, lambda step: self.meter.at(min(1.0, step / max(1, total))), failures=True
        )
        self.seconds += sum(one["loop"] for one in result.timings)
        if result.interrupted:
            raise KeyboardInterrupt
        if result.error and "Step" not in result.thermo:
            raise (CannotRun if "ERROR" in result.error else BlowUp)(result.error)
        return result, folder


def _broken(result):
    steps = result.thermo.get("Step", np.zeros(1))
    return f"after step {steps[-1]:.0f}: {result.error}"


def stability(cases, names, out, full, silence, meter, only=None, starts=None, take=None):
    """Run what is not there yet; another process may run other cases into the same folder meanwhile.

    Args:
        cases: name to `Case`, all that there are.
        names: those to run.
        out: folder.
        full: whether with full lengths.
        silence: s without a sign of life after which a run is given up.
        meter: a ``console.Meter`` that counts rows.
        only: names of integrators; None for all that the cases name.
        starts: how many at least, of cases that have several; None for as many as each verdict needs.
        take: folder of another atlas, whose rows stand in for those that are not there; they are judged anew and not run.

    Returns:
        plain data: ``cases``, each with its ``rows``; ``summary``, what is told of all; ``interrupted``; circumstances.
    """
    summary = machine.circumstances() | {"interrupted": False, "full": full, "cases": []}
    taken = _taken(take, cases, full) if take else {}
    try:
        for name in _in_turn(names, out):
            for _, integrator in plan(cases, [name], full, only):
                file = _file(out, cases[name], integrator, full)
                meter.begin(f"{name}, {COMPARED[integrator].label}", 1)
                ended = None
                if file.exists() or (name, integrator) not in taken:
                    for row in _rows(
                        cases[name],
                        integrator,
                        file,
                        out / "runs" / name,
                        full,
                        silence,
                        meter,
                        starts,
                    ):
                        _save(summary, cases, out, taken, file, row)
                        ended = row["ended"] and row["ended"][1]
                meter.end(ended)
    except KeyboardInterrupt:
        summary["interrupted"] = True
    _save(summary, cases, out, taken)
    return summary


def _taken(folder, cases, full):
    """Rows of another atlas's summary, by case and integrator, without those of other lengths or inner bounds."""
    rows = {
        (case["name"], row["integrator"]): row
        for case in json.loads((folder / "summary.json").read_text())["cases"]
        for row in case["rows"]
    }
    return {(name, one): row for (name, one), row in rows.items()
            if name in cases and row["inner"] == _inner(cases[name]) and row["length"] == _plain(cases[name].length(full, one))}  # fmt: skip


def _plain(length):
    return list(length) if isinstance(length, tuple) else length


def _in_turn(names, out):
    """The names, each while no other process has its case: those that are another's are waited for when all others are done."""
    busy = []
    for some, how in (names, fcntl.LOCK_EX | fcntl.LOCK_NB), (busy, fcntl.LOCK_EX):
        for name in some:
            folder = out / "runs" / name
            folder.mkdir(parents=True, exist_ok=True)
            with open(folder / "lock", "w") as lock:
                try:
                    fcntl.flock(lock, how)
                except BlockingIOError:
                    busy.append(name)
                    continue
                yield name


def plan(cases, names, full, only=None):
    """(case, integrator), names, in the order in which they run."""
    return [
        (name, one)
        for name in names
        for one in COMPARED
        if one in (only or cases[name].integrators(full))
    ]


def _rows(case, name, file, folder, full, silence, meter, starts):
    """Run a case with an integrator; yields its row, as plain data without verdict, after each start that it did not have yet."""
    integrator = COMPARED[name]
    ranks = 1 if full else 2  # in full, cases side by side make the better use of cores
    stand = Stand(case, integrator, folder / run.folder_name(name), silence, meter, ranks)
    stand.folder.mkdir(parents=True, exist_ok=True)
    row = json.loads(file.read_text()) if file.exists() else {
        "integrator": name, "label": integrator.label, "kind": integrator.kind, "numbers": [], "ended": None,
        "length": case.length(full, name), "inner": _inner(case), "seconds": 0.0,
        "versions": machine.versions() | {"package": machine.package_hash()[:12]},
        "command": shlex.join(["python", "-m", "validation", "stability", case.name, "--only", name, "--full" if full else "--short"]),
    }  # fmt: skip
    while not _enough(case, row, starts):
        stand.start, before = len(row["numbers"]), stand.seconds
        row = (
            row
            | {"date": machine.now()}
            | _measured(stand, case.length(full, name), row["numbers"])
        )
        row["seconds"] += stand.seconds - before
        yield row


def _enough(case, row, starts=None):
    """Whether a row needs no more starts: what is asked for, or a verdict that is sure when its number of starts is the least one, doubled again and
    again."""
    count, (least, most) = len(row["numbers"]), case.starts
    if row["ended"] or count >= most:
        return True
    if starts:
        return count >= max(least, starts)
    doubled = (
        count >= least and count % least == 0 and (count // least).bit_count() == 1
    )  # few looks: each is a chance to be sure by chance
    return doubled and verdict(case, row) != "cannot tell"


def _measured(stand, length, before):
    """What one start more adds to a row."""
    try:
        with np.errstate(all="ignore"):  # what breaks, overflows: the number tells
            number = stand.case.measure(stand, length)
        if not np.isfinite(number.value):
            raise BlowUp(f"not finite; {number.note}")
        plain = asdict(number) | {
            "value": float(number.value),
            "error": float(number.error),
            "freedom": number.freedom and float(number.freedom),
        }
        return {"numbers": [*before, plain]}
    except BlowUp as found:
        return {"ended": ["blow-up", str(found)]}
    except CannotRun as found:
        return {"ended": ["cannot run", str(found)]}
    except (
        ValueError,
        IndexError,
        ArithmeticError,
    ) as found:  # what a broken trajectory does to its analysis (LinAlgError is a ValueError)
        return {"ended": ["blow-up", f"analysis: {type(found).__name__}: {found}"]}


def verdict(case, row):
    """A row's verdict, by the bounds of today."""
    return (
        row["ended"][0] if row["ended"] else case.verdict([Number(**one) for one in row["numbers"]])
    )


def judged(case, row):
    """A row with its number, verdict and note, by the bounds of today."""
    number = None if row["ended"] else case.number([Number(**one) for one in row["numbers"]])
    note = row["ended"][1] if row["ended"] else number.note
    found = {key: number and getattr(number, key) for key in ("value", "error", "freedom")}
    return row | found | {"verdict": verdict(case, row), "note": note}


def _inner(case):
    """Bounds that what is measured follows from."""
    return {key: one.bound for key, one in case.criteria.items() if one.inner} | {
        "rounding": criteria.rounding(1)
    }


def _file(out, case, name, full):
    """Where the row of a case with an integrator is kept: the name has the hash of what it follows from, code, length and inner bounds."""
    origin = hashlib.sha256(
        json.dumps([_code(), repr(case.length(full, name)), _inner(case)]).encode()
    ).hexdigest()
    return out / "rows" / case.name / f"{run.folder_name(name)}-{origin[:16]}.json"


@functools.cache
def _code():
    """Hash of versions, the package, this one without what only shows, and the scenes' files, as they are when first asked for: what is edited later
    does not run in this process."""
    found = hashlib.sha256(json.dumps([machine.versions(), machine.package_hash()]).encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        if not any(path.match(pattern) for pattern in SHOWN):
            found.update(path.read_bytes())
    for scene in SCENES.values():
        found.update(machine.contents(scene.folder).encode())
    return found.hexdigest()


def _save(summary, cases, out, taken, file=None, row=None):
    """Keep a row, if one is given, and write the summary of all that there are, other processes' too."""
    with open(out / "summary.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if row:
            file.parent.mkdir(parents=True, exist_ok=True)
            part = file.with_suffix(".part")
            part.write_text(json.dumps(row, indent=1, ensure_ascii=False) + "\n")
            part.replace(file)
        files = {
            (case.name, name): _file(out, case, name, summary["full"])
            for case in cases.values()
            for name in COMPARED
        }
        rows = taken | {
            key: json.loads(path.read_text()) for key, path in files.items() if path.exists()
        }
        rows = {
            (name, key): row
            for (name, key), row in rows.items()
            if row["ended"] or len(row["numbers"]) >= cases[name].starts[0]
        }
        _fill(summary, cases, rows)
        save(summary, out)


def _fill(summary, cases, rows):
    """Put the rows into the summary, and what they say."""
    summary["cases"] = [
        {
            "name": case.name, "physics": case.physics, "criterion": case.criterion, "bound": case.bound, "low": case.low, "high": case.high,
            "unit": case.unit, "bars": case.bars, "length": case.length(summary["full"]), "integrators": case.integrators(summary["full"]),
            "criteria": [{"quantity": one.quantity, "text": one.text()} for one in case.criteria.values()],
            "rows": [judged(case, rows[case.name, name]) for name in COMPARED if (case.name, name) in rows],
        }
        for case in cases.values() if any((case.name, name) in rows for name in COMPARED)
    ]  # fmt: skip
    summary["summary"] = told(summary["cases"])
    named = [case["name"] for case in summary["cases"]]
    summary["command"] = shlex.join(["python", "-m", "validation", "stability", *(named if len(named) < len(cases) else []),
                                     "--full" if summary["full"] else "--short"])  # fmt: skip


def told(cases):
    """What all rows together say: dictionaries of ``what``, ``holds`` (None: cannot tell, as ours has not run) and ``where``, names of cases.

    Args:
        cases: plain data, each with ``rows`` and ``integrators``, the names of those that it is to be run with.
    """
    verdicts = {
        case["name"]: {row["integrator"]: row["verdict"] for row in case["rows"]} for case in cases
    }
    theirs = {
        case["name"]: [
            row["verdict"] for row in case["rows"] if row["kind"] in ("rigid", "constraints")
        ]
        for case in cases
    }
    ours = {name: found["nosquish"] for name, found in verdicts.items() if "nosquish" in found}
    unknown = [name for name in verdicts if name not in ours]
    worse = [
        name
        for name, verdict in ours.items()
        if verdict in BROKEN and any(one in SURVIVED for one in theirs[name])
    ]
    behind = [
        name for name, verdict in ours.items() if verdict != "pass" and "pass" in theirs[name]
    ]
    lost = {case["name"]: {name for name, verdict in verdicts[case["name"]].items() if verdict in LOST}
            for case in cases if set(case["integrators"]) <= set(verdicts[case["name"]])}  # fmt: skip
    blunt = [name for name, by in lost.items() if not by]
    old = [name for name, by in lost.items() if by == {"gear"}]
    return [
        {
            "what": "Ours has no blow-up that any LAMMPS fix survives",
            "holds": not worse and (None if unknown else True),
            "where": worse or unknown,
        },
        {
            "what": "Ours passes what any LAMMPS fix passes",
            "holds": not behind and (None if unknown else True),
            "where": behind or unknown,
        },
        {
            "what": "Each case has an integrator that fails or breaks",
            "holds": not blunt,
            "where": blunt,
        },
        {
            "what": "Each case has one that fails or breaks beside Gear",
            "holds": not blunt + old,
            "where": blunt + old,
        },
    ]
