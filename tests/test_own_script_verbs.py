"""The harness's verbs with a user's script."""

import json
import math
import re
from dataclasses import replace

import pytest
import scripts
from conftest import Silent, read_thermo
from own_scripts import take

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation.choice import Choice
from validation.trial import confirm, lists, measure, report, rest, timed, trial

from validation import command_line
from validation.__main__ import main
from validation.check import measure as check
from validation.running import run, store
from validation.scenes.integrators import Integrator


def test_an_integrator_that_is_none_is_refused(capsys):
    """Locks out a word behind --only that is passed over in silence, a label of the table that is
    none, and an answer with names that this script does not have."""
    with pytest.raises(SystemExit, match="2"):
        command_line.chosen_of({"a": 1, "b": 2}, ["x"])
    assert "there is no integrator x: choose from a, b" in capsys.readouterr().err
    assert command_line.chosen_of({"a": 1, "b": 2}, None) == [1, 2]
    known = {one.name: one for one in (Integrator("a", "a 1e-4 + b", ()), Integrator("c", "c", ()))}
    for word in "a", "a 1e-4 + b":
        assert command_line.chosen_of(known, ["c", word]) == [*known.values()]
        assert command_line.chosen_of(known, [word]) == [known["a"]]
    with pytest.raises(SystemExit, match="2"):
        command_line.chosen_of(known, ["rigid/nve"])
    assert capsys.readouterr().err.endswith('choose from a ("a 1e-4 + b"), c\n')


def test_a_word_too_many_is_answered_with_the_verbs_usage(capsys):
    """Locks out steps with blanks between them, that are answered with how all verbs are used."""
    with pytest.raises(SystemExit, match="2"):
        main(["sample", "water", "--dt", "4", "6", "--short", "8"])
    told = capsys.readouterr().err
    assert "unrecognized arguments" in told and "--dt FS,FS" in told


@pytest.mark.parametrize("verb", ["compare", "cost", "check", "stress"])
def test_two_commands_do_not_measure_in_one_folder_at_a_time(verb, tmp_path):
    """Locks out a command that removes the script's files, or a run, from under another's LAMMPS:
    with other options they would do the same runs in the same places."""
    path = scripts.rings(tmp_path)
    out = tmp_path / "out"
    with store.alone(out), pytest.raises(SystemExit, match=r"another command measures in .*--out"):
        main([verb, str(path), "--out", str(out)])
    assert [one.name for one in out.iterdir()] == ["alone.lock"]
    with store.alone(out):  # it is free again
        pass


def test_a_second_comparison_takes_no_run_of_another(tmp_path):
    """Locks out runs of other options, in the same folder, that are taken for one's own; and that
    a run of the same options is done again."""
    path = str(scripts.rings(tmp_path))
    out = tmp_path / "out"
    words = ["--ranks", "1", "--rounds", "1", "--segment", "20", "--only", "nosquish", "--out"]
    seen = []
    for more in ["--dt", "2"], ["--dt", "4"], ["--steps", "120"], ["--steps", "120"]:
        assert main(["compare", path, "--steps", "100", *words, str(out), *more]) == 0
        (row,) = json.loads((out / "summary.json").read_text())["integrators"]
        done = (out / "runs" / "nosquish" / "done.json").stat().st_mtime_ns
        seen.append((row["steps"], row["temperature"]["value"], done))
    assert [steps for steps, *_ in seen] == [100, 100, 120, 120]
    assert len(set(seen)) == 3 and seen[2] == seen[3]


@pytest.mark.timeout(600)
def test_compare_and_cost_of_a_script(tmp_path, capsys):
    """Locks out a verb that ends with a script: both write their page and numbers."""
    path = str(scripts.polymer(tmp_path))
    out = tmp_path / "compare"
    words = ["--ranks", "1", "--rounds", "1", "--segment", "20", "--only",
             "nosquish/nvt langevin", "rigid/nvt/small"]  # fmt: skip
    assert main(["compare", path, "--steps", "200", "--out", str(out), *words]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert [row["name"] for row in summary["integrators"]] == ["rigid/nvt/small", "nosquish"]
    assert all(row["distance"] is not None for row in summary["integrators"])
    judged = {row["name"]: row.get("energy_sd") is not None for row in summary["integrators"]}
    assert judged == {"rigid/nvt/small": False, "nosquish": True}
    page = (out / "report.html").read_text()
    assert "ε" in page and "pair_modify shift yes" in page
    out = tmp_path / "cost"
    words = ["--ranks", "1", "--rounds", "1", "--seconds", "0.02", *words[-3:]]
    assert main(["cost", path, "--short", "--out", str(out), *words]) == 0
    (point,) = json.loads((out / "summary.json").read_text())["points"]
    assert point["bodies"] == 27 and all(row["modify"] for row in point["integrators"])


@pytest.mark.timeout(900)
def test_advise_names_a_step_that_is_good_and_not_one_that_fails(tmp_path, monkeypatch):
    """Locks out advice for a step at which the run heats or its energy fluctuates above the target:
    rings at constant energy, with a step that is safe and one that is far too long."""
    monkeypatch.setattr(measure, "LATE", 100)  # a busy machine takes longer than was planned
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
    assert "nosquish/nve with a step of 4 fs" in page and "timestep 4" in page
    assert "By default 0.01: " in page and len(good["cost"]["values"]) == timed.ROUNDS
    assert bad["cost"] is None  # it is not timed
    skins = [one["command"] for one in summary["lists"]]
    assert skins == ["neighbor 2 bin", "neighbor 3 bin", "neighbor 4 bin"]  # LAMMPS's own is 2
    assert all(0 < one["min"] <= one["median"] <= one["max"] for one in summary["lists"])
    assert "neighbor 3 bin" in page
    # again: nothing is run, and another process finds the same
    begin = {one: one.stat().st_mtime_ns for one in out.glob("runs/**/done.json")}
    assert begin and main(["advise", str(path), *words, *targets]) == 0
    assert begin == {one: one.stat().st_mtime_ns for one in begin}
    # and longer
    monkeypatch.setattr(confirm, "LONGER", 2.0)
    status = main(["advise", str(path), *words, *targets, "--confirm"])
    summary = json.loads((out / "summary.json").read_text())
    longer = summary["confirmed"]
    assert longer["time"] == 2 * good["time"]
    asked = longer["points"]
    assert [(one["integrator"], one["dt"]) for one in asked] == [("nosquish", 4), ("nosquish", 6)]
    assert status == (confirm.holds(summary) is False)
    page = (out / "report.html").read_text()
    assert "4 fs, in a run 2 times as long, " in page and "6 fs, in a run 2 times as long, " in page
    # advice that does not bear out
    for one in asked:
        one["errors"]["energy"] |= {"value": 9.0, "error": 0.1}
    said = "; ".join(confirm.said(summary, "fs"))
    assert confirm.holds(summary) is False and said.count("is not within the targets") == 2
    asked[1]["failed"] = "it heats"
    assert "6 fs, in a run 2 times as long, fails: it heats." in confirm.said(summary, "fs")


@pytest.mark.timeout(900)
def test_advise_runs_what_promises_most_for_longer(tmp_path, monkeypatch):
    """Locks out a budget that is spent on steps that are not named, a long run that is judged by
    what chose it, and one that is run again by the same command."""
    monkeypatch.setattr(measure, "LATE", 100)
    # whatever else the machine does, and however much short runs tell, a step gets the rest
    monkeypatch.setattr(rest, "WORTH", 0.2)
    monkeypatch.setattr(rest, "least_known", lambda *some: math.inf)
    monkeypatch.setattr(trial, "startup", lambda own: 0.5)
    monkeypatch.setattr(timed, "FASTEST", 1)
    path = scripts.rings(tmp_path)
    path.write_text(path.read_text().replace("fix heat all langevin 300 300 200 11\n", ""))
    out = tmp_path / "out"
    words = ["--budget", "0.7", "--steps", "1,2,4", "--only", "nosquish", "--out", str(out)]
    targets = ["--target", "energy=0.2", "drift=100", "temperature=0.1", "rdf=10"]
    status = main(["advise", str(path), *words, *targets])
    summary = json.loads((out / "summary.json").read_text())
    times = {one["dt"]: one["time"] for one in summary["points"]}
    (alone,) = (one for one in summary["points"] if one["alone"])
    longer = {dt for dt, time in times.items() if time != summary["time"]}
    held = 2.0  # fs, half of the script's step
    assert longer in ({alone["dt"]}, {alone["dt"], held})
    assert len({times[dt] for dt in longer}) == 1
    assert times[alone["dt"]] > summary["time"]  # of which as much is left out
    assert status in (0, 1)
    begin = {one: one.stat().st_mtime_ns for one in out.glob("runs/**/done.json")}
    assert main(["advise", str(path), *words, *targets]) == status
    assert begin == {one: one.stat().st_mtime_ns for one in out.glob("runs/**/done.json")}


WATER = "fix 1 all python/move 'fix_nosquish.NVT water molecule temp 298 298 100 seed 9'"
PRINTED = {  # of scripts whose integrators are printed, a function of ``scripts`` and words
    "two fixes": ("spce", {}, {}),
    "in quotes": ("spce", {"fix": f"group water type 1 2\n{WATER}\nfix_modify 1 virial yes"}, {}),
    "no rigid fix": (
        "spce",
        {"fix": "group water type 1 2\nfix move all nve"},
        {"group": "water", "bodies": "molecule"},
    ),
    "others beside bodies": ("solute", {}, {}),
    "points of ours": ("staged", {}, {}),
    "pressure": ("co2", {}, {}),
}


def with_advice(text, told):
    """A script with what ``advise`` tells of it."""
    kept = text.replace("&\n", "").splitlines()
    lines = [line.strip() for line in told.splitlines() if line.startswith("    ")]
    (place,) = (line for line in told.splitlines() if line.startswith("In the place of"))
    assert place.endswith("and of the script's timestep:")
    ids = re.findall(r"fix (\S+) \(", place)
    fixes = [
        n for n, line in enumerate(kept) if line.split()[:1] == ["fix"] and line.split()[1] in ids
    ]
    kept[fixes[-1]] = "\n".join(lines)
    lost = [n for n, line in enumerate(kept) if line.startswith("timestep")] + fixes[:-1]
    for line in told.splitlines():
        if line.startswith("These name a fix that goes"):
            some = line.rstrip(".").partition("have to go, too: ")[2].split("; ")
            lost += [kept.index(one) for one in some]
    return "\n".join(line for n, line in enumerate(kept) if n not in lost) + "\n"


@pytest.mark.parametrize("which", PRINTED)
def test_what_advise_prints_runs_as_it_is(which, tmp_path, run_lammps, capsys):
    """Locks out lines that LAMMPS refuses in the place where they are said to stand, or that begin
    with another system than the one that was tried; and a place that is not said."""
    kind, how, ask = PRINTED[which]
    path = getattr(scripts, kind)(tmp_path, **how)
    own = take(path, tmp_path / "out", **ask)
    first = next(one for one in own.integrators.values() if one.kind in ("ours", "rigid"))
    (start,), _ = check._starts(
        replace(own, integrators={"": first}), tmp_path / "out", 1, 300.0, Silent()
    )
    text = path.read_text().replace("log water.log", "")
    columns = "thermo_style custom step temp pe\nthermo_modify norm no\nrun 3"
    text = re.sub(r"^run [1-9]\d*$(?!(.|\n)*^run )", columns, text, flags=re.M)
    skins = [{"command": "neighbor 0.7 bin", "median": 0.9, "min": 0.8, "max": 0.95}]
    for one in own.integrators.values():
        row = trial._row(own, trial.Point(one, own.scene.dt), None, None)
        choice = Choice({}, row, row)
        lines = report.instead(choice, report._lines({"lists": skins}, choice))
        done = run_lammps(with_advice(text, "\n".join(lines)))
        rows = read_thermo(done.log[done.log.rindex("   Step") :])
        assert rows["Step"][-1] - rows["Step"][0] == 3
        assert rows["PotEng"][0] == pytest.approx(start["potential"], rel=1e-6)


def test_ranks_are_started_by_the_launcher(monkeypatch):
    """Locks out a cluster's launcher that is not used."""
    monkeypatch.setattr(run, "_launch", None)
    run.launch_by("srun -n {ranks} --exact")
    assert run.launcher(4) == ["srun", "-n", "4", "--exact"]
    run.launch_by(None)
    assert run.launcher(4)[1:] == ["-np", "4"]


@pytest.mark.parametrize(
    "words",
    [
        "stress gradient", "compare water", "sample water", "cost water",
        "claims long-run", "claims",
        "check my.in",
    ],
)  # fmt: skip
def test_every_verb_that_starts_ranks_takes_a_launcher(monkeypatch, words):
    """Locks out an option that is there and does nothing, as it did for scenes of sweep, and a verb
    that runs on the machine where a cluster's users may run nothing."""
    verb, *_ = words.split()
    monkeypatch.setattr(run, "_launch", None)
    monkeypatch.setattr(f"validation.{verb}.command.run", lambda _: 0)
    assert main([*words.split(), "--launch", "env srun -n {ranks}"]) == 0
    assert run.launcher(3) == ["env", "srun", "-n", "3"]
    assert main(words.split()) == 0
    assert run.launcher(3)[1:] == ["-np", "3"]


@pytest.mark.parametrize(
    "words",
    [
        "stress gradient", "compare water", "sample water", "cost water",
        "claims long-run", "claims", "report",
        "check my.in",
    ],
)  # fmt: skip
@pytest.mark.parametrize("place", ["file/below", "/proc/none"])
def test_an_output_folder_that_cannot_be_made_is_told(tmp_path, monkeypatch, capsys, words, place):
    """Locks out a traceback, and one that comes when all has been measured."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    (tmp_path / "my.in").write_text("")
    place += "/page.html" * (words == "report")
    with pytest.raises(SystemExit) as end:
        main([*words.split(), "--out", place])
    assert end.value.code == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"output folder \S+: .*: give another folder by --out", said), said


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("srun", "{ranks} is missing"),
        ("nolauncher -n {ranks}", "there is no program nolauncher"),
        ("", "{ranks} is missing"),
    ],
)
def test_a_launcher_that_cannot_start_ranks_is_refused(capsys, command, said):
    """Locks out runs on another number of ranks than the table says, and a traceback."""
    with pytest.raises(SystemExit) as end:
        main(["compare", "water", "--launch", command])
    assert end.value.code == 2 and said in capsys.readouterr().err


SCENES_ONLY = "claims report cost sample stress"


@pytest.mark.parametrize(
    "words",
    [
        *("claims", "claims theory", "report"),
        *("cost", "sample", "stress"),
        *("compare water", "cost start", "sweep water", "sample water", "advise water"),
        *("stress needles", "advise nothing"),
    ],
)
def test_without_a_checkout_each_verb_says_that_there_are_no_scenes(words, tmp_path, monkeypatch):
    """Locks out a bare traceback about a file of site-packages, and a list of scenes to choose from
    that is empty."""
    monkeypatch.setattr(command_line, "INPUTS", tmp_path / "inputs")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, match="built-in scenes come with a checkout"):
        main(words.split())
    assert not [*tmp_path.iterdir()]


def test_a_word_that_is_no_script_gets_no_empty_list(capsys):
    """Locks out `choose from` with nothing behind it, of verbs that have no scenes."""
    with pytest.raises(SystemExit, match="2"):
        main(["check", "water"])
    assert "there is no input script water\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("advise water --target drift=1 --confirm", "--confirm is for a script"),
        ("advise water --target drift=1 --only nosquish", "--only is for a script"),
        ("advise water --target drift=1 --ranks 2", "--ranks is for a script"),
        ("advise in.own --from results", "--from is for a scene"),
        ("sweep dimer --target drift=1", "--target is for a script"),
        ("compare water --group all", "--group is for a script"),
        ("stress needles -var a 1", "-var is for a script"),
        ("cost water --run 2", "--run is for a script"),
        ("sweep in.own --short", "--short is for scenes"),
        ("stress in.own --full", "--full is for the cases"),
    ],
)
def test_words_of_a_script_for_a_scene(words, said, tmp_path, monkeypatch, capsys):
    """Locks out words that are taken for a scene, or for a script, and do nothing there."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.own").write_text("units lj\n")
    with pytest.raises(SystemExit) as end:
        main(words.split())
    assert end.value.code == 2 and said in capsys.readouterr().err
