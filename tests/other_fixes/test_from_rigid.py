"""What LAMMPS's rigid fixes have around them, and what serves in its place: see from-rigid.md.

Each is tried beside fix rigid/nve/small, on the same trajectory.
"""

import re

import numpy as np
import pytest

from support.running import LAMMPS, read_thermo
from support.systems import LIKE_LAMMPS, RIGID, SMALL, mixture

THERMO = (
    "thermo_style custom step temp pe ke {}\nthermo_modify norm no format float %.16g\nthermo 10\n"
)
OURS, THEIRS = (fix.format(group="all", words="molecule") for fix in (LIKE_LAMMPS, SMALL))


@pytest.fixture(scope="module")
def system():
    """Bodies whose rotation is split with both fixes."""
    return mixture("solid planar")


@pytest.fixture
def both(run_lammps, system):
    """A function that runs two scripts, one after the other, and gives their thermo tables; first
    is what comes before the box."""

    def run(ours, theirs, first="", **how):
        first = f"clear\n{first}\n{system.setup}\ntimestep 0.002\n"
        parts = [f"{first}{text}\n" for text in (ours, theirs)]
        log = run_lammps('\nprint "OTHER"\n'.join(parts), files=system.files, **how).log
        return [read_thermo(part) for part in re.split(r"^OTHER$", log, flags=re.M)]

    return run


def assert_alike(ours, theirs, columns):
    """Assert that tables have the same in these columns: pairs of names, or a name for both."""
    for column in columns:
        one, other = (column, column) if isinstance(column, str) else column
        np.testing.assert_allclose(
            ours[one], theirs[other], rtol=1e-9, atol=1e-9 * np.abs(theirs[other]).max()
        )


PUSH = "group some molecule 2 3 4\nfix push some addforce 3.0 -1.0 0.5\n"


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("words", ["late", "early", "early late"])
def test_bodyforces(both, words, ranks):
    """Locks out forces of fixes behind this one that bodies do not get, or not from the start, as
    with the fix before LAMMPS's; such that they get although the script says that they do not, and
    forces of fixes before it that they do not get; and a second word that does not take the first
    one back."""
    before = PUSH.replace("push", "before").replace("some", "few").replace("3.0", "1.5")
    end = "".join(f"fix_modify 1 bodyforces {word}\n" for word in words.split())
    end += f"{THERMO.format('')}run 20\nrun 20"
    theirs = f"{THEIRS}\n{PUSH}" if words == "early" else f"{PUSH}{THEIRS}\n"
    tables = both(f"{before}{OURS}\n{PUSH}{end}", f"{before}{theirs}{end}", ranks=ranks)
    assert_alike(*tables, ["PotEng", "KinEng"])
    plain, other = both(f"{OURS}\n{end}", f"{OURS}\n{PUSH}{end}", ranks=ranks)
    for one, pushed in (plain, tables[0]), (other, tables[0]):
        assert np.abs(pushed["KinEng"][2] / one["KinEng"][2] - 1) > 1e-4


def test_bodyforces_early_in_runs_in_a_row(both):
    """Locks out forces of fixes behind this one in the half step that one run leaves to the next,
    where that does not compute the forces anew."""
    fix = "fix 1 all nosquish/nvt molecule temp 1 1 1 seed 5"
    early = f"{fix}\n{PUSH}fix_modify 1 bodyforces early\n{THERMO.format('')}"
    one, other = both(f"{early}run 20 pre yes\nrun 20 pre no", f"{early}run 40")
    for name in "PotEng", "KinEng":
        assert one[name][-1] == pytest.approx(other[name][-1], rel=1e-12)


@pytest.mark.quick("fix-1")
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("how", ["fix", "keyword", "behind", "variable behind"])
def test_gravity(both, how, ranks):
    """Locks out a weight of bodies that is not that of fix rigid's keyword gravity, by this keyword
    or by fix gravity alone, which may be defined behind the bodies' fix."""
    weight = "fix g all gravity 2.0 vector 1 -1 0.5"
    end = f"{THERMO.format('')}run 20\nrun 20"
    ours = OURS if how == "fix" else f"{OURS} gravity g"
    disable = "" if how == "fix" else " disable"
    lines = [f"{weight}{disable}", ours]
    if how == "variable behind":
        lines[0] = "variable g equal 2.0\n" + lines[0].replace("2.0", "v_g")
    lines = "\n".join(lines[:: -1 if "behind" in how else 1])
    theirs = f"{weight} disable\n{THEIRS} gravity g"
    if LAMMPS < (2025, 7):  # there bodies have no weight in the first half of a run's first step
        theirs = f"{weight}\n{THEIRS}"
    tables = both(
        f"{lines}\n{end}",
        f"{theirs}\n{end}",
        ranks=ranks,
    )
    assert_alike(*tables, ["PotEng", "KinEng"])
    assert np.ptp(tables[0]["KinEng"] + tables[0]["PotEng"]) > 1


GRAVITY = "fix g all gravity 1 vector 0 0 -1 disable\n"
ZERO = f"{OURS}\nrun 0\nvelocity all zero {{}} rigid 1"
MODIFIED = "fix 1 all nosquish/{}\nfix_modify 1 {}"
LEVELS = "run_style respa 2 2 pair 1\n"
REFUSED = {  # lines, and what the message says
    "zero linear": (ZERO.format("linear"), "Velocity rigid used with non-rigid fix-ID"),
    "zero angular": (ZERO.format("angular"), "Velocity rigid used with non-rigid fix-ID"),
    "soon": (
        f"{OURS}\n{PUSH}fix_modify 1 bodyforces soon",
        "bodyforces soon: expected early or late",
    ),
    "early with levels": (
        f"{OURS}\n{PUSH}{LEVELS}fix_modify 1 bodyforces early",
        "not for run_style respa",
    ),
    "no value": (
        MODIFIED.format("nve molecule", "bodyforces"),
        "does not support fix_modify bodyforces command",
    ),
    "temp": (
        MODIFIED.format("nve molecule", "temp thermo_temp"),
        "does not support fix_modify temp command",
    ),
    "press": (
        MODIFIED.format("nve molecule", "press thermo_press"),
        "does not support fix_modify press command",
    ),
    "temp without a value": (
        MODIFIED.format("nph molecule iso 0 0 1", "temp"),
        "does not support fix_modify temp command",
    ),
    "no gravity": (
        f"{GRAVITY}fix 1 all nosquish/nve molecule gravity h",
        "'h' is not a fix gravity",
    ),
    "gravity with levels": (
        f"{GRAVITY}{LEVELS}fix 1 all nosquish/nve molecule gravity g",
        "run_style",
    ),
    "gravity with HMC": (
        f"{GRAVITY}fix 1 all nosquish/hmc molecule temp 1 steps 1 seed 5 gravity g",
        "fix_modify g energy",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(refused, system, name):
    """Locks out a command without effect; words that mean nothing, and forces of levels that are
    not those of the bodies; a crash where a word has no value, and a temperature or pressure for an
    integrator that has no use for it, taken without a word; bodies without the weight that is asked
    for, or with that of several levels, and a test of an energy without that of the weight."""
    lines, says = REFUSED[name]
    refused(f"{system.setup}\n{lines}\nrun 0\n", says, system.files)


@pytest.mark.parametrize("suffix", ["omp", "opt"])
@pytest.mark.parametrize("words", ["nve molecule", "nvt molecule temp 1 1 1 seed 5"])
def test_suffix(both, words, suffix):
    """Locks out bodies that miss forces, or virial, of styles that a suffix chooses."""
    fix = f"fix 1 all nosquish/{words}\n"
    pair = "pair_style lj/cut 2.5\npair_coeff * * 1.0 1.0\n"
    end = f"{pair}{fix}{THERMO.format('press')}run 40"
    ours, plain = both(f"suffix {suffix}\n{end}", f"suffix off\n{end}", first="package omp 2")
    assert_alike(ours, plain, ["PotEng", "KinEng", "Press"])


BALLS = """three balls

3 atoms

Coords

1 0.5 0.1 0.0
2 -0.3 0.6 0.0
3 -0.4 -0.4 0.2

Types

1 1
2 1
3 1

Diameters

1 0.9
2 0.9
3 0.9

Masses

1 1.5
2 1.0
3 2.0
"""
SOLVENT = """
units         lj
atom_style    sphere
atom_modify   first balls map array
fix           prop all property/atom mol ghost yes
lattice       sc 0.032 origin 0.5 0.5 0.5
region        box block 0 6.3 0 6.3 0 6.3 units box
create_box    2 box
molecule      balls mol.balls
create_atoms  0 box mol balls 3
lattice       sc 30
create_atoms  2 box
set           type 2 mass 0.05
group         balls type 1
group         solvent type 2
velocity      balls create 1.0 5
velocity      solvent create 1.0 6 loop geom
pair_style    lj/cut 1.5
pair_coeff    * * 0.0 1.0
pair_coeff    1 2 0.0 1.0 0.45
neighbor      0.4 multi
neigh_modify  every 1 delay 0
comm_modify   mode multi group balls vel yes
delete_atoms  overlap 0.45 solvent balls
neigh_modify  include balls exclude molecule/intra balls
pair_coeff    1 1 1.0 1.0
pair_coeff    1 2 0.0 1.0 0.0
timestep      0.002
FIX
fix           2 solvent srd 20 balls 1.0 0.225 77 search 0.3 inside ignore overlap yes &
              collision noslip
thermo_style  custom step pe ke f_1 f_2[1] f_2[2]
thermo_modify norm no format float %.14g
thermo        5
run           50
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_solvent_of_srd(run_lammps, ranks):
    """Locks out bodies that fix srd finds elsewhere, or with other velocities and spins, than those
    of LAMMPS's fix rigid: it looks in the middle of a step."""
    tables = {}
    for fix in LIKE_LAMMPS, RIGID:
        line = fix.format(group="balls", words="molecule")
        run = run_lammps(SOLVENT.replace("FIX", line), files={"mol.balls": BALLS}, ranks=ranks)
        tables[fix] = run.thermo
    assert_alike(*tables.values(), ["PotEng", "KinEng", "f_1", "f_2[1]", "f_2[2]"])
    assert tables[RIGID]["f_2[1]"][-1] > 50  # collisions
