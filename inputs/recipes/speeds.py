"""Compare the speeds of LAMMPS commands, which run in turn: ns/day of the last run of each.

    python speeds.py FOLDER ROUNDS "LABEL: COMMAND" "LABEL: COMMAND" ...

The speed is that by CPU time, so other load on the machine matters little, and all commands get
the same share of it.  summary.json in FOLDER has the speeds, also relative to the first command.
Needs this package with the extra `validation`.
"""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

from fix_nosquish_validation.running import lammps_log, machine
from fix_nosquish_validation.statistics import measures


def speed(command, log):
    """The ns/day of a command's last run, by CPU time; its time step is in fs."""
    words = [*shlex.split(command), "-log", log]
    text = subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True).stdout
    loop = lammps_log.timings(text)[-1]
    dt = float(re.findall(r"^ +Time step +: (\S+)", text, re.M)[-1])  # only on the screen
    return 0.0864 * dt * loop.steps / (loop.seconds * loop.cpu / 100)


def main(folder, rounds, *labelled):
    folder.mkdir(parents=True, exist_ok=True)
    commands = dict(text.split(": ", 1) for text in labelled)
    speeds = {label: [] for label in commands}
    for number in range(rounds):
        for place, (label, command) in enumerate(commands.items()):
            speeds[label].append(speed(command, folder / f"log.{place}-{number}"))
    first, *_ = speeds.values()
    rows = [
        {
            "label": label,
            "speed": measures.spread(values),
            "times": measures.spread(ours / usual for usual, ours in zip(first, values)),
        }
        for label, values in speeds.items()
    ]
    words = shlex.join(["python", "speeds.py", "FOLDER", str(rounds), *labelled])
    record = machine.circumstances() | {"rounds": rounds, "rows": rows, "command": words}
    (folder / "summary.json").write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:])
