"""LAMMPS's own examples with a rigid fix, run with LAMMPS's fix and with ours in its place.

A copy differs from its input by nothing but output and length: more digits and more rows are
printed, and a run of many steps ends after fewer, with its ramps (``start``, ``stop``) as long as
they were.  Every column that is printed is compared: the first steps from the same start, then
means with 95 % intervals.
"""

import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ..pages import Column, Table
from ..running import lammps_log, run
from ..running.store import Store
from ..statistics.check import Check
from ..statistics.estimate import CONFIDENCE, margin
from .plan import Bench, Claims, Found

OURS, THEIRS = "ours", "theirs"
SUFFIX = "-sf", "nosquish"
RANKS = 1, 2
SILENCE = 300.0  # s of a run at most, above what it is to take
SECONDS = 4.0  # of a run with LAMMPS's own fix on 1 rank at most; the others are as long
DENSE = 20  # steps at the start of a run of which each is printed
ROWS = 100  # about so many rows are printed of the rest
ROW = "examples_row"  # a variable: the step of the next row
DIGITS = "thermo_modify format float %.15g"
CONTINUED = re.compile(r"&[ \t]*\n")
TABLES = ["run"], ["minimize"]  # commands that print a table
# whole numbers of four and more digits there are seeds, but where rows are averaged
SEEDED = re.compile(r"\s*(velocity|create_atoms|fix\s+\S+\s+\S+\s+(?!ave/))")
SEED = re.compile(r"(?<![\w.+-])\d{4,}(?![\w.])")
NOT_COMPARED = ["Step", "CPU", "T/CPU", "S/CPU", "CPULeft", "Elapsed"]
# what LAMMPS's rigid fixes say of the pressure has an impulse in a run's first step, and an error
# of first order in the step in all others
PRESSURE = r"Press|P[xyz]{2}$|Enthalpy"
ROUNDING = 1e-9  # of a column, after twenty steps: 1e-16 grows by 10 in two or three of them
NOISE = 1e-9  # of a run's largest value: a column that is smaller in the first steps is zero there
TOGETHER = 1e-3  # of a column: two runs are one trajectory, and need no other starts
# at half the step an error of order 1/2 (noise that one lacks in a half step) falls by 1.41, of
# order 1 by 2, of order 2 by 4; what is wrong does not fall
FALLS = 1.25
GOOD = "agrees", "known", "refused", "not with theirs"

_DOF = (
    "LAMMPS's thermostat counts the total momentum, which is zero, among the degrees of freedom, "
    "so its mean temperature is higher than the target"
)
_BOX = (
    "the run begins far from its pressure and ends before it is reached. LAMMPS's piston is pushed "
    "by the impulse in the pressure of step 0, and has another thermostat"
)
# examples whose columns differ for a reason that is known
KNOWN = {
    "deposit/in.deposit.molecule.rigid-nvt-small": (
        "LAMMPS's fix has no thermostat for molecules that are inserted in the run, unless the "
        "script says fix_modify dynamic/dof yes. With that the two agree"
    ),
    "rigid/in.rigid.cubes.nvt": _DOF,
    "rigid/in.rigid.cubes.npt": _BOX,
    "rigid/in.rigid.cubes.nph": _BOX,
    "rigid/in.rigid.tnr": (
        "the first half step of LAMMPS's fix lacks the random forces of the fix langevin behind "
        f"it, and at constant pressure {_BOX}"
    ),
}


class Lengths(NamedTuple):
    """Steps of a script's runs together, at most, and starts: with other seeds, its own counted."""

    steps: int
    starts: int


SHORT, FULL = Lengths(200, 2), Lengths(10_000, 4)

# ---- copies


@dataclass(frozen=True)
class Example:
    """An input script, with its name below the folder of examples."""

    name: str
    path: Path

    @property
    def commands(self) -> list[str]:
        """Its lines, of which one that is continued is one."""
        return CONTINUED.sub(" ", self.path.read_text(errors="replace")).splitlines()

    @property
    def fixes(self) -> list[list[str]]:
        """The words of its rigid fixes."""
        return [words for words in map(_words, self.commands) if _rigid(words)]

    @property
    def plain(self) -> bool:
        """Whether its first rigid fix is rigid or rigid/small: these have another scheme."""
        return self.fixes[0][3] in ("rigid", "rigid/small")

    @property
    def tables(self) -> tuple[int, int]:
        """How many tables it prints, and how many of them before its first rigid fix."""
        words = [_words(line) for line in self.commands]
        at = next(place for place, some in enumerate(words) if _rigid(some))
        prints = [some[:1] in TABLES for some in words]
        return sum(prints), sum(prints[:at])

    def copy(
        self,
        steps: Sequence[int],
        every: int,
        start: int = 0,
        seconds: float | None = None,
        finer: int = 0,
        nve: bool = False,
    ) -> str:
        """What is run.

        Args:
            steps: of each run at most.
            every: steps from one row to the next, behind the first ones.
            start: another number gives other seeds; 0 those of the input.
            seconds: of each run at most; then LAMMPS ends it.
            finer: steps for one of the input, in a copy of the beginning only, which ends behind
                the first steps with a rigid fix; 0 for a whole copy.
            nve: whether rigid/nve takes the place of rigid.
        """
        dense, (_, first), table = DENSE * max(1, finer), self.tables, 0
        row = f"(step<{dense})*(step+1)+(step>={dense})*(floor(step/{every})+1)*{every}"
        lines = [f'variable {ROW} equal "{row}"', f"thermo v_{ROW}", DIGITS]
        for line in self.commands:
            words = _words(line)
            if start and SEEDED.match(line):
                line = SEED.sub(lambda seed: str(int(seed[0]) + 1000 * start), line)
            if nve and _rigid(words):
                line = re.sub(r"(\srigid)(?=(/small)?\s)", r"\1/nve", line, count=1)
            if words[:1] in TABLES:
                if finer and table == first:
                    cut = _cut(words, steps[table] and DENSE, finer)
                    return "\n".join([*lines, f"timestep $(dt/{finer})", cut]) + "\n"
                lines += [f"timer timeout 0:{int(seconds):02} every 10"] if seconds else []
                lines.append(_cut(words, steps[table]))
                table += 1
            elif words[:1] == ["thermo"]:
                lines.append(f"thermo v_{ROW}")
            else:
                lines += [line, DIGITS] if words[:1] == ["thermo_style"] else [line]
        return "\n".join(lines) + "\n"


def inputs(folder: Path) -> dict[str, Example]:
    """The inputs below a folder that have a rigid fix, by name."""
    paths = sorted(path for path in folder.rglob("in.*") if path.is_file())
    made = (Example(path.relative_to(folder).as_posix(), path) for path in paths)
    return {example.name: example for example in made if example.fixes}


def _words(line: str) -> list[str]:
    return line.partition("#")[0].split()


def _rigid(words) -> bool:
    return len(words) > 3 and words[0] == "fix" and words[3].split("/")[0] == "rigid"


def _cut(words, steps, finer=1) -> str:
    """A run of at most so many steps, each of which is made of ``finer`` ones."""
    if words[0] != "run" or not words[1].isdigit():
        return " ".join(words)
    whole = int(words[1])
    count = min(whole, steps) * finer
    ramps = [f"start $(step) stop $(step+{whole * finer})"] if count < whole * finer else []
    return " ".join(["run", str(count), *ramps, *words[2:]])


# ---- runs


class Runs:
    """A way to run copies of an example: each in a folder of its own, and kept as a record.

    Attributes:
        steps: of each of its runs, as many as LAMMPS's own fix does in `SECONDS` at most.
        first: the record of that.
    """

    def __init__(self, example: Example, store: Store, lengths: Lengths) -> None:
        self.example, self._store, self.lengths = example, store, lengths
        tables, _ = example.tables
        most = [max(DENSE, lengths.steps // tables)] * tables
        self.every = max(1, lengths.steps // tables // ROWS)
        self.first = self.run(example.copy(most, self.every, seconds=SECONDS), THEIRS, 1, "first")
        made = [int(table["Step"][-1] - table["Step"][0]) for table in self.first["tables"]]
        self.steps = [*made, *most[len(made) :]]

    def __call__(self, which: str, ranks: int, name: str, **how) -> dict:
        """The record of a run: ``error``, ``said`` (what took the place of what) and ``tables``."""
        return self.run(self.example.copy(self.steps, self.every, **how), which, ranks, name)

    def run(self, text: str, which: str, ranks: int, name: str) -> dict:
        """The record of a run of this text."""
        folder = self.example.path.parent
        files = sorted(path for path in folder.iterdir() if path.is_file())
        origin = self._store.origin(text, which, ranks, files=files)
        name = f"{self.example.name}/{which}-{ranks}-{name}"
        return self._store.once(name, origin, lambda: self._run(text, which, ranks, files))

    def _run(self, text, which, ranks, files):
        options = "-in", self.example.path.name, "-log", "log.examples", "-nocite"
        words = [*run.launcher(ranks), sys.executable, "-m", "fix_nosquish", *options]
        words += SUFFIX if which == OURS else ()
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for file in files:
                (folder / file.name).symlink_to(file.resolve())
            (folder / self.example.path.name).unlink()
            (folder / self.example.path.name).write_text(text)
            with open(folder / "output.txt", "w") as output:
                error = _watched(words, folder, output)
            said, log = (_read(folder / file) for file in ("output.txt", "log.examples"))
        if error:
            error = run.one_line(lammps_log.error(said) or lammps_log.error(log) or error)
        taken = re.findall(r"^Fix \S+: (nosquish.*)", said, re.M)
        return {"error": error, "said": list(dict.fromkeys(taken)), "tables": tables_of(log)}


def _watched(words, folder, output) -> str | None:
    """Why a run did not end well; None if it did."""
    how: dict = {"cwd": folder, "stdout": output, "stderr": subprocess.STDOUT}
    with run.started(words, **how) as process:
        try:
            status = process.wait(SILENCE + 3 * SECONDS)
        except subprocess.TimeoutExpired:
            return "no end"
    return f"LAMMPS crashed (exit status {status})" if status else None


def _read(path):
    return path.read_text(errors="replace") if path.exists() else ""


def tables_of(log: str) -> list[dict]:
    """Each run's table of a log: {column: values}."""
    parts = map(lammps_log.thermo, re.split(r"^Loop time.*$", log, flags=re.M))
    return [{name: [*map(float, some)] for name, some in part.items()} for part in parts if part]


# ---- what comes of them


def row(runs: Runs, count: int) -> dict:
    """What comes of an example, one of ``count``, on 1 and 2 ranks: a verdict, numbers, a note."""
    theirs, ours = [runs.first, runs(THEIRS, 2, "0")], [runs(OURS, n, "0") for n in RANKS]
    styles = [" ".join(words[3:]) for words in runs.example.fixes]
    found: dict = {
        "example": runs.example.name,
        "fixes": list(dict.fromkeys(styles)),
        "said": ours[0]["said"],
        "steps": runs.steps,
        "note": "",
    }
    failed, bad = ([one["error"] for one in some if one["error"]] for some in (theirs, ours))
    if failed:
        return found | {"verdict": "not with theirs", "note": failed[0], "ours": bad[:1]}
    if bad:
        told = len(bad) == len(RANKS) and all(error.startswith("ERROR") for error in bad)
        return found | {"verdict": "refused" if told else "crash", "note": bad[0]}
    unlike = [name for both in zip(theirs, ours) for name in _unlike(*both)]
    if unlike:
        note = f"not the same tables: {', '.join(dict.fromkeys(unlike))}"
        return found | {"verdict": "differs", "note": note}
    number = _compared(runs, theirs, ours, count)
    wrong = [f"the mean of {', '.join(number['far'])}"] * bool(number["far"])
    wrong += ["the first steps"] * any(factor < FALLS for factor in number.get("falls", ()))
    if not wrong:
        return found | number | {"verdict": "agrees"}
    why = KNOWN.get(runs.example.name)
    verdict = "known" if why else "differs"
    return found | number | {"verdict": verdict, "note": " and ".join(wrong), "why": why}


def _compared(runs, theirs, ours, count):
    number: dict = {}
    if "langevin" not in runs.example.fixes[0][4:]:  # whose noise is another
        number["begin"], number["falls"] = _beginnings(runs, ours)
    apart_by = (apart(*both)[0] for pair in zip(theirs, ours) for both in pairs(*pair))
    number["whole"] = max(apart_by)
    starts = [(theirs[0], ours[0])]
    if number["whole"] > TOGETHER:
        for start in range(1, runs.lengths.starts):
            pair = tuple(runs(which, 1, str(start), start=start) for which in (THEIRS, OURS))
            if not (pair[0]["error"] or pair[1]["error"] or _unlike(*pair)):
                starts.append(pair)
        number |= means(starts, runs.example.tables[1], count)
    return {"columns": 0, "outside": [], "far": []} | number | {"starts": len(starts)}


def _beginnings(runs: Runs, ours: list[dict]) -> tuple[list[float], list[float]]:
    """How far the first steps are apart, motion and pressure on 1 rank and on 2, from LAMMPS's
    rigid/nve in the place of rigid; and by how much what is more than rounding falls at half the
    step, on 1 rank."""
    _, at = runs.example.tables
    nve, least = runs.example.plain, NOISE * _frames(ours[0])[at].abs().max()
    # rigid/nve says another thing by it
    without = [f"f_{runs.example.fixes[0][1]}"] if nve else []

    def begin(theirs, ours, finer=1, of="max"):
        one, other = (
            table.iloc[: DENSE * finer + 1 : finer].drop(columns=without, errors="ignore")
            for table in pairs(theirs, ours)[at]
        )
        return apart(one, other, of, least)

    theirs = [runs(THEIRS, ranks, "begin", finer=1, nve=nve) for ranks in RANKS]
    found = [far for pair in zip(theirs, ours) for far in begin(*pair)]
    if max(found) <= ROUNDING:
        return found, []
    finer = [
        runs(which, 1, "finer", finer=2, nve=nve and which == THEIRS) for which in (THEIRS, OURS)
    ]
    usual, half = begin(theirs[0], ours[0], 1, "median"), begin(finer[0], finer[1], 2, "median")
    falls = [
        one / max(1e-300, other) for most, one, other in zip(found, usual, half) if most > ROUNDING
    ]
    return found, falls


def _frames(record: dict) -> list[pd.DataFrame]:
    """The tables, without clocks."""
    return [
        pd.DataFrame(table).drop(columns=NOT_COMPARED, errors="ignore")
        for table in record["tables"]
    ]


def _unlike(theirs: dict, ours: dict) -> list[str]:
    """Columns that one of two runs does not have, or that one has more tables."""
    both = theirs["tables"], ours["tables"]
    if len(both[0]) != len(both[1]):
        return [f"{len(both[1])} of {len(both[0])} runs"]
    return [name for one, other in zip(*both) for name in {*one} ^ {*other}]


def pairs(theirs: dict, ours: dict) -> list[tuple[pd.DataFrame, pd.DataFrame]]:
    """Their tables and ours, of the rows that both have."""
    both = zip(_frames(theirs), _frames(ours))
    return [one.align(other, join="inner") for one, other in both]


def apart(
    theirs: pd.DataFrame,
    ours: pd.DataFrame,
    of: str = "max",
    least: pd.Series | None = None,
) -> tuple[float, float]:
    """The largest difference of a column of motion, and of a pressure, which has no first row:
    ``of`` all rows, in units of the column's largest value, or of one in ``least``."""
    least = pd.Series(0.0, index=theirs.columns) if least is None else least
    pressures, found = theirs.columns.str.match(PRESSURE), []
    for kind, begin in (~pressures, 0), (pressures, 1):
        one, other = (table.loc[:, kind].iloc[begin:] for table in (theirs, ours))
        sizes = pd.concat([one.abs().max(), other.abs().max(), least[one.columns]], axis="columns")
        far = (one - other).abs().agg(of) / sizes.max(axis="columns").replace(0.0, 1.0)
        found.append(float(far.fillna(np.inf).max()) if one.size else 0.0)
    return found[0], found[1]


def means(starts: Sequence[tuple[dict, dict]], at: int, count: int = 1) -> dict:
    """Whether means of all columns agree, over the rest of each run: differences from the same
    start whose 95 % interval has zero in it.

    Of pressures the error that LAMMPS's have in the first steps of table ``at`` is no difference.

    Returns:
        ``columns``: how many there are; ``outside``: those outside of their interval; ``far``:
        those outside of the one in which all columns of ``count`` such comparisons are in 95 %.
    """
    differences, least = [], []
    for theirs, ours in starts:
        both = pairs(theirs, ours)
        known = _of_pressures(*both[at])
        far: dict[str, float] = {}
        size: dict[str, float] = {}
        for number, (one, other) in enumerate(both, 1):
            rest = (other - one).iloc[DENSE + 1 :]
            far |= {f"{name} of run {number}": value for name, value in rest.mean().items()}
            largest = TOGETHER * one.iloc[DENSE + 1 :].abs().max()
            for name, value in largest.items():
                size[f"{name} of run {number}"] = max(value, known.get(name, 0.0))
        differences.append(far)
        least.append(size)
    off = pd.DataFrame(differences).dropna(axis="columns", how="all")
    error, no_less = off.sem(), pd.DataFrame(least).max()[off.columns]

    def outside(confidence):
        reach = margin(1.0, len(off) - 1, confidence) if len(off) > 1 else np.inf
        return [*off.columns[off.mean().abs() > np.maximum(reach * error, no_less)]]

    of_all = 1 - (1 - CONFIDENCE) / max(1, count * len(off.columns))
    found = {"outside": outside(CONFIDENCE), "far": outside(of_all)}
    return {"columns": len(off.columns)} | found


def _of_pressures(theirs: pd.DataFrame, ours: pd.DataFrame) -> pd.Series:
    """Twice the largest difference of each pressure in the first steps of a table, where the runs
    are one trajectory."""
    one, other = (table.iloc[: DENSE + 1] for table in (theirs, ours))
    if apart(one, other)[0] > TOGETHER:
        return pd.Series(dtype=float)
    return 2 * (one - other).iloc[1:].abs().max().filter(regex=f"^({PRESSURE})")


def names(bench: Bench) -> Mapping[str, Example]:
    """All examples."""
    return inputs(bench.lammps) if bench.lammps else {}


def check(row: Mapping) -> Check:
    """Whether an example agrees, of its row; no number where there is nothing to compare."""
    value, what = None, "columns that differ: in the first steps, or in their means"
    if row["verdict"] in ("agrees", "known", "differs") and "far" in row:
        value = len(row["far"]) + sum(factor < FALLS for factor in row.get("falls", ()))
    note = "; ".join(filter(None, (row["verdict"], row["note"], row.get("why"))))
    return Check.of("examples", row["example"], what, value, high=0.0, note=note)


def judge(found: Found, bench: Bench) -> dict:
    """``rows``, one for each example, ``checks``, and ``failed``: why examples do not agree."""
    lengths, store = FULL if bench.full else SHORT, Store(bench.out / "records")
    rows, chosen = [], [one for one in names(bench).values() if one.name in bench.names]
    for example in chosen:
        bench.meter.begin(example.name, 1)
        try:
            rows.append(row(Runs(example, store, lengths), len(chosen)))
        except KeyboardInterrupt:
            bench.interrupted = True
            bench.meter.end("interrupted")
            break
        bench.meter.end(None if rows[-1]["verdict"] in GOOD else rows[-1]["note"])
    failed = {one["example"]: one["note"] for one in rows if one["verdict"] not in GOOD}
    checks = [check(one).plain() for one in rows]
    return {**lengths._asdict(), "checks": checks, "rows": rows, "failed": failed}


COLUMNS = (
    *(Column(key, key, kind="text") for key in ("example", "verdict", "note")),
    Column("whole", "largest difference", kind="number", form=".1e"),
    *(Column(key, key, kind="number") for key in ("columns", "starts")),
)
CLAIMS = Claims(
    "LAMMPS's own examples with our fix in place of LAMMPS's",
    "Does an input that has a rigid fix give the same numbers with -sf nosquish?",
    "examples with a rigid fix in which every printed column agrees",
    {"examples": "LAMMPS's examples"},
    lambda bench: [],
    judge,
    names,
    tables=lambda summary: [Table("All", COLUMNS, summary["rows"], "table", long=True)],
    checks_file="checks",
    ours=False,
)
