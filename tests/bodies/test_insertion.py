"""Atoms that come and go: bodies follow, against LAMMPS's fix rigid/nve/small in the same run."""

import numpy as np
import pytest

from support.endings import assert_ended
from support.insertion import (
    DEPOSIT,
    EVAPORATE,
    GCMC,
    MASSES,
    MOLECULE,
    MOLECULES,
    OURS,
    SCRIPT,
    THEIRS,
)
from validation.scenes.integrators import target


@pytest.fixture
def compared(run_lammps, tmp_path):
    """A function that runs a script with each of several fixes, and gives what each leaves:
    thermodynamics and atoms (id, mol, type, x, v)."""

    def run(*fixes, ranks=1, **words):
        defaults = {
            "style": "molecular", "edge": 8, "masses": MASSES, "first": "", "run": "run 100",
            "changes": "", "files": {},
        }  # fmt: skip
        words = defaults | words
        files, left = {"mol.bent": MOLECULE} | words.pop("files"), []
        for fix in fixes:
            done = run_lammps(SCRIPT.format(fix=fix, **words), files=files, ranks=ranks)
            lines = (tmp_path / "end").read_text().splitlines()[9:]
            atoms = np.array([line.split() for line in lines], float).reshape(-1, 9)
            left.append((done.thermo, atoms))
        return left

    return run


def assert_same(left, names=("Atoms", "Temp", "PotEng", "TotEng"), tolerance=1e-9, edge=8):
    (thermo, atoms), (of_theirs, theirs) = left
    assert np.array_equal(atoms[:, :3], theirs[:, :3])
    apart = atoms[:, 3:] - theirs[:, 3:]
    apart[:, :3] -= edge * np.rint(apart[:, :3] / edge)
    assert np.abs(apart).max(initial=0) < tolerance
    for name in names:
        np.testing.assert_allclose(thermo[name], of_theirs[name], rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("first", [0, 12])
def test_deposit(compared, first, ranks):
    """Locks out bodies that do not come with their atoms, into an empty box, too, and degrees of
    freedom that are not those of the bodies there are."""
    words = {"first": MOLECULES.format(first) if first else "", "ranks": ranks}
    left = compared(OURS, THEIRS, changes=DEPOSIT, **words)
    assert left[0][0]["Atoms"][-1] == 3 * (first + 12)
    assert_same(left)


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("words", ["separate yes", "separate no", "thermostat csvr seed 5"])
def test_thermostat_of_an_empty_box(compared, words, ranks):
    """Locks out a run that ends because there is nothing yet, or no rotation, that a thermostat
    could scale: the first molecule comes into an empty box, and does not rotate."""
    fix = f"fix 1 mols rigid/nvt/small/nosquish molecule mol bent temp 1 1 0.1 {words}"
    row = MOLECULE.replace("-0.3 -0.4 -0.1", "0 0 0").replace("-0.5 0.6 0.2", "-0.8 0.2 0.1")
    files = {"mol.bent": row}  # what comes has no rotation, not even by rounding
    ((thermo, _),) = compared(fix, changes=DEPOSIT, run="run 400", ranks=ranks, files=files)
    assert thermo["Atoms"][0] == 0 and thermo["Atoms"][-1] == 36
    assert abs(thermo["Temp"][8:].mean() - 1.0) < 0.5


def test_one_of_several_templates(compared):
    """Locks out the first template that the script has defined, in the place of the one that the
    fix line names."""
    masses = f"{MASSES}\nmolecule small mol.small"
    files = {"mol.small": MOLECULE.replace("-0.3 -0.4", "-0.2 -0.3")}
    assert_same(compared(OURS, THEIRS, changes=DEPOSIT, masses=masses, files=files))


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_gcmc(compared, ranks):
    """Locks out bodies that stay when fix gcmc takes their atoms, in the step in which others
    come."""
    ours = OURS.replace("123", "321")  # LAMMPS sorts the axes of a template's body the other way
    left = compared(ours, THEIRS, changes=GCMC.format(-3), ranks=ranks)
    assert len(np.unique(left[0][0]["Atoms"])) > 3
    assert_same(left)


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_evaporate(compared, ranks):
    """Locks out bodies that stay when their atoms are deleted, to the last one."""
    first = MOLECULES.format(9)
    left = compared(OURS, THEIRS, first=first, changes=EVAPORATE, ranks=ranks)
    assert left[0][0]["Atoms"][-1] == 0
    assert_same(left)


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_points(compared, ranks):
    """Locks out atoms of keyword flexible that come and go and are not moved, or moved twice."""
    first = (
        MOLECULES.format(12)
        + "\nregion top block 0 8 0 8 7 8\ngroup gas empty\ngroup bodies type 1 2"
    )
    changes = (
        "fix 2 gas deposit 9 1 10 4567 region top near 0.5 vz -2 -1 vx -1 1 vy -1 1 units box\n"
        "fix 3 gas evaporate 25 1 box 4928"
    )
    theirs = "fix 1 bodies rigid/nve/small molecule\nfix 9 gas nve"
    ours = "fix 1 bodies nosquish/nve molecule flexible gas order 123"
    left = compared(ours, theirs, first=first, changes=changes, ranks=ranks)
    assert left[0][0]["Atoms"][-1] == 36 + 9 - 4
    assert_same(left)


NVT = "fix 1 mols nosquish/nvt molecule mol bent temp 1 1 1e-1 {}"


@pytest.mark.parametrize("ranks", [1, 4])
@pytest.mark.parametrize(
    "fix",
    [
        OURS,
        NVT.format("seed 4928"),
        NVT.format("thermostat csvr seed 4928"),
        NVT.format("thermostat nh"),
        NVT.format("thermostat nh separate yes"),
    ],
)
def test_two_parts(compared, fix, ranks):
    """Locks out degrees of freedom of a thermostat, and a rotation, that stay those of the bodies
    with which the run began: in a second run they are of those that there are."""
    first, changes = MOLECULES.format(12), DEPOSIT
    one, two = (
        compared(fix, first=first, changes=changes, run=run, ranks=ranks)[0]
        for run in ("run 100", "run 50\nrun 50")
    )
    assert two[0]["Atoms"][0] < two[0]["Atoms"][4]
    assert_same([(one[0][-1:], one[1]), (two[0][-1:], two[1])], ("Atoms", "Temp"))


def test_table_and_switches(compared, tmp_path):
    """Locks out a table of bodies without those that came, and switched off forces that act on
    them."""
    words = "force * off off off torque * off off off output 50 v_table"
    fix = f"variable table string t.csv\n{OURS} {words}"
    ((thermo, _),) = compared(fix, changes=DEPOSIT, run="run 150", first=MOLECULES.format(4))
    assert np.ptp(thermo["Temp"][-2:]) < 1e-7 < np.ptp(thermo["PotEng"][-2:])
    steps = np.loadtxt(tmp_path / "t.csv", delimiter=",", skiprows=1, usecols=0)
    assert [(steps == step).sum() for step in (0, 50, 100, 150)] == [4, 11, 16, 16]


# the same, of spheres
SPHERES = (
    MOLECULE.replace("3 2\n", "3 1\n").replace("2 2\n", "2 1\n")
    + """
Diameters

1 1
2 1
3 1

Masses

1 0.5
2 0.5
3 0.5
"""
)


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_pour(compared, ranks):
    """Locks out spheres that come into an empty box without torque and spin, and granular forces
    that do not know the masses of inserted bodies.

    Bodies that fix rigid/nve/small takes from a template have the axes in the other order.
    """
    first = (
        "comm_modify vel yes\nchange_box all boundary p p f\n"
        "pair_style gran/hooke 2000.0 NULL 50.0 NULL 0.5 0\npair_coeff * *\n"
    )
    changes = (
        "fix 7 mols gravity 1.0 vector 0 0 -1\n"
        "region slab block 1 7 1 7 3 6.8 units box\n"
        "fix 2 mols pour 12 0 4767548 vol 0.8 20 region slab mol bent rigid 1\n"
        "fix 8 mols wall/gran hooke 2000.0 NULL 50.0 NULL 0.5 0 zplane 0 NULL\n"
    )
    left = compared(
        OURS.replace("order 123", "order 321"),
        THEIRS,
        style="sphere\natom_modify map array",
        masses="fix 6 all property/atom mol ghost yes",
        first=first,
        changes=changes,
        files={"mol.bent": SPHERES},
        ranks=ranks,
        run="compute s all temp/sphere\ncompute_modify s dynamic/dof yes\nthermo_modify temp s\n"
        "timestep 0.005\nrun 600",
    )
    assert left[0][0]["Atoms"][-1] == 36
    assert_same(left, ("Atoms", "Temp"))


def test_between_runs(compared):
    """Locks out bodies of the last run that stand in the way of atoms that a script inserts and
    deletes, whether bodies are made anew or not."""
    again = (
        "run 30\ncreate_atoms 0 single 7.5 7.5 7.5 mol bent 99\nset mol 10 vx 0.5 vy 0.2 vz -0.1\n"
        "group out molecule 2 5\ndelete_atoms group out\nrun 70"
    )
    first = MOLECULES.format(9)
    anew = again.replace("\nrun 70", f"\nunfix 1\n{THEIRS}\nrun 70")
    theirs = compared(THEIRS, first=first, run=anew)
    for words in "", " reinit no":
        ours = compared(f"{OURS}{words}", first=first, run=again)
        assert_same([*ours, *theirs])


@pytest.mark.parametrize("ranks", [1, 4])
def test_new_atom_ids_between_runs(compared, ranks):
    """Locks out a run that ends in error because bodies of the last one have atoms with new IDs."""
    deleted = "run 30\ngroup out molecule 2 5\ndelete_atoms group out\n{}run 40"
    theirs, ours = (
        compared(fix, first=MOLECULES.format(9), run=deleted.format(reset), ranks=ranks)[0][0]
        for fix, reset in ((THEIRS, ""), (f"{OURS} reinit no", "reset_atoms id\n"))
    )
    for name in "Temp", "PotEng", "TotEng":
        np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-9)


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("fix", ["fix 1 mols rigid/nve/small/nosquish molecule mol bent", OURS])
def test_molecule_ids_that_were_reset(compared, fix, ranks):
    """Locks out an end of the run where a new molecule gets the ID that a body was defined with,
    whose atoms have another one since: it is a body of its own, as with LAMMPS's fix."""
    run = "run 30\ngroup out molecule 2 5\ndelete_atoms group out\nreset_atoms mol all\nrun 70"
    first = MOLECULES.format(9)
    left = compared(fix, THEIRS, changes=DEPOSIT, first=first, run=run, ranks=ranks)
    assert left[0][0]["Atoms"][-1] > left[0][0]["Atoms"].min()
    assert_same(left)


# as LAMMPS's example rigid/in.rigid.gravity has it
OWN = MOLECULE.replace(
    "3 atoms\n", "3 atoms\n2.1 mass\n0.2 0.1 -0.15 com\n0.9 1.1 1.3 0.1 -0.05 0.2 inertia\n"
)
OTHER = OWN.replace("2.1 mass", "4.2 mass").replace("0.9 1.1", "1.4 1.2")


SPLIT_AS_THEIRS = OURS.replace(" order 123", "")  # of such bodies their axes are the other way


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_template_with_a_mass_of_its_own(compared, ranks):
    """Locks out bodies with the mass, centre and inertia of their atoms, where their template has
    its own."""
    words = {"files": {"mol.bent": OWN}, "changes": DEPOSIT, "ranks": ranks}
    ours, theirs = compared(SPLIT_AS_THEIRS, THEIRS, **words)
    assert ours[0]["Atoms"][-1] == 36
    assert_same([ours, theirs], ("Atoms", "PotEng"))
    other = compared(THEIRS, **words | {"files": {}})[0]
    assert np.abs(theirs[1] - other[1]).max() > 0.01


@pytest.mark.parametrize("ranks", [1, 2])
def test_template_beside_bodies_of_the_start(compared, ranks):
    """Locks out bodies of the start that take from a template what inserted ones take: as with fix
    rigid/small they are made of their atoms."""
    words = {"files": {"mol.bent": OWN}, "changes": DEPOSIT, "ranks": ranks}
    words |= {"first": MOLECULES.format(6), "run": "timestep 0.0002\nrun 100"}
    left = compared(SPLIT_AS_THEIRS, THEIRS, **words)
    assert left[0][0]["Atoms"][-1] == 54
    assert_same(left, ("Atoms", "PotEng"), tolerance=1e-6)


@pytest.mark.parametrize("ranks", [1, 2])
def test_templates_that_are_several(compared, ranks):
    """Locks out the first molecule of a template in the place of the one that was inserted."""
    words = {
        "masses": f"{MASSES}\nmolecule both mol.bent mol.other", "ranks": ranks,
        "files": {"mol.bent": OWN, "mol.other": OTHER},
        "changes": DEPOSIT.replace("mol bent", "mol both molfrac 0.5 0.5"),
    }  # fmt: skip
    fixes = [fix.replace("mol bent", "mol both") for fix in (SPLIT_AS_THEIRS, THEIRS)]
    assert_same(compared(*fixes, **words), ("Atoms", "PotEng"))


def test_template_in_a_later_run(compared, run_lammps, tmp_path):
    """Locks out inserted bodies whose template is forgotten at the next run, as fix rigid/small
    forgets it, and in a restart file."""
    words = {"first": MOLECULES.format(6), "files": {"mol.bent": OWN}, "changes": DEPOSIT}
    one = compared(OURS, run="run 150", **words)[0]
    two = compared(OURS, run="run 120\nwrite_restart kept\nrun 30", **words)[0]
    assert np.array_equal(one[1], two[1])
    again = (
        "read_restart kept\nneigh_modify delay 0 every 1 check yes exclude molecule/intra all\n"
        "variable file string kept.rigid\nmolecule bent mol.bent\ntimestep 0.002\n"
        f"{OURS.replace(' mol bent', ' infile v_file')}\n"
        "thermo_style custom step atoms\nrun 30\n"
        "write_dump all custom end id mol type x y z vx vy vz modify sort id format float %.17g"
    )
    run_lammps(again)
    atoms = np.loadtxt(tmp_path / "end", skiprows=9)
    assert_same([(one[0], atoms), one], (), tolerance=1e-8)


def test_molecule_that_is_no_body(refused):
    """Locks out a molecule of a template whose parts are bodies by themselves."""
    parts = OWN + "\nMolecules\n\n1 1\n2 1\n3 2\n"
    script = SCRIPT.format(
        style="molecular", edge=8, masses=MASSES, first="", changes=DEPOSIT, fix=OURS, run="run 20"
    )
    refused(script, "has 2 atoms, of a molecule of 3 that was inserted", {"mol.bent": parts})


AMMONIA = """top

4 atoms

Coords

1 0.3 -0.3 -0.3
2 -0.3 0.3 -0.3
3 -0.3 -0.3 0.3
4 0 0 0

Types

1 2
2 2
3 2
4 1
"""


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("run", ["run 150", "run 70\nrun 80"])
def test_rotors_stay(run_lammps, tmp_path, run, ranks):
    """Locks out a rotation of symmetric tops that is exact until asymmetric bodies come, and split
    from then on, or from the next run on: what does not act on bodies does not change their way."""
    first = (
        "molecule top mol.top\npair_style zero 1.0\npair_coeff * *\n"
        "create_atoms 0 random 8 4928 inner overlap 1.2 maxtry 1000 mol top 777\n"
        "velocity all create 1.0 4711 loop geom"
    )
    ends = []
    for changes in "", DEPOSIT.replace("12 0 8", "5 0 20"):
        script = SCRIPT.format(
            style="molecular", edge=8, masses=MASSES, first=first, changes=changes, run=run,
            fix=OURS.replace(" order 123", ""),
        )  # fmt: skip
        done = run_lammps(script, files={"mol.bent": MOLECULE, "mol.top": AMMONIA}, ranks=ranks)
        assert done.thermo["Atoms"][-1] == 32 + 15 * bool(changes)
        lines = (tmp_path / "end").read_text().splitlines()[9:]
        ends.append(lines[:32])
    assert ends[0] == ends[1]


GEAR, NVE = target("Gear"), "nosquish/nve molecule"
MOVES = GCMC.format(-2).replace("12 0 0", "0 6 0").replace("rigid 1", "")
CASES = {
    "no such template": (f"{NVE} mol other", DEPOSIT, "no molecule template 'other'"),
    "no template": (NVE, DEPOSIT, "not using the same molecule template"),
    "constant pressure": (
        "nosquish/npt molecule mol bent temp 1 1 1 seed 1 iso 0 0 1 compressibility 1e-1", DEPOSIT,
        "bodies came or are gone by step 1, which the integrator",
    ),
    "Gear": (
        f'python/move "{GEAR} mols molecule mol bent"', DEPOSIT,
        "bodies came or are gone by step 1",
    ),
    "part of a body": (
        NVE, EVAPORATE.replace("molecule yes", ""), "is gone by step 10: it left",
    ),
    "moved": (
        f"{NVE} mol bent", MOVES,
        "away from where its rigid body has it",
    ),
}  # fmt: skip


@pytest.mark.parametrize("ranks", [1, 4])
@pytest.mark.parametrize("name", CASES)
def test_refused(run_lammps, tmp_path, name, ranks):
    """Locks out a hang, a message per rank and a silently wrong run where bodies cannot follow."""
    words, changes, says = CASES[name]
    script = SCRIPT.format(
        style="molecular", edge=8, masses=MASSES, first=MOLECULES.format(9), changes=changes,
        fix=f"fix 1 mols {words}", run="run 100",
    )  # fmt: skip
    run = run_lammps(script, files={"mol.bent": MOLECULE}, ranks=ranks, check=False)
    assert_ended(run, [says], tmp_path)


@pytest.mark.parametrize("header", ["", "2.1 mass\n0.2 0.1 -0.15 com\n0.9 1.1 1.3 0 0 0 inertia\n"])
def test_spheres_of_a_template_without_masses(run_lammps, header):
    """Locks out the crash that LAMMPS's own fix has where neither types nor the template give
    atoms a mass: spheres have that of density 1, bodies what the template says of them."""
    spheres = SPHERES[: SPHERES.index("Masses")].replace("3 atoms\n", f"3 atoms\n{header}")
    script = SCRIPT.format(
        style="sphere\natom_modify map array", edge=8, first="pair_style zero 1\npair_coeff * *",
        masses="fix 6 all property/atom mol ghost yes", fix=OURS,
        changes=f"{DEPOSIT.replace('12 0 8', '1 0 1')}\nfix 4 all addforce 0.1 0 0\n"
        "variable v equal vcm(all,x)",
        run="thermo_style custom step v_v\nrun 200",
    )  # fmt: skip
    v = run_lammps(script, files={"mol.bent": spheres}).thermo["v_v"]
    mass = 2.1 if header else 3 * np.pi / 6
    slope = (v[-1] - v[5]) / (0.002 * 20 * (len(v) - 6))
    assert slope == pytest.approx(0.3 / mass, rel=0.3 if header else 1e-6)


@pytest.mark.parametrize("place", ["0 0 0", "0.3 -0.2 0.1"])
def test_atoms_of_a_template(run_lammps, tmp_path, place):
    """Locks out single atoms that count as bodies of which a template says more than they tell: a
    next run would take no velocities over, and a restart file would have one beside it."""
    one = f"atom\n\n1 atoms\n\nCoords\n\n1 {place}\n\nTypes\n\n1 1\n"
    script = SCRIPT.format(
        style="molecular", edge=8, masses=MASSES, first="", changes=DEPOSIT, fix=OURS,
        run="run 100\nvelocity all set 0.5 0 0\nwrite_restart kept\nrun 10",
    )  # fmt: skip
    run = run_lammps(script, files={"mol.bent": one})
    assert run.thermo["Atoms"][-1] == 12 and "without effect" not in run.log
    assert not (tmp_path / "kept.rigid").exists()
