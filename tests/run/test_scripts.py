"""What a script does between runs, against LAMMPS's own rigid/nve in the same script.

All cases of one number of ranks run in one process, one after the other with `clear` between them,
because starting LAMMPS takes longer than they do. If it breaks in one of them, that and the ones
after it fail.
"""

import re
from typing import NamedTuple

import numpy as np
import pytest

from support.endings import BENT
from support.running import read_thermo

SCRIPT = """
clear
print         "PART {name}"
units         lj
atom_style    molecular
atom_modify   map yes
lattice       sc 0.04
region        box block 0 3 0 3 0 3
create_box    1 box
molecule      bent mol.bent
create_atoms  0 box mol bent 4928
mass          * 1.0
velocity      all create 1.0 4928
pair_style    lj/cut 2.5
pair_coeff    * * 1.0 0.4
neigh_modify  delay 0 every 1 check yes exclude molecule/intra all
timestep      0.001
thermo_style  custom step temp pe etotal press
thermo_modify format float %.16g
{groups}
fix           1 bodies {fix}
run           10
{between}
run           10 {how}
write_dump    all custom {end} id x y z vx vy vz modify sort id format float %.16g
"""
OURS = "nosquish/nve molecule order 123"
THEIRS = "rigid/nve molecule"


class Case(NamedTuple):
    """What a script does after the first run; FIX
    stands for the rigid fix, without its ID and group.

    With `anew`, rigid/nve's fix is defined anew before the second run, because it does not take
    this change over. With `reshaped`, ours is, because it would give bodies their shape again,
    which rigid/nve does not. The words are those of the body style.
    """

    between: str = ""
    how: str = ""
    groups: str = ""
    anew: bool = False
    reshaped: bool = False
    tolerance: float = 1e-9
    words: str = "molecule"


INSIDE = "displace_atoms all move 1.4 1.4 1.4 units box"  # no body crosses a face of the box
HALVES = "unfix 1\ngroup a molecule <= 13\ngroup b subtract bodies a\nfix 1 a FIX\n"
CASES = {
    # atoms come and go, so that LAMMPS moves its arrays: views of the old ones are dead
    "arrays moved": Case(
        "lattice sc 80.0\ncreate_atoms 1 box\ngroup extra subtract all bodies\n"
        "delete_atoms group extra compress no"
    ),
    # a temperature outside of a run counts degrees of freedom
    "dof between runs": Case(
        'print "$(c_other)"',
        "pre no",
        "compute other all temp\ncompute_modify other dynamic/dof yes",
    ),
    # LAMMPS's last group has the sign bit of the atoms' mask
    "32 groups": Case(groups="\n".join(f"group g{k} empty" for k in range(30))),
    # of a new fix: LAMMPS's rigid fixes count degrees of freedom that they must not after a first
    # run (test_other_fixes.py)
    "new velocities": Case("unfix 1\nfix 1 bodies FIX\nvelocity all create 2.0 87287"),
    "velocity set": Case("variable w atom 0.3*sin(x)\nvelocity bodies set 0.1 v_w NULL"),
    "velocity scale": Case("velocity all scale 2.0 temp thermo_temp"),
    "velocity zero": Case(
        "velocity all set 0.4 0 0 sum yes\nrun 2\nvelocity all zero linear\nrun 2\n"
        "velocity all zero angular"
    ),
    "velocity ramp": Case("velocity all ramp vx 0 1 y 0 8 sum yes units box"),
    "new time step": Case("timestep 0.002"),
    "reset_timestep": Case("reset_timestep 1000"),
    "reset_timestep to 0": Case("reset_timestep 0"),
    "run 0": Case("run 0\nrun 0"),
    "post no": Case("run 3 post no\nrun 0 post no", "pre no post no"),
    "run every": Case("", 'every 3 "variable a equal step" "print $a"'),
    "run every with commands": Case("", 'every 5 "velocity all scale 1.5 temp thermo_temp"'),
    "run start stop": Case(
        "variable r equal ramp(0,3)\nfix 0 bodies addforce v_r 0 0\nunfix 1\nfix 1 bodies FIX",
        "start 0 stop 100",
    ),
    "run upto": Case("", "upto\n"),
    "loop": Case(
        "variable i loop 3\nlabel again{end}\nrun 3\ndisplace_atoms all move 0.1 0 0\nnext i\n"
        "jump SELF again{end}"
    ),
    "write_data": Case("write_data data.out"),
    "write_restart": Case("write_restart restart.out"),
    "info": Case("info system fixes groups computes"),
    "balance": Case("balance 0.9 shift xyz 5 1.01"),
    "displaced": Case("displace_atoms all move 3.3 0.2 -5.1"),
    "displace one": Case("group one molecule 14\ndisplace_atoms one move 0.1 -0.2 0.1 units box"),
    "rotate one": Case(
        "group one molecule 14\ndisplace_atoms one rotate 4 4 4 1 2 -1 25 units box"
    ),
    "delete bodies": Case("group some molecule 3 7 20\ndelete_atoms group some", anew=True),
    "delete an atom": Case(
        "delete_atoms group corner", groups="group corner id 40", anew=True, tolerance=1e-6
    ),
    "create bodies": Case(
        "create_atoms 0 single 0.5 0.5 0.5 mol bent 77\n"
        "create_atoms 0 single 1.5 1.5 0.5 mol bent 78\ngroup bodies type 1",
        anew=True,
    ),
    # deformed bodies keep their shape (test_shapes), unless the fix is defined again
    "scaled box": Case("change_box all x scale 1.05 y scale 0.97 remap", reshaped=True),
    "wider box": Case(f"{INSIDE}\nchange_box all z delta -1 2 units box"),
    "boundary": Case(f"{INSIDE}\nchange_box all boundary p f p"),
    "triclinic box": Case("change_box all triclinic"),
    "tilted box": Case(
        "change_box all triclinic xy delta 0.5 yz delta -0.3 remap units box", reshaped=True
    ),
    # the bodies are those of the fix's definition, whatever becomes of what the fix line names
    "group changed": Case("group bodies clear\ngroup bodies molecule 1:20"),
    "group grown": Case(HALVES + "run 3\ngroup a molecule 14:20"),
    "molecules joined": Case("reset_atoms mol all\nrun 5\nbalance 0.9 shift xyz 5 1.01"),
    "molecules divided": Case("reset_atoms mol all single yes"),
    "joined before the first run": Case("unfix 1\nfix 1 bodies FIX\nreset_atoms mol all"),
    "one body changed": Case(
        "unfix 1\ngroup a molecule 2 5\nfix 1 a FIX\nrun 3\ngroup a molecule 7\n"
        "group odd id 4\ngroup b subtract a odd\ngroup a clear\ngroup a union b",
        words="single",
    ),
    "groups of the bodies changed": Case(
        "run 2\ngroup p molecule 3\ngroup q clear\nrun 2\ngroup p delete\ngroup other molecule 7",
        groups="group p molecule 1\ngroup q molecule 2 9",
        words="group 2 p q",
    ),
    "custom values changed": Case(
        "variable f atom mol\nvariable g atom 40-mol\nunfix 1\nset group all i_frag v_f\n"
        "fix 1 bodies FIX\n"
        "run 3\nset atom 4*6 i_frag 1\nrun 3\nset group all i_frag v_g",
        groups="fix p all property/atom i_frag\nset group all i_frag 1",
        words="custom i_frag",
    ),
    "minimised without the fix": Case("unfix 1\nmin_style cg\nminimize 0 0 4 8\nfix 1 bodies FIX"),
    "new fix": Case("unfix 1\nrun 5\nfix other bodies FIX"),
    # a variable that tells bodies apart is read once: atoms stay in their bodies wherever they go
    "variable changed": Case(
        "variable k equal 1\nwrite_data data.out\nbalance 0.9 shift xyz 5 1.01\nrun 5\n"
        "write_restart state",
        groups="variable k equal 0\nvariable b atom mol*(v_k<1)",
        words="custom v_b",
    ),
    "variable of new atoms": Case(
        "create_atoms 0 single 0.5 0.5 0.5 mol bent 77\ngroup bodies type 1",
        groups="variable b atom mol",
        words="custom v_b",
        anew=True,
    ),
    "same fix again": Case("fix 1 bodies FIX"),
    "two fixes": Case(HALVES + "fix 2 b FIX"),
    "beside rigid/nve": Case(HALVES + "fix 2 b rigid/nve molecule"),
    "beside fix nve": Case(HALVES + "fix 2 b nve"),
    "read_data add": Case(
        f"{INSIDE}\nrun 1\nwrite_data data.more\nread_data data.more add append shift 8.8 0 0\n"
        "group bodies type 1",
        anew=True,
    ),
}


def script(name, case, fix, number):
    """The input of a case with one of the two fixes."""
    between = case.between + (
        "\nunfix 1\nfix 1 bodies FIX" if (case.anew if fix == THEIRS else case.reshaped) else ""
    )
    end = f"end.{number}.{'theirs' if fix == THEIRS else 'ours'}"
    text = SCRIPT.format(
        name=end,
        end=end,
        groups=case.groups + "\ngroup bodies type 1",
        fix="FIX",
        how=case.how,
        between=between.replace("{end}", end),
    )
    if case.how == "upto\n":
        text = text.replace("run           10 upto", "run 20 upto")
    return text.replace("FIX", fix.replace("molecule", case.words))


@pytest.fixture(scope="module")
def known():
    """What the process of each number of ranks left."""
    return {}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", CASES)
def test_between_runs(run_lammps, tmp_path, known, ranks, name):
    """Locks out state of an earlier run, or of an earlier system,
    that is used after the script has changed the system."""
    if ranks not in known:
        parts = [
            script(other, case, fix, k)
            for k, (other, case) in enumerate(CASES.items())
            for fix in (OURS, THEIRS)
        ]
        run = run_lammps("".join(parts), files={"mol.bent": BENT}, ranks=ranks, check=False)
        words = re.split(r"^PART (.*)\n", run.log, flags=re.M)[1:]
        known[ranks] = run, dict(zip(words[::2], words[1::2])), tmp_path
    run, logs, folder = known[ranks]
    tables, ends = [], []
    for who in "ours", "theirs":
        file = f"end.{list(CASES).index(name)}.{who}"
        assert (folder / file).exists(), f"{who}:\n" + "\n".join(run.screen.splitlines()[-20:])
        tables.append(read_thermo(logs[file]))
        ends.append(np.loadtxt(folder / file, skiprows=9))
    ours, theirs = tables
    assert ours["Step"].tolist() == theirs["Step"].tolist() and len(ours) >= 3
    rtol = CASES[name].tolerance
    for column in "Temp", "PotEng", "TotEng":
        np.testing.assert_allclose(
            ours[column], theirs[column], rtol=rtol, atol=0.01 * rtol, err_msg=column
        )
    ours, theirs = ends
    assert ours.shape == theirs.shape
    np.testing.assert_allclose(
        ours[:, 4:], theirs[:, 4:], rtol=0, atol=rtol * np.abs(theirs[:, 4:]).max()
    )
    np.testing.assert_allclose(ours[:, 1:4], theirs[:, 1:4], rtol=0, atol=rtol * 10)


# dimers and trimers of patchy bodies: a core and three arms, of which two that meet are bonded
REACTIVE = """
clear
print "PART {name}"
units lj
atom_style molecular
region b block 0 8.1 0 8.1 0 8.1
create_box 3 b bond/types 2 extra/bond/per/atom 3 extra/special/per/atom 8
mass * 1
lattice sc 0.0508052634
molecule arms mol.arms
molecule pre mol.pre
molecule post mol.post
create_atoms 0 box mol arms 4928
pair_style lj/cut 1.1225
pair_coeff * * 1 1
pair_coeff 2*3 2*3 0.0 1.0 1.6
pair_modify shift yes
bond_style harmonic
bond_coeff 1 100 0.6
bond_coeff 2 5 1.0
special_bonds lj 0 1 1
comm_modify cutoff 4
neigh_modify every 1 delay 0
velocity all create 3.0 77 mom yes loop geom
timestep 0.002
thermo_style custom step temp ke etotal bonds
thermo_modify norm no format float %.16g
suffix {suffix}
fix r all {fix}
suffix off
fix rx all bond/react stabilization no react one all 5 0 1.5 pre post map
thermo 25
run 150
run 25
unfix rx
write_restart file.{name}
run 25
"""
CONTINUED = """
clear
print "PART {name}"
read_restart file.{other}
neigh_modify every 1 delay 0
thermo_style custom step temp ke etotal bonds
thermo_modify norm no format float %.16g
fix r all {fix}
thermo 25
run 25
"""


def template(name, types, bonds):
    """A molecule template of these types, with these bonds (type, atom, atom)."""
    lines = [name, "", f"{len(types)} atoms", f"{len(bonds)} bonds", "", "Types", ""]
    lines += [f"{k} {kind}" for k, kind in enumerate(types, 1)]
    lines += ["", "Bonds", "", *(f"{k} {a} {b} {c}" for k, (a, b, c) in enumerate(bonds, 1))]
    return "\n".join(lines) + "\n"


ARMS = [(1, 1, k) for k in (2, 3, 4)]
REACTION = {
    "mol.arms": template("arms", (1, 2, 2, 2), ARMS)
    + "\nCoords\n\n1 0 0 0\n2 0.6 0 0\n3 -0.3 0.52 0\n4 -0.3 -0.52 0\n",
    "mol.pre": template("pre", (1, 2, 2, 1), [(1, 1, 2), (1, 3, 4)]),
    "mol.post": template("post", (1, 3, 3, 1), [(1, 1, 2), (1, 3, 4), (2, 2, 3)]),
    "map": "map\n\n4 equivalences\n2 edgeIDs\n\nInitiatorIDs\n\n2\n3\n\nEdgeIDs\n\n1\n4\n\n"
    "Equivalences\n\n1 1\n2 2\n3 3\n4 4\n",
}


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_reactions(run_lammps, ranks):
    """Locks out bodies that merge at the next run, or behind a restart, where fix bond/react has
    made the molecule-IDs of joined molecules equal: the kinetic energy of a step changed between
    two runs, and there were fewer bodies than before."""
    fixes = {
        "theirs": ("off", "rigid/nve/small molecule"),
        "ours": ("off", "nosquish/nve molecule order 123"),
        "suffix": ("nosquish", "rigid/nve/small molecule"),
    }
    text = "".join(
        REACTIVE.format(name=name, suffix=suffix, fix=fix) for name, (suffix, fix) in fixes.items()
    )
    text += CONTINUED.format(name="again", other="ours", fix=fixes["ours"][1])
    text += CONTINUED.format(name="other", other="suffix", fix=fixes["ours"][1])
    log = run_lammps(text, files=REACTION, ranks=ranks).log
    words = re.split(r"^PART (.*)\n", log, flags=re.M)[1:]
    logs = dict(zip(words[::2], words[1::2]))
    tables = {name: read_thermo(text) for name, text in logs.items()}
    theirs, ours = tables["theirs"], tables["ours"]
    assert theirs["Bonds"][-1] > theirs["Bonds"][0]
    assert ours["Step"][6] == ours["Step"][7] and ours["Step"][8] == ours["Step"][9]
    np.testing.assert_allclose(ours["KinEng"][[6, 8]], ours["KinEng"][[7, 9]], rtol=1e-12)
    for name in "ours", "suffix":
        for column in "Temp", "KinEng", "TotEng", "Bonds":
            np.testing.assert_allclose(tables[name][column], theirs[column], rtol=1e-7)
    for name in "again", "other":
        for column in "Temp", "KinEng", "TotEng":
            np.testing.assert_allclose(tables[name][column], ours[column][-2:], rtol=1e-7)
    assert "since this fix was defined (with another molecule-ID or group: " in logs["ours"]
    assert "27 rigid bodies with 108 atoms" in logs["again"]


TOLD = {
    "molecule": ("set atom 4*9 mol 1", "with another molecule-ID or group: 6"),
    "custom i_f": ("set atom 4 i_f 7", "with another value of i_f or group: 1"),
    "single": ("group a id 40 41", "with another group: 2"),
    "group 2 b c": (
        "group d subtract c e\ngroup b id 7\ngroup c clear\ngroup c union d\ngroup a id 40",
        "with another group: 1",
    ),
    "molecule flexible f": (
        "group e union all\ngroup f clear\ngroup f id 40",
        "with another molecule-ID or group: 4",
    ),
    "custom v_m": ("variable m delete\nvariable m atom 1", ""),
}


def test_told_of_changes(run_lammps):
    """Locks out a change of what the fix line names that has no effect, and no word of it."""
    groups = "group a id 1:30\ngroup b id 4:6\ngroup c id 7:9\ngroup e id 7\ngroup f id 31:33\n"
    groups += "variable m atom mol\nfix p all property/atom i_f\nset group all i_f v_m\n"
    text = "".join(
        SCRIPT.format(
            name=words, end="end", groups=groups, fix="", how="", between=f"{change}\nrun 2\nrun 2"
        ).replace("fix           1 bodies ", f"fix 1 a nosquish/nve {words}")
        for words, (change, _) in TOLD.items()
    )
    log = run_lammps(text, files={"mol.bent": BENT}, ranks=2).log
    logs = re.split(r"^PART .*\n", log, flags=re.M)[1:]
    results = [re.findall(r"since this fix was defined \((.*?)\)\.", one) for one in logs]
    assert results == [[told] if told else [] for _, told in TOLD.values()]


RERUN = """
{setup}
fix           1 bodies {fix}
dump          1 all custom 5 frames id type x y z ix iy iz vx vy vz
dump_modify   1 sort id format float %.17g
run           20
unfix         1
undump        1
{before}
rerun         frames dump x y z ix iy iz vx vy vz box yes
"""


@pytest.mark.quick("2")
@pytest.mark.parametrize("ranks", [1, 2])
def test_rerun(run_lammps, ranks):
    """Locks out a rerun that the fix ends, because the snapshots are not where it would have put
    the bodies, or whose temperature and energy are others than in the run."""
    setup = SCRIPT.split("{groups}")[0].replace("{name}", "rerun") + "thermo 5\ngroup bodies type 1"
    tables = {}
    for name, before in (
        ("without", "compute_modify thermo_temp dynamic/dof no"),
        ("with", "fix 1 bodies {fix}"),
    ):
        text = RERUN.format(setup=setup, fix=OURS, before=before.format(fix=OURS))
        tables[name] = run_lammps(text, files={"mol.bent": BENT}, ranks=ranks).thermo
        assert tables[name]["Step"].tolist() == 2 * [0, 5, 10, 15, 20]
        np.testing.assert_allclose(
            tables[name]["PotEng"][5:], tables[name]["PotEng"][:5], rtol=1e-12
        )
    table = tables["with"]
    for column in "Temp", "TotEng":
        np.testing.assert_allclose(table[column][5:], table[column][:5], rtol=1e-9)


ROUNDED = """
{setup}
fix           1 bodies {fix}
dump          1 all custom 5 frames id x y z
run           20
unfix         1
undump        1
{again}
compute       1 all stress/atom NULL pair
dump          2 all custom 5 {name} id x y z fx fy fz c_1[*]
dump_modify   2 sort id format float %.17g
rerun         frames dump x y z box yes
"""


@pytest.mark.quick("1")
@pytest.mark.parametrize("ranks", [1, 2])
def test_rerun_of_rounded_places(run_lammps, tmp_path, ranks):
    """Locks out a rerun whose forces are those of other places than the file has: bodies do not
    get their exact shape back there, as they do between runs."""
    setup = SCRIPT.split("{groups}")[0].replace("{name}", "rerun") + "thermo 5\ngroup bodies type 1"
    frames = []
    for name in "without", "with":
        again = f"fix 1 bodies {OURS}" if name == "with" else ""
        text = ROUNDED.format(setup=setup, fix=OURS, name=name, again=again)
        log = run_lammps(text, files={"mol.bent": BENT}, ranks=ranks).log
        assert "deformed" not in log
        parts = (tmp_path / name).read_text().split("ITEM: TIMESTEP\n")[1:]
        frames.append(np.array([np.loadtxt(part.splitlines()[8:]) for part in parts]))
    without, with_fix = frames
    scale = np.abs(without).max(axis=(0, 1))
    assert without.shape == (5, 81, 13) and scale.min() > 0
    assert (np.abs(with_fix - without) / scale).max() < 1e-9
