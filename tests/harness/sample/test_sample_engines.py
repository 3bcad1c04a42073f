"""Other engines of the verb sample: what they are given, what is read of them, how runs end."""

import json
import subprocess
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from support import needs_extra  # noqa: F401  the extra validation
from support.running import BIN
from validation.__main__ import main
from validation.running import run
from validation.sample import measure, openmm_engine, scenes
from validation.sample.openmm_engine import KJ, EngineRun, of_scene

SCENE = scenes.SCENES["water"](Path()).scene
WATER = of_scene(SCENE)
COURSE = EngineRun(298.0, 5.0, 2.0, [20, 80], 24, 7)


def test_openmm_has_the_scenes_forces(tmp_path):
    """Locks out another cutoff, unit, charge or mixing in OpenMM than LAMMPS has: energy and force
    on each atom of one configuration."""
    openmm = pytest.importorskip("openmm", reason="the extra 'engines' is not installed")
    (tmp_path / "in.one").write_text(
        "\n".join(SCENE.setup)
        + "\nthermo_modify norm no format float %.15g\nrun 0\nprint $(pe) file pe.txt\n"
        + "write_dump all custom forces.txt fx fy fz modify sort id format float %.15g\n"
    )
    for file in SCENE.folder.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    words = [BIN / "lmp", "-in", "in.one", "-log", "none", "-screen", "none"]
    subprocess.run(words, cwd=tmp_path, check=True, timeout=60)
    expected = float((tmp_path / "pe.txt").read_text())
    forces = np.loadtxt(tmp_path / "forces.txt", skiprows=9)
    given = openmm_engine.parameters(COURSE, WATER)
    place, _ = openmm_engine.start(given | {"platform": "Reference"})
    state = place.getState(getEnergy=True, getForces=True)
    assert state.getPotentialEnergy()._value / KJ == pytest.approx(expected, rel=1e-8)
    found = np.array(state.getForces(asNumpy=True)._value) / KJ / 10
    assert abs(found - forces).max() < 1e-6 * abs(forces).max()
    assert isinstance(place.getIntegrator(), openmm.LangevinMiddleIntegrator)
    assert place.getIntegrator().getFriction()._value == COURSE.friction
    assert place.getIntegrator().getStepSize()._value == pytest.approx(2e-3)


# a package that does as OpenMM where a run ends early
FAKE = """\
class OpenMMException(Exception):
    pass
def System():
    {end}
"""
ENDS = {  # how the run ends, and whether the same run would end so again
    "raise OpenMMException('Particle coordinate is NaN')": ("ERROR: Particle coordinate", True),
    "import os, signal; os.kill(os.getpid(), signal.SIGKILL)": ("ended without a message", False),
    "import time; time.sleep(60)": (run.HUNG, True),
}


@pytest.mark.parametrize("end", ENDS)
def test_how_a_run_ends(end, tmp_path, monkeypatch):
    """Locks out a failure without its reason, a run that somebody killed as a failure of OpenMM,
    and one that hangs for ever."""
    (tmp_path / "openmm.py").write_text(FAKE.format(end=end))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(openmm_engine, "versions", lambda: {"OpenMM": "8"})
    job = openmm_engine.job(COURSE, WATER, tmp_path / "run", 3.0)
    why, lasts = ENDS[end]
    assert why in run.run(job).error
    assert run.is_there(job, failures=True) == lasts


def test_an_engine_that_is_not_there(monkeypatch, tmp_path):
    """Locks out a traceback, or a message without a way to go on; and a limit that is taken from
    another scene's results."""

    def version(package):
        raise metadata.PackageNotFoundError

    monkeypatch.setattr(openmm_engine.metadata, "version", version)
    words = ["sample", "water", "--out", str(tmp_path / "out"), "--only"]
    with pytest.raises(SystemExit, match=r"OpenMM.*pip install") as it:
        main([*words, "openmm-langevin-5"])
    assert "leave its schemes out of --only" in str(it.value)
    (tmp_path / "summary.json").write_text(
        json.dumps({"scene": "co2", "limits": {"potential": {}}})
    )
    with pytest.raises(SystemExit, match="no limit of small steps of the scene water"):
        main([*words, "nh", "--from", str(tmp_path)])
    with pytest.raises(SystemExit, match="no limit of small steps of the scene water"):
        measure.known_limits(tmp_path / "nothing", "water")


def test_a_short_run(tmp_path, capsys):
    """Locks out a verb that does not come to its page, and a pressure in other units: OpenMM's is
    the same function of a configuration as LAMMPS's, whose liquid has a few hundred atm."""
    pytest.importorskip("openmm", reason="the extra 'engines' is not installed")
    limits = {
        "potential": {"value": -9.5, "error": 0.01},
        "pressure": {"value": 500.0, "error": 9.0},
    }
    (tmp_path / "summary.json").write_text(json.dumps({"scene": "water", "limits": limits}))
    out = tmp_path / "out"
    words = ["sample", "water", "--ps", "0.2", "--dt", "8", "--only", "openmm-langevin-20"]
    assert main([*words, "--from", str(tmp_path), "--out", str(out)]) == 0
    summary = json.loads((out / "summary.json").read_text())
    (row,) = summary["rows"]
    assert summary["versions"]["OpenMM"] and row["error"] is None and row["engine"] == "OpenMM"
    assert abs(row["biases"]["potential"]["value"]) < 0.5 and row["clock"]["median"] > 0
    assert abs(row["biases"]["pressure"]["value"]) < 3000
    assert {"table.csv", "bias.png", "report.html"} <= {one.name for one in out.iterdir()}
    assert "LangevinMiddle" in capsys.readouterr().out
