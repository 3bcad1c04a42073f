"""The light water dimer: bound, with the mean temperature that its files say,
and no pair of atoms left out."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

FOLDER = Path(__file__).resolve().parent.parent / "inputs" / "water_dimer"
FILES = {name: (FOLDER / name).read_text() for name in ("data.dimer", "forcefield.dimer")}
SCRIPT = """
units         real
atom_style    full
boundary      f f f
read_data     data.dimer
include       forcefield.dimer
fix           1 all python/move "fix_nosquish.NVE all molecule"
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
BOLTZMANN, MVV2E = 0.0019872067, 48.88821291**2  # LAMMPS's


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


def microcanonical_temperature(x, energy, momentum, chains=400, sweeps=200, seed=7):
    """Mean temperature of all states with this energy, angular momentum, and no total momentum:
    no trajectory is needed.

    With these fixed, momenta leave a configuration the weight (E - U - L I^-1 L / 2)^2 / sqrt(det
    I): six of the nine momenta are free, I is the inertia of the whole.  Metropolis samples the
    relative position and the two molecules' orientations.

    Args:
        x: positions (6, 3) to begin with.  energy: kcal/mol.  momentum: angular, of the whole (3,).
    """
    rng = np.random.default_rng(seed)
    mass = np.tile(MASS, 2)

    def weight(x):
        """Logarithm of the weight, and the kinetic energy."""
        d = x - np.einsum("a,nak->nk", mass, x)[:, None] / mass.sum()
        inertia = -np.einsum("a,nak,nal->nkl", mass, d, d)
        inertia -= np.trace(inertia, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        kinetic = energy - potential(x)
        free = kinetic - MVV2E / 2 * np.einsum(
            "k,nkl,l->n", momentum, np.linalg.inv(inertia), momentum
        )
        free[distances(x).min(axis=(1, 2)) < 1] = 0  # where atoms run into each other
        with np.errstate(divide="ignore"):
            return 2 * np.log(np.maximum(free, 0)) - np.linalg.slogdet(inertia)[1] / 2, kinetic

    def turned(x, atoms, angle):
        """Turned at random about the centre of mass of these atoms."""
        x, part = x.copy(), x[:, atoms]
        centre = np.einsum("a,nak->nk", mass[atoms], part)[:, None] / mass[atoms].sum()
        turns = Rotation.from_rotvec(rng.normal(scale=angle, size=(len(x), 3))).as_matrix()
        x[:, atoms] = centre + np.einsum("nkl,nal->nak", turns, part - centre)
        return x

    def shifted(x):
        x = x.copy()
        x[:, 3:] += rng.normal(scale=0.12, size=(len(x), 1, 3))
        return x

    first, second, both = slice(0, 3), slice(3, 6), slice(0, 6)
    moves = (
        shifted,
        lambda x: turned(x, first, 0.5),
        lambda x: turned(x, second, 0.5),
        lambda x: turned(x, both, 0.5),
    )
    x = np.tile(x, (chains, 1, 1))
    now, kinetic = weight(x)
    means = []
    for _ in range(sweeps):
        for move in moves:
            there = move(x)
            then, its_kinetic = weight(there)
            taken = np.log(rng.random(chains)) < then - now
            x[taken], now[taken], kinetic[taken] = there[taken], then[taken], its_kinetic[taken]
        means.append(kinetic.mean())
    return 2 * np.mean(means[sweeps // 5 :]) / (9 * BOLTZMANN)


def test_mean_temperature():
    """Locks out a dimer that is colder or warmer than its files say, or that can part, for which
    its total energy must be negative.

    (A trajectory's mean takes tens of nanoseconds to settle.)
    """
    words = [line.split() for line in FILES["data.dimer"].splitlines()]
    x = np.array([row[4:] for row in words if len(row) == 7], float)
    v = np.array([row[1:] for row in words[words.index(["Velocities"]) :] if len(row) == 4], float)[
        :6
    ]
    mass = np.tile(MASS, 2)
    assert np.abs(mass @ v).max() < 1e-12
    energy = potential(x[None])[0] + MVV2E / 2 * (mass[:, None] * v**2).sum()
    assert energy < 0
    momentum = (mass[:, None] * np.cross(x, v)).sum(axis=0)
    assert abs(microcanonical_temperature(x, energy, momentum) - 155) < 1.5


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
