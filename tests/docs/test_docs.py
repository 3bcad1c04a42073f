"""The documentation: what it quotes is what the programs print."""

import ast
import importlib
import re
import subprocess
from types import SimpleNamespace

import committed
import numpy as np
import pytest

from fix_nosquish import INTEGRATORS
from fix_nosquish.errors import RunError
from fix_nosquish.host.command import Command, Line
from support.running import ROOT
from validation.sample.observables import BY_KEY

DOCS = ROOT / "docs"
PAGES = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
PAGES += sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)


def blocks(text):
    """The fenced blocks of a page: (language, caption, content)."""
    fence = r"^```(?:\{code-block\} )?(\w+)\n(?::caption: (\S+)\n)?(.*?)^```$"
    return re.findall(fence, text, re.M | re.S)


def files(text):
    """From name to content of the files that a page shows, of one or more blocks each."""
    results = {}
    for _, name, content in blocks(text):
        results[name] = results.get(name, "") + content
    return results


# ---- the README and the results


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
@pytest.mark.quick("README.md")
def test_pages_have_the_committed_results(path):
    """Locks out a number or a table on a page that the committed results do not give, and one that
    lost its rows, as where a name in the results has changed."""
    text = path.read_text()
    assert committed.filled(text) == text, "run: python docs/_ext/committed.py"
    assert text.count("<!-- results:") == len(committed.MARKS.findall(text))
    for _, words, _ in committed.MARKS.findall(text):
        assert re.search(rf"results: {re.escape(words)} -->\n\n\S", text), words
    heads = re.findall(r"^(\|.*\|)\n\|(?:---\|)+\n(\||.*)", text, re.M)
    assert all(first == "|" for _, first in heads)


def test_ci_finds_the_test_command():
    """Locks out a README without the one command that .ci/run takes from it."""
    taken = re.search(r"sed -n '(.*)' README.md", (ROOT / ".ci/run").read_text())[1]
    result = subprocess.run(
        ["sed", "-n", taken, ROOT / "README.md"], capture_output=True, text=True
    )
    assert len(result.stdout.splitlines()) == 1, result.stdout


def without_code(path):
    """The text of a page but its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", path.read_text(), flags=re.M | re.S)


def anchors(path):
    """The anchors of a page's headings on GitHub, which Sphinx has, too."""
    titles = re.findall(r"^#+ +(.*?) *$", without_code(path), re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_to_files_and_headings(path):
    """Locks out links and figures that are not there: Sphinx does not see those of the README, and
    GitHub has no anchors but those of headings."""
    for target, anchor in re.findall(r"\]\(([^)#:\s]*)(?:#([^)]*))?\)", without_code(path)):
        page = path.parent / target if target else path
        assert page.exists(), target
        assert not anchor or anchor in anchors(page), f"{target}#{anchor}"


# ---- the fix


def test_each_keyword_is_on_its_page(run_lammps):
    """Locks out a keyword without its place there: the refusal of an unknown one names all.  What
    only NVT or NPT has is on its page."""
    script = files((DOCS / "tutorial.md").read_text())
    setup = script["in.build"].replace("write_data      data.co2 nocoeff", "")
    known = []
    pages = (
        ("NVE", "fix.md", 6), ("NVT", "fix-nvt.md", 4), ("NPT", "fix-npt.md", 7),
        ("HMC", "fix-hmc.md", 1),
    )  # fmt: skip
    for name, page, least in pages:
        line = f'fix 1 all python/move "fix_nosquish.{name} all molecule nonsense 1"\n'
        run = run_lammps(setup + line, files={"co2.txt": script["co2.txt"]}, check=False)
        keywords = re.search(r"unknown keyword 'nonsense': expected ([\w, ]*\w)", run.screen)[1]
        new = [word for word in keywords.split(", ") if word not in known]
        text = (DOCS / page).read_text()
        assert len(new) > least
        for word in new:
            assert re.search(rf"^\| [^|]*\[`{word}`\]\(#[\w-]+\)[^|]* \|", text, re.M), word
            assert re.search(rf"^### .*\b{word}\b", text, re.M), word
            assert word in text.split("## Default")[1], word
        known += new


def fix_lines(text):
    """The lines of native styles that a text shows, also in the middle of a sentence."""
    text = re.sub(r"&\n *", "", text)
    return re.findall(r"fix +\w+ +\w+ +nosquish/\w+[^`#\n]*", text)


LISTINGS = re.compile(r"<!-- results: listing .*?<!-- end", re.S)  # of files, which run elsewhere
SHOWN = {
    path.relative_to(ROOT).as_posix(): fix_lines(LISTINGS.sub("", path.read_text()))
    for path in PAGES
}
SHOWN["docstrings"] = [
    line for path in (ROOT / "fix_nosquish").rglob("*.py") for line in fix_lines(path.read_text())
]
PATTERN = re.compile(r"fix +ID +group ", re.I)  # with places for the user's words: it does not run
# all that the lines name, in water without charges
SCENE = (
    """units real
atom_style full
read_data data.water
change_box all triclinic
group far molecule > 100
delete_atoms group far
fix prop all property/atom i_body
variable molecule atom mol
variable own_body atom mol
set group all i_body v_molecule
molecule benzene one.mol
variable T equal 298.15
variable factor equal 4.0
pair_style lj/cut 8.0
pair_coeff * * 0.1 3.0
bond_style zero
bond_coeff *
angle_style zero
angle_coeff *
special_bonds lj/coul 0 0 0
group rigid molecule <= 50
group rest subtract all rigid
group own_rest empty
group solute empty
group tip molecule 1
group substrate molecule 2
velocity all create 298 4928 loop geom
timestep 0.5
fix g all gravity 0.001 vector 0 0 -1 disable
fix_modify g energy yes
"""
    + "".join(
        f"group {name} union all\n"
        for name in ("water", "mols", "liquid", "bodies", "own_bodies", "grains", "sides")
    )
    + ("".join(f"group {name} union tip\n" for name in ("clump", "plate", "gas")))
)
ONE = "one\n\n2 atoms\n\nCoords\n\n1 0 0 0\n2 1 0 0\n\nTypes\n\n1 1\n2 1\n"


@pytest.mark.parametrize("place", [place for place in SHOWN if SHOWN[place]])
def test_fix_lines_run(run_lammps, place):
    """Locks out a line of a page or of a docstring that the fix refuses, and a pattern of a style
    that is not there."""
    styles = {re.search(r"nosquish/(\w+)", line)[1].upper() for line in SHOWN[place]}
    assert styles - {"PAIRS"} <= INTEGRATORS.keys()  # pairs is no integrator
    lines = dict.fromkeys(line for line in SHOWN[place] if not PATTERN.match(line))
    script = SCENE + "".join(f"{line}\nrun 10\nunfix {line.split()[1]}\n" for line in lines)
    data = (ROOT / "inputs/water/data.water").read_text()
    run = run_lammps(script, files={"data.water": data, "one.mol": ONE}, check=False)
    assert run.log.count("Loop time") == len(lines), run.screen


REFINED = """units real
atom_style full
read_data data.512
include forcefield.512
group water type 1 2
velocity all create 298 4928 loop geom
velocity all zero linear
timestep 12
"""


def test_refined_averages_of_the_page(run_lammps, tmp_path, monkeypatch):
    """Locks out lines that do not run as the page has them, and a script of the page whose energy
    or pressure is not the harness's."""
    shown = blocks((DOCS / "fix-nvt.md").read_text())
    (script,) = (code for language, _, code in shown if language == "python")
    (lines,) = (code for _, _, code in shown if "thermo_modify" in code)
    lines = lines.replace("f_1[5]", "f_1[5] time f_1[2] f_1[3] f_1[4]")  # those of the harness
    folder = ROOT / "inputs" / "water_512"
    given = {name: (folder / name).read_text() for name in ("data.512", "forcefield.512")}
    table = run_lammps(f"{REFINED}{lines}run 40\n", files=given).thermo
    monkeypatch.chdir(tmp_path)
    page = {}
    exec(script, page)
    columns = {name: table[name] for name in table.dtype.names}
    plan = SimpleNamespace(scene=SimpleNamespace(unit=512))
    scheme = SimpleNamespace(refined=True, temperature=298.0, held=3, pressure=None)
    for key, ours in ("potential", page["energy"] / 512), ("pressure", page["pressure"]):
        expected = BY_KEY[key].of(columns, plan, scheme)
        assert np.ptp(expected) > 0.0
        np.testing.assert_allclose(ours, expected, rtol=1e-9)


@pytest.fixture(scope="module")
def source():
    """The text of the package, in which a message is one piece."""
    paths = (ROOT / "fix_nosquish").rglob("*")
    text = "".join(path.read_text() for path in paths if path.suffix in (".py", ".cpp", ".h"))
    return re.sub(r"[\"']\s*\n\s*f?[\"']", "", text)


@pytest.mark.parametrize(
    ("page", "heading", "least"),
    [
        ("fix.md", "### What is refused", 10),
        ("fix-nvt.md", "## Restrictions", 5),
        ("fix-npt.md", "## Restrictions", 4),
        ("fix-nph.md", "## Restrictions", 0),
        ("fix-hmc.md", "## Restrictions", 8),
    ],
)
def test_quoted_messages_are_those_of_the_package(source, page, heading, least):
    """Locks out a message on a fix's page that the package does not print."""
    rows = re.split("^##", (DOCS / page).read_text().split(heading)[1], flags=re.M)[0]
    quoted = re.findall(r"\| `([^`]*)` \|$", rows, re.M)
    assert len(quoted) > least
    for message in quoted:
        variable = (
            r"the body of molecule \d|\d[\d.]*|\.\.\.|\(.*?\)|'\w+'|"
            r"an ellipsoid, |a body particle, |an SPH particle, | this fix |\(style \w+\)|: "
        )
        parts = [part.strip() for part in re.split(variable, message) if part]
        longest = max(parts, key=len)
        assert len(longest) > 10 and longest in source, (message, longest)


# ---- what is reported against fix rigid


INPUTS = {path.name: path.read_text() for path in (ROOT / "inputs" / "reported").iterdir()}
NH = "nosquish/nvt molecule temp 1 1 0.2 thermostat nh"
LANGEVIN = "nosquish/nvt molecule temp 1 1 0.2 seed 4928"
NPT = "nosquish/npt molecule temp 1 1 0.2 iso 0.1 0.1 1 thermostat nh barostat mtk"
WITH_OURS = {  # of a case the fix, and what would be 0 without the problem, within a limit
    "run": (NH, lambda run: np.ptp(run.thermo["Econserve"]), 0.05),
    "memory": (LANGEVIN, lambda run: run.thermo["Press"] - 63e-3 * run.thermo["Temp"], 5e-3),
    "gas": (LANGEVIN, lambda run: run.thermo["Press"] - 0.055, 0.01),
    "slabs": (NH, lambda run: np.ptp(run.thermo["Econserve"]), 0.05),
    "minimize": ("", lambda run: run.thermo["v_largest"] - run.thermo["v_smallest"], 1e-9),
    "insert": (f"{NH} mol bent", lambda run: run.thermo["Temp"][-3:] - 1.0, 0.3),
    "shear": ("", lambda run: run.thermo["c_v[1]"][-1] + 1.0, 1e-9),
    "bath": ("", lambda run: run.thermo["c_z"], 0.0),
    "gcmc": (f"{NH} mol bent", lambda run: run.thermo["Atoms"][-1] - 3, 0.0),
    "custom": ("nosquish/nve custom v_body", lambda run: np.ptp(run.thermo["TotEng"]), 0.1),
    "large": ("", lambda run: np.ptp(run.thermo["TotEng"]), 1e-9),
    "images": ("", lambda run: np.ptp(run.thermo["TotEng"]), 0.1),
    "restart": (NPT, lambda run: np.diff(np.array(END.findall(run.log), float)), 1e-12),
}
END = re.compile(r"^(?:in one run|restarted): +(\S+)$", re.M)


@pytest.mark.parametrize("case", re.findall(r"^label +(\w+)", INPUTS["in.reported"], re.M))
def test_reports_with_ours(run_lammps, case):
    """Locks out an input on the page that does not run, or that shows its problem with ours."""
    fix, problem, limit = WITH_OURS[case]
    words = {"case": case, "fix": fix or "nosquish/nve molecule", "moves": "0"}
    words["dimension"] = "2" if case == "bath" else "3"
    options = [word for name, value in words.items() for word in ("-var", name, value)]
    run = run_lammps(INPUTS["in.reported"], files=INPUTS, options=options, launcher="lmp")
    assert (np.abs(problem(run)) <= limit).all()


# ---- the tutorial


def shorter(script):
    """A script with runs of 20 steps."""
    script = re.sub(r"^(run +)\S+", r"\g<1>20", script, flags=re.M)
    return re.sub(r"^(thermo +)\d+|^(dump .* custom )\d+", r"\g<1>\g<2>10", script, flags=re.M)


@pytest.mark.quick
def test_tutorial(run_lammps, tmp_path):
    """Locks out a tutorial whose scripts do not run, or print something else than it quotes."""
    text = (DOCS / "tutorial.md").read_text()
    script = files(text)
    run_lammps(script["in.build"], files={"co2.txt": script["co2.txt"]})
    first = run_lammps(shorter(script["in.co2"]))
    quoted = script["log.lammps"]
    assert quoted in first.log
    assert first.log.count("Loop time") == 2 and (tmp_path / "trajectory.dump").exists()

    step = shorter(script["in.step"])
    second = run_lammps(step, options=["-var", "dt", "4"])
    assert re.search(r"^step 4 fs: range of the energy \d\.\d+ kcal/mol$", second.log, re.M)
    assert "start velocities: rigid motion" in second.log

    long = run_lammps(shorter(script["in.long"]))
    assert "moments scale 4.0" in long.log and long.log.count("Loop time") == 1

    line = re.findall(r"^    (fix .*output.*)$", text, re.M)[0]
    table = re.sub(r"^fix +bodies .*$", line.replace(" 100 ", " 10 "), step, flags=re.M)
    run_lammps(table, options=["-var", "dt", "2"])
    head, *rows = (tmp_path / "bodies.csv").read_text().splitlines()
    page_of_the_fix = (DOCS / "fix.md").read_text()
    for column in head.split(","):
        assert f"`{column}`" in page_of_the_fix, column
    assert len(rows) == 3 * 216


FREE = """units lj
atom_style full
read_data data.water
mass * 1.0
pair_style zero 3.0
pair_coeff * *
bond_style zero
angle_style zero
bond_coeff * 1.0
angle_coeff * 90.0
velocity all create 2.0 4711 loop geom
neighbor 0.3 bin
fix 1 all python/move "damped.Damped all molecule"
thermo_style custom step f_1[1] f_1[2] pe
thermo_modify format float %.15g
timestep 0.005
thermo 40
run 200"""


def test_integrator_of_the_documentation(run_lammps):
    """Locks out an example that does not run as it stands, is longer than it says, a splitting
    that is not done as it is declared, and parameters of one's own that do not arrive.

    The kinetic energy of bodies without forces falls as exp(-2 t / 100): of translation exactly, of
    rotation but for the splitting's error."""
    example, data = DOCS / "damped.py", ROOT / "inputs" / "water" / "data.water"
    assert len(example.read_text().splitlines()) <= 40
    given = {"damped.py": example.read_text(), "data.water": data.read_text()}
    for ranks in 2, 1:  # the first one compiles the loops
        thermo = run_lammps(FREE, files=given, ranks=ranks, timeout=250).thermo
        left = np.exp(-0.02 * 0.005 * thermo["Step"])
        for column, error in ("f_1[1]", 1e-12), ("f_1[2]", 1e-4):
            energies = thermo[column]
            np.testing.assert_allclose(energies / energies[0], left, rtol=error)


def with_thermostat(name, words):
    """An example of the documentation, as files and as an input script."""
    example, data = f"{name.partition('.')[0]}.py", ROOT / "inputs" / "water" / "data.water"
    given = {example: (DOCS / example).read_text(), "data.water": data.read_text()}
    ours = f"{name} all molecule temp 1 1 1e-1 {words}"
    return given, FREE.replace("damped.Damped all molecule", ours)


@pytest.mark.parametrize(
    "name, words",
    [
        ("annealed.AnnealedNVT", "seed 7"),
        ("andersen.AndersenNVT", "part 0.7 seed 7"),
        ("weak.BerendsenNVT", ""),
    ],
)
def test_thermostats_of_the_documentation(run_lammps, name, words):
    """Locks out examples that do not run as they stand, that do not keep the temperature, or whose
    energy is not counted."""
    given, lines = with_thermostat(name, words)
    lines = lines.replace("f_1[1] f_1[2] pe", "f_1[3] etotal econserve")
    lines = lines.replace("thermo_modify", "thermo_modify norm no")
    for ranks in 2, 1:  # the first one compiles the loops
        thermo = run_lammps(lines, files=given, ranks=ranks, timeout=250).thermo
        assert thermo["f_1[3]"][0] > 1.5 and thermo["f_1[3]"][-1] == pytest.approx(1.0, rel=0.2)
        assert np.ptp(thermo["Econserve"]) < 0.01 * np.ptp(thermo["TotEng"])


@pytest.mark.quick
@pytest.mark.parametrize(
    "name, words, says",
    [
        (
            "weak.BerendsenNVT",
            "seed 7",
            "keyword seed has no effect with Berendsen's thermostat: leave it out",
        ),
        (
            "weak.BerendsenNVT",
            "tchain 7",
            "keyword tchain has no effect with Berendsen's thermostat",
        ),
        ("andersen.AndersenNVT", "part 0.7", "keyword seed is missing"),
        (
            "andersen.AndersenNVT",
            "part 0.7 seed 7 separate yes",
            "separate has no effect with Andersen's",
        ),
    ],
)
def test_keywords_of_a_thermostat(monkeypatch, name, words, says):
    """Locks out a keyword that a thermostat of one's own ignores in silence, and a missing seed."""
    monkeypatch.syspath_prepend(DOCS)
    module, _, kind_name = name.partition(".")
    kind = getattr(importlib.import_module(module), kind_name)
    line = Line.quoted(f"{kind_name} all molecule temp 1 1 1 {words}")
    with pytest.raises(RunError, match=re.escape(says)):
        kind(Command.parse(line, kind.keywords, kind.extra_keywords), 3)


OWN = "andersen.AndersenNVT"


def test_own_keywords_values_and_state(run_lammps):
    """Locks out a keyword of one's own that does not arrive, a value of one's own that is not
    behind the package's, and a state that ranks have differently or that a restart forgets."""
    given, lines = with_thermostat(OWN, "part 1 seed 7")
    lines = lines.replace("f_1[1] f_1[2] pe", "f_1[3] f_1[6]")
    whole = run_lammps(lines, files=given, timeout=250).thermo["f_1[6]"]
    collisions = 200 * (1.0 - np.exp(-0.05))
    assert whole[0] == 0 and whole[-1] == pytest.approx(collisions, abs=4.0 * collisions**0.5)
    tail = lines.partition("read_data data.water\n")[2]
    tail = tail.replace("velocity all", "# velocity").replace("mass *", "# mass *")
    second = f"units lj\nread_restart half\n{tail.replace('run 200', 'run 80')}"
    first = lines.replace("run 200", "run 120\nwrite_restart half")
    for ranks in 1, 2:
        run_lammps(first, files=given, ranks=ranks, timeout=250)
        rest = run_lammps(second, files=given, ranks=ranks, timeout=250)
        assert rest.thermo["f_1[6]"][-1] == whole[-1]


@pytest.mark.parametrize(
    "words, message",
    [
        ("", "keyword part is missing: give it the part of a velocity that a collision makes new"),
        ("part x", "'x' was given where the part of a velocity that a collision makes new"),
        ("part 1.5", "keyword part is 1.5, and must be above 0 and at most 1"),
        ("part 1 thermostat csvr", "keyword thermostat: 'csvr' was given where one of andersen"),
    ],
)
def test_wrong_own_keywords(run_lammps, words, message):
    """Locks out a keyword of one's own that is not checked as the package's, and a message that
    shows another line than the user's."""
    given, lines = with_thermostat(OWN, f"{words} seed 7")
    done = run_lammps(lines, files=given, check=False, timeout=250)
    assert done.code and message in done.screen and f"{OWN} all molecule" in done.screen


def rooms_used(file):
    """What a file in a room imports from beside its room."""
    nodes = ast.walk(ast.parse(file.read_text()))
    imports = [one for one in nodes if isinstance(one, ast.ImportFrom) and one.level == 2]
    used = {one.module.split(".")[0] for one in imports if one.module}
    return used | {name.name for one in imports if not one.module for name in one.names}


def test_rooms_use_those_below_them():
    """Locks out rooms of the package that need each other in a circle, rooms that the page on its
    architecture does not name, and files that it names and that are gone."""
    package, text = ROOT / "fix_nosquish", (DOCS / "architecture.md").read_text()
    rooms = re.findall(r"(?m)^\| `(\w+)/` \|", text)
    assert {*rooms, "plugin"} == {file.parent.name for file in package.glob("*/__init__.py")}
    for floor, room in enumerate(rooms):
        for file in (package / room).glob("*.py"):
            assert not rooms_used(file) & {*rooms[:floor], "plugin"}, file
    there = [str(file) for folder in (package, ROOT / "validation") for file in folder.rglob("*.*")]
    for name in re.findall(r"`([\w/]+\.(?:py|h|cpp))`", text):
        assert (ROOT / name).exists() or any(file.endswith(f"/{name}") for file in there), name
