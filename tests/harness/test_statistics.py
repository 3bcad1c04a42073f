"""From series and positions to numbers: against exact answers, and by how often intervals cover.

Statistical tests pass within five standard errors and use fixed random seeds.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

from validation.statistics import measures
from validation.statistics.estimate import margin


def ar1(n, phi, seed):
    """Stationary noise with unit variance and autocorrelation phi^k."""
    noise = np.random.default_rng(seed).normal(size=n)
    noise[1:] *= np.sqrt(1 - phi**2)
    return lfilter([1], [1, -phi], noise)


def noise_of(rng, series, n, time, step):
    """White noise (time 0) or AR(1) with this correlation time in samples, with a walk: its
    variance in a 64th of the series over that of that part's mean without it, as far as that is
    white; None for a walk alone."""
    phi = np.exp(-1 / time) if time else 0.0
    white = rng.normal(size=(series, n))
    white[:, 0] /= np.sqrt(1 - phi**2)
    x = lfilter([np.sqrt(1 - phi**2)], [1, -phi], white)
    walk = np.cumsum(rng.normal(size=(series, n)), axis=1) * np.sqrt((1 + phi) / (1 - phi)) * 64 / n
    return walk if step is None else x + np.sqrt(step) * walk


@pytest.mark.parametrize("n, time", [(40, 0), (120, 0), (640, 0), (640, 1 / 50)])
def test_the_margin_of_a_drift_covers(n, time):
    """Locks out a margin that covers too seldom, whatever walks, as one by the most likely walk
    does (76 % of a weak walk), and one that is far larger than the scatter of slopes."""
    rng, t = np.random.default_rng(n), np.arange(n) * 0.1
    for step in (0.0, 0.03, 0.3, 10.0, None):
        series = 0.3 * t - 7.0 + noise_of(rng, 250, n, time * n, step)
        results = [measures.drift(t, row) for row in series]
        off, margins = np.transpose([(one.value - 0.3, one.margin) for one in results])
        assert np.mean(np.abs(off) < margins) > 0.93, step
        # the walk that white noise allows, or its correlation time, makes it wider
        assert np.median(margins) < (7.0 if step == 0.0 else 2.7) * margin(np.std(off)), step


def test_deviation_about_the_line():
    """Locks out a drift that passes for scatter: about the line the deviation is the noise's, with
    and without a drift."""
    t, x = np.arange(4000) * 0.1, ar1(4000, 0.5, seed=8)
    assert measures.standard_deviation(x + 0.1 * t).value > 10
    assert measures.about_line(t, x + 0.1 * t) == pytest.approx(measures.about_line(t, x))
    assert measures.about_line(t, x).value == pytest.approx(1.0, rel=0.05)


def test_drift_without_noise_and_of_few_values():
    """Locks out a series without noise that has some or ends in a division by zero, and an error of
    few values."""
    t = np.arange(500) * 0.1
    assert measures.drift(t, np.full(500, 7.0))[:2] == pytest.approx((0.0, 0.0), abs=1e-14)
    assert measures.drift(t, 3 * t)[:2] == pytest.approx((3.0, 0.0), abs=1e-12)
    for n in 1, 2, 7:
        assert measures.drift(t[:n], 3 * t[:n]).error == np.inf, "so few values tell no error"


def test_of_one_or_two_values_no_error_is_known():
    """Locks out a number for sure, of a single start or of two samples."""
    assert measures.mean_of_few([2.0]) == (2.0, np.inf, None)
    assert measures.ratio([1.0], [2.0]).margin == np.inf
    assert measures.mean([3.0]).margin == np.inf
    for x in [1.0], [1.0, 2.0]:
        assert measures.standard_deviation(np.array(x)).error == np.inf


def test_ratio_of_pairs():
    """Locks out the ratio turned round, and the scatter of the single ratios given as the error of
    their mean."""
    rng = np.random.default_rng(6)
    result = np.array(
        [
            measures.ratio(*np.exp(rng.normal(size=(2, 50)) * 0.1 + [[0.0], [0.3]]))
            for _ in range(200)
        ]
    )
    assert result[:, 0].mean() == pytest.approx(np.exp(0.3), rel=0.01)
    assert result[:, 1].mean() == pytest.approx(result[:, 0].std(), rel=0.2)


SLOW = 500  # samples of correlation time


def two_times(n, seed):
    """White noise with unit variance, of which 6 % is slow."""
    return np.sqrt(0.94) * ar1(n, 0.0, seed) + np.sqrt(0.06) * ar1(
        n, np.exp(-1 / SLOW), 1000 + seed
    )


def test_errors_with_two_times():
    """Locks out a slow part of the noise that is lost behind a fast one, in the error of a mean and
    in that of a standard deviation; and the error of the variance given as that of its root.

    The variance of the mean is that of both parts by themselves, (0.94 + 0.06 * 2 * 500) / n.
    """
    n, rng = 60000, np.random.default_rng(7)
    noise = [two_times(n, seed) for seed in range(10)]
    expected = np.sqrt((0.94 + 0.06 * 2 * SLOW) / n)
    assert np.mean([measures.mean(x)[1] for x in noise]) == pytest.approx(expected, rel=0.25)
    # of which the square is 9 (1 + 0.1 x)
    turned = [3.0 * np.sqrt(1 + 0.1 * x) * rng.choice([-1, 1], n) for x in noise]
    sd, errors, _ = np.transpose([measures.standard_deviation(x) for x in turned])
    assert np.mean(sd) == pytest.approx(3.0, rel=0.01)
    assert np.mean(errors) == pytest.approx(3.0 * 0.1 * expected / 2, rel=0.25)


@pytest.mark.parametrize("n", [4, 13, 23])
def test_error_of_the_mean_of_few(n):
    """Locks out blocks of a short series that leave samples out, or are none: of independent ones
    the error is 1 / sqrt(n)."""
    errors = [measures.mean(ar1(n, 0.0, seed))[1] for seed in range(400)]
    assert np.mean(errors) == pytest.approx(1 / np.sqrt(n), rel=0.25)


@pytest.mark.parametrize("time", [0.0, 0.01, 0.03, 0.1, 0.3])
def test_the_mean_of_a_short_series_covers(time):
    """Locks out a margin that takes g's value for sure: where the correlation time was a tenth of
    the series it covered in 80 % of cases, at 0.3 in 62 %; a variance that is too small by what the
    mean's error takes off it; and a margin so wide that it covers always."""
    rng, n = np.random.default_rng(8), 300
    results = [
        (measures.mean(x), measures.squares(x).mean()) for x in noise_of(rng, 600, n, time * n, 0)
    ]
    hits = np.mean([abs(one.value) < one.margin for one, _ in results])
    assert (0.93 if time < 0.3 else 0.86) < hits < 0.985
    scatter = margin(np.std([one.value for one, _ in results]))
    assert np.median([one.margin for one, _ in results]) < (1.3 if time < 0.03 else 2.0) * scatter
    if time < 0.3:
        assert np.mean([square for _, square in results]) == pytest.approx(1.0, abs=0.06)


@pytest.mark.quick("2-12.706")
@pytest.mark.parametrize("number, table", [(2, 12.706), (4, 3.182), (32, 2.040)])
def test_margin_of_few_is_students(number, table):
    """Locks out two standard errors of few values that are called 95 %, where they cover 83 % (two)
    or 90 % (four); a table of Student's t beside it."""
    rows = np.random.default_rng(number).normal(size=(4000, number))
    results = [measures.mean_of_few(row) for row in rows]
    assert results[0].margin / results[0].error == pytest.approx(table, rel=1e-3)
    assert np.mean([abs(one.value) < one.margin for one in results]) == pytest.approx(
        0.95, abs=0.012
    )
    assert measures.margin(1.0) == pytest.approx(1.960, abs=1e-3)


@pytest.mark.parametrize(
    "sizes, second", [((4, 4), 1.0), ((2, 32), 0.2), ((3, 5), 3.0), ((4, 200), 3.0)]
)
def test_sum_of_numbers_with_few_values_each(sizes, second):
    """Locks out the larger number of degrees of freedom, or Welch's where a part has one: the
    interval of a sum of two means then covers too seldom."""
    rng, covered = np.random.default_rng(5), []
    for _ in range(3000):
        one, other = (
            measures.mean_of_few(size * rng.normal(size=number))
            for number, size in zip(sizes, (1.0, second))
        )
        error, freedom = measures.combined(one[1:], other[1:])
        covered.append(abs(one.value + other.value) < measures.margin(error, freedom))
    assert 0.94 < np.mean(covered) < 0.99
    assert measures.combined((3.0, None), (4.0, None)) == (5.0, None) and measures.combined(
        (0.0, 3), (0.0, None)
    ) == (0.0, None)


def test_a_quotient_has_the_freedom_of_its_parts():
    """Locks out a quotient whose error counts as sure."""
    few, many = measures.Estimate(2.0, 0.2, 3), measures.Estimate(-4.0, 0.4)
    assert measures.quotient(few, many)[:2] == pytest.approx((-0.5, 0.05 * np.sqrt(2)), rel=1e-9)
    assert measures.quotient(few, many).margin == pytest.approx(
        np.hypot(0.05 * 3.182, 0.05 * 1.960), rel=1e-3
    )
    assert measures.quotient(many, many).freedom is None


CUBE = np.diag([10.0, 10.0, 10.0])


SKEWED = np.array([[10.0, 0, 0], [4.0, 9.0, 0], [-3.0, 2.0, 8.0]])


ALL = (True, True, True)


@pytest.mark.quick
@pytest.mark.parametrize("cell", [CUBE, SKEWED], ids=["cube", "triclinic"])
def test_distance_ignores_periodic_images(cell):
    """Locks out distances of a box length between images of one atom, and folding across a wall."""
    x = np.random.default_rng(2).uniform(0, 8, size=(20, 3))
    y = x + np.random.default_rng(3).integers(-2, 3, size=(20, 3)) @ cell
    y[7] += [0.03, 0.0, -0.04]
    off = np.linalg.norm(measures.nearest_image(x - y, cell, ALL), axis=1)
    assert off[7] == pytest.approx(0.05) and np.delete(off, 7).max() < 1e-12
    walled = measures.nearest_image(np.full((1, 3), 9.0), CUBE, (True, True, False))
    np.testing.assert_allclose(walled, [[-1.0, -1.0, 9.0]])
