"""Passes on several threads: they change no trajectory."""

import re

import numpy as np
import pytest
from conftest import LAUNCHERS
from systems import mixture
from test_extended import setup as particles
from test_nvt import SMOOTH

# threads have a part of few bodies, too; and the log tells how many blocks each had last
FEW = """
import fix_nosquish
from fix_nosquish.run import threads
from fix_nosquish.run.integrator import Integrator

def post_run(self, plain=Integrator.post_run):
    plain(self)
    if self.passes.threads.size > 1:
        blocks = self.passes.threads.parts[:, 1] - 1
        self.host.log(f"BLOCKS {' '.join(map(str, blocks))}\\n")

Integrator.post_run = post_run

def __getattr__(name):
    if name.startswith("__"):
        raise AttributeError(name)
    threads.LEAST = 0
    return getattr(fix_nosquish, name)
"""
STEPS = 60
END = f"""
compute       own all stress/atom NULL virial
dump          end all custom {STEPS} end.* id xu yu zu vx vy vz c_own[1] c_own[5]
dump_modify   end sort id format float %.17g
compute       force all pressure NULL virial
thermo_style  custom step pe c_force c_force[4] f_1
thermo        {STEPS // 3}
thermo_modify format float %.17g norm no
run           {STEPS}
"""
FIX = 'fix 1 all python/move "few.{}"'
MIXTURE = mixture(side=5, spacing=2.9, temperature=2.0)
BOX = f"{MIXTURE.setup}\n{SMOOTH}timestep 0.004\n"
GROUPS = "group left molecule 1:40\ngroup middle molecule 41:90\ngroup right molecule 91:124\n"
SPHERES = f"{particles('dipole')}\nreplicate 2 2 2\ntimestep 0.001\n"
TEMPERATURE, CELL = "all molecule temp 2 2 2e-1", "iso 12e-2 12e-2 2e-1 every"
# lines before the fix, its words, and whether each body goes its way by itself; else all depend on
# a sum over them, which is rounded otherwise
CASES = {
    "nve": (BOX, "NVE all molecule", True),
    "masked": (BOX, "NVE all molecule mrot 2 force 3 on off on", True),
    "respa": (f"{BOX}run_style respa/omp 2 2 pair 2\n", "NVE all molecule", True),
    "spheres": (SPHERES, "NVE all molecule", True),
    "langevin": (BOX, f"NVT {TEMPERATURE} seed 771", True),
    "csvr": (BOX, f"NVT {TEMPERATURE} seed 771 thermostat csvr", False),
    "chains": (BOX, f"NVT {TEMPERATURE} thermostat nh separate yes", False),
    "crescale": (BOX, f"NPT {TEMPERATURE} seed 771 {CELL} 2 compressibility 8", False),
    "piston": (BOX, f"NPT {TEMPERATURE} seed 771 {CELL} 1 barostat mtk", False),
    # of more than 64 atoms each: a block for itself, and one thread has none
    "large": (BOX + GROUPS, "NVE all group 3 left middle right", True),
}


@pytest.fixture
def run(run_lammps, tmp_path):
    """A function that runs a script on so many threads (what the environment says, if ""); it
    gives the atoms at the end, the thermo
    table, and how many blocks each thread of rank 0 had."""

    def run(threads, script, few=FEW, **how):
        files = {"few.py": few, **MIXTURE.files}
        first = threads and f"package omp {threads}\n"
        done = run_lammps(f"{first}{script}", files=files, **how)
        blocks = re.findall(r"BLOCKS (.*)", done.log)
        blocks = [int(number) for number in blocks[-1].split()] if blocks else []
        return np.loadtxt(tmp_path / f"end.{STEPS}", skiprows=9), done.thermo, blocks

    return run


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", CASES)
def test_threads_change_no_trajectory(run, name, ranks):
    """Locks out threads that share memory to work with, that leave out bodies or do some twice, or
    that miss the atoms in another periodic image; and sums, as of the virial, that lack a part."""
    before, words, alone = CASES[name]
    script = f"{before}{FIX.format(words)}{END}"
    atoms, thermo, blocks = run(1, script, ranks=ranks)
    assert not blocks
    for threads in (2, 4) if ranks == 1 else (3,):
        others, other_thermo, blocks = run(threads, script, ranks=ranks)
        assert len(blocks) == threads and sum(number > 0 for number in blocks) > 1, blocks
        if alone:
            np.testing.assert_array_equal(others[:, :7], atoms[:, :7])
        np.testing.assert_allclose(others, atoms, rtol=1e-9, atol=1e-9)
        for column in thermo.dtype.names:
            np.testing.assert_allclose(other_thermo[column], thermo[column], rtol=1e-9)


def test_number_of_threads_changes(run):
    """Locks out threads of a former LAMMPS in the process, whose number or memory stays."""
    before, words, _ = CASES["nve"]
    script = f"{before}{FIX.format(words)}{END}"
    parts = [f"package omp {threads}\n{script}" for threads in (4, 1, 3)]
    (atoms, _, none), (others, _, blocks) = run(1, script), run(2, "clear\n".join(parts))
    np.testing.assert_array_equal(others[:, :7], atoms[:, :7])
    assert not none and len(blocks) == 3


def test_fewer_threads_than_asked_for(run):
    """Locks out bodies that stand still where OpenMP gives fewer threads than LAMMPS counts."""
    before, words, _ = CASES["nve"]
    script = f"{before}{FIX.format(words)}{END}"
    limit = ["env", "OMP_NUM_THREADS=3", "OMP_THREAD_LIMIT=2", *LAUNCHERS["lmp"]]
    (atoms, *_), (others, _, blocks) = run(1, script), run("", script, launcher=limit)
    np.testing.assert_array_equal(others[:, :7], atoms[:, :7])
    assert len(blocks) == 3


@pytest.mark.parametrize("molecule", [1, 125])
def test_what_one_thread_finds_ends_the_run(refused, molecule):
    """Locks out bad forces on a body of one thread, the first or the last, that go unseen."""
    push = f"group one molecule {molecule}\nvariable push equal exp(1000.0*(step>9))\n"
    push += "fix push one addforce v_push 0 0\n"
    script = f"package omp 3\n{BOX}{FIX.format('NVE all molecule')}\n{push}run 20\n"
    says = f"the force on the body of molecule {molecule} is not finite at step 10"
    refused(script, says, {"few.py": FEW, **MIXTURE.files})


def test_few_bodies_have_one_thread(run):
    """Locks out threads that are woken where that takes longer than the bodies do."""
    before, words, _ = CASES["nve"]
    few = FEW.replace("threads.LEAST = 0", "threads.LEAST = 16")
    assert run(2, f"{before}{FIX.format(words)}{END}", few=few)[2] == [-1, -1]
