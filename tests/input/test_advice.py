"""What messages advise is followed: the script that is refused says what to do, and the script that
does so runs, with what was meant."""

import re
from typing import NamedTuple

import numpy as np
import pytest

from fix_nosquish.host.hosts import OtherFix
from fix_nosquish.run.other_fixes import OtherFixes
from support.endings import LINEAR, PLAIN, assert_ended

CO2 = """
units real
boundary p p p
atom_style full
lattice sc 6.0
region box block 0 5 0 5 0 10
create_box 2 box
molecule co2 mol.co2
create_atoms 0 box mol co2 464563
mass 1 12.01
mass 2 16.0
pair_style lj/smooth/linear 9.0
pair_coeff * * 0.1 2.9
neigh_modify exclude molecule/intra all delay 0 every 1
velocity all create 300 4928 mom yes
thermo_style custom step temp pe etotal
thermo_modify norm no format float %.12g
thermo 100
region hot block INF INF INF INF 0 12 units box
region cold block INF INF INF INF 30 42 units box
fix 1 all nosquish/nve molecule
"""
# a plate on a gas, which keeps one component of its force, or none
PLATE = """
units lj
atom_style molecular
boundary p p f
region box block 0 8 0 8 0 16
create_box 2 box
lattice sc 0.244140625
region gas block 0 7.9 0 7.9 1 6 units box
create_atoms 1 region gas
lattice sc 1.0
region plate block 0 7.9 0 7.9 7.9 8.1 units box
create_atoms 2 region plate
mass * 1
set type 2 mol 1
group plate type 2
group gas type 1
pair_style lj/smooth/linear 2.5
pair_coeff * * 0.5 1.0
neigh_modify exclude group plate plate delay 0 every 1
fix floor gas wall/harmonic zlo 0 10 1 1
velocity gas create 1.5 7
timestep 0.004
variable z equal xcm(plate,z)
thermo_style custom step temp lx v_z
thermo_modify norm no lost error
thermo 100
"""
HELD = "fix 1 plate nosquish/nve molecule force * off off {} torque * off off off\n"
NPT = "fix 2 gas npt temp 1 1 1 x 0.5 0.5 5 {}\n"
PRESSED = "fix 3 plate addforce 0 0 -0.5\n"


def energy_is_kept(run):
    energy = run.thermo["TotEng"]
    assert np.abs(energy - energy[0]).max() < 1e-3 * np.ptp(run.thermo["PotEng"])


def heat_is_carried(run):
    """All that one fix gives to the bodies and the other one takes, but for what a line says."""
    energy = run.thermo["TotEng"]
    lost = float(re.search(r"In this run (\S+) of the kinetic energy", run.log)[1])
    assert 1e-4 < lost < 0.1
    np.testing.assert_allclose(energy[-1] - energy[0], -lost, atol=0.2 * lost)


def plate_stays(run):
    assert np.ptp(run.thermo["v_z"]) == 0.0 and np.ptp(run.thermo["Lx"]) > 1e-3


def plate_floats(run):
    assert np.ptp(run.thermo["Lx"]) == 0.0
    assert run.thermo["v_z"][-1] < 7.9 and run.thermo["v_z"].min() > 1.0


WALLED = CO2.replace("boundary p p p", "boundary p p f").replace(
    "create_atoms 0 box", "region in block 0 4.9 0 4.9 0.9 8.9\ncreate_atoms 0 region in"
)


class Case(NamedTuple):
    """What is refused, the advice of its message, and what follows that."""

    setup: str
    lines: str
    says: str
    advised: str
    holds: object


CASES = {
    "conductivity": Case(
        CO2,
        "fix h all thermal/conductivity 50 z 20\n",
        "use two fixes heat, with a region for each",
        "fix h all heat 20 5e-2 region hot\nfix c all heat 20 -5e-2 region cold\n",
        heat_is_carried,
    ),
    "ehex": Case(
        CO2,
        "fix h all ehex 20 5e-2 region hot\nfix c all ehex 20 -5e-2 region cold\n",
        "use fix heat, which changes velocities only",
        "fix h all heat 20 5e-2 region hot\nfix c all heat 20 -5e-2 region cold\n",
        heat_is_carried,
    ),
    "viscosity": Case(
        CO2,
        "fix h all viscosity 50 x z 20\n",
        "use fix accelerate/cos",
        "fix h all accelerate/cos 1e-5\n",
        lambda run: None,
    ),
    "recenter": Case(
        CO2,
        "fix h all recenter INIT INIT INIT\n",
        "use fix momentum with linear 1 1 1",
        "fix h all momentum 10 linear 1 1 1\n",
        energy_is_kept,
    ),
    "reflecting wall": Case(
        WALLED,
        "fix h all wall/reflect zlo EDGE zhi EDGE\n",
        "use a wall with a force, such as fix wall/harmonic",
        "fix h all wall/harmonic zlo EDGE 1 1 3 zhi EDGE 1 1 3\n"
        "fix_modify h energy yes\n",
        energy_is_kept,
    ),
    "plate that does not move": Case(
        PLATE,
        HELD.format("off") + NPT.format(""),
        "Leave bodies that do not move at all out of the fix",
        NPT.format("dilate gas"),
        plate_stays,
    ),
    "plate that presses": Case(
        PLATE,
        HELD.format("on") + NPT.format("") + PRESSED,
        "keep the box (fix nvt), and add the pressure's force to them (fix addforce)",
        HELD.format("on") + "fix 2 gas nvt temp 1 1 1\n" + PRESSED,
        plate_floats,
    ),
    "plate in a box of ours": Case(
        PLATE,
        "fix 1 plate nosquish/nph molecule x 0 0 5 dilate gas "
        "force * off off on\nfix 2 gas nvt temp 1 1 1\n" + PRESSED,
        "keep the box (fix nvt), and add the pressure's force to them (fix addforce)",
        HELD.format("on") + "fix 2 gas nvt temp 1 1 1\n" + PRESSED,
        plate_floats,
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "ranks"), [*((name, 1) for name in CASES), ("conductivity", 2), ("recenter", 2)]
)
def test_advice_of_what_is_refused(run_lammps, tmp_path, name, ranks):
    """Locks out a message that sends the user to what is refused, too, or to what does not do what
    was meant; and what is refused here: it went wrong without a word, or ended the run later."""
    case, how = CASES[name], {"files": {"mol.co2": LINEAR}, "ranks": ranks}
    first = run_lammps(f"{case.setup}{case.lines}run 200\n", check=False, **how)
    assert_ended(first, [case.says], tmp_path)
    assert "Step" not in first.log, "refused as the run begins"
    case.holds(run_lammps(f"{case.setup}{case.advised}run 400\n", **how))


SOME = (
    f"{CO2}group some id 1:3\ngroup rest subtract all some\nunfix 1\n"
    "fix 1 rest nosquish/nve molecule\nfix 2 some nve\n"
)


@pytest.mark.parametrize("ranks", [1, 2])
def test_recenter_of_another_group(run_lammps, tmp_path, ranks):
    """Locks out a run that ends later because fix recenter moves the bodies' atoms, too, which its
    group does not tell; and one that is refused although it moves other atoms alone, by which
    nothing changes."""
    how = {"files": {"mol.co2": LINEAR}, "ranks": ranks}
    line = "fix h some recenter INIT INIT INIT{}\n"
    run = run_lammps(f"{SOME}{line.format(' shift all')}run 50\n", check=False, **how)
    assert_ended(run, ["fix h (style recenter) moves atom", "use fix momentum with"], tmp_path)
    assert "Step" not in run.log, "refused as the run begins"
    end = "write_dump rest custom end id x y z modify sort id format float %.17g\n"
    ends = []
    for words in "", line.format(""), line.format(" shift some"):
        run_lammps(f"{SOME}pair_style zero 9\npair_coeff * *\n{words}run 50\n{end}", **how)
        ends.append(np.loadtxt(tmp_path / "end", skiprows=9))
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])


PUSH = (
    PLAIN
    + """
from fix_nosquish.host.lammps import Lammps

class Push(Plain):
    def __init__(self, ptr):
        self.lammps = Lammps(ptr)
    def initial_integrate(self, vflag):
        self.lammps.x[self.lammps.tags == 9] += 0.01
"""
)


def test_atoms_that_nobody_is_said_to_move(run_lammps, tmp_path):
    """Locks out a run that ends because atoms were moved without the name of the fix that may have
    done so: one with a user's code, whose group does not tell."""
    script = f'{SOME}group none empty\nfix h none python/move "push.Push"\nrun 200\n'
    files = {"mol.co2": LINEAR, "push.py": PUSH}
    run = run_lammps(script, files=files, check=False)
    assert_ended(run, ["something else moved it, perhaps fix h (style python/move)"], tmp_path)


def test_suspects():
    """Locks out fix python/invoke, which needs no group, and a fix that changes the box among those
    that cannot have moved atoms, and those that change velocities alone among the others."""
    nothing = dict.fromkeys(OtherFix._fields, 0)
    fixes = [
        OtherFix(**nothing | {"id": style, "style": style, "end_of_step": 1, "called": 1})
        for style in ("python/invoke", "momentum", "ave/time", "temp/csvr", "deform", "new/style")
    ]
    fixes.append(OtherFix(**nothing | {"id": "box", "style": "deform", "box_change": True}))
    results = [fix.id for fix in OtherFixes(fixes).possible_movers()]
    assert results == ["python/invoke", "new/style", "box"]


def test_advice_of_noise_that_no_energy_tests(run_lammps, tmp_path):
    """Locks out hybrid Monte Carlo with the noise of a pair style, which it takes for forces."""
    script = (
        "units lj\natom_style sphere\nregion b block 0 9 0 9 0 9\ncreate_box 1 b\n"
        "create_atoms 1 random 8 7 NULL overlap 2 maxtry 1000\nset atom * diameter 1\n"
        "pair_style hybrid/overlay zero 2 brownian 1 1 1 1.5 2 1 77 1 0\npair_coeff * * zero\n"
        "pair_coeff * * brownian\ntimestep 0.001\nvariable own atom id\n"
        "fix 1 all nosquish/{}\nrun 10\n"
    )
    refused = run_lammps(script.format("hmc custom v_own temp 1 steps 10 seed 5"), check=False)
    advice = "leave it out, or use fix nosquish/nvt with thermostat langevin"
    assert_ended(refused, ["pair style brownian has friction or noise", advice], tmp_path)
    run_lammps(script.format("nvt custom v_own temp 1 1 1 seed 5"))
