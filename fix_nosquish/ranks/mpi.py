"""MPI for compiled loops: they call the functions of the MPI library by their addresses.

So one piece of code shares bodies and follows atoms, whatever calls it: the plugin in C++, or
Python for a LAMMPS's own fix python/move.  mpi4py, which knows the library, gives addresses,
handles, sizes.
"""

import ctypes
from typing import NamedTuple

import numpy as np

from ..loops.compiled import L1, Cell, address, call, inlined, longs
from ..loops.memory import room

# entries of `Mpi.interface`: functions,
_FUNCTIONS = (
    "Isend",
    "Issend",
    "Irecv",
    "Waitall",
    "Testall",
    "Test",
    "Ibarrier",
    "Improbe",
    "Mprobe",
    "Mrecv",
    "Get_count",
    "Allreduce",
)
(
    ISEND, ISSEND, IRECV, WAITALL, TESTALL, TEST, IBARRIER, IMPROBE, MPROBE, MRECV, GET_COUNT,
    ALLREDUCE,
) = range(12)  # fmt: skip
# handles, sizes, offsets,
COMM, LONG, DOUBLE, SUM, ANY_SOURCE, REQUEST_SIZE, SOURCE_AT, STATUS_SIZE = range(12, 20)
# how many ranks and which one is this, which of two tags is next
RANKS, RANK, TURN, ENTRIES = 20, 21, 22, 23

QUESTION, ANSWER, PART = 1, 3, 4  # tags of messages; QUESTION + 1 is one, too

# entries of `Mpi.words`, where MPI writes: a flag or a count, a message, a barrier's request, a
# status
FLAG, MESSAGE, BARRIER, STATUS, WORDS = 0, 1, 2, 3, 35
# rows of the memory: requests, as many as messages are under way, and statuses; what `deliver`
# leaves: senders, how many numbers each sent, the numbers; and what it works with
ROWS = "requests", "statuses", "senders", "sent", "numbers", "unsorted", "begins"
REQUESTS, STATUSES, SENDERS, SENT, NUMBERS, UNSORTED, BEGINS = range(1, 8)


class Mpi(NamedTuple):
    """What loops need to call MPI: see above.

    Attributes:
        interface: (ENTRIES,).  words: (WORDS,).
    """

    interface: L1
    words: L1


def alone():
    """The cells of an `Mpi` of one rank, that is never called."""
    interface = np.zeros(ENTRIES, np.int64)
    interface[RANKS] = 1
    return {"interface": Cell(L1, interface), "words": Cell(L1, np.zeros(WORDS, np.int64))}


def cells(comm, MPI):
    """The cells of an `Mpi`.

    Args:
        comm: the communicator.  MPI: mpi4py's module.
    Returns:
        dictionary from the names of fields to `compiled.Cell`.
    """

    def handle(thing):
        memory = ctypes.string_at(MPI._addressof(thing), MPI._sizeof(thing))
        return int.from_bytes(memory, "little", signed=True)

    mpi = ctypes.CDLL(None)  # with what stands before the library, as a tool that counts calls
    if not hasattr(mpi, "MPI_Init"):
        mpi = ctypes.CDLL(MPI.__file__)
    interface = np.zeros(ENTRIES, np.int64)
    for k, name in enumerate(_FUNCTIONS):
        interface[k] = ctypes.cast(getattr(mpi, f"MPI_{name}"), ctypes.c_void_p).value
    for k, thing in (COMM, comm), (LONG, MPI.INT64_T), (DOUBLE, MPI.DOUBLE), (SUM, MPI.SUM):
        interface[k] = handle(thing)
    interface[ANY_SOURCE], interface[RANKS], interface[RANK] = MPI.ANY_SOURCE, comm.size, comm.rank
    interface[REQUEST_SIZE], interface[STATUS_SIZE] = (
        MPI._sizeof(MPI.Request),
        MPI._sizeof(MPI.Status),
    )
    status = MPI.Status()
    status.source = 12345
    raw = ctypes.string_at(MPI._addressof(status), MPI._sizeof(status))
    interface[SOURCE_AT] = np.frombuffer(raw, np.int32).tolist().index(12345)
    assert MPI._sizeof(MPI.Status) <= 8 * (WORDS - STATUS)
    return {"interface": Cell(L1, interface), "words": Cell(L1, np.zeros(WORDS, np.int64))}


@inlined
def request(mpi, memory):
    """The address of the request of one more message that is under way."""
    interface = mpi.interface
    memory[REQUESTS, 1] += 1
    place = room(memory, REQUESTS, memory[REQUESTS, 1] * interface[REQUEST_SIZE])
    return place + (memory[REQUESTS, 1] - 1) * interface[REQUEST_SIZE]


@inlined
def send(mpi, memory, how, begin, count, kind, rank, tag):
    """Begin to send (how: ISEND, ISSEND) or receive (IRECV) so many numbers at this address."""
    interface = mpi.interface
    place = request(mpi, memory)
    call(interface[how], begin, count, interface[kind], rank, tag, interface[COMM], place)


@inlined
def wait(mpi, memory):
    """Wait until all messages that are under way are there."""
    interface = mpi.interface
    n = memory[REQUESTS, 1]
    if n:
        statuses = room(memory, STATUSES, n * interface[STATUS_SIZE])
        call(interface[WAITALL], n, memory[REQUESTS, 0], statuses)
        memory[REQUESTS, 1] = 0


@inlined
def all_sent(mpi, memory):
    """Whether all messages that are under way are there."""
    interface, words = mpi.interface, mpi.words
    n = memory[REQUESTS, 1]
    words[FLAG] = 0
    statuses = room(memory, STATUSES, n * interface[STATUS_SIZE])
    call(interface[TESTALL], n, memory[REQUESTS, 0], address(words), statuses)
    if words[FLAG]:
        memory[REQUESTS, 1] = 0
    return words[FLAG] != 0


@inlined
def add_up(mpi, kind, numbers, sums):
    """The sums over all ranks of each of these numbers; kind is LONG or DOUBLE."""
    interface, n = mpi.interface, numbers.size
    if interface[RANKS] > 1:
        call(
            interface[ALLREDUCE],
            address(numbers),
            address(sums),
            n,
            interface[kind],
            interface[SUM],
            interface[COMM],
        )
    else:
        for k in range(n):
            sums[k] = numbers[k]


@inlined
def append(memory, row, value):
    """Put a number behind those in this row."""
    n = memory[row, 1]
    longs(room(memory, row, 8 * (n + 1)), n + 1)[n] = value
    memory[row, 1] = n + 1


@inlined
def expect(memory, source, count):
    """Have room for so many numbers from this rank. Returns: their place."""
    begin = memory[UNSORTED, 1]
    append(memory, SENDERS, source)
    append(memory, SENT, count)
    append(memory, BEGINS, begin)
    memory[UNSORTED, 1] = begin + count
    return room(memory, UNSORTED, 8 * (begin + count)) + 8 * begin


@inlined
def receive(mpi, memory):
    """Receive the message that was probed."""
    interface, words = mpi.interface, mpi.words
    status = address(words) + 8 * STATUS
    words[FLAG] = 0
    call(interface[GET_COUNT], status, interface[LONG], address(words))
    count = words[FLAG]
    half = 2 * STATUS + interface[SOURCE_AT]
    source = (words[half // 2] >> (32 * (half % 2))) & 0xFFFFFFFF
    place = expect(memory, source, count)
    call(interface[MRECV], place, count, interface[LONG], address(words) + 8 * MESSAGE, status)


@inlined
def deliver(mpi, memory, to, many, parts, sources, known):
    """Send a part to each of some ranks, and receive what others send to this one; collective.

    What has come is in SENDERS, SENT and NUMBERS of the memory, in the order of the ranks.

    Args:
        to, many: (n,) the ranks, and how many numbers go to each.  parts: the numbers.
        sources: the ranks that send something to this one, if they are known: else they are found.
    """
    interface, words, rank = mpi.interface, mpi.words, mpi.interface[RANK]
    message, status = address(words) + 8 * MESSAGE, address(words) + 8 * STATUS
    how, tag, begin = ISEND if known else ISSEND, ANSWER if known else QUESTION + interface[TURN], 0
    for row in (SENDERS, SENT, BEGINS, UNSORTED):
        memory[row, 1] = 0
    for r in range(to.size):
        if to[r] == rank:
            own = longs(expect(memory, rank, many[r]), many[r])
            for k in range(many[r]):
                own[k] = parts[begin + k]
        else:
            send(mpi, memory, how, address(parts) + 8 * begin, many[r], LONG, to[r], tag)
        begin += many[r]
    if known:
        for r in range(sources.size):
            if sources[r] != rank:
                call(interface[MPROBE], sources[r], tag, interface[COMM], message, status)
                receive(mpi, memory)
        wait(mpi, memory)
    else:
        # A rank enters the barrier when all it sent is being received: when all have, there is
        # nothing more to come.  Ranks ahead of this one may be in the next round by then, but not
        # in the one after it: two tags do.
        interface[TURN] = 1 - interface[TURN]
        entered = over = False
        while not over:
            words[FLAG] = 0
            call(
                interface[IMPROBE],
                interface[ANY_SOURCE],
                tag,
                interface[COMM],
                address(words),
                message,
                status,
            )
            if words[FLAG]:
                receive(mpi, memory)
            elif not entered:
                if all_sent(mpi, memory):
                    call(interface[IBARRIER], interface[COMM], address(words) + 8 * BARRIER)
                    entered = True
            else:
                call(interface[TEST], address(words) + 8 * BARRIER, address(words), status)
                over = words[FLAG] != 0
    put_in_order(memory)


@inlined
def put_in_order(memory):
    """Put what has come in the order of the ranks."""
    n, total = memory[SENDERS, 1], memory[UNSORTED, 1]
    senders, sent = longs(memory[SENDERS, 0], n), longs(memory[SENT, 0], n)
    begins, unsorted = longs(memory[BEGINS, 0], n), longs(memory[UNSORTED, 0], total)
    numbers, end = longs(room(memory, NUMBERS, 8 * total), total), 0
    for k in range(1, n):
        source, count, begin, i = senders[k], sent[k], begins[k], k
        while i > 0 and senders[i - 1] > source:
            senders[i], sent[i], begins[i] = senders[i - 1], sent[i - 1], begins[i - 1]
            i -= 1
        senders[i], sent[i], begins[i] = source, count, begin
    for k in range(n):
        for i in range(sent[k]):
            numbers[end + i] = unsorted[begins[k] + i]
        end += sent[k]
    memory[NUMBERS, 1] = total
