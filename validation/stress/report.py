"""From the rows of `stability` to files and the terminal; summary.json is written as rows come."""

from collections.abc import Mapping
from pathlib import Path

from rich.console import Console
from rich.text import Text

from ..pages import report
from ..pages.figures import draw_each
from ..pages.page import page
from ..statistics.estimate import Estimate
from .criteria import CRITERIA
from .figures import LOOKS, by_integrator, columns, matrix, narrow, signed
from .measure import COMPARED, Case


def write(summary: dict, out: Path) -> None:
    """Write all files but summary.json into the folder ``out``."""
    lines = [_line(case, row) for case in summary["cases"] for row in case["rows"]]
    report.write_tables(out, {"table": report.frame(lines)})
    figures = draw_each((matrix,), out, summary)
    shown = {"summary": summary, "columns": columns(summary), "criteria": CRITERIA.values()}
    told = {"cell": cell, "verdict": verdict, "package": package}
    page("stability.html", out / "report.html", figures, **shown, **told)


def _line(case, row):
    """A line of table.csv."""
    line = {"case": case["name"], "integrator": row["integrator"], "label": row["label"]}
    line |= {"value": row["value"], "margin": Estimate.of(row).margin or None}
    line |= {"error is": case["bars"], "unit": case["unit"], "bound": case["bound"]}
    line |= {"verdict": row["verdict"], "note": row["note"], "measured with": package(row)}
    return line | {key: row[key] for key in ("date", "command")}


def package(row: dict) -> str:
    """With which package a row was measured, as text."""
    found = row["versions"]
    return f"fix_nosquish {found['fix_nosquish']} ({found['package']}), LAMMPS {found['lammps']}"


def cell(row: dict | None) -> str:
    """A row's entry in the matrix as text: sign and number."""
    if row is None:
        return ""
    number = Estimate.of(row)
    if number.value is None:
        return signed(row, "")
    small = number.margin <= 1e-3 * abs(number.value)
    return signed(row, (Estimate(number.value) if small else number).text())


def list_cases(console: Console, cases: Mapping[str, Case]) -> None:
    """Print all cases and integrators."""
    heads = ["case", "physics", "number", "error"]
    rows = [[one.name, one.physics, one.criterion, one.bars] for one in cases.values()]
    report.table(console, "Cases", heads, rows, heads)
    heads = ["quantity", "bound", "derived from", "whose need", "cases"]
    rows = [
        [one.quantity, one.text(), one.derivation, one.need, ", ".join(one.cases)]
        for one in CRITERIA.values()
    ]
    report.table(console, "Criteria", heads, rows, heads)
    names = ", ".join(f'"{name}"' if " " in name else name for name in COMPARED)
    console.print(f"integrators: {names}", soft_wrap=True)


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the matrix, what broke and why, and what all rows together say."""
    names, rows, notes = columns(summary), [], []
    for case in summary["cases"]:
        own, cells = by_integrator(case), []
        for row in map(own.get, names):
            value = "" if row is None or row["value"] is None else format(row["value"], ".2g")
            cells.append(Text(signed(row, value), LOOKS[row["verdict"]][2]) if row else "")
        rows.append([f"{case['name']}\n{case['bound']} {case['unit']}", *cells])
        for row in case["rows"]:
            missed = row["verdict"] != "pass" and row["integrator"] == "nosquish"
            if missed or row["verdict"] == "blow-up":
                told = f"{case['name']}, {row['label']}: {row['verdict']} {row['note']}"
                notes.append(signed(row, told))
    report.table(console, "Stability", ["case\nbound", *map(narrow, names.values())], rows)
    console.print(", ".join(f"{sign} {name}".strip() for name, (_, sign, _) in LOOKS.items()))
    for note in notes:
        console.print(note, markup=False, soft_wrap=True)
    for line in summary["summary"]:
        console.print(verdict(line), style="bold", markup=False, soft_wrap=True)
    report.end(console, summary, out)


def verdict(line: dict) -> str:
    """A line of ``measure.told`` as text."""
    where = f" ({', '.join(line['where'])})" if line["where"] else ""
    words = {True: "yes", False: f"no{where}", None: f"cannot tell, ours has no row yet{where}"}
    return f"{line['what']}: {words[line['holds']]}"
