"""The light water dimer: bound, and no pair of atoms left out."""

import numpy as np

from support.running import ROOT

FOLDER = ROOT / "inputs" / "water_dimer"
FILES = {name: (FOLDER / name).read_text() for name in ("data.dimer", "forcefield.dimer")}
SCRIPT = """
units         real
atom_style    full
boundary      f f f
read_data     data.dimer
include       forcefield.dimer
fix 1 all nosquish/nve molecule
dump          1 all custom {every} positions id x y z
dump_modify   1 sort id format float %.17g
thermo_style  custom step temp pe etotal
thermo_modify format float %.15g
thermo        {every}
timestep      0.3
run           {steps}
"""
# by atom: charge, and TIP3P's epsilon (kcal/mol) and Rmin/2 (Angstrom) as CHARMM22 has them
CHARGE, EPSILON, RADIUS = np.array(
    [(-0.834, 0.1521, 1.7682), (0.417, 0.046, 0.2245), (0.417, 0.046, 0.2245)]
).T


MASS = np.array([15.9994, 0.1, 0.1])
MVV2E = 48.88821291**2  # LAMMPS's


def distances(x):
    """Between the atoms of the two molecules: positions (n, 6, 3) to (n, 3, 3)."""
    return np.linalg.norm(x[:, :3, None] - x[:, None, 3:], axis=-1)


def potential(x):
    """Potential energy (n,) in kcal/mol at positions (n, 6, 3)."""
    r = distances(x)
    ratio = ((RADIUS[:, None] + RADIUS) / r) ** 6
    energy = (
        np.sqrt(np.outer(EPSILON, EPSILON)) * (ratio**2 - 2 * ratio)
        + 332.06371 * np.outer(CHARGE, CHARGE) / r
    )
    return energy.sum(axis=(1, 2))


def test_no_pair_is_left_out(run_lammps, tmp_path):
    """Locks out a cutoff, a neighbour list or a box that the dimer outgrows: the potential energy
    against the sum over all pairs."""
    table = run_lammps(SCRIPT.format(steps=120000, every=2000), files=FILES).thermo
    frames = (tmp_path / "positions").read_text().split("ITEM: TIMESTEP")[1:]
    x = np.array([[line.split()[1:] for line in frame.splitlines()[9:]] for frame in frames], float)
    np.testing.assert_allclose(table["PotEng"], potential(x), rtol=0, atol=1e-8)
    assert np.ptp(table["TotEng"]) < 0.02 * abs(table["TotEng"].mean())
    along = np.sum((x[:, 0] - x[:, 3]) * (x[0, 0] - x[0, 3]), axis=1)
    assert along.min() < 0, "too short: the list of the start would do for all"
