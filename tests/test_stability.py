"""The stability atlas: verdicts, rows that are kept, numbers that are known otherwise, and that cases tell integrators apart."""

import csv
import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import Silent

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # after site-packages: the installed fix_nosquish is tested

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "scipy"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from scipy.special import ellipk  # noqa: E402

from validation import __main__ as command  # noqa: E402
from validation import console, run, stability, stability_bodies, stability_molecules, stability_report, stability_tops  # noqa: E402
from validation.stability import BlowUp, CannotRun, Case, Number  # noqa: E402
from validation.stability_cases import CASES  # noqa: E402


def case(measure, name="test", **more):
    usual = {"physics": "None.", "criterion": "a number", "unit": "", "why": "none", "bars": "none", "short": 1, "full": 2, "high": 1.0}
    return Case(name=name, measure=measure, **usual | more)


def row(found, integrator="nosquish", folder=Path("unused"), length=None):
    """The row of a case with an integrator; of another length, if one is given."""
    if length is not None:
        found = dataclasses.replace(found, short=length)
    return stability._row(found, integrator, folder, False, 60.0, Silent())


def raises(error):
    def measure(stand, length):
        raise error

    return measure


@pytest.mark.parametrize(
    "measure, bounds, verdict",
    [
        (lambda stand, length: Number(0.5, 0.1), {}, "pass"),
        (lambda stand, length: Number(0.5, 0.3), {}, "cannot tell"),
        (lambda stand, length: Number(1.5, 0.1), {}, "fail"),
        (lambda stand, length: Number(1.5, 0.1), {"high": None, "low": 1.0}, "pass"),
        (lambda stand, length: Number(np.nan), {}, "blow-up"),
        (lambda stand, length: Number(np.inf), {"high": None, "low": 1.0}, "blow-up"),
        (raises(BlowUp("after step 7: lost atoms")), {}, "blow-up"),
        (raises(CannotRun("no such cluster")), {}, "cannot run"),
    ],
)
def test_verdicts(tmp_path, measure, bounds, verdict):
    """Locks out a number that is not finite and passes, an error bar that is forgotten, a lower bound taken for an upper one."""
    found = row(case(measure, **bounds), folder=tmp_path)
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
        "rows": [{"integrator": name, "kind": kinds[name], "verdict": verdict} for name, verdict in verdicts.items()],
    }


@pytest.mark.parametrize(
    "verdicts, holds",
    [
        ({"nosquish": "blow-up", "rigid": "fail"}, (False, True, True)),
        ({"nosquish": "blow-up", "shake": "pass"}, (False, False, True)),
        ({"nosquish": "cannot run", "rigid": "blow-up", "shake": "cannot tell"}, (False, True, True)),
        ({"nosquish": "blow-up", "rigid": "blow-up", "gear": "pass"}, (True, True, True)),
        ({"nosquish": "fail", "rigid": "pass"}, (True, False, True)),
        ({"nosquish": "pass", "rigid": "pass", "shake": "cannot run"}, (True, True, False)),
        ({"nosquish": "pass", "gear": "blow-up"}, (True, True, True)),
    ],
)
def test_what_all_rows_say(verdicts, holds):
    """Locks out a blow-up of ours that is not told, one that is told though every LAMMPS fix has it, and a case that tells nothing apart."""
    assert tuple(line["holds"] for line in stability.told([rows(**verdicts)])) == holds


def test_a_case_that_is_not_complete_is_not_called_blunt():
    """Locks out a judgement before the integrator that fails has had its turn."""
    found = rows(nosquish="pass", rigid="pass")
    assert not stability.told([found])[2]["holds"]
    assert stability.told([found | {"integrators": ["nosquish", "rigid", "gear"]}])[2]["holds"]


def test_rows_are_kept(tmp_path, monkeypatch):
    """Locks out rows that are lost by a Ctrl-C or run again after it, those of other cases forgotten, and those of other lengths taken."""
    done = []

    def measure(stand, length):
        done.append((stand.case.name, stand.integrator.name, length))
        if len(done) == 2:
            raise KeyboardInterrupt
        return Number(0.5)

    cases = {name: case(measure, name) for name in ("one", "two")}
    run_them = lambda names, full=False: stability.stability(cases, names, tmp_path, full, 60.0, Silent(), ["nosquish", "rigid"])  # noqa: E731
    summary = run_them(["one"])
    assert summary["interrupted"] and [len(found["rows"]) for found in summary["cases"]] == [1]
    summary = run_them(["one"])
    assert not summary["interrupted"] and [found["integrator"] for found in summary["cases"][0]["rows"]] == ["nosquish", "rigid"]
    assert [name for _, name, _ in done] == ["nosquish", "rigid", "rigid"]
    summary = run_them(["two"])
    assert [found["name"] for found in summary["cases"]] == ["one", "two"]
    assert len(done) == 5
    assert json.loads((tmp_path / "summary.json").read_text())["cases"] == summary["cases"]
    run_them(["one"], full=True)
    assert done[5:] == [("one", "nosquish", 2), ("one", "rigid", 2)]


@pytest.mark.parametrize("error, told", [(0.0, ""), (0.125, "0.125")])
def test_error_bars_are_told(tmp_path, error, told):
    """Locks out a number without an error bar that does not say why, or has one of zero."""
    cases = {"test": case(lambda stand, length: Number(0.5, error), bars="so and so")}
    summary = stability.stability(cases, ["test"], tmp_path, False, 60.0, Silent(), ["nosquish"])
    stability_report.write(summary, tmp_path)
    with open(tmp_path / "table.csv") as file:
        (line,) = csv.DictReader(file)
    assert line["error"] == told and line["error is"] == "so and so"
    assert "±: so and so." in (tmp_path / "report.html").read_text()


def test_cases_side_by_side(tmp_path):
    """Locks out rows that another process has saved meanwhile and that this one's summary loses, and a command that makes only a part of them."""

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


@pytest.mark.parametrize("moment", [(1, 1, 1), (1, 1, 1e-12), (1, 1, 2), (1 + 1e-6, 1 + 1e-6, 2), (0.7, 0.9, 1.3)])
def test_bodies_have_the_moments_that_they_are_named_after(moment):
    """Locks out needles and disks of other moments."""
    x, mass = stability_bodies.three_rods(np.array(moment, float))
    tensor = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(mass, x))
    np.testing.assert_allclose(tensor, np.diag(moment), rtol=1e-3, atol=1e-16)


def test_time_between_turns_over():
    """Locks out a wrong exact answer: the angular momentum's middle component is sn, of period 4 K (Landau and Lifshitz, section 37)."""
    moments, _ = stability_bodies.moments(stability_bodies.BENT, stability_bodies.MASSES)
    spin = stability_tops.MIDDLE * np.array([stability_tops.TILT, 1.0, stability_tops.TILT])
    i3, i2, i1 = moments  # there the smallest comes first
    square, twice = ((moments * spin) ** 2).sum(), (moments * spin**2).sum()
    if square < twice * i2:
        i1, i3 = i3, i1
    m = (i2 - i1) * (twice * i3 - square) / ((i3 - i2) * (square - twice * i1))
    rate = np.sqrt((i3 - i2) * (square - twice * i1) / (i1 * i2 * i3))
    np.testing.assert_allclose(stability_tops.exact_interval(), 2 * ellipk(m) / rate, rtol=1e-5)


# each with a length that is short, who passes and who does not
APART = [
    ("degenerate", 4000, "nosquish", "rigid/nve"),
    ("turn-per-step", 4000, "nosquish", "rigid"),
    ("turn-per-step", 400, "rigid/nve", "shake 1e-8"),
    ("long-tops", 2000, "nosquish", "shake 1e-4"),
    ("long-tops", 2000, "rigid/nve", "matubayasi-nakahara"),
    ("far-away", 50, "nosquish", "rigid/nve/small"),
]


@pytest.mark.parametrize("name, length, passes, does_not", APART)
def test_cases_tell_integrators_apart(tmp_path, name, length, passes, does_not):
    """Locks out a bound that nobody can fail, and one that nobody can keep."""
    assert row(CASES[name], passes, tmp_path / "runs", length)["verdict"] == "pass"
    found = row(CASES[name], does_not, tmp_path / "runs", length)
    assert found["verdict"] in ("fail", "blow-up"), found


def test_ranks_tell_integrators_apart(tmp_path):
    """Locks out a liquid in which nothing is added up over ranks, so that they agree to the last bit whatever is run."""
    found = row(CASES["ranks"], "rigid/nve", tmp_path, 10)
    assert found["verdict"] == "pass" and found["value"] > 0.0, found
    found = row(CASES["ranks"], "rattle 1e-4", tmp_path, 10)
    assert found["verdict"] == "fail" and found["value"] > 1e6 * CASES["ranks"].high, found


def test_limit_of_springs(tmp_path):
    """Locks out a limit in other units, or one that is the first or last step tried: velocity Verlet of an oscillator breaks at ω Δt = 2, Gear's
    scheme far below; and the energy's swing below the limit, which grows but is no drift, is not taken for a break."""
    found = row(CASES["springs"], "nosquish", tmp_path, 30)
    assert 1.6 < found["value"] < 2.0, found
    assert row(CASES["springs"], "gear", tmp_path, 30)["value"] < 0.6


@pytest.mark.parametrize("good", range(30))
def test_limit_by_halving(monkeypatch, good):
    """Locks out a bisection that ends elsewhere than trying all steps does, or tries more than need be."""
    tried, steps = [], np.arange(5.0, 12.1, 0.25)

    def stable(stand, scene, label, dts, time, allowed, **how):
        tried.extend(dts)
        return [bool(dt < 4.9 + 0.25 * good) for dt in dts], "broke"

    monkeypatch.setattr(stability_molecules, "_stable", stable)
    found = stability_molecules.halved(None, None, steps, 1.0, 0.02)
    assert len(tried) <= 5
    every = stability_molecules.limit(None, None, steps, 1.0, 0.02)
    assert (found.value, found.error) == (every.value, every.error)
    assert good in (0, 29) or found.value == 4.875 + 0.25 * good and found.error == 0.0625


def test_limit_of_a_run_that_breaks_at_once(tmp_path):
    """Locks out a crash of the atlas, and a limit, where not even the first step is borne."""

    def measure(stand, length):
        return stability_molecules.limit(stand, stability_molecules.dimer_of(0.1), [50.0, 60.0], length)

    found = row(case(measure, high=None, low=1.0), folder=tmp_path, length=5000.0)
    assert found["value"] == 25.0 and found["note"].startswith("not at 50 fs") or found["verdict"] == "blow-up", found


def test_dimer_of_other_masses_has_the_same_energy(tmp_path):
    """Locks out a light dimer that is hotter or colder than the others."""
    kinetic = []
    for mass in 1.0, 0.1, 0.01:
        measured = []

        def measure(stand, length, mass=mass, measured=measured):
            result, _ = stand.run(stability_molecules.dimer_of(mass), f"{mass}", [length], dt=0.01, every=1)
            measured.append(result.thermo["KinEng"][0])
            return Number(0.0)

        row(case(measure), "rigid/nve", tmp_path)
        kinetic += measured
    np.testing.assert_allclose(kinetic, kinetic[1], rtol=1e-9)


def test_refused_bodies_are_not_run(tmp_path):
    """Locks out shake on bodies that it cannot hold, and a refusal of LAMMPS that passes for a blow-up."""
    assert row(CASES["needles"], "shake 1e-8", tmp_path)["verdict"] == "cannot run"

    def measure(stand, length):
        scene = stability_molecules.dimer_of(0.1)
        stand.run(dataclasses.replace(scene, bodies="nonsense"), "run", [1], dt=0.1, every=1)

    found = row(case(measure), "rigid/nve", tmp_path)
    assert found["verdict"] == "cannot run" and "ERROR" in found["note"], found


def test_command(tmp_path, monkeypatch, capsys):
    """Locks out files that are missing or hold less than was run, a page with links to other files, and unknown names that are taken."""
    monkeypatch.setattr(run, "run", lambda *_: pytest.fail("nothing is to be run"))
    out = str(tmp_path)
    assert command.main(["stability", "needles", "disks", "--only", "shake 1e-8", "rattle 1e-8", "--out", out]) == 0
    with open(tmp_path / "table.csv") as file:
        table = list(csv.DictReader(file))
    assert [(line["case"], line["integrator"]) for line in table] == [(a, b) for a in ("needles", "disks") for b in ("shake 1e-8", "rattle 1e-8")]
    page = (tmp_path / "report.html").read_text()
    assert all(word in page for word in ("needles", "cannot run", "data:image/png;base64", CASES["disks"].criterion, f"±: {CASES['disks'].bars}."))
    assert [line["error is"] for line in table] == 2 * [CASES["needles"].bars] + 2 * [CASES["disks"].bars]
    assert 'src="http' not in page and 'href="http' not in page
    shown = capsys.readouterr().out
    assert "Ours has no blow-up that any LAMMPS fix survives: yes" in shown
    for words in ["nonsense"], ["needles", "--only", "nonsense"]:
        with pytest.raises(SystemExit):
            command.main(["stability", *words, "--out", out])
        assert "choose from" in capsys.readouterr().err


def test_list_names_all_cases(capsys):
    """Locks out a case without its physics, number, bound, reason, and what its error bar is or why it has none."""
    stability_report.list_cases(console.console(), CASES)
    shown = capsys.readouterr().out
    for found in CASES.values():
        assert found.name in shown
        assert found.physics and found.criterion and found.why and found.bars
        assert (found.low is None) != (found.high is None)
