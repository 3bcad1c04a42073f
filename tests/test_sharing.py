"""Sharing between ranks, without LAMMPS: random holders of bodies against sums over all ranks.

This file is also the script that the ranks run.
"""

import subprocess
import sys

import numpy as np
import pytest

SEEDS = range(25)


def scenes(size):
    """Random scenes, alike on all ranks: IDs, who holds which body (bodies, ranks), and each rank's parts."""
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        bodies = int(rng.choice([1, 5, 60]))
        holds = rng.random((bodies, size)) < rng.choice([0.1, 0.5, 1.0])
        ids = rng.choice(10**6, bodies, replace=False)
        yield rng, ids, holds, rng.normal(size=(size, 3, bodies)) * 10.0 ** rng.integers(-8, 8, (size, 1, bodies))


def check_combine(world):
    """Sharers.combine equals the parts added up in the order of the ranks; one rank owns each body."""
    for rng, ids, holds, parts in scenes(world.size):
        mine = np.random.default_rng(world.rank).permutation(np.flatnonzero(holds[:, world.rank]))
        # a rank that knows its body to be whole does not ask for sharers
        partial = ~(holds[mine].sum(axis=1) == 1) | (rng.random() < 0.5)
        sharers = world.sharers(ids[mine], partial)
        shared = np.flatnonzero(holds[mine].sum(axis=1) > 1)
        assert np.array_equal(sharers.bodies, shared)
        assert np.array_equal(sharers.owned, holds[mine].argmax(axis=1) == world.rank)
        for operation, none in (np.add, 0.0), (np.maximum, -np.inf), (np.minimum, np.inf):
            want = np.full(parts.shape[1:], none)
            for r in range(world.size):
                want = operation(want, np.where(holds[:, r], parts[r], none))
            got = parts[world.rank][:, mine].copy()
            sharers.combine(got, operation)
            assert got.tobytes() == np.ascontiguousarray(want[:, mine]).tobytes()  # to the last bit
            copies = world.comm.allgather(dict(zip(ids[mine].tolist(), (c.tobytes() for c in got.T))))
            for body, k in zip(ids, range(len(ids))):
                assert len({copy[body] for copy in copies if body in copy}) == holds[k].any()


def check_follow(world):
    """World.follow gives each atom's new rank the row of its old one, for atoms in any order."""
    for rng, *_ in scenes(world.size):
        n = int(rng.choice([0, 3, 300]))
        tags = rng.choice(10**9, n, replace=False) + 1
        rows = rng.normal(size=(n, 4))
        old, new = rng.integers(0, world.size, (2, n))
        shuffle = np.random.default_rng(world.rank).permutation(n)
        lost = shuffle[(old == world.rank)[shuffle] & (new != world.rank)[shuffle]]
        gained = shuffle[::-1][(new == world.rank)[shuffle[::-1]] & (old != world.rank)[shuffle[::-1]]]
        got = world.follow(tags[lost], rows[lost], tags[gained], lambda gone, known, come: None)
        assert np.array_equal(got, rows[gained])


def check_atoms_lost(world):
    """World.follow tells of atoms that nobody has, and of new ones, and ends the run on all ranks alike."""
    from fix_nosquish.errors import RunError

    last = world.rank == world.size - 1
    for lost, gained in ([7], []), ([], [7]):
        lost, gained = (np.array(tags if last else [], np.int64) for tags in (lost, gained))

        def problem(gone, known, come):
            if len(gone):
                return f"gone {gone} {known}"
            return f"come {come}" if len(come) else None

        try:
            world.follow(lost, np.full((len(lost), 2), 0.5), gained, problem)
            text = "no error"
        except RunError as error:
            assert error.everywhere
            text = str(error)
        assert set(world.comm.allgather(text)) <= {"gone [7] [[0.5 0.5]]", "come [7]"}, text


def check_agree(world):
    """World.agree raises the lowest rank's message on all ranks, and total and any reach all."""
    from fix_nosquish.errors import RunError

    world.agree(None)
    try:
        world.agree(f"problem of rank {world.rank}" if world.rank else None)
        raise AssertionError("no error")
    except RunError as error:
        assert str(error) == "problem of rank 1" and error.everywhere
    assert world.total(np.array([1.0, world.rank])).tolist() == [world.size, world.size * (world.size - 1) / 2]
    assert world.any(world.rank == world.size - 1) is True and world.any(False) is False


CHECKS = {name: check for name, check in globals().items() if name.startswith("check_")}


@pytest.mark.parametrize("ranks", [2, 4, 8])
def test_ranks(ranks):
    """Locks out parts added in another order on another rank (copies of a body that differ in the last bit
    come apart), sharers not found or found twice, no or two owners, rows given to the wrong atoms, and
    a problem that one rank does not hear of (a hang).  One start for all checks: it is what takes time."""
    from conftest import BIN

    done = subprocess.run([str(BIN / "mpirun"), "-np", str(ranks), sys.executable, __file__], text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=90)  # fmt: skip
    assert done.returncode == 0, done.stdout
    for name in CHECKS:
        assert done.stdout.count(name) == ranks, f"{name} did not pass on all ranks:\n{done.stdout}"


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
        "        def __getattr__(self, attribute):\n            return getattr(self.ours, attribute)\n"
        "        def __setattr__(self, attribute, value):\n            setattr(self.ours, attribute, value)\n"
        "        def final_integrate(self):\n"
        "            self.ours.final_integrate()\n"
        "            print('MPI4PY', 'mpi4py' in sys.modules, flush=True)\n"
        "    return Watched\n"
    )
    script = (
        "units lj\natom_style molecular\nregion box block 0 9 0 9 0 9\ncreate_box 1 box\nmass 1 1\n"
        "create_atoms 1 single 1 1 1\ncreate_atoms 1 single 2 1 1\ncreate_atoms 1 single 1 2 1\n"
        "pair_style zero 2.5\npair_coeff * *\nset group all mol 1\nvelocity all create 1 384\n"
        'fix 1 all python/move "watched.NVE all molecule"\nrun 2\n'
    )
    run = run_lammps(script, files={"watched.py": watch})
    assert run.screen.count("MPI4PY False") == 2, run.screen


if __name__ == "__main__":
    from mpi4py import MPI

    from fix_nosquish.sharing import World

    try:
        for name, check in CHECKS.items():
            check(World(MPI.COMM_WORLD.py2f()))
            print(name + "\n", end="", flush=True)
    except BaseException:
        import traceback

        traceback.print_exc()
        sys.stderr.flush()
        MPI.COMM_WORLD.Abort(1)
