"""From the points of ``ensembles`` to files and the terminal."""

from pathlib import Path

from rich.console import Console

from validation.ensembles.criteria import LEAST, MOLECULE, TITLES, TOO_SHORT
from validation.ensembles.figures import bias
from validation.ensembles.plan import BESIDE, REFERENCE, Point
from validation.pages import report
from validation.pages.figures import draw_each
from validation.pages.said import Figure, Said, of_checks
from validation.pages.tables import Column, cell, numbers

COLUMNS = (
    Column("bias", "bias of U/N", "kcal/mol", "estimate"),
    Column("temperature", "temp", "K", "estimate"),
    Column("translation", "T_trans", "K", "estimate"),
    Column("rotation", "T_rot", "K", "estimate"),
    Column("apart", "T_trans − T_rot", "K", "estimate"),
    Column("pressure_bias", "bias of P", "atm", "estimate"),
    Column("drift", "drift", "kcal/mol/ps", "estimate"),
    Column("distribution", "K", "sd"),
    Column("cost", "cost", "s/ps"),
)
SHOWN = [one for one in COLUMNS if one.key not in ("translation", "rotation")]  # in the terminal
MEANS = (
    Column("potential", "potential energy", MOLECULE, "estimate"),
    Column("pressure", "pressure", "atm", "estimate"),
)


def label(row: dict) -> str:
    """A row's scheme and step."""
    return Point(row["scheme"], row["dt"]).label


def limit(summary: dict) -> str:
    """What the reference's means are, and how near it is to the limit of small steps."""
    found = {(row["scheme"], row["dt"]): row for row in summary["rows"] if not row["error"]}
    if (one := found.get(REFERENCE)) is None:
        return f"The reference, {REFERENCE.label}, was not measured: there are no biases."
    told = [f"{cell(one, column)} {column.unit} ({column.title})" for column in MEANS]
    said = f"The reference, {REFERENCE.label}, has {' and '.join(told)}. "
    if (two := found.get(BESIDE)) is None:
        return said + f"How near it is to the limit is not known without {BESIDE.label}."
    told = [f"{cell(two, column)} {column.unit}" for column in COLUMNS if "bias" in column.key]
    return said + f"{BESIDE.dt:g} fs are apart from it by {' and '.join(told)}."


def write(summary: dict, out: Path) -> None:
    """Write summary.json, table.csv, checks.csv, the figure and report.html into a folder.

    Args:
        summary: plain data: ``rows``, ``checks``, settings and circumstances.
    """
    table = [
        {"scheme": row["label"], "step (fs)": row["dt"], "starts": row["starts"]}
        | numbers(row, (*MEANS, *COLUMNS))
        | {"status": row["error"] or "ok"}
        for row in summary["rows"]
    ]
    tables = {"table": report.frame(table), "checks": report.of_checks(summary["checks"])}
    values = {"columns": COLUMNS, "cell": cell, "label": label, "titles": TITLES}
    values |= {"too_short": TOO_SHORT if summary["settings"]["time"] < LEAST else ""}
    figures = draw_each((bias,), out, summary)
    report.write(summary, out, tables, "ensembles.html", figures, **values, limit=limit(summary))


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the points, the checks, what failed and where the files are."""
    heads, cells = ["scheme", "step\nfs", *(one.head for one in SHOWN)], []
    for row in summary["rows"]:
        name = "✗ " * bool(row["error"]) + row["label"]
        step = f"{row['dt']:g}"
        cells.append([name, step, *(cell(row, one, short=True) for one in SHOWN)])
    styles = ["bold" if row["ours"] else None for row in summary["rows"]]
    report.table(console, summary["title"], heads, cells, styles=styles)
    console.print(limit(summary), soft_wrap=True)
    if summary["settings"]["time"] < LEAST:
        console.print(TOO_SHORT, soft_wrap=True)
    else:
        report.show_checks(console, summary["checks"], TITLES)
    failures = [f"{label(row)}: {row['error']}" for row in summary["rows"] if row["error"]]
    report.end(console, summary, out, failures)


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    noun = "statements about what thermostats with long steps sample"
    figures = [Figure("bias.png", "Bias of the mean potential energy against the time step.")]
    return of_checks(summary, TITLES, noun, lines=[limit(summary)], figures=figures)
