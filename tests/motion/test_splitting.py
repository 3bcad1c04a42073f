"""Splittings: which ones are refused, and in what passes a step is done."""

import numpy as np
import pytest

from fix_nosquish.errors import RunError
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.motion.operations import kick
from fix_nosquish.motion.step import Operation, stages
from support.endings import assert_ended
from support.systems import mixture

PAUSE = Operation(kick, prepared=True, measures=kick)
KNOWN = NVE.operations | {
    "O": Operation(kick, prepared=True), "M": PAUSE, "D": PAUSE._replace(moves=True),
}  # fmt: skip


@pytest.mark.parametrize(
    ("splitting", "more", "says"),
    [
        ("B A X B", {}, "there is no operation X, only A, B"),
        ("B A F B", {"F": Operation(kick)}, "the letter F stands for the forces"),
        ("B B", {}, "none of its operations moves the bodies"),
        ("B A O A O A B", {}, "may occur once, not before the first"),
        ("O B A B", {}, "may occur once, not before the first"),
        ("B A B O", {}, "may occur once, not before the first"),
        ("B A B", {"B": Operation(lambda *block: None)}, "of operation B is not marked @inlined"),
    ],
)
def test_refused(splitting, more, says):
    """Locks out a letter that is taken for something else, and random numbers that are drawn twice
    in a step or with the temperature of another."""
    with pytest.raises(RunError, match=says):
        stages(splitting, KNOWN | more)


@pytest.mark.parametrize(
    ("splitting", "passes", "tail_moves", "prepared"),
    [
        ("B A B", 1, False, False),
        ("B A F A B", 1, True, False),
        ("B A O A B", 1, False, True),
        ("B A M A B", 2, False, True),
        ("B D B", 2, False, True),
    ],
)
def test_passes(splitting, passes, tail_moves, prepared):
    """Locks out a second pass over the bodies where nothing is measured, and none where it is."""
    result = stages(splitting, KNOWN)
    assert len(result.middle) == passes
    assert (result.tail_moves, result.prepared) == (tail_moves, prepared)


def test_nothing_prepares():
    """Locks out parameters, as of random numbers, that stay the same in all steps."""
    with pytest.raises(RunError, match="no loop `prepares`"):
        type("Own", (NVE,), {"splitting": "B A O A B", "operations": KNOWN})


OWN = """
from fix_nosquish import of_fix_line
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.loops.compiled import inlined
from fix_nosquish.motion.block import COUNTED, FREE, LANES, NUMBER, POINT, P, V
from fix_nosquish.motion.step import Operation

@inlined
def slow(block, kind, dt, parameters):
    for b in range(LANES):
        factor = 1.0 if block[COUNTED, b] == 0.0 else block[COUNTED, b]
        factor *= 1.0 - 0.1 * (block[NUMBER, b] == 3.0)
        for k in range(3):
            block[V + k, b] *= factor * block[FREE + k, b]
        if kind != POINT:
            for k in range(4):
                block[P + k, b] *= factor * block[FREE + 3, b]

class Slow(NVE):
    splitting = "{splitting}"
    operations = NVE.operations | {{"S": Operation(slow)}}

__getattr__ = of_fix_line(Slow)
"""


@pytest.mark.parametrize(
    ("splitting", "more"),
    [("B A S A B", ""), ("S B A B", ""), ("S B A B", "run_style respa 2 2 pair 2\n")],
)
def test_rows_that_tell_who_a_body_is(run_lammps, tmp_path, splitting, more):
    """Locks out operations that find other numbers than said in the rows COUNTED, NUMBER and FREE,
    wherever they stand in a step: only body 3 is slowed down."""
    system, steps = mixture(side=2), 4
    end = "dump 1 all custom {0} end id mol vx vy vz\ndump_modify 1 sort id format float %.17g\n"
    results = {}
    for name in "slow.Slow", "fix_nosquish.NVE":
        script = f"{system.setup}\n{more}pair_coeff * * 0 1\ntimestep 0.001\n"
        script += f'fix 1 bodies python/move "{name} bodies molecule"\n{end.format(steps)}'
        script += f"run {steps}\n"
        files = system.files | {"slow.py": OWN.format(splitting=splitting)}
        run_lammps(script, files=files)
        results[name] = np.loadtxt((tmp_path / "end").read_text().split("vz\n")[-1].splitlines())
    slowed, free = results.values()
    other = slowed[:, 1] != 3
    np.testing.assert_allclose(slowed[other], free[other], rtol=1e-6, atol=1e-9)
    times = steps * (3 if more else 1)  # a step of the outer level begins, and two of the inner one
    energies = [(one[~other, 2:] ** 2).sum() for one in (slowed, free)]
    assert energies[0] == pytest.approx(energies[1] * 0.9 ** (2 * times), rel=0.05)


BRAKE = """
import numpy as np
from fix_nosquish import of_fix_line
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.loops.compiled import F, inlined, record
from fix_nosquish.motion.block import COUNTED, LANES, MASS, V
from fix_nosquish.motion.step import Operation

@inlined
def slow(block, kind, dt, parameters):
    for k in range(3):
        for b in range(LANES):
            twice = block[COUNTED, b] * block[MASS, b] * block[V + k, b] * block[V + k, b]
            parameters.taken += 0.5 * (1.0 - 0.99**2) * twice
            block[V + k, b] *= 0.99

class Brake(NVE):
    splitting = "B A B S"
    operations = NVE.operations | {"S": Operation(slow)}
    numbers = record("Brake", NVE.numbers, taken=F)

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.restart_state = np.array([7.0, 0.0])  # what it is, the energy taken before this run
{methods}
__getattr__ = of_fix_line(Brake)
"""
NEW_NAMES = """
    def extra_parameters(self, run):
        self.restart_state[1] = self.scalar(run)
        return {}

    def scalar(self, run):
        now = 0.0 if run.parameters is None else run.parameters.taken
        return self.restart_state[1] + run.ranks.total(np.array([now]))[0]

    def prepare_restart(self, run):
        self.restart_state[1], run.parameters.taken = self.scalar(run), 0.0
"""
FORMER_NAMES = """
    couples = True

    def own_parameters(self):
        self.restart_state[1] = self.taken()
        return {}

    def taken(self):
        now = 0.0 if self.parameters is None else self.parameters.taken
        return self.restart_state[1] + self.communicator.total(np.array([now]))[0]

    def compute_scalar(self):
        return self.taken()

    def write_restart(self):
        self.restart_state[1], self.parameters.taken = self.taken(), 0.0
"""


@pytest.mark.parametrize("methods", [NEW_NAMES, FORMER_NAMES], ids=["new", "former"])
@pytest.mark.parametrize("ranks", [1, 2])
def test_energy_taken_is_counted_and_kept(run_lammps, run_system, ranks, methods):
    """Locks out energy that a user's integrator takes and that econserve lacks, and a count that
    begins anew with a restart file; and a class with names of before that does nothing, or without
    a warning."""
    system = mixture(side=3, spacing=2.9)
    # what a restart file does not have
    pair = "pair_style lj/smooth/linear 2.5\npair_coeff * * 1 1\nneighbor 0.4 bin\n"
    pair += "neigh_modify every 1 delay 0 check yes exclude molecule/intra all\n"
    fix = f'{pair}timestep 0.001\nfix 1 all python/move "brake.Brake all molecule"\n'
    fix += "thermo_style custom step etotal econserve f_1\nthermo_modify norm no\nthermo 50\n"
    files = system.files | {"brake.py": BRAKE.replace("{methods}", methods)}
    first = run_system(
        system, f"{fix}run 100\nwrite_restart kept\nrun 100\n", files=files, ranks=ranks
    )
    whole, warned = first.thermo, "WARNING: class Brake uses own_parameters" in first.log
    assert warned == (methods == FORMER_NAMES)
    second = run_lammps(f"read_restart kept\n{fix}run 100\n", files=files, ranks=ranks).thermo
    assert np.ptp(whole["TotEng"]) > 50 * np.ptp(whole["Econserve"])
    np.testing.assert_allclose(second["f_1"], whole["f_1"][-len(second) :], rtol=1e-5)


NUMBERS = (
    "import fix_nosquish\nfrom fix_nosquish.integrators.nve import NVE\n"
    "from fix_nosquish.loops.compiled import F, record\nclass Own(NVE):\n"
)
UNFINISHED = {
    "lone": (
        "from fix_nosquish.integrators.nve import NVE\nclass Own(NVE):\n    pass\n",
        "Have in it: __getattr__ = fix_nosquish.of_fix_line(Own)",
    ),
    "ensemble": (
        "from fix_nosquish.integrators.nvt import NVT\nclass Own(NVT):\n    pass\n",
        "Have in it: __getattr__ = fix_nosquish.of_fix_line(Own)",
    ),
    "twice": (
        f"{NUMBERS}    numbers = record('Own', NVE.numbers, ftm2v=F)\n",
        "record Own: the record Parameters has a field ftm2v already",
    ),
    "unknown": (
        f"{NUMBERS}    numbers = record('Own', NVE.numbers, friction=F)\n"
        "    extra_parameters = lambda self, run: {'frction': 1.0}\n"
        "__getattr__ = fix_nosquish.of_fix_line(Own)\n",
        "the record Own has no field frction, but ftm2v, mrot, friction",
    ),
    "hook": (
        "import fix_nosquish\nfrom fix_nosquish.integrators.nve import NVE\n"
        "class Own(NVE):\n    def final_integrate(self):\n        pass\n"
        "__getattr__ = fix_nosquish.of_fix_line(Own)\n",
        "class Own has final_integrate: an integrator declares its step",
    ),
    "letter": (
        "from fix_nosquish.integrators.nve import NVE\n"
        "class Own(NVE):\n    splitting = 'B A Q A B'\n",
        "splitting 'B A Q A B': there is no operation Q, only A, B",
    ),
    "misspelt": (
        "from fix_nosquish.integrators.rescaling import Rescaling\n"
        "class Own(Rescaling):\n    keyword, degree = ('separate',), 3\n",
        "class Own has keyword, which means nothing here. Did you mean keywords?",
    ),
}


@pytest.mark.parametrize("name", UNFINISHED)
def test_an_unfinished_integrator(run_lammps, tmp_path, name):
    """Locks out a message that does not say what a new integrator lacks, an ensemble that cannot be
    derived from, numbers that take the place of others, or are not there, without a word, a hook of
    LAMMPS that would never be called, and a declaration that nothing reads, for it is misspelt; and
    pages of traceback before the message."""
    system, (text, says) = mixture(side=2), UNFINISHED[name]
    line = f'fix 1 bodies python/move "{name}.Own bodies molecule"\n'
    files = system.files | {f"{name}.py": text}
    run = run_lammps(f"{system.setup}\n{line}run 0\n", files=files, check=False)
    assert_ended(run, [says], tmp_path)
    assert name not in ("letter", "hook", "misspelt") or "Traceback" not in run.screen
