"""From what breaks others to files: summary.json, table.csv, report.html; and to the terminal."""

from collections import Counter
from pathlib import Path

import pandas as pd
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from validation.pages import said
from validation.pages.page import page, save

COLUMNS = ["case", "what", "integrator", "value", "most", "verdict", "note", "why"]


def write(summary: dict, out: Path) -> None:
    """Write all files into a folder.

    Args:
        summary: plain data: ``rows`` as of ``measure.breaks``, and the circumstances.
    """
    save(summary, out)
    table = pd.DataFrame(summary["rows"], columns=COLUMNS)
    table["value"] = ["" if one is None else f"{one:.3g}" for one in _values(summary)]
    table.to_csv(out / "table.csv", index=False)
    found = {"fixes": fixes(summary), "cases": cases(summary), "shown": shown}
    page("breaks.html", out / "report.html", [], summary=summary, **found)


def _values(summary):
    return [row["value"] for row in summary["rows"]]


def fixes(summary: dict) -> list[str]:
    """Names of the fixes, in order."""
    return list(dict.fromkeys(row["integrator"] for row in summary["rows"]))


def cases(summary: dict) -> dict[str, dict[str, dict]]:
    """{case: {fix: row}}"""
    found: dict[str, dict[str, dict]] = {}
    for row in summary["rows"]:
        found.setdefault(row["case"], {})[row["integrator"]] = row
    return found


def shown(row: dict | None) -> str:
    """A number as text; that it has ended in its place."""
    if row is None or row["value"] is None:
        return "not run" if row is None else "ends"
    return f"{row['value']:.1e}" if 0 < row["value"] < 1e-3 else f"{row['value']:.2g}"


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the numbers, and where the files are."""
    title = "What breaks others: small is good"
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    table.add_column("case", overflow="fold")
    for head in ("at most", *fixes(summary)):
        table.add_column(head, justify="right")
    for name, found in cases(summary).items():
        rows = [found.get(fix) for fix in fixes(summary)]
        cells = (shown(row) + " ✗" * bool(row and row["verdict"] != "pass") for row in rows)
        table.add_row(name, f"{next(iter(found.values()))['most']:.2g}", *cells)
    console.print(table)
    for row in summary["rows"]:
        if row["note"] and row["verdict"] != "pass":
            told = f"✗ {row['case']}, {row['integrator']}: {row['note']}"
            console.print(told, markup=False, soft_wrap=True)
    if summary["interrupted"]:
        console.print("Interrupted.")
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)


def say(summary: dict) -> said.Said:
    """For the report of all verbs."""
    told, rows = [], []
    for fix in fixes(summary):
        count = Counter(row["verdict"] for row in summary["rows"] if row["integrator"] == fix)
        words = {"fail": "wrong", "ends": "ended by an error or a crash"}
        bad = ", ".join(
            f"{count[verdict]} {one}" for verdict, one in words.items() if count[verdict]
        )
        told.append(f"{fix} {count['pass']}" + f" ({bad})" * bool(bad))
    for name, found in cases(summary).items():
        some = next(iter(found.values()))
        cells = (_cell(found.get(fix)) for fix in fixes(summary))
        rows.append([name, some["what"], said.Cell.number(some["most"], ".2g"), *cells])
    number = len(cases(summary))
    sentence = f"Passed, of {number} cases that users report as broken: {'; '.join(told)}."
    head = "case", "what is measured", "at most", *fixes(summary)
    best = said.Table.of("Small is good", head, rows)
    return said.Said([sentence], best=[best], short=[sentence])


def _cell(row):
    verdict = row["verdict"] if row else ""
    return said.Cell(shown(row), said.sortable(row and row["value"]), verdict)
