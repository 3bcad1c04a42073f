"""What the counted messages of a step would cost on many ranks: a model, no measurement."""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

RANKS = 1000, 10_000, 100_000
LOAD = 48  # bytes of force and torque on a body


class Link(NamedTuple):
    """A connection between ranks: s that a short message takes, and bytes per s of a long one."""

    name: str
    latency: float
    bandwidth: float


NETWORK = Link("between nodes (100 Gbit/s InfiniBand, as commonly reported)", 1.5e-6, 12e9)


def model(rows: Sequence[dict], link: Link = NETWORK) -> list[dict]:
    """Rows with ``seconds`` of a step on `RANKS`, of rows of counts.

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
    for ((cut, name), last), n in itertools.product(largest.items(), RANKS):
        bodies = last["bodies"] // last["ranks"] * n
        seconds = last["messages"] * link.latency + last["bytes"] / link.bandwidth
        seconds += last["collectives"] * math.log2(n) * link.latency
        if name == "rigid/nve":
            seconds += math.log2(n) * link.latency + 2 * LOAD * bodies / link.bandwidth
        row = {"link": link.name, "decomposition": cut, "integrator": name, "ranks": n}
        result.append({**row, "bodies": bodies, "seconds": seconds})
    return result
