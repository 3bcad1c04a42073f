"""Rigid bodies beside atoms that fix shake holds, in a box that changes: bonds, energy, volumes."""

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from support.builds import NUMBER
from support.fixes import THERMOSTATS
from support.sampling import DUMP, FREE, SMOOTH, distance_of_ends, thermo
from validation.scenes.data_file import data_file

SHAPES = (  # of a body, of two kinds that shake holds, and of an atom by itself
    [[0, 0, 0], [0.6, 0.5, 0], [-0.6, 0.5, 0]],
    [[0, 0, 0], [0.8, 0, 0]],
    [[0, 0, 0], [0.7, 0.4, 0], [-0.7, 0.4, 0]],
    [[0, 0, 0]],
)
LENGTHS = {2: 0.8, 3: np.sqrt(0.65)}
CELL = "iso 12e-2 12e-2 2e-1 every 2"
BAROSTATS = {
    "crescale": f"{CELL} compressibility 8 dilate all",
    "mtk": f"{CELL} barostat mtk dilate all",
}


def words(thermostat, barostat):
    """The words of a fix line: crescale needs a seed, too, mtk with chains has no use for one."""
    given = THERMOSTATS[thermostat]
    seed = "seed 771 " if barostat == "crescale" and "seed" not in given else ""
    return f"{seed}{given} {BAROSTATS.get(barostat, '')}"


def system(side, spacing=2.6, tilt=0.0):
    """Molecules of the four kinds in turn on a lattice, across faces, and the begin of a script."""
    random, edge = np.random.default_rng(3), spacing * side
    x, molecule, kinds, bonds, angles = [], [], [], [], []
    for k, place in enumerate(np.ndindex(side, side, side)):
        kind, n = k % 4, len(x)
        shape = Rotation.random(random_state=random).apply(SHAPES[kind]) + spacing * np.array(place)
        x += [(a + tilt * b, b, c) for a, b, c in shape]
        molecule += [k + 1] * len(shape)
        kinds += [kind + 1] * len(shape)
        bonds += [(max(kind, 1), n + 1, n + j) for j in range(2, len(shape) + 1)]
        angles += [(1, n + 2, n + 1, n + 3)] * (kind == 2)
    columns, terms = [molecule, kinds, x], {"bonds": bonds, "angles": angles}
    how = {"tilt": (tilt * edge, 0, 0), "mass": (1.0, 1.5, 0.7, 1.0), "terms": terms}
    text = data_file("molecular", columns, (0, edge), **how)
    between = 2 * np.degrees(np.arctan2(0.7, 0.4))
    setup = (
        "units lj\natom_style molecular\nread_data data.test\n"
        f"bond_style harmonic\nbond_coeff 1 0 {LENGTHS[2]}\nbond_coeff 2 0 {LENGTHS[3]}\n"
        f"angle_style harmonic\nangle_coeff 1 0 {between:.15g}\nspecial_bonds lj 0 0 0\n"
        "group ours type 1\ngroup others subtract all ours\ngroup held type 2 3\n"
        "velocity all create 2.0 4928 loop geom\n"
    )
    return setup, {"data.test": text}


GAS = f"{FREE}comm_modify cutoff 2.5\n"  # longer than bonds
SHAKE = "fix hold held shake 1e-10 200 0 b 1 2 a 1\n"
ILVES = "fix hold held ilves 1e-10 25 0 b 1 2 a 1\n"
NVE = "fix move others nve\n"


def ours(words, name="npt"):
    return f"fix 1 ours nosquish/{name} molecule temp 2 2 2e-1 {words}\n"


@pytest.mark.parametrize("barostat", BAROSTATS)
@pytest.mark.parametrize("thermostat", ["langevin", "separate", "chains"])
def test_volumes_of_a_gas(run_lammps, thermostat, barostat):
    """Locks out a box that stretches bonds that shake holds, which then pull with forces of no
    potential, and a pressure that counts what atoms do within their molecule: a gas of free
    molecules has the gamma distribution of volumes, whatever holds them together."""
    setup, files = system(3)
    heat = "fix heat others langevin 2 2 0.2 9182\n"
    line = ours(words(thermostat, barostat))
    script = f"{setup}{GAS}{heat}{SHAKE}{NVE}timestep 0.004\n{line}{thermo('vol', 100)}run 40000\n"
    rows = run_lammps(script, files=files).thermo[20:]
    shape = (27 + 1, 0, 2.0 / 0.12)
    assert stats.kstest(rows["Volume"], "gamma", shape).pvalue > 1e-3, rows["Volume"].mean()


@pytest.mark.parametrize("thermostat", ["csvr", "nh", "chains"])
def test_energy_of_bodies_among_held_atoms(run_lammps, thermostat):
    """Locks out degrees of freedom without the bodies' total momentum, which atoms that shake holds
    change, and chains that such collisions drive: the kinetic energy is canonical."""
    setup, files = system(2)
    line = ours(words(thermostat, "none"), "nvt") + thermo("f_1[1] f_1[2]", 50)
    heat = "fix heat others langevin 2 2 0.5 9182\n"
    script = f"{setup}{SMOOTH}{heat}{SHAKE}{NVE}timestep 0.002\n{line}run 60000\n"
    rows = run_lammps(script, files=files).thermo[200:]
    energy = rows["f_1[1]"] + rows["f_1[2]"]
    shape = (2 * 6 / 2, 0, 2.0)
    assert stats.kstest(energy[::2], "gamma", shape).pvalue > 1e-3, energy.mean()


@pytest.mark.parametrize("barostat", ["none", *BAROSTATS])
@pytest.mark.parametrize("thermostat", ["langevin", "csvr", "nh"])
def test_energy(run_lammps, thermostat, barostat):
    """Locks out constraints that do work when the box changes: energy fell by 40 times what there
    was in 8 ps, with crescale; and sums of which ranks have a part each."""
    setup, files = system(3)
    name = "nvt" if barostat == "none" else "npt"
    line = ours(words(thermostat, barostat), name).replace("every 2", "every 1")
    line = line.replace("y 8", "y 4").replace("12e-2 2e-1", "12e-2 4e-1")
    line += thermo("etotal econserve vol", 20)
    script = f"{setup}{SMOOTH}{SHAKE}{NVE}timestep 0.001\n{line}run "
    rows = run_lammps(f"{script}1000\n", files=files).thermo[1:]  # behind shake's start
    assert barostat == "none" or np.ptp(rows["Volume"]) > 0.05 * rows["Volume"][0]
    assert rows["Econserve"].std() < 0.005 * rows["TotEng"].std()
    of_two = run_lammps(f"{script}100\n", files=files, ranks=2).thermo[1:]
    for column in "Econserve", "TotEng", "Volume":
        np.testing.assert_allclose(of_two[column], rows[column][: len(of_two)], rtol=1e-8)


@pytest.mark.parametrize("barostat", BAROSTATS)
def test_ranks_and_bonds(run_lammps, tmp_path, barostat):
    """Locks out molecules of which each rank moves its own atoms by another centre, molecules
    across a face that are pulled apart, and bonds of another length; wherever the fix that moves
    them stands."""
    setup, files = system(3, tilt=0.3)
    line = ours(
        words("langevin", barostat).replace("iso", "tri").replace("2e-1 every 2", "8e-1 every 2")
    )
    begin, end = f"{setup}{SMOOTH}timestep 0.002\n{SHAKE}", f"run 200\n{DUMP.format('end')}"
    before, behind = f"{begin}{NVE}{line}{end}", f"{begin}{line}{NVE}{end}"
    h = np.diag([7.8] * 3)
    h[0, 1] = 0.3 * 7.8
    assert distance_of_ends(run_lammps, tmp_path, [(before, n) for n in (1, 2, 4)], files, h) < 1e-9
    assert_bonds(tmp_path / "end")
    run_lammps(behind, files=files)
    assert_bonds(tmp_path / "end")


def assert_bonds(path):
    """Atoms that shake holds in a dump are as far from the first of their molecule as they were."""
    atoms = np.loadtxt(path, skiprows=9)
    x, molecule = atoms[:, 3:6], atoms[:, 1]
    for number in np.unique(molecule):
        kind, one = (int(number) - 1) % 4, x[molecule == number]
        lengths = np.linalg.norm(one[1:] - one[0], axis=1)
        if kind in (1, 2):
            np.testing.assert_allclose(lengths, LENGTHS[kind + 1], rtol=1e-8)


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("before", "cell", "says"),
    [
        (
            f"group some id 4\n{SHAKE}",
            "dilate some",
            "together with an atom that is not in its group",
        ),
        (
            f"{SHAKE}unfix hold\nfix hold held rigid/small molecule\n",
            "dilate all",
            "fix hold (style rigid/small) says where atoms are",
        ),
        *([(ILVES, "dilate all", "use fix shake, or leave them")] if NUMBER >= 20260704 else []),
    ],
)
def test_what_cannot_move_with_the_box(refused, before, cell, says, ranks):
    """Locks out a molecule of which half moves with the box, and bodies of fix rigid that stay
    where they are while the pressure counts them as moving."""
    setup, files = system(3)
    line = ours(f"seed 5 {CELL} compressibility 8 {cell}")
    refused(f"{setup}{GAS}{before}{line}timestep 0.002\nrun 20\n", says, files, ranks=ranks)
