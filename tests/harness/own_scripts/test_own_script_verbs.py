"""The harness's verbs with a user's script."""

import json
import re
import shlex
import sys

import pytest

from support import (
    scripts,
)
from validation import command_line
from validation.__main__ import main, parser
from validation.running import run, store
from validation.scenes.integrators import Integrator
from validation.user_script import loader


def test_an_integrator_that_is_none_is_refused(capsys):
    """Locks out a word behind --only that is passed over in silence, a label of the table that is
    none, and an answer with names that this script does not have."""
    with pytest.raises(SystemExit, match="2"):
        command_line.select({"a": 1, "b": 2}, ["x"])
    assert "there is no integrator x: choose from a, b" in capsys.readouterr().err
    assert command_line.select({"a": 1, "b": 2}, None) == [1, 2]
    known = {one.name: one for one in (Integrator("a", "a 1e-4 + b", ()), Integrator("c", "c", ()))}
    for word in "a", "a 1e-4 + b":
        assert command_line.select(known, ["c", word]) == [*known.values()]
        assert command_line.select(known, [word]) == [known["a"]]
    with pytest.raises(SystemExit, match="2"):
        command_line.select(known, ["rigid/nve"])
    assert capsys.readouterr().err.endswith('choose from a ("a 1e-4 + b"), c\n')


@pytest.mark.parametrize("verb", ["cost", "check"])
def test_two_commands_do_not_measure_in_one_folder_at_a_time(verb, tmp_path, monkeypatch):
    """Locks out a command that removes the script's files, or a run, from under another's LAMMPS:
    with other options they would do the same runs in the same places."""
    path = scripts.rings(tmp_path)
    out = tmp_path / "out"
    with store.alone(out), pytest.raises(SystemExit, match=r"another command uses .*--out"):
        main([verb, str(path), "--out", str(out)])
    assert [one.name for one in out.iterdir()] == ["alone.lock"]
    monkeypatch.setattr(loader, "load", lambda *_: 1 / 0)  # the script is read
    with store.alone(out), pytest.raises(ZeroDivisionError):  # as advised, elsewhere or later
        main([verb, str(path), "--out", str(tmp_path / "other")])
    with pytest.raises(ZeroDivisionError):
        main([verb, str(path), "--out", str(out)])


@pytest.mark.timeout(600)
def test_cost_of_a_script(tmp_path, monkeypatch):
    """Locks out a verb that ends with a script: it writes its numbers; and a command of the page
    that does not give them again."""
    out = tmp_path / "cost"
    words = ["cost", str(scripts.polymer(tmp_path)), "--short", "--out", str(out), "--ranks", "1"]
    words += ["--rounds", "1", "--seconds", "0.02"]
    words += ["--only", "nosquish/nvt langevin", "rigid/nvt/small"]

    def summary(words):
        monkeypatch.setattr(sys, "argv", ["nosquish", *words])
        assert main(words) == 0
        return json.loads((out / "summary.json").read_text())

    told = summary(words)
    (point,) = told["points"]
    assert point["bodies"] == 27 and all(row["modify"] for row in point["integrators"])
    assert summary(shlex.split(told["command"])[1:])["points"] == [point]


@pytest.mark.parametrize(
    "words",
    [
        "stress gradient", "compare water", "sample water", "cost water",
        "claims theory", "claims",
        "check my.in",
    ],
)  # fmt: skip
def test_every_verb_that_starts_ranks_takes_a_launcher(monkeypatch, words):
    """Locks out an option that is there and does nothing, as it did for scenes, and a verb
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
        "claims theory", "claims", "report",
        "check my.in",
    ],
)  # fmt: skip
@pytest.mark.parametrize("place", ["file/below", "/proc/none"])
def test_an_output_folder_that_cannot_be_made_is_told(tmp_path, monkeypatch, capsys, words, place):
    """Locks out a traceback, and one that comes when all has been measured."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    (tmp_path / "my.in").write_text("")
    with pytest.raises(SystemExit) as end:
        main([*words.split(), "--out", place])
    assert end.value.code == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert re.fullmatch(r"output folder \S+: .*: give another folder by --out", said), said
    arguments = parser().parse_args([*words.split(), "--out", str(tmp_path / "another")])
    assert command_line.output_folder(arguments).is_dir()


@pytest.mark.parametrize(
    "words",
    [
        *("claims", "claims theory", "report"),
        *("cost", "sample", "stress"),
        *("compare water", "compare nothing", "cost start", "sample water"),
        "stress needles",
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


@pytest.mark.parametrize("verb", ["check", "compare", "cost", "sample"])
def test_without_a_checkout_verbs_take_scripts_as_advised(verb, tmp_path, monkeypatch):
    """Locks out verbs that ask for a scene where a script is given."""
    monkeypatch.setattr(command_line, "INPUTS", tmp_path / "inputs")
    monkeypatch.setattr(loader, "load", lambda *_: 1 / 0)  # the script is read
    with pytest.raises(ZeroDivisionError):
        main([verb, str(scripts.rings(tmp_path)), "--out", str(tmp_path / "out")])
