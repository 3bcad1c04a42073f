"""The error of a mean at a step, from runs with this step and longer ones."""

import numpy as np
import pytest

from validation.compare import law
from validation.statistics import measures
from validation.statistics.estimate import Estimate


@pytest.mark.parametrize("held", [0.0, 1.0])
@pytest.mark.parametrize("size", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("part", [-0.05, -0.02, 0.0, 0.02])
def test_error_bars_from_longer_steps_cover(part, size, held):
    """Locks out error bars that are right for an exact square law only: with one power they cover
    in 10 to 50 % of cases where the fourth power is 5 to 20 % of the error at the longest step.

    Args:
        part: the fourth power's over the second's, of a step of 1: at 6 it is 36 times that.
        size: the error at 1, in error bars of a run.
        held: the error bar of the reference, which is a run with half of the step; 0 for none.
    """
    random, finer = np.random.default_rng(3), 0.5 if held else 0.0

    def run(dt, error=1.0):
        return Estimate(size * dt**2 * (1 + part * dt**2) + error * random.normal(), error)

    covered, steps = {1.0: [], 2.0: [], 3.0: []}, (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
    for _ in range(300):
        against = run(finer, held)
        results = {dt: run(dt) for dt in steps} | ({finer: against} if held else {})
        for dt, own in covered.items():
            one = law.by_law(dt, results, against, finer)
            own.append(abs(one.value - size * dt**2 * (1 + part * dt**2)) < one.margin)
    assert min(map(np.mean, covered.values())) > 0.89


def test_longer_steps_tell_the_error_of_shorter_ones():
    """Locks out longer steps that tell nothing, one whose error has grown faster, and an error that
    no step makes smaller and passes for a small one."""
    exact = {dt: Estimate(5.0 + 0.1 * dt**2, 0.05) for dt in (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)}
    one, held = law.by_law(1.0, exact, Estimate(5.0, 0.02)), Estimate(5.0, 0.02)
    assert one.value == pytest.approx(0.1)
    assert one.margin < 0.9 * measures.difference(exact[1.0], held).margin
    squares = {dt: Estimate(0.1 * dt**2, 0.01) for dt in (1.0, 2.0)}
    grown = law.by_law(1.0, squares | {4.0: Estimate(9.0, 0.01)})
    assert grown.value == pytest.approx(0.1, abs=0.005)
    same = {dt: Estimate(0.1, 0.01) for dt in (1.0, 2.0, 4.0)}
    assert law.by_law(1.0, same).value == pytest.approx(0.1, abs=0.005)
    longest = law.by_law(4.0, squares | {4.0: Estimate(9.0, 0.01)})
    assert longest.value == pytest.approx(9.0)  # not from shorter ones
    # held against a step of the same integrator, which has a part of the error itself
    for steps in (2.0,), (2.0, 4.0):
        errors = {dt: Estimate(0.1 * dt**2, 0.01) for dt in steps}
        assert law.by_law(2.0, errors, Estimate(0.1), 1.0).value == pytest.approx(0.4)
    still = {dt: Estimate(1.0) for dt in (1.0, 2.0)}
    assert law.by_law(1.0, still, Estimate(1.0)).value == 0.0


def pole(dt):
    """An error whose powers are all alike at a step of 7, where the integrator ends."""
    return dt**2 / (1 - (dt / 7) ** 2)


@pytest.mark.parametrize("size", [0.3, 2.0, 10.0, 30.0])
def test_error_bars_cover_near_the_end_of_stability(size):
    """Locks out a longest step whose error has grown faster than a series of few powers, within
    what chi-squared sees, and that passes for what is told of shorter ones."""
    random, covered = np.random.default_rng(5), {1.0: [], 2.0: [], 3.0: []}
    for _ in range(300):
        means = {
            dt: size * pole(dt) + random.normal() for dt in (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
        }
        results = {dt: Estimate(mean, 1.0) for dt, mean in means.items()}
        for dt, own in covered.items():
            one = law.by_law(dt, results, results[0.5], 0.5)
            own.append(abs(one.value - size * pole(dt)) < one.margin)
    assert min(map(np.mean, covered.values())) > 0.92


def test_a_law_of_what_is_not_finite_or_single():
    """Locks out a trial that ends in an error of linear algebra, for one run tells nothing."""
    one, lost = Estimate(1.0, 0.1), Estimate(1.0, np.inf)
    assert law.by_law(2.0, {2.0: one}).value == 1.0
    assert law.by_law(2.0, {2.0: lost}) is None
    results = {2.0: one, 3.0: lost, 4.0: one, 6.0: one}
    assert np.isfinite(law.by_law(2.0, results).margin)
    assert law.by_law(2.0, results, lost, 1.0).margin == np.inf
    near = {1.0: one, 1.0000001: one}
    assert abs(law.by_law(1.0, near, one, 1.0).value) < 1e8  # nothing to tell it from


@pytest.mark.parametrize(
    "steps", [(0.5, 1.0), (0.5,), (0.5, 1.0, 2.0, 4.0), (1.0, 2.0, 4.0), (2.0,)]
)
def test_steps_around_that_of_the_reference_have_their_own_errors(steps):
    """Locks out an error with the wrong sign, none, or an error bar that does not cover, of steps
    that are shorter than that of the reference, and of the reference's own."""
    random, finer, covered = np.random.default_rng(11), 1.0, []
    for _ in range(400):
        means = {dt: Estimate(3.0 + 0.1 * dt**2 + 0.02 * random.normal(), 0.02) for dt in steps}
        means.setdefault(finer, Estimate(3.1 + 0.02 * random.normal(), 0.02))
        for dt in means:
            one = law.by_law(dt, means, means[finer], finer)
            covered.append(abs(one.value - 0.1 * dt**2) < one.margin)
    assert np.mean(covered) > 0.92
    exact = {dt: Estimate(3.0 + 0.1 * dt**2, 0.01) for dt in {*steps, finer}}
    for dt in exact:
        one = law.by_law(dt, exact, exact[finer], finer)
        assert one.value == pytest.approx(0.1 * dt**2)
    assert law.by_law(finer, {finer: exact[finer]}, exact[finer], finer) is None
