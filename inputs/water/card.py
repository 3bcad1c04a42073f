"""Forces on a graphics card beside those of the host: in.card by two commands of LAMMPS.

    python card.py "mpirun -np 8 lmp" "lmp -k on g 1 -sf kk" [STEPS [N ...]]

Run it in this folder. It prints how far atoms are apart after 20 steps of 2 fs, the total energy in
STEPS (10,000) more steps, and what steps cost on the card with 3,000 N^3 atoms (N is 2, 3 and 7).
The logs, log.*, stay.
"""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np

TIMED = {"nosquish": 2.0, "shake": 2.0, "heavy": 10.0}  # time steps in fs, by in.card's names


def run(command: str, name: str, **variables: object) -> str:
    """Run in.card; return its log."""
    variables |= {"name": name}
    words = " ".join(f"-var {key} {value}" for key, value in variables.items())
    line = f"{command} -in in.card -log log.{name} -screen none {words}"
    if subprocess.run(shlex.split(line)).returncode:
        sys.exit(f"{line}\nended with an error: see log.{name}")
    return Path(f"log.{name}").read_text()


def compare(logs: dict[str, str]) -> None:
    """Print what the log says of copies, and how two runs differ."""
    kokkos = [line for line in logs["card"].splitlines() if re.match(" *KOKKOS", line)]
    ends = [np.loadtxt(f"end.{name}", skiprows=9) for name in logs]
    apart = np.abs(ends[1] - ends[0])
    print(*kokkos, sep="\n")
    print(f"After 20 steps positions differ by {apart[:, 1:4].max():.1e} Angstrom")
    for name, log in logs.items():
        rows = log.rpartition("TotEng")[2].partition("Loop time")[0].splitlines()[1:]
        energy = np.array([float(row.split()[3]) for row in rows])
        print(
            f"Total energy by the {name}, kcal/mol: mean {energy.mean():.4f}, standard deviation "
            f"{energy.std():.4f}, from the first to the last step {energy[-1] - energy[0]:+.4f}"
        )


def cost(log: str, dt: float) -> str:
    """Atoms, the time of a step and that in Modify in ms, and ns a day, of the second run."""
    loops = re.findall(r"Loop time of (\S+) .* for (\d+) steps with (\d+) atoms", log)
    modify = re.findall(r"^Modify +\| \S+ +\| (\S+)", log, re.MULTILINE)
    time, steps, atoms = loops[-1]
    step, part = (1e3 * float(seconds) / int(steps) for seconds in (time, modify[-1]))
    return f"{atoms:>9} {dt:5.1f} {step:9.3f} {part:9.3f} {86.4 * dt / step:9.2f}"


def main(host: str, card: str, steps: str = "10000", *sizes: str) -> None:
    """Print the comparison, and a table of costs."""
    compare({name: run(by, name, steps=steps) for name, by in (("host", host), ("card", card))})
    print(f"{'fix':>9} {'atoms':>9} {'fs':>5} {'ms/step':>9} {'Modify':>9} {'ns/day':>9}")
    for n in sizes or ("2", "3", "7"):
        few = max(20, int(steps) // (10 * int(n) ** 2))
        for fix, dt in TIMED.items():
            log = run(card, f"{fix}.{n}", fix=fix, dt=dt, n=n, steps=few)
            print(f"{fix:>9} {cost(log, dt)}", flush=True)


main(*sys.argv[1:])
