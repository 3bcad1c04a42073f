"""Fix nosquish/pairs beside LAMMPS's own loop over pairs of atoms, in the same process."""

import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.special import erfc

from support.endings import assert_ended
from support.running import ROOT, read_thermo
from support.scripts import DEGREE, data, on_lattice

HALF = 104.52 * DEGREE / 2
ARM = 0.9572 * np.array([np.sin(HALF), np.cos(HALF), 0])
WATER = np.array([[0, 0, 0], ARM, ARM * [-1, 1, 1]])
CO2 = np.array([[0, 0, 0], [1.16, 0, 0], [-1.16, 0, 0]])
RING = 1.39 * np.array([[np.cos(k * 60 * DEGREE), np.sin(k * 60 * DEGREE), 0] for k in range(6)])
CHARGES = [-0.834, 0.417, 0.417]
MASSES = [15.9994, 1.008, 12.0]
EDGE = 3.104  # of a cube with one molecule of water
PAIRS = "fix pairs all nosquish/pairs\n"
MIXED = "fix pairs all nosquish/pairs precision mixed\n"
TENSOR = "pxx pyy pzz pxy pxz pyz"
THERMO = (
    f"thermo_style custom step evdwl ecoul pe {TENSOR}\nthermo_modify format float %.17g norm no\n"
)
END = "write_dump all custom {} id x y z fx fy fz modify sort id format float %.17g\n"


def water(path, number=4):
    x, edge = on_lattice(WATER, number, EDGE, 1)
    bonds, angles = [(1, 0, 1), (1, 0, 2)], [(1, 1, 0, 2)]
    data(path, x, edge, [1, 2, 2], CHARGES, MASSES[:2], bonds, angles)


def mixture(path):
    """Water, CO2 of the same number of atoms, rings of six and single atoms; IDs in no order."""
    x, edge = on_lattice(WATER, 4, EDGE, 1)
    rows, number = [], 0
    for molecule, place in enumerate(x.mean(axis=1)[:40], 1):
        shape, kinds, charges = [
            (WATER, [1, 2, 2], CHARGES),
            (CO2, [3, 1, 1], [0.7, -0.35, -0.35]),
            (RING[:1] * 0, [3], [0.2]),
            (0.6 * RING, [3, 2] * 3, [0.1, -0.1] * 3),
        ][molecule % 4]
        for kind, charge, site in zip(kinds, charges, shape @ np.linalg.qr(x[molecule])[0]):
            number += 1
            at = " ".join(f"{value:.12f}" for value in 1.5 * place + site)
            rows.append(f"{number} {41 - molecule} {kind} {charge} {at}")
    np.random.default_rng(3).shuffle(rows)
    masses = "\n".join(f"{k} {mass}" for k, mass in enumerate(MASSES, 1))
    box = "\n".join(f"0 {1.5 * edge} {a}lo {a}hi" for a in "xyz")
    path.write_text(
        f"of a test\n\n{len(rows)} atoms\n3 atom types\n{box}\n\nMasses\n\n{masses}\n\nAtoms\n\n"
        + "\n".join(rows) + "\n"
    )  # fmt: skip


def lattice(path):
    """Linear molecules whose centres are on faces of the box, with site 0 at either end."""
    x, edge = on_lattice(CO2, 3, 4.3, 2)
    x = (x - 0.5 * 4.3)[:, [1, 0, 2]]
    x[::2] = x[::2, ::-1]
    data(path, x, edge, [2, 1, 2], [-0.35, 0.7, -0.35], MASSES[:2])


def solute(path):
    """CO2 across the middle of the box, between single atoms."""
    x, edge = on_lattice(CO2[:1], 4, 4.0, 2)
    data(path, x, edge, [1], [0.0], MASSES[:2])
    text = path.read_text().replace("64 atoms", "67 atoms")
    middle = [
        f"{65 + k} 65 2 {q} {8 + x} 8.1 8.2"
        for k, (q, x) in enumerate(((0.7, 0), (-0.35, 1.16), (-0.35, -1.16)))
    ]
    path.write_text(text + "\n".join(middle) + "\n")


LJ = "pair_coeff 1 1 0.1521 3.15\npair_coeff 2 2 0.046 0.4\n"
MIX = "pair_modify mix arithmetic\n"
LONG = f"{LJ}kspace_style pppm 1e-4\npair_modify table 0\n"
BONDS = "bond_style zero\nbond_coeff * 0.9572\nangle_style zero\nangle_coeff * 104.52\n"
SPECIAL = BONDS + "special_bonds lj/coul 0 0 0\n"
FACTORS = BONDS + "special_bonds lj/coul 0 0.4 0\n"
APART = "neigh_modify exclude molecule/intra all\n"
MOVED = "change_box all x final {0} {1} y final {0} {1} z final {0} {1}"
TILTED = "change_box all triclinic xy final 3.0 xz final -2.0 yz final 1.0 remap units box\n"


class Scene(NamedTuple):
    """The lines after read_data, what makes the data file, and lines before read_data."""

    lines: str
    make: Callable[[Path], None] = water
    before: str = ""

    @property
    def script(self):
        start = f"units real\natom_style full\nneighbor 1.0 bin\n{self.before}\n"
        return f"{start}read_data data.liquid\n{self.lines}"


SCENES = {
    "lj/cut/coul/long": Scene(f"pair_style lj/cut/coul/long 5.0 6.0\n{LONG}{SPECIAL}"),
    "factors": Scene(f"pair_style lj/cut/coul/long 6.0\n{LONG}{FACTORS}"),
    "shift": Scene(f"pair_style lj/cut/coul/long 6.0\n{LONG}pair_modify shift yes\n{APART}"),
    "lj/charmm/coul/long": Scene(
        f"pair_style lj/charmm/coul/long 4.0 5.5 6.0\n{MIX}{LONG}{SPECIAL}"
    ),
    "lj/cut/coul/cut": Scene(f"pair_style lj/cut/coul/cut 5.0 6.0\n{LJ}{APART}"),
    "own cutoffs": Scene(
        f"pair_style lj/cut/coul/cut 5.0\n{LJ}pair_coeff 1 2 0.08 1.7 4.0 5.5\n{APART}"
    ),
    "lj/cut": Scene(f"pair_style lj/cut 6.0\n{LJ}{SPECIAL}"),
    "empty ranks": Scene(
        f"change_box all x final 0 60\npair_style lj/cut/coul/cut 6.0\n{LJ}{FACTORS}",
        lambda path: water(path, 2),
    ),
    "several images": Scene(
        f"pair_style lj/cut/coul/long 10.0\n{LONG}{APART}", lambda path: water(path, 3)
    ),
    "newton off": Scene(f"pair_style lj/cut/coul/long 6.0\n{LONG}{SPECIAL}", before="newton off"),
    "one octant": Scene(
        f"{MOVED.format(0, 60)}\npair_style lj/cut/coul/cut 6.0\n{LJ}{SPECIAL}",
        lambda path: water(path, 8),
        "newton off",
    ),
    "far away": Scene(
        f"{MOVED.format(2000, 2000 + 4 * EDGE)} remap\npair_style lj/cut/coul/cut 6.0\n{LJ}{APART}"
    ),
    "triclinic": Scene(
        f"{TILTED}pair_style lj/cut/coul/long 6.0\n{LONG}kspace_style ewald 1e-4\n{APART}"
    ),
    "lattice": Scene(f"pair_style lj/cut/coul/cut 6.0 8.0\n{LJ}{APART}", lattice),
    "solute": Scene(f"pair_style lj/cut/coul/cut 6.0 8.0\n{LJ}{APART}", solute),
    "mixture": Scene(
        f"pair_style lj/cut/coul/long 5.0 7.0\n{MIX}{LONG}pair_coeff 3 3 0.1 3.0\n{APART}", mixture
    ),
}


@pytest.fixture
def both(run_lammps, tmp_path):
    """A function that runs a scene without and with the fix, and gives the thermo tables, the last
    atoms and the log."""

    def run(scene, lines, fix=PAIRS, **how):
        scene.make(tmp_path / "data.liquid")
        parts = [
            f"clear\n{scene.script}{THERMO}{own}{lines}\n{END.format(name)}"
            for own, name in (("", "plain"), (fix, "ours"))
        ]
        log = run_lammps('\nprint "OTHER"\n'.join(parts), **how).log
        tables = [read_thermo(part) for part in re.split(r"^OTHER$", log, flags=re.M)]
        return tables, [np.loadtxt(tmp_path / name, skiprows=9) for name in ("plain", "ours")], log

    return run


def assert_alike(tables, atoms, tolerance=1e-10, of_sums=1):
    """Energies, pressures and forces, relative to the largest of their kind; in the sums positive
    and negative numbers cancel, so their tolerance can be larger."""
    plain, ours = tables
    for names in ["E_vdwl"], ["E_coul"], ["PotEng"], TENSOR.replace("p", "P").split():
        one, other = (np.array([table[name] for name in names]) for table in (ours, plain))
        largest = np.abs(other).max()
        np.testing.assert_allclose(one, other, rtol=0, atol=of_sums * tolerance * largest)
    for columns in slice(1, 4), slice(4, 7):
        one, other = atoms[1][:, columns], atoms[0][:, columns]
        np.testing.assert_allclose(one, other, rtol=0, atol=tolerance * np.abs(other).max())


@pytest.mark.quick("1-lj/cut/coul/long")
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("ranks", [1, 2, 4, 8])
def test_same_as_the_style(both, scene, ranks):
    """Locks out a wrong force, energy or virial, pairs left out or counted twice between ranks and
    images, wrong factors within molecules, and species taken for each other."""
    tables, atoms, log = both(SCENES[scene], "run 0", ranks=ranks)
    assert "Fix pairs nosquish/pairs: computes pair_style" in log
    assert_alike(tables, atoms)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("ranks", [1, 2])
def test_mixed_precision(both, scene, ranks):
    """Locks out forces with an error above 1e-5, and a word that does nothing."""
    tables, atoms, log = both(SCENES[scene], "run 0", fix=MIXED, ranks=ranks)
    assert "in mixed precision" in log
    assert_alike(tables, atoms, 1e-5, of_sums=10)
    one, other = atoms[1][:, 4:7], atoms[0][:, 4:7]
    assert np.abs(one - other).max() > 1e-8 * np.abs(other).max()


@pytest.mark.parametrize("energy", [1e-60, 1e60])
def test_mixed_precision_is_not_enough(both, energy):
    """Locks out coefficients that are 0 or infinite in single precision."""
    scene = Scene(f"pair_style lj/cut 6.0\npair_coeff * * {energy} 0.5\n{SPECIAL}")
    tables, atoms, log = both(scene, "run 0", fix=MIXED)
    assert "LAMMPS computes the pairs: its results differ" in log
    assert_alike(tables, atoms, 1e-15)


def test_lists_of_steps_with_energies_of_each_atom(both, tmp_path):
    """Locks out a list that is made while two atoms are far from each other, and used again after
    they have come within the cutoff."""
    scene = Scene(
        f"pair_style lj/cut 6.0\n{LJ}neighbor 2.0 bin\nneigh_modify every 1 delay 0 check yes\n",
        lambda path: data(
            path, np.array([[[1.0, 5, 5]], [[8.2, 5, 5]]]), 30.0, [1], [0.0], MASSES[:2]
        ),
    )
    moves = (
        "reset_timestep 10\ntimestep 1.0\ngroup left id 1\ngroup right id 2\n"
        "fix 1 left move wiggle -0.99 0 0 80\nfix 2 right move wiggle 0.99 0 0 80\n"
        f"compute e all pe/atom pair\ndump 1 all custom 40 {tmp_path / 'energies'} c_e\n"
        "thermo 40\nrun 70\nundump 1"
    )
    tables, atoms, log = both(scene, moves)
    assert set(re.findall(r"builds = (\d+)", log)) == {"0"}
    assert tables[0]["E_vdwl"][-1] < 0
    assert_alike(tables, atoms, 1e-15)


WARM = "velocity all create 300 5\n"
NVE = "fix 1 all nosquish/nve molecule\n"
MOVES = {
    "nosquish/nve": f"{WARM}{NVE}run 30\nrun 20 pre no",
    "nosquish/npt": (
        f"{WARM}fix 1 all nosquish/npt molecule temp 300 300 100 seed 3 iso 1 1 200\nrun 40"
    ),
    "nosquish/hmc": "fix 1 all nosquish/hmc molecule temp 300 steps 4 seed 3\nthermo 4\nrun 40",
    "fast": f"neighbor 2.0 bin\nvelocity all create 3000 5\n{NVE}run 120",
    "rigid/nve/small": f"{WARM}fix 1 all rigid/nve/small molecule\nrun 40",
    "shake": f"{WARM}fix 1 all shake 1e-8 200 0 b 1 a 1\nfix 2 all nve\nrun 40",
    "deform": f"{WARM}{NVE}fix 2 all deform 1 xy erate 1e-3 remap x\nrun 40",
    "min": f"{NVE}min_style cg\nminimize 0 0 10 20",
    "in each step": (
        f"{WARM}{NVE}compute e all pe/atom pair\ncompute total all reduce sum c_e\n"
        f"thermo_style custom step evdwl ecoul pe {TENSOR} c_total\nthermo 1\n"
        "neighbor 1.0 bin\nrun 8"
    ),
    "rerun": (
        f"{WARM}{NVE}dump 1 all custom 5 frames id x y z\ndump_modify 1 format float %.12g\n"
        "run 20\nundump 1\nrerun frames dump x y z\nrun 0"
    ),
    "per atom": (
        f"{WARM}{NVE}compute e all pe/atom pair\ncompute s all stress/atom NULL pair\n"
        "compute total all reduce sum c_e c_s[1] c_s[4]\n"
        f"thermo_style custom step evdwl ecoul pe {TENSOR} c_total[*]\nthermo 7\nrun 30"
    ),
}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("moves", MOVES)
def test_same_trajectory(both, moves, ranks):
    """Locks out lists that are too short or too old, forces that minimizers and other integrators
    do not get, and steps with energies of each atom that count pairs twice."""
    scene = SCENES["lj/cut/coul/long"]
    if moves == "deform":
        scene = Scene(f"change_box all triclinic\n{scene.lines}")
    every = "neighbor 0.3 bin\nneigh_modify every 1 delay 0 check yes\nthermo 10\ntimestep 1.0\n"
    tables, atoms, log = both(scene, every + MOVES[moves], ranks=ranks)
    assert_alike(tables, atoms, 1e-7)
    assert moves in ("min", "in each step") or max(map(int, re.findall(r"builds = (\d+)", log))) > 2
    if moves == "per atom":
        for name in "c_total[1]", "c_total[2]", "c_total[3]":
            np.testing.assert_allclose(tables[1][name], tables[0][name], rtol=1e-7)


def test_erfc_is_lammps_own(both):
    """Locks out an approximation of erfc that is worse than LAMMPS's: the energy of the mesh's
    screened charges, summed by hand."""
    tables, atoms, log = both(SCENES["several images"], "run 0")
    g = float(re.findall(r"G vector \(1/distance\) = (\S+)", log)[0])
    x, edge, q = atoms[1][:, 1:4], 3 * EDGE, np.tile(CHARGES, 27)
    shifts = edge * np.stack(np.meshgrid(*[np.arange(-2, 3)] * 3), axis=-1).reshape(-1, 1, 1, 3)
    r = np.linalg.norm(x[:, None] - x[None] + shifts, axis=-1)
    together = np.arange(81)[:, None] // 3 == np.arange(81) // 3
    counted = (r < 10.0) & ~together
    r = np.where(counted, r, 1.0)
    energy = 0.5 * 332.06371 * np.sum(np.where(counted, q[:, None] * q * erfc(g * r) / r, 0.0))
    assert tables[1]["E_coul"][0] == pytest.approx(energy, rel=1e-5)


HYBRID = "hybrid/overlay lj/cut 6.0 coul/long 6.0\npair_coeff * * lj/cut 0.1 3.0"
ADAPT = "fix 9 all adapt 0 pair lj/cut/coul/long epsilon 1 1 v_e\nvariable e equal 0.1\n"
NOT_WITH = "it cannot be used with 'pair_modify compute no'"
SIZE = "a molecule has more than 16 atoms, or its atoms do not have consecutive IDs"
LEFT = {
    # what cannot be: lines after the scene's, and the reason in the log
    "style": (
        "pair_style lj/smooth 4.0 6.0\npair_coeff * * 0.1 3.0\nkspace_style none\n",
        "pair_style lj/smooth is not",
    ),
    "hybrid": (
        f"pair_style {HYBRID}\npair_coeff * * coul/long\n",
        "pair_style hybrid/overlay is not",
    ),
    "adapt": (ADAPT, "fix adapt calls the pair style, or changes it"),
    "tally": ("group one id 1\ncompute 9 one force/tally all\n", "compute force/tally calls"),
    "exclude": ("neigh_modify exclude type 1 1\n", "'neigh_modify exclude' excludes other pairs"),
    "molecule 0": ("set atom 1 mol 0\n", "atoms have molecule-ID 0"),
    "not consecutive": ("set atom 1 mol 2\nset atom 4 mol 1\n", SIZE),
    "long": ("set atom 1*6 mol 1\n", "a molecule is so long"),
    "large": ("set group all mol 1\n", SIZE),
    "respa": ("run_style respa 2 2 pair 1 kspace 2\n", "it needs run_style verlet"),
    "multi": ("neighbor 1.0 multi\ncomm_modify mode multi\n", NOT_WITH),
    "no compute": ("pair_modify compute no\n", NOT_WITH),
}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("left", LEFT)
def test_leaves_the_rest_to_lammps(both, left, ranks):
    """Locks out a scene that the fix computes wrongly instead of leaving it to LAMMPS, with the
    reason in the log."""
    lines, words = LEFT[left]
    scene = Scene(SCENES["lj/cut/coul/long"].lines + lines)
    tables, atoms, log = both(scene, "run 0", ranks=ranks)
    assert f"LAMMPS computes the pairs: {words}" in log
    assert_alike(tables, atoms, 1e-15)


def test_leaves_pairs_to_lammps_without_it(both):
    """Locks out pairs that nobody computes after the fix is deleted."""
    deleted = f"{PAIRS}run 0\nunfix pairs\n"
    tables, atoms, _ = both(SCENES["lj/cut/coul/long"], "run 0", fix=deleted)
    assert_alike([tables[0], tables[1][1:]], atoms, 1e-15)


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("all nosquish/pairs mixed", "'precision double' or 'precision mixed' can follow"),
        ("all nosquish/pairs precision single", "'precision double' or 'precision mixed' can"),
        ("some nosquish/pairs", "its group must be 'all'"),
    ],
)
def test_wrong_words(run_lammps, tmp_path, words, message, ranks):
    """Locks out words that do nothing, and a group that the fix would not keep to."""
    water(tmp_path / "data.liquid")
    text = f"{SCENES['lj/cut'].script}group some id 1\nfix pairs {words}\nrun 0\n"
    assert_ended(
        run_lammps(text, ranks=ranks, check=False), [f"nosquish/pairs: {message}"], tmp_path
    )


def test_molecules_that_fall_apart(run_lammps, tmp_path):
    """Locks out pairs that are missed because a molecule has become larger than the list knows."""
    water(tmp_path / "data.liquid")
    soft = "bond_style harmonic\nbond_coeff * 0.01 0.9572\nangle_style zero\nangle_coeff *\n"
    scene = Scene(f"pair_style lj/cut 6.0\n{LJ}{soft}")
    text = (
        f"{scene.script}{PAIRS}fix 1 all nve\nvelocity all create 9000 5\n"
        "neigh_modify every 1 delay 0 check yes\nrun 500\n"
    )
    assert_ended(run_lammps(text, check=False), ["has grown since the run began"], tmp_path)


def test_two(run_lammps, tmp_path):
    """Locks out pairs that two of these fixes compute."""
    water(tmp_path / "data.liquid")
    text = f"{SCENES['lj/cut'].script}{PAIRS}fix 2 all nosquish/pairs\nrun 0\n"
    assert_ended(run_lammps(text, check=False), ["there is another fix of this style"], tmp_path)


@pytest.mark.parametrize("level", ["x86-64", "x86-64-v3", "x86-64-v4"])
def test_arithmetic_of_lanes(tmp_path, level):
    """Locks out instructions of one kind of processors that compute another result."""
    (tmp_path / "lanes.cpp").write_text(
        """#include "lanes.h"
#include <cmath>
#include <cstdio>
using namespace nosquish;
template <typename Real> double error(double most)
{
  double largest = 0.0;
  for (Real x = 1e-6; x < most; x *= 1.01) {
    const Lanes<Real> lanes = Lanes<Real>{} + x;
    const double root = inverse_sqrt<Real>(lanes)[7], power = exponential<Real>(-lanes)[3];
    largest = std::fmax(largest, std::fabs(root * std::sqrt((double) x) - 1.0));
    largest = std::fmax(largest, std::fabs(power / std::exp(-(double) x) - 1.0));
  }
  return largest;
}
int main() { printf("%g %g", error<double>(650.0), error<float>(70.0)); }
"""
    )
    command = [
        "c++",
        "-std=c++17",
        "-O2",
        f"-march={level}",
        "-I",
        str(ROOT / "fix_nosquish" / "pairs"),
    ]
    subprocess.run([*command, "lanes.cpp", "-o", "lanes"], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "lanes"], capture_output=True, text=True)
    if done.returncode < 0:  # by a signal
        pytest.skip(f"this processor has no {level}")
    double, single = map(float, done.stdout.split())
    assert double < 2e-14
    assert single < 5e-7
