"""The stability atlas: verdicts, rows that are kept, numbers that are known otherwise, and that
cases tell integrators apart."""

import csv
import dataclasses
import json
import shutil
import threading
from collections import defaultdict
from pathlib import Path

import committed
import numpy as np
import pytest
from conftest import Silent
from scipy import stats

ROOT = Path(__file__).resolve().parent.parent

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "scipy"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation.stability import figures as stability_figures
from validation.stability import measure as stability
from validation.stability import molecules as stability_molecules
from validation.stability import report as stability_report
from validation.stability import tops as stability_tops
from validation.stability.cases import CASES
from validation.stability.criteria import CRITERIA, ENOUGH_STARTS, Criterion
from validation.stability.measure import BlowUp, CannotRun, Case, Number

from validation import __main__ as command
from validation.pages import console
from validation.running import run
from validation.scenes import bodies as stability_bodies
from validation.statistics import measures
from validation.theory.top import free_top


def criterion(bound=1.0, side="≤", unit="", **more):
    return Criterion(side, bound, unit, ("test",), "a number", "none", "none", (), **more)


def case(measure, name="test", side="≤", **more):
    usual = {
        "physics": "None.",
        "criterion": "a number",
        "bars": "none",
        "short": 1,
        "full": 2,
        "bounds": {"test": criterion(side=side)},
    }
    return Case(name=name, measure=measure, **usual | more)


def row(found, integrator="nosquish", folder=Path("unused"), length=None, starts=None):
    """The row of a case with an integrator; of another length, if one is given."""
    if length is not None:
        found = dataclasses.replace(found, short=length)
    stand = stability.Stand(found, stability.COMPARED[integrator], folder, 60.0, Silent())
    *_, last = stability.grown(stand, integrator, False, starts=starts)
    return stability.judged(found, last)


def raises(error):
    def measure(stand, length):
        raise error

    return measure


@pytest.mark.parametrize(
    "measure, side, verdict",
    [
        (lambda stand, length: Number(0.5, 0.1), "≤", "pass"),
        (lambda stand, length: Number(0.5, 0.3), "≤", "cannot tell"),
        (lambda stand, length: Number(1.5, 0.1), "≤", "fail"),
        (lambda stand, length: Number(1.5, 0.1), "≥", "pass"),
        (lambda stand, length: Number(np.nan), "≤", "blow-up"),
        (lambda stand, length: Number(np.inf), "≥", "blow-up"),
        (raises(BlowUp("after step 7: lost atoms")), "≤", "blow-up"),
        (raises(CannotRun("no such cluster")), "≤", "cannot run"),
        (raises(np.linalg.LinAlgError("singular")), "≤", "blow-up"),
        (raises(ZeroDivisionError()), "≤", "blow-up"),
        (lambda stand, length: np.empty(3)[length + 2], "≤", "blow-up"),
    ],
)
def test_verdicts(tmp_path, measure, side, verdict):
    """Locks out a number that is not finite and passes, an error bar that is forgotten, a lower
    bound taken for an upper one, and an analysis of a broken run that ends the atlas."""
    found = row(case(measure, side=side), folder=tmp_path)
    assert found["verdict"] == verdict
    assert (found["value"] is None) == (verdict in stability.BROKEN)
    if verdict in stability.BROKEN:
        assert found["note"]
    json.dumps(found, allow_nan=False)


def rows(**verdicts):
    kinds = {"nosquish": "ours", "gear": "ours", "rigid": "rigid", "shake": "constraints"}
    return {
        "name": "test",
        "integrators": list(verdicts),
        "rows": [
            {"integrator": name, "kind": kinds[name], "verdict": verdict}
            for name, verdict in verdicts.items()
        ],
    }


@pytest.mark.parametrize("size", [1e80, 1e150, 1e200])
def test_drift_of_what_blew_up(size):
    """Locks out squares that overflow: the slope of a series that explodes is that of the same one
    with numbers of order one, times its size."""
    t = np.linspace(0.0, 1.0, 1000)
    x = np.exp(40 * (t - 1)) + 1e-3 * np.sin(1e5 * t)
    with np.errstate(all="ignore"):
        found = measures.drift(t, size * x)
    np.testing.assert_allclose(found.times(1 / size), measures.drift(t, x), rtol=1e-9)


@pytest.mark.parametrize(
    "verdicts, holds",
    [
        ({"nosquish": "blow-up", "rigid": "fail"}, (False, True, True, True)),
        ({"nosquish": "blow-up", "shake": "pass"}, (False, False, True, True)),
        (
            {"nosquish": "cannot run", "rigid": "blow-up", "shake": "cannot tell"},
            (False, True, True, True),
        ),
        ({"nosquish": "blow-up", "rigid": "blow-up", "gear": "pass"}, (True, True, True, True)),
        ({"nosquish": "fail", "rigid": "pass"}, (True, False, True, True)),
        ({"nosquish": "pass", "rigid": "pass", "shake": "cannot run"}, (True, True, False, False)),
        ({"nosquish": "pass", "rigid": "cannot tell"}, (True, True, False, False)),
        ({"nosquish": "pass", "gear": "blow-up"}, (True, True, True, False)),
        ({"nosquish": "pass", "gear": "fail", "shake": "fail"}, (True, True, True, True)),
        ({"rigid": "pass", "shake": "fail"}, (None, None, True, True)),
    ],
)
def test_what_all_rows_say(verdicts, holds):
    """Locks out a blow-up of ours that is not told, one that is told though every LAMMPS fix has
    it, a case that tells nothing apart, or only Gear from all others, and a yes of what has not
    been run."""
    told = stability.told([rows(**verdicts)])
    assert tuple(line["holds"] for line in told) == holds
    assert [line["where"] for line in told] == [[] if line["holds"] else ["test"] for line in told]
    assert ["cannot tell" in stability_report.verdict(line) for line in told] == [
        one is None for one in holds
    ]


def test_a_blow_up_is_told_before_all_rows_are_there():
    """Locks out one of ours that hides behind a case that ours has not run."""
    line = stability.told(
        [rows(nosquish="blow-up", rigid="pass"), rows(rigid="pass") | {"name": "other"}]
    )[0]
    assert line["holds"] is False and line["where"] == ["test"]


def test_a_case_that_is_not_complete_is_not_called_blunt():
    """Locks out a judgement before the integrator that fails has had its turn."""
    found = rows(nosquish="pass", rigid="pass")
    assert not stability.told([found])[2]["holds"]
    assert stability.told([found | {"integrators": ["nosquish", "rigid", "gear"]}])[2]["holds"]


def test_rows_are_kept(tmp_path, monkeypatch):
    """Locks out rows that are lost by a Ctrl-C or run again after it, those of other cases
    forgotten, and those of other lengths taken."""
    done = []

    def measure(stand, length):
        done.append((stand.case.name, stand.integrator.name, length))
        if len(done) == 2:
            raise KeyboardInterrupt
        return Number(0.5)

    cases = {name: case(measure, name) for name in ("one", "two")}

    def run_them(names, full=False):
        only = ["nosquish", "rigid"]
        return stability.stability(cases, names, tmp_path, full, 60.0, Silent(), only)

    summary = run_them(["one"])
    assert summary["interrupted"] and [len(found["rows"]) for found in summary["cases"]] == [1]
    summary = run_them(["one"])
    assert not summary["interrupted"] and [
        found["integrator"] for found in summary["cases"][0]["rows"]
    ] == ["nosquish", "rigid"]
    assert [name for _, name, _ in done] == ["nosquish", "rigid", "rigid"]
    summary = run_them(["two"])
    assert [found["name"] for found in summary["cases"]] == ["one", "two"]
    assert len(done) == 5
    assert json.loads((tmp_path / "summary.json").read_text())["cases"] == summary["cases"]
    run_them(["one"], full=True)
    assert done[5:] == [("one", "nosquish", 2), ("one", "rigid", 2)]
    monkeypatch.setattr(stability.store, "code_of", lambda module: "other")
    summary = run_them(["two"])
    assert [found["name"] for found in summary["cases"]] == ["two"] and len(done) == 9
    monkeypatch.undo()
    assert [found["name"] for found in run_them(["two"])["cases"]] == ["one", "two"] and len(
        done
    ) == 9


def test_code_is_all_that_rows_follow_from(tmp_path, monkeypatch):
    """Locks out rows that stay though a module that made them, or a scene, is another; and rows
    that are lost by what only shows."""
    copy = tmp_path / "validation"
    shutil.copytree(
        ROOT / "validation", copy, ignore=shutil.ignore_patterns("results", "__pycache__")
    )
    monkeypatch.setattr(stability.store, "HARNESS", copy)

    cases = {"test": case(None)}

    def code():
        stability.store.code_of.cache_clear()
        return stability.Rows(cases, tmp_path, False).place("test", "nosquish")[1]

    before = code()
    for shows in "stability/report", "pages/figures", "report/sections", "stability/command":
        (copy / f"{shows}.py").write_text("")
    assert code() == before
    found = {before}
    for follows in (
        "statistics/measures",
        "statistics/motion",
        "running/starts",
        "scenes/bodies",
        "scenes/integrators",
        "scenes/peptide",
        "scenes/__init__",
        "running/worker",
        "running/run",
        "statistics/check",
        "stability/tops",
    ):
        (copy / f"{follows}.py").write_text("")
        found.add(code())
    monkeypatch.setattr(stability.machine, "contents", lambda folder: "another")
    found.add(code())
    assert len(found) == 13
    stability.store.code_of.cache_clear()


def test_a_length_of_some_is_a_tenth(tmp_path):
    """Locks out slow schemes that run for all the length, a tenth that others get, and a row of one
    length that passes for another's."""
    done = {}

    def measure(stand, length):
        done[stand.integrator.name] = length
        return Number(0.5)

    found = case(measure, full=1000, tenth=stability.SLOW)
    summary = stability.stability(
        {"test": found}, ["test"], tmp_path, True, 60.0, Silent(), ["nosquish", "gear"]
    )
    assert done == {"nosquish": 1000, "gear": 100} and [
        one["length"] for one in summary["cases"][0]["rows"]
    ] == [1000, 100]
    assert found.length(False, "gear") == 1


@pytest.mark.parametrize("error, told", [(0.0, ""), (0.125, "0.244")])
def test_error_bars_are_told(tmp_path, error, told):
    """Locks out a number without an error bar that does not say why, or has one of zero."""
    cases = {"test": case(lambda stand, length: Number(0.5, error), bars="so and so")}
    summary = stability.stability(cases, ["test"], tmp_path, False, 60.0, Silent(), ["nosquish"])
    stability_report.write(summary, tmp_path)
    with open(tmp_path / "table.csv") as file:
        (line,) = csv.DictReader(file)
    assert line["margin"][:5] == told and line["error is"] == "so and so"
    assert "Error: so and so." in (tmp_path / "report.html").read_text()


def tile(value, error, verdict="pass", **bounds):
    return stability_figures._tile(
        {"low": None, "high": None} | bounds, {"value": value, "error": error, "verdict": verdict}
    )


@pytest.mark.parametrize(
    "value, error, verdict, bounds, text",
    [
        (2e-4, 4e-4, "pass", {"high": 0.05}, "<1e−3"),
        (2e-4, 0.0, "fail", {"high": 1e-5}, "✗ 2e−4"),
        (0.12, 0.03, "fail", {"high": 0.05}, "✗ 0.18"),
        (4e8, 0.0, "fail", {"high": 1.0}, "✗ 4e8"),
        (8e-4, 1e-4, "pass", {"high": 0.05}, "1e−3"),
        (0.0, 0.0, "pass", {"high": 0.05}, "0"),
        (6.1, 0.24, "cannot tell", {"low": 6.0}, "? 6.1±0.5"),
        (9.75, 0.125, "pass", {"low": 6.0}, "9.75±0.2"),
        (0.0, 0.0, "fail", {"low": 6.0}, "✗ 0"),
        (None, None, "blow-up", {"low": 6.0}, "✸"),
    ],
)
def test_tiles(value, error, verdict, bounds, text):
    """Locks out a figure that ranks noise: what it shows of a number is what is judged, the number
    and two errors, or its error beside it."""
    assert tile(value, error, verdict, **bounds)[2] == text


def test_tiles_are_no_darker_by_chance():
    """Locks out a tile that looks better than another because noise came out small."""
    chance, sure = tile(7e-6, 7e-4, high=2.5e-3)[0], tile(2e-4, 1e-5, high=2.5e-3)[0]
    assert (sure < chance).all()


def test_cases_side_by_side(tmp_path):
    """Locks out rows that another process has saved meanwhile and that this one's summary loses,
    and a command that makes only a part of them."""

    def run_them(name):
        return stability.stability(cases, [name], tmp_path, False, 60.0, Silent(), ["nosquish"])

    def measure(stand, length):
        if stand.case.name == "one":
            run_them("two")
        return Number(0.5)

    cases = {name: case(measure, name) for name in ("one", "two", "three")}
    summary = run_them("one")
    assert [found["name"] for found in summary["cases"]] == ["one", "two"]
    assert json.loads((tmp_path / "summary.json").read_text())["cases"] == summary["cases"]
    assert summary["command"] == "python -m validation stability one two --short"
    assert run_them("three")["command"] == "python -m validation stability --short"


def test_a_case_is_one_process_alone(tmp_path):
    """Locks out two processes in one case's folder, and one that waits while there are other
    cases."""
    done = []

    def measure(stand, length):
        done.append(stand.case.name)
        return Number(0.5)

    cases = {name: case(measure, name) for name in ("one", "two")}
    with stability.Rows(cases, tmp_path, False).store.locked("one"):
        run_them = threading.Thread(
            target=stability.stability,
            args=(cases, ["one", "two"], tmp_path, False, 60.0, Silent(), ["nosquish"]),
        )
        run_them.start()
        for _ in range(60):  # on a busy machine it takes a while
            run_them.join(0.5)
            if done:
                break
        assert run_them.is_alive() and done == ["two"]
    run_them.join(30.0)
    assert done == ["two", "one"]


@pytest.mark.parametrize(
    "moment", [(1, 1, 1), (1, 1, 1e-12), (1, 1, 2), (1 + 1e-6, 1 + 1e-6, 2), (0.7, 0.9, 1.3)]
)
def test_bodies_have_the_moments_that_they_are_named_after(moment):
    """Locks out needles and disks of other moments."""
    x, mass = stability_bodies.three_rods(np.array(moment, float))
    tensor = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(mass, x))
    np.testing.assert_allclose(tensor, np.diag(moment), rtol=1e-3, atol=1e-16)


@pytest.mark.parametrize("tilt", stability_tops.TILTS)
def test_time_between_turns_over(tilt):
    """Locks out a wrong exact answer: the exact motion, position by position, turns over as
    often."""
    moments, _ = stability_bodies.moments(stability_bodies.BENT, stability_bodies.MASSES)
    start = moments * stability_tops.MIDDLE * np.array([tilt, 1.0, tilt])
    exact = stability_tops.exact_interval(tilt)
    times = np.linspace(0.0, 3.2 * exact, 600)
    along = np.array(
        [free_top(np.array([1.0, 0, 0, 0]), start, moments, time)[1][1] for time in times]
    )
    between = np.diff(stability_tops._turns_over(times, along))
    assert len(between) >= 2
    np.testing.assert_allclose(between, exact, rtol=1e-5)


@pytest.mark.parametrize("moment", [(1.0, 1.0, 1.0), (1.0, 1.0, 0.1), (1.0, 1.0, 1.9)])
def test_exact_symmetric_top(moment):
    """Locks out a wrong exact answer: angular momentum and energy stay, and Euler's equations hold
    at each moment."""
    moment, spin, turn = np.array(moment), np.array([0.6, -0.5, 0.7]), stability_bodies.turned(1)
    h = 1e-4
    for time in 0.0, 1.0, 30.0:
        before, now, after = (
            stability_bodies.symmetric_top(turn, spin, moment, time + step) for step in (-h, 0.0, h)
        )
        omega = (now.inv() * after * (now.inv() * before).inv()).as_rotvec() / (
            2 * h
        )  # in the top's frame
        np.testing.assert_allclose(now.apply(moment * omega), turn.apply(moment * spin), atol=1e-6)
        np.testing.assert_allclose(moment @ omega**2, moment @ spin**2, rtol=1e-6)
    np.testing.assert_allclose(
        stability_bodies.symmetric_top(turn, spin, moment, 0.0).as_matrix(), turn.as_matrix()
    )


@pytest.mark.parametrize("pace, sure", [(1.0, True), (1.0 + 1e-3, True), (None, False)])
def test_phase_of_turning_over(pace, sure):
    """Locks out turns over that are miscounted between windows, and a count that is taken for sure
    though the pace changes."""
    exact, rng = 100.0, np.random.default_rng(3)
    paces = [pace, pace, pace] if pace else [1.0, 1.001, 1.002]
    windows, at = [], 0
    for one, start in zip(paces, (0, 5000, 60_000)):
        at = max(at, start)
        windows.append((at + np.arange(120)) * exact * one + 1e-3 * rng.normal(size=120))
    found = stability_tops._phase(windows, exact, 10_000_000)
    assert ("turned over 60119 times" in found.note) == sure
    expected = pace - 1 if pace else 2e-3
    assert abs(found.value - expected) < (1e-8 if pace else 1e-5)


def test_every_case_has_criteria():
    """Locks out a case without a criterion that judges it, a criterion of no case, and one without
    derivation or need."""
    for found in CASES.values():
        assert found.judged and all(one.side == "≤" for one in found.judged[1:]), found.name
    assert {name for one in CRITERIA.values() for name in one.cases} == set(CASES)
    for name, one in CRITERIA.items():
        assert one.derivation and one.need and one.quantity and one.side in "≤≥", name


def test_changed_bounds_are_dated():
    """Locks out a bound that is changed without a dated entry that says so, and one whose cases
    have none."""
    for name, one in CRITERIA.items():
        assert one.changes[-1].bound == one.bound, (
            f"{name}: add a Change with the new bound, its date and reason"
        )
        assert all(
            change.date and change.reason and change.old and change.new for change in one.changes
        ), name
        assert [change.date for change in one.changes] == sorted(
            change.date for change in one.changes
        ), name
        assert {
            case for change in one.changes if change.bound == one.bound for case in change.cases
        } == set(one.cases), name


def test_committed_rows_are_judged_by_the_bounds_of_today():
    """Locks out a bound that is changed in the table alone, and results that other bounds have
    judged."""
    summary = json.loads(
        (ROOT / "validation" / "results" / "stability" / "summary.json").read_text()
    )
    for told in summary["cases"]:
        found = CASES[told["name"]]
        assert [told["low"], told["high"]] == [found.low, found.high], found.name
        assert [one["text"] for one in told["criteria"]] == [
            one.text() for one in found.criteria.values()
        ], found.name
        for line in told["rows"]:
            again = stability.judged(found, line)
            assert (again["verdict"], again["value"], again["note"]) == (
                line["verdict"],
                line["value"],
                line["note"],
            ), (found.name, line["label"])


def test_starts_are_added_until_the_verdict_is_sure(tmp_path):
    """Locks out a verdict that stays unsure though there could be more starts, starts that are run
    again, and more looks than doublings."""
    done = []

    def measure(stand, length):
        done.append(stand.start)
        return Number([0.2, 1.4, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2, 0.2][stand.start])

    found = case(measure, starts=(4, 19), together=stability.mean_of_starts)

    def run_it(starts=None):
        cases, only = {"test": found}, ["nosquish"]
        return stability.stability(cases, ["test"], tmp_path, False, 60.0, Silent(), only, starts)

    (line,) = run_it()["cases"][0]["rows"]
    assert done == list(range(8)) and line["verdict"] == "pass" and len(line["numbers"]) == 8
    run_it()
    assert len(done) == 8
    (line,) = run_it(9)["cases"][0]["rows"]
    assert done == list(range(9)) and [one["value"] for one in line["numbers"]] == [
        0.2,
        1.4,
    ] + 7 * [0.2]


@pytest.mark.parametrize("looks, starts", [([1], (1, 1)), ([4, 8, 16, 19], (4, 19))])
def test_many_looks_are_one_verdict(looks, starts):
    """Locks out that each look at more starts spends all of the 5 %: of a number that lies on its
    bound 13 % of the verdicts were sure then."""
    many = starts[1] > 1
    found = case(None, starts=starts, **{"together": stability.mean_of_starts} if many else {})
    assert found.looks == looks
    sure = 0
    for seed in range(4000):
        values = 1.0 + 0.3 * np.random.default_rng(seed).normal(size=19)
        error = 0.0 if many else 0.3  # the scatter of starts tells it
        numbers = [[Number(value, error) for value in values[:look]] for look in looks]
        sure += any(found.verdict(some) != "cannot tell" for some in numbers)
    assert 0.02 < sure / 4000 < 0.06


def test_all_starts_have_to_hold(tmp_path):
    """Locks out a mean of limits that lie in groups, a pass of a few starts, and starts that go on
    after one has failed."""

    def of(values):
        found = case(
            lambda stand, length: Number(values[stand.start]),
            side="≥",
            starts=(4, 19),
            together=stability.lowest_of_starts,
            every=True,
        )
        line = row(found, folder=tmp_path)
        return line["value"], line["verdict"], len(line["numbers"])

    assert of([2.0, 2.0, 2.0, 0.9] + 15 * [2.0]) == (0.9, "fail", 4)
    assert of([2.0, 2.0, 1.1] + 16 * [2.0]) == (1.1, "pass", ENOUGH_STARTS)
    with_some = case(
        None, side="≥", starts=(4, 19), together=stability.lowest_of_starts, every=True
    )
    assert with_some.verdict([Number(2.0)] * (ENOUGH_STARTS - 1)) == "cannot tell"


def test_drifts_of_starts_have_a_sign():
    """Locks out a mean of absolute values, which chance alone keeps from zero."""
    found = stability.drift_of_starts(
        [Number(0.3, 0.1, freedom=62.0), Number(-0.1, 0.1, freedom=62.0)]
    )
    np.testing.assert_allclose(
        [found.value, found.error, found.freedom], [0.1, 0.1 / np.sqrt(2), 62.0]
    )


def test_rows_of_another_atlas_are_judged_again(tmp_path):
    """Locks out rows that are run again for a new bound, old verdicts that stay, and rows that
    other inner bounds made."""
    measured = case(lambda stand, length: Number(0.5))
    stability.stability(
        {"test": measured}, ["test"], tmp_path / "old", False, 60.0, Silent(), ["nosquish"]
    )

    def take(found, out):
        cases, how = {"test": found}, {"only": ["nosquish"], "take": tmp_path / "old"}
        found = stability.stability(cases, ["test"], tmp_path / out, False, 60.0, Silent(), **how)
        return found["cases"][0]["rows"][0]

    ran = []
    stricter = dataclasses.replace(
        measured,
        bounds={"test": criterion(0.1)},
        measure=lambda stand, length: ran.append(1) or Number(0.7),
    )
    line = take(stricter, "new")
    assert (line["value"], line["verdict"], ran) == (0.5, "fail", [])
    inner = dataclasses.replace(
        stricter, bounds=stricter.bounds | {"inner": criterion(0.3, inner=True)}
    )
    line = take(inner, "other")
    assert (line["value"], line["verdict"], ran) == (0.7, "fail", [1])


def test_tolerance_is_what_was_asked_for():
    """Locks out rattle 1e-4 that is held to distances of 1e-7."""

    def shape(name):
        stand = stability.Stand(None, stability.COMPARED[name], None, 0.0, None)
        return stability_tops.kept(stand, 1_000_000, 0.0, 5e-5)["shape"]

    np.testing.assert_allclose([shape("rattle 1e-4"), shape("shake 1e-8")], [0.5, 5e3])
    assert shape("rigid/nve") > 1e4


# each with a length that is short, who passes and who does not
APART = [
    ("needles", 20_000, "nosquish", "rigid/nve"),
    ("disks", 4000, "rigid/nve", "matubayasi-nakahara"),
    ("degenerate", 20_000, "rigid/nve", "rigid"),
    ("middle-axis", 1000, "nosquish", "rigid"),
    ("turn-per-step", 10_000, "shake 1e-8", "rigid"),
    ("long-tops", 8000, "nosquish", "rigid"),
    ("contact", 120_000, "nosquish", "gear"),
    ("far-away", 50, "nosquish", "rigid/nve/small"),
    ("resonance", 50, "nosquish", "gear"),
]


@pytest.mark.parametrize("name, length, passes, does_not", APART)
def test_cases_tell_integrators_apart(tmp_path, name, length, passes, does_not):
    """Locks out a bound that nobody can fail, and one that nobody can keep."""
    first = row(CASES[name], passes, tmp_path / "runs", length, starts=CASES[name].starts[0])
    assert first["verdict"] in ("pass", "cannot tell" if CASES[name].every else "pass"), (
        first
    )  # some starts of those that all have to hold
    found = row(CASES[name], does_not, tmp_path / "runs", length, starts=CASES[name].starts[0])
    assert found["verdict"] in ("fail", "blow-up"), found


def test_ranks_tell_integrators_apart(tmp_path, monkeypatch):
    """Locks out a liquid in which nothing is added up over ranks, so that they agree to the last
    bit whatever is run."""
    monkeypatch.setattr("validation.stability.contact.RANKS", (4,))
    found = row(CASES["ranks"], "rigid/nve", tmp_path, 10)
    assert found["verdict"] == "pass" and found["value"] > 0.0, found
    found = row(CASES["ranks"], "rattle 1e-4", tmp_path, 10)
    assert found["verdict"] == "fail" and found["value"] > 1e6 * CASES["ranks"].high, found


def test_limit_of_springs(tmp_path):
    """Locks out a limit in other units, or one that is the first or last step tried: velocity
    Verlet of an oscillator breaks at ω Δt = 2, Gear's scheme far below; and the energy's swing
    below the limit, which grows but is no drift, is not taken for a break."""
    found = row(CASES["springs"], "nosquish", tmp_path, 30)
    assert 1.6 < found["value"] < 2.0, found
    assert row(CASES["springs"], "gear", tmp_path, 30)["value"] < 0.6


class Stand0:
    """A stand of the first start."""

    start = 0


def changing(monkeypatch, bears):
    """Put energies that change in place of runs; gives the list of the time steps tried."""
    tried = []

    def changes(stand, scene, label, dts, time, allowed, **how):
        tried.extend(dts)
        return np.array([0.01 * allowed if bears(dt, scene) else np.inf for dt in dts]), "broke"

    monkeypatch.setattr(stability_molecules, "changes", changes)
    return tried


@pytest.mark.parametrize("good", range(48))
def test_limit_by_halving(monkeypatch, good):
    """Locks out a bisection that ends elsewhere than trying all steps does, tries more than need
    be, or invents a limit below the first step."""
    steps = np.arange(0.5, 12.1, 0.25)
    tried = changing(monkeypatch, lambda dt, scene: dt < 0.4 + 0.25 * good)
    found = stability_molecules.halved(None, None, steps, 1.0, 0.02)
    assert len(tried) <= 7
    assert good < 4 or any(0.7 < 2 * dt / found.value < 1.3 for dt in tried)
    every = stability_molecules.limit(Stand0, None, steps, 1.0)
    assert (found.value, found.error) == (every.value, every.error)
    if good == 0:
        assert found.value == found.error == 0.0 and found.note.startswith("not even at 0.5 fs")
    elif good < 47:
        assert (found.value, found.error) == (0.375 + 0.25 * good, 0.0625)


def test_limit_of_steps_that_are_bad_below_good_ones(monkeypatch):
    """Locks out a limit of the step where shorter steps break too, as where an energy drifts with
    any step."""
    changing(monkeypatch, lambda dt, scene: 4.0 < dt < 8.1 or dt < 0.6)
    found = stability_molecules.halved(None, None, np.arange(0.5, 12.1, 0.5), 1.0, 0.02)
    assert (found.value, found.error) == (0.75, 0.125) and "again at 8 fs" in found.note


def test_limit_is_a_mean_over_starts(monkeypatch):
    """Locks out an error bar without what another start gives, or one for which four starts were as
    good as many."""
    changing(monkeypatch, lambda dt, scene: dt < scene)
    starts = [
        stability_molecules.limit(Stand0, one, np.arange(1.0, 12.0), 1.0)
        for one in (4.1, 5.1, 6.1, 7.1)
    ]
    found = stability.mean_of_starts(starts)
    assert found.value == 6.0
    expected = np.hypot(
        stats.t.ppf(0.975, 3) * np.std([4, 5, 6, 7], ddof=1) / 2, stats.norm.ppf(0.975) * 0.25
    )
    np.testing.assert_allclose(measures.margin(found.error, found.freedom), expected)


def test_limit_of_a_run_that_breaks_at_once(tmp_path):
    """Locks out a crash of the atlas, and a limit, where not even the first step is borne."""

    def measure(stand, length):
        return stability_molecules.limit(
            stand, stability_molecules.dimer_of(0.1), [50.0, 60.0], length
        )

    found = row(case(measure, side="≥"), folder=tmp_path, length=5000.0)
    assert (found["verdict"], found["value"]) == ("fail", 0.0) and found["note"].startswith(
        "not even at 50 fs"
    ), found


def test_dimer_of_other_masses_has_the_same_energy(tmp_path):
    """Locks out a light dimer that is hotter or colder than the others."""
    kinetic = []
    for mass in 1.0, 0.1, 0.01:
        measured = []

        def measure(stand, length, mass=mass, measured=measured):
            result, _ = stand.run(
                stability_molecules.dimer_of(mass), f"{mass}", [length], dt=0.01, every=1
            )
            measured.append(result.thermo["KinEng"][0])
            return Number(0.0)

        row(case(measure), "rigid/nve", tmp_path)
        kinetic += measured
    np.testing.assert_allclose(kinetic, kinetic[1], rtol=1e-9)


def test_refused_bodies_are_not_run(tmp_path):
    """Locks out shake on bodies that it cannot hold, and a refusal of LAMMPS that passes for a
    blow-up."""
    assert row(CASES["needles"], "shake 1e-8", tmp_path)["verdict"] == "cannot run"

    def measure(stand, length):
        scene = stability_molecules.dimer_of(0.1)
        stand.run(dataclasses.replace(scene, bodies="nonsense"), "run", [1], dt=0.1, every=1)

    found = row(case(measure), "rigid/nve", tmp_path)
    assert found["verdict"] == "cannot run" and "ERROR" in found["note"], found


def test_command(tmp_path, monkeypatch, capsys):
    """Locks out files that are missing or hold less than was run, a page with links to other files,
    and unknown names that are taken."""
    monkeypatch.setattr(run, "run", lambda *_: pytest.fail("nothing is to be run"))
    out = str(tmp_path)
    assert (
        command.main(
            ["stability", "needles", "disks", "--only", "shake 1e-8", "rattle 1e-8", "--out", out]
        )
        == 0
    )
    with open(tmp_path / "table.csv") as file:
        table = list(csv.DictReader(file))
    assert [(line["case"], line["integrator"]) for line in table] == [
        (a, b) for a in ("needles", "disks") for b in ("shake 1e-8", "rattle 1e-8")
    ]
    page = (tmp_path / "report.html").read_text()
    assert all(
        word in page
        for word in (
            "needles",
            "cannot run",
            "data:image/png;base64",
            CASES["disks"].criterion,
            CRITERIA["orientation"].derivation,
        )
    )
    assert [line["error is"] for line in table] == 2 * [CASES["needles"].bars] + 2 * [
        CASES["disks"].bars
    ]
    assert 'src="http' not in page and 'href="http' not in page
    shown = capsys.readouterr().out
    assert (
        "Ours has no blow-up that any LAMMPS fix survives: cannot tell, ours has no row yet "
        "(needles, disks)" in shown
    )
    for words in ["nonsense"], ["needles", "--only", "nonsense"]:
        with pytest.raises(SystemExit):
            command.main(["stability", *words, "--out", out])
        assert "choose from" in capsys.readouterr().err


def test_list_names_all_cases(capsys):
    """Locks out a case without its physics, number, bound, reason, and what its error bar is or why
    it has none."""
    stability_report.list_cases(console.console(), CASES)
    shown = capsys.readouterr().out
    for found in CASES.values():
        assert found.name in shown
        assert found.physics and found.criterion and found.bars
        assert (found.low is None) != (found.high is None)


def standing(summary):
    """Who comes to which verdict in how many cases, and in which ones, as a Markdown table."""
    found, labels = defaultdict(lambda: defaultdict(list)), {}
    for case in summary["cases"]:
        for row in case["rows"]:
            labels[row["integrator"]] = row["label"]
            verdict = "fail" if row["verdict"] in stability.LOST else row["verdict"]
            found[row["integrator"]][verdict].append(case["name"])
    lines = ["| integrator | passes | fails | cannot tell | cannot run |", "|---|---|---|---|---|"]
    for name in filter(found.get, stability.COMPARED):
        others = (found[name][key] for key in ("fail", "cannot tell", "cannot run"))
        cells = (f"{len(some)}: {', '.join(some)}" if some else "0" for some in others)
        label, passed = committed.cell(labels[name]), len(found[name]["pass"])
        lines.append(f"| `{label}` | {passed} | {' | '.join(cells)} |")
    return "\n".join(lines)


def test_page_claims_what_the_table_gives():
    """Locks out a page that claims another verdict than the committed rows, as these are judged by
    the bounds of today."""
    summary = json.loads(
        (ROOT / "validation" / "results" / "stability" / "summary.json").read_text()
    )
    told = standing(summary)
    page = committed.render((ROOT / "docs" / "results" / "stability.md").read_text())
    assert told in page, f"its section 'The atlas' is to have\n{told}"
