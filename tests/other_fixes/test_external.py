"""External forces: fix_modify external, and add_force from Python."""

import re
import sys

import numpy as np
import pytest

from support import insertion
from support.debian import debian, obstacle
from support.endings import PLAIN
from support.running import ROOT
from support.systems import SHAPES, assemble, mixture
from validation.statistics import motion

ALL = "solid planar pair row single"
NVE = "fix 1 all nosquish/nve molecule\n"
THERMO = (
    "thermo_style custom step pe ke etotal press pxx pyy pzz pxy pxz pyz {}\n"
    "thermo_modify format float %.16g norm no\n"
)
END = "write_dump all custom end id xu yu zu vx vy vz modify sort id format float %.16g\n"
# places that periodic faces do not cut
UNWRAPPED = "".join(
    f"variable {axis} vector f_1[{k}]+{{length}}*f_1[{12 + k}]\n" for k, axis in enumerate("xyz", 1)
)
GAS = "pair_style zero 2.5\npair_coeff * *\n"


def masses(system):
    """Of the bodies, in the order of their IDs."""
    return np.bincount(system.molecule, system.mass)[1:]


def vector(name, values):
    """A vector-style variable of these numbers."""
    return f"variable {name} vector [{','.join(f'{value:.17g}' for value in values)}]\n"


@pytest.fixture
def run_bodies(run_system, tmp_path):
    """Run lines with the bodies of a system, and give its thermo table and atoms at the end."""

    def run(system, lines, **how):
        done = run_system(system, f"timestep {system.dt}\n{lines}\n{END}", **how)
        return done.thermo, motion.read(tmp_path / "end")[1][0][:, 1:], done

    return run


# ---- against LAMMPS's own


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_as_addforce(run_bodies, ranks):
    """Locks out a force on a body that is not the sum of such forces on its atoms, at any time, and
    its energy and virial that are not those of fix addforce."""
    system = mixture(ALL)
    atoms = (
        "compute u all property/atom xu yu\n"
        "variable fx atom 0.4*mass*(1+0.1*step)\nvariable e atom -v_fx*c_u[1]+0.3*mass*c_u[2]\n"
        "variable fy atom -0.3*mass\n"
        "fix push all addforce v_fx v_fy 0.0 energy v_e\nfix_modify push energy yes virial yes\n"
    )
    m = masses(system)
    bodies = (
        vector("m", m) + UNWRAPPED.format(length=system.h[0, 0])
        + "variable fx vector 0.4*v_m*(1+0.1*step)\nvariable fy vector -0.3*v_m\n"
        "variable e vector -v_fx*v_x-v_fy*v_y\n"
        "fix_modify 1 external force v_fx v_fy 0.0 energy v_e virial yes\n"
    )  # fmt: skip
    runs = THERMO.format("") + "thermo 5\nrun 20\nrun 20"
    theirs, their_atoms, _ = run_bodies(system, atoms + NVE + runs, ranks=ranks)
    ours, our_atoms, _ = run_bodies(system, NVE + bodies + runs, ranks=ranks)
    for name in theirs.dtype.names:
        scale = np.abs(theirs[name]).max()
        assert np.abs(ours[name] - theirs[name]).max() < 1e-10 * scale, name
    assert np.abs(our_atoms - their_atoms).max() < 1e-10
    free, *_ = run_bodies(system, NVE + runs, ranks=ranks)
    assert np.abs(ours["KinEng"] / free["KinEng"] - 1)[-1] > 1e-3


@pytest.mark.parametrize("ranks", [1, 2])
def test_as_addtorque(run_bodies, ranks):
    """Locks out a torque that is not about the centre of mass, in the space frame, or of another
    body, as by the order of rows of f_ID."""
    system = mixture("solid planar")
    groups = "".join(f"group b{k} molecule {k}\n" for k in (2, 20))
    theirs = "fix a b2 addtorque 0.5 -1.0 2.0\nfix b b20 addtorque -1.5 0.3 v_t\n"
    torque = np.zeros((3, 27))
    torque[:, 1], torque[:2, 19] = (0.5, -1.0, 2.0), (-1.5, 0.3)
    where = np.zeros(27)
    where[19] = 1.0
    ours = (
        "".join(vector(f"t{axis}", row) for axis, row in zip("xyz", torque)) + vector("w", where)
        + "variable tzt vector v_tz+v_t*v_w\n"
        "fix_modify 1 external torque v_tx v_ty v_tzt\n"
    )  # fmt: skip
    runs = "variable t equal cos(step/10)\n" + THERMO.format("") + "run 40"
    theirs, their_atoms, _ = run_bodies(system, groups + NVE + theirs + runs, ranks=ranks)
    ours, our_atoms, _ = run_bodies(system, NVE + ours + runs, ranks=ranks)
    assert ours["PotEng"] == pytest.approx(theirs["PotEng"], rel=1e-11)
    assert np.abs(our_atoms - their_atoms).max() < 1e-10


@pytest.mark.parametrize("ranks", [1, 2])
def test_columns_of_others(run_bodies, ranks):
    """Locks out columns that are of another step, as LAMMPS keeps a variable's values within a
    step: of another fix's bodies, and of a compute."""
    system = mixture("single", side=4, spacing=1.4)
    some, rest = "group some molecule <= 32\n", "group rest molecule > 32\n"
    lines = (
        f"{some}{rest}fix 2 rest nosquish/nve molecule\nfix 1 some nosquish/nve molecule\n"
        "compute chunk some chunk/atom molecule\n"
        "compute centre some com/chunk chunk\n"
        + "".join(f"variable p{k} vector f_2[{k}]\n" for k in (1, 2, 3))
        + "".join(f"variable c{k} vector c_centre[{k}]\n" for k in (1, 2, 3))
        + "fix_modify 1 external force v_p1 v_p2 v_p3 torque 0 0 0\n"
        "fix_modify 2 external force v_c1 v_c2 v_c3\n"
        + "".join(f"variable off{k} equal f_1[9][{6 + k}]-f_2[9][{k}]\n" for k in (1, 2, 3))
        + "".join(f"variable of{k} equal f_2[9][{6 + k}]-c_centre[9][{k}]\n" for k in (1, 2, 3))
        + "variable far equal f_2[9][1]-f_2[9][3]\n"
        + GAS + THERMO.format("v_off1 v_off2 v_off3 v_of1 v_of2 v_of3 v_far")
        + "thermo 3\nrun 12"
    )  # fmt: skip
    thermo, *_ = run_bodies(system, lines, ranks=ranks)
    for name in ["v_off1", "v_off2", "v_off3", "v_of1", "v_of2", "v_of3"]:
        assert np.abs(thermo[name]).max() < 1e-12, name
    assert np.abs(thermo["v_far"]).min() > 0.1


# ---- exact solutions


def alone(*kinds, spacing=4.0):
    """Bodies at rest, far apart, without forces, whose atoms' masses are 1.0, 1.6 and 0.4."""
    h = spacing * max(2, len(kinds)) * np.eye(3)
    bodies = [
        (kind, np.array(SHAPES[kind][0]) + spacing * (k + 0.5), SHAPES[kind][1])
        for k, kind in enumerate(kinds)
    ]
    return assemble(bodies, h, setup="", temperature=0.0)


def test_torque_about_what_has_no_moment(run_bodies):
    """Locks out what turns about an axis without moment: a torque along a linear body, and one on
    a single atom."""
    system = alone("pair", "row", "single")
    lines = (
        GAS + NVE + "fix_modify 1 external torque 1e3 0 0\n"
        + THERMO.format("f_1[1][10] f_1[3][10]") + "run 40"
    )  # fmt: skip
    thermo, atoms, _ = run_bodies(system, lines)
    assert not atoms[:, 3:].any()
    assert thermo["f_1[1][10]"][-1] == thermo["f_1[3][10]"][-1] == 0.0


TRAP = (
    "{unwrapped}"
    "variable fx vector -{k}*(v_x-{c})\nvariable fy vector -{k}*(v_y-{c})\n"
    "variable fz vector -{k}*(v_z-{c})\n"
    "variable u vector 0.5*{k}*((v_x-{c})^2+(v_y-{c})^2+(v_z-{c})^2)\n"
    "fix_modify 1 external force v_fx v_fy v_fz energy v_u\n"
)


def trap(system, stiffness):
    """A harmonic trap for all centres of mass, at the centre of the box, with its energy."""
    edge = system.h[0, 0]
    unwrapped = UNWRAPPED.format(length=edge)
    return TRAP.format(unwrapped=unwrapped, k=stiffness, c=0.5 * edge)


@pytest.mark.parametrize(
    "fix",
    [
        "nosquish/nve molecule",
        "nosquish/nvt molecule temp 1 1 5.0 seed 7",
        "nosquish/nvt molecule temp 1 1 5.0 seed 7 thermostat csvr",
        "nosquish/nvt molecule temp 1 1 5.0 thermostat nh",
    ],
)
def test_energy_in_a_trap(run_bodies, fix):
    """Locks out an energy of external forces that econserve lacks, and a total momentum that a
    thermostat takes as constant while a trap pushes."""
    system = mixture("solid planar pair", seed=3)
    lines = f"{GAS}fix 1 all {fix}\n{trap(system, 2.0)}" + THERMO.format("econserve")
    off = []
    for dt, steps in (0.02, 250), (0.01, 500):
        more = f"timestep {dt}\nthermo {steps // 50}\nrun {steps}"
        thermo, _, done = run_bodies(system, lines + more)
        off.append(np.std(thermo["Econserve"] - thermo["Econserve"][0]))
        assert np.ptp(thermo["PotEng"]) > 100 * off[-1]
    assert off[1] < 0.4 * off[0]
    if "thermostat" in fix:
        assert "with the total momentum, because of external forces" in done.log


def test_energy_at_constant_pressure(run_bodies):
    """Locks out a virial of external forces that is not the work that they do when the box
    stretches about its centre: without it the energy is off by 30."""
    system = mixture("solid planar pair", seed=3)
    edges = "".join(f"variable l{axis} equal l{axis}\n" for axis in "xyz")
    own_trap = edges + trap(system, 0.5).replace("energy v_u", "energy v_u virial yes")
    for axis in "xyz":
        own_trap = own_trap.replace(f"{axis} vector f_1", f"{axis} vector 0*v_l{axis}+f_1")
        place = f"{system.h[0, 0]}*f_1[{13 + 'xyz'.index(axis)}]"
        own_trap = own_trap.replace(place, place.replace(f"{system.h[0, 0]}", f"v_l{axis}"))
    off = []
    for dt, steps in (0.02, 250), (0.01, 500):
        fix = f"fix 1 all nosquish/nph molecule iso 0.02 0.02 10 every 1\ntimestep {dt}\n"
        run = THERMO.format("econserve vol") + f"thermo {steps // 50}\nrun {steps}"
        thermo, _, done = run_bodies(system, GAS + fix + own_trap + run)
        off.append(np.abs(thermo["Econserve"] - thermo["Econserve"][0]).max())
    assert off[1] < 0.3 * off[0] < 1e-3
    assert np.ptp(thermo["Volume"]) > 50
    assert "WARNING" not in done.log
    bare = own_trap.replace(" virial yes", "")
    *_, done = run_bodies(system, GAS + fix + bare + THERMO.format("vol") + "run 1")
    assert "Give fix_modify external the words virial yes" in done.log


# ---- ranks, runs, bodies that come and go


def test_runs_in_a_row(run_bodies):
    """Locks out forces of before, where something moves bodies between two runs, and forces that a
    command between two runs drops."""
    system = alone("single", "single")
    lines = GAS + NVE + trap(system, 1.0) + THERMO.format("f_1[1][7]") + "run 0\n"
    for runs in (
        "run 40",
        "run 20\nrun 20 pre no",
        "run 20\nwrite_restart state\nrun 20 pre no",
        "run 20\nwrite_data data\nrun 20",
    ):
        _, atoms, _ = run_bodies(system, lines + runs)
        if runs == "run 40":
            expected = atoms
        assert atoms == pytest.approx(expected, abs=1e-13), runs
    thermo, *_ = run_bodies(system, lines + "displace_atoms all move 0.25 0 0\nrun 0")
    assert thermo["f_1[1][7]"][-1] == pytest.approx(thermo["f_1[1][7]"][0] - 0.25)
    thermo, *_ = run_bodies(system, lines + "fix_modify 1 external none\nrun 0")
    assert thermo["f_1[1][7]"][-1] == 0.0


def test_bodies_that_come_and_go(run_bodies):
    """Locks out forces of a body that went, for one that has its number or its place now."""
    system = alone(*["single"] * 9, spacing=3.0)
    system = system._replace(setup=f"{system.setup}\nregion in block 0 40 0 40 0 40")
    lines = GAS + NVE + "variable fx vector 0.1*f_1[1]\n" + (
        "fix_modify 1 external force v_fx 0 0\n"
        "variable off vector abs(f_1[7]-v_fx)\n"
        "fix 2 all evaporate 10 1 in 4928 molecule yes\n"
        + THERMO.format("atoms v_off[1] v_off[2]") + "thermo 10\nrun 60"
    )  # fmt: skip
    thermo, *_ = run_bodies(system, lines)
    assert thermo["Atoms"][-1] == 3
    assert np.abs(thermo["v_off[1]"]).max() < 1e-13
    assert np.abs(thermo["v_off[2]"]).max() < 1e-13


@pytest.mark.parametrize("ranks", [1, 2])
def test_bodies_that_are_inserted(run_lammps, ranks):
    """Locks out bodies that come in a run and do not have the force that is the same for all."""
    words = "fix_modify 1 external force 0.25 0 0"
    script = insertion.SCRIPT.format(
        style="molecular", edge=9, masses=insertion.MASSES, changes=insertion.DEPOSIT,
        first=insertion.MOLECULES.format(10), fix=f"{insertion.OURS}\n{words}",
        run="pair_style zero 2.5\npair_coeff * *\nvariable off vector abs(f_1[7]-0.25)\n"
        "variable worst equal max(v_off)\nthermo_style custom step atoms v_worst\nrun 80",
    ).replace("write_dump", "#")  # fmt: skip
    thermo = run_lammps(script, files={"mol.bent": insertion.MOLECULE}, ranks=ranks).thermo
    assert thermo["Atoms"][-1] > thermo["Atoms"][0]
    assert thermo["v_worst"].max() == 0.0


# ---- from Python

DRIVE = """
import sys
import numpy as np
if {ranks} > 1:
    from mpi4py import MPI
from lammps import lammps
import fix_nosquish

lmp = lammps()
lmp.file(sys.argv[1])
{lines}
lmp.command("write_dump all custom end id xu yu zu vx vy vz modify sort id format float %.16g")
lmp.close()
"""
GIVES = """
lmp.command("variable u internal 0.0")
lmp.command("fix_modify 1 external python energy v_u")
lmp.command("run 0")
bodies = fix_nosquish.rigid_bodies(lmp, "1")
bodies.add_force([20, 3], [[1.0, 2.0, 3.0], [0.5, 0.0, -0.5]], [0.0, 0.3, 0.0])
bodies.add_force([7], [0.0, 0.0, 9.0])
lmp.set_internal_variable("u", -4.25)
lmp.command("run 10")
fix_nosquish.rigid_bodies(lmp, "1").add_force(np.array([7]), [1.0, 0.0, 0.0])
lmp.command("run 5 pre no")
lmp.command("run 5 pre no")
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_forces_from_python(run_bodies, run_lammps, tmp_path, ranks):
    """Locks out forces of Python's that act on other bodies than named, only for a step or a run,
    beside those that replace them, or twice on two ranks; and their energy that pe lacks."""
    system = mixture("solid planar pair")
    force, torque, later = np.zeros((3, 27)), np.zeros((3, 27)), np.zeros(27)
    force[:, 19], force[:, 2], force[2, 6] = (1.0, 2.0, 3.0), (0.5, 0.0, -0.5), 9.0
    torque[1, [2, 19]], later[6] = 0.3, 1.0
    words = "".join(vector(f"f{axis}", row) for axis, row in zip("xyz", force))
    words += vector("ty", torque[1]) + vector("later", later)
    words += (
        "variable gx vector v_fx+v_later*(step>10)\nvariable gz vector v_fz-9*v_later*(step>10)\n"
    )
    words += "fix_modify 1 external force v_gx v_fy v_gz torque 0 v_ty 0 energy -4.25\n"
    setup = f"{NVE}{THERMO.format('')}"
    expected, atoms, _ = run_bodies(
        system, f"{setup}run 0\n{words}run 10\nrun 5 pre no\nrun 5 pre no", ranks=ranks
    )
    (tmp_path / "drive.py").write_text(DRIVE.format(ranks=ranks, lines=GIVES))
    system = system._replace(setup=f"{system.setup}\ntimestep {system.dt}\n{setup}")
    done = run_lammps(
        system.setup, files=system.files, ranks=ranks, launcher=[sys.executable, "drive.py"]
    )
    actual = motion.read(tmp_path / "end")[1][0][:, 1:]
    assert actual == pytest.approx(atoms, abs=1e-13)
    assert done.thermo["TotEng"][-1] == pytest.approx(expected["TotEng"][-1], rel=1e-12)
    assert np.ptp(expected["TotEng"][1:]) > 1e-3


LATE = (
    PLAIN
    + """
import fix_nosquish
class Late(Plain):
    def __init__(self, ptr): self.ptr = ptr
    def final_integrate(self):
        fix_nosquish.rigid_bodies(self.ptr, "1").add_force([1], [1.0, 0.0, 0.0])
"""
)
TOO_LATE = """lmp.command("group none empty")
lmp.command("fix 2 none python/move late.Late")
lmp.command("run 9")
"""


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    "call, says",
    [
        ("bodies.add_force([1, 28], [1, 0, 0])", "there is no body with ID 28"),
        ("bodies.add_force([1, 2, 1], [1, 0, 0])", "a body's ID is given twice"),
        (
            "bodies.add_force([1, 2, 4, 5], np.ones((3, 3)))",
            "expected IDs of bodies, a force (n, 3)",
        ),
        ("bodies.add_force([1], [1, 0, np.nan])", "a force or torque is not finite"),
        ("bodies.add_force([1], [lmp.extract_setting('world_rank'), 0, 0])", "other forces than"),
        ("bodies.add_force([1], [1, 0, 0]); lmp.command('run 1 pre no')", "'pre yes'"),
        (TOO_LATE, "have 'fix_modify ID external python' before it"),
        (
            "lmp.command('unfix 1'); bodies.add_force([1], [1, 0, 0])",
            "fix of these bodies no longer exists",
        ),
        (
            "lmp.command('clear'); bodies.add_force([1], [1, 0, 0])",
            "fix of these bodies no longer exists",
        ),
    ],
)
def test_what_python_cannot_hand_in(run_lammps, tmp_path, call, says, ranks):
    """Locks out what add_force takes and does nothing with, or does on one rank."""
    if ranks == 1 and "world_rank" in call:
        return
    system = mixture("solid planar pair")
    (tmp_path / "late.py").write_text(LATE)
    lines = f'lmp.command("run 0")\nbodies = fix_nosquish.rigid_bodies(lmp, "1")\n{call}'
    (tmp_path / "drive.py").write_text(DRIVE.format(ranks=ranks, lines=lines))
    done = run_lammps(
        system.setup + "\n" + NVE, files=system.files, ranks=ranks, check=False,
        launcher=[sys.executable, "drive.py"], timeout=60,
    )  # fmt: skip
    assert done.code != 0
    assert says in done.screen


OWN = """
import numpy as np
import fix_nosquish
from fix_nosquish.integrators.nve import NVE
find = fix_nosquish.of_fix_line(NVE)

def __getattr__(text):
    if text.startswith("__"):
        return find(text)

    def made(ptr):
        driver, force = find(text.replace("Pushed", "NVE"))(ptr), [[1.0, 0.0, 3.0], [0.0, 2.0, 0.0]]
        driver.fix.setting.external.give(np.arange(1, 28), [2, 20], force, [0.0, 0.5, 0.0])
        return driver

    return made
"""


@pytest.mark.skipif(bool(obstacle()), reason=obstacle() or "")
@pytest.mark.parametrize("ranks", [1, 2])
def test_in_a_lammps_with_its_own_fix(run_system, run_bodies, tmp_path, ranks):
    """Locks out add_force that serves with the plugin only: a class of one's own hands them in."""
    system = mixture("solid planar pair")
    force, torque = np.zeros((3, 27)), np.zeros(27)
    force[:, 1], force[1, 19], torque[[1, 19]] = (1.0, 0.0, 3.0), 2.0, 0.5
    words = "".join(vector(f"f{axis}", row) for axis, row in zip("xyz", force))
    words += vector("t", torque) + "fix_modify 1 external force v_fx v_fy v_fz torque 0 v_t 0\n"
    runs = THERMO.format("") + "run 20\nrun 20 pre no"
    _, atoms, _ = run_bodies(system, NVE + words + runs)
    own = 'fix 1 all python/move "own.Pushed all molecule"\n'
    run_system(
        system,
        f"timestep {system.dt}\n{own}{runs}\n{END}",
        files={"own.py": OWN},
        launcher=debian(ranks),
    )
    assert motion.read(tmp_path / "end")[1][0][:, 1:] == pytest.approx(atoms, abs=1e-10)


# ---- what cannot be


VARIABLES = (
    "variable three vector [1,2,3]\nvariable some atom x\nvariable word string a\n"
    "variable huge equal 1e200*1e200\nvariable one equal 1\nvariable y vector f_1[2]\n"
)


@pytest.mark.parametrize(
    "words, says",
    [
        ("force v_three 0 0", "v_three has 3 values, and there are 27 bodies"),
        ("force 0 0 0 energy v_three torque 1 0 0", "v_three has 3 values, and there are 27"),
        ("force f_1[1] 0 0", "'variable NAME vector f_ID[i]'"),
        ("force v_some 0 0", "v_some is of a variable of another style"),
        ("force v_word 0 0", "v_word is of a variable of another style"),
        ("force v_missing 0 0", "v_missing: there is no such variable"),
        ("force 0 0", "'nothing' was given after force"),
        ("force 0 0 up", "'up' was given after force"),
        ("force 0 0 inf", "'inf' was given after force"),
        ("force 1 0 0 torque 0 0 0 force 1 0 0", "force is given twice"),
        ("force 1 0 0 virial maybe", "'maybe' was given where virial expects yes or no"),
        ("force 1 0 0 bodyforces early", "'bodyforces' was given where force FX FY FZ"),
        ("energy v_one", "at least one of force, torque and python"),
        ("none force 1 0 0", "at least one of force, torque and python, or none alone"),
        ("", "fix_modify external: expected at least one of force, torque and python"),
        ("force 1 0 0 torque 0 0 v_huge", "v_huge is not finite in step 0"),
        ("force 1 0 0\nrun_style respa 2 2 pair 1", "cannot be used with run_style respa"),
        ("force 1 0 0\nrun 1\nfix_modify 1 external none\nrun 1 pre no", "'pre yes'"),
        ("force 1 0 0 virial yes\nunfix 1_external", "fix 1_external is gone"),
        (
            "none\nfix 1_external all addforce 1 0 0\nfix_modify 1 external force 1 0 0",
            "fix 1_external (style addforce) has the ID that",
        ),
    ],
)
@pytest.mark.parametrize("ranks", [1, 2])
def test_what_is_refused(refused, words, says, ranks):
    """Locks out words that act otherwise than they say, or not at all."""
    system = mixture("solid planar pair")
    script = f"{system.setup}\n{VARIABLES}{NVE}fix_modify 1 external {words}\nrun 2"
    refused(script, says, system.files, ranks=ranks)


def test_no_fix_stays_behind(run_system):
    """Locks out a fix that tells of external forces of a fix that is gone, and two of one ID."""
    system = mixture("solid planar pair")
    words = "fix_modify 1 external force 1 0 0 energy 0\n"
    done = run_system(
        system,
        f"{NVE}{words}{words}run 1\n{NVE}{words}run 1\n{words}unfix 1\ninfo fixes\n"
        f"{NVE}{words}fix_modify 1 external none\nrun 1\ninfo fixes\n",
    )
    assert "style = nosquish/nve" in done.screen
    assert "_external," not in done.screen.replace(" ", "")


# ---- the page


def test_examples_of_the_page(run_bodies, run_lammps, tmp_path):
    """Locks out examples of the page that do not run, or not as it says."""
    page = (ROOT / "docs" / "fix.md").read_text()
    section = page.split("### External forces\n")[1].split("### Several ranks")[0]
    (trap_along_x,) = re.findall("```lammps\n(.*?)```", section, re.DOTALL)
    give, prepare = re.findall("```python\n(.*?)```", section, re.DOTALL)
    system = alone(*["single"] * 9, spacing=1.5)
    run = f"{GAS}{trap_along_x}{THERMO.format('f_1[2][1] f_1[2][7]')}run 100"
    thermo, *_ = run_bodies(system, run)
    assert thermo["f_1[2][7]"] == pytest.approx(-0.5 * (thermo["f_1[2][1]"] - 10), abs=1e-12)
    assert thermo["TotEng"] == pytest.approx(thermo["TotEng"][0], rel=1e-5)
    assert np.ptp(thermo["KinEng"]) > 0.5
    lines = f'lmp.command("run 0")\n{give}lmp.command("run 1")\n{prepare}lmp.command("run 1")'
    (tmp_path / "drive.py").write_text(DRIVE.format(ranks=1, lines=lines))
    done = run_lammps(
        f"{system.setup}\n{GAS}{NVE}thermo_style custom step f_1[8][9] f_1[3][7]\n",
        files=system.files,
        launcher=[sys.executable, "drive.py"],
    )
    assert list(done.thermo["f_1[8][9]"]) == [0.0, 2.0, 2.0, 2.0, 2.0]
    assert list(done.thermo["f_1[3][7]"]) == [0.0, 1.0, 1.0, 1.0, 1.0]


def test_words_of_a_command_that_failed(run_system, tmp_path):
    """Locks out the first words of a command that failed, where a program catches the error and
    runs on: those of the command before it stay."""
    system = mixture("solid planar pair")
    lines = (
        "lmp.command('fix_modify 1 external force 0 0 2')\n"
        "try: lmp.command('fix_modify 1 external force 1 2')\n"
        "except Exception: lmp.command('thermo_style custom step f_1[8][7] f_1[8][9]')\n"
        "lmp.command('run 0')\nlmp.command('fix_modify 1 external none')\nlmp.command('run 0')"
    )
    (tmp_path / "drive.py").write_text(DRIVE.format(ranks=1, lines=lines))
    done = run_system(system, f"{NVE}", launcher=[sys.executable, "drive.py"])
    pushed, free = done.thermo
    assert pushed["f_1[8][7]"] == free["f_1[8][7]"]
    assert pushed["f_1[8][9]"] - free["f_1[8][9]"] == pytest.approx(2.0, abs=1e-3)
