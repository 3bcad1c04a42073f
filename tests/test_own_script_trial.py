"""A user's script with several integrators and steps: what is measured, and what is said of it."""

import fcntl
import json
import re
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scripts
from conftest import Silent
from own_scripts import GAS, take

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation.choice import meets
from validation.own import counted, shapes, shifted
from validation.pages import console
from validation.running import rounds, run
from validation.running.store import Store
from validation.sample import scenes as sample_scenes
from validation.scenes.integrators import Integrator
from validation.scenes.units import UNITS
from validation.statistics import measures, structure
from validation.statistics.estimate import Estimate
from validation.trial import confirm, errors, law, lists, report, targets, timed, trial, turns


def test_temperatures_of_bodies_are_those_they_were_given(tmp_path):
    """Locks out degrees of freedom that are counted wrongly: bodies with velocities drawn for a
    temperature have it, in translation and in rotation."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    random, kelvin, frames = np.random.default_rng(1), 250.0, 400
    made = shapes.bodies(own)
    (group,), (r,), (moments,), (axes,) = made.groups, made.apart, made.moments, made.axes
    scale = own.said["boltzmann"] * kelvin / shapes.mvv2e(own)
    mass = own.atoms["mass"]
    centre = random.normal(size=(frames, len(group), 3)) * np.sqrt(scale / mass[group[0]].sum())
    spin = random.normal(size=(frames, len(group), 3)) * np.sqrt(
        np.where(moments > 1e-6 * moments[:, :1], scale / np.maximum(moments, 1e-12), 0.0)
    )
    omega = np.einsum("bik,fbk->fbi", axes, spin)
    v = np.zeros((frames, len(mass), 3))
    v[:, group] = centre[:, :, None] + np.cross(omega[:, :, None], r)
    x = np.broadcast_to(own.atoms["x"], v.shape)
    cells, periodic = np.array([own.said["cell"]] * frames), np.array([True] * 3)
    positions = run.Positions(x, own.found.body, cells, periodic, v=v, mass=mass)
    rest = shapes.freedom_of_turning(own)
    assert rest == 2 * own.bodies  # of linear ones
    moving, turning = errors._temperatures(own, structure.Motion(positions), range(frames), rest)
    assert moving.mean() == pytest.approx(kelvin, rel=0.01)
    assert turning.mean() == pytest.approx(kelvin, rel=0.01)


def test_numbers_are_of_what_counts_of_a_run(tmp_path):
    """Locks out the energy of the atoms in the place of the one that is to be kept, and frames from
    before the part that counts."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    random, frames, first = np.random.default_rng(1), 40, 10
    mass, body = own.atoms["mass"], own.found.body
    v = np.tile(random.normal(size=(len(mass), 3)), (1 + frames, 1, 1))
    v[: 1 + first] *= 3.0
    x = np.broadcast_to(own.atoms["x"], v.shape)
    cells, periodic = np.array([own.said["cell"]] * len(v)), np.array([True] * 3)
    positions = run.Positions(x, body, cells, periodic, v=v, mass=mass)
    thermo = dict.fromkeys(("PotEng", "KinEng", "Temp", "TotEng", "Density"), np.ones(1 + frames))
    thermo |= {"Step": np.arange(1.0 + frames), "Econserve": np.arange(1.0 + frames)}
    rest = shapes.freedom_of_turning(own)
    result = SimpleNamespace(positions=positions, thermo=thermo)
    found = errors.numbers(own, 1.0, result, first / frames, rest)
    np.testing.assert_array_equal(found["conserved"], np.arange(first, 1.0 + frames))
    motion = structure.Motion(positions)
    (moving,), (turning,) = errors._temperatures(own, motion, [frames], rest)
    kelvin = shapes.temperature(own)
    assert found["kinds"][0].value == pytest.approx((moving - turning) / kelvin, rel=1e-9)


def test_the_temperature_that_may_be_furthest_off_counts():
    """Locks out a difference that is small and hardly known, beside a larger one that is known."""
    kinds = [Estimate(0.01, 1e-4), Estimate(0.005, 0.02)]
    found = errors.of_means(None, 1.0, {1.0: {"kinds": kinds}}, None, 0.0)
    assert found["temperature"].value == 0.005


def test_a_run_whose_energy_is_no_number_has_failed(tmp_path):
    """Locks out a run without numbers that counts as one."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    thermo = {"Step": np.arange(3.0), "Temp": np.full(3, shapes.temperature(own))}
    for energies, failed in ([1.0, 1.0, 1.0], False), ([1.0, np.nan, 1.0], True):
        result = SimpleNamespace(error=None, thermo=thermo | {"TotEng": np.array(energies)})
        assert (trial.failure(own, result) is not None) == failed


def test_fastest_motions(tmp_path):
    """Locks out torques about other axes than those of the moments, and mean squares of vectors in
    the place of their components': with forces that are known the frequencies are."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    body = own.found.body.copy()
    body[body == body.max()] = 0
    own = replace(own, found=replace(own.found, body=body))
    made = shapes.bodies(own)
    (group,), (r,), (moments,), (axes,) = made.groups, made.apart, made.moments, made.axes
    force, torque = np.zeros_like(own.atoms["x"]), 3.0 * axes[:, None, :, 0]
    force[group] = np.cross(torque, r) / (r**2).sum(axis=(1, 2))[:, None, None]
    force[body == 0] = 2.0
    own = replace(own, atoms=own.atoms | {"f": force})
    found, unit = shapes.fastest(own, made), shapes.thermal(own) * shapes.mvv2e(own)
    assert found["turning"] == pytest.approx(3.0 / np.sqrt(moments[:, 0].mean() * unit))
    free = own.atoms["mass"][body == 0].min()
    assert found["other atoms"] == pytest.approx(2.0 / np.sqrt(free * unit))


def test_an_advised_step_bears_out_by_itself():
    """Locks out a verdict on the advised step that is that of the longer one beside it, which need
    not do."""
    some = [
        {"failed": None, "uncounted": None, "errors": {"energy": Estimate(value, 1e-3).plain()}}
        for value in (0.1, 9.0)
    ]
    assert confirm.holds({"targets": {"energy": 0.2}, "confirmed": {"points": some}}) is True


def test_steps_behind_one_that_fails_are_left_out():
    """Locks out the time for a step that is longer than one that has failed."""
    short, long, other = trial.Point("a", 1.0), trial.Point("a", 2.0), trial.Point("b", 2.0)
    jobs = dict.fromkeys((short, long, other))
    failed = {short: "it heats"}
    assert trial._skipped(None, long, jobs, failed)
    assert not trial._skipped(None, other, jobs, failed)


def test_targets_are_those_that_a_script_has(tmp_path):
    """Locks out a target that says nothing of a script, one that is not known, and a barostat
    whose work counts as unknown: econserve has it, with each of ours."""
    lines = "compute t all temp/sphere\nthermo_modify temp t"
    spheres = take(scripts.spheres(tmp_path, lines), tmp_path / "out1")
    assert set(targets.targets(spheres, {})) == {"drift", "energy", "rdf"}
    assert any("moments of inertia of their own" in one for one in spheres.notes)
    co2 = take(scripts.co2(tmp_path), tmp_path / "out")
    assert set(targets.targets(co2, {})) == {"drift", "energy", "temperature", "density", "rdf"}
    assert targets.targets(co2, {"drift": 1.0})["drift"] == 1.0
    with pytest.raises(LookupError, match="there is no target speed"):
        targets.targets(co2, {"speed": 1.0})
    spce = take(scripts.spce(tmp_path), tmp_path / "out2")
    found = targets.targets(spce, {"energy": 0.1})
    assert found["energy"] == 0.1 and found["drift"] == targets.HEATED
    assert "density" not in found
    path = scripts.rings(tmp_path)
    rings = take(path, tmp_path / "out3")
    assert "energy" not in targets.targets(rings, {})  # fix langevin stays
    with pytest.raises(LookupError, match="drift says nothing of this script"):
        targets.targets(rings, {"drift": 1.0})
    text = path.read_text().replace("timestep 4", "unfix heat\ntimestep 4")
    path.write_text(text)
    assert "energy" in targets.targets(take(path, tmp_path / "out3"), {})
    press = "unfix heat\nfix press all press/berendsen iso 1 1 1000\ntimestep 4"
    path.write_text(text.replace("unfix heat\ntimestep 4", press))
    assert "energy" not in targets.targets(take(path, tmp_path / "out3"), {})  # as this one does


def test_energies_that_other_fixes_give_and_nobody_counts(tmp_path):
    """Locks out a drift that is the work of a wall, whose energy LAMMPS counts only if it is asked
    to; and one that is asked for and then left out."""
    path = scripts.clusters(tmp_path)
    own = take(path, tmp_path / "out")
    assert counted.acting(own) == ["wall"] and not counted.lacking(own)
    assert {"drift", "energy"} <= set(targets.targets(own, {}))
    path.write_text(path.read_text().replace("fix_modify wall energy yes\n", ""))
    own = take(path, tmp_path / "out")
    assert counted.lacking(own) == ["wall"]
    assert set(targets.targets(own, {})) == {"temperature"}
    with pytest.raises(LookupError, match="what fix wall does to the energy is not counted"):
        targets.targets(own, {"drift": 1.0})
    for commands, asked in (
        (["fix a all indent", "fix_modify a energy yes"], {"a"}),
        (["fix_modify a energy yes", "fix a all indent"], set()),
        (["fix_modify a virial yes energy yes", "fix_modify a energy no"], set()),
    ):
        assert counted._asked(commands) == asked


def test_targets_of_bodies_at_rest_are_refused(tmp_path):
    """Locks out runs of some minutes that end in a division by zero, for nothing moves."""
    path = tmp_path / "in.rest"
    path.write_text(GAS + "fix 1 a rigid/nve  single\nrun  1\n")
    with pytest.raises(LookupError, match="the atoms are at rest at 'run 1'"):
        targets.targets(take(path, tmp_path / "out"), {})


@pytest.mark.parametrize("held", [0.0, 1.0])
@pytest.mark.parametrize("size", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("part", [-0.05, -0.02, -0.005, 0.0, 0.005, 0.02])
def test_error_bars_from_longer_steps_cover(part, size, held):
    """Locks out error bars that are right for an exact square law only: with one power they cover
    in 10 to 50 % of cases where the fourth power is 5 to 20 % of the error at the longest step.

    Args:
        part: the fourth power's over the second's, of a step of 1: at 6 it is 36 times that.
        size: the error at 1, in error bars of a run.
        held: the error bar of the reference, which is a run with half of the step; 0 for none.
    """
    random, finer = np.random.default_rng(3), 0.5 if held else 0.0

    def run(dt, error=1.0):
        return Estimate(size * dt**2 * (1 + part * dt**2) + error * random.normal(), error)

    covered, steps = {1.0: [], 2.0: [], 3.0: []}, (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
    for _ in range(300):
        against = run(finer, held)
        found = {dt: run(dt) for dt in steps} | ({finer: against} if held else {})
        for dt, own in covered.items():
            one = law.by_law(dt, found, against, finer)
            own.append(abs(one.value - size * dt**2 * (1 + part * dt**2)) < one.margin)
    assert min(map(np.mean, covered.values())) > 0.89


def test_longer_steps_tell_the_error_of_shorter_ones():
    """Locks out longer steps that tell nothing, one whose error has grown faster, and an error that
    no step makes smaller and passes for a small one."""
    exact = {dt: Estimate(5.0 + 0.1 * dt**2, 0.05) for dt in (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)}
    one, held = law.by_law(1.0, exact, Estimate(5.0, 0.02)), Estimate(5.0, 0.02)
    assert one.value == pytest.approx(0.1)
    assert one.margin < 0.9 * measures.difference(exact[1.0], held).margin
    squares = {dt: Estimate(0.1 * dt**2, 0.01) for dt in (1.0, 2.0)}
    grown = law.by_law(1.0, squares | {4.0: Estimate(9.0, 0.01)})
    assert grown.value == pytest.approx(0.1, abs=0.005)
    same = {dt: Estimate(0.1, 0.01) for dt in (1.0, 2.0, 4.0)}
    assert law.by_law(1.0, same).value == pytest.approx(0.1, abs=0.005)
    longest = law.by_law(4.0, squares | {4.0: Estimate(9.0, 0.01)})
    assert longest.value == pytest.approx(9.0)  # not from shorter ones
    # held against a step of the same integrator, which has a part of the error itself
    for steps in (2.0,), (2.0, 4.0):
        errors = {dt: Estimate(0.1 * dt**2, 0.01) for dt in steps}
        assert law.by_law(2.0, errors, Estimate(0.1), 1.0).value == pytest.approx(0.4)
    still = {dt: Estimate(1.0) for dt in (1.0, 2.0)}
    assert law.by_law(1.0, still, Estimate(1.0)).value == 0.0


def pole(dt):
    """An error whose powers are all alike at a step of 7, where the integrator ends."""
    return dt**2 / (1 - (dt / 7) ** 2)


@pytest.mark.parametrize("size", [0.3, 2.0, 10.0, 30.0])
def test_error_bars_cover_near_the_end_of_stability(size):
    """Locks out a longest step whose error has grown faster than a series of few powers, within
    what chi-squared sees, and that passes for what is told of shorter ones."""
    random, covered = np.random.default_rng(5), {1.0: [], 2.0: [], 3.0: []}
    for _ in range(300):
        means = {
            dt: size * pole(dt) + random.normal() for dt in (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
        }
        found = {dt: Estimate(mean, 1.0) for dt, mean in means.items()}
        for dt, own in covered.items():
            one = law.by_law(dt, found, found[0.5], 0.5)
            own.append(abs(one.value - size * pole(dt)) < one.margin)
    assert min(map(np.mean, covered.values())) > 0.92


@pytest.mark.parametrize("size", [0.0, 5.0, 10.0, 20.0])
def test_errors_that_no_step_makes_smaller_are_seen(size):
    """Locks out an error that is the same at all steps, as a thermostat's or a common start's, and
    is taken for powers of the step that vanish at short ones."""
    random, covered = np.random.default_rng(6), {1.0: [], 2.0: [], 3.0: []}
    for _ in range(300):
        found = {
            dt: Estimate(size + 0.02 * dt**2 + random.normal(), 1.0)
            for dt in (1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
        }
        for dt, own in covered.items():
            one = law.by_law(dt, found)
            own.append(abs(one.value - size - 0.02 * dt**2) < one.margin)
    assert min(map(np.mean, covered.values())) > 0.9
    unseen = [law.by_law(1.0, {dt: Estimate(1.0, 1.0) for dt in (1.0, 2.0, 3.0, 4.0)})]
    assert abs(unseen[0].value) < 0.2  # what may be noise is no error of the step


def test_error_bars_cover_where_the_error_changes_its_sign():
    """Locks out higher powers that are taken for small because they cancel the square at the
    longest step."""
    random, above = np.random.default_rng(8), []
    for _ in range(400):
        means = {dt: dt**2 - dt**4 / 36 + random.normal() for dt in (0.5, 1, 1.5, 2, 3, 4, 6)}
        found = {dt: Estimate(mean, 1.0) for dt, mean in means.items()}
        for dt in (1, 2, 3):
            one = law.by_law(dt, found, found[0.5], 0.5)
            above.append(dt**2 - dt**4 / 36 > one.value + one.margin)
    assert np.mean(above) < 0.06


def test_a_law_of_what_is_not_finite_or_single():
    """Locks out a trial that ends in an error of linear algebra, for one run tells nothing."""
    one, lost = Estimate(1.0, 0.1), Estimate(1.0, np.inf)
    assert law.by_law(2.0, {2.0: one}).value == 1.0
    assert law.by_law(2.0, {2.0: lost}) is None
    found = {2.0: one, 3.0: lost, 4.0: one, 6.0: one}
    assert np.isfinite(law.by_law(2.0, found).margin)
    assert law.by_law(2.0, found, lost, 1.0).margin == np.inf
    near = {1.0: one, 1.0000001: one}
    assert abs(law.by_law(1.0, near, one, 1.0).value) < 1e8  # nothing to tell it from


@pytest.mark.parametrize("grows", ["square", "less", "more", "pole"])
@pytest.mark.parametrize("size", [0.0002, 0.002, 0.01])
def test_error_bars_of_g_from_longer_steps_cover(size, grows):
    """Locks out a g(r) of a short step that is told by its own run alone, whose noise hides the
    error; and error bars that do not cover."""
    error = {
        "square": lambda dt: dt**2,
        "less": lambda dt: dt**2 * (1 - 0.02 * dt**2),
        "more": lambda dt: dt**2 * (1 + 0.02 * dt**2),
        "pole": pole,
    }[grows]
    random, finer, blocks, bins = np.random.default_rng(7), 0.5, 20, 40
    shape = np.sin(np.linspace(0, 9, bins))
    shape *= size / np.sqrt(np.mean(shape**2))
    covered, reach = {1.0: [], 2.0: [], 3.0: []}, []
    for _ in range(100):
        g = {
            dt: error(dt) * shape + 0.05 * random.normal(size=(blocks, bins))
            for dt in (finer, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
        }
        for dt, own in covered.items():
            one = law.rms_by_law(dt, g, g[finer], finer)
            own.append(one is not None and abs(one.value - size * error(dt)) < one.margin)
        alone = law.rms_by_law(1.0, {dt: g[dt] for dt in (finer, 1.0)}, g[finer], finer)
        together = law.rms_by_law(1.0, g, g[finer], finer)
        reach.append([one.value + one.margin for one in (together, alone)])
    assert min(map(np.mean, covered.values())) > 0.88
    assert np.median(np.divide(*zip(*reach))) < 0.9


@pytest.mark.parametrize(
    "steps", [(0.5, 1.0), (0.5,), (0.5, 1.0, 2.0, 4.0), (1.0, 2.0, 4.0), (2.0,)]
)
def test_steps_around_that_of_the_reference_have_their_own_errors(steps):
    """Locks out an error with the wrong sign, none, or an error bar that does not cover, of steps
    that are shorter than that of the reference, and of the reference's own."""
    random, finer, covered = np.random.default_rng(11), 1.0, []
    for _ in range(400):
        means = {dt: Estimate(3.0 + 0.1 * dt**2 + 0.02 * random.normal(), 0.02) for dt in steps}
        means.setdefault(finer, Estimate(3.1 + 0.02 * random.normal(), 0.02))
        for dt in means:
            one = law.by_law(dt, means, means[finer], finer)
            covered.append(abs(one.value - 0.1 * dt**2) < one.margin)
    assert np.mean(covered) > 0.92
    exact = {dt: Estimate(3.0 + 0.1 * dt**2, 0.01) for dt in {*steps, finer}}
    for dt in exact:
        one = law.by_law(dt, exact, exact[finer], finer)
        assert one.value == pytest.approx(0.1 * dt**2)
    assert law.by_law(finer, {finer: exact[finer]}, exact[finer], finer) is None
    # g(r) alike: errors 0.1 dt^2 in each bin, with noise
    g = {dt: 0.1 * dt**2 + 1e-4 * random.normal(size=(10, 50)) for dt in exact}
    for dt in exact:
        one = law.rms_by_law(dt, g, g[finer], finer)
        assert one.value == pytest.approx(0.1 * dt**2, rel=0.01)
    assert law.rms_by_law(finer, {finer: g[finer]}, g[finer], finer) is None


def energies(own, series, apart):
    """What is made of a series of the energy, with samples so far apart."""
    time = apart * np.arange(len(series))
    return errors._of_energy(own, {"time": time, "conserved": series, "kinetic": 2.0, "freedom": 9})


@pytest.mark.parametrize("kind", ["rings", "spce"])
def test_the_energys_change_is_what_is_said_of_it(kind, taken):
    """Locks out a number that depends on how often the energy is looked at, which errors of some
    steps vanish from, or on the length of the run, which the wander at a cutoff grows with."""
    own = taken(kind)
    step = own.scene.dt
    span = targets.SPAN * step
    random = np.random.default_rng(2)
    walk = np.cumsum(random.normal(size=400_000)) / np.sqrt(targets.SPAN)  # a variance of 1 in it
    angle = np.cumsum(0.2 * random.normal(size=len(walk)))  # forgotten in about 50 steps
    energy = walk + np.sqrt(2) * np.sin(angle) + random.normal(size=len(walk))
    for stride in (1, 12, 48, 96):
        for part in (1, 10):
            found = energies(own, energy[: len(energy) // part : stride], stride * step)["energy"]
            forgotten = 1 - np.exp(-0.02 * targets.SPAN)
            right = np.sqrt(0.5 + forgotten + 1) / 2.0
            assert abs(found.value - right) < 2 * found.margin < 0.3
    about = targets.about(own, {"energy": 0.2, "drift": 1.0})
    assert f"kept in {span:g} fs, rms" in about["energy"]["what"]
    heated = kind == "spce"
    usual = targets.HEATED if heated else 0.01  # the page says it, too
    assert about["drift"]["default"] == usual


@pytest.mark.parametrize("long", [1200.0, 4e4, 1e6, 1e8])
def test_samples_of_the_energy_are_equally_apart(long):
    """Locks out samples whose distance depends on the step, on the budget, or differs within a
    run; and runs that are longer or shorter than was planned."""
    for frames in 20, 200, 1000:
        lengths = trial.Lengths(time=long, frames=frames, dt=2.0)
        for factor in (0.5, *trial.FACTORS):
            dt = 2.0 * factor
            every, runs = lengths.every(dt), lengths.runs(dt)
            assert all(one % every == 0 for one in runs) and len(set(runs)) == 1
            if long >= targets.SPAN * 2.0 * frames:
                assert sum(runs) * dt == pytest.approx(long, rel=0.1)
                span = targets.SPAN * 2.0 / (every * dt)
                assert span == pytest.approx(round(span)) and 1 <= round(span) <= 8
            assert 1 <= len(runs) <= frames


def test_parts_of_a_run_that_are_not_independent_make_no_error_of_g_smaller():
    """Locks out a step that is advised for a g(r) whose noise was taken for less than it is: of
    as many parts as a run is cut into, neighbours correlated, the bound holds as often as it
    says."""
    random, bins, true = np.random.default_rng(4), 50, 0.02
    held = []
    for _ in range(400):
        noise = random.normal(size=(errors.BLOCKS + 1, bins))
        off = true + 0.04 * (noise[1:] + 0.6 * noise[:-1])  # neighbours: 0.44
        found = measures.without_noise(off)
        held.append(true <= found.value + found.margin)
    assert np.mean(held) > 0.97


SLOW = {  # noise of g(r) in a 20th of a run: fast, slow, and how many of these the slow one lasts
    "fast": (0.05, 0.0, 1.0),
    "a part": (0.0, 0.05, 1.0),
    "half of the run": (0.0, 0.05, 10.0),
    "the run": (0.0, 0.05, 20.0),
    "longer than the run": (0.0, 0.05, 1000.0),
    "a quarter, hidden by fast noise": (0.05, 0.03, 5.0),
    "the run, hidden by fast noise": (0.05, 0.03, 20.0),
    "longer, hidden by fast noise": (0.05, 0.03, 1000.0),
}
STEPS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0), (1.0, 2.0, 3.0), (1.0, 2.0)


def of_runs(random, noise, steps=STEPS[0], bias=0.0, trend=0.0, parts=errors.BLOCKS, bins=40):
    """Of runs with several steps what `errors.of_g` takes: g(r) of successive parts, whose noise is
    autoregressive.

    Args:
        noise: as in `SLOW`.
        bias: rms error of g(r) at a step of 1, which grows as the square.
        trend: of the potential energy, in its error bars.
    """
    shape = np.sqrt(2) * np.sin(np.linspace(0, 6 * np.pi, bins, endpoint=False))
    fast, slow, time = noise
    kept = np.exp(-1 / time)

    def one(dt):
        series = random.normal(size=(parts, bins))
        for k in range(1, parts):
            series[k] = kept * series[k - 1] + np.sqrt(1 - kept**2) * series[k]
        off = fast * random.normal(size=(parts, bins)) + slow * series
        settling = Estimate(trend + random.normal(), 1.0)
        return {"rdf": 1 + bias * dt**2 * shape + off, "settling": settling}

    return {dt: one(dt) for dt in steps}


def verdicts(runs, target=0.02):
    """Of each step whether its g(r) is within a target, and the estimates."""
    first, *steps = runs
    found = {dt: errors.of_g(dt, runs, runs[first], first)[0] for dt in steps}
    rows = [
        {"failed": None, "errors": {"rdf": one.plain()} if one else {}} for one in found.values()
    ]
    return dict(zip(found, (meets(row, {"rdf": target}) for row in rows))), found


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("noise", SLOW)
def test_noise_is_no_error_of_g(noise, steps):
    """Locks out "no step is within the targets" from the noise of runs that are as short as a few
    correlation times of g(r), or shorter: its parts look independent, and differ from the
    reference's by chance."""
    random, wrong, told = np.random.default_rng(12), [], []
    for _ in range(50):
        found, _ = verdicts(of_runs(random, SLOW[noise], steps))
        wrong.append([one is False for one in found.values()])
        told += [one is not None for one in found.values()]
    assert np.mean(wrong) < 0.03 and not np.all(wrong, axis=1).any()
    if noise == "fast":  # these runs are long enough
        assert np.mean(told) > (0.9 if len(steps) > 3 else 0.3)
    if "run" in noise and len(steps) > 2:
        assert np.mean(told) < 0.06


@pytest.mark.parametrize("noise", ["fast", "a part"])
def test_an_error_of_g_that_grows_with_the_step_is_found(noise):
    """Locks out a real error that is taken for noise: it is 0.005 at a step of 1, and within 0.02
    up to a step of 2."""
    random, covered, long, short = np.random.default_rng(13), [], [], []
    for _ in range(50):
        found, each = verdicts(of_runs(random, SLOW[noise], bias=0.005))
        long += [found[4.0] is False, found[6.0] is False]
        short.append(found[1.0] is not False)
        covered += [abs(one.value - 0.005 * dt**2) < one.margin for dt, one in each.items() if one]
    assert np.mean(long) > 0.9 and np.mean(short) > 0.95 and np.mean(covered) > 0.9


@pytest.mark.parametrize("time", [0.5, 1.0, 2.0, 3.0])
def test_parts_of_correlated_runs(time):
    """Locks out error bars that take correlated parts of a run for independent ones: against the
    known variance of the mean of an autoregressive series."""
    random, parts = np.random.default_rng(15), 20
    apart = np.abs(np.subtract.outer(np.arange(parts), np.arange(parts)))
    exact = np.exp(-apart / time).mean()
    numbers, ratios, seen = [], [], []
    for _ in range(100):
        runs = [one["rdf"] for one in of_runs(random, (0.0, 1.0, time), STEPS[1]).values()]
        number, variance = measures.parts_of_runs(runs)
        numbers.append(number)
        ratios.append(variance / exact)
        made = measures.independent(runs, int(number), variance)
        assert all(np.allclose(one.mean(axis=0), own.mean(axis=0)) for one, own in zip(made, runs))
        seen.append(np.mean([one.var(axis=0, ddof=1).mean() / len(one) for one in made]) / variance)
    assert np.allclose(seen, 1.0)
    assert 0.6 < np.median(ratios) < 1.1
    assert np.median(numbers) == pytest.approx(1 / exact, rel=0.3)


def test_no_verdict_on_a_structure_that_is_settling_or_does_not_follow_the_step():
    """Locks out a verdict on g(r) where the start was not in equilibrium, and where a short step is
    further off than a longer one."""
    random = np.random.default_rng(14)
    for trend, told in (0.0, 0), (10.0, 50):
        runs = [of_runs(random, SLOW["fast"], bias=0.005, trend=trend) for _ in range(50)]
        found = [errors.of_g(2.0, one, one[0.5], 0.5)[1] for one in runs]
        assert abs(sum(one is not None and one.why == errors.SETTLING for one in found) - told) < 5
    runs = of_runs(random, SLOW["fast"], STEPS[1])  # as seen: 0.050 at 2 fs, 0.014 at 3 fs
    runs[2.0]["rdf"] += 0.05 * np.sqrt(2) * np.sin(np.arange(40))
    error, untold = errors.of_g(2.0, runs, runs[1.0], 1.0)
    assert error is None and untold.why == errors.ERRATIC
    assert untold.plain(0.025)["longer"] == pytest.approx((3 * 0.05 / 0.025) ** 2, rel=0.2)


def test_what_is_said_of_a_structure_that_is_not_told():
    """Locks out an answer that does not say why there is none of g(r), and what to do."""
    short = "Runs of 100 fs are shorter than 10 correlation times of g(r), so it cannot be decided."
    noise = "With 2, 3 fs the error of g(r) does not follow the step, so it is noise, and g(r)"
    for why, longer, said, then in (
        (errors.SHORT, 4.0, f"{short} Runs of about 400 fs should tell.", "About --budget 20 "),
        (errors.SHORT, 1.2, f"{short} Runs of about 200 fs should tell.", "About --budget 10 "),
        (errors.ERRATIC, 25.0, f"{noise} cannot be decided. Runs of about 2500", "--budget 120 "),
        (errors.ERRATIC, 1e4, f"{noise} cannot be decided.", "try about --budget 50 first"),
        (errors.SETTLING, None, "The start is not in equilibrium", "Give a target that short"),
    ):
        rows = [row(dt, energy=Estimate(0.1, 0.01)) for dt in (2.0, 3.0)]
        for one in rows:
            one["untold"] = {"why": why, "longer": longer}
        _, told, lines = report.answer(summary_of({"energy": 0.2, "rdf": 0.03}, *rows))
        assert told[0].startswith(said) and not lines
        assert then in told[1] and "No step" not in " ".join(told)
        assert any("Nothing is known of g(r). But for that" in one for one in told)


def test_integrators_whose_energy_says_nothing(taken):
    """Locks out a drift of rigid/nvt that is LAMMPS's bookkeeping, and such an integrator that is
    "not met" by it, or advised without a word."""
    own = taken("spce")
    wrong = {name for name, one in own.integrators.items() if counted.wrongly(one)}
    assert wrong == {"rigid/nvt", "rigid/nvt/small"}
    yours = Integrator("yours", "yours", ("fix 1 {group} rigid/small molecule langevin 1 1 1 5",))
    assert counted.wrongly(yours)
    random = np.random.default_rng(4)
    series = {"time": 16.0 * np.arange(500), "conserved": random.normal(size=500)}
    series |= {"kinetic": 1.0, "freedom": 9, "kinds": []}
    for name, one in own.integrators.items():
        found = errors.errors(own, one, 2.0, {2.0: series}, None, 0.0)
        assert set(found) == (set() if name in wrong else {"drift", "energy"})
    wanted = {"drift": 1.0, "temperature": 0.01}
    good = row(4.0, drift=Estimate(0.1, 0.01), temperature=Estimate(0.001, 1e-4))
    lost = row(6.0, name="rigid/nvt", temperature=Estimate(0.001, 1e-4))
    lost |= {"uncounted": True, "cost": measures.spread([0.5])}
    choice, told, _ = report.answer(summary_of(wanted, good, lost))
    assert choice.best == good
    (first, second) = told[-2:]
    assert "Of rigid/nvt nobody knows drift: LAMMPS's econserve" in first
    assert "But for that, rigid/nvt with 6 fs is within the targets" in second
    longest, _ = report.tables(summary_of(wanted, good, lost))
    assert [one[-1].text for one in longest.rows] == ["met", "met by the rest"]
    choice, told, _ = report.answer(summary_of(wanted, lost))
    assert choice.best is None and told == [first, second]


def test_a_cost_is_one_number():
    """Locks out a second number in brackets, of which nobody says what it is."""
    timed = row(4.0, cost=(1.5, 1.25, 2.0), drift=Estimate(0.1, 0.01)) | {"rough": None}
    summary = summary_of({"drift": 1.0}, timed)
    longest, _ = report.tables(summary)
    assert (longest.columns[2], longest.rows[0][2].text) == ("s per ns", "1.25")
    assert "4 fs: 1.25 s per ns" in report.answer(summary)[1][0]


def row(dt, name="nosquish", cost=(1.0,), **errors):
    """A row of a trial."""
    spent, told = measures.spread(cost), {name: one.plain() for name, one in errors.items()}
    return {
        **{"integrator": name, "label": name, "dt": dt, "lines": [f"fix {name}"], "failed": None},
        **{"is_reference": False, "asked": True, "uncounted": False, "ours": name == "nosquish"},
        **{"cost": spent, "rough": spent, "signed": {}},
        **{"errors": told, "by_itself": told, "time": 100.0, "alone": False},
        **{"untold": None, "place": "In the place of fix 1 (nve)", "lost": []},
    }


def summary_of(targets, *rows):
    """A trial's summary."""
    summary = {"targets": targets, "points": list(rows), "units": "real", "late": False}
    return summary | {
        "ns": "ns",
        "ranks": 1,
        "minutes": 5.0,
        "level": 0.95,
        "time": 100.0,
        "dt": 2.0,
    }


def test_the_reference_is_advised_if_its_step_was_asked_for():
    """Locks out the command that is advised where no step is short enough, and that cannot find
    ours good at the step of the reference; and one that is advised and was not asked for."""
    held = row(1.0, drift=Estimate(0.1, 0.01)) | {"is_reference": True}
    wanted = {"drift": 1.0}
    choice, _, lines = report.answer(summary_of(wanted, held))
    assert choice.best == held and "timestep 1" in lines
    longest, every = report.tables(summary_of(wanted, held))
    assert every.rows[0][-1].text == "reference, met" and len(longest.rows) == 1
    choice, told, _ = report.answer(summary_of(wanted, held | {"asked": False}))
    assert choice.best is None and told == ["No run is complete, so nothing is known yet."]
    alone = report.answer(summary_of({"drift": 1.0, "rdf": 0.1}, held))[1]  # no other step
    assert "another step of the same integrator to tell rdf. But for that" in alone[1]
    assert not any("inf" in line for line in alone)


def test_a_trial_that_ends_before_its_first_run_says_so(capsys, tmp_path):
    """Locks out a traceback after a Ctrl-C while a step's time is measured."""
    summary = summary_of({"drift": 1.0}) | {"interrupted": True}
    assert report.show(console.console(), summary, tmp_path) is False
    said = capsys.readouterr().out
    assert "Interrupted: the same command goes on from here." in said


@pytest.mark.parametrize("unit", (1e-10, 1e-8, 1e-4, 1.0))
def test_g_is_the_same_in_each_unit_of_length(unit):
    """Locks out a g(r) of zeros, and an error of it that is zero, in units si and cgs, where a
    volume in single precision is none."""
    x = np.random.default_rng(1).uniform(0, 20, (40, 60, 3))
    cells = np.array([20 * np.eye(3)] * len(x))
    found = structure.of_sites(x * unit, cells * unit, (2.0 * unit, 9.5 * unit), 0.5 * unit)
    r = np.abs(x[:, :, None] - x[:, None])
    r = np.linalg.norm(np.minimum(r, 20 - r), axis=3)[:, np.triu(np.ones((60, 60), bool), 1)]
    edges = 2.0 + 0.5 * np.arange(16)
    ideal = r.size * 4 / 3 * np.pi * np.diff(edges**3) / 20**3
    np.testing.assert_allclose(found.mean(axis=0), np.histogram(r, edges)[0] / ideal, rtol=0.01)


def test_g_of_runs_with_other_numbers_of_parts_is_compared():
    """Locks out a g(r) that is left out, for one run has room for fewer frames than another."""
    random = np.random.default_rng(3)
    runs = [random.normal(size=(parts, 7)) for parts in (20, 13)]
    number, variance = measures.parts_of_runs(runs)
    assert 5 < number <= 13
    assert measures.parts_of_runs([runs[0][:1]]) == (1.0, np.inf)  # tells nothing
    for one, own in zip(measures.independent(runs, 10, variance), runs):
        assert one.shape == (10, 7) and np.allclose(one.mean(axis=0), own.mean(axis=0))


def test_what_is_timed_could_be_advised():
    """Locks out costs of points that could not be advised, and points that could and have none."""
    wanted = {"drift": 1.0}
    good, wide, bad = (Estimate(value, error) for value, error in ((0.1, 0.1), (0.9, 0.1), (9, 1)))
    rows = [
        row(1.0, cost=[4.0], drift=good),
        row(2.0, cost=[2.0], drift=good),
        row(4.0, cost=[1.0], drift=wide),
        row(8.0, cost=[0.5], drift=bad),
        row(2.0, name="rigid/nve", cost=[2.4], drift=good),
        row(2.0, name="rigid", cost=[3.0], drift=good),
    ]
    found = timed.candidates(summary_of(wanted, *rows))
    assert [(one["integrator"], one["dt"]) for one in found] == [
        ("nosquish", 4.0),
        ("nosquish", 2.0),
        ("rigid/nve", 2.0),
    ]
    many = [row(dt, cost=[1 / dt], drift=wide) for dt in range(1, 20)]
    assert len(timed.candidates(summary_of(wanted, *many))) == timed.FASTEST
    assert not timed.candidates(summary_of(wanted, row(1.0, drift=good) | {"asked": False}))


def test_what_is_timed_in_turn_is_done_by_one_process(taken, tmp_path, monkeypatch):
    """Locks out two processes of a folder that remove each other's runs while they time them, runs
    with samples, and work that is done again."""
    own = taken("rings")
    calls = []

    def in_turn(labels, make, number, meter):
        with Store(tmp_path / "out" / "records", "").locked(
            "timed", fcntl.LOCK_EX | fcntl.LOCK_NB
        ) as mine:
            assert not mine
        jobs = [make(name, 1) for name in labels]
        assert all("thermo 0" in job.commands and not job.body_property for job in jobs)
        calls.append([job.commands[-1] for job in jobs])
        return {name: [rounds.Timing(loop=2e6)] * number for name in labels}, {}, False

    monkeypatch.setattr(rounds, "in_turn", in_turn)
    ours = own.integrators["nosquish"]
    some = {"a": turns.Timed("a", ours, 2.0, [3, 40]),
            "b": turns.Timed("b", ours, 2.0, [3, 40], ("neighbor 1 bin",))}  # fmt: skip
    how = 3, tmp_path / "out", 1, 60.0, Silent()
    for _ in range(2):
        assert turns.loops(own, "timed", some, *how) == {"a": [2.0] * 3, "b": [2.0] * 3}
    assert calls == [["thermo 0", "neighbor 1 bin"]]
    turns.loops(own, "timed", {"a": some["a"]}, *how)
    assert len(calls) == 2


def test_lines_make_the_group_that_they_name(taken):
    """Locks out lines for the script that name a group that it does not have."""
    own = taken("solute")
    (group,) = own.found.setup
    held = trial.reference(own)
    done = {held: trial.Done("it heats", 1.0, [], {})}
    (found,) = trial.rows(own, [held], [held], done, {})
    assert found["lines"][0] == group and "own_bodies" in found["lines"][-1]


def test_units_are_lammpss():
    """Locks out a temperature that is a thousand times too low in units electron."""
    code = (
        "import json, sys\nfrom mpi4py import MPI\nfrom lammps import lammps\n"
        "lmp, found = lammps(cmdargs=['-log', 'none', '-screen', 'none']), {}\n"
        "for name in sys.argv[1:]:\n"
        "    lmp.command('clear')\n    lmp.command(f'units {name}')\n"
        "    found[name] = lmp.extract_global('mvv2e')\nprint(json.dumps(found))"
    )
    names = "real", "metal", "electron", "lj", "si", "cgs", "micro", "nano"
    words = [sys.executable, "-c", code, *names]
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == {
        name: shapes.MVV2E.get(name, 1.0) for name in names
    }


def test_each_units_drift_is_told_of_a_time_that_runs_have():
    """Locks out a drift per 1,000 s, or per 1,000 ns, which no run can tell: all but reduced units
    have the ns, of their own length."""
    second = {"fs": 1e-15, "ps": 1e-12, "ns": 1e-9, "µs": 1e-6, "s": 1.0}
    for style, units in UNITS.items():
        own = SimpleNamespace(scene=SimpleNamespace(units=style), units=units)
        steps = targets.steps_of_cost(own, 1.0)
        if style == "lj":
            assert (steps, targets.name_of_ns(own)) == (1000.0, "1,000 τ")
        else:
            assert steps * second[units.time] == pytest.approx(1e-9)
            assert targets.name_of_ns(own) == "ns"


def test_schemes_of_a_script_that_keep_the_momentum_are_known(taken, tmp_path):
    """Locks out a pressure that lacks kT over the volume where the momentum is kept at zero, and
    shares its limit with one that does not."""
    case = sample_scenes.of_script(taken("spce"))
    held = {name: scheme.held for name, scheme in case.schemes.items()}
    random = {"nosquish", "rigid/small+langevin"}
    assert random < set(held) and {"nosquish-csvr", "nosquish-nh", "rigid/nvt", "shake"} < set(held)
    assert held == {name: 0 if name in random else 3 for name in held}
    path = scripts.spce(tmp_path)
    path.write_text(path.read_text().replace("timestep", "fix pull all addforce 0 0 0\ntimestep"))
    case = sample_scenes.of_script(take(path, tmp_path / "out"))
    assert {scheme.held for scheme in case.schemes.values()} == {0}


def test_what_short_runs_cannot_tell_is_said_and_the_rest_answered():
    """Locks out an answer that says nothing, because one target is below what runs so short can
    tell; and a budget that would not tell it."""
    one = row(4.0, "ours", drift=Estimate(0.0, 0.1), energy=Estimate(0.1, 0.01))
    errors, summary = one["errors"], summary_of({"drift": 0.02, "energy": 0.2}, one)
    choice, told, lines = report.answer(summary)
    assert choice.best is None and not lines
    assert "About --budget 29 tells" in told[0]  # ((1.96 + 0.84) * 0.1 / 0.02)^(2/3) times 5
    assert "cannot tell drift below 0.2. But for that, ours with 4 fs" in told[1]
    errors["drift"] = Estimate(0.01, 0.1).plain()  # noise
    assert "About --budget 29 tells" in report.answer(summary)[1][0]
    errors["drift"] = Estimate(0.014, 0.01).plain()  # noise is half of the square
    assert "About --budget 10 tells" in report.answer(summary)[1][0]
    errors["drift"] = Estimate(0.11, 0.1).plain()  # may be noise, if the step is within
    assert "About --budget 73 tells" in report.answer(summary)[1][0]
    errors["energy"] = Estimate(0.1, 0.2).plain()  # nor this
    assert not any("But for that" in line for line in report.answer(summary)[1])


def test_an_answer_by_energies_that_nobody_knows_says_what_to_do():
    """Locks out an answer that ends with what nobody knows, where the budget was over before ours
    ran; and a budget of years, from runs of a few samples."""
    some = {"temperature": Estimate(0.01, 0.01)}
    lost = row(4.0, "rigid/nvt", **some) | {"uncounted": True}
    summary = summary_of({"drift": 1.0, "temperature": 0.02}, lost) | {"late": True}
    choice, told, lines = report.answer(summary)
    assert choice.best is None and not lines and told[0].startswith("The budget was over before")
    assert told[1].startswith("Of rigid/nvt nobody knows drift")
    assert told[2] == "What follows is by temperature only."
    assert "About --budget 10 tells" in told[3] and told[-1].startswith("The nearest: rigid/nvt")
    assert report._minutes(summary) == 10
    lost["errors"]["temperature"] = Estimate(0.01, 0.1, 1).plain()
    assert "try about --budget 50 first" in report.answer(summary)[1][3]
    assert report._minutes(summary) is None
    (*_, last) = report.answer(summary | {"targets": {"drift": 1.0}})[1]
    assert last.startswith("Nothing else is a target")


def test_no_step_behind_a_bad_one_may_be_good():
    """Locks out an answer that asks for more minutes, where a shorter step is above a target for
    sure, so that no budget names the longer one; and a faster step of another integrator, of which
    there is no telling, that goes unsaid."""
    bad, open_ = row(1.0, drift=Estimate(1.5, 0.1)), row(2.0, drift=Estimate(0.9, 0.3))
    choice, told, _ = report.answer(summary_of({"drift": 1.0}, bad, open_))
    assert not choice.perhaps and told[0].startswith("No step that was tried is within the targets")
    good = row(0.5, drift=Estimate(0.1, 0.1))
    told = report.answer(summary_of({"drift": 1.0}, good, bad, open_))[1]
    assert "With 1 fs: too much of drift" in told[1] and "larger --budget" not in " ".join(told)
    other = row(1.0, "other", drift=Estimate(0.9, 0.3))
    told = report.answer(summary_of({"drift": 1.0}, good, bad, open_, other))[1]
    assert "As fast or faster, if they are within the targets: other, 1 fs." in told
    other["cost"] = None  # it was slower by its run, and is not timed
    told = report.answer(summary_of({"drift": 1.0}, good, bad, open_, other))[1]
    assert not any("As fast or faster" in line for line in told)


def test_a_step_near_one_that_fails_is_not_named():
    """Locks out a step with which bonds break, but so rarely that no run of some minutes sees it: a
    brush's was named that ended a run ten times as long."""
    good = Estimate(0.1, 0.1)
    fails = row(0.02, drift=good) | {"failed": "Bad FENE bond", "errors": {}}
    rows = [row(dt, cost=[1 / dt], drift=good) for dt in (0.005, 0.01, 0.015)]
    summary = summary_of({"drift": 1.0}, *rows, fails)
    choice, told, lines = report.answer(summary)
    assert choice.best == rows[1] and "timestep 0.01" in lines
    assert any(line.startswith("0.015 fs is too near to a step that fails") for line in told)
    assert [one["dt"] for one in timed.candidates(summary)] == [0.01]
    rows[2]["alone"] = True
    assert trial.chosen([*rows, fails], {"drift": 1.0}, 0.95).best == rows[1]
    other = row(0.0151, "other", cost=[50.0], drift=good)
    assert trial.chosen([*rows, fails, other], {"drift": 1.0}, 0.95).best == other
    assert not trial.near_failure([rows[1], row(0.015) | {"failed": "it heats"}])


def test_the_budget_that_tells_a_drift_is_what_a_longer_run_needs():
    """Locks out a budget that a slope does not need: its error goes as the length to -3/2."""
    rng, lengths = np.random.default_rng(5), (1000, 4000)
    short, long = (
        np.mean([measures.line_drift(np.arange(n), rng.normal(size=n)).margin for _ in range(20)])
        for n in lengths
    )
    one = row(4.0, "ours", drift=Estimate(0.0, short / 1.96))
    summary = summary_of({"drift": long}, one) | {"minutes": 100}
    assert 330 < int(re.search(r"--budget (\d+)", report.answer(summary)[1][0])[1]) < 480


def test_a_skin_is_advised_only_if_it_is_faster_in_each_round(tmp_path):
    """Locks out a skin that is as fast as the script's within the spread, a line for the script
    that is not the fastest skin's, and a skin that is not the last one of the script."""
    first = lists.Tried(command="neighbor 1 bin", median=1.0, min=1.0, max=1.0)
    mixed = lists.Tried(command="neighbor 1.5 bin", median=0.8, min=0.7, max=1.1)
    good = lists.Tried(command="neighbor 2 bin", median=0.9, min=0.85, max=0.95)
    assert lists.fastest([first, mixed]) is None
    assert lists.fastest([first, mixed, good]) == good
    summary = summary_of({}, row(8.0) | {"lines": ["fix 1"]}) | {"lists": [first, mixed, good]}
    _, told, lines = report.answer(summary)
    assert lines == ["fix 1", "timestep 8", "neighbor 2 bin"]
    assert any("0.90 (0.85 to 0.95)" in line for line in told)
    summary["lists"] = [first, mixed]
    _, told, lines = report.answer(summary)
    assert lines == ["fix 1", "timestep 8"] and any("not faster" in line for line in told)
    path = scripts.rings(tmp_path)
    own = take(path, tmp_path / "out")
    scene = replace(own.scene, setup=(*own.scene.setup, "neighbor 0.7 bin", "neighbor 1.4 multi"))
    assert lists.skin_of(own) == (2.0, "bin")
    assert lists.skin_of(replace(own, scene=scene)) == (1.4, "multi")


def test_energies_that_end_at_zero_leave_the_motion_and_show_a_drift(taken, tmp_path):
    """Locks out a shift that changes forces; and an energy that jumps at cutoffs, which hides what
    the integrator does to it."""
    own, told = taken("clusters"), []
    other = shifted.shifted(own, told.append)
    assert told == [other.notes[-1]] and "'pair_modify shift yes tail no' is added" in told[0]
    ours = next(one for one in own.integrators.values() if one.kind == "ours")
    ends, spreads = [], []
    for number, one in enumerate((own, other)):
        how: dict = {"dt": 0.001, "every": 10, "keeps": "motion"}
        result = run.run(run.job(one.scene, ours, tmp_path / str(number), [1000], **how))
        assert not result.error
        ends.append(result.positions.x[-1])
        spreads.append(np.std(result.thermo["TotEng"]))
    assert np.array_equal(*ends)
    assert spreads[1] < 0.1 * spreads[0]


def test_pair_energies_that_cannot_be_shifted(taken):
    """Locks out a shift that LAMMPS refuses, one that is there already, one that takes the tail
    from a barostat's pressure, one that changes what fix gcmc accepts, and one of no use, where
    nobody counts what a fix gives."""
    own = taken("clusters")

    def added(*commands, fixes=(), press=()):
        said = {"commands": commands, "fixes": dict(enumerate(fixes))}
        state = replace(own.found.state, press=press)
        one = replace(own, said=said, found=replace(own.found, state=state))
        made = shifted.shifted(one, tell=lambda note: None)
        return made.scene.then[len(own.scene.then) :]

    style, axis = "pair_style lj/cut 2.5", (("x", "1", "1", "1000"),)
    line = ("pair_modify shift yes tail no",)
    assert added(style) == added(style, press=axis) == line
    assert added() == added("pair_style none") == added("pair_style zero 3.0") == ()
    assert added(style, "pair_modify mix sixthpower shift yes") == ()
    other = "pair_style lj/cut/coul/cut 3.0"
    assert added(style, "pair_modify shift yes", other) == line
    # LAMMPS keeps what was said of a style that is set again
    assert added(style, "pair_modify shift yes", "pair_style lj/cut 3.0") == ()
    tail = style, "pair_modify tail yes mix arithmetic", "pair_style lj/cut 3.0"
    assert added(*tail) == line
    assert added(*tail, press=axis) == added(*tail, fixes=["fix p b nph iso 1 1 1000"]) == ()
    assert added("read_restart r", style) == line
    assert added("read_restart r", style, press=axis) == ()
    for fix in ("gcmc 100 0 5 0 29494 1.0 -0.5 0.1 mol ice", "press/berendsen iso 1 1 1000"):
        assert added(style, fixes=[f"fix g gas {fix}"]) == ()
    move = "fix m a python/move 'fix_nosquish.{} a molecule temp 1.0 steps 8 seed 4'"
    assert added(style, fixes=[move.format("HMC")]) == ()
    assert added(style, fixes=[move.format("NVT")]) == line
