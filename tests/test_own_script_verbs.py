"""The harness's verbs with a user's script."""

import json
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scripts
from conftest import Silent, read_thermo
from own_scripts import take

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation import command_line
from validation.__main__ import main
from validation.check import measure as check
from validation.check import report as check_report
from validation.choice import Choice
from validation.own import shapes
from validation.pages import console
from validation.running import run, store
from validation.scenes.integrators import Integrator
from validation.stability import stress
from validation.trial import confirm, lists, measure, report, rest, timed, trial


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


@pytest.mark.parametrize("verb", ["compare", "cost", "check", "stability"])
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


def test_check_tells_of_a_mesh_that_runs_choose(tmp_path):
    """Locks out silence on a mesh that each run at constant pressure chooses anew, and a warning
    where the script gives it."""
    path = scripts.co2(tmp_path)
    (found,) = check._mesh(take(path, tmp_path / "one"))
    assert found.holds is False and "mesh and gewald that each run" in found.what
    path.write_text(path.read_text().replace("pppm 1e-3", "pppm 1e-3\nkspace_modify mesh 8 8 8"))
    (found,) = check._mesh(take(path, tmp_path / "two"))
    assert found.what.startswith("gewald that")
    assert "(G vector, grid): kspace_modify mesh NX NY NZ gewald G" in found.note
    log = (tmp_path / "one" / "script" / "log.lammps").read_text()
    vector = re.search(r"G vector \(1/distance\) = (\S+)", log)[1]
    grid = re.search(r"grid = (.*)", log)[1]
    path.write_text(path.read_text().replace("8 8 8", f"{grid} gewald {vector}"))
    assert not [*check._mesh(take(path, tmp_path / "three"))]


def test_what_check_advises_against_forces_within_bodies_does_it(tmp_path):
    """Locks out a command that check names, and that LAMMPS refuses or that changes nothing."""
    path = scripts.rings(tmp_path)
    text = path.read_text().replace("special_bonds lj/coul 0 0 0\n", "")
    ones = "special_bonds lj/coul 1 1 1\n"
    path.write_text(text.replace("run 0\n", f"{ones}run 0\n"))

    def told(name):
        own = take(path, tmp_path / name)
        return next(one for one in check._script(own) if one.subject == "forces within bodies")

    note = told("before").note
    commands = re.findall(r"((?:neigh_modify|special_bonds) [\w/ ]+?) leaves out", note)
    assert [one.split()[0] for one in commands] == ["special_bonds", "neigh_modify"]
    for number, command in enumerate(commands):
        path.write_text(text.replace("run 0\n", f"{ones}{command}\nrun 0\n"))
        assert told(f"{number}").value == 0


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
    assert "exclude molecule/intra all leaves out all of them" in found.note
    own.atoms["molecule"][:] = 1  # of all bodies
    assert "a molecule ID of its own" in check._exclusion(own)


def test_what_is_advised_against_pairs_within_bodies_is_new_and_reaches_them(taken):
    """Locks out special_bonds that the script has, for pairs that no bonds tell; that does to other
    bonds, too; and an offset of the energy with a mesh that nobody mentions."""
    own = taken("rings")
    bonds, said = own.atoms["bonds"], dict(own.said)

    def advised(bonds=bonds, special=1.0, commands=()):
        made = said | {"special": [[1.0, *[special] * 3]] * 2, "commands": commands}
        return check._exclusion(replace(own, said=made, atoms=own.atoms | {"bonds": bonds}))

    reached = "special_bonds lj/coul 0 0 0 leaves out"
    assert f"{reached} {64 * 15} of them; neigh_modify exclude" in advised()
    assert f"{reached} 64 of them" in advised(bonds[::6])  # of each body one
    assert "special_bonds" not in advised(special=0.0)
    between = np.concatenate([bonds, [[1, 1, 7]]])  # of two bodies
    assert "special_bonds" not in advised(between)
    mesh, none = "kspace_style pppm 1e-4", "kspace_style none"
    for commands, told in ([], False), ([mesh], True), ([mesh, none], False):
        assert ("a constant to the energy" in advised(commands=commands)) is told


def test_check_says_what_its_table_cannot(taken, tmp_path, capsys):
    """Locks out an energy that LAMMPS counts wrongly and that stands beside ours as if ours were a
    thousand times better; and three different steps that are all called safe."""
    own = taken("spce")
    lost, ours = (own.integrators[name] for name in ("rigid/nvt/small", "nosquish"))
    own = replace(own, integrators={one.name: one for one in (lost, ours)})
    summary = check.check(own, tmp_path, 1, 300.0, Silent())
    shown = {one["label"]: "change" in one for one in summary["integrators"]}
    assert shown == {"rigid/nvt/small": False, ours.label: True}
    check_report.write(summary, tmp_path)
    check_report.show(console.console(), summary, tmp_path)
    told = "Energies of rigid/nvt/small are left out: LAMMPS's econserve is not what it keeps"
    assert told in capsys.readouterr().out
    assert told in (tmp_path / "report.html").read_text().replace("&#39;", "'")
    last = check_report.tables(summary)[-1]
    assert [row[5].text == "–" for row in last.rows] == [True, False]
    steps = [one["note"] for one in summary["checks"] if one["part"] == "step"]
    assert len(steps) == 3 and all("by this number alone, " in note for note in steps)


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


def test_check_of_atoms_that_a_fix_holds(tmp_path):
    """Locks out a check that ends in a traceback where other atoms have no force, so that no step
    is too long for them."""
    path = scripts.spce(tmp_path, fix="group some molecule <= 63\nfix 1 some rigid/nve molecule",
                        lines="group one molecule 64\nfix still one setforce 0 0 0")  # fmt: skip
    own = take(path, tmp_path / "out")
    made = shapes.bodies(own)
    found = [one.subject for one in check._step(own, made, shapes.kinds(own, made))]
    assert found[1:] == ["centres", "turning"]


def test_a_start_whose_run_has_no_numbers_fails(taken, tmp_path, monkeypatch):
    """Locks out "ok" of an integrator whose energy is nan after some steps: LAMMPS goes on."""
    own = taken("spce")
    one = next(iter(own.integrators.values()))
    own = replace(own, integrators={one.name: one})
    names = "Step", "Temp", "Press", "KinEng", "PotEng", "TotEng", "Econserve"
    thermo = {name: np.ones(5) for name in names} | {"Step": 2.0 * np.arange(5)}
    result = SimpleNamespace(error=None, interrupted=False, thermo=thermo)
    monkeypatch.setattr(run, "once", lambda job: result)
    (row,), _ = check._starts(own, tmp_path, 1, 60.0, Silent())
    assert row["error"] is None and row["temperature"] == 1.0
    thermo["TotEng"] = np.array([1.0, 1.0, np.nan, np.inf, np.nan])
    thermo["Press"] = np.array([1.0, 1.0, 1.0, np.nan, np.nan])
    (row,), _ = check._starts(own, tmp_path, 1, 60.0, Silent())
    assert row["error"] == "no number from step 4 on: TotEng" and "change" not in row


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
        "sweep water", "stability gradient", "compare water", "sample water", "cost water",
        "long", "paper", "published", "theory",
        "check my.in", "bodies my.in", "advise my.in",
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
        "sweep water", "stability gradient", "compare water", "sample water", "cost water",
        "long", "paper", "published", "theory", "breaks", "report",
        "check my.in", "bodies my.in", "advise my.in",
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


SCENES_ONLY = "theory published report paper sweep cost sample stability"


@pytest.mark.parametrize(
    "words",
    [
        *("theory", "published", "report", "paper"),
        *("sweep", "cost", "sample", "stability"),
        *("compare water", "cost start", "sweep water", "sample water", "advise water"),
        *("stability needles", "advise nothing"),
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
        ("stability needles -var a 1", "-var is for a script"),
        ("cost water --run 2", "--run is for a script"),
        ("sweep in.own --short", "--short is for scenes"),
        ("stability in.own --starts 0", "--starts is for the cases"),
    ],
)
def test_words_of_a_script_for_a_scene(words, said, tmp_path, monkeypatch, capsys):
    """Locks out words that are taken for a scene, or for a script, and do nothing there."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.own").write_text("units lj\n")
    with pytest.raises(SystemExit) as end:
        main(words.split())
    assert end.value.code == 2 and said in capsys.readouterr().err
