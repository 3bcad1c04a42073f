"""Averages at step zero from long steps: ``sample --to-zero``."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from support import (
    scripts,
)
from support.harness import take
from support.running import ROOT
from validation import INPUTS, __main__
from validation.experiment import Point
from validation.running import run
from validation.sample import extrapolation, scenes, schemes
from validation.sample import plan as plans
from validation.statistics import limit, measures
from validation.statistics.estimate import Estimate

RESULTS = ROOT / "validation" / "results"
SHORT, USUAL, EVEN, FOUR = (4, 8), (2.5, 5, 7.5), (4, 6, 8), (2, 4, 6, 8)
# of water with csvr at 8 fs, as committed: what a mean is off, and the standard error of one of
# 300 ps; of the torque also the part of the term in h^4 that langevin-5 shows
ENERGY, PRESSURE, TORQUE = (-0.025, 0.004), (-97.0, 14.0), (6.65, 0.12)


def off(size, share, h):
    """A mean's error of the step that is so large at 8 fs: a series whose terms are, at 8 fs, each
    this share of the one before, as of a motion that is unstable at 8 fs over its root."""
    x = (h / 8) ** 2
    return size * (1 - share) * x / (1 - share * x)


def cover(steps, size, error, share, repeats=1000, freedom=None, common=0.0):
    """How often the interval at zero has the truth, and how often it is said to be wide.

    Args:
        common: of a mean's error, the part that all steps have from their common start.
    """
    rng, inside, wide = np.random.default_rng(8), 0, 0
    for _ in range(repeats):
        start, points = rng.normal(), {}
        for h in steps:
            noise = np.sqrt(1 - common**2) * rng.normal() + common * start
            scale = np.sqrt(rng.chisquare(freedom) / freedom) if freedom else 1.0
            points[h] = Estimate(off(size, share, h) + error * noise, error * scale, freedom)
        fit = limit.extrapolate(points)
        inside += abs(fit.limit.value) < fit.limit.margin
        wide += extrapolation._of_fit(fit, dict.fromkeys(steps, 1.0))["wide"]
    return inside / repeats, wide / repeats


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
@pytest.mark.parametrize("number", [ENERGY, PRESSURE, TORQUE], ids=["energy", "pressure", "torque"])
def test_the_interval_covers_the_limit(number, share):
    """Locks out an interval that leaves out what the line in the square of the step leaves out, or
    that is much too wide: it has the truth in 95 ± 2.5 % of 1,000 repeats, with terms in h^4 and
    above of the size that water has, for usual steps."""
    inside, _ = cover(USUAL, *number, share)
    assert 0.93 < inside < 0.975


@pytest.mark.parametrize("steps", [SHORT, EVEN, FOUR])
@pytest.mark.parametrize("share", [0.0, 0.4])
@pytest.mark.parametrize("number", [ENERGY, PRESSURE, TORQUE], ids=["energy", "pressure", "torque"])
def test_an_interval_that_covers_too_often_is_said_to_be_wide(number, share, steps):
    """Locks out steps that do not tell the term in h^4 and an interval without it; and silence
    where the interval has much for it."""
    inside, wide = cover(steps, *number, share, repeats=500)
    assert inside > 0.93 and (inside < 0.98 or wide > 0.3)


def test_few_values_and_a_common_start_cover():
    """Locks out errors as if they were known where twelve blocks tell them, and a start that all
    steps have in common as a reason for smaller intervals."""
    for how in {"freedom": 11}, {"common": 0.7}:
        inside, _ = cover(USUAL, *ENERGY, 0.2, **how)
        assert 0.93 < inside < 0.995


def rows_of(means, scheme="csvr", starts=1):
    """Rows of a scheme, of a mean at each step."""
    return [
        {
            "scheme": scheme,
            "dt": dt,
            "error": None,
            "starts": starts,
            "means": {"torque": one.plain()},
        }
        for dt, one in means.items()
    ]


@pytest.fixture(scope="module")
def water():
    return scenes.SCENES["water"](None)


def torques(share, error=0.06, steps=USUAL, size=6.65):
    """Means without noise, with their errors."""
    return {h: Estimate(45.0 + off(size, share, h), error) for h in steps}


def test_the_fourth_power_is_recognised():
    """Locks out a term in h^4 that is not seen where it is there, or seen where it is not; a limit
    that is off by it; and, of two steps, that it cannot be told."""
    result = extrapolation.extrapolate(rows_of(torques(0.4)), 300.0)["torque"]
    assert result["h4"] and not result["why"] and abs(result["value"] - 45.0) < 0.06
    line = limit.extrapolate(torques(0.4), powers=1).limit
    assert abs(line.value - 45.0) > 2 * line.margin
    result = extrapolation.extrapolate(rows_of(torques(0.0)), 300.0)["torque"]
    assert not result["h4"] and not result["wide"]
    # the curve goes through the means
    for share in 0.0, 0.4:
        means = torques(share)
        curve = np.polynomial.Polynomial(
            extrapolation.extrapolate(rows_of(means), 300.0)["torque"]["curve"]
        )
        for h, mean in means.items():
            assert curve((h / max(means)) ** 2) == pytest.approx(mean.value, abs=mean.error)
    result = extrapolation.extrapolate(rows_of(torques(0.4, steps=SHORT)), 300.0)["torque"]
    assert result["wide"] and result["probability"] is None
    assert abs(result["value"] - 45.0) < Estimate.of(result).margin


def test_points_that_fit_no_series_are_refused():
    """Locks out a number where the means are no series in the square of the step, as where the
    longest step is unstable: of water at 12 fs, as committed, and of one that goes up and down."""
    up = {4.0: -0.005, 6.0: -0.014, 8.0: -0.020, 10.0: 0.017}
    means = {dt: Estimate(-9.4 + value, 0.002) for dt, value in up.items()}
    result = extrapolation.extrapolate(rows_of(means), 300.0)["torque"]
    assert "no series" in result["why"]
    said = extrapolation._answer("torque", result)
    assert "at 4, 6, 8, 10 fs" in said and "leave out the longest step" in said
    del means[10.0]  # as advised
    again = extrapolation.extrapolate(rows_of(means), 300.0)["torque"]
    assert not again["why"] and "no number" not in extrapolation._answer("torque", again)
    some = {4.0: Estimate(45.0, 0.1), 6.0: Estimate(45.0, np.inf), 8.0: Estimate(45.0)}
    one = extrapolation.extrapolate(rows_of(some), 300.0)["torque"]
    assert one["why"] == "only one step tells a mean" and "value" not in one
    assert "add steps (--dt)" in extrapolation._answer("torque", one)
    some |= {6.0: Estimate(44.0, 0.1)}
    assert not extrapolation.extrapolate(rows_of(some), 300.0)["torque"]["why"]


def measured(steps, size, error, share, rng):
    """Means with noise."""
    return {h: Estimate(off(size, share, h) + error * rng.normal(), error) for h in steps}


@pytest.mark.parametrize("number", [ENERGY, PRESSURE, TORQUE], ids=["energy", "pressure", "torque"])
def test_a_step_that_is_advised_narrows_the_interval(number):
    """Locks out a further step, advised where the interval has much for the term in h^4, that
    leaves it so, or makes it wrong."""
    rng, ratios, inside = np.random.default_rng(5), [], []
    summary = {"title": "", "settings": {"starts": 1, "time": 300.0, "settle": 1.0}}
    while len(ratios) < 100:
        means = measured(SHORT, *number, 0.2, rng)
        before = extrapolation.extrapolate(rows_of(means), 300.0)["torque"]
        if not before["wide"]:
            continue
        rows = [row | {"label": "", "lines": []} for row in rows_of(means)]
        (advice,) = extrapolation.describe(
            summary | {"rows": rows, "zero": {"torque": before}}
        ).lines[1:]
        (step,) = map(float, re.findall(r"at best about ([\d.]+) fs \(--dt\)", advice))
        means |= measured([step], *number, 0.2, rng)
        after = extrapolation.extrapolate(rows_of(means), 300.0)["torque"]
        if not after["why"]:
            assert not after["wide"]
            ratios.append(Estimate.of(after).margin / Estimate.of(before).margin)
            inside.append(abs(after["value"]) < Estimate.of(after).margin)
    assert max(ratios) < 0.8 and np.mean(inside) > 0.85


def test_a_refused_average_without_its_longest_step():
    """Locks out the advice to leave out the longest step, of torques whose terms fall off too
    slowly for a series, if no number comes of it, or a wrong one."""
    rng, refused, inside = np.random.default_rng(5), 0, []
    for _ in range(100):
        means = measured(FOUR, *TORQUE, 0.6, rng)
        if extrapolation.extrapolate(rows_of(means), 300.0)["torque"]["why"]:
            refused += 1
            del means[8]
            again = extrapolation.extrapolate(rows_of(means), 300.0)["torque"]
            if not again["why"]:
                inside.append(abs(again["value"]) < Estimate.of(again).margin)
    assert refused > 50 and len(inside) > 0.8 * refused and np.mean(inside) > 0.85


def test_what_a_short_step_would_cost():
    """Locks out another cost beside a run at 1 fs: the variance of U0 by the weights of a line, of
    means that are not off, is (1.125^2 + 0.125^2) times that of a mean, as textbooks have it."""
    means = {h: Estimate(45.0, 0.1) for h in (2.5, 7.5)}
    results = extrapolation.extrapolate(rows_of(means, starts=2), 100.0)["torque"]
    variance = 1.125**2 + 0.125**2
    steps = 200 / 2.5 + 200 / 7.5
    assert results["fewer"] == pytest.approx(200 / variance / steps, rel=0.02)


def test_what_is_run(water):
    """Locks out several schemes, moments of inertia that are others at each step, averages whose
    error is of another power, and a single step; other usual steps than a third, two thirds and
    all of the longest one."""
    assert extrapolation.points(water, ["csvr"], (8.0, 4.0)) == [
        Point("csvr", 4.0),
        Point("csvr", 8.0),
    ]
    assert [point.dt for point in extrapolation.points(water, ["csvr"], None)] == [2.0, 4.0, 6.0]
    assert extrapolation.default_steps(8.02) == (2.5, 5.0, 8.0)
    assert extrapolation.default_steps(0.9) == pytest.approx((0.3, 0.6, 0.9))
    for only, steps, said in (
        (["csvr", "nh"], None, "one scheme"),
        (["csvr-step"], None, "depend on the step"),
        (["csvr"], (8.0,), "two steps"),
        (["csvr-refined"], None, "does not apply"),
    ):
        with pytest.raises(SystemExit, match=said) as refusal:
            extrapolation.points(water, only, steps)
        if said == "depend on the step":
            (words,) = re.findall("such as '(.*)'$", str(refusal.value))
    step = water.schemes["csvr-step"]
    fixed = replace(step, lines=tuple(one.replace("moments step", words) for one in step.lines))
    assert extrapolation.points(replace(water, schemes={"csvr-step": fixed}), None, None)


def test_committed_points_lead_to_the_committed_limit():
    """Locks out extrapolations that real runs contradict: of water's schemes with three steps up to
    8 fs each average is beside the limit, which other schemes and short steps have told, too."""
    summary = json.loads((RESULTS / "sample-water-steps" / "summary.json").read_text())
    number = 0
    for scheme in "langevin-5", "langevin-20", "csvr":
        rows = [row for row in summary["rows"] if row["scheme"] == scheme and row["dt"] <= 8]
        zero = extrapolation.extrapolate(rows, summary["settings"]["time"])
        for key in "potential", "pressure", "torque":
            assert not zero[key]["why"]
            off = measures.difference(Estimate.of(zero[key]), Estimate.of(summary["limits"][key]))
            assert abs(off.value) < 1.5 * off.margin
            number += 1
    assert number == 9


def beginning(path, words, tmp_path, monkeypatch, steps):
    """What the verb makes of a script with steps, in runs of some samples; its exit status."""
    monkeypatch.setattr(plans, "ROUNDS", 1)
    monkeypatch.setattr(plans, "SECONDS", 0.02)
    out = tmp_path / "zero"
    status = __main__.main(["sample", str(path), "--to-zero", *words, "--out", str(out)])
    summary = json.loads((out / "summary.json").read_text())
    assert [row["dt"] for row in summary["rows"]] == steps
    assert not any(row["error"] for row in summary["rows"])
    assert status == any(one["why"] for one in summary["zero"].values())
    page = (out / "report.html").read_text()
    assert "at zero" in page and (out / "averages.csv").exists() and (out / "to-zero.png").exists()
    return summary


def test_longer_steps_run_from_half_of_the_starts(water, tmp_path):
    """Locks out time that is given to steps of which the limit takes little; progress that counts
    what is not run; and fewer starts where biases are asked for."""
    points = extrapolation.points(water, ["csvr"], (2.0, 4.0, 8.0))
    for fewer, each in (True, (3, 2, 2)), (False, (3, 3, 3)):
        runs = plans.Runs(water, plans.Lengths(10.0, 3), tmp_path, 60.0, fewer)
        made = [one.point for one in runs.trajectories(points) if one.point]
        assert tuple(map(made.count, points)) == each
        steps = sum(sum(runs.lengths.runs(point.dt)) for point in made)
        assert runs.steps(points) == steps + 3 * runs._begin


def test_scripts_without_a_thermostat_of_their_fix_are_refused(taken):
    """Locks out averages of a temperature that another fix controls. The fixes that the message
    names are those of the scripts that run below."""
    with pytest.raises(SystemExit, match=r"kept by fix nvt or npt, rigid/nvt or rigid/npt, nosq"):
        scenes.of_script(taken("rings"))


def test_the_usual_steps_of_water(tmp_path):
    """Locks out usual steps of water in equilibrium, of a script with our fix at 4 fs, that are not
    as long as its libration allows; torques where something else acts on atoms, and where the
    script has their names."""
    path = INPUTS / "water_512" / "in.512"
    own = take(path, tmp_path / "out")
    plan = scenes.of_script(own)
    assert [point.dt for point in extrapolation.points(plan, None, None)] == [2.5, 5.0, 8.0]
    assert plan.turning == 3 * 512
    assert plan.schemes["rigid/small+langevin"].lines[0] == schemes.RAW
    walls = own.reading["fixes"] | {"pull": "fix pull all addforce 0 0 0"}
    for said in (
        {"fixes": walls},
        {"commands": [*own.reading["commands"], "compute torques all ke"]},
    ):
        other = replace(own, reading=own.reading | said)
        assert scenes.of_script(other).turning == 0
    long = replace(own, scene=replace(own.scene, dt=12.0))
    assert [point.dt for point in extrapolation.points(scenes.of_script(long), None, None)] == [
        4,
        8,
        12,
    ]


@pytest.mark.timeout(600)
def test_the_verb_runs_a_script(tmp_path, monkeypatch):
    """Locks out a script that has no average at step zero, or no torques; and usual steps that do
    not follow from its forces, which are strong in a start on a lattice."""
    words = ["--ps", "0.3"]
    summary = beginning(scripts.spce(tmp_path), words, tmp_path, monkeypatch, [1.0, 2.0, 3.5])
    assert {row["scheme"] for row in summary["rows"]} == {"nosquish"}
    assert set(summary["zero"]) == {"potential", "capacity", "pressure", "torque"}
    assert all(20 < row["means"]["torque"]["value"] < 200 for row in summary["rows"])
    told = extrapolation.extrapolate
    refused = {"why": "the means fit no series in the square of the step"}
    monkeypatch.setattr(
        extrapolation,
        "extrapolate",
        lambda *some: {key: one | refused for key, one in told(*some).items()},
    )
    words = ["--ps", "0.3", "--out", str(tmp_path / "zero")]
    assert __main__.main(["sample", str(tmp_path / "in.spce"), "--to-zero", *words]) == 1
    assert "U/N: no number" in (tmp_path / "zero" / "report.html").read_text()
    with pytest.raises(SystemExit):
        __main__.main(["sample", "water", "--to-zero", "--from", str(tmp_path)])


@pytest.mark.timeout(600)
def test_the_verb_runs_a_script_at_constant_pressure(tmp_path, monkeypatch):
    """Locks out a script with a barostat that is refused, starts whose box is lost, and a pressure
    that is told as if it were not the barostat's."""
    words = ["--ps", "0.1", "--dt", "4,8"]
    summary = beginning(scripts.co2(tmp_path), words, tmp_path, monkeypatch, [4.0, 8.0])
    assert set(summary["zero"]) == {"potential", "density", "compressibility", "torque"}
    (dump,) = (tmp_path / "zero").rglob("start-1/start/state.dump")
    first = dump.read_text().rpartition("ITEM: BOX BOUNDS")[2].splitlines()[1]
    low, high = map(float, first.split())
    for log in (tmp_path / "zero").glob("runs/*-ps/start-1/nosquish-*/log.lammps"):
        volume = run.collect(log.parent).thermo["Volume"][0]
        assert volume == pytest.approx((high - low) ** 3, rel=1e-9) != 21.5**3
