"""Words that act: each keyword of our fixes, of LAMMPS's rigid fixes, and of the commands
``*_modify`` that can stand beside them, has its effect here or its answer.

An effect is what LAMMPS's own fix makes of the same word, or a number that is known.  The tables
are complete: a word that our fixes get needs a row, which may be a test in another file.
"""

import re
from typing import NamedTuple

import numpy as np
import pytest

from fix_nosquish import of_style
from fix_nosquish.errors import RunError
from fix_nosquish.host import command
from fix_nosquish.host.command import Command, Line
from support.fixes import STYLES
from support.insertion import MASSES, MOLECULE
from support.running import LAMMPS, ROOT, read_thermo
from support.sampling import FREE
from support.systems import RIGID, mixture
from validation.scenes.boxes import nearest

BODIES = mixture("solid planar", temperature=3.0)
TILTED = mixture("solid planar", tilt=0.2)
GRAVITY = "fix g all gravity 2.0 vector 1 -1 0.5"
LIKE_LAMMPS = "fix 1 {group} nosquish/nve {words} order 123"


def fix(style, words="", needs=None):
    """The line of a fix with the words that its style needs, and these."""
    return f"fix 1 {{group}} nosquish/{style} {{words}} {needs or STYLES[style]} {words}"


# ---------------------------------------------------------------- the keywords of our fixes


@pytest.fixture
def run(simulate):
    """A function that gives the Result of bodies with a fix."""

    def run(line, steps=20, system=BODIES, every=1, **how):
        return simulate(system, line, steps, every=every, **how)

    return run


def test_seed(run):
    """Locks out noise that is the same for each seed, or not the same for one."""
    needs = "temp 1.25 1.5 0.75 seed {}"
    one, again, other = (
        run(fix("nvt", needs=needs.format(number)), before=before)
        for number, before in ((1, ""), (1, "# again"), (2, ""))
    )
    assert np.array_equal(one.x, again.x) and np.abs(one.v - other.v).max() > 1e-2


@pytest.mark.parametrize("value, same", [("no", True), ("yes", False)])
def test_separate(run, value, same):
    """Locks out one factor for translation and rotation, or two, against the keyword's word, and
    noise that the two share."""
    needs = f"temp 1 1 0.02 seed 5 thermostat csvr separate {value}"
    how = {"before": FREE, "columns": "f_1[1] f_1[2]", "every": 20}
    table = run(fix("nvt", needs=needs), 4000, **how).thermo
    assert bool(np.ptp(table["f_1[2]"] / table["f_1[1]"]) < 1e-9) is same
    assert (np.corrcoef(table["f_1[1]"], table["f_1[2]"])[0, 1] > 0.5) == same


def test_tchain(run):
    """Locks out chains of one length."""
    line = fix("nvt", "tchain {}", "temp 1 1 0.1 thermostat nh")
    one, three = (run(line.replace("{}", n), 50) for n in "13")
    assert np.abs(one.v - three.v).max() > 1e-2


PULLED = "1.5 1.5 2.5"
STRETCHED = {  # keyword: what of the box changes, and which of that by the same factor
    **{
        "iso": ("Lx Ly Lz", "Lx Ly Lz"),
        "aniso": ("Lx Ly Lz", ""),
        "tri": ("Lx Ly Lz Xy Xz Yz", ""),
    },
    **{axis: (f"L{axis}", "") for axis in "xyz"},
    **{"xy": ("Xy Xz", ""), "xz": ("Xz", ""), "yz": ("Yz", "")},  # c is tilted along b, too
}


@pytest.mark.parametrize("word", STRETCHED)
def test_pressure(run, word):
    """Locks out an axis or a tilt that changes and was not named, and one that was and does not."""
    system = TILTED if word in ("tri", *command.TILTS) else BODIES
    columns = "lx ly lz xy xz yz" if system is TILTED else "lx ly lz"
    needs = f"{word} {PULLED} every 1"
    table = run(fix("nph", needs=needs), system=system, columns=columns).thermo
    changes, same = STRETCHED[word]
    moved = {name for name in columns.title().split() if np.ptp(table[name]) > 1e-9}
    assert moved == set(changes.split())
    assert np.ptp([table[name][-1] / table[name][0] for name in same.split()] or [0]) < 1e-12


@pytest.mark.parametrize("value", command.COUPLES)
def test_couple(run, value):
    """Locks out coupled axes that part, and others that do not."""
    needs = f"aniso {PULLED} every 1 couple {value}"
    table = run(fix("nph", needs=needs), columns="lx ly lz").thermo
    ratio = {axis: table[f"L{axis}"][-1] / table[f"L{axis}"][0] for axis in "xyz"}
    for one, other in "xy", "yz", "xz":
        together = one in value and other in value and value != "none"
        assert bool(abs(ratio[one] - ratio[other]) < 1e-12) is together


# of each entry in the tables of keywords, the test that fails if the value is read and not used
ACTS = {
    **dict.fromkeys(("force", "torque"), "test_keywords.py::test_force_and_torque"),
    "reinit": "test_keywords.py::test_reinit",
    "infile": "test_keywords.py::test_infile",
    "mrot": "test_exact_rotor.py::test_free_bodies_in_lammps",
    "rotor": "test_exact_rotor.py::test_free_bodies_in_lammps",
    "order": "test_nve.py::test_order_of_axes",
    "output": "test_output.py::test_steps_of_several_runs",
    "flexible": "test_nvt.py::test_points_move_as_with_nve",
    "mol": "test_insertion.py::test_one_of_several_templates",
    "gravity": "test_from_rigid.py::test_gravity",
    "temp": "test_nvt.py::test_ramp",
    "thermostat": "test_nvt.py::test_time_of_rescaling",
    "seed": "test_words.py::test_seed",
    "tchain": "test_words.py::test_tchain",
    "separate": "test_words.py::test_separate",
    "moments": "test_moments.py::test_moments_decide_the_step",
    **dict.fromkeys(STRETCHED, "test_words.py::test_pressure"),
    "couple": "test_words.py::test_couple",
    "every": "test_npt.py::test_how_often_the_box_changes",
    "dilate": "test_tri.py::test_what_moves_with_the_box",
    "barostat": "test_npt.py::test_ramp",
    "compressibility": "test_npt.py::test_ramp",
    "temp T": "test_hmc.py::test_momenta",
    "steps": "test_hmc.py::test_mix",
    "mix": "test_hmc.py::test_mix",
}


def entries(style):
    """The keywords of a style, to their entries in the tables of keywords."""
    own = of_style(f"nosquish/{style}").keywords
    return {entry.split()[0]: entry for entry in (*command.KEYWORDS, *own)}


@pytest.mark.quick
def test_each_keyword_has_a_row():
    """Locks out a keyword of our fixes that no test knows, and a test of one that is gone."""
    assert {entry for style in STYLES for entry in entries(style).values()} == set(ACTS)
    for test in ACTS.values():
        file, name = test.split("::")
        assert f"\ndef {name}(" in next((ROOT / "tests").rglob(file)).read_text(), test


# ---------------------------------------------------------------- keywords of other fixes

# of doc/src/fix_rigid.rst and fix_nh.rst, and of the sources: those that our fixes have not, and
# what the message says to write
ELSEWHERE = {
    "langevin": "fix nosquish/nvt has Langevin's thermostat: temp TSTART TSTOP TDAMP seed N",
    **dict.fromkeys(("tparam", "tloop", "ploop"), "thermostat nh with tchain N"),
    "pchain": "has the length tchain",
    "mtk": "barostat mtk",
    **dict.fromkeys(("nreset", "drag", "ptemp", "fixedpoint", "flip", "update"), "leave it out"),
    **dict.fromkeys(("scalexy", "scaleyz", "scalexz"), "leave it out"),
    **dict.fromkeys(
        ("bodyforces", "energy", "virial", "respa", "dynamic/dof", "external"),
        "give it by fix_modify, after this fix",
    ),
}
RIGID_WORDS = """langevin reinit temp iso aniso x y z couple tparam pchain dilate force torque
    infile mol gravity"""
NH_WORDS = """temp iso aniso tri x y z xy yz xz couple tchain pchain mtk tloop ploop nreset drag
    ptemp dilate scalexy scaleyz scalexz flip fixedpoint update"""


def answer(style, keyword):
    """What a fix says of a keyword that it has not."""
    words = ["molecule", *STYLES[style].split(), keyword, "1"]
    with pytest.raises(RunError) as caught:
        Command.parse(
            Line.native("1", "all", f"nosquish/{style}", words),
            of_style(f"nosquish/{style}").keywords,
        )
    said, text = caught.value.args[0], f"unknown keyword '{keyword}': "
    assert said.startswith(text) and f'word {len(words) + 3} of "fix 1 all' not in text
    return said.removeprefix(text).partition(" (in word")[0]


@pytest.mark.quick
@pytest.mark.parametrize("style", STYLES)
def test_keywords_of_other_fixes(style):
    """Locks out a keyword that is answered by a list of others: the message says what to write, and
    a fix that it names has the keyword."""
    ours = {keyword for each in STYLES for keyword in entries(each)}
    theirs = {*RIGID_WORDS.split(), *NH_WORDS.split()}
    assert theirs - ours == theirs & set(ELSEWHERE)
    for keyword, says in ELSEWHERE.items():
        assert says in answer(style, keyword)
    for keyword in ours - set(entries(style)):
        said = answer(style, keyword)
        named = re.findall(r"nosquish/(\w+)", said)
        assert named and all(keyword in entries(name) for name in named), said


# ---------------------------------------------------------------- commands beside our fixes


class Beside(NamedTuple):
    """A word of a command that acts beside a fix.

    Attributes:
        before, behind: lines before and behind the fix; first: in place of LAMMPS's atom_modify.
        shows: an expression that finds something else in our log, or in a file, than without them.
        column: a thermodynamic column that has other values with them.
        setup: what they need, which is there without them, too.
        run: the lines of the run.  words, group: of the fix.  ranks: how many there are.
    """

    before: str = ""
    behind: str = ""
    shows: str = ""
    column: str = ""
    first: str = "atom_modify map array"
    setup: str = ""
    run: str = "run 30"
    file: str = ""
    words: str = "molecule"
    group: str = "all"
    ranks: int = 1


MULTI = "neighbor 0.4 multi"
# without neighbor multi/old: it reads memory that nobody has set, and in a few of 100 runs LAMMPS,
# with its own fix nve, too, then loses pairs
OLD = "comm_modify mode multi/old"
GHOSTS = r"Nghost: +(\d+)"
PAIRS = r"Total # of neighbors = (\d+)"
LISTS = r"Neighbor list builds = (\d+)"
FIRST = "group half molecule 1:10\natom_modify first half"
DPD = "pair_style dpd 1.0 2.0 77\npair_coeff * * 5.0 4.5"  # friction between atoms
ORDER = {"run": "run 30\nwrite_dump all custom order id", "file": "order", "shows": r"^\d+ ?$"}
BESIDE = {
    "neigh_modify": {
        "every": Beside("neigh_modify every 7 check no", shows=LISTS),
        "delay": Beside("neigh_modify delay 10 check no", shows=LISTS),
        "check": Beside("neigh_modify check no", shows=LISTS),
        "once": Beside("neigh_modify once yes", shows=LISTS),
        "include": Beside("neigh_modify include half", setup=FIRST, group="half", column="PotEng"),
        "exclude type": Beside("neigh_modify exclude type 1 2", column="PotEng"),
        "exclude group": Beside("neigh_modify exclude group solid planar", column="PotEng"),
        "exclude molecule/inter": Beside("neigh_modify exclude molecule/inter all", shows=PAIRS),
        "exclude molecule/intra": Beside(
            "neigh_modify exclude molecule/intra all",
            setup="neigh_modify exclude none",
            shows=PAIRS,
        ),
        "exclude none": Beside("neigh_modify exclude none", column="PotEng"),
        "page": Beside("neigh_modify page 30000 one 3000", shows="max neighbors/atom: (.*)"),
        "binsize": Beside("neigh_modify binsize 0.7", shows="binsize = (.*),"),
        "collection/type": Beside(
            "neigh_modify collection/type 2 1 2*3\ncomm_modify mode multi cutoff/multi 1 3.5",
            setup=MULTI,
            shows=GHOSTS,
        ),
        "collection/interval": Beside(
            "neigh_modify collection/interval 2 1.6 9\ncomm_modify mode multi cutoff/multi 2 3.5",
            setup=MULTI,
            shows=GHOSTS,
        ),
    },
    "comm_modify": {
        "mode": Beside("comm_modify mode multi cutoff/multi 1 3.5", setup=MULTI, shows=GHOSTS),
        "cutoff": Beside("comm_modify cutoff 3.5", shows="ghost atom cutoff = (.*)"),
        "cutoff/multi": Beside(
            "comm_modify cutoff/multi 1 3.5", setup=f"{MULTI}\ncomm_modify mode multi", shows=GHOSTS
        ),
        "reduce/multi": Beside(
            "comm_modify reduce/multi",
            shows=GHOSTS,
            setup=f"{MULTI}\nneigh_modify collection/type 2 1 2*3\ncomm_modify mode multi\n"
            "pair_coeff 2*3 2*3 1.0 1.0 1.2",
        ),
        "cutoff/multi/old": Beside("comm_modify cutoff/multi/old 1 3.5", setup=OLD, shows=GHOSTS),
        "group": Beside(
            "comm_modify group half",
            setup=f"{FIRST}\nneigh_modify include half",
            group="half",
            shows=GHOSTS,
        ),
        "vel": Beside(f"comm_modify vel yes\n{DPD}", column="PotEng", run="run 0\nrun 30"),
    },
    "atom_modify": {
        "map": Beside(first="atom_modify map hash"),
        "first": Beside(f"{FIRST}\nneigh_modify check no", **ORDER),
        "sort": Beside("atom_modify sort 5 1.0\nneigh_modify check no", **ORDER),
    },
    "thermo_modify": {
        "warn": Beside(
            behind="thermo_modify warn ignore",
            setup="set group all mol 0",
            shows="WARNING: (.*)",
        ),
        "norm": Beside(behind="thermo_modify norm yes", column="PotEng"),
        "flush": Beside(behind="thermo_modify flush yes"),
        "line": Beside(behind="thermo_modify line yaml", shows="keywords: .'Step'"),
        "colname": Beside(behind="thermo_modify colname 2 Kelvin", shows=r"Step +(\S+)"),
        "format": Beside(behind="thermo_modify format 2 %.3f", shows=r"^ +0 +\d\.(\d+)"),
        "temp": Beside("compute t solid temp", "thermo_modify temp t", column="Temp"),
        "press": Beside(
            "compute p all pressure NULL pair", "thermo_modify press p", column="Press"
        ),
    },
    "compute_modify": {
        "extra/dof": Beside(behind="compute_modify thermo_temp extra/dof 100", column="Temp"),
        "dynamic/dof": Beside(behind="compute_modify thermo_temp dynamic/dof yes"),
    },
    "fix_modify": {
        "virial": Beside(behind="fix_modify 1 virial no", column="Press"),
        "bodyforces": Beside(
            behind="fix_modify 1 bodyforces early",
            run="fix 7 solid addforce 1 0 0\nrun 30",
            column="PotEng",
        ),
        "dynamic/dof": Beside(behind="fix_modify 1 dynamic/dof yes"),
    },
    "others": {
        "timestep": Beside(behind="timestep 0.001", column="PotEng"),
        "newton": Beside(first="newton off\natom_modify map array", shows="newton (off)"),
        "suffix": Beside(
            first="package omp 1\nsuffix omp\natom_modify map array", shows="pair (lj/cut.*),"
        ),
        "reset_timestep": Beside(behind="reset_timestep 1000", shows=r"^ +(\d+) "),
        "reset_atoms": Beside(behind="run 15\nreset_atoms id sort yes", shows="Resetting atom IDs"),
        "fix balance": Beside(
            behind="fix b all balance 5 1.0 shift xyz 10 1.0", shows="Nlocal: +(.*)", ranks=2
        ),
        "processors": Beside(
            first="processors 1 2 1\natom_modify map array",
            shows="(.*) MPI processor grid",
            ranks=2,
        ),
    },
}


@pytest.mark.parametrize(
    "command, word", [(command, word) for command in BESIDE for word in BESIDE[command]]
)
def test_word_beside(run_lammps, tmp_path, command, word):
    """Locks out a word that LAMMPS takes and that means nothing, or something else than beside
    LAMMPS's own fix, for the bodies of ours."""
    if word == "cutoff/multi/old" and LAMMPS > (2025, 7, 22):
        pytest.skip("this LAMMPS has no communication mode multi/old")
    row = BESIDE[command][word]
    text, files = "", ("ours", "theirs", "without")
    for name, line in zip(files, (LIKE_LAMMPS, RIGID, LIKE_LAMMPS), strict=True):
        some = row if name != "without" else Beside(run=row.run)
        setup = BODIES.setup.replace("atom_modify map array", some.first)
        text += f"""clear
suffix off
print "PART"
{setup}
{row.setup}
{some.before}
{line.format(group=row.group, words=row.words)}
thermo_style custom step temp pe press
thermo_modify norm no format float %.16g warn default
thermo 10
timestep 0.002
{some.behind}
{some.run}
shell mv order order.{name}
write_dump all custom {name} id x y z vx vy vz modify sort id format float %.16g
"""
    log = run_lammps(text, files=BODIES.files, ranks=row.ranks).log
    logs = dict(zip(files, log.split("PART\n")[1:], strict=True))
    dumps = {name: np.loadtxt(tmp_path / name, skiprows=9) for name in files}
    delta = dumps["ours"] - dumps["theirs"]
    assert np.abs(nearest(delta[:, 1:4], BODIES.h)).max() < 1e-8
    assert np.abs(delta[:, 4:]).max() < 1e-8
    if row.shows:
        results = [
            re.findall(
                row.shows,
                (tmp_path / f"{row.file}.{name}").read_text() if row.file else logs[name],
                re.M,
            )
            for name in ("ours", "without")
        ]
        assert results[0] != results[1] and (results[0] or word == "warn")
    if row.column:
        with_it, without = (read_thermo(logs[name])[row.column] for name in ("ours", "without"))
        assert np.abs(with_it - without).max() > 1e-6
        theirs = read_thermo(logs["theirs"])[row.column]
        if row.column != "Press":  # that of fix rigid is of other times
            np.testing.assert_allclose(with_it, theirs, rtol=1e-8, atol=1e-8)


def cut(system):
    """The IDs of two atoms of a body that are at opposite faces of the box."""
    x = np.array([line.split() for line in system.files["data.bodies"].splitlines()
                  if len(line.split()) == 9], float)  # fmt: skip
    far = np.abs(x[:, None, 3:6] - x[:, 3:6]).max(axis=2)
    far = (far > 0.6 * system.h[0, 0]) & (far < system.h[0, 0] - 1)  # and no ghosts of each other
    return np.argwhere(far & (x[:, None, 1] == x[:, 1]))[0] + 1


BOND = "bond_style zero\nbond_coeff 1\ncreate_bonds single/bond 1 {} {}".format(*cut(BODIES))
# lines of a script with nosquish/nve, or LINE in its place; what ends it, or stands in the log
ANSWERS = {
    "neigh_modify cluster": (
        f"{BOND}\npair_style zero 0.1\npair_coeff * *\nneighbor 0.1 bin\nneigh_modify cluster yes",
        "extent > half of periodic box length",
    ),
    "neigh_modify one": ("neigh_modify page 100 one 10", "boost neigh_modify one"),
    "neigh_modify include": (
        f"{FIRST}\nneigh_modify include half", "neigh_modify include leaves out atom",
    ),
    "atom_modify id": (
        "clear\natom_style atomic\natom_modify id no\nregion r block 0 9 0 9 0 9\n"
        "create_box 1 r\ncreate_atoms 1 random 5 7 NULL\nmass 1 1\npair_style zero 2\n"
        "pair_coeff * *\nfix 1 all nosquish/nve single", "needs atom IDs",
    ),
    "thermo_modify triclinic/general": (
        "LINE\nthermo_modify triclinic/general yes", "is not general triclinic",
    ),
    "compute_modify extra": (
        "LINE\ncompute_modify thermo_temp extra 9", "does not support compute_modify extra",
    ),
    "compute_modify dynamic": (
        "LINE\ncompute_modify thermo_temp dynamic yes", "does not support compute_modify dynamic",
    ),
    "fix_modify temp": ("LINE\nfix_modify 1 temp thermo_temp", "does not support fix_modify temp"),
    "fix_modify press": ("LINE\nfix_modify 1 press thermo_press", "not support fix_modify press"),
    "fix_modify energy": ("LINE\nfix_modify 1 energy yes", "does not support fix_modify energy"),
    "fix_modify respa": ("LINE\nfix_modify 1 respa 1", "Illegal fix_modify respa"),
    "keyword gravity": (
        f"{GRAVITY}\nfix 1 all nosquish/nve molecule gravity g", "have their weight twice",
    ),
}  # fmt: skip
WARNED = {
    "fix_modify dynamic/dof": ("LINE\nfix_modify 1 dynamic/dof no", "dynamic/dof no has no effect"),
    "fix_modify temp": (
        "fix 1 all nosquish/nph molecule iso 0 0 1\nfix_modify 1 temp thermo_temp",
        "fix_modify temp thermo_temp has no effect",
    ),
    "fix_modify press": (
        "fix 1 all nosquish/nph molecule iso 0 0 1\nfix_modify 1 press thermo_press",
        "fix_modify press thermo_press has no effect",
    ),
}


def with_answer(lines):
    """A script of bodies with these lines, and files."""
    lines = lines if "LINE" in lines or "fix 1" in lines else f"{lines}\nLINE"
    lines = lines.replace("LINE", "fix 1 all nosquish/nve molecule")
    setup = BODIES.setup.replace(
        "read_data data.bodies",
        "read_data data.bodies extra/bond/types 1 extra/bond/per/atom 2 extra/special/per/atom 9",
    )
    return f"{setup}\n{lines}\ntimestep 0.002\nrun 5\n"


# those of which each rank tells by itself
ON_ONE = "neigh_modify cluster", "neigh_modify one"


@pytest.mark.parametrize(
    "word, ranks",
    [(word, ranks) for word in ANSWERS for ranks in (1, 2)[: 1 if word in ON_ONE else 2]],
)
def test_word_is_answered(refused, word, ranks):
    """Locks out a word without an effect on our fix, or with a wrong one, and a run that goes on
    without telling."""
    if word in ("compute_modify extra", "compute_modify dynamic") and LAMMPS < (2025, 2):
        pytest.skip("this LAMMPS takes it for extra/dof or dynamic/dof")
    lines, says = ANSWERS[word]
    refused(with_answer(lines), says, BODIES.files, ranks=ranks)


@pytest.mark.parametrize("word", WARNED)
def test_word_is_warned_of(run_lammps, word):
    """Locks out a word without an effect on our fix, of which the log does not tell, and a line
    that is there without it."""
    lines, says = WARNED[word]
    plain = "\n".join(line for line in lines.splitlines() if "fix_modify" not in line)
    for text, count in (lines, 1), (plain, 0):
        log = run_lammps(with_answer(text), files=BODIES.files, ranks=2).log
        assert log.count(says) == count


LEAVING = f"""units lj
atom_style molecular
boundary f p p
region box block 0 8 0 8 0 8
create_box 2 box bond/types 1 extra/bond/per/atom 1 extra/special/per/atom 4
{MASSES}
molecule bent mol.bent
pair_style lj/cut 2.5
pair_coeff * * 0.4 0.8
region inner block 1.5 5 1.5 7 1.5 7
create_atoms 0 random 6 4928 inner overlap 1.2 maxtry 1000 mol bent 777
create_atoms 1 single 7.0 4 4
create_atoms 1 single 7.5 4 4
group loose id 19 20
group bodies subtract all loose
velocity bodies create 1.0 4711
velocity loose set 30 0 0
bond_style zero
bond_coeff 1
create_bonds single/bond 1 19 20
comm_modify cutoff 3
neigh_modify every 1 delay 0 check no
timestep 0.002
FIX
fix 2 loose nve
thermo_style custom step atoms pe
thermo_modify norm no format float %.15g WORDS
thermo 10
run 50
"""
LOST = {  # what the log says, and whether the run goes on
    "lost error lost/bond error": ("Bond atoms 19 20 missing", False),
    "lost error lost/bond ignore": ("ERROR: Lost atoms: original 20 current 19", False),
    "lost warn lost/bond warn": ("WARNING: Lost atoms: original 20 current 19", True),
    "lost ignore lost/bond ignore": ("", True),
}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("words", LOST)
def test_lost_atoms(run_lammps, words, ranks):
    """Locks out words on lost atoms that mean something else where there are bodies, too."""
    says, goes_on = LOST[words]
    runs = []
    for line in LIKE_LAMMPS, RIGID:
        text = LEAVING.replace("FIX", line.format(group="bodies", words="molecule"))
        text = text.replace("WORDS", words)
        how = {"files": {"mol.bent": MOLECULE}, "ranks": ranks, "check": False}
        runs.append(run_lammps(text, **how))
        assert says in runs[-1].screen and (runs[-1].code == 0) is goes_on
        assert says or "Lost atoms" not in runs[-1].log
    if goes_on:
        ours, theirs = (run.thermo for run in runs)
        assert ours["Atoms"][-1] == 18
        np.testing.assert_allclose(ours["PotEng"], theirs["PotEng"], rtol=1e-8)


# of doc/src/*_modify.rst, and of LAMMPS's sources: Neighbor, Comm, Atom, Thermo, Compute and Fix
# have a method modify_params each
MODIFY = {
    "neigh_modify": "delay every check once cluster include exclude page one binsize "
    "collection/type collection/interval",
    "comm_modify": "mode cutoff cutoff/multi reduce/multi cutoff/multi/old group vel",
    "atom_modify": "id map first sort",
    "thermo_modify": "lost lost/bond warn norm flush line colname format temp press "
    "triclinic/general",
    "compute_modify": "extra/dof extra dynamic/dof dynamic",
    "fix_modify": "temp press energy virial respa dynamic/dof bodyforces",
}


def test_each_word_of_lammps_has_a_row():
    """Locks out a word of LAMMPS that is left out of these tables."""
    answered = {*ANSWERS, *WARNED, "thermo_modify lost", "thermo_modify lost/bond"}
    for name, words in MODIFY.items():
        rows = {f"{name} {word.split()[0]}" for word in BESIDE[name]}
        assert {f"{name} {word}" for word in words.split()} <= rows | answered


TIMES = """units {}
atom_style molecular
region box block 0 20 0 20 0 20
create_box 1 box
mass 1 20.0
create_atoms 1 single 1 1 1
create_atoms 1 single 2 1 1
create_atoms 1 single 1 2 1
create_atoms 1 single 9 9 9
create_atoms 1 single 9 9 8
create_atoms 1 single {} 9 9
set atom 1*3 mol 1
set atom 4*6 mol 2
pair_style zero 3
pair_coeff * *
velocity all create 300 4928
timestep {}
fix 1 all nosquish/{}
run 0
"""
NVT, NPT = "nvt molecule temp 300 300 {} ", "npt molecule temp 300 300 {} seed 5 iso 1 1 {}"


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("units", "dt", "fix", "says"),
    [
        ("real", 1.0, NVT.format(0.1) + "seed 5", "TDAMP 0.1 is 0.1 time steps of 1,"),
        ("real", 1.0, NVT.format(0.5) + "thermostat csvr seed 5", "TDAMP 0.5 is 0.5 time steps"),
        ("metal", 0.001, NVT.format(100) + "thermostat nh", "TDAMP 100 is 1e+05 time steps"),
        ("metal", 0.001, NPT.format(0.1, 1000), "PDAMP 1000 is 1e+06 time steps"),
        ("real", 1.0, NPT.format(100, 1), "the box changes 1 times in PDAMP"),
        ("real", 0.001, "nve molecule", "the time step is 0.001 fs: with units real, timestep is"),
        ("metal", 1.0, "nve molecule", "the time step is 1000 fs: with units metal, timestep is"),
        ("real", 1.0, NPT.format(100, 1000), ""),
        ("metal", 0.001, NPT.format(0.1, 1), ""),
    ],
)
def test_times_in_another_unit(run_lammps, units, dt, fix, says, ranks):
    """Locks out silence at a damping time or a time step that is 1,000 times off, as of fs for
    ps, and a warning of one that is right."""
    log = run_lammps(TIMES.format(units, 8, dt, fix), ranks=ranks).log
    warnings = re.findall("^WARNING: .*", log, re.M)
    assert any(says in line for line in warnings) if says else not warnings, warnings


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("edge", "words", "warned"), [(20, "", 0), (11, "", 1), (11, "torque 2 off off off", 0)]
)
def test_body_as_wide_as_the_box(run_lammps, edge, words, warned, ranks):
    """Locks out silence where a body meets its own images as it turns, and a warning where keyword
    torque keeps it from turning, as the warning advises."""
    text = TIMES.format("real", 15, 1.0, f"nve molecule {words}")
    text = text.replace("0 20 0 20 0 20", f"0 20 0 {edge} 0 20").replace("9 9 8", "3 9 9")
    log = run_lammps(text, ranks=ranks).log
    said = re.findall(r"body of molecule 2 is 12 wide, and the periodic box 11: where it", log)
    assert len(said) == warned, log[-900:]
