"""Where integrators break: cases with a number each, run with fix_nosquish's schemes and with LAMMPS's rigid and constraint fixes.

A case is a function of a `Stand` and a length that runs LAMMPS and gives a `Number`; `stability` runs cases with integrators, row by row, and judges
each number against the case's bound.  Rows are kept in the output folder's summary.json: one that is there already is not run again unless the
code has changed, and of one that was interrupted the runs that are complete are taken over.  Cases may run side by side, each in a process of its
own with the same output folder: what a process saves has the others' rows in it.
"""

import fcntl
import functools
import hashlib
import json
import shlex
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from validation import machine, run
from validation.check import Check
from validation.integrators import INTEGRATORS, SWEPT
from validation.report import save

BROKEN = "blow-up", "cannot run"
SURVIVED = "pass", "fail", "cannot tell"
_WORDS = {True: "pass", False: "fail", None: "cannot tell"}

# in the order of the table's columns
COMPARED = {
    "nosquish": INTEGRATORS["nosquish"],
    **{name: SWEPT[name] for name in ("matubayasi-nakahara", "gear", "rigid/nve", "rigid/nve/small", "rigid", "rigid/small")},
    **{name: SWEPT[name.replace(" ", "-")] for name in ("shake 1e-4", "shake 1e-6", "shake 1e-8", "rattle 1e-4", "rattle 1e-8")},
}
# why a number has the error bar that it has, or none
LINE = "standard error of the line's slope, from the scatter of blocks of samples about it"
EXTREME = "none: the largest of all deviations in runs that give the same each time, of which no mean is taken"

# without those that are much like another
FEW = tuple(name for name in COMPARED if name not in ("rigid/small", "shake 1e-6", "rattle 1e-8"))


@dataclass(frozen=True)
class Number:
    """What a case measures.

    Attributes:
        value: in the case's unit.
        error: its standard error, or how finely it was looked for.
        note: what else there is to say, as which part of the case the number is of.
    """

    value: float
    error: float = 0.0
    note: str = ""


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
        unit: of the number; empty for a ratio.
        why: where the bound comes from.
        bars: what the number's error is, or why there is none.
        measure: function of a `Stand` and a length, which gives a `Number`.
        short, full: lengths (what they count is the function's own).
        low, high: bounds of the number; None for none.
        few: names of the integrators with ``--short``.
    """

    name: str
    physics: str
    criterion: str
    unit: str
    why: str
    bars: str
    measure: Callable
    short: object
    full: object
    low: float | None = None
    high: float | None = None
    few: tuple[str, ...] = FEW

    @property
    def bound(self):
        """The bound as text."""
        return f"≥ {self.low:g}" if self.high is None else f"≤ {self.high:g}"

    def length(self, full):
        """Of a full atlas or of a short one."""
        return self.full if full else self.short

    def integrators(self, full):
        """Names of the integrators that it is run with."""
        return [name for name in COMPARED if full or name in self.few]

    def verdict(self, number):
        """pass, fail, or cannot tell where the number's error reaches over the bound."""
        return _WORDS[Check(self.name, "", self.criterion, number.value, number.error, self.low, self.high).holds]


@dataclass
class Stand:
    """Where a case is run with one integrator.

    Attributes:
        case: a `Case`.  integrator: an ``Integrator``.
        folder: of this case with this integrator; the case's own files may stand in its parent.
        silence: s without a sign of life after which a run is given up.
        meter: a ``console.Meter``.
    """

    case: Case
    integrator: object
    folder: Path
    silence: float
    meter: object
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
        result, folder = self.attempt(scene, label, runs, more=more, files=files, integrator=integrator, **how)
        if result.error:
            raise BlowUp(_broken(result))
        energy = result.thermo.get("TotEng", np.zeros(1))
        if not np.isfinite(energy).all():
            raise BlowUp(f"energy not finite, by step {result.thermo['Step'][np.argmin(np.isfinite(energy))]:.0f}")
        return result, folder

    def attempt(self, scene, label, runs, *, more=(), files=(), integrator=None, **how):
        """As `run`, but a run that broke after its first line of output is a result like any other."""
        integrator = integrator or self.integrator
        if not integrator.can_run(scene):
            raise CannotRun(f"{integrator.label}: there is no cluster of bonds and angles that holds these bodies")
        folder = (self.folder / run.folder_name(label)).resolve()
        job = run.job(scene, integrator, folder, runs, more=[line.format(folder=folder) for line in more],
                      **{"silence": self.silence, "positions": False, "origin": machine.origin(scene, integrator, *files), **how})  # fmt: skip
        result = run.once(job, lambda step: self.meter.at(min(1.0, step / max(1, sum(runs)))))
        self.seconds += sum(one["loop"] for one in result.timings)
        if result.interrupted:
            raise KeyboardInterrupt
        if result.error and "Step" not in result.thermo:
            raise (CannotRun if "ERROR" in result.error else BlowUp)(result.error)
        return result, folder


def _broken(result):
    steps = result.thermo.get("Step", np.zeros(1))
    return f"after step {steps[-1]:.0f}: {result.error}"


def stability(cases, names, out, full, silence, meter, only=None):
    """Run what is not there yet; another process may run other cases into the same folder meanwhile.

    Args:
        cases: name to `Case`, all that there are.
        names: those to run.
        out: folder.
        full: whether with full lengths.
        silence: s without a sign of life after which a run is given up.
        meter: a ``console.Meter`` that counts rows.
        only: names of integrators; None for all that the cases name.

    Returns:
        plain data: ``cases``, each with its ``rows``; ``summary``, what is told of all; ``interrupted``; circumstances.
    """
    summary = machine.circumstances() | {"interrupted": False, "full": full, "cases": []}
    rows = _known(cases, out, full)
    try:
        for name, integrator in plan(cases, names, full, only):
            case = cases[name]
            if (name, integrator) not in rows:
                rows[name, integrator] = _row(case, integrator, out / "runs" / name, full, silence, meter)
                _save(summary, cases, rows, out)
            else:
                meter.begin(f"{name}, {COMPARED[integrator].label}", 1)
                meter.end(None)
    except KeyboardInterrupt:
        summary["interrupted"] = True
    _save(summary, cases, rows, out)
    return summary


def plan(cases, names, full, only=None):
    """(case, integrator), names, in the order in which they run."""
    return [(name, one) for name in names for one in COMPARED if one in (only or cases[name].integrators(full))]


def _row(case, name, folder, full, silence, meter):
    """Run a case with an integrator: its row, as plain data."""
    integrator = COMPARED[name]
    stand = Stand(case, integrator, folder / run.folder_name(name), silence, meter)
    stand.folder.mkdir(parents=True, exist_ok=True)
    meter.begin(f"{case.name}, {integrator.label}", 1)
    number = None
    try:
        with np.errstate(all="ignore"):  # what breaks, overflows: the number tells
            number = case.measure(stand, case.length(full))
        if not np.isfinite(number.value):
            raise BlowUp(f"not finite; {number.note}")
        verdict, note = case.verdict(number), number.note
    except BlowUp as found:
        verdict, note, number = "blow-up", str(found), None
    except CannotRun as found:
        verdict, note = "cannot run", str(found)
    meter.end(note if verdict in BROKEN else None)
    return {
        "integrator": name, "label": integrator.label, "kind": integrator.kind,
        "value": number and float(number.value), "error": number and float(number.error),
        "verdict": verdict, "note": note, "seconds": stand.seconds,
        "command": shlex.join(["python", "-m", "validation", "stability", case.name, "--only", name, "--full" if full else "--short"]),
        "origin": _origin(case, full),
    }  # fmt: skip


def _origin(case, full):
    """Hash of what a case's rows follow from: code and length."""
    return hashlib.sha256(json.dumps([_code(), repr(case.length(full))]).encode()).hexdigest()


@functools.cache
def _code():
    """Hash of versions, the package and this verb's code, as they are when first asked for: what is edited later does not run in this process."""
    found = hashlib.sha256(json.dumps([machine.versions(), machine.package_hash()]).encode())
    for path in sorted(Path(__file__).parent.glob("stability*.py")):
        if path.name != "stability_report.py":
            found.update(path.read_bytes())
    return found.hexdigest()


def _known(cases, out, full):
    """(case, integrator) to row, of an earlier summary or another process's, if it is of the same code and length."""
    path = out / "summary.json"
    if not path.exists():
        return {}
    found = {(case["name"], row["integrator"]): row for case in json.loads(path.read_text())["cases"] for row in case["rows"]}
    origins = {name: _origin(case, full) for name, case in cases.items()}
    return {key: row for key, row in found.items() if row["origin"] == origins.get(key[0])}


def _save(summary, cases, rows, out):
    """Write the summary of these rows and of those that are in the file; both ``rows`` and ``summary`` then have all."""
    with open(out / "summary.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        rows |= _known(cases, out, summary["full"]) | rows
        _fill(summary, cases, rows)
        save(summary, out)


def _fill(summary, cases, rows):
    """Put the rows into the summary, and what they say."""
    summary["cases"] = [
        {
            "name": case.name, "physics": case.physics, "criterion": case.criterion, "bound": case.bound, "low": case.low, "high": case.high,
            "unit": case.unit, "why": case.why, "bars": case.bars, "length": case.length(summary["full"]),
            "integrators": case.integrators(summary["full"]),
            "rows": [rows[case.name, name] for name in COMPARED if (case.name, name) in rows],
        }
        for case in cases.values() if any((case.name, name) in rows for name in COMPARED)
    ]  # fmt: skip
    summary["summary"] = told(summary["cases"])
    named = [case["name"] for case in summary["cases"]]
    summary["command"] = shlex.join(["python", "-m", "validation", "stability", *(named if len(named) < len(cases) else []),
                                     "--full" if summary["full"] else "--short"])  # fmt: skip


def told(cases):
    """What all rows together say: three dictionaries of ``what``, ``holds`` and ``where``.

    Args:
        cases: plain data, each with ``rows`` and ``integrators``, the names of those that it is to be run with.
    """
    ours = {case["name"]: row for case in cases for row in case["rows"] if row["integrator"] == "nosquish"}
    theirs = {case["name"]: [row for row in case["rows"] if row["kind"] in ("rigid", "constraints")] for case in cases}
    worse = [name for name, row in ours.items() if row["verdict"] in BROKEN and any(one["verdict"] in SURVIVED for one in theirs[name])]
    lost = [name for name, row in ours.items() if row["verdict"] != "pass" and any(one["verdict"] == "pass" for one in theirs[name])]
    blunt = [
        case["name"] for case in cases
        if {row["integrator"] for row in case["rows"]} >= set(case["integrators"])
        and all(row["verdict"] in ("pass", "cannot run") for row in case["rows"])
    ]  # fmt: skip
    return [
        {"what": "Ours has no blow-up that any LAMMPS fix survives", "holds": not worse, "where": worse},
        {"what": "Ours passes what any LAMMPS fix passes", "holds": not lost, "where": lost},
        {"what": "Each case has an integrator that does not pass", "holds": not blunt, "where": blunt},
    ]
