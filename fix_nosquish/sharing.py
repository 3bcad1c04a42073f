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

from itertools import count

import numpy as np

from . import packing
from .compiled import F1, F2, I, L1, Cell
from .errors import RunError

_BITS = 32  # an atom's origin is rank << 32 | place
_QUESTIONS, _ANSWERS, _PARTS = (0, 1), 2, 3  # tags of messages
_LOAD = 6  # numbers of a body's force and torque


def origin(rank, places):
    """The origins, int64, of atoms that have these places in a rank's list of bodies' atoms."""
    return np.int64(rank << _BITS) | places


def places(origins):
    """The places in these origins."""
    return origins & ((1 << _BITS) - 1)


class Alone:
    """One rank: every method gives back what it was given."""

    size, rank, handle = 1, 0, 0

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

    def fetch(self, origins, rows_of):
        """As `World.fetch`; no atom can have come."""
        return rows_of(origins)

    def gone(self, lost, gained):
        """As `World.gone`."""
        return lost


ALONE = Alone()


class World:
    """Several ranks: LAMMPS's, with a communicator of our own, so that no message is taken for one of LAMMPS's.

    Args:
        comm: the Fortran handle of LAMMPS's communicator, as its library gives it.
    """

    _attribute = None  # under which LAMMPS's communicator keeps ours, and frees it when it is freed

    def __init__(self, comm):
        from mpi4py import MPI

        if World._attribute is None:
            World._attribute = MPI.Comm.Create_keyval(
                delete_fn=lambda comm, key, ours: ours[0].Free()
            )
        theirs = MPI.Comm.f2py(comm)
        if not theirs.Get_attr(World._attribute):
            theirs.Set_attr(World._attribute, (theirs.Dup(), count()))
        self.comm, self._rounds = theirs.Get_attr(World._attribute)
        self.mpi, self.size, self.rank, self.handle = (
            MPI,
            self.comm.size,
            self.comm.rank,
            self.comm.py2f(),
        )
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
            part = received[self._status.source] = np.empty(
                self._status.Get_count(self.mpi.BYTE) // 8, dtype
            )
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
        result[order] = _join(
            self.deliver(back, answers.dtype, parts).values(), answers.dtype
        ).reshape(result.shape)
        return result

    def look_up(self, keys, values, wanted):
        """Ask all ranks for values, through a directory that is spread over them.

        Args:
            keys: (n,) int64, each on one rank only.  values: (n,) int64.  wanted: (m,) keys.
        Returns:
            (m,) the values of these keys, -1 for a key that no rank has.
        """
        order = np.argsort(keys % self.size, kind="stable")
        told = self.deliver(
            _split((keys % self.size)[order], np.stack([keys, values], axis=1)[order]), np.int64
        )
        known = dict(_join(told.values(), np.int64).reshape(-1, 2).tolist())

        def answer(asked):
            return np.array([known.get(key, -1) for key in asked.tolist()], np.int64)[:, None]

        return self.ask(wanted % self.size, wanted, answer)[:, 0]

    def fetch(self, origins, rows_of):
        """Ask for what the ranks that lost atoms know of them.

        Args:
            origins: (m,) int64, where each atom gained was before: a rank, not this one, and the atom's place there.
            rows_of: a function of (n,) places that gives (n, width) float64, what goes with these atoms.
        Returns:
            (m, width) rows, in the order of origins.
        """
        return self.ask(origins >> _BITS, places(origins), rows_of)

    def gone(self, lost, gained):
        """Which of the places of lost atoms are of atoms that no rank has.

        Args:
            lost: (k,) places of atoms that this rank no longer has.  gained: origins of atoms from other ranks.
        """
        gained = np.sort(gained)
        told = self.deliver(_split(gained >> _BITS, places(gained)), np.int64)
        return np.setdiff1d(lost, _join(told.values(), np.int64))

    def exchange(self, partners, counts, sent, received):
        """Begin to send each partner its part, and to fill `received` with what they send.

        Args:
            partners: the ranks.  counts: how many numbers each sends and receives.
            sent, received: the parts, one after the other.
        Returns:
            a function that waits for the end of it.
        """
        requests, end = [], 0
        for rank, n in zip(partners, counts):
            part = slice(end, end := end + n)
            requests += [
                self.comm.Irecv(received[part], rank, _PARTS),
                self.comm.Isend(sent[part], rank, _PARTS),
            ]
        return lambda: self.mpi.Request.Waitall(requests)


def _split(keys, rows):
    """The rows of each key, a dictionary; keys are sorted."""
    bounds = [0, *(np.flatnonzero(keys[1:] != keys[:-1]) + 1).tolist(), len(keys)]
    return {int(keys[a]): rows[a:b] for a, b in zip(bounds, bounds[1:]) if a < b}


def _join(parts, dtype):
    """One flat array after the other."""
    return np.concatenate([np.empty(0, dtype), *parts])


class Delivery:
    """`World.deliver` of int64, as a pass: what to send, and what has come, is in cells (see `compiled.Cell`).

    Args:
        world: the `World`.
        to, many, parts: the ranks, how many numbers go to each, and the numbers, one after the other.  ranks: how many ranks.
        senders, sent, numbers: out: the same of what has come.
        sources, of: the ranks that send something to this one, and their number; None if they are to be found out.
    """

    def __init__(
        self, world, to, many, parts, ranks, senders, sent, numbers, sources=None, of=None
    ):
        self.world = world
        self.cells = [
            to,
            many,
            parts,
            ranks,
            senders,
            sent,
            numbers,
            *([sources, of] if sources else []),
        ]

    def __call__(self):
        """Send and receive."""
        to, many, parts, ranks, senders, sent, numbers, *known = self.cells
        n = ranks.number
        ends = np.cumsum(many.array[:n])
        outgoing = dict(
            zip(to.array[:n].tolist(), np.split(parts.array[: ends[-1] if n else 0], ends[:-1]))
        )
        got = self.world.deliver(
            outgoing, np.int64, known[0].array[: known[1].number].tolist() if known else None
        )
        senders.set(np.array([*got], np.int64))
        sent.set(np.array([len(part) for part in got.values()], np.int64))
        numbers.set(_join(got.values(), np.int64))
        return 0


class Exchange:
    """`World.exchange`, as a pass: all that it takes is in cells.  Its end is another pass, `Completion`.

    Args:
        world: the `World`.
        partners, shares: the other ranks, and how many bodies are shared with each.  ranks: how many partners.
        rows: how many numbers go with each body.
        sent, received: the numbers.
    """

    def __init__(self, world, partners, shares, ranks, rows, sent, received):
        self.world = world
        self.cells = [partners, shares, ranks, rows, sent, received]

    def __call__(self):
        """Begin to send and receive."""
        partners, shares, ranks, rows, sent, received = self.cells
        n = ranks.number
        self.wait = self.world.exchange(
            partners.array[:n].tolist(),
            (rows.number * shares.array[:n]).tolist(),
            sent.array,
            received.array,
        )


class Completion:
    """The end of an `Exchange`, as a pass."""

    def __init__(self, exchange):
        self.exchange, self.world, self.cells = exchange, exchange.world, []

    def __call__(self):
        """Wait until all is sent and received."""
        self.exchange.wait()


class Agreement:
    """The sums over all ranks of what `kernels.locate` has found, up to MOVED, as a pass.

    Args:
        world: the `World` or `Alone`.  found: the `Cell` of these numbers.
    """

    def __init__(self, world, found):
        self.world, self.cells = world, [found]

    def total(self):
        """The sums, a list; collective."""
        return self.world.total(self.cells[0].array).astype(int).tolist()


# arrays of `Sharers`, with an entry for each body of this rank, or for each number that is answered or received
_OF_BODIES = (
    "asked",
    "ids",
    "meet",
    "order",
    "spare",
    "places",
    "questions",
    "homes",
    "many",
    "home",
    "bodies",
    "first",
)
_OF_ANSWERS = (
    "sorted",
    "work",
    "owner",
    "equal",
    "answers",
    "parts",
    "partners",
    "shares",
    "source",
    "sent",
)
_RECEIVED = "askers", "wanted", "wanted_ids", "answerers", "answered", "holders"


class Sharers:
    """The bodies of this rank that other ranks hold too.

    Args:
        world: the `World` or `Alone`.
        load: the `Cell` of force and torque (6, n), which `add` adds up.

    Attributes:
        bodies: (m,) places of the shared bodies in this rank's list of bodies.
        home: (n,) the lowest rank of those that hold each body.
        owned: (n,) bool, whether this rank is it: what has to be counted once is counted there.
        cells: dictionary from names to `compiled.Cell`; of interest to others: asked, ids, meet, home, bodies, counts.
        counts: numbers; see `packing`.
        finding: the passes that find the sharers of the bodies in asked, ids and meet; a loop that lacks room returns 1.
        giving, taking: the passes that do `combine(load)`, between which nothing may change it for shared bodies.  All lists are
            empty on one rank.
    """

    def __init__(self, world, load=None):
        self._world, self.counts = world, np.zeros(packing.COUNTS, np.int64)
        self.cells = cells = {name: Cell(L1) for name in (*_OF_BODIES, *_OF_ANSWERS, *_RECEIVED)}
        cells |= {
            "counts": Cell(L1, self.counts),
            "load": load or Cell(F2),
            "packed": Cell(F1),
            "received": Cell(F1),
        }
        self._bodies = self._numbers = -1  # for how many there is room
        self.finding, self.giving, self.taking = [], [], []
        if world.size == 1:
            return
        homes, partners = (
            Cell(I, numbers=self.counts[k : k + 1]) for k in (packing.HOMES, packing.PARTNERS)
        )
        questions = Delivery(
            world,
            cells["homes"],
            cells["many"],
            cells["questions"],
            homes,
            *(cells[name] for name in _RECEIVED[:3]),
        )
        answers = Delivery(world, cells["askers"], cells["parts"], cells["answers"], Cell(I, numbers=cells["askers"].numbers[1:]),
                           *(cells[name] for name in _RECEIVED[3:]), cells["homes"], homes)  # fmt: skip
        self.finding = [
            packing.ask.bind_to(cells, home=cells["meet"]),
            questions,
            packing.answer.bind_to(cells, ids=cells["wanted_ids"], asked=cells["wanted"], order=cells["sorted"], spare=cells["work"],
                                   first=cells["equal"]),
            answers,
            packing.connect.bind_to(cells, answers=cells["holders"], own=world.rank),
        ]  # fmt: skip
        rows = Cell(I, _LOAD)
        exchange = Exchange(
            world,
            cells["partners"],
            cells["shares"],
            partners,
            rows,
            cells["packed"],
            cells["received"],
        )
        self.giving = [packing.pack.bind_to(cells, values=cells["load"]), exchange]
        self.taking = [Completion(exchange), packing.add.bind_to(cells, values=cells["load"])]

    def make_room(self, bodies=0, numbers=0):
        """Make room for so many bodies, and for so many numbers of what is answered, which is lost."""
        if bodies > self._bodies:
            self._bodies = bodies
            for name in _OF_BODIES:
                old, new = self.cells[name].array, np.empty(bodies + 1, np.int64)
                new[: len(old)] = old
                self.cells[name].set(new)
        if numbers > self._numbers:
            self._numbers = numbers
            for name in _OF_ANSWERS:
                self.cells[name].set(np.empty(numbers, np.int64))
            for name in "packed", "received":
                self.cells[name].set(np.empty(_LOAD * numbers))

    def find(self, n, places, ids, home):
        """Find who else holds some of this rank's bodies; collective.

        Args:
            n: how many bodies this rank has.
            places: (m,) those that it does not know to be whole here.
            ids: (m,) int64, their IDs, each once.
            home: (m,) int64, the rank at which all holders of each body meet: any on which they agree.
        Returns:
            Sharers: self.
        """
        m = len(places)
        self.make_room(n)
        for name, values in ("asked", places), ("ids", ids), ("meet", home):
            self.cells[name].array[:m] = values
        self.none(n)
        self.counts[packing.ASKED] = m
        for one in self.finding:
            self.do(one)
        return self

    def do(self, one):
        """Do one of the passes `finding`, and make the room that it lacks."""
        while one():
            self.make_room(numbers=2 * int(self.counts[packing.NEEDED]))

    def none(self, n):
        """There are n bodies, and nobody else holds them."""
        self.make_room(n)
        self.cells["home"].array[:] = self._world.rank
        self.counts[[packing.BODIES, packing.KNOWN]] = n, 1

    @property
    def bodies(self):
        return self.cells["bodies"].array[: self.counts[packing.SHARED]]

    @property
    def home(self):
        return self.cells["home"].array[: self.counts[packing.BODIES]]

    @property
    def owned(self):
        return self.home == self._world.rank

    def add(self):
        """`combine(load)`, bound."""
        for one in (*self.giving, *self.taking):
            one()

    def combine(self, values, operation=np.add):
        """Combine the ranks' parts of shared bodies, in place: one exchange.

        Args:
            values: (components, n) float64, contiguous: this rank's parts; bodies that are not shared stay as they are.
            operation: numpy.add, maximum or minimum.
        """
        shared, ranks, n = self.counts[[packing.SHARED, packing.PARTNERS, packing.SENT]].tolist()
        if not shared:
            return
        cells, rows = self.cells, len(values)
        sent, received = np.empty((2, rows * n))
        packing.pack(values, cells["sent"], sent, self.counts)
        partners, shares = (cells[name].array[:ranks] for name in ("partners", "shares"))
        self._world.exchange(partners.tolist(), (rows * shares).tolist(), sent, received)()
        if operation is np.add:
            packing.add(
                values, cells["bodies"], cells["first"], cells["source"], received, self.counts
            )
        else:
            parts = np.concatenate([received.reshape(-1, rows).T, values[:, self.bodies]], axis=1)
            first = cells["first"].array[: shared + 1]
            source, own = (
                cells["source"].array[: first[-1]],
                n + np.repeat(np.arange(shared), np.diff(first)),
            )
            values[:, self.bodies] = operation.reduceat(
                parts[:, np.where(source < 0, own, source)], first[:-1], axis=1
            )
