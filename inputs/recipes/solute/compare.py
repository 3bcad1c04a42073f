"""Compare the speed of in.solute with that of in.shake, by CPU time.

    python compare.py FOLDER [STARTS [STEPS]]

The two run in turn, at constant pressure, so other load on the machine affects both alike.
summary.json in FOLDER has ns/day of one core.  Needs this package with the extra `validation`.
"""

import json
import subprocess
import sys
from pathlib import Path

from fix_nosquish_validation.running import lammps_log, machine
from fix_nosquish_validation.statistics import measures

HERE = Path(__file__).resolve().parent
WAYS = {"shake + fix npt": "in.shake", "with nosquish/npt": "in.solute"}
STEP = 2e-3  # ps, of both scripts


def run(folder, script, steps):
    """The ns/day of a script's last run, by CPU time."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in "data.solute", "forcefield.solute":
        (folder / name).write_bytes((HERE / name).read_bytes())
    words = ["-var", "warm", "100", "-var", "steps", str(steps)]
    subprocess.run(["lmp", "-in", HERE / script, *words], cwd=folder, check=True)
    loop = lammps_log.timings((folder / "log.lammps").read_text())[-1]
    return 86.4 * STEP * steps / (loop.seconds * loop.cpu / 100)


def main(folder, starts=5, steps=2000):
    subprocess.run(["lmp", "-in", "build.solute"], cwd=HERE, check=True)
    speeds = {label: [] for label in WAYS}
    for start in range(starts):
        for label, script in WAYS.items():
            speeds[label].append(run(folder / f"{script}-{start}", script, steps))
    first, second = speeds.values()
    rows = [{"label": label, "speed": measures.spread(values)} for label, values in speeds.items()]
    rows[1]["times"] = measures.spread(ours / usual for usual, ours in zip(first, second))
    record = machine.circumstances() | {"dt": 1000 * STEP, "starts": starts, "rows": rows}
    record["command"] = f"python inputs/recipes/solute/compare.py FOLDER {starts} {steps}"
    (folder / "summary.json").write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:4]))
