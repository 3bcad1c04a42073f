"""The verb engines: what OpenMM and GROMACS are given, what is read of them, and their limits."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import BIN, Silent

for needed in ("rich", "matplotlib", "pandas", "jinja2", "physical_validation", "mdtraj"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation import RESULTS
from validation.__main__ import main
from validation.engines import engine, measure, plan, with_gromacs, with_openmm
from validation.engines.engine import BAR, KJ, Course, Engine, Failed, Samples
from validation.engines.runs import Runs
from validation.engines.water import Shift, of_scene
from validation.ensembles.lengths import Lengths, Point

WATER = of_scene(plan.CASE.scene)
COURSE = Course("sd", 298.0, 5.0, 2.0, 100, 24, 7)
# GROMACS 2022.5's energies of the scene's data file, and of 48 fs behind: ps, kJ/mol, bar
ENERGIES = """\
    0.000000  -20348.523437500000  707.449707031250
    0.048000  -20368.228515625000  484.449218750000
"""


def test_openmm_has_the_scenes_forces(tmp_path):
    """Locks out another cutoff, unit, charge or mixing in OpenMM than LAMMPS has: energy and force
    on each atom of one configuration."""
    openmm = pytest.importorskip("openmm", reason="the extra 'engines' is not installed")
    from validation.engines import openmm_worker

    (tmp_path / "in.one").write_text(
        "\n".join(plan.CASE.scene.setup)
        + "\nthermo_modify norm no format float %.15g\nrun 0\nprint $(pe) file pe.txt\n"
        + "write_dump all custom forces.txt fx fy fz modify sort id format float %.15g\n"
    )
    for file in plan.CASE.scene.folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    words = [BIN / "lmp", "-in", "in.one", "-log", "none", "-screen", "none"]
    subprocess.run(words, cwd=tmp_path, check=True, timeout=60)
    expected = float((tmp_path / "pe.txt").read_text())
    forces = np.loadtxt(tmp_path / "forces.txt", skiprows=9)
    place = openmm_worker.context(with_openmm.job(COURSE, WATER) | {"platform": "Reference"})
    state = place.getState(getEnergy=True, getForces=True)
    assert state.getPotentialEnergy()._value / KJ == pytest.approx(expected, rel=1e-8)
    found = np.array(state.getForces(asNumpy=True)._value) / KJ / 10
    assert abs(found - forces).max() < 1e-6 * abs(forces).max()
    assert isinstance(place.getIntegrator(), openmm.LangevinMiddleIntegrator)
    assert place.getIntegrator().getFriction()._value == COURSE.friction
    assert place.getIntegrator().getStepSize()._value == pytest.approx(2e-3)


def by_hand(water):
    """kcal/mol of a configuration with GROMACS's forces: force-switched Lennard-Jones, and a
    reaction field whose force is zero at the cutoff."""
    number, total = water.molecules, 0.0
    charge = np.tile([water.charge[0], water.charge[1], water.charge[1]], number)
    molecule, oxygen = np.repeat(np.arange(number), 3), np.tile([True, False, False], number)
    reach = water.coulomb.outer
    ended = [(one, one.coefficients) for one in (water.repulsion, water.dispersion)]
    for i in range(len(water.x)):
        d = water.x[i + 1 :] - water.x[i]
        d -= np.round(d / water.box) * water.box
        r = np.sqrt((d**2).sum(axis=1))
        inside, others = r < reach, molecule[i + 1 :] != molecule[i]
        # GROMACS counts excluded pairs of the field, too, and each charge with itself
        field = r**2 / (2 * reach**3) - 3 / (2 * reach)
        pair = np.where(others, 1 / r, 0.0) + field
        total += 332.06371 * charge[i] * np.sum((charge[i + 1 :] * pair)[inside])
        if oxygen[i]:
            r = r[inside & others & oxygen[i + 1 :]]
            past, sign = np.maximum(r - water.dispersion.inner, 0), 1.0
            for one, (a, b, c) in ended:
                term = r ** -float(one.power) - a / 3 * past**3 - b / 4 * past**4 - c
                total += sign * 4 * water.depth * water.size**one.power * term.sum()
                sign = -1.0
    return total - 332.06371 * np.sum(charge**2) * 3 / (4 * reach)


def test_gromacs_has_the_forces_that_are_told():
    """Locks out units, charges and a cutoff that the page does not tell, and energies or pressures
    that are read in other units."""
    found = with_gromacs.samples(ENERGIES, 2.0, 3.0)
    assert found.step.tolist() == [0, 24] and found.seconds == 3.0
    assert found.potential[0] == pytest.approx(by_hand(WATER), rel=2e-5)
    assert found.pressure[1] == pytest.approx(484.449218750 / 1.01325)


def test_shifted_terms_end():
    """Locks out a term whose energy, force or slope of the force jumps, at either end."""
    for one in (Shift(1, 0.0, 8.5), Shift(6, 7.0, 8.5), Shift(12, 7.0, 8.5)):
        a, b, c = one.coefficients
        p, rc, wide = one.power, one.outer, one.outer - one.inner
        assert rc**-p - a / 3 * wide**3 - b / 4 * wide**4 - c == pytest.approx(0, abs=1e-12)
        assert p * rc ** (-p - 1) + a * wide**2 + b * wide**3 == pytest.approx(0, abs=1e-12)
        slope = -p * (p + 1) * rc ** (-p - 2) + 2 * a * wide + 3 * b * wide**2
        assert slope == pytest.approx(0, abs=1e-12)


def test_gromacs_inputs():
    """Locks out a start that is rounded or has another order, a topology of other molecules, and
    settings that are not those of the course."""
    made = with_gromacs.inputs(COURSE, WATER)
    lines = made["start.gro"].splitlines()
    assert len(lines) == 3 + len(WATER.x) and lines[2][10:15].strip() == "OW"
    x = np.array([[line[20:35], line[35:50], line[50:65]] for line in lines[2:-1]], float)
    assert abs(10 * x - WATER.x).max() < 1e-8
    assert "SOL 512" in made["topol.top"] and "1 1 0.09572" in made["topol.top"]
    said = dict(line.split(" = ") for line in made["run.mdp"].splitlines())
    said = {key.strip(): value for key, value in said.items()}
    assert said["integrator"] == "sd" and said["tau-t"] == "0.2" and said["dt"] == "0.002"
    assert said["tcoupl"] == "no" and said["comm-mode"] == "None" and said["nsteps"] == "100"
    assert int(said["nstlog"]) % int(said["nstenergy"]) == 0
    rescaled = with_gromacs.settings(replace(COURSE, thermostat="v-rescale"), WATER)
    assert "= md\n" in rescaled and "= v-rescale\n" in rescaled and "= Linear\n" in rescaled


def test_a_scene_with_other_forces(tmp_path):
    """Locks out numbers of a force field that has another form."""
    folder = plan.CASE.scene.folder
    text = (folder / "forcefield.512").read_text().replace("coul/gromacs", "coul/cut")
    (tmp_path / "forcefield.512").write_text(text)
    (tmp_path / "data.512").write_bytes((folder / "data.512").read_bytes())
    with pytest.raises(ValueError, match="pair_style lj/gromacs/coul/gromacs"):
        of_scene(replace(plan.CASE.scene, folder=tmp_path))


# ---- runs


FATAL = "Program gmx\n\nFatal error:\nstep 3: water can not\nbe settled.\n\nFor more"
SAID = {
    FATAL: "step 3: water can not be settled.",
    "0 1 2\nERROR: Particle coordinate is NaN.\n": "Particle coordinate is NaN.",
    "Traceback:\n  x\nModuleNotFoundError: No module\n": "ModuleNotFoundError: No module",
}


@pytest.mark.parametrize("text", SAID)
def test_why_an_engine_ended(tmp_path, text):
    """Locks out a failure without its reason."""
    code = f"import sys; print({text!r}); sys.exit(1)"
    with pytest.raises(Failed, match=SAID[text]) as found:
        engine.wait([sys.executable, "-c", code], tmp_path)
    assert found.value.lasts


@pytest.mark.parametrize("sign, lasts", [("SEGV", True), ("KILL", False)])
def test_a_signal(tmp_path, sign, lasts):
    """Locks out a run that somebody killed as a failure of the engine, and one that crashed as
    none."""
    code = f"import os, signal; os.kill(os.getpid(), signal.SIG{sign})"
    with pytest.raises(Failed, match=f"signal SIG{sign}") as found:
        engine.wait([sys.executable, "-c", code], tmp_path)
    assert found.value.lasts == lasts


def test_a_run_without_output(tmp_path):
    """Locks out a run that hangs for ever."""
    with pytest.raises(Failed, match="no sign of life"):
        engine.wait([sys.executable, "-c", "import time; time.sleep(60)"], tmp_path, 0.5)


class Fake:
    """An engine that does what it is told, and counts."""

    def __init__(self):
        self.done = []

    def __call__(self, course, folder: Path, silence, on_step):
        self.done.append(course.seed)
        assert (folder / "given").read_text() == str(course.dt)
        if course.seed == 1:
            raise Failed("it blew up")
        if course.seed == 2:
            raise Failed("killed", lasts=False)
        if course.seed == 3:
            raise KeyboardInterrupt
        energy = np.nan if course.seed == 4 else -2.0
        return Samples(np.arange(2), np.array([energy, -1.0]), np.ones(2), 0.5)


def test_runs_resume(tmp_path):
    """Locks out a run that is done again, one that is taken over with other inputs, a failure that
    is lost or done again, one that somebody ended as a result, and a Ctrl-C that loses what is
    complete."""
    fake, silent = Fake(), Silent()
    one = Engine("fake", "", lambda: "1", lambda c, w: {"given": str(c.dt)}, lambda c, w: [], fake)

    def do(*seeds, dt=2.0, version="1"):
        made = Runs(WATER, tmp_path, {"fake": version}, 1.0)
        courses = {f"run-{seed}": replace(COURSE, seed=seed, dt=dt) for seed in seeds}
        wanted = {name: (name, one, course) for name, course in courses.items()}
        interrupted = made.do(wanted, silent)
        return interrupted, [made.found(name, one, course) for name, course in courses.items()]

    interrupted, (good, blown, killed, nan) = do(5, 1, 2, 4)
    assert not interrupted and good[0].potential.tolist() == [-2.0, -1.0] and good[1] is None
    assert blown == (None, "it blew up") and killed == (None, "killed")
    assert nan == (None, "energy is not finite")
    interrupted, (ended, later, before) = do(3, 6, 5)
    assert interrupted and ended == later == (None, None) and before[0] is not None
    assert fake.done == [5, 1, 2, 4, 3]
    do(5, 1, 2, 4)
    assert fake.done[5:] == [2]  # the one that was killed
    do(5, dt=1.0)
    do(5, version="2")
    assert fake.done[6:] == [5, 5]


def test_an_engine_that_is_not_there(monkeypatch, tmp_path, capsys):
    """Locks out a traceback, or a message without a way to go on."""
    pytest.importorskip("openmm", reason="the extra 'engines' is not installed")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SystemExit, match=r"GROMACS.*apt-get install gromacs") as it:
        main(["engines", "--out", str(tmp_path / "out")])
    assert "--only openmm-langevin-5 openmm-langevin-20" in str(it.value)
    # points that an earlier command has left of an engine that is gone ask for nothing
    (tmp_path / "start-1").mkdir()
    for name in "gromacs-sd-2-fs-0a", "openmm-langevin-20-4-fs-0b", "no-scheme-4-fs-0c":
        (tmp_path / "start-1" / f"{name}.json").touch()
    points = [Point("openmm-langevin-5", 2.0)]
    every = measure.with_left(points, tmp_path)
    assert [one.scheme for one in every] == ["openmm-langevin-5", "openmm-langevin-20"]
    scheme = plan.SCHEMES["gromacs-sd"]
    there = replace(scheme, engine=replace(scheme.engine, version=lambda: "1"))
    monkeypatch.setitem(plan.SCHEMES, "gromacs-sd", there)
    assert len(measure.with_left(points, tmp_path)) == 3
    with pytest.raises(SystemExit, match="no limit of the scene water"):
        measure.known_limit(RESULTS / "ensembles-pressure")
    with pytest.raises(SystemExit, match=r"has no summary\.json"):
        measure.known_limit(tmp_path)


# ---- numbers


def test_biases():
    """Locks out an engine that is held against another limit than is told, samples of the part that
    is left out, and a pressure that lacks what the total momentum takes off."""
    lengths, rng = Lengths(100.0, 1), np.random.default_rng(2)
    known = {"potential": {"value": -9.5, "error": 1e-3}, "pressure": {"value": 500.0, "error": 1}}
    limits = {"OpenMM": (-9.4, 600.0), "GROMACS": (-9.0, 300.0)}
    found = {}
    for point in plan.points(None, None):
        one, course = plan.SCHEMES[point.scheme], plan.course(point, lengths, 1)
        step = np.arange(0, course.steps, course.every)
        energy, pressure = limits[one.engine.name]
        factor = 1e-3 * point.dt**2
        noise = 1e-4 * rng.normal(size=len(step)), 0.1 * rng.normal(size=len(step))
        gas = 298 * 0.0019872067 / WATER.box.prod() * 68568.415 * (one.held == 3)
        potential = 512 * (energy + factor + noise[0]) + 1e3 * (step < lengths.runs(point.dt)[0])
        found[point] = [Samples(step, potential, pressure - gas + noise[1], 7.0)]
    broken = Point("gromacs-sd", 6.0)
    runs = Runs(WATER, Path(), {}, 1.0)
    told = measure.told(found, {broken: "gone"}, list(found), lengths, runs, known)
    for row in told["rows"]:
        if (row["scheme"], row["dt"]) == broken:
            assert row["error"] == "gone" and not row["biases"]
            continue
        bias = 1e-3 * row["dt"] ** 2 + 0.1 * (row["engine"] == "OpenMM")
        assert row["biases"]["potential"]["value"] == pytest.approx(bias, abs=2e-5)
        assert row["biases"]["pressure"]["value"] == pytest.approx(
            100.0 * (row["engine"] == "OpenMM"), abs=0.05
        )
        assert row["clock"]["median"] == pytest.approx(7 / 110, rel=0.01)
    assert told["limits"]["GROMACS"]["potential"]["value"] == pytest.approx(-9.0, abs=2e-5)
    assert list(told["apart"]) == ["OpenMM"]
    assert told["apart"]["OpenMM"]["potential"]["value"] == pytest.approx(0.1, abs=2e-5)


def test_a_short_run(tmp_path, capsys):
    """Locks out a verb that does not come to its page, and a pressure in other units: OpenMM's is
    the same function of a configuration as LAMMPS's, whose liquid has a few hundred atm."""
    pytest.importorskip("openmm", reason="the extra 'engines' is not installed")
    out = tmp_path / "out"
    words = ["engines", "--ps", "0.4", "--dt", "8", "--only", "openmm-langevin-20"]
    assert main([*words, "--out", str(out)]) == 0
    summary = json.loads((out / "summary.json").read_text())
    (row,) = summary["rows"]
    assert summary["versions"]["OpenMM"] and row["error"] is None
    assert abs(row["biases"]["potential"]["value"]) < 0.3
    assert abs(row["biases"]["pressure"]["value"]) < 2000 * BAR
    assert {"table.csv", "bias.png", "report.html"} <= {one.name for one in out.iterdir()}
    assert "LangevinMiddle" in capsys.readouterr().out
