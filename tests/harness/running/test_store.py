"""What the harness keeps: it is taken again while all that it follows from is the same."""

import json
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

from support.running import ROOT
from validation.running import json_files, machine, run, store
from validation.running.store import Store


@dataclass(frozen=True)
class Settings:
    steps: int


@pytest.fixture
def harness(tmp_path, monkeypatch):
    """A copy of the harness whose files can be changed."""
    copy = tmp_path / "validation"
    ignored = shutil.ignore_patterns("results", "__pycache__")
    shutil.copytree(ROOT / "validation", copy, ignore=ignored)
    monkeypatch.setattr(store, "HARNESS", copy)
    store.code.cache_clear()
    yield copy
    store.code.cache_clear()


def counted(found):
    """A function that makes a record, and the list of its calls."""
    calls = []
    return lambda: calls.append(1) or found, calls


@pytest.mark.quick
def test_made_once(tmp_path):
    """Locks out work that is done again, and a record that is taken for another's."""
    make, calls = counted({"value": 1.5})
    for _ in range(2):
        kept = Store(tmp_path)
        assert kept.once("some/thing", kept.origin(Settings(3)), make) == {"value": 1.5}
    assert len(calls) == 1
    for name, origin in (
        ("other", kept.origin(Settings(3))),
        ("some/thing", kept.origin(Settings(4))),
    ):
        kept.once(name, origin, make)
    assert len(calls) == 3


@pytest.mark.quick
def test_origin_is_all_that_counts(tmp_path, monkeypatch):
    """Locks out a record that stays though a file, a version or the package is another."""
    file = tmp_path / "input"
    file.write_text("one")
    results = {Store(tmp_path).origin(Settings(3), files=[file])}
    file.write_text("two")
    results.add(Store(tmp_path).origin(Settings(3), files=[file]))
    monkeypatch.setattr(machine, "versions", lambda: {"lammps": "another"})
    results.add(Store(tmp_path).origin(Settings(3), files=[file]))
    monkeypatch.setattr(machine, "package_hash", lambda: "another")
    results.add(Store(tmp_path).origin(Settings(3), files=[file]))
    assert len(results) == 4
    with pytest.raises(TypeError, match="is no plain data"):
        Store(tmp_path).origin(object())


@pytest.mark.quick
@pytest.mark.parametrize(
    ("name", "counts"),
    [
        *(("stress/tops.py", True), ("scenes/boxes.py", True), ("running/run.py", True)),
        # a worker, which nothing imports, and what others of the harness's own are compiled from
        *(("running/worker.py", True), ("running/recorder.cpp", True), ("experiment.py", True)),
        *(("stress/command.py", False), ("stress/report.py", False), ("pages/console.py", False)),
    ],
)
def test_code_that_measures_counts(harness, name, counts):
    """Locks out results that stay though what made them is another, and results that are lost by
    another help text, table or figure."""
    before = store.code()
    (harness / name).write_text((harness / name).read_text() + "\nMORE = 1\n")
    store.code.cache_clear()
    assert (store.code() != before) is counts


def test_interrupted(tmp_path):
    """Locks out half a record after a Ctrl-C, and earlier ones that it takes along."""
    kept = Store(tmp_path)

    def stop():
        raise KeyboardInterrupt

    kept.once("first", kept.origin(1), lambda: {"value": 1})
    with pytest.raises(KeyboardInterrupt):
        kept.once("second", kept.origin(1), stop)
    assert kept.load("second", kept.origin(1)) is None
    assert kept.load("first", kept.origin(1))["record"] == {"value": 1}
    kept.save("second", kept.origin(1), {"value": 2}, complete=False)
    assert kept.once("second", kept.origin(1), lambda: {"value": 3}) == {"value": 3}


def test_processes_share(tmp_path):
    """Locks out work that two processes do, and one that waits for another while there is more."""
    with Store(tmp_path).locked("one"):
        names = Store(tmp_path).shared(["one", "two"])
        assert next(names) == "two"
    assert [*names] == ["one"]


def test_file_is_whole(tmp_path, monkeypatch):
    """Locks out a file that an interruption leaves in half."""
    json_files.write(tmp_path / "one.json", {"value": 1})

    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", stop)
    with pytest.raises(KeyboardInterrupt):
        json_files.write(tmp_path / "one.json", {"value": 2})
    assert json.loads((tmp_path / "one.json").read_text()) == {"value": 1}


DAMAGES = {
    "cut": lambda text: text[: len(text) // 2],
    "empty": lambda text: "",
    "a list": lambda text: f"[{text}]",
    "an unknown field": lambda text: text.replace("{", '{"colour": 1,', 1),
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("file", ["job.json", "done.json"])
def test_a_damaged_file_of_a_run_has_it_done_again(tmp_path, capsys, file, damage):
    """Locks out a traceback where a folder is gone on with in which a file was cut short, by a
    full disk or an older version, or is of a newer one."""
    made = ["region box block 0 1 0 1 0 1", "create_box 1 box", "mass 1 1", "fix 1 all nve"]
    job = run.Job(str(tmp_path / "run"), str(tmp_path), made, [1], None)
    assert run.once(job).error is None and run.is_there(job)
    path = tmp_path / "run" / file
    path.write_text(DAMAGES[damage](path.read_text()))
    if (file, damage) == ("done.json", "an unknown field"):
        assert run.is_there(job) and run.collect(path.parent).error is None
        return
    assert not run.is_there(job)
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith(f"{path} is damaged (") and said.endswith("is done again")
    assert (run.collect(path.parent).error is None) is (file == "job.json")
    assert run.once(job).error is None and run.is_there(job)


def test_positions_that_were_not_written_to_their_end(tmp_path, harness, monkeypatch):
    """Locks out half a file of positions, which ends all later commands in the folder."""
    worker = harness / "running" / "worker.py"
    text = run.WORKER.read_text()
    assert text.count("np.savez(file, **arrays)") == 1
    worker.write_text(text.replace("np.savez(file, **arrays)", "file.write(b'PK'); 1 / 0"))
    monkeypatch.setattr(run, "WORKER", worker)
    made = ["region box block 0 1 0 1 0 1", "create_box 1 box", "create_atoms 1 single 0 0 0"]
    made = ["atom_style molecular", *made, "mass 1 1", "fix 1 all nve"]
    job = run.Job(str(tmp_path / "run"), str(tmp_path), made, [1], "molecule")
    assert run.run(job).error == "division by zero"
    assert run.collect(job.directory).positions is None


def test_nothing_of_python_runs_between_fork_and_exec(monkeypatch):
    """Locks out a child that waits for ever for a lock that another thread, as that of a progress
    bar, had when it was forked."""
    popen, seen = subprocess.Popen, []

    def begins(words, **more):
        seen.append(more)
        return popen(words, **more)

    monkeypatch.setattr(subprocess, "Popen", begins)
    output = subprocess.PIPE
    with run.started(["sh", "-c", "trap"], stdout=output, text=True) as process:
        assert process.communicate()[0] == ""  # no signal is ignored
    with run.started(["no-such-program"], stderr=output, text=True) as process:
        printed = process.communicate()[1]
    assert printed == "ERROR: no-such-program cannot be started: No such file or directory\n"
    assert len(seen) == 2 and not any(more.get("preexec_fn") for more in seen)
