"""The report of `check`."""

from ..pages import Column, Report, Table
from ..scenes.units import UNITS
from ..statistics.check import VERDICTS
from ..user_script import conserved_energy
from .measure import STEPS, TITLES


def describe(summary: dict) -> Report:
    """The report on whether a script is sound."""
    checks = summary["checks"]
    out, unknown = (_subjects(checks, verdict) for verdict in VERDICTS[1:])
    sentences = f"Out of their bounds: {out}." * bool(out), f"Not known: {unknown}." * bool(unknown)
    answer = " ".join(filter(None, sentences)) or "All numbers that have bounds are within them."
    if none_starts(summary):
        answer = "No integrator can run the start: LAMMPS's errors are in the table."
    labels = ", ".join(row["label"] for row in summary["integrators"] if row["uncounted"])
    return Report(
        f"Check: {summary['title']}",
        "Is this script sound: its bodies, its step, its fixes?",
        answer,
        lines=[
            *summary["notes"],
            *[f"Energies of {labels} are left out: {conserved_energy.WHY}."] * bool(labels),
            *summary["suffix"],
        ],
        tables=[_kinds(summary), _starts(summary)],
        checks=checks,
        parts=TITLES,
        checks_file="table",
        failures=[
            f"{row['label']}: {row['error']}" for row in summary["integrators"] if row["error"]
        ],
    )


def none_starts(summary: dict) -> bool:
    """Whether each integrator that was tried has failed."""
    rows = summary["integrators"]
    return bool(rows) and all(row["error"] for row in rows)


def is_sound(summary: dict) -> bool:
    """Whether all numbers are known and within their bounds, and an integrator can run."""
    return not none_starts(summary) and not any(
        check["verdict"] in VERDICTS[1:] for check in summary["checks"]
    )


def _subjects(checks: list[dict], verdict: str) -> str:
    """Name the checks with a verdict, each once."""
    named = (_subject(check) for check in checks if check["verdict"] == verdict)
    return ", ".join(dict.fromkeys(named))


def _subject(check: dict) -> str:
    """Name a check; for a step, whether it is unstable or inaccurate."""
    kind = check["what"].partition(":")[0]
    named = {"stability": "the step is unstable", "accuracy": "the step is inaccurate"}
    return f"{check['subject']} ({named[kind]})" if kind in named else check["subject"]


def _kinds(summary: dict) -> Table:
    """A table of the kinds of bodies."""
    rows = [
        [
            *(kind["name"], f"{kind['number']:,}", kind["atoms"], kind["shape"], kind["freedom"]),
            *(f"{kind['mass']:.4g}", f"{kind['size']:.4g}"),
            *(" ".join(f"{value:.4g}" for value in kind["moments"]), f"{kind['angle']:.2g} rad"),
        ]
        for kind in summary["kinds"]
    ]
    return Table.of(
        f"Kinds of bodies; the turn is in one step of {summary['dt']:g} "
        f"{UNITS[summary['units']].time}",
        "bodies of types, number, atoms, shape, freedom, mass, size, moments, turn",
        rows,
    )


def _starts(summary: dict) -> Table:
    """A table of the start with each integrator."""
    units = UNITS[summary["units"]]
    columns = [
        Column("label", "integrator", kind="text"),
        Column("temperature", "temperature", units.temperature, "number", ".6g"),
        Column("freedom", "degrees of freedom", kind="number"),
        Column("pressure", "pressure", units.pressure, "number", ".6g"),
        Column("potential", "potential energy", units.energy, "number", ".6g"),
        Column("change", f"range of its energy in {STEPS} steps", units.energy, "number", ".6g"),
        Column("status", "status", kind="text"),
    ]
    return Table(
        "What each integrator makes of the start",
        columns,
        [row | {"status": row["error"] or "ok"} for row in summary["integrators"]],
    )
