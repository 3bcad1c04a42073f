"""The statistics of `sample`: limits of small steps, memories, total errors, two states."""

import math

import numpy as np
import pytest
from scipy import signal

from validation.sample import measure, scenes, schemes
from validation.sample.plan import DIPOLE
from validation.scenes.units import BOLTZMANN
from validation.statistics import limit, measures, precision, refined, structure
from validation.statistics.estimate import Estimate

ATM = 68568.415  # atm Angstrom^3 in a kcal/mol
REACHES = {"a": 4.0, "b": 8.0, "exact": math.inf}
STEPS = {
    **{("a", dt): 0.05 for dt in (1.0, 2.0, 4.0)},
    **{("b", dt): 0.02 for dt in (2.0, 4.0, 6.0, 8.0)},
    ("exact", 6.0): 0.04,
    ("a", 6.0): 0.01,  # beyond its reach
    ("other", 2.0): 0.01,  # with a limit of its own
}


def exact(scheme, dt):
    """A mean whose limit is -9, with another error of the step for each scheme."""
    if scheme == "other":
        return -8.0
    return -9.0 + {"a": 0.02 * dt**2, "b": -0.003 * dt**2 + 1e-4 * dt**4, "exact": 0.0}[scheme]


def fit(points):
    return limit.fit(points, {key: key for key in points}, REACHES)


def test_the_limit_of_exact_numbers():
    """Locks out a limit or a bias that is off where nothing is uncertain, a term that is missing,
    and points that have no place in the fit."""
    result = fit({key: Estimate(exact(*key), error) for key, error in STEPS.items()})
    assert result.limit.value == pytest.approx(-9.0, abs=1e-9) and result.chi2 < 1e-9
    assert result.freedom == 8 - 1 - 1 - 2
    assert ("a", 6.0) not in result.weights and ("other", 2.0) not in result.weights
    for key in STEPS:
        assert result.bias(key).value == pytest.approx(exact(*key) + 9.0, abs=1e-9)


@pytest.mark.parametrize("freedom", [None, 11])
def test_the_limits_error_covers(freedom):
    """Locks out an error of U0 or of a bias that is too small or too large: of 1,500 samples the
    95 % interval has the truth in 95 %, of points in the fit, outside of it, and of their chi2,
    which agrees with less than everything."""
    rng = np.random.default_rng(5)
    inside: dict = dict.fromkeys((None, *STEPS), 0)
    agree, number = 0, 1500
    for _ in range(number):
        points = {}
        for key, error in STEPS.items():
            told = error if freedom is None else error * np.sqrt(rng.chisquare(freedom) / freedom)
            points[key] = Estimate(exact(*key) + error * rng.normal(), told, freedom)
        result = fit(points)
        agree += result.agrees
        inside[None] += abs(result.limit.value + 9.0) < result.limit.margin
        for key in STEPS:
            one = result.bias(key)
            inside[key] += abs(one.value - exact(*key) - 9.0) < one.margin
    # with errors that few values tell a margin is too wide rather than too narrow
    low, high = (0.93, 0.97) if freedom is None else (0.93, 0.995)
    for key, count in inside.items():
        assert low < count / number < high, key
    assert 0.92 < agree / number < 0.98


def test_points_of_few_starts_weigh_little():
    """Locks out the error of two starts, which by chance is tiny, in a point's weight: what counts
    is its margin, of Student's t with one degree of freedom."""
    points = {("exact", 1.0): Estimate(-9.0, 0.01, 1.0), ("exact", 2.0): Estimate(-8.0, 0.01)}
    part = (1.959964 / 12.706205) ** 2
    assert fit(points).limit.value == pytest.approx((-8.0 - 9.0 * part) / (1 + part), rel=1e-6)


def test_a_point_of_the_fit_is_correlated_with_it():
    """Locks out errors of a point and the limit that are added as if they were independent: the
    only exact point is the limit."""
    points = {("exact", 6.0): Estimate(-9.0, 0.04), ("other", 2.0): Estimate(-8.0, 0.03)}
    result = fit(points)
    assert result.limit == Estimate(-9.0, 0.04) and result.bias(("exact", 6.0)).error == 0
    assert result.bias(("other", 2.0)).error == pytest.approx(0.05)


def test_no_limit():
    """Locks out a limit of schemes with one step each, which is that of nothing."""
    assert fit({("a", 2.0): Estimate(1.0, 0.1), ("b", 2.0): Estimate(1.0, 0.1)}) is None
    assert fit({("other", 2.0): Estimate(1.0, 0.1)}) is None and fit({}) is None


def remembering(rng, samples, time):
    """Standard normal numbers with an exponential autocorrelation."""
    keep = np.exp(-1 / time)
    noise = rng.normal(size=samples + round(20 * time))
    return signal.lfilter([np.sqrt(1 - keep**2)], [1, -keep], noise)[-samples:]


def test_the_error_of_an_autocorrelation_time():
    """Locks out a time of an independent sample without its error, or with another one, and one
    that is too small where the mean of a short series is taken off."""
    rng, truth = np.random.default_rng(2), 1 / np.tanh(0.5 / 10.0)
    results = [measures.autocorrelation(remembering(rng, 20000, 10.0)) for _ in range(300)]
    off = np.array([(one.value - truth) / one.error for one in results])
    assert 0.75 < off.std() < 1.3 and abs(off.mean()) < 0.5
    short = [measures.autocorrelation(remembering(rng, 200, 5.0)).value for _ in range(600)]
    assert np.mean(short) == pytest.approx(1 / np.tanh(0.5 / 5.0), rel=0.12)


def memory_of_a_square(rng, starts, samples, memory):
    """What runs of three such components tell of their square."""
    x = [[remembering(rng, samples, memory) for _ in range(3)] for _ in range(starts)]
    parts = [measures.autocovariance(np.transpose(one)) for one in x]
    return measures.autocorrelation_of_square(np.concatenate(parts))


def test_the_memory_of_a_square():
    """Locks out the memory of a squared dipole as that of the dipole, a value that noise makes too
    large, and an error that does not cover: runs of 100 memories, as those of water."""
    rng, memory, samples = np.random.default_rng(6), 40.0, 4000
    keep = np.exp(-2 / memory)  # of the square: that of a component, squared
    truth, results = (1 + keep) / (1 - keep), {}
    for starts in 1, 6:
        results[starts] = [memory_of_a_square(rng, starts, samples, memory) for _ in range(150)]
        values = np.array([one.value for one in results[starts]])
        assert abs(values.mean() / truth - 1) < 0.03
        covered = [abs(one.value - truth) < one.margin for one in results[starts]]
        assert np.mean(covered) > 0.85 and results[starts][0].freedom == 3 * starts - 1
    # in runs of ten memories squares of noise would make it 13 % too large
    short = [memory_of_a_square(rng, 1, samples // 10, memory).value for _ in range(600)]
    assert 0.85 < np.mean(short) / truth < 1.0
    # the square of the same series tells much less
    squares = [
        measures.autocorrelation(sum(remembering(rng, samples, memory) ** 2 for _ in range(3)))
        for _ in range(150)
    ]
    assert np.std([one.value for one in squares]) > 1.3 * np.std([one.value for one in results[1]])


def test_a_gains_interval_covers():
    """Locks out intervals of gains that are too narrow: of noises whose logarithms are normal, that
    of the true ratio is inside in 95 % of cases."""
    rng, inside = np.random.default_rng(4), 0
    for _ in range(2000):
        first, second = (
            precision.BiasAndNoise(Estimate(0.0), Estimate(noise, 0.2 * noise))
            for noise in np.exp(0.2 * rng.normal(size=2))
        )
        result = precision.times(first, second, 1.0)
        inside += result.low <= 1.0 <= result.high
    assert 0.94 < inside / 2000 < 0.965


def test_time_to_an_error():
    """Locks out a time to an error that the bias alone exceeds, and a ratio upside down."""
    good = precision.BiasAndNoise(Estimate(0.0), Estimate(2.0))
    bad = precision.BiasAndNoise(Estimate(0.1), Estimate(1.0))
    assert precision.seconds(good, 0.1) == (pytest.approx(200.0),) * 3
    assert precision.seconds(bad, 0.1).value == np.inf
    assert precision.times(bad, good, np.sqrt(0.02)).value == pytest.approx((1 / 0.01) / (2 / 0.02))
    assert precision.times(good, bad, 0.05).value == 0
    assert precision.times(bad, good, 0.05).plain()["value"] is None
    nothing = precision.BiasAndNoise(Estimate(np.nan), Estimate(1.0))
    assert set(precision.times(nothing, good, 0.1).plain().values()) == {None}
    unsure = precision.BiasAndNoise(Estimate(0.0, 0.1), Estimate(2.0, 0.2))
    spread = precision.seconds(unsure, 0.1)
    assert 180 < spread.low < spread.value < np.inf and spread.high == np.inf
    assert unsure.error(1e12) == pytest.approx(0.1)


def gas(seed, temperature, pressure, samples=400, bodies=2000, wide=1.0):
    """Independent samples of an ideal gas whose bodies have the potential energy of three springs:
    volumes, Å³, and energies, kcal/mol, have gamma distributions. ``wide`` makes both wider."""
    rng, kt = np.random.default_rng(seed), BOLTZMANN * temperature
    energies = kt * rng.gamma(1.5 * bodies, size=samples)
    volumes = kt * ATM / pressure * rng.gamma(bodies + 1, size=samples)
    values = np.array([energies, volumes])
    mean = values.mean(axis=1, keepdims=True)
    return structure.Sampled(temperature, pressure, mean + wide * (values - mean))


@pytest.mark.parametrize(("wide", "low", "high"), [(1.0, 0.4, 1.4), (0.85, 2, 4), (1.15, 2, 4)])
def test_two_states_of_series(wide, low, high):
    """Locks out samples that remember each other and pass for independent ones, of which a right
    ensemble has several standard deviations, and a check that a width 15 % off passes."""
    rng, volume, sd = np.random.default_rng(7), 15800.0, 178.0
    kt, ((*_, low_state), _, (*_, high_state)) = BOLTZMANN * 298.0 * ATM, schemes.STATES
    apart = sd**2 * (high_state - low_state) / kt  # of two normal distributions
    assert 1.5 < apart / sd < 2.5
    results = []
    for _ in range(12):
        pair = []
        for pressure, mean in (low_state, volume), (high_state, volume - apart):
            values = measure.thin(
                mean + wide * sd * remembering(rng, 12500, 50.0), times=measure.DENSER
            )
            both = np.concatenate([0 * values, values])
            pair.append(structure.Sampled(298.0, pressure, both))
        results.append(structure.between_states(*pair))
    assert low < np.sqrt(np.mean(np.square(results))) < high


def test_independent_samples():
    """Locks out samples that remember each other: of two series the slower one counts."""
    rng = np.random.default_rng(5)
    fast = rng.normal(size=20000)
    slow = signal.lfilter([1], [1, -0.9], fast)
    for times in 1, 4:
        apart = len(slow) / measure.thin(fast, slow, times=times).shape[1]
        assert apart == pytest.approx(1.9 / 0.1 / times, rel=0.2)  # (1 + 0.9) / (1 - 0.9)
    assert measure.thin(fast).shape == (1, 20000)


def test_a_bias_has_the_error_of_both():
    """Locks out a reference that is taken as exact."""
    one = measures.difference(Estimate(7.0, 3.0), Estimate(2.0, 4.0))
    assert one.value == 5.0 and one.error == pytest.approx(5.0) and one.freedom is None
    few = measures.difference(Estimate(7.0, 3.0, 4.0), Estimate(2.0, 4.0, 4.0))
    assert few.margin == pytest.approx(np.hypot(*(Estimate(0, e, 4.0).margin for e in (3, 4))))


def test_the_scatter_of_starts_tells_their_errors():
    """Locks out errors of the series where starts are further apart than these say: -9, -9.1 and
    -9.2 have a mean with the error 0.1/√3, and Student's t of two degrees of freedom. And a margin
    of 12.7 errors of two starts that are as near as their own errors say."""

    def pooled(number, *error):
        return measures.mean_of_starts([Estimate(-9.0 - 0.1 * i, *error) for i in range(number)])

    apart = pooled(3, 1e-6)
    assert apart.value == pytest.approx(-9.1) and apart.error == pytest.approx(0.1 / np.sqrt(3))
    assert apart.margin == pytest.approx(4.302653 * apart.error, rel=1e-6)
    assert pooled(1, 1e-6) == Estimate(-9.0, 1e-6)
    assert pooled(2, 0.1, 20.0) == pytest.approx((-9.05, 0.1 / np.sqrt(2), 40.0))
    assert pooled(2, 0.1).margin == pytest.approx(1.96 * 0.1 / np.sqrt(2), 1e-3)
    assert pooled(2, 0.0).margin == pytest.approx(12.706 * 0.05, 1e-3)


@pytest.mark.parametrize("starts", [1, 2, 5])
def test_the_error_of_a_dipoles_fluctuation_covers(starts):
    """Locks out margins that are too sure of how much runs of five memories remember: they covered
    in 75 to 86 % of cases."""
    rng, memory, samples, covered = np.random.default_rng(starts), 210.0, 1000, []
    for _ in range(1000 // starts):
        some = [
            measures.mean(sum(remembering(rng, samples, memory) ** 2 for _ in range(3)))
            for _ in range(starts)
        ]
        mean = measures.mean_of_starts(some)
        covered.append(abs(mean.value - 3) < mean.margin)
    assert 0.88 < np.mean(covered) < 0.98


def test_dipoles_of_all_starts_together():
    """Locks out the memory of the dipole from each start by itself, or in samples; and the variance
    of one start for that of all."""
    rng, plan, memory, starts = np.random.default_rng(9), scenes.SCENES["water"](None), 40.0, []
    rest = dict.fromkeys(("PotEng", "Press", "Volume"), np.ones(4000))
    for _ in range(4):
        columns = {key: remembering(rng, 4000, memory) for key in DIPOLE}
        table = rest | columns | {"Time": 24.0 * np.arange(4000)}
        starts.append(measure.of_series(table, plan, plan.schemes["nh"]))
    pooled = measure.pool(starts)
    variances = [one.variances["dipole"] for one in starts]
    assert pooled.variances["dipole"] == pytest.approx(np.mean(variances)) != variances[0]
    remembers = pooled.remembers["dipole"]
    assert remembers.value == pytest.approx(0.024 * memory, rel=0.15)
    assert remembers.freedom == 3 * 4 - 1


def oscillators(rng, h, kt, parts=3000, steps=100):
    """Harmonic modes of unit mass as a global thermostat in the middle of the step has them: each
    is canonical for the shadow Hamiltonian of kick, drift, kick, and amplitudes change slowly.

    Returns:
        frequencies, positions, (parts * steps, modes), and the exact <x^2>.
    """
    w = np.linspace(0.3, 1.0, 12)
    turn = np.arccos(1 - (h * w) ** 2 / 2)  # a step's angle
    # <v^2> of the middle is w^2 <x^2>; the shadow's action is kT' / (turn / h) in each mode
    over = turn / h * w * np.sqrt(1 - (h * w / 2) ** 2)  # kT' / <x^2>
    warm = kt * len(w) / (w**2 / over).sum()
    ends = rng.normal(size=(2, parts + 1, 1, len(w))) * np.sqrt(warm / over)
    mix = np.linspace(0, np.pi / 2, steps, endpoint=False)[:, None]
    a, b = (np.cos(mix) * one[:-1] + np.sin(mix) * one[1:] for one in ends)
    angle = np.arange(parts * steps).reshape(parts, steps, 1) * turn
    return w, (a * np.cos(angle) + b * np.sin(angle)).reshape(-1, len(w)), warm / over


@pytest.mark.parametrize("h", [0.3, 0.6])
def test_refined_averages_are_those_of_small_steps(h):
    """Locks out a term, a sign or a factor of the refined average: of harmonic modes the error of
    the mean squared force is known, and the mean energy has none."""
    kt = 1.7
    w, x, square = oscillators(np.random.default_rng(5), h, kt)
    u, force = (0.5 * w**2 * x**2).sum(axis=1), (w**4 * x**2).sum(axis=1)
    off, exact = (w**4 * square).sum() - kt * (w**2).sum(), kt * (w**2).sum()
    assert off == pytest.approx(0.0152 * h**2 * exact, rel=0.05)
    for a, error, share in (force, off, 0.1), (u, 0.0, 0.2):
        made = refined.series(a, u, h**2 / 24 * force, h, kt, len(w))
        assert a.mean() - made.mean() == pytest.approx(error, abs=share * off * a.mean() / exact)
    # the parts of a series of the energy's square are independent, and known to their errors
    parts = [np.array_split(one, 60) for one in (u**2, u, h**2 / 24 * force)]
    means = [measures.mean(refined.series(*part, h, kt, len(w))) for part in zip(*parts)]
    spread = np.std([mean.value for mean in means], ddof=1)
    assert np.mean([mean.error for mean in means]) == pytest.approx(spread, rel=0.25)


def test_total_error_against_brute_force():
    """Locks out another formula of bias and noise: the rms error of means of many runs that last so
    long, of a series with a bias."""
    rng, cost, apart, bias = np.random.default_rng(3), 2.5, 0.1, 0.05
    x = 3.0 * remembering(rng, 400000, 8.0)
    remembers = measures.autocorrelation(x).times(apart)
    assert remembers.value == pytest.approx(apart / np.tanh(0.5 / 8.0), rel=0.1)
    worth = precision.BiasAndNoise(Estimate(bias), remembers.times(np.var(x) * cost))
    for samples in 2000, 20000:
        errors = [3.0 * remembering(rng, samples, 8.0).mean() + bias for _ in range(400)]
        seconds = samples * apart * cost
        brute = np.sqrt(np.mean(np.square(errors)))
        assert worth.error(seconds) == pytest.approx(brute, rel=0.15)
        assert precision.seconds(worth, brute).value == pytest.approx(seconds, rel=0.5)
