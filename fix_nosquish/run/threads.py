"""Passes on several threads, each of which does some of the blocks of bodies.

The threads are those of LAMMPS's own OpenMP, as many as LAMMPS counts: its runtime starts them,
has them sleep, and ends them, and they are the ones that compute forces.  A thread does what a rank
with these blocks would do.  It has a cell of its own for the rows of them, memory of its own to
work with, and a copy of what the loop adds sums to.  How many threads there are does not change
what a body does; sums over bodies differ by how they are rounded, as between ranks.
"""

import ctypes

import numpy as np

from ..bodies.bodies import aligned
from ..loops.compiled import F1, F2, F64, I1, I2, L1, L2, Cell, I, address, array, call, loop
from ..motion.block import LANES, LINE

LEAST = 16  # blocks for each thread; with fewer, one does all: waking others takes as long
INT = 0xFFFFFFFF  # of what `call` gives, where a function gives an int


@loop
def work(function: I, tables: L1, results: L1, thread_number: I, team_size: I):
    """What each thread does: its part, and those of threads that OpenMP does not give."""
    part = call(thread_number) & INT
    while part < tables.size:
        results[part] = call(function, tables[part])
        part += call(team_size) & INT


@loop
def share(
    blocks: I2, rounds: I1, parts: L2, least: I, parallel: I, worker: I, worker_table: I,
    function: I, whole_table: I, results: L1, sums: F1, copies: F2,
) -> I:  # fmt: skip
    """Run a loop on all threads, each with a part of the blocks that has as many bodies and atoms.

    Args:
        parts: (threads, 3) out: the cells of the parts of `blocks`.
        least: with fewer blocks one thread does all.
        parallel: OpenMP's function that has each thread call another one.
        worker, worker_table: that one, and its cells.
        function, whole_table: the loop, and its cells for all blocks.
        sums, copies: what it adds to, and (threads, at least as many) for each thread.
    Returns:
        the sum of what it returns.
    """
    n, threads, begin = blocks.shape[0] - 1, parts.shape[0], 0
    if n < least:
        return call(function, whole_table)
    total = blocks[n, 0] + rounds[blocks[n, 1]]
    for t in range(threads):
        end, above = begin, n
        while end < above:
            middle = (end + above) // 2
            if (blocks[middle, 0] + rounds[blocks[middle, 1]]) * threads < total * (t + 1):
                end = middle + 1
            else:
                above = middle
        parts[t, 0], parts[t, 1], parts[t, 2] = address(blocks) + 12 * begin, end - begin + 1, 3
        begin = end
        for k in range(sums.size):
            copies[t, k] = sums[k]
    call(parallel, worker, worker_table, threads, 0)
    found = 0
    for t in range(threads):
        found += results[t]
    for k in range(sums.size):
        before = sums[k]
        for t in range(threads):
            if copies[t, k] != before:
                sums[k] += copies[t, k] - before
    return found


class Threads:
    """The threads of a run.

    Args:
        lammps: the `Lammps`.
        cells: dictionary of the cells that loops are bound to.

    Attributes:
        size: how many they are.
        parts: (size, 3), if there are several: the cells of their parts of the blocks.
    """

    def __init__(self, lammps, cells):
        self._openmp, self.size = lammps.openmp, lammps.threads
        if self.size > 1:
            rows = cells["block"].array.shape[0]
            self.parts = np.zeros((self.size, 3), np.int64)
            self._own = [
                {"blocks": Cell(I2, numbers=part), "block": Cell(F64, aligned((rows, LANES)))}
                for part in self.parts
            ]

    def bind(self, loop, cells, sums="", count=0, **more):
        """Bind a loop over blocks of bodies, as `Loop.bind_to` does, for all threads.

        Args:
            sums, count: the cell (count,) that the loop adds sums over bodies to.
        """
        whole = loop.bind_to(cells, **more)
        if self.size == 1:
            return whole
        copies = aligned((self.size, count + LINE))
        of_parts = [
            loop.bind_to(cells, **own, **({sums: _copy(cells[sums], copy)} if sums else {}), **more)
            for own, copy in zip(self._own, copies, strict=True)
        ]
        parallel, thread_number, team_size = self._openmp
        function, results = whole.func.address, np.zeros(self.size, np.int64)
        tables = np.array([table_of(part) for part in of_parts])
        worker = work.bind(function, tables, results, thread_number, team_size)
        shared = share.bind_to(
            cells, parts=self.parts, least=LEAST * self.size, parallel=parallel,
            worker=worker.func.address, worker_table=table_of(worker), function=function,
            whole_table=table_of(whole), results=results,
            sums=floats_of(cells[sums], count) if sums else np.empty(0),
            copies=copies,
        )  # fmt: skip
        shared.kept = whole, of_parts, worker
        return shared


def floats_of(cell, count):
    if not cell.kind.dtype.names:
        return cell
    return array(cell.numbers[0].item(), (count,), np.float64)


def _copy(cell, numbers):
    kind = cell.kind
    record = kind.of(numbers) if kind.dtype.names else numbers[: len(cell.array)]
    return Cell(kind, record)


def table_of(bound):
    """Where the addresses of the cells of a bound loop are."""
    return ctypes.addressof(bound.args[0])
