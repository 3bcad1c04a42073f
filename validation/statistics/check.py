"""A number beside the bounds that it is held against, and how such numbers are shown: in the
terminal and as CSV."""

import csv
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from validation.statistics.estimate import SURE, Estimate

COLUMNS = (
    "part",
    "subject",
    "what",
    "value",
    "margin",
    "unit",
    "low",
    "high",
    "verdict",
    "note",
    "source",
)


@dataclass(frozen=True)
class Check:
    """A number, and between which bounds it has to be.

    Attributes:
        part: under which heading it stands.
        subject: whose number it is.
        what: the number, in words.
        value: measured; None if it could not be.
        error: its standard error; 0 for a number that has none, as one that is computed, not
            sampled.
        freedom: degrees of freedom of the error; None for many.
        low, high: bounds; None for none.
        unit: of all of these.
        note: what else there is to say, as why there is no value.
        source: who says so.
    """

    part: str
    subject: str
    what: str
    value: float | None
    error: float = 0.0
    low: float | None = None
    high: float | None = None
    unit: str = ""
    note: str = ""
    source: str = ""
    freedom: float | None = field(default=None, kw_only=True)

    @classmethod
    def of(
        cls, part: str, subject: str, what: str, found: Estimate | float | None, **more
    ) -> "Check":
        """The check of an `Estimate`, of a number without an error, or of none."""
        one = found if isinstance(found, Estimate) else Estimate(found)
        number = {"value": None} if one.value is None else one.plain()
        return cls(part, subject, what, **number | more)

    @property
    def estimate(self) -> Estimate:
        """The number with its error."""
        return Estimate(self.value, self.error, self.freedom)

    @property
    def margin(self) -> float:
        """Half the width of the 95 % interval."""
        return self.estimate.margin

    @property
    def holds(self) -> bool | None:
        """Whether all of value ± `margin` is within the bounds: False if all is outside of them,
        None if neither, or without bounds."""
        if self.value is None or (self.low is None and self.high is None):
            return None
        low, high = (
            -np.inf if self.low is None else self.low,
            np.inf if self.high is None else self.high,
        )
        least, most = self.value - self.margin, self.value + self.margin
        if low <= least and most <= high:
            return True
        return False if most < low or least > high else None

    @property
    def verdict(self) -> str:
        """`holds` in words; empty for a number without bounds."""
        if self.value is not None and self.low is None and self.high is None:
            return ""
        return {True: "holds", False: "does not hold", None: "cannot tell"}[self.holds]

    def plain(self) -> dict:
        """As a dictionary, with the verdict."""
        return asdict(self) | {"verdict": self.verdict}


def measured(check: dict) -> str:
    """The number of a check as text; ``check`` is of `Check.plain`."""
    return f"{Estimate.of(check).text()} {check['unit']}".strip()


def bound(check: dict) -> str:
    """The bounds of a check as text; ``check`` is of `Check.plain`."""
    low, high = (None if check[key] is None else f"{check[key]:.4g}" for key in ("low", "high"))
    return f"{low} … {high}" if low and high else f"≥ {low}" if low else f"≤ {high}" if high else ""


def write(checks: list[dict], path: Path) -> None:
    """Write checks, of `Check.plain`, to a CSV file; where there is no margin its cell is empty."""
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n", extrasaction="ignore")
        writer.writeheader()
        writer.writerows(one | {"margin": Estimate.of(one).margin or None} for one in checks)


def show(console: Console, checks: list[dict], titles: dict[str, str]) -> None:
    """Print checks, of `Check.plain`: a table for each part.

    Args:
        titles: part to its heading.
    """
    for part, title in titles.items():
        table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD)
        for heading in "of", "number":
            table.add_column(heading, overflow="fold")
        for heading in "measured", "bound":
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column("verdict", overflow="fold")
        for check in checks:
            if check["part"] == part:
                table.add_row(
                    check["subject"], check["what"], measured(check), bound(check), check["verdict"]
                )
        if table.rows:
            console.print(table)
    counts = [
        f"{sum(check['verdict'] == verdict for check in checks)} × {verdict}"
        for verdict in ("holds", "does not hold", "cannot tell")
    ]
    console.print(", ".join(counts) + f" (± and verdicts: {SURE} intervals)")
    for check in checks:
        if check["verdict"] not in ("", "holds") and check["note"]:
            console.print(
                f"{check['subject']}, {check['what']}: {check['note']}",
                markup=False,
                soft_wrap=True,
            )
