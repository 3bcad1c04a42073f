"""The verb ``stress``: verdicts, rows that are kept, numbers that are known otherwise, and that
cases tell integrators apart."""

import csv
import dataclasses
import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from support.harness import Silent
from support.running import ROOT
from validation.__main__ import main
from validation.running import run
from validation.scenes import SCENES, bodies
from validation.statistics import measures
from validation.stress import measure, molecules
from validation.stress.cases import CASES
from validation.stress.criteria import CRITERIA, Criterion
from validation.stress.measure import BlowUp, CannotRun, Case, Number

COMMITTED = ROOT / "validation" / "results" / "stress"


def criterion(bound=1.0, side="≤", **more):
    return Criterion(side, bound, "", "test", "a number", "none", "none", **more)


def case(number, name="test", side="≤", **more):
    usual = {"physics": "None.", "criterion": "a number", "bars": "so and so"}
    usual |= {"short": 1, "full": 2, "bounds": {"test": criterion(side=side)}}
    return Case(name=name, measure=number, **usual | more)


def row(found, integrator="nosquish", folder=Path("unused"), length=None):
    """The row of a case with an integrator; of another length, if one is given."""
    if length is not None:
        found = dataclasses.replace(found, short=length)
    runner = measure.Runner(found, measure.COMPARED[integrator], folder, 60.0, Silent())
    *_, last = measure.run_starts(runner, integrator, False)
    return measure.judge(found, last)


def stress(cases, names, out, full=False, only=("nosquish",)):
    return measure.stress(cases, names, out, full, 60.0, Silent(), only)


def raises(error):
    def measured(runner, length):
        raise error

    return measured


@pytest.mark.quick
@pytest.mark.parametrize(
    "number, side, verdict",
    [
        (lambda runner, length: Number(0.5, 0.1), "≤", "pass"),
        (lambda runner, length: Number(0.5, 0.3), "≤", "cannot tell"),
        (lambda runner, length: Number(1.5, 0.1), "≤", "fail"),
        (lambda runner, length: Number(1.5, 0.1), "≥", "pass"),
        (lambda runner, length: Number(np.nan), "≤", "blow-up"),
        (lambda runner, length: Number(np.inf), "≥", "blow-up"),
        (raises(BlowUp("after step 7: lost atoms")), "≤", "blow-up"),
        (raises(CannotRun("no such cluster")), "≤", "cannot run"),
        (raises(np.linalg.LinAlgError("singular")), "≤", "blow-up"),
        (raises(ZeroDivisionError()), "≤", "blow-up"),
        (lambda runner, length: np.empty(3)[length + 2], "≤", "blow-up"),
    ],
)
def test_verdicts(tmp_path, number, side, verdict):
    """Locks out a number that is not finite and passes, an error bar that is forgotten, a lower
    bound taken for an upper one, and an analysis of a broken run that ends all."""
    results = row(case(number, side=side), folder=tmp_path)
    assert results["verdict"] == verdict
    assert (results["value"] is None) == (verdict in measure.BROKEN)
    if verdict in measure.BROKEN:
        assert results["note"]
    json.dumps(results, allow_nan=False)


@pytest.mark.parametrize("size", [1e80, 1e150, 1e200])
def test_drift_of_what_blew_up(size):
    """Locks out squares that overflow: the slope of a series that explodes is that of the same one
    with numbers of order one, times its size."""
    t = np.linspace(0.0, 1.0, 1000)
    x = np.exp(40 * (t - 1)) + 1e-3 * np.sin(1e5 * t)
    with np.errstate(all="ignore"):
        result = measures.drift(t, size * x)
    np.testing.assert_allclose(result.times(1 / size), measures.drift(t, x), rtol=1e-9)


@pytest.mark.parametrize(
    "verdicts, breaks, behind",
    [
        ({"nosquish": "blow-up", "rigid": "fail"}, True, False),
        ({"nosquish": "blow-up", "shake": "pass"}, True, True),
        ({"nosquish": "cannot run", "rigid": "blow-up", "shake": "cannot tell"}, True, False),
        ({"nosquish": "blow-up", "rigid": "blow-up", "shake": "cannot run"}, False, False),
        ({"nosquish": "fail", "rigid": "pass"}, False, True),
        ({"nosquish": "pass", "rigid": "pass", "shake": "cannot run"}, False, False),
        ({"rigid": "pass", "shake": "fail"}, False, False),
    ],
)
def test_where_ours_is_worse(verdicts, breaks, behind):
    """Locks out a blow-up of ours that is not told, and one that is told though every LAMMPS fix
    has it."""
    kinds = {"nosquish": "ours", "rigid": "rigid", "shake": "constraints"}
    rows = [
        {"integrator": name, "kind": kinds[name], "verdict": verdict}
        for name, verdict in verdicts.items()
    ]
    result = measure.find_defeats([{"name": "test", "rows": rows}])
    assert [bool(names) for names in result.values()] == [breaks, behind]


def test_rows_are_kept(tmp_path, monkeypatch):
    """Locks out rows that are lost by a Ctrl-C or run again after it, those of other cases
    forgotten, those of other lengths taken, and a case that is asked for and not measured anew by
    other code."""
    done = []

    def measured(runner, length):
        done.append((runner.case.name, runner.integrator.name, length))
        if len(done) == 2:
            raise KeyboardInterrupt
        return Number(0.5)

    cases = {name: case(measured, name) for name in ("one", "two")}

    def run_them(names, full=False):
        summary = stress(cases, names, tmp_path, full, ["nosquish", "rigid"])
        measure.json_files.write(tmp_path / "summary.json", summary)
        results = {told["name"]: len(told["rows"]) for told in summary["cases"]}
        return results, summary["interrupted"], summary["command"]

    assert run_them(["one"])[:2] == ({"one": 1}, True)
    assert run_them(["one"])[:2] == ({"one": 2}, False)
    assert [name for _, name, _ in done] == ["nosquish", "rigid", "rigid"]
    assert run_them(["two"])[0] == {"one": 2, "two": 2} and len(done) == 5
    assert run_them(["one"], full=True)[0] == {"one": 2}
    assert done[5:] == [("one", "nosquish", 2), ("one", "rigid", 2)]
    monkeypatch.setattr("validation.running.store.code", lambda: "other")
    results, _, command = run_them(["two"])
    assert results == {"two": 2} and command == "nosquish stress two --short"
    assert len(done) == 9


# ---- exact answers


@pytest.mark.parametrize(
    "moment", [(1, 1, 1), (1, 1, 1e-12), (1, 1, 2), (1 + 1e-6, 1 + 1e-6, 2), (0.7, 0.9, 1.3)]
)
def test_bodies_have_the_moments_that_they_are_named_after(moment):
    """Locks out needles and disks of other moments."""
    x, mass = bodies.three_rods(np.array(moment, float))
    tensor = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(mass, x))
    np.testing.assert_allclose(tensor, np.diag(moment), rtol=1e-3, atol=1e-16)


@pytest.mark.parametrize("moment", [(1.0, 1.0, 1.0), (1.0, 1.0, 0.1), (1.0, 1.0, 1.9)])
def test_exact_symmetric_top(moment):
    """Locks out a wrong exact answer: angular momentum and energy stay, and Euler's equations hold
    at each moment."""
    moment, spin, turn = np.array(moment), np.array([0.6, -0.5, 0.7]), bodies.turned(1)
    h = 1e-4
    for time in 0.0, 1.0, 30.0:
        before, now, after = (
            bodies.symmetric_top(turn, spin, moment, time + step) for step in (-h, 0.0, h)
        )
        step = (now.inv() * after * (now.inv() * before).inv()).as_rotvec()
        omega = step / (2 * h)  # in the top's frame
        np.testing.assert_allclose(now.apply(moment * omega), turn.apply(moment * spin), atol=1e-6)
        np.testing.assert_allclose(moment @ omega**2, moment @ spin**2, rtol=1e-6)
    again = bodies.symmetric_top(turn, spin, moment, 0.0)
    np.testing.assert_allclose(again.as_matrix(), turn.as_matrix())


# ---- bounds


def test_committed_rows_are_judged_by_the_bounds_of_today():
    """Locks out a bound that is changed in the table alone, results that other bounds have judged,
    and a case that nobody fails."""
    summary = json.loads((COMMITTED / "summary.json").read_text())
    assert [told["name"] for told in summary["cases"]] == [*CASES]
    for told in summary["cases"]:
        result = CASES[told["name"]]
        assert (told["low"], told["high"]) == result.bound.within(), result.name
        texts = [one.text() for one in result.criteria.values()]
        assert [one["text"] for one in told["criteria"]] == texts, result.name
        for line in told["rows"]:
            again = measure.judge(result, line)
            keys = "verdict", "value", "note"
            assert [again[key] for key in keys] == [line[key] for key in keys], line["command"]
        assert {"fail", "blow-up"} & {line["verdict"] for line in told["rows"]}, result.name


def test_rows_that_other_inner_bounds_made_are_not_shown(tmp_path):
    """Locks out a number of the folder's summary that is none of the case as it is today."""
    cases = {name: case(lambda runner, length: Number(0.5), name) for name in ("one", "two")}
    elsewhere = stress(cases, cases, tmp_path / "elsewhere")
    measure.json_files.write(tmp_path / "summary.json", elsewhere)
    inner = {"test": criterion(), "inner": criterion(0.3, inner=True)}
    cases["one"] = dataclasses.replace(cases["one"], bounds=inner)
    assert [told["name"] for told in stress(cases, ["two"], tmp_path)["cases"]] == ["two"]


# ---- starts


def test_starts_are_added_until_the_verdict_is_sure(tmp_path):
    """Locks out a verdict that stays unsure though there could be more starts, starts that are run
    again, and more looks than doublings."""
    done = []

    def measured(runner, length):
        done.append(runner.start)
        return Number([1.4, *[0.2] * 7][runner.start], 0.3)

    cases = {"test": case(measured, starts=8)}
    for _ in range(2):
        (line,) = stress(cases, ["test"], tmp_path)["cases"][0]["rows"]
        assert done == list(range(4)) and line["verdict"] == "pass" and len(line["numbers"]) == 4


@pytest.mark.parametrize("starts", [1, 8])
def test_many_looks_are_one_verdict(starts):
    """Locks out that each look at more starts spends all of the 5 %: of a number that lies on its
    bound 13 % of the verdicts were sure then."""
    result = case(None, starts=starts)
    assert result.looks == [1, 2, 4, 8][: 1 + 3 * (starts > 1)]
    sure = 0
    for seed in range(4000):
        values = 1.0 + 0.3 * np.random.default_rng(seed).normal(size=starts)
        numbers = [[Number(value, 0.3) for value in values[:look]] for look in result.looks]
        sure += any(result.verdict(some) != "cannot tell" for some in numbers)
    assert 0.02 < sure / 4000 < 0.06


# ---- that cases tell integrators apart

# each with a length that is short, who passes and who does not
APART = [
    ("needles", 20_000, "nosquish", "rigid/nve"),
    ("disks", 8000, "rigid/nve", "rigid"),
    ("far-away", 50, "nosquish", "rigid/nve/small"),
    ("images-half", None, "nosquish", "rigid/nve/small"),
    ("temp-csvr", None, "nosquish", "rigid/nve"),
]


@pytest.mark.parametrize("name, length, passes, does_not", APART)
def test_cases_tell_integrators_apart(tmp_path, name, length, passes, does_not):
    """Locks out a bound that nobody can fail, and one that nobody can keep."""
    for who, verdicts in (passes, ("pass",)), (does_not, ("fail", "blow-up")):
        result = row(CASES[name], who, tmp_path / "runs", length)
        assert result["verdict"] in verdicts, result


def changing(monkeypatch, bears):
    """Put energies that change in place of runs; gives the list of the time steps tried."""
    tried = []

    def change(runner, scene, dt, time, **how):
        tried.append(dt)
        return 0.01 * molecules.ALLOWED if bears(dt) else np.inf, "broke" * (not bears(dt)) or None

    monkeypatch.setattr(molecules, "change", change)
    return tried


@pytest.mark.parametrize("good", range(0, 48, 3))
def test_limit_by_halving(monkeypatch, good):
    """Locks out a bisection that ends elsewhere than at the first bad step, tries more than need
    be, or invents a limit below the first step."""
    steps = np.arange(0.5, 12.1, 0.25)
    tried = changing(monkeypatch, lambda dt: dt < 0.4 + 0.25 * good)
    result = molecules.find_longest_step(None, None, steps, 1.0)
    assert len(set(tried)) <= 8
    assert good < 4 or any(0.7 < 2 * dt / result.value < 1.3 for dt in tried)
    if good == 0:
        assert result.value == result.error == 0.0 and result.note.startswith("not even at 0.5 fs")
    elif good < 47:
        assert (result.value, result.error) == (0.375 + 0.25 * good, 0.0625)


def test_limit_of_runs(tmp_path):
    """Locks out a crash, and a limit, where not even the first step is borne; a good step that is
    taken for a bad one; and an energy that is far off and goes on."""

    def measured(runner, length):
        return molecules.find_longest_step(runner, SCENES["dimer"], np.array(length), 200.0)

    results = row(case(measured, side="≥"), folder=tmp_path / "long", length=[50.0, 60.0])
    assert (results["verdict"], results["value"]) == ("fail", 0.0)
    assert results["note"].startswith("not even at 50 fs"), results
    results = row(case(measured, side="≥"), folder=tmp_path / "short", length=[0.3, 0.6, 50.0])
    assert results["note"] == "stable at 0.6 fs, not at 50 fs"


def test_refused_bodies_are_not_run(tmp_path):
    """Locks out shake on bodies that it cannot hold, and an error of LAMMPS that is none."""
    assert row(CASES["needles"], "shake 1e-8", tmp_path)["verdict"] == "cannot run"

    def measured(runner, length):
        scene = dataclasses.replace(SCENES["dimer"], bodies="nonsense")
        runner.run(scene, "run", [1], dt=0.1, every=1)

    results = row(case(measured), "rigid/nve", tmp_path)
    assert results["verdict"] == "blow-up" and "ERROR" in results["note"], results


# ---- the command


def test_command(tmp_path, monkeypatch, capsys):
    """Locks out files that are missing or hold less than was run, a page with links to other files
    or without the bounds' reasons, and unknown names that are taken."""
    monkeypatch.setattr(run, "run", lambda *_: pytest.fail("nothing is to be run"))
    out, only = str(tmp_path), ["shake 1e-8", "rattle 1e-8"]
    assert main(["stress", "needles", "disks", "--only", *only, "--out", out]) == 0
    with open(tmp_path / "table.csv") as file:
        table = list(csv.DictReader(file))
    pairs = [(line["case"], line["integrator"], line["error is"]) for line in table]
    assert pairs == [(a, b, CASES[a].bars) for a in ("needles", "disks") for b in only]
    page = (tmp_path / "report.html").read_text()
    for word in "cannot run", CASES["disks"].criterion, CRITERIA["orientation"].derivation:
        assert word in page
    assert 'src="http' not in page and 'href="http' not in page
    assert "Not all integrators have run yet in needles, disks." in capsys.readouterr().out
    (line,) = [
        line for line in table if line["case"] == "needles" and line["integrator"] == only[0]
    ]
    words = shlex.split(line["command"])[1:]
    assert main([*words, "--out", str(tmp_path / "again")]) == 0
    with open(tmp_path / "again" / "table.csv") as file:
        (again,) = csv.DictReader(file)
    assert again | {"date": ""} == line | {"date": ""}
    for words in ["nonsense"], ["needles", "--only", "nonsense"]:
        with pytest.raises(SystemExit):
            main(["stress", *words, "--out", out])
        assert "choose from" in capsys.readouterr().err
    assert main(["stress", "--list"]) == 0
    shown = capsys.readouterr().out
    assert all(name in shown for name in CASES)
