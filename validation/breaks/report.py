"""From what breaks others to files and the terminal."""

from collections import Counter
from pathlib import Path

from rich.console import Console

from ..pages import report, said

COLUMNS = "case", "what", "integrator", "value", "most", "verdict", "note", "why"


def write(summary: dict, out: Path) -> None:
    """Write all files into a folder.

    Args:
        summary: plain data: ``rows`` as of ``measure.breaks``, and the circumstances.
    """
    values = (row["value"] for row in summary["rows"])
    texts = ["" if one is None else f"{one:.3g}" for one in values]
    table = report.frame(summary["rows"], COLUMNS).assign(value=texts)
    found: dict = {"fixes": fixes(summary), "cases": cases(summary), "shown": shown}
    report.write(summary, out, {"table": table}, "breaks.html", **found)


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
    """Print the numbers, and what did not pass."""
    rows = []
    for name, found in cases(summary).items():
        own = [found.get(fix) for fix in fixes(summary)]
        cells = [shown(row) + " ✗" * bool(row and row["verdict"] != "pass") for row in own]
        rows.append([name, f"{next(iter(found.values()))['most']:.2g}", *cells])
    heads = ["case", "at most", *fixes(summary)]
    report.table(console, "What breaks others: small is good", heads, rows)
    failures = [
        f"{row['case']}, {row['integrator']}: {row['note']}"
        for row in summary["rows"]
        if row["note"] and row["verdict"] != "pass"
    ]
    report.end(console, summary, out, failures)


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
