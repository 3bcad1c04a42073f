"""Bodies held by several ranks: who shares, what follows the atoms, one exchange a step.

Every rank that owns an atom of a body keeps that body's whole state.  Each step the
sharing ranks send each other their partial force and torque and add the parts up in
the order of their ranks, so that all copies of a body stay equal to the last bit and
no rank is the body's master.  Ghost atoms play no part.

`Alone` is the world of a run on one rank: nothing is shared, nothing is imported.
`World` is the world of several ranks.  All methods of both are collective.
"""

import numpy as np

from .errors import RunError

_IDENTITY = {np.add: 0.0, np.maximum: -np.inf, np.minimum: np.inf}


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

    def follow(self, lost_tags, lost_rows, gained_tags, problem):
        """As `World.follow`; here no atom can have gone or come."""
        self.agree(problem(lost_tags, lost_rows, gained_tags))

    def sharers(self, ids, partial):
        """Who else holds the bodies `ids`; here nobody."""
        return Sharers.none(len(ids))


class World:
    """Several ranks, with LAMMPS's own communicator.

    Args:
        comm: the Fortran handle of the communicator, as LAMMPS's library gives it.
    """

    def __init__(self, comm):
        from mpi4py import MPI

        self.mpi = MPI
        self.comm = MPI.Comm.f2py(comm)
        self.size, self.rank = self.comm.size, self.comm.rank

    def agree(self, problem):
        """End the run on all ranks, with the first rank's message, if any rank has a problem."""
        first = self.comm.allreduce(self.rank if problem else self.size, op=self.mpi.MIN)
        if first < self.size:
            raise RunError(self.comm.bcast(problem, root=first), everywhere=True)

    def total(self, values):
        """Sum of an array over all ranks, as float64."""
        result = np.array(values, float)
        self.comm.Allreduce(self.mpi.IN_PLACE, result)
        return result

    def any(self, flag):
        """Whether `flag` is true on any rank."""
        return self.comm.allreduce(bool(flag), op=self.mpi.LOR)

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

    def route(self, to, rows):
        """Send each row to a rank.

        Args:
            to: (n,) the rank that each row is for.  rows: (n, width) of any dtype.
        Returns:
            (sources, rows): the rank that each received row came from, in the order of
            the ranks, and the rows.
        """
        order = np.argsort(to, kind="stable")
        width = rows.dtype.itemsize * rows.shape[1]
        send = np.ascontiguousarray(rows[order])
        counts = np.bincount(to, minlength=self.size)
        incoming = np.empty_like(counts)
        self.comm.Alltoall(counts, incoming)
        received = np.empty((incoming.sum(), rows.shape[1]), rows.dtype)
        row = self.mpi.BYTE.Create_contiguous(width).Commit()
        self.comm.Alltoallv([send, counts, row], [received, incoming, row])
        row.Free()
        return np.repeat(np.arange(self.size), incoming), received

    def sharers(self, ids, partial):
        """Find, through a directory spread over all ranks, who else holds the bodies `ids`.

        Args:
            ids: (n,) body IDs, each once.
            partial: (n,) bool, False for bodies that are known to be whole here.
        """
        candidates = np.flatnonzero(partial)
        wanted = ids[candidates]
        source, asked = self.route(wanted % self.size, wanted[:, None])
        asked = asked[:, 0]
        order = np.lexsort((source, asked))
        asked, source = asked[order], source[order]
        # every pair of different holders of one body, as (asks, body, holds)
        count = np.unique(asked, return_counts=True)[1]
        start = np.repeat(np.cumsum(count) - count, count)
        mates = np.repeat(count, count)
        asks = np.repeat(np.arange(len(asked)), mates)
        within = np.arange(len(asks)) - np.repeat(np.cumsum(mates) - mates, mates)
        holds = np.repeat(start, mates) + within
        pairs = asks != holds
        asks, holds = asks[pairs], holds[pairs]
        _, answer = self.route(source[asks], np.stack([asked[asks], source[holds]], axis=1))
        body, rank = answer[:, 0], answer[:, 1]
        by_id = np.argsort(wanted)
        place = candidates[by_id[np.searchsorted(wanted, body, sorter=by_id)]] if len(body) else body
        partners = []
        for partner in np.unique(rank):
            mine = rank == partner
            # both sides list their common bodies in the order of the bodies' IDs
            partners.append((int(partner), place[mine][np.argsort(body[mine])]))
        return Sharers(self, len(ids), partners)

    def follow(self, lost_tags, lost_rows, gained_tags, problem):
        """Bring each gained atom what the rank that lost it knew of it.

        Lost and gained atoms meet at a rank that their tag determines.

        Args:
            lost_tags: (n,) tags of atoms that this rank no longer owns.
            lost_rows: (n, width) float64, what goes with each.
            gained_tags: (m,) tags of atoms that this rank now owns, and did not before.
            problem: a function of the tags and rows of atoms that no rank gained and of the tags of
                atoms that no rank lost, whose message (None for none) ends the run.
        Returns:
            (m, width) rows, in the order of gained_tags.
        """
        _, rows = self.route(
            lost_tags % self.size, np.concatenate([lost_tags[:, None].astype(float), lost_rows], axis=1)
        )
        source, asked = self.route(gained_tags % self.size, gained_tags[:, None])
        tags = rows[:, 0].astype(np.int64)
        rows, tags = rows[np.argsort(tags)], np.sort(tags)
        asked = asked[:, 0]
        missing = ~np.isin(tags, asked)
        self.agree(problem(tags[missing], rows[missing, 1:], np.setdiff1d(asked, tags)))
        _, rows = self.route(source, rows[np.searchsorted(tags, asked)])
        order = np.argsort(rows[:, 0])
        back = np.empty(len(gained_tags), np.int64)
        back[np.argsort(gained_tags)] = order
        return rows[back, 1:]


class Sharers:
    """The bodies of this rank that other ranks hold too.

    Attributes:
        bodies: (m,) places of the shared bodies in this rank's list of bodies.
        owned: (n,) bool, whether this rank is the lowest of those that hold the body:
            what has to be counted once is counted there.
    """

    def __init__(self, world, bodies, partners):
        self.world, self.partners = world, partners
        self.bodies = np.unique(np.concatenate([held for _, held in partners])) if partners else np.empty(0, int)
        self.owned = np.ones(bodies, bool)
        for rank, held in partners:
            if rank < world.rank:
                self.owned[held] = False
        # what this rank sends and receives, and where each part is added, in the order of the ranks
        mine = [(world.rank, self.bodies)] if partners else []
        self._order = [(rank, np.searchsorted(self.bodies, held)) for rank, held in sorted(mine + partners, key=lambda p: p[0])]

    @classmethod
    def none(cls, bodies):
        """No body is shared."""
        return cls(Alone(), bodies, [])

    def combine(self, values, operation=np.add):
        """Combine the ranks' parts of shared bodies, in place: one exchange.

        Args:
            values: (components, n) this rank's parts; bodies that are not shared stay as they are.
            operation: numpy.add, maximum or minimum.
        """
        if not self.partners:
            return
        mine = np.ascontiguousarray(values[:, self.bodies])
        comm = self.world.comm
        received, requests = {self.world.rank: mine}, []
        for rank, held in self.partners:
            received[rank] = np.empty((len(values), len(held)))
            requests.append(comm.Irecv(received[rank], rank))
        for rank, held in self.partners:
            requests.append(comm.Isend(np.ascontiguousarray(values[:, held]), rank))
        self.world.mpi.Request.Waitall(requests)
        total = np.full_like(mine, _IDENTITY[operation])
        for rank, place in self._order:
            total[:, place] = operation(total[:, place], received[rank])
        values[:, self.bodies] = total
