"""Running what breaks others: each case with each fix, a number beside its bound."""

import itertools
import re
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

from validation.breaks.plan import CASES, FIXES, SILENCE, Ended
from validation.running import lammps_log, run
from validation.running.store import Store
from validation.scenes.boxes import result, script


class Runs:
    """A way to run: a process for each input, in a folder of its own kind; what was run is not run
    again."""

    def __init__(self, folder):
        self.folder, self.known = folder, {}

    def __call__(self, system, fix, steps, ranks=1, **how):
        """The `Result` of ``boxes.script``.

        Raises:
            Ended: LAMMPS has ended with a message, or hung.
        """
        text = script(system, fix, steps, **how)
        key = text, *system.files.values()
        if key not in self.known:
            for name, content in {"in.breaks": text, **system.files}.items():
                (self.folder / name).write_text(content)
            command = [
                sys.executable,
                "-m",
                "fix_nosquish",
                "-in",
                "in.breaks",
                "-log",
                "log.breaks",
            ]
            try:
                done = subprocess.run(
                    command, cwd=self.folder, capture_output=True, text=True, timeout=SILENCE
                )
            except subprocess.TimeoutExpired:
                raise Ended(f"no end in {SILENCE:g} s") from None
            if done.returncode:
                why = re.search(r"ERROR.*", done.stdout + done.stderr)
                raise Ended(why[0] if why else f"LAMMPS crashed (exit status {done.returncode})")
            log = (self.folder / "log.breaks").read_text()
            self.known[key] = result(self.folder / "end", lammps_log.thermo(log), log)
        return self.known[key]


def breaks(names, out, meter):
    """Measure cases with all fixes, those that the output folder does not have.

    Args:
        names: in `CASES`.
        out: folder; what was measured is kept in its folder ``records``.
        meter: a ``console.Meter``.

    Returns:
        (rows, interrupted): plain data, a row for each case and fix.
    """
    rows, kept = [], Store(out / "records", "validation.breaks.measure")
    with tempfile.TemporaryDirectory() as folder:
        simulate = Runs(Path(folder))
        for case, label in itertools.product((CASES[name] for name in names), FIXES):
            fix = FIXES[label]
            meter.begin(f"{case.name}, {label}", 1)
            name = f"{case.name}/{run.folder_name(label)}"
            measure = partial(_measured, case, simulate, fix)
            try:
                found = kept.once(name, kept.origin(fix), measure)
            except KeyboardInterrupt:
                meter.end("interrupted")
                return rows, True
            meter.end(found["note"] if found["value"] is None else None)
            row = {
                "case": case.name,
                "what": case.what,
                "integrator": label,
                "most": case.most,
                "why": case.why,
                "verdict": verdict(found["value"], case.most),
            }
            rows.append(row | found)
    return rows, False


def _measured(case, simulate, fix):
    """A case's number with a fix, None where LAMMPS has ended the run, and what else there is."""
    try:
        value, note = told(case.measure(simulate, fix))
    except Ended as end:
        value, note = None, str(end)
    return {"value": value, "note": note}


def told(found):
    """A case's number, and what else there is to say of it."""
    value, note = found if isinstance(found, tuple) else (found, "")
    return float(value), note


def verdict(value, most):
    """In a word: what a number says, None where LAMMPS has ended the run."""
    return "ends" if value is None else "pass" if value <= most else "fail"
