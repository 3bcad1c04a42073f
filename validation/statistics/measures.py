"""Estimates with errors from time series and positions.  NumPy and SciPy, no LAMMPS.

The errors account for the correlation of successive samples; see `estimate`.
"""

from collections.abc import Iterable, Sequence
from typing import TypedDict

import numpy as np
from scipy import special

from .estimate import CONFIDENCE, Estimate, combined, margin

LEAST_OF_LINE = 8  # values needed to distinguish a random walk from noise about a line
FEW_BLOCKS = 12  # for the error of its mean
MOST_OF_ALL = 0.5  # largest correlation time, in lengths of the series, that is corrected for
SURELY = 1e6  # degrees of freedom of an exact error


def autocorrelation(x: np.ndarray) -> Estimate:
    """Statistical inefficiency: the number of successive samples per independent sample.

    g = 1 + 2 sum_k rho(k), with rho the normalised autocorrelation, summed to the
    first window of five times its own g/2 (A. Sokal's automatic windowing); at least 1.  Its error
    is Madras's and Sokal's, J. Stat. Phys. 50, 109 (1988).  The mean that is taken off makes the
    sum too small, by (2 W + 1) / n of it with a window of W (U. Wolff, Comput. Phys. Commun. 156,
    143, 2004).
    """
    x = np.asarray(x, float) - np.mean(x)
    n = len(x)
    if n < 2 or not np.any(x):
        return Estimate(1.0)
    correlation = _products(x)
    g, window = _windowed(correlation / correlation[0])
    part = (2 * window + 1) / n
    inefficiency = max(1.0, float(g) * (1 + part))
    return Estimate(inefficiency, inefficiency * float(np.sqrt(2 * part)))


def autocovariance(x: np.ndarray) -> np.ndarray:
    """Autocovariance of series whose mean is exactly zero.

    Args:
        x: (samples, series).

    Returns:
        (series, lags), for lags up to half of the series.
    """
    n, lags = len(x), np.arange(len(x) // 2)
    return (_products(x)[lags] / (n - lags)[:, None]).T


def autocorrelation_of_square(covariances: np.ndarray) -> Estimate:
    """`autocorrelation` of the square of a vector whose components are Gaussian, alike and
    independent, with means of zero.

    The normalised autocorrelation of the square is rho(k)^2, with rho that of a component.  So all
    components of all runs tell one function, where a square tells one number less surely.  rho(k)^2
    is the mean of products of two components, for the square of a noisy number is too large.  The
    window is that of `autocorrelation`; the error is the jackknife's, over components.  Its margin
    covers 93 % of cases in series of 50 times that number or more, 90 % in ten times, 80 % in five.

    Args:
        covariances: (components of all runs, lags), see `autocovariance`; at least three.
    """
    parts = [np.delete(covariances, i, axis=0) for i in range(len(covariances))]
    inefficiency, number = _of_square(covariances), len(parts)
    values = np.array([_of_square(part) for part in parts])
    error = np.sqrt((number - 1) * np.var(values))
    return Estimate(inefficiency, float(error), number - 1)


def _of_square(covariances: np.ndarray) -> float:
    products = covariances.sum(axis=0) ** 2 - (covariances**2).sum(axis=0)
    if not products[0] > 0:
        return 1.0
    return max(1.0, float(_windowed(products / products[0])[0]))


def _products(x: np.ndarray) -> np.ndarray:
    """Sum of x_i x_(i + lag) for each lag, along the first axis."""
    spectrum = np.fft.rfft(x, 2 * len(x), axis=0)
    return np.fft.irfft(np.abs(spectrum) ** 2, axis=0)[: len(x)]


def _windowed(correlation: np.ndarray) -> tuple[float, int]:
    """1 + 2 sum_k rho(k), summed to the first window of five times its half, and the window."""
    g = 2 * np.cumsum(correlation) - 1
    enough = np.arange(len(g)) >= 2.5 * g
    window = int(np.argmax(enough)) if enough.any() else len(g) - 1
    return g[window], window


def statistical_inefficiency(x: np.ndarray) -> float:
    """The value of `autocorrelation`."""
    return autocorrelation(x).value


def mean_of_few(values: Sequence[float]) -> Estimate:
    """The mean of a few independent values, for example of starts, with the error from their
    scatter; infinite for a single value."""
    number = len(values)
    if number < 2:
        return Estimate(values[0], np.inf)
    return Estimate(float(np.mean(values)), np.std(values, ddof=1) / np.sqrt(number), number - 1)


def mean_of_starts(starts: Sequence[Estimate]) -> Estimate:
    """The mean of independent estimates of one number, for example of starts.

    Its error combines theirs, with the degrees of freedom of Welch and Satterthwaite, because the
    scatter of two or three starts is a poor estimate.  If starts differ by more than their errors
    allow (F test, 5 %), the error is that of their scatter.
    """
    if len(starts) == 1:
        return starts[0]
    apart = mean_of_few([start.value for start in starts])
    squares = np.array([start.error for start in starts]) ** 2
    total = squares.sum()
    if not total > 0:
        return apart
    parts = [square**2 / start.freedom for square, start in zip(squares, starts) if start.freedom]
    freedom = total**2 / sum(parts) if sum(parts) > 0 else SURELY
    ratio = apart.error**2 / (total / len(starts) ** 2)
    if special.fdtrc(len(starts) - 1, freedom, ratio) < 1 - CONFIDENCE:
        return apart
    return Estimate(apart.value, float(np.sqrt(total)) / len(starts), float(freedom))


def weighted_mean(estimates: Sequence[Estimate]) -> Estimate:
    """The mean of independent estimates of one number, each weighted by its margin to the power of
    -2."""
    weights = np.array([estimate.margin for estimate in estimates]) ** -2.0
    parts = [estimate.times(weight) for estimate, weight in zip(estimates, weights / sum(weights))]
    error, freedom = combined(*(part[1:] for part in parts))
    return Estimate(sum(part.value for part in parts), error, freedom)


def mean(x: np.ndarray) -> Estimate:
    """`Estimate` of the mean, in units of ``x``.

    The margin is the larger of sd sqrt(g / n) and that from the scatter of the means of
    `FEW_BLOCKS` equal blocks.  The window of g closes after the first fast decay, so a slow
    component that is small in each sample but dominates the error of the mean is seen by the
    blocks only, if its correlation time is shorter than a block.  Without a slow component the
    margin is too large by 8 % on average.

    The margin covers 93 % or more where the correlation time is up to a tenth of the series, and
    80 % where it is all of it: degrees of freedom are those of g's own error.
    """
    x = np.asarray(x, float)
    blocks = mean_of_few([block.mean() for block in np.array_split(x, min(FEW_BLOCKS, len(x)))])
    g = autocorrelation(x)
    freedom = max(1.0, 2 * (g.value / g.error) ** 2) if g.error else None
    smooth = np.sqrt(_squares(x, g.value).mean() * g.value / len(x))
    return max(
        Estimate(x.mean(), float(smooth), freedom),
        blocks._replace(value=x.mean()),
        key=lambda estimate: estimate.margin,
    )


def squares(x: np.ndarray) -> np.ndarray:
    """(x - <x>)^2 of each sample times n / (n - g), so that the mean is the variance about the
    exact mean, in units of ``x``^2."""
    x = np.asarray(x, float)
    return _squares(x, statistical_inefficiency(x))


def _squares(x, g):
    return (x - x.mean()) ** 2 / (1 - min(g / len(x), MOST_OF_ALL))


def standard_deviation(x: np.ndarray) -> Estimate:
    """`Estimate` of the standard deviation about the series' own mean, in units of ``x``.

    The error is that of the mean of (x - <x>)^2, divided by 2 sd; infinite for less than three
    values.
    """
    x = np.asarray(x, float)
    sd = float(np.std(x, ddof=min(1, len(x) - 1)))
    if len(x) < 3:
        return Estimate(sd, np.inf)
    _, error, freedom = mean((x - x.mean()) ** 2)
    return Estimate(sd, error / (2 * sd), freedom) if sd > 0 else Estimate(sd)


def about_line(t: np.ndarray, x: np.ndarray) -> Estimate:
    """`standard_deviation` about the least-squares line, for a series that drifts."""
    line = _line(np.asarray(t, float))
    return standard_deviation(x - line @ (np.linalg.pinv(line) @ x))


def drift(t: np.ndarray, x: np.ndarray) -> Estimate:
    """`Estimate` of the slope of a series whose noise may also wander, by one line through it.

    The error is that of the noise about the line, and of the largest walk that the series allows
    (the most likely one and 1.64 of its standard errors).  A walk of variance W t makes the slope
    of a line over the time T uncertain by 6/5 W / T.  So the margin covers in 94 to 100 % of cases,
    with white or correlated noise, a walk, or both.

    Args:
        t: equally spaced times.
        x: as many values, of one series.

    Returns:
        in units of ``x`` over units of ``t``; the error is infinite for less than 8 values.
    """
    t, x = np.asarray(t, float) - np.mean(t), np.asarray(x, float)
    size = np.abs(x).max() or 1.0  # the squares of a run that blew up would overflow
    x = (x - x.mean()) / size
    slope = t @ x / max(t @ t, 1e-300)
    if len(t) < LEAST_OF_LINE:
        return Estimate(float(size * slope), np.inf)
    span, rest = t[-1] - t[0], x - slope * t
    independent = len(t) / statistical_inefficiency(rest)
    noise = 12 * rest.var() / (independent * span**2)
    walk = random_walk(t, x)
    wander = 1.2 * (walk.value + special.ndtri(CONFIDENCE) * walk.error) / span
    error, freedom = float(np.sqrt(noise + wander)), max(1.0, independent - 2)
    return Estimate(float(slope), error, freedom).times(size)


def random_walk(t: np.ndarray, x: np.ndarray, blocks: int = 32) -> Estimate:
    """How much the variance of x(t + s) - x(t) grows with s, an `Estimate`, in units of ``x``^2
    over those of ``t``.

    In white noise beside a walk, by the most likely walk; a block has to be longer than the
    correlation time of all that does not wander, else that passes for a walk.  So there are few
    blocks.  The error is that of maximum likelihood, from the Fisher information. A walk over the
    time T makes a variance about its own mean of this number times T / 6.

    Args:
        t: equally spaced times.
        x: as many values.
        blocks: how many at most, or some more; values of less than a block at the end are left out.
    """
    size = max(1, len(t) // blocks)
    whole = len(t) // size * size
    t, x = (np.reshape(values[:whole], (-1, size)).mean(axis=1) for values in (t, x))
    walk, error = _most_likely_walk(t, x)
    return Estimate(walk, error).times(1 / (t[1] - t[0]))


def _line(t):
    return np.stack([np.ones(len(t)), t - t.mean()], axis=1)


def _modes(t):
    """Independent modes of a random walk orthogonal to lines: variances, and modes as columns.

    The covariance of the means of a walk over blocks i <= j (from 1) is i - 1/2, and i - 2/3 if
    they are the same.
    """
    rest = np.linalg.qr(_line(t), mode="complete")[0][:, 2:]
    age = np.arange(1, len(t) + 1)
    covariance = np.minimum.outer(age, age) - 0.5 - np.eye(len(t)) / 6
    values, vectors = np.linalg.eigh(rest.T @ covariance @ rest)
    return values, rest @ vectors


def _most_likely_walk(t, x):
    """The maximum-likelihood variance of the walk's step from block to block, and its error."""
    values, modes = _modes(t)
    power = (modes.T @ x) ** 2
    if not np.any(power):
        return 0.0, 0.0
    # fine where one of the two is small
    parts = np.append(np.geomspace(1e-4, 1.0, 100), 1 - np.geomspace(1e-4, 0.1, 30))
    parts = np.append(0.0, parts)[:, None]
    spectrum = (1 - parts) + parts * values
    variance = np.mean(power / spectrum, axis=1)  # the most likely one with each part
    # -2 log likelihood
    best = np.argmin(len(power) * np.log(variance) + np.log(spectrum).sum(axis=1))
    weights = (variance[best] * spectrum[best]) ** -2
    mixed = weights @ values
    information = 0.5 * np.array([[weights.sum(), mixed], [mixed, weights @ values**2]])
    return parts[best, 0] * variance[best], np.sqrt(np.linalg.inv(information)[1, 1])


def difference(first: Estimate, second: Estimate) -> Estimate:
    """First less second, independent `Estimate`s."""
    return Estimate(first.value - second.value, *combined(first[1:], second[1:]))


def quotient(first: Estimate, second: Estimate) -> Estimate:
    """First over second, independent `Estimate`s."""
    value = first.value / second.value
    parts = first.times(1 / second.value), second.times(value / second.value)
    return Estimate(value, *combined(*(part[1:] for part in parts)))


def without_noise(off: np.ndarray) -> Estimate:
    """The rms of a mean difference, corrected for noise.

    Args:
        off: independent measurements of the difference, as rows; the error is their jackknife's.
    """
    products = off @ off.T / off.shape[1]
    n, diagonal = len(products), np.diag(products)
    pairs = products.sum() - diagonal.sum()
    square = pairs / (n * (n - 1))
    without = (pairs - 2 * (products.sum(axis=1) - diagonal)) / ((n - 1) * (n - 2))  # one of them
    error = np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2))
    reach = margin(error, n - 1)
    ends = [square, square - reach, max(square, 0.0) + reach]
    value, least, most = np.sqrt(np.maximum(ends, 0.0))
    return Estimate(value, max(value - least, most - value) / margin(1.0, n - 1), n - 1)


def nearest_image(
    d: np.ndarray, cell: np.ndarray, periodic: Sequence[bool] | np.ndarray
) -> np.ndarray:
    """Displacements (..., 3) folded to the nearest periodic image.

    Args:
        d: displacements.
        cell: cell vectors as rows, a along x and b in the xy plane.
        periodic: three flags.
    """
    d = np.array(d, float)
    for axis in (2, 1, 0):
        if periodic[axis]:
            d -= np.round(d[..., axis, None] / cell[axis][axis]) * np.asarray(cell[axis])
    return d


def body_groups(bodies: np.ndarray) -> list[np.ndarray]:
    """Arrays (bodies, n) of the atoms of all bodies with n atoms, for each n, without body 0."""
    order = np.argsort(bodies, kind="stable")
    inside = order[bodies[order] != 0]
    _, first, sizes = np.unique(bodies[inside], return_index=True, return_counts=True)
    return [inside[first[sizes == n][:, None] + np.arange(n)] for n in np.unique(sizes)]


class Spread(TypedDict):
    """A few values, as plain data."""

    median: float
    min: float
    max: float
    values: list[float]


def spread(values: Iterable[float]) -> Spread:
    """The `Spread` of values."""
    numbers = [float(value) for value in values]
    return Spread(
        median=float(np.median(numbers)), min=min(numbers), max=max(numbers), values=numbers
    )


def ratio(first: Sequence[float], second: Sequence[float]) -> Estimate:
    """Geometric mean of second / first over independent pairs of positive numbers, an
    `Estimate`."""
    logarithm = mean_of_few(np.log(np.asarray(second, float) / np.asarray(first, float)))
    value = np.exp(logarithm.value)
    return Estimate(value, value * logarithm.error, logarithm.freedom)
