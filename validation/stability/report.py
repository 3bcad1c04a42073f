"""From the rows of `stability` to files and the terminal: table.csv, a figure, report.html;
summary.json is written as rows come."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from validation.pages.figures import INK, draw_each
from validation.pages.page import page
from validation.stability.criteria import CRITERIA
from validation.stability.measure import COMPARED, Case
from validation.statistics.estimate import SURE, Estimate

# colours that differ in lightness too, and a sign each
LOOKS = {
    "pass": ("#3b7dbf", "", "blue"),
    "fail": ("#e69f00", "✗", "yellow"),
    "blow-up": ("#1a1a1a", "✸", "red"),
    "cannot tell": ("#c9b8d6", "?", "magenta"),
    "cannot run": ("#f2f2f2", "–", "bright_black"),
}
SHADES = 6.0  # decades from the bound at which a colour is full
NARROW = {"fix_nosquish.NVE": "ours\n(NVE)"}
READ = (
    f"Each case's number against its bound (at the left): a longest step with its {SURE} margin; "
    "else number and margin together, which is what is judged, with < where the number is below "
    "its margin; the paler the nearer to the bound. ✗ fails, ? cannot tell, ✸ breaks (not finite, "
    "atoms lost, crash or hang), – cannot be run; empty: not run. Where each number's error comes "
    "from, or why it has none, is told case by case."
)


def write(summary: dict, out: Path) -> None:
    """Write all files but summary.json into the folder ``out``."""
    lines = [_line(case, row) for case in summary["cases"] for row in case["rows"]]
    pd.DataFrame(lines, dtype=object).to_csv(out / "table.csv", index=False)
    figures = draw_each((matrix,), out, summary)
    shown = {"summary": summary, "columns": _columns(summary), "criteria": CRITERIA.values()}
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


def _columns(summary):
    """Names and labels of the integrators that have rows."""
    found = {row["integrator"]: row["label"] for case in summary["cases"] for row in case["rows"]}
    return {name: found[name] for name in COMPARED if name in found}


def _rows(case):
    return {row["integrator"]: row for row in case["rows"]}


def _signed(row, text):
    """The sign of a row's verdict, and a text."""
    return f"{LOOKS[row['verdict']][1]} {text}".strip()


def cell(row: dict | None) -> str:
    """A row's entry in the matrix as text: sign and number."""
    if row is None:
        return ""
    number = Estimate.of(row)
    if number.value is None:
        return _signed(row, "")
    small = number.margin <= 1e-3 * abs(number.value)
    return _signed(row, (Estimate(number.value) if small else number).text())


def list_cases(console: Console, cases: Mapping[str, Case]) -> None:
    """Print all cases and integrators."""
    table = _table("Cases", "case", "physics", "number", "error")
    for case in cases.values():
        table.add_row(case.name, case.physics, case.criterion, case.bars)
    console.print(table)
    table = _table("Criteria", "quantity", "bound", "derived from", "whose need", "cases")
    for one in CRITERIA.values():
        table.add_row(one.quantity, one.text(), one.derivation, one.need, ", ".join(one.cases))
    console.print(table)
    names = ", ".join(f'"{name}"' if " " in name else name for name in COMPARED)
    console.print(f"integrators: {names}", soft_wrap=True)


def _table(title, *heads, justify="left", **how):
    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, **how)
    for head in heads:
        table.add_column(head, justify="left" if head == heads[0] else justify, overflow="fold")
    return table


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the matrix, what broke and why, and what all rows together say."""
    columns, notes = _columns(summary), []
    heads = map(_narrow, columns.values())
    table = _table("Stability", "case\nbound", *heads, justify="right", padding=(0, 1, 0, 0))
    for case in summary["cases"]:
        rows, cells = _rows(case), []
        for row in map(rows.get, columns):
            value = "" if row is None or row["value"] is None else format(row["value"], ".2g")
            cells.append(f"[{LOOKS[row['verdict']][2]}]{_signed(row, value)}[/]" if row else "")
        table.add_row(f"{case['name']}\n{case['bound']} {case['unit']}", *cells)
        for row in case["rows"]:
            missed = row["verdict"] != "pass" and row["integrator"] == "nosquish"
            if missed or row["verdict"] == "blow-up":
                told = f"{case['name']}, {row['label']}: {row['verdict']} {row['note']}"
                notes.append(_signed(row, told))
    console.print(table)
    console.print(", ".join(f"{sign} {name}".strip() for name, (_, sign, _) in LOOKS.items()))
    for note in notes:
        console.print(note, markup=False, soft_wrap=True)
    for line in summary["summary"]:
        console.print(verdict(line), style="bold", markup=False, soft_wrap=True)
    if summary["interrupted"]:
        console.print("Interrupted: the same command goes on from here.")
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)


def verdict(line: dict) -> str:
    """A line of ``measure.told`` as text."""
    where = f" ({', '.join(line['where'])})" if line["where"] else ""
    words = {True: "yes", False: f"no{where}", None: f"cannot tell, ours has no row yet{where}"}
    return f"{line['what']}: {words[line['holds']]}"


def _narrow(label):
    short = label.replace(" + nve", "").replace("/small", "/\nsmall").replace(" ", "\n")
    return NARROW.get(label, short)


def matrix(summary: dict) -> tuple[Figure | None, str]:
    """Cases by integrators, coloured by verdict, each with its number."""
    columns, cases = _columns(summary), summary["cases"]
    if not cases:
        return None, ""
    size = max(7.0, 2.6 + 0.92 * len(columns)), 2.0 + 0.42 * len(cases)
    figure, axis = plt.subplots(figsize=size, layout="constrained")
    image = np.ones((len(cases), len(columns), 3))
    for y, case in enumerate(cases):
        rows = _rows(case)
        for x, name in enumerate(columns):
            if name in rows:
                image[y, x], ink, text = _tile(case, rows[name])
                axis.text(x, y, text, ha="center", va="center", color=ink, fontsize=8.5)
    axis.imshow(image, aspect="auto")
    names = [f"{case['name']}  {case['bound']} {case['unit']}".strip() for case in cases]
    axis.set_xticks(range(len(columns)), [_narrow(label) for label in columns.values()])
    axis.set_yticks(range(len(cases)), names)
    axis.xaxis.tick_top()
    axis.set_xticks(np.arange(len(columns) - 1) + 0.5, minor=True)
    axis.set_yticks(np.arange(len(cases) - 1) + 0.5, minor=True)
    axis.grid(which="minor", color="white", lw=2)
    axis.tick_params(which="both", length=0)
    axis.spines[:].set_visible(False)
    for label in axis.get_xticklabels():
        label.set_fontweight("bold" if label.get_text().startswith("ours") else "normal")
    patches = [
        Patch(facecolor=colour, edgecolor=INK, lw=0.5, label=f"{name} {sign}".strip())
        for name, (colour, sign, _) in LOOKS.items()
    ]
    axis.legend(
        handles=patches,
        loc="upper left",
        bbox_to_anchor=(0, -0.01),
        ncols=len(LOOKS),
        frameon=False,
    )
    return figure, READ


def _brief(x):
    """A positive number in few characters."""
    if x == 0 or 0.01 <= x < 99.5:
        return f"{x:.2g}"
    digit, exponent = f"{x:.0e}".split("e")
    return f"{digit}e{int(exponent)}".replace("-", "−")


def _tile(case, row):
    """Colour of a tile, of its text, and the text."""
    colour, sign, _ = LOOKS[row["verdict"]]
    full, value, unsure = np.array(to_rgb(colour)), row["value"], Estimate.of(row).margin
    if value is None:
        return full, "white" if full.mean() < 0.5 else INK, sign
    if case["high"] is None:  # a time step is not far off in decades
        judged, times = value - unsure, SHADES
        text = f"{value:.3g}±{unsure:.1g}" if unsure else f"{value:.3g}"
    else:
        judged, times = abs(value) + unsure, 1.0
        text = ("<" if value < unsure else "") + _brief(judged)
    bound = case["low"] if case["high"] is None else case["high"]
    decades = times * abs(np.log10(judged / bound)) if judged > 0 else np.inf
    strength = 0.45 + 0.55 * min(1.0, decades / SHADES)
    shade = 1 - strength * (1 - full) if row["verdict"] in ("pass", "fail") else full
    return shade, "white" if shade @ (0.299, 0.587, 0.114) < 0.55 else INK, _signed(row, text)
