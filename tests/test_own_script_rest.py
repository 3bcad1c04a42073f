"""Where the rest of the time goes that the trial of a user's script has."""

import numpy as np
import pytest

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation.own import law, rest, trial
from validation.statistics import measures
from validation.statistics.estimate import Estimate

STEPS = 1.0, 1.5, 2.0, 3.0, 4.0, 6.0


def row(dt, name="nosquish", seconds=1.0, **errors):
    """A row of a trial, with errors of (value, standard error); ``seconds`` is the cost with a step
    of 1."""
    spent = measures.spread([seconds / dt])
    return {
        **{"integrator": name, "label": name, "dt": dt, "lines": [f"fix {name}"], "failed": None},
        **{"is_reference": False, "asked": True, "uncounted": False, "ours": name == "nosquish"},
        **{"cost": None, "rough": spent, "signed": {}, "time": 100.0, "alone": False},
        "errors": {name: Estimate(*error).plain() for name, error in errors.items()},
    }


def test_time_goes_to_the_integrator_that_promises_the_fastest_step():
    """Locks out time for an integrator whose good steps are slower, for one whose step is fast and
    bad, and for what is known already."""
    wanted = {"temperature": 1.0}

    def promise(*rows):
        found = rest.promising(rows, wanted)
        return found and (found["integrator"], found["dt"])

    ours = row(2.0, temperature=(0.6, 0.5)), row(4.0, temperature=(1.3, 0.5))
    slow = row(2.0, "slow", 2.0, temperature=(0.1, 0.5))
    fast = row(4.0, "fast", 0.5, temperature=(1.9, 0.6))
    assert promise(*ours, slow, fast) == ("nosquish", 2.0)
    # without its noise an error of 1.05 is one of 0.9
    assert promise(*ours, slow, row(4.0, "fast", 0.5, temperature=(1.05, 0.54))) == ("fast", 4.0)
    assert promise(row(2.0, "fast", 0.5, temperature=(3.0, 0.1)), *ours) == ("nosquish", 2.0)
    # none promises: the nearest
    assert promise(ours[1], fast) == ("nosquish", 4.0)
    # what is behind a bad step, or fails, or has no error of a target
    bad = row(1.0, "fast", 0.5, temperature=(3.0, 0.1))
    assert promise(*ours, bad, row(6.0, "fast", 0.5, temperature=(0.0, 0.5)))[0] == "nosquish"
    assert promise(*ours, row(6.0, "fast", 0.5) | {"failed": "it heats"})[0] == "nosquish"
    assert promise(row(2.0), row(3.0, "fast", drift=(0.0, 0.1))) is None
    # known already: nothing that may be good is faster
    sure = row(2.0, temperature=(0.1, 0.1)), row(4.0, temperature=(3.0, 0.1))
    assert promise(*sure, slow) is None
    assert promise(*sure, row(4.0, "fast", 0.5, temperature=(0.5, 0.5))) == ("fast", 4.0)


def procedure(shape, size, bar, random):
    """Steps that are named: with as much time for each, and with the rest of it for one step.

    Args:
        shape: of the error against the step.  size: of it at a step of 1, in targets.
        bar: standard error of a run, if all get the same time, in targets.
    """
    wanted, names = {"temperature": 1.0}, ("nosquish", "other")

    def rows(means):
        found = []
        for name, own in means.items():
            for dt in own:
                error = law.by_law(dt, own)
                cost = 1.0 if name == "nosquish" else 1.1
                found.append(row(dt, name, cost, temperature=(abs(error.value), error.error)))
        return found

    def mean(dt, error):
        return Estimate(size * shape(dt) + error * random.normal(), error)

    def named(found):
        found = [one | {"cost": one["rough"]} for one in found]
        best = trial.chosen(found, wanted, trial.level(found)).best
        return best["dt"] if best else 0.0

    alike = named(rows({name: {dt: mean(dt, bar) for dt in STEPS} for name in names}))
    short = bar / np.sqrt(rest.FIRST)
    means = {name: {dt: mean(dt, short) for dt in STEPS} for name in names}
    found = rows(means)
    best = rest.promising(found, wanted)
    if best:
        own, dt = best["integrator"], best["dt"]
        steps = [one["dt"] for one in rest.neighbours(found, best)]
        cost = (2.1 if own == "nosquish" else 2.1 / 1.1) * sum(1 / one for one in STEPS)
        times = (1 - rest.FIRST) * cost / sum(1 / one for one in steps)
        means[own] |= {one: mean(one, bar / np.sqrt(times)) for one in steps}
        found, alone = rows(means), means[own][dt]
        for one in found:
            if (one["integrator"], one["dt"]) == (own, dt):
                one |= row(dt, own, 1.0, temperature=(abs(alone.value), alone.error))
                one["alone"] = True
    return alike, named(found)


SHAPES = {
    "square": lambda dt: dt**2,
    "less": lambda dt: dt**2 * (1 - 0.015 * dt**2),
    "more": lambda dt: dt**2 * (1 + 0.03 * dt**2),
    "same": lambda dt: 4.0,
}


def test_time_for_one_step_names_longer_steps_and_no_wrong_ones():
    """Locks out a second part of a trial that tells less than the same time for all, and an answer
    that is wrong more often than it says, for runs were chosen by what they show."""
    gained = []
    for shape, grows in SHAPES.items():
        for size in (0.02, 0.05, 0.15, 0.5):
            for bar in (0.15, 0.5):
                random = np.random.default_rng(9)
                named = np.array([procedure(grows, size, bar, random) for _ in range(100)])
                wrong = sum(size * grows(dt) > 1 for dt in named[:, 1] if dt)
                assert wrong <= 9, (shape, size, bar)  # of 5 in so many
                gained.append(named.mean(axis=0))
    before, after = np.mean(gained, axis=0)
    assert after > 1.1 * before


def test_a_step_that_its_own_run_judges_is_good_by_itself():
    """Locks out a step that waits for shorter ones that nobody has run for long; and a long run
    that fails, or that is not timed, and is named."""
    wanted = {"temperature": 1.0}
    rows = [row(dt, temperature=(0.3, 0.6)) | {"cost": measures.spread([1 / dt])} for dt in STEPS]
    assert trial.chosen(rows, wanted, trial.level(rows)).best is None
    rows[2] |= {"alone": True, "errors": {"temperature": Estimate(0.5, 0.25).plain()}}
    assert trial.level(rows) == trial.CONFIDENCE
    assert trial.chosen(rows, wanted, trial.level(rows)).best == rows[2]
    other = row(1.0, "other", temperature=(0.3, 0.6))
    assert trial.level([*rows, other]) == pytest.approx(0.975)
    for worse in {"failed": "it heats"}, {"cost": None}:
        some = [*rows[:2], rows[2] | worse, *rows[3:]]
        assert trial.chosen(some, wanted, 0.95).best is None
    rows[2]["errors"] = {"temperature": Estimate(2.0, 0.25).plain()}
    choice = trial.chosen(rows, wanted, 0.95)
    assert choice.best is None and {one["dt"] for one in choice.perhaps} == {1.0, 1.5}


def test_neighbours_are_the_next_steps_that_run():
    """Locks out time for a step that has failed, or for another integrator's."""
    rows = [row(dt, temperature=(0.3, 0.6)) for dt in STEPS] + [row(2.5, "other")]
    rows[4]["failed"] = rows[5]["failed"] = "it heats"

    def steps(best):
        return [one["dt"] for one in rest.neighbours(rows, best)]

    assert steps(rows[0]) == [1.0, 1.5] and steps(rows[1]) == [1.0, 1.5, 2.0]
    assert steps(rows[3]) == [2.0, 3.0] and steps(rows[6]) == [2.5]
