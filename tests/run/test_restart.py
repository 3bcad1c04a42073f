"""Runs that are continued: in the same script, from a restart file, from a data file,
on other numbers of ranks."""

import numpy as np
import pytest

from support import systems
from support.systems import AFTER, OURS, Result, differ, mixture

# tops whose principal axes the inertia leaves open, of one type of atom
TOPS = {
    "tetrahedron": (np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 0.35, [1] * 4),
    "cube": (
        np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.35,
        [2] * 8,
    ),
    "triangle": ([[0.6, 0, 0], [-0.3, 0.3 * 3**0.5, 0], [-0.3, -0.3 * 3**0.5, 0]], [1] * 3),
    "pyramid": (
        [[0.6, 0, 0], [-0.3, 0.3 * 3**0.5, 0], [-0.3, -0.3 * 3**0.5, 0], [0, 0, 0.7]],
        [1, 1, 1, 3],
    ),
    "bent": ([[0, 0, 0], [0.6, 0.4, 0], [-0.6, 0.4, 0]], [2, 3, 3]),
}
EXACT = "modify sort id format float %.17g"


@pytest.fixture
def tops(monkeypatch):
    """A function like `mixture`, of bodies of all symmetries."""
    for name, shape in TOPS.items():
        monkeypatch.setitem(systems.SHAPES, name, shape)
    return mixture


@pytest.fixture
def run_on(run_lammps, tmp_path):
    """A function that runs a script, and reads the positions and velocities that it dumps."""

    def run(script, *names, ranks=1, files=None, columns="x y z vx vy vz"):
        for name in names:
            assert script.count(f"DUMP {name}\n") == 1
            script = script.replace(
                f"DUMP {name}\n", f"write_dump all custom {name} id {columns} {EXACT}\n"
            )
        run_lammps(script, ranks=ranks, files=files)
        atoms = [np.loadtxt(tmp_path / name, skiprows=9)[:, 1:] for name in names]
        return [Result(a[:, :3], a[:, 3:], None, "") for a in atoms]

    return run


ALL = "tetrahedron cube triangle pyramid bent solid row pair single"
SYSTEMS = {
    "cube": (lambda tops: tops(ALL, spacing=2.9), 1, 2),
    "triclinic": (lambda tops: tops(ALL, spacing=2.9, tilt=0.3), 4, 2),
    "plane": (
        lambda tops: tops("triangle bent pair row single", side=5, spacing=2.9, dimension=2),
        2,
        1,
    ),
}


@pytest.mark.quick("cube")
@pytest.mark.parametrize("name", SYSTEMS)
def test_continued(run_on, tops, name):
    """Locks out a restart that goes on otherwise than the run that wrote it: other image flags,
    another choice of principal axes where the inertia leaves them open, velocities of another time,
    on other numbers of ranks."""
    make, before, after = SYSTEMS[name]
    system = make(tops)
    fixes = OURS.format(group="all", words="molecule") + (
        "\nfix 9 all enforce2d" if name == "plane" else ""
    )
    step = f"timestep {system.dt:.17g}\n"
    first = (
        f"{system.setup}\n{step}{fixes}\nrun 50\nwrite_restart middle.restart\n"
        "write_data middle.data nocoeff\n"
        "restart 40 old.restart new.restart\nrun 100\nDUMP continued\n"
        f"clear\n{system.setup}\n{step}{fixes}\nrun 150\nDUMP whole\n"
    )
    continued, whole = run_on(first, "continued", "whole", ranks=before, files=system.files)
    from_data = system.setup.replace("data.bodies", "middle.data")
    second = (
        f"read_restart middle.restart\n{AFTER}\n{step}{fixes}\nrun 100\nDUMP restarted\n"
        f"clear\n{from_data}\nreset_timestep 50\n{step}{fixes}\nrun 100\nDUMP from_data\n"
        # written while the run went on, at step 120
        f"clear\nread_restart new.restart\nprint 'at $(step)'\n{AFTER}\n{step}{fixes}\n"
        "run 150 upto\nDUMP periodic\n"
    )
    results = run_on(second, "restarted", "from_data", "periodic", ranks=after)
    errors = {"whole": differ(whole, continued, system.h)}
    errors |= {
        kind: differ(result, continued, system.h)
        for kind, result in zip(("restarted", "from_data", "periodic"), results)
    }
    assert max(errors.values()) < 1e-10, errors


SPHERES = """units lj
atom_style sphere
atom_modify map array
region box block 0 7 0 7 0 7
create_box 2 box
fix id all property/atom mol ghost yes
lattice sc 2.2
{atoms}
set type 1 diameter 1.0
set type 2 diameter 0.7
set group all density 1.5
{molecules}
velocity all create 2.0 4928
pair_style lj/cut 2.5
pair_coeff * * 1.0 0.8
neigh_modify every 1 delay 0 check yes exclude molecule/intra all
timestep 0.002
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_replicated(run_lammps, run_system, refused, ranks):
    """Locks out copies whose bodies merge, beside atoms whose bodies a restart file has."""
    system, native = mixture("solid planar"), "fix {} all nosquish/nve molecule\n"
    run_system(
        system,
        f"{native.format(1)}run 2\nwrite_restart same\nset atom 4*9 mol 1\nwrite_restart other\n",
        ranks=ranks,
    )
    again = "read_restart {}\n" + AFTER + "replicate 2 1 1\n" + native + "run 2\n"
    run_lammps(again.format("same", 1), ranks=ranks)
    run_lammps(again.format("other", 2), ranks=ranks)
    refused(again.format("other", 1), "to replicate them", {}, ranks=ranks)


DECIDED = {  # a fix's group and words, what is before it, and what changes behind a run
    "molecule": ("all", "molecule", "", "set atom 4*9 mol 1"),
    "custom i_f": (
        "all",
        "custom i_f",
        "fix p all property/atom i_f\n{}variable f atom mol\nset group all i_f v_f",
        "set atom 4*9 i_f 1",
    ),
    "custom v_f": ("all", "custom v_f", "variable f atom mol*(step<5)", ""),
    "group": (
        "all",
        "group 2 a b",
        "group a molecule 1\ngroup b molecule 2 9",
        "group a molecule 3\ngroup b clear",
    ),
    "single": ("a", "single", "group a molecule 1", "group a molecule 3"),
    "flexible": (
        "a",
        "molecule flexible b",
        "group a molecule 1:20\ngroup b subtract all a",
        "group b clear\ngroup a clear\ngroup a molecule 3:27",
    ),
}


@pytest.mark.parametrize("name", DECIDED)
def test_bodies_of_the_definition(run_on, name):
    """Locks out a restart whose bodies are decided anew by molecule-IDs, values and groups that
    have changed since the fix was defined: written between runs and in one, read on another number
    of ranks, by the same fix and by the same integrator of another style."""
    group, words, before, change = DECIDED[name]
    system, again = mixture("solid planar"), AFTER + before.partition("{}")[0]
    native = f"timestep {system.dt}\nfix 1 {group} nosquish/nve {words}\n"
    quoted = f"timestep {system.dt}\n" + OURS.format(group=group, words=words) + "\n"
    first = f"{system.setup}\n{before.format('')}\n{native}run 6\n{change}\nrun 6\n"
    first += "write_restart between\nrestart 5 within later\nrun 8\nrestart 0\nrun 12\nDUMP whole\n"
    (whole,) = run_on(first, "whole", files=system.files)
    second = f"read_restart between\n{again}\n{native}run 20\nDUMP native\n"
    second += f"clear\nread_restart within\n{again}\n{quoted}run 32 upto\nDUMP quoted\n"
    for run in run_on(second, "native", "quoted", ranks=2):
        assert differ(run, whole, system.h) < 1e-9
