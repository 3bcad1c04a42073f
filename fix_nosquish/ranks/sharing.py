"""Bodies held by several ranks: who shares them, and one exchange a step.

Every rank that owns an atom of a body keeps that body's whole state.  Each step the sharing ranks
send each other their partial force and torque and add the parts up in the order of their ranks, so
that all copies of a body stay equal to the last bit and no rank is the body's master.  Ghost atoms
play no part.  What a rank sends and keeps depends on its own bodies and on the ranks that share
them, not on how many bodies or ranks there are.

The holders of a body find each other at a rank on which all agree, where they meet: each tells it
which bodies it has, and it tells them who else has.
"""

import numpy as np

from ..loops.compiled import F1, F2, L1, L2, Cell, I, address, array, floats, inlined, longs, loop
from ..loops.memory import Memory, room
from .mpi import (
    DOUBLE,
    IRECV,
    ISEND,
    NUMBERS,
    PART,
    RANK,
    RANKS,
    ROWS,
    SENDERS,
    SENT,
    Mpi,
    deliver,
    send,
    wait,
)

# what is counted: bodies of this rank, those that may be shared, ranks at which these meet; bodies
# that are shared, ranks that share them, copies sent to them
BODIES, ASKED, MEETINGS, SHARED, PARTNERS, COPIES, COUNTS = range(7)
# rows of the memory, behind those of `mpi`: (asked,) bodies that may be shared, their IDs, where
# they meet; the same in order; (meetings,) these ranks and how many meet there; (bodies,) where
# each meets from now on; (shared,) shared bodies; where the parts of each begin in the sources, and
# these; (partners,) ranks, how many bodies are shared with each; (copies,) what is sent; and what
# to work with
_OWN = (
    "asked",
    "ids",
    "meet",
    "places",
    "questions",
    "meetings",
    "many",
    "home",
    "shared",
    "first",
    "source",
    "partners",
    "shares",
    "copies",
    "order",
    "spare",
    "owner",
    "equal",
    "answers",
    "parts",
)
(
    ASKED_ROW,
    IDS,
    MEET,
    PLACES,
    QUESTIONS,
    MEETING,
    MANY,
    HOME_ROW,
    SHARED_ROW,
    FIRST,
    SOURCE,
    PARTNER,
    SHARES,
    COPIED,
    ORDER,
    SPARE,
    OWNER,
    EQUAL,
    ANSWERS,
    PARTS,
) = range(1 + len(ROWS), 21 + len(ROWS))
PACKED, RECEIVED = 21 + len(ROWS), 22 + len(ROWS)
ADD, LEAST, GREATEST = range(3)  # how parts are combined

_BITS = 32  # an atom's origin is rank << 32 | place


def origin(rank, places):
    """The origins, int64, of atoms that have these places in a rank's list of bodies' atoms."""
    return np.int64(rank << _BITS) | places


def places(origins):
    """The places in these origins."""
    return origins & ((1 << _BITS) - 1)


# ---------------------------------------------------------------- who shares


@inlined
def in_row(memory, row, n):
    """The array of this row, with room for n numbers; what is there stays."""
    return longs(room(memory, row, 8 * n), n)


@inlined
def sort(order, spare, n, high, low):
    """Fill order with 0 to n - 1 so that high, and where it is equal low, does not fall.

    It merges sorted runs.
    """
    for i in range(n):
        order[i] = i
    width = 1
    while width < n:
        for begin in range(0, n, 2 * width):
            middle, end = min(begin + width, n), min(begin + 2 * width, n)
            a, b = begin, middle
            for k in range(begin, end):
                first = a < middle
                if first and b < end:
                    i, j = order[a], order[b]
                    first = high[i] < high[j] or (high[i] == high[j] and low[i] <= low[j])
                if first:
                    spare[k] = order[a]
                    a += 1
                else:
                    spare[k] = order[b]
                    b += 1
        for k in range(n):
            order[k] = spare[k]
        width *= 2


@inlined
def ask(memory, counts):
    """Put the bodies that may be shared in the order of where holders meet, then of ID.

    Two holders agree on it.
    """
    n, ranks = counts[ASKED], 0
    asked, ids = in_row(memory, ASKED_ROW, n), in_row(memory, IDS, n)
    meet = in_row(memory, MEET, n)
    order, places, questions = (
        in_row(memory, ORDER, n),
        in_row(memory, PLACES, n),
        in_row(memory, QUESTIONS, n),
    )
    meeting, many = in_row(memory, MEETING, n), in_row(memory, MANY, n)
    sort(order, in_row(memory, SPARE, n), n, meet, ids)
    for k in range(n):
        i = order[k]
        places[k], questions[k] = asked[i], ids[i]
        if ranks == 0 or meeting[ranks - 1] != meet[i]:
            meeting[ranks], many[ranks] = meet[i], 0
            ranks += 1
        many[ranks - 1] += 1
    counts[MEETINGS] = ranks


@inlined
def answer(memory):
    """Tell ranks that ask who holds bodies who else has asked.

    For each asker ANSWERS has how many ranks hold each of its bodies, then which ranks, body by
    body.
    """
    ranks, n = memory[SENDERS, 1], memory[NUMBERS, 1]
    askers, asked = in_row(memory, SENDERS, ranks), in_row(memory, SENT, ranks)
    ids, order, spare = (
        in_row(memory, NUMBERS, n),
        in_row(memory, ORDER, n),
        in_row(memory, SPARE, n),
    )
    owner, equal = in_row(memory, OWNER, n), in_row(memory, EQUAL, n)
    total = begin = i = 0
    for r in range(ranks):
        for _ in range(asked[r]):
            owner[i] = r
            i += 1
    sort(order, spare, n, ids, owner)
    while begin < n:
        end = begin
        while end < n and ids[order[end]] == ids[order[begin]]:
            end += 1
        for k in range(begin, end):
            equal[order[k]], spare[order[k]] = begin, end - begin
        total += (end - begin) * (1 + end - begin)
        begin = end
    answers, parts = in_row(memory, ANSWERS, total), in_row(memory, PARTS, ranks)
    total = i = 0
    for r in range(ranks):
        begin, end = i, i + asked[r]
        parts[r] = -total
        for i in range(begin, end):
            answers[total] = spare[i]
            total += 1
        for i in range(begin, end):
            for k in range(equal[i], equal[i] + spare[i]):
                answers[total] = askers[owner[order[k]]]
                total += 1
        parts[r] += total
        i = end


@inlined
def connect(memory, counts, own):
    """Find with whom this rank, `own`, shares which bodies, and how their parts lie in messages.

    NUMBERS has a part from each meeting, with what it was asked of the next many[r] places: by how
    many ranks each of these bodies is held, then by which, body by body; the first of them is its
    home from now on.  What is sent is in the order of the partners, for each that of places.  What
    is received is in the same order: the parts of the i-th shared body are those of
    source[first[i]] to source[first[i + 1]], and -1 there is this rank's part.
    """
    bodies, n, answered = counts[BODIES], counts[ASKED], memory[NUMBERS, 1]
    places, many = in_row(memory, PLACES, n), in_row(memory, MANY, n)
    answers, home = in_row(memory, NUMBERS, answered), in_row(memory, HOME_ROW, bodies)
    shared, first = in_row(memory, SHARED_ROW, n), in_row(memory, FIRST, n + 1)
    source, copies = in_row(memory, SOURCE, answered), in_row(memory, COPIED, answered)
    partners, shares = in_row(memory, PARTNER, answered), in_row(memory, SHARES, answered)
    for b in range(bodies):
        home[b] = own
    nshared = npartners = entries = end = place = last = 0
    first[0] = 0
    for r in range(counts[MEETINGS]):
        held, begin = end, end + many[r]
        for i in range(place, place + many[r]):
            home[places[i]] = answers[begin]
            end = begin + answers[held]
            if end > begin + 1:
                for k in range(begin, end):
                    source[entries] = -1
                    if answers[k] != own:
                        p = 0
                        while p < npartners and partners[p] != answers[k]:
                            p += 1
                        if p == npartners:
                            partners[p], shares[p] = answers[k], 0
                            npartners += 1
                        source[entries] = p
                        shares[p] += 1
                    entries += 1
                shared[nshared] = places[i]
                nshared += 1
                first[nshared] = entries
            held, begin = held + 1, end
        place += many[r]
    # shares serve as the next free entry of each partner, and are what they were at the end
    for p in range(npartners):
        last += shares[p]
        shares[p] = last - shares[p]
    for i in range(nshared):
        for k in range(first[i], first[i + 1]):
            p = source[k]
            if p >= 0:
                source[k] = shares[p]
                copies[shares[p]] = shared[i]
                shares[p] += 1
    for p in range(npartners - 1, 0, -1):
        shares[p] -= shares[p - 1]
    counts[SHARED], counts[PARTNERS], counts[COPIES] = nshared, npartners, last


@inlined
def find(mpi, memory, counts):
    """Find who else holds the bodies that may be shared; collective."""
    own = mpi.interface[RANK]
    if mpi.interface[RANKS] == 1:
        home = in_row(memory, HOME_ROW, counts[BODIES])
        for b in range(counts[BODIES]):
            home[b] = own
        counts[SHARED] = counts[PARTNERS] = counts[COPIES] = 0
    else:
        ask(memory, counts)
        meeting, many = (
            in_row(memory, MEETING, counts[MEETINGS]),
            in_row(memory, MANY, counts[MEETINGS]),
        )
        questions = in_row(memory, QUESTIONS, counts[ASKED])
        deliver(mpi, memory, meeting, many, questions, meeting, False)
        answer(memory)
        n = memory[SENDERS, 1]
        askers = in_row(memory, SPARE, n)  # a copy: their row takes the answers' senders
        for r in range(n):
            askers[r] = longs(memory[SENDERS, 0], n)[r]
        parts, answers = in_row(memory, PARTS, n), in_row(memory, ANSWERS, 1)
        deliver(mpi, memory, askers, parts, answers, meeting, True)
        connect(memory, counts, own)


@loop
def find_sharers(mpi: Mpi, sharing: L2, counts: L1):
    """`find`, of what Python has put to the rows of the memory."""
    find(mpi, sharing, counts)


# ---------------------------------------------------------------- one exchange


@loop
def give(mpi: Mpi, sharing: L2, counts: L1, values: F2):
    """Begin to send the columns of shared bodies to their sharers, and to receive theirs."""
    rows, n, begin = values.shape[0], counts[COPIES], 0
    copies = longs(sharing[COPIED, 0], n)
    packed = floats(room(sharing, PACKED, 8 * rows * n), n, rows)
    received = room(sharing, RECEIVED, 8 * rows * n)
    for k in range(n):
        for row in range(rows):
            packed[k, row] = values[row, copies[k]]
    for p in range(counts[PARTNERS]):
        rank = longs(sharing[PARTNER, 0], p + 1)[p]
        count = rows * longs(sharing[SHARES, 0], p + 1)[p]
        send(mpi, sharing, IRECV, received + begin, count, DOUBLE, rank, PART)
        send(mpi, sharing, ISEND, address(packed) + begin, count, DOUBLE, rank, PART)
        begin += 8 * count


@loop
def combine(mpi: Mpi, sharing: L2, counts: L1, values: F2, how: I):
    """Wait for the parts of shared bodies; set their columns to what these give, in their order.

    how: ADD, LEAST or GREATEST.
    """
    wait(mpi, sharing)
    rows, n = values.shape[0], counts[SHARED]
    shared, first = longs(sharing[SHARED_ROW, 0], n), longs(sharing[FIRST, 0], n + 1)
    source = longs(sharing[SOURCE, 0], first[n] if n else 0)
    received = floats(sharing[RECEIVED, 0], counts[COPIES], rows)
    for i in range(n):
        for row in range(rows):
            own = values[row, shared[i]]
            result = 0.0 if how == ADD else own
            for k in range(first[i], first[i + 1]):
                part = own if source[k] < 0 else received[source[k], row]
                if how == ADD:
                    result += part
                else:
                    result = min(result, part) if how == LEAST else max(result, part)
            values[row, shared[i]] = result


class Sharers:
    """The bodies of this rank that other ranks hold too.

    Args:
        communicator: the `Communicator` or `ALONE`.

    Attributes:
        bodies: (m,) places of the shared bodies in this rank's list of bodies.
        home: (n,) the lowest rank of those that hold each body.
        owned: (n,) bool, whether this rank is it: what has to be counted once is counted there.
        cells: what the loops take: of `Mpi`, "sharing" and "counts".
    """

    def __init__(self, communicator):
        self._communicator, self.counts = communicator, np.zeros(COUNTS, np.int64)
        kinds = dict.fromkeys((*ROWS, *_OWN), L1) | {"packed": F1, "received": F1}
        self._memory = Memory(kinds)
        self.cells = communicator.cells | {
            "sharing": self._memory.cells["memory"],
            "counts": Cell(L1, self.counts),
        }

    def find(self, n, places, ids, meet):
        """Find who else holds some of this rank's bodies; collective.

        Args:
            n: how many bodies this rank has.
            places: (m,) those that it does not know to be whole here.
            ids: (m,) int64, their IDs, each once.
            meet: (m,) int64, the rank at which all holders of each body meet: any on which they
                agree.
        Returns:
            Sharers: self.
        """
        for name, values in ("asked", places), ("ids", ids), ("meet", meet):
            self._memory.put(name, values)
        self.counts[[BODIES, ASKED]] = n, len(places)
        find_sharers.bind_to(self.cells)()
        return self

    def _row(self, row, count):
        place = self._memory.table[row, 0].item()
        return array(place, (self.counts[count].item(),), np.int64)

    @property
    def bodies(self):
        return self._row(SHARED_ROW, SHARED)

    @property
    def home(self):
        return self._row(HOME_ROW, BODIES)

    @property
    def owned(self):
        return self.home == self._communicator.rank

    def combine(self, values, operation=np.add):
        """Combine the ranks' parts of shared bodies, in place: one exchange.

        Args:
            values: (components, n) float64, contiguous: this rank's parts; others stay as they are.
            operation: numpy.add, minimum or maximum.
        """
        if self.counts[SHARED]:
            how = (np.add, np.minimum, np.maximum).index(operation)
            give.bind_to(self.cells, values=values)()
            combine.bind_to(self.cells, values=values, how=how)()

    def total(self, body, *columns):
        """Sums over the atoms of each body, on all ranks, (len(columns), n): one exchange.

        Args:
            body: (m,) the place of each atom's body in this rank's list.
            columns: (m,) each, a number of each atom.
        """
        n = self.counts[BODIES]
        sums = [np.bincount(body, column, minlength=n) for column in columns]
        sums = np.array(sums, float)  # bincount gives whole numbers for no atoms
        self.combine(sums)
        return sums

    def lowest(self, body, *columns):
        """As `total`, the lowest number of each body's atoms; inf for a body without any."""
        return self._extreme(body, columns, np.inf, np.minimum)

    def highest(self, body, *columns):
        """As `total`, the highest number of each body's atoms; -inf for a body without any."""
        return self._extreme(body, columns, -np.inf, np.maximum)

    def _extreme(self, body, columns, start, operation):
        result = np.full((len(columns), self.counts[BODIES]), start)
        for row, column in zip(result, columns):
            operation.at(row, body, column)
        self.combine(result, operation)
        return result
