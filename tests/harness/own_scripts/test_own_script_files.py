"""The files that a user's script names, and what an earlier run changes: no file of the user's is
written to, and the system that is compared is the script's."""

import re
from pathlib import Path

import numpy as np
import pytest

from support.harness import GAS, advised, refused, run_lmp, take, written
from support.running import read_thermo
from validation.__main__ import main
from validation.running import run, starts
from validation.user_script import loader

RIGID = "fix 1 a rigid/nve single\ntimestep 0.001\n"
LENNARD = GAS.replace("pair_style zero 2.0", "pair_style lj/cut 2.0").replace(
    "pair_coeff * *", "pair_coeff * * 1 1"
)


def box(tmp_path, name="start.data"):
    """A data file of the user's."""
    lines = ["of a test", "", "4 atoms", "1 atom types", "", *(f"0 6 {a}lo {a}hi" for a in "xyz")]
    atoms = [f"{n} 1 {x} {y} 1" for n, (x, y) in enumerate([(1, 1), (2, 1), (4, 4), (4, 5)], 1)]
    text = "\n".join([*lines, "", "Masses", "", "1 1", "", "Atoms", "", *atoms, ""])
    return written(tmp_path, text, name)


READ = """units lj
read_data {name}
group a id 1 2
pair_style zero 2.0
pair_coeff * *
"""


def pairs(own):
    """What a run of the scene says of its start."""
    place = Path(own.scene.overlay).parents[1] / "look"
    first = next(iter(own.integrators.values()))
    return run.run(run.job(own.scene, first, place, [2], dt=own.scene.dt, every=1, silence=100.0))


HOSTILE = """shell cd {there}
variable f string start.data
units lj
read_data $f
group a id 1 2
pair_style lj/cut 2.0
pair_coeff * * 1 1
shell rm {there}/start.data
shell mkdir made
shell cd made
shell mv ../start.data ../gone.data
print kept append {there}/note
write_data ../start.data
write_data {there}/start.data.gz
shell cd ..
log {there}/note
restart 2 {there}/note
dump 1 all atom 1 note
python f input 1 1 here "def f(x): open('{there}/note', 'w')"
pair_write 1 1 9 r 0.9 1.9 {there}/note lj
fix 1 a rigid/nve single
fix p all print 1 "line" file {there}/note
fix m all ave/time 1 1 1 c_thermo_temp file ../parts/note
velocity a create 1 5
run 4 every 2 "write_data note" "print now append {there}/note" 'if "1" then "shell rm note"' ""
write_dump all custom {there}/note id x
write_restart note
run 5
"""


@pytest.mark.parametrize("whole", [True, False])
def test_no_file_of_the_users_is_written_to(tmp_path, whole):
    """Locks out a command that writes over, adds to, moves or removes a file of the user's, as the
    script is read or as its commands are repeated, whatever folder or way of writing it has; and a
    shell or Python that does."""
    place = tmp_path / "user" / "parts"
    box(place), (place / "note").write_text("my own")
    path = written(place, HOSTILE.format(there=place if whole else "."))
    before = {one: one.read_bytes() for one in place.parent.rglob("*") if one.is_file()}
    own = take(path, tmp_path / "out", at=2)
    result = pairs(own)
    assert not result.error, result.error
    assert {one: one.read_bytes() for one in place.parent.rglob("*") if one.is_file()} == before
    left = [one.split()[0] for one in own.reading["left_out"]]
    assert left == ["shell", "shell", "log", "restart", "dump", "python", "shell"]
    assert own.reading["step"] == 4
    assert len([*(tmp_path / "out" / "look").rglob("note")]) == 1  # as the fixes of a run write
    message = refused("shell cd nowhere\nread_data x\n", tmp_path)
    assert "Cannot open file x" in message


def test_commands_between_parts_of_the_run_are_told(tmp_path):
    """Locks out a comparison of another run than the script's, without a word."""
    text = GAS + RIGID + 'run 10 every 5 "velocity a scale 1.0"\n'
    notes = take(written(tmp_path, text), tmp_path / "out").notes
    assert any("are left out: velocity a scale 1.0" in one for one in notes)


def test_names_are_of_the_scripts_folder_or_of_the_one_where_it_was_started(tmp_path):
    """Locks out the files beside a link's target in the place of those beside the link, files that
    LAMMPS finds where it is started, and a choice between two that differ."""
    one, other = tmp_path / "water298", tmp_path / "scripts"
    box(one)
    path = written(other, READ.format(name="start.data") + RIGID + "run 5\n")
    (one / "in.own").symlink_to(path)
    assert take(one / "in.own", tmp_path / "a").bodies == 1  # the link's own folder
    asked = loader.ScriptOptions(str(path), str(one))
    assert loader.load(asked, tmp_path / "b", 2, 100.0, tell=lambda _: None).bodies == 1
    (other / "start.data").write_text((one / "start.data").read_text().replace("0 6", "0 7"))
    with pytest.raises(SystemExit, match=r"start.data is another file in .*scripts than in"):
        loader.load(asked, tmp_path / "c", 1, 100.0, tell=lambda _: None)
    assert take(path, tmp_path / "d").bodies == 1  # as advised: from the script's folder
    (one / "start.data").rename(one / "other.data")  # or with another name
    assert loader.load(asked, tmp_path / "c", 1, 100.0, tell=lambda _: None).bodies == 1


def test_the_next_run_is_the_one_that_is_advised(tmp_path):
    """Locks out --run with a number that the script does not have, or of the same run again; and no
    way to a run at constant temperature of a script whose first run heats."""
    text = GAS + "velocity all create 1 5\nfix 1 a rigid/nvt single temp 1 2 1\nrun 5\nunfix 1\n"
    path = written(tmp_path, text + "fix 2 b nve\nrun 6\n" + RIGID + "run 7\n")
    own = take(path, tmp_path / "out")
    with pytest.raises(SystemExit, match=r"changes temp from 1 to 2, .* give a run at constant"):
        loader.refuse_ramps(own)
    (note,) = (one for one in own.notes if "takes the next run" in one)
    own = take(path, tmp_path / "out", **advised(note))
    assert own.reading["run"] == "run 7"
    loader.refuse_ramps(own)


def test_a_reading_that_is_too_slow_gets_longer_as_advised(tmp_path):
    """Locks out --silence that is advised, and does not count for the reading of a script."""
    path = written(tmp_path, GAS + RIGID + "run 5\n")
    words = "check", str(path), "--rigid", "--out", str(tmp_path / "out"), "--silence"
    with pytest.raises(SystemExit, match="give a larger --silence"):
        main([*words, "1e-3"])
    assert main([*words, "200"]) in (0, 1)


def test_is_file_finds_the_users_files(tmp_path):
    """Locks out the branch of a file that is not there, where it is; and a reading that goes on
    when it comes or goes."""
    text = 'if "$(is_file(more.lmp))" then "variable x equal 2" else "variable x equal 1"\n'
    path = written(tmp_path, GAS + text + RIGID + "timestep $(v_x/1000)\nrun 5\n")
    assert take(path, tmp_path / "out").scene.dt == 0.001
    (tmp_path / "more.lmp").write_text("\n")
    assert take(path, tmp_path / "out").scene.dt == 0.002
    (tmp_path / "more.lmp").unlink()
    assert take(path, tmp_path / "out").scene.dt == 0.001


def test_what_the_script_writes_is_what_it_reads(tmp_path):
    """Locks out an old file of the user's in the place of the one that the script writes, one that
    is lacking, in a folder that the script makes, too, and a message that does not say why."""
    old = box(tmp_path, "eq.data")
    before = old.read_text()
    text = GAS + "displace_atoms b move 0.25 0 0\nwrite_data eq.data nocoeff\nclear\n"
    text += "shell mkdir sub\nshell cd sub\n" + READ.format(name="../eq.data")
    text += 'print "timestep 0.003" file more.lmp\n' + RIGID + "include more.lmp\n"
    text += 'fix p all print 1 "3" file v.txt screen no title ""\nrun 2\nunfix p\n'
    (tmp_path / "v.txt").write_text("2\n")
    text += "variable v file v.txt\nvelocity a create $v 5\nrun 5\n"
    own = take(written(tmp_path, text), tmp_path / "out", at=2)
    np.testing.assert_allclose(own.atoms["x"][2], [4.25, 4.0, 4.0])
    assert own.scene.dt == 0.003 and old.read_text() == before
    assert not pairs(own).error and not (tmp_path / "more.lmp").exists()
    assert not (tmp_path / "sub").exists()
    text = GAS + RIGID + "dump 1 all custom 5 traj.dump id x y z\nrun 5\nundump 1\n"
    text += "read_dump traj.dump 5 x y z\nrun 5\n"
    message = refused(text, tmp_path, at=2)
    assert "'read_dump traj.dump 5 x y z'" in message and "left out: dump 1 all" in message


def test_the_environment_is_looked_at_again(tmp_path, monkeypatch):
    """Locks out an old reading in the place of a new one."""
    text = GAS + RIGID + "variable t getenv STEP_OF_TEST\ntimestep $t\nrun 5\n"
    path = written(tmp_path, text)
    for value in "0.001", "0.002":
        monkeypatch.setenv("STEP_OF_TEST", value)
        assert take(path, tmp_path / "out").scene.dt == float(value)


def test_a_wildcard_finds_what_the_script_has_written(tmp_path):
    """Locks out the user's older file, or none, in the place of the one that the script itself has
    written before: that one is in the harness's folder."""
    write = GAS + "reset_timestep {}\nwrite_restart state.*.restart\n"
    read = "clear\nread_restart state.*.restart\npair_style zero 2.0\npair_coeff * *\n"
    path = written(tmp_path, write.format(7) + read + RIGID + "run 5\n")
    assert take(path, tmp_path / "none").reading["step"] == 7
    run_lmp(written(tmp_path, write.format(3), "in.older"), "-log", "none")
    assert take(path, tmp_path / "older").reading["step"] == 7
    assert [file.name for file in tmp_path.glob("state.*")] == ["state.3.restart"]


def test_clear_in_a_loop_keeps_the_loops_counter(tmp_path):
    """Locks out variables that count from the begin in the run that is compared."""
    loop = "variable i loop 3\nlabel top\nclear\n" + GAS + RIGID
    text = loop + "variable t equal v_i\nrun 2\nnext i\njump SELF top\n"
    own = take(written(tmp_path, text), tmp_path / "out", at=3)
    lines = [one for one in own.scene.setup if one.split()[0] in ("variable", "next")]
    assert lines.count("variable i loop 3") == 1 and lines.count("next i") == 2


@pytest.mark.parametrize(
    "change",
    [
        "variable e equal 3.0\nfix ad all adapt 1 pair lj/cut epsilon 1 1 v_e reset no\n",
        "",
    ],
)
def test_another_system_than_the_scripts_is_told(tmp_path, change):
    """Locks out coefficients, charges or bonds that an earlier run has changed, and that are lost
    without a word; and a word where nothing is lost."""
    text = LENNARD + RIGID + change + "run 3\n" + "unfix ad\n" * bool(change) + "run 5\n"
    notes = take(written(tmp_path, text), tmp_path / "out", at=2).notes
    assert any("this is another system" in one for one in notes) is bool(change)


@pytest.mark.parametrize(
    ("told", "change", "more"),
    [
        ("this is another system",
         "fix ad all adapt 1 pair lj/cut epsilon 1 1 v_e reset no\nrun 3\nunfix ad\n", ""),
        ("the largest is 4",
         "run 3\ngroup c id 3\ndelete_atoms group c compress no\n", True),
    ],
)  # fmt: skip
def test_what_runs_have_made_is_read_from_a_file(tmp_path, run_lammps, told, change, more):
    """Locks out advice that does not help: write_data after runs that change coefficients or delete
    atoms, and a script that reads that file."""
    before = LENNARD + "variable e equal 3.0\n" + RIGID + change
    try:
        notes = take(written(tmp_path, before + "run 5\n"), tmp_path / "out", at=2).notes
    except SystemExit as end:
        notes = [str(end)]
    (note,) = (one for one in notes if told in one)
    assert "write_data" in note
    if more:
        gaps = f"{LENNARD}group c id 3\ndelete_atoms group c compress no\n"
        assert "the largest is 4" in refused(f"{gaps}{RIGID}run 5\n", tmp_path)
        (more,) = re.findall("command '(.*?)'", note)
        assert take(written(tmp_path, f"{gaps}{more}\n{RIGID}run 5\n"), tmp_path / "gaps").bodies
    done = run_lammps(before + "thermo_style custom step pe\nwrite_data made.data\nrun 0\n")
    start = f"units lj\natom_modify map yes\npair_style lj/cut 2.0\nread_data made.data\n{more}\n"
    own = take(written(tmp_path, f"{start}group a id 1 2\n{RIGID}run 5\n"), tmp_path / "again")
    assert not any("write_data" in one for one in own.notes)
    energy = read_thermo(done.log[done.log.rindex("   Step") :])["PotEng"][0] * len(own.atoms["x"])
    assert own.reading["potential"] == pytest.approx(energy, rel=1e-6)


def test_fixes_that_change_the_step_are_left_out(tmp_path):
    """Locks out steps of another length than the table says, and a run that ends early."""
    text = GAS + "fix dt all dt/reset 1 1e-4 2e-4 0.1\nvariable n equal step\n"
    text += "fix h all halt 1 v_n > 3 error soft\n"
    text += "fix mean all ave/time 1 1 1 f_dt\n"
    own = take(written(tmp_path, text + RIGID + "run 10\n"), tmp_path / "out")
    assert any("may fail without it: fix mean all" in one for one in own.notes)
    text = text.replace("fix mean all ave/time 1 1 1 f_dt\n", "")
    own = take(written(tmp_path, text + RIGID + "run 10\n"), tmp_path / "out")
    assert not any(re.search(r"dt/reset|halt", one) for one in (*own.scene.setup, *own.scene.then))
    assert any("change the step or end a run early: fix dt all" in one for one in own.notes)
    result = pairs(own)
    assert not result.error and result.thermo["Time"][-1] == pytest.approx(0.002)


def test_commands_that_need_a_fix_which_is_replaced_are_told(tmp_path):
    """Locks out rows that fail for a line of the script's output, where nobody says so."""
    text = GAS + RIGID + "compute k a ke/rigid 1\nthermo_style custom step pe f_1\n"
    text += "variable t equal c_1_temp\nvariable u equal c_11_temp\n"
    text += "variable k equal f_1\nvariable other equal f_11\nvariable half_1 equal 3\nrun 5\n"
    notes = take(written(tmp_path, text), tmp_path / "out").notes
    (note,) = (one for one in notes if "replaced" in one)
    assert note.endswith("without it: variable t equal c_1_temp; variable k equal f_1.")
    assert any(one.endswith("numbers of rigid fixes: compute k a ke/rigid 1.") for one in notes)


def test_letters_of_other_encodings_in_comments(tmp_path):
    """Locks out a script that LAMMPS runs and the harness takes for a picture."""
    path = tmp_path / "in.own"
    path.write_bytes("# Wärme\n".encode("latin-1") + (GAS + RIGID + "run 5\n").encode())
    assert take(path, tmp_path / "out").bodies == 1


def test_thermo_output_without_a_temperature(tmp_path):
    """Locks out a script that is refused because its output does not name what the harness asks."""
    text = GAS + "velocity all create 2.0 5\nthermo_style custom step pe\n" + RIGID + "run 5\n"
    assert take(written(tmp_path, text), tmp_path / "out").reading["temperature"] > 0


@pytest.mark.parametrize("name", ["Zürich", 'a"b', "it's", "two words", "a$b"])
def test_folders_with_letters_that_lammps_does_not_take(tmp_path, name):
    """Locks out a message on bytes that cannot be decoded, or on a quote, where the path of the
    user's folder has such letters: LAMMPS's commands have no path through it."""
    folder = tmp_path / name / "run"
    box(folder)
    (folder / "start.data").rename(tmp_path / name / "above.data")
    (tmp_path / name / "note").write_text("kept")
    text = READ.format(name="../above.data") + f"fix p all print 5 x title ../note\n{RIGID}"
    own = take(written(folder, text + "run 5\nrun 5\n"), folder / "out", at=2)
    assert own.bodies == 1
    dump = (folder / "out" / "first" / "state.dump").resolve()
    how: dict = {"dt": 0.001, "every": 1}
    for one in own.integrators.values():
        job = run.job(own.scene, one, dump.parent, [5], more=starts.to_dump(dump, 5), **how)
        assert run.run(job).error is None
        begun = starts.from_dump(own.scene, dump, 5)
        second = run.run(run.job(begun, one, folder / "out" / "second", [5], **how))
        assert second.error is None and len(second.thermo["Step"]) == 6


def test_a_name_that_lammps_does_not_take_is_told(tmp_path):
    """Locks out "'utf-8' codec can't decode byte" where LAMMPS itself cannot open a file."""
    box(tmp_path).rename(tmp_path / "größe.data")
    message = refused(READ.format(name="größe.data") + RIGID + "run 5\n", tmp_path)
    assert message.startswith("in.bad: the script failed at 'read_data gr")
    assert message.endswith("accepts only ASCII characters in commands. Rename what has others")
    (tmp_path / "größe.data").rename(tmp_path / "start.data")
    path = written(tmp_path, READ.format(name="start.data") + RIGID + "run 5\n")
    assert take(path, tmp_path / "out").bodies == 1


def test_atoms_that_a_run_creates_are_read_from_a_file(tmp_path, run_lammps):
    """Locks out a traceback where there are no atoms yet, and advice that does not help."""
    box = GAS[: GAS.index("create_atoms")].replace("lj\n", "lj\natom_style molecular\n")
    pairs = "pair_style zero 2.0\npair_coeff * *\nmass 1 1\n"
    (tmp_path / "mol.dimer").write_text("one\n\n2 atoms\n\nCoords\n\n1 0 0 0\n2 1 0 0\n\nTypes\n\n"
                                        "1 1\n2 1\n")  # fmt: skip
    text = f"{box}{pairs}molecule d mol.dimer\nfix 1 all rigid/nve/small molecule mol d\n"
    text += "fix new all deposit 2 0 1 5 mol d rigid 1 region box near 1\ntimestep 0.001\nrun 5\n"
    message = refused(text, tmp_path)
    assert "no atoms at 'run 5'" in message and "use write_data" in message
    run_lammps(f"{text}write_data made.data nocoeff\n")
    read = "units lj\natom_style molecular\nread_data made.data\n"
    path = written(tmp_path, f"{read}{pairs}fix 1 all rigid/nve/small molecule\nrun 5\n")
    assert take(path, tmp_path / "out").bodies == 2


def test_a_file_that_rank_0_cannot_write_ends_all_ranks(tmp_path):
    """Locks out ranks that wait for the first one, which reads the script anew."""
    text = READ.format(name=box(tmp_path).name) + RIGID + "run 2\n"
    text += 'print "x" file sub\nwrite_data sub/x.data\nrun 5\n'
    path = written(tmp_path, text)
    asked = loader.ScriptOptions(str(path), str(tmp_path), at=2)
    with pytest.raises(SystemExit, match=r"failed at 'write_data sub/x.data'"):
        loader.load(asked, tmp_path / "out", 2, 40.0, tell=lambda _: None)
