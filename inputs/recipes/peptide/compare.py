"""Compare rigid groups at 4 fs with fix shake at 1 and 2 fs: averages, and ns/day of one core.

    python compare.py FOLDER [STARTS [PS]]

Each start has its own velocities, 2 ps to equilibrate, and PS ps of samples.  Its runs with the
three integrators follow each other, so other load on the machine affects all of them alike.
Runs that are in FOLDER are not repeated.  summary.json there has the averages.  Needs this package
with the extra `validation`.
"""

import json
import resource
import subprocess
import sys
from pathlib import Path

from validation.running import lammps_log, machine
from validation.statistics import measures
from validation.statistics.estimate import Estimate, plain

HERE = Path(__file__).resolve().parent
WAYS = ("shake", 1.0), ("shake", 2.0), ("rigid", 4.0)
WARM = 2.0  # ps
NAMES = {"shake": "fix shake", "rigid": "rigid groups"}
AVERAGES = {  # of the log's columns
    "Density": "density, g/cm³",
    "c_water": "temperature of water, K",
    "c_peptide": "temperature of the peptide, K",
    "c_oo[28][2]": "first peak of g(r) of water's O",
    "c_oo[34][3]": "neighbours within 3.4 Å",
    "c_size": "radius of gyration, Å",
}
SPEED = "ns/day"


def run(folder, way, dt, start, time):
    """The averages of one start, and its ns/day by CPU time; kept in the folder."""
    kept = folder / "averages.json"
    if not kept.exists():
        folder.mkdir(parents=True, exist_ok=True)
        given = {"inputs": HERE.parents[1], "way": way, "dt": dt, "seed": 4928 + start}
        given |= {"warm": WARM, "time": time}
        words = [word for name, value in given.items() for word in ("-var", name, str(value))]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(["lmp", "-in", HERE / "in.compare", *words], cwd=folder, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        rows = lammps_log.thermo((folder / "log.lammps").read_text())
        late = rows["Step"] * dt > 1000 * WARM
        found = {title: measures.mean(rows[name][late]) for name, title in AVERAGES.items()}
        kept.write_text(json.dumps(plain(found) | {SPEED: 86.4 * (WARM + time) / seconds}))
    return json.loads(kept.read_text())


def summary(runs, time):
    """Averages of the integrators, what they differ by from the first one, and speeds."""
    means = {
        way: {
            title: measures.of_starts([Estimate.of(one[title]) for one in starts])
            for title in AVERAGES.values()
        }
        for way, starts in runs.items()
    }
    rows = []
    for way, dt in WAYS:
        own, first, starts = means[way, dt], means[WAYS[0]], runs[way, dt]
        less = {title: measures.difference(own[title], first[title]) for title in own}
        rows.append({
            "label": f"{NAMES[way]}, {dt:g} fs",
            "means": plain(own),
            "less": plain(less),
            "speed": measures.spread(one[SPEED] for one in starts),
            "times": measures.spread(
                one[SPEED] / other[SPEED] for one, other in zip(starts, runs[WAYS[0]])
            ),
        })  # fmt: skip
    return {"starts": len(runs[WAYS[0]]), "warm": WARM, "time": time, "rows": rows}


def main(folder, starts=5, time=10.0):
    said, runs = machine.circumstances(), {way: [] for way in WAYS}
    for start in range(starts):
        for way, dt in WAYS:
            own = folder / f"{way}-{dt:g}-{start}"
            runs[way, dt].append(run(own, way, dt, start, time))
        said["command"] = f"python inputs/recipes/peptide/compare.py FOLDER {start + 1} {time:g}"
        text = json.dumps(said | summary(runs, time), indent=1)
        (folder / "summary.json").write_text(text + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:3]), *map(float, sys.argv[3:4]))
