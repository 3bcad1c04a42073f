"""The plugin's own fix styles, nosquish/nve and its kin, which take LAMMPS's words."""

import re
import subprocess
import sys

import numpy as np
import pytest

from fix_nosquish import INTEGRATORS, of_style
from support.builds import NUMBER
from support.endings import assert_ended
from support.fixes import STYLES
from support.running import LAUNCHERS
from support.systems import mixture, script

QUOTED = 'fix 1 {{group}} python/move "fix_nosquish.{} {{group}} {{words}}"'
NATIVE = "fix 1 {{group}} nosquish/{} {{words}}"


def run_of(system, name, form, steps=20, before="", after="", words=None):
    """The script of a system with an integrator, as a native style or in quotes."""
    fix = NATIVE.format(name) if form == "native" else QUOTED.format(name.upper())
    words = STYLES[name] if words is None else words
    how = dict(group="bodies", dt=0.5, every=5, before=before, after=after)
    return script(system, fix, steps, words=f"molecule {words}", **how)


def table(run):
    return [run.thermo[name] for name in run.thermo.dtype.names]


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", STYLES)
def test_same_as_in_quotes(run_lammps, name, ranks):
    """Locks out words that mean something else in LAMMPS's own form, a decimal point that cuts a
    number in either form, and another group than the fix's."""
    system = mixture("solid planar")
    native, quoted = (
        table(run_lammps(run_of(system, name, form), files=system.files, ranks=ranks))
        for form in ("native", "quoted")
    )
    assert np.ptp(native[3]) > 0  # pe
    np.testing.assert_array_equal(native, quoted)


def test_variables_and_continued_lines(run_lammps):
    """Locks out a line in which LAMMPS does not put variables' values in place, or cannot be
    continued."""
    system = mixture("solid planar")
    plain = table(run_lammps(run_of(system, "nvt", "native"), files=system.files))
    words = "temp ${T} v_stop $(v_T*0.6) &\n  seed ${seed}"
    before = "variable T index 1.25\nvariable stop equal 1.5\nvariable seed index 4928\n"
    text = run_of(system, "nvt", "native", before=before, words=words)
    np.testing.assert_array_equal(table(run_lammps(text, files=system.files)), plain)


BAD = {  # the line behind its style, what the message says, and the word under which LAMMPS points
    "no body style": ("nve", "", ["the fix line ends where a body style"], None),
    "number": ("nvt", "molecule temp 1.0 1,5 2.0 seed 4", ["'1,5'", "word 8 of"], "1,5"),
    "keyword": ("nvt", "molecule temp 1 1 2 sead 4", ["keyword 'sead'", "word 10 of"], "sead"),
    "body style": ("nve", "molecules", ["body style 'molecules'", "word 5 of"], "molecules"),
    "missing keyword": ("nvt", "molecule temp 1 1 2", ["keyword seed is missing"], None),
}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("what", BAD)
def test_errors_name_style_and_word(run_lammps, tmp_path, what, ranks):
    """Locks out messages that leave the user to look for the word."""
    name, words, says, pointed = BAD[what]
    system = mixture("solid planar")
    text = script(system, NATIVE.format(name), 0, words=words, group="bodies")
    run = run_lammps(text, files=system.files, ranks=ranks, check=False)
    line = f"fix 1 bodies nosquish/{name} {words}".strip()
    assert_ended(run, [f"Fix 1 nosquish/{name}: ", *says, f'"{line}"'], tmp_path)
    if pointed and NUMBER >= 20250204:  # before, LAMMPS does not mark the word
        said, marks = re.search(r"\n(?:Last input line: )?(fix 1 .*)\n( *\^+)", run.screen).groups()
        at = run.screen[run.screen.index(marks) :].split("\n")[0]
        whole = next(one for one in run.screen.splitlines() if one.endswith(said))
        assert whole[at.index("^") : len(at)] == pointed


ADVISED = {  # what is wrong: (the integrator, its words, lines behind the fix, what serves)
    "keyword of a thermostat": ("nve", "langevin 1 1 1 4", "", "{nvt} has Langevin's"),
    "pressure": ("nvt", "temp 1 1 2 seed 4 iso 1 1 1", "", "no barostat: use {npt} or {nph}"),
    "barostat beside it": (
        "nve",
        "",
        "fix 2 all press/langevin iso 1 1 1 temp 1 1 5",
        "use {npt} or {nph}",
    ),
    "minimization": (
        "nve",
        "",
        "fix_modify 1 external force 1 0 0\nminimize 0 0 1 1",
        "use a run with {nvt}",
    ),
    "one component of a torque": ("nvt", "temp 1 1 2 seed 4 torque * on on off", "", "use {nve}"),
}


@pytest.mark.parametrize("form", ["native", "quoted"])
@pytest.mark.parametrize("what", ADVISED)
def test_advice_has_the_form_in_use(run_lammps, what, form):
    """Locks out advice that names a Python class to who wrote a fix style, and a fix style to who
    has the class: LAMMPS's own fix python/move has no such style."""
    name, words, after, says = ADVISED[what]
    named = {
        name: f"fix nosquish/{name}" if form == "native" else f"fix_nosquish.{name.upper()}"
        for name in STYLES
    }
    system = mixture("solid planar")
    text = run_of(system, name, form, 1, words=words).replace(
        "thermo_style", f"{after}\nthermo_style"
    )
    printed = " ".join(run_lammps(text, files=system.files, check=False).screen.split())
    assert says.format(**named) in printed


def test_each_style_has_its_class():
    """Locks out a style of the plugin without a class, or with another one."""
    for name in STYLES:
        assert of_style(f"nosquish/{name}").__name__ == name.upper() in INTEGRATORS


@pytest.mark.parametrize("launcher", LAUNCHERS)
def test_survives_clear(run_lammps, launcher):
    """Locks out styles that are gone when LAMMPS begins anew."""
    system = mixture("solid planar")
    text = run_of(system, "nve", "native")
    run = run_lammps(f"{text}clear\n{text}", files=system.files, launcher=launcher)
    pe = run.thermo["PotEng"]
    np.testing.assert_array_equal(pe[: len(pe) // 2], pe[len(pe) // 2 :])


SEVERAL = """
import os, lammps
def new(load=False):
    own = lammps.lammps(cmdargs=["-log", "none", "-screen", "none", "-suffix", "nosquish"])
    if load:
        own.command(f"plugin load {plugin}")
    return own
def run(own, load=False):
    own.command("clear")
    if load:
        own.command(f"plugin load {plugin}")
    own.file("in.one" if load else "in.test")
    return own.get_thermo("pe")
found = []
one, two = new(), new()
found += [run(two), run(one), run(one)]
two.close()
found += [run(one), run(new())]
one.close()
third = new()
found.append(run(third))
# by LAMMPS's command instead of LAMMPS's folders
plugin = os.path.join(os.environ.pop("LAMMPS_PLUGIN_PATH").split(":")[0], "python_moveplugin.so")
found.append(run(third, load=True))
third.close()
found.append(run(new(load=True), load=True))
print("FOUND", *found)
"""


@pytest.mark.usefixtures("lammps_from_python")
def test_several_lammps(tmp_path):
    """Locks out styles that are gone, or a crash, where plugins stay from one LAMMPS of a process
    to the next, as they do from 2026 on, or go with each LAMMPS, as before: side by side, one after
    the other, after clear, and with plugin load."""
    system = mixture("solid planar")
    text = run_of(system, "nve", "native", 5)
    texts = text, text.replace("nosquish/nve", "rigid/nve"), text
    files = {"in.one": text, "in.test": "clear\n".join(texts), **system.files}
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    done = subprocess.run(
        [sys.executable, "-c", SEVERAL], cwd=tmp_path, text=True, capture_output=True, timeout=100
    )
    assert done.returncode == 0, done.stdout + done.stderr
    _, *result = next(line for line in done.stdout.splitlines() if "FOUND" in line).split()
    assert len(result) == 8 and len(set(result)) == 1, result


ALIASES = {  # what users write: the style that it is, and its words
    "nosquish/nvt/small": ("nosquish/nvt", STYLES["nvt"]),
    "nosquish/nve/small": ("nosquish/nve", ""),
    "nosquish/rigid": ("rigid/nosquish", ""),
    "nosquish/rigid/nvt/small": ("rigid/nvt/small/nosquish", "temp 1.25 1.5 0.75"),
}


@pytest.mark.parametrize("alias", ALIASES)
def test_aliases(run_lammps, alias):
    """Locks out an unknown style, or another one than is meant, for the names that users of fix
    rigid/nvt/small try first, and a log that does not say which style runs."""
    style, words = ALIASES[alias]
    system = mixture("solid planar")
    text, plain = (
        script(system, f"fix 1 {{group}} {name} {{words}}", 20, words=f"molecule {words}")
        for name in (alias, style)
    )
    expected = table(run_lammps(plain, files=system.files))
    run = run_lammps(text, files=system.files, ranks=2)
    assert f"Fix 1: {alias} is {style}\n" in run.log
    np.testing.assert_allclose(table(run), expected, rtol=1e-9)
    assert of_style(alias) is of_style(style)
