"""The report of `stress`."""

from collections import Counter
from collections.abc import Iterable, Mapping
from functools import partial

from rich.console import Console

from ..pages import Cell, Column, Figure, Report, Table, show_table
from ..scenes.integrators import OURS
from ..statistics.estimate import Estimate
from .criteria import CRITERIA
from .figures import READ, matrix
from .measure import ALL, EXTREME, REPORTED, Case, find_defeats

TABLES = {
    EXTREME: "Extreme cases",
    REPORTED: "Problems that users have reported, in Lennard-Jones units: smaller is better",
}
MEASURED_WITH = "fix_nosquish {fix_nosquish} ({package}), LAMMPS {lammps}"
KEYS = (
    *("case", "integrator", "label", "value", "margin", "error is", "unit", "bound"),
    *("verdict", "note", "measured with", "date", "command"),
)


def describe(summary: dict) -> Report:
    """The report on what fails and where."""
    cases = summary["cases"]
    every = [(case, row) for case in cases for row in case["rows"]]
    extreme, reported = ([case for case in cases if case["part"] == part] for part in TABLES)
    lines = [
        f"{what}: {', '.join(names) or 'none'}." for what, names in find_defeats(cases).items()
    ]
    waiting = [case["name"] for case in cases if len(case["rows"]) < len(case["integrators"])]
    if waiting:
        lines.append(f"Not all integrators have run yet in {', '.join(waiting)}.")
    return Report(
        "What breaks, where",
        "Which integrator fails at long steps, in hot or cold systems, with unusual shapes, far "
        "from the origin, and in the cases that users have reported?",
        _answer(cases),
        lines=lines,
        tables=[
            _table(TABLES[EXTREME], extreme),
            _table(TABLES[REPORTED], reported),
            _bounds(),
            Table("", [Column(key, key, kind="text") for key in KEYS], _lines(every), "table"),
        ],
        figures=[Figure("matrix", partial(matrix, extreme), READ)],
        notes={case["name"]: f"{case['criterion']}. Error: {case['bars']}." for case in cases},
        failures=[
            f"{case['name']}, {row['label']}: {row['note']}"
            for case, row in every
            if row["verdict"] == "blow-up"
        ],
        defeats=[
            f"{case['name']}: {row['verdict']}"
            for case, row in every
            if row["integrator"] == OURS and row["verdict"] not in ("pass", "cannot run")
        ]
        + [text for case in extreme for text in _longer(case)],
    )


def _longer(case: dict) -> list[str]:
    """Name the integrators with a longer step than ours, in a case whose number is a step."""
    ours = next((row for row in case["rows"] if row["integrator"] == OURS), None)
    if ours is None or ours["value"] is None or case["low"] is None:
        return []
    most = ours["value"] + Estimate.of(ours).margin
    text = f"ours {_number_cell(ours).text} {case['unit']}"
    return [
        f"{case['name']}: {row['label']} runs with {_number_cell(row).text} {case['unit']}, {text}."
        for row in case["rows"]
        if row["value"] is not None and row["value"] - Estimate.of(row).margin > most
    ]


def _answer(cases: Iterable[dict]) -> str:
    """Say how many cases ours passes, and which of LAMMPS's fixes passes most."""
    rows = [row for case in cases for row in case["rows"]]
    ran = Counter(row["label"] for row in rows if row["verdict"] != "cannot run")
    passed = Counter(row["label"] for row in rows if row["verdict"] == "pass")
    kinds = {row["label"]: row["kind"] for row in rows}
    theirs = [label for label in ran if kinds[label] != "ours"]
    best = max(theirs, key=lambda label: passed[label] / ran[label], default=None)
    ours = next((row["label"] for row in rows if row["integrator"] == OURS), None)
    sentences = []
    if ours:
        sentences.append(f"{ours} passes {passed[ours]} of the {ran[ours]} cases that it can run.")
    if best:
        sentences.append(
            f"The best of LAMMPS's fixes, {best}, passes {passed[best]} of {ran[best]}."
        )
    return " ".join(sentences)


def _labels(cases: Iterable[dict]) -> dict[str, str]:
    """Names and labels of the integrators that have rows, in order."""
    label_of = {row["integrator"]: row["label"] for case in cases for row in case["rows"]}
    return {name: label_of[name] for name in ALL if name in label_of}


def _lines(every: Iterable[tuple[dict, dict]]) -> list[dict]:
    """The lines of table.csv."""
    return [
        {**row, "case": case["name"], "margin": Estimate.of(row).margin or None}
        | {"error is": case["bars"], "unit": case["unit"], "bound": case["bound"]}
        | {"measured with": MEASURED_WITH.format(**row["versions"])}
        for case, row in every
    ]


def _number_cell(row: Mapping | None) -> Cell:
    """A row's number, with its verdict."""
    if row is None:
        return Cell("not run")
    if row["value"] is None:
        return Cell(
            "breaks" if row["verdict"] == "blow-up" else "cannot run", verdict=row["verdict"]
        )
    number = Estimate.of(row)
    small = number.margin <= 1e-3 * abs(number.value)
    return Cell((Estimate(number.value) if small else number).text(), row["value"], row["verdict"])


def _table(title: str, cases: list[dict]) -> Table:
    """A table of cases by integrators."""
    labels, rows = _labels(cases), []
    for case in cases:
        by_name = {row["integrator"]: row for row in case["rows"]}
        bound = f"{case['bound']} {case['unit']}".strip()
        numbers = (_number_cell(by_name.get(name)) for name in labels)
        rows.append([case["name"], case["physics"], bound, *numbers])
    return Table.of(title, ["case", "what happens", "bound", *labels.values()], rows)


def _bounds() -> Table:
    """A table of every bound, with its derivation."""
    head = "quantity, bound, derived from, whose need, cases"
    rows = [
        (
            criterion.quantity,
            criterion.text(),
            criterion.derivation,
            criterion.need,
            criterion.cases.replace(" ", ", "),
        )
        for criterion in CRITERIA.values()
    ]
    return Table.of(
        "Bounds, each derived from physics or from what users need, not from results",
        head,
        rows,
        long=True,
    )


def list_cases(console: Console, cases: Mapping[str, Case]) -> None:
    """Print all cases, bounds and integrators."""
    rows = [(case.name, case.physics, case.criterion, case.bound.text(), case.bars)
            for case in cases.values()]  # fmt: skip
    show_table(console, Table.of("Cases", "case, physics, number, bound, error", rows))
    show_table(console, _bounds())
    names = ", ".join(f'"{name}"' if " " in name else name for name in ALL)
    console.print(f"integrators: {names}", soft_wrap=True)
