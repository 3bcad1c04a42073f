"""From a summary to files: summary.json, table.csv, series.csv, report.html."""

import base64
import csv
import json
from dataclasses import dataclass
from pathlib import Path

import jinja2

from validation import machine

from validation.measures import margin

FREE = 90.0  # percent of a core that a rank must have had
TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Column:
    """A column of the comparison: where its numbers are, and what they mean."""

    key: str
    title: str
    unit: str
    kind: str  # "estimate": value, standard error, its degrees of freedom; "number"; "spread": median, min, max
    meaning: str


COLUMNS = (
    Column(
        "energy_sd",
        "sd of energy",
        "kcal/mol",
        "estimate",
        "Standard deviation of the total energy of the whole box about its mean. "
        "± is the half width of its 95 % interval, correlation in time included; so it is in the next columns. "
        "It says so where the energy drifts: then this number grows with the length of the run.",
    ),
    Column(
        "energy_sd_line",
        "sd about its line",
        "kcal/mol",
        "estimate",
        "The same about the straight line through the energy: what is left of it without its drift.",
    ),
    Column(
        "drift",
        "energy drift",
        "kcal/mol/ps",
        "estimate",
        "Slope of the total energy, the mean of those of seven stretches of the run. If it is smaller "
        "than what stands beside it, it is not distinguishable from zero.",
    ),
    Column("temperature", "temperature", "K", "estimate", "Mean of LAMMPS's temp."),
    Column(
        "pressure",
        "pressure",
        "atm",
        "estimate",
        "Mean of LAMMPS's press. LAMMPS's rigid fixes average the constraint virial over two "
        "half steps.",
    ),
    Column(
        "distance",
        "distance",
        "Å",
        "number",
        "Largest distance of any atom, nearest image, from the same atom with rigid/nve "
        "after the first steps ({distance_after_steps} of them). Two methods that are exact up "
        "to rounding differ by rounding that the chaotic motion has amplified; two that differ "
        "in their time discretisation, as rigid/nve and shake do, differ by far more.",
    ),
    Column(
        "rigidity",
        "rigidity",
        "Å",
        "number",
        "Largest change, from the start to the end of the run, of any distance within a body.",
    ),
    Column(
        "modify",
        "Modify",
        "µs/step",
        "spread",
        "Time in the fixes (row Modify of LAMMPS's timing table, average over ranks). Median "
        "[minimum–maximum] of {timing_rounds} segments of {timing_steps} steps, run in turn with "
        "those of the other integrators.",
    ),
    Column(
        "modify_ratio",
        "vs rigid/nve",
        "ratio",
        "spread",
        "The same over that of rigid/nve in the same round.",
    ),
    Column("loop", "loop", "ms/step", "spread", "Wall time of a whole step in the same segments."),
)


def cell(row, column, short=False):
    """A row's entry in a column as text; ``short`` leaves out minimum and maximum."""
    value = row.get(column.key)
    if value is None:
        return "–"
    if column.kind == "estimate":
        drifts = (
            column.key == "energy_sd"
            and "drift" in row
            and abs(row["drift"]["value"]) > _margin(row["drift"])
        )
        return estimate(value["value"], _margin(value)) + ", drifts" * drifts
    if column.kind == "number":
        return f"{value:.1e}" if value else "0"
    digits = 0 if value["median"] >= 100 else 2
    if short:
        return f"{value['median']:.{digits}f}"
    return f"{value['median']:.{digits}f} [{value['min']:.{digits}f}–{value['max']:.{digits}f}]"


def _margin(found):
    return margin(found["error"], found.get("freedom"))


def estimate(value, margin):
    """Value ± margin, to two digits of the margin."""
    if not margin > 0:
        return f"{value:.4g}"
    digits = 0
    while margin * 10**digits < 9.5 and digits < 12:
        digits += 1
    return f"{value:.{digits}f} ± {margin:.{digits}f}"


def status(row):
    """In words: whether the row is complete, and if not, why."""
    if not row["error"]:
        return "ok"
    done = f" after {row['steps']} steps" if row["steps"] else ""
    return f"{row['error']}{done}"


def busy(summary):
    """A warning if the machine was too busy for its timings to be trusted, or None."""
    shares = [row["cpu"] for row in summary["integrators"] if row.get("cpu") is not None]
    if not shares or min(shares) >= FREE:
        return None
    return (
        f"The machine was busy: a rank had as little as {min(shares):.0f} % of a core while "
        "timed. Ratios of one round still compare like with like; absolute times are too long."
    )


def save(summary, out):
    """Write plain data to summary.json in the folder ``out``, whole or not at all."""
    path = out / "summary.json"
    part = path.with_suffix(".part")
    part.write_text(json.dumps(summary, indent=1, ensure_ascii=False) + "\n")
    part.replace(path)


def write(summary, series, figures, out):
    """Write all files of a comparison into the folder ``out``.

    Args:
        summary: plain data.
        series: integrator name to thermo table.
        figures: list of (PNG path, caption).
    """
    save(summary, out)
    _write_table(summary, out / "table.csv")
    _write_series(series, out / "series.csv")
    _write_page(summary, figures, out / "report.html")


def _write_table(summary, path):
    parts = {"estimate": ("value", "margin"), "spread": ("median", "min", "max")}
    header, picks = ["integrator"], []
    for column in COLUMNS:
        for part in parts.get(column.kind, (None,)):
            suffix = f" {part}" if part not in (None, "value") else ""
            header.append(f"{column.title}{suffix} ({column.unit})")
            picks.append((column.key, part))
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*header, "status"])
        for row in summary["integrators"]:
            values = [
                "" if row.get(key) is None else _margin(row[key]) if part == "margin"
                else row[key][part] if part else row[key] for key, part in picks
            ]  # fmt: skip
            writer.writerow([row["label"], *values, status(row)])


def _write_series(series, path):
    """Thermo samples of all integrators, one row each."""
    with open(path, "w", newline="") as file:
        writer = csv.writer(file)
        names = list(next(iter(series.values()), {"Step": []}))
        writer.writerow(["integrator", *names])
        for name, table in series.items():
            for values in zip(*(table[column] for column in names)):
                writer.writerow([name, int(values[0]), *(f"{value:.12g}" for value in values[1:])])


def _write_page(summary, figures, path):
    page(
        "compare.html", path, figures,
        summary=summary,
        columns=COLUMNS,
        meanings=[column.meaning.format(**summary["settings"]) for column in COLUMNS],
        cell=cell,
        status=status,
        busy=busy(summary),
    )  # fmt: skip


def page(template, path, figures, **values):
    """Write a self-contained HTML page.

    Args:
        template: its name in ``templates``.
        path: of the page.
        figures: list of (PNG path, caption).
        values: what else the template uses.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["package"] = machine.package
    embedded = [
        (base64.b64encode(Path(png).read_bytes()).decode(), caption) for png, caption in figures
    ]
    Path(path).write_text(environment.get_template(template).render(figures=embedded, **values))
