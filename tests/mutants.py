"""Break the code, one fault at a time, and see that a test fails.

    python tests/mutants.py [WORD ...]

``mutants.toml`` has the faults: of each the file, a text that stands there once and its
replacement, what a user would notice, and the tests of which one has to fail.  Words choose the
faults in whose file, description or tests one of them occurs.  The result of each fault is

    killed       a test fails
    SURVIVES     all tests pass: a test is missing, or it is no fault
    GONE         the text or a test is no longer there: update the list

and the exit status is 1 if one is not killed.  Each takes 10 to 60 s, because the loops that the
change leads to are compiled anew.

All is done in a copy of the checkout, whose plugin has to be compiled (pip install -e .).  It needs
Python 3.11.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import tomllib

ROOT = Path(__file__).resolve().parent.parent
PYTEST = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
BUILD = [sys.executable, "setup.py", "-q", "build_ext", "--inplace"]
PLUGIN = "fix_nosquish/plugin"
RESULTS = {0: "SURVIVES", 1: "killed"}  # by pytest's exit status; others: a test is not there


def copy_checkout(place):
    """Copy the checkout to a new folder.

    Returns:
        the environment in which the copy is what Python and LAMMPS import.
    """
    shutil.copytree(ROOT, place, ignore=shutil.ignore_patterns(".*", "__pycache__", "build"))
    (place / "fix_nosquish_validation").symlink_to("validation")  # as pip installs it
    # else each run of pytest would compile all loops, of which a test needs few
    conftest = place / "tests/conftest.py"
    conftest.write_text(conftest.read_text().replace("    compile_loops()\n", ""))
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "fix_nosquish")
    if cache.exists():
        shutil.copytree(cache, place / "cache/fix_nosquish")
    return os.environ | {"PYTHONPATH": str(place), "XDG_CACHE_HOME": str(place / "cache")}


def result(mutant, place, environment):
    """Apply a fault in the copy, run its tests and take it back."""
    path = place / mutant["file"]
    text = path.read_text() if path.exists() else ""
    if text.count(mutant["old"]) != 1:
        return "GONE"
    how = {"cwd": place, "env": environment, "capture_output": True}
    times = path.stat()
    path.write_text(text.replace(mutant["old"], mutant["new"]))
    if path.suffix in (".h", ".cpp") or path.name == "structs.py":
        subprocess.run(BUILD, **how, check=True)
    done = subprocess.run([*PYTEST, *(f"tests/{test}" for test in mutant["tests"])], **how)
    path.write_text(text)
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))  # else the plugin seems to be old
    shutil.copytree(ROOT / PLUGIN, place / PLUGIN, dirs_exist_ok=True)
    return RESULTS.get(done.returncode, "GONE")


def main():
    results = set()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder, "checkout")
        environment = copy_checkout(place)
        for mutant in tomllib.loads((ROOT / "tests/mutants.toml").read_text())["mutant"]:
            name = f"{mutant['file']}: {mutant['fault']}"
            about = " ".join((name, *mutant["tests"]))
            if not sys.argv[1:] or any(word in about for word in sys.argv[1:]):
                word = result(mutant, place, environment)
                print(f"{word:8} {name}", flush=True)
                results.add(word)
    sys.exit(results != {"killed"})


if __name__ == "__main__":
    main()
