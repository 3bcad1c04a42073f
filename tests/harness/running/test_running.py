"""Runs of LAMMPS in processes of their own: what they leave, and how they end."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from support.running import ROOT, wait_for
from validation.running import lammps_log, run
from validation.scenes import Scene
from validation.scenes.data_file import data_file
from validation.scenes.integrators import Integrator, rigid
from validation.statistics import motion

LOG = """\
run 20
   Step          Time          TotEng
         0              0  -8049.5
        10             20  -8049.25
WARNING: something happened (src/x.cpp:1)
        20             40  -8049.75
Loop time of 0.5 on 2 procs for 20 steps with 3000 atoms

46.4% CPU use with 2 MPI tasks x 1 OpenMP threads

MPI task timing breakdown:
Section |  min time  |  avg time  |  max time  |%varavg| %total
---------------------------------------------------------------
Pair    | 0.3        | 0.31       | 0.32       |   2.0 | 63.75
Modify  | 0.045      | 0.046      | 0.047      |   0.1 |  2.19
Other   |            | 0.02792    |            |       |  1.33

Nlocal:           1500 ave        1502 max        1498 min
run 200 pre no
   Step          Time          TotEng
        20             40  -8049.75
        30             60  -8050
Loop time of 4 on 2 procs for 200 steps with 3000 atoms

99.4% CPU use with 2 MPI tasks x 1 OpenMP threads

Section |  min time  |  avg time  |  max time  |%varavg| %total
Modify  | 1e-3       | 2e-3       | 3e-3       |   0.1 |  2.19
ERROR: Lost atoms: original 3000 current 2997 (src/thermo.cpp:526)
"""


def test_timing_table():
    """Locks out minimum or maximum for average, and sections of one run given to another."""
    first, second = lammps_log.timings(LOG)
    assert first.sections == {"Pair": 0.31, "Modify": 0.046, "Other": 0.02792}
    assert second.sections == {"Modify": 2e-3}
    assert (first.seconds, first.steps, first.cpu) == (0.5, 20, 46.4)
    assert (second.seconds, second.steps, second.cpu) == (4.0, 200, 99.4)


def test_results_of_a_run_that_was_ended_as_it_wrote(tmp_path):
    """Locks out a verb that fails where Ctrl-C cut a log or a dump, and half a number read as a
    whole one."""
    whole = lammps_log.timings(LOG)[-1]
    rows = "Section |  min time  |  avg time\nPair    | 1.5        | 2.25\n"
    for end in range(len(rows) + 1):
        (*_, last) = lammps_log.timings(f"{LOG}\n{rows[:end]}")
        more = {"Pair": 2.25} if end == len(rows) else {}
        assert last.sections == whole.sections | more

    frame = "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n2\n" + "\n" * 5 + "1 2.5\n2 -12.25\n"
    first, second = frame.format(0), frame.format(20)
    dump = tmp_path / "atoms.dump"
    for end in range(len(first + second) + 1):
        dump.write_text((first + second)[:end])
        steps, values = motion.read(dump)
        count = (end >= len(first)) + (end == len(first + second))
        assert steps.tolist() == [0, 20][:count]
        assert values.tolist() == [[[1, 2.5], [2, -12.25]]] * count


@pytest.mark.quick
def test_thermo_table():
    """Locks out the step printed by both of two runs counted twice, and warnings read as rows."""
    table = lammps_log.thermo(LOG)
    assert table["Step"].tolist() == [0, 10, 20, 30]
    assert table["TotEng"].tolist() == [-8049.5, -8049.25, -8049.75, -8050.0]


def test_thermo_of_runs_that_print_different_columns():
    """Locks out a traceback where the second run prints more columns than the first, or others."""
    more = LOG.replace("Time          TotEng\n        20             40  -8049.75", "Time          "
                       "TotEng     Press\n        20             40  -8049.75  7")  # fmt: skip
    more = more.replace("60  -8050", "60  -8050   8")
    table = lammps_log.thermo(more)
    assert table["TotEng"].tolist() == [-8049.5, -8049.25, -8049.75, -8050.0]
    np.testing.assert_array_equal(table["Press"], [np.nan, np.nan, 7, 8])
    assert lammps_log.thermo("Step Temp\n")["Temp"].tolist() == []


def test_thermo_of_a_log_cut_in_a_number():
    """Locks out '-80' read from a log that ends in the middle of '-8049.75'."""
    cut = LOG[: LOG.index("-8049.75") + 3]
    assert lammps_log.thermo(cut)["TotEng"].tolist() == [-8049.5, -8049.25]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """27 rigid bent triatomic molecules of Lennard-Jones atoms."""
    folder = tmp_path_factory.mktemp("scene")
    body = np.repeat(np.arange(27), 3)
    corner = 5.0 * np.stack([body % 3, body // 3 % 3, body // 9], axis=1)
    place = corner + np.tile([(0, 0, 0), (1.0, 0, 0), (0, 1.2, 0)], (27, 1))
    kind = np.ones(81, int)
    (folder / "data.tiny").write_text(
        data_file("molecular", [body + 1, kind, place], (0, 15), mass=[12])
    )
    setup = (
        "units real",
        "atom_style molecular",
        "read_data data.tiny",
        "pair_style lj/cut 6.0",
        "pair_coeff 1 1 0.1 3.2",
        "neigh_modify exclude molecule/intra all",
        "velocity all create 100 1",
        "group water type 1",
    )
    return Scene("tiny", "27 triatomics", folder, setup, "water", "molecule", "b 1 a 1")


def running(word):
    """IDs of the processes whose command has a word."""
    results = []
    for one in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            if word.encode() in one.read_bytes() and int(one.parent.name) != os.getpid():
                results.append(int(one.parent.name))
    return results


@pytest.mark.timeout(60)
def test_ranks_end_with_a_harness_that_is_killed():
    """Locks out ranks that go on when the harness was killed: another process that shares its runs
    does the same run again, in the same folder."""
    code = (
        "import subprocess, sys, time; from validation.running import run\n"
        "with run.started([sys.executable, '-c', 'import time; time.sleep(50)']) as process:\n"
        "    print(process.pid, flush=True); time.sleep(50)"
    )
    how: dict = {"stdout": subprocess.PIPE, "text": True, "cwd": ROOT}
    with subprocess.Popen([sys.executable, "-c", code], **how) as harness:
        assert harness.stdout and int(harness.stdout.readline())
        harness.kill()
    wait_for(lambda: not running("time.sleep(50)"), 10)


@pytest.mark.timeout(120)
@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGHUP])
def test_a_verb_in_the_background_ends_all_by_a_signal(tmp_path, sign):
    """Locks out a worker that goes on when the verb was ended: it runs in the background of a shell
    script, so Ctrl-C is ignored, and the signal comes three times."""

    def in_background():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(sign, signal.SIG_DFL)  # these tests may run behind nohup

    words = ["claims", "--full", "paper/dimer-nosquish-1", "--out", str(tmp_path)]
    command = [sys.executable, "-m", "validation", *words]
    said = tmp_path / "said.txt"
    with open(said, "w") as output:
        verb = subprocess.Popen(
            command,
            cwd=ROOT,
            start_new_session=True,
            preexec_fn=in_background,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
    try:
        wait_for(lambda: any(tmp_path.rglob("log.lammps")), 60)
        for _ in range(3):
            verb.send_signal(sign)
            time.sleep(0.02)
        assert verb.wait(40) == 130, said.read_text()
        assert not running(str(tmp_path))
    finally:
        for one in {verb.pid, *running(str(tmp_path))}:
            with contextlib.suppress(ProcessLookupError):
                os.kill(one, signal.SIGKILL)
        verb.wait()


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_result_is_that_of_the_fix_of_its_name(scene, tmp_path, ranks):
    """Locks out a row of LAMMPS's fix that ours has run, wherever the suffix nosquish was set; the
    one of a script does not act there."""
    how: dict = {"dt": 1.0, "every": 1, "ranks": ranks}
    theirs, suffix = rigid("rigid/nve"), "suffix nosquish"
    first = run.job(scene, theirs, tmp_path / "off", [1], **how)
    hidden = replace(first, directory=str(tmp_path / "on"), commands=[suffix, *first.commands])
    assert run.run(first).error is None
    result = run.run(hidden)
    assert "fix 1 is rigid/nve/nosquish of fix_nosquish" in result.error
    assert run.is_there(hidden, failures=True)
    with_it = replace(scene, setup=(*scene.setup, suffix))
    named = theirs.lines[0].replace("rigid", "nosquish/rigid")  # as some write it
    for one in theirs, replace(theirs, kind="ours", lines=(named,)):
        assert run.run(run.job(with_it, one, tmp_path / one.kind, [1], **how)).error is None


def test_a_folder_that_lammps_does_not_take(tmp_path):
    """Locks out a message of encodings, and advice that does not help."""
    commands = ["region box block 0 1 0 1 0 1", "create_box 1 box", "mass 1 1", "fix 1 all nve"]
    errors = []
    for name in "größe", "another":
        (tmp_path / name).mkdir()
        write = f'write_restart "{tmp_path / name}/state.restart"'
        job = run.Job(str(tmp_path / name), str(tmp_path), [*commands, write], [1], None)
        errors.append(run.run(job).error)
    assert "the path of a file has others: give another folder by --out" in errors[0]
    assert errors[1] is None


@pytest.mark.parametrize(
    ("words", "left"),
    [
        ("nosquish", "none"),
        ("hybrid nosquish omp", "omp"),
        ("hybrid gpu nosquish", "gpu"),
        ("hybrid opt omp", "hybrid opt omp"),
        ("off", "off"),
    ],
)
def test_other_suffixes_stay(words, left):
    """Locks out a suffix of the user's that goes with ours."""
    assert run.without_suffix(f"suffix {words}") == f"suffix {left}"


@pytest.mark.timeout(60)
def test_a_hung_run_is_given_up_with_all_its_ranks(scene, tmp_path):
    """Locks out a comparison that waits for ever, and ranks that live on."""
    marker = str(tmp_path)
    hang = Integrator("hang", "hang", ("shell sleep 47",))
    job = run.job(scene, hang, tmp_path / "hang", [10], dt=1.0, every=10, ranks=2, silence=4.0)
    begin = time.monotonic()
    result = run.run(job)
    assert "no sign of life" in result.error
    assert time.monotonic() - begin < 40
    time.sleep(1.0)
    left = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True).stdout
    assert marker not in left, "a rank outlived its run"


@pytest.mark.quick
@pytest.mark.timeout(60)
def test_a_crash_is_a_result(scene, tmp_path, monkeypatch):
    """Locks out a rank killed by the system that takes the comparison with it."""
    killed = tmp_path / "killed.py"
    killed.write_text("import os\nos.kill(os.getpid(), 9)\n")
    monkeypatch.setattr(run, "WORKER", killed)
    job = run.job(scene, rigid("rigid"), tmp_path / "crash", [10], dt=1.0, every=10)
    result = run.run(job)
    assert "signal 9" in result.error or "exit code 9" in result.error


@pytest.mark.quick
def test_help_is_instant():
    """Locks out heavy imports before the command line is read."""
    code = (
        "import sys; sys.argv[1:] = ['compare', '--help']\n"
        "from validation.__main__ import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'matplotlib', 'rich', 'lammps', 'mpi4py'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "--ranks" in done.stdout


@pytest.fixture
def unfinished(tmp_path, monkeypatch):
    """A job whose ranks sleep, and what ends its processes in the end; SIGTERM is a Ctrl-C."""
    worker = tmp_path / "worker.py"
    worker.write_text("import time\ntime.sleep(100)\n")
    monkeypatch.setattr(run, "WORKER", worker)
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    yield run.Job(str(tmp_path / "run"), ".", [], [], None, ranks=2)
    signal.signal(signal.SIGTERM, before)
    for one in running(str(worker)):
        os.kill(one, signal.SIGKILL)


@pytest.mark.timeout(60)
@pytest.mark.parametrize("moment", ["begin", "end", "behind", "again"])
def test_a_signal_at_a_bad_moment_leaves_no_process(unfinished, monkeypatch, moment):
    """Locks out ranks that go on for ever: a signal came while their mpirun was being started, or
    a second one while they were being ended. And one that is lost, as it came when a run's
    processes had just ended: the verb would go on with the next run. And one that comes again soon
    after, which ends the verb as it writes what it has."""
    popen, kill = subprocess.Popen, os.killpg

    def stop():
        os.kill(os.getpid(), signal.SIGTERM)

    def begins(*words, **more):
        process = popen(*words, **more)
        if moment == "begin":
            stop()
        return process

    def ends(*one):
        stop()
        kill(*one)
        if moment == "again":
            threading.Timer(0.3, stop).start()

    def watch(*_):
        time.sleep(1)  # until there are ranks
        if moment == "end":
            stop()
        return False

    monkeypatch.setattr(subprocess, "Popen", begins)
    monkeypatch.setattr(os, "killpg", ends)
    monkeypatch.setattr(run, "watch", watch)
    try:
        result = run.run(unfinished)
        time.sleep(0.5 * (moment == "again"))  # at its report
    except KeyboardInterrupt:  # it would end pytest
        pytest.fail("the signal has passed through")
    assert result.interrupted and result.error == run.INTERRUPTED
    wait_for(lambda: not running(str(run.WORKER)), 10)
    assert signal.getsignal(signal.SIGTERM) is signal.default_int_handler


def test_a_run_that_was_stopped_is_not_hung(tmp_path, monkeypatch):
    """Locks out a run given up because it and the harness were stopped for longer than a hung run
    may be silent."""
    process = subprocess.Popen(["sleep", "1.5"])
    sleep = time.sleep
    monkeypatch.setattr(
        run.time, "sleep", lambda seconds: sleep(seconds + 0.5)
    )  # as if stopped between two looks
    assert not run.watch(process, tmp_path / "log", 1.0, print)


def test_an_mpi_library_within_lammps(tmp_path):
    """Locks out a crash of LAMMPS that starts from Python with a second MPI library, as the package
    lammps had one up to 2025.7.22.0.1."""
    for name in "lammps/__init__.py", "lammps.libs/libmpi-2dae7d75.so.12":
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    done = subprocess.run(
        [sys.executable, "-m", "validation", "check", "in.any", "--out", str(tmp_path / "out")],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1 and "pip install 'lammps>=2025.7.22.0.2'" in done.stderr
