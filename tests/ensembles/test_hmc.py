"""HMC: what a rejected trajectory leaves, what is sampled, ranks, restart, what it refuses."""

import sys
from itertools import product
from math import erfc, sqrt

import numpy as np
import pytest
from scipy import stats

from support.fixes import POINTS, fix_hmc, fix_nvt
from support.own_classes import MINE
from support.running import read_thermo
from support.sampling import (
    DIPOLES,
    DUMP,
    FIELD,
    FREE,
    PLACES,
    SMOOTH,
    assert_directions,
    body_momenta,
    distance_of_ends,
    dump_lines,
    gas,
    read_frames,
    thermo,
)
from support.systems import AFTER, SHAPES, droplet, mixture


def of_trajectories(every):
    """Lines for the outputs of the test of each trajectory."""
    return thermo("f_1[5] f_1[6] f_1[7]", every)


# ------------------------------------------------------------------ a trajectory


def test_reversible(run_system, tmp_path):
    """Locks out a trajectory that does not come back when its momenta are reversed: what makes the
    test of the energy right at any step."""
    system = mixture(side=2, spacing=2.9)
    words = fix_hmc("temp 2 steps 150 seed 7 mix v_none", "mine.Turns")
    run_system(
        system,
        f"{SMOOTH}timestep 0.004\n{words}run 0\n{DUMP.format('start')}run 150\n"
        f"{DUMP.format('middle')}run 150\n{DUMP.format('end')}",
        files={"mine.py": MINE},
    )
    start, middle, end = (
        np.loadtxt(tmp_path / name, skiprows=9)[:, 3:] for name in ("start", "middle", "end")
    )
    assert np.abs(start - end).max() < 1e-9
    assert np.abs(start - middle)[:, :3].max() > 0.3


@pytest.mark.quick("box-2")
@pytest.mark.parametrize(
    ("case", "ranks"), [*product(["box", "tilt", "points", "plane"], [1, 2, 4]), ("box", 8)]
)
def test_rejected(run_system, tmp_path, case, ranks):
    """Locks out anything that a rejected trajectory leaves behind: places, image flags, forces,
    energy and pressure are those of before, wherever atoms have come meanwhile, and on whatever
    rank; momenta are reversed. Bodies come further than a rank's part of the box."""
    if case == "plane":
        system = mixture("planar pair row single", side=4, spacing=2.9, dimension=2)
    else:
        system = mixture(side=3, spacing=2.9, tilt=0.3 if case == "tilt" else 0.0)
    words = "temp 400 steps 400 seed 7 mix v_none"
    before, group, flat = "", "all", ""
    if case == "points":
        before, group, words = POINTS, "stiff", f"{words} flexible loose"
    if case == "plane":
        flat = "fix 2 all enforce2d\n"
    words = fix_hmc(words, "mine.Rejects", group) + flat + thermo("press f_1[1] f_1[7]", 200)
    away_from_faces = f"displace_atoms all move 0.1 0.1 {0.0 if flat else 0.1}\n"
    done = run_system(
        system,
        f"{away_from_faces}{SMOOTH}{before}velocity all create 400 9\n"
        f"fix push all addforce 0.3 0 0\nfix_modify push energy yes\ntimestep 0.0015\n"
        f"{words}{dump_lines(200)}run 400\n",
        files={"mine.py": MINE},
        ranks=ranks,
    )
    start, away, end = read_frames(tmp_path)
    of_start, of_away, of_end = done.thermo
    box = np.diag(system.h)[: 2 if case == "plane" else 3].min()
    assert np.abs(away - start)[:, 3:6].max() > box / 2
    assert np.abs(away - start)[:, 12:].max() >= 1
    assert of_end["f_1[7]"] == 0
    for columns, exact in (slice(3, 6), 1e-12), (slice(6, 9), 1e-10):
        scale = np.abs(start[:, columns]).max()
        np.testing.assert_allclose(end[:, columns], start[:, columns], atol=exact * scale, rtol=0)
    np.testing.assert_allclose(end[:, 9:12], -start[:, 9:12], atol=1e-9, rtol=0)
    np.testing.assert_array_equal(end[:, 12:], start[:, 12:])
    for column, exact in ("PotEng", 1e-12), ("Press", 1e-10), ("f_1[1]", 1e-10):
        assert of_end[column] == pytest.approx(of_start[column], rel=exact), column
        assert of_end[column] != pytest.approx(of_away[column], rel=1e-3), column


@pytest.mark.parametrize("ranks", [1, 2])
def test_rejected_in_a_box_that_grows(run_lammps, tmp_path, ranks):
    """Locks out faces that stay where a rejected trajectory had taken them: those that follow the
    atoms go back with them."""
    system = droplet("s s s")
    words = fix_hmc("temp 4 steps 100 seed 7 mix v_none", "mine.Rejects") + thermo("lx ly lz", 50)
    script = f"{system.setup}\n{SMOOTH}velocity all create 40 9\ntimestep 0.004\n{words}"
    files = system.files | {"mine.py": MINE}
    rows = run_lammps(f"{script}{dump_lines(50)}run 100\n", files=files, ranks=ranks).thermo
    start, away, end = read_frames(tmp_path)
    assert np.abs(away - start)[:, 3:6].max() > 1
    np.testing.assert_allclose(end[:, 3:6], start[:, 3:6], atol=1e-11, rtol=0)
    for name in "Lx", "Ly", "Lz", "PotEng":
        of_start, of_away, of_end = rows[name]
        assert of_end == pytest.approx(of_start, rel=1e-11), name
        assert of_end != pytest.approx(of_away, rel=1e-3), name


@pytest.mark.parametrize("steps", [1, 10])
def test_looking_changes_nothing(run_system, tmp_path, steps):
    """Locks out a trajectory that goes on otherwise where something looks at it, and an energy that
    LAMMPS tallies only if something else asks for it."""
    system, ends = mixture(side=3, spacing=2.9), []
    words = fix_hmc(f"temp 2 steps {steps} seed 7 mix v_half")
    for every in (100, 1):
        done = run_system(
            system,
            f"{SMOOTH}timestep 0.04\n{words}{of_trajectories(every)}run 100\n{DUMP.format('end')}",
        )
        ends.append(np.loadtxt(tmp_path / "end", skiprows=9))
    np.testing.assert_array_equal(*ends)
    rows = done.thermo
    assert 0 < rows["f_1[5]"][-1] < 1
    tested = rows[steps::steps]
    np.testing.assert_allclose(
        tested["f_1[5]"], tested["f_1[7]"].cumsum() / np.arange(1, len(tested) + 1), rtol=1e-12
    )


# ------------------------------------------------------------------ distributions


def test_momenta(run_system, tmp_path):
    """Locks out momenta of a wrong strength for a mass, a moment, a kind of body, and some that
    are not drawn: without forces they stay as they are drawn."""
    system = gas()
    words = fix_hmc("temp 2 steps 5 seed 771")
    run_system(
        system, f"{FREE}velocity all set 0 0 0\ntimestep 0.002\n{words}run 5\n" + DUMP.format("end")
    )
    mass, momentum, _, along = body_momenta(tmp_path / "end")
    along = along[np.isfinite(along)]
    for numbers in (*(momentum / np.sqrt(2.0 * mass)[:, None]).T, along / sqrt(2.0)):
        assert stats.kstest(numbers, "norm").pvalue > 1e-3
    assert len(along) > 2 * len(mass)


def test_mix(run_system, tmp_path):
    """Locks out another share of noise than the one asked for: a trajectory keeps the root of
    1 - mix of the momenta that free bodies have."""
    system = gas()
    words = "variable most equal 0.75\n" + fix_hmc("temp 2 steps 5 seed 771 mix v_most")
    run_system(
        system,
        f"{FREE}timestep 0.002\n{words}run 60\n{DUMP.format('first')}run 5\n"
        + DUMP.format("second"),
    )
    (mass, one, *_), (_, two, *_) = (
        body_momenta(tmp_path / "first"),
        body_momenta(tmp_path / "second"),
    )
    kept = (one * two / mass[:, None]).sum() / (one**2 / mass[:, None]).sum()
    assert abs(kept - 0.5) < 4 * sqrt(0.75 / one.size), kept


@pytest.mark.parametrize(("mix", "seed"), [("1", 7), ("v_half", 8)])
def test_orientations(run_system, tmp_path, mix, seed):
    """Locks out a test that lets errors of the step pass, momenta that are not reversed, and a
    state that is not wholly that of before: in a field that pulls two atoms apart, directions have
    Langevin's distribution at a step at which a third of the trajectories is rejected."""
    system = mixture("solid", side=3, temperature=2.0)
    words = fix_hmc(f"temp 2 steps 5 seed {seed} mix {mix}") + of_trajectories(4000)
    rows = run_system(
        system, f"{FREE}{FIELD}{words}timestep 0.6\nrun 100\n{dump_lines(20, PLACES)}run 4000\n"
    ).thermo
    assert_directions(tmp_path, 27)
    assert 0.5 < rows["f_1[5]"][-1] < 0.8


WORLDS = f"""variable w world 0 1
log log.$w
{{setup}}
{FREE}{FIELD}
velocity all create 2.0 $(v_w+8) loop geom
fix 1 all nosquish/nvt molecule temp 2 2 0.5 seed 7
timestep 0.1
thermo_style custom step pe
thermo_modify norm no
thermo 10
run 8000
"""


def test_replicas_with_one_seed(run_lammps, tmp_path):
    """Locks out replicas of a partition that move alike, from whatever velocities, because their
    noise is the same: their energies are independent, with the mean of Langevin's function."""
    system, options = mixture("solid", side=3, temperature=2.0), ("-partition", "1", "1")
    text = WORLDS.format(setup=system.setup)
    run_lammps(text, files=system.files, ranks=2, launcher="lmp", options=options)
    logs = [(tmp_path / f"log.{w}").read_text() for w in (0, 1)]
    energies = np.array([read_thermo(log)["PotEng"][50:] for log in logs])
    independent = energies.size / 4  # of both; their correlation time is one sample or two
    assert abs(np.corrcoef(energies)[0, 1]) < 5 / sqrt(independent / 2)
    x = np.array(SHAPES["solid"][0])
    a = DIPOLES * np.linalg.norm(x[0] - x[1]) / 2.0
    mean = -27 * 2.0 * a * (1 / np.tanh(a) - 1 / a)
    assert abs(energies.mean() - mean) < 5 * energies.std() / sqrt(independent)


def test_acceptance(run_system):
    """Locks out a change of the energy that is not that of the trajectory: its exponential is 1 in
    the mean (Creutz, Phys. Rev. D 38, 1228, 1988), and from its mean follows how many trajectories
    are accepted (Gupta et al., Phys. Lett. B 242, 437, 1990)."""
    system = mixture("solid", side=4, spacing=2.4)
    words = fix_hmc("temp 1 steps 10 seed 7") + of_trajectories(10)
    rows = run_system(system, f"{SMOOTH}timestep 0.03\n{words}run 9000\n").thermo[101:]
    change, accepted = rows["f_1[6]"], rows["f_1[7]"]
    weight, n = np.exp(-change), len(change)
    goal = erfc(sqrt(change.mean()) / 2)
    assert abs(weight.mean() - 1) < 4 * weight.std() / sqrt(n)
    assert abs(accepted.mean() - np.minimum(weight, 1).mean()) < 4 * sqrt(0.25 / n)
    assert accepted.mean() == pytest.approx(goal, abs=0.05)


# ------------------------------------------------------------------ ranks, restart


@pytest.mark.parametrize("kinds", ["bodies", "points"])
def test_same_end(run_lammps, tmp_path, kinds):
    """Locks out noise or a decision that depends on the rank, bodies that go back elsewhere, and a
    run that goes on otherwise than one that did not stop: after a second run command, and from a
    restart file on another number of ranks, with what was counted."""
    system = mixture(side=3, spacing=2.9, tilt=0.3)
    words = "temp 2 steps 10 seed 13 mix v_half"
    bodies = (
        fix_hmc(words) if kinds == "bodies" else fix_hmc(f"{words} flexible loose", group="stiff")
    )
    start = f"{SMOOTH}timestep 0.025\n{bodies}{of_trajectories(10)}"
    begin, end = f"{system.setup}\n{POINTS}{start}", DUMP.format("end")
    runs = [(f"{begin}run 120\n{end}", ranks) for ranks in (1, 2, 4, 8)]
    parts = f"{begin}run 60\nwrite_restart middle\nrun 30\nrun 30 pre no\n{end}"
    runs += [(parts, 2), (f"read_restart middle\n{AFTER}{start}run 60\n{end}", 4)]
    accepted = []

    def run(*given, **how):
        accepted.append(run_lammps(*given, **how).thermo["f_1[5]"][-1])

    assert distance_of_ends(run, tmp_path, runs, system.files, system.h) < 1e-10
    assert 0 < accepted[0] < 1
    np.testing.assert_allclose(accepted, accepted[0], rtol=1e-12)


def test_restart_of_a_thermostat(run_system):
    """Locks out counts that are what a thermostat has left, and the other way round, and a chain
    that is filled with what another thermostat has left."""
    system = mixture(side=2, spacing=2.9)
    lines = fix_hmc("temp 2 steps 5 seed 7"), fix_nvt("seed 7 thermostat csvr", "2 2 2e-1")
    chain = fix_nvt("thermostat nh", "2 2 2e-1")
    for first, second, says in (
        (*lines, "has the state of another thermostat"),
        (*lines[::-1], "has no state of hybrid Monte Carlo"),
        (lines[1], chain, "this one begins anew"),
    ):
        assert (
            says
            in run_system(
                system,
                f"timestep 0.004\n{first}run 10\nwrite_restart middle\nclear\nread_restart middle\n"
                f"{second}run 10\n",
            ).log
        )


# ------------------------------------------------------------------ what is refused


HALT = "variable now equal step\nfix 2 all halt 5 v_now >= 15 error continue\nrun 40\n"


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ("thermo 10\nrun 40\n", None),
        ("thermo 5\nrun 40\n", "LAMMPS writes output in step 5, within a trajectory"),
        (
            "thermo 10\nrestart 15 keep\nrun 40\n",
            "LAMMPS writes output in step 15, within a trajectory",
        ),
        (
            "thermo 10\nfix 2 all ave/time 1 10 10 c_thermo_pe\nrun 40\n",
            "fix 2 (style ave/time) looks every 1 steps, within a trajectory",
        ),
        (HALT, "WARNING: the run has ended in step 15, within a trajectory"),
        ("minimize 0 0 5 100\nrun 15\n", None),
    ],
    ids=["each", "thermo", "restart", "fix", "halt", "minimize"],
)
def test_what_looks_within_a_trajectory(run_system, lines, says):
    """Locks out averages over configurations that no test has passed, and steps without a test
    where another fix ends the run, without a word; and a minimization that is refused unless its
    steps are a multiple of a trajectory's, or that is said to have ended within one."""
    log = run_system(mixture(side=2), fix_hmc("temp 2 steps 10 seed 5") + lines).log
    assert log.count("of hybrid Monte Carlo: what is there was not tested") == bool(says)
    assert says in log if says else "within a trajectory" not in log


def test_others_that_are_harmless(run_lammps):
    """Locks out the refusal of fixes that only read, or whose energy is tested."""
    system = mixture(side=2)
    others = FIELD + "fix 2 all ave/time 5 2 10 c_thermo_pe\nfix 3 all store/state 10 x y z\n"
    others += "fix 4 all balance 20 1.1 shift xyz 5 1.1\n"
    words = fix_hmc("temp 2 steps 10 seed 5") + of_trajectories(10)
    rows = run_lammps(f"{system.setup}\n{others}{words}run 40\n", files=system.files, ranks=2)
    assert rows.thermo["f_1[5]"][-1] > 0


DRIVEN = """
import sys
from lammps import lammps

lmp = lammps()
lmp.file(sys.argv[1])
lmp.command("uncompute 1_energy")
try:
    lmp.command("run 5 pre no")
except Exception as error:
    print("SAID", error)
print("STEP", lmp.extract_global("ntimestep"))
"""


def test_an_error_where_the_energy_is_asked_for(run_system, tmp_path):
    """Locks out a step's number that stays another one, where a compute ends the run by an error
    and a Python driver goes on."""
    (tmp_path / "drive.py").write_text(DRIVEN)
    system = mixture(side=2, spacing=2.9)
    run = run_system(
        system,
        f"{fix_hmc('temp 300 steps 5 seed 3')}run 5\n",
        launcher=[sys.executable, "drive.py"],
    )
    assert "compute 1_energy is gone" in run.screen
    assert "STEP 6" in run.screen, run.screen
