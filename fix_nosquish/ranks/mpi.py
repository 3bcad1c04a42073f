"""MPI for compiled loops: they call the functions of the MPI library by their addresses.

So the same code shares bodies and follows atoms whether the plugin runs the loops or Python does,
for LAMMPS's own fix python/move.  Messages in the plugin would delete nothing: without a plugin
they would still be needed here.  mpi4py gives the handles and constants of the MPI library.
"""

import ctypes
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..loops.compiled import I1, L1, L2, Cell, I, address, call, inlined, longs, loop
from ..loops.memory import LENGTH, PLACE, Memory, append, ints_in, longs_in, place_of, resize, rows

if TYPE_CHECKING:
    from mpi4py import MPI

QUESTION, ANSWER, PART = 1, 3, 4  # tags of messages; QUESTION + 1 is one, too


class MessageRows(NamedTuple):
    """Rows of the memory for messages.

    Attributes:
        requests: of the messages that are under way.
        senders, sent, numbers: what has come: from whom, how many numbers from each, and these.
        flag, message, status, fortran_status: where MPI writes a flag or a count, the handle of a
            message, its status, and the status as Fortran has it.
        next_tag: (1,) which of two tags the next round of questions has.
    """

    requests: L1
    senders: L1
    sent: L1
    numbers: L1
    flag: I1
    message: L1
    status: L1
    fortran_status: I1
    next_tag: L1


MESSAGES = rows(MessageRows)


class Mpi(NamedTuple):
    """What loops need to call MPI.

    Attributes:
        MPI_...: addresses of its functions, and what else has these names in C.
        communicator: the handle of ours.
        rank, ranks: which one this is, and how many there are.
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
    messages: L2


def of_library(memory: Memory, comm: "MPI.Comm", MPI: ModuleType) -> dict[str, Cell]:
    """The cells of an `Mpi`, by the names of its fields.

    Args:
        memory: with `MessageRows`.  comm: the communicator.  MPI: mpi4py's module.
    """
    for name in "flag", "message", "next_tag":
        memory.put(name, [0])
    memory.put("status", np.zeros(-(-MPI._sizeof(MPI.Status) // 8)))
    memory.put("fortran_status", np.zeros(MPI.F_STATUS_SIZE))
    values = {
        "MPI_INT64_T": MPI.INT64_T.handle,
        "MPI_DOUBLE": MPI.DOUBLE.handle,
        "MPI_SUM": MPI.SUM.handle,
        "MPI_ANY_SOURCE": MPI.ANY_SOURCE,
        "MPI_F_SOURCE": MPI.F_SOURCE,
        "communicator": comm.handle,
        "rank": comm.rank,
        "ranks": comm.size,
    }
    library = ctypes.CDLL(None)  # with what stands before it, as a tool that counts calls
    if not hasattr(library, "MPI_Init"):
        library = ctypes.CDLL(MPI.__file__)
    for name in set(Mpi._fields) - set(values) - {"messages"}:
        values[name] = place_of(getattr(library, name))
    return cells_of(memory, values)


def cells_of(memory: Memory, values: dict[str, int]) -> dict[str, Cell]:
    """The cells of an `Mpi` with these numbers; what is not there is 0, as of one rank."""
    numbers = {name: ctypes.c_int64(values.get(name, 0)).value for name in Mpi._fields}
    cells = {name: Cell(I, number) for name, number in numbers.items()}
    return cells | {"messages": memory.cells["messages"]}


@inlined
def new_request(messages):
    """Where MPI writes the handle of one more message that is under way."""
    append(messages, MESSAGES.requests, 0)
    return messages[MESSAGES.requests, PLACE] + 8 * (messages[MESSAGES.requests, LENGTH] - 1)


@inlined
def send(mpi, function, place, count, kind, rank, tag):
    """Begin to send so many numbers from this place in memory to a rank, or to receive them there.

    Args:
        function: mpi.MPI_Isend, MPI_Issend or MPI_Irecv.  kind: mpi.MPI_INT64_T or MPI_DOUBLE.
    """
    here = new_request(mpi.messages)
    call(function, place, count, kind, rank, tag, mpi.communicator, here)


@inlined
def wait(mpi):
    """Wait until all messages that are under way are there."""
    messages = mpi.messages
    for k in range(messages[MESSAGES.requests, LENGTH]):
        here = messages[MESSAGES.requests, PLACE] + 8 * k
        call(mpi.MPI_Wait, here, messages[MESSAGES.status, PLACE])
    resize(messages, MESSAGES.requests, 0, 1)


@inlined
def all_there(mpi):
    """Whether all messages that are under way are there."""
    messages = mpi.messages
    flag = ints_in(messages, MESSAGES.flag)
    for k in range(messages[MESSAGES.requests, LENGTH]):
        here = messages[MESSAGES.requests, PLACE] + 8 * k
        call(mpi.MPI_Test, here, address(flag), messages[MESSAGES.status, PLACE])
        if not flag[0]:
            return False
    resize(messages, MESSAGES.requests, 0, 1)
    return True


@inlined
def add_up(mpi, numbers, sums):
    """The sums over all ranks of each of these float64 numbers."""
    n, here, there = numbers.size, address(numbers), address(sums)
    if mpi.ranks > 1:
        call(mpi.MPI_Allreduce, here, there, n, mpi.MPI_DOUBLE, mpi.MPI_SUM, mpi.communicator)
    else:
        for k in range(n):
            sums[k] = numbers[k]


@inlined
def expect(messages, source, count):
    """Have room for so many numbers from this rank, behind those that have come. Returns: where."""
    begin = messages[MESSAGES.numbers, LENGTH]
    append(messages, MESSAGES.senders, source)
    append(messages, MESSAGES.sent, count)
    resize(messages, MESSAGES.numbers, begin + count, 1)
    return messages[MESSAGES.numbers, PLACE] + 8 * begin


@inlined
def keep(mpi, part):
    """Receive the part that this rank has for itself, if it has any."""
    if part.size:
        numbers = longs(expect(mpi.messages, mpi.rank, part.size), part.size)
        for k in range(part.size):
            numbers[k] = part[k]


@inlined
def receive(mpi):
    """Receive the message that was probed."""
    messages = mpi.messages
    flag, status = ints_in(messages, MESSAGES.flag), messages[MESSAGES.status, PLACE]
    call(mpi.MPI_Get_count, status, mpi.MPI_INT64_T, address(flag))
    count, fortran = np.int64(flag[0]), ints_in(messages, MESSAGES.fortran_status)
    call(mpi.MPI_Status_c2f, status, address(fortran))
    place = expect(messages, np.int64(fortran[mpi.MPI_F_SOURCE]), count)
    call(mpi.MPI_Mrecv, place, count, mpi.MPI_INT64_T, messages[MESSAGES.message, PLACE], status)


@inlined
def receive_from(mpi, sources, own):
    """Receive a part from each of these ranks, in their order; own is that of this rank."""
    messages = mpi.messages
    message, status = messages[MESSAGES.message, PLACE], messages[MESSAGES.status, PLACE]
    for r in range(sources.size):
        if sources[r] == mpi.rank:
            keep(mpi, own)
        else:
            call(mpi.MPI_Mprobe, sources[r], ANSWER, mpi.communicator, message, status)
            receive(mpi)
    wait(mpi)


@inlined
def receive_all(mpi, tag):
    """Receive what any ranks send to this one with this tag, until all that was sent is there;
    collective.

    A rank enters the barrier when all it sent is being received: when all have, there is nothing
    more to come.  Ranks ahead of this one may be in the next round by then, but not in the one
    after it: two tags do.
    """
    messages, source, entered, over = mpi.messages, mpi.MPI_ANY_SOURCE, False, False
    flag, message = ints_in(messages, MESSAGES.flag), messages[MESSAGES.message, PLACE]
    status = messages[MESSAGES.status, PLACE]
    while not over:
        call(mpi.MPI_Improbe, source, tag, mpi.communicator, address(flag), message, status)
        if flag[0]:
            receive(mpi)
        elif all_there(mpi):  # with the barrier, once this rank has entered it
            over = entered
            if not entered:
                call(mpi.MPI_Ibarrier, mpi.communicator, new_request(messages))
                entered = True


@inlined
def deliver(mpi, to, many, parts, sources, known):
    """Send a part to each of some ranks, and receive what others send to this one; collective.

    What has come is in `senders`, `sent` and `numbers` of the messages.

    Args:
        to, many: (n,) the ranks, and how many numbers go to each; they may be those of `senders`.
        parts: the numbers.
        sources: the ranks that send something to this one, if they are known; the parts come in
            their order then.  Else they are found, and come in any.
    """
    messages, begin, own = mpi.messages, 0, parts[:0]
    next_tag = longs_in(messages, MESSAGES.next_tag)
    function = mpi.MPI_Isend if known else mpi.MPI_Issend
    tag = ANSWER if known else QUESTION + next_tag[0]
    for row in (MESSAGES.senders, MESSAGES.sent, MESSAGES.numbers):
        resize(messages, row, 0, 1)
    for r in range(to.size):
        part = parts[begin : begin + many[r]]
        if to[r] == mpi.rank:
            own = part
        else:
            send(mpi, function, address(part), part.size, mpi.MPI_INT64_T, to[r], tag)
        begin += many[r]
    if known:
        receive_from(mpi, sources, own)
    else:
        next_tag[0] = 1 - next_tag[0]
        keep(mpi, own)
        receive_all(mpi, tag)


@loop
def deliver_parts(mpi: Mpi, to: L1, many: L1, parts: L1, sources: L1, known: I):
    """`deliver`."""
    deliver(mpi, to, many, parts, sources, known)
