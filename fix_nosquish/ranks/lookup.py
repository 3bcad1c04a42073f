"""What ranks ask each other of atoms, for messages and a LAMMPS that takes nothing along."""

import numpy as np

from ..loops.compiled import F2, L1, L2, I, loop
from ..loops.memory import Memory
from .migration import OF_BODY, enter, hashed
from .mpi import ROWS, Mpi, deliver
from .sharing import places


@loop
def deliver_parts(mpi: Mpi, messages: L2, to: L1, many: L1, parts: L1, sources: L1, known: I):
    """`mpi.deliver`."""
    deliver(mpi, messages, to, many, parts, sources, known)


@loop
def describe(places: L1, body: L1, displace: F2, state: F2, rows: F2):
    """Write what another rank needs to know of the atoms at these places, but for their origin,
    to rows (places, OF_BODY + ...)."""
    for j in range(places.size):
        p = places[j]
        for row in range(state.shape[0]):
            rows[j, OF_BODY + row] = state[row, body[p]]
        for c in range(displace.shape[0]):
            rows[j, OF_BODY + state.shape[0] + c] = displace[c, p]


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


class Messages:
    """Messages to single ranks; all methods are collective.

    Args:
        communicator: the `Communicator`.
    """

    def __init__(self, communicator):
        self._memory = Memory(dict.fromkeys(ROWS, L1))
        self._cells = communicator.cells | {"messages": self._memory.cells["memory"]}

    def deliver(self, to, numbers, sources=None):
        """Send numbers to ranks.

        Args:
            to: (n,) the rank to which each row goes, in order.  numbers: (n, width) int64.
            sources: the ranks that send something to this one, if all ranks know theirs.
        Returns:
            (ranks, counts, numbers): who sent something, how many rows each, and the rows.
        """
        ranks, counts = np.unique(to, return_counts=True)
        known = sources is not None
        deliver_parts.bind_to(
            self._cells,
            to=ranks,
            many=counts * numbers.shape[1],
            parts=numbers.ravel(),
            sources=sources if known else ranks,
            known=known,
        )()
        got = (self._memory.cells[name].array.copy() for name in ("senders", "sent", "numbers"))
        ranks, counts, numbers_got = got
        return ranks, counts // numbers.shape[1], numbers_got.reshape(-1, numbers.shape[1])

    def ask(self, to, questions, answer):
        """Ask other ranks, and answer what they ask.

        Args:
            to: (m,) int64, the rank that is asked each question.  questions: (m,) int64.
            answer: a function of the questions (k,) to this rank, which gives (k, width) numbers.
        Returns:
            (m, width) the answers to this rank's questions.
        """
        order = np.argsort(to, kind="stable")
        asked = to[order]
        askers, counts, wanted = self.deliver(asked, questions[order, None])
        answers = np.ascontiguousarray(answer(wanted[:, 0]))
        kind = answers.dtype
        back = self.deliver(np.repeat(askers, counts), answers.view(np.int64), np.unique(asked))[2]
        result = np.empty((len(to), answers.shape[1]), kind)
        result[order] = back.view(kind).reshape(result.shape)
        return result


def look_up(communicator, keys, values, wanted):
    """Ask all ranks for values, through a directory that is spread over them; collective.

    Args:
        keys: (n,) int64, each on one rank only.  values: (n,) int64.  wanted: (m,) keys.
    Returns:
        (m,) the values of these keys, -1 for a key that no rank has.
    """
    if communicator.size == 1:  # what this rank has it need not ask for
        return np.full(len(wanted), -1)
    messages = Messages(communicator)
    order = np.argsort(keys % communicator.size, kind="stable")
    pairs = np.stack([keys, values], axis=1)[order]
    told = messages.deliver((keys % communicator.size)[order], pairs)[2]
    known = dict(told.tolist())

    def answer(asked):
        return np.array([known.get(key, -1) for key in asked.tolist()], np.int64)[:, None]

    return messages.ask(wanted % communicator.size, wanted, answer)[:, 0]


def fetch(communicator, origins, rows_of):
    """Ask for what the ranks that lost atoms know of them; collective.

    Args:
        origins: (m,) int64, where each atom gained was before: another rank, and its place there.
        rows_of: a function of (n,) places that gives (n, width) float64, what goes with these
            atoms.
    Returns:
        (m, width) rows, in the order of origins.
    """
    if communicator.size == 1:
        return rows_of(origins)
    return Messages(communicator).ask(origins >> 32, places(origins), rows_of)


def gone(communicator, lost, gained):
    """Which of the places of lost atoms are of atoms that no rank has; collective.

    Args:
        lost: (k,) places of atoms that this rank no longer has.
        gained: origins of atoms from other ranks.
    """
    if communicator.size == 1:
        return lost
    gained = np.sort(gained)
    told = Messages(communicator).deliver(gained >> 32, places(gained)[:, None])[2]
    return np.setdiff1d(lost, told[:, 0])
