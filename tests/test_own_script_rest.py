"""Where the rest of the time goes that the trial of a user's script has."""

from types import SimpleNamespace

import numpy as np
import pytest

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation.choice import level_of_each
from validation.statistics import measures
from validation.statistics.estimate import Estimate
from validation.trial import law, rest, trial

STEPS = 1.0, 1.5, 2.0, 3.0, 4.0, 6.0
# what is asked of a script: its units and its atoms
OWN = SimpleNamespace(scene=SimpleNamespace(units="lj"), found=SimpleNamespace(body=range(9)))
COST = 0.1  # s of 1,000 times with a step of 1
TIME = 3e5  # of short runs


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
        **{"cost": None, "rough": spent, "signed": {}, "independent": 100.0, "untold": None},
        **{"time": TIME, "alone": False},
        "errors": told,
        "by_itself": {key: Estimate(*one).plain() for key, one in (by_itself or errors).items()},
    }


def planned(rows, wanted, seconds):
    """What is run for longer."""
    summary = {"points": rows, "targets": wanted, "time": TIME, "level": level_of(rows)}
    return rest.plan(OWN, summary, seconds)


def level_of(rows):
    """The confidence of what short runs name."""
    return level_of_each(rows, rest.SHARE)


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
    wanted = {"temperature": 1.0, "rdf": 1.0}
    for noise, again in (0.8, True), (0.1, False):
        one = row(2.0, temperature=(0.1, 0.6), rdf=(0.1, noise))
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
    # g(r) that short runs tell stays theirs
    alone = found._replace(again=False)
    assert rest.pays(alone)[0] > 0
    hidden = row(2.0, temperature=(0.1, 0.6), rdf=(0.1, 0.8))
    assert rest.pays(alone._replace(row=hidden | {"cost": hidden["rough"]}))[0] == 0
    assert rest._shrinks(found._replace(times=4.0, again=True), "rdf") == 1 / 2


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
    chance = rest.pays(found)[0] * one["rough"]["min"]
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
        best = trial.chosen(found, wanted, level).best
        return best["dt"] if best else 0.0

    level = level_of_each([{"integrator": name} for name in names])
    alike = named(rows({name: {dt: mean(dt, bar) for dt in STEPS} for name in names}))
    level = level_of_each([{"integrator": name} for name in names], rest.SHARE)
    short = bar / np.sqrt(rest.FIRST)
    means = {name: {dt: mean(dt, short) for dt in STEPS} for name in names}
    seconds = (1 / rest.FIRST - 1) * 1e-3 * TIME * sum(names.values()) * sum(1 / dt for dt in STEPS)
    found = rows(means)
    best = planned(found, wanted, seconds)
    if best:
        own, dt = best.row["integrator"], best.row["dt"]
        alone = mean(dt, short / np.sqrt(best.times))
        for one in found:
            if (one["integrator"], one["dt"]) == (own, dt):
                error = abs(alone.value), alone.error
                one |= row(dt, own, names[own], temperature=error) | {"alone": True}
    return alike, named(found)


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
    for grows in SHAPES.values():
        for size in (0.02, 0.05, 0.15, 0.5):
            for bar in (0.15, 0.5):
                random = np.random.default_rng(9)
                named = np.array([procedure(grows, size, bar, random) for _ in range(80)])
                wrong = sum(size * grows(dt) > 1 for dt in named[:, 1] if dt)
                gained.append((*named.mean(axis=0), wrong))
    before, after, wrong = np.mean(gained, axis=0)
    assert after > 1.2 * before
    assert wrong / 80 < 0.02 and max(one[2] for one in gained) < 0.15 * 80


def test_a_step_that_its_own_run_judges_is_good_or_bad_by_that():
    """Locks out a step that waits for shorter ones that nobody has run for long, or that a short
    run of one takes back; and a long run that fails, or that is not timed, and is named."""
    wanted = {"temperature": 1.0}
    rows = [row(dt, temperature=(0.3, 0.6)) | {"cost": measures.spread([1 / dt])} for dt in STEPS]
    assert trial.chosen(rows, wanted, 0.975).best is None
    rows[2] |= {"alone": True, "errors": {"temperature": Estimate(0.5, 0.25).plain()}}
    assert trial.chosen(rows, wanted, 0.975).best == rows[2]  # not by 97.5 %
    bad = row(1.5, temperature=(3.0, 0.6))
    assert trial.chosen([rows[0], bad, *rows[2:]], wanted, 0.975).best == rows[2]
    for worse in {"failed": "it heats"}, {"cost": None}:
        some = [*rows[:2], rows[2] | worse, *rows[3:]]
        assert trial.chosen(some, wanted, 0.95).best is None
    rows[2]["errors"] = {"temperature": Estimate(2.0, 0.25).plain()}
    choice = trial.chosen(rows, wanted, 0.95)
    assert choice.best is None and {one["dt"] for one in choice.perhaps} == {1.0, 1.5}


def test_an_integrator_whose_energy_says_nothing_gets_the_time_if_there_is_no_other():
    """Locks out time that nobody gets, where only a fix of LAMMPS was asked for."""
    wanted = {"drift": 1.0, "temperature": 1.0}
    lost = [row(dt, "rigid/nvt", temperature=(0.3, 0.6)) | {"uncounted": True} for dt in (1.0, 2.0)]
    found = planned(lost, wanted, 1e3)
    assert found.row["integrator"] == "rigid/nvt" and found.wanted == {"temperature": 1.0}
    ours = row(1.0, temperature=(0.3, 0.6), drift=(0.3, 0.6))
    assert planned([*lost, ours], wanted, 1e3).row["integrator"] == "nosquish"
    assert planned([row(1.0, "rigid/nvt") | {"uncounted": True}], {"drift": 1.0}, 1e3) is None


def test_what_is_gained_counts():
    """Locks out time for a step that is hardly faster than one that is known to be good."""
    one = row(2.0, temperature=(0.3, 0.5))
    found = planned([one], {"temperature": 1.0}, 1e3)
    gains = [rest.pays(found, times * one["rough"]["min"])[0] for times in (1.0, 2.0, 1e9)]
    assert gains[0] == 0 and gains[1] == pytest.approx(gains[2] / 2)


def test_frames_tell_no_more_than_there_are(monkeypatch):
    """Locks out a chance that counts on noise that goes as the length of a run, where the memory
    has room for no more frames."""
    one = row(2.0, temperature=(0.3, 0.6), drift=(0.0, 0.1))
    wanted = {"temperature": 1.0, "drift": 1.0}
    free = planned([one], wanted, 1e3)
    assert rest._shrinks(free, "temperature") == pytest.approx(free.times**-0.5)
    monkeypatch.setattr(trial, "frames_of", lambda own, time, dt: 110)
    full = planned([one], wanted, 1e3)
    assert full.times == free.times and rest._shrinks(full, "drift") == full.times**-1.5
    assert 1.0 <= rest._shrinks(full, "temperature") < 1.2


def test_a_long_run_is_held_against_a_long_one(monkeypatch):
    """Locks out what is still settling after the start that counts as an error of the step, for it
    is held against another part of a run; and a run that the machine ended that counts as one."""
    runs = {}
    monkeypatch.setattr(trial, "rows", lambda own, every, some, found, wanted: runs.update(found)
                        or [{"asked": one in some, "dt": one.dt} for one in every])  # fmt: skip
    held, one, two = (trial.Point(name, dt) for name, dt in zip("aaa", (1.0, 2.0, 3.0)))
    tried = trial.Trial({"targets": {}}, [held, one, two], {held: "short", one: "s", two: "s"})
    assert [row["dt"] for row in rest.rows(OWN, tried, [one], {one: "long", held: "long"})] == [2.0]
    assert runs == {held: "long", one: "long"}
    runs.clear()
    rest.rows(OWN, tried, [two, one], {one: "long", two: "long"})
    assert runs == {held: "short", one: "long", two: "long"}
    for wanted, choices in (
        ({"density": 1.0, "rdf": 1.0}, (True,)),
        ({"rdf": 1.0}, (False, True)),
        ({"drift": 1.0, "temperature": 1.0}, (False,)),
    ):
        assert rest._choices(wanted) == choices
