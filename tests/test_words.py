"""Words that act: each keyword of our fixes, of LAMMPS's rigid fixes, and of the commands
``*_modify`` that can stand beside them, has its effect here or its answer.

An effect is what LAMMPS's own fix makes of the same word, or a number that is known.  The tables
are complete: a word that our fixes get needs a row.
"""

import re
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest
from conftest import read_thermo
from systems import RIGID, SMALL, apart, mixture
from test_fire import FORCES, atoms
from test_insertion import DEPOSIT, MASSES, MOLECULE, SCRIPT, THEIRS
from test_keywords import rows_of, text_of, unlike_its_atoms, with_file
from test_native import STYLES
from test_nvt import FREE, SMOOTH
from test_output import read

from fix_nosquish import of_style
from fix_nosquish.errors import RunError
from fix_nosquish.host import command
from fix_nosquish.host.command import Command, Line
from validation.scenes.boxes import nearest

BODIES = mixture("solid planar", temperature=3.0)
TILTED = mixture("solid planar", tilt=0.2)
GRAVITY = "fix g all gravity 2.0 vector 1 -1 0.5"
LIKE_LAMMPS = "fix 1 {group} nosquish/nve {words} order 123"


def fix(style, words="", needs=None):
    """The line of a fix with the words that its style needs, and these."""
    return f"fix 1 {{group}} nosquish/{style} {{words}} {needs or STYLES[style]} {words}"


def alike(ours, theirs, system=BODIES, tolerance=1e-9):
    """Whether two Results are the same to rounding: places, velocities, temperature, energy."""
    close = partial(np.allclose, rtol=tolerance, atol=tolerance * np.abs(theirs.v).max())
    return (
        apart(ours, theirs, system.h) < tolerance * np.abs(theirs.x).max()
        and close(ours.v, theirs.v)
        and all(close(ours.thermo[name], theirs.thermo[name]) for name in ("Temp", "PotEng"))
    )


# ---------------------------------------------------------------- the keywords of our fixes

ACTS = {}  # entry in the tables of keywords: what asserts that it acts


class Tools(NamedTuple):
    """What a check may use."""

    simulate: object
    run_lammps: object
    folder: object

    def run(self, line, steps=20, system=BODIES, every=1, **how):
        """The Result of bodies with this fix."""
        return self.simulate(system, line, steps, every=every, **how)


@pytest.fixture
def tools(simulate, run_lammps, tmp_path):
    return Tools(simulate, run_lammps, tmp_path)


def acts(*entries):
    """Decorator of a check, a function of `Tools`, that asserts that these keywords act."""

    def note(check):
        ACTS.update(dict.fromkeys(entries, check))
        return check

    return note


def as_with(theirs, words, system=BODIES, **how):
    """A check: as LAMMPS's fix with the same words, and not as without them."""

    def check(tools):
        ours, other, without = (
            tools.run(line, system=system, words=f"molecule {more}", **how)
            for line, more in ((LIKE_LAMMPS, words), (theirs, words), (LIKE_LAMMPS, ""))
        )
        assert alike(ours, other, system) and not alike(ours, without, system)

    return check


ACTS["force"] = as_with(RIGID, "force 3 off on off force 4*9 on off off")
ACTS["torque"] = as_with(RIGID, "torque * off on on")
ACTS["reinit"] = as_with(RIGID, "reinit no", after="velocity all scale 2.0\nrun 20")
ACTS["gravity"] = as_with(SMALL, "gravity g", before=f"{GRAVITY} disable")


@acts("infile")
def infile(tools):
    rows = unlike_its_atoms(rows_of(BODIES, tools.run("", 0)))
    as_with(RIGID, "infile bodies", with_file(BODIES, text_of(rows)))(tools)


@acts("mrot", "rotor")
def splitting_of_the_rotation(tools):
    one, four, many, exact = (
        tools.run(fix("nve", words), 50, dt=2) for words in ("", "mrot 4", "mrot 64", "rotor exact")
    )
    errors = [apart(run, exact, BODIES.h) for run in (one, four, many)]
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.1)
    assert errors[2] < 1e-3 * errors[0]


@acts("order")
def order(tools):
    theirs = tools.run(RIGID)
    assert alike(tools.run(fix("nve", "order 123")), theirs)
    assert not alike(tools.run(fix("nve")), theirs)


@acts("output")
def output(tools):
    tools.run(fix("nve", "output 5 table"), words="molecule  ")  # no other test has run this
    assert [*np.unique(read(tools.folder / "table")["step"])] == [0, 5, 10, 15, 20]


@acts("points")
def points(tools):
    system = mixture("solid planar single")
    theirs = tools.run(RIGID, system=system)  # and fix nve
    ours = fix("nve", "points single order 123")
    assert alike(tools.run(ours, system=system._replace(singles=False)), theirs, system)


@acts("mol")
def mol(tools):
    left = []
    for line in fix("nve", "mol bent order 123").format(group="mols", words="molecule"), THEIRS:
        text = SCRIPT.format(
            fix=line, changes=DEPOSIT, style="molecular", edge=8, masses=MASSES, first="",
            run="run 100",
        )  # fmt: skip
        left.append(tools.run_lammps(text, files={"mol.bent": MOLECULE}).thermo)
    for name in "Atoms", "PotEng":
        np.testing.assert_allclose(left[0][name], left[1][name], rtol=1e-9)
    assert left[0]["Atoms"][-1] == 36


# ---- thermostats


@acts("temp")
def temp(tools):
    line = fix("nvt", needs="temp 1.0 4.0 0.008 seed 7 thermostat csvr")
    table = tools.run(line, 400, columns="f_1[3] f_1[4]", every=10).thermo
    found, asked = table["f_1[3]"] + table["f_1[4]"], 2 * (1 + 3 * table["Step"] / 400)
    # of 162 degrees of freedom, over 10 independent samples each
    for part in slice(10, 20), slice(20, 30), slice(30, 41):
        assert found[part].mean() == pytest.approx(asked[part].mean(), rel=0.12)


@acts("thermostat")
def thermostat(tools):
    for name in command.THERMOSTATS:
        seed = "" if name == "nh" else "seed 7"
        line = fix("nvt", needs=f"temp 0.5 0.5 0.02 {seed} thermostat {name}")
        table = tools.run(line, 100, columns="econserve f_1").thermo
        assert table["Temp"][0] > 2.0 and table["Temp"][50:].mean() < 1.0, name
        assert np.ptp(table["f_1"]) > 100 * np.ptp(table["Econserve"]), name


@acts("seed")
def seed(tools):
    needs = "temp 1.25 1.5 0.75 seed {}"
    one, again, other = (
        tools.run(fix("nvt", needs=needs.format(number)), before=before)
        for number, before in ((1, ""), (1, "# again"), (2, ""))
    )
    assert np.array_equal(one.x, again.x) and not alike(one, other)


@acts("tchain")
def tchain(tools):
    runs = [
        tools.run(fix("nvt", f"tchain {n}", "temp 1 1 0.1 thermostat nh"), 50, columns="econserve")
        for n in (1, 3)
    ]
    assert not alike(*runs)
    for run in runs:
        assert np.ptp(run.thermo["Econserve"]) < 0.05 * np.ptp(run.thermo["TotEng"])


@acts("separate")
def separate(tools):
    for value, same in ("no", True), ("yes", False):
        needs = f"temp 1 1 0.02 seed 5 thermostat csvr separate {value}"
        table = tools.run(fix("nvt", needs=needs), before=FREE, columns="f_1[1] f_1[2]").thermo
        assert bool(np.ptp(table["f_1[2]"] / table["f_1[1]"]) < 1e-9) is same


@acts("moments")
def moments(tools):
    def turned(words, steps, dt):
        line = fix("nvt", words, "temp 1 1 1e9 thermostat nh")
        x = tools.run(line, steps, before=FREE, dt=dt).x
        first = np.array([np.argmax(BODIES.molecule == body) for body in BODIES.molecule])
        return nearest(x - x[first], BODIES.h)

    # the same energy of rotation: with four times the moments half the angular velocity
    fast, slow, long = turned("", 20, 0.5), turned("moments scale 4", 20, 1), turned("", 20, 1)
    np.testing.assert_allclose(slow, fast, atol=1e-6)
    assert np.abs(slow - long).max() > 1e-2
    equal, step = (
        tools.run(fix("nvt", f"moments {words}"), 0).log for words in ("equal 7", "step")
    )
    assert re.search(r"moments.* 7", equal) and "moments" in step


# ---- boxes

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


def pressure(tools, word):
    system = TILTED if word in ("tri", *command.TILTS) else BODIES
    columns = "lx ly lz xy xz yz" if system is TILTED else "lx ly lz"
    needs = f"{word} {PULLED} every 1"
    table = tools.run(fix("nph", needs=needs), system=system, columns=columns).thermo
    changes, same = STRETCHED[word]
    moved = {name for name in columns.title().split() if np.ptp(table[name]) > 1e-9}
    assert moved == set(changes.split())
    assert np.ptp([table[name][-1] / table[name][0] for name in same.split()] or [0]) < 1e-12


ACTS.update({word: partial(pressure, word=word) for word in STRETCHED})


@acts("couple")
def couple(tools):
    for value in command.COUPLES:
        needs = f"aniso {PULLED} every 1 couple {value}"
        table = tools.run(fix("nph", needs=needs), columns="lx ly lz").thermo
        ratio = {axis: table[f"L{axis}"][-1] / table[f"L{axis}"][0] for axis in "xyz"}
        for one, other in "xy", "yz", "xz":
            together = one in value and other in value and value != "none"
            assert bool(abs(ratio[one] - ratio[other]) < 1e-12) is together, value


@acts("every")
def every(tools):
    table = tools.run(fix("nph", needs=f"iso {PULLED} every 5"), columns="vol").thermo
    changed = table["Step"][1:][np.diff(table["Volume"]) != 0]
    assert [*changed] == [1, 6, 11, 16]


@acts("dilate")
def dilate(tools):
    before = "group bodies clear\ngroup bodies molecule <= 26\ngroup rest molecule 27"
    line = fix("nph", "dilate rest", f"iso {PULLED} every 1")
    start, end = (tools.run(line, n, before=before, columns="lx") for n in (0, 20))
    mine = BODIES.molecule == 27
    factor = end.thermo["Lx"][-1] / end.thermo["Lx"][0]
    centre = BODIES.h.sum(axis=1) / 2
    expected = centre + factor * (start.x[mine] - centre)
    assert abs(factor - 1) > 1e-6
    np.testing.assert_allclose(nearest(end.x[mine] - expected, factor * BODIES.h), 0, atol=1e-9)


@acts("barostat")
def barostat(tools):
    needs = f"temp 1 1 0.5 seed 5 iso {PULLED} every 1 thermostat csvr barostat {{}}"
    first = {}
    for name in "mtk", "crescale compressibility 0.01":
        table = tools.run(fix("npt", needs=needs.format(name)), columns="vol").thermo
        change = np.abs(np.diff(np.log(table["Volume"])))
        first[name.split()[0]] = change[0] / change.max()
    # a piston starts from rest; the other one goes at random from the first step on
    print(first)
    assert first["mtk"] < 0.1 < first["crescale"]


@acts("compressibility")
def compressibility(tools):
    changes = []
    for value in 1e-10, 4e-10:
        needs = f"temp 1 1 0.5 seed 5 iso {PULLED} every 1 compressibility {value}"
        table = tools.run(fix("npt", needs=needs), 1, columns="vol").thermo
        changes.append(np.diff(np.log(table["Volume"]))[0])
    # noise goes as the root, and is nearly all of it where the number is small
    assert changes[1] / changes[0] == pytest.approx(2, rel=0.01)


# ---- hybrid Monte Carlo


def drawn(tools, needs, steps, **how):
    """A run of free bodies, whose momenta change only where they are drawn."""
    return tools.run(fix("hmc", needs=needs), steps, before=FREE, columns="f_1", **how)


@acts("temp T")
def temperature_of_trajectories(tools):
    found = drawn(tools, "temp 2 steps 1 seed 5", 40).thermo["f_1"][1:]
    assert found.mean() == pytest.approx(2, rel=0.06)


@acts("steps")
def steps_of_trajectories(tools):
    table = drawn(tools, "temp 2 steps 5 seed 5", 20).thermo
    new = table["Step"][1:][np.abs(np.diff(table["f_1"])) > 1e-6]
    assert [*new] == [1, 6, 11, 16]


@acts("mix")
def mix(tools):
    for value in 0.19, 1.0:
        needs = f"temp 2 steps 1 seed 5 mix {value}"
        one, two = (drawn(tools, needs, n).v * np.sqrt(BODIES.mass)[:, None] for n in (5, 6))
        kept = (one * two).sum() / np.linalg.norm(one) / np.linalg.norm(two)
        assert kept == pytest.approx(np.sqrt(1 - value), abs=0.2)


# ---- quenches


@acts("force FTOL", "torque TTOL")
def tolerances(tools):
    system, ends = mixture("solid planar", side=2, spacing=2.9), {}
    for force, torque in ("1e-2", "1e9"), ("1e9", "1e-2"), ("1e-4", "1e-4"):
        line = fix("fire", needs=f"force {force} torque {torque}")
        how = {"before": SMOOTH, "columns": "f_1[5] f_1[6]", "system": system}
        table = tools.run(line, 10000, **how).thermo
        least = np.array([float(force), float(torque)])
        norms = np.stack([table["f_1[5]"], table["f_1[6]"]], axis=1)
        assert (norms[-1] <= least).all() and (norms[1:-2] > least).any(axis=1).all()
        ends[force, torque] = table["Step"][-1]
    assert max(ends.values()) == ends["1e-4", "1e-4"] < 10000


@acts("dmax")
def dmax(tools):
    system = mixture("single", side=3, spacing=1.15)._replace(singles=False, group="all")
    needs, moved = "force 1e-9 torque 1e-9 dmax {}", "displace_atoms all random 0.1 0.1 0.1 8"
    for most, least in (1e-6, 1e-6), (1.0, 1e-5):
        start, end = (
            tools.run(
                fix("fire", needs=needs.format(most)), n, system=system, before=SMOOTH + moved
            )
            for n in (0, 1)
        )
        far = np.linalg.norm(nearest(end.x - start.x, system.h), axis=1).max()
        assert far <= most * (1 + 1e-6) and far >= least * (1 - 1e-6)


WAY = {  # words of min_modify, and the same here
    **{"tmax": "2", "tmin": "1", "dtgrow": "1.4", "dtshrink": "0.8", "alpha0": "0.1"},
    **{"alphashrink": "0.5", "delaystep": "3"},
}
# so that each comes to act, and points go as there
OTHERS = {"dmax": "10", "delaystep": "5", "tmax": "8", "tmin": "1e-2", "dtshrink": "0.1"}
OTHERS["halfstepback"] = "no"


def way_of_a_quench(tools, word):
    system = mixture("single", side=4, spacing=1.15)
    start = f"clear\n{system.setup}\n{SMOOTH}mass * 1\ndisplace_atoms all random 0.1 0.1 0.1 8\n"
    text = ""
    for name, some in ("with", OTHERS | {word: WAY[word]}), ("without", OTHERS):
        words = " ".join(f"{word} {value}" for word, value in some.items())
        ours = fix("fire", needs=f"force 1e-13 torque 1e-13 {words}")
        text += f"{start}timestep 0.002\n{ours.format(group='all', words='molecule')}\nrun 150\n"
        text += FORCES.format(f"ours.{name}")
        text += (
            f"{start}timestep 0.002\nmin_style fire\nmin_modify {words}\nminimize 0 0 150 9999\n"
        )
        text += FORCES.format(f"theirs.{name}")
    tools.run_lammps(text, files=system.files)
    ours, theirs, plain = (
        atoms(tools.folder / name)[2] for name in ("ours.with", "theirs.with", "ours.without")
    )
    assert np.abs(nearest(ours - theirs, system.h)).max() < 1e-9
    assert np.abs(nearest(ours - plain, system.h)).max() > 1e-6


ACTS.update({word: partial(way_of_a_quench, word=word) for word in WAY})

WELL = """units lj
atom_modify map array
region box block -5 5 -5 5 -5 5
create_box 1 box
create_atoms 1 single 0 0 0
mass 1 1
pair_style zero 2
pair_coeff * *
fix 2 all spring/self 1
displace_atoms all move 1 0 0
timestep 0.2
variable x equal x[1]
fix 1 all nosquish/fire single force 1e-6 torque 1 dmax 9 delaystep 1 halfstepback {}
thermo_style custom step v_x f_1[7]
thermo_modify format float %.16g
thermo 1
run 20
"""


@acts("halfstepback")
def halfstepback(tools):
    for word, part in ("yes", 0.5), ("no", 0.0):
        table = tools.run_lammps(WELL.format(word)).thermo
        x, dt = table["v_x"], table["f_1[7]"]
        back = next(n for n in range(2, 20) if (x[n] - x[n - 1]) * x[n] > 0)
        v = (x[back] - x[back - 1]) / dt[back]
        expected = x[back] - part * dt[back + 1] * v - dt[back + 1] ** 2 * x[back]
        assert x[back + 1] == pytest.approx(expected, rel=1e-9), word


@pytest.mark.parametrize("entry", ACTS)
def test_keyword_acts(tools, entry):
    """Locks out a keyword that is read and forgotten."""
    ACTS[entry](tools)


def entries(style):
    """The keywords of a style, to their entries in the tables of keywords."""
    own = of_style(f"nosquish/{style}").keywords
    return {entry.split()[0]: entry for entry in (*command.KEYWORDS, *own)}


def test_each_keyword_has_a_row():
    """Locks out a keyword of our fixes that no row of this file knows, and a row of one that is
    gone."""
    assert {entry for style in STYLES for entry in entries(style).values()} == set(ACTS)


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
        "it is a word of fix_modify, behind this fix",
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
OLD = "neighbor 0.4 multi/old\ncomm_modify mode multi/old"
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
        found = [
            re.findall(
                row.shows,
                (tmp_path / f"{row.file}.{name}").read_text() if row.file else logs[name],
                re.M,
            )
            for name in ("ours", "without")
        ]
        assert found[0] != found[1] and (found[0] or word == "warn")
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
