"""Break the code, one fault at a time, and see that a test fails.

    python tests/mutants.py RESULTS [WORD ...]

``mutants.toml`` has the faults: of each the file, a text that stands there once and what replaces
it, what a user would have of it, and tests of which one has to fail; ``checked`` are those of which
this was seen.  Words choose those in whose file, fault or tests one of them stands.  It tells of
each

    killed       a test fails
    SURVIVES     all pass: a test is missing, or it is no fault
    GONE         the text, or a test, is there no more: bring the list up to date

and ends with 1 if one is not killed.  The file RESULTS keeps that, so a command that was stopped
goes on where it was.  Each takes 10 to 60 s, for loops that the change leads to are compiled anew.

All is done in a copy of the checkout, whose plugin has to be compiled (pip install -e .).  It needs
Python 3.11.
"""

import json
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
OUTCOMES = {0: "SURVIVES", 4: "GONE", 5: "GONE"}  # by pytest's exit codes


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
    kept = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "fix_nosquish")
    if kept.exists():
        shutil.copytree(kept, place / "cache/fix_nosquish")
    return os.environ | {"PYTHONPATH": str(place), "XDG_CACHE_HOME": str(place / "cache")}


def outcome(mutant, place, environment):
    """Apply a fault in the copy, run its tests and take it back: a word, and what failed."""
    path = place / mutant["file"]
    text = path.read_text()
    if text.count(mutant["old"]) != 1:
        return "GONE", "its text does not stand once in the file"
    how = {"cwd": place, "env": environment, "capture_output": True, "text": True}
    path.write_text(text.replace(mutant["old"], mutant["new"]))
    if path.suffix in (".h", ".cpp"):
        subprocess.run(BUILD, **how, check=True)
    done = subprocess.run([*PYTEST, *(f"tests/{test}" for test in mutant["tests"])], **how)
    path.write_text(text)
    shutil.copytree(ROOT / PLUGIN, place / PLUGIN, dirs_exist_ok=True)
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return OUTCOMES.get(done.returncode, "killed"), " ".join(failed)


def main():
    results, words = Path(sys.argv[1]), sys.argv[2:]
    results.touch()
    found = dict(map(json.loads, results.read_text().splitlines()))
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder, "checkout")
        environment = copy_checkout(place)
        mutants = tomllib.loads((place / "tests/mutants.toml").read_text())["mutant"]
        for number, mutant in enumerate(mutants, 1):
            name = f"{mutant['file']}: {mutant['fault']}"
            about = " ".join((name, *mutant["tests"]))
            if words and not any(word in about for word in words):
                continue
            if name not in found:
                found[name] = outcome(mutant, place, environment)
                with results.open("a") as file:
                    file.write(json.dumps((name, found[name])) + "\n")
            word, why = found[name]
            print(f"{number:3}/{len(mutants)} {word:8} {name}  {why}", flush=True)
    sys.exit(any(word != "killed" for word, _ in found.values()))


if __name__ == "__main__":
    main()
