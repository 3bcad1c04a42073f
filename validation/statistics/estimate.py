"""A sampled number with its error.

Errors are standard errors (one standard deviation of the estimate).  An error from few values is
uncertain itself, so its degrees of freedom are kept.  Both give the margin, the half width of the
95 % confidence interval, which is shown beside a number and decides verdicts.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy import special

CONFIDENCE = 0.95  # of the interval value ± margin
SURE = f"{100 * CONFIDENCE:g} %"  # the same as text


def margin(error: float, freedom: float | None = None, confidence: float = CONFIDENCE) -> float:
    """Half width of the confidence interval: the standard error times Student's t.

    Args:
        freedom: degrees of freedom; None for a normal variable.
    """
    quantile = (1 + confidence) / 2
    return error * float(
        special.ndtri(quantile) if freedom is None else special.stdtrit(freedom, quantile)
    )


def combined(*parts: tuple[float, float | None]) -> tuple[float, float | None]:
    """Standard error of a sum of independent numbers, and its degrees of freedom.

    The squared margin is the sum of the squared margins.  Its coverage is at least that of the
    parts (W. G. Howe, J. Am. Stat. Assoc. 69, 789, 1974); with the degrees of freedom of Welch and
    Satterthwaite it is lower if a part has very few.

    Args:
        parts: (error, freedom) of each number.
    """
    size = max((abs(error) for error, _ in parts), default=0.0)
    if not 0 < size < np.inf:
        return float(size), None
    error, wide = (
        float(np.sqrt(sum(float(value / size) ** 2 for value in values)))
        for values in zip(*((error, margin(error, freedom)) for error, freedom in parts))
    )
    times = wide / error
    if times <= margin(1.0) * (1 + 1e-9):
        return float(size) * error, None
    return float(size) * error, float(special.stdtridf((1 + CONFIDENCE) / 2, times))


class Estimate(NamedTuple):
    """A number, its standard error, and the degrees of freedom of that; None for many."""

    value: Any  # a float, or an array of several; None where there is no number
    error: float = 0.0
    freedom: float | None = None

    @classmethod
    def of(cls, plain: Mapping) -> "Estimate":
        """From plain data, which may have further keys; a missing error is 0."""
        return cls(plain["value"], plain["error"] or 0.0, plain.get("freedom"))

    @property
    def margin(self) -> float:
        """Half the width of the 95 % interval."""
        return margin(self.error, self.freedom)

    @property
    def normal_error(self) -> float:
        """The standard error of a normal variable with the same margin."""
        return self.margin / margin(1.0)

    def times(self, factor: float) -> "Estimate":
        """The number in another unit."""
        return Estimate(self.value * factor, self.error * abs(factor), self.freedom)

    def plain(self) -> dict:
        """As a dictionary, for JSON and as keywords."""
        return {
            "value": float(self.value),
            "error": float(self.error),
            "freedom": self.freedom and float(self.freedom),
        }

    def text(self) -> str:
        """Value ± margin as text, for all magnitudes."""
        if self.value is None:
            return "–"
        if not self.error > 0:
            return f"{self.value:.3g}"
        if 1e-3 < max(abs(self.value), self.margin) < 1e5:
            digits = 0
            while self.margin * 10**digits < 9.5 and digits < 12:  # two digits of the margin
                digits += 1
            return f"{self.value:.{digits}f} ± {self.margin:.{digits}f}"
        return f"{self.value:.2e} ± {self.margin:.1e}"


def plain(values: Mapping[str, Any]) -> dict:
    """Plain data of estimates and other values; None is left out, except for ``error``."""
    return {
        key: value.plain() if isinstance(value, Estimate) else value
        for key, value in values.items()
        if value is not None or key == "error"
    }
