"""The common limit of small steps of several schemes, and the bias of each point.

Schemes that sample the same distribution differ by errors of the step only.  These are even in it:
U_s(h) = U0 + a_s h^2 + b_s h^4, with one U0 for all.  A weighted least-squares fit to all points
gives U0 with a smaller error than any one run with a very short step (`fit`).

`extrapolate` estimates U0 from one scheme.
"""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from scipy import special

from .estimate import CONFIDENCE, Estimate, combined
from .measures import difference

ENOUGH = 4  # steps of a scheme with a term in h^4
# ratio of successive terms of the error at the longest step, in h^2, h^4, h^6: (h / s)^2 for a
# motion that is unstable at the step s
SHARE = 0.3
POWERS = 3  # of the square of the step
Key = TypeVar("Key", bound=Hashable)


@dataclass(frozen=True)
class Fit:
    """The limit from a fit of several points.

    Attributes:
        points: all points, by key.
        weights: of the points of the fit in U0.
        chi2, freedom: of the residuals, and their degrees of freedom.
        terms: U0, and the coefficients of the other terms.
    """

    points: Mapping
    weights: Mapping = field(default_factory=dict)
    chi2: float = 0.0
    freedom: int = 0
    terms: tuple[float, ...] = ()

    @property
    def limit(self) -> Estimate:
        """U0."""
        return Estimate(
            float(sum(weight * self.points[key].value for key, weight in self.weights.items())),
            *self._error(self.weights),
        )

    def bias(self, key: Hashable) -> Estimate:
        """The value of a point minus U0."""
        parts = self.distance(key)
        return Estimate(
            float(sum(weight * self.points[other].value for other, weight in parts.items())),
            *self._error(parts),
        )

    def distance(self, key: Hashable) -> dict:
        """Weights of the points in a point minus U0.

        Points are independent, but a point of the fit contributes to U0: with these weights the
        error of the difference needs no covariance.
        """
        parts = {other: -weight for other, weight in self.weights.items()}
        parts[key] = parts.get(key, 0.0) + 1.0
        return parts

    @property
    def probability(self) -> float | None:
        """Probability of this or a larger chi2 if the model is correct; None without residuals."""
        return float(special.chdtrc(self.freedom, self.chi2)) if self.freedom else None

    @property
    def agrees(self) -> bool:
        """Whether the points agree with the model, at the 5 % level."""
        return self.probability is None or self.probability > 1 - CONFIDENCE

    def _error(self, parts):
        every = ((weight * self.points[key].error, key) for key, weight in parts.items())
        return combined(*((error, self.points[key].freedom) for error, key in every))


def fit(
    points: Mapping[Key, Estimate],
    steps: Mapping[Key, tuple[str, float]],
    reaches: Mapping[str, float],
) -> Fit | None:
    """The `Fit` of independent points; None if they do not determine a limit.

    Args:
        steps: scheme and step of each point.
        reaches: for each scheme that shares the limit, the longest step whose error the terms
            describe; infinite for a scheme without error of the step.
    """
    used = [
        point
        for point, (scheme, dt) in steps.items()
        if dt <= reaches.get(scheme, 0.0) and points[point].error > 0
    ]
    terms = _terms([steps[point] for point in used], reaches)
    return _least_squares(points, used, np.stack([np.ones(len(used)), *terms], axis=1))


def extrapolate(points: Mapping[float, Estimate], powers: int = POWERS) -> Fit | None:
    """The `Fit` of means of one scheme, by step; None with less than two steps.

    U(h) = U0 + a x + b x^2 + c x^3, with x the square of the step over that of the longest one.
    The magnitudes of b and c are estimated from a (`SHARE`): each is a further point of the fit,
    with the name of its power of h, the value zero and this standard error.  So the error of U0
    includes what the means do not determine of them.

    Args:
        powers: of x.
    """
    means = {dt: mean for dt, mean in sorted(points.items()) if 0 < mean.error < np.inf}
    if len(means) < 2:
        return None
    shortest, *_, longest = means
    squares = {dt: (dt / longest) ** 2 for dt in means}
    slope = difference(means[longest], means[shortest]).times(1 / (1 - squares[shortest]))
    seen = float(np.hypot(slope.value, slope.error))
    higher = {f"h^{2 * n}": Estimate(0.0, seen * SHARE ** (n - 1)) for n in range(2, powers + 1)}
    rows = [[x**n for n in range(powers + 1)] for x in squares.values()]
    return _least_squares(
        means | higher, [*means, *higher], np.array([*rows, *np.eye(powers + 1)[2:]])
    )


def _least_squares(points: Mapping, used: list, design: np.ndarray) -> Fit | None:
    """The weighted least-squares fit, with U0 in the first column; None if it is not determined."""
    # an error that few values tell is uncertain: its margin weighs it as a normal one
    size = np.array([points[key].normal_error for key in used])
    if not len(used):
        return None
    scaled = design / size[:, None]
    inverse = np.linalg.pinv(scaled)
    if abs((inverse @ scaled)[0] - np.eye(len(scaled[0]))[0]).max() > 1e-6:
        return None  # no scheme has two steps
    values = np.array([points[key].value for key in used]) / size
    terms = inverse @ values
    left = values - scaled @ terms
    freedom = len(used) - np.linalg.matrix_rank(scaled)
    weights = dict(zip(used, map(float, inverse[0] / size)))
    return Fit(points, weights, float(left @ left), int(freedom), tuple(map(float, terms)))


def _terms(steps: list[tuple[str, float]], reaches: Mapping[str, float]) -> list[np.ndarray]:
    """Columns of h^2 for each scheme, and of h^4 for one with enough steps."""
    columns = []
    for scheme in dict.fromkeys(name for name, _ in steps):
        reach = reaches[scheme]
        if math.isinf(reach):
            continue
        square = np.array([(dt / reach) ** 2 * (name == scheme) for name, dt in steps])
        number = len({dt for name, dt in steps if name == scheme})
        columns += [square, square**2][: 2 if number >= ENOUGH else 1]
    return columns
