"""Shared bodies: which ranks share them, and one exchange per step (two where a virial is asked).

Each rank that owns an atom of a body has a copy of the body's state.  In each step the ranks that
share a body exchange their partial sums of force and torque, and add them up in the order of the
ranks, so all copies stay equal to the last bit.  Ghost atoms are not needed.  The cost for a rank
depends on its shared bodies and their ranks, not on the total number of bodies or ranks.

The ranks that share a body find each other by a rendezvous: each sends the IDs of its bodies to a
rank on which all agree, which answers with the list of ranks.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from ..loops.compiled import F2, L1, L2, I, address, inlined, loop
from ..loops.memory import LENGTH, Memory, append, floats_in, longs_in, new_longs, resize, rows
from .communicator import Ranks
from .mpi import MESSAGES, PART, Mpi, deliver, start, wait

ADD, GREATEST = range(2)  # how parts are combined
END = -1  # ends the ranks of a body in an answer


class SharingRows(NamedTuple):
    """Rows of the memory of a rank's shared bodies.

    Attributes:
        asked, ids, meet: (asked,) columns of the bodies that may be shared, their IDs, and the rank
            of the rendezvous for each.
        places, questions: (asked,) the same columns and IDs, sorted by rank of the rendezvous.
        meetings, many: (meetings,) ranks of the rendezvous, and number of bodies for each.
        home: (bodies,) lowest rank that has each body: its next rendezvous.
        shared: (shared,) columns of the shared bodies.
        first, source: (shared + 1,), (parts,) the parts of shared body i are the entries first[i]
            to first[i + 1] of source: a row of `received`, or -1 for the part of this rank.
        partners, shares: (partners,) ranks that share bodies with this one, and numbers of these
            bodies.
        copies: (copies,) columns of the bodies whose parts are sent, partner by partner.
        packed, received: (copies, rows) parts to send to the partners, and parts received.
        order, holder, entry, body, answers, parts: scratch.
    """

    asked: L1
    ids: L1
    meet: L1
    places: L1
    questions: L1
    meetings: L1
    many: L1
    home: L1
    shared: L1
    first: L1
    source: L1
    partners: L1
    shares: L1
    copies: L1
    packed: F2
    received: F2
    order: L1
    holder: L1
    entry: L1
    body: L1
    answers: L1
    parts: L1


SHARING = rows(SharingRows)


def places(origins: Any) -> Any:
    """The indices of atoms, from the origins rank << 32 | index."""
    return origins & 0xFFFFFFFF


# ---------------------------------------------------------------- who shares


@inlined
def argsort(order, n, high, low):
    """Fill `order` with the indices 0 to n - 1, sorted by `high`, then `low`, then themselves.

    Shell sort works in place.  Loops cannot use the sorts of numba, which allocate arrays.
    """
    for i in range(n):
        order[i] = i
    gap = n
    while gap > 1:
        gap = max(gap * 5 // 11, 1)
        for k in range(gap, n):
            i = order[k]
            while k >= gap:
                j = order[k - gap]
                if (high[j], low[j], j) <= (high[i], low[i], i):
                    break
                order[k] = j
                k -= gap
            order[k] = i


@inlined
def group(sharing, n, ranks, low, to, many):
    """`argsort` by rank and `low`; set rows `to` and `many` to the ranks and their counts."""
    order = new_longs(sharing, SHARING.order, n)
    argsort(order, n, ranks, low)
    resize(sharing, to, 0, 1)
    resize(sharing, many, 0, 1)
    for k in range(n):
        if k == 0 or ranks[order[k]] != ranks[order[k - 1]]:
            append(sharing, to, ranks[order[k]])
            append(sharing, many, 0)
        longs_in(sharing, many)[sharing[many, LENGTH] - 1] += 1


@inlined
def ask(sharing):
    """Sort the bodies that may be shared by rank of the rendezvous, then by ID."""
    asked, ids = longs_in(sharing, SHARING.asked), longs_in(sharing, SHARING.ids)
    meet, n = longs_in(sharing, SHARING.meet), asked.size
    group(sharing, n, meet, ids, SHARING.meetings, SHARING.many)
    places, order = new_longs(sharing, SHARING.places, n), longs_in(sharing, SHARING.order)
    questions = new_longs(sharing, SHARING.questions, n)
    for k in range(n):
        places[k], questions[k] = asked[order[k]], ids[order[k]]


@inlined
def answer(sharing, messages):
    """Answer the questions that this rank has received: which ranks asked about the same body.

    `answers` has for each asker, body by body, the ranks and END; `parts` has the count of these
    numbers for each asker.
    """
    askers, asked = longs_in(messages, MESSAGES.senders), longs_in(messages, MESSAGES.sent)
    ids = longs_in(messages, MESSAGES.numbers)
    n, i, parts = ids.size, 0, new_longs(sharing, SHARING.parts, askers.size)
    order, holder = new_longs(sharing, SHARING.order, n), new_longs(sharing, SHARING.holder, n)
    entry = new_longs(sharing, SHARING.entry, n)
    for r in range(askers.size):
        for _ in range(asked[r]):
            holder[i] = askers[r]
            i += 1
    argsort(order, n, ids, holder)
    for k in range(n):
        alike = k > 0 and ids[order[k]] == ids[order[k - 1]]
        entry[order[k]] = entry[order[k - 1]] if alike else k
    i = 0
    resize(sharing, SHARING.answers, 0, 1)
    for r in range(askers.size):
        before = sharing[SHARING.answers, LENGTH]
        for _ in range(asked[r]):
            k = entry[i]
            while k < n and ids[order[k]] == ids[i]:
                append(sharing, SHARING.answers, holder[order[k]])
                k += 1
            append(sharing, SHARING.answers, END)
            i += 1
        parts[r] = sharing[SHARING.answers, LENGTH] - before


@inlined
def connect(mpi, sharing):
    """Find the partners of this rank, the bodies shared with each, and the order of their parts.

    The received numbers are, for each of `places`, the ranks of the body and END.  The first of
    these ranks is the body's home.  Parts are sent and received partner by partner, for each in the
    order of `places`.
    """
    places, home = longs_in(sharing, SHARING.places), longs_in(sharing, SHARING.home)
    answers = longs_in(mpi.messages, MESSAGES.numbers)
    shared = new_longs(sharing, SHARING.shared, places.size)
    first = new_longs(sharing, SHARING.first, places.size + 1)
    source = new_longs(sharing, SHARING.source, answers.size)
    holder = new_longs(sharing, SHARING.holder, answers.size)
    entry = new_longs(sharing, SHARING.entry, answers.size)
    body = new_longs(sharing, SHARING.body, answers.size)
    nshared = entries = others = k = 0
    for i in range(places.size):
        home[places[i]] = answers[k]
        if answers[k + 1] == END:  # not shared
            k += 2
            continue
        shared[nshared], first[nshared] = places[i], entries
        nshared += 1
        while answers[k] != END:
            if answers[k] != mpi.rank:
                holder[others], entry[others], body[others] = answers[k], entries, places[i]
                others += 1
            source[entries] = -1
            entries += 1
            k += 1
        k += 1
    first[nshared] = entries
    resize(sharing, SHARING.shared, nshared, 1)
    group(sharing, others, holder, entry, SHARING.partners, SHARING.shares)
    copies, order = new_longs(sharing, SHARING.copies, others), longs_in(sharing, SHARING.order)
    for k in range(others):
        copies[k], source[entry[order[k]]] = body[order[k]], k


@inlined
def find(mpi, sharing):
    """Find which ranks share the bodies in `asked`, and the `home` of all bodies; collective."""
    home, messages = longs_in(sharing, SHARING.home), mpi.messages
    for b in range(home.size):
        home[b] = mpi.rank
    if mpi.ranks > 1:
        ask(sharing)
        meetings, many = longs_in(sharing, SHARING.meetings), longs_in(sharing, SHARING.many)
        deliver(mpi, meetings, many, longs_in(sharing, SHARING.questions), meetings, False)
        answer(sharing, messages)
        askers, answers = longs_in(messages, MESSAGES.senders), longs_in(sharing, SHARING.answers)
        deliver(mpi, askers, longs_in(sharing, SHARING.parts), answers, meetings, True)
        connect(mpi, sharing)


@loop
def find_sharers(mpi: Mpi, sharing: L2):
    """`find`, for rows that Python has set."""
    find(mpi, sharing)


# ---------------------------------------------------------------- one exchange


@loop
def give(mpi: Mpi, sharing: L2, values: F2):
    """Begin an exchange, which `combine` ends: send the columns of shared bodies to partners."""
    copies, rows, begin = longs_in(sharing, SHARING.copies), values.shape[0], 0
    partners, shares = longs_in(sharing, SHARING.partners), longs_in(sharing, SHARING.shares)
    resize(sharing, SHARING.packed, copies.size, rows)
    resize(sharing, SHARING.received, copies.size, rows)
    packed, received = floats_in(sharing, SHARING.packed), floats_in(sharing, SHARING.received)
    for k in range(copies.size):
        for row in range(rows):
            packed[k, row] = values[row, copies[k]]
    for p in range(partners.size):
        count, kind = rows * shares[p], mpi.MPI_DOUBLE
        start(mpi, mpi.MPI_Irecv, address(received) + begin, count, kind, partners[p], PART)
        start(mpi, mpi.MPI_Isend, address(packed) + begin, count, kind, partners[p], PART)
        begin += 8 * count


@loop
def combine(mpi: Mpi, sharing: L2, values: F2, how: I):
    """End an exchange: wait for the parts of shared bodies, combine them in the order of the ranks.

    Args:
        how: ADD or GREATEST.
    """
    wait(mpi)
    shared, first = longs_in(sharing, SHARING.shared), longs_in(sharing, SHARING.first)
    source, received = longs_in(sharing, SHARING.source), floats_in(sharing, SHARING.received)
    for i in range(shared.size):
        for row in range(values.shape[0]):
            local = values[row, shared[i]]
            result = 0.0 if how == ADD else local
            for k in range(first[i], first[i + 1]):
                part = local if source[k] < 0 else received[source[k], row]
                result = result + part if how == ADD else max(result, part)
            values[row, shared[i]] = result


class Sharers:
    """The bodies that this rank shares with others.

    Args:
        communicator: the `Communicator` or `ALONE`.

    Attributes:
        bodies: (m,) columns of the shared bodies.
        home: (n,) lowest rank that has each body.
        owned: (n,) bool, whether this is that rank, which counts the body in sums over bodies, and
            does nothing else for it: all ranks that share a body move it alike.
        cells: the cells of an `Mpi`, and "sharing".
    """

    def __init__(self, communicator: Ranks) -> None:
        self._communicator, self._memory = communicator, Memory("sharing", SharingRows)
        self.cells = communicator.cells | {"sharing": self._memory.cells["sharing"]}

    def find(self, n: int, places: Any, ids: Any, meet: Any) -> "Sharers":
        """Find which ranks share the bodies of this rank; collective.

        Args:
            n: the number of bodies of this rank.
            places: (m,) columns of the bodies that may be shared.
            ids: (m,) int64, their IDs, without repetition.
            meet: (m,) int64, rank of the rendezvous for each: any on which all ranks agree.
        Returns:
            self.
        """
        rows = {"home": np.zeros(n), "asked": places, "ids": ids, "meet": meet}
        for name, values in rows.items():
            self._memory.put(name, values)
        find_sharers.bind_to(self.cells)()
        return self

    @property
    def bodies(self) -> np.ndarray:
        return self._memory.cells["shared"].array

    @property
    def home(self) -> np.ndarray:
        return self._memory.cells["home"].array

    @property
    def owned(self) -> np.ndarray:
        return self.home == self._communicator.rank

    def combine(self, values: np.ndarray, operation: Any = np.add) -> None:
        """Combine the parts of shared bodies in place, by one exchange; collective.

        Args:
            values: (components, n) float64, contiguous: the parts of this rank. Columns of bodies
                that are not shared are unchanged.
            operation: numpy.add or numpy.maximum.
        """
        if len(self.bodies):
            how = {np.add: ADD, np.maximum: GREATEST}[operation]
            give.bind_to(self.cells, values=values)()
            combine.bind_to(self.cells, values=values, how=how)()

    def total(self, body: np.ndarray, columns: Iterable[np.ndarray]) -> np.ndarray:
        """Sums over the atoms of each body on all ranks, (columns, n); collective.

        Args:
            body: (m,) column of each atom's body.
            columns: arrays (m,) of a number for each atom; an iterator saves memory.
        """
        n = len(self.home)
        sums = np.array([np.bincount(body, column, minlength=n) for column in columns], float)
        self.combine(sums)
        return sums

    def highest(self, body: np.ndarray, *columns: np.ndarray) -> np.ndarray:
        """The maximum, otherwise like `total`; -inf for a body without atoms."""
        result = np.full((len(columns), len(self.home)), -np.inf)
        for row, column in zip(result, columns):
            np.maximum.at(row, body, column)
        self.combine(result, np.maximum)
        return result

    def lowest(self, body: np.ndarray, *columns: np.ndarray) -> np.ndarray:
        """The minimum, otherwise like `total`; inf for a body without atoms."""
        return -self.highest(body, *(-np.asarray(column, float) for column in columns))
