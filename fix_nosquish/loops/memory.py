"""Arrays that compiled loops make longer by themselves, and Python sees through cells."""

import ctypes
import weakref

import numpy as np

from .compiled import L2, Cell, array, call, inlined

# columns of a memory's table: where an array is (its shape follows), and its room in bytes
PLACE, SIZE = 0, 3
REALLOC = 0  # the row that holds the address of C's realloc

_libc = ctypes.CDLL(None)
_libc.realloc.restype, _libc.realloc.argtypes = ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_size_t]
_libc.free.argtypes = [ctypes.c_void_p]


class Memory:
    """Arrays by name, which live as long as this object.

    Args:
        kinds: dictionary from names to their `compiled.Kind`, in the order of the table's rows.

    Attributes:
        table: (rows, 4) of each array its address, its shape (0 for a dimension that it has not),
            and for how many bytes there is room.
        cells: dictionary from names to `compiled.Cell`; "memory" is that of the table.
    """

    def __init__(self, kinds):
        self.table = table = np.zeros((1 + len(kinds), 4), np.int64)
        table[REALLOC, PLACE] = ctypes.cast(_libc.realloc, ctypes.c_void_p).value
        rows = zip(kinds.items(), table[1:, :3], strict=True)
        self.cells = {name: Cell(kind, numbers=numbers) for (name, kind), numbers in rows}
        self.cells["memory"] = Cell(L2, table)
        weakref.finalize(self, _free, table).atexit = False  # LAMMPS may outlive this interpreter

    def put(self, name, values):
        """Copy values to the array of this name."""
        cell = self.cells[name]
        values = np.ascontiguousarray(values, cell.kind.dtype)
        row = 1 + list(self.cells).index(name)
        if values.nbytes > self.table[row, SIZE]:
            self.table[row, PLACE] = _libc.realloc(self.table[row, PLACE].item(), values.nbytes)
            self.table[row, SIZE] = values.nbytes
        cell.numbers[1:] = values.shape
        array(cell.numbers[0].item(), values.shape, values.dtype)[...] = values


def _free(table):
    for place in table[1:, PLACE][table[1:, SIZE] > 0].tolist():
        _libc.free(place)


@inlined
def room(memory, row, size):
    """The place of this row's array, with room for so many bytes; what is there stays."""
    if size > memory[row, SIZE]:
        memory[row, SIZE] = size + size // 4 + 64
        memory[row, PLACE] = call(memory[REALLOC, PLACE], memory[row, PLACE], memory[row, SIZE])
    return memory[row, PLACE]
