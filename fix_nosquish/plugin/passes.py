"""Passes that the plugin does by itself, as C finds them."""

from ctypes import Structure, addressof, c_int32, c_int64, c_void_p
from functools import partial

# What a pass is; 0 is after the last one.
LOOP, KINDS = 1, {"Delivery": 2, "Exchange": 3, "Completion": 4, "Agreement": 5}


class Pass(Structure):
    """Mirror of Pass in python_move.cpp."""

    _fields_ = [("kind", c_int32), ("comm", c_int32), ("loop", c_void_p), ("cells", c_void_p)]


def passes(each):
    """An array of `Pass`, and what has to live as long; see `Host.go_alone`."""
    array, kept = (Pass * (len(each) + 1))(), []
    for entry, one in zip(array, each):
        if isinstance(one, partial):
            entry.kind, entry.loop, entry.cells = LOOP, one.func.address, addressof(one.args[0])
        else:
            addresses = (c_int64 * (len(one.cells) + 1))(*[cell.address for cell in one.cells])
            entry.kind, entry.comm, entry.cells = (
                KINDS[type(one).__name__],
                one.world.handle,
                addressof(addresses),
            )
            kept.append(addresses)
    return array, (each, kept)
