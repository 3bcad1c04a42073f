"""Running copies of LAMMPS's examples, with its own fixes and with ours in their place."""

import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ..running import lammps_log, run
from ..running.store import Store
from .plan import DENSE, ROWS, Example

OURS, THEIRS = "ours", "theirs"
SUFFIX = "-sf", "nosquish"
SILENCE = 300.0  # s of a run at most, above what it is to take


@dataclass(frozen=True)
class Lengths:
    """How long all this is.

    Attributes:
        steps: of the runs of a script together, at most.
        starts: with other seeds, the input's own counted.
        seconds: of a run with LAMMPS's own fix on 1 rank at most; the others are as long.
    """

    steps: int
    starts: int
    seconds: float


class Runs:
    """A way to run copies of examples: each in a folder of its own, and kept as a record."""

    def __init__(self, out: Path, lengths: Lengths) -> None:
        self.lengths = lengths
        self.kept = Store(out / "records", "examples.runs")

    def every(self, example: Example) -> int:
        """Steps from one row to the next."""
        return max(1, self.lengths.steps // example.runs // ROWS)

    def first(self, example: Example) -> tuple[dict, list[int]]:
        """The record of the run with LAMMPS's own fix on 1 rank, and how long others are."""
        steps = [max(DENSE, self.lengths.steps // example.runs)] * example.runs
        text = example.copy(steps, self.every(example), seconds=self.lengths.seconds)
        record = self(example, text, THEIRS, 1, "first")
        made = [int(table["Step"][-1] - table["Step"][0]) for table in record["tables"]]
        return record, [*made, *steps[len(made) :]]

    def __call__(self, example: Example, text: str, which: str, ranks: int, name: str) -> dict:
        """The record of a run: ``error``, ``said`` (what took the place of what) and ``tables``."""
        origin = self.kept.origin(text, which, ranks, files=example.files)
        make = partial(self._run, example, text, which, ranks)
        return self.kept.once(f"{example.name}/{which}-{ranks}-{name}", origin, make)

    def _run(self, example, text, which, ranks):
        words = [*run.launcher(ranks), sys.executable, "-m", "fix_nosquish"]
        words += ["-in", example.path.name, "-log", "log.examples", "-nocite"]
        words += SUFFIX if which == OURS else ()
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            for file in example.files:
                (folder / file.name).symlink_to(file.resolve())
            (folder / example.path.name).unlink()
            (folder / example.path.name).write_text(text)
            with open(folder / "output.txt", "w") as output:
                error = self._watched(words, folder, output)
            said = _read(folder / "output.txt")
            log = _read(folder / "log.examples") or said
        if error:
            error = run.one_line(lammps_log.error(said) or lammps_log.error(log) or error)
        return {"error": error, "said": _said(said), "tables": tables(log)}

    def _watched(self, words, folder, output):
        """Why a run did not end well; None if it did."""
        how: dict = {"cwd": folder, "stdout": output, "stderr": subprocess.STDOUT}
        with run.started(words, **how) as process:
            try:
                status = process.wait(SILENCE + 3 * self.lengths.seconds)
            except subprocess.TimeoutExpired:
                return "no end"
        return f"LAMMPS crashed (exit status {status})" if status else None


def _read(path):
    return path.read_text(errors="replace") if path.exists() else ""


def _said(text):
    """What the log says of fixes that take others' places."""
    return list(dict.fromkeys(re.findall(r"^Fix \S+: (nosquish.*)", text, re.M)))


def tables(log: str) -> list[dict]:
    """Each run's table of a log: {column: values}."""
    parts = re.split(r"^Loop time.*$", log, flags=re.M)
    read = (lammps_log.thermo(part) for part in parts)
    return [{name: [*map(float, some)] for name, some in one.items()} for one in read if one]
