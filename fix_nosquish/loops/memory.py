"""Arrays that compiled loops can lengthen, and that Python sees through cells.

    class Rows(NamedTuple):
        ids: L1
        weights: F2

    ROW = rows(Rows)

    @loop
    def begin(things: L2, n: I):
        ids = new_longs(things, ROW.ids, n)
        ...

    memory = Memory("things", Rows)
    begin.bind_to(memory.cells, n=3)()
    memory.cells["ids"].array

Loops take the table of the memory, which has a row for each array.  The class `Rows` defines them:
loops use the indices of the rows by these names, Python uses the cells.
"""

import ctypes
import math
import weakref
from typing import Any, NamedTuple, TypeVar

import numpy as np

from .compiled import L2, Cell, annotations, inlined

# columns of the table: the address of an array, its shape (the second number is 1 if it has one
# dimension), how many bytes are allocated, and how many bytes a number has
ADDRESS, LENGTH, WIDTH, CAPACITY, ITEMSIZE = range(5)

_libc = ctypes.CDLL(None)
_libc.realloc.restype, _libc.realloc.argtypes = ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_size_t]
_libc.free.argtypes = [ctypes.c_void_p]

Rows = TypeVar("Rows", bound=NamedTuple)


def rows(names: type[Rows]) -> Rows:
    """The indices of the rows by their names: constants for loops.

    Args:
        names: a NamedTuple whose fields are the arrays of a memory, annotated with their kinds.
    """
    return names(*range(len(names._fields)))


class Memory:
    """Named arrays, which live as long as this object.

    Args:
        name: the name of the loops' argument that is the table.
        names: see `rows`.

    Attributes:
        table: (rows, 5) the columns above, of each array.
        cells: dictionary from names to `compiled.Cell`; it includes that of the table.
    """

    def __init__(self, name: str, names: type[Any]) -> None:
        kinds = annotations(names)
        self.table = table = np.zeros((len(kinds), 5), np.int64)
        table[:, WIDTH], table[:, ITEMSIZE] = 1, [kind.dtype.itemsize for kind in kinds.values()]
        self._rows = dict(zip(kinds, table))
        self.cells = {row: Cell(kind, numbers=self._rows[row]) for row, kind in kinds.items()}
        self.cells[name] = Cell(L2, table)
        weakref.finalize(self, _free, table).atexit = False  # LAMMPS may outlive this interpreter

    def put(self, name: str, values: Any) -> None:
        """Copy values to the array of this name, which gets their shape.

        Raises:
            MemoryError: if they cannot be allocated.
        """
        values = np.asarray(values)
        self.new(name, values.shape)[...] = values

    def new(self, name: str, shape: tuple[int, ...]) -> np.ndarray:
        """The array of this name, of this shape from now on; what is in it is undefined.

        Raises:
            MemoryError: if it cannot be allocated.
        """
        cell, row = self.cells[name], self._rows[name]
        size = math.prod(shape) * row[ITEMSIZE].item()
        if size > row[CAPACITY]:
            address = _libc.realloc(row[ADDRESS].item(), size)
            if not address:
                raise MemoryError(f"there is no memory for the {size} bytes of {name}")
            row[ADDRESS], row[CAPACITY] = address, size
        cell.numbers[1:] = shape
        return cell.array


def _free(table: np.ndarray) -> None:
    for address in table[:, ADDRESS][table[:, CAPACITY] > 0].tolist():
        _libc.free(address)


# Only loops can call these.
def reallocate(address: Any, size: Any) -> Any:
    """C's realloc; if it fails, the process prints a message and ends, and MPI ends the others.

    A loop cannot raise an error, and all code after this one would write to address 0.
    """


def longs_in(memory: Any, row: Any) -> Any:
    """The int64 array in this row, (length,)."""


def ints_in(memory: Any, row: Any) -> Any:
    """The int32 array in this row, (length,)."""


def int_rows_in(memory: Any, row: Any) -> Any:
    """The int32 array in this row, (length, width)."""


def floats_in(memory: Any, row: Any) -> Any:
    """The float64 array in this row, (length, width)."""


@inlined
def reserve(memory, row, size):
    """Allocate at least so many bytes for the array in this row, which keeps its contents."""
    if size > memory[row, CAPACITY]:
        memory[row, CAPACITY] = size + size // 4 + 64
        memory[row, ADDRESS] = reallocate(memory[row, ADDRESS], memory[row, CAPACITY])


@inlined
def resize(memory, row, length, width):
    """Change the shape of the array in this row; the bytes of its memory stay."""
    reserve(memory, row, length * width * memory[row, ITEMSIZE])
    memory[row, LENGTH], memory[row, WIDTH] = length, width


@inlined
def new_longs(memory, row, n):
    """The int64 array in this row, resized to n numbers."""
    resize(memory, row, n, 1)
    return longs_in(memory, row)


@inlined
def append(memory, row, value):
    """Append a number to an int64 array."""
    n = memory[row, LENGTH]
    new_longs(memory, row, n + 1)[n] = value
