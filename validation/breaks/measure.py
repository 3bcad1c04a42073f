"""Running what breaks others: each case with each fix, a number beside its bound."""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from ..running import lammps_log, run
from ..running.store import Store
from ..scenes.boxes import Result, System, result, script
from .plan import CASES, FIXES, SILENCE, Ended


class Runs:
    """A way to run: a process for each input, in a folder of its own kind; what was run is not run
    again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.known: dict[tuple, Result] = {}

    def __call__(self, system: System, fix: str, steps: int, ranks: int = 1, **how) -> Result:
        """The result of ``boxes.script``.

        Raises:
            Ended: LAMMPS has ended with a message, or hung.
            ValueError: it is to have several ranks, which this does not do.
        """
        if ranks != 1:
            raise ValueError("runs on one rank only")
        text = script(system, fix, steps, **how)
        key = text, *system.files.values()
        if key not in self.known:
            self.known[key] = self._run({"in.breaks": text, **system.files})
        return self.known[key]

    def _run(self, files):
        for name, content in files.items():
            (self.folder / name).write_text(content)
        command = [sys.executable, "-m", "fix_nosquish", "-in", "in.breaks", "-log", "log.breaks"]
        how: dict = {"cwd": self.folder, "capture_output": True, "text": True, "timeout": SILENCE}
        try:
            done = subprocess.run(command, **how)
        except subprocess.TimeoutExpired:
            raise Ended(f"no end in {SILENCE:g} s") from None
        if done.returncode:
            why = re.search(r"ERROR.*", done.stdout + done.stderr)
            raise Ended(why[0] if why else f"LAMMPS crashed (exit status {done.returncode})")
        log = (self.folder / "log.breaks").read_text()
        return result(self.folder / "end", lammps_log.thermo(log), log)


def breaks(names: Iterable[str], out: Path, meter: run.Meter) -> tuple[list[dict], bool]:
    """Measure cases with all fixes, those that the output folder does not have in ``records``.

    Returns:
        plain data, a row for each case and fix; whether a Ctrl-C ended it.
    """
    rows: list[dict] = []
    kept = Store(out / "records", "breaks.measure")
    with tempfile.TemporaryDirectory() as folder:
        simulate = Runs(Path(folder))
        for case, label in ((CASES[name], label) for name in names for label in FIXES):
            meter.begin(f"{case.name}, {label}", 1)
            name, fix = f"{case.name}/{run.folder_name(label)}", FIXES[label]
            make = partial(_measured, case, simulate, fix)
            try:
                found = kept.once(name, kept.origin(fix), make)
            except KeyboardInterrupt:
                meter.end("interrupted")
                return rows, True
            meter.end(found["note"] if found["value"] is None else None)
            row = {"case": case.name, "what": case.what, "integrator": label, "most": case.most}
            row |= {"why": case.why, "verdict": verdict(found["value"], case.most)}
            rows.append(row | found)
    return rows, False


def _measured(case, simulate, fix):
    """A case's number with a fix, None where LAMMPS has ended the run, and what else there is."""
    try:
        value, note = told(case.measure(simulate, fix))
    except Ended as end:
        value, note = None, str(end)
    return {"value": value, "note": note}


def told(found: float | tuple[float, str]) -> tuple[float, str]:
    """A case's number, and what else there is to say of it."""
    value, note = found if isinstance(found, tuple) else (found, "")
    return float(value), note


def verdict(value: float | None, most: float) -> str:
    """In a word: what a number says, None where LAMMPS has ended the run."""
    return "ends" if value is None else "pass" if value <= most else "fail"
