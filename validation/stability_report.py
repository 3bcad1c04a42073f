"""From the rows of `stability` to files and the terminal: table.csv, a figure, report.html; summary.json is written as rows come."""

import csv

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.patches import Patch
from rich.box import SIMPLE_HEAD
from rich.table import Table

from validation.check import SURE, number
from validation.criteria import CRITERIA
from validation.figures import INK, draw_each
from validation.measures import margin
from validation.report import page
from validation.stability import COMPARED

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
    f"Each case's number against its bound (at the left): a longest step with its {SURE} margin; else number and margin together, which is "
    "what is judged, with < where the number is below its margin; the paler the nearer to the bound. "
    "✗ fails, ? cannot tell, ✸ breaks (not finite, atoms lost, crash or hang), – cannot be run; empty: not run. "
    "Where each number's error comes from, or why it has none, is told case by case."
)
COLUMNS = (
    "case",
    "integrator",
    "label",
    "value",
    "margin",
    "error is",
    "unit",
    "bound",
    "verdict",
    "note",
    "measured with",
    "date",
    "command",
)


def write(summary, out):
    """Write all files but summary.json into the folder ``out``.

    Args:
        summary: plain data, of ``stability.stability``.
    """
    with open(out / "table.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for case in summary["cases"]:
            known = {
                "case": case["name"],
                "error is": case["bars"],
                "unit": case["unit"],
                "bound": case["bound"],
            }
            for row in case["rows"]:
                writer.writerow(
                    {
                        key: (
                            known
                            | row
                            | {"margin": _margin(row) or None, "measured with": package(row)}
                        )[key]
                        for key in COLUMNS
                    }
                )
    page(
        "stability.html",
        out / "report.html",
        draw_each((matrix,), out, summary),
        summary=summary,
        cell=cell,
        number=number,
        verdict=verdict,
        package=package,
        criteria=CRITERIA.values(),
        columns=_columns(summary),
    )


def package(row):
    """With which package a row was measured, as text."""
    return f"fix_nosquish {row['versions']['fix_nosquish']} ({row['versions']['package']}), LAMMPS {row['versions']['lammps']}"


def _columns(summary):
    """Names and labels of the integrators that have rows."""
    found = {row["integrator"]: row["label"] for case in summary["cases"] for row in case["rows"]}
    return {name: found[name] for name in COMPARED if name in found}


def cell(row):
    """A row's entry in the matrix as text: sign and number."""
    if row is None:
        return ""
    sign = LOOKS[row["verdict"]][1]
    value = (
        ""
        if row["value"] is None
        else number(
            row["value"],
            row["error"] if _margin(row) > 1e-3 * abs(row["value"]) else 0.0,
            row.get("freedom"),
        )
    )
    return f"{sign} {value}".strip()


def _margin(row):
    return margin(row["error"] or 0.0, row.get("freedom"))


def list_cases(console, cases):
    """Print all cases and integrators."""
    table = Table(title="Cases", title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    for heading in "case", "physics", "number", "error":
        table.add_column(heading, overflow="fold")
    for case in cases.values():
        table.add_row(case.name, case.physics, case.criterion, case.bars)
    console.print(table)
    table = Table(title="Criteria", title_justify="left", title_style="bold", box=SIMPLE_HEAD)
    for heading in "quantity", "bound", "derived from", "whose need", "cases":
        table.add_column(heading, overflow="fold")
    for one in CRITERIA.values():
        table.add_row(one.quantity, one.text(), one.derivation, one.need, ", ".join(one.cases))
    console.print(table)
    console.print(
        "integrators: " + ", ".join(f'"{name}"' if " " in name else name for name in COMPARED),
        soft_wrap=True,
    )


def show(console, summary, out):
    """Print the matrix, what broke and why, and what all rows together say."""
    columns = _columns(summary)
    table = Table(
        title="Stability",
        title_justify="left",
        title_style="bold",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    table.add_column("case\nbound", overflow="fold")
    for label in columns.values():
        table.add_column(_narrow(label), justify="right", overflow="fold")
    for case in summary["cases"]:
        rows = {row["integrator"]: row for row in case["rows"]}
        cells = [
            (_short(rows.get(name)), LOOKS[rows[name]["verdict"]][2] if name in rows else "")
            for name in columns
        ]
        table.add_row(
            f"{case['name']}\n{case['bound']} {case['unit']}",
            *(f"[{colour}]{text}[/]" if colour else text for text, colour in cells),
        )
    console.print(table)
    console.print(
        ", ".join(f"{look[1]} {name}" if look[1] else name for name, look in LOOKS.items())
    )
    for case in summary["cases"]:
        for row in case["rows"]:
            if (
                row["verdict"] == "blow-up"
                or row["verdict"] != "pass"
                and row["integrator"] == "nosquish"
            ):
                console.print(
                    f"{LOOKS[row['verdict']][1]} {case['name']}, {row['label']}: {row['verdict']} {row['note']}",
                    markup=False,
                    soft_wrap=True,
                )
    for line in summary["summary"]:
        console.print(verdict(line), style="bold", markup=False, soft_wrap=True)
    if summary["interrupted"]:
        console.print("Interrupted: the same command goes on from here.")
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)


def verdict(line):
    """A line of ``stability.told`` as text."""
    where = f" ({', '.join(line['where'])})" if line["where"] else ""
    return (
        f"{line['what']}: "
        + {True: "yes", False: "no" + where, None: "cannot tell, ours has no row yet" + where}[
            line["holds"]
        ]
    )


def _narrow(label):
    return NARROW.get(label) or label.replace(" + nve", "").replace("/small", "/\nsmall").replace(
        " ", "\n"
    )


def _short(row):
    if row is None:
        return ""
    return f"{LOOKS[row['verdict']][1]} {'' if row['value'] is None else format(row['value'], '.2g')}".strip()


def matrix(summary):
    """Cases by integrators, coloured by verdict, each with its number."""
    columns, cases = _columns(summary), summary["cases"]
    if not cases:
        return None, ""
    figure, axis = plt.subplots(
        figsize=(max(7.0, 2.6 + 0.92 * len(columns)), 2.0 + 0.42 * len(cases)), layout="constrained"
    )
    image = np.ones((len(cases), len(columns), 3))
    for y, case in enumerate(cases):
        rows = {row["integrator"]: row for row in case["rows"]}
        for x, name in enumerate(columns):
            if name in rows:
                image[y, x], ink, text = _tile(case, rows[name])
                axis.text(x, y, text, ha="center", va="center", color=ink, fontsize=8.5)
    axis.imshow(image, aspect="auto")
    axis.set_xticks(range(len(columns)), [_narrow(label) for label in columns.values()])
    axis.set_yticks(
        range(len(cases)),
        [f"{case['name']}  {case['bound']} {case['unit']}".strip() for case in cases],
    )
    axis.xaxis.tick_top()
    axis.tick_params(length=0)
    axis.set_xticks(np.arange(len(columns) - 1) + 0.5, minor=True)
    axis.set_yticks(np.arange(len(cases) - 1) + 0.5, minor=True)
    axis.grid(which="minor", color="white", lw=2)
    axis.tick_params(which="minor", length=0)
    axis.spines[:].set_visible(False)
    for label in axis.get_xticklabels():
        label.set_fontweight("bold" if label.get_text().startswith("ours") else "normal")
    axis.legend(handles=[Patch(facecolor=look[0], edgecolor=INK, lw=0.5, label=f"{name} {look[1]}".strip()) for name, look in LOOKS.items()],
                loc="upper left", bbox_to_anchor=(0, -0.01), ncols=len(LOOKS), frameon=False)  # fmt: skip
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
    full, value, unsure = np.array(to_rgb(colour)), row["value"], _margin(row)
    if value is None:
        return full, "white" if full.mean() < 0.5 else INK, sign
    if case["high"] is None:
        judged, text = value - unsure, f"{value:.3g}±{unsure:.1g}" if unsure else f"{value:.3g}"
        decades = (
            SHADES * abs(np.log10(judged / case["low"])) if judged > 0 else np.inf
        )  # a time step is not far off in decades
    else:
        judged = abs(value) + unsure
        decades = abs(np.log10(judged / case["high"])) if judged else np.inf
        text = ("<" if value < unsure else "") + _brief(judged)
    strength = 0.45 + 0.55 * min(1.0, decades / SHADES)
    shade = 1 - strength * (1 - full) if row["verdict"] in ("pass", "fail") else full
    return shade, "white" if shade @ (0.299, 0.587, 0.114) < 0.55 else INK, f"{sign} {text}".strip()
