"""Numbers compared with bounds."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field

import numpy as np

from .estimate import Estimate

CHECK_COLUMNS = (
    *("part", "subject", "what", "value", "margin", "unit"),
    *("low", "high", "verdict", "note", "source"),
)
VERDICTS = "holds", "does not hold", "cannot tell"


@dataclass(frozen=True)
class Check:
    """A number with its bounds.

    Attributes:
        part: heading.
        subject: what was measured, for example an integrator with a step.
        what: description of the number.
        value: None if it could not be measured.
        error: standard error; 0 for a number that is computed, not sampled.
        freedom: degrees of freedom of the error; None for many.
        low, high: bounds; None for none.
        unit: of all of these.
        note: for example why there is no value.
        source: of the bounds.
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
        cls, part: str, subject: str, what: str, value: Estimate | float | None, **more
    ) -> "Check":
        """The check of an `Estimate`, of a number without error, or of None."""
        estimate = value if isinstance(value, Estimate) else Estimate(value)
        number = {"value": None} if estimate.value is None else estimate.plain()
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
        """True if the interval value ± `margin` is within the bounds, False if it is outside, None
        otherwise and without bounds."""
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
        return dict(zip((True, False, None), VERDICTS))[self.holds]

    def plain(self) -> dict:
        """As a dictionary, with the verdict."""
        return asdict(self) | {"verdict": self.verdict}


def measured(check: Mapping) -> str:
    """The number of a `Check.plain` as text."""
    return f"{Estimate.of(check).text()} {check['unit']}".strip()


def bound(check: Mapping) -> str:
    """The bounds of a `Check.plain` as text."""
    low, high = (None if check[key] is None else f"{check[key]:.4g}" for key in ("low", "high"))
    return f"{low} … {high}" if low and high else f"≥ {low}" if low else f"≤ {high}" if high else ""
