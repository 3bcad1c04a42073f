"""Bad input ends the run on all ranks within seconds,
with one message that says what is wrong and what to do."""

import re
from importlib import metadata

import pytest

import fix_nosquish
from fix_nosquish.errors import RunError
from fix_nosquish.host.command import Command, Line
from support.bad_input import CASES, Case
from support.builds import NUMBER
from support.endings import BENT, SECONDS, assert_ended

# seen in the words alone; how the run then ends, "keyword that does not exist" has
OF_WORDS = (
    "body style that does not exist",
    "no body style",
    "value missing",
    "value not a number",
    "value of zero",
    "keyword given twice",
    "number of groups missing",
    "fewer groups than announced",
    "custom of neither kind",
)


# words, what the message says
UNREADABLE = {
    "number zero": ("force 0 on on on", ("'0'", "M xflag yflag zflag", "n, m*n or *")),
    "no number": ("torque one on on on", ("'one'", "M xflag yflag zflag")),
    "negative number": ("torque -1* on on on", ("'-1*'", "M xflag yflag zflag")),
    "neither on nor off": ("force * on off yes", ("'yes'", "three times on or off")),
    "flag missing": ("force * on off", ("ends where", "M xflag yflag zflag")),
    "keyword for a flag": (
        "force * on off torque * on on on",
        ("'torque'", "three times on or off"),
    ),
    "reinit neither yes nor no": ("reinit on", ("'on'", "yes or no")),
    "reinit twice": ("reinit no reinit no", ("reinit", "twice")),
    "infile that would be read again": ("infile f reinit yes", ("leave out reinit yes",)),
    "no name of the infile": ("infile", ("ends where", "a file", "v_NAME")),
    "keyword of a thermostat": ("temp 1 1 1", ("'temp'", "fix_nosquish.NVT")),
    "keyword langevin": ("langevin 1 1 1 428984", ("'langevin'", "fix_nosquish.NVT")),
}


@pytest.mark.quick(*UNREADABLE)
@pytest.mark.parametrize("name", [*OF_WORDS, *UNREADABLE])
def test_words(name):
    """Locks out words that are taken for something else, and messages that do not name the word and
    what was expected, for each wrong fix line."""
    if name in OF_WORDS:
        words, expected = CASES[name].words, CASES[name].expected
    else:
        words, expected = f"all molecule {UNREADABLE[name][0]}", UNREADABLE[name][1]
    with pytest.raises(RunError) as caught:
        Command.parse(Line.quoted(f"NVE {words}"))
    assert caught.value.everywhere
    assert not [says for says in (*expected, words) if says not in str(caught.value)]


@pytest.mark.quick(
    "atoms lost",
    "exception of its own",
    "force that becomes NaN",
    "keyword that does not exist",
    "no words at all",
)
@pytest.mark.parametrize("name", [name for name in CASES if name not in OF_WORDS])
def test_ends_on_two_ranks(run_case, tmp_path, name):
    """Locks out a hang, a message per rank, a bare traceback and a silently wrong run,
    for each wrong input."""
    assert_ended(run_case(CASES[name], ranks=2), CASES[name].expected, tmp_path)


def test_variable_that_one_rank_cannot_evaluate(run_case):
    """Locks out ranks that wait for the one that ends, with LAMMPS's message and ours."""
    case = Case("all custom v_body", before="variable body atom 10/(id-5)")
    run = run_case(case, ranks=2)
    assert run.code != 0 and "Divide by 0 in variable formula" in run.screen
    assert run.screen.count("variable body cannot be evaluated") == 1


@pytest.mark.quick("library-keyword that does not exist")
@pytest.mark.parametrize(
    "launcher, name",
    [
        ("library", "value with a point"),
        ("library", "keyword that does not exist"),
        ("lmp", "atoms at one point"),
        ("library", "fix nve after ours"),
        ("library", "force not finite from the start"),
        ("lmp", "atoms deleted by a fix"),
        ("library", "box deformed with respa"),
        ("lmp", "exception of its own"),
        ("library", "exception of its own"),
    ],
)
def test_ends_on_one_rank(run_case, tmp_path, launcher, name):
    """Locks out a check that works only where ranks agree on it,
    and a Python session that gets no exception."""
    run = run_case(CASES[name], launcher=launcher)
    assert_ended(run, CASES[name].expected, tmp_path)
    if launcher == "library":
        lines = run.screen.splitlines()
        (error,) = (line for line in lines if line.startswith("ERROR"))
        length = None if NUMBER >= 20250722 else 99  # which its module takes of a message
        raised = [line for line in lines if line.startswith("Exception: ")]
        assert raised == [f"Exception: {error[:length].strip()}"], run.screen


# atom styles whose integrators advance more than positions and velocities, and what of each atom is
# refused, by how it is made
MORE = {
    "sph": ("is an SPH particle, whose density and energy", "fix rigid/meso"),
    "smd": ("is an SPH particle",),
    "hybrid charge sph": ("is an SPH particle",),
    "rheo": ("is a fluid particle of RHEO, whose density", "rheo/status 1"),
    "edpd": ("style edpd, whose temperature",),
    "tdpd 2": ("style tdpd, whose concentrations",),
    "electron": ("is an electron, whose radius",),
    "spin": ("is a magnetic spin, whose precession",),
}
AS_POINTS = {
    "rheo": "set group all rheo/status 1",
    "electron": "set group all spin/electron 0",
    "spin": "",
    "mdpd": "",
    "dpd": "",
    "peri": "",
}


@pytest.mark.parametrize("style", [*MORE, "mdpd", "dpd", "peri"])
def test_atoms_with_more_to_advance(run_lammps, tmp_path, style):
    """Locks out densities, temperatures, spins that stand still, because an integrator that
    advances them was replaced by this one; atoms of these styles that have none, or whose forces
    need none, are taken."""
    if style == "rheo" and NUMBER < 20250204:
        pytest.skip("the Python package of this LAMMPS has no RHEO")
    made = {
        "spin": "set group all spin/atom 1.5 0 0 1",
        "electron": "set group all spin/electron 1",
    }.get(style, "")
    script = f"""
units lj
atom_style {style}
newton on
atom_modify map array
region box block 0 4 0 4 0 4
region inner block 1 2 1 2 1 2
create_box 1 box
create_atoms 1 random 10 4928 inner
pair_style none
{"set group all mass 1.0" if style in ("smd", "peri") else "mass * 1.0"}
SET
fix 1 all nosquish/nve single
run 1
"""
    ranks = 2 if style == "sph" else 1
    if style in MORE:
        run = run_lammps(script.replace("SET", made), ranks=ranks, check=False, timeout=SECONDS)
        assert_ended(run, (*MORE[style], "this fix does not advance"), tmp_path)
    if style in AS_POINTS:
        assert run_lammps(script.replace("SET", AS_POINTS[style])).code == 0


def test_group_of_the_fix(run_case):
    """Locks out silence where the fix line's two groups differ,
    and one of them does not do what it seems to."""
    run = run_case(
        Case("bodies molecule", before="group bodies molecule <= 20", steps=5), ranks=2, check=True
    )
    assert run.log.count("WARNING: the fix line names group all, the class group bodies") == 1


def test_before_the_box(run_lammps, tmp_path):
    """Locks out a crash where the fix line stands above read_data."""
    run = run_lammps(
        "fix 1 all nosquish/nve single\n",
        ranks=2,
        check=False,
        timeout=SECONDS,
    )
    assert run.code != 0 and run.screen.count("ERROR") == 1 and "box" in run.screen, run.screen


@pytest.mark.quick("delete_atoms group odd")
@pytest.mark.parametrize(
    "between",
    [
        "delete_atoms group odd",
        "create_atoms 1 single 0.5 0.5 0.5 units lattice\nset atom 82 mol 28",
        "displace_atoms odd move 0.1 0.1 0.1",
        "change_box all x scale 1.1 remap",
        "unfix 1\nfix 1 odd nosquish/nve single",
        "velocity all create 2.0 87287",
    ],
)
def test_change_between_runs(run_case, between):
    """Locks out the refusal between runs of what is refused in mid-run,
    and bodies of a fix that is gone."""
    run = run_case(
        Case(steps=20, before="group odd molecule 1", after=f"run 20\n{between}"),
        ranks=2,
        check=True,
    )
    assert run.screen.count("Loop time") == 2


def test_version(run_case):
    """Locks out a log that does not say which package made the run,
    and a version that is not that of what is installed."""
    installed = metadata.version("fix_nosquish")
    assert fix_nosquish.__version__ == installed
    assert (
        f"Rigid bodies by NO_SQUISH, fix_nosquish {installed}: NVE all molecule\n"
        in run_case(Case(steps=1), check=True).log
    )


def test_image_flags_that_may_tear_a_body(run_case):
    """Locks out silence where the image flags of one atom make a body as wide as the box."""
    run = run_case(
        Case("all single", before="set atom 1 image 1 0 0", steps=1), ranks=2, check=True
    )
    assert (
        run.log.count(
            "WARNING: the body of group all (its first atom is 1) may be cut by a periodic face"
        )
        == 1
    )


def test_molecule_zero(run_case):
    """Locks out silence where atoms without a molecule become one body,
    as in LAMMPS's fix rigid."""
    warning = "WARNING: the 6 atoms with molecule-ID 0 are one rigid body"
    run = run_case(Case(before="set atom 4*9 mol 0", steps=5), ranks=2, check=True)
    assert run.log.count(warning) == run.screen.count(warning) == 1
    assert "WARNING" not in run_case(Case(steps=5), ranks=2, check=True).log


@pytest.mark.parametrize(
    "before, target",
    [
        ("group rigid union ${g}", '"fix_nosquish.NVE rigid molecule mrot 2"'),
        ("variable words string '\"fix_nosquish.NVE a molecule mrot 2\"'", "${words}"),
        (
            "variable words index '\"fix_nosquish.NVE a molecule mrot 1\"' '\"fix_nosquish.NVE a "
            "molecule mrot 2\"'\nnext words",
            "${words}",
        ),
    ],
)
def test_variables_in_the_fix_line(run_case, before, target):
    """Locks out advice that LAMMPS does not take."""
    case = Case(before=f"group a molecule 1 2\nvariable g string a\n{before}", steps=1)
    script = case.script.replace(f'"{case.module} {case.words}"', target)
    run = run_case(type("", (), {"script": script}), check=True)
    assert re.search(r"Rigid bodies by .*: NVE (rigid|a) molecule mrot 2$", run.log, re.M), run.log


def test_file_with_letters_beyond_ascii(run_lammps, tmp_path):
    """Locks out the advice for a file's name with letters beyond ASCII: a variable of the command
    line brings it, which LAMMPS does not do for a script's words."""
    case = Case("all molecule output 5 v_f", steps=10)
    given = {"options": ("-var", "f", "caf\u00e9.csv"), "files": {"mol.bent": BENT}}
    run_lammps(case.script, launcher="lmp", **given)
    assert (tmp_path / "caf\u00e9.csv").exists()
