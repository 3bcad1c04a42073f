"""Which step `compare` names: against a search over everything, and how often it is wrong."""

import math
from statistics import NormalDist
from types import SimpleNamespace

import numpy as np
import pytest

from support.comparison import row
from validation.compare import choice, law, measure, plan
from validation.compare.choice import choose, level_of_each
from validation.experiment import Point
from validation.statistics.estimate import Estimate

NAMES = "nosquish-2", "nosquish", "rigid"
STEPS = 1.0, 1.5, 2.0, 3.0, 4.0, 6.0


# ---- against a search over everything


def by_hand(rows, targets, level):
    """Best, ties and those of which there is no telling, as `choose` should have them, by plain
    comparisons: places in the list."""

    def ends(one, wide):  # of all errors, in targets; infinite where they are not known
        results = [one["errors"].get(name, {"value": 0.0, "error": math.inf}) for name in targets]
        return [(error["value"] + wide * error["error"]) / most
                for error, most in zip(results, targets.values())]  # fmt: skip

    sure, single = (NormalDist().inv_cdf((1 + one) / 2) for one in (level, 0.95))
    fails = {name: min((one["dt"] for one in rows if one["failed"] and one["integrator"] == name),
                       default=math.inf) for name in NAMES}  # fmt: skip
    bad = [one["failed"] is not None or max(ends(one, -single)) > 1 for one in rows]
    good, maybe = [], []
    for n, one in enumerate(rows):
        alike = [m for m, other in enumerate(rows) if other["integrator"] == one["integrator"]]
        shorter = [m for m in alike if rows[m]["dt"] <= one["dt"]]
        if any(bad[m] for m in shorter) or 1.5 * one["dt"] > fails[one["integrator"]]:
            continue
        (good if all(max(ends(rows[m], sure)) <= 1 for m in shorter) else maybe).append(n)
    maybe += [n for n in good if not rows[n]["cpu"]]
    good = [n for n in good if rows[n]["cpu"]]

    def costs(key):
        return {n: one["cpu"][key] if one["cpu"] else math.inf for n, one in enumerate(rows)}

    cost, least = costs("median"), costs("min")
    usual = cost[min(good, key=cost.get)] if good else math.inf
    tied = [n for n in good if least[n] <= usual]
    plain = [n for n in tied if rows[n]["integrator"] == "nosquish"]
    best = min(plain or tied, key=lambda n: (len(rows[n]["lines"][0].split()), cost[n]),
               default=None)  # fmt: skip
    return best, {n for n in tied if n != best}, {n for n in maybe if least[n] <= usual}


def some_rows(random, count=15):
    """Random rows: failed, not timed, without a number among them."""
    results = []
    for n in range(count):
        errors = {
            name: (10 ** random.uniform(-2, 0.5), 10 ** random.uniform(-3, -0.5))
            for name in ("x", "y")
            if random.random() < 0.95
        }
        spent = 10 ** random.uniform(0, 1) * (1 + random.uniform(0, 0.5, 3))
        cost = spent if random.random() < 0.9 else None
        one = row(0.5 * 1.4 ** (n // 3), NAMES[n % 3], cost, **errors)
        one["lines"] = [one["lines"][0] + " mrot 2" * (n % 3 == 0)]
        results.append(one | {"failed": "exploded" if random.random() < 0.08 else None})
    return results


def disagreements(cases=300):
    """What `choose` and the search say differently, over random rows and targets."""
    random = np.random.default_rng(7)
    for _ in range(cases):
        rows = some_rows(random)
        targets = {name: 10 ** random.uniform(-1, 1) for name in ("x", "y")}
        level = level_of_each(NAMES)
        result = choose(rows, targets, level)
        places = [{rows.index(one) for one in some} for some in (result.ties, result.perhaps)]
        best = None if result.best is None else rows.index(result.best)
        if (best, *places) != by_hand(rows, targets, level):
            yield best, places


@pytest.mark.quick
def test_choice_is_that_of_a_search():
    """Locks out a choice that is not the fastest, forgets a measure, or names wrong ties or
    doubts."""
    assert not list(disagreements())


def test_a_bar_across_the_target_is_not_met():
    """Locks out a point whose value is below the target and whose error bar is not; and one above
    that is called out of the question."""
    fast, slow = row(1.0, "a", [1.0], x=(0.9, 0.06)), row(1.0, "b", [5.0], x=(0.5, 0.06))
    result = choose([fast, slow], {"x": 1.0}, 0.95)
    assert result.best is slow and result.perhaps == (fast,)
    verdicts = [choose([fast], {"x": most}, 0.95).verdict for most in (1.0, 0.8, 1.03, 0.7)]
    assert verdicts == ["cannot tell", "cannot tell", "met", "not met"]
    near, factor = choice.nearest([fast, slow], {"x": 0.1})
    assert near is slow and factor == pytest.approx(5 + 0.6 * 1.96, rel=1e-3)
    assert choice.is_zero(row(1.0, x=(0.1, 0.06)), "x") and not choice.is_zero(fast, "x")


def test_integrators_whose_runs_do_not_tell_a_target():
    """Locks out such an integrator that is advised without a word, and no answer where there is no
    other."""
    lost = row(1.0, "rigid/nvt", [0.5], t=(0.1, 0.1)) | {"without": ["drift"]}
    ours, wanted = row(1.0, t=(0.1, 0.1), drift=(0.1, 0.1)), {"drift": 1.0, "t": 1.0}
    assert choose([lost, ours], wanted, 0.95).best is ours
    result = choose([lost], wanted, 0.95)
    assert result.best is lost and result.targets == {"t": 1.0}
    assert choose([lost], {"drift": 1.0}, 0.95).best is None


def test_a_step_is_not_named_over_a_shorter_one_that_is_not_good():
    """Locks out a longer step that is within the targets by chance, where a shorter one is not for
    sure; and a shorter one that is not timed, and so hides longer ones."""
    short, long = row(1.0, cost=[9.0], x=(0.5, 0.4)), row(2.0, cost=[5.0], x=(0.1, 0.1))
    wanted = {"x": 1.0}
    assert choose([short, long], wanted, 0.95).best is None
    short["errors"]["x"]["error"] = 0.1
    assert choose([short, long], wanted, 0.95).best is long
    assert choose([short | {"cpu": None}, long], wanted, 0.95).best is long
    assert choose([short | {"failed": "exploded"}, long], wanted, 0.95).verdict == "not met"
    assert choice.level_of_each(["a"]) == choice.level_of_each(["a", "b"]) == 0.95
    assert choice.level_of_each("abc") == pytest.approx(1 - 0.1 / 3)


def test_a_step_near_one_that_fails_is_not_named():
    """Locks out a step with which bonds break, but so rarely that no run of some minutes sees it: a
    brush's was named that ended a run ten times as long."""
    rows = [row(dt, cost=[1 / dt], drift=(0.1, 0.1)) for dt in (0.005, 0.01, 0.015)]
    rows.append(row(0.02) | {"failed": "Bad FENE bond", "errors": {}})
    for more in {}, {"alone": True}:
        rows[2] |= more
        assert choose(rows, {"drift": 1.0}, 0.95).best == rows[1]
    other = row(0.0151, "other", cost=[50.0], drift=(0.1, 0.1))
    assert choose([*rows, other], {"drift": 1.0}, 0.95).best is other


def test_a_step_that_its_own_run_judges_is_good_or_bad_by_that():
    """Locks out a step that waits for shorter ones that nobody has run for long, or that a short
    run of one takes back; and a long run that fails, or that is not timed, and is named."""
    rows = [row(dt, cost=[1 / dt], t=(0.3, 0.6)) for dt in STEPS]
    assert choose(rows, {"t": 1.0}, 0.975).best is None
    rows[2] |= {"alone": True, "errors": {"t": Estimate(0.5, 0.25).plain()}}
    assert choose(rows, {"t": 1.0}, 0.975).best is rows[2]  # not by 97.5 %
    bad = row(1.5, t=(3.0, 0.6))
    assert choose([rows[0], bad, *rows[2:]], {"t": 1.0}, 0.975).best is rows[2]
    for worse, best in ({"failed": "it heats"}, None), ({"cpu": None}, rows[1]):
        some = [*rows[:2], rows[2] | worse, *rows[3:]]
        assert choose(some, {"t": 1.0}, 0.95).best is best
    rows[2]["errors"] = {"t": Estimate(2.0, 0.25).plain()}
    assert {one["dt"] for one in choose(rows, {"t": 1.0}, 0.95).perhaps} == {1.0, 1.5}


@pytest.mark.parametrize("sizes", [(0.03, 0.03, 0.03), (0.1, 0.28, 0.03), (0.09, 0.0, 0.0)])
@pytest.mark.parametrize("error", [0.1, 0.2, 0.35])
def test_steps_judged_from_the_shortest_are_wrong_as_seldom_as_they_say(sizes, error):
    """Locks out a step that is named by chance, as one of many."""
    random, wrong = np.random.default_rng(1), []
    for _ in range(400):
        rows = [
            row(dt, "abc"[n], [10 / dt * (1 + 0.01 * n)],
                x=(abs(size * dt**2 + error * np.sqrt(dt) * random.normal()), error * np.sqrt(dt)))
            for n, size in enumerate(sizes) for dt in STEPS
        ]  # fmt: skip
        result = choose(rows, {"x": 1.0}, level_of_each("abc"))
        named = [result.best, *result.ties] if result.best else []
        wrong.append(any(sizes["abc".index(p["integrator"])] * p["dt"] ** 2 > 1 for p in named))
    assert np.mean(wrong) < 0.06


# ---- where the rest of the time goes

STEP, TIME = 1e-4, 1e5  # s of a step, and of short runs


def prepared(rows, targets, minutes=1.0):
    """A comparison whose short runs gave these rows."""
    names = {one["integrator"] for one in rows}
    lengths = plan.Lengths(TIME, 200, 96.0)
    points = [Point(one["integrator"], one["dt"]) for one in rows]
    settings = plan.Settings(None, minutes)
    here = plan.Machine(STEP, 0.0, 100)
    case = SimpleNamespace(scene=SimpleNamespace(dt=1.0), thermostat=None)
    made = measure.Prepared(case, settings, targets, points, Point("held", 0.5), here, lengths)
    assert made.level == level_of_each(names, measure.SHARE if len(rows) > 2 else 1.0)
    return made


def choose_long_run(rows, targets, minutes=2.0):
    return measure.choose_long_run(prepared(rows, targets, minutes), rows)


SHAPES = {
    "square": lambda dt: dt**2,
    "less": lambda dt: dt**2 * (1 - 0.015 * dt**2),
    "more": lambda dt: dt**2 * (1 + 0.03 * dt**2),
    "same": lambda dt: 4.0,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_step_that_the_whole_procedure_names_is_good(shape):
    """Locks out an answer that is wrong more often than it says, for the step was chosen by what
    the runs show; and a long run that finds nothing."""
    random, wanted, grows = np.random.default_rng(9), {"t": 1.0}, SHAPES[shape]
    wrong, named, before = 0, [], []
    for size in (0.02, 0.05, 0.15, 0.3):
        for bar in (0.2, 0.5):
            for _ in range(40):
                means = {
                    dt: Estimate(size * grows(dt) + bar * random.normal(), bar) for dt in STEPS
                }
                rows = []
                for dt, mine in means.items():
                    told = law.by_law(dt, means)
                    one = row(dt, cost=[1 / dt], t=(abs(told.value), told.error))
                    own = {"t": choice.size(mine)}
                    rows.append(one | {"by_itself": own})
                level = level_of_each(["nosquish"], measure.SHARE)
                first = choose(rows, wanted, level).best
                if best := choose_long_run(rows, wanted):
                    long = bar * best.times**-0.5
                    alone = size * grows(best.point.dt) + long * random.normal()
                    where = [one["dt"] for one in rows].index(best.point.dt)
                    errors = {"t": Estimate(abs(alone), long).plain()}
                    rows[where] = rows[where] | {"alone": True, "errors": errors}
                result = choose(rows, wanted, level).best
                before.append(first["dt"] if first else 0.0)
                named.append(result["dt"] if result else 0.0)
                wrong += result is not None and size * grows(result["dt"]) > 1
    assert wrong / len(named) < 0.05
    assert shape == "same" or np.mean(named) > 1.1 * np.mean(before)
