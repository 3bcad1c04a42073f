"""Compare commands of LAMMPS, or of GROMACS's mdrun: speed and averages of the last run of each.

    python compare.py FILE FOLDER [STARTS]

FILE has a section [commands] with lines LABEL = COMMAND, in which {seed} differs from start to
start, and may have one [averages] with lines TITLE = COLUMN, of LAMMPS's log, or
TITLE = time COLUMN for its correlation time in ps.  Commands run in turn, so other load on the
machine affects all alike.  LAMMPS's speed is that by CPU time, GROMACS's by wall time.
summary.json in FOLDER has speeds, also relative to the first command, and averages, with errors
from the fluctuations in each run and the scatter of starts.  Runs whose complete log is in FOLDER,
or which an earlier summary.json there has, are not repeated, so more starts can be added later.
Needs this package with the extra `validation`.
"""

import json
import re
import shlex
import subprocess
import sys
from configparser import RawConfigParser
from pathlib import Path

from fix_nosquish_validation.running import lammps_log, machine
from fix_nosquish_validation.statistics import measures
from fix_nosquish_validation.statistics.estimate import Estimate, plain

SEED = 4928
COMPLETE = re.compile(r"^(Total wall time|Finished mdrun)", re.M)


def run(command, log):
    """The log of a command's run."""
    if not log.exists() or not COMPLETE.search(log.read_text()):
        words = shlex.split(command)
        subprocess.run([*words, "-g" if words[0] == "gmx" else "-log", log], check=True)
    return log.read_text()


def speed(text):
    """The ns/day of a log's last run; LAMMPS's time step is in fs."""
    if gromacs := re.findall(r"^Performance: +(\S+) +\S+$", text, re.M):
        return float(gromacs[-1])
    loop = lammps_log.timings(text)[-1]
    return 0.0864 * time_step(text) * loop.steps / (loop.seconds * loop.cpu / 100)


def time_step(text):
    """The last time step of LAMMPS's log, fs."""
    return float(re.findall(r"^timestep +([\d.]+)", text, re.M)[-1])


def means(text, columns):
    """Averages, or correlation times, of a log's last run, by title."""
    if not columns:
        return {}
    rows, loop = lammps_log.thermo(text), lammps_log.timings(text)[-1]
    late = rows["Step"] > rows["Step"][-1] - loop.steps
    # an independent sample is two correlation times from the next
    half = time_step(text) / 1000 * (rows["Step"][-1] - rows["Step"][-2]) / 2

    def estimate(words):
        *time, name = words.split()
        x = rows[name][late]
        return measures.autocorrelation(x).times(half) if time else measures.mean(x)

    return {title: estimate(words) for title, words in columns.items()}


def main(file, folder, starts=1):
    settings = RawConfigParser(delimiters="=")
    settings.optionxform = str  # keeps capitals
    settings.read_string("[averages]")
    settings.read_string(file.read_text())
    commands, columns = settings["commands"], settings["averages"]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "summary.json"
    rows = json.loads(path.read_text())["rows"] if path.exists() else []
    former, runs = {row["label"]: row.get("runs", []) for row in rows}, {}
    for start in range(starts):
        for place, (label, command) in enumerate(commands.items()):
            log, known = folder / f"{place}-{start}.log", former.get(label, [])[start : start + 1]
            if log.exists() or not known:
                text = run(command.replace("{seed}", str(SEED + start)), log)
                known = [{"speed": speed(text), "means": plain(means(text, columns))}]
            runs.setdefault(label, []).extend(known)
    first, rows = [one["speed"] for one in next(iter(runs.values()))], []
    for label, of_label in runs.items():
        speeds = [one["speed"] for one in of_label]
        averages = {
            title: measures.mean_of_starts([Estimate.of(one["means"][title]) for one in of_label])
            for title in columns
        }
        rows.append(
            {
                "label": label,
                "means": plain(averages),
                "speed": measures.spread(speeds),
                "times": measures.spread([ours / usual for usual, ours in zip(first, speeds)]),
                "runs": of_label,
            }
        )
    usage = f"python compare.py {file} FOLDER {starts}"
    record = machine.circumstances() | {"starts": starts, "rows": rows, "command": usage}
    path.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]), *map(int, sys.argv[3:4]))
