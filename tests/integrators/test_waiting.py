"""The end of a step that nothing looks at waits for the next step:
nothing may come of that but time."""

import re

import numpy as np
import pytest

from support.running import ROOT
from support.systems import OURS, apart, line_of_class, mixture

STEPS = 60


@pytest.mark.parametrize(
    ("kinds", "ranks"),
    [("solid planar pair row single", 1), ("solid planar pair row single", 4), ("row", 2)],
)
def test_output_changes_nothing(simulate, kinds, ranks):
    """Locks out a half step that is done twice, left out, or done with other forces, where the end
    of a step waits: a run that is looked at in each step and one that is looked at in none agree to
    the last bit."""
    system = mixture(kinds)
    looked = simulate(system, OURS, STEPS, every=1, ranks=ranks)
    alone = simulate(system, OURS, STEPS, every=STEPS, ranks=ranks)
    np.testing.assert_array_equal(alone.x, looked.x)
    np.testing.assert_array_equal(alone.v, looked.v)


def test_output_changes_nothing_for_bodies_of_many_atoms(run_lammps, tmp_path):
    """Locks out atoms of a body that fills a block by itself (block.LANES) placed by a part of its
    force only, in the pass that does a whole step: bodies of 2 to 200 atoms beside flexible
    chains."""
    folder = ROOT / "inputs" / "mixed"
    files = {name: (folder / name).read_text() for name in ("data.mixed", "forcefield.mixed")}
    atoms = []
    for every in 1, 30:
        run_lammps(
            f"""units lj
atom_style bond
read_data data.mixed
include forcefield.mixed
fix 1 bodies nosquish/nve molecule
fix 2 chains nve
thermo {every}
timestep 0.004
run 30
write_dump all custom end id x y z vx vy vz modify sort id format float %.17g""",
            files=files,
        )
        atoms.append((tmp_path / "end").read_text())
    assert atoms[0] == atoms[1]


@pytest.mark.parametrize(
    "more",
    [
        "comm_modify vel yes",
        "fix 7 all momentum 1000 linear 1 1 1",
        "fix 7 all momentum 7 linear 1 1 1",
        "fix 7 all external pf/array 1",
        "fix 7 all dt/reset 7 1 1 100",
    ],
    ids=["half step", "late", "late often", "between", "reset"],
)
def test_what_needs_more_changes_nothing(simulate, more):
    """Locks out a pass that is left out, or a time step that is used too late,
    on steps that wait with other fixes about."""
    system = mixture()
    if "dt/reset" in more:  # to the time step that it is: what waits is done then
        more = more.replace("1 1 100", f"NULL {system.dt:.17g} 100")
    alone = simulate(system, OURS, STEPS, every=STEPS)
    with_fix = simulate(system, OURS, STEPS, every=STEPS, before=more)
    assert apart(alone, with_fix, system.h) < 1e-12


@pytest.mark.quick
def test_readers_find_velocities(run_lammps, tmp_path):
    """Locks out velocities of an earlier step, or of the half step, where a fix, a dump, a variable
    or a command reads the atoms' at a step without thermo output: all find what a run with output
    in each step has."""
    system = mixture("solid row")
    lines = f"""{system.setup}
fix 1 bodies nosquish/nve molecule
compute ke all ke
variable ke equal c_ke
variable step equal step
fix 2 all print 7 "${{step}} ${{ke}}" file print.txt screen no
fix 3 all ave/time 5 1 5 c_ke file ave.txt
variable every equal stride(1,60,11)
dump 4 all custom 1 dump.txt id vx
dump_modify 4 every v_every
timestep {system.dt}
thermo_style custom step c_ke
"""
    files = {}
    for every in 1, 60:
        run = run_lammps(
            f"{lines}thermo {every}\nrun 60\nvariable end equal c_ke\nprint 'end $(v_end:%.15g)'",
            files=system.files,
        )
        files[every] = [
            (tmp_path / name).read_text() for name in ("print.txt", "ave.txt", "dump.txt")
        ] + [run.screen.splitlines()[-2]]
    assert files[1] == files[60]
    assert len(files[1][2].splitlines()) > 100


FOLLOWING = """
from mpi4py import MPI
from fix_nosquish.bodies.bodies import Bodies
from fix_nosquish.host.command import Line
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.run.fix import fix_of
from fix_nosquish.run.schedule import LOOKS

calls = 0

def follow(bodies, *arguments, plain=Bodies.follow):
    global calls
    calls += 1
    return plain(bodies, *arguments)

Bodies.follow = follow

def __getattr__(name):
    if name.startswith("__"):
        raise AttributeError(name)
    kind, words = name.split(" ", 1)

    def made(ptr):
        fix = fix_of(NVE, ptr, Line.quoted("NVE " + words))
        init, post_run = fix.init, fix.post_run

        def busy():
            init()
            fix.host.facts |= LOOKS

        def report():
            post_run()
            most = MPI.COMM_WORLD.reduce(calls, MPI.MAX)
            fix.host.log(f"FOLLOWED {most} {fix.lammps.neighbor_builds:.0f}\\n")

        fix.post_run = report
        if kind == "Busy":
            fix.init = busy
        return fix

    return made
"""


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_following_without_python(simulate, known, run_lammps, tmp_path, ranks):
    """Locks out a plugin that follows the atoms in another way than the class does, by a bit, where
    bodies go from rank to rank, are shared by two to four, and arrays grow; and one that leaves it
    to Python when there is no need."""
    (tmp_path / "following.py").write_text(FOLLOWING)
    system = mixture("solid row pair", temperature=8.0)
    results, counts = [], []
    steps = {1: 240, 2: 240, 4: 80}[ranks]
    for name in "Busy", "Lazy":
        run = simulate(
            system,
            line_of_class(f"following.{name}"),
            steps,
            every=steps,
            ranks=ranks,
            before="neigh_modify every 2 delay 0 check no\natom_modify sort 9 1.2",
        )
        results.append(run)
        counts.append([int(word) for word in re.findall(r"FOLLOWED (\d+) (\d+)", run.log)[-1]])
    for name in "x", "v":
        np.testing.assert_array_equal(getattr(results[0], name), getattr(results[1], name))
    (busy, builds), (lazy, _) = counts
    assert builds > 0.45 * steps and busy > builds and lazy < 15, counts


@pytest.mark.parametrize("ranks", [1, 2])
def test_virial_behind_a_command_between_runs(run_system, ranks):
    """Locks out the constraint virial twice in the pressure of the first step of a run that is not
    set up, where a command between the runs has made the bodies anew."""
    system, pressure = mixture("solid planar row", temperature=3.0), []
    for between in "", "write_restart r\n":
        rows = run_system(
            system,
            f"timestep 0.002\n{OURS.format(group='bodies', words='molecule')}\nthermo 1\n"
            f"run 4\n{between}run 2 pre no\n",
            ranks=ranks,
        ).thermo
        pressure.append(dict(zip(rows["Step"], rows["Press"])))
    assert pressure[0][5] == pytest.approx(pressure[1][5], rel=1e-3)
