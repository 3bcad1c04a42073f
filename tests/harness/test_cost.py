"""The benchmark: its arithmetic from made-up timings, its scenes, and a small one from end to
end."""

import csv
import itertools
import json
import os
import re
import subprocess
from functools import partial

import numpy as np
import pytest

from support.harness import Silent
from support.running import BIN, read_thermo
from validation import pages
from validation.cost import measure, plan, report
from validation.running import lammps_log, machine, rounds, run, startup
from validation.scenes import SCENES
from validation.scenes.integrators import BENCHMARKED, INTEGRATORS, Integrator
from validation.statistics import measures

timing = partial(rounds.Timing, cpu=100.0)


@pytest.mark.quick
def test_ratios_are_of_one_round():
    """Locks out a ratio of medians, or of different rounds: on a machine whose speed changes from
    round to round these are wrong."""
    ours = [timing(modify=slow * 1.0) for slow in (1, 10, 3)]
    theirs = [timing(modify=slow * 4.0) for slow in (1, 10, 3)]
    ratio = rounds.ratio(ours, theirs, "modify")
    assert ratio["values"] == [0.25, 0.25, 0.25]
    uneven = rounds.ratio(
        [timing(modify=m) for m in (1, 9, 2)], [timing(modify=m) for m in (2, 3, 1)], "modify"
    )
    assert (uneven["median"], uneven["min"], uneven["max"]) == (2.0, 0.5, 3.0)
    assert rounds.ratio(ours, theirs[:1], "modify")["values"] == [0.25], (
        "the other has failed after a round"
    )
    assert rounds.ratio(ours, [], "modify") is None
    difference = rounds.difference(theirs, ours, "modify")
    assert difference["values"] == [3, 30, 9]


def test_the_order_changes_from_round_to_round(monkeypatch):
    """Locks out a place in the sequence that one integrator always has, or has more often in each
    invocation: times fell with it, and one fix against itself took 1.017 times as long."""
    monkeypatch.setattr(rounds, "timing", lambda job, result: job)
    monkeypatch.setattr(run, "run", lambda job: run.Result(None, {}, [], None, {}))

    def orders(number):
        done = []
        rounds.in_turn(
            {name: name for name in "abcd"}, lambda name, n: done.append(name), number, Silent()
        )
        return ["".join(done[4 * n : 4 * n + 4]) for n in range(number)]

    some = orders(20)
    assert all(sorted(order) == [*"abcd"] for order in some)
    for one, other in itertools.combinations("abcd", 2):  # neither is first more often
        assert sum(order.index(one) < order.index(other) for order in some) == 10
    assert len({*some}) > 5 and orders(20) != some


def test_atoms_that_have_flown_apart_have_no_speed(monkeypatch):
    """Locks out the cost of a step without neighbours: LAMMPS goes on after the energy is nan."""
    thermo = {"Step": np.array([0.0, 8.0]), "TotEng": np.array([-1.0, np.nan])}
    monkeypatch.setattr(run, "run", lambda job: run.Result(None, thermo, [], None, {}))
    timings, errors, _ = rounds.in_turn({"a": "a"}, lambda name, n: None, 2, Silent())
    assert timings == {"a": []} and errors == {"a": "no number from step 8 on: TotEng"}


def test_no_verdict_where_the_numbers_do_not_tell():
    """Locks out a sentence that ours is slower, or a defeat, where the rounds scatter across 1; and
    an interval that a spread within rounds makes."""

    def point(*ratios):
        spread = measures.spread(ratios)
        row = {"name": "rigid/nve", "label": "rigid/nve", "kind": "rigid", "modify": None}
        row |= {"loop_ratio": spread, "spent_ratio": spread, "error": None}
        return {"scene": "water", "bodies": 10, "ranks": 1, "integrators": [row]}

    low, high = (report.interval(measures.spread([1.5, 0.7, 1.4]))[key] for key in ("low", "high"))
    assert low < 1 < high
    unsure = report.describe({"points": [point(1.5, 0.7, 1.4)]})
    assert "faster in 0 of 1 cases, and significantly slower in 0" in unsure.answer
    assert unsure.defeats == []
    slow = report.describe({"points": [point(1.21, 1.2, 1.22, 1.19)]})
    assert "slower in 1" in slow.answer and "1.2 (95 % CI 1.18–1.23)" in slow.defeats[0]
    assert report.interval(measures.spread([1.2])) is None  # one round tells no scatter


def test_numbers_leave_warm_up_and_preparations_out():
    """Locks out the warm-up's time, or that of `run 0`, taken for a segment's, and seconds for
    microseconds."""

    def log(loop, modify, steps):
        return lammps_log.Loop(loop, 1, steps, 3, 90.0 + steps, {"Modify": modify})

    segments = log(1e-3, 4e-4, 4), log(2e-3, 8e-4, 4), log(9e-3, 9e-3, 4)
    logs = [log(9, 9, 0), log(9, 9, 0), log(8, 8, 2), *segments]
    seconds = {"setups": [0.5, 0.25], "runs": []}
    result = run.Result(None, {}, logs, None, {}, memory=[10, 20], seconds=seconds)
    job = run.Job(
        "", "", ["units lj", "fix 1 all nve", "fix 2 all nve"], [2, 4, 4, 4], None, setups=2
    )
    found = rounds.timing(job, result)
    assert found.modify == pytest.approx(200) and found.loop == pytest.approx(500)
    assert found.spent == pytest.approx(470)  # 94 % of a core
    assert (found.cpu, found.setups, found.memory) == (94.0, [0.5, 0.25], [10, 20])


# ------------------------------------------------------------- scenes


def one_step(scene, integrator, folder):
    """The ``Result`` of two short steps."""
    dt = 0.01 if scene.units == "real" else 1e-5
    return run.run(run.job(scene, integrator, folder, [1], dt=dt, every=0))


@pytest.mark.timeout(120)
@pytest.mark.parametrize("name", SCENES)
def test_scene_runs_alike_with_ours_and_lammps(name, tmp_path):
    """Locks out a scene whose bodies are others for ours than for rigid/nve, or whose start is not
    that of a warm, stable system, and an in.* that does not run, or is another system than the one
    that is measured."""
    scene = SCENES[name].of_size(SCENES[name].unit)
    results = [
        one_step(scene, INTEGRATORS[one], tmp_path / one.replace("/", "-"))
        for one in ("nosquish", "rigid/nve")
    ]
    assert [one.error for one in results] == [None, None]
    ours, theirs = results
    moved = np.abs(ours.positions.x[1] - ours.positions.x[0]).max()
    assert np.abs(ours.positions.x[1] - theirs.positions.x[1]).max() < 1e-6 * moved + 1e-13
    kelvin = {"water": 295, "peptide": 300, "mixed": 1, "big": 1, "dimer": 155}
    expected = kelvin.get(name, theirs.thermo["Temp"][0])  # a new scene's, as LAMMPS has it
    assert ours.thermo["Temp"][0] == pytest.approx(expected, rel=0.04)
    assert np.abs(ours.thermo["TotEng"][1] / ours.thermo["TotEng"][0] - 1) < 1e-4

    log = tmp_path / "log.lammps"
    command = [str(BIN / "lmp"), "-in", f"in.{name}", "-log", str(log), "-var", "nsteps", "2"]
    done = subprocess.run(command, cwd=scene.folder, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout
    text = log.read_text()
    energy = ours.thermo["TotEng"][0] / (ours.timings[0].atoms if scene.units == "lj" else 1)
    assert read_thermo(text)["TotEng"][0] == pytest.approx(energy, rel=1e-6)
    assert int(re.search(r"(\d+) rigid bodies", text).group(1)) == scene.unit


# ------------------------------------------------------------- from end to end


@pytest.fixture
def small(monkeypatch, tmp_path):
    """A function that runs the benchmark of the dimer on one rank: (summary, what was begun)."""
    monkeypatch.setattr(machine, "package_hash", lambda: "the code")

    def begun(integrators):
        call = measure.Call(tmp_path / "out", Silent())
        wanted = plan.points(["dimer"], (1,), [], integrators, rounds=2, seconds=0.01)
        return measure.cost(wanted, call), call.meter.begun

    return begun


@pytest.mark.timeout(240)
def test_bench_from_end_to_end(small, monkeypatch, tmp_path):
    """Locks out a failed integrator that ends the others or hides its cause, rounds that are not in
    turn, a point that is measured twice, one that is taken over although code or settings have
    changed."""
    broken = Integrator("broken", "broken", ("fix 1 {group} no/such/fix",), kind="rigid")
    monkeypatch.setitem(BENCHMARKED, "broken", broken)
    summary, begun = small(integrators=("broken", "nosquish", "rigid/nve"))
    turns = [label.rsplit(", ", 2)[1:] for label in begun]
    three = ["nosquish/nve", "rigid/nve", "nve/noforce"]
    assert sorted(turns) == sorted(
        [["broken", "1/2"]] + [[name, turn] for turn in ("1/2", "2/2") for name in three]
    )
    assert [turn for _, turn in turns] == ["1/2"] * 4 + ["2/2"] * 3
    (one,) = summary["points"]
    failed, ours, theirs = one["integrators"]
    assert "no/such/fix" in failed["error"] and failed["modify"] is None
    assert ours["error"] is None and theirs["error"] is None
    for row in ours, theirs:
        assert (
            0 < row["modify"]["median"] < row["loop"]["median"]
            and len(row["modify"]["values"]) == 2
        )
        assert row["setup"] and row["memory"]
    pairs = [a / b for a, b in zip(ours["modify"]["values"], theirs["modify"]["values"])]
    assert theirs["modify_ratio"]["values"] == pytest.approx(pairs)
    pages.write(report.describe(summary), summary, tmp_path)
    table = list(csv.DictReader((tmp_path / "table.csv").open()))
    assert [row["integrator"] for row in table] == ["broken", "nosquish/nve", "rigid/nve"]
    assert (
        "no/such/fix" in table[0]["status"]
        and float(table[1]["Modify median (µs/step)"]) == ours["modify"]["median"]
    )
    assert json.loads((tmp_path / "summary.json").read_text()) == summary

    again, begun = small(integrators=("broken", "nosquish", "rigid/nve"))
    assert len(begun) == 1 and again["points"] == summary["points"]
    monkeypatch.setattr(rounds, "calibrate", lambda make: 1e-5)
    monkeypatch.setattr(machine, "package_hash", lambda: "other code")
    monkeypatch.setattr(rounds, "in_turn", lambda jobs, *_: ({name: [] for name in jobs}, {}, True))
    changed, _ = small(integrators=("broken", "nosquish", "rigid/nve"))
    assert (
        changed["interrupted"] and changed["points"][0]["integrators"][1]["error"] == "interrupted"
    )
    incomplete, _ = small(integrators=("broken", "nosquish", "rigid/nve"))
    assert incomplete["interrupted"], "an interrupted point was taken for a complete one"


def test_a_start_is_timed(tmp_path):
    """Locks out a start that cannot be timed on one core, and a harness that stays on that core."""
    cores = os.sched_getaffinity(0)
    wall, cpu = startup._start(SCENES["water"], startup.PLAIN, tmp_path, 1)
    assert 0 < cpu < 1.1 * wall  # as on one core
    assert os.sched_getaffinity(0) == cores
