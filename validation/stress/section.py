"""What the stability atlas says to the report of all verbs: how long a step each integrator bears,
and what breaks where."""

import re
import textwrap
from collections import Counter, defaultdict

import numpy as np

from ..pages.said import NONE, Cell, Figure, Said, Table, sortable
from ..scenes import FS_PER_PS
from ..scenes.integrators import OURS
from ..statistics.estimate import Estimate
from .cases import CASES
from .criteria import CRITERIA
from .figures import READ
from .measure import COMPARED
from .report import package

LAMMPS = "rigid", "rigid/nve", "rigid/small", "rigid/nve/small", "shake", "rattle"
WORDS = {True: "yes", False: "no", None: "cannot tell"}


def say(summary: dict) -> Said:
    """How long a step each integrator bears, and what breaks where."""
    cases, full = summary["cases"], summary.get("full")
    unseen = [name for name in CASES if name not in {case["name"] for case in cases}]
    counts = [(case["name"], len(case["rows"]), len(case["integrators"])) for case in cases]
    partial = [f"{name} ({there} of {all_})" for name, there, all_ in counts if there < all_]
    headlines = []
    for told in summary["summary"]:
        holds = None if told["holds"] and (unseen or partial) else told["holds"]
        where = f" ({', '.join(told['where'])})" if told["where"] else ""
        headlines.append(f"{told['what']}: {WORDS[holds]}{where}.")
    if unseen:
        headlines.append(f"Cases that were not run: {', '.join(unseen)}.")
    if partial:
        told = f"Not all integrators have had their turn yet in {', '.join(partial)}."
        headlines.append(told)
    times = [np.atleast_1d(case["length"])[0] / FS_PER_PS for case in cases if case["unit"] == "fs"]
    extent = "the limits of the time step are those of {:g} to {:g} ps"
    return Said(
        headlines,
        tables=[_criteria(), _changes(), _every(cases, full)],
        best=[_longest(cases), Figure("matrix.png", READ), _physics(cases, full)],
        short=[_short(cases)] if cases else [],
        extent=extent.format(min(times), max(times)) if times else "",
    )


def _rows(cases):
    """Case and row, of all."""
    return [(case, row) for case in cases for row in case["rows"]]


def _every(cases, full):
    """Every number."""
    rows = []
    for case, row in _rows(cases):
        what = _of_this(case["physics"], full), _of_this(case["criterion"], full), _bound(case)
        number = Cell(Estimate.of(row).text(), sortable(row["value"])), case["bars"], row["verdict"]
        where = package(row), row["date"][:10], row["command"]
        rows.append([case["name"], *what, row["label"], *number, row["note"] or "", *where])
    head = "case, physics, criterion, bound, integrator, value, error is, verdict, note, "
    return Table.of("Every number", head + "measured with, date, command", rows)


def _criteria():
    """Every bound, and what it is derived from."""
    title = "Criteria: each bound is derived from physics or from a user's need, apart from any"
    head = "quantity, bound, derived from, whose need, cases, since"
    rows = [
        (one.quantity, one.text(), one.derivation, one.need, ", ".join(one.cases), one.date)
        for one in CRITERIA.values()
    ]
    return Table.of(f"{title} result", head, rows)


def _changes():
    """Every change of a bound."""
    changes = [change for one in CRITERIA.values() for change in one.changes]
    rows = [(one.date, ", ".join(one.cases), one.old, one.new, one.reason) for one in changes]
    return Table.of("Changes of bounds", "date, cases, from, to, reason", rows)


def _short(cases):
    """How many cases ours passes, and the one of LAMMPS's fixes that passes most."""
    rows = [row for _, row in _rows(cases)]
    ran = Counter(row["label"] for row in rows if row["verdict"] != "cannot run")
    passed = Counter(row["label"] for row in rows if row["verdict"] == "pass")
    ours = next((row["label"] for row in rows if row["integrator"] == OURS), None)
    theirs = {row["label"] for row in rows if row["integrator"].split()[0] in LAMMPS}
    best = max((one for one in ran if one in theirs), key=lambda one: passed[one], default=None)
    told = [f"{label} {passed[label]} of {ran[label]}" for label in (ours, best) if label]
    most = ", the most of LAMMPS’s fixes" * (best is not None)
    return f"passed for sure, of the cases that a fix can run: {', '.join(told)}{most}."


def _of_this(text, full):
    """A case's text with the lengths of this run alone: they write ``0.2 ps (--full: 5 ps)``, and
    ``: 1e6 turns with --full``."""
    text = re.sub(r"(\S+ \S+) \(--full: ([^)]*)\)", r"\2" if full else r"\1", text)
    if full:
        return re.sub(r",? with --full", "", text)
    return re.sub(r"[:;] [^:;]*? with --full( \([^)]*\))?", "", text)


def _few(row):
    """A number with its margin as text; without it where it is below a thousandth of the number."""
    text = Estimate.of(row).text()
    value, *margin = (float(word) for word in text.split(" ± "))
    return f"{row['value']:.3g}" if margin and margin[0] < 1e-3 * abs(value) else text


def _place(name):
    """Where an integrator stands in a table."""
    names = list(COMPARED)
    return names.index(name) if name in names else len(names)


def _longest(cases):
    """The longest stable step of each integrator."""
    labels = {row["integrator"]: row["label"] for _, row in _rows(cases)}
    limits = [case for case in cases if case["unit"] == "fs"]
    found = {(case["name"], row["integrator"]): row for case, row in _rows(limits)}
    rows = [
        [labels[name], *(_step(found.get((case["name"], name))) for case in limits)]
        for name in sorted(labels, key=_place)
    ]
    bars = defaultdict(list)
    for case in limits:
        bars[case["bars"]].append(case["name"])
    what = "; ".join(f"of {', '.join(names)}: {told}" for told, names in bars.items())
    title = f"Longest stable step, fs, and what it is to be; ± is, {what}"
    columns = "integrator", *(f"{case['name']} ({case['bound']})" for case in limits)
    return Table.of(title, columns, rows)


def _step(row):
    """A longest stable step, in fs: of one without an error, as it was the longest that was tried,
    what it is at least."""
    if row is None or row["value"] is None:
        return NONE if row is None else Cell(row["verdict"], NONE.value)
    least = "≥ " if row["value"] and not row["error"] else ""
    return Cell(least + Estimate.of(row).text(), row["value"], row["verdict"])


def _physics(cases, full):
    """A line for each case: what happens, and who does not bear it."""

    rows = []
    for case in cases:
        ours = next((row for row in case["rows"] if row["integrator"] == OURS), None)
        others = [row for row in case["rows"] if row is not ours]
        bad = [row for row in others if row["verdict"] not in ("pass", "cannot run")]
        who = "; ".join(_result(row, case) for row in bad) or "–"
        what = (
            _of_this(case["physics"], full),
            f"{_of_this(case['criterion'], full)} {_bound(case)}",
        )
        cell = Cell("not run", verdict="cannot tell")
        if ours:
            cell = Cell(_result(ours, case, ""), verdict=ours["verdict"])
        rows.append((case["name"], *what, cell, who))
    head = "case", "what happens", "number, bound", "ours", "who else does not pass"
    return Table.of("The cases", head, rows)


def _bound(case):
    return f"{case['bound']} {case['unit']}".strip()


def _result(row, case, name=None):
    """Who came to what in a case, as text."""
    name = f"{row['label'] if name is None else name} "
    if row["value"] is None:
        # who says so
        why = re.sub(r"ERROR( on proc \d+)?: (Fix \S+ python/move: )?", "", row["note"] or "")
        verb = "cannot run" if row["verdict"] == "cannot run" else "breaks"
        return f"{name}{verb}: {textwrap.shorten(why, 80, placeholder=' …')}".strip()
    doubt = " (cannot tell)" if row["verdict"] == "cannot tell" else ""
    return f"{name}{_few(row)} {case['unit']}".strip() + doubt
