"""User's scripts of five kinds: they begin as in LAMMPS, and each integrator moves them."""

import re
from pathlib import Path

import numpy as np
import pytest

from support import (
    scripts,
)
from support.endings import LINEAR
from support.harness import replaced, run_lmp, started, take, written
from validation.check import measure as check
from validation.compare import case as cases
from validation.running import lammps_log, run
from validation.user_script import atom_number

KINDS = ("spce", "co2", "rings", "polymer", "clusters")
BODIES = {"spce": 64, "co2": 125, "rings": 64, "polymer": 27, "clusters": 64}
ENSEMBLE = {"spce": "nvt", "co2": "npt", "rings": "nve", "polymer": "nvt", "clusters": "nve"}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.timeout(600)
def test_a_script_is_found_and_begins_as_in_lammps(kind, ranks, tmp_path):
    """Locks out a scene that is another system than the script's: the first step's energies are
    those that LAMMPS has where it stops in the script, and the user's files are as they were."""
    path = getattr(scripts, kind)(tmp_path)
    before = {one: one.read_bytes() for one in tmp_path.rglob("*") if one.is_file()}
    out = tmp_path / "out"
    own = take(path, out, ranks)
    assert own.bodies == BODIES[kind]
    assert own.rigid.state.ensemble == ENSEMBLE[kind]
    assert own.reference in own.integrators
    how = {"dt": own.scene.dt, "every": 1, "ranks": ranks}
    yours = own.integrators[own.reference]
    result = run.run(run.job(own.scene, yours, out / "yours", [2], **how))
    assert result.error is None
    after = {one: one.read_bytes() for one in tmp_path.rglob("*")
             if one.is_file() and out not in one.parents}  # fmt: skip
    assert before == after
    assert result.thermo["PotEng"][0] == pytest.approx(own.reading["potential"], rel=1e-9)
    assert result.positions.bodies.max() == own.bodies


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.timeout(900)
def test_each_integrator_moves_each_kind(kind, tmp_path, monkeypatch):
    """Locks out a line that LAMMPS or our fix does not take: all integrators do some steps, from
    the same temperature.

    New memory is full of large numbers, so nobody uses it before it is set (as the keyword
    langevin of LAMMPS's rigid/small does, of 22 Jul 2025).
    """
    monkeypatch.setenv("MALLOC_PERTURB_", "170")
    own = take(getattr(scripts, kind)(tmp_path), tmp_path / "out")
    kelvin = [row["temperature"] for row in started(own, tmp_path / "out")]
    assert np.ptp(kelvin) < 1e-3 * np.mean(kelvin)
    kinds = {one.kind for one in own.integrators.values()}
    assert kinds >= {"ours", "rigid"} and (kind != "spce" or "constraints" in kinds)


GCMC = """units real
atom_style full
region b block 0 20 0 20 0 20
create_box 2 b
mass 1 12
mass 2 16
molecule g mol.co2
pair_style lj/cut 6
pair_coeff * * 0.1 3
neigh_modify exclude molecule/intra all
create_atoms 0 random 9 88 NULL mol g 99 overlap 2
velocity all create 300 771
fix int all rigid/nvt/small molecule mol g temp 300 300 50
fix mc all gcmc 5 9 0 0 5431 300 -1 1 mol g pressure 900 rigid int group all tfac_insert 1.6667
run 9
"""


@pytest.mark.parametrize(
    "insert",
    [
        "gcmc 5 9 0 0 5431 300 -1 1 mol g pressure 900 rigid int group all tfac_insert 1.6667",
        "deposit 90 0 2 5431 mol g rigid int region b near 2",
    ],
)
def test_a_fix_that_inserts_molecules_finds_the_bodies_fix(tmp_path, insert):
    """Locks out rows that know no template, so that molecules which come are no bodies: a fix
    replaced that of a grand canonical script without its keyword mol, as one that others lack; and
    a fix that refuses its own state, because steps count from 0 after an earlier run."""
    (tmp_path / "mol.co2").write_text(LINEAR)
    path = written(tmp_path, re.sub(r"(?<=fix mc all ).*", insert, GCMC) + "run 9\n")
    own = take(path, tmp_path / "out", at=1 + insert.startswith("deposit"))
    started(own, tmp_path / "out", only=("nosquish", own.reference))
    for name in "nosquish", own.reference:
        folder = tmp_path / "out" / "runs" / run.folder_name(name)
        counted = lammps_log.timings((folder / "log.lammps").read_text())[-1].atoms
        assert counted > len(own.atoms["x"]), name  # molecules came
    assert "mol g" in own.integrators["nosquish"].lines[-1]
    assert not any("mol g" in note for note in own.notes if note.startswith("Keywords"))


def test_compare_leaves_out_what_inserts_molecules(tmp_path):
    """Locks out a comparison whose runs all fail, because atoms come, and the advice to try shorter
    steps."""
    (tmp_path / "mol.co2").write_text(LINEAR)
    own = take(written(tmp_path, GCMC), tmp_path / "out")
    told: list[str] = []
    same = atom_number.with_constant_atoms(own, told.append)
    assert "Left out" in told[0] and "fix mc all gcmc 5 9" in told[0] and told[0] in same.notes
    assert "mol g" in same.integrators[own.reference].lines[-1]
    job = check._job(same, same.integrators[own.reference], tmp_path / "run", 9)
    assert run.run(job).error is None
    log = (tmp_path / "run" / "log.lammps").read_text()
    assert lammps_log.timings(log)[-1].atoms == len(own.atoms["x"])


BESIDE = """units lj
atom_style molecular
lattice sc 0.4
region b block 0 6 0 6 0 6
create_box 2 b
mass * 1
molecule d mol.dimer
pair_style lj/cut 2.5
pair_coeff * * 1 1
neigh_modify exclude molecule/intra all
region left block 0 2.9 0 6 0 6
region right block 2.9 6 0 6 0 6
create_atoms 1 region right
create_atoms 0 region left mol d 99
group dimers type 2
group solvent type 1
velocity all create 1.5 771
fix 1 dimers rigid/small molecule langevin 1.5 1.5 1 4
fix 2 solvent npt temp 1.5 1.5 1 iso 2 2 5
variable twice equal c_k*2
compute k all ke/rigid 1
fix out all ave/time 1 1 1 v_twice file energies
thermo_style custom step temp press vol c_k v_twice
timestep 0.002
run 9
"""
DIMER = """dimer

2 atoms

Coords

1 0 0 0
2 0.6 0 0

Types

1 2
2 2
"""


def test_a_barostat_beside_a_rigid_fix(tmp_path):
    """Locks out rows that LAMMPS or our fix refuses, or that lose the barostat, where fix npt moves
    the other atoms; and rows without a rigid fix that its computes ask for."""
    (tmp_path / "mol.dimer").write_text(DIMER)
    own = take(written(tmp_path, BESIDE), tmp_path / "out")
    assert own.rigid.ids == ("1", "2") and own.rigid.state.ensemble == "npt"
    (line,) = own.integrators["nosquish"].lines
    assert " nosquish/npt " in line and " flexible solvent" in line
    assert {"rigid/npt", "rigid/npt/small", own.reference} <= own.integrators.keys()
    started(own, tmp_path / "out")
    for name in own.integrators:
        thermo = run.collect(tmp_path / "out" / "runs" / run.folder_name(name)).thermo
        assert thermo["PotEng"][0] == pytest.approx(own.reading["potential"], rel=1e-9), name
        assert thermo["Temp"][0] == pytest.approx(own.reading["temperature"], rel=1e-6), name
        assert thermo["Density"][-1] != thermo["Density"][0], name  # the box changes
    assert any("only report numbers of rigid fixes: variable twice" in one for one in own.notes)


FORMS = {
    "off and on": ("suffix nosquish\nsuffix off\nsuffix on", True),
    "off": ("suffix nosquish\nsuffix off", False),
    "hybrid, the other first": ("suffix hybrid omp nosquish", True),  # omp has no such fix
}


@pytest.mark.parametrize("form", FORMS)
def test_a_script_with_the_suffix_has_the_rows_of_one_without(form, taken, tmp_path):
    """Locks out rows named after LAMMPS's fixes that ours have run, with our pressures, as the
    script's suffix has it; and a script's own fix that is told, and left out of the energies, as
    LAMMPS's. Each row is that of the script without a suffix."""
    words, acts = FORMS[form]
    path = replaced(scripts.rings(tmp_path), "fix bodies", f"{words}\nfix bodies")
    path.write_text(f"package omp 1\n{path.read_text()}")
    own, results = take(path, tmp_path / "out"), {}
    for one in own, taken("rings"):
        kept = {"yours", "nosquish", "rigid/nve", "rigid/nve/small"} & one.integrators.keys()
        rows = started(one, Path(one.scene.overlay).parents[1], only=sorted(kept))
        results[one is own] = {row["label"]: row["pressure"] for row in rows}
    with_it, without = results[True], results[False]
    yours = with_it.pop("yours: nosquish/nve", None)
    assert with_it == pytest.approx(without, rel=1e-6) and len(without) == 3
    assert without["nosquish/nve"] != pytest.approx(without["rigid/nve"], rel=1e-2)
    assert yours == (pytest.approx(without["nosquish/nve"], rel=1e-6) if acts else None)
    told = " ".join(check._suffix(own, tmp_path / "out", 1, 300.0))
    says = "{} fix bodies (rigid/nve/small) {}"
    acted, did_not = ("The suffix nosquish replaces", "by"), ("", "is LAMMPS's own")
    assert says.format(*acted if acts else did_not) in told
    usual = {"yours" if acts else "nosquish", "rigid/nve/small"}  # ours and LAMMPS's
    assert set(cases.of_script(own).usual) == usual


TEMPERATURES = {
    "of spheres": "compute t all temp/sphere\nthermo_modify temp t",
    "beside other words": "compute t all temp/sphere\nthermo_modify temp t lost warn flush yes",
    "of a part": "compute c all temp/com\ncompute_modify c extra/dof -300\n"
    "compute t all temp/sphere bias c\n"
    "compute p all pressure t\n"
    "thermo_style custom step temp press\nthermo_modify temp t press p line one",
    "with other degrees of freedom": "compute t all temp/sphere\ncompute_modify t extra/dof 9\n"
    "compute_modify thermo_temp extra/dof 100\nthermo_modify temp t",
    "by fix_modify": "compute t all temp/sphere\nthermo_modify temp t\n"
    "fix wall all wall/lj93 zlo EDGE 1 1 2.5\nfix_modify wall virial yes",
}


@pytest.mark.parametrize("which", TEMPERATURES)
def test_temperature_and_pressure_are_the_scripts(which, tmp_path):
    """Locks out temperatures and pressures of other computes than the script's, by which bodies of
    spheres cannot even begin: held against what LAMMPS prints for the script itself."""
    lines = f"{TEMPERATURES[which]}\nthermo_modify norm no"
    path = scripts.spheres(tmp_path, lines)
    if "wall" in lines:
        replaced(path, "lattice", "boundary p p f\nlattice")
    run_lmp(path, "-log", "log")
    theirs = lammps_log.thermo((tmp_path / "log").read_text())
    own = take(path, tmp_path / "out")
    assert own.reading["temperature"] == pytest.approx(theirs["Temp"][0], rel=1e-5)
    rows = started(own, tmp_path / "out")
    assert len(rows) > 3
    for row in rows:
        assert row["temperature"] == pytest.approx(theirs["Temp"][0], rel=1e-5), row["label"]
    assert own.integrators[rows[0]["name"]].kind == "rigid"  # the script's own
    assert rows[0]["pressure"] == pytest.approx(theirs["Press"][0], rel=1e-4)
