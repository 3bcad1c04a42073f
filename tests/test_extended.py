"""Bodies of ellipsoids, lines, triangles and dipoles: orientations, torques and inertia."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from systems import LIKE_LAMMPS, OURS, SMALL



class Scene(NamedTuple):
    """A kind of particles; a body has three of them, of types 1, 2 and 3.

    Attributes:
        style: the atom style.  shape: commands that give them shape, mass and charge.
        pair: commands for the forces.  columns: what to dump, besides places and velocities.
        side: between bodies.  dimension: 2 or 3.  thermo: columns of its own, and their computes.
    """

    style: str
    shape: str
    pair: str
    columns: str
    side: float = 4.0
    dimension: int = 3
    computes: str = ""
    thermo: str = ""


QUAT = "c_own[1] c_own[2] c_own[3] c_own[4] angmomx angmomy angmomz"
SCENES = {
    "ellipsoid": Scene(
        "hybrid ellipsoid molecular",
        "set type 1 shape 1.0 1.4 0.8\nset type 2 shape 0.7 0.7 1.5\nset type 1*2 density 1.1\n"
        "set type 3 mass 0.7\nset type 1*2 quat/random 4928",
        "pair_style gayberne 1.0 1.0 1.0 4.0\npair_coeff * * 1.0 0.9 1 1 1 1 1 1 3.0",
        QUAT,
        computes="compute own all property/atom quatw quati quatj quatk\n"
        "compute turning shaped erotate/asphere",
        thermo="c_turning",
    ),
    "line": Scene(
        "line",
        "set type 1 length 0.8\nset type 2 length 0.5\nset type 3 length 1.1\n"
        "set group all theta/random 4928\nset group all density 1.3\nset group all diameter 0",
        "pair_style line/lj 3.0\npair_coeff * * 1.0 0.6 0.6 0.8 3.0",
        "c_own[1] c_own[2] c_own[3] c_own[4] omegaz",
        dimension=2,
        computes="compute own all property/atom end1x end1y end2x end2y\n"
        "compute turning shaped erotate/asphere",
        thermo="c_turning",
    ),
    "triangle": Scene(
        "tri",
        "set type 1 tri 0.8\nset type 2 tri 0.5\nset type 3 tri 1.0\n"
        "set group all quat/random 4928\nset group all density 1.3\nset group all diameter 0",
        "pair_style tri/lj 3.0\npair_coeff * * 1.0 0.6 0.6 0.8 3.0",
        "c_own[1] c_own[2] c_own[3] c_own[4] c_own[5] c_own[6] angmomx angmomy angmomz",
        computes="compute own all property/atom corner1x corner1y corner1z corner2x corner2y "
        "corner2z\ncompute turning shaped erotate/asphere",
        thermo="c_turning",
    ),
    "dipole": Scene(
        "hybrid sphere dipole molecular",
        "set group all diameter 0.5\nset group all density 1.3\nset type 1*2 dipole/random 4928 0.6\n"
        "set type 1 charge 0.5\nset type 3 charge -0.5",
        "pair_style lj/cut/dipole/cut 3.0\npair_coeff * * 1.0 0.9",
        "mux muy muz omegax omegay omegaz",
    ),
}


def setup(kind):
    """The script up to the fix."""
    scene, rng = SCENES[kind], np.random.default_rng(8)
    plane = scene.dimension == 2
    shape = np.array([[0, 0, 0], [0.9, 0.2, 0.1], [-0.4, 0.8, -0.3]]) * [1, 1, not plane]
    count = 4 if plane else 3
    high = count * scene.side
    atoms, number = [], 0
    for body, site in enumerate(np.ndindex(count, count, 1 if plane else count)):
        turn = Rotation.from_rotvec([0, 0, 1] * rng.uniform(0, 6, 3)) if plane else (
            Rotation.random(random_state=rng))
        for k, place in enumerate(turn.apply(shape) + (np.array(site) + [0.5, 0.5, 0 if plane else 0.5]) * scene.side):
            x, y, z = place
            number += 1
            atoms += [f"create_atoms {k + 1} single {x:.15g} {y:.15g} {z:.15g} units box",
                      f"set atom {number} mol {body + 1}"]
    low, top = (-0.5, 0.5) if plane else (0, high)
    return "\n".join([
        "units lj", f"dimension {scene.dimension}", f"atom_style {scene.style}",
        "atom_modify map array", f"region box block 0 {high} 0 {high} {low} {top}",
        "create_box 3 box", *atoms, scene.shape, "group shaped type 1 2" if "ell" in kind else
        "group shaped type 1 2 3", "velocity all create 1.5 4928",
        forces(kind),
    ])  # fmt: skip


def forces(kind):
    """What a restart file does not keep."""
    scene = SCENES[kind]
    return "\n".join([
        scene.pair, "neighbor 0.5 bin",
        "neigh_modify every 1 delay 0 check yes exclude molecule/intra all",
        "fix 9 all enforce2d" if scene.dimension == 2 else "", scene.computes, "compute moving all ke", "timestep 0.002",
        f"thermo_style custom step pe c_moving {scene.thermo}", "thermo_modify format float %.16g norm no",
        "",
    ])  # fmt: skip


@pytest.fixture
def run_kind(run_lammps, tmp_path):
    """A function that runs particles of a kind, and gives (atoms, columns): places unwrapped,
    velocities and those of the kind; and the thermo table."""

    def run(kind, text, *, start=None, ranks=1, name="end"):
        columns = f"id xu yu zu vx vy vz {SCENES[kind].columns}"
        dump = f"write_dump all custom {name} {columns} modify sort id format float %.17g"
        done = run_lammps(f"{start or setup(kind)}\n{text}\n{dump}\n", ranks=ranks)
        return np.loadtxt(tmp_path / name, skiprows=9)[:, 1:], done.thermo

    return run


def close(ours, theirs, tolerance):
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * np.abs(theirs).max())


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("kind", SCENES)
def test_as_fix_rigid(run_kind, kind, ranks):
    """Locks out particles whose inertia, torque, orientation or spin is left out or wrong, and
    orientations that get lost on the way to another rank."""
    run = "thermo 20\nrun 100"
    theirs, table = run_kind(kind, SMALL.format(group="all", words="molecule") + "\n" + run)
    words = LIKE_LAMMPS.format(group="all", words="molecule")
    ours, ours_table = run_kind(kind, words + "\n" + run, ranks=ranks)
    close(ours[:, :3], theirs[:, :3], 1e-9)
    close(ours[:, 3:6], theirs[:, 3:6], 1e-8)
    close(ours[:, 6:], theirs[:, 6:], 1e-8)
    start = 1  # rigid/nve makes the velocities rigid after its first output
    for name in ours_table.dtype.names[1:]:
        np.testing.assert_allclose(ours_table[name][start:], table[name][start:], rtol=1e-8)
