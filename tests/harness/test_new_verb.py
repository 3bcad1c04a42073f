"""A verb that is added to the harness, as its page says."""

import shutil
import subprocess
import sys
from pathlib import Path

from support.running import ROOT


def test_the_example_of_a_verb_runs(tmp_path):
    """Locks out an example that does not run, and a verb that has to be entered somewhere."""
    ignored = shutil.ignore_patterns("results", "__pycache__")
    shutil.copytree(ROOT / "validation", tmp_path / "validation", ignore=ignored)
    (tmp_path / "inputs").symlink_to(ROOT / "inputs")
    folder = tmp_path / "validation" / "wiggle"
    folder.mkdir()
    (folder / "__init__.py").touch()
    shutil.copy(Path(__file__).parent / "wiggle.py", folder / "command.py")
    words = [sys.executable, "-m", "validation", "wiggle", "--out", "out"]
    for _ in range(2):  # the second time nothing is run
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stdout + done.stderr
    rows = (tmp_path / "out" / "table.csv").read_text().splitlines()[1:]
    spread = [float(row.split(",")[1]) for row in rows]
    assert len(spread) == 3 and spread[2] > 2 * spread[1] > 4 * spread[0]
    assert "3 steps were measured" in (tmp_path / "out" / "report.html").read_text()
