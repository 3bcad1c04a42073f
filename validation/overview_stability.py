"""What the stability atlas says to the report of all verbs: how long a step each integrator bears, and what breaks where."""

import math
import re
import textwrap

import numpy as np

from validation.check import number
from validation.compare import FS_PER_PS
from validation.criteria import CRITERIA
from validation.overview_pieces import Cell, Figure, Said, Table, sortable
from validation.stability import COMPARED, LOST
from validation.stability_cases import CASES
from validation.stability_report import READ, package

OURS = "nosquish"
FIXES = [
    name
    for name in COMPARED
    if name.split()[0]
    in ("rigid", "rigid/nve", "rigid/small", "rigid/nve/small", "shake", "rattle")
]
WORDS = {True: "yes", False: "no", None: "cannot tell"}
PLACES = {name: place for place, name in enumerate(COMPARED)}  # of rows


def say(summary):
    """How long a step each integrator bears, and what breaks where."""
    cases = summary["cases"]
    labels = {row["integrator"]: row["label"] for case in cases for row in case["rows"]}
    labels = {
        name: labels[name]
        for name in sorted(labels, key=lambda name: PLACES.get(name, len(PLACES)))
    }
    unseen = [name for name in CASES if name not in {case["name"] for case in cases}]
    counts = [(case["name"], len(case["rows"]), len(case["integrators"])) for case in cases]
    partial = [f"{name} ({there} of {all_})" for name, there, all_ in counts if there < all_]
    headlines = []
    for told in summary["summary"]:
        holds = None if told["holds"] and (unseen or partial) else told["holds"]
        headlines.append(
            f"{told['what']}: {WORDS[holds]}"
            + (f" ({', '.join(told['where'])})" if told["where"] else "")
            + "."
        )
    headlines += [f"Cases that were not run: {', '.join(unseen)}."] * bool(unseen)
    headlines += [f"Not all integrators have had their turn yet in {', '.join(partial)}."] * bool(
        partial
    )
    rows = [
        [Cell(case["name"]), Cell(_of_this(case["physics"], summary.get("full"))), Cell(_criterion(case, summary)), Cell(_bound(case)), Cell(row["label"]),
         Cell(number(row["value"], row["error"] or 0.0, row.get("freedom")), sortable(row["value"])), Cell(case["bars"]),
         Cell(row["verdict"]), Cell(row["note"] or ""), Cell(package(row)), Cell(row["date"][:10]), Cell(row["command"])]
        for case in cases for row in case["rows"]
    ]  # fmt: skip
    columns = (
        "case",
        "physics",
        "criterion",
        "bound",
        "integrator",
        "value",
        "error is",
        "verdict",
        "note",
        "measured with",
        "date",
        "command",
    )
    times = [np.atleast_1d(case["length"])[0] / FS_PER_PS for case in cases if case["unit"] == "fs"]
    return Said(
        headlines, [], [_criteria(), _changes(), Table("Every number", columns, rows)],
        best=[_longest(cases, labels), Figure("matrix.png", READ), _physics(cases, summary)],
        short=[_short(cases)] if cases else [],
        extent=f"the limits of the time step are those of {min(times):g} to {max(times):g} ps" if times else "",
    )  # fmt: skip


def _criteria():
    """Every bound, and what it is derived from."""
    rows = [[Cell(one.quantity), Cell(one.text()), Cell(one.derivation), Cell(one.need), Cell(", ".join(one.cases)), Cell(one.date)]
            for one in CRITERIA.values()]  # fmt: skip
    columns = "quantity", "bound", "derived from", "whose need", "cases", "since"
    return Table(
        "Criteria: each bound is derived from physics or from a user's need, apart from any result",
        columns,
        rows,
    )


def _changes():
    """Every change of a bound."""
    rows = [[Cell(change.date), Cell(", ".join(change.cases)), Cell(change.old), Cell(change.new), Cell(change.reason)]
            for one in CRITERIA.values() for change in one.changes]  # fmt: skip
    return Table("Changes of bounds", ("date", "cases", "from", "to", "reason"), rows)


def _short(cases):
    """How many cases ours passes, and the one of LAMMPS's fixes that passes most."""
    passed, ran = {}, {}
    for row in (row for case in cases for row in case["rows"] if row["verdict"] != "cannot run"):
        ran[row["label"]] = ran.get(row["label"], 0) + 1
        passed[row["label"]] = passed.get(row["label"], 0) + (row["verdict"] == "pass")
    ours = next(
        (row["label"] for case in cases for row in case["rows"] if row["integrator"] == OURS), None
    )
    others = [
        label
        for label in ran
        if label
        in {row["label"] for case in cases for row in case["rows"] if row["integrator"] in FIXES}
    ]
    best = max(others, key=passed.get, default=None)
    told = [f"{label} {passed[label]} of {ran[label]}" for label in (ours, best) if label]
    return f"passed for sure, of the cases that a fix can run: {', '.join(told)}{', the most of LAMMPS’s fixes' * (best is not None)}."


def _of_this(text, full):
    """A case's text with the lengths of this run alone: they write ``0.2 ps (--full: 5 ps)``, and ``: 1e6 turns with --full``."""
    text = re.sub(r"(\S+ \S+) \(--full: ([^)]*)\)", r"\2" if full else r"\1", text)
    return (
        re.sub(r",? with --full", "", text)
        if full
        else re.sub(r"[:;] [^:;]*? with --full( \([^)]*\))?", "", text)
    )


def _criterion(case, summary):
    return _of_this(case["criterion"], summary.get("full"))


def _few(row):
    """A number with its margin as text; without it where it is below a thousandth of the number."""
    text = number(row["value"], row["error"] or 0.0, row.get("freedom"))
    value, *margin = (float(word) for word in text.split(" ± "))
    return f"{row['value']:.3g}" if margin and margin[0] < 1e-3 * abs(value) else text


def _longest(cases, labels):
    """The longest stable step of each integrator."""
    limits = [case for case in cases if case["unit"] == "fs"]
    found = {(case["name"], row["integrator"]): row for case in limits for row in case["rows"]}
    rows = [
        [Cell(label), *(_step(found.get((case["name"], name))) for case in limits)]
        for name, label in labels.items()
    ]
    bars = {}
    for case in limits:
        bars.setdefault(case["bars"], []).append(case["name"])
    what = "; ".join(f"of {', '.join(names)}: {told}" for told, names in bars.items())
    columns = "integrator", *(f"{case['name']} ({case['bound']})" for case in limits)
    return Table(f"Longest stable step, fs, and what it is to be; ± is, {what}", columns, rows)


def _step(row):
    """A longest stable step, in fs: of one without an error, as it was the longest that was tried, what it is at least."""
    if row is None or row["value"] is None:
        return Cell("–" if row is None else row["verdict"], math.nan)
    least = "≥ " if row["value"] and not row["error"] else ""
    return Cell(
        least + number(row["value"], row["error"] or 0.0, row.get("freedom")),
        row["value"],
        row["verdict"],
    )


def _physics(cases, summary):
    """A line for each case: what happens, and who does not bear it."""
    rows = []
    for case in cases:
        ours = next((row for row in case["rows"] if row["integrator"] == OURS), None)
        bad = [
            _result(row, case)
            for row in case["rows"]
            if row["verdict"] not in ("pass", "cannot run") and row is not ours
        ]
        rows.append([
            Cell(case["name"]), Cell(_of_this(case["physics"], summary.get("full"))), Cell(f"{_criterion(case, summary)} {_bound(case)}"),
            Cell(_result(ours, case, "") if ours else "not run", verdict=ours["verdict"] if ours else "cannot tell"), Cell("; ".join(bad) or "–"),
        ])  # fmt: skip
    return Table(
        "The cases",
        ("case", "what happens", "number, bound", "ours", "who else does not pass"),
        rows,
    )


def _bound(case):
    return f"{case['bound']} {case['unit']}".strip()


def _result(row, case, name=None):
    """Who came to what in a case, as text."""
    name = f"{row['label'] if name is None else name} "
    if row["value"] is None:
        why = re.sub(
            r"ERROR( on proc \d+)?: (Fix \S+ python/move: )?", "", row["note"] or ""
        )  # who says so
        verb = "cannot run" if row["verdict"] == "cannot run" else "breaks"
        return f"{name}{verb}: {textwrap.shorten(why, 80, placeholder=' …')}".strip()
    doubt = " (cannot tell)" if row["verdict"] == "cannot tell" else ""
    return f"{name}{_few(row)} {case['unit']}".strip() + doubt


def standing(summary):
    """Who comes to which verdict in how many cases, and in which ones, as a Markdown table."""
    cases = summary["cases"]
    verdicts = {row["integrator"]: {} for case in cases for row in case["rows"]}
    labels = {row["integrator"]: row["label"] for case in cases for row in case["rows"]}
    for case in cases:
        for row in case["rows"]:
            verdicts[row["integrator"]].setdefault(
                "fail" if row["verdict"] in LOST else row["verdict"], []
            ).append(case["name"])
    lines = ["| integrator | passes | fails | cannot tell | cannot run |", "|---|---|---|---|---|"]
    for name in sorted(verdicts, key=lambda name: PLACES.get(name, len(PLACES))):
        found = verdicts[name]
        cells = (
            f"{len(found[key])}: {', '.join(found[key])}" if key in found else "0"
            for key in ("fail", "cannot tell", "cannot run")
        )
        lines.append(f"| `{labels[name]}` | {len(found.get('pass', []))} | {' | '.join(cells)} |")
    return "\n".join(lines)
