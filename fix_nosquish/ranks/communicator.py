"""The ranks of a run: what Python does with all of them, mostly once a run, and what loops call MPI
with.

`ALONE` is a run on one rank: nothing is shared, and mpi4py is not imported.
"""

import time
from collections.abc import Callable
from contextlib import contextmanager

import numpy as np

from ..errors import RunError
from . import mpi


class Alone:
    """One rank: every method gives back what it was given."""

    size, rank = 1, 0

    def __init__(self):
        self.cells = mpi.alone()

    def agree(self, problem):
        """End the run if there is a problem (a message, or None for none)."""
        if problem:
            raise RunError(problem, everywhere=True)

    def refuse(self, wrong: np.ndarray, text: Callable[[int], str]) -> None:
        """End the run if something is wrong on any rank; collective.

        Args:
            wrong: (n,) bool, which of n things of this rank are.
            text: gives the message for the first of these, by its place among the n.
        Raises:
            RunError: on all ranks, with the message of the first rank that has one.
        """
        self.agree(text(int(wrong.argmax())) if wrong.any() else None)

    @contextmanager
    def together(self, what):
        """Do something that can fail on one rank: then the run ends on all, with a message."""
        problem = None
        try:
            yield
        except Exception as error:
            problem = f"{what}: {type(error).__name__}: {error}"
        self.agree(problem)

    def total(self, values):
        """Sum of an array over all ranks, as float64."""
        return np.asarray(values, float)

    def count(self, n):
        """Sum of a whole number over all ranks."""
        return round(self.total(np.array([n]))[0])

    def any(self, flag):
        """Whether `flag` is true on any rank."""
        return flag

    def gather(self, rows):
        """All ranks' rows, in the order of the ranks, on rank 0; elsewhere None."""
        return rows

    gather_to_all = share = gather

    def rest(self):
        """Wait for all ranks, and leave the processor to others meanwhile."""


ALONE = Alone()


class Communicator(Alone):
    """Several ranks: LAMMPS's, with a communicator of our own, whose messages are not LAMMPS's.

    Args:
        comm: the Fortran handle of LAMMPS's communicator, as its library gives it.

    Attributes:
        cells: of the `mpi.Mpi` of this communicator.
    """

    _attribute = None  # under which LAMMPS's communicator keeps ours, and frees it when it is freed

    def __init__(self, comm):
        from mpi4py import MPI

        kind = Communicator
        if kind._attribute is None:
            kind._attribute = MPI.Comm.Create_keyval(
                delete_fn=lambda comm, key, ours: ours[0].Free()
            )
        theirs = MPI.Comm.f2py(comm)
        if not theirs.Get_attr(kind._attribute):
            ours = theirs.Dup()
            ours.Set_errhandler(MPI.ERRORS_ARE_FATAL)  # no loop looks at what MPI returns
            theirs.Set_attr(kind._attribute, (ours, mpi.cells(ours, MPI)))
        self.comm, self.cells = theirs.Get_attr(kind._attribute)
        self.mpi, self.size, self.rank = MPI, self.comm.size, self.comm.rank
        self._number = np.empty(1, np.int64)

    def _reduce(self, number, operation):
        self._number[0] = number
        self.comm.Allreduce(self.mpi.IN_PLACE, self._number, operation)
        return int(self._number[0])

    def agree(self, problem):
        """End the run on all ranks, with the first rank's message, if any rank has a problem."""
        first = self._reduce(self.rank if problem else self.size, self.mpi.MIN)
        if first < self.size:
            raise RunError(self.comm.bcast(problem, root=first), everywhere=True)

    def total(self, values):
        """Sum of an array over all ranks, as float64."""
        result = np.array(values, float)
        self.comm.Allreduce(self.mpi.IN_PLACE, result)
        return result

    def any(self, flag):
        """Whether `flag` is true on any rank."""
        return bool(self._reduce(bool(flag), self.mpi.MAX))

    def rest(self):
        """Wait for all ranks, and leave the processor to others meanwhile."""
        request, pause = self.comm.Ibarrier(), 1e-4
        while not request.Test():
            time.sleep(pause)
            pause = min(2 * pause, 0.02)

    def share(self, rows):
        """Rank 0's rows, for all ranks."""
        return self.comm.bcast(rows)

    def gather(self, rows):
        """All ranks' rows, in the order of the ranks, on rank 0; elsewhere None."""
        parts = self.comm.gather(rows)
        return None if parts is None else np.concatenate(parts)

    def gather_to_all(self, rows):
        """All ranks' rows, in the order of the ranks, on every rank."""
        return np.concatenate(self.comm.allgather(rows))

    def abort(self):
        """End the run on all ranks, now."""
        self.comm.Abort(1)
