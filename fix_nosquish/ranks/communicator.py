"""The ranks of a run: collective operations for Python, and the cells with which loops call MPI.

`ALONE` are the ranks of a run on one, which does not import mpi4py.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ..errors import RunError
from ..loops.memory import Memory
from . import mpi


class Ranks:
    """The ranks of a run.  This class is of a run on one rank, where each collective operation
    returns its argument; `Communicator` is of several.

    Attributes:
        size, rank: the number of ranks, and the rank of this process.
        messages: the `Memory` with `mpi.MessageRows`.
        cells: the cells of an `mpi.Mpi`.
    """

    size, rank = 1, 0

    def __init__(self) -> None:
        self.messages = Memory("messages", mpi.MessageRows)
        self.cells = mpi.cells_of(self.messages, {"ranks": 1})

    def agree(self, problem: str | None) -> None:
        """Raise an error on all ranks if any rank has a problem; collective.

        Args:
            problem: a message, or None.
        Raises:
            RunError: with the message of the lowest rank that has one.
        """
        first = self.least(self.rank if problem else self.size)
        if first < self.size:
            raise RunError(self.share(problem, first), everywhere=True)

    def refuse(self, wrong: np.ndarray, text: Callable[[int], str]) -> None:
        """Raise an error on all ranks if one of n items on any rank is wrong; collective.

        Args:
            wrong: (n,) bool, which items of this rank are wrong.
            text: returns the message for an item, by its index.
        Raises:
            RunError: with the message for the first wrong item of the lowest rank.
        """
        self.agree(text(int(wrong.argmax())) if wrong.any() else None)

    @contextmanager
    def together(self, what: str) -> Iterator[None]:
        """Turn an exception in this block, on any rank, into a `RunError` on all ranks; collective.

        Args:
            what: the operation that fails, the beginning of the message.
        """
        problem = None
        try:
            yield
        except Exception as error:
            problem = f"{what}: {type(error).__name__}: {error}"
        self.agree(problem)

    def total(self, values: Any) -> np.ndarray:
        """The sum of an array over all ranks, as float64."""
        return np.asarray(values, float)

    def count(self, n: int) -> int:
        """The sum of an integer over all ranks."""
        return round(self.total(np.array([n]))[0])

    def any(self, flag: Any) -> bool:
        """Whether `flag` is true on any rank."""
        return self.least(0 if flag else 1) == 0

    def least(self, number: int) -> int:
        """The minimum of an integer over all ranks."""
        return number

    def gather(self, rows: np.ndarray) -> Any:
        """The rows of all ranks, in the order of the ranks, on rank 0; None on other ranks."""
        return rows

    def gather_to_all(self, rows: np.ndarray) -> np.ndarray:
        """The rows of all ranks, in the order of the ranks, on every rank."""
        return rows

    def share(self, value: Any, rank: int = 0) -> Any:
        """Broadcast the value of a rank."""
        return value

    def wait(self) -> None:
        """Wait for all ranks without the busy waiting of an MPI barrier."""


ALONE = Ranks()


class Communicator(Ranks):
    """Several ranks, with a duplicate of LAMMPS's communicator to keep messages separate.

    Args:
        comm: the Fortran handle of LAMMPS's communicator.

    Attributes:
        comm: the duplicate, as a communicator of mpi4py.
    """

    _keyval: int | None = None  # attribute of LAMMPS's communicator that holds and frees ours

    def __init__(self, comm: int) -> None:
        from mpi4py import MPI

        if Communicator._keyval is None:
            Communicator._keyval = MPI.Comm.Create_keyval(
                delete_fn=lambda comm, key, ours: ours[0].Free()
            )
        theirs = MPI.Comm.f2py(comm)
        ours: Any = theirs.Get_attr(Communicator._keyval)
        if not ours:
            duplicate = theirs.Dup()
            duplicate.Set_errhandler(MPI.ERRORS_ARE_FATAL)  # loops do not check return values
            messages = Memory("messages", mpi.MessageRows)
            ours = duplicate, messages, mpi.cells_of_library(messages, duplicate, MPI)
            theirs.Set_attr(Communicator._keyval, ours)
        self.comm, self.messages, self.cells = ours
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

    def wait(self) -> None:
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
        """End the processes of all ranks at once."""
        self.comm.Abort(1)
