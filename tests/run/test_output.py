"""What the fix tells of its bodies: the file of keyword output, body_table, f_ID columns,
the virial of each atom."""

import re
import sys

import mdtraj
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from support.body_table import MOMENTS, NAMES, read_dump, read_table, vector
from support.endings import SECONDS, assert_ended
from support.systems import LIKE_LAMMPS, OURS, RIGID, droplet, mixture
from validation.statistics import motion

FILE = "variable table string bodies.csv"


@pytest.fixture(autouse=True)
def leave_files(known):
    """Every run leaves its own files: none is known from another test."""
    known.clear()


# ---- the file


def close(found, expected, most):
    """Assert that no number is further off than this."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=most)


def compare_centre(row, system, mine, x, v, f):
    """Hold a body's centre, its velocity and the force on it against those of its atoms `mine`."""
    mass, total = system.mass[mine], system.mass[mine].sum()
    np.testing.assert_allclose(row["mass"], total, rtol=1e-12)
    # in the box, but for what it has moved since atoms were last put there
    place, image = vector(row, "x", "y", "z"), vector(row, "ix", "iy", "iz")
    close(place + system.h @ image, mass @ x[mine] / total, 1e-9 * np.abs(x).max())
    part = place / np.diag(system.h)
    assert (part > -0.1).all() and (part < 1.1).all()
    close(vector(row, "vx", "vy", "vz"), mass @ v[mine] / total, 1e-10 * np.abs(v).max())
    close(vector(row, "fx", "fy", "fz"), f[mine].sum(axis=0), 1e-10 * np.abs(f).max())


def compare_rotation(row, system, mine, x, v, f):
    """Hold a body's rotation, the torque on it and its principal frame against its atoms
    `mine`."""
    mass, total = system.mass[mine], system.mass[mine].sum()
    r, velocity = x[mine] - mass @ x[mine] / total, mass @ v[mine] / total
    momentum, large = mass @ np.cross(r, v[mine] - velocity), mass @ np.abs(v[mine])
    close(vector(row, "angmomx", "angmomy", "angmomz"), momentum, 3e-9 * np.abs(large).max())
    torque = np.cross(r, f[mine]).sum(axis=0)
    close(vector(row, "tqx", "tqy", "tqz"), torque, 3e-9 * np.abs(f).max())
    # every atom goes as v + omega x r
    told = vector(row, "omegax", "omegay", "omegaz")
    close(velocity + np.cross(told, r), v[mine], 1e-9 * np.abs(v).max())
    # the principal frame: the tensor of inertia is diagonal there, largest first
    square = (r**2).sum(axis=1)[:, None, None] * np.eye(3)
    inertia = (mass[:, None, None] * (square - r[:, :, None] * r[:, None])).sum(axis=0)
    turn = Rotation.from_quat(vector(row, "q1", "q2", "q3", "q0")).as_matrix()
    inside = turn.T @ inertia @ turn
    close(inside, np.diag(np.diag(inside)), 1e-9 * (np.abs(inertia).max() + 1))
    assert (np.diff(np.diag(inside)) <= 1e-9 * np.abs(inertia).max()).all()
    q = vector(row, "q0", "q1", "q2", "q3")
    np.testing.assert_allclose(q @ q, 1, rtol=1e-12)


@pytest.mark.quick
def test_values(simulate, tmp_path):
    """Locks out a centre in the wrong image, velocities of the half step, forces of another step,
    vectors in another frame, a quaternion turned the other way, units left out: each from
    positions, velocities and forces of a dump of the same step."""
    system = mixture(units="real")
    dump = (
        "dump 1 all custom 20 dump.* id x y z vx vy vz fx fy fz ix iy iz\n"
        "dump_modify 1 sort id format float %.17g"
    )
    simulate(
        system,
        OURS,
        40,
        words="molecule output 20 v_table",
        before=f"{FILE}\n{dump}",
        ranks=2,
    )
    table = read_table(tmp_path / "bodies.csv")
    bodies = np.unique(system.molecule)
    assert len(table) == 3 * len(bodies)
    for step in 0, 20, 40:
        rows = table[table["step"] == step]
        np.testing.assert_array_equal(rows["body"], bodies)
        np.testing.assert_allclose(rows["time"], step * system.dt, rtol=1e-12)
        atoms = np.loadtxt(tmp_path / f"dump.{step}", skiprows=9)
        x, v, f = atoms[:, 1:4] + atoms[:, 10:13] @ system.h.T, atoms[:, 4:7], atoms[:, 7:10]
        for row, body in zip(rows, bodies, strict=True):
            mine = system.molecule == body
            assert row["natoms"] == mine.sum()
            compare_centre(row, system, mine, x, v, f)
            compare_rotation(row, system, mine, x, v, f)


@pytest.mark.parametrize("ranks", [1, 2])
def test_lines_on_bodies(run_lammps, ranks):
    """Locks out a log with more on bodies than their number, degrees of freedom and temperature (it
    had ten lines on passes that no page explained)."""
    system = mixture("solid row")
    for line in OURS, "suffix nosquish\n" + RIGID:
        fix = line.format(group="bodies", words="molecule")
        log = run_lammps(f"{system.setup}\n{fix}\nrun 0\n", files=system.files, ranks=ranks).log
        said = re.search(r"^Rigid bodies by .*\n((  .*\n)+)", log, re.M)[1].splitlines()
        begins = [text.split()[0] for text in said[:3]]
        assert begins == [str(len(set(system.molecule))), said[1].split()[0], "start"], said
        assert "degrees of freedom" in said[1] and "temperature" in said[2]
        assert not said[3:], said


@pytest.mark.quick("2")
@pytest.mark.parametrize("ranks", [2, 4])
def test_same_on_any_number_of_ranks(simulate, tmp_path, ranks):
    """Locks out rows that are missing, twice or in another order,
    and frames that depend on the number of ranks."""
    system, tables = mixture(tilt=0.3), []
    for n in 1, ranks:
        simulate(system, OURS, 30, words="molecule output 10 v_table", before=FILE, ranks=n)
        tables.append(read_table(tmp_path / "bodies.csv"))
    one, many = tables
    for name in NAMES[:5]:
        np.testing.assert_array_equal(many[name], one[name], err_msg=name)
    turns = [Rotation.from_quat(vector(t, "q1", "q2", "q3", "q0")).as_matrix() for t in tables]
    linear = (one["natoms"] > 1) & (one["natoms"] < 4)
    np.testing.assert_allclose(turns[1][~linear], turns[0][~linear], rtol=0, atol=1e-8)
    np.testing.assert_allclose(
        turns[1][linear, :, 2], turns[0][linear, :, 2], rtol=0, atol=1e-8
    )  # the axis on which the atoms are
    for names in (["vx", "vy", "vz"], MOMENTS[:3], MOMENTS[3:6], MOMENTS[6:9], MOMENTS[9:]):
        reference = vector(one, *names)
        np.testing.assert_allclose(
            vector(many, *names),
            reference,
            rtol=0,
            atol=1e-8 * np.abs(reference).max(),
            err_msg=names[0],
        )
    centre = [vector(t, "x", "y", "z") + vector(t, "ix", "iy", "iz") @ system.h.T for t in tables]
    np.testing.assert_allclose(*centre, rtol=0, atol=1e-9 * np.abs(centre[0]).max())


@pytest.mark.parametrize("name, read", [("table", read_table), ("t.lammpstrj", read_dump)])
def test_steps_of_several_runs(simulate, tmp_path, name, read):
    """Locks out steps that are no multiples of N, a step that stands in the file twice where one
    run ends and the next begins, a second run that empties the file, an older file that is not
    replaced, and a file without a point in its name that is not taken as it is."""
    (tmp_path / name).write_text("step,time,vx (space frame; sigma/tau)\n")
    system = mixture("solid planar pair")
    after = "run 9\nrun 3 pre no\nrun 0\nrun 4\nreset_timestep 60\nrun 5"
    before = f"variable table string {name}"
    words = "molecule output 8 v_table" if "." in name else "molecule output 8 table"
    simulate(system, OURS, 20, words=words, before=before, after=after, ranks=2)
    table = read(tmp_path / name)
    steps = table["step"].reshape(-1, 27)
    assert (steps == steps[:, :1]).all() and (
        table["body"].reshape(-1, 27) == np.arange(1, 28)
    ).all()
    np.testing.assert_array_equal(steps[:, 0], [0, 8, 16, 24, 32, 64])


def test_order_of_rows(simulate, tmp_path):
    """Locks out rows in the order of atoms or ranks: they are in that of the bodies' IDs, the
    custom values, negative ones too."""
    system = mixture("solid planar")
    before = (
        FILE
        + "\nfix 3 all property/atom i_body\nvariable b atom 20-3*mol\nset group all i_body v_b"
    )
    simulate(system, OURS, 5, words="custom i_body output 5 v_table", before=before, ranks=4)
    table = read_table(tmp_path / "bodies.csv")
    np.testing.assert_array_equal(table["body"], np.tile(20 - 3 * np.arange(27, 0, -1), 2))
    np.testing.assert_array_equal(
        table["natoms"][:27], [(system.molecule == m).sum() for m in range(27, 0, -1)]
    )


# ---- the file in LAMMPS's dump format

DUMP = "bodies.lammpstrj"
ATOMS = (
    "dump 1 all custom 15 atoms.lammpstrj id type mol xu yu zu\n"
    "dump_modify 1 sort id format float %.17g"
)


def boxes(path):
    """The lines ITEM: BOX BOUNDS of a dump, and the numbers after them, (frames, 3, columns)."""
    lines = path.read_text().splitlines()
    places = [k for k, line in enumerate(lines) if "BOX BOUNDS" in line]
    numbers = [[line.split() for line in lines[k + 1 : k + 4]] for k in places]
    return [lines[k] for k in places], np.array(numbers, float)


@pytest.mark.parametrize(
    "system, ranks",
    [
        pytest.param(mixture(tilt=0.3), 4, marks=pytest.mark.quick),
        (mixture("row pair single", tilt=-0.2), 1),
        (droplet("p f f", margin=2.0), 2),
    ],
    ids=["tilted", "tilted back", "faces"],
)
def test_dump_beside_that_of_atoms(simulate, tmp_path, system, ranks):
    """Locks out a box, faces, image flags, order or direction of a quaternion, one that belongs to
    another frame at each step, and species that are not those of LAMMPS's dump of the atoms, where
    fix deform changes the box (here not in a step of the files: it does so after the table); and a
    file that mdtraj cannot read."""
    fix = f"fix 9 all deform 4 x scale 1.01 remap x\n{OURS}"
    before = f"variable table string {DUMP}\n{ATOMS}"
    simulate(system, fix, 30, words="molecule output 15 v_table", before=before, ranks=ranks)
    lines, bounds = boxes(tmp_path / DUMP)
    lines_of_atoms, bounds_of_atoms = boxes(tmp_path / "atoms.lammpstrj")
    assert lines == lines_of_atoms
    close(bounds, bounds_of_atoms, 1e-14 * np.abs(bounds).max())
    table = read_dump(tmp_path / DUMP).reshape(3, -1)
    atoms = motion.read(tmp_path / "atoms.lammpstrj")[1]
    n, body = table.shape[1], np.searchsorted(table["body"][0], atoms[0, :, 2])
    kinds = [tuple(np.sort(atoms[0, body == k, 1])) for k in range(n)]
    types = [[*dict.fromkeys(kinds)].index(kind) + 1 for kind in kinds]
    np.testing.assert_array_equal(table["type"], [types] * 3)

    topology = mdtraj.Topology()
    residue = topology.add_residue("bodies", topology.add_chain())
    for _ in range(n):
        topology.add_atom("body", mdtraj.element.virtual, residue)
    read = mdtraj.load(tmp_path / DUMP, top=topology)
    close(10 * read.xyz, vector(table, "x", "y", "z"), 1e-5)
    inside = None
    for k, rows in enumerate(table):
        h = 10 * read.unitcell_vectors[k].T
        centre = vector(rows, "x", "y", "z") + vector(rows, "ix", "iy", "iz") @ h.T
        r = atoms[k, :, 3:] - centre[body]
        turn = Rotation.from_quat(vector(rows, "q1", "q2", "q3", "q0"))[body]
        inside = turn.inv().apply(r) if inside is None else inside
        close(turn.apply(inside), r, 1e-5)  # mdtraj has single precision
    assert np.abs(r - turn.apply(turn.inv().apply(atoms[0, :, 3:]))).max() > 0.01


def test_species_keep_their_type(simulate, tmp_path):
    """Locks out another type of a species in the next run, because the first one is gone."""
    before = f"variable table string {DUMP}"
    after = "delete_atoms group solid\nrun 10"
    simulate(
        mixture("solid planar pair"), OURS, 10, words="molecule output 10 v_table", before=before,
        after=after, ranks=2,
    )  # fmt: skip
    table = read_dump(tmp_path / DUMP)
    counts = [np.count_nonzero(table["type"] == kind) for kind in (1, 2, 3)]
    assert len(table) == sum(counts) and counts == [18, 27, 27]
    assert (table["type"] == 1 + (table["body"] > 9) + (table["body"] > 18)).all()


# ---- a disk that does not take it


@pytest.mark.parametrize(
    "name, said, ranks",
    [
        ("nowhere/bodies", "No such file or directory", 2),
        ("/dev/full", "No space left on device", 1),
        (".", "directory", 2),
    ],
)
def test_file_that_cannot_be_written(simulate, tmp_path, name, said, ranks):
    """Locks out a hang of the ranks that do not write, a message per rank,
    and a run that goes on without its output."""
    before = f"variable table string {name}"
    run = simulate(
        mixture("solid"),
        OURS,
        10,
        words="molecule output 1 v_table",
        before=before,
        ranks=ranks,
        check=False,
        timeout=SECONDS,
    )
    assert_ended(run, ("keyword output", name, said), tmp_path)


# a file on a disk of 64 KiB
SMALL_DISK = """
import errno, io, os, sys
import lammps
from fix_nosquish.run import output

class File(io.FileIO):
    def write(self, text):
        room = 65536 - self.tell()
        if not room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(text[:room])

output.open = lambda path, mode, buffering: File(path, mode)
# two ranks' tracebacks run into each other, and into the message looked for
sys.excepthook = lambda *_: None
lammps.lammps().file(sys.argv[1])
"""


LIMITED = """
import sys, resource, lammps
lmp = lammps.lammps()
resource.setrlimit(resource.RLIMIT_FSIZE, (99999, 99999))
sys.excepthook = lambda *_: None
lmp.file(sys.argv[1])
"""


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    "disk, said", [(SMALL_DISK, "No space left on device"), (LIMITED, "File too large")]
)
def test_disk_that_fills_up(simulate, tmp_path, disk, said, ranks):
    """Locks out a file that ends within a step or a row, a log that is lost, and a hang, when the
    disk is full in mid-run, or a file as large as a limit allows."""
    run = simulate(
        mixture("solid"),
        OURS,
        100,
        words="molecule output 1 v_table",
        before=FILE,
        every=1,
        ranks=ranks,
        check=False,
        timeout=SECONDS,
        launcher=[sys.executable, "-c", disk],
    )
    assert_ended(run, ("keyword output", "bodies.csv", said), tmp_path)
    assert (tmp_path / "bodies.csv").read_text().endswith("\n")
    table = read_table(tmp_path / "bodies.csv")
    last = int(table["step"][-1])
    assert last >= 2 and len(table) == 27 * (last + 1)
    assert f"whole up to step {last}" in run.screen
    assert run.thermo["Step"][-1] in (last, last + 1)


def test_table_of_a_run_without_setup(run_system, tmp_path):
    """Locks out a row of the first step with the positions of before it, where write_restart has
    begun a run that goes on with pre no."""
    system, tables = mixture(side=2), []
    fix = OURS.format(group="all", words="molecule output 1 v_table")
    for runs in "run 6", "run 3\nwrite_restart state\nrun 3 pre no":
        run_system(system, f"{FILE}\n{fix}\ntimestep {0.1 * system.dt:.17g}\n{runs}\n")
        tables.append(read_table(tmp_path / "bodies.csv"))
    whole, parts = tables
    np.testing.assert_array_equal(whole["step"], parts["step"])
    for name in ["vx", "vy", "vz", "omegax", "omegay", "omegaz"]:
        np.testing.assert_allclose(whole[name], parts[name], rtol=0, atol=1e-9, err_msg=name)


# ---- from Python

SCRIPT = """
import sys
import numpy as np
{more}
from lammps import lammps
import fix_nosquish

def gathered(lmp, what):
    table = fix_nosquish.body_table(lmp, "1")
    assert (np.diff(table["body"]) > 0).all()
    if {ranks} > 1:
        table = np.concatenate(MPI.COMM_WORLD.allgather(table))
    if not lmp.extract_setting("world_rank"):
        np.save(what, table)

lmp = lammps()
lmp.file(sys.argv[1])
for fix in "7", "1":
    try:
        fix_nosquish.body_table(lmp, fix)
    except Exception as error:
        print("refused:", error)
lmp.command("run 0")
gathered(lmp, "start")
lmp.command("run 20")
gathered(lmp, "end")
lmp.command("write_restart state")
gathered(lmp, "later")
lmp.close()
"""


@pytest.mark.parametrize("ranks", [1, 2, 4, 8])
@pytest.mark.parametrize("name, read", [("bodies.csv", read_table), (DUMP, read_dump)])
def test_table_in_python(run_lammps, tmp_path, ranks, name, read):
    """Locks out fields that are missing, a body on two ranks or on none, rows in another order than
    that of the bodies' IDs, another number than in the file, and a table that reads the atoms where
    they were before another command moved them."""
    system = mixture()
    (tmp_path / "drive.py").write_text(
        SCRIPT.format(more="from mpi4py import MPI" if ranks > 1 else "", ranks=ranks)
    )
    fix = OURS.format(group="all", words="molecule output 20 v_table")
    before = f"variable table string {name}"
    script = "\n".join([system.setup, before, fix, f"timestep {system.dt:.17g}", ""])
    run = run_lammps(
        script,
        files=system.files,
        ranks=ranks,
        launcher=[sys.executable, "-m", "mpi4py", "drive.py"],
        timeout=SECONDS,
    )
    assert "no fix 7" in run.screen and "before the first run" in run.screen
    table = read(tmp_path / name)
    fields = "step time body natoms mass x image v q angmom omega force torque"
    for when in "start", "end", "later":
        rows = np.load(tmp_path / f"{when}.npy")
        assert rows.dtype.names == tuple(fields.split())
        assert (
            rows["q"].shape == (27, 4)
            and rows["torque"].shape == (27, 3)
            and rows["body"].dtype == rows["image"].dtype == np.int64
        )
        np.testing.assert_array_equal(np.sort(rows["body"]), np.arange(1, 28))
        rows = np.sort(rows, order="body")
        same = table[table["step"] == (0 if when == "start" else 20)]
        plain = np.column_stack([rows[field] for field in fields.split()])
        if when == "later":  # write_restart may have put the atoms into the box
            centre = vector(same, "x", "y", "z") + vector(same, "ix", "iy", "iz") @ system.h.T
            close(rows["x"] + rows["image"] @ system.h.T, centre, 1e-12)
        else:
            here = [field in same.dtype.names for field in NAMES]
            assert sum(here) == len(NAMES) - 2 * (name == DUMP)
            np.testing.assert_array_equal(plain[:, here], vector(same, *np.compress(here, NAMES)))


# ---- f_ID


def columns(*ij):
    return "f_1 " + " ".join(f"f_1[{i}][{j}]" for i, j in ij)


SOME = [(i, j) for i in (1, 8, 27) for j in (1, 2, 3, 4, 6, 7, 9, 10, 12, 13, 14, 15)]


@pytest.mark.parametrize("ranks", [1, 4])
def test_scalar_and_array(simulate, ranks):
    """Locks out another order of rows or columns of f_ID[i][j] than fix rigid's, another
    temperature in f_ID, values of the step before, and rows that are on another rank left at
    zero."""
    system = mixture("solid planar")
    how = dict(every=1, columns=columns(*SOME))
    theirs, ours = (
        simulate(system, RIGID, 20, **how),
        simulate(system, LIKE_LAMMPS, 20, ranks=ranks, **how),
    )
    np.testing.assert_allclose(ours.thermo["f_1"], theirs.thermo["f_1"], rtol=1e-9)
    for i, j in SOME:
        a, b = (r.thermo[f"f_1[{i}][{j}]"] for r in (ours, theirs))
        if j <= 3:  # which image is the centre's own is a matter of taste
            a, b = (
                c + system.h[j - 1, j - 1] * r.thermo[f"f_1[{i}][{j + 12}]"]
                if (i, j + 12) in SOME
                else c
                for c, r in ((a, ours), (b, theirs))
            )
        if j <= 12:
            np.testing.assert_allclose(
                a, b, rtol=0, atol=1e-8 * max(1, np.abs(b).max()), err_msg=f"{i} {j}"
            )


def test_scalar_with_forces_off(simulate):
    """Locks out a temperature in f_ID that depends on keyword force: all motion counts, that of a
    component which is switched off too. (rigid/nve leaves such components out: 0.7175 against
    0.7721.)"""
    system, words = mixture("solid planar"), "molecule force * off on on torque * off off off"
    ours = simulate(system, LIKE_LAMMPS, 20, words=words, every=5, columns="f_1 f_1[1] f_1[2]")
    degrees = 6 * system.molecule.max()
    np.testing.assert_allclose(
        ours.thermo["f_1"],
        2 * (ours.thermo["f_1[1]"] + ours.thermo["f_1[2]"]) / degrees,
        rtol=1e-12,
    )


SWITCHED = "force * off off on torque * off {0} off force 3 off off off"
SUMS = (
    "compute ch all chunk/atom molecule\ncompute t all torque/chunk ch\n"
    "compute p all property/atom fx fy fz\ncompute f all reduce/chunk ch sum c_p[*]\n"
)
SOME_SUMS = [(i, j) for i in (2, 3) for j in range(1, 7)]
LOCAL = "compute all all rigid/local/nosquish 1 fx fy fz tqx tqy tqz\n" + "".join(
    f"compute m{j} all reduce max c_all[{j}] inputs local\nvariable m{j} equal max(f_1[{j + 6}])\n"
    for j in range(1, 7)
)


@pytest.mark.parametrize(
    "fix, ranks",
    [
        ("rigid {words}", 1),
        ("rigid/nosquish {words}", 2),
        ("nosquish/nve {words} output 10 v_table", 1),
        ("nosquish/nve {words}\nrun_style respa 2 2 pair 1", 2),
        ("nosquish/nvt {words} temp 1 1 1 seed 3", 4),
        ("nosquish/nvt {words} temp 1 1 1 thermostat nh", 1),
    ],
)
def test_force_on_held_bodies(simulate, tmp_path, fix, ranks):
    """Locks out forces and torques that are 0 where the keywords force and torque switch components
    off: friction and disjoining pressure of walls are read there. As with LAMMPS's fix rigid, which
    is tried, too, they are the sums over the atoms, in f_ID, in compute rigid/local and in the file
    of keyword output."""
    words = "molecule " + SWITCHED.format("off" if "temp" in fix else "on")
    columns = [f"f_1[{i}][{j + 6}] c_{'ft'[j > 3]}[{i}][{(j - 1) % 3 + 1}]" for i, j in SOME_SUMS]
    local = LOCAL if "nosquish" in fix else ""
    columns += [f"c_m{j} v_m{j}" for j in range(1, 7) if local]
    thermo = simulate(
        mixture("solid planar"), f"fix 1 {{group}} {fix}\n{SUMS}{local}", 20,
        words=words, ranks=ranks, columns=" ".join(columns), before=FILE,
    ).thermo  # fmt: skip
    for i, j in SOME_SUMS:
        result, name = thermo[f"f_1[{i}][{j + 6}]"], f"c_{'ft'[j > 3]}[{i}][{(j - 1) % 3 + 1}]"
        assert np.abs(thermo[name]).min() > 1e-6
        close(result, thermo[name], 1e-10 * np.abs(result).max())
        if local:
            close(thermo[f"c_m{j}"], thermo[f"v_m{j}"], 1e-12)
        if "output" in fix:
            table = read_table(tmp_path / "bodies.csv")
            close(table[NAMES[j - 7]][table["body"] == i], result, 1e-12)


def test_vector(simulate):
    """Locks out energies without their factor of the unit style, translation and rotation mixed up,
    and wrong degrees of freedom: against compute ke/rigid and erotate/rigid of fix rigid/nve, and
    the equation E = N k T / 2."""
    system = mixture("solid planar pair", units="real")
    rigid = "compute ke all ke/rigid 1\ncompute rot all erotate/rigid 1"
    vector = "f_1 " + " ".join(f"f_1[{k}]" for k in range(1, 5))
    how = dict(every=5, dt=0.01, after="run 10")
    theirs = simulate(system, RIGID + "\n" + rigid, 20, columns="c_ke c_rot f_1", **how)
    ours = simulate(system, LIKE_LAMMPS, 20, columns=vector, ranks=2, **how)
    np.testing.assert_allclose(ours.thermo["f_1[1]"], theirs.thermo["c_ke"], rtol=1e-9)
    np.testing.assert_allclose(
        ours.thermo["f_1[2]"], theirs.thermo["c_rot"], rtol=1e-7
    )  # LAMMPS splits the rotation of pairs
    np.testing.assert_allclose(
        ours.thermo["f_1"][-3:], theirs.thermo["f_1"][-3:], rtol=1e-7
    )  # in its first run it knows no linear ones
    counts = [np.bincount(system.molecule)[1:]]
    linear = (counts[0] == 2).sum()
    boltz = 0.0019872067
    for energy, temperature, degrees in (1, 3, 3 * 27), (2, 4, 3 * 27 - linear):
        np.testing.assert_allclose(
            2 * ours.thermo[f"f_1[{energy}]"],
            degrees * boltz * ours.thermo[f"f_1[{temperature}]"],
            rtol=1e-6,
        )


# ---- virial of each atom


STRESS = (
    "compute s all stress/atom NULL {parts}\n"
    "compute total all reduce sum c_s[1] c_s[2] c_s[3] c_s[4] c_s[5] c_s[6]\n"
    "compute p all pressure NULL {parts}\nvariable volume equal vol\n"
)
PARTS = (
    " ".join(f"c_total[{k}]" for k in range(1, 7))
    + " vol "
    + " ".join(f"c_p[{k}]" for k in range(1, 7))
)


def pressures(result):
    """(steps, 6) pressure by compute stress/atom and by compute pressure."""
    t = result.thermo
    return [
        np.stack(
            [sign * t[f"{name}[{k}]"] / (t["Volume"] if sign < 0 else 1) for k in range(1, 7)],
            axis=1,
        )
        for name, sign in (("c_total", -1), ("c_p", 1))
    ]


@pytest.mark.parametrize("ranks, parts", [(1, "virial"), (4, "fix")])
def test_stress_of_atoms(simulate, ranks, parts):
    """Locks out bodies' virial that is not in compute stress/atom, is there twice, on another atom
    or of another step: the atoms' stresses add up to the pressure, where bodies are on several
    ranks and atoms change places, too."""
    system = mixture()
    how = dict(
        before=STRESS.format(parts=parts) + "neigh_modify every 1 delay 0 check no",
        columns=PARTS,
        every=3,
        ranks=ranks,
    )
    of_atoms, whole = pressures(simulate(system, OURS, 30, **how))
    np.testing.assert_allclose(of_atoms, whole, rtol=0, atol=1e-10 * np.abs(whole).max())
    assert np.abs(whole).max() > 0.1


@pytest.mark.parametrize("ranks", [1, 4])
def test_stress_of_each_atom(simulate, tmp_path, ranks):
    """Locks out a virial that adds up and yet is on the wrong atoms: with m a - f of each atom, a
    by differences of a dump's velocities, about the centre of mass.  (fix rigid has it about the
    origin: its sum is the same.)"""
    system, dt = mixture("solid planar row"), 1e-2
    dump = (
        "\ndump 1 all custom 1 dump.* id x y z vx vy vz fx fy fz ix iy iz c_s[1] c_s[2] c_s[3] "
        "c_s[4] c_s[5] c_s[6] c_c[1] c_c[2] c_c[3] c_c[4] c_c[5] c_c[6] c_c[7] c_c[8] c_c[9]"
        "\ndump_modify 1 sort id format float %.17g"
    )
    simulate(
        system,
        OURS,
        2,
        dt=dt,
        every=1,
        before=f"compute c all centroid/stress/atom NULL fix\n{STRESS.format(parts='fix')}{dump}",
        columns=PARTS,
        ranks=ranks,
    )
    early, now, late = (np.loadtxt(tmp_path / f"dump.{k}", skiprows=9)[:, 1:] for k in range(3))
    x = now[:, :3] + now[:, 9:12] @ system.h.T
    force = (
        system.mass[:, None] * (late[:, 3:6] - early[:, 3:6]) / (2 * dt * system.dt) - now[:, 6:9]
    )
    totals = np.bincount(system.molecule, system.mass)
    centre = (
        np.stack([np.bincount(system.molecule, system.mass * c) for c in x.T], axis=1)[1:]
        / totals[1:, None]
    )
    r = x - centre[system.molecule - 1]
    virial = np.stack(
        [
            r[:, a] * force[:, b]
            for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1))
        ],
        axis=1,
    )
    bound = 1e-5 * np.abs(virial).max()
    np.testing.assert_allclose(-now[:, 12:18], virial[:, :6], rtol=0, atol=bound)
    np.testing.assert_allclose(-now[:, 18:], virial, rtol=0, atol=bound)
    assert np.abs(virial[:, 3] - virial[:, 6]).max() > 1
    assert np.abs(virial).max() > 1


def test_two_fixes_and_one_file(run_system, tmp_path):
    """Locks out two fixes that write over each other's tables."""
    system = mixture("solid planar")
    fixes = [
        OURS.format(group=g, words="molecule output 2 same").replace("fix 1", f"fix {k}")
        for k, g in enumerate(("one", "two"))
    ]
    groups = "group one molecule 1:9\ngroup two subtract all one"
    run = run_system(
        system, "\n".join([groups, *fixes, "run 4", ""]), ranks=2, check=False, timeout=SECONDS
    )
    assert_ended(run, ("two fixes write their table", "same", "a file of its own"), tmp_path)


CALLED = """
import sys
import numpy as np
{more}
from lammps import lammps
import fix_nosquish

lmp = lammps()
lmp.file(sys.argv[1])
seen = []

def look(caller, step, nlocal, tag, x, f):
    f[:] = 0.0
    if step:
        seen.append(np.sort(fix_nosquish.body_table(lmp, "1"), order="body"))

lmp.set_fix_external_callback("e", look, lmp)
lmp.command("run 6")
np.save(f"seen.{{lmp.extract_setting('world_rank')}}", np.array(seen))
lmp.close()
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_table_in_the_middle_of_a_step(run_lammps, tmp_path, ranks):
    """Locks out force and torque that are those of the last output where something in mid-step
    asks, when no step calls Python."""
    system = mixture("solid planar pair")
    (tmp_path / "drive.py").write_text(
        CALLED.format(more="from mpi4py import MPI" if ranks > 1 else "")
    )
    fix = OURS.format(group="all", words="molecule")
    tables = []
    for every in 1, 6:
        script = "\n".join(
            [
                system.setup,
                fix,
                "fix e all external pf/callback 1 1",
                f"thermo {every}",
                f"timestep {system.dt:.17g}",
                "",
            ]
        )
        run_lammps(
            script,
            files=system.files,
            ranks=ranks,
            launcher=[sys.executable, "-m", "mpi4py", "drive.py"],
            timeout=SECONDS,
        )
        tables.append(
            np.concatenate(
                [np.load(tmp_path / f"seen.{rank}.npy") for rank in range(ranks)], axis=1
            )
        )
    each, last = tables
    assert (
        each.shape == (6, len(np.unique(system.molecule)))
        and (each["force"][1:] != each["force"][:-1]).any(axis=(1, 2)).all()
    )
    for name in "x", "v", "force", "torque":
        np.testing.assert_allclose(last[name], each[name], rtol=1e-12, atol=1e-12, err_msg=name)


def test_pressure_where_the_table_is_written(simulate):
    """Locks out a pressure without the bodies' virial, on steps that only end with Python."""
    system = mixture("solid planar pair row")
    plain = simulate(system, OURS, 20, every=4)
    table = simulate(system, OURS, 20, every=4, words="molecule output 4 table")
    np.testing.assert_array_equal(table.thermo["Press"], plain.thermo["Press"])


@pytest.mark.parametrize("ranks", [1, 2])
def test_column_of_a_former_fix(refused, ranks):
    """Locks out a Python error, or another fix's value, where output outlives the words of the fix
    that gave it."""
    system = mixture(side=2, spacing=3)
    fix = "fix 1 all nosquish/hmc molecule temp 1 seed 4 steps 1"
    script = (
        f"{system.setup}\n{fix}\nthermo_style custom step f_1[7]\nrun 0\nunfix 1\n"
        f"{OURS.format(group='all', words='molecule')}\nrun 10\n"
    )
    refused(script, "f_1[7] was asked for, and this fix has 4", system.files, ranks=ranks)


HELD = """
import os
import sys
import numpy as np
{more}
from lammps import lammps
import fix_nosquish
from fix_nosquish.run import registry

def print(*words):  # a line at once, also where another rank prints
    os.write(1, (" ".join(map(str, words)) + chr(10)).encode())

def tell(what, *arguments):
    try:
        print("SAID", what(*arguments))
    except Exception as error:
        print("SAID", type(error).__name__, error)

lmp = lammps()
lmp.file(sys.argv[1])
held, = [one for one in registry._all]
table = held.table
print("BEFORE", len(table()))
lmp.command("unfix 1")
tell(table)
tell(getattr, held, "lammps")
tell(fix_nosquish.body_table, lmp, "1")
try:
    lmp.command('fix 1 all nosquish/hmc molecule temp 300 seed 1 nosuch 2')
except Exception as error:
    broken = error  # which holds the frames, and so the integrator, that was not finished
tell(fix_nosquish.body_table, lmp, "1")
lmp.command('{fix}')
lmp.command("run 5")
print("AFTER", len(fix_nosquish.body_table(lmp, "1")))
lmp.close()
tell(table)
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_an_integrator_that_is_held_after_unfix(run_system, tmp_path, ranks):
    """Locks out an integrator that a driver holds, whose fix is gone, which reads freed memory,
    has body_table fail, and has a new fix refused because of bodies that it no longer moves."""
    fix = "fix 1 all nosquish/hmc molecule temp 300 steps 5 seed 1"
    more = "from mpi4py import MPI" if ranks > 1 else ""
    (tmp_path / "drive.py").write_text(HELD.format(more=more, fix=fix))
    system = mixture("solid planar pair")
    run = run_system(system, f"{fix}\nrun 5\n", ranks=ranks, launcher=[sys.executable, "drive.py"])
    printed = run.screen.split("SAID ")[1:]  # two ranks may print on one line
    assert len(printed) == 5 * ranks
    gone = [line for line in printed if line.startswith("RunError fix 1 (nosquish/hmc) no longer")]
    assert len(gone) == 3 * ranks
    assert sum("RunError there is no fix 1" in line for line in printed) == 2 * ranks
    counts = [
        sum(map(int, re.findall(rf"{word} (\d+)", run.screen))) for word in ("BEFORE", "AFTER")
    ]
    assert counts[0] == counts[1] > 1


FULL = """
import sys
from lammps import lammps
import numpy as np
from fix_nosquish.bodies import infile

def save(file, *_, **__):
    file.write("half")
    raise OSError(28, "No space left on device")

lmp = lammps()
lmp.file(sys.argv[1])
np.savetxt, savetxt = save, np.savetxt
try:
    lmp.command("write_restart state")
except Exception as error:
    print("SAID", error)
"""


def test_file_beside_a_restart_that_does_not_fit(simulate, run_system, tmp_path):
    """Locks out a disk that is full and leaves half of the bodies beside a restart file, in the
    place of those of before."""
    system = mixture("planar")
    (tmp_path / "drive.py").write_text(FULL)
    fix = OURS.format(group="all", words="molecule infile v_bodies")
    run = run_system(
        system,
        f"variable bodies string none\n{fix}\nrun 0\nwrite_restart state\n",
        files={"none": "0\n"},
        launcher=[sys.executable, "drive.py"],
    )
    assert "cannot write the bodies to state.rigid: No space left on device" in run.screen
    text = (tmp_path / "state.rigid").read_text()
    assert "half" not in text and len(text.splitlines()) > 3
    assert not list(tmp_path.glob("state.rigid.*"))
