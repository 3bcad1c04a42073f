"""From the counts and the model of `scaling` to files: summary.json, counts.csv, model.csv, a figure, report.html."""

import csv

import matplotlib.pyplot as plt
from rich.table import Table

from validation.bench_figures import MARKS
from validation.figures import draw_each
from validation.report import page, save

COUNTS = (
    "decomposition",
    "integrator",
    "ranks",
    "bodies",
    "messages",
    "bytes",
    "collectives",
    "collective_bytes",
)
MODEL = ("link", "decomposition", "integrator", "ranks", "bodies", "seconds")


def write(summary, out):
    """Write all files into the folder ``out``.

    Args:
        summary: with ``counts`` (rows of `scaling.scaling`), ``model`` (rows of `scaling.model`, with the link's name) and
            ``links``, as plain data.
    """
    save(summary, out)
    for name, columns in ("counts", COUNTS), ("model", MODEL):
        with open(out / f"{name}.csv", "w", newline="") as file:
            writer = csv.DictWriter(file, columns, extrasaction="ignore", lineterminator="\n")
            writer.writeheader()
            writer.writerows(row for row in summary[name] if not row.get("error"))
    page("scaling.html", out / "report.html", draw_each((scaling,), out, summary), summary=summary)


def show(console, summary, out):
    """Print the counts."""
    table = Table(*COUNTS, title="handed to MPI by the fixes, per rank and step")
    for row in summary["counts"]:
        table.add_row(*(row["error"] or "" if key not in row else f"{row[key]:.4g}" if isinstance(row[key], float) else str(row[key])
                        for key in COUNTS))  # fmt: skip
    console.print(table)
    console.print(f"page: {out / 'report.html'}")


def scaling(summary):
    """Bytes per rank and step, and the model's time, against the number of ranks."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
    for rows, axis, value in (summary["counts"], left, lambda row: row["bytes"] + row["collective_bytes"]), (
        [row for row in summary["model"] if row["link"] == summary["links"][0]["name"]], right, lambda row: row["seconds"] * 1e6,
    ):  # fmt: skip
        for decomposition, line in ("slab", "--"), ("brick", "-"):
            for name, (colour, mark) in MARKS.items():
                some = [
                    row
                    for row in rows
                    if (row["decomposition"], row["integrator"]) == (decomposition, name)
                    and not row.get("error")
                ]
                shown = [row for row in some if value(row) > 0]
                if shown:
                    axis.loglog([row["ranks"] for row in shown], [value(row) for row in shown], line, color=colour, marker=mark,
                                label=f"{name}, {decomposition}")  # fmt: skip
        axis.set_xlabel("ranks")
    left.set_ylabel("bytes per rank and step")
    right.set_ylabel("µs per step, by the model")
    right.legend(frameon=False, fontsize=8)
    return figure, "Per rank and step: bytes counted (left), time by the model (right)."
