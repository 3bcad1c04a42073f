"""The ranks of a run: what Python does with all of them, mostly once a run, and what loops call MPI
with.

`ALONE` is a run on one rank: nothing is shared, and mpi4py is not imported.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ..errors import RunError
from ..loops.memory import Memory
from . import mpi


class Alone:
    """One rank: every method gives back what it was given.

    Attributes:
        size, rank: how many ranks there are, and which one this is.
        messages: the memory for messages between them.
        cells: of their `mpi.Mpi`.
    """

    size, rank = 1, 0

    def __init__(self) -> None:
        self.messages = Memory("messages", mpi.MessageRows)
        self.cells = mpi.cells_of(self.messages, {"ranks": 1})

    def agree(self, problem: str | None) -> None:
        """End the run if there is a problem (a message, or None for none).

        Raises:
            RunError: on all ranks, with the first rank's message, if any rank has a problem.
        """
        first = self.least(self.rank if problem else self.size)
        if first < self.size:
            raise RunError(self.share(problem, first), everywhere=True)

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
    def together(self, what: str) -> Iterator[None]:
        """Do something that can fail on one rank: then the run ends on all, with a message."""
        problem = None
        try:
            yield
        except Exception as error:
            problem = f"{what}: {type(error).__name__}: {error}"
        self.agree(problem)

    def total(self, values: Any) -> np.ndarray:
        """Sum of an array over all ranks, as float64."""
        return np.asarray(values, float)

    def count(self, n: int) -> int:
        """Sum of a whole number over all ranks."""
        return round(self.total(np.array([n]))[0])

    def any(self, flag: Any) -> bool:
        """Whether `flag` is true on any rank."""
        return self.least(0 if flag else 1) == 0

    def least(self, number: int) -> int:
        """The smallest of the ranks' whole numbers."""
        return number

    def gather(self, rows: np.ndarray) -> Any:
        """All ranks' rows, in the order of the ranks, on rank 0; elsewhere None."""
        return rows

    def gather_to_all(self, rows: np.ndarray) -> np.ndarray:
        """All ranks' rows, in the order of the ranks, on every rank."""
        return rows

    def share(self, value: Any, rank: int = 0) -> Any:
        """This rank's value, for all ranks."""
        return value

    def rest(self) -> None:
        """Wait for all ranks, and leave the processor to others meanwhile."""


ALONE = Alone()


class Communicator(Alone):
    """Several ranks: LAMMPS's, with a communicator of our own, whose messages are not LAMMPS's.

    Args:
        comm: the Fortran handle of LAMMPS's communicator, as its library gives it.

    Attributes:
        comm: mpi4py's communicator, ours.
    """

    _attribute: int | None = None  # under which LAMMPS's communicator keeps ours, and frees it

    def __init__(self, comm: int) -> None:
        from mpi4py import MPI

        kind = Communicator
        if kind._attribute is None:
            kind._attribute = MPI.Comm.Create_keyval(
                delete_fn=lambda comm, key, ours: ours[0].Free()
            )
        theirs = MPI.Comm.f2py(comm)
        kept: Any = theirs.Get_attr(kind._attribute)
        if not kept:
            ours = theirs.Dup()
            ours.Set_errhandler(MPI.ERRORS_ARE_FATAL)  # no loop looks at what MPI returns
            messages = Memory("messages", mpi.MessageRows)
            kept = ours, messages, mpi.of_library(messages, ours, MPI)
            theirs.Set_attr(kind._attribute, kept)
        self.comm, self.messages, self.cells = kept
        self.size, self.rank = self.comm.size, self.comm.rank
        self._mpi, self._number = MPI, np.empty(1, np.int64)

    def least(self, number: int) -> int:
        self._number[0] = number
        self.comm.Allreduce(self._mpi.IN_PLACE, self._number, self._mpi.MIN)
        return int(self._number[0])

    def total(self, values: Any) -> np.ndarray:
        result = np.array(values, float)
        self.comm.Allreduce(self._mpi.IN_PLACE, result)
        return result

    def rest(self) -> None:
        request, pause = self.comm.Ibarrier(), 1e-4
        while not request.Test():
            time.sleep(pause)
            pause = min(2 * pause, 0.02)

    def share(self, value: Any, rank: int = 0) -> Any:
        return self.comm.bcast(value, rank)

    def gather(self, rows: np.ndarray) -> Any:
        parts = self.comm.gather(rows)
        return None if parts is None else np.concatenate(parts)

    def gather_to_all(self, rows: np.ndarray) -> np.ndarray:
        return np.concatenate(self.comm.allgather(rows))

    def abort(self) -> None:
        """End the run on all ranks, now."""
        self.comm.Abort(1)
