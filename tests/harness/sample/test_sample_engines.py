"""Other engines of the verb sample: what they are given, what is read of them, how runs end."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from support.harness import run_lmp, written
from validation.__main__ import main
from validation.running import run
from validation.sample import engine, gromacs_engine, measure, openmm_engine, scenes
from validation.sample.engine import BAR, KJ, EngineRun, of_scene

SCENE = scenes.SCENES["water"](Path()).scene
WATER = of_scene(SCENE)
COURSE = EngineRun("sd", 298.0, 5.0, 2.0, [20, 80], 24, 7)
# GROMACS 2022.5's energies of the scene's data file, and of 48 fs behind: ps, kJ/mol, bar
ENERGIES = """\
    0.000000  -20348.523437500000  707.449707031250
    0.048000  -20368.228515625000  484.449218750000
"""


def test_openmm_has_the_scenes_forces(tmp_path):
    """Locks out another cutoff, unit, charge or mixing in OpenMM than LAMMPS has: energy and force
    on each atom of one configuration."""
    openmm = pytest.importorskip("openmm", reason="the extra 'engines' is not installed")
    script = written(
        tmp_path,
        "\n".join(SCENE.setup)
        + "\nthermo_modify norm no format float %.15g\nrun 0\nprint $(pe) file pe.txt\n"
        + "write_dump all custom forces.txt fx fy fz modify sort id format float %.15g\n",
    )
    for file in SCENE.folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    run_lmp(script, "-log", "none", "-screen", "none")
    expected = float((tmp_path / "pe.txt").read_text())
    forces = np.loadtxt(tmp_path / "forces.txt", skiprows=9)
    given = openmm_engine.ENGINE.job(COURSE, WATER, tmp_path, 1.0).input
    place, _ = openmm_engine.create_context(given | {"platform": "Reference"})
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
    charge = np.tile([engine.CHARGE[0], engine.CHARGE[1], engine.CHARGE[1]], number)
    molecule, oxygen = np.repeat(np.arange(number), 3), np.tile([True, False, False], number)
    reach = engine.COULOMB.outer
    ended = [(one, one.coefficients) for one in (engine.REPULSION, engine.DISPERSION)]
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
            past, sign = np.maximum(r - engine.DISPERSION.inner, 0), 1.0
            for one, (a, b, c) in ended:
                term = r ** -float(one.power) - a / 3 * past**3 - b / 4 * past**4 - c
                total += sign * 4 * engine.DEPTH * engine.SIZE**one.power * term.sum()
                sign = -1.0
    return total - 332.06371 * np.sum(charge**2) * 3 / (4 * reach)


def test_gromacs_has_the_forces_that_are_told():
    """Locks out units, charges and a cutoff that the page does not tell, and energies or pressures
    that are read in other units."""
    first, second = gromacs_engine.read(ENERGIES, 2.0)
    assert (first.step, second.step) == (0, 24)
    assert first.potential == pytest.approx(by_hand(WATER), rel=2e-5)
    assert second.pressure == pytest.approx(484.449218750 / 1.01325)


def test_gromacs_inputs():
    """Locks out a start that is rounded or has another order, a topology of other molecules, and
    settings that are not those of the course."""
    made = gromacs_engine.worker_input(COURSE, WATER)["files"]
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
    rescaled = gromacs_engine.settings(replace(COURSE, thermostat="v-rescale"))
    assert "= md\n" in rescaled and "= v-rescale\n" in rescaled and "= Linear\n" in rescaled


# ---- runs

# does as gmx, by what its settings say: it writes energies, or ends
FAKE = """\
#!{python}
import os, pathlib, signal, sys, time
if sys.argv[1] == "--version":
    print("GROMACS version:    2022.5-fake")
elif sys.argv[1] == "mdrun":
    log = "   Step   Time\\n     24   0.05\\n       Time:        3.900        1.95      200.0\\n"
    pathlib.Path("run.log").write_text(log)
    pathlib.Path("mdrun").write_text(str(os.getpid()))
    {mdrun}
elif sys.argv[1] == "energy":
    assert sys.stdin.read() == "Potential\\nPressure\\n\\n"
    pathlib.Path("energies.xvg").write_text({energies!r})
"""
FATAL = "print('Fatal error:\\nstep 3: water can not\\nbe settled.\\n\\nFor more'); sys.exit(1)"
ENDS = {  # what mdrun does: how the run ends, and whether the same run would end so again
    "pass": (None, True),
    FATAL: ("ERROR: step 3: water can not be settled.", True),
    "sys.exit(1)": ("ERROR: gmx mdrun ended without a message, by status 1", True),
    "os.kill(os.getpid(), signal.SIGSEGV)": ("ended without a message, by signal SIGSEGV", True),
    "os.kill(os.getpid(), signal.SIGKILL)": ("gmx mdrun was ended by signal SIGKILL", False),
    "time.sleep(60)": (run.HUNG, True),
}


@pytest.fixture
def gromacs(tmp_path, monkeypatch):
    """A job of GROMACS whose mdrun does what it is told."""
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:/usr/bin:/bin")

    def job(mdrun="pass", silence=30.0):
        path = tmp_path / "bin" / "gmx"
        path.write_text(FAKE.format(python=sys.executable, mdrun=mdrun, energies=ENERGIES))
        path.chmod(0o755)
        return gromacs_engine.ENGINE.job(COURSE, WATER, tmp_path / "run", silence)

    return job


@pytest.mark.parametrize("mdrun", ENDS)
def test_how_gromacs_ends(gromacs, mdrun):
    """Locks out a failure without its reason, a run that somebody killed as a failure of the
    engine, one that crashed as none, one that hangs for ever, and columns in other units."""
    why, lasts = ENDS[mdrun]
    job = gromacs(mdrun, 2.0 if "sleep" in mdrun else 30.0)
    result = run.run(job)
    assert (result.error is None) if why is None else (why in result.error)
    assert run.is_there(job, failures=True) == lasts
    if why is None:
        assert result.versions == {"GROMACS": "2022.5-fake"}
        assert result.timings[-1].seconds == 1.95  # not that of preparations
        table = result.thermo
        assert table["Step"].tolist() == [0, 24] and table["Time"].tolist() == [0.0, 48.0]
        assert table["PotEng"][0] == pytest.approx(-20348.5234375 / KJ)
        assert table["Press"][1] == pytest.approx(484.44921875 * BAR)
        assert table["Volume"][0] == pytest.approx(WATER.box.prod())
        assert result.timings[-1].steps == 24


def test_an_engine_that_is_not_there(monkeypatch, tmp_path):
    """Locks out a traceback, or a message without a way to go on."""
    monkeypatch.setenv("PATH", str(tmp_path))
    words = ["sample", "water", "--out", str(tmp_path / "out"), "--only"]
    with pytest.raises(SystemExit, match=r"GROMACS.*apt-get install gromacs") as it:
        main([*words, "gromacs-sd"])
    assert "leave its schemes out of --only" in str(it.value)
    monkeypatch.setattr(measure, "sample", lambda *_: 1 / 0)  # the first run
    with pytest.raises(ZeroDivisionError):
        main([*words, "csvr"])


def test_a_short_run(tmp_path, capsys):
    """Locks out a verb that does not come to its page, and a pressure in other units: OpenMM's is
    the same function of a configuration as LAMMPS's, whose liquid has a few hundred atm."""
    pytest.importorskip("openmm", reason="the extra 'engines' is not installed")
    means = {
        "potential": {"value": -9.5, "error": 0.01},
        "pressure": {"value": 500.0, "error": 9.0},
    }
    row = {"scheme": "langevin-20", "starts": 1, "error": None, "means": means}
    (tmp_path / "summary.json").write_text(
        json.dumps(
            {
                "scene": "water",
                "settings": {"time": 1.0, "starts": 1},
                "rows": [row | {"dt": dt} for dt in (2.0, 4.0)],
            }
        )
    )
    out = tmp_path / "out"
    words = ["sample", "water", "--ps", "0.2", "--dt", "8", "--only", "openmm-langevin-20"]
    words += ["--seed", "7200"]
    assert main([*words, "--from", str(tmp_path), "--out", str(out)]) == 0
    summary = json.loads((out / "summary.json").read_text())
    (row,) = summary["rows"]
    assert summary["versions"]["OpenMM"] and row["error"] is None and row["engine"] == "OpenMM"
    assert abs(row["biases"]["potential"]["value"]) < 0.5 and row["cost"]["median"] > 0
    assert abs(row["biases"]["pressure"]["value"]) < 3000
    assert {"table.csv", "bias.png", "report.html"} <= {one.name for one in out.iterdir()}
    assert "LangevinMiddle" in capsys.readouterr().out
