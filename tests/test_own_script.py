"""A user's own input script: what is read of it, what is found, and that nothing of it changes.

Held against LAMMPS itself, which runs the same script as it is, and against what is known of the
scripts that `scripts` writes.
"""

import fcntl
import functools
import json
import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import scripts
from conftest import Silent
from scipy.sparse.csgraph import shortest_path

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation import command_line
from validation.__main__ import main
from validation.bodies import command as bodies
from validation.bodies import parts
from validation.check import measure as check
from validation.ensembles.lengths import Lengths, One
from validation.ensembles.plan import SCHEMES
from validation.ensembles.runs import Runs
from validation.own import (
    counted,
    finding,
    lists,
    report,
    schemes,
    script,
    shapes,
    stress,
    system,
    trial,
    turns,
)
from validation.own.finding import Unclear
from validation.running import lammps_log, machine, rounds, run, startup
from validation.running.store import Store
from validation.sampling import plan as sampling_plan
from validation.scenes import SCENES
from validation.scenes.integrators import Integrator
from validation.statistics import measures, structure
from validation.statistics.estimate import Estimate

KINDS = ("spce", "co2", "rings", "polymer", "clusters")
BODIES = {"spce": 64, "co2": 125, "rings": 64, "polymer": 27, "clusters": 64}
ENSEMBLE = {"spce": "nvt", "co2": "npt", "rings": "nve", "polymer": "nvt", "clusters": "nve"}


def take(path, out, ranks=1, **ask):
    """What the harness makes of a script."""
    return system.take(system.Ask(str(path), **ask), out, ranks, 300.0, tell=lambda line: None)


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """What `take` makes of a script of `scripts` as it is, once."""

    @functools.cache
    def make(kind):
        folder = tmp_path_factory.mktemp(kind)
        return take(getattr(scripts, kind)(folder), folder / "out")

    return make


def refused(text, tmp_path, **ask):
    """The one message that ends the reading of a script with these commands."""
    path = tmp_path / "in.bad"
    path.write_text(text)
    with pytest.raises(SystemExit) as end:
        take(path, tmp_path / "out", **ask)
    message = str(end.value.code)
    assert "\n" not in message and message.startswith("in.bad: ")
    return message


GAS = """units lj
region box block 0 6 0 6 0 6
create_box 1 box
create_atoms 1 single 1 1 1
create_atoms 1 single 2 1 1
create_atoms 1 single 4 4 4
create_atoms 1 single 4 4.8 4
mass 1 1
group a id 1 2
group b id 3 4
pair_style zero 2.0
pair_coeff * *
"""


# ---- the language


def test_lines_words_and_branches_are_lammpss():
    """Locks out a continued line, a comment in quotes, triple quotes or an elif that LAMMPS reads
    otherwise."""
    text = 'print "a # b" # c\nfix 1 &\n  all nve # x\nprint """one\ntwo"""\n\n# nothing\n'
    assert [script.texts(line) for line in script.lines(text)] == [
        ["print", "a # b"],
        ["fix", "1", "all", "nve"],
        ["print", "one\ntwo"],
    ]
    found = script.words("fix p all print 10 \"$x 'y'\" file 'a b.txt'")
    assert [word.text for word in found][5:] == ["$x 'y'", "file", "a b.txt"]
    words = script.words('if "$a > 1" then "run 1" "run 2" elif "$a" "run 3" else "jump SELF x"')
    assert script.branches(words) == [
        ('"$a > 1"', ["run 1", "run 2"]),
        ('"$a"', ["run 3"]),
        (None, ["jump SELF x"]),
    ]
    line = "fix m all ave/time 1 5 5 c_t file out.txt mode scalar"
    assert script.without_files(line) == "fix m all ave/time 1 5 5 c_t mode scalar"
    assert script.without_files("fix 1 all rigid molecule infile file") != ""


def test_the_commands_are_those_that_lammps_does(tmp_path):
    """Locks out a loop, a jump, a condition or a variable of the command line that is followed
    otherwise than LAMMPS does: both set the same variable."""
    (tmp_path / "more.in").write_text('variable text string "${text}+m"\n')
    path = tmp_path / "in.loop"
    path.write_text(
        GAS
        + """variable text string s
variable n index 2
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
variable t equal 2*$(v_i)
fix 1 all rigid/nve group 2 a b
timestep $(v_t/1000)
print "says ${text} $t"
run 1
"""
    )
    for more in [], ["-var", "n", "3"]:
        command = ["lmp", "-in", str(path), "-log", str(tmp_path / "log"), *more]
        subprocess.run([str(Path(sys.executable).with_name(command[0])), *command[1:]], check=True,
                       cwd=tmp_path, stdout=subprocess.DEVNULL)  # fmt: skip
        log = (tmp_path / "log").read_text()
        told = next(line for line in log.splitlines() if line.startswith("says ")).split()[1:]
        variables = (("n", "3"),) if more else ()
        own = take(path, tmp_path / "out", variables=variables)
        last = [one for one in own.scene.setup if one.startswith("variable text")][-1]
        assert last.split()[-1] == told[0]
        assert own.scene.dt == float(told[1]) / 1000


def test_scripts_are_read_with_the_package_that_is_installed():
    """Locks out the checkout's fix_nosquish in its place, which is not what users' runs have, and
    compiles its loops anew."""
    code = (
        f"import runpy; runpy.run_path({str(system.READER)!r}, run_name='reader')\n"
        "import fix_nosquish; print(fix_nosquish.__file__)"
    )
    how = {"capture_output": True, "text": True, "timeout": 100, "check": True, "cwd": "/"}
    done = subprocess.run([sys.executable, "-c", code], **how)
    assert Path(done.stdout.split()[-1]).resolve().parent == startup.package().resolve()


# ---- scripts of five kinds


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.timeout(600)
def test_a_script_is_found_and_begins_as_in_lammps(kind, ranks, tmp_path):
    """Locks out a scene that is another system than the script's: the first step's energies are
    those that LAMMPS prints for the script itself, and the user's files are as they were."""
    path = getattr(scripts, kind)(tmp_path)
    before = {one: one.read_bytes() for one in tmp_path.rglob("*") if one.is_file()}
    out = tmp_path / "out"
    own = take(path, out, ranks)
    assert own.bodies == BODIES[kind]
    assert own.found.state.ensemble == ENSEMBLE[kind]
    assert own.reference in own.integrators
    how = {"dt": own.scene.dt, "every": 1, "ranks": ranks}
    yours = own.integrators[own.reference]
    result = run.run(run.job(own.scene, yours, out / "yours", [2], **how))
    assert result.error is None
    after = {one: one.read_bytes() for one in tmp_path.rglob("*")
             if one.is_file() and out not in one.parents}  # fmt: skip
    assert before == after
    log = (out / "script" / "log.lammps").read_text()
    theirs = lammps_log.thermo(log.replace("thermo_style", ""))
    energy = theirs["PotEng"][-1] if "PotEng" in theirs else theirs["E_pair"][-1]
    atoms = len(own.found.body) if own.scene.units == "lj" else 1
    if kind not in ("polymer", "clusters"):  # there thermo has other energies, too
        assert result.thermo["PotEng"][0] == pytest.approx(energy * atoms, rel=1e-4)
    assert result.positions.bodies.max() == own.bodies


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.timeout(900)
def test_each_integrator_moves_each_kind(kind, tmp_path, monkeypatch):
    """Locks out a line that LAMMPS or our fix does not take: all integrators do some steps, from
    the same temperature.

    New memory is full of large numbers, so nobody uses it before it is set (as the keyword
    langevin of LAMMPS's rigid/small does, of 22 Jul 2025).
    """
    monkeypatch.setenv("MALLOC_PERTURB_", "170")
    path = getattr(scripts, kind)(tmp_path)
    own = take(path, tmp_path / "out")
    rows, interrupted = check._starts(own, tmp_path / "out", 1, 300.0, Silent())
    assert not interrupted
    assert [row["error"] for row in rows] == [None] * len(rows)
    kelvin = [row["temperature"] for row in rows]
    assert np.ptp(kelvin) < 1e-3 * np.mean(kelvin)
    kinds = {one.kind for one in own.integrators.values()}
    assert kinds >= {"ours", "rigid"} and (kind != "spce" or "constraints" in kinds)


def test_outputs_are_left_out_and_walls_stay(tmp_path):
    """Locks out a file that the script would write, or a fix of the script's that is lost."""
    own = take(scripts.clusters(tmp_path), tmp_path / "out")
    lines = [*own.scene.setup, *own.scene.then]
    assert any("wall/lj93" in line for line in lines) and "fix_modify wall energy yes" in lines
    assert not any("means.txt" in line for line in lines)
    assert any("means.txt" in line for line in own.said["left_out"])
    assert not list(tmp_path.rglob("means.txt"))


def test_a_script_is_read_anew_only_if_it_changed(tmp_path):
    """Locks out a stale reading, and one that is done again for nothing, which would begin all runs
    from another state."""
    path = scripts.rings(tmp_path)
    (tmp_path / "notes").write_text("of no command")
    first = take(path, tmp_path / "out")
    ask, folder = first.ask, first.scene.folder.parent
    assert system._known(ask, folder, 1, everything=False)
    assert not system._known(ask, folder, 1, everything=True)  # bodies stops at another run
    names = {one.name for one in first.scene.folder.iterdir()}
    assert names == {"rings.data", "state.dump", "bodies.npy"}
    (tmp_path / "notes").write_text("changed")
    log = (tmp_path / "out" / "script" / "log.lammps").read_text()
    assert "thermo_modify flush yes\nrun 0\n" in log  # else it is silent, and taken for hung
    dump = first.scene.folder / "state.dump"
    stamp = dump.stat().st_mtime_ns
    take(path, tmp_path / "out")
    assert dump.stat().st_mtime_ns == stamp
    data = tmp_path / "rings.data"
    data.write_text(data.read_text().replace("13.019", "14.5"))
    again = take(path, tmp_path / "out")
    assert again.atoms["mass"][0] == 14.5


def test_runs_follow_from_all_files_of_the_script(tmp_path):
    """Locks out results of a file that is another one now, in a folder below, above or anywhere;
    and a copy of one that is above, outside of the output folder."""
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
    one = own.integrators[own.reference]
    keys = {machine.origin(own.scene, one)}
    for file in files:
        file.write_text(file.read_text() + "\n")
        scene = replace(own.scene, origin=system._contents(own.said["files"]))
        keys.add(machine.origin(scene, one))
    assert len(keys) == 4
    assert machine.origin(take(path, out).scene, one) in keys - {machine.origin(own.scene, one)}
    assert [one.name for one in out.rglob("*.mol")] == ["sub.mol"]


# ---- runs before the one that is compared


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
    assert own.said["run"] == "run 100" and own.said["skipped"] == 2
    assert "variable seen equal 250" in own.scene.setup
    assert own.said["temperature"] == pytest.approx(1.5) and own.said["later"] == []
    told = {"run 0": False, "run 5": True, "run 5 upto": False, "minimize 0 0 1 1": False,
            "run 9 upto": True, "rerun a dump x": False, "tad 1": True}  # fmt: skip
    assert {line: script.takes_time(line, 5) for line in told} == told
    then = ["fix h a spring/self 5", "fix 2 a nve", "run 9", "fix k b spring/self 1"]
    (late,) = system._late(then)  # it is said what is not where the script has it
    assert late.endswith(": fix h a spring/self 5.") and not system._late(then[3:])
    assert script.without_step("read_dump a 5 x y format native") == (
        "read_dump a 5 x y timestep no format native"
    )


def test_a_script_with_ours_is_read_as_ours_is(staged):
    """Locks out the fix's group for the class's, points that nobody moves, `moments equal 6` as one
    word, a variable's temperature, the first line of a fix that is defined twice, and a lost
    fix_modify."""
    _, own, folder = staged
    found = own.found
    assert (found.group, found.points, found.rest) == ("bodies", "points", True)
    assert found.body.tolist() == [1, 1, 2, 2, 0, 0, 0]
    assert found.state == finding.State(("15e-1", "15e-1", "1"))
    assert found.dropped == ("moments equal 6",)
    assert shapes.temperature(own) == 1.5
    assert not any("fix_nosquish" in line for line in (*own.scene.setup, *own.scene.then))
    yours = own.integrators["yours"]
    assert yours.then == ("fix_modify 1 virial yes",)
    assert any("own integrator only: fix_modify 1 virial yes." in line for line in own.notes)
    rows, _ = check._starts(own, folder / "out", 1, 300.0, Silent())
    assert [row["error"] for row in rows] == [None] * len(rows)
    held = replace(found, constraints="b 1")
    lines = next(schemes._constrained(held)).commands(own.scene)
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


def test_a_later_run_of_what_shake_holds(tmp_path, monkeypatch):
    """Locks out the state of rigid velocities at a step where nobody finds it; one that is half
    written, or that two processes write at once."""
    path = scripts.spce(tmp_path, lines="run 5", number=3)
    seen, once = [], run.run

    def watched(job):
        with Store(tmp_path / "out", "").locked("script", fcntl.LOCK_EX | fcntl.LOCK_NB) as free:
            seen.append(free)
        if len(seen) == 1:
            Path(job.directory).mkdir()
            (Path(job.directory) / "state.dump").write_text("half")
            raise KeyboardInterrupt
        return once(job)

    monkeypatch.setattr(system.run, "run", watched)
    with pytest.raises(KeyboardInterrupt):
        take(path, tmp_path / "out", at=2)
    own = take(path, tmp_path / "out", at=2)
    monkeypatch.undo()
    assert seen == [False, False] and own.said["step"] == 5
    shake = own.integrators["shake"]
    how = {"dt": own.scene.dt, "every": 1}
    result = run.run(run.job(own.scene, shake, tmp_path / "shake", [2], **how))
    assert result.error is None and result.thermo["Step"].tolist() == [0, 1, 2]


def test_what_a_run_changes_is_changed_once_in_two_dimensions(tmp_path):
    """Locks out a ramp that begins anew in each part of a run, and coordinates that LAMMPS refuses
    to read in two dimensions."""
    flat = GAS.replace("units lj\n", "units lj\ndimension 2\n").replace("6 0 6\n", "6 -0.5 0.5\n")
    flat = flat.replace("1 1\ncreate", "1 0\ncreate").replace(" 4\n", " 0\n")
    flat = flat.replace("group b id 3 0\n", "group b id 3 4\n")
    path = tmp_path / "in.flat"
    path.write_text(
        flat + "velocity all create 1 5\nfix plane all enforce2d\nfix 1 a rigid/nve single\n"
        "fix box all deform 1 x delta 0 3 remap none\nrun 10\n"
    )
    own = take(path, tmp_path / "out")
    how = {"dt": 0.001, "every": 0}
    job = run.job(own.scene, own.integrators[own.reference], tmp_path / "run", [10, 20], **how)
    result = run.run(job)
    assert result.error is None
    assert result.positions.cells[:, 0, 0] == pytest.approx([6, 7, 9])
    ramp = finding.State(("300", "300.0", "1"), (("iso", "1", "2", "9"), ("x", "1", "1", "9")))
    assert ramp.ramps == ["iso from 1 to 2"]
    with pytest.raises(SystemExit, match=r"in\.flat: 'run 10' changes iso from 1 to 2, so means"):
        system.refuse_ramps(replace(own, found=replace(own.found, state=ramp)))


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


def test_a_start_has_no_longer_step_than_the_script(tmp_path):
    """Locks out a start of `sampling` that breaks, of a script whose step is a short one."""
    scene, starter = SCENES["water"], SCHEMES["langevin-5"]
    for dt, steps in ((0.5, 40), (4.0, 10)):
        runs = Runs(replace(scene, dt=dt), starter, Lengths(0.02), tmp_path, 9.0, lambda *_: [])
        job = runs.start(1)
        assert f"timestep {min(dt, 2.0)}" in job.commands and job.runs == [steps]
        one = One("x", "x", starter, dt, 1)
        assert any(f'state.dump" {steps} x' in line for line in runs.job(one).commands)


# ---- what is found


def test_atoms_with_molecule_id_0_are_a_body():
    """Locks out atoms that are taken for free, while all rigid fixes weld them into one body."""
    atoms = {"molecule": np.array([0, 3, 3, 0, 1]), "mask": np.array([1, 1, 1, 1, 0])}
    said = {"groups": ["all"], "run": "run 1", "skipped": 0, "step": 0, "left_out": []}
    said |= {"later": [], "at": 1}
    body = finding.numbers(said, atoms, "all", ["molecule"])
    assert body.tolist() == [1, 2, 2, 1, 0]
    line = "fix 1 all rigid/nve molecule"
    found = finding.Found(
        ("1",), (line,), "rigid/nve", "rigid", "all", "molecule", finding.State(), body
    )
    assert any(
        "The 2 atoms with molecule-ID 0" in one for one in schemes.summary(found, said, atoms)
    )


def test_numbers_of_a_fix_python_move_have_no_point():
    """Locks out a temperature that our fix reads otherwise."""
    for word in "298.15", "0.5", "1.0", "300", "1e-3", "2.50", "-1.25", "0.001":
        plain = schemes.undotted(word)
        assert "." not in plain and float(plain) == float(word)
    assert schemes.undotted("v_T") == "v_T"


def test_water_beside_a_molecule_that_shake_holds_in_part(tmp_path):
    """Locks out a rigid part that is none: shake holds a bond of a flexible molecule beside rigid
    water, as scripts of proteins do. Only the water becomes bodies; all begins with each line."""
    path = scripts.solute(tmp_path)
    own = take(path, tmp_path / "out")
    assert own.bodies == 27
    assert own.found.rest and own.found.holder
    assert (own.found.body[-4:] == 0).all()
    rows, _ = check._starts(own, tmp_path / "out", 1, 300.0, Silent())
    assert [row["error"] for row in rows] == [None] * len(rows)


def test_flexible_water_is_made_rigid_by_options(tmp_path):
    """Locks out a script without rigid fix that --group and --bodies do not make rigid."""
    path = scripts.spce(tmp_path, fix="group w type 1 2\nfix move all nve", number=3)
    assert "no run of the script has a fix" in refused(
        path.read_text().replace("parts/", f"{tmp_path}/parts/"), tmp_path
    )
    own = take(path, tmp_path / "own", group="w", bodies="molecule")
    assert own.bodies == 27 and own.reference == "nosquish"


@pytest.mark.parametrize("ranks", [1, 2])
def test_bodies_by_an_atom_style_variable(ranks, tmp_path):
    """Locks out bodies that a variable tells and nobody reads, in LAMMPS's examples/rigid, or that
    are put to the wrong atoms where these are on two ranks."""
    path = tmp_path / "in.variable"
    told = "variable b atom 5*(id<=2)+2*(id>2)\n"
    mapped = GAS.replace("units lj\n", "units lj\natom_modify map yes\n")
    for one, other in (("1 1 1", "5 4 4"), ("2 1 1", "5 4.8 4"), ("4 4 4", "1 1 1"),
                       ("4 4.8 4", "2 1 1")):  # fmt: skip
        mapped = mapped.replace(f"single {one}", f"single  {other}", 1)
    path.write_text(mapped + told + "fix 1 all rigid/nve custom v_b\nrun 1\n")
    own = take(path, tmp_path / "out", ranks)
    assert own.found.body.tolist() == [2, 2, 1, 1]
    rows, _ = check._starts(own, tmp_path / "out", ranks, 300.0, Silent())
    assert [row["error"] for row in rows] == [None] * len(rows)


# ---- scripts that cannot be taken


def test_scripts_that_cannot_be_taken_say_why_in_one_line(tmp_path):
    """Locks out a traceback, a guess, or a message that does not say what to do."""
    two = GAS + "fix 1 a rigid/nve single\nfix 2 b rigid/nve single\nrun 1\n"
    message = refused(two, tmp_path)
    assert "2 fixes could be meant: 1 (rigid/nve on a), 2 (rigid/nve on b)" in message
    assert "--fix ID" in message
    path = tmp_path / "in.two"
    path.write_text(two)
    assert take(path, tmp_path / "two", fix=("2",)).found.group == "b"
    message = refused(GAS + "fix 1 all nve\nrun 100000000\n", tmp_path)
    assert "run 100000000: 1 (nve on all)" in message and "--bodies molecule" in message
    assert "has no run" in refused(GAS, tmp_path)
    message = refused(GAS + "jump /dev/nothing\n", tmp_path)
    assert "there is no file /dev/nothing" in message
    assert "has no label there" in refused(GAS + "jump SELF there\n", tmp_path)
    message = refused("jump SELF\n", tmp_path)
    assert "a loop of the script have no end" in message
    wrong = GAS + "fix 1 all rigid/nve molecule\nrun 1\n"
    assert "the script failed at 'fix 1 all rigid/nve molecule'" in refused(wrong, tmp_path)
    late = GAS.replace("pair_coeff * *\n", "") + "fix 1 a rigid/nve single\nrun 1\n"
    assert "coeffs are not set" in refused(late, tmp_path)
    with pytest.raises(SystemExit, match="there is no script"):
        take("nothing", tmp_path)
    assert "put the commands that would be typed" in refused("jump /dev/stdin\n", tmp_path)
    assert "the file includes itself" in refused("include in.bad\n", tmp_path)
    with_gap = GAS + "group one id 2\ndelete_atoms group one compress no\n"
    message = refused(with_gap + "fix 1 b rigid/nve single\nrun 1\n", tmp_path)
    assert "atom IDs are not 1 to 3 at 'run 1' (the largest is 4)" in message
    bare = "".join(line for line in GAS.splitlines(True) if line.split()[0] != "create_atoms")
    bare = bare.replace("id 1 2", "empty").replace("id 3 4", "empty")
    message = refused(bare + "fix 1 all nve\nrun 1\n", tmp_path, group="all", bodies="molecule")
    assert "there are no atoms at 'run 1'" in message
    (tmp_path / "in.bad").write_bytes(b"\xff\xfe")
    with pytest.raises(SystemExit, match=r"in\.bad is no text"):
        take(tmp_path / "in.bad", tmp_path / "out")


def test_an_integrator_that_is_none_is_refused(capsys):
    """Locks out a word behind --only that is passed over in silence."""
    with pytest.raises(SystemExit, match="2"):
        command_line.chosen_of({"a": 1, "b": 2}, ["x"])
    assert "there is no integrator x: choose from a, b" in capsys.readouterr().err
    assert command_line.chosen_of({"a": 1, "b": 2}, None) == [1, 2]


def test_a_word_too_many_is_answered_with_the_verbs_usage(capsys):
    """Locks out steps with blanks between them, that are answered with how all verbs are used."""
    with pytest.raises(SystemExit, match="2"):
        main(["sampling", "water", "--dt", "4", "6", "--short", "8"])
    told = capsys.readouterr().err
    assert "unrecognized arguments" in told and "--dt FS,FS" in told


# ---- numbers


def test_shapes_of_known_bodies(tmp_path):
    """Locks out a moment, a size or a number of degrees of freedom that is not the body's own."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    (kind,) = shapes.kinds(own, shapes.bodies(own))
    assert (kind.number, kind.atoms, kind.shape, kind.freedom) == (125, 3, "linear", 5)
    assert kind.size == pytest.approx(2.32, rel=1e-9)
    assert kind.moments[0] == pytest.approx(2 * 15.999 * 1.16**2, rel=1e-9)
    kt = 0.0019872067 * 250 / 2390.0573615334906
    assert kind.angle == pytest.approx(2 * np.sqrt(kt / kind.moments[0]), rel=1e-6)


def test_temperatures_of_bodies_are_those_they_were_given(tmp_path):
    """Locks out degrees of freedom that are counted wrongly: bodies with velocities drawn for a
    temperature have it, in translation and in rotation."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    random, kelvin, frames = np.random.default_rng(1), 250.0, 400
    made = shapes.bodies(own)
    (group,), (r,), (moments,), (axes,) = made.groups, made.apart, made.moments, made.axes
    scale = own.said["boltzmann"] * kelvin / shapes.mvv2e(own)
    mass = own.atoms["mass"]
    centre = random.normal(size=(frames, len(group), 3)) * np.sqrt(scale / mass[group[0]].sum())
    spin = random.normal(size=(frames, len(group), 3)) * np.sqrt(
        np.where(moments > 1e-6 * moments[:, :1], scale / np.maximum(moments, 1e-12), 0.0)
    )
    omega = np.einsum("bik,fbk->fbi", axes, spin)
    v = np.zeros((frames, len(mass), 3))
    v[:, group] = centre[:, :, None] + np.cross(omega[:, :, None], r)
    x = np.broadcast_to(own.atoms["x"], v.shape)
    cells, periodic = np.array([own.said["cell"]] * frames), np.array([True] * 3)
    positions = run.Positions(x, own.found.body, cells, periodic, v=v, mass=mass)
    rest = shapes.freedom_of_turning(own)
    assert rest == 2 * own.bodies  # of linear ones
    moving, turning = trial._temperatures(own, structure.Motion(positions), range(frames), rest)
    assert moving.mean() == pytest.approx(kelvin, rel=0.01)
    assert turning.mean() == pytest.approx(kelvin, rel=0.01)


def test_targets_are_those_that_a_script_has(tmp_path):
    """Locks out a target that says nothing of a script, one that is not known, and a barostat
    whose work counts as unknown: econserve has it, with each of ours."""
    co2 = take(scripts.co2(tmp_path), tmp_path / "out")
    assert set(trial.targets(co2, {})) == {"drift", "energy", "temperature", "density", "rdf"}
    assert trial.targets(co2, {"drift": 1.0})["drift"] == 1.0
    with pytest.raises(LookupError, match="there is no target speed"):
        trial.targets(co2, {"speed": 1.0})
    spce = take(scripts.spce(tmp_path), tmp_path / "out2")
    found = trial.targets(spce, {"energy": 0.1})
    assert found["energy"] == 0.1 and found["drift"] == trial.HEATED
    assert "density" not in found
    path = scripts.rings(tmp_path)
    rings = take(path, tmp_path / "out3")
    assert "energy" not in trial.targets(rings, {})  # fix langevin stays
    with pytest.raises(LookupError, match="drift says nothing of this script"):
        trial.targets(rings, {"drift": 1.0})
    text = path.read_text().replace("timestep 4", "unfix heat\ntimestep 4")
    path.write_text(text)
    assert "energy" in trial.targets(take(path, tmp_path / "out3"), {})
    press = "unfix heat\nfix press all press/berendsen iso 1 1 1000\ntimestep 4"
    path.write_text(text.replace("unfix heat\ntimestep 4", press))
    assert "energy" not in trial.targets(take(path, tmp_path / "out3"), {})  # as this one does


def test_energies_that_other_fixes_give_and_nobody_counts(tmp_path):
    """Locks out a drift that is the work of a wall, whose energy LAMMPS counts only if it is asked
    to; and one that is asked for and then left out."""
    path = scripts.clusters(tmp_path)
    own = take(path, tmp_path / "out")
    assert counted.acting(own) == ["wall"] and not counted.lacking(own)
    assert {"drift", "energy"} <= set(trial.targets(own, {}))
    path.write_text(path.read_text().replace("fix_modify wall energy yes\n", ""))
    own = take(path, tmp_path / "out")
    assert counted.lacking(own) == ["wall"]
    assert set(trial.targets(own, {})) == {"temperature"}
    with pytest.raises(LookupError, match="what fix wall does to the energy is not counted"):
        trial.targets(own, {"drift": 1.0})
    for commands, asked in (
        (["fix a all indent", "fix_modify a energy yes"], {"a"}),
        (["fix_modify a energy yes", "fix a all indent"], set()),
        (["fix_modify a virial yes energy yes", "fix_modify a energy no"], set()),
    ):
        assert counted._asked(commands) == asked


def test_targets_of_bodies_at_rest_are_refused(tmp_path):
    """Locks out runs of some minutes that end in a division by zero, for nothing moves."""
    path = tmp_path / "in.rest"
    path.write_text(GAS + "fix 1 a rigid/nve  single\nrun  1\n")
    with pytest.raises(LookupError, match="the atoms are at rest at 'run 1'"):
        trial.targets(take(path, tmp_path / "out"), {})


def test_longer_steps_tell_the_error_of_shorter_ones():
    """Locks out an error bar that is not that of the square law, a longer step whose error has
    grown faster, and an error that no step makes smaller and passes for a small one."""
    random, covered, surer = np.random.default_rng(3), [], []
    for _ in range(400):
        held = Estimate(5.0 + random.normal() * 0.02, 0.02)
        found = {
            dt: Estimate(5.0 + 0.1 * dt**2 + random.normal() * 0.05, 0.05) for dt in (1.0, 2.0, 4.0)
        }
        one = trial.by_law(1.0, found, held)
        covered.append(abs(one.value - 0.1) < one.margin)
        surer.append(one.margin < measures.difference(found[1.0], held).margin / 4)
    assert np.mean(surer) > 0.9  # else chi-squared is large by chance
    assert 0.92 < np.mean(covered) < 0.98
    law = {dt: Estimate(0.1 * dt**2, 0.01) for dt in (1.0, 2.0)}
    first = trial.by_law(1.0, law)
    assert trial.by_law(1.0, law | {4.0: Estimate(9.0, 0.01)}) == first
    same = {dt: Estimate(0.1, 0.01) for dt in (1.0, 2.0, 4.0)}
    assert trial.by_law(1.0, same) == same[1.0]
    assert trial.by_law(4.0, law | {4.0: Estimate(9.0, 0.01)}).value == 9.0  # not from shorter ones
    # held against a step of the same integrator, which has a part of the error itself
    for steps in (2.0,), (2.0, 4.0):
        errors = {dt: Estimate(0.1 * dt**2, 0.01) for dt in steps}
        assert trial.by_law(2.0, errors, Estimate(0.1), 1.0).value == pytest.approx(0.4)
    still = {dt: Estimate(1.0) for dt in (1.0, 2.0)}
    assert trial.by_law(1.0, still, Estimate(1.0)).value == 0.0


@pytest.mark.parametrize(
    "steps", [(0.5, 1.0), (0.5,), (0.5, 1.0, 2.0, 4.0), (1.0, 2.0, 4.0), (2.0,)]
)
def test_steps_around_that_of_the_reference_have_their_own_errors(steps):
    """Locks out an error with the wrong sign, none, or an error bar that does not cover, of steps
    that are shorter than that of the reference, and of the reference's own."""
    random, finer, covered = np.random.default_rng(11), 1.0, []
    for _ in range(400):
        means = {dt: Estimate(3.0 + 0.1 * dt**2 + 0.02 * random.normal(), 0.02) for dt in steps}
        means.setdefault(finer, Estimate(3.1 + 0.02 * random.normal(), 0.02))
        for dt in means:
            one = trial.by_law(dt, means, means[finer], finer)
            covered.append(abs(one.value - 0.1 * dt**2) < one.margin)
    assert np.mean(covered) > 0.92
    exact = {dt: Estimate(3.0 + 0.1 * dt**2, 0.01) for dt in {*steps, finer}}
    for dt in exact:
        one = trial.by_law(dt, exact, exact[finer], finer)
        assert one.value == pytest.approx(0.1 * dt**2)
    assert trial.by_law(finer, {finer: exact[finer]}, exact[finer], finer) is None
    # g(r) alike: errors 0.1 dt^2 in each bin, with noise
    g = {dt: 0.1 * dt**2 + 1e-4 * random.normal(size=(10, 50)) for dt in exact}
    alike = {dt: {"rdf": one} for dt, one in g.items()}
    for dt in exact:
        one = trial._of_rdf(dt, alike, alike[finer], finer)
        assert one.value == pytest.approx(0.1 * dt**2, rel=0.01)
    assert trial._of_rdf(finer, {finer: alike[finer]}, alike[finer], finer) is None


def energies(own, series, apart):
    """What is made of a series of the energy, with samples so far apart."""
    time = apart * np.arange(len(series))
    return trial._of_energy(own, {"time": time, "conserved": series, "kinetic": 2.0, "freedom": 9})


@pytest.mark.parametrize("kind", ["rings", "spce"])
def test_the_energys_change_is_what_is_said_of_it(kind, taken):
    """Locks out a number that depends on how often the energy is looked at, which errors of some
    steps vanish from, or on the length of the run, which the wander at a cutoff grows with."""
    own = taken(kind)
    step = own.scene.dt
    span = trial.SPAN * step
    random = np.random.default_rng(2)
    walk = np.cumsum(random.normal(size=400_000)) / np.sqrt(trial.SPAN)  # a variance of 1 in it
    angle = np.cumsum(0.2 * random.normal(size=len(walk)))  # forgotten in about 50 steps
    energy = walk + np.sqrt(2) * np.sin(angle) + random.normal(size=len(walk))
    for stride in (1, 12, 48, 96):
        for part in (1, 10):
            found = energies(own, energy[: len(energy) // part : stride], stride * step)["energy"]
            forgotten = 1 - np.exp(-0.02 * trial.SPAN)
            right = np.sqrt(0.5 + forgotten + 1) / 2.0
            assert abs(found.value - right) < 2 * found.margin < 0.3
    about = trial._about(own, {"energy": 0.2, "drift": 1.0})
    assert f"kept in {span:g} fs, rms" in about["energy"]["what"]
    heated = kind == "spce"
    assert about["drift"]["default"] == (trial.HEATED if heated else 0.01)  # the page says it, too


@pytest.mark.parametrize("long", [1200.0, 4e4, 1e6, 1e8])
def test_samples_of_the_energy_are_equally_apart(long):
    """Locks out samples whose distance depends on the step, on the budget, or differs within a
    run; and runs that are longer or shorter than was planned."""
    for frames in 20, 200, 1000:
        lengths = trial.Lengths(time=long, frames=frames, step=1e-3, dt=2.0)
        for factor in (0.5, *trial.FACTORS):
            dt = 2.0 * factor
            every, runs = lengths.every(dt), lengths.runs(dt)
            assert all(one % every == 0 for one in runs) and len(set(runs)) == 1
            if long >= trial.SPAN * 2.0 * frames:
                assert sum(runs) * dt == pytest.approx(long, rel=0.1)
                span = trial.SPAN * 2.0 / (every * dt)
                assert span == pytest.approx(round(span)) and 1 <= round(span) <= 8
            assert 1 <= len(runs) <= frames


def test_parts_of_a_run_that_are_not_independent_make_no_error_of_g_smaller():
    """Locks out a step that is advised for a g(r) whose noise was taken for less than it is: of
    as many parts as a run is cut into, neighbours correlated, the bound holds as often as it
    says."""
    random, bins, true = np.random.default_rng(4), 50, 0.02
    held = []
    for _ in range(400):
        noise = random.normal(size=(trial.BLOCKS + 1, bins))
        off = true + 0.04 * (noise[1:] + 0.6 * noise[:-1])  # neighbours: 0.44
        found = measures.without_noise(off)
        held.append(true <= found.value + found.margin)
    assert np.mean(held) > 0.97


def test_integrators_whose_energy_says_nothing(taken):
    """Locks out a drift of rigid/nvt that is LAMMPS's bookkeeping, and such an integrator that is
    "not met" by it, or advised without a word."""
    own = taken("spce")
    wrong = {name for name, one in own.integrators.items() if counted.wrongly(one)}
    assert wrong == {"rigid/nvt", "rigid/nvt/small"}
    yours = Integrator("yours", "yours", ("fix 1 {group} rigid/small molecule langevin 1 1 1 5",))
    assert counted.wrongly(yours)
    random = np.random.default_rng(4)
    series = {"time": 16.0 * np.arange(500), "conserved": random.normal(size=500)}
    series |= {"kinetic": 1.0, "freedom": 9, "kinds": []}
    for name, one in own.integrators.items():
        found = trial._errors(own, trial.Point(one, 2.0), {2.0: series}, None, 0.0)
        assert set(found) == (set() if name in wrong else {"drift", "energy"})
    wanted = {"drift": 1.0, "temperature": 0.01}
    good = row(4.0, drift=Estimate(0.1, 0.01), temperature=Estimate(0.001, 1e-4))
    lost = row(6.0, name="rigid/nvt", temperature=Estimate(0.001, 1e-4))
    lost |= {"uncounted": True, "cost": measures.spread([0.5])}
    choice, told, _ = report.answer(summary_of(wanted, good, lost))
    assert choice.best == good
    (first, second) = told[-2:]
    assert "Of rigid/nvt nobody knows drift: LAMMPS's econserve" in first
    assert "But for that, rigid/nvt with 6 fs is within the targets" in second
    longest, _ = report.tables(summary_of(wanted, good, lost))
    assert [one[-1].text for one in longest.rows] == ["met", "met by the rest"]
    choice, told, _ = report.answer(summary_of(wanted, lost))
    assert choice.best is None and told == [first, second]


def row(dt, name="nosquish", cost=(1.0,), **errors):
    """A row of a trial."""
    spent = measures.spread(cost)
    return {
        **{"integrator": name, "label": name, "dt": dt, "lines": [f"fix {name}"], "failed": None},
        **{"is_reference": False, "asked": True, "uncounted": False, "ours": name == "nosquish"},
        **{"cost": spent, "rough": spent, "signed": {}},
        "errors": {key: error.plain() for key, error in errors.items()},
    }


def summary_of(targets, *rows):
    """A trial's summary."""
    summary = {"targets": targets, "points": list(rows), "units": "real", "late": False}
    return summary | {"ns": "ns", "ranks": 1, "minutes": 5.0, "dt": 2.0}


def test_the_reference_is_advised_if_its_step_was_asked_for():
    """Locks out the command that is advised where no step is short enough, and that cannot find
    ours good at the step of the reference; and one that is advised and was not asked for."""
    held = row(1.0, drift=Estimate(0.1, 0.01)) | {"is_reference": True}
    wanted = {"drift": 1.0}
    choice, _, lines = report.answer(summary_of(wanted, held))
    assert choice.best == held and "timestep 1" in lines
    longest, every = report.tables(summary_of(wanted, held))
    assert every.rows[0][-1].text == "reference, met" and len(longest.rows) == 1
    choice, told, _ = report.answer(summary_of(wanted, held | {"asked": False}))
    assert choice.best is None and told == ["No run is complete, so nothing is known yet."]
    alone = report.answer(summary_of({"drift": 1.0, "rdf": 0.1}, held))[1]  # no other step
    assert "another step of the same integrator to tell rdf. But for that" in alone[1]
    assert not any("inf" in line for line in alone)


def test_what_is_timed_could_be_advised():
    """Locks out costs of points that could not be advised, and points that could and have none."""
    wanted = {"drift": 1.0}
    good, wide, bad = (Estimate(value, error) for value, error in ((0.1, 0.1), (0.9, 0.1), (9, 1)))
    rows = [
        row(1.0, cost=[4.0], drift=good),
        row(2.0, cost=[2.0], drift=good),
        row(4.0, cost=[1.0], drift=wide),
        row(8.0, cost=[0.5], drift=bad),
        row(2.0, name="rigid/nve", cost=[2.4], drift=good),
        row(2.0, name="rigid", cost=[3.0], drift=good),
    ]
    found = trial._candidates(rows, wanted)
    assert [(one["integrator"], one["dt"]) for one in found] == [
        ("nosquish", 4.0),
        ("nosquish", 2.0),
        ("rigid/nve", 2.0),
    ]
    many = [row(dt, cost=[1 / dt], drift=wide) for dt in range(1, 20)]
    assert len(trial._candidates(many, wanted)) == trial.FASTEST
    assert not trial._candidates([row(1.0, drift=good) | {"asked": False}], wanted)


def test_what_is_timed_in_turn_is_done_by_one_process(taken, tmp_path, monkeypatch):
    """Locks out two processes of a folder that remove each other's runs while they time them, runs
    with samples, and work that is done again."""
    own = taken("rings")
    calls = []

    def in_turn(labels, make, number, meter):
        with Store(tmp_path / "out" / "records", "").locked(
            "timed", fcntl.LOCK_EX | fcntl.LOCK_NB
        ) as mine:
            assert not mine
        jobs = [make(name, 1) for name in labels]
        assert all("thermo 0" in job.commands and not job.body_property for job in jobs)
        calls.append([job.commands[-1] for job in jobs])
        return {name: [rounds.Timing(loop=2e6)] * number for name in labels}, {}, False

    monkeypatch.setattr(rounds, "in_turn", in_turn)
    ours = own.integrators["nosquish"]
    some = {"a": turns.Timed("a", ours, 2.0, [3, 40]),
            "b": turns.Timed("b", ours, 2.0, [3, 40], ("neighbor 1 bin",))}  # fmt: skip
    how = 3, tmp_path / "out", 1, 60.0, Silent()
    for _ in range(2):
        assert turns.loops(own, "timed", some, *how) == {"a": [2.0] * 3, "b": [2.0] * 3}
    assert calls == [["thermo 0", "neighbor 1 bin"]]
    turns.loops(own, "timed", {"a": some["a"]}, *how)
    assert len(calls) == 2


def test_lines_make_the_group_that_they_name(taken):
    """Locks out lines for the script that name a group that it does not have."""
    own = taken("solute")
    (group,) = own.found.setup
    held = trial.reference(own)
    done = {held: trial._Done("it heats", [], {})}
    (found,) = trial._rows(own, [held], [held], done, held, {})
    assert found["lines"][0] == group and "own_bodies" in found["lines"][-1]


def test_units_are_lammpss():
    """Locks out a temperature that is a thousand times too low in units electron."""
    code = (
        "import json, sys\nfrom mpi4py import MPI\nfrom lammps import lammps\n"
        "lmp, found = lammps(cmdargs=['-log', 'none', '-screen', 'none']), {}\n"
        "for name in sys.argv[1:]:\n"
        "    lmp.command('clear')\n    lmp.command(f'units {name}')\n"
        "    found[name] = lmp.extract_global('mvv2e')\nprint(json.dumps(found))"
    )
    names = "real", "metal", "electron", "lj", "si", "cgs", "micro", "nano"
    words = [sys.executable, "-c", code, *names]
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == {
        name: shapes.MVV2E.get(name, 1.0) for name in names
    }


def test_sizes_and_nearest_atoms_of_large_bodies(taken):
    """Locks out memory that grows as the square of a body's atoms, a size that is not a body's, and
    nearest atoms that are of one body, bonded, or not the nearest."""
    random = np.random.default_rng(8)
    for shape in ((1, 1, 1), (5, 1, 1), (3, 3, 0.01), (1, 0, 0)):
        small = random.normal(size=(7, 30, 3)) * shape
        apart = np.linalg.norm(small[:, :, None] - small[:, None], axis=3)
        assert shapes.width(small) == pytest.approx(apart.max())
        large = random.uniform(-1, 1, size=(3, 400, 3)) * shape
        apart = np.linalg.norm(large[:, :, None] - large[:, None], axis=3)
        assert 0.95 * apart.max() < shapes.width(large) <= apart.max() * (1 + 1e-12)
    assert shapes.width(np.zeros((5, 1, 3))) == 0.0
    huge = random.normal(size=(2, 20_000, 3))
    assert shapes.width(huge) > 2 * np.linalg.norm(huge, axis=2).max() * 0.8
    own = taken("rings")
    edge, places = own.said["cell"][0][0], own.atoms["x"]
    for number, seed in ((1, 0), (60, 1), (300, 2)):  # atoms of each body
        random = np.random.default_rng(seed)
        body = np.arange(len(places)) // number + 1
        x = random.uniform(0, edge, size=places.shape)
        if number != 60:
            body[:20] = 0
        else:  # dense ones, each far from the next: the nearest are of the same body
            x = edge * body[:, None] / (1 + body.max()) + random.uniform(0, 0.5, size=x.shape)
        x[1] = x[0] + 1e-4  # bonded, and in no body
        bonds = np.array([[1, 1, 2]])
        made = replace(own, found=replace(own.found, body=body),
                       atoms=own.atoms | {"x": x, "bonds": bonds})  # fmt: skip
        near = measures.nearest_image(x[:, None] - x, np.array(own.said["cell"]), [True] * 3)
        apart = np.linalg.norm(near, axis=2)
        apart[(body[:, None] == body) & (body > 0)] = np.inf
        apart[np.diag_indices(len(x))] = apart[0, 1] = apart[1, 0] = np.inf
        distance, i, j = shapes.nearest(made)
        assert distance == pytest.approx(apart.min()) == pytest.approx(apart[i - 1, j - 1])


def test_schemes_of_a_script_that_keep_the_momentum_are_known(taken, tmp_path):
    """Locks out a pressure that lacks kT over the volume where the momentum is kept at zero, and
    shares its limit with one that does not."""
    case = sampling_plan.of_script(taken("spce"))
    held = {name: scheme.held for name, scheme in case.schemes.items()}
    random = {"nosquish", "rigid/small+langevin"}
    assert random < set(held) and {"nosquish-csvr", "nosquish-nh", "rigid/nvt", "shake"} < set(held)
    assert held == {name: 0 if name in random else 3 for name in held}
    path = scripts.spce(tmp_path)
    path.write_text(path.read_text().replace("timestep", "fix pull all addforce 0 0 0\ntimestep"))
    case = sampling_plan.of_script(take(path, tmp_path / "out"))
    assert {scheme.held for scheme in case.schemes.values()} == {0}


def test_what_short_runs_cannot_tell_is_said_and_the_rest_answered():
    """Locks out an answer that says nothing, because one target is below what runs so short can
    tell; and a budget that would not tell it."""
    one = row(4.0, "ours", drift=Estimate(0.0, 0.1), energy=Estimate(0.1, 0.01))
    errors, summary = one["errors"], summary_of({"drift": 0.02, "energy": 0.2}, one)
    choice, told, lines = report.answer(summary)
    assert choice.best is None and not lines
    assert "About --budget 480 tells" in told[0]  # (1.96 * 0.1 / 0.02)^2 times 5
    assert "cannot tell drift below 0.2. But for that, ours with 4 fs" in told[1]
    errors["energy"] = Estimate(0.1, 0.2).plain()  # nor this
    assert not any("But for that" in line for line in report.answer(summary)[1])


@pytest.mark.timeout(600)
def test_what_breaks_on_a_script(tmp_path):
    """Locks out a number of the stress that cannot fail: a step that is far too long does, and runs
    of another length end elsewhere."""
    path = scripts.rings(tmp_path)
    text = path.read_text().replace("fix heat all langevin 300 300 200 11\n", "")
    path.write_text(text.replace("timestep 4", "timestep 10"))
    out = tmp_path / "out"
    words = ["--only", "nosquish", "--out", str(out)]
    assert main(["stability", str(path), *words]) == 0
    checks = json.loads((out / "summary.json").read_text())["checks"]
    parts = {part: [one for one in checks if one["part"] == part] for part in stress.TITLES}
    assert [one["verdict"] for one in parts["parts"] + parts["ranks"]] == ["holds"] * 2
    assert parts["step"][-1]["verdict"] == "does not hold"
    ends = [
        run.collect(out / "runs" / "nosquish" / name).positions.x[-1]
        for name in ("in-one", "in-two", "on-1-ranks")
    ]
    assert np.abs(ends[0] - ends[1]).max() < 1e-3 < np.abs(ends[0] - ends[2]).max()


# ---- the verbs


@pytest.mark.timeout(600)
def test_compare_and_bench_of_a_script(tmp_path, capsys):
    """Locks out a verb that ends with a script: both write their page and numbers."""
    path = str(scripts.polymer(tmp_path))
    out = tmp_path / "compare"
    words = ["--ranks", "1", "--rounds", "1", "--segment", "20", "--only", "nosquish",
             "rigid/nvt/small"]  # fmt: skip
    assert main(["compare", path, "--steps", "200", "--out", str(out), *words]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert [row["name"] for row in summary["integrators"]] == ["rigid/nvt/small", "nosquish"]
    assert all(row["distance"] is not None for row in summary["integrators"])
    judged = {row["name"]: row.get("energy_sd") is not None for row in summary["integrators"]}
    assert judged == {"rigid/nvt/small": False, "nosquish": True}
    assert "ε" in (out / "report.html").read_text()
    out = tmp_path / "bench"
    words = ["--ranks", "1", "--rounds", "1", "--seconds", "0.02", *words[-3:]]
    assert main(["bench", path, "--short", "--out", str(out), *words]) == 0
    (point,) = json.loads((out / "summary.json").read_text())["points"]
    assert point["bodies"] == 27 and all(row["modify"] for row in point["integrators"])


@pytest.mark.timeout(900)
def test_advise_names_a_step_that_is_good_and_not_one_that_fails(tmp_path, monkeypatch):
    """Locks out advice for a step at which the run heats or its energy fluctuates above the target:
    rings at constant energy, with a step that is safe and one that is far too long."""
    monkeypatch.setattr(trial, "LATE", 100)  # a busy machine takes longer than was planned
    monkeypatch.setattr(lists, "LEAST", 1)  # and its steps are too long for the skins
    path = scripts.rings(tmp_path)
    path.write_text(path.read_text().replace("fix heat all langevin 300 300 200 11\n", ""))
    out = tmp_path / "out"
    words = ["--budget", "0.2", "--steps", "4,60", "--only", "nosquish", "--out", str(out)]
    targets = ["--target", "energy=0.2", "drift=100", "temperature=1", "rdf=10"]
    assert main(["advise", str(path), *words, *targets]) == 0
    summary = json.loads((out / "summary.json").read_text())
    good, bad = (one for one in summary["points"] if not one["is_reference"])
    assert good["dt"] == 4 and good["errors"]["energy"]["value"] < 0.2
    assert bad["failed"] or bad["errors"]["energy"]["value"] > 0.2
    page = (out / "report.html").read_text()
    assert "fix_nosquish.NVE with a step of 4 fs" in page and "timestep 4" in page
    assert "By default 0.01: " in page and len(good["cost"]["values"]) == trial.ROUNDS
    assert bad["cost"] is None  # it is not timed
    skins = [one["command"] for one in summary["lists"]]
    assert skins == ["neighbor 2 bin", "neighbor 3 bin", "neighbor 4 bin"]  # LAMMPS's own is 2
    assert all(0.2 < one["min"] <= one["max"] < 5 for one in summary["lists"])
    assert "neighbor 3 bin" in page
    # again: nothing is run, and another process finds the same
    begin = {one: one.stat().st_mtime_ns for one in out.glob("runs/**/done.json")}
    assert begin and main(["advise", str(path), *words, *targets]) == 0
    assert begin == {one: one.stat().st_mtime_ns for one in begin}


def test_a_skin_is_advised_only_if_it_is_faster_in_each_round(tmp_path):
    """Locks out a skin that is as fast as the script's within the spread, a line for the script
    that is not the fastest skin's, and a skin that is not the last one of the script."""
    first = lists.Tried(command="neighbor 1 bin", median=1.0, min=1.0, max=1.0)
    mixed = lists.Tried(command="neighbor 1.5 bin", median=0.8, min=0.7, max=1.1)
    good = lists.Tried(command="neighbor 2 bin", median=0.9, min=0.85, max=0.95)
    assert lists.fastest([first, mixed]) is None
    assert lists.fastest([first, mixed, good]) == good
    summary = summary_of({}, row(8.0) | {"lines": ["fix 1"]}) | {"lists": [first, mixed, good]}
    _, told, lines = report.answer(summary)
    assert lines == ["fix 1", "timestep 8", "neighbor 2 bin"]
    assert any("0.90 (0.85 to 0.95)" in line for line in told)
    summary["lists"] = [first, mixed]
    _, told, lines = report.answer(summary)
    assert lines == ["fix 1", "timestep 8"] and any("not faster" in line for line in told)
    path = scripts.rings(tmp_path)
    own = take(path, tmp_path / "out")
    scene = replace(own.scene, setup=(*own.scene.setup, "neighbor 0.7 bin", "neighbor 1.4 multi"))
    assert lists.skin_of(own) == (2.0, "bin")
    assert lists.skin_of(replace(own, scene=scene)) == (1.4, "multi")


def test_rigid_parts_are_found_by_their_chemistry(tmp_path):
    """Locks out a part that is none, or one that is missed: toluene, methylammonium, cyclohexane
    and water, held against what chemistry says of them."""
    number, bonds, mass, x = 0, [], [], []

    def atom(element, place, to=None):
        nonlocal number
        number += 1
        mass.append(parts.ELEMENTS[element])
        x.append(place)
        if to:
            bonds.append((1, to, number))
        return number

    corners = 1.39 * np.array([[np.cos(a), np.sin(a), 0] for a in np.arange(6) * np.pi / 3])
    ring = [atom("C", place) for place in corners]
    bonds += [(1, a, b) for a, b in zip(ring, ring[1:] + ring[:1])]
    hydrogens = [atom("H", 1.8 * place, at) for place, at in zip(corners[1:], ring[1:])]
    methyl = atom("C", 2.1 * corners[0], ring[0])
    of_methyl = [atom("H", [3.3, y, z], methyl) for y, z in ((1, 0), (-0.5, 0.9), (-0.5, -0.9))]
    carbon = atom("C", [10, 0, 0])
    nitrogen = atom("N", [11.5, 0, 0], carbon)
    for at in carbon, nitrogen:
        for place in range(3):
            atom("H", [10.5 + place, 1, 1], at)
    chair = [atom("C", place + np.array([0, 10, (-1) ** i / 4])) for i, place in enumerate(corners)]
    bonds += [(1, a, b) for a, b in zip(chair, chair[1:] + chair[:1])]
    for at in chair:
        atom("H", [0, 12, 1], at), atom("H", [0, 12, -1], at)
    water = [atom("O", [0, 0, 9])]
    water += [atom("H", [1, 0, 9], water[0]), atom("H", [0, 1, 9], water[0])]
    atoms = {"mass": np.array(mass), "x": np.array(x, float), "bonds": np.array(bonds)}
    body, counts = parts.rigid(atoms, 40 * np.eye(3), [True] * 3)
    assert counts == {"water": 1, "CH3": 2, "NH3": 1, "rings": 1}
    found = {frozenset(1 + np.flatnonzero(body == one)) for one in range(1, 6)}
    assert {frozenset(ring + hydrogens), frozenset([methyl, *of_methyl]), frozenset(water)} < found
    assert body.max() == 5 and not body[np.array(chair) - 1].any()
    _, counts = parts.rigid(atoms, 40 * np.eye(3), [True] * 3, ["CH3"])
    assert counts == {"CH3": 2}


def test_a_data_file_with_bodies_is_read_by_lammps(tmp_path, capsys):
    """Locks out a data file that LAMMPS or our fix does not read as it was meant, or bodies of one
    kind that differ: flexible water, distorted, becomes bodies of one shape."""
    path = scripts.spce(tmp_path, fix="fix move all nve", number=3)
    field = tmp_path / "parts" / "spce.ff"  # the data file's coefficients have to go with it
    field.write_text(field.read_text().replace("bond_style harmonic\nbond_coeff 1 0 1.0\n", ""))
    with open(tmp_path / "parts" / "spce.data", "a") as file:
        file.write("\nBond Coeffs # harmonic\n\n1 0 1.0\n")
    text = path.read_text().replace("read_data", "bond_style harmonic\nread_data")
    path.write_text(text)
    assert main(["bodies", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "27 × water" in capsys.readouterr().out
    (tmp_path / "spce.data").write_bytes((tmp_path / "out" / "spce.data").read_bytes())
    lines = bodies._lines("property", "spce.data")
    assert "group bodies variable is_in" in lines
    text = text.replace("read_data parts/spce.data", "\n".join(lines[:4]))
    text = text.replace("fix move all nve", "\n".join(lines[5:6]))
    again = tmp_path / "in.again"
    again.write_text(text)
    own = take(again, tmp_path / "again")
    assert own.bodies == 27 and own.found.bodies == "custom i_body"
    (kind,) = shapes.kinds(own, shapes.bodies(own))
    assert kind.number == 27 and kind.scatter < 1e-6


@pytest.mark.parametrize(
    ("words", "pairs"),
    [
        ("", 0),  # LAMMPS's own factors are 0
        ("special_bonds lj/coul 0 0 1\n", 3),  # opposite atoms of a ring
        ("special_bonds lj 0 1 1 coul 0 0 0\n", 9),
        ("special_bonds lj/coul 1 1 1\ngroup exclude type 1\n", 15),
        ("special_bonds lj/coul 1 1 1\nneigh_modify exclude molecule/intra all\n", 0),
        ("special_bonds lj/coul 1 1 1\nneigh_modify exclude molecule/intra all\n"
         "neigh_modify exclude none\n", 15),
        ("special_bonds lj/coul 1 1 1\ngroup wall empty\n"
         "neigh_modify exclude group wall wall\n", 15),
        ("special_bonds lj/coul 1 1 1\ngroup some id 1 7\n"
         "neigh_modify exclude molecule/intra some exclude group some some\n", 15),
        ("special_bonds lj/coul 1 1 1\ngroup some id 1:3\n"
         "neigh_modify exclude molecule/intra some\n", None),
        ("special_bonds lj/coul 1 1 1\ngroup some id 1:3\n"
         "neigh_modify exclude group some all\n", None),
        ("special_bonds lj/coul 1 1 1\nneigh_modify exclude type 1 1\n", 0),
    ],
)  # fmt: skip
def test_pairs_within_bodies_are_counted(tmp_path, words, pairs):
    """Locks out a warning of forces that bonds leave out by LAMMPS's defaults, and exclusions that
    are none."""
    path = scripts.rings(tmp_path)
    text = path.read_text()
    path.write_text(text.replace("special_bonds lj/coul 0 0 0\n", words))
    own = take(path, tmp_path / "out")
    (found,) = (one for one in check._script(own) if one.subject == "forces within bodies")
    assert found.value == (None if pairs is None else 64 * pairs)
    if pairs is None:
        assert found.holds is None and "leaves out a part of them" in check._told(found).note
        return
    assert "exclude molecule/intra all, or" in found.note
    own.atoms["molecule"][:] = 1  # of all bodies
    assert "a molecule ID of its own" in check._exclusion(own)


def test_bonded_pairs():
    """Locks out pairs that are counted twice, at another distance than the shortest one, or over
    atoms of other bodies."""
    rng = np.random.default_rng(5)
    body = np.repeat([0, 1, 2, 3], [3, 7, 6, 5])
    bonds = np.unique(np.sort(rng.integers(1, len(body) + 1, size=(22, 2)), axis=1), axis=0)
    bonds = bonds[bonds[:, 0] < bonds[:, 1]]
    graph = np.zeros((len(body), len(body)))
    graph[tuple(bonds.T - 1)] = 1
    apart = shortest_path(graph, directed=False, unweighted=True)
    same = (body[:, None] == body) & (body > 0) & np.triu(np.ones_like(graph, dtype=bool), 1)
    found = finding.bonded_pairs(np.insert(bonds, 0, 1, axis=1), body)
    assert found.tolist() == [np.sum(apart[same] == one) for one in (1, 2, 3)]
    assert found.min() > 0


def test_check_finds_what_does_not_fit(tmp_path):
    """Locks out a script whose atoms overlap, stand still, or are pushed by forces within bodies,
    and that passes."""
    path = scripts.rings(tmp_path)
    text = path.read_text()
    path.write_text(
        text.replace("special_bonds lj/coul 0 0 0\n", "special_bonds lj 0 0 0 coul 0 0 1\n")
        .replace("fix bodies all rigid/nve/small molecule", "group some molecule 1:60\n"
                 "fix bodies some rigid/nve/small molecule")
        .replace("timestep 4", "timestep 400")
    )  # fmt: skip
    own = take(path, tmp_path / "out")
    made = shapes.bodies(own)
    checks = (*check._bodies(own, made, shapes.kinds(own, made)), *check._script(own),
              *check._step(own, made, shapes.kinds(own, made)))  # fmt: skip
    found = {(one.subject, one.what): one.holds for one in checks}
    assert found[("atoms", "that no fix moves")] is False
    assert found[("forces within bodies", "pairs of atoms that have them")] is False
    assert found[("thermostats", "of the bodies")] is True
    turns = [holds for (_, what), holds in found.items() if what.startswith("rms angle")]
    assert turns == [False]
    for one in map(check._told, checks):  # what is wrong is said where it is so
        assert bool(one.note) == (one.part == "step" or not one.holds), one


def test_ranks_are_started_by_the_launcher(monkeypatch):
    """Locks out a cluster's launcher that is not used."""
    monkeypatch.setattr(run, "_launch", None)
    run.launch_by("srun -n {ranks} --exact")
    assert run.launcher(4) == ["srun", "-n", "4", "--exact"]
    run.launch_by(None)
    assert run.launcher(4)[1:] == ["-np", "4"]


def test_a_fix_of_ours_acts_on_the_group_of_its_class():
    """Locks out `check` that counts atoms as moved, or heated, which no fix touches: the class has
    a group and points of its own, and the fix's group says nothing."""
    said = {"groups": ["all", "bodies", "points"]}
    atoms = {"mask": np.array([3, 3, 5, 1])}
    words = {
        "rigid molecule": [True] * 4,
        'python/move "fix_nosquish.NVE bodies molecule"': [True, True, False, False],
        'python/move "fix_nosquish.HMC bodies molecule temp 1 every 9 seed 5"': [1, 1, 0, 0],
        'python/move "fix_nosquish.NVT bodies molecule temp 1 1 1 points points seed 5"': [
            1,
            1,
            1,
            0,
        ],
        'python/move "other.Class bodies"': [True] * 4,
    }
    for text, wanted in words.items():
        assert finding.acted_on(said, atoms, f"fix 1 all {text}").tolist() == list(
            map(bool, wanted)
        )


def test_kinds_of_fixes():
    """Locks out a fix that is taken for another kind."""
    known = {
        "fix 1 all rigid/nvt/small molecule temp 1 1 1": "rigid",
        "fix 1 all rigid/small/omp molecule": "rigid",
        'fix 1 all python/move "fix_nosquish.NVT all molecule temp 1 1 1"': "ours",
        "fix 1 all python/move other.Class": None,
        "fix 1 all shake 1e-4 20 0 b 1": "constraints",
        "fix 1 all npt temp 1 1 1 iso 1 1 1": "plain",
        "fix 1 all langevin 1 1 1 3": None,
    }
    assert {line: finding.kind_of(line) for line in known} == known
    with pytest.raises(Unclear, match="angles of the box"):
        finding.state_of(["temp", "1", "1", "1", "tri", "0", "0", "1"], "npt")
    assert isinstance(Integrator("a", "a", ()), Integrator)
