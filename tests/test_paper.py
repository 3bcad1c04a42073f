"""The paper's test problems: pieces that follow one another, and judgements on energies that are known.

Statistical checks use fixed random seeds.
"""

import dataclasses
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # after site-packages: the installed fix_nosquish is tested

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

import mdtraj  # noqa: E402

from validation import paper, paper_claims, paper_peptide, paper_report, run  # noqa: E402
from validation.integrators import PAPER  # noqa: E402
from validation.scenes import SCENES  # noqa: E402


class Silent:
    """A meter that shows nothing."""

    def begin(self, label, total):
        pass

    def at(self, step):
        pass

    def end(self, error):
        pass


def trajectory(integrator="nosquish", steps=300, piece=300, **more):
    usual = {"name": "test", "label": "test", "scene": SCENES["dimer"], "dt": paper.DIMER_DT, "every": 10, "ranks": 1}
    return paper.Trajectory(integrator=PAPER[integrator], steps=steps, piece=piece, **usual | more)


@pytest.mark.timeout(120)
@pytest.mark.parametrize("integrator", ["nosquish", "matubayasi-nakahara", "shake", "rigid/nve/small"])
def test_pieces_are_one_trajectory(tmp_path, integrator):
    """Locks out a piece that starts from other atoms than the one before has left, samples told twice, and a time that starts anew."""
    whole, _ = paper.do(trajectory(integrator), tmp_path / "whole", 60, Silent())
    cut, _ = paper.do(trajectory(integrator, piece=120), tmp_path / "cut", 60, Silent())
    assert whole.error is None and cut.error is None
    assert cut.time == pytest.approx(np.arange(31) * 10 * 0.3e-3)
    assert np.ptp(whole.total) > 1e-4, "an energy that does not change checks nothing"
    assert cut.total == pytest.approx(whole.total, abs=1e-9)
    assert cut.kinetic == pytest.approx(whole.kinetic, abs=1e-7)
    assert cut.positions["x"][1] == pytest.approx(whole.positions["x"][1], abs=1e-7)
    assert [steps for _, steps in cut.pieces] == [120, 120, 60]


@pytest.mark.timeout(120)
def test_a_run_goes_on_after_an_interruption(tmp_path, monkeypatch):
    """Locks out complete pieces that are run again, and a trajectory that is complete without its last one."""
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
    monkeypatch.setattr(run, "run", lambda job, on_step=None: done.append(Path(job.directory).name) or original(job, on_step))
    rest, interrupted = paper.do(trajectory(piece=100), tmp_path, 60, Silent())
    assert not interrupted and rest.error is None and len(rest.time) == 31
    assert done == ["piece-0", "piece-100", "piece-200"]


def made(name, total, scene="dimer", dt=3.0, every=10, integrator="nosquish", **more):
    """A series with this total energy."""
    total = np.asarray(total, float)
    path = trajectory(integrator, name=name, scene=SCENES[scene], dt=dt, steps=every * (len(total) - 1), every=every)
    time = np.arange(len(total)) * every * dt / 1000
    usual = {"kinetic": np.full(len(total), 2000.0), "potential": total - 2000.0, "temperature": np.full(len(total), 300.0)}
    return paper.Series(path, None, time, total, **usual | more, positions=None, pieces=[], seconds=1.0)


def noise(size, seed, n=4000, level=-10000.0):
    return level + size * np.random.default_rng(seed).normal(size=n)


def claim(found, words):
    """The one claim that has these words."""
    (one,) = [one for one in paper_claims.judge(found)["claims"] if words in one["what"]]
    return one


def dimers(size):
    ours = {f"dimer-nosquish-{n}": made(f"dimer-nosquish-{n}", noise(1.0, n)) for n in range(1, 5)}
    return ours | {f"dimer-matubayasi-nakahara-{n}": made("other", noise(size, 10 + n)) for n in range(1, 5)}


@pytest.mark.parametrize("size, holds", [(1.5, True), (1.0, None), (0.7, False)])
def test_who_is_more_accurate(size, holds):
    """Locks out the ratio turned round, and a verdict within the errors."""
    dimer = claim(dimers(size), "dimer: NO_SQUISH is more accurate")
    liquid = {"water-nosquish": made("a", noise(1.0, 1), "water"), "water-matubayasi-nakahara": made("b", noise(size, 2), "water")}
    for one in dimer, claim(liquid, "liquid: NO_SQUISH is more accurate"):
        assert one["value"] == pytest.approx(size, abs=5 * one["error"])
        assert one["error"] < 0.05
        assert one["holds"] is holds


def test_who_drifts():
    """Locks out a drift that passes for stable, and chance that passes for a drift."""
    t = np.arange(4000) * 0.03
    steady, drifting = made("a", noise(1.0, 3), "peptide"), made("b", noise(1.0, 4) + 0.1 * t, "peptide")
    assert claim({"peptide-nosquish": steady}, "NO_SQUISH: stable")["holds"] is True
    assert claim({"peptide-nosquish": drifting}, "NO_SQUISH: stable")["holds"] is False
    assert claim({"peptide-rigid/small": steady}, "Richardson")["holds"] is False
    found = claim({"peptide-rigid/small": drifting}, "Richardson")
    assert found["holds"] is True and found["value"] == pytest.approx(0.1, abs=5 * found["error"])


def test_average_measure_with_each_zero_of_energy():
    """Locks out the root mean square for the mean, a wrong zero, and a wrong law for size and step."""
    total = np.where(np.arange(400) % 4 < 2, -10000.3, -9999.7)
    found = {"peptide-nosquish": made("a", total, "peptide")}
    found |= {f"peptide-{name}": made(name, [-1000.0], "peptide", potential=np.array([u])) for name, u in (("alone", -3000.0), ("within", -32000.3))}
    rows = {row["convention"]: row for row in paper_claims.judge(found)["conventions"]}
    assert rows["over |total energy|"]["value"] == pytest.approx(3e-5)
    assert rows["over |kinetic energy|"]["value"] == pytest.approx(0.3 / 2000)
    assert rows["over |potential energy|"]["value"] == pytest.approx(0.3 / 12000)
    assert rows["over |potential energy less that of the molecules apart|"]["value"] == pytest.approx(0.3 / 9000)
    assert rows["over |total energy with the Coulomb energy of bonded atoms|"]["value"] == pytest.approx(0.3 / 30000)
    assert rows["over |total energy|"]["size_for_it"] == pytest.approx(9 * SCENES["peptide"].unit)
    assert rows["over |total energy|"]["dt_for_it"] == pytest.approx(3 / np.sqrt(3))
    near = "total energy", "potential energy", "total energy with the Coulomb energy of bonded atoms"
    expected = {f"over |{what}|" for what in near} | {"E - E(0) in place of E - <E>, over |total energy|"}
    assert {name for name, row in rows.items() if row["about"]} == expected


def test_force_field_has_its_part_of_the_variance():
    """Locks out the part of the deviation for that of the variance, and lengths that differ."""
    slow = np.cumsum(np.random.default_rng(5).normal(size=4000)) * 0.1  # which a short run does not see
    found = {"peptide-nosquish": made("a", noise(1.0, 6) + slow, "peptide"), "force-field-x": made("x", noise(0.5, 7, n=240), "peptide", dt=0.5)}
    one = claim(found, "force field x")
    assert one["value"] == pytest.approx(0.25, rel=0.25)
    assert one["holds"] is True
    found["force-field-x"] = made("x", noise(1.0, 7, n=240), "peptide", dt=0.5)
    assert claim(found, "force field x")["holds"] is False


def test_gear_is_held_against_the_same_time():
    """Locks out NO_SQUISH's whole run beside Gear's first moment, and a run that ended early left out."""
    t = np.arange(200) * 0.03
    later = 100.0 * (t > t[20])
    ours, gear = made("a", -9000 + 0.01 * np.sign(np.sin(t * 90)) + later, "water"), made("b", -9000 + 5 * t[:20], "water", integrator="gear")
    one = claim({"water-nosquish": ours, "water-gear": gear}, "water at 3 fs")
    assert one["holds"] is True and one["value"] > 50
    gear.error = "lost atoms"
    assert "lost atoms" in claim({"water-nosquish": ours, "water-gear": gear}, "water at 3 fs")["source"]


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
    x = np.array([[0, 0, 0], [np.sin(half), np.cos(half), 0], [-np.sin(half), np.cos(half), 0]]) * 0.9572
    v = np.cross([0.003, -0.002, 0.02], x)
    x = (x + [10.0 + shift, 10.0, 10.0]) % 20.0
    lines = ["one molecule", "", "3 atoms", "2 bonds", "1 angles", "2 atom types", "1 bond types", "1 angle types", ""]
    lines += [f"0 20 {c}lo {c}hi" for c in "xyz"] + ["", "Masses", "", "1 15.9994", "2 1.008", "", "Atoms # full", ""]
    lines += [f"{i + 1} 1 {1 + (i > 0)} 0 " + " ".join(f"{c:.16g}" for c in x[i]) for i in range(3)] + ["", "Velocities", ""]
    lines += [f"{i + 1} " + " ".join(f"{c:.16g}" for c in v[i]) for i in range(3)]
    return "\n".join([*lines, "", "Bonds", "", "1 1 1 2", "2 1 1 3", "", "Angles", "", "1 1 2 1 3", ""])


def test_why_rattle_is_not_in_figure_3(run_lammps):
    """Locks out the page's word on fix rattle once a LAMMPS has it right: the same molecule keeps velocities along its
    bonds where it crosses a periodic face, and its kinetic energy is another."""
    inside = run_lammps(RATTLE, files={"data.water": one_water(0.0)}).thermo[-1]
    across = run_lammps(RATTLE, files={"data.water": one_water(10.0)}).thermo[-1]
    assert max(abs(inside["c_largest"]), abs(inside["c_smallest"])) < 1e-15
    assert max(abs(across["c_largest"]), abs(across["c_smallest"])) > 1e-5
    assert abs(across["KinEng"] / inside["KinEng"] - 1) > 1e-5


@pytest.mark.timeout(120)
def test_shake_holds_what_the_rigid_groups_hold(tmp_path):
    """Locks out constraints of wrong types: LAMMPS's own count of clusters is that of the bodies in the data file."""
    scene = paper_peptide.scene()
    found, _ = paper.do(trajectory("shake", steps=0, scene=scene, dt=1.0), tmp_path, 100, Silent())
    assert found.error is None
    sizes = Counter(Counter(found.positions["bodies"][found.positions["bodies"] > 0].tolist()).values())
    log = next(tmp_path.rglob("log.lammps")).read_text()
    for words, number in (("size 2", sizes[2]), ("size 4", sizes[4]), ("frozen angles", sizes[3])):
        line = next(line for line in log.splitlines() if words in line)
        assert int(line.split()[0]) == number, line


def test_helix_is_seen_and_its_loss_too(tmp_path):
    """Locks out atoms in another order, nanometres for Angstrom, a distance that turning changes, and a helix where there is none."""
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
            text += f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{len(frame)}\nITEM: BOX BOUNDS\n0 1\n0 1\n0 1\nITEM: ATOMS id xu yu zu\n{rows}\n"
        (folder / "helix.dump").write_text(text)
    found = paper_peptide.helix(pieces, 0.5)
    assert found["time"].tolist() == [0.0, 5.0, 10.0]
    assert found["helical"][0] >= 8 and found["helical"][1] == found["helical"][0] and found["helical"][2] < 4
    assert found["rmsd"][1] < 0.01 < 1.0 < found["rmsd"][2]


def test_all_files_are_written(tmp_path):
    """Locks out a report that fails where much is missing, and one that asks for other files."""
    found = dimers(1.5)
    summary = {"interrupted": True, "command": "x", "date": "x", "machine": {}, "versions": {}, "lengths": dataclasses.asdict(paper.SHORT)}
    summary |= paper_claims.judge(found)
    paper_report.write(summary, found, tmp_path)
    assert (tmp_path / "figure_2a.png").stat().st_size > 10000 and not (tmp_path / "figure_3.png").exists()
    page = (tmp_path / "report.html").read_text()
    assert "data:image/png;base64," in page and 'src="http' not in page
    assert sum(path.stat().st_size for path in tmp_path.iterdir() if path.suffix != ".html") < 300_000
    assert "holds" in (tmp_path / "claims.csv").read_text()


def test_plans_are_what_the_paper_has():
    """Locks out another step or a shorter run than the paper's, and two trajectories that write to one folder."""
    plan = list(paper.plan(paper.FULL, 2, Path("x")))
    assert len({one.name for one in plan}) == len(plan)
    named = {one.name: one for one in plan}
    for name, dt, ps in ("dimer-nosquish-1", 0.3, 300), ("peptide-nosquish", 3.0, 300), ("peptide-shake", 3.0, 300), ("water-nosquish", 3.0, 1000):
        assert named[name].dt == dt and named[name].steps * dt / 1000 >= ps
