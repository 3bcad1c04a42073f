"""The suite itself: it tests the installed package, and says when a part is missing."""

import os
import re
import shutil
import subprocess
import sys

import pytest

from support.running import BIN, ROOT
from validation.running import startup

COMMANDS = {"module": [sys.executable, "-m", "pytest"], "script": [str(BIN / "pytest")]}

WHERE = """
import subprocess
import sys

CODE = "import fix_nosquish; print(fix_nosquish.__file__)"

def test_where():
    import fix_nosquish
    import validation

    assert validation.__file__ == {validation!r}
    assert fix_nosquish.__file__ == {package!r}
    for folder, code in ("/", CODE), ({checkout!r}, "import validation; " + CODE):
        said = subprocess.check_output([sys.executable, "-c", code], cwd=folder, text=True)
        assert said.strip() == {package!r}
"""
PARTS = """
import pytest

@pytest.mark.skipif(True, reason="no engine")
def test_engine():
    pass

@pytest.mark.xfail
def test_known():
    assert False
"""


@pytest.fixture
def checkout(tmp_path):
    """A copy of the checkout with these tests alone, by name."""
    folder = tmp_path / "copy"
    ignore = shutil.ignore_patterns("__pycache__", "results", "test_*", "*.so")
    for name in "fix_nosquish", "tests", "validation":
        shutil.copytree(ROOT / name, folder / name, ignore=ignore)
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def run(checkout, *words, how="module", **tests):
    """Run pytest on these tests in the copy of the checkout."""
    for name, text in tests.items():
        (checkout / "tests" / f"test_{name}.py").write_text(text)
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")
    }
    return subprocess.run(
        [*COMMANDS[how], *words],
        cwd=checkout,
        env=environment,
        text=True,
        timeout=60,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )


@pytest.mark.quick("module")
@pytest.mark.parametrize("how", COMMANDS)
def test_imports_what_is_installed(checkout, how):
    """Locks out tests of the checkout's files while LAMMPS's processes import others."""
    package = startup.package()
    done = run(
        checkout,
        how=how,
        where=WHERE.format(
            checkout=str(checkout),
            validation=str(checkout / "validation" / "__init__.py"),
            package=str(package / "__init__.py"),
        ),
    )
    assert done.returncode == 0 and "1 passed" in done.stdout, done.stdout
    assert str(package) in done.stdout.split("collected")[0]


MODULE = 'import pytest\n\npytest.importorskip("no_such_module")\n'


def test_refuses_another_package(checkout):
    """Locks out a suite that silently tests another package than the checkout's."""
    changed = checkout / "fix_nosquish" / "integrators" / "nve.py"
    assert changed.exists()
    changed.open("a").write("# changed\n")
    done = run(checkout, where="def test_nothing():\n    pass\n")
    assert done.returncode == pytest.ExitCode.USAGE_ERROR and "passed" not in done.stdout, (
        done.stdout
    )
    assert "not the same: integrators/nve.py. Install it first: pip install ." in done.stdout


@pytest.mark.parametrize("options", [[], ["--nothing-missing"], ["--nothing-missing", "-n", "1"]])
def test_nothing_missing(checkout, options):
    """Locks out tests and modules that are skipped without notice
    where all parts are to be there."""
    done = run(
        checkout, *options, "-rA", "--continue-on-collection-errors", parts=PARTS, module=MODULE
    )
    printed = re.findall(r"^(SKIPPED|FAILED|ERROR|XFAIL)", done.stdout, re.MULTILINE)
    expected = ["ERROR", "ERROR", "XFAIL"] if options else ["SKIPPED", "SKIPPED", "XFAIL"]
    assert (
        sorted(printed) == expected
        and "no engine" in done.stdout
        and "no_such_module" in done.stdout
    ), done.stdout
