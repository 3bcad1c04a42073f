"""Columns of tables, and their cells as text."""

from dataclasses import dataclass

from validation.statistics.estimate import Estimate, rounded

FREE = 90.0  # percent of a core that a rank must have had


@dataclass(frozen=True)
class Column:
    """A column of the comparison: where its numbers are, and what they mean."""

    key: str
    title: str
    unit: str
    # "estimate": value, standard error, its degrees of freedom; "number"; "spread": median, min,
    # max
    kind: str
    meaning: str


def cell(row: dict, column: Column, short: bool = False) -> str:
    """A row's entry in a column as text; ``short`` leaves out minimum and maximum."""
    value = row.get(column.key)
    if value is None:
        return "–"
    if column.kind == "estimate":
        drift = Estimate.of(row["drift"]) if "drift" in row else Estimate(0.0)
        drifts = column.key == "energy_sd" and abs(drift.value) > drift.margin
        return rounded(value["value"], Estimate.of(value).margin) + ", drifts" * drifts
    if column.kind == "number":
        return f"{value:.1e}" if value else "0"
    digits = 0 if value["median"] >= 100 else 2
    if short:
        return f"{value['median']:.{digits}f}"
    return f"{value['median']:.{digits}f} [{value['min']:.{digits}f}–{value['max']:.{digits}f}]"


def busy(summary: dict) -> str | None:
    """A warning if the machine was too busy for its timings to be trusted, or None."""
    shares = [row["cpu"] for row in summary["integrators"] if row.get("cpu") is not None]
    if not shares or min(shares) >= FREE:
        return None
    return (
        f"The machine was busy: a rank had as little as {min(shares):.0f} % of a core while "
        "timed. Ratios of one round still compare like with like; absolute times are too long."
    )
