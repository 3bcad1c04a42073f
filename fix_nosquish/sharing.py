"""Bodies held by several ranks: who shares, what follows the atoms, one exchange a step.

Every rank that owns an atom of a body keeps that body's whole state.  Each step the
sharing ranks send each other their partial force and torque and add the parts up in
the order of their ranks, so that all copies of a body stay equal to the last bit and
no rank is the body's master.  Ghost atoms play no part.

What a rank sends and keeps depends on its own bodies and on the ranks that share them,
not on how many bodies or ranks there are: messages go to the ranks that they are for,
and these learn that no more will come from a barrier (`World.deliver`).

`Alone` is the world of a run on one rank: nothing is shared, mpi4py is not imported.
`World` is the world of several ranks.  All methods of both are collective.
"""

import ctypes
from itertools import count

import numpy as np

from . import packing
from .errors import RunError

_BITS = 32  # an atom's origin is rank << 32 | place
_QUESTIONS, _ANSWERS, _PARTS = (0, 1), 2, 3  # tags of messages


def origin(rank, places):
    """The origins, int64, of atoms that have these places in a rank's list of bodies' atoms."""
    return np.int64(rank << _BITS) | places


class Alone:
    """One rank: every method gives back what it was given."""

    size, rank = 1, 0

    def agree(self, problem):
        """End the run if there is a problem (a message, or None for none)."""
        if problem:
            raise RunError(problem, everywhere=True)

    def total(self, values):
        """Sum of an array over all ranks, as float64."""
        return np.asarray(values, float)

    def any(self, flag):
        """Whether `flag` is true on any rank."""
        return flag

    def gather(self, rows):
        """All ranks' rows."""
        return rows

    gather_to_all = share = gather

    def look_up(self, keys, values, wanted):
        """As `World.look_up`; what this rank has it need not ask for."""
        return np.full(len(wanted), -1)

    def fetch(self, origins, lost, rows_of):
        """As `World.fetch`; no atom can have come."""
        return rows_of(lost[:0]), lost

    def sharers(self, n, places, ids, home):
        """As `World.sharers`; nobody else holds bodies."""
        return Sharers.none(n)


class World:
    """Several ranks: LAMMPS's, with a communicator of our own, so that no message is taken for one of LAMMPS's.

    Args:
        comm: the Fortran handle of LAMMPS's communicator, as its library gives it.
    """

    _attribute = None  # under which LAMMPS's communicator keeps ours, and frees it when it is freed

    def __init__(self, comm):
        from mpi4py import MPI

        if World._attribute is None:
            World._attribute = MPI.Comm.Create_keyval(delete_fn=lambda comm, key, ours: ours[0].Free())
        theirs = MPI.Comm.f2py(comm)
        if not theirs.Get_attr(World._attribute):
            theirs.Set_attr(World._attribute, (theirs.Dup(), count()))
        self.comm, self._rounds = theirs.Get_attr(World._attribute)
        self.mpi, self.size, self.rank = MPI, self.comm.size, self.comm.rank
        self._number, self._status = np.empty(1, np.int64), MPI.Status()

    def _reduce(self, number, operation):
        self._number[0] = number
        self.comm.Allreduce(self.mpi.IN_PLACE, self._number, operation)
        return int(self._number[0])

    def agree(self, problem):
        """End the run on all ranks, with the first rank's message, if any rank has a problem."""
        first = self._reduce(self.rank if problem else self.size, self.mpi.MIN)
        if first < self.size:
            raise RunError(self.comm.bcast(problem, root=first), everywhere=True)

    def total(self, values):
        """Sum of an array over all ranks, as float64."""
        result = np.array(values, float)
        self.comm.Allreduce(self.mpi.IN_PLACE, result)
        return result

    def any(self, flag):
        """Whether `flag` is true on any rank."""
        return bool(self._reduce(bool(flag), self.mpi.MAX))

    def share(self, rows):
        """Rank 0's rows, for all ranks."""
        return self.comm.bcast(rows)

    def gather(self, rows):
        """All ranks' rows, in the order of the ranks, on rank 0; elsewhere None."""
        parts = self.comm.gather(rows)
        return None if parts is None else np.concatenate(parts)

    def gather_to_all(self, rows):
        """All ranks' rows, in the order of the ranks, on every rank."""
        return np.concatenate(self.comm.allgather(rows))

    def abort(self):
        """End the run on all ranks, now."""
        self.comm.Abort(1)

    def deliver(self, parts, dtype, sources=None):
        """Send an array to each of some ranks: one message to each.

        Args:
            parts: dictionary from ranks to C-contiguous arrays.  dtype: theirs, int64 or float64, alike on all ranks.
            sources: the ranks that send something to this one, if all ranks know theirs; else they are found out.
        Returns:
            dictionary from the ranks that sent something to this one, in their order, to flat arrays.
        """
        received = {}
        send, tag = self.comm.Isend, _ANSWERS
        if sources is None:
            send, tag = self.comm.Issend, _QUESTIONS[next(self._rounds) % 2]
        sent = [send(part, rank, tag) for rank, part in parts.items() if rank != self.rank]
        if self.rank in parts:
            received[self.rank] = parts[self.rank].ravel()

        def receive(message):
            part = received[self._status.source] = np.empty(self._status.Get_count(self.mpi.BYTE) // 8, dtype)
            message.Recv(part)

        if sources is not None:
            for rank in sources:
                if rank != self.rank:
                    receive(self.comm.Mprobe(rank, tag, self._status))
            self.mpi.Request.Waitall(sent)
        else:
            # A rank enters the barrier when all it sent is being received: when all have, there is nothing more to
            # come.  Ranks ahead of this one may be in the next round by then, but not in the one after it: two tags do.
            barrier = None
            while not (barrier and barrier.Test()):
                message = self.comm.Improbe(self.mpi.ANY_SOURCE, tag, self._status)
                if message:
                    receive(message)
                elif not barrier and self.mpi.Request.Testall(sent):
                    barrier = self.comm.Ibarrier()
        return dict(sorted(received.items()))

    def ask(self, to, questions, answer):
        """Ask other ranks, and answer what they ask.

        Args:
            to: (m,) int64, the rank that is asked each question.  questions: (m,) int64.
            answer: a function of the questions (k,) to this rank, which gives (k, width) numbers.
        Returns:
            (m, width) the answers to this rank's questions.
        """
        order = np.argsort(to, kind="stable")
        parts = _split(to[order], questions[order])
        asked = self.deliver(parts, np.int64)
        answers = np.ascontiguousarray(answer(_join(asked.values(), np.int64)))
        end = 0
        back = {rank: answers[end : (end := end + len(part))] for rank, part in asked.items()}
        result = np.empty((len(to), answers.shape[1]), answers.dtype)
        result[order] = _join(self.deliver(back, answers.dtype, parts).values(), answers.dtype).reshape(result.shape)
        return result

    def look_up(self, keys, values, wanted):
        """Ask all ranks for values, through a directory that is spread over them.

        Args:
            keys: (n,) int64, each on one rank only.  values: (n,) int64.  wanted: (m,) keys.
        Returns:
            (m,) the values of these keys, -1 for a key that no rank has.
        """
        order = np.argsort(keys % self.size, kind="stable")
        told = self.deliver(_split((keys % self.size)[order], np.stack([keys, values], axis=1)[order]), np.int64)
        known = dict(_join(told.values(), np.int64).reshape(-1, 2).tolist())

        def answer(asked):
            return np.array([known.get(key, -1) for key in asked.tolist()], np.int64)[:, None]

        return self.ask(wanted % self.size, wanted, answer)[:, 0]

    def fetch(self, origins, lost, rows_of):
        """Bring each gained atom what the rank that lost it knew of it.

        Args:
            origins: (m,) int64, where each atom gained was before: a rank, not this one, and the atom's place there.
            lost: (k,) places of atoms that this rank no longer has.
            rows_of: a function of (n,) places that gives (n, width) float64, what goes with these atoms.
        Returns:
            (m, width) rows, in the order of origins; (l,) the places of lost atoms that no rank gained.
        """
        missing = lost

        def answer(places):
            nonlocal missing
            # an atom is on one rank: if as many are asked for as are lost, they are the same
            missing = lost[:0] if len(places) == len(lost) else np.setdiff1d(lost, places)
            return rows_of(places)

        return self.ask(origins >> _BITS, origins & ((1 << _BITS) - 1), answer), missing

    def sharers(self, n, places, ids, home):
        """Find who else holds some of this rank's bodies.

        Args:
            n: how many bodies this rank has.
            places: (m,) those that it does not know to be whole here.
            ids: (m,) int64, their IDs, each once.
            home: (m,) int64, the rank at which all holders of each body meet: any on which they agree.
        """
        # in an order on which two holders of the same bodies agree
        order = np.lexsort((ids, home))
        questions = _split(home[order], ids[order])
        answers = self.deliver(_holders(self.deliver(questions, np.int64)), np.int64, questions)
        return Sharers(self, n, places[order], [len(part) for part in questions.values()], _join(answers.values(), np.int64))


def _split(keys, rows):
    """The rows of each key, a dictionary; keys are sorted."""
    bounds = [0, *(np.flatnonzero(keys[1:] != keys[:-1]) + 1).tolist(), len(keys)]
    return {int(keys[a]): rows[a:b] for a, b in zip(bounds, bounds[1:]) if a < b}


def _join(parts, dtype):
    """One flat array after the other."""
    return np.concatenate([np.empty(0, dtype), *parts])


def _holders(asked):
    """What to answer ranks (keys) that ask who holds bodies; see `packing.answer`."""
    ids = _join(asked.values(), np.int64)
    order, bounds = np.argsort(ids, kind="stable"), np.cumsum([0, *map(len, asked.values())], dtype=np.int64)
    (first, many), ends = np.empty((2, len(ids)), np.int64), np.empty(len(asked) + 1, np.int64)
    answers = np.empty(packing.meet(ids, order, first, many), np.int64)
    packing.answer(ids, order, first, many, bounds, np.array([*asked], np.int64), answers, ends)
    ends = ends.tolist()
    return {rank: answers[begin:end] for rank, begin, end in zip(asked, ends, ends[1:])}


class Sharers:
    """The bodies of this rank that other ranks hold too.

    Args:
        world: the `World` or `Alone`.
        n: number of bodies on this rank.
        places: (k,) the places of those that may be shared, in an order on which holders of the same bodies agree.
        asked: how many of these each rank was asked for.  answers: what these ranks answered; see `packing.connect`.

    Attributes:
        bodies: (m,) places of the shared bodies in this rank's list of bodies.
        owned: (n,) bool, whether this rank is the lowest of those that hold the body:
            what has to be counted once is counted there.
        home: (n,) that lowest rank.
    """

    def __init__(self, world, n, places, asked, answers):
        self.home = np.full(n, world.rank)
        partners, counts, self._source, sent = np.empty((4, len(answers)), np.int64)
        bodies, self._first = np.empty(len(places), np.int64), np.zeros(len(places) + 1, np.int64)
        sizes = np.empty(2, np.int64)
        packing.connect(places, np.array(asked, np.int64), answers, world.rank, self.home, partners, counts, bodies, self._first, self._source, sent, sizes)
        shared, others = sizes.tolist()
        self.bodies, self.owned = bodies[:shared], self.home == world.rank
        self._partners, self._counts = partners[:others].tolist(), counts[:others].tolist()
        self._sent = sent[: sum(self._counts)]
        self._world, self._values, self._links = world, None, {}

    @classmethod
    def none(cls, n):
        """No body is shared."""
        none = np.empty(0, np.int64)
        return cls(Alone(), n, none, [], none)

    def combine(self, values, operation=np.add):
        """Combine the ranks' parts of shared bodies, in place: one exchange.

        Args:
            values: (components, n) float64, contiguous: this rank's parts; bodies that are not shared stay as they are.
            operation: numpy.add, maximum or minimum.
        """
        if not len(self.bodies):
            return
        self._bind(values)
        self._pack()
        self._link.exchange()
        if operation is np.add:
            self._add()
        else:
            parts = np.concatenate([self._link.received.reshape(-1, len(values)).T, values[:, self.bodies]], axis=1)
            first = self._first[: len(self.bodies) + 1]
            source, own = self._source[: first[-1]], len(self._sent) + np.repeat(np.arange(len(self.bodies)), np.diff(first))
            values[:, self.bodies] = operation.reduceat(parts[:, np.where(source < 0, own, source)], first[:-1], axis=1)

    def passes(self, values):
        """`combine(values)` as passes, for others to do in this order: loops, and the exchange between them; no pass if nothing is shared."""
        if not len(self.bodies):
            return []
        self._bind(values)
        return [self._pack, self._link, self._add]

    def _bind(self, values):
        if values is self._values:
            return
        rows = len(values)
        if rows not in self._links:
            self._links[rows] = _Link(self._world, rows, self._partners, self._counts)
        self._values, self._link = values, self._links[rows]
        self._pack = packing.pack.bind(values, self._sent, self._link.sent)
        self._add = packing.add.bind(values, self.bodies, self._first, self._source, self._link.received)


class _Link:
    """A connection to other ranks that carries the same amount of numbers each time.

    Args:
        world: the `World`.
        rows: how many numbers go with each body.
        partners: the other ranks.  counts: how many bodies are shared with each.

    Attributes:
        sent, received: the numbers, flat, rank by rank.
        requests: the persistent requests.
    """

    def __init__(self, world, rows, partners, counts):
        self.sent, self.received = np.empty((2, rows * sum(counts)))
        self._mpi, self.requests, end = world.mpi, [], 0
        for rank, count in zip(partners, counts):
            part = slice(end, end := end + rows * count)
            self.requests.append(world.comm.Recv_init(self.received[part], rank, _PARTS))
            self.requests.append(world.comm.Send_init(self.sent[part], rank, _PARTS))

    def exchange(self):
        """Send what stands in `sent` and fill `received`."""
        self._mpi.Prequest.Startall(self.requests)
        self._mpi.Request.Waitall(self.requests)

    def handles(self):
        """The requests as MPI has them, one after the other, in a buffer."""
        return ctypes.create_string_buffer(b"".join(ctypes.string_at(self._mpi._addressof(one), self._mpi._sizeof(one)) for one in self.requests))

    def __del__(self):
        if not self._mpi.Is_finalized():
            for request in self.requests:
                request.Free()
