"""The same class and fix line in a LAMMPS that has its own fix python/move,
here that of Debian's lammps package.

It is another version (29 Sep 2021), with Open MPI and the system's Python.  DEBIAN_LAMMPS names it
if it is not /usr/bin/lmp.
"""

import gc
import re
import weakref
from unittest.mock import MagicMock

import numpy as np
import pytest

from fix_nosquish.errors import RunError
from fix_nosquish.host.command import Line
from fix_nosquish.host.own_fix import OwnFix
from fix_nosquish.ranks.communicator import ALONE
from support.bad_input import CASES
from support.debian import ICE, debian, ice, obstacle
from support.endings import BENT, SECONDS, SPOIL, processes_in
from support.systems import line_of_class, mixture

pytestmark = pytest.mark.skipif(bool(obstacle()), reason=obstacle() or "")

SCRIPT = (
    ICE
    + """{fix}
thermo_style  custom step temp pxx pyy pzz pxy pxz pyz
thermo_modify format float %.16g
thermo        10
timestep      1.0
{runs}
write_dump    all custom dump.end id xu yu zu modify sort id format float %.16g
"""
)
NVE = line_of_class("fix_nosquish.NVE")
OURS = 'fix 1 water python/move "fix_nosquish.NVE water molecule"'
RIGID = "fix 1 water rigid/nve molecule"


@pytest.fixture
def run_water(run_lammps, tmp_path, known):
    """Run a small box of water; return its Run and the positions at its end.
    No run is done twice."""

    def run(fix, runs="run 20", *, launcher=None, ranks=1, own_ranks=1):
        script = SCRIPT.format(fix=fix, runs=runs)
        key = script, str(launcher), ranks, own_ranks
        if key not in known:
            how = dict(launcher=launcher or debian(ranks), ranks=own_ranks)
            done = run_lammps(script, files={"data.ice": ice()}, **how)
            known[key] = done, np.loadtxt(tmp_path / "dump.end", skiprows=9)[:, 1:]
        return known[key]

    return run


def advised(run):
    """The input lines that the log of a run names."""
    return "\n".join(re.findall(r"^    ((?:compute_modify|fix) .*)$", run.log, re.M))


@pytest.mark.quick
def test_trajectory(run_water):
    """Locks out a class that works only with the plugin,
    and copies of a body that drift apart between ranks."""
    _, expected = run_water(RIGID, "run 50")
    for ranks in 1, 2, 4:
        _, ours = run_water(OURS, "run 50", ranks=ranks)
        assert np.abs(ours - expected).max() < 1e-8, f"on {ranks} ranks"


@pytest.mark.parametrize("ranks", [1, 2])
def test_temperature(run_water, ranks):
    """Locks out advice that is wrong or not found in the log, and a pressure without a word that it
    lacks the constraint forces."""
    log = run_water(OURS, "run 0", ranks=ranks)[0]
    lines = advised(log)
    assert lines == "compute_modify thermo_temp extra/dof 378"
    assert "press lacks the forces that hold the bodies rigid" in log.log
    own = run_water(f"{OURS}\n{lines}", ranks=ranks)[0].thermo
    assert len(own) == 3
    np.testing.assert_allclose(own["Temp"], run_water(RIGID)[0].thermo["Temp"], rtol=1e-10)


@pytest.mark.quick("1")
@pytest.mark.parametrize("ranks", [1, 2])
def test_runs_in_a_row(run_water, ranks):
    """Locks out a second run that starts from the first one's velocities, forces or indices, and
    velocities of another temperature than before a first run."""
    create = "velocity all create 400 87287\n"
    runs = f"run 20\nrun 10\n{create}run 20"
    lines = advised(run_water(OURS, "run 0", ranks=ranks)[0])
    ours, theirs = (
        run_water(f"{OURS}\n{lines}", runs, ranks=ranks),
        run_water(RIGID, runs.replace(create, f"unfix 1\n{create}{RIGID}\n")),
    )
    np.testing.assert_allclose(ours[1], theirs[1], rtol=0, atol=1e-8)
    np.testing.assert_allclose(ours[0].thermo["Temp"], theirs[0].thermo["Temp"], rtol=1e-10)


# the message comes with Python's traceback
IN_IMPORT = (
    "value with a point",
    "integrator that does not exist",
    "variable in the quotes",
)
# in the constructor, at the set-up of a run, in it: what asks this LAMMPS, and one of mere words
LATER = (
    "no words at all",
    "group that is not defined",
    "property that is not defined",
    "variable that is not defined",
    "variable too large",
    "group without atoms",
    "atom style without molecules",
    "body without mass",
    "atoms at one point",
    "two fixes claim an atom",
    "box changed by a barostat",
    "box deformed alone",
    "force that becomes infinite",
    "run that explodes",
    "overlap at the start",
    "atoms lost",
    "atoms deleted by a fix",
    "atoms added by a fix",
    "exception of its own",
)
# with another message: here other fixes are not known, and the text is split at a point
FOUND_LATER = {
    "box changed by a barostat": ("the box has changed by step 1", "fix_nosquish.NPT"),
    "value with a point": ("No module named", "NVE all molecule mrot 2'"),
}


@pytest.mark.quick("no words at all")
@pytest.mark.parametrize("name", IN_IMPORT + LATER)
def test_bad_input_ends_all_ranks(run_lammps, tmp_path, name):
    """Locks out the hang of LAMMPS's own fix, where one rank fails and waits for the others,
    and a lost message."""
    files = {"mol.bent": BENT, "spoil.py": SPOIL}
    case = CASES[name]
    expected = FOUND_LATER.get(name, case.expected)
    run = run_lammps(case.script, files=files, launcher=debian(2), check=False, timeout=SECONDS)
    assert run.code != 0, run.screen
    printed = [line for line in run.screen.splitlines() if all(words in line for words in expected)]
    if name in IN_IMPORT:
        assert printed, run.screen
    else:
        assert len([line for line in printed if line.startswith("ERROR")]) == 1, run.screen
    assert not processes_in(tmp_path)


# the plugin and LAMMPS's own fix draw the same numbers
NVT = 'fix 1 water python/move "fix_nosquish.NVT water molecule temp 295 295 100 {words}"'
HMC = 'fix 1 water python/move "fix_nosquish.HMC water molecule temp 295 steps 10 seed 71"'


@pytest.mark.parametrize(
    "words, ranks",
    [("seed 71", 1), ("seed 71", 2), ("seed 71 thermostat csvr", 2), ("thermostat nh", 2)],
)
def test_constant_temperature(run_water, words, ranks):
    """Locks out a thermostat that needs the plugin: LAMMPS's own fix has the same motion."""
    fix = NVT.format(words=words)
    _, plugin = run_water(fix, launcher="lmp")
    _, own = run_water(fix, ranks=ranks)
    assert np.abs(plugin - own).max() < 1e-7


@pytest.mark.parametrize("ranks", [1, 2])
def test_bodies_of_the_definition(run_lammps, tmp_path, ranks):
    """Locks out bodies that are decided anew at each run: by a variable that has changed since, or
    without a word by molecule-IDs that have."""
    system, ends = mixture("solid planar"), []
    before = f"{system.setup}\nvariable b atom mol*(step<5)\ntimestep {system.dt}\n"
    end = "write_dump all custom end id x y z modify sort id format float %.16g\n"
    for words in "molecule", "custom v_b":
        script = f"{before}{NVE.format(group='all', words=words)}\nrun 6\nrun 30\n{end}"
        run_lammps(script, files=system.files, launcher=debian(ranks))
        ends.append(np.loadtxt(tmp_path / "end", skiprows=9))
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-9)
    script = script.replace("run 30", "set atom 4*9 mol 1\nrun 30").replace(
        "custom v_b", "molecule"
    )
    run = run_lammps(script, files=system.files, launcher=debian(ranks), check=False)
    assert (
        run.code != 0 and "(with another molecule-ID or group: 4), or got other IDs" in run.screen
    )


def test_rank_that_loses_atoms_between_runs(run_water):
    """Locks out a crash, and bodies of other atoms, where a rank has fewer than in the last run."""
    _, one = run_water(OURS, "run 10\nrun 10")
    _, two = run_water(OURS, "run 10\nbalance 1.0 z 0.2\nrun 10", ranks=2)
    assert np.abs(one - two).max() < 1e-7


@pytest.mark.parametrize(
    "fix, says, ranks",
    [
        (
            NVT.format(words="seed 71").replace("295 295", "295 400"),
            "LAMMPS's own fix python/move does not tell where a run ends",
            1,
        ),
        (f"run_style respa 2 2 pair 2\n{OURS}", "run_style respa cannot be used with LAMMPS's", 2),
        (HMC, "gives no potential energy in", 1),
        (HMC, "gives no potential energy in", 2),
    ],
    ids=["ramp", "levels", "HMC", "HMC on 2 ranks"],
)
def test_what_needs_the_plugin(run_lammps, fix, says, ranks):
    """Locks out a ramp whose end is not known, and that is silently constant, and trajectories that
    are tested without an energy, or hang on one rank."""
    how = {"launcher": debian(ranks), "check": False, "timeout": SECONDS}
    done = run_lammps(SCRIPT.format(fix=fix, runs="run 10"), files={"data.ice": ice()}, **how)
    printed = [line for line in done.screen.splitlines() if says in line]
    assert done.code and len([line for line in printed if line.startswith("ERROR")]) == 1, (
        done.screen
    )


def test_a_failed_fix_goes_away(capfd):
    """Locks out a fix that lives on, and claims its atoms, because it holds its own error."""

    class Fix:
        def __init__(self):
            self.host = OwnFix(MagicMock(), ALONE, Line.quoted("NVE all molecule"))

        def fail(self):
            try:
                raise RunError("no atoms", everywhere=True)
            except RunError as error:
                self.host.end(error)

    gc.disable()
    try:
        fix = Fix()
        fix.fail()
        gone = weakref.ref(fix.host)
        del fix
        assert gone() is None
    finally:
        gc.enable()
    assert capfd.readouterr().err == "ERROR: no atoms\n"


def test_words_in_the_log(run_water):
    """Locks out lines on keywords, and warnings, that no log has: LAMMPS's own fix takes text for
    it only when the fix is defined."""
    line = line_of_class("fix_nosquish.NVT").format(
        group="water", words="molecule temp 300 300 100 seed 3 moments step"
    )
    log = run_water(f"timestep 300\n{line}", "run 0")[0].log
    for text in "principal moments: at least", "WARNING: the time step is 300":
        assert text in log
