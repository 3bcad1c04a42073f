"""LAMMPS's minimize with rigid bodies: minima as of scipy, shapes, ranks, kinds of bodies, other
fixes, and what follows."""

import re

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from support.overlapping import DEPTH, MASSES, SIZE, WATER, overlapping
from support.sampling import SMOOTH
from support.systems import mixture, sizes
from validation.scenes.data_file import data_file

FORCES = (
    "write_dump all custom {} id mol mass xu yu zu fx fy fz modify sort id format float %.17g\n"
)


def atoms(path):
    """What `FORCES` has written: molecules, masses, places, forces."""
    rows = np.loadtxt(path, skiprows=9)
    return rows[:, 1], rows[:, 2], rows[:, 3:6], rows[:, 6:9]


def norms(path, axes=(1, 1, 1)):
    """The largest force and the largest torque on a molecule, from its atoms' forces along some
    axes."""
    molecule, mass, x, f = atoms(path)
    f, results = f * axes, []
    for one in np.unique(molecule):
        here = molecule == one
        d = x[here] - np.average(x[here], axis=0, weights=mass[here])
        results.append([f[here].sum(axis=0), np.cross(d, f[here]).sum(axis=0)])
    return np.linalg.norm(results, axis=2).max(axis=0)


def bent(before, after):
    """By how much a distance within a molecule has changed, at most."""
    (molecule, _, x, _), (_, _, y, _) = before, after
    return np.abs(sizes(molecule, x) - sizes(molecule, y)).max()


# ------------------------------------------------------------------ minima


def energy_of_two(coordinates, shape, types, charges, constant):
    """Of two rigid molecules, each a place and a rotation vector."""
    one, two = (
        Rotation.from_rotvec(part[3:]).apply(shape) + part[:3] for part in coordinates.reshape(2, 6)
    )
    r = np.linalg.norm(one[:, None] - two, axis=2)
    depth, size = np.array(DEPTH)[types - 1], np.array(SIZE)[types - 1]
    depth, size = np.sqrt(np.outer(depth, depth)), (size[:, None] + size) / 2
    sixth = (size / r) ** 6
    return (4 * depth * (sixth**2 - sixth) + constant * np.outer(charges, charges) / r).sum()


REACHED = "Stopping criterion = force tolerance"
WAYS = {
    "cg": "fix 1 all nosquish/nve molecule\n{}minimize 0 1e-9 5000 9000\n",
    "sd": "fix 1 all nosquish/nvt molecule temp 1 1 100 seed 4 thermostat csvr\n{}min_style sd\n"
    "min_modify line forcezero norm inf\nminimize 0 1e-5 9000 90000\n",
}


@pytest.mark.quick("cg")
@pytest.mark.parametrize("way", WAYS)
def test_dimer(run_lammps, tmp_path, way):
    """Locks out a state that is called relaxed and is no minimum: two waters come to the energy
    that scipy finds for two rigid molecules; and a thermostat's warning of bodies at rest, although
    none acts."""
    shape, types, charges = (np.array(part) for part in WATER)
    start = np.array([25, 25, 25, 0, 0, 0, 27.6, 25.5, 25.2, 0.4, 1.1, 0.3])
    x = np.concatenate(
        [Rotation.from_rotvec(part[3:]).apply(shape) + part[:3] for part in start.reshape(2, 6)]
    )
    columns = [np.repeat([1, 2], 3), np.tile(types, 2), np.tile(charges, 2), x]
    pairs = "\n".join(
        f"pair_coeff {i + 1} {j + 1} {np.sqrt(DEPTH[i] * DEPTH[j]):.17g} {(SIZE[i] + SIZE[j]) / 2}"
        for i, j in ((0, 0), (0, 1), (1, 1))
    )
    script = f"""units real
atom_style full
boundary f f f
read_data data.two
pair_style lj/cut/coul/cut 40
{pairs}
pair_modify shift no
neigh_modify exclude molecule/intra all
timestep 1
"""
    table = "thermo_style custom step pe\nthermo_modify format float %.16g norm no\n"
    script += WAYS[way].format(table)
    two = data_file("full", columns, (0.0, 50.0), mass=MASSES[:2])
    done = run_lammps(script, files={"data.two": two})
    more = shape, types, charges, 332.06371  # of units real
    best = minimize(energy_of_two, start, more, "BFGS", options={"gtol": 1e-7})
    assert REACHED in done.log and "that thermostat" not in done.log
    assert done.thermo["PotEng"][-1] == pytest.approx(best.fun, abs=1e-7)
    assert best.fun < energy_of_two(start, *more) - 1.0


def test_in_the_plane(run_system, tmp_path):
    """Locks out bodies that minimize pushes or turns out of the plane, and forces along z and
    torques about axes that no body has there: these do not count against the tolerances."""
    system = mixture("planar pair row single", side=3, spacing=2.9, dimension=2)
    lines = WAYS["cg"].format("group some id <= 5\nfix up some addforce 0 0 0.1\n")
    done = run_system(
        system, f"{SMOOTH}{FORCES.format('start')}{lines}run 0\n" + FORCES.format("end")
    )
    start, end = (atoms(tmp_path / name) for name in ("start", "end"))
    assert REACHED in done.log
    assert (end[2][:, 2] == start[2][:, 2]).all()
    assert (norms(tmp_path / "end", (1, 1, 0)) < 1.001e-9).all()
    assert bent(start, end) < 1e-12


def test_spheres(run_lammps, tmp_path):
    """Locks out spheres whose forces or torques are above the tolerance when the others' are not:
    one alone has no atom off its centre, and its radius of gyration is that of the sphere."""
    system = mixture("pair single", side=2, spacing=2.9)
    setup = system.setup.replace("atom_style molecular", "atom_style hybrid sphere molecular")
    data = re.sub(r"Masses\n\n(.+\n)+\n", "", system.files["data.bodies"])
    data = re.sub(r"\nVelocities\n\n(.+\n)+", "", data)
    data = re.sub(
        r"^(\d+) (\d+) (\d+) (\S+ \S+ \S+) (\S+ \S+ \S+)$", r"\1 \3 \4 0.5 1.0 \2 \5", data,
        flags=re.MULTILINE,
    ).replace("# molecular", "# hybrid")  # fmt: skip
    script = f"{setup}\n{SMOOTH}{FORCES.format('start')}{WAYS['cg'].format('')}"
    done = run_lammps(f"{script}run 0\n{FORCES.format('end')}", files={"data.bodies": data})
    assert REACHED in done.log
    assert (norms(tmp_path / "end") < 1.001e-9).all()
    assert bent(atoms(tmp_path / "start"), atoms(tmp_path / "end")) < 1e-12


@pytest.mark.parametrize("words", ["", " barostat mtk every 1 iso 1 1 100"], ids=["nvt", "npt"])
def test_overlap_that_breaks_chains(run_lammps, run_system, words):
    """Locks out an error of chains that asks for a TDAMP of at least what was given, and one of a
    piston that asks for another pressure, where atoms overlap at the start: each says so, and its
    advice is good."""
    system, kind = overlapping(40, 10), "npt" if words else "nvt"
    velocities = "velocity all create 298 4928 loop geom\ntimestep 1\n"
    chains = f"fix 1 all nosquish/{kind} molecule temp 298 298 100 thermostat nh{words}\n"
    screen = run_system(system, f"{velocities}{chains}run 100\n", check=False).screen.replace(
        "\n", " "
    )
    what = "than an edge," if words else "the Nose-Hoover chains are unstable"
    assert re.search(rf"{what} at step \d+: .*overlap at the start", screen), screen[-900:]
    assert "relax the bodies with minimize while this fix is defined" in screen
    assert "TDAMP" not in screen
    relax = f"{chains}minimize 0 5 1000 5000\n{velocities}run 100\n"
    run_lammps(f"{system.setup}\n{relax}", files=system.files)


DIPOLES = """
units lj
atom_style hybrid sphere dipole
region box block -5 5 -5 5 -5 5
create_box 1 box
create_atoms 1 single 0 0 0
create_atoms 1 single 1.5 0.2 0.1
create_atoms 1 single 0 2 0
set group all mass 1.0 diameter 0
set atom 1 dipole 1 0 0
set atom 2 dipole 0 1 0
set atom 3 dipole 0 0 1
fix body all property/atom i_body
set group all i_body 1
group loose id 2 3
group rigid id 1
pair_style lj/cut/dipole/cut 4.0
pair_coeff * * 1 1
fix field all efield 0 0.5 0.3
fix_modify field energy yes
fix 1 rigid nosquish/nve custom i_body flexible loose
"""


def test_torque_without_a_moment(run_lammps):
    """Locks out a minimization that does not end because of a torque that turns nothing, on a
    dipole that is a point."""
    assert REACHED in run_lammps(f"{DIPOLES}minimize 0 1e-4 4000 9000\n").log


# ------------------------------------------------------------------ LAMMPS's minimize

TABLE = "thermo_style custom step temp pe press\nthermo_modify format float %.16g norm no\n"


def goes_on(table):
    """Assert that a run begins where the minimization before it has ended."""
    first = np.flatnonzero(np.diff(table["Step"]) == 0)[-1]
    for name in "Temp", "PotEng", "Press":
        assert table[name][first + 1] == pytest.approx(table[name][first], rel=1e-9), name


@pytest.mark.parametrize("ranks", [1, 4])
def test_minimize_overlapping_start(run_system, tmp_path, ranks):
    """Locks out bodies that minimize bends, energies that rise, forces and torques above what it
    was asked for, velocities that change, and a next run that is elsewhere."""
    system = overlapping(12, 4)
    done = run_system(
        system,
        (
            f"{FORCES.format('start')}fix 1 all nosquish/nve molecule\n"
            f"{TABLE}velocity all create 300 4928\nthermo 1\nminimize 0 1e-6 5000 9000\nrun 0\n"
        )
        + FORCES.format("end"),
        ranks=ranks,
    )
    start, end = (atoms(tmp_path / name) for name in ("start", "end"))
    assert REACHED in done.log
    assert (norms(tmp_path / "end") < [1e-6, 2.5e-6]).all()  # torques are over radii, below 2.5
    assert bent(start, end) < 1e-12
    table = done.thermo
    assert (np.diff(table["PotEng"]) < 1e-9).all()
    assert table["PotEng"][0] > 1e5 > 0 > table["PotEng"][-1]
    assert np.ptp(table["Temp"]) < 1e-9 * table["Temp"][0]
    goes_on(table)


@pytest.mark.parametrize("ranks", [2, 4])
def test_minimize_beside_other_atoms(run_lammps, tmp_path, ranks):
    """Locks out atoms in no body that stay where they are, bodies of two fixes that move as those
    of one, and forces that are left on either."""
    system = mixture(side=2, spacing=2.2)
    groups = "group some molecule <= 4\ngroup two molecule 5:6\n"
    groups += "group rigid union some two\ngroup rest subtract all rigid\n"
    both = "fix 1 some nosquish/nvt molecule temp 1 1 1 thermostat nh\n"
    both += "fix 2 two nosquish/nve molecule\nfix 3 rest nve\n"
    exclude = " exclude molecule/intra "
    text = f"{system.setup.replace(exclude + 'all', '')}\n{SMOOTH}{groups}"
    text += f"neigh_modify{exclude}rigid\n"
    text += f"{FORCES.format('start')}{both}{TABLE}timestep 0.002\nminimize 0 1e-4 9000 20000\n"
    done = run_lammps(f"{text}run 0\n{FORCES.format('end')}", files=system.files, ranks=ranks)
    start, end = (atoms(tmp_path / name) for name in ("start", "end"))
    assert REACHED in done.log
    assert done.thermo["PotEng"][-2] == pytest.approx(done.thermo["PotEng"][-1], rel=1e-12)
    rigid = start[0] <= 6
    some, others = (
        [[column[which] for column in rows] for rows in (start, end)] for which in (rigid, ~rigid)
    )
    assert np.abs(others[1][3]).max() < 1e-4
    assert bent(*some) < 1e-12
    assert bent(*others) > 0.1


INTEGRATORS = (
    "nve molecule reinit no",
    "nvt molecule temp 1 1 1 seed 4",
    "npt molecule temp 1 1 1 thermostat nh barostat mtk iso 1 1 10",
    "npt molecule temp 1 1 1 seed 4 iso 1 1 10 compressibility 1e-1",
    "hmc molecule temp 1 seed 4 steps 2",
)


@pytest.mark.parametrize("ranks", [1, 4])
def test_minimize_with_each_integrator(run_lammps, tmp_path, ranks):
    """Locks out a box or a start of an integrator's own that minimize leaves undone, bodies that
    are back where they were before, and forces on bodies that are gone with those on atoms."""
    system = mixture(side=2, spacing=2.9)
    table = TABLE.replace("press", "press f_1[1][7] f_1[2][10]")
    text = f"{system.setup}\n{SMOOTH}{FORCES.format('start')}thermo 1000\ntimestep 0.002\n"
    for words in INTEGRATORS:
        text += f"fix 1 all nosquish/{words}\n{table}run 2\nminimize 0 0 20 60\nreset_timestep 0\n"
        text += "run 2\nunfix 1\n"
    done = run_lammps(text + FORCES.format("end"), files=system.files, ranks=ranks)
    start, end = (atoms(tmp_path / name) for name in ("start", "end"))
    assert bent(start, end) < 1e-9
    table = done.thermo.reshape(len(INTEGRATORS), 6)  # rows of the begin and the end of each
    assert (table["PotEng"][:, 3] < table["PotEng"][:, 2]).all()
    for name in "PotEng", "Press", "Temp", "f_1[1][7]", "f_1[2][10]":
        np.testing.assert_allclose(table[name][:, 4], table[name][:, 3], rtol=1e-9, err_msg=name)


def test_run_after_minimize(run_system, tmp_path):
    """Locks out a first step without its half kick: a thermostat whose velocities are those of the
    middle of a step begins behind minimize as a new one does."""
    system = mixture("solid planar", side=2, spacing=2.2)
    line = "fix 1 all nosquish/nvt molecule temp 1 1 1 seed 4\n"
    for name, again in ("one", ""), ("two", f"unfix 1\n{line}"):
        run_system(
            system,
            f"{SMOOTH}timestep 0.002\n{line}minimize 0 0 20 60\n{again}run 5\n"
            + FORCES.format(name),
        )
    (*_, x, _), (*_, y, _) = (atoms(tmp_path / name) for name in ("one", "two"))
    np.testing.assert_allclose(x, y, rtol=0, atol=1e-12)


@pytest.mark.quick
def test_minimize_with_components_off(run_system, tmp_path):
    """Locks out bodies that minimize moves where force and torque do not act on them."""
    system = mixture("solid planar", side=2, spacing=2.2)
    words = "molecule force 1*3 off off on torque 1*3 off off on torque 4 off off off"
    done = run_system(
        system,
        f"{SMOOTH}{FORCES.format('start')}fix 1 all nosquish/nve {words}\n"
        f"minimize 0 1e-6 900 2000\n{FORCES.format('end')}",
    )
    assert REACHED in done.log
    (molecule, mass, x, _), (*_, y, _) = (atoms(tmp_path / name) for name in ("start", "end"))
    for one in 1, 2, 3, 4:
        here = molecule == one
        shift = (mass[here, None] * (y - x)[here]).sum(axis=0) / mass[here].sum()
        moved = np.abs((y - x)[here] - shift).max(axis=0)  # by rotation
        if one < 4:
            assert np.abs(shift[:2]).max() < 1e-12 < 1e-3 < abs(shift[2])
            assert moved[2] < 1e-12 < 1e-3 < moved[0]
        else:
            assert moved.max() < 1e-12


def test_minimize_keeps_dmax(run_system, tmp_path):
    """Locks out a first step that is longer than min_modify says: a body's atoms move by dmax as a
    root mean square, at most."""
    system = overlapping(40, 10)
    run_system(
        system,
        f"fix 1 all nosquish/nve molecule\nmin_modify dmax 0.02\n"
        f"{FORCES.format('one')}minimize 0 0 1 1\n{FORCES.format('two')}",
    )
    (molecule, _, x, _), (_, _, y, _) = (atoms(tmp_path / name) for name in ("one", "two"))
    square = np.bincount(molecule.astype(int), ((y - x) ** 2).sum(axis=1))[1:]
    root = np.sqrt(square / np.bincount(molecule.astype(int))[1:])
    assert 0.02 * 0.7 < root.max() < 0.02 * 1.2  # a body's centre of mass is not that of its atoms


def test_minimize_before_the_fix(run_system, tmp_path):
    """Locks out a minimization that is not LAMMPS's own where no rigid body is defined yet."""
    system = mixture("solid planar", side=2, spacing=2.2)
    lines = f"minimize 0 1e-3 50 100\n{FORCES.format('end')}"
    options = ("-sf", "nosquish")
    for name, with_suffix in ("one", ()), ("two", options):
        run_system(system, f"{SMOOTH}{lines.replace('end', name)}", options=with_suffix)
    assert (tmp_path / "one").read_text() == (tmp_path / "two").read_text()


@pytest.mark.quick
def test_unchanged_script_with_minimize(run_lammps, tmp_path):
    """Locks out bodies that minimize behind LAMMPS's rigid fix bends with the suffix, too."""
    system = mixture("solid planar", side=2, spacing=2.2)
    text = f"{system.setup}\n{SMOOTH}{FORCES.format('start')}fix 1 all rigid/nve/small molecule\n"
    text += f"minimize 0 1e-6 100 300\n{FORCES.format('end')}run 5\n"
    for options, low, high in ((), 0.1, np.inf), (("-sf", "nosquish"), 0.0, 1e-12):
        run_lammps(text, files=system.files, options=options)
        assert low <= bent(atoms(tmp_path / "start"), atoms(tmp_path / "end")) < high
