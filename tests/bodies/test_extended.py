"""Bodies of ellipsoids, lines, triangles and dipoles: orientations, torques and inertia."""

import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from support.builds import NUMBER
from support.systems import OURS, SMALL, close
from validation.running import startup


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
        "pair_style line/lj 3.0\npair_coeff * * 0.2 0.2 0.3 0.6 3.0\npair_modify shift yes",
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
        "pair_style tri/lj 3.0\npair_coeff * * 1.0 0.5 3.0",
        "c_own[1] c_own[2] c_own[3] c_own[4] c_own[5] c_own[6] angmomx angmomy angmomz",
        computes="compute own all property/atom corner1x corner1y corner1z corner2x corner2y "
        "corner2z\ncompute turning shaped erotate/asphere",
        thermo="c_turning",
    ),
    "dipole": Scene(
        "hybrid sphere dipole molecular",
        "set group all diameter 0.5\nset group all density 1.3\n"
        "set type 1*2 dipole/random 4928 0.6\nset type 1 charge 0.5\nset type 3 charge -0.5",
        "pair_style lj/cut/dipole/cut 3.0\npair_coeff * * 1.0 0.9",
        "mux muy muz omegax omegay omegaz",
    ),
    "quaternion": Scene(
        "bpm/sphere",
        "set group all diameter 0.5\nset group all density 1.3\nset group all quat/random 4928",
        "pair_style lj/cut 3.0\npair_coeff * * 1.0 0.9",
        "c_own[1] c_own[2] c_own[3] c_own[4] omegax omegay omegaz",
        computes="compute own all property/atom quatw quati quatj quatk",
    ),
}


def setup(kind, *, alone=False):
    """The script up to the fix; `alone`: each particle is far from others, and a molecule."""
    scene, rng = SCENES[kind], np.random.default_rng(8)
    plane = scene.dimension == 2
    shape = np.array([[0, 0, 0], [0.9, 0.2, 0.1], [-0.4, 0.8, -0.3]]) * [1, 1, not plane]
    count, side = 4 if plane else 3, scene.side / (2 if alone else 1)
    high = count * side
    atoms, number = [], 0
    for body, site in enumerate(np.ndindex(count, count, 1 if plane else count)):
        turn = (
            Rotation.from_rotvec([0, 0, 1] * rng.uniform(0, 6, 3))
            if plane
            else (Rotation.random(random_state=rng))
        )
        centre = side * np.add(site, [0.5, 0.5, 0 if plane else 0.5])
        places = enumerate(turn.apply(shape) + centre)
        for k, place in [(body % 3, centre)] if alone else places:
            x, y, z = place
            number += 1
            atoms += [
                f"create_atoms {k + 1} single {x:.15g} {y:.15g} {z:.15g} units box",
                f"set atom {number} mol {body + 1}",
            ]
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
        "fix 9 all enforce2d" if scene.dimension == 2 else "", scene.computes,
        "compute moving all ke", "timestep 0.002",
        f"thermo_style custom step pe c_moving {scene.thermo}",
        "thermo_modify format float %.16g norm no", "",
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


def compare(run_kind, kind, ranks, *, tolerance=1e-9, table=True, setting=""):
    """Run 100 steps with LAMMPS's fix on one rank, and with this one."""
    rest = "molecule\n" + setting + "\nthermo 20\nrun 100"
    theirs, their_table = run_kind(kind, SMALL.format(group="all", words=rest))
    rest = rest.replace("molecule", "molecule order 123")
    ours, ours_table = run_kind(kind, OURS.format(group="all", words=rest), ranks=ranks)
    close(ours[:, :3], theirs[:, :3], tolerance)
    close(ours[:, 3:6], theirs[:, 3:6], 10 * tolerance)
    same = 6 + 4 * (kind == "quaternion" and NUMBER < 20250722)  # there fix rigid turns no quat
    close(ours[:, same:], theirs[:, same:], 10 * tolerance)
    for name in (
        ours_table.dtype.names[1:] if table else ()
    ):  # LAMMPS's makes the velocities rigid after row 0
        np.testing.assert_allclose(ours_table[name][1:], their_table[name][1:], rtol=10 * tolerance)


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("kind", ["ellipsoid", "dipole", "quaternion"])
def test_as_fix_rigid(run_kind, kind, ranks):
    """Locks out particles whose inertia, torque, orientation or spin is left out or wrong, and
    orientations that get lost on the way to another rank."""
    compare(run_kind, kind, ranks)


@pytest.mark.parametrize("ranks", [1, 2])
def test_early_torques(run_kind, ranks):
    """Locks out torques on particles by fixes behind this one that bodies get although the script
    says that they do not."""
    field = "fix field all efield 2.0 -1.0 0.5\nfix_modify 1 bodyforces early"
    compare(run_kind, "dipole", ranks, setting=field)


@pytest.mark.parametrize("forces", [False, True])
def test_triangles_as_fix_rigid(run_kind, forces):
    """Locks out triangles whose inertia, torque or orientation is wrong. LAMMPS's forces between
    triangles jump: with its own fix, one rank and two differ by 2e-4 in the velocities after 100
    steps. So what is sharp is the free motion. (LAMMPS's fix takes triangles for spheres, unless
    their diameter is set to 0.)"""
    compare(
        run_kind, "triangle", 4, tolerance=1e-4 if forces else 1e-9, table=not forces,
        setting="" if forces else "pair_style zero 3.0\npair_coeff * *",
    )  # fmt: skip


SINGLE = {"ellipsoid": "nve/asphere", "line": "nve/line", "triangle": "nve/tri"}


@pytest.mark.parametrize("kind", SINGLE)
def test_single_particles(run_kind, kind):
    """Locks out a particle alone in its body that moves otherwise than with LAMMPS's fix for it.
    In the plane both turn it alike, to rounding; in space the two fixes differ by their schemes,
    and so by a fourth at half the step."""
    start = setup(kind, alone=True) + "group dots type 3\nfix 3 dots nve\n" * (kind == "ellipsoid")
    spin = "omega 0 0 0.7" if kind == "line" else "angmom 0.1 0.07 -0.05"
    start += f"set group shaped {spin}\n"
    off = []
    for n in (20,) if kind == "line" else (20, 40):
        run = f"\ntimestep {0.04 / n:.17g}\nthermo {n}\nrun {n}"
        theirs, table = run_kind(kind, f"fix 1 shaped {SINGLE[kind]}{run}", start=start)
        ours, mine = run_kind(
            kind, OURS.format(group="shaped", words="molecule") + run, start=start, ranks=2
        )
        off.append(np.abs(ours - theirs)[:, 6:].max())
        assert np.isclose(mine["c_turning"][-1], table["c_turning"][-1], rtol=1e-3)
    if kind == "line":
        close(ours, theirs, 1e-9)
    else:
        assert off[0] / off[1] == pytest.approx(4.0, rel=0.2), off


def test_lines_are_rigid(run_kind):
    """Locks out lines that stay behind their bodies, that are turned as a run begins, or whose
    torque or inertia is wrong: LAMMPS's forces and torques do the work that the bodies gain, to
    second order in the time step, and the lines of a body keep their angles to each other.
    (LAMMPS's fix rigid takes lines for spheres, or refuses their moments.)"""
    fix, wrong = OURS.format(group="all", words="molecule"), []
    power = """
compute w all property/atom tqz omegaz
variable w atom fx*vx+fy*vy+c_w[1]*c_w[2]
compute power all reduce sum v_w
variable energy equal f_1[1]+f_1[2]
thermo_style custom step c_power v_energy c_moving c_turning
thermo_modify format float %.16g norm no
"""
    bare, _ = run_kind("line", "run 0")
    start, _ = run_kind("line", f"{fix}\nrun 0")
    close(start[:, 6:10], bare[:, 6:10], 1e-12)
    for n in (100, 200):
        run = f"{fix}{power}timestep {1.0 / n:.17g}\nthermo 1\nrun {n}"
        end, table = run_kind("line", run, ranks=4)
        gained = np.ptp(table["v_energy"][[0, -1]])
        wrong.append(abs(np.trapezoid(table["c_power"]) / n - gained))
        of_atoms = table["c_moving"] + table["c_turning"]
        np.testing.assert_allclose(of_atoms, table["v_energy"], rtol=1e-12)
        lines = [(r[:, 8:10] - r[:, 6:8]) @ [1, 1j] for r in (start, end)]
        bonds = [(np.roll(r[:, :2].reshape(-1, 3, 2), 1, 1) @ [1, 1j]).ravel() - r[:, :2] @ [1, 1j]
                 for r in (start, end)]  # fmt: skip
        turned = bonds[1] / bonds[0]
        close(lines[1], lines[0] * turned, 1e-11)
        assert np.abs(turned - 1).max() > 0.5, "nothing turned"
    assert gained > 1e-2 and wrong[1] < 1e-2 * gained
    assert wrong[0] / wrong[1] == pytest.approx(4.0, rel=0.3), (wrong, gained)


@pytest.mark.parametrize("kind", SCENES)
def test_restarted(run_kind, kind):
    """Locks out a restart, on another number of ranks, that loses a particle's spin or finds other
    principal axes than before; lines and triangles of a body are three, so that it has an own
    shape."""
    fix = OURS.format(group="all", words="molecule")
    free = "pair_style zero 3.0\npair_coeff * *\n" if kind == "triangle" else ""
    whole, _ = run_kind(kind, f"{free}{fix}\nrun 30\nwrite_restart middle\nrun 40", ranks=2)
    again, _ = run_kind(
        kind, f"{free}{fix}\nrun 40", start="read_restart middle\n" + forces(kind), name="again"
    )
    close(again, whole, 1e-10)


@pytest.mark.parametrize("kind, dt", [("ellipsoid", 0.08), ("dipole", 0.03)])
def test_rejected_trajectory(run_kind, kind, dt):
    """Locks out particles that keep the orientation of a trajectory that was rejected: with their
    bodies back where they were, the potential energy and the torques are those of before."""
    fix = OURS.format(group="all", words="molecule temp 15e-1 steps 5 seed 8").replace(
        "nosquish/nve", "nosquish/hmc"
    )
    columns = "\ncompute each all property/atom tqx tqy tqz"
    columns += "\ncompute torque all reduce sumsq c_each[*]"
    columns += "\nthermo_style custom step pe f_1[7] c_torque[*]"
    columns += "\nthermo_modify norm no format float %.16g"
    _, table = run_kind(kind, f"{fix}{columns}\ntimestep {dt}\nthermo 5\nrun 40")
    rejected = table["f_1[7]"][1:] == 0
    assert 1 < rejected.sum() < len(rejected)
    for name in "PotEng", "c_torque[1]", "c_torque[2]", "c_torque[3]":
        before, after = table[name][:-1][rejected], table[name][1:][rejected]
        exact = 1e-12 if name == "PotEng" else 1e-10
        np.testing.assert_allclose(after, before, rtol=exact, err_msg=name)


@pytest.mark.parametrize("how", ["exactly", "roughly", "places alone"])
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("kind", ["ellipsoid", "dipole", "quaternion"])
def test_turned_between_runs(run_kind, kind, ranks, how):
    """Locks out particles that keep their orientation while something turns their body: whether it
    keeps the body's shape or not, and turns them or not, they turn with it."""
    fix = OURS.format(group="all", words="molecule") + "\nneigh_modify exclude molecule/intra all\n"
    turn, back = (f"displace_atoms all rotate 0 0 0 0.3 1 0.2 {by}\n" for by in (200, -200))
    if how == "roughly":
        turn = "displace_atoms all random 1e-4 1e-4 1e-4 77\n" + turn
    if how == "places alone":
        dump = "write_dump all custom there id x y z ix iy iz modify format float %.17g\n"
        turn += f"{dump}{back}read_dump there 0 x y z ix iy iz box no\n"
    start = f"{setup(kind)}\nvelocity all set 0 0 0\n{fix}run 0\n"
    before, _ = run_kind(kind, "", start=start, ranks=ranks, name="before")
    after, _ = run_kind(kind, f"{turn}run 0", start=start, ranks=ranks)
    axis = np.array([0.3, 1, 0.2])
    rotation = Rotation.from_rotvec(np.radians(200) * axis / np.linalg.norm(axis))
    if kind == "dipole":
        ours, expected = after[:, 6:9], rotation.apply(before[:, 6:9])
    else:
        shaped = np.arange(len(before)) % 3 < (2 if kind == "ellipsoid" else 3)  # else points
        ours, quats = (
            Rotation.from_quat(np.roll(x[shaped, 6:10], -1, axis=1)) for x in (after, before)
        )
        ours, expected = ours.as_matrix(), (rotation * quats).as_matrix()
    close(ours, expected, 2e-3 if how == "roughly" else 1e-9)


LINE = """units lj
atom_style {style}
atom_modify map array
region box block -5 5 -5 5 -5 5
create_box 1 box
create_atoms 1 single -0.5 -0.05 -0.2
create_atoms 1 single 0.5 0.05 0.2
set group all {made}
pair_style zero 2.0
pair_coeff * *
thermo_style custom step
{columns}
fix body all property/atom i_body
set group all i_body 1
fix 1 all nosquish/nve custom i_body
run 0
displace_atoms all rotate 0 0 0 {axis} {degrees}
run 0
write_dump all custom end id x y z {what} modify sort id format float %.17g
"""


@pytest.mark.parametrize("axis, moves", [("1 0.1 0.4", False), ("0 0 1", True)])
def test_line_of_dipoles_turned_between_runs(run_lammps, axis, moves):
    """Locks out dipoles that are turned by chance about the line of their body, of which two atoms
    do not tell how it has turned; and a refusal of a line whose atoms are where they were."""
    made = "mass 1.0 diameter 0\nset group all dipole 0.3 1 0.5"
    text = LINE.format(style="hybrid sphere dipole", made=made, axis=axis, degrees=1.0,
                       what="mux muy muz", columns="")  # fmt: skip
    run = run_lammps(text, check=False)
    assert ("is a line of particles with an orientation" in run.screen) == moves
    assert (run.code != 0) == moves


# a LAMMPS whose style of ellipsoids writes COUNT numbers for ghost atoms: of a superellipsoid of
# newer versions these are a flag, shape, quaternion, two exponents and the principal moments
ELLIPSOIDS = """
#include <algorithm>
namespace LAMMPS_NS {
class AtomVec { public: virtual ~AtomVec() {} double other[7]; };
class AtomVecEllipsoid : public AtomVec {
 public:
  virtual int pack_border_bonus(int, int *, double *buffer)
  {
    const double all[] = {1, 1.5, 2.5, 0.5, 0.5, -0.5, 0.5, 0.5, 4, 3, 11, 12, 13};
    std::copy_n(all, COUNT, buffer);
    return COUNT;
  }
  virtual void unpack_comm_bonus(int, int, double *) {}
};
}
void *style() { return new LAMMPS_NS::AtomVecEllipsoid; }
"""
READER = """
#include "particles.h"
#include <cstdio>
void *style();
namespace LAMMPS_NS {
int AtomVecLine::pack_border_bonus(int, int *, double *) { return 0; }
void AtomVecLine::unpack_comm_bonus(int, int, double *) {}
int AtomVecTri::pack_border_bonus(int, int *, double *) { return 0; }
void AtomVecTri::unpack_comm_bonus(int, int, double *) {}
}
int main()
{
  int index[] = {0};
  double mass[] = {2.0}, numbers[7];
  LAMMPS_NS::Atom atom{1, index, nullptr, nullptr, mass, style()};
  nosquish::Particles particles(&atom);
  if (!particles.read(numbers)) return 0 * std::puts("unknown");
  for (double number : numbers) std::printf("%g ", number);
}
"""
ATOM = """
#include <cstring>
namespace LAMMPS_NS {
struct Atom {
  int nlocal, *ellipsoid, *line, *tri;
  double *rmass;
  void *one;
  int quat_flag;
  double **quat;
  void *style_match(const char *name) { return strcmp(name, "ellipsoid") ? nullptr : one; }
};
}
"""


@pytest.mark.parametrize(
    "count, expected",
    [
        (8, [2 * 0.2 * 6.5, 2 * 0.2 * 2.5, 2 * 0.2 * 8.5, 0.5, -0.5, 0.5, 0.5]),
        (13, [11, 12, 13, 0.5, -0.5, 0.5, 0.5]),
        (10, None),
        (12, None),
    ],
)
def test_ellipsoids_of_other_versions(tmp_path, count, expected):
    """Locks out moments of an ellipsoid for a superellipsoid of a newer LAMMPS, which knows its own
    moments, and for particles of a version that writes what is not known here."""
    program = tmp_path / "read"
    parts = {"atom.h": ATOM, "ellipsoids.cpp": ELLIPSOIDS, "read.cpp": READER}
    for name, text in parts.items():
        (tmp_path / name).write_text(text)
    headers = Path(startup.package()) / "plugin"

    command = ["g++", "-std=c++17", f"-DCOUNT={count}", "-I", tmp_path, "-I", headers]
    sources = [tmp_path / name for name in ("ellipsoids.cpp", "read.cpp")]
    subprocess.run([*command, *sources, "-o", program], check=True)
    printed = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    if expected is None:
        assert printed.strip() == "unknown"
    else:
        np.testing.assert_allclose(np.array(printed.split(), float), expected, rtol=1e-5)


@pytest.mark.parametrize("ranks", [1, 4])
def test_minimize_dipoles(run_kind, tmp_path, ranks):
    """Locks out a minimization without the torques on particles, or that leaves their orientations
    as they were: in a field that is the same everywhere, each body's dipole comes to lie along it,
    of charges and of dipoles."""
    lines = "pair_style zero 3.0\npair_coeff * *\nfix field all efield 2.0 -1.0 0.5\n"
    lines += "fix_modify field energy yes\nfix 1 all nosquish/nve molecule\n"
    lines += "write_dump all custom start id mol q xu yu zu mux muy muz modify format float %.17g\n"
    _, table = run_kind("dipole", f"{lines}minimize 0 1e-9 500 900\nrun 0", ranks=ranks)
    rows = np.loadtxt(tmp_path / "start", skiprows=9)
    dipoles = rows[:, 6:] + rows[:, 2:3] * rows[:, 3:6]
    of_bodies = np.array([dipoles[rows[:, 1] == body].sum(axis=0) for body in range(1, 28)])
    least = -np.linalg.norm(of_bodies, axis=1).sum() * np.linalg.norm([2.0, -1.0, 0.5])
    np.testing.assert_allclose(table["PotEng"][-2:], least, rtol=1e-12)
    assert table["PotEng"][0] > least / 2


def test_minimize_ellipsoids(run_kind):
    """Locks out a minimization that leaves the orientations of ellipsoids as they were: the run
    behind it has another energy then."""
    lines = "pair_modify shift yes\nfix 1 all nosquish/nve molecule\nthermo 1\n"
    _, table = run_kind("ellipsoid", f"{lines}minimize 0 1e-6 40 900\nrun 0", ranks=2)
    energy = table["PotEng"]
    assert (np.diff(energy) < 1e-9 * abs(energy[-1])).all()
    assert energy[-1] == pytest.approx(energy[-2], rel=1e-12)
    assert energy[-1] < energy[0] - 0.1
