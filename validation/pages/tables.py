"""Columns of tables, and their cells as text and as numbers."""

from collections.abc import Iterable
from dataclasses import dataclass

from ..statistics.estimate import Estimate, rounded

INTERVAL = "value", "low", "high"
FREE = 90.0  # percent of a core that a rank must have had


@dataclass(frozen=True)
class Column:
    """A column of a table: where its numbers are in a row, and how they are called.

    Attributes:
        kind: ``estimate`` (value, error, freedom), ``spread`` (median, min, max), ``interval``
            (value, low, high; None is infinite) or ``number``.
    """

    key: str
    title: str
    unit: str
    kind: str = "spread"

    @property
    def head(self) -> str:
        """Its heading in the terminal."""
        return f"{self.title}\n{self.unit}"


def cell(row: dict, column: Column, short: bool = False) -> str:
    """A row's entry in a column as text; ``short`` leaves out minimum and maximum of a time, but
    not of a ratio, whose range says whether the machine let it be told."""
    value = row.get(column.key)
    if value is None:
        return "–"
    if column.kind == "estimate":
        drift = Estimate.of(row["drift"]) if row.get("drift") else Estimate(0.0)
        drifts = column.key == "energy_sd" and abs(drift.value) > drift.margin
        return rounded(value["value"], Estimate.of(value).margin) + ", drifts" * drifts
    if column.kind == "number":
        return f"{value:.1e}" if value else "0"
    if column.kind == "interval":
        middle, least, most = (_digits(value[part]) for part in INTERVAL)
        return f"{middle} ({least}–{most})"
    median, low, high = (
        f"{value[part]:.{0 if value['median'] >= 100 else 2}f}" for part in ("median", "min", "max")
    )
    in_short = short and not column.key.endswith("_ratio")
    return median if in_short else f"{median} [{low}–{high}]"


def _digits(value: float | None) -> str:
    """A number with two digits at least; None is infinite."""
    if value is None:
        return "∞"
    return f"{value:,.0f}" if abs(value) >= 10 else f"{value:.2g}"


def numbers(row: dict, columns: Iterable[Column]) -> dict:
    """A row's entries as the cells of a CSV file, by their headings; None where there is none."""
    found: dict = {}
    for column in columns:
        value = row.get(column.key)
        if column.kind == "number":
            parts = {"": value}
        elif column.kind == "estimate":
            known = Estimate.of(value) if value else None
            parts = {"": known and known.value, " margin": known and known.margin}
        elif column.kind == "interval":
            parts = {f" {part}".replace(" value", ""): value and value[part] for part in INTERVAL}
        else:
            parts = {f" {part}": value and value[part] for part in ("median", "min", "max")}
        found |= {f"{column.title}{part} ({column.unit})": one for part, one in parts.items()}
    return found


def busy(summary: dict) -> str | None:
    """A warning if the machine was too busy for its timings to be trusted, or None."""
    shares = [row["cpu"] for row in summary["integrators"] if row.get("cpu") is not None]
    if not shares or min(shares) >= FREE:
        return None
    return (
        f"The machine was busy: a rank had as little as {min(shares):.0f} % of a core while "
        "timed. Times are too long, and a ratio is wrong where the other integrator had its cores: "
        "believe only one with a narrow range, or measure again with a free core for each rank."
    )


def ranks_of(number: int) -> str:
    """'1 rank', '2 ranks'."""
    return f"{number} rank" + "s" * (number != 1)
