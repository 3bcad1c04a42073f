"""The paper's test problems: pieces that follow one another, and judgements on energies that are
known.

Statistical checks use fixed random seeds.
"""

import dataclasses
import signal
import time
from collections import Counter
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from conftest import Silent

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

import mdtraj

from validation import __main__ as command
from validation.paper import measure as paper_claims
from validation.paper import plan as paper
from validation.paper import report as paper_report
from validation.running import machine, run
from validation.running.lock import Lock
from validation.running.trajectory import Series, Trajectory
from validation.scenes import SCENES
from validation.scenes import peptide as paper_peptide
from validation.scenes.data_file import data_file
from validation.scenes.integrators import PAPER
from validation.statistics import measures
from validation.statistics.check import Check


def trajectory(integrator="nosquish", steps=300, piece=300, **more):
    usual = {
        "name": "test",
        "label": "test",
        "scene": SCENES["dimer"],
        "dt": paper.DIMER_DT,
        "every": 10,
        "ranks": 1,
    }
    return Trajectory(integrator=PAPER[integrator], steps=steps, piece=piece, **usual | more)


@pytest.mark.timeout(120)
@pytest.mark.parametrize(
    "integrator", ["nosquish", "matubayasi-nakahara", "shake", "rigid/nve/small"]
)
def test_pieces_are_one_trajectory(tmp_path, integrator):
    """Locks out a piece that starts from other atoms than the one before has left, samples told
    twice, and a time that starts anew."""
    whole, _ = paper.do(trajectory(integrator), tmp_path / "whole", 60, Silent())
    cut, _ = paper.do(trajectory(integrator, piece=120), tmp_path / "cut", 60, Silent())
    assert whole.error is None and cut.error is None
    assert cut.time == pytest.approx(np.arange(31) * 10 * 0.3e-3)
    assert np.ptp(whole.total) > 1e-4, "an energy that does not change checks nothing"
    assert cut.total == pytest.approx(whole.total, abs=1e-9)
    assert cut.kinetic == pytest.approx(whole.kinetic, abs=1e-7)
    assert cut.positions.x[1] == pytest.approx(whole.positions.x[1], abs=1e-7)
    assert [steps for _, steps in cut.pieces] == [120, 120, 60]


@pytest.mark.timeout(120)
def test_a_run_goes_on_after_an_interruption(tmp_path, monkeypatch):
    """Locks out complete pieces that are run again, and a trajectory that is complete without
    its last one."""
    done = []

    def limited(job, on_step=None):
        if len(done) == 2:
            return run.Result("interrupted", {}, [], None, {}, interrupted=True)
        done.append(Path(job.directory).name)
        return original(job, on_step)

    original = run.run
    monkeypatch.setattr(run, "run", limited)
    some, interrupted = paper.do(trajectory(piece=100), tmp_path, 60, Silent())
    assert interrupted and some.error == "interrupted" and len(some.time) == 21
    monkeypatch.setattr(
        run,
        "run",
        lambda job, on_step=None: done.append(Path(job.directory).name) or original(job, on_step),
    )
    rest, interrupted = paper.do(trajectory(piece=100), tmp_path, 60, Silent())
    assert not interrupted and rest.error is None and len(rest.time) == 31
    assert done == ["piece-0", "piece-100", "piece-200"]


def test_two_processes_do_one_trajectory_one_after_the_other(tmp_path, monkeypatch):
    """Locks out a command that empties the folder in which another one's LAMMPS is at work: the
    second waits, and takes over what the first has left."""
    real, said = run.run, tmp_path / "said"

    def slow(job, *more, **how):
        with open(said, "a") as file:
            file.write("begin\n")
        time.sleep(0.5)  # the other one would begin now
        return real(job, *more, **how)

    def command_of_its_own():
        found, _ = paper.do(trajectory(), tmp_path, 60, Silent())
        assert found.error is None
        with open(said, "a") as file:
            file.write(f"end {found.total[-1]!r}\n")

    monkeypatch.setattr(run, "run", slow)
    both = [get_context("fork").Process(target=command_of_its_own) for _ in range(2)]
    try:
        for each in both:
            each.start()
        for each in both:
            each.join(60)
        assert [each.exitcode for each in both] == [0, 0]
    finally:
        for each in both:
            each.terminate()
    lines = said.read_text().splitlines()
    assert lines[0] == "begin" and [line[:3] for line in lines[1:]] == ["end", "end"]
    assert lines[1] == lines[2]


def test_an_interruption_while_another_process_has_the_run(tmp_path):
    """Locks out a Ctrl-C that, while it waits, takes with it what was complete before."""

    def interrupt(*_):
        raise KeyboardInterrupt

    usual = signal.signal(signal.SIGALRM, interrupt)
    try:
        with Lock(tmp_path / "test" / "piece-0" / run.LOCK):
            signal.setitimer(signal.ITIMER_REAL, 1.0)
            found, interrupted = paper.do(trajectory(), tmp_path, 60, Silent())
    finally:
        signal.signal(signal.SIGALRM, usual)
    assert interrupted and found.error == run.INTERRUPTED and not len(found.total)


def test_what_a_run_starts_from_is_part_of_it(tmp_path, monkeypatch):
    """Locks out a result of other code, of other input files or of another start that is taken
    over."""
    dump = tmp_path / "start"
    dump.write_text("one")
    path = trajectory(start=(dump, 0))

    def origin(path=path):
        (job,) = path.jobs(tmp_path, 60)
        return job.origin

    first, theirs = origin(), origin(trajectory("shake"))
    assert origin() == first
    dump.write_text("two")
    second = origin()
    monkeypatch.setattr(machine, "package_hash", lambda: "other code")
    third = origin()
    assert origin(trajectory("shake")) == theirs, "fix shake is no code of ours"
    monkeypatch.setattr(machine, "versions", lambda: {"lammps": "another"})
    fourth = origin()
    other_files = dataclasses.replace(SCENES["dimer"], folder=SCENES["water"].folder)
    assert (
        len({first, second, third, fourth, origin(dataclasses.replace(path, scene=other_files))})
        == 5
    )
    assert origin(trajectory("shake")) != theirs


def test_an_interruption_between_runs_keeps_what_there_is(tmp_path, monkeypatch):
    """Locks out a traceback in place of a report."""
    done = []

    def do(path, *_):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(path.name)
        return made(path.name, noise(1.0, 1)), False

    monkeypatch.setattr(paper, "do", do)
    found, circumstances = paper.paper(
        tmp_path, paper.plan(paper.SHORT, 1, tmp_path), 1, 60, Silent()
    )
    assert list(found) == done and circumstances["interrupted"]


@pytest.mark.parametrize("failing, status", [(None, 0), ("gear", 0), ("nosquish", 1), ("shake", 1)])
def test_exit_status(tmp_path, monkeypatch, failing, status):
    """Locks out a run that failed and is not told, and Gear's, which is expected to, told as a
    failure."""
    found = {
        name: made(name, noise(1.0, 1), integrator=name) for name in ("nosquish", "gear", "shake")
    }
    for name, one in found.items():
        one.error = "lost atoms" if name == failing else None
    monkeypatch.setattr(
        paper, "paper", lambda *_: (found, machine.circumstances() | {"interrupted": False})
    )
    assert command.main(["paper", "--out", str(tmp_path)]) == status


def test_parts_are_told_by_their_names(tmp_path, monkeypatch, capsys):
    """Locks out a part that runs other trajectories too, or leaves some of its own out, and a
    name that is none."""
    chosen = []

    def gather(out, plan, *_):
        chosen.extend(one.name for one in plan)
        return {}, machine.circumstances() | {"interrupted": False}

    monkeypatch.setattr(paper, "paper", gather)
    words = ["paper", "--out", str(tmp_path)]
    assert command.main([*words, "dimer", "water-matubayasi"]) == 0
    names = [one.name for one in paper.plan(paper.SHORT, 2, tmp_path)]
    assert (
        chosen
        == [name for name in names if "dimer" in name or name == "water-matubayasi-nakahara"]
        != []
    )
    chosen.clear()
    assert command.main([*words, "peptide-nosquish"]) == 0 and chosen == [
        "peptide-nosquish"
    ]  # of all that begin so
    chosen.clear()
    assert command.main(words) == 0 and chosen == names
    with pytest.raises(SystemExit):
        command.main([*words, "dimer", "trimer"])
    assert "trimer" in capsys.readouterr().err


def made(name, total, scene="dimer", dt=3.0, every=10, integrator="nosquish", **more):
    """A series with this total energy."""
    total = np.asarray(total, float)
    path = trajectory(
        integrator,
        name=name,
        scene=SCENES[scene],
        dt=dt,
        steps=every * (len(total) - 1),
        every=every,
    )
    time = np.arange(len(total)) * every * dt / 1000
    usual = {
        "kinetic": np.full(len(total), 2000.0),
        "potential": total - 2000.0,
        "temperature": np.full(len(total), 300.0),
    }
    return Series(path, None, time, total, **usual | more, positions=None, pieces=[], seconds=1.0)


def noise(size, seed, n=4000, level=-10000.0):
    return level + size * np.random.default_rng(seed).normal(size=n)


def claim(found, *words):
    """The one check that has all these words, of its subject and number."""
    (one,) = [
        one
        for one in paper_claims.judge(found)["checks"]
        if all(word in f"{one['subject']}, {one['what']}" for word in words)
    ]
    return one


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
    assert check.verdict == (
        ""
        if low is high is None
        else {True: "holds", False: "does not hold", None: "cannot tell"}[holds]
    )


def test_random_walk_is_told_from_noise():
    """Locks out a rate that is off by the time of a block, an error that is not the estimate's
    scatter, and noise taken for a walk."""
    t, rng = 0.02 * np.arange(2048), np.random.default_rng(9)
    rates, errors = np.transpose(
        [
            measures.random_walk(
                t,
                rng.normal(size=len(t)) + np.cumsum(rng.normal(size=len(t))) * np.sqrt(3.0 * 0.02),
            )[:2]
            for _ in range(100)
        ]
    )
    assert rates.mean() == pytest.approx(3.0, rel=0.15)
    assert errors.mean() == pytest.approx(rates.std(), rel=0.4)
    still = [measures.random_walk(t, rng.normal(size=len(t)))[:2] for _ in range(20)]
    assert np.mean([rate < 2.5 * error for rate, error in still]) > 0.8 and np.max(still) < 0.05


WORD = {True: "holds", None: "cannot tell", False: "does not hold"}


def dimers(scatter, count=16):
    """NO_SQUISH and reference 12 from some starts: the same sd, other means."""
    means = np.random.default_rng(3).normal(size=(2, count))
    means *= [[0.1], [0.1 * scatter]] / means.std(axis=1, keepdims=True)
    names = "nosquish", "matubayasi-nakahara"
    return {"dimer-starts": made("x", noise(1.0, 99), temperature=noise(20.0, 98, level=154.0))} | {
        f"dimer-{name}-{n + 1}": made("x", noise(1.0, 100 * k + n, level=-9000 + means[k, n]))
        for k, name in enumerate(names)
        for n in range(count)
    }


@pytest.mark.parametrize("scatter, holds", [(8.0, True), (1.0, None), (0.1, False)])
def test_who_wanders_from_start_to_start(scatter, holds):
    """Locks out the ratio turned round, a verdict within the errors, and the deviation along a
    trajectory taken for that of the means."""
    found = dimers(scatter)
    one = claim(found, "reference 12 over NO_SQUISH", "scatter of")
    assert one["value"] == pytest.approx(np.log10(scatter), abs=4 * one["error"])
    assert one["verdict"] == WORD[holds]
    soon = claim(found, "first 0.5 ps")
    assert soon["value"] == pytest.approx(1.0, abs=4 * soon["error"])
    warm = claim(found, "mean temperature")
    assert warm["value"] == pytest.approx(154.0, abs=5 * warm["error"]) and warm[
        "error"
    ] == pytest.approx(20.0 / np.sqrt(4000), rel=0.5)


@pytest.mark.parametrize("size, holds", [(1.5, True), (1.0, None), (0.7, False)])
def test_who_is_more_accurate_on_the_dimer(size, holds):
    """Locks out the ratio turned round, other starts' trajectories that are compared, and the
    scatter of one ratio for the error of the mean."""
    found, own = dimers(1.0), np.random.default_rng(4).lognormal(sigma=1.0, size=16)
    for n, of_both in enumerate(own, 1):
        for name, part in (
            ("nosquish", 1.0),
            ("matubayasi-nakahara", size * (1.0 + 0.1 * (-1) ** n)),
        ):
            found[f"dimer-{name}-{n}"].total = noise(of_both * part, n, level=-9000)
    one = claim(found, "reference 12 over NO_SQUISH", "average measure")
    assert one["value"] == pytest.approx(size, rel=0.03) and one["error"] == pytest.approx(
        0.1 * size / np.sqrt(15), rel=0.1
    )
    assert one["verdict"] == WORD[holds]
    first = next(check for check in paper_claims.judge(found)["checks"] if check["part"] == "dimer")
    assert first["what"] == one["what"]


@pytest.mark.parametrize("size, holds", [(1.5, True), (1.0, None), (0.7, False)])
def test_who_is_more_accurate_in_the_liquid(size, holds):
    """Locks out the ratio turned round, a verdict within the errors, and a wander that is left
    out."""
    found = {
        "water-nosquish": made("a", noise(1.0, 1), "water"),
        "water-matubayasi-nakahara": made("b", noise(size, 2), "water"),
    }
    one = claim(found, "more accurate")
    assert one["value"] == pytest.approx(size, abs=5 * one["error"]) and one["error"] < 0.05
    assert one["verdict"] == WORD[holds]
    steps = np.repeat(np.random.default_rng(3).normal(size=8) * 2 * size, 500)
    found["water-matubayasi-nakahara"].total += steps
    assert claim(found, "more accurate")["value"] > 1.5 * size
    wander = claim(found, "wander")
    assert wander["value"] > 1 and wander["verdict"] == "holds"


@pytest.mark.parametrize("number", [4, 8, 16, 32])
def test_the_ratio_of_two_scatters(number):
    """Locks out a margin of a ratio that is symmetric where the ratio's error is not: of eight
    values a ratio of 9 was none yet, and two equal scatters were told apart in 6 instead of 2.5 %,
    to one side; and parts of a walk taken for independent ones, 17 %."""
    rng, sides = np.random.default_rng(number), []
    for _ in range(4000):
        one = measures.scatters_apart(*rng.normal(size=(2, number)))
        sides.append([one.value > one.margin, one.value < -one.margin])
    assert np.abs(np.mean(sides, axis=0) - 0.025).max() < 0.009
    freedom, sides = measures.freedom_of_walk(number), []
    walks = np.cumsum(rng.normal(size=(2000, 2, number * 16)), axis=2)
    for both in walks.reshape(2000, 2, number, 16).mean(axis=3):
        one = measures.scatters_apart(*both, freedom)
        sides.append([one.value > one.margin, one.value < -one.margin])
    assert np.max(np.mean(sides, axis=0)) < 0.04
    assert one.margin > 1.3 * measures.scatters_apart(*both).margin or number == 4


def test_who_drifts():
    """Locks out a drift that passes for stable, chance that passes for a drift, and stable by
    large errors."""
    t = np.arange(4000) * 0.03
    steady, drifting = (
        made("a", noise(1.0, 3, 40_000), "peptide", every=1),
        made("b", noise(1.0, 4) + 0.1 * t, "peptide", integrator="rigid/small"),
    )
    loud = made("c", noise(300.0, 5), "peptide")

    def verdict(one, *words, **more):
        return claim({"peptide-nosquish": one} | more, "NO_SQUISH", *words)["verdict"]

    beside = {"peptide-rigid/small": drifting}
    assert verdict(steady, "stable") == verdict(steady, "stable", **beside) == "holds"
    assert verdict(drifting, "stable") == verdict(drifting, "stable", **beside) == "does not hold"
    assert verdict(loud, "stable", **beside) == "cannot tell"
    assert (
        claim(beside, "drifts")["verdict"] == "holds"
        and claim({"peptide-rigid/small": steady}, "drifts")["verdict"] == "does not hold"
    )
    starts = dimers(1.0)
    assert claim(starts, "reference 12, stable")["verdict"] == "holds"
    for one in starts.values():
        one.total += 0.1 * one.time
    assert claim(starts, "reference 12, stable")["verdict"] == "does not hold"


@pytest.mark.parametrize(
    "size, equal, within", [(1.0, True, True), (1.085, True, False), (1.3, False, False)]
)
def test_who_is_equal(size, equal, within):
    """Locks out a difference that passes since errors are large, and one that does since it is
    small."""
    found = {
        "peptide-nosquish-123": made("a", noise(size, 1), "peptide"),
        "peptide-rigid/nve/small": made("b", noise(1.0, 2), "peptide"),
    }
    assert claim(found, "equal: sd")["verdict"] == WORD[equal]
    assert claim(found, "equal within")["verdict"] == WORD[within]
    uneven = noise(1.0, 3, level=0.0) * np.repeat(np.linspace(0.4, 1.6, 8), 500) - 10000
    found["peptide-nosquish-123"] = made("a", uneven, "peptide")
    assert (
        claim(found, "equal: sd")["verdict"]
        == claim(found, "equal within")["verdict"]
        == "cannot tell"
    )


def test_what_is_not_complete_is_not_judged():
    """Locks out a claim from a trajectory that ended early, and a length that the claim does not
    tell."""
    found = {
        "water-nosquish": made("a", noise(1.0, 1), "water"),
        "water-matubayasi-nakahara": made("b", noise(2.0, 2), "water"),
    }
    assert "120 ps" in claim(found, "more accurate")["what"]
    found["water-matubayasi-nakahara"].error = "interrupted"
    assert {one["subject"] for one in paper_claims.judge(found)["checks"]} == {"NO_SQUISH"}
    assert len(paper_claims.judge(found)["rows"]) == 2


def test_laws_of_step_and_size_and_average_measure_with_each_zero_of_energy():
    """Locks out the root mean square for the mean, a wrong zero, and laws for size and step that
    are not those measured."""
    total = np.where(np.arange(400) % 4 < 2, -10000.3, -9999.7)
    found = {"peptide-nosquish": made("a", total, "peptide")}
    found |= {
        f"peptide-{name}": made(name, [-1000.0], "peptide", potential=np.array([u]))
        for name, u in (("alone", -3000.0), ("within", -32000.3))
    }
    assert "dt_for_it" not in paper_claims.judge(found)["conventions"][0], (
        "there is no law without runs"
    )
    for dt, every in (1.5, 20), (2.0, 15), (3.0, 10):
        found[f"peptide-at-{dt:g}-fs"] = made(
            "x", noise(0.1 * dt**2, 1) + 3e-3 * np.arange(4000), "peptide", dt, every
        )
    for seed, bodies in enumerate((1000, 2000, 8000)):
        found[f"water-{bodies}"] = made("x", noise(0.01 * bodies**0.5, seed), "water")
        found[f"water-{bodies}"].trajectory = trajectory(scene=SCENES["water"].of_size(bodies))
    judged = paper_claims.judge(found)
    rows = {row["convention"]: row for row in judged["conventions"]}
    time, size = (claim(found, word) for word in ("Δt to the power", "molecules to the power"))
    for one, law in (time, 2.0), (size, 0.5):
        assert (
            one["value"] == pytest.approx(law, abs=4 * one["error"])
            and one["error"] < 0.05
            and one["verdict"] == "holds"
        )
    assert rows["over |total energy|"]["value"] == pytest.approx(3e-5)
    assert rows["over |kinetic energy|"]["value"] == pytest.approx(0.3 / 2000)
    assert rows["over |potential energy|"]["value"] == pytest.approx(0.3 / 12000)
    assert rows["over |potential energy less that of the molecules apart|"][
        "value"
    ] == pytest.approx(0.3 / 9000)
    assert rows["over |total energy with the Coulomb energy of bonded atoms|"][
        "value"
    ] == pytest.approx(0.3 / 30000)
    assert rows["over |total energy|"]["size_for_it"] == pytest.approx(
        3 ** (1 / (1 - size["value"])) * SCENES["peptide"].unit
    )
    assert rows["over |total energy|"]["dt_for_it"] == pytest.approx(3 / 3 ** (1 / time["value"]))
    near = (
        "total energy",
        "potential energy",
        "total energy with the Coulomb energy of bonded atoms",
    )
    expected = {f"over |{what}|" for what in near} | {
        "E - E(0) in place of E - <E>, over |total energy|"
    }
    assert {name for name, row in rows.items() if row["about"]} == expected


def test_force_field_has_its_part_of_the_variance():
    """Locks out the part of the deviation for that of the variance, and a random walk that is
    judged by the short time in which it was seen."""
    usual = made("a", noise(1.0, 6, n=20000), "peptide")  # 600 ps, and 12 ps at the small step

    def small(size, rate):
        walk = np.cumsum(np.random.default_rng(5).normal(size=4000)) * np.sqrt(rate * 3e-3)
        return {
            "peptide-nosquish": usual,
            "force-field-as it is": made("x", noise(size, 7) + walk, "peptide", 0.5, 6),
        }

    one = claim(small(0.5, 0.0), "does not dominate")
    assert one["value"] == pytest.approx(0.25, rel=0.15) and one["verdict"] == "holds"
    assert claim(small(1.0, 0.0), "does not dominate")["verdict"] == "does not hold"
    one = claim(small(0.1, 0.05), "does not dominate")  # sd 0.3 in 12 ps, but 2.2 in 600
    assert (
        one["value"] == pytest.approx(0.05 * 600 / 6, abs=4 * one["error"])
        and one["verdict"] == "does not hold"
    )
    found = small(0.5, 0.0)
    found["force-field-neighbour list each step"] = dataclasses.replace(
        found["force-field-as it is"]
    )
    assert claim(found, "neighbour list")["verdict"] == "holds"
    found["force-field-neighbour list each step"].total = noise(0.5, 8)
    assert claim(found, "neighbour list")["verdict"] == "does not hold"


def test_gear_is_held_against_the_same_starts():
    """Locks out a ratio of other starts' runs, Gear's first steps taken for its error, a run
    that ended early left out, and a drift that chance makes."""
    found = {}
    for n, size in enumerate((0.01, 0.1, 1.0), 1):
        found[f"water-nosquish-short-step-{n}"] = made("a", noise(size, n), "water", dt=1.0)
        found[f"water-gear-short-step-{n}"] = made("b", noise(2 * size, 10 + n), "water", dt=1.0)
        found[f"water-gear-short-step-{n}"].total[:3] -= 5000.0  # of 10 steps each
    one = claim(found, "Gear over NO_SQUISH, water", "average measure")
    assert (
        one["value"] == pytest.approx(2.0, rel=0.03)
        and one["error"] < 0.1
        and one["verdict"] == "holds"
    )
    assert claim(found, "Gear, water", "drifts")["verdict"] == "does not hold"
    far = claim(found, "NO_SQUISH over Gear, water", "far more accurate")
    assert far["value"] is None and far["verdict"] == "cannot tell", "over a drift that may be none"
    for part, word in (0.0, "holds"), (0.05, "holds"), (0.5, "does not hold"):
        again = {name: dataclasses.replace(one) for name, one in found.items()}
        for name, one in again.items():
            one.total = (
                one.total + (10.0 if "gear" in name else 10.0 * part) * one.time
            )  # 400 in all
        far = claim(again, "NO_SQUISH over Gear, water", "far more accurate")
        assert far["value"] == pytest.approx(part, abs=0.01) and far["verdict"] == word
    gear = made("b", [-9000, -8000, 1e9], "water", integrator="gear")
    gear.error = "lost atoms"
    one = claim({"water-gear": gear}, "unstable")
    assert one["verdict"] == "holds" and "lost atoms" in one["note"]
    assert (
        claim({"water-gear": made("b", [-9000, -8999, -9001], "water")}, "unstable")["verdict"]
        == "does not hold"
    )
    dimer = dimers(1.0, 4)
    dimer |= {
        f"dimer-gear-{n}": made(
            "c", noise(0.1, 50 + n, level=-9000) + (0.05 + 0.001 * n) * np.arange(4000) * 0.03
        )
        for n in range(1, 5)
    }
    assert claim(dimer, "Gear, dimer", "drifts")["verdict"] == "holds"
    crossing = claim(dimer, "after which time")
    assert (
        crossing["value"] == pytest.approx(1.0 / 0.0525, rel=0.05)
        and crossing["verdict"] == "holds"
    )
    assert (
        "measure is 0.3" in crossing["note"]
    )  # an energy that has gone evenly from 0 to 1 by then: 1/4, over that of the noise of 1: 0.8
    dimer |= {f"dimer-gear-{n}": made("c", noise(0.1, 50 + n, level=-9000)) for n in range(1, 5)}
    assert claim(dimer, "Gear, dimer", "drifts")["verdict"] == "does not hold"
    assert not [
        one for one in paper_claims.judge(dimer)["checks"] if "after which time" in one["what"]
    ]
    for n in range(1, 5):
        dimer[f"dimer-gear-{n}"].total[0] -= 1000.0  # sampled but once in Gear's first steps
    assert claim(dimer, "Gear over NO_SQUISH, dimer", "average measure")["value"] == pytest.approx(
        0.1, rel=0.05
    )


RATTLE = """
units real
atom_style full
read_data data.water
pair_style zero 8.0
pair_coeff * *
bond_style zero
bond_coeff 1 0.9572
angle_style zero
angle_coeff 1 104.52
fix 1 all nve
fix 2 all rattle 1e-10 100 0 b 1 a 1
compute along all bond/local velvib
compute largest all reduce max c_along inputs local
compute smallest all reduce min c_along inputs local
thermo_style custom step ke c_largest c_smallest
thermo_modify norm no format float %.15g
timestep 1.0
thermo 10
run 10
"""


def one_water(shift):
    """LAMMPS data file of one turning molecule, moved along x and wrapped into its periodic box."""
    half = np.radians(104.52 / 2)
    x = (
        np.array([[0, 0, 0], [np.sin(half), np.cos(half), 0], [-np.sin(half), np.cos(half), 0]])
        * 0.9572
    )
    v = np.cross([0.003, -0.002, 0.02], x)
    x = np.add(x, [10.0 + shift, 10.0, 10.0]) % 20.0
    return data_file(
        "full",
        [[1, 1, 1], [1, 2, 2], [0, 0, 0], x],
        (0, 20),
        mass=[15.9994, 1.008],
        velocities=[v],
        terms={"bonds": [(1, 1, 2), (1, 1, 3)], "angles": [(1, 2, 1, 3)]},
    )


def test_why_rattle_is_not_in_figure_3(run_lammps):
    """Locks out the page's word on fix rattle once a LAMMPS has it right: the same molecule
    keeps velocities along its bonds where it crosses a periodic face, and its kinetic energy is
    another."""
    inside = run_lammps(RATTLE, files={"data.water": one_water(0.0)}).thermo[-1]
    across = run_lammps(RATTLE, files={"data.water": one_water(10.0)}).thermo[-1]
    assert max(abs(inside["c_largest"]), abs(inside["c_smallest"])) < 1e-15
    assert max(abs(across["c_largest"]), abs(across["c_smallest"])) > 1e-5
    assert abs(across["KinEng"] / inside["KinEng"] - 1) > 1e-5


@pytest.mark.timeout(120)
def test_shake_holds_what_the_rigid_groups_hold(tmp_path):
    """Locks out constraints of wrong types: LAMMPS's own count of clusters is that of the bodies
    in the data file."""
    scene = paper_peptide.scene()
    found, _ = paper.do(trajectory("shake", steps=0, scene=scene, dt=1.0), tmp_path, 100, Silent())
    assert found.error is None
    sizes = Counter(Counter(found.positions.bodies[found.positions.bodies > 0].tolist()).values())
    log = next(tmp_path.rglob("log.lammps")).read_text()
    for words, number in (("size 2", sizes[2]), ("size 4", sizes[4]), ("frozen angles", sizes[3])):
        line = next(line for line in log.splitlines() if words in line)
        assert int(line.split()[0]) == number, line


def test_helix_is_seen_and_its_loss_too(tmp_path):
    """Locks out atoms in another order, nanometres for Angstrom, a distance that turning
    changes, and a helix where there is none."""
    path = mdtraj.load(str(paper_peptide.PDB))
    x = 10.0 * path.xyz[0]
    turn = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))[0]
    turned = x @ (turn * np.sign(np.linalg.det(turn))) + [30.0, -20.0, 5.0]
    stretched = x * np.where(np.ptp(x, axis=0) == np.ptp(x, axis=0).max(), 2.2, 1.0)
    pieces = []
    for number, frames in enumerate(([x, turned], [turned, stretched])):
        folder = tmp_path / str(number)
        folder.mkdir()
        pieces.append((folder, 10))
        text = ""
        for step, frame in zip((0, 10), frames):
            rows = "\n".join(f"{i} {a:.4f} {b:.4f} {c:.4f}" for i, (a, b, c) in enumerate(frame, 1))
            text += f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{len(frame)}\n"
            text += f"ITEM: BOX BOUNDS\n0 1\n0 1\n0 1\nITEM: ATOMS id xu yu zu\n{rows}\n"
        (folder / "helix.dump").write_text(text)
    found = paper_peptide.helix(pieces, 0.5)
    assert found["time"].tolist() == [0.0, 5.0, 10.0]
    assert (
        found["helical"][0] >= 8
        and found["helical"][1] == found["helical"][0]
        and found["helical"][2] < 4
    )
    assert found["rmsd"][1] < 0.01 < 1.0 < found["rmsd"][2]
    (tmp_path / "1" / "helix.dump").unlink()
    assert paper_peptide.helix(pieces, 0.5) is None, "a helix without its end"


def test_all_files_are_written(tmp_path):
    """Locks out a report that fails where much is missing, and one that asks for other files."""
    found = dimers(8.0)
    summary = {
        "interrupted": True,
        "command": "x",
        "date": "x",
        "machine": {},
        "versions": {},
        "lengths": dataclasses.asdict(paper.SHORT),
    }
    summary |= paper_claims.judge(found)
    paper_report.write(summary, found, tmp_path)
    assert (tmp_path / "figure_2a.png").stat().st_size > 10000 and not (
        tmp_path / "figure_3.png"
    ).exists()
    page = (tmp_path / "report.html").read_text()
    assert "data:image/png;base64," in page and 'src="http' not in page
    assert (
        sum(path.stat().st_size for path in tmp_path.iterdir() if path.suffix != ".html") < 300_000
    )
    assert "holds" in (tmp_path / "claims.csv").read_text()


def test_plans_are_what_the_paper_has():
    """Locks out another step or a shorter run than the paper's, and two trajectories that write
    to one folder."""
    plan = list(paper.plan(paper.FULL, 2, Path("x")))
    assert len({one.name for one in plan}) == len(plan)
    named = {one.name: one for one in plan}
    for name, dt, ps in (
        ("dimer-nosquish-1", 0.3, 300),
        ("peptide-nosquish", 3.0, 300),
        ("peptide-shake", 3.0, 300),
        ("water-nosquish", 3.0, 1000),
    ):
        assert named[name].dt == dt and named[name].steps * dt / 1000 >= ps
