"""The error of an average as a function of CPU time.

After T seconds error^2 = b^2 + A / T, where b is the bias and A the variance of a sample times the
cost of an independent one.
"""

from typing import NamedTuple

import numpy as np

from .estimate import CONFIDENCE, Estimate

DRAWS, SEED = 4000, 7  # of errors, for intervals of numbers that are far from normal


class BiasAndNoise(NamedTuple):
    """Bias and noise of an average with one scheme and step.

    Attributes:
        bias: b.
        noise: A, variance of the mean times CPU time, s.
    """

    bias: Estimate
    noise: Estimate

    def error(self, seconds: np.ndarray | float) -> np.ndarray:
        """The total error after this CPU time, s; it includes the error of the bias, so that
        a short run does not seem accurate."""
        return np.sqrt(
            self.bias.value**2 + self.bias.error**2 + self.noise.value / np.asarray(seconds)
        )

    def draws(self, number: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Random biases and noises within their errors, (DRAWS,); ``number``: of the sequence."""
        rng = np.random.default_rng((SEED, number))
        freedom = self.bias.freedom
        shape = rng.normal(size=DRAWS) if freedom is None else rng.standard_t(freedom, DRAWS)
        relative = self.noise.error / self.noise.value if self.noise.value else 0.0
        return (
            self.bias.value + self.bias.error * shape,
            self.noise.value * np.exp(relative * rng.normal(size=DRAWS)),
        )


class Interval(NamedTuple):
    """A median, and the ends of its 95 % interval; they can be infinite."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, draws: np.ndarray) -> "Interval":
        """The interval of equally likely numbers."""
        ends = 50 * (1 - CONFIDENCE), 50 * (1 + CONFIDENCE)
        # a rank, not a mean of two: one of these may be infinite
        return cls(*map(float, np.percentile(draws, (50, *ends), method="nearest")))

    def plain(self) -> dict:
        """As a dictionary; what is infinite is None."""
        return {
            name: value if np.isfinite(value) else None for name, value in self._asdict().items()
        }


def _seconds(bias, noise, error):
    room = error**2 - bias**2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(room > 0, noise / room, np.inf)


def seconds(average: BiasAndNoise, error: float) -> Interval:
    """CPU time until a total error, s, with its interval."""
    return Interval.of(_seconds(*average.draws(), error))


def times(known: BiasAndNoise, other: BiasAndNoise, error: float) -> Interval:
    """CPU time until a total error, divided by that of the other scheme."""
    if np.isnan([estimate.value for average in (known, other) for estimate in average]).any():
        return Interval(np.nan, np.nan, np.nan)
    first, second = known.draws(1), other.draws(2)
    spent, other_spent = _seconds(*first, error), _seconds(*second, error)
    with np.errstate(invalid="ignore"):
        ratio = spent / other_spent
    # none of both comes to it: nobody is faster
    return Interval.of(np.where(np.isnan(ratio), 1.0, ratio))
