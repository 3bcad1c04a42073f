"""How close to the machine: bytes that must move, and how fast this machine moves bytes.

Both are counted as in the STREAM benchmark: what is read and what is written, without the reads
that a cache makes on its own account before a write.
"""

import itertools
import json
import statistics
import subprocess
import sys
import time

FLOAT, INDEX = 8, 4  # bytes
ELEMENTS = 2**24  # of each of three arrays of a process: 128 MiB, far more than a cache
REPEATS = 15
# what a step without output must read and write, however it is written, in bytes. Of a body it
# reads mass, moments, x, v, q, p and writes x, v, q, p; of an atom it reads its index, its place
# in the body and its force, and writes its position
BODY = FLOAT * (1 + 3 + 3 + 3 + 4 + 4) + FLOAT * (3 + 3 + 4 + 4)
ATOM = INDEX + FLOAT * (3 + 3) + FLOAT * 3


def bytes_per_step(bodies: int, atoms: int) -> int:
    """Bytes that so many bodies with so many atoms in all must move in a step."""
    return bodies * BODY + atoms * ATOM


def measure(processes: int, repeats: int = REPEATS, elements: int = ELEMENTS) -> dict:
    """What each of so many processes can read and write, all at the same time.

    Returns:
        ``copy`` and ``add`` (c = a, c = a + b): GB/s of a process, the median of all; ``best``, the
        larger one, which is the stricter measure for a program; ``processes``, ``array_bytes``.
    """
    # all begin at the same time, and those of one do not end long before the others'
    begin = time.time() + 1.5 + 0.5 * processes
    command = [sys.executable, __file__, *map(str, (begin, repeats, elements))]
    running = [
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(processes)
    ]
    found = [json.loads(process.communicate()[0]) for process in running]
    rates = {
        name: statistics.median(rate for own in found for rate in own[name]) / 1e9
        for name in ("copy", "add")
    }
    best = max(rates.values())
    return rates | {"best": best, "processes": processes, "array_bytes": FLOAT * elements}


def _stream(begin: float, repeats: int, elements: int) -> dict[str, list[float]]:
    """Rates of this process, bytes per s."""
    import numpy as np

    a, b, c = (np.full(elements, value) for value in (1.0, 2.0, 0.0))
    actions = {"copy": (2, lambda: np.copyto(c, a)), "add": (3, lambda: np.add(a, b, out=c))}
    time.sleep(max(0.0, begin - time.time()))
    rates: dict[str, list[float]] = {name: [] for name in actions}
    for _, (name, (moved, action)) in itertools.product(range(repeats), actions.items()):
        start = time.perf_counter()
        action()
        rates[name].append(moved * a.nbytes / (time.perf_counter() - start))
    return rates


if __name__ == "__main__":
    print(json.dumps(_stream(float(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))))
