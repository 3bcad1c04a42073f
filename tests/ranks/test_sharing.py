"""Sharing between ranks, without LAMMPS: random holders of bodies against sums over all ranks.

This file is also the script that the ranks run.
"""

import subprocess
import sys
import time

import numpy as np
import pytest

SEEDS = 60  # over the number of ranks: many ranks take long, and meet as often


def scenes(size):
    """Random scenes, alike on all ranks: IDs, who holds which body (bodies, ranks),
    and each rank's parts."""
    for seed in range(SEEDS // size):
        rng = np.random.default_rng(seed)
        bodies = int(rng.choice([1, 5, 60]))
        holds = rng.random((bodies, size)) < rng.choice([0.1, 0.5, 1.0])
        ids = rng.choice(10**6, bodies, replace=False)
        yield (
            rng,
            ids,
            holds,
            rng.normal(size=(size, 3, bodies)) * 10.0 ** rng.integers(-8, 8, (size, 1, bodies)),
        )


def check_combine(world):
    """Sharers.combine equals the parts added up in the order of the ranks;
    one rank owns each body."""
    from fix_nosquish.ranks.sharing import Sharers

    for rng, ids, holds, parts in scenes(world.size):
        mine = np.random.default_rng(world.rank).permutation(np.flatnonzero(holds[:, world.rank]))
        # a rank that knows its body to be whole does not ask for sharers; where holders meet does
        # not matter
        partial = ~(holds[mine].sum(axis=1) == 1) | (rng.random() < 0.5)
        home = rng.integers(0, world.size, len(ids))
        asked = np.flatnonzero(partial)
        sharers = Sharers(world).find(len(mine), asked, ids[mine[asked]], home[mine[asked]])
        shared = np.flatnonzero(holds[mine].sum(axis=1) > 1)
        assert np.array_equal(np.sort(sharers.bodies), shared)
        assert np.array_equal(sharers.home, holds[mine].argmax(axis=1))
        assert np.array_equal(sharers.owned, sharers.home == world.rank)
        for operation, none in (np.add, 0.0), (np.maximum, -np.inf), (np.add, 0.0):
            want = np.full(parts.shape[1:], none)
            for r in range(world.size):
                want = operation(want, np.where(holds[:, r], parts[r], none))
            got = parts[world.rank][:, mine].copy()
            sharers.combine(got, operation)
            assert got.tobytes() == np.ascontiguousarray(want[:, mine]).tobytes()  # to the last bit
            copies = world.comm.allgather(
                dict(zip(ids[mine].tolist(), (c.tobytes() for c in got.T)))
            )
            for body, k in zip(ids, range(len(ids))):
                assert len({copy[body] for copy in copies if body in copy}) == holds[k].any()


def check_deliver(world):
    """exchange brings every array to its rank,
    when ranks are at different rounds of it, too."""
    from fix_nosquish.ranks.lookup import exchange

    for k, (rng, *_) in enumerate(scenes(world.size)):
        size = rng.choice([0, 0, 1, 300, 30000], (world.size, world.size))  # from, to
        to = np.repeat(np.arange(world.size), size[world.rank])
        parts = np.arange(len(to)) * world.size + world.rank
        if k % world.size == world.rank:
            time.sleep(0.002)  # the others are ahead
        senders, got = exchange(world, to, np.stack([parts, to], axis=1))
        ranks, counts = np.unique(senders, return_counts=True)
        assert ranks.tolist() == np.flatnonzero(size[:, world.rank]).tolist()
        assert counts.tolist() == size[ranks, world.rank].tolist()
        assert senders.tolist() == sorted(senders.tolist())
        begins = [size[r, : world.rank].sum() for r in ranks]
        want = [np.arange(b, b + n) * world.size + r for r, b, n in zip(ranks, begins, counts)]
        assert np.array_equal(got[:, 0], np.concatenate([np.empty(0, int), *want]))
        assert (got[:, 1] == world.rank).all()


def check_look_up(world):
    """look_up gives the rows of keys that any rank has, and -1 for others."""
    from fix_nosquish.ranks.lookup import look_up

    for rng, *_ in scenes(world.size):
        n = int(rng.choice([0, 3, 300]))
        keys, values = rng.choice(10**9, n, replace=False), rng.integers(0, 10**6, n)
        mine = rng.integers(0, world.size, n) == world.rank
        ask = np.random.default_rng(world.rank).permutation(
            np.concatenate([keys, 10**9 + np.arange(5)])
        )
        known = dict(zip(keys.tolist(), values.tolist()))
        assert look_up(world, keys[mine], values[mine, None], ask).tolist() == [
            [known.get(key, -1)] for key in ask.tolist()
        ]


def check_atoms_lost(world):
    """gone tells the rank that lost them of atoms that nobody has."""
    from fix_nosquish.ranks.lookup import gone

    last = world.size - 1
    origins = np.array([last << 32 | 5] if world.rank == 0 else [], np.int64)
    lost = np.array([3, 5, 7] if world.rank == last else [], np.int64)
    assert gone(world, lost, origins).tolist() == ([3, 7] if world.rank == last else [])


def check_one_communicator(world):
    """All worlds of one communicator of LAMMPS use one of ours, which is freed with it,
    and none of its messages is theirs."""
    from mpi4py import MPI

    from fix_nosquish.ranks.communicator import Communicator
    from fix_nosquish.ranks.lookup import exchange

    lammps = MPI.COMM_WORLD.Dup()
    first, second = (Communicator(lammps.py2f()) for _ in range(2))
    assert first.comm == second.comm and first.comm != lammps
    lammps.Free()
    assert (
        first.comm == MPI.COMM_NULL
    )  # else a library that makes and ends many LAMMPS runs out of communicators
    theirs = MPI.COMM_WORLD.isend("LAMMPS's", (world.rank + 1) % world.size)
    assert not len(exchange(world, np.empty(0, int), np.empty((0, 1), int))[0])
    assert MPI.COMM_WORLD.recv() == "LAMMPS's"
    theirs.wait()


def check_agree(world):
    """Communicator.agree raises the lowest rank's message on all ranks,
    and total and any reach all."""
    from fix_nosquish.errors import RunError

    world.agree(None)
    try:
        world.agree(f"problem of rank {world.rank}" if world.rank else None)
        raise AssertionError("no error")
    except RunError as error:
        assert str(error) == "problem of rank 1" and error.everywhere
    assert world.total(np.array([1.0, world.rank])).tolist() == [
        world.size,
        world.size * (world.size - 1) / 2,
    ]
    assert world.any(world.rank == world.size - 1) is True and world.any(False) is False


CHECKS = {name: check for name, check in globals().items() if name.startswith("check_")}


@pytest.mark.quick("2", "4")
@pytest.mark.parametrize("ranks", [2, 4, 8])
def test_ranks(ranks):
    """Locks out parts added in another order on another rank (copies of a body that differ in the
    last bit come apart), sharers not found or found twice, no or two owners, rows given to the
    wrong atoms, and a problem that one rank does not hear of (a hang).  One start for all checks:
    it is what takes time."""
    from support.running import BIN

    done = subprocess.run(
        [str(BIN / "mpirun"), "-np", str(ranks), sys.executable, __file__],
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=90,
    )
    assert done.returncode == 0, done.stdout
    for name in CHECKS:
        assert done.stdout.count(name) == ranks, f"{name} did not pass on all ranks:\n{done.stdout}"


@pytest.mark.quick
def test_one_rank_needs_no_mpi4py(run_lammps):
    """Locks out an import of mpi4py, and so an MPI call of ours, in a run on one rank.
    (By lmp: under Python, LAMMPS's own module imports mpi4py.)"""
    watch = (
        "import sys\nimport fix_nosquish\n"
        "def __getattr__(name):\n"
        "    if name.startswith('__'):\n        raise AttributeError(name)\n"
        "    made = getattr(fix_nosquish, name)\n"
        "    class Watched:\n"
        "        def __init__(self, ptr):\n            self.__dict__['ours'] = made(ptr)\n"
        "        def __getattr__(self, attribute):\n"
        "            return getattr(self.ours, attribute)\n"
        "        def __setattr__(self, attribute, value):\n"
        "            setattr(self.ours, attribute, value)\n"
        "        def post_run(self):\n"
        "            self.ours.post_run()\n"
        "            print('MPI4PY', 'mpi4py' in sys.modules, flush=True)\n"
        "    return Watched\n"
    )
    script = (
        "units lj\natom_style molecular\nregion box block 0 9 0 9 0 9\ncreate_box 1 box\nmass 1 1\n"
        "create_atoms 1 single 1 1 1\ncreate_atoms 1 single 2 1 1\ncreate_atoms 1 single 1 2 1\n"
        "pair_style zero 2.5\npair_coeff * *\nset group all mol 1\nvelocity all create 1 384\n"
        'fix 1 all python/move "watched.NVE all molecule"\nrun 2\n'
    )
    run = run_lammps(script, files={"watched.py": watch}, launcher="lmp")
    assert run.screen.count("MPI4PY False") == 1, run.screen


if __name__ == "__main__":
    from mpi4py import MPI

    from fix_nosquish.ranks.communicator import Communicator

    try:
        for name, check in CHECKS.items():
            check(Communicator(MPI.COMM_WORLD.py2f()))
            print(name + "\n", end="", flush=True)
    except BaseException:
        import traceback

        traceback.print_exc()
        sys.stderr.flush()
        MPI.COMM_WORLD.Abort(1)
