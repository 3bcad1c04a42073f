"""The compiled loops for a LAMMPS that takes nothing along with its atoms: to find them by their IDs, and to tell of their bodies."""

import numpy as np

from .compiled import F2, L1, loop
from .kernels import OF_ATOM, OF_BODY, enter, hashed


@loop
def describe(places: L1, body: L1, d: F2, state: F2, rows: F2):
    """Write for each of the atoms at these places what another rank needs to know of it, but for its origin, to rows (places, OF_BODY + ...)."""
    for j in range(places.size):
        p = places[j]
        for c in range(OF_BODY - OF_ATOM):
            rows[j, OF_ATOM + c] = d[c, p]
        for row in range(state.shape[0]):
            rows[j, OF_BODY + row] = state[row, body[p]]


@loop
def find_in_table(keys: L1, wanted: L1, table: L1, found: L1):
    """See `find`; table is filled with -1 and its size is a power of two."""
    last = table.size - 1
    for j in range(keys.size):
        enter(table, keys[j], j)
    for i in range(wanted.size):
        h = hashed(wanted[i], table)
        while table[h] >= 0 and keys[table[h]] != wanted[i]:
            h = (h + 1) & last
        found[i] = table[h]


def find(keys, wanted):
    """For each entry of `wanted` its place in `keys` (both unique, positive int64), or -1.

    A hash table of the size of the rank's own data: no array grows with the system.
    """
    table = np.full(1 << (2 * len(keys) + 3).bit_length(), -1, np.int64)
    found = np.empty(len(wanted), np.int64)
    find_in_table(keys, wanted, table, found)
    return found
