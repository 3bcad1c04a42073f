"""The keywords force, torque, reinit and infile, and bodies of spheres,
against fix rigid/nve with the same words."""

import itertools
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from support import systems
from support.bad_input import Case
from support.endings import SECONDS, assert_ended
from support.systems import LIKE_LAMMPS, OURS, RIGID, apart, close, mixture
from validation.scenes.data_file import data_file


def assert_same(ours, theirs, system):
    """Two Results have the same positions, velocities and temperatures, to rounding errors."""
    systems.assert_same(ours, theirs, system.h)
    np.testing.assert_allclose(ours.thermo["Temp"], theirs.thermo["Temp"], rtol=1e-8)


# ---- force and torque

GROUPS = "group a molecule 1\ngroup b molecule 8 9\ngroup c molecule 20"
FLAT = "fix 9 all enforce2d"
CUSTOM = "fix 3 all property/atom i_body\nvariable b atom 70-2*mol\nset group all i_body v_b"


@pytest.mark.quick("molecule one")
@pytest.mark.parametrize(
    "words, group, before, ranks",
    [
        ("molecule force 3 off on off torque 3 on off off", "bodies", "", 1),
        ("molecule force * off off off torque * off on on", "bodies", "", 2),
        (
            "molecule force 20* on off on force 21 off on off torque *5 off off off "
            "torque 2*3 on off on force * on on on force 6*9 off off on",
            "bodies",
            "",
            4,
        ),
        (
            "molecule force 2 off off off torque 3* off off on",
            "some",
            "group some molecule 2 7:11",
            2,
        ),
        (
            "group 3 a b c force 2*3 on off off torque 1*2 off off off torque 2 on off on",
            "all",
            GROUPS,
            1,
        ),
        (
            "custom i_body torque 2*20 off off on force 27 off off off force *1 off on on",
            "all",
            CUSTOM,
            2,
        ),
        ("single force 1 off off on torque * off on off", "one", "group one molecule 5", 1),
        ("molecule force 2*9 off on off torque 5* off off off", "bodies", FLAT, 2),
        (
            "molecule force * on off off force 1 on on off torque * off off off torque *3 off off "
            "on",
            "bodies",
            FLAT,
            2,
        ),
    ],
    ids=[
        "molecule one",
        "molecule all",
        "molecule overridden",
        "molecules with gaps",
        "group",
        "custom",
        "single",
        "plane",
        "plane overridden",
    ],
)
def test_force_and_torque(simulate, words, group, before, ranks):
    """Locks out flags on other bodies than those of this number (molecule-IDs have gaps, custom
    values turn the order, ranks have a few bodies each), flags in the body frame, and an earlier
    keyword that wins over a later one; and that the words that fix rigid demands in two dimensions
    are refused, or switch other components off."""
    flat = before == FLAT
    system = mixture("planar", side=5, dimension=2) if flat else mixture("solid planar")
    how = dict(group=group, before=before)
    theirs = simulate(system, RIGID, 50, words=words, **how)
    assert_same(simulate(system, LIKE_LAMMPS, 50, words=words, ranks=ranks, **how), theirs, system)
    plain = simulate(
        system, RIGID, 50, words=words.partition(" force")[0].partition(" torque")[0], **how
    )
    assert apart(plain, theirs, system.h) > 1e-3, "the words make no difference here"


def test_force_off_is_a_straight_line(simulate):
    """Locks out a body that is off and yet gets a kick from its shared forces: without force and
    torque, the centres of pairs and single atoms too go straight and the energy of each body's
    motion stays (fix rigid takes no single atoms)."""
    system = mixture()
    start, end = (
        simulate(
            system, OURS, n, words="molecule force * off off off torque * off off off", ranks=2
        )
        for n in (0, 100)
    )
    for body in np.unique(system.molecule):
        mine = system.molecule == body
        mass = system.mass[mine]
        first, last = (mass @ run.v[mine] / mass.sum() for run in (start, end))
        np.testing.assert_allclose(last, first, rtol=0, atol=1e-13)
        kinetic = [mass @ (run.v[mine] ** 2).sum(axis=1) for run in (start, end)]
        if mine.sum() <= 3:  # linear, and so exact
            np.testing.assert_allclose(kinetic[1], kinetic[0], rtol=1e-12)


BAD_WORDS = {
    "number above the last body": Case(
        "all molecule force 28 on on on", ("keyword force", "bodies 28 to 28", "bodies 1 to 27")
    ),
    "range that goes past the last body": Case(
        "all molecule torque 5*30 on on on", ("keyword torque", "bodies 5 to 30", "1 to 27")
    ),
    "range the wrong way round": Case(
        "all molecule force 9*5 on on on", ("keyword force", "bodies 9 to 5")
    ),
    "infile of a variable that is not there": Case(
        "all molecule infile v_f", ("variable 'f'", "define it before the fix")
    ),
    "infile of a variable without text": Case(
        "all molecule infile v_f",
        ("variable f", "not a string-style variable", "string"),
        before="variable f equal 1",
    ),
    "infile that is not there": Case(
        "all molecule infile nowhere", ("infile nowhere", "No such file")
    ),
    "infile that is a folder": Case(
        "all molecule infile v_f", ("infile .: Is a directory",), before="variable f string ."
    ),
}


@pytest.mark.parametrize("name", BAD_WORDS)
def test_bad_words(run_case, tmp_path, name):
    """Locks out a hang, several messages, a traceback and a silently wrong run,
    for each wrong use of a keyword."""
    assert_ended(run_case(BAD_WORDS[name], ranks=2), BAD_WORDS[name].expected, tmp_path)


@pytest.mark.parametrize(
    "words, said", [("force * on on on", "z is off"), ("torque 1 on off on", "x and y are off")]
)
def test_bad_words_in_the_plane(simulate, tmp_path, words, said):
    """Locks out silence where a script asks for what two dimensions do not have."""
    system = mixture("planar", side=5, dimension=2)
    run = simulate(
        system,
        OURS,
        1,
        words="molecule " + words,
        before="fix 9 all enforce2d",
        ranks=2,
        check=False,
        timeout=SECONDS,
    )
    assert_ended(
        run, ("keyword " + words.split()[0], said + " in two dimensions", "say off"), tmp_path
    )


# ---- reinit


def test_groups_with_other_bits(run_system, tmp_path):
    """Locks out bodies that are lost because their groups were deleted and made anew, and "claimed
    by two fixes" of atoms that are not, because a fix still knew the other's group by its old
    bit."""
    system, ends = mixture(side=2, spacing=2.9), []
    group, line = (
        "group {0} molecule {1}\n",
        "fix {1} {0} nosquish/nve {2} reinit no\n",
    )
    groups = [group.format(*which) for which in ("a1", "b2", "c3")]
    fixes = line.format("all", 1, "group 2 a b") + line.format("all", 2, "group 1 c")
    others = "group a delete\ngroup b delete\ngroup c delete\n" + "".join(reversed(groups))
    for between in "", others:
        run_system(
            system,
            f"{''.join(groups)}{fixes}timestep 0.004\nrun 20\n{between}run 20\n"
            f"write_dump all custom end id x y z modify sort id format float %.17g\n",
        )
        ends.append(np.loadtxt(tmp_path / "end", skiprows=9))
    np.testing.assert_array_equal(*ends)


BETWEEN = {
    "nothing": "run 20",
    "velocities scaled": "velocity all scale 2.5\nrun 20",
    "velocities new": (
        "variable w atom sin(id)\nvelocity all set v_w NULL v_w\nrun 20\n"
        "velocity all set 0.1 0 0 sum yes\nrun 20"
    ),
    "another time step": "timestep 0.001\nrun 20",
    "pre no": "velocity all scale 2.5\nrun 20 pre no",
}


@pytest.mark.quick("yes-1-velocities new")
@pytest.mark.parametrize("between", BETWEEN)
@pytest.mark.parametrize("reinit, ranks", [("yes", 1), ("no", 2)])
def test_reinit(simulate, reinit, between, ranks):
    """Locks out reinit no that takes velocities from the atoms (or leaves theirs in the printed
    temperature), and reinit yes that does not, over several runs in one script."""
    system = mixture("solid planar")
    how = dict(words="molecule reinit " + reinit, after=BETWEEN[between])
    theirs = simulate(system, RIGID, 20, **how)
    assert_same(simulate(system, LIKE_LAMMPS, 20, ranks=ranks, **how), theirs, system)
    if "velocities" in between:
        kept = simulate(
            system,
            RIGID,
            20,
            words="molecule reinit no",
            after="\n".join(line for line in BETWEEN[between].split("\n") if line[:3] == "run"),
        )
        assert (apart(kept, theirs, system.h) < 1e-9) == (reinit == "no")


def test_reinit_no_with_displaced_atoms(simulate, tmp_path):
    """Locks out bodies that jump back, or atoms that come off their bodies,
    where a script moves atoms under reinit no."""
    move = "group odd molecule 3\ndisplace_atoms odd move 0.1 0.1 0.1 units box\nrun 5"
    system = mixture("solid planar")
    assert len(simulate(system, OURS, 5, after=move).thermo) == 4
    run = simulate(
        system,
        OURS,
        5,
        words="molecule reinit no",
        after=move,
        ranks=2,
        check=False,
        timeout=SECONDS,
    )
    assert_ended(
        run, ("away from where its rigid body has it", "something else moved it"), tmp_path
    )


# ---- infile


def rows_of(system, start, which=None, ids=None):
    """The rows of an infile, (bodies, 20), computed from the atoms of a Result.

    Args:
        which: (atoms,) the body of each atom, 0 for none; None for the molecules.
    """
    which, rows = system.molecule if which is None else which, []
    inverse = np.linalg.inv(system.h).T
    for body in np.unique(which[which > 0]):
        mine = which == body
        mass = system.mass[mine]
        r = start.x[mine] - start.x[mine][0]
        r -= np.rint(r @ inverse) @ system.h.T
        centre = mass @ r / mass.sum()
        r, v = r - centre, mass @ start.v[mine] / mass.sum()
        inertia = (
            mass[:, None, None]
            * ((r**2).sum(axis=1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None])
        ).sum(axis=0)
        centre += start.x[mine][0]
        image = np.floor(centre @ inverse)
        rows.append(
            [
                body,
                mass.sum(),
                *(centre - system.h @ image),
                *np.diag(inertia),
                *inertia[[0, 0, 1], [1, 2, 2]],
                *v,
                *(mass @ np.cross(r, start.v[mine])),
                *image,
            ]
        )
    return np.array(rows)


def text_of(rows):
    """An infile with these rows, the way users write one: a comment, an empty line."""
    form = "{:.0f} " + "{:.17g} " * 16 + "{:.0f} {:.0f} {:.0f}"
    return (
        "# of a test\n\n" + f"{len(rows)}\n" + "\n".join(form.format(*row) for row in rows) + "\n"
    )


def with_file(system, text, name="bodies"):
    return system._replace(files={**system.files, name: text})


def unlike_its_atoms(rows):
    """Other mass, centre, inertia and motion than the atoms', as of overlapping particles."""
    rng, rows = np.random.default_rng(5), rows.copy()
    rows[:, 1] *= rng.uniform(0.6, 0.9, len(rows))
    rows[:, 2:5] += rng.uniform(-0.1, 0.1, (len(rows), 3))
    for row in rows:
        turn = Rotation.from_quat(rng.normal(size=4)).as_matrix()
        inertia = turn @ np.diag(rng.uniform(0.8, 1.2) * np.array([2.1, 1.4, 0.9])) @ turn.T
        row[5:11] = *np.diag(inertia), *inertia[[0, 0, 1], [1, 2, 2]]
    rows[:, 11:17] = rng.normal(size=(len(rows), 6)) * 0.8
    return rows


BODIES = "molecule", "group 3 a b c", "single", "custom i_body"


def bodies_of(system, style):
    """What makes bodies of this style, and the body of each atom: (before, group, (atoms,))."""
    which = np.zeros(len(system.molecule), int)
    if style == "molecule":
        return "", "all", system.molecule
    if style == "single":
        return "group one molecule 5", "one", (system.molecule == 5).astype(int)
    if style.startswith("custom"):
        return (
            "fix 3 all property/atom i_body\nvariable b atom 28-mol\nset group all i_body v_b",
            "all",
            28 - system.molecule,
        )
    for body, molecules in enumerate(([4], [8], [20])):
        which[np.isin(system.molecule, molecules)] = body + 1
    return "group a molecule 4\ngroup b molecule 8\ngroup c molecule 20", "all", which


@pytest.mark.quick("molecule-2")
@pytest.mark.parametrize("style, ranks", list(zip(BODIES, (2, 1, 4, 1))))
def test_infile(simulate, style, ranks):
    """Locks out columns that are taken for others, inertia or momentum in another frame, a body
    with another's line, and what the file says being lost on the other ranks that share a body."""
    system = mixture("solid planar")
    before, group, which = bodies_of(system, style)
    rows = unlike_its_atoms(rows_of(system, simulate(system, "", 0), which))
    system = with_file(system, text_of(rows[::-1]))
    how = dict(before=before, group=group, words=style + " infile bodies", every=50)
    theirs = simulate(system, RIGID, 50, **how)
    ours = simulate(system, LIKE_LAMMPS, 50, ranks=ranks, **how)
    assert_same(ours, theirs, system)
    assert apart(simulate(system, RIGID, 50, **{**how, "words": style}), theirs, system.h) > 0.01


def test_infile_of_some_bodies(simulate):
    """Locks out bodies that are not in the file and lose their own mass, shape or velocity."""
    system = mixture("solid planar")
    rows = rows_of(system, simulate(system, "", 0))
    chosen = [2, 9, 26]
    odd = rows.copy()
    odd[chosen] = unlike_its_atoms(rows)[chosen]
    some, all_ = with_file(system, text_of(odd[chosen])), with_file(system, text_of(odd))
    ours = simulate(some, LIKE_LAMMPS, 50, words="molecule infile bodies", ranks=2)
    assert_same(ours, simulate(all_, RIGID, 50, words="molecule infile bodies"), system)


def test_infile_in_a_later_run(simulate):
    """Locks out a file that is read again at the next run, which would set the bodies back."""
    system = mixture("solid planar")
    rows = unlike_its_atoms(rows_of(system, simulate(system, "", 0)))
    system = with_file(system, text_of(rows))
    how = dict(
        words="molecule infile bodies", after="velocity all scale 2.0\nrun 20\nrun 10", every=50
    )
    assert_same(
        simulate(system, LIKE_LAMMPS, 20, ranks=2, **how),
        simulate(system, RIGID, 20, **how),
        system,
    )


GOOD_ROW = "{} 3 1 1 1 1 1 1 0 0 0 0 0 0 0 0 0 0 0 0"
NOT_FINITE = "the line of body 9", "not finite"
WRONG_FILES = {
    "empty": ("", ("first line", "number of bodies")),
    "comments only": ("# 1\n\n", ("first line", "number of bodies")),
    "no number": (GOOD_ROW.format(1), ("first line", "number of bodies")),
    "too few lines": (
        "3\n" + GOOD_ROW.format(1) + "\n" + GOOD_ROW.format(2),
        ("announces 3 bodies", "lines for 2"),
    ),
    "more lines": (
        "1\n" + GOOD_ROW.format(9) + "\n" + GOOD_ROW.format(1),
        ("announces 1 bodies", "lines for 2"),
    ),
    "unknown body": (
        "2\n" + GOOD_ROW.format(1) + "\n" + GOOD_ROW.format(77),
        ("body 77", "not there"),
    ),
    "body twice": ("2\n" + GOOD_ROW.format(9) + "\n" + GOOD_ROW.format(9), ("body 9", "twice")),
    "too few columns": (
        "1\n" + GOOD_ROW.format(9).rpartition(" ")[0],
        ("body 9", "19 values", "20 are expected"),
    ),
    "too many columns": (
        "1\n" + GOOD_ROW.format(9) + " 0",
        ("body 9", "21 values", "20 are expected"),
    ),
    "no numbers": (
        "1\n" + GOOD_ROW.format(9).replace("3", "three"),
        ("cannot read the infile", "three"),
    ),
    "no mass": ("1\n" + GOOD_ROW.format(9).replace("3", "0"), ("body 9 has", "mass 0")),
    "not finite": ("1\n" + GOOD_ROW.format(9).replace("3", "nan"), NOT_FINITE),
    "negative moment": (
        "1\n1 3 1 1 1 -1 1 1 0 0 0 0 0 0 0 0 0 0 0 0",
        ("the body of molecule 1 has", "negative principal moment of inertia, -1"),
    ),
    "inertia not finite": ("1\n9 3 1 1 1 nan 1 1 0 0 0 0 0 0 0 0 0 0 0 0", NOT_FINITE),
    "velocity not finite": ("1\n9 3 1 1 1 1 1 1 0 0 0 nan 0 0 0 0 0 0 0 0", NOT_FINITE),
    "part of an ID": ("1\n" + GOOD_ROW.format(9.5), ("9.5 is no ID of a body",)),
}


@pytest.mark.quick("unknown body")
@pytest.mark.parametrize("name", WRONG_FILES)
def test_wrong_infile(run_lammps, tmp_path, name):
    """Locks out a traceback, a message per rank and a silently wrong run, for each wrong file."""
    text, expected = WRONG_FILES[name]
    system = mixture("solid planar")
    script = (
        system.setup
        + "\n"
        + OURS.format(group="all", words="molecule infile bodies")
        + "\nthermo 1\nrun 1\n"
    )
    ranks = 2 if name in ("empty", "unknown body", "no mass", "not finite") else 1
    files = {**system.files, "bodies": text}
    run = run_lammps(script, files=files, ranks=ranks, check=False, timeout=SECONDS)
    assert_ended(run, expected, tmp_path)


def read_rows(path):
    lines = [
        line for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")
    ]
    rows = np.array([line.split() for line in lines[1:]], float)
    assert int(lines[0]) == len(rows)
    return rows


def test_restart(simulate, run_lammps, tmp_path):
    """Locks out a restart that loses what an infile said: NAME.rigid beside the restart file is
    what fix rigid/nve writes there; a fix without infile writes no such file."""
    system = mixture("solid planar")
    rows = unlike_its_atoms(rows_of(system, simulate(system, "", 0)))
    system = with_file(system, text_of(rows))
    how = dict(words="molecule infile bodies", after="write_restart state\nrun 30", every=30)
    theirs = simulate(system, RIGID, 30, **how)
    of_rigid = read_rows(tmp_path / "state.rigid")
    (tmp_path / "state.rigid").unlink()
    ours = simulate(system, LIKE_LAMMPS, 30, ranks=2, **how)
    assert_same(ours, theirs, system)
    of_ours = read_rows(tmp_path / "state.rigid")
    # the centre's image is a matter of taste
    for each in of_rigid, of_ours:
        each[:, 2:5] += each[:, 17:20] @ system.h.T
    np.testing.assert_allclose(
        of_ours[:, :17], of_rigid[:, :17], rtol=0, atol=1e-9 * np.abs(of_rigid).max()
    )
    (tmp_path / "state.rigid").unlink()
    simulate(system, OURS, 1, after="write_restart state")
    assert not (tmp_path / "state.rigid").exists()


# ---- spheres


def clumps(*, dimension=3, points=True, velocity=1.0, count=3):
    """Clumps of overlapping spheres, and points among them, as a script's first part and data file.

    In each: three spheres of different size and mass and, with `points`, an atom of radius 0;
    in the plane the same, flat."""
    rng = np.random.default_rng(8)
    spacing, rows, speeds = 1.75 if points else 1.45, [], []
    sites = [
        np.array(s) * spacing for s in np.ndindex(count, count, count if dimension == 3 else 1)
    ]
    shape = np.array([[0, 0, 0], [0.55, 0.1, 0.1], [-0.3, 0.5, -0.2], [-0.4, -0.45, 0.3]])
    sizes = [
        (1.0, 1.9),
        (0.7, 2.5),
        (0.8, 1.2),
        (0.0, 0.6),
    ]  # diameter, and density or for a point mass
    side = spacing * count
    for body, site in enumerate(sites):
        turn = (
            Rotation.from_quat(rng.normal(size=4))
            if dimension == 3
            else Rotation.from_rotvec([0, 0, rng.uniform(0, 6.3)])
        )
        flat = shape * [1, 1, dimension == 3]
        for r, (diameter, density) in zip(turn.apply(flat) + site, sizes[: 4 if points else 3]):
            image = np.floor(r / side).astype(int) * [1, 1, dimension == 3]
            rows.append([1, *(r - image * side), diameter, density, body + 1, *image])
            speeds.append(
                rng.normal(size=6) * velocity * ([1] * 6 if dimension == 3 else [1, 1, 0, 0, 0, 1])
            )
    half = 0.5 if dimension == 2 else 0
    height = (-half, side if dimension == 3 else half)
    data = data_file("hybrid", [*zip(*rows)], [(0, side), (0, side), height], velocities=[speeds])
    script = "\n".join(
        [
            "units lj",
            f"dimension {dimension}",
            "atom_style hybrid sphere molecular",
            "atom_modify map array",
            "comm_modify vel yes",
            "newton off",
            "read_data data.clumps",
            "pair_style gran/hooke/history 3000.0 2000.0 0.0 0.0 0.5 0",
            "pair_coeff * *",
            "neighbor 0.3 bin",
            "neigh_modify every 1 delay 0 check yes exclude molecule/intra all",
            "fix 9 all enforce2d" if dimension == 2 else "",
            "compute spin all temp/sphere",
            "timestep 0.0005",
            "thermo_style custom step temp pe press pxx pyy pzz pxy pxz pyz",
            "thermo_modify format float %.16g norm no temp spin",
            "",
        ]
    )
    return script, data


@pytest.fixture
def run_clumps(run_lammps, tmp_path):
    """A function that runs clumps with a fix, and gives (atoms, 9): positions unwrapped,
    velocities, omegas; and the thermo table."""

    def run(system, fix, steps=200, ranks=1, every=20, after=""):
        script, data = system
        dump = (
            "write_dump all custom end id xu yu zu vx vy vz omegax omegay omegaz radius "
            "tqx tqy tqz modify sort id format float %.17g\n"
        )
        done = run_lammps(
            "\n".join([script, fix, f"thermo {every}", f"run {steps}", after, dump]),
            files={"data.clumps": data},
            ranks=ranks,
        )
        atoms = np.loadtxt(tmp_path / "end", skiprows=9)[:, 1:]
        atoms[atoms[:, 9] == 0, 6:9] = 0  # of a point, LAMMPS's fixes leave it as it was
        assert steps == 0 or np.abs(atoms[:, 10:]).max() > 0.1, "no friction"
        return atoms[:, :9], done.thermo

    return run


@pytest.mark.parametrize("dimension, points, ranks", [(3, True, 4), (3, False, 1), (2, True, 2)])
def test_spheres(run_clumps, dimension, points, ranks):
    """Locks out spheres whose own inertia, torque (friction) or spin is left out, a spin that
    friction does not see at the half step, and degrees of freedom of points and spheres that are
    mixed up."""
    system = clumps(dimension=dimension, points=points, count=3 if dimension == 3 else 5)
    (theirs, table), (ours, ours_table) = (
        run_clumps(system, fix.format(group="all", words="molecule"), ranks=n)
        for fix, n in ((RIGID, 1), (LIKE_LAMMPS, ranks))
    )
    assert table["PotEng"].shape == ours_table["PotEng"].shape and np.abs(theirs[:, 6:]).max() > 0.1
    close(ours[:, :3], theirs[:, :3], 1e-9)
    close(ours[:, 3:6], theirs[:, 3:6], 1e-8)
    close(ours[:, 6:], theirs[:, 6:], 1e-8)
    np.testing.assert_allclose(ours_table["Temp"], table["Temp"], rtol=1e-8)


def test_damped_spheres(run_clumps):
    """Locks out friction that damps with the mass of a sphere alone, where fix rigid's bodies tell
    the pair style theirs. (The first run makes the velocities rigid, which rigid/nve does only
    after its first forces.)"""
    script, data = clumps(points=False)
    system = script.replace("3000.0 2000.0 0.0 0.0", "3000.0 2000.0 50.0 50.0"), data
    replaced = f"suffix nosquish\n{RIGID}\nsuffix off"
    theirs, *ours = (
        run_clumps(system, fix.format(group="all", words="molecule") + "\nrun 0", ranks=n)[0]
        for fix, n in ((RIGID, 1), (LIKE_LAMMPS, 1), (LIKE_LAMMPS, 2), (replaced, 2))
    )
    for result in ours:
        close(result[:, :3], theirs[:, :3], 1e-9)


def test_points_beside_grains(run_clumps):
    """Locks out a crash of granular pair styles, which look the bodies up,
    where the bodies themselves have no sphere."""
    script, data = clumps()
    script += """group points id 4 8 12
variable dot atom radius==0
group dots variable dot
group rest subtract dots points
group grains subtract all dots
fix 2 grains nve/sphere
fix 3 rest nve
"""
    fixes = (RIGID, 1), (LIKE_LAMMPS, 1), (LIKE_LAMMPS, 2)
    theirs, *ours = (
        run_clumps(
            (script, data), fix.format(group="points", words="group 1 points"), steps=20, ranks=n
        )[0]
        for fix, n in fixes
    )
    for result in ours:
        close(result[:, :3], theirs[:, :3], 1e-9)


def test_minimisation_of_grains(run_lammps):
    """Locks out a crash of granular pair styles in a minimisation, where they ask for the bodies
    as in a run."""
    script, data = clumps()
    lines = script, LIKE_LAMMPS.format(group="all", words="molecule"), "minimize 0 0 3 10"
    run_lammps("\n".join(lines), files={"data.clumps": data})


def test_pressure_of_spheres(run_clumps):
    """Locks out a wrong constraint virial of spheres: the six components differ from
    rigid/nve/small's in proportion to dt."""
    system, size = clumps(), []
    for n in 40, 80:
        short = (system[0] + f"timestep {0.002 / n:.17g}\n", system[1])
        tables = [
            run_clumps(short, f.format(group="all", words="molecule"), n, every=n)[1][-1:]
            for f in (OURS, "fix 1 {group} rigid/nve/small {words}")
        ]
        ours, theirs = (
            np.array([t[name][0] for name in ("Pxx", "Pyy", "Pzz", "Pxy", "Pxz", "Pyz")])
            for t in tables
        )
        size.append(np.linalg.norm(ours - theirs) / np.linalg.norm(ours))
    assert size[0] / size[1] == pytest.approx(2.0, rel=0.2)
    assert size[1] < 0.01


@pytest.mark.parametrize("dimension", [2, 3])
def test_single_spheres(run_clumps, dimension):
    """Locks out a sphere alone that does not turn, or turns as if it were a point: it moves as with
    fix nve/sphere (fix rigid takes no single atoms)."""
    script, data = clumps(dimension=dimension, points=False, count=3 if dimension == 3 else 5)
    script = script.replace("exclude molecule/intra all", "").replace(
        "3000.0 2000.0", "300.0 200.0"
    )  # overlapping ones push each other away
    split = "variable k atom id\n"
    theirs, table = run_clumps((script, data), "fix 1 all nve/sphere")
    ours, ours_table = run_clumps(
        (script, data), split + OURS.format(group="all", words="custom v_k"), ranks=2
    )
    close(ours[:, :3], theirs[:, :3], 1e-9)
    close(ours[:, 3:], theirs[:, 3:], 1e-8)
    for name in "Temp", "Press", "Pxy":
        np.testing.assert_allclose(ours_table[name], table[name], rtol=1e-8, err_msg=name)


def test_spheres_as_points(run_lammps):
    """Locks out spheres of keyword flexible that are counted among the kinds of the bodies, and
    degrees of freedom that leave out how they turn."""
    script, data = clumps(points=False)
    script += "group bodies molecule <= 20\ngroup loose subtract all bodies\n"
    fix = "fix 1 bodies nosquish/nve molecule flexible loose\n"
    log = run_lammps(f"{script}\n{fix}run 0\n", files={"data.clumps": data}).log
    assert "20 rigid bodies with 60 atoms: 20 three-dimensional; 21 flexible atoms" in log
    assert f"{20 * 6 + 21 * 6} left to the bodies" in log


def test_particles_that_do_not_spin(run_lammps):
    """Locks out silence where velocity create leaves the spheres of bodies without their spin, so
    that rotation starts colder than asked for."""
    script, data = clumps(points=False)
    fix = OURS.format(group="all", words="molecule")
    still = "velocity all create 1.0 4928\nset group all omega 0 0 0\n"
    files = {"data.clumps": data}
    logged = run_lammps(f"{script}\n{still}{fix}\nrun 0\n", files=files).log
    spins = run_lammps(
        f"{script}\n{still}set group all omega 0 0 1\n{fix}\nrun 0\n", files=files
    ).log
    warm = fix.replace("nve molecule", "nvt molecule temp 1 1 1 seed 7")
    warmed = run_lammps(f"{script}\n{still}{warm}\nrun 0\n", files=files).log
    assert "the bodies' rotation starts colder than their translation" in logged
    assert "starts colder" not in spins + warmed


@pytest.mark.quick
def test_sphere_in_a_group(run_clumps):
    """Locks out a body style group in which one body is a single sphere and another one a clump."""
    script, data = clumps(points=False)
    script += "group a id 1\ngroup b molecule 9\ngroup c molecule 12 13\n"
    mine = OURS.format(group="all", words="group 3 a b c order 123")
    theirs, _ = run_clumps(
        (script, data),
        "group bodies union b c\nfix 1 bodies rigid/nve group 2 b c\nfix 2 a nve/sphere",
    )
    ours, _ = run_clumps((script, data), mine, ranks=2)
    close(ours, theirs, 1e-8)


def test_restart_file_before_any_run(simulate, run_lammps, tmp_path):
    """Locks out a script that ends where it writes a restart file before the first run
    of bodies of an infile."""
    system = mixture("solid planar")
    rows = rows_of(system, simulate(system, RIGID, 0))
    rows[0, 1] = 9.0
    fix = LIKE_LAMMPS.format(group="all", words="molecule infile bodies")
    run_lammps(
        f"{system.setup}\n{fix}\nwrite_restart early\n",
        files=with_file(system, text_of(rows[:1])).files,
        ranks=2,
    )
    written = np.loadtxt(tmp_path / "early.rigid", skiprows=3)
    assert len(written) == system.molecule.max() and written[0, 0] == 1 and written[0, 1] == 9.0


def test_restart_of_two_fixes(simulate, run_lammps, run_system, tmp_path):
    """Locks out a restart that gives a fix the bodies of another one, whose file took the place of
    its own, and points that are bodies there: each fix has a file by its ID, points are in none."""
    system = mixture("solid planar single")
    rows = unlike_its_atoms(rows_of(system, simulate(system, "", 0)))
    natoms = np.bincount(system.molecule)[1:]
    files = {name: text_of(rows[natoms == n]) for name, n in (("solids", 5), ("planars", 4))}
    neighbours = "neigh_modify every 1 delay 0 check yes exclude molecule/intra all\n"
    dump = "modify sort id format float %.17g\n"
    dump = f"write_dump all custom {{}} id xu yu zu vx vy vz {dump}"

    def fixes(of_solids, of_planars):
        return f"""{neighbours}timestep {system.dt:.17g}
variable s string {of_solids}
variable p string {of_planars}
fix 1 solid nosquish/nve molecule infile v_s flexible single
fix two planar nosquish/nve molecule infile v_p
"""

    run_system(
        system,
        f"{fixes('solids', 'planars')}run 20\nwrite_restart state\nrun 20\n" + dump.format("whole"),
        files=files,
        ranks=2,
    )
    assert not (tmp_path / "state.rigid").exists()
    assert [len(read_rows(tmp_path / f"state.{name}.rigid")) for name in ("1", "two")] == [
        (natoms == 5).sum(), (natoms == 4).sum()
    ]  # fmt: skip
    again = "atom_modify map array\nread_restart state\n"
    again += fixes("state.1.rigid", "state.two.rigid") + "run 20\n"
    run_lammps(again + dump.format("again"))
    end, then = (np.loadtxt(tmp_path / name, skiprows=9)[:, 1:] for name in ("whole", "again"))
    np.testing.assert_allclose(then, end, rtol=0, atol=1e-9 * np.abs(end).max())


def test_velocities_set_between_runs_that_go_on(run_lammps):
    """Locks out silence where velocities that a script sets have no effect, because the bodies go
    on, and that they have one where a fix might have set them."""
    system, parts, expected = mixture("solid planar"), [], []
    # which never acts, and is not to be taken for who has set them
    late = "fix late all temp/rescale 5 1.0 1.0 1000.0 1.0"
    for (reinit, how), between, other in itertools.product(
        [("no", ""), ("yes", ""), ("yes", "pre no"), ("no", "pre no")],
        ["velocity all scale 3.0", ""],
        ["", late],
    ):
        fix = LIKE_LAMMPS.format(group="all", words=f"molecule reinit {reinit}")
        parts += [f"clear\nprint PART\n{system.setup}\n{fix}\n{other}"]
        parts += [f"run 5\n{between}\nrun 5 {how}\nrun 5 {how}\n"]
        expected.append(int(bool(between) and (reinit, how) != ("yes", "")))
    log = run_lammps("\n".join(parts), files=system.files).log
    _, *logs = re.split(r"^PART\n", log, flags=re.M)
    told = [log.count("without effect, because the bodies go on") for log in logs]
    assert told == expected and "by fix late" not in log


def test_infile_of_other_bodies(run_lammps, simulate):
    """Locks out silence where a fix gets the file of another one, whose bodies have the same IDs
    and are elsewhere, lighter or heavier; and a warning of bodies whose own masses are just
    others, by twice or half."""
    system = mixture("solid planar single")
    rows = rows_of(system, simulate(system, "", 0))
    alone = np.bincount(system.molecule)[rows[:, 0].astype(int)] == 1
    other = np.concatenate([rows[~alone][:2], rows[alone][:1]])
    other[:, 1] *= 0.5, 2.0, 1.0
    other[:, 2:5] += 1.5
    rows = rows[~alone]
    rows[::2, 1] *= 3.0
    said = {}
    for name, given in ("own", unlike_its_atoms(rows)), ("other", other):
        script = (
            f"{system.setup}\n{OURS.format(group='all', words='molecule infile bodies')}\nrun 0"
        )
        files = with_file(system, text_of(given)).files
        said[name] = run_lammps(script + "\n", files=files, ranks=2).log
    assert "WARNING: the infile has the centres of 3 bodies far from their atoms" in said["other"]
    assert "far from their atoms" not in said["own"]
