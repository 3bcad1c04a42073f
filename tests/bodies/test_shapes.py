"""Shapes of bodies that something deforms between two runs,
and bodies of one kind with different shapes."""

import itertools
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fix_nosquish.bodies import shapes
from support.endings import assert_ended
from support.systems import MASSES, OURS, assemble, mixture
from validation.scenes.data_file import data_file

ALL = "solid planar pair row single"
EXACT = "modify sort id format float %.17g"
SAID = (
    r"Bodies that were deformed between the runs: (\d+); "
    r"the body of molecule (\d+) the most, by (\S+), (\S+) of its size"
)

# what deforms bodies, in boxes of three vectors, and where bodies turn with it
DEFORMED = {
    "scaled": (
        lambda: mixture(ALL),
        "change_box all x final 0 7.4 y final 0 8.1 z scale 1.0 remap units box",
    ),
    "twice as wide": (lambda: mixture(ALL), "change_box all x final 0 15.3 remap units box"),
    "sheared": (
        lambda: mixture(ALL, tilt=0.3),
        "change_box all xy delta 0.9 yz delta -0.4 remap units box",
    ),
    "plane": (
        lambda: mixture("planar pair row single", side=5, dimension=2),
        "change_box all x final 0 11 remap units box",
    ),
    "moved at random": (
        lambda: mixture(ALL),
        "displace_atoms all random 0.1 0.1 0.1 4928 units box",
    ),
    "ramp": (lambda: mixture(ALL), "displace_atoms all ramp y 0.0 0.5 x 0.0 7.65 units box"),
    "one atom": (lambda: mixture(ALL), "variable x atom x+0.2\nset atom 12 x v_x"),
    "scaled in large steps": (
        lambda: mixture(ALL),
        "change_box all x final 0 7.5 remap x final 0 7.8 set y final 0 7.7 remap units box",
    ),
}


@pytest.fixture
def run_dumps(run_lammps, tmp_path):
    """A function that runs a script in which DUMP name stands for a dump of unwrapped atoms;
    it gives the log and these."""

    def run(script, files, ranks=1, **how):
        names = re.findall(r"DUMP (\w+)", script)
        script = re.sub(
            r"DUMP (\w+)",
            rf"write_dump all custom \1 id xu yu zu vx vy vz ix iy iz {EXACT}",
            script,
        )
        done = run_lammps(script, files=files, ranks=ranks, **how)
        return done, {
            name: np.loadtxt(tmp_path / name, skiprows=9)[:, 1:]
            for name in names
            if (tmp_path / name).exists()
        }

    return run


def placed(before, after, system):
    """Where least squares put the shapes of `before`,
    and how far each body's atoms are from there, of its size: by scipy."""
    result, far = after.copy(), []
    for body in np.unique(system.molecule):
        mine = system.molecule == body
        mass, x, shape = system.mass[mine], after[mine], before[mine]
        centre = mass @ x / mass.sum()
        shape = shape - mass @ shape / mass.sum()
        turn = (
            Rotation.align_vectors(x - centre, shape, weights=mass)[0]
            if len(mass) > 1
            else Rotation.identity()
        )
        result[mine] = centre + turn.apply(shape)
        size = np.linalg.norm(shape, axis=1).max()
        far.append(np.linalg.norm(x - result[mine], axis=1).max() / size if size > 1e-9 else 0.0)
    return result, np.array(far)


def with_atoms(system, x, v, log):
    """The files of the system with other places, unwrapped, and velocities,
    in the box that the log's line BOX tells."""
    lo, hi, tilt = np.array(re.search(r"(?m)^BOX (.*)", log)[1].split(), float).reshape(3, 3)
    text = system.files["data.bodies"]
    atoms = text[text.index("Atoms") : text.index("Velocities")].splitlines()[2:]
    _, molecule, kind = np.array([line.split()[:3] for line in atoms if line], int).T
    return {
        "data.bodies": data_file(
            "molecular",
            [molecule, kind, x],
            np.stack([lo, hi], axis=1),
            tilt=tilt,
            mass=MASSES,
            velocities=[v],
        )
    }


SIDES = ("xlo", "ylo", "zlo", "xhi", "yhi", "zhi", "xy", "xz", "yz")
BOX = f"print 'BOX {' '.join(f'$({k}:%.17g)' for k in SIDES)}'"


def script(system, then, words="molecule"):
    fix = OURS.format(group="all", words=words)
    more = "fix 9 all enforce2d\n" if "dimension 2" in system.setup else ""
    return f"{system.setup}\n{more}{fix}\ntimestep {system.dt:.17g}\n{then}\n"


@pytest.mark.filterwarnings("ignore:Optimal rotation is not uniquely")
@pytest.mark.parametrize("name, ranks", [("scaled", 4), *zip(DEFORMED, itertools.cycle((2, 1)))])
def test_bodies_keep_their_shape(run_dumps, name, ranks):
    """Locks out bodies that shrink, silently, when a script scales the box between two runs or
    displaces their atoms: each is where scipy's least squares put it, its distances stay, and it
    moves on as in a fresh script."""
    make, deform = DEFORMED[name]
    system = make()
    then = (
        f"run 20\nDUMP before\n{deform}\nDUMP deformed\n{BOX}\nrun 0\nDUMP placed\nrun 30\nDUMP end"
    )
    run, atoms = run_dumps(script(system, then), system.files, ranks)
    x, v = (np.split(atoms["deformed"], [3, 6], axis=1))[:2]
    expected, far = placed(atoms["before"][:, :3], x, system)
    np.testing.assert_allclose(atoms["placed"][:, :3], expected, rtol=0, atol=1e-12)
    for body in np.unique(system.molecule):
        pairs = (
            np.array([*itertools.combinations(np.flatnonzero(system.molecule == body), 2)], int)
            .reshape(-1, 2)
            .T
        )
        old, new = (
            np.linalg.norm(a[pairs[0], :3] - a[pairs[1], :3], axis=1)
            for a in (atoms["before"], atoms["placed"])
        )
        np.testing.assert_allclose(new, old, rtol=0, atol=1e-12)
    logged = re.findall(SAID, run.log)
    assert len(logged) == 1 and int(logged[0][0]) == (far > 1e-8).sum()
    assert int(logged[0][1]) == far.argmax() + 1 and float(logged[0][3]) == pytest.approx(
        far.max(), rel=0.05
    )
    _, other = run_dumps(
        script(system, "run 30\nDUMP end"), with_atoms(system, expected, v, run.log)
    )
    distance = atoms["end"] - other["end"]
    assert np.abs(distance[:, :6]).max() < 1e-9


WHOLE = {  # what leaves every body its shape, if it leaves the body at all
    "nothing": "",
    "moved": "displace_atoms all move 0.3 -9.1 0.2 units box",
    "turned": "group one molecule 3\ndisplace_atoms one rotate 1 1 1 0.3 0.5 1 77 units box",
    "read again": "read_dump same 20 x y z ix iy iz vx vy vz",
    "other members": "group part id 3 17\ndelete_atoms group part",
    "other molecule-IDs": "variable m atom mol+100\nset group all mol v_m",
    "defined again": "change_box all x scale 0.97 remap\nunfix 1\n"
    + OURS.format(group="all", words="molecule"),
}


@pytest.mark.parametrize("name", WHOLE)
def test_bodies_with_the_shape_of_their_atoms(run_lammps, name):
    """Locks out a message, and atoms that are moved, where nothing has deformed a body, it is of
    other atoms now, or the fix is new."""
    system = mixture("solid planar")
    dump = f"write_dump all custom same id type x y z ix iy iz vx vy vz {EXACT}"
    run = run_lammps(
        script(system, f"run 20\n{dump}\n{WHOLE[name]}\nrun 20"), files=system.files, ranks=2
    )
    assert "deformed" not in run.log and run.log.count("Loop time") == 2


REFUSED = {
    "box, reinit no": (
        "molecule reinit no",
        "change_box all x scale 0.97 remap\nrun 5",
        ("the box has changed", "with reinit yes"),
    ),
    "box, pre no": (
        "molecule",
        "change_box all x scale 0.97 remap\nrun 5 pre no",
        ("the box has changed", "without infile or 'pre no'"),
    ),
    "atoms, pre no": (
        "molecule",
        "displace_atoms all random 0.1 0.1 0.1 4928\nrun 5 pre no",
        ("where its rigid body has it", "run N pre yes"),
    ),
    "boundary": (
        "molecule",
        "change_box all boundary p p f\nrun 5",
        ("was torn apart between the runs", "unfix this fix"),
    ),
}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_keep_its_shape_is_refused(run_lammps, tmp_path, name, ranks):
    """Locks out atoms that silently jump back, and bodies in the middle of nowhere,
    where bodies go on as they are or are torn."""
    words, then, expected = REFUSED[name]
    system = mixture(ALL)
    how = {"files": system.files, "ranks": ranks, "check": False, "timeout": 60}
    assert_ended(run_lammps(script(system, f"run 5\n{then}", words), **how), expected, tmp_path)


def test_ranks_without_bodies(run_lammps):
    """Locks out a rank that has no body and fails where the others say which one was deformed."""
    then = "run 5\nchange_box all x scale 0.97 remap\nrun 5"
    one = "group one molecule 3\n" + OURS.format(group="one", words="molecule")
    system = mixture(ALL)
    run = run_lammps(f"{system.setup}\n{one}\n{then}", files=system.files, ranks=4, timeout=60)
    assert re.search(SAID, run.log).groups()[:2] == ("1", "3")


def test_fitted_turns():
    """Locks out a fit that mirrors a body, and one that is not exact for a body that is flat."""
    rng = np.random.default_rng(3)
    turns = shapes.best_turns(rng.normal(size=(200, 3, 3)))
    np.testing.assert_allclose(np.linalg.det(turns), 1.0, rtol=1e-12)
    turn = Rotation.random(200, random_state=rng).as_matrix()
    shape = rng.normal(size=(200, 5, 3)) * [1, 1, 0]
    products = np.einsum("nka,nkb->nab", shape @ turn.transpose(0, 2, 1), shape)
    np.testing.assert_allclose(shapes.best_turns(products), turn, rtol=0, atol=1e-10)


# ---- bodies of one kind


def bent(angle):
    """A carbon dioxide of three unit steps, bent by so many degrees."""
    half = np.radians(angle) / 2
    return (
        np.array([[0, 0, 0], [np.cos(half), np.sin(half), 0], [-np.cos(half), np.sin(half), 0]])
        * 0.7
    )


CHIRAL = np.array([[0, 0, 0], [0.9, 0, 0], [0, 0.7, 0], [0.1, 0.2, 0.5]])
TRIANGLE = np.array([[0, 0, 0], [0.9, 0, 0], [0.1, 0.7, 0]])
SPECIES = {  # shapes of 27 bodies; how many differ by 0.001 of the size; whether it warns
    "bent": ([bent(k) for k in np.linspace(0.0, 26.0, 27)], 26, True),
    "one is bent": ([bent(20.0)] + [bent(0.0)] * 26, 26, True),
    "planar ones among linear ones": ([bent(0.06 * (k % 5 == 3)) for k in range(27)], 0, True),
    "stretched": ([TRIANGLE * (1 + 0.002 * (k == 13)) for k in range(27)], 1, True),
    "one is another": ([TRIANGLE * [1, 2.2 if k == 13 else 1, 1] for k in range(27)], 1, True),
    "fragments": ([*np.random.default_rng(5).uniform(-0.7, 0.7, (27, 3, 3))], 0, False),
    "two fragments": ([bent(120.0 * (k % 2)) for k in range(27)], 0, False),
    "digits of a data file": ([np.round(TRIANGLE, 3) for k in range(27)], 0, False),
    "mirrored": ([CHIRAL * [1, 1, (-1) ** k] for k in range(27)], 0, False),
    "other order of types": (
        [TRIANGLE[:: (-1) ** k] if k < 2 else TRIANGLE for k in range(27)],
        0,
        False,
    ),
}


def herd(name, seed=3):
    """The 27 bodies, turned at random, on a lattice that the faces of the box cut."""
    shapes, *_ = SPECIES[name]
    rng, bodies = np.random.default_rng(seed), []
    for k, (shape, site) in enumerate(zip(shapes, itertools.product(range(3), repeat=3))):
        x = Rotation.from_quat(rng.normal(size=4)).apply(shape) + 2.55 * np.array(site)
        if name == "digits of a data file":
            x = np.round(x, 4)
        types = np.array([1, 2, 3, 1])[: len(shape)]
        bodies.append(
            ("molecule", x, types[::-1] if name == "other order of types" and k == 1 else types)
        )
    return assemble(bodies, 7.65 * np.eye(3))


@pytest.mark.filterwarnings("ignore:Optimal rotation is not uniquely")
@pytest.mark.parametrize(
    "name, ranks",
    [("bent", 1), ("bent", 4), ("one is bent", 2), *((name, 2) for name in list(SPECIES)[2:])],
)
def test_molecules_of_one_kind_with_other_shapes(run_lammps, name, ranks):
    """Locks out silence where molecules of one species differ in shape, as after a minimisation
    without bonds, on any number of ranks, and a warning where only digits differ, the mirror image,
    or the order of the types, or where fragments have the same types."""
    system, (_, differ, warned) = herd(name), SPECIES[name]
    run = run_lammps(script(system, "run 5\nrun 5"), files=system.files, ranks=ranks)
    logged = re.findall("^WARNING: the 27 bodies of 3 atoms.*", run.log, re.M)
    assert len(logged) == warned and ("differ in shape" in run.log) == warned, run.log
    told = re.findall(r": (\d+) differ from it by more than 0.001 of its size", "".join(logged))
    assert told == [str(differ)] * (differ > 0)


@pytest.mark.parametrize("before", ["", "fix 0 all rigid/nve/small molecule"])
def test_a_minimization_before_the_fix(run_lammps, before):
    """Locks out a warning of shapes that does not name the minimize that bent them, without a fix
    or beside LAMMPS's own rigid one, and advice that does not help: minimize after the fix."""
    system, relax = herd("stretched"), "min_modify dmax 0.02\nminimize 0 1e-3 1 40"
    ours = "fix 1 all nosquish/nve molecule"
    bent = run_lammps(
        "\n".join([system.setup, before, relax, "unfix 0" * bool(before), ours, "run 0"]),
        files=system.files,
    )
    (said,) = re.findall("^WARNING: the 27 bodies .* differ in shape.*", bent.log, re.M)
    assert "Was there a minimize before this fix was defined?" in said and "26 differ" in said
    rigid = run_lammps("\n".join([system.setup, ours, relax, "run 0"]), files=system.files)
    assert "1 differ from it" in rigid.log


def ring(n, radius):
    """The corners of a regular polygon, (n, 3)."""
    angle = 2 * np.pi * np.arange(n) / n
    return radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)


OXYGEN_AND_HYDROGENS = np.array([[0, 0, 0], [0.757, 0.586, 0], [-0.757, 0.586, 0]])
CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
TEMPLATES = {  # places and types of atoms; those of type 3 have next to no mass
    "five-site water": (
        [*OXYGEN_AND_HYDROGENS, [0, -0.404, 0.571], [0, -0.404, -0.571]], [1, 2, 2, 3, 3],
    ),
    "four-site water": ([*OXYGEN_AND_HYDROGENS, [0, 0.15, 0]], [1, 2, 2, 3]),
    "methane": ([[0, 0, 0], *CORNERS[[0, 3, 5, 6]]], [1, 2, 2, 2, 2]),
    "benzene": ([*ring(6, 1.4), *ring(6, 2.5)], [1] * 6 + [2] * 6),
    "cube": (CORNERS, [1] * 8),
    "ammonia": ([[0, 0, 0.3], *ring(3, 0.9)], [1, 2, 2, 2]),
}  # fmt: skip


@pytest.mark.parametrize("deformed", [False, True])
@pytest.mark.parametrize("mass", ["1e-100", "1e-12"])
@pytest.mark.parametrize("name", TEMPLATES)
def test_molecules_of_one_template(run_lammps, name, mass, deformed):
    """Locks out a warning of like molecules, which rounding errors turn about an axis without mass
    or one of several that are equal, and silence where one atom is elsewhere."""
    x, types = TEMPLATES[name]
    rows = [(k, *place) for k, place in enumerate(np.asarray(x, float).tolist(), 1)]
    places = "\n".join(" ".join(map(str, row)) for row in rows)
    kinds = "\n".join(f"{k} {kind}" for k, kind in enumerate(types, 1))
    template = f"one\n\n{len(types)} atoms\n\nCoords\n\n{places}\n\nTypes\n\n{kinds}\n"
    last = len(types) * 14  # of the molecule in the middle
    move = f"group last id {last}\ndisplace_atoms last move 0.03 0.03 0.03"
    run = run_lammps(
        f"""units real
atom_style molecular
lattice sc 7
region box block 0 3 0 3 0 3
create_box 3 box
molecule one mol.one
create_atoms 0 box mol one 4928
{move if deformed else ""}
mass 1 15.9994
mass 2 1.008
mass 3 {mass}
pair_style zero 4
pair_coeff * *
velocity all create 298 4928
fix 1 all nosquish/nve molecule
run 1
""",
        files={"mol.one": template},
    )
    assert ("27 bodies" in run.log and "differ in shape: 1 differ" in run.log) == deformed, run.log


ROW = """units lj
atom_style {style}
region box block 0 20 0 20 0 20
create_box 3 box
molecule one mol.one
create_atoms 0 single 3 3 3 mol one 4928
create_atoms 0 single 13 13 13 mol one 4929
{masses}
pair_style zero 2
pair_coeff * *
group beside type 3
fix push beside addforce 0.1 0.2 0.3
{fix}
thermo_style custom step ke
thermo_modify norm no format float %.12g
timestep 0.001
run 100
"""
TWO_MASSES, EACH = "mass 1*2 1.0\nmass 3 {}", "set group all mass 1\nset group all diameter 0\n"


def row(masses, beside, fix="fix 1 all nosquish/nve molecule"):
    """A script with bodies of two atoms, and a third one beside their line; and its files."""
    places = f"Coords\n\n1 0 0 0\n2 1 0 0\n3 0.4 {beside} 0"
    template = f"one\n\n3 atoms\n\n{places}\n\nTypes\n\n1 1\n2 2\n3 3\n"
    style = "hybrid sphere dipole molecular" if "dipole" in masses else "molecular"
    return ROW.format(style=style, masses=masses, fix=fix), {"mol.one": template}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("mass", ["1e-100", "1e-09"])
def test_what_stands_beside_a_line_of_masses(refused, mass, ranks):
    """Locks out the torque of an atom without mass about the line in which the masses of its body
    are: nothing has a moment of inertia there, so it was lost without a word."""
    script, files = row(TWO_MASSES.format(mass), 0.5)
    says = f"the body of molecule 1 has its mass in a line, and atom 3 (mass {mass}) is 0.5 away"
    refused(script, says, files, ranks=ranks)


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(("dipole", "warned"), [("0.1 0.4 0.9", True), ("0.7 0 0", False)])
def test_dipoles_across_a_line_of_masses(run_lammps, dipole, warned, ranks):
    """Locks out the same of a dipole without a word, and a warning of one that is along the line.
    Without `rotate` LAMMPS would turn each molecule at random, and not its dipole."""
    script, files = row(f"{EACH}set type 1 dipole {dipole}", 0)
    script = script.replace("mol one 4928", "mol one 4928 rotate 0 1 0 0")
    script = script.replace("mol one 4929", "mol one 4929 rotate 0 1 0 0")
    log = run_lammps(script, files=files, ranks=ranks).log
    assert ("WARNING: dipoles are across the lines of linear bodies" in log) == warned


@pytest.mark.parametrize(("mass", "beside"), [("0.1", 0.5), ("1e-100", 0), ("1e-100", 1e-3)])
def test_advice_for_a_line_of_masses(run_lammps, mass, beside):
    """Locks out advice that does not help, and a refusal of atoms that are in the line but for what
    a data file rounds: with a mass, or in the line, atoms turn the body as in fix rigid."""
    energies = [
        run_lammps(script, files=files).thermo["KinEng"][-1]
        for fix in ("nosquish/nve molecule", "rigid/nve molecule")
        for script, files in [row(TWO_MASSES.format(mass), beside, f"fix 1 all {fix}")]
    ]
    assert energies[0] > 1e-4 and energies[0] == pytest.approx(energies[1], rel=1e-6)
