"""Weak scaling, counted: what a rank sends in a step at a fixed number of molecules per rank, and
what that would cost on many.

Counts do not depend on how fast or how loaded the machine is: ranks may share cores.
"""

import itertools
import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fix_nosquish import block, migration
from validation.running import counting, run
from validation.scenes import SCENES
from validation.scenes.integrators import INTEGRATORS

COMPARED = "nosquish", "rigid/nve", "rigid/nve/small"
COUNTED = "messages", "bytes", "collectives", "collective_bytes"
WARM_UP, STEPS = 10, 30
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


def grid(ranks, decomposition):
    """Ranks along x, y, z: a row of them ("slab"), or the block of them nearest to a cube
    ("brick")."""
    if decomposition == "slab":
        return ranks, 1, 1
    sides = range(1, ranks + 1)
    blocks = [
        (a, b, ranks // (a * b)) for a, b in itertools.product(sides, sides) if ranks % (a * b) == 0
    ]
    return min(
        (block for block in blocks if sorted(block, reverse=True) == list(block)),
        key=lambda block: block[0] / block[2],
    )


def scaling(out, ranks=(1, 2, 4, 8, 16), meter=None):
    """Count what the fixes of each integrator send, with a copy of the scene water for each rank,
    cut in slabs and in bricks.

    Args:
        out: folder for the runs.
        ranks: their numbers; bricks are also counted on 27, from where on each has its full 26
            neighbours.
        meter: a `console.Meter`, or None.
    Returns:
        list of dictionaries: decomposition, integrator, ranks, bodies, and, mean over the ranks and
        steps, the messages, bytes, collectives and collective_bytes that a rank's fixes hand to MPI
        in a step; error (None, or why there are no counts).
    """
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    rows = []
    for decomposition, numbers in ("slab", ranks), ("brick", sorted({*ranks, 27})):
        for n, name in itertools.product(numbers, COMPARED):
            rows.append(_count(out, decomposition, n, INTEGRATORS[name], meter))
            if rows[-1]["error"] == run.INTERRUPTED:
                return rows
    return rows


def _count(out, decomposition, ranks, integrator, meter):
    water = SCENES["water"]
    block = " ".join(map(str, grid(ranks, decomposition)))
    lines = []
    for line in water.setup:
        lines += (
            [f"processors {block}", line, f"replicate {block}"]
            if line.startswith("read_data ")
            else [line]
        )
    scene = replace(water, setup=(*lines, *FORCES))
    folder = out / f"{decomposition}-{ranks}-{run.folder_name(integrator.name)}"
    job = run.job(
        scene,
        integrator,
        folder / "run",
        [WARM_UP, STEPS],
        dt=scene.dt,
        every=0,
        ranks=ranks,
        positions=False,
    )
    if meter:
        meter.begin(f"{integrator.label}, {decomposition}, {ranks} ranks", WARM_UP + STEPS)
    result = run.run(
        job, meter.at if meter else lambda step: None, counting.environment(folder / "counts")
    )
    if meter:
        meter.end(result.error)
    row = {
        "decomposition": decomposition,
        "integrator": integrator.name,
        "ranks": ranks,
        "bodies": ranks * water.unit,
    }
    row["error"] = result.error
    if not result.error:
        counts = counting.read(folder / "counts")
        row |= {
            key: float(np.mean([rank[f"fix_{key}"] for rank in counts])) / STEPS for key in COUNTED
        }
    return row


def link():
    """The `Link` between two ranks on this machine, measured with mpi4py's own ping-pong."""
    command = [
        run.mpirun(),
        "-np",
        "2",
        sys.executable,
        "-m",
        "mpi4py.bench",
        "pingpong",
        "-m",
        "8",
        "-n",
        "4194304",
        "-l",
        "2000",
    ]
    text = subprocess.run(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, check=True
    ).stdout
    times = {
        int(size): float(time)
        for size, time in re.findall(r"^ *(\d+) +[\d.]+ \| (\S+) ", text, re.M)
    }
    return Link(
        "between two ranks of this machine",
        times[8],
        max(size / time for size, time in times.items()),
    )


def model(rows, link, ranks=(1000, 10_000, 100_000)):
    """What the counted messages of a step would take on many ranks, in s: a model, not a
    measurement.

    A message takes the link's latency, and its bytes what the bandwidth says; a rank sends one
    after the other. A collective of a few numbers takes log2(ranks) messages. From the largest
    number of ranks that was counted on, messages and bytes are taken not to change any more. Fix
    rigid/nve has all ranks sum the forces and torques on all bodies of the system (MPI_Allreduce of
    6 numbers for each): of these bytes the link carries twice as many, and the messages are 2
    log2(ranks), which is what the best known algorithm needs. What the ranks compute is left out.

    Args:
        rows: of `scaling`.
        link: a `Link`.
        ranks: for how many.
    Returns:
        list of dictionaries: decomposition, integrator, ranks, bodies, seconds.
    """
    result = []
    done = sorted((row for row in rows if not row["error"]), key=lambda row: row["ranks"])
    largest = {(row["decomposition"], row["integrator"]): row for row in done}
    for (decomposition, name), last in largest.items():
        for n in ranks:
            bodies = last["bodies"] // last["ranks"] * n
            seconds = last["messages"] * link.latency + last["bytes"] / link.bandwidth
            seconds += last["collectives"] * math.log2(n) * link.latency
            if name == "rigid/nve":
                seconds += math.log2(n) * link.latency + 2 * LOAD * bodies / link.bandwidth
            result.append(
                {
                    "decomposition": decomposition,
                    "integrator": name,
                    "ranks": n,
                    "bodies": bodies,
                    "seconds": seconds,
                }
            )
    return result


def summary(rows: list[dict]) -> dict:
    """What was counted, and the model of it, as plain data."""
    links = [NETWORK, link()]
    return {
        "interrupted": any(row["error"] == "interrupted" for row in rows),
        "steps": STEPS,
        "carried": migration.OF_BODY + block.ROWS,
        "counts": rows,
        "links": [link._asdict() for link in links],
        "model": [{"link": link.name, **row} for link in links for row in model(rows, link)],
    }
