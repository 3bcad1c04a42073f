"""Compare rigid groups at 4 fs with fix shake at 1 and 2 fs: averages, and ns/day of one core.

    python compare.py FOLDER [STARTS [PS]]

Each start has velocities of its own, 2 ps to forget them, and PS ps of samples.  Its runs with the
three integrators follow each other, so that other load on the machine is the same for all.  Runs
that FOLDER has are not run again.  Its summary.json has the averages, with 95 % intervals from
the scatter of starts.  Needs this package with the extra `validation`.
"""

import json
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np

from validation.running import lammps_log, machine
from validation.statistics import measures

HERE = Path(__file__).resolve().parent
WAYS = ("shake", 1.0), ("shake", 2.0), ("rigid", 4.0)
WARM = 2.0  # ps
NAMES = {"shake": "fix shake", "rigid": "rigid groups"}
AVERAGES = {  # of the log's columns
    "Density": "density, g/cm³",
    "c_water": "temperature of water, K",
    "c_peptide": "temperature of the peptide, K",
    "c_size": "radius of gyration, Å",
}


def run(folder, way, dt, start, time):
    """The averages of one start, and its speed, ns/day of CPU time; kept in the folder."""
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
        found = {title: rows[name][late].mean() for name, title in AVERAGES.items()}
        r, g, neighbours = np.loadtxt(folder / "rdf.txt", skiprows=4, usecols=(1, 2, 3)).T
        found["first peak of g(r) of water's O"] = g.max()
        found["neighbours within 3.4 Å"] = neighbours[r < 3.4][-1]
        found["ns/day"] = 86.4 * (WARM + time) / seconds
        kept.write_text(json.dumps(found))
    return json.loads(kept.read_text())


def summary(runs, time):
    """Averages of the integrators, and what they differ by from the first one, as plain data."""
    rows = []
    for way, dt in WAYS:
        row = {"label": f"{NAMES[way]}, {dt:g} fs"}
        for title in runs[way, dt][0]:
            own, first = ([one[title] for one in runs[key]] for key in ((way, dt), WAYS[0]))
            mean = measures.of_few(own)
            less = measures.difference(mean, measures.of_few(first))
            if title == "ns/day":
                less = measures.ratio(first, own)
            row[title] = {"mean": mean.plain(), "beside": less.plain()}
        rows.append(row)
    return {"starts": len(runs[WAYS[0]]), "warm": WARM, "time": time, "rows": rows}


def main(folder, starts=5, time=10.0):
    said = machine.circumstances() | {"command": f"python compare.py FOLDER {starts} {time:g}"}
    runs = {way: [] for way in WAYS}
    for start in range(starts):
        for way, dt in WAYS:
            own = folder / f"{way}-{dt:g}-{start}"
            runs[way, dt].append(run(own, way, dt, start, time))
        if start:
            text = json.dumps(said | summary(runs, time), indent=1)
            (folder / "summary.json").write_text(text + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:3]), *map(float, sys.argv[3:4]))
