"""Weak scaling, counted: what a rank sends in a step at a fixed number of molecules per rank, and
what that would cost on many.

Counts do not depend on how fast or how loaded the machine is: ranks may share cores.
"""

import itertools
import math
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..running import counting, run
from ..scenes import SCENES, Scene
from ..scenes.integrators import INTEGRATORS

COMPARED = "nosquish", "rigid/nve", "rigid/nve/small"
COUNTED = "messages", "bytes", "collectives", "collective_bytes"
WARM_UP, STEPS = 10, 30
MANY = 1000, 10_000, 100_000  # ranks of the model
LOAD = 48  # bytes of force and torque on a body
# water without the mesh, whose own messages are not of interest
FORCES = (
    "kspace_style none",
    "pair_style lj/charmm/coul/charmm 8.0 10.0",
    "pair_modify mix arithmetic",
    "pair_coeff 1 1 0.1521 3.1505742268338603",
    "pair_coeff 2 2 0.046 0.4000135244450124",
)


class Link(NamedTuple):
    """A connection between ranks: s that a short message takes, and bytes per s of a long one."""

    name: str
    latency: float
    bandwidth: float


NETWORK = Link("between nodes (100 Gbit/s InfiniBand, as commonly reported)", 1.5e-6, 12e9)


def water(ranks: int, cut: str) -> Scene:
    """The water with a copy for each rank, each rank's domain one of them."""
    scene, lines = SCENES["water"], []
    block = " ".join(map(str, grid(ranks, cut)))
    for line in scene.setup:
        copies = [f"processors {block}", line, f"replicate {block}"]
        lines += copies if line.startswith("read_data ") else [line]
    return replace(scene, setup=(*lines, *FORCES))


def grid(ranks: int, cut: str) -> tuple[int, int, int]:
    """Ranks along x, y, z: a row ("slab"), or the block of them nearest to a cube ("brick")."""
    if cut == "slab":
        return ranks, 1, 1
    sides = range(1, ranks + 1)
    pairs = ((a, b) for a, b in itertools.product(sides, sides) if ranks % (a * b) == 0)
    blocks = [(a, b, ranks // (a * b)) for a, b in pairs]
    return min((a / c, (a, b, c)) for a, b, c in blocks if a >= b >= c)[1]


def count(ranks: int, cut: str, folder: Path, meter: run.Meter, silence: float) -> list[dict]:
    """What the fixes hand to MPI, of a rank and step, mean over both; a Ctrl-C passes through.

    Returns:
        rows with ``decomposition``, ``integrator``, ``ranks``, ``bodies``, ``error`` (None, or why
        there are no counts) and `COUNTED`.
    """
    rows, scene = [], water(ranks, cut)
    for name in COMPARED:
        meter.begin(f"messages, {ranks} ranks, {cut}: {name}", 1)
        directory = folder / f"{cut}-{ranks}-{run.folder_name(name)}"
        how: dict = {"dt": scene.dt, "every": 0, "ranks": ranks, "keeps": "nothing"}
        how |= {"silence": silence}
        job = run.job(scene, INTEGRATORS[name], directory / "run", [WARM_UP, STEPS], **how)
        result = run.run(job, environment=counting.environment(directory / "counts"))
        meter.end(result.error)
        if result.interrupted:
            raise KeyboardInterrupt
        row = {"decomposition": cut, "integrator": name, "ranks": ranks}
        row |= {"bodies": ranks * scene.unit, "error": result.error}
        if not result.error:
            sent = counting.read(directory / "counts")
            for key in COUNTED:
                row[key] = float(np.mean([rank[f"fix_{key}"] for rank in sent])) / STEPS
        rows.append(row)
    return rows


def link() -> Link:
    """Between two ranks on this machine, measured with mpi4py's own ping-pong."""
    program = ["-m", "mpi4py.bench", "pingpong", "-m", "8", "-n", "4194304", "-l", "2000"]
    command = [*run.launcher(2), sys.executable, *program]
    quiet = subprocess.DEVNULL
    text = subprocess.run(command, stdin=quiet, capture_output=True, text=True, check=True).stdout
    found = re.findall(r"^ *(\d+) +[\d.]+ \| (\S+) ", text, re.M)
    times = {int(size): float(time) for size, time in found}
    fastest = max(size / time for size, time in times.items())
    return Link("between two ranks of this machine", times[8], fastest)


def model(rows: Sequence[dict], link: Link) -> list[dict]:
    """What the counted messages of a step would take on `MANY` ranks, in s: no measurement.

    A message takes the link's latency, and its bytes what the bandwidth says; a rank sends one
    after the other. A collective of a few numbers takes log2(ranks) messages. From the largest
    number of ranks that was counted on, messages and bytes are taken not to change any more.

    Fix rigid/nve has all ranks sum the forces and torques on all bodies of the system
    (MPI_Allreduce of 6 numbers for each). The best known algorithm needs 2 log2(ranks) messages,
    and the link carries twice as many bytes. What the ranks compute is left out.
    """
    result = []
    done = sorted((row for row in rows if not row["error"]), key=lambda row: row["ranks"])
    largest = {(row["decomposition"], row["integrator"]): row for row in done}
    for ((cut, name), last), n in itertools.product(largest.items(), MANY):
        bodies = last["bodies"] // last["ranks"] * n
        seconds = last["messages"] * link.latency + last["bytes"] / link.bandwidth
        seconds += last["collectives"] * math.log2(n) * link.latency
        if name == "rigid/nve":
            seconds += math.log2(n) * link.latency + 2 * LOAD * bodies / link.bandwidth
        row = {"decomposition": cut, "integrator": name, "ranks": n}
        result.append({**row, "bodies": bodies, "seconds": seconds})
    return result
