"""What `stress` says of its summary: of cases, or of a user's script."""

import re
import textwrap
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from functools import partial

from rich.console import Console

from ..pages import Cell, Column, Figure, Said, Table, show_table
from ..scenes.integrators import OURS
from ..statistics.estimate import Estimate
from . import figures
from .criteria import CRITERIA
from .measure import ALL, COMPARED, EXTREME, REPORTED, Case, conclusions
from .script import TITLES

LOST = ("fail", "blow-up")
KEYS = (
    *("case", "integrator", "label", "value", "margin", "error is", "unit", "bound"),
    *("verdict", "note", "measured with", "date", "command"),
)


def said(summary: dict) -> Said:
    """What breaks, where."""
    if "checks" in summary:
        return _of_script(summary)
    cases, full = summary["cases"], summary["full"]
    lines = [f"{line['what']}: {_word(line)}." for line in conclusions(cases)]
    partial_ = [case["name"] for case in cases if len(case["rows"]) < len(case["integrators"])]
    if partial_:
        lines.append(f"Not all integrators have run yet in {', '.join(partial_)}.")
    extreme, reported = (
        [case for case in cases if case["part"] == part] for part in (EXTREME, REPORTED)
    )
    return Said(
        "What breaks, where",
        "Which integrator breaks where: at long steps, in heat and cold, with odd bodies, on many "
        "ranks, far away, and where users report it?",
        _answer(cases),
        lines=lines,
        tables=[
            _longest(extreme),
            _standing(extreme),
            _cases(extreme, full),
            _reported(reported),
            _bounds(),
            _changes(),
            Table("", [Column(key, key, kind="text") for key in KEYS], _rows(cases), "table"),
        ],
        figures=[Figure("matrix", partial(figures.matrix, extreme), figures.READ)],
        failures=[
            f"{case['name']}, {row['label']}: {row['note']}"
            for case in cases
            for row in case["rows"]
            if row["verdict"] == "blow-up"
        ],
    )


def _of_script(summary: dict) -> Said:
    """What breaks on a user's script."""
    checks = summary["checks"]
    lost = [check for check in checks if check["verdict"] == "does not hold"]
    who = Counter(check["subject"] for check in lost)
    told = ", ".join(f"{name} {number}" for name, number in who.items())
    return Said(
        f"What breaks: {summary['title']}",
        "Do longer steps, a run in two parts or another number of ranks break it?",
        f"Numbers out of their bounds: {told or 'none'}.",
        lines=summary["notes"],
        checks=checks,
        parts=TITLES,
        checks_file="table",
    )


def _word(line: Mapping) -> str:
    """Whether a conclusion holds, and where not."""
    where = f" ({', '.join(line['where'])})" if line["where"] else ""
    words = {True: "yes", False: f"no{where}", None: f"cannot tell, ours has no row yet{where}"}
    return words[line["holds"]]


def _answer(cases: Iterable[dict]) -> str:
    """How many cases ours passes, and the one of LAMMPS's fixes that passes most."""
    rows = [row for case in cases for row in case["rows"]]
    ran = Counter(row["label"] for row in rows if row["verdict"] != "cannot run")
    passed = Counter(row["label"] for row in rows if row["verdict"] == "pass")
    kinds = {row["label"]: row["kind"] for row in rows}
    theirs = [label for label in ran if kinds[label] != "ours"]
    best = max(theirs, key=lambda label: passed[label] / ran[label], default=None)
    ours = next((row["label"] for row in rows if row["integrator"] == OURS), None)
    told = [f"{label} {passed[label]} of {ran[label]}" for label in (ours, best) if label]
    most = ", the largest share of LAMMPS's fixes" * (best is not None)
    return f"Passed, of the cases that a fix can run: {', '.join(told)}{most}."


def _labels(cases: Iterable[dict]) -> dict[str, str]:
    """Names and labels of the integrators that have rows, in order."""
    found = {row["integrator"]: row["label"] for case in cases for row in case["rows"]}
    return {name: found[name] for name in ALL if name in found}


def _rows(cases: Iterable[dict]) -> list[dict]:
    """The rows of table.csv."""
    return [
        {**row, "case": case["name"], "margin": Estimate.of(row).margin or None}
        | {"error is": case["bars"], "unit": case["unit"], "bound": case["bound"]}
        | {"measured with": _package(row)}
        for case in cases
        for row in case["rows"]
    ]


def _package(row: Mapping) -> str:
    """With which package a row was measured."""
    found = row["versions"]
    return f"fix_nosquish {found['fix_nosquish']} ({found['package']}), LAMMPS {found['lammps']}"


def _found(row: Mapping | None) -> Cell:
    """A row's number, with its verdict."""
    if row is None:
        return Cell("not run")
    if row["value"] is None:
        return Cell(
            "breaks" if row["verdict"] == "blow-up" else "cannot run", verdict=row["verdict"]
        )
    number = Estimate.of(row)
    small = number.margin <= 1e-3 * abs(number.value)
    text = (Estimate(number.value) if small else number).text()
    return Cell(text, row["value"], row["verdict"])


def _longest(cases: Iterable[dict]) -> Table:
    """The longest stable step of each integrator."""
    limits = [case for case in cases if case["unit"] == "fs"]
    names = [f"{case['name']} ({case['bound']})" for case in limits]
    bars = defaultdict(list)
    for case in limits:
        bars[case["bars"]].append(case["name"])
    note = "; ".join(f"± of {', '.join(some)}: {told}" for told, some in bars.items())
    return _by_integrator("Longest stable step, fs", names, limits, note=note)


def _by_integrator(title: str, heads: Iterable[str], cases: list[dict], **more) -> Table:
    found = [{row["integrator"]: row for row in case["rows"]} for case in cases]
    rows = [
        [label, *(_found(rows.get(name)) for rows in found)]
        for name, label in _labels(cases).items()
    ]
    return Table.of(title, ["integrator", *heads], rows, **more)


def _standing(cases: Iterable[dict]) -> Table:
    """Which integrator passes how many cases, and which ones it does not."""
    found: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for case in cases:
        for row in case["rows"]:
            verdict = "fail" if row["verdict"] in LOST else row["verdict"]
            found[row["integrator"]][verdict].append(case["name"])
    rows = []
    for name, label in _labels(cases).items():
        lost = (found[name][key] for key in ("fail", "cannot tell", "cannot run"))
        counted = (f"{len(some)}: {', '.join(some)}" if some else "0" for some in lost)
        rows.append([label, len(found[name]["pass"]), *counted])
    heads = "integrator, passes, fails or breaks, cannot tell, cannot run"
    return Table.of("Who passes", heads, rows)


def _cases(cases: Iterable[dict], full: bool) -> Table:
    """A line for each case: what happens, and who does not bear it."""
    rows = []
    for case in cases:
        ours = next((row for row in case["rows"] if row["integrator"] == OURS), None)
        others = [row for row in case["rows"] if row is not ours]
        bad = [row for row in others if row["verdict"] not in ("pass", "cannot run")]
        number = f"{of_length(case['criterion'], full)} {case['bound']} {case['unit']}".strip()
        what = case["name"], of_length(case["physics"], full), number
        rows.append([*what, _found(ours), "; ".join(_result(row, case) for row in bad) or "–"])
    head = "case, what happens, number and bound, ours, who else does not pass"
    return Table.of("The cases", re.split(", ", head), rows)


def _result(row: Mapping, case: Mapping) -> str:
    """Who came to what in a case."""
    if row["value"] is None:
        why = re.sub(r"ERROR( on proc \d+)?: (Fix \S+ python/move: )?", "", row["note"])
        short = textwrap.shorten(why, 80, placeholder=" …")
        return f"{row['label']} breaks: {short}"
    doubt = " (cannot tell)" if row["verdict"] == "cannot tell" else ""
    return f"{row['label']} {_found(row).text} {case['unit']}".strip() + doubt


def of_length(text: str, full: bool) -> str:
    """A case's text with the lengths of this run alone: they write ``0.2 ps (--full: 5 ps)``, and
    ``: 1e6 turns with --full``."""
    text = re.sub(r"(\S+ \S+) \(--full: ([^)]*)\)", r"\2" if full else r"\1", text)
    if full:
        return re.sub(r",? with --full", "", text)
    return re.sub(r"[:;] [^:;]*? with --full( \([^)]*\))?", "", text)


def _reported(cases: list[dict]) -> Table:
    """What users report, with a column for each fix."""
    labels = _labels(cases)
    rows = []
    for case in cases:
        found = {row["integrator"]: row for row in case["rows"]}
        what = f"{case['physics'].rstrip('.')}: {case['criterion']}"
        rows.append(
            [case["name"], what, case["bound"], *(_found(found.get(name)) for name in labels)]
        )
    heads = ["case", "what happens: number", "bound", *labels.values()]
    title = "What users report as broken, in Lennard-Jones units: small is good"
    return Table.of(title, heads, rows)


def _bounds() -> Table:
    """Every bound, and what it is derived from."""
    head = "quantity, bound, derived from, whose need, cases, since"
    rows = [
        (some.quantity, some.text(), some.derivation, some.need, ", ".join(some.cases), some.date)
        for some in CRITERIA.values()
    ]
    title = "Bounds: each is derived from physics or from a user's need, apart from any result"
    return Table.of(title, head, rows, long=True)


def _changes() -> Table:
    """Every change of a bound."""
    changes = [change for some in CRITERIA.values() for change in some.changes]
    rows = [(one.date, ", ".join(one.cases), one.old, one.new, one.reason) for one in changes]
    return Table.of("Changes of bounds", "date, cases, from, to, reason", rows, long=True)


def list_cases(console: Console, cases: Mapping[str, Case]) -> None:
    """Print all cases, bounds and integrators."""
    rows = [(case.name, case.physics, case.criterion, case.bound.text(), case.bars)
            for case in cases.values()]  # fmt: skip
    show_table(console, Table.of("Cases", "case, physics, number, bound, error", rows))
    show_table(console, _bounds())
    names = ", ".join(f'"{name}"' if " " in name else name for name in COMPARED)
    console.print(f"integrators: {names}", soft_wrap=True)
