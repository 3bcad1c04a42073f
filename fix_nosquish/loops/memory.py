"""Arrays that compiled loops make longer by themselves, and Python sees through cells."""

import ctypes
import weakref

import numpy as np

from .compiled import L2, Cell, array, call, inlined

# columns of a memory's table: where an array is (its shape follows), and its room in bytes
PLACE, SIZE = 0, 3
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
        functions = _libc.realloc, _libc.perror, _libc._exit, _NO_ROOM
        table[C] = [ctypes.cast(one, ctypes.c_void_p).value for one in functions]
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
            place = _libc.realloc(self.table[row, PLACE].item(), values.nbytes)
            if not place:
                raise MemoryError(f"there is no memory for the {values.nbytes} bytes of {name}")
            self.table[row, PLACE], self.table[row, SIZE] = place, values.nbytes
        cell.numbers[1:] = values.shape
        array(cell.numbers[0].item(), values.shape, values.dtype)[...] = values


def _free(table):
    for place in table[1:, PLACE][table[1:, SIZE] > 0].tolist():
        _libc.free(place)


@inlined
def room(memory, row, size):
    """The place of this row's array, with room for so many bytes; what is there stays.

    Without memory this rank ends with a message, for no loop can raise an error, and MPI ends the
    others.
    """
    if size > memory[row, SIZE]:
        more = size + size // 4 + 64
        place = call(memory[C, REALLOC], memory[row, PLACE], more)
        if place == 0:
            call(memory[C, PERROR], memory[C, MESSAGE])
            call(memory[C, EXIT], 1)
        memory[row, SIZE], memory[row, PLACE] = more, place
    return memory[row, PLACE]
