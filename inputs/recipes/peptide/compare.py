"""Compare rigid groups at 4 fs with fix shake at 1 and 2 fs: averages, and ns/day of one core.

    python compare.py FOLDER [STARTS [WARM [TIME]]]

Each start has its own velocities, WARM ps to equilibrate, and TIME ps of samples.  Its runs with
the three integrators follow each other, so other load on the machine affects all of them alike.
Runs that are in FOLDER are not repeated.  summary.json there has the averages, with errors from
the fluctuations in each run and the scatter of starts.  Needs this package with the extra
`validation`.
"""

import json
import subprocess
import sys
from pathlib import Path

from fix_nosquish_validation.running import lammps_log, machine
from fix_nosquish_validation.statistics import measures
from fix_nosquish_validation.statistics.estimate import plain

HERE = Path(__file__).resolve().parent
WAYS = ("shake", 1.0), ("shake", 2.0), ("rigid", 4.0)
NAMES = {"shake": "fix shake", "rigid": "rigid groups"}
AVERAGES = {  # of the log's columns
    "Density": "density, g/cm³",
    "c_water": "temperature of water, K",
    "c_peptide": "temperature of the peptide, K",
    "c_oo[28][2]": "first peak of g(r) of water's O",
    "c_oo[34][3]": "neighbours within 3.4 Å",
    "c_size": "radius of gyration, Å",
}


def run(folder, way, dt, start, warm, time):
    """The averages of one start, and its ns/day by CPU time."""
    log = folder / "log.lammps"
    if not log.exists() or "Total wall time" not in log.read_text():
        folder.mkdir(parents=True, exist_ok=True)
        variables = {"inputs": HERE.parents[1], "way": way, "dt": dt, "seed": 4928 + start}
        variables |= {"warm": warm, "time": time}
        words = [word for name, value in variables.items() for word in ("-var", name, str(value))]
        subprocess.run(["lmp", "-in", HERE / "in.compare", *words], cwd=folder, check=True)
    rows = lammps_log.thermo(log.read_text())
    late = rows["Step"] * dt > 1000 * warm
    means = {title: measures.mean(rows[name][late]) for name, title in AVERAGES.items()}
    loop = lammps_log.timings(log.read_text())[-1]
    return means, 86.4 * time / (loop.seconds * loop.cpu / 100)


def summary(runs):
    """Averages of each integrator, and its speed, also relative to the first one."""
    rows, firsts = [], [speed for _, speed in runs[WAYS[0]]]
    for (way, dt), starts in runs.items():
        means = {
            title: measures.mean_of_starts([means[title] for means, _ in starts])
            for title in AVERAGES.values()
        }
        speeds = [speed for _, speed in starts]
        rows.append(
            {
                "label": f"{NAMES[way]}, {dt:g} fs",
                "means": plain(means),
                "speed": measures.spread(speeds),
                "times": measures.spread(speed / first for speed, first in zip(speeds, firsts)),
            }
        )
    return {"starts": len(firsts), "rows": rows}


def main(folder, starts=5, warm=10.0, time=100.0):
    record, runs = machine.circumstances() | {"warm": warm, "time": time}, {way: [] for way in WAYS}
    for start in range(starts):
        for way, dt in WAYS:
            runs[way, dt].append(run(folder / f"{way}-{dt:g}-{start}", way, dt, start, warm, time))
        usage = f"FOLDER {start + 1} {warm:g} {time:g}"
        record["command"] = f"python inputs/recipes/peptide/compare.py {usage}"
        (folder / "summary.json").write_text(json.dumps(record | summary(runs), indent=1) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:3]), *map(float, sys.argv[3:5]))
