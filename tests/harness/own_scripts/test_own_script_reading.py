"""A user's own input script: what is read of it, and that nothing of it changes.

Held against LAMMPS itself, which runs the same script as it is.
"""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from support import (
    scripts,
)
from support.harness import GAS, advised, refused, run_lmp, started, take, written
from validation.running import machine, run
from validation.user_script import candidates, commands, loader, rigid_atoms, shapes


def test_words_are_lammpss(tmp_path):
    """Locks out a word that comes apart, or gets a value in it, as its command is repeated: LAMMPS
    prints what it was told, in words that need each kind of quotes."""
    said = "a # b", "'c' d", '"e"', "$x & y", "", "f\tg", "# \"h\" 'i'", "two\nlines"
    texts = [["print", word, "file", f"{n}"] for n, word in enumerate(said)]
    lines = ["variable x string no", *map(commands.join_words, texts), ""]
    run_lmp(written(tmp_path, "\n".join(lines)), "-log", "none")
    for words, file in zip(texts, map(str, range(len(said)))):
        assert commands.split_words(commands.join_words(words)) == words
        assert (tmp_path / file).read_text() == words[1].replace("$x", "no") + "\n"
    assert commands.join_words(["fix", "1", "all", "nve"]) == "fix 1 all nve"


def test_the_commands_are_those_that_lammps_does(tmp_path):
    """Locks out a loop, a jump, a condition or a variable of the command line that is followed
    otherwise than LAMMPS does: both set the same variable. Values of the command line have more
    than one letter, and there are several of one variable."""
    more = 'variable old string ${text}\nvariable text string "${old}+m"\n'
    (tmp_path / "more.in").write_text(more)
    path = written(
        tmp_path,
        GAS
        + """variable text string s
variable n index 2
variable w index one two
variable i loop $n
label top
variable j index a b
label inner
variable text string ${text}$i$j
if "$i == 2 && ($j == a)" then "variable text string ${text}!" "include more.in" elif "$i == 1" &
  "variable text string ${text}?" else "jump SELF out"
next j
jump SELF inner
next i
jump SELF top
label out
variable text string ${text}$n${w}
next w
variable text string ${text}${w}
variable t equal 2*$(v_i)
fix 1 all rigid/nve group 2 a b
timestep $(v_t/1000)
print "says ${text} $t"
run 1
""",
    )
    several = (("n", "12"), ("w", "left", "right"))
    for variables in (), several:
        more = [word for one in variables for word in ("-var", *one)]
        run_lmp(path, "-log", "log", *more)
        log = (tmp_path / "log").read_text()
        told = next(line for line in log.splitlines() if line.startswith("says ")).split()[1:]
        own = take(path, tmp_path / "out", variables=variables)
        last = [one for one in own.scene.setup if one.startswith("variable text")][-1]
        assert last.split()[-1] == told[0]
        assert own.scene.dt == float(told[1]) / 1000


def test_runs_follow_from_all_files_of_the_script(tmp_path):
    """Locks out results of a file that is another one now, in a folder below, above or anywhere; a
    copy of one that is above, outside of the output folder; and other results of the same files
    after a run that has written to its folder."""
    home = tmp_path / "a" / "b"
    (home / "parts").mkdir(parents=True)
    files = home / "parts" / "sub.mol", tmp_path / "up.mol", tmp_path / "whole.mol"
    for file in files:
        file.write_text("one\n\n1 atoms\n\nCoords\n\n1 0 0 0\n\nTypes\n\n1 1\n")
    names = "parts/sub.mol", "../../up.mol", str(files[2])
    more = "".join(f"molecule m{n} {name}\n" for n, name in enumerate(names))
    path = home / "in.files"
    path.write_text(GAS + more + "fix 1 a rigid/nve single\nrun 1\n")
    out = tmp_path / "out"
    own = take(path, out)
    assert {Path(one) for one in own.reading["files"]} == {*files, path}
    one = own.integrators[own.reference]
    keys = {machine.origin(own.scene, one)}
    for file in files:
        file.write_text(file.read_text() + "\n")
        scene = replace(own.scene, origin=loader._files_of(own.reading, out / "script"))
        keys.add(machine.origin(scene, one))
    assert len(keys) == 4
    before = machine.origin(take(path, out).scene, one)
    run.run(run.job(own.scene, one, out / "run", [1], dt=0.001, every=0))
    assert machine.origin(take(path, out).scene, one) == before
    assert machine.origin(take(path, out).scene, one) in keys - {machine.origin(own.scene, one)}


@pytest.fixture(scope="module")
def staged(tmp_path_factory):
    """(its script, what the harness makes of it, its folder)."""
    folder = tmp_path_factory.mktemp("staged")
    path = scripts.staged(folder)
    return path, take(path, folder / "out"), folder


def test_a_run_without_steps_is_none(staged):
    """Locks out run 0 as the run, before velocities are scaled; and commands that need what an
    earlier run gives, which the first reading passes over."""
    _, own, _ = staged
    assert own.reading["run"] == "run 100" and own.reading["skipped"] == 2
    assert "variable seen equal 250" in own.scene.setup
    assert own.reading["temperature"] == pytest.approx(1.5) and own.reading["later"] == []
    told = {"run 0": False, "run 5": True, "run 5 upto": False, "minimize 0 0 1 1": False,
            "run 9 upto": True, "rerun a dump x": False, "tad 1": True}  # fmt: skip
    assert {line: commands.advances_time(line.split(), 5) for line in told} == told


def test_a_script_with_ours_is_read_as_ours_is(staged):
    """Locks out the fix's group for the class's, points that nobody moves, `moments equal 6` as one
    word, a variable's temperature, the first line of a fix that is defined twice, and a lost
    fix_modify."""
    _, own, folder = staged
    result = own.rigid
    assert (result.group, result.flexible, result.rest) == ("bodies", "points", True)
    assert result.body.tolist() == [1, 1, 2, 2, 0, 0, 0]
    assert result.state == rigid_atoms.State(("1.5", "1.5", "1"))
    assert result.dropped == ("moments equal 6",)
    assert shapes.temperature(own) == 1.5
    assert not any("fix_nosquish" in line for line in (*own.scene.setup, *own.scene.then))
    yours = own.integrators["yours"]
    assert yours.then == ("fix_modify 1 virial yes",)
    assert any("own integrator only: fix_modify 1 virial yes." in line for line in own.notes)
    started(own, folder / "out")
    held = replace(result, constraints="b 1")
    lines = next(candidates._constrained(held)).commands(own.scene)
    assert lines[0] == "group own_all union bodies points" and "own_all nvt" in lines[1]


def test_commands_behind_a_run_find_atoms_where_it_left_them(staged):
    """Locks out groups, and springs' ends, of the places before that run; and steps that do not
    begin at 0, by which samples are left out."""
    _, own, folder = staged
    more = ["variable n equal count(there)", 'print "there are $n"']
    how = {"dt": own.scene.dt, "every": 1, "more": more}
    result = run.run(run.job(own.scene, own.integrators["yours"], folder / "run", [2], **how))
    assert result.error is None
    assert "there are 5\n" in (folder / "run" / "log.lammps").read_text()
    assert result.thermo["PotEng"][0] == pytest.approx(0, abs=1e-20)
    assert result.thermo["Step"].tolist() == [0, 1, 2]
    assert [line for line in own.scene.then if line.startswith("change_box")] == []
    assert any("Steps count from 0 here, and from 250" in line for line in own.notes)
    known = Path(own.scene.body_property)
    bodies, types = np.load(known)
    np.save(known, [bodies, types + 1])
    again = run.run(run.job(own.scene, own.integrators["yours"], folder / "ids", [0], **how))
    assert "other IDs than when the script was read" in again.error
    np.save(known, [bodies, types])


def test_what_a_run_changes_is_changed_once_in_two_dimensions(tmp_path):
    """Locks out a ramp that begins anew in each part of a run, and coordinates that LAMMPS refuses
    to read in two dimensions."""
    flat = GAS.replace("units lj\n", "units lj\ndimension 2\n").replace("6 0 6\n", "6 -0.5 0.5\n")
    flat = flat.replace("1 1\ncreate", "1 0\ncreate").replace(" 4\n", " 0\n")
    flat = flat.replace("group b id 3 0\n", "group b id 3 4\n")
    path = written(
        tmp_path,
        flat + "velocity all create 1 5\nfix plane all enforce2d\nfix 1 a rigid/nve single\n"
        "fix box all deform 1 x delta 0 3 remap none\nrun 10\n",
    )
    own = take(path, tmp_path / "out")
    how = {"dt": 0.001, "every": 0}
    job = run.job(own.scene, own.integrators[own.reference], tmp_path / "run", [10, 20], **how)
    result = run.run(job)
    assert result.error is None
    assert result.positions.cells[:, 0, 0] == pytest.approx([6, 7, 9])
    ramp = rigid_atoms.State(("300", "300.0", "1"), (("iso", "1", "2", "9"), ("x", "1", "1", "9")))
    assert ramp.ramps == ["iso from 1 to 2"]


def test_a_failure_of_the_machine_is_no_result(tmp_path):
    """Locks out a full disk that is a run's result for ever."""
    job = run.Job(str(tmp_path), str(tmp_path), [], [1], None)
    (tmp_path / "job.json").write_text(json.dumps(asdict(job)))
    kept = {
        "ERROR on proc 0: Lost atoms": True,
        "'ERROR on proc 1: Fix 1 python/move: the force'": True,
        f"{run.HUNG} for 9 s, ended": True,
        "[Errno 28] No space left on device": False,
        "ERROR: Cannot open dump file x: No space left on device": False,
        "MemoryError": False,
    }
    for text, result in kept.items():
        (tmp_path / "error.txt").write_text(text)
        assert run.is_there(job, failures=True) is result, text


OWN = "fix 1 a rigid/nve single\n"
HOW = {"group": "a", "bodies": "single"}
TWO = f"{GAS}{OWN}fix 2 b rigid/nve single\nrun 1\n"
SAID = [  # a script, options, and parts of what the one line says
    (TWO, {}, "2 fixes could be replaced: 1 (rigid/nve on a), 2 (rigid/nve on b)...--fix ID"),
    (f"{GAS}fix 1 all nve\nrun 100000000\n", {},
     "run 100000000: 1 (nve on all)...--bodies molecule"),
    (GAS, {}, "has no run"),
    ("", {}, "has no run"),
    (f"{GAS}jump /nowhere/nothing\n", {}, "failed at 'jump /nowhere/nothing'"),
    (f"{GAS}jump SELF there\n", {}, "Label...wasn't found"),
    ("jump SELF\n", {}, "a loop of the script may have no end"),
    *(
        (f"{GAS}{line}\nrun 1\n", {}, f"the script failed at '{line}': ERROR")
        for line in (
            "fix 1 all rigid/nve molecule", "fix 1 all", "fix 1 all python/move",
            'fix 1 all python/move "fix_nosquish.NVE all"',
        )
    ),
    (f"{GAS.replace('pair_coeff * *', '')}{OWN}run 1\n", {}, "coeffs are not set"),
    ("jump /dev/stdin\n", {}, "has no run"),
    ("include in.bad\n", {}, "failed at 'include in.bad'"),
    (f"{GAS}quit\n{OWN}run 5\n", {}, "has no run"),
    (f"{GAS}fix 1 a nve\nrun 5\n", {"fix": ("9",), **HOW},
     "there is no fix 9 at that run; it has 1 (nve"),
    (f"{GAS}{OWN}run 5\n", {"fix": ("9",)}, "no run of the script has fix 9"),
    (f"{GAS}{OWN}run 5\n", {"at": 3}, "the script has only 1 such runs"),
    (f"{GAS}fix 1 a nve\nrun 5\n", HOW | {"group": "waters"},
     "no group waters at its run; it has all, a, b"),
    *(
        (f"{GAS}fix 1 a nve\nrun 5\n", HOW | {"bodies": words}, f"--bodies {words}: molecule")
        for words in ("molecules", "custom", "custom x", "group", "group 2 a", "group 1 none")
    ),
    (f"{GAS}if \"1 == 1\" \"run 5\"\n", {}, "failed at 'if \"1 == 1\" \"ru"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "options", "says"), SAID)
def test_scripts_that_cannot_be_taken_say_why_in_one_line(tmp_path, text, options, says):
    """Locks out a traceback, a guess, another fix or run in the place of the one that is named, or
    a message that does not say what to do."""
    message = refused(text, tmp_path, **options)
    assert all(part in message for part in says.split("..."))


def test_one_of_two_fixes(tmp_path):
    """Locks out the first fix in the place of the one that --fix names, as a message advises."""
    ask = advised(refused(TWO, tmp_path), ID="2")
    assert take(tmp_path / "in.bad", tmp_path / "two", **ask).rigid.group == "b"
