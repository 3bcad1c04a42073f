"""Compare commands of LAMMPS, or of GROMACS's mdrun: speed and averages of the last run of each.

    python compare.py FILE FOLDER [STARTS]

FILE has a section [commands] with lines LABEL = COMMAND, in which {seed} differs from start to
start, and may have one [averages] with lines TITLE = COLUMN, of LAMMPS's log.  Commands run in
turn, so other load on the machine affects all alike.  LAMMPS's speed is that by CPU time, GROMACS's
by wall time.  Runs that are complete in FOLDER are not repeated.  summary.json there has speeds,
also relative to the first command, and averages, with errors from the fluctuations in each run and
the scatter of starts.  Needs this package with the extra `validation`.
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
from fix_nosquish_validation.statistics.estimate import plain

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
    dt = float(re.findall(r"^timestep +([\d.]+)", text, re.M)[-1])
    return 0.0864 * dt * loop.steps / (loop.seconds * loop.cpu / 100)


def means(text, columns):
    """Averages of a log's last run, by title."""
    if not columns:
        return {}
    rows, loop = lammps_log.thermo(text), lammps_log.timings(text)[-1]
    late = rows["Step"] > rows["Step"][-1] - loop.steps
    return {title: measures.mean(rows[name][late]) for title, name in columns.items()}


def main(file, folder, starts=1):
    settings = RawConfigParser(delimiters="=")
    settings.optionxform = str  # keeps capitals
    settings.read_string("[averages]")
    settings.read_string(file.read_text())
    commands, columns = settings["commands"], settings["averages"]
    folder.mkdir(parents=True, exist_ok=True)
    logs = {label: [] for label in commands}
    for start in range(starts):
        for place, (label, command) in enumerate(commands.items()):
            words = command.replace("{seed}", str(SEED + start))
            logs[label].append(run(words, folder / f"{place}-{start}.log"))
    speeds = {label: [speed(text) for text in texts] for label, texts in logs.items()}
    first, rows = next(iter(speeds.values())), []
    for label, texts in logs.items():
        of_starts = [means(text, columns) for text in texts]
        averages = {
            title: measures.mean_of_starts([its[title] for its in of_starts]) for title in columns
        }
        times = [ours / usual for usual, ours in zip(first, speeds[label])]
        rows.append(
            {
                "label": label,
                "means": plain(averages),
                "speed": measures.spread(speeds[label]),
                "times": measures.spread(times),
            }
        )
    usage = f"python compare.py {file} FOLDER {starts}"
    record = machine.circumstances() | {"starts": starts, "rows": rows, "command": usage}
    (folder / "summary.json").write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]), *map(int, sys.argv[3:4]))
