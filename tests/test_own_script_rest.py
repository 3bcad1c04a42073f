"""Where the rest of the time goes that the trial of a user's script has."""

from types import SimpleNamespace

import numpy as np
import pytest

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation.own import law, rest, trial
from validation.statistics import measures
from validation.statistics.estimate import Estimate

STEPS = 1.0, 1.5, 2.0, 3.0, 4.0, 6.0
# what is asked of a script: its units and its atoms
OWN = SimpleNamespace(scene=SimpleNamespace(units="lj"), found=SimpleNamespace(body=()))
COST = 100.0  # s of 1,000 times with a step of 1
TIME = 300.0  # of short runs


@pytest.fixture(autouse=True)
def no_startup(monkeypatch):
    monkeypatch.setattr(trial, "startup", lambda own: 0.0)


def row(dt, name="nosquish", cost=COST, by_itself=None, **errors):
    """A row of a trial, with errors of (value, standard error)."""
    spent = measures.spread([cost / dt])
    told = {name: Estimate(*error).plain() for name, error in errors.items()}
    return {
        **{"integrator": name, "label": name, "dt": dt, "lines": [f"fix {name}"], "failed": None},
        **{"is_reference": False, "asked": True, "uncounted": False, "ours": name == "nosquish"},
        **{"cost": None, "rough": spent, "signed": {}, "time": TIME, "alone": False},
        "errors": told,
        "by_itself": {key: Estimate(*one).plain() for key, one in (by_itself or errors).items()},
    }


def planned(rows, wanted, seconds):
    """What is run for longer."""
    return rest.plan(OWN, {"points": rows, "targets": wanted, "time": TIME}, seconds)


def test_time_goes_to_the_step_that_pays_most():
    """Locks out time for a step that is bad, that is slower and no more likely good, that the time
    cannot tell, that has failed, or behind a bad one; and for what is known already."""
    wanted = {"temperature": 1.0}

    def step(*rows, seconds=1e3):
        found = planned(rows, wanted, seconds)
        return found and (found.row["integrator"], found.row["dt"])

    good, near = row(2.0, temperature=(0.3, 0.5)), row(4.0, temperature=(1.3, 0.5))
    slow = row(2.0, "slow", 2 * COST, temperature=(0.3, 0.5))
    assert step(good, near, slow) == ("nosquish", 2.0)
    assert step(good, row(4.0, temperature=(0.8, 0.5)), slow) == ("nosquish", 4.0)
    far = row(1.5, "fast", COST / 9, temperature=(3.0, 0.1))
    behind = row(6.0, "fast", COST / 9, temperature=(0.0, 0.5))
    assert step(good, near, far, behind) == step(good, near, behind | {"failed": "it heats"})
    assert step(good, far) == ("nosquish", 2.0) and step(far, behind) is None
    # its own run is noisier than what all steps tell of it, and the time does not change that
    noisy = row(6.0, "fast", temperature=(0.3, 0.5), by_itself={"temperature": (0.3, 3.0)})
    assert step(good, noisy, seconds=100.0) == ("nosquish", 2.0)
    assert step(good, noisy, seconds=1e6) == ("fast", 6.0)
    # noise of means is that of the integrator, not what the step's short run makes of it
    quiet = row(3.0, temperature=(0.3, 0.5), by_itself={"temperature": (0.3, 0.01)})
    found = planned([good, near, quiet], wanted, 1e3)
    assert found.noise == {"temperature": 0.5} and found.row["dt"] == 3.0
    # none can be told: the nearest
    assert step(row(2.0, temperature=(0.3, 9.0)), row(4.0, temperature=(0.3, 7.0)))[1] == 4.0
    assert step(row(2.0), row(3.0, "fast", drift=(0.0, 0.1))) is None
    # known already: nothing that may be good is faster
    sure = row(2.0, temperature=(0.1, 0.1)), row(4.0, temperature=(3.0, 0.1))
    assert step(*sure, slow) is None
    assert step(*sure, row(4.0, "fast", COST / 2, temperature=(0.5, 0.5))) == ("fast", 4.0)
    assert step(good, seconds=0.5e-3 * COST * TIME) is None  # not worth it


def test_the_run_that_means_are_held_against_is_longer_where_it_hides_an_error():
    """Locks out a long run that is held against a short one whose noise is as large as the target,
    and a run that costs much and tells nothing new."""
    held = row(0.5, temperature=(0.0, 0.6)) | {"is_reference": True, "asked": False}
    wanted = {"temperature": 1.0, "density": 1.0}
    for noise, again in (0.8, True), (0.1, False):
        one = row(2.0, temperature=(0.1, 0.6), density=(0.1, noise))
        found = planned([held, one], wanted, 1e3)
        assert found.again is again
        cost = (1 / 2.0 + 2 * again) * COST * found.time / 1e3
        assert cost == pytest.approx(1e3)
        counts = found.time - max(trial.SETTLES * found.time, TIME)
        assert found.times == pytest.approx(counts / (0.75 * TIME))
    assert planned([held, one], {"temperature": 1.0}, 1e3).again is False
    # noise that a run that is so many times as long has, of a slope, a mean, and one held against
    # the short run of another integrator or step
    assert rest._shrinks(found._replace(times=4.0), "drift") == 1 / 8
    assert rest._shrinks(found._replace(times=4.0), "temperature") == 1 / 2
    assert rest._shrinks(found._replace(times=4.0), "density") == pytest.approx(np.sqrt(5 / 8))
    assert rest._shrinks(found._replace(times=4.0, again=True), "density") == 1 / 2


@pytest.mark.parametrize("error", [0.2, 0.8])
@pytest.mark.parametrize("seconds", [200.0, 1e3])
def test_the_chance_that_a_run_tells_is_what_it_is(seconds, error):
    """Locks out a chance that is not that of the run: in so many of the worlds in which a short run
    shows the same does the long one find the step good for sure."""
    random, wanted = np.random.default_rng(2), {"temperature": 1.0}
    short, told = 0.5, []
    one = row(2.0, temperature=(error, short))
    found = planned([one], wanted, seconds)
    noise = short * found.times**-0.5
    for _ in range(20000):
        long = error + short * random.normal() + noise * random.normal()
        told.append(abs(long) + Estimate(long, noise).margin <= 1)
    chance = rest.pays(found, wanted)[0] * one["rough"]["min"]
    assert chance == pytest.approx(np.mean(told), abs=0.015)


def procedure(shape, size, bar, random):
    """Steps that are named: with as much time for each, and with the rest of it for one step.

    Args:
        shape: of the error against the step.  size: of it at a step of 1, in targets.
        bar: standard error of a run, if all get the same time, in targets.
    """
    wanted, names = {"temperature": 1.0}, {"nosquish": COST, "other": 1.1 * COST}

    def rows(means):
        found = []
        for name, own in means.items():
            for dt, mine in own.items():
                error = law.by_law(dt, own)
                by_itself = {"temperature": (abs(mine.value), mine.error)}
                told = abs(error.value), error.error
                found.append(row(dt, name, names[name], by_itself, temperature=told))
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
    seconds = (1 / rest.FIRST - 1) * 1e-3 * TIME * sum(names.values()) * sum(1 / dt for dt in STEPS)
    best = planned(rows(means), wanted, seconds)
    if best:
        own, dt = best.row["integrator"], best.row["dt"]
        means[own][dt] = mean(dt, short / np.sqrt(best.times))
        found = rows(means)
        for one in found:
            if (one["integrator"], one["dt"]) == (own, dt):
                one["errors"] = one["by_itself"]
                one["alone"] = True
    return alike, named(found if best else rows(means))


SHAPES = {
    "square": lambda dt: dt**2,
    "less": lambda dt: dt**2 * (1 - 0.015 * dt**2),
    "more": lambda dt: dt**2 * (1 + 0.03 * dt**2),
    "same": lambda dt: 4.0,
}


def test_time_for_one_step_names_longer_steps_and_no_wrong_ones():
    """Locks out a second part of a trial that tells less than the same time for all, and an answer
    that is wrong more often than it says, for the step was chosen by what the runs show."""
    gained = []
    for shape, grows in SHAPES.items():
        for size in (0.02, 0.05, 0.15, 0.5):
            for bar in (0.15, 0.5):
                random = np.random.default_rng(9)
                named = np.array([procedure(grows, size, bar, random) for _ in range(80)])
                wrong = sum(size * grows(dt) > 1 for dt in named[:, 1] if dt)
                print(shape, size, bar, named.mean(axis=0), wrong)
                gained.append((*named.mean(axis=0), wrong))
    before, after, wrong = np.mean(gained, axis=0)
    assert after > 1.2 * before
    assert wrong / 80 < 0.02 and max(one[2] for one in gained) < 0.15 * 80


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
