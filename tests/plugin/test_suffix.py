"""Unchanged scripts with LAMMPS's rigid fixes, run by ``lmp -sf nosquish``."""

import re
from itertools import pairwise

import numpy as np
import pytest

from support.builds import NUMBER
from support.running import read_thermo
from support.systems import AFTER, mixture, script

ON = ["-sf", "nosquish"]
STYLES = {  # what stands behind molecule
    "rigid": "",
    "rigid/nve": "",
    "rigid/nvt": "temp 1.25 1.5 0.75",
    "rigid/npt": "temp 1.25 1.5 0.75 iso 1.5 1.5 2.5",
    "rigid/nph": "iso 1.5 1.5 2.5",
}
# of 27 bodies: the inertia that fix rigid gives the box counts 6 x 27 + 3 degrees of freedom, ours
# 3 x 27, which three axes share; and fix rigid pushes it for half of the time
BOX = f"iso 1.5 1.5 {2.5 * np.sqrt(6 * 165 / 81):.17g} every 1"
LINE = (
    "id mol mass x y z xu yu zu vx vy vz fx fy fz ix iy iz tqx tqy tqz omegax omegay omegaz "
    "angmomx angmomy angmomz quatw quati quatj quatk inertiax inertiay inertiaz"
)
VALUES = LINE.split()
COLUMNS = " ".join(f"c_rl[{k}]" for k in range(1, len(VALUES) + 1))  # reduce of 4 Feb 2025 has no *
COMPUTES = f"""compute ke all ke/rigid 1
compute er all erotate/rigid 1
compute rl all rigid/local 1 {LINE}
compute sum all reduce sum {COLUMNS} inputs local
compute most all reduce max {COLUMNS} inputs local
"""
DUMP = "dump rl all local {} rows c_rl[*]\ndump_modify rl format float %.17g\n"
BODIES = "solid planar"  # no two moments of which are equal


def run_of(style, words=None, steps=20, **how):
    """The script of bodies with one of LAMMPS's rigid fixes."""
    words = STYLES.get(style, "") if words is None else words
    how = {"group": "bodies", "dt": 0.5, "every": 5, **how}
    fix = f"fix 1 {{group}} {style} molecule {words}"
    return script(mixture(BODIES), fix, steps, words="", **how)


@pytest.fixture
def on(run_lammps):
    """A function that runs a script with the suffix, or options in its place."""

    def run(text, options=ON, **how):
        return run_lammps(text, files=mixture(BODIES).files, options=options, **how)

    return run


def rows(path):
    """What a dump local has of its last step, in the order of the bodies' molecule-IDs."""
    text = path.read_text().rpartition("ITEM: ENTRIES")[2].partition("\n")[2]
    table = np.array([line.split() for line in text.splitlines()], float)
    return table[np.argsort(table[:, VALUES.index("mol")])]


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("style", ["rigid/nve", "rigid/nve/small"])
def test_the_trajectory_of_fix_rigid(on, tmp_path, style, ranks):
    """Locks out words, an order of axes or a step that are not those of the fix whose place is
    taken, and computes that say something else of it."""
    computes = COMPUTES if "small" in style else "".join(COMPUTES.splitlines(True)[:2])
    columns = "c_ke c_er" + " c_sum[*] c_most[*]" * ("small" in style)
    text = run_of(style, steps=40).replace("thermo_style custom", f"{computes}thermo_style custom")
    text = text.replace("pyz ", f"pyz {columns}")
    text = text.replace("run 40", (DUMP.format(20) if "small" in style else "") + "run 40")
    tables = []
    for options, n in ((), 1), (ON, ranks):
        run = on(text, options, ranks=n)
        assert (f"nosquish/nve replaces {style}\n" in run.log) == bool(options)
        tables.append((run.thermo, "small" in style and rows(tmp_path / "rows")))
    (theirs, of_theirs), (ours, of_ours) = tables
    for name in "PotEng", "TotEng", "c_ke", "c_er", "Temp":
        np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-9, err_msg=name)
    if "small" not in style:
        return
    for k, name in enumerate(VALUES):
        if name == "id":  # theirs is the atom nearest to the middle of the body
            continue
        mine, other = of_ours[:, k], of_theirs[:, k]
        if name.startswith("quat"):  # the axes may point the other way
            mine, other = abs(mine), abs(other)
            if name == "quatw":  # any of the four may be the scalar part
                every = slice(k, k + 4)
                turn = abs(of_ours[:, every]).max(axis=1) - abs(of_theirs[:, every]).max(axis=1)
                np.testing.assert_allclose(turn, 0.0, atol=1e-8)
            continue
        scale = max(np.abs(other).max(), 1e-300)
        np.testing.assert_allclose(mine / scale, other / scale, atol=1e-8, err_msg=name)


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("ending", ["", "/small", "/omp", "/small/omp", "/nosquish"])
@pytest.mark.parametrize("style", STYLES)
def test_each_style(on, style, ending, ranks):
    """Locks out a style of which the suffix makes another integrator, or none, with or without the
    endings that LAMMPS's styles have."""
    kind = {"rigid": "nve"}.get(style, style[-3:])
    words = {
        "nve": "order 123",
        "nvt": "temp 1.25 1.5 0.75 thermostat nh tchain 10 separate yes",
        "npt": f"temp 1.25 1.5 0.75 thermostat nh tchain 10 separate yes barostat mtk {BOX}",
        "nph": f"{BOX} order 123",
    }[kind]
    native = on(run_of(f"nosquish/{kind}", words), (), ranks=ranks).thermo
    options = () if ending == "/nosquish" else ON
    ours = on(run_of(style + ending, STYLES[style]), options, ranks=ranks).thermo
    np.testing.assert_allclose(ours["PotEng"], native["PotEng"], rtol=1e-9)
    assert np.ptp(ours["PotEng"]) > 0


def test_langevin(on):
    """Locks out keyword langevin that is not the thermostat of NVT, an f_ID that is not the
    temperature there, and its energy in econserve."""
    columns = "f_1 econserve"
    native = run_of("nosquish/nvt", "temp 1.5 1.25 0.75 seed 4928 order 123 rotor split")
    text = run_of("rigid/nve/small", "langevin 1.5 1.25 0.75 4928 rotor split", columns=columns)
    ours = on(text)
    np.testing.assert_array_equal(ours.thermo["PotEng"], on(native, ()).thermo["PotEng"])
    table = ours.thermo
    degrees = 6 * 27  # LAMMPS counts three less
    np.testing.assert_allclose(table["f_1"] * degrees, table["Temp"] * (degrees - 3), rtol=1e-9)
    np.testing.assert_array_equal(table["TotEng"], table["Econserve"])


@pytest.mark.parametrize("ranks", [1, 2])
def test_components_that_are_off(on, ranks):
    """Locks out an f_ID that counts the components of force and torque that fix rigid leaves
    out."""
    words = "force 1*5 off on off torque 3 off off off"
    text = run_of("rigid", words, columns="f_1")
    theirs = on(text.replace("run 20", "run 0"), ()).thermo["f_1"]
    ours = on(text.replace("run 20", "run 0"), ranks=ranks).thermo["f_1"]
    np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-9)
    plain = on(text.replace(words, "").replace("run 20", "run 0")).thermo["f_1"]
    assert abs(plain[0] / ours[0] - 1) > 1e-3


@pytest.mark.parametrize(
    "style, words",
    [
        ("rigid/nve", ""),
        ("rigid", "force * off off on"),
        ("rigid/nve/small", "langevin 1 1 1 5"),
        ("rigid/nvt", "temp 1 1 1"),
    ],
)
@pytest.mark.parametrize("ranks", [1, 2])
def test_asked_before_a_first_run(on, style, words, ranks):
    """Locks out a traceback where a script asks for f_ID before there are bodies."""
    run = on(run_of(style, words).replace("run 20", "print $(f_1)"), check=False, ranks=ranks)
    assert run.code and "there is nothing to tell of the bodies before" in run.screen
    assert "Traceback" not in run.screen


@pytest.mark.parametrize("pressure", ["iso 4 4 1", "x 4 4 1 y 4 4 1 couple xy"])
def test_period_of_the_box(on, pressure):
    """Locks out a PDAMP that gives the box another period than in fix rigid: both are released from
    a start at another pressure, and their volumes swing."""
    text = run_of("rigid/nph/small", pressure, steps=1000, columns="vol", every=10)
    theirs, ours = (on(text, options).thermo["Volume"] for options in ((), ON))

    turns = [volume[:100].argmin() for volume in (ours, theirs)]
    assert 0 < turns[1] < 90 and abs(turns[0] / turns[1] - 1) < 0.15


T, P, Q = STYLES["rigid/nvt"], "1.5 1.5 2.5", "1.0 1.0 2.5"
SAME = {  # words, others that mean the same, and lines behind the fix
    "couple behind iso": ("rigid/npt", f"{T} iso {P} couple xy", f"{T} aniso {P} couple xy"),
    "couple before iso": ("rigid/npt", f"{T} couple xy iso {P}", f"{T} iso {P}"),
    "couple none": ("rigid/nph", f"iso {P} couple none", f"aniso {P}"),
    "z behind aniso": ("rigid/nph", f"aniso {P} z {Q}", f"x {P} y {P} z {Q}"),
    "z before aniso": ("rigid/nph", f"z {Q} aniso {P}", f"aniso {P}"),
    "iso and aniso": ("rigid/nph", f"iso {P} aniso {Q}", f"iso {Q}"),
    "without a pressure": ("rigid/nvt", f"{T} dilate all couple none", T),
    "without anything": ("rigid", "dilate bodies couple none", ""),
    "a temperature": ("rigid/nvt", T, T, "compute t all temp\nfix_modify 1 temp t\n"),
}


@pytest.mark.parametrize("name", SAME)
def test_words_that_lammps_takes(on, name):
    """Locks out the refusal of words that LAMMPS's fix takes, or another meaning than there: with
    either words, both have the same motion."""
    style, words, same, *lines = SAME[name]
    for options in (), ON:
        text = run_of(style, words, columns="lx ly lz")
        text = text.replace("thermo_style", "".join([*lines, "thermo_style"]), 1)
        first, second = (
            on(one, options).thermo for one in (text, run_of(style, same, columns="lx ly lz"))
        )
        for column in "PotEng", "Lx", "Lz":
            np.testing.assert_allclose(first[column], second[column], rtol=1e-12)


def test_words_without_effect_are_named(on):
    """Locks out words that have no effect, without a line in the log."""
    log = on(run_of("rigid/nvt", f"{T} dilate all")).log
    assert "couple and dilate have no effect, as there" in log


def test_friction_alone(on):
    """Locks out the refusal of a temperature of zero: without forces bodies slow down as exp(-t /
    TDAMP)."""
    text = run_of("rigid/nve/small", "langevin 0 0 0.5 5", steps=40, columns="f_1")
    table = on(text.replace("fix 1", "pair_style zero 2\npair_coeff * *\nfix 1", 1)).thermo
    expected = np.exp(-2 * table["Step"] * 0.5 * mixture(BODIES).dt / 0.5)
    np.testing.assert_allclose(table["f_1"] / table["f_1"][0], expected, rtol=1e-9)


def test_pistons_of_several_periods(on):
    """Locks out one period for all axes where the fix line gives each its own: from a piston at
    rest, an axis begins to move as the inverse square of its PDAMP."""
    starts = []
    for slow in 2.5, 5.0:
        text = run_of("rigid/nph", f"x 9 9 2.5 y 9 9 {slow}", steps=4, every=2, dt=0.1,
                      columns="lx ly")  # fmt: skip
        starts.append([np.ptp(on(text).thermo[column]) for column in ("Lx", "Ly")])
    (x, y), (x_of_slow, y_of_slow) = starts
    assert x_of_slow == pytest.approx(x, rel=1e-3)
    assert y / y_of_slow == pytest.approx(4.0, rel=1e-3)


@pytest.mark.parametrize("ranks", [1, 2])
def test_piston_from_rest(on, ranks):
    """Locks out a run that ends because the bodies are at rest as it begins, with no temperature
    for the piston's inertia: fix langevin heats them. LAMMPS takes a temperature of 1 (lj)."""
    text = run_of("rigid/nph/small", "iso 0.5 0.5 2.5", steps=1000, columns="vol", every=10)
    heat = "velocity all set 0 0 0\nfix 9 all langevin 1.25 1.25 0.5 4928\nthermo_style"
    text = text.replace("thermo_style", heat, 1)
    theirs, ours = (on(text, options, ranks=ranks) for options in ((), ON))
    assert "inertia: it is that for a temperature of 1, as in fix rigid/nph" in ours.log
    for name, near in ("Temp", 0.3), ("Volume", 0.1):
        means = [run.thermo[name][40:].mean() for run in (theirs, ours)]
        assert means[1] == pytest.approx(means[0], rel=near), name


ZERO = "velocity all zero {} rigid 1\nrun 0\n"


@pytest.mark.quick
@pytest.mark.parametrize("words", ["", "reinit no"])
@pytest.mark.parametrize("motion", ["linear", "angular"])
@pytest.mark.parametrize("ranks", [1, 2])
def test_velocity_zero(on, motion, words, ranks):
    """Locks out a motion that goes on, or one that was not named and stops: LAMMPS calls methods
    of the fix that do nothing unless it has them."""
    text = run_of("rigid/nve", words, columns="c_ke c_er", after=ZERO.format(motion))
    text = text.replace("thermo_style", "".join(COMPUTES.splitlines(True)[:2]) + "thermo_style")
    table = on(text, ranks=ranks).thermo
    stopped, goes_on = ("c_ke", "c_er") if motion == "linear" else ("c_er", "c_ke")
    assert table[stopped][-1] < 1e-20 and table[stopped][-2] > 1
    np.testing.assert_allclose(table[goes_on][-1], table[goes_on][-2], rtol=1e-9)


@pytest.mark.parametrize("motion", ["linear", "angular"])
@pytest.mark.parametrize("style", ["rigid/nve", "rigid/nve/small"])
@pytest.mark.parametrize("ranks", [1, 2])
def test_velocity_zero_before_a_run(on, motion, style, ranks):
    """Locks out velocities that are written where nothing points yet: LAMMPS crashed where the
    command came before a first run. (Its own fix stops both motions there, or crashes.)"""
    text = run_of(style, columns="c_ke c_er", steps=0)
    text = text.replace("thermo_style", "".join(COMPUTES.splitlines(True)[:2]) + "thermo_style")
    moving = on(text, ranks=ranks).thermo[0]
    still = on(text.replace("run 0", ZERO.format(motion)), ranks=ranks).thermo[0]
    stopped, goes_on = ("c_ke", "c_er") if motion == "linear" else ("c_er", "c_ke")
    assert still[stopped] < 1e-20 and moving[stopped] > 1
    np.testing.assert_allclose(still[goes_on], moving[goes_on], rtol=1e-9)


def test_defined_again(on):
    """Locks out a style whose name is not the one under which LAMMPS looks a fix of the same ID
    up."""
    fix = "fix 1 bodies rigid/nve molecule"
    text = run_of("rigid/nve")
    again = on(text.replace(fix, f"{fix}\n{fix}")).thermo["PotEng"]
    np.testing.assert_array_equal(again, on(text).thermo["PotEng"])


TEMPER = """
log           log.$w
variable      T world 1.0 3.0
pair_style    zero 1.0
pair_coeff    * *
fix           1 bodies {}
thermo_style  custom step temp
thermo        10
timestep      0.01
{}        2000 500 $T 1 3847 58728{}
"""


@pytest.mark.parametrize(
    "command, pressure, words",
    [
        ("temper", "", "rigid/nvt/small molecule temp $T $T 0.2"),
        ("temper", "", "rigid/nvt molecule temp $T $T 0.2"),
        ("temper/npt", " 0.1", "rigid/npt molecule temp $T $T 0.2 iso 0.1 0.1 1000.0"),
    ],
)
def test_temper(on, tmp_path, command, pressure, words):
    """Locks out temperatures that command temper swaps in its log only: the thermostat has to take
    over the new one. Without forces each swap is accepted."""
    text = TEMPER.format(words, command, pressure)
    text = f"variable w world 1 2\n{mixture(BODIES).setup}{text}"
    options = [*ON, "-partition", "2x1", "-log", "log.both"]
    on(text, options, ranks=2, launcher="lmp")
    swaps = re.findall(r"^ *(\d+) +(\d) +(\d) *$", (tmp_path / "log.both").read_text(), flags=re.M)
    assert len({row[1:] for row in swaps}) == 2
    for world in 0, 1:
        table = read_thermo((tmp_path / f"log.{world + 1}").read_text())
        for (first, *held), (last, *_) in pairwise(swaps):
            inside = (table["Step"] > int(first) + 200) & (table["Step"] <= int(last))
            expected = (1.0, 3.0)[int(held[world])]
            assert abs(table["Temp"][inside].mean() / expected - 1) < 0.25


FORMS = {
    "quoted": 'python/move "fix_nosquish.NVT bodies molecule {}"',
    "native": "nosquish/nvt molecule {}",
    "suffix": "rigid/nvt molecule temp 1.25 1.25 0.75",
    "explicit": "rigid/nvt/small/nosquish molecule temp 1.25 1.25 0.75",
}
CHAINS = "temp 1.25 1.25 0.75 thermostat nh tchain 10 separate yes"


def of_form(name, steps, after="", before=""):
    text = run_of("rigid/nvt", "", steps, after=after)
    line = "fix 1 bodies " + FORMS[name].format(CHAINS)
    text = text.replace("fix 1 bodies rigid/nvt molecule ", line)
    if before:
        text = f"{before}\n{AFTER}\n" + text.split("group bodies", 1)[1].split("\n", 1)[1]
    return text, ON if name == "suffix" else ()


@pytest.mark.parametrize("second", FORMS)
@pytest.mark.parametrize("first", FORMS)
def test_state_of_another_form(on, first, second):
    """Locks out a thermostat that begins anew where the fix line before the restart had another
    form."""
    text, options = of_form(first, 40)
    whole = on(text, options).thermo["PotEng"][-1]
    text, options = of_form(first, 20, "write_restart half")
    on(text, options)
    text, options = of_form(second, 20, before="read_restart half")
    run = on(text, options)
    np.testing.assert_allclose(run.thermo["PotEng"][-1], whole, rtol=1e-10)


def test_state_of_lammps_own(on):
    """Locks out the state of LAMMPS's own fix that ours takes for its own, and ours that LAMMPS's
    takes: with the suffix on, both have the same name in restart files."""
    theirs = run_of("rigid/nvt", "temp 1.25 1.25 0.75", after="write_restart half")
    on(theirs, ())
    text, options = of_form("suffix", 20, before="read_restart half")
    run = on(text, options)
    assert "a state for this ID that this fix did not write" in run.log
    text, options = of_form("suffix", 20, "write_restart half")
    on(text, options)
    continued, _ = of_form("suffix", 20, before="read_restart half")
    chained = on(continued, ()).thermo["PotEng"]
    anew = continued.replace("read_restart half", "read_restart plain")
    on(text.replace("write_restart half", "unfix 1\nwrite_restart plain"), options)
    np.testing.assert_allclose(chained, on(anew, ()).thermo["PotEng"], rtol=1e-12)


REFUSED = {
    "LAMMPS's compute on ours": (
        "suffix off\ncompute 7 all {} 1\nsuffix on\n",
        "rigid/nve/small",
        "is LAMMPS's own, which works only with LAMMPS's own rigid fixes",
    ),
    "ours on LAMMPS's": (
        "compute 7 all {}/nosquish 1\nsuffix off\nunfix 1\nfix 1 bodies rigid/nve/small molecule\n",
        "rigid/nve/small",
        "is no fix of fix_nosquish",
    ),
}


@pytest.mark.parametrize("compute", ["ke/rigid", "erotate/rigid", "rigid/local"])
@pytest.mark.parametrize("what", REFUSED)
def test_computes_of_the_other(on, tmp_path, what, compute):
    """Locks out LAMMPS's computes on our fix, which they would take for their own class without a
    look, and ours on LAMMPS's."""
    lines, style, says = REFUSED[what]
    lines = lines.format(compute)
    if compute == "rigid/local":
        if NUMBER < 20250204 and "ours on" not in what:
            pytest.skip("LAMMPS's compute rigid/local of this version crashes")
        says = says if "ours on" in what else "does not point to fix rigid/small"  # LAMMPS's words
        lines = re.sub(r"(compute 7 .*)", r"\1 id mass", lines)
    text = run_of(style).replace("thermo_style custom", f"{lines}thermo_style custom", 1)
    run = on(text, check=False)
    assert run.code and says in run.screen.replace("\n", " "), run.screen[-2000:]


@pytest.mark.skipif(NUMBER < 20250722, reason="this LAMMPS has no fix hmc")
def test_hmc_of_lammps(on):
    """Locks out LAMMPS's fix hmc, which takes each fix rigid/small for its own class."""
    line = "fix 2 all hmc 10 4928 1.0 rigid 1\n"
    text = run_of("rigid/nve/small").replace("thermo_style custom", f"{line}thermo_style custom", 1)
    run = on(text, check=False)
    assert run.code and "does not point to fix rigid/small" in run.screen


@pytest.mark.parametrize("ranks", [1, 2])
def test_infile_of_custom(on, tmp_path, ranks):
    """Locks out an infile whose bodies are taken by their values, where fix rigid with style custom
    counts them from the smallest one; one that is written so, too."""
    system = mixture(BODIES)
    values = "".join(f"{k} {10 + m}\n" for k, m in enumerate(system.molecule, 1))
    (tmp_path / "values").write_text(f"{len(system.molecule)}\n{values}")
    own = (
        "fix p all property/atom i_own ghost yes\nvariable own atomfile values\n"
        "set atom * i_own v_own"
    )
    columns = [f"f_1[2][{k}]" for k in (1, 2, 3, 13, 14, 15, 4)]
    how = {"before": own, "steps": 0, "columns": " ".join(columns)}
    text = run_of("rigid/nve", "", **how).replace("molecule \n", "custom i_own\n")
    result = on(text).thermo[0]
    x, image = ([f"{result[c]:.17g}" for c in some] for some in (columns[:3], columns[3:6]))
    row = f"2 50.0 {' '.join(x)} 9 10 11 0 0 0 0.5 0 0 0 0 0 {' '.join(image)}\n"
    (tmp_path / "in.bodies").write_text("1\n" + row)
    text = text.replace("custom i_own", "custom i_own infile in.bodies")
    text = text.replace("run 0", "run 0\nwrite_restart left")
    speeds, written = [], []
    for options in (), ON:
        speeds.append(on(text, options, ranks=ranks).thermo[columns[-1]][0])
        lines = [line.split() for line in (tmp_path / "left.rigid").read_text().splitlines()]
        written.append(sorted(int(words[0]) for words in lines if len(words) == 20))
    assert speeds == [0.5, 0.5] and written[0] == written[1] == list(range(1, 28))


BAD = {
    "tparam": ("rigid/nve", "tparam 5 1 3", "unknown keyword 'tparam'"),
    "langevin": ("rigid/nvt", "temp 1 1 1 langevin 1 1 1 5", "unknown keyword 'langevin'"),
    "number": ("rigid/nvt", "temp 1 1 1 tparam 0 1 3", "word 11 of"),
    "no temp": ("rigid/nvt", "", "keyword temp is missing"),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_words(on, what):
    """Locks out words that are read over, and errors that do not say which fix and word."""
    style, words, says = BAD[what]
    run = on(run_of(style, words), check=False)
    assert run.code and says in run.screen and f"Fix 1 {style}/nosquish: " in run.screen


def test_box_of_the_suffix_moves_in_each_step(on):
    """Locks out a box that leaves the path of fix rigid's at the start of a run far from its
    pressure, because it moves in one of many steps, as our own does by default."""
    words = "temp 1.25 1.25 0.75 iso 20 20 2.5"
    text = run_of("rigid/npt/small", words, 40, every=1, columns="vol")
    theirs, ours = (on(text, options).thermo["Volume"] for options in ((), ON))
    assert np.ptp(theirs) > 1e-3 * theirs[0]
    assert np.abs(ours - theirs).max() < 0.05 * np.ptp(theirs)


@pytest.mark.parametrize("pressure", ["iso 1 1 1", "x 1 1 1 y 1 1 1 couple xy"])
def test_box_far_from_its_pressure(run_lammps, pressure):
    """Locks out a chain on the piston that brakes it more than that of fix rigid: a gas under
    pressure became a liquid in twice the time."""
    system = mixture(BODIES, spacing=5)
    fix = f"fix 1 {{group}} rigid/npt/small molecule temp 1.25 1.25 5 {pressure}"
    text = script(system, fix, 240, words="", group="bodies", dt=1.0, every=40, columns="vol")
    theirs, ours = (
        run_lammps(text, files=system.files, options=options).thermo["Volume"]
        for options in ((), ON)
    )
    assert theirs[-1] < 0.4 * theirs[0]
    np.testing.assert_allclose(ours, theirs, rtol=0.03)


@pytest.mark.parametrize(
    "style, words, says, source",
    [
        ("rigid/npt", "temp 1 1 1 iso 1 1 1", True, None),
        ("rigid/npt", "temp 1 2 1 iso 1 1 1", False, "the higher of TSTART and TSTOP"),
        (
            "rigid/npt",
            "temp 1 1 1 iso 1 1 1 barostat crescale seed 5 compressibility 1",
            False,
            None,
        ),
        ("rigid/nph", "iso 1 1 1", False, "the bodies' first temperature"),
        ("rigid/nph", "iso 1 1 1 langevin 1 1 1 5", False, "the higher of TSTART and TSTOP"),
        ("rigid/nvt", "temp 1 2 1", False, None),
    ],
)
def test_period_that_the_log_promises(on, style, words, says, source):
    """Locks out the promise of the same period where the inertia of LAMMPS's piston follows from
    another temperature than ours."""
    log = on(run_of(style, words, steps=0)).log
    assert ("the period of the box with this PDAMP" in log) == says
    assert ("the piston's inertia follows from" in log) == bool(source)
    assert not source or f"follows from {source}" in log
