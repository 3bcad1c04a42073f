"""The sweep: what is run and when not, and errors against values that are known."""

import dataclasses
import itertools
import shlex
from pathlib import Path

import numpy as np
import pytest
from conftest import Silent

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

import mdtraj
from scipy import constants
from scipy.spatial.transform import Rotation

from validation.running import run
from validation.scenes import SCENES
from validation.scenes import peptide as paper_peptide
from validation.scenes.integrators import SWEPT
from validation.statistics import structure as sweep_structure
from validation.statistics.measures import Estimate
from validation.sweep import errors as sweep_errors
from validation.sweep import measure as sweep
from validation.sweep import plan as sweep_plan
from validation.sweep.errors import Numbers

CELL = np.diag([20.0, 22.0, 24.0])
SHAPES = {  # one atom, two, three in a line, three, four
    1: np.zeros((1, 3)),
    2: np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.1]]),
    3: np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.2, 0.0, 0.0]]),
    4: np.array([[0.0, 0.0, 0.0], [0.9, 0.3, 0.0], [-0.3, 0.9, 0.2]]),
    5: np.array([[0.0, 0.0, 0.0], [1.1, 0.2, 0.1], [-0.4, 1.0, 0.3], [0.2, -0.5, 1.2]]),
}


def placed(seed):
    """Bodies of all `SHAPES` before and after known motions: (before, after, body of each atom,
    mass, distances, angles)."""
    random = np.random.default_rng(seed)
    before, after, bodies, masses, distances, angles = [], [], [], [], [], []
    for body, shape in enumerate([*SHAPES.values()] * 3, 1):
        mass = random.uniform(1.0, 16.0, len(shape))
        turn, centre = (
            Rotation.random(random_state=random),
            random.uniform(0.0, 20.0, 3) * (body % 2),
        )  # each other one is cut
        r = turn.apply(shape - mass @ shape / mass.sum())
        angle, shift = 10 ** random.uniform(-6, -0.5), random.normal(0.0, 0.01, 3)
        axis = random.normal(size=3)
        if (
            len(shape) in (2, 3) and np.linalg.matrix_rank(r, tol=1e-9) == 1
        ):  # its own axis turns by the angle only about one across it
            axis = np.cross(axis, r[0])
        before.append(centre + r)
        after.append(
            centre + shift + Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).apply(r)
        )
        bodies += [body] * len(shape)
        masses += list(mass)
        distances.append(np.linalg.norm(shift))
        angles += [angle] if len(shape) > 1 else []
    return (
        np.concatenate(before),
        np.concatenate(after),
        np.array(bodies),
        np.array(masses),
        np.array(distances),
        np.array(angles),
    )


def motion(x, bodies, mass, v=None, bonds=(), angles=()):
    """A `Motion` of frames ``x``, folded into the cell."""
    x = np.asarray(x) % np.diag(CELL)
    return sweep_structure.Motion(
        run.Positions(
            x,
            bodies,
            np.repeat(CELL[None], len(x), axis=0),
            np.ones(3, bool),
            np.zeros_like(x) if v is None else np.asarray(v),
            mass,
            np.array(bonds, int).reshape(-1, 2),
            np.array(angles, int).reshape(-1, 3),
        )
    )


@pytest.mark.parametrize("seed", range(8))
def test_distance_and_angle_from_a_reference(seed):
    """Locks out bodies compared where a periodic face cuts them, reflections taken for rotations,
    linear bodies' own axis, small angles lost."""
    before, after, bodies, mass, distances, angles = placed(seed)
    found = motion([before, after], bodies, mass)
    exact = before % np.diag(CELL)
    assert any(np.ptp(exact[bodies == body], axis=0).max() > 10 for body in bodies), (
        "no body is cut: nothing is checked"
    )
    assert found.distance(1, exact)[0] == pytest.approx(np.sqrt(np.mean(distances**2)), rel=1e-9)
    assert found.angle(1, exact)[0] == pytest.approx(np.sqrt(np.mean(angles**2)), rel=1e-7)
    for body in np.unique(bodies):  # each alone, so that the smallest angles count
        chosen = bodies == body
        if chosen.sum() > 1:
            alone = motion([before[chosen], after[chosen]], bodies[chosen], mass[chosen])
            expected = angles[
                np.sum([np.sum(bodies == other) > 1 for other in range(1, body)], dtype=int)
            ]
            assert alone.angle(1, exact[chosen])[0] == pytest.approx(expected, rel=1e-5, abs=1e-14)


def test_bond_and_angle_errors_are_the_largest():
    """Locks out a mean for the largest, bonds between bodies, and angles of bodies that fix shake
    cannot hold as a whole."""
    water = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    four = SHAPES[5] + 5.0
    start = np.concatenate([water, four])
    x = np.array([start, start, start])
    x[1, 1, 0] += 0.03  # a bond 0.03 longer
    x[2, 2] = [np.sin(0.02), np.cos(0.02), 0.0]  # an angle 0.02 smaller
    across = np.cross(four[1] - four[0], [0.0, 0.0, 1.0])
    x[2, 4] += (
        0.05 * across / np.linalg.norm(across)
    )  # an angle of a body of four: it does not count
    x[2, 3:] += 3.0  # all of a body
    found = motion(
        x,
        np.array([1, 1, 1, 2, 2, 2, 2]),
        np.ones(7),
        bonds=[[0, 1], [0, 2], [0, 3], [3, 4]],
        angles=[[1, 0, 2], [4, 3, 5]],
    )
    assert found.bond_error() == pytest.approx(0.03, rel=1e-9)
    assert found.angle_error() == pytest.approx(0.02, rel=1e-9)


def test_kinetic_energies_of_bodies_are_in_kcal():
    """Locks out wrong units, and bodies of other degrees of freedom among those of six."""
    x = np.concatenate([SHAPES[4], SHAPES[5] + 5, SHAPES[3] + 9])
    v = np.random.default_rng(2).normal(0.0, 0.01, (1, len(x), 3))
    mass = np.arange(1.0, len(x) + 1)
    found = motion([x], np.repeat([1, 2, 3], [3, 4, 3]), mass, v).kinetic(slice(None))
    joule = (
        0.5
        * mass[:3]
        @ (v[0, :3] ** 2).sum(axis=1)
        * constants.atomic_mass
        * (constants.angstrom / constants.femto) ** 2
    )
    assert found == pytest.approx(np.array([[joule * constants.N_A / 4184]]), rel=1e-6)


def test_helicity_of_a_helix_and_of_a_thread():
    """Locks out a peptide cut by a periodic face, and a helix that is lost and not seen."""
    helix = mdtraj.load(str(paper_peptide.PDB)).xyz[0] * 10
    thread = helix + np.linspace(0, 1, len(helix))[:, None] * [0.0, 0.0, 40.0]
    cell = np.diag([38.0, 38.0, 38.0])
    found = motion([helix, helix + 17.0, thread], np.zeros(len(helix), int), np.ones(len(helix)))
    found.cell, found.x = cell, np.array([helix, helix + 17.0, thread]) % 38.0
    kept = paper_peptide.helicity(found.x, found.cell, found.periodic)
    assert kept[:2] == pytest.approx([1.0, 1.0]) and kept[2] < 0.5


def result(energy=None, error=None, kinetic=10.0, step=None):
    """A run that left energies only."""
    energy = np.zeros(3) if energy is None else np.asarray(energy)
    step = np.arange(len(energy)) if step is None else step
    freedom = 30
    temperature = np.full(len(energy), 2 * kinetic / (freedom * sweep_errors.BOLTZMANN))
    return run.Result(
        error,
        {
            "Step": step,
            "TotEng": energy,
            "KinEng": np.full(len(energy), kinetic),
            "Temp": temperature,
        },
        [],
        None,
        {},
    )


def test_what_a_failure_is():
    """Locks out an explosion that LAMMPS survives, taken for a measurement; and an energy that
    merely fluctuates, taken for one."""
    allowed = 30 / 2 * sweep_errors.BOLTZMANN * 300
    assert sweep_errors.degrees_of_freedom(result()) == 30
    assert sweep_errors.failure(result([0.0, 0.9 * allowed, -0.9 * allowed]), 300.0) is None
    assert "step 2" in sweep_errors.failure(result([0.0, 0.0, 1.1 * allowed]), 300.0)
    assert "step 1" in sweep_errors.failure(result([0.0, np.nan, 0.0]), 300.0)
    assert sweep_errors.failure(result(error="ERROR: Lost atoms"), 300.0) == "ERROR: Lost atoms"


def test_a_point_has_the_larger_error():
    """Locks out errors of short runs that do not see what differs from start to start, and scatter
    of few starts that is small by chance."""
    assert sweep_errors.pooled([Estimate(1.0, 0.3), Estimate(1.0, 0.4)])[:2] == pytest.approx(
        (1.0, 0.25)
    )
    assert sweep_errors.pooled([Estimate(2.0, 0.1)])[:2] == pytest.approx((2.0, 0.1))
    apart = sweep_errors.pooled([Estimate(1.0, 0.3), Estimate(2.0, 0.4)])
    assert apart == pytest.approx((1.5, 0.5, 1)) and apart.margin == pytest.approx(
        0.5 * 12.706, rel=1e-3
    )  # by a table of Student's t


@pytest.mark.parametrize("starts", [2, 4])
def test_few_starts_have_an_honest_scatter(starts):
    """Locks out an interval from the scatter of two or four values that is called one of 95 %, and
    covers 83 or 90."""
    values = np.random.default_rng(1).normal(0.0, 1.0, (2000, starts))
    found = [sweep_errors.pooled([Estimate(value) for value in row]) for row in values]
    assert np.mean([abs(one.value) < one.margin for one in found]) == pytest.approx(0.95, abs=0.015)


STARTS = 4


def averages(limit, seed, chance=0.0):
    """A sweep's record and points of several schemes whose averages are limit + b dt^2, b the
    scheme's own, with noise and each start's chance."""
    random = np.random.default_rng(seed)
    swept = dataclasses.replace(sweep_plan.SWEEPS["water"], measures=("potential",))
    shared, bar = random.normal(0.0, chance, STARTS), np.hypot(0.01, chance)
    found = {}
    for name, slope in (
        ("nosquish", 0.02),
        ("rigid/nve", 0.05),
        ("matubayasi-nakahara", 3.0),
        ("rigid", -2.0),
    ):
        for dt in (1.0, 2.0, 3.0, 4.0, 8.0):
            value = (
                limit + slope * dt**2 + (5.0 if dt > 4 else 0.0) + (1.0 if abs(slope) > 1 else 0.0)
            )  # no law at long steps, or of what drifts
            found[sweep_plan.Point("water", SWEPT[name], dt)] = [
                Numbers({"potential": Estimate(value + chance + noise, bar)})
                for chance, noise in zip(shared, random.normal(0.0, 0.01, STARTS))
            ]
    return swept, found


@pytest.mark.parametrize("chance", [0.0, 0.3])
def test_limits_are_those_of_the_symplectic_schemes(chance):
    """Locks out a limit from schemes that drift or from steps too long for the law, one slope for
    all schemes, and an error that is none."""
    off = []
    for seed in range(60):
        swept, found = averages(-9.7, seed, chance)
        limit = sweep_errors.limits(found, swept)["potential"]
        assert len(limit) == STARTS
        one = sweep_errors.pooled(limit)
        off.append((one.value + 9.7) / one.error)
    assert 0.4 < np.std(off) < 1.5 and abs(np.mean(off)) < 0.5
    few = {point: one for point, one in found.items() if point.dt == 1.0}
    assert sweep_errors.limits(few, swept) == {}, "one step has no limit"


def test_another_model_is_held_against_nothing_of_ours():
    """Locks out shake's freely bending CH3 groups taken for an integrator's error, and mixed into
    the limit of rigid ones."""
    swept, found = averages(-9.7, 3)
    odd = [Numbers({"potential": Estimate(5.0, 0.001)}) for _ in range(STARTS)]
    shake = {sweep_plan.Point("water", SWEPT["shake-1e-8"], dt): odd for dt in (1.0, 2.0)}
    peptide = dataclasses.replace(swept, differs="CH3 bends")
    assert (
        sweep_errors.limits(found | shake, peptide)
        == sweep_errors.limits(found, swept)
        != sweep_errors.limits(found | shake, swept)
    )
    errors = sweep_errors.of_points(found | shake, sweep_errors.limits(found, swept), peptide)
    assert all(errors[point] == ({}, {}) for point in shake) and all(
        "potential" in errors[point][0] for point in found
    )
    assert sweep_plan.SWEEPS["peptide"].measures_of(SWEPT["nosquish"]) == list(
        sweep_plan.SWEEPS["peptide"].measures
    )
    assert not {"position", "orientation", "potential"} & set(
        sweep_plan.SWEEPS["peptide"].measures_of(SWEPT["shake-1e-8"])
    )
    assert {"position", "potential"} < set(
        sweep_plan.SWEEPS["water"].measures_of(SWEPT["shake-1e-8"])
    )


def test_what_starts_share_is_no_error():
    """Locks out a point held against the limit of other starts, and each start's chance taken for
    the integrator's error."""
    swept, found = averages(-9.7, 5, chance=3.0)
    errors, signed = sweep_errors.of_points(found, sweep_errors.limits(found, swept), swept)[
        sweep_plan.Point("water", SWEPT["rigid"], 4.0)
    ]
    assert (
        signed["potential"]["value"] == pytest.approx(-31.0, abs=0.1)
        and errors["potential"]["value"] == -signed["potential"]["value"]
    )
    assert 0.001 < errors["potential"]["error"] < 0.1
    two = {point: numbers[:2] for point, numbers in found.items()}
    errors, _ = sweep_errors.of_points(two, sweep_errors.limits(two, swept), swept)[
        sweep_plan.Point("water", SWEPT["rigid"], 4.0)
    ]
    assert errors["potential"]["error"] > 2, "two starts scatter little by chance"


@pytest.mark.parametrize("starts", [1, 4])
@pytest.mark.parametrize("difference", [0.0, 0.05])
def test_noise_is_no_difference_of_g(difference, starts):
    """Locks out a distance between two g(r) that is their noise or what their starts share, one
    that is lost with it, and an error bar that is wrong."""
    random, bins, off = np.random.default_rng(3), 60, []
    swept = dataclasses.replace(sweep_plan.SWEEPS["water"], measures=("g_oo",))
    first, second, third = (
        sweep_plan.Point("water", SWEPT[name], dt)
        for name, dt in (("nosquish", 1.0), ("rigid/nve", 0.5), ("shake-1e-4", 2.0))
    )
    for _ in range(100):
        shared = random.normal(0.0, 0.3, (starts, 1, bins))  # of all runs from a start
        found = {
            point: [
                Numbers({"g_oo": 1.0 + chance + added + random.normal(0.0, 0.05, (5, bins))})
                for chance in shared
            ]
            for point, added in ((first, 0.0), (second, 0.0), (third, difference))
        }
        errors = sweep_errors.of_points(found, {}, swept)
        one = Estimate(**errors[third][0]["g_oo"])
        assert one.error < 0.03
        off.append((one.value - difference) / one.error if difference else one.value > one.margin)
    if difference:
        assert abs(np.mean(off)) < 0.4 and 0.4 < np.std(off) < 1.5
    else:
        assert np.mean(off) < 0.08
    assert sweep_errors.of_points({first: found[first], third: []}, {}, swept)[first] == ({}, {}), (
        "held against itself"
    )


@pytest.mark.parametrize("starts", [1, 4])
def test_equipartition_of_correlated_samples(starts):
    """Locks out starts that are taken for one series, correlated samples for independent ones, and
    a difference of temperatures that is not seen."""
    random, kt, number = np.random.default_rng(5), sweep_errors.BOLTZMANN * 300, 400
    point = sweep_plan.Point("water", SWEPT["nosquish"], 1.0)

    def found(off):
        each = []
        for _ in range(starts):
            noise = random.normal(0.0, np.sqrt(1 - 0.9**2), (2, number))
            noise[:, 0] /= np.sqrt(1 - 0.9**2)
            for k in range(1, number):
                noise[:, k] += 0.9 * noise[:, k - 1]
            energies = 750 * kt * (1 + 0.02 * noise + off * np.array([[1.0], [-1.0]]))
            kelvin = 300 * energies.mean() / (750 * kt)
            one = Numbers({"pv_equipartition": energies}, temperature=kelvin)
            each.append(dataclasses.replace(one, moving=1500, turning=1500))
        return sweep_errors._equipartition(point, {point: each})[0]

    assert np.mean([found(0.0) > 3 for _ in range(60)]) < 0.05
    assert found(0.05) > 6


def test_physical_validation_tells_right_from_wrong():
    """Locks out data given to physical_validation in other units or degrees of freedom, and a
    result that is read wrongly."""
    random, kt = np.random.default_rng(4), sweep_errors.BOLTZMANN * 300
    energies = random.gamma(3.0, kt, 20000)
    assert sweep_structure.distribution(energies, 300.0) < 4
    assert sweep_structure.distribution(energies, 310.0) > 6
    assert (
        sweep_structure.distribution(
            np.full(20000, 3 * kt) + random.normal(0.0, 0.1 * kt, 20000), 300.0
        )
        > 20
    ), "the mean only"
    translation, rotation = (random.normal(150 * kt, 3 * kt, 500) for _ in range(2))
    assert sweep_structure.equipartition(translation, rotation, 300, 300, 300.0) < 5
    assert sweep_structure.equipartition(1.02 * translation, 0.98 * rotation, 300, 300, 300.0) > 10
    noise = random.normal(size=1000)
    assert sweep_structure.convergence({1.0: noise, 2.0: 4 * noise}) == pytest.approx(0.0, abs=1e-9)
    assert sweep_structure.convergence({1.0: noise, 2.0: 6 * noise}) == pytest.approx(0.5)


@pytest.mark.parametrize("short", [False, True])
@pytest.mark.parametrize("times", [1.0, 1.01, 2.0, 7.0])
def test_budget(short, times):
    """Locks out a budget that is not kept, runs too short to fail, and a point's own command that
    would run something else."""
    scenes = sweep_plan.SHORT_SCENES if short else sweep_plan.SCENES
    budget = times * (sweep_plan.SHORT_BUDGET if short else sweep_plan.BUDGET)
    minutes = 0.0
    for name, one in sweep_plan.lengths(scenes, short, budget).items():
        swept, points = sweep_plan.sweeps(short)[name], sweep_plan.points([name], short)
        assert sweep_plan.lengths([name], short, float(f"{one.budget:.10g}"))[name] == one
        assert one.time >= (0.1 if short else swept.least)
        steps = swept.apart * 1000 / swept.scene.dt + 16 * swept.horizon / min(
            point.dt for point in points
        )
        for point in points:
            parts = sweep_plan.parts(swept, point.dt, one.time)
            sampled = (parts.end - parts.begin) * point.dt
            assert sampled >= 250 * point.dt and (point.dt < swept.fine or sampled > 999 * one.time)
            steps += sum(parts.runs)
        cost = one.starts * (steps * swept.seconds + (len(points) + 2) * swept.startup) / 60
        assert 0.7 * one.minutes < cost <= one.minutes
        minutes += one.minutes
    assert minutes == pytest.approx(budget)


@pytest.mark.parametrize("short", [False, True])
def test_too_small_a_budget(short):
    """Locks out a sweep that takes longer than it may, or is too short to tell anything, and a
    message with a number that is refused again."""
    scenes = sweep_plan.SHORT_SCENES if short else sweep_plan.SCENES
    with pytest.raises(ValueError, match="needed") as refused:
        sweep_plan.lengths(scenes, short, 3.0)
    enough = int(str(refused.value).split()[-3])
    assert set(sweep_plan.lengths(scenes, short, enough)) == set(scenes)
    with pytest.raises(ValueError):
        sweep_plan.lengths(scenes, short, enough - 1)


def test_every_step_ends_at_the_horizon():
    """Locks out a trajectory compared at another time than the reference's."""
    for swept in (*sweep_plan.SWEEPS.values(), *sweep_plan.SHORT_SWEEPS.values()):
        for dt in swept.steps:
            assert swept.horizon / dt == pytest.approx(round(swept.horizon / dt), abs=1e-9)
        assert set(swept.measures) <= set(sweep_errors.MEASURES)


SMALL = {"starts": 2, "time": 0.3, "minutes": 1.0, "budget": 2.0}
STEPS = 0.2, 0.4
LIMITS = {"potential", "equipartition"}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The dimer with few steps: what was run, and the summary, of the first call and of a second
    one, which asks for one point."""
    with pytest.MonkeyPatch.context() as patch:
        quick = dataclasses.replace(sweep_plan.SHORT_SWEEPS["dimer"], apart=0.3, seconds=1e-4)
        patch.setitem(sweep_plan.SHORT_SWEEPS, "dimer", quick)
        refused = dataclasses.replace(
            SWEPT["rigid"], lines=(*SWEPT["rigid"].lines, 'if "$(dt>0.3)" then "no_such_command"')
        )
        patch.setitem(SWEPT, "rigid", refused)
        out, original, done = tmp_path_factory.mktemp("sweep"), run.run, []
        patch.setattr(run, "run", lambda job, on_step=None: done.append(job) or original(job))
        points = sweep_plan.points(
            ["dimer"], True, ["nosquish", "rigid", "shake-1e-8"], (*STEPS, 0.6)
        )
        first = sweep.sweep(
            points, {"dimer": sweep_plan.Lengths(**SMALL)}, out, Silent(), short=True
        )
        number = len(done)
        one = [point for point in points if (point.integrator.name, point.dt) == ("rigid", 0.4)]
        second = sweep.sweep(one, {"dimer": sweep_plan.Lengths(**SMALL)}, out, Silent(), short=True)
        yield out, done[:number], done[number:], first, second


def row(summary, name, dt):
    return next(
        one
        for one in summary["scenes"]["dimer"]["points"]
        if (one["integrator"], one["dt"]) == (name, dt)
    )


@pytest.mark.timeout(180)
def test_a_failure_ends_the_longer_steps(small):
    """Locks out longer steps after a blow-up, a failed point taken as measured, and a failure that
    is run again from the next start."""
    _, done, again, summary, _ = small
    failed = row(summary, "rigid", 0.4)
    assert (
        failed["failed"]
        and failed["failures"] == 1
        and failed["errors"] == {}
        and failed["cost"] is None
    )
    longer = row(summary, "rigid", 0.6)
    assert longer["failed"] == "fails with 0.4 fs" and (longer["failures"], longer["starts"]) == (
        0,
        0,
    )
    assert (
        row(summary, "rigid", 0.2)["starts"] == 2 and row(summary, "rigid", 0.2)["failed"] is None
    )
    assert sum("/rigid/0.4-fs" in job.directory for job in done) == 1
    assert row(summary, "nosquish", 0.6)["failed"] is None
    assert again == [], "what was complete, or had failed, was run again"


def test_what_is_there_is_measured_too(small):
    """Locks out one point's sweep that forgets the others, or that has no limits and g(r) to be
    held against."""
    *_, first, second = small
    assert (
        second["scenes"]["dimer"]["begun"] == first["scenes"]["dimer"]["begun"]
        and set(second["scenes"]["dimer"]["limits"]) == LIMITS
    )
    kept, found = (
        [
            one | {"errors": set(one["errors"]), "signed": None}
            for one in summary["scenes"]["dimer"]["points"]
            if one["starts"]
        ]
        for summary in (first, second)
    )
    assert found == [one for one in kept if one["dt"] != 0.6], "all but those of an unusual step"


def test_a_hang_is_kept(tmp_path, monkeypatch):
    """Locks out a hang that is waited for again each time, and one that is taken for a hang where
    more time is allowed now."""
    scene, original, done = (
        dataclasses.replace(SCENES["dimer"], setup=(*SCENES["dimer"].setup, "shell sleep 60")),
        run.run,
        [],
    )
    monkeypatch.setattr(run, "run", lambda job, on_step=None: done.append(job) or original(job))

    def runs(silence, failures):
        found = run.once(
            run.job(scene, SWEPT["rigid"], tmp_path / "job", [1], dt=0.1, every=0, silence=silence),
            failures=failures,
        )
        assert "no sign of life" in found.error
        return len(done)

    assert [
        runs(1.0, True),
        runs(1.0, True),
        runs(0.9, True),
        runs(1.1, True),
        runs(1.1, False),
    ] == [1, 1, 1, 2, 3]


def test_starts_take_turns(small):
    """Locks out repeats of a point that follow each other, and points of other starts than their
    names tell."""
    _, done, *_ = small
    names = [
        Path(job.directory).relative_to(Path(job.directory).parents[2]).as_posix()
        for job in done
        if "-fs/" in job.directory
    ]
    assert [name.rpartition("/")[2] for name in names] == ["1"] * 8 + ["2"] * 7
    assert names[:3] == [f"{name}/0.2-fs/1" for name in ("nosquish", "rigid", "shake-1e-8")]
    read = {
        line
        for job in done
        if job.directory.endswith("-fs/2")
        for line in job.commands
        if line.startswith("read_dump")
    }
    assert len(read) == 1 and "starts/piece-1000/" in read.pop()


def test_samples_and_segments(small):
    """Locks out output in the timed steps, samples at other steps than told, and costs of other
    steps than the timed ones."""
    out, *_, summary, _ = small
    swept = dataclasses.replace(sweep_plan.SWEEPS["dimer"], seconds=1e-4)
    parts = sweep_plan.parts(swept, 0.2, SMALL["time"])
    kept = run.collect(out / "runs/dimer-short/nosquish/0.2-fs/1")
    samples = range(parts.begin, parts.end + 1, parts.every)
    assert list(kept.thermo["Step"]) == [0, parts.horizon, *samples, parts.end + parts.timed]
    assert (samples[-1] - samples[0]) * 0.2e-3 >= SMALL["time"]
    cost = row(summary, "nosquish", 0.2)["cost"]
    assert len(cost["values"]) == 2 * 2
    assert cost["values"][:2] == pytest.approx(
        [kept.timings[n].seconds / parts.timed / 0.2 * 1e6 for n in (1, -1)]
    )
    assert kept.timings[1].steps == kept.timings[-1].steps == parts.timed
    first, last = parts.frames.indices(len(kept.positions.x))[:2]
    assert np.cumsum([0, *parts.runs])[[first, last - 1]].tolist() == [parts.begin, parts.end]
    assert len(kept.positions.x) == 1 + len(parts.runs)


def test_temperatures_are_the_atoms(small):
    """Locks out kinetic energies of bodies that are LAMMPS's own fix's, or of another step than the
    positions."""
    out, *_ = small
    for name in "nosquish", "shake-1e-8":
        kept = run.collect(out / f"runs/dimer-short/{name}/0.2-fs/1")
        v, mass = kept.positions.v[-1].reshape(2, 3, 3), kept.positions.mass.reshape(2, 3, 1)
        centre = (mass * v).sum(axis=1) / mass.sum(axis=1)
        translation = 0.5 * (mass.sum(axis=1) * centre**2).sum() * 1e7 / 4184
        rotation = 0.5 * (mass * (v - centre[:, None]) ** 2).sum() * 1e7 / 4184
        assert kept.thermo["v_translation"][-1] == pytest.approx(translation, rel=1e-6)
        assert kept.thermo["v_rotation"][-1] == pytest.approx(rotation, rel=1e-6)
        assert translation + rotation == pytest.approx(kept.thermo["KinEng"][-1], rel=1e-6)


def test_errors_fall_with_the_square_of_the_step(small):
    """Locks out a reference at another time or from another start, and errors of a scheme that are
    another's."""
    out, *_, summary, _ = small
    reference = run.collect(out / "runs/dimer-short/reference/1").thermo["Step"]
    assert set(np.diff(reference)) == {100}, "no sign of life from a long run"
    for name in "nosquish", "shake-1e-8":
        for measure in "position", "orientation":
            short, long = (row(summary, name, dt)["errors"][measure]["value"] for dt in STEPS)
            assert long / short == pytest.approx(4.0, rel=0.05)
    assert (
        row(summary, "nosquish", 0.2)["errors"]["bond"]["value"]
        < 1e-11
        < row(summary, "shake-1e-8", 0.2)["errors"]["bond"]["value"]
        < 1e-8
    )
    scene = summary["scenes"]["dimer"]
    assert scene["degrees_of_freedom"] == 9 and scene["bodies"] == 2
    assert set(row(summary, "nosquish", 0.4)["errors"]) == set(sweep_plan.SWEEPS["dimer"].measures)
    assert set(scene["limits"]) == LIMITS


def test_command_of_a_point(small):
    """Locks out a command that another point's, or other starts, would follow."""
    *_, summary, _ = small
    words = shlex.split(row(summary, "shake-1e-8", 0.4)["command"])
    assert words[:4] == ["python", "-m", "validation", "sweep"] and "--short" in words
    given = dict(itertools.pairwise(words))
    assert (words[4], given["--only"], given["--steps"], given["--budget"]) == (
        "dimer",
        "shake-1e-8",
        "0.4",
        "2",
    )


def test_an_interruption_keeps_what_is_measured(tmp_path, monkeypatch):
    """Locks out a traceback in place of a summary, and points after the interruption."""
    monkeypatch.setattr(
        run,
        "once",
        lambda job, on_step=None, failures=False: run.Result(
            "interrupted", {}, [], None, {}, interrupted=True
        ),
    )
    points = sweep_plan.points(["dimer", "water"], True)
    monkeypatch.setattr(sweep.starts, "of_size", lambda scene, bodies, folder: scene)
    summary = sweep.sweep(
        points, sweep_plan.lengths(["dimer", "water"], True), tmp_path, Silent(), short=True
    )
    assert (
        summary["interrupted"]
        and list(summary["scenes"]) == ["dimer"]
        and summary["scenes"]["dimer"]["points"] == []
    )
