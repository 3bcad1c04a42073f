"""Arrays that compiled loops make longer by themselves, and Python sees through cells.

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

Loops are given the memory's table, in which each array has a row.  The class of the rows is the one
definition of them: loops have the numbers of the rows by these names, Python the cells.
"""

import ctypes
import weakref
from typing import Any, NamedTuple, TypeVar

import numpy as np

from .compiled import L2, Cell, annotations, call, inlined

# columns of the table: where an array is, its shape (the second is 1 if it has one dimension), for
# how many bytes there is room, and how many bytes a number takes
PLACE, LENGTH, WIDTH, ROOM, ITEM = range(5)
# the first row holds addresses of C's functions, and of what the second says
C = 0
REALLOC, PERROR, EXIT, MESSAGE = range(4)

_libc = ctypes.CDLL(None)
_NO_ROOM = ctypes.create_string_buffer(
    b"ERROR: fix_nosquish: there is no memory left on this node for the bodies of this rank. Use "
    b"more nodes, or fewer ranks on each"
)
_libc.realloc.restype, _libc.realloc.argtypes = ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_size_t]
_libc.free.argtypes = [ctypes.c_void_p]


def place_of(thing: Any) -> int:
    """Where a function, or a buffer, of ctypes is in memory."""
    return ctypes.cast(thing, ctypes.c_void_p).value or 0


Rows = TypeVar("Rows", bound=NamedTuple)


def rows(names: type[Rows]) -> Rows:
    """The number of each row by its name: constants for loops.

    Args:
        names: a NamedTuple whose fields are arrays of a memory, with their kinds as annotations.
    """
    return names(*range(1, 1 + len(names._fields)))


class Memory:
    """Arrays by name, which live as long as this object.

    Args:
        name: what loops call the argument that is the table.
        names: as of `rows`.

    Attributes:
        table: (rows, 5) what the columns' names say of each array.
        cells: dictionary from names to `compiled.Cell`, that of the table among them.
    """

    def __init__(self, name: str, names: type[Any]) -> None:
        kinds = annotations(names)
        self.table = table = np.zeros((1 + len(kinds), 5), np.int64)
        functions = _libc.realloc, _libc.perror, _libc._exit, _NO_ROOM
        table[C, :4] = [place_of(one) for one in functions]
        table[1:, WIDTH], table[1:, ITEM] = 1, [kind.dtype.itemsize for kind in kinds.values()]
        self._rows = dict(zip(kinds, table[1:]))
        self.cells = {one: Cell(kind, numbers=self._rows[one]) for one, kind in kinds.items()}
        self.cells[name] = Cell(L2, table)
        weakref.finalize(self, _free, table).atexit = False  # LAMMPS may outlive this interpreter

    def put(self, name: str, values: Any) -> None:
        """Copy values to the array of this name.

        Raises:
            MemoryError: if there is no room for them.
        """
        cell, row = self.cells[name], self._rows[name]
        values = np.ascontiguousarray(values, cell.kind.dtype)
        if values.nbytes > row[ROOM]:
            place = _libc.realloc(row[PLACE].item(), values.nbytes)
            if not place:
                raise MemoryError(f"there is no memory for the {values.nbytes} bytes of {name}")
            row[PLACE], row[ROOM] = place, values.nbytes
        cell.numbers[1:] = values.shape
        cell.array[...] = values


def _free(table: np.ndarray) -> None:
    for place in table[1:, PLACE][table[1:, ROOM] > 0].tolist():
        _libc.free(place)


@inlined
def room(memory, row, size):
    """The place of this row's array, with room for so many bytes; what is there stays.

    Without memory this rank ends with a message, for no loop can raise an error, and MPI ends the
    others.
    """
    if size > memory[row, ROOM]:
        more = size + size // 4 + 64
        place = call(memory[C, REALLOC], memory[row, PLACE], more)
        if place == 0:
            call(memory[C, PERROR], memory[C, MESSAGE])
            call(memory[C, EXIT], 1)
        memory[row, ROOM], memory[row, PLACE] = more, place
    return memory[row, PLACE]


@inlined
def resize(memory, row, length, width):
    """Have this row's array be of another shape; what is there stays in its place in memory."""
    room(memory, row, length * width * memory[row, ITEM])
    memory[row, LENGTH], memory[row, WIDTH] = length, width


# what only loops can call
def longs_in(memory, row):
    """The int64 array in this row, (length,)."""


def ints_in(memory, row):
    """The int32 array in this row, (length,)."""


def int_rows_in(memory, row):
    """The int32 array in this row, (length, width)."""


def floats_in(memory, row):
    """The float64 array in this row, (length, width)."""


@inlined
def new_longs(memory, row, n):
    """The int64 array in this row, of n numbers from now on; those that are there stay."""
    resize(memory, row, n, 1)
    return longs_in(memory, row)


@inlined
def append(memory, row, value):
    """Put a number behind those of an int64 array."""
    n = memory[row, LENGTH]
    new_longs(memory, row, n + 1)[n] = value


@inlined
def swap(memory, row, other):
    """Have each of two rows have the other's array."""
    for column in range(memory.shape[1]):
        memory[row, column], memory[other, column] = memory[other, column], memory[row, column]
