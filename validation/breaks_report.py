"""From what breaks others to files: summary.json, table.csv, report.html; and to the terminal."""

import csv

from rich.box import SIMPLE_HEAD
from rich.table import Table

from validation.report import page, save

COLUMNS = "case", "what", "integrator", "value", "most", "verdict", "note", "why"


def write(summary, out):
    """Write all files into the folder ``out``.

    Args:
        summary: plain data: ``rows`` as of ``breaks.breaks``, and the circumstances.
    """
    save(summary, out)
    with open(out / "table.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            row | {"value": "" if row["value"] is None else f"{row['value']:.3g}"}
            for row in summary["rows"]
        )
    page(
        "breaks.html",
        out / "report.html",
        [],
        summary=summary,
        fixes=fixes(summary),
        cases=cases(summary),
        shown=shown,
    )


def fixes(summary):
    """Names of the fixes, in order."""
    return list(dict.fromkeys(row["integrator"] for row in summary["rows"]))


def cases(summary):
    """{case: {fix: row}}"""
    found = {}
    for row in summary["rows"]:
        found.setdefault(row["case"], {})[row["integrator"]] = row
    return found


def shown(row):
    """A number as text; that it has ended in its place."""
    if row is None or row["value"] is None:
        return "not run" if row is None else "ends"
    return f"{row['value']:.1e}" if 0 < row["value"] < 1e-3 else f"{row['value']:.2g}"


def show(console, summary, out):
    """Print the numbers, and where the files are."""
    table = Table(
        title="What breaks others: small is good",
        title_justify="left",
        title_style="bold",
        box=SIMPLE_HEAD,
    )
    table.add_column("case", overflow="fold")
    for head in ("at most", *fixes(summary)):
        table.add_column(head, justify="right")
    for name, row in cases(summary).items():
        values = (row.get(fix) for fix in fixes(summary))
        table.add_row(
            name,
            f"{next(iter(row.values()))['most']:.2g}",
            *(shown(one) + " ✗" * (one is not None and one["verdict"] != "pass") for one in values),
        )
    console.print(table)
    for row in summary["rows"]:
        if row["note"] and row["verdict"] != "pass":
            console.print(
                f"✗ {row['case']}, {row['integrator']}: {row['note']}", markup=False, soft_wrap=True
            )
    if summary["interrupted"]:
        console.print("Interrupted.")
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)
