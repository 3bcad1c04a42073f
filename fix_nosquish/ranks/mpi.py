"""MPI for compiled loops.

Loops send messages themselves, so that neither a step nor a new neighbor list calls Python.  They
call MPI by the addresses of its functions, with handles and constants from mpi4py.  These differ
between MPI libraries, but the compiled loops are the same for all.

A rank finds the ranks that send to it by the algorithm NBX (T. Hoefler, C. Siebert and
A. Lumsdaine, PPoPP 2010): synchronous sends and a non-blocking barrier.  Its cost grows with the
logarithm of the number of ranks.  An all-to-all of counts, on which LAMMPS's rendezvous is based,
would cost each rank time and memory proportional to the number of ranks.
"""

import ctypes
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..loops.compiled import I1, L1, L2, Cell, I, address, annotations, call, inlined, loop
from ..loops.memory import ADDRESS, LENGTH, Memory, append, longs_in, resize, rows

if TYPE_CHECKING:
    from mpi4py import MPI

QUESTION, ANSWER, PART = 1, 3, 4  # tags of messages; questions also use QUESTION + 1


class MessageRows(NamedTuple):
    """Rows of the memory for messages.

    Attributes:
        requests: handles of pending messages, 8 bytes each.
        senders, sent, numbers: the received messages: rank of each sender, count of numbers sent,
            and all numbers.
    """

    requests: L1
    senders: L1
    sent: L1
    numbers: L1


MESSAGES = rows(MessageRows)


class Mpi(NamedTuple):
    """Handles and addresses with which loops call MPI.

    Attributes:
        MPI_...: addresses of functions, handles and constants of these names.
        communicator: the handle of `Communicator.comm`.
        rank, ranks: the rank of this process, and the number of ranks.
        flag, message, status, fortran_status: MPI's output: a flag or a count, the handle of a
            message, its status, and the status in Fortran's form.
        next_tag: (1,) 0 or 1: the next questions have the tag QUESTION + next_tag.
        messages: the table of a memory with `MessageRows`.
    """

    MPI_Isend: I
    MPI_Issend: I
    MPI_Irecv: I
    MPI_Wait: I
    MPI_Test: I
    MPI_Ibarrier: I
    MPI_Improbe: I
    MPI_Mprobe: I
    MPI_Mrecv: I
    MPI_Get_count: I
    MPI_Status_c2f: I
    MPI_Allreduce: I
    MPI_INT64_T: I
    MPI_DOUBLE: I
    MPI_SUM: I
    MPI_ANY_SOURCE: I
    MPI_F_SOURCE: I
    communicator: I
    rank: I
    ranks: I
    flag: I1
    message: L1
    status: L1
    fortran_status: I1
    next_tag: L1
    messages: L2


def cells_of_library(memory: Memory, comm: "MPI.Comm", MPI: ModuleType) -> dict[str, Cell]:
    """The cells of an `Mpi`, by the names of its fields.

    Args:
        memory: with `MessageRows`.
        comm: the communicator.
        MPI: mpi4py's module, which `ALONE` does not import.
    """
    values: dict[str, Any] = {
        "MPI_INT64_T": MPI.INT64_T.handle,
        "MPI_DOUBLE": MPI.DOUBLE.handle,
        "MPI_SUM": MPI.SUM.handle,
        "MPI_ANY_SOURCE": MPI.ANY_SOURCE,
        "MPI_F_SOURCE": MPI.F_SOURCE,
        "communicator": comm.handle,
        "rank": comm.rank,
        "ranks": comm.size,
        "status": np.zeros(-(-MPI._sizeof(MPI.Status) // 8), np.int64),
        "fortran_status": np.zeros(MPI.F_STATUS_SIZE, np.int32),
    }
    library = ctypes.CDLL(None)  # tried first, so that a preloaded library can intercept calls
    if not hasattr(library, "MPI_Init"):
        library = ctypes.CDLL(MPI.__file__)
    for name in Mpi._fields:
        if name.startswith("MPI_") and name not in values:
            values[name] = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
    return cells_of(memory, values)


def cells_of(memory: Memory, values: dict[str, Any]) -> dict[str, Cell]:
    """The cells of an `Mpi` with these numbers and arrays; 0 for others, which a single rank does
    not use, and for flags."""
    cells = {"messages": memory.cells["messages"]}
    for name, kind in annotations(Mpi).items():
        value = values.get(name, 0 if kind is I else np.zeros(1, kind.dtype))
        if name not in cells:
            cells[name] = Cell(kind, ctypes.c_int64(value).value if kind is I else value)
    return cells


@inlined
def new_request(messages):
    """Append a request; return the address for its handle."""
    append(messages, MESSAGES.requests, 0)
    return messages[MESSAGES.requests, ADDRESS] + 8 * (messages[MESSAGES.requests, LENGTH] - 1)


@inlined
def start(mpi, function, buffer, count, kind, rank, tag):
    """Start to send numbers to a rank, or to receive them from it.

    Args:
        function: mpi.MPI_Isend, MPI_Issend or MPI_Irecv.
        buffer: the address of the numbers.
        kind: mpi.MPI_INT64_T or MPI_DOUBLE.
    """
    request = new_request(mpi.messages)
    call(function, buffer, count, kind, rank, tag, mpi.communicator, request)


@inlined
def wait(mpi):
    """Wait until all messages that were started are complete."""
    messages = mpi.messages
    for k in range(messages[MESSAGES.requests, LENGTH]):
        call(mpi.MPI_Wait, messages[MESSAGES.requests, ADDRESS] + 8 * k, address(mpi.status))
    resize(messages, MESSAGES.requests, 0, 1)


@inlined
def all_complete(mpi):
    """Whether all messages that were started are complete."""
    messages, status = mpi.messages, address(mpi.status)
    for k in range(messages[MESSAGES.requests, LENGTH]):
        request = messages[MESSAGES.requests, ADDRESS] + 8 * k
        call(mpi.MPI_Test, request, address(mpi.flag), status)
        if not mpi.flag[0]:
            return False
    resize(messages, MESSAGES.requests, 0, 1)
    return True


@inlined
def add_up(mpi, numbers, sums):
    """Set `sums` to the sums over all ranks of float64 numbers; collective."""
    n, local, total = numbers.size, address(numbers), address(sums)
    if mpi.ranks > 1:
        call(mpi.MPI_Allreduce, local, total, n, mpi.MPI_DOUBLE, mpi.MPI_SUM, mpi.communicator)
    else:
        for k in range(n):
            sums[k] = numbers[k]


@inlined
def extend_received(messages, source, count):
    """Append a message of this many numbers from a rank; return the index of the first one."""
    begin = messages[MESSAGES.numbers, LENGTH]
    append(messages, MESSAGES.senders, source)
    append(messages, MESSAGES.sent, count)
    resize(messages, MESSAGES.numbers, begin + count, 1)
    return begin


@inlined
def receive(mpi):
    """Append the message that a probe has found to those that were received."""
    messages, status = mpi.messages, address(mpi.status)
    call(mpi.MPI_Get_count, status, mpi.MPI_INT64_T, address(mpi.flag))
    count = np.int64(mpi.flag[0])
    call(mpi.MPI_Status_c2f, status, address(mpi.fortran_status))
    source = np.int64(mpi.fortran_status[mpi.MPI_F_SOURCE])
    begin = extend_received(messages, source, count)
    buffer = messages[MESSAGES.numbers, ADDRESS] + 8 * begin
    call(mpi.MPI_Mrecv, buffer, count, mpi.MPI_INT64_T, address(mpi.message), status)


@inlined
def receive_own(mpi, part):
    """Append the part that this rank has for itself, without a message."""
    messages = mpi.messages
    begin = extend_received(messages, np.int64(mpi.rank), np.int64(part.size))
    numbers = longs_in(messages, MESSAGES.numbers)
    for k in range(part.size):
        numbers[begin + k] = part[k]


@inlined
def receive_from(mpi, sources, own):
    """Receive a part from each of these ranks, in their order; `own` is the part of this rank."""
    message, status = address(mpi.message), address(mpi.status)
    for r in range(sources.size):
        if sources[r] == mpi.rank:
            receive_own(mpi, own)
        else:
            call(mpi.MPI_Mprobe, sources[r], ANSWER, mpi.communicator, message, status)
            receive(mpi)
    wait(mpi)


@inlined
def receive_from_any(mpi, tag):
    """Receive all messages that ranks send to this one with this tag, by NBX; collective.

    A rank enters the barrier when all its messages are being received.  When all ranks have entered
    it, no message is left.  A rank that has left the barrier may already send its next messages,
    but not those after them, so two alternating tags suffice.
    """
    source, entered, done = mpi.MPI_ANY_SOURCE, False, False
    flag, message, status = address(mpi.flag), address(mpi.message), address(mpi.status)
    while not done:
        call(mpi.MPI_Improbe, source, tag, mpi.communicator, flag, message, status)
        if mpi.flag[0]:
            receive(mpi)
        elif all_complete(mpi):  # the barrier included, once this rank has entered it
            done = entered
            if not entered:
                call(mpi.MPI_Ibarrier, mpi.communicator, new_request(mpi.messages))
                entered = True


@inlined
def deliver(mpi, to, many, parts, sources, known):
    """Send a part to each of some ranks, and receive the parts for this rank; collective.

    The result is in the rows `senders`, `sent` and `numbers` of the messages.

    Args:
        to, many: (n,) destination ranks, and count of numbers for each; these may be `senders` and
            `sent` of the last call.
        parts: the numbers, rank by rank.
        sources: if known, the ranks that send to this one, in the order of the result.
        known: whether all ranks know their sources. If not, they are found, and the order of the
            result is arbitrary.
    """
    messages, begin, own, has_own = mpi.messages, 0, parts[:0], False
    function = mpi.MPI_Isend if known else mpi.MPI_Issend
    tag = ANSWER if known else QUESTION + mpi.next_tag[0]
    for row in (MESSAGES.senders, MESSAGES.sent, MESSAGES.numbers):
        resize(messages, row, 0, 1)
    for r in range(to.size):
        if to[r] == mpi.rank:
            own, has_own = parts[begin : begin + many[r]], True
        else:
            start(mpi, function, address(parts) + 8 * begin, many[r], mpi.MPI_INT64_T, to[r], tag)
        begin += many[r]
    if known:
        receive_from(mpi, sources, own)
    else:
        if has_own:
            receive_own(mpi, own)
        mpi.next_tag[0] = 1 - mpi.next_tag[0]
        receive_from_any(mpi, tag)


@loop
def deliver_parts(mpi: Mpi, to: L1, many: L1, parts: L1, sources: L1, known: I):
    """`deliver`."""
    deliver(mpi, to, many, parts, sources, known)
