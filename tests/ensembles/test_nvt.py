"""NVT: distributions, decay, conserved energy, reversibility, ranks, restart, what it refuses."""

import re
from math import exp, sqrt
from zlib import crc32

import numpy as np
import pytest
from scipy import stats

from fix_nosquish.integrators import csvr
from fix_nosquish.integrators.nose_hoover import NoseHoover
from fix_nosquish.integrators.rescaling import Scales
from fix_nosquish.motion import philox
from support.builds import NUMBER
from support.fixes import POINTS, THERMOSTATS, fix_nvt, fix_nvt_with_points
from support.sampling import (
    DUMP,
    FREE,
    SMOOTH,
    body_momenta,
    distance_of_ends,
    gas,
    reverse,
    spreads,
    thermo,
)
from support.systems import AFTER, line_of_class, mixture

# ------------------------------------------------------------------ random numbers


def test_known_answers():
    """Locks out a Philox that is not the published one: the answers are those of Random123."""
    for counter, key, answer in (
        ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
        ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
        (
            (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
            (0xA4093822, 0x299F31D0),
            (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
        ),
    ):
        assert philox.philox(*counter, *key) == answer


def test_normal_numbers():
    """Locks out a logarithm or an angle that is wrong somewhere: against those of `math`, at words
    where their formulas change, and the tails of the distribution."""
    random = np.random.default_rng(5).integers(0, 2**32, 3000).tolist()
    edges = [e + d for e in (2**k for k in range(1, 32)) for d in (-1, 0, 1)]
    words = np.array([0, *edges, 2**32 - 1, *random])
    of_words = np.array([philox.minus_log(w) for w in words.tolist()])
    np.testing.assert_allclose(of_words, -np.log((words + 1) / 2**32), rtol=1e-15, atol=1e-16)
    turns = 2 * np.pi * ((words + 0.5) / 2**32) - np.pi / 4
    actual = np.array([philox.direction(w) for w in words.tolist()])
    expected = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    np.testing.assert_allclose(actual, expected, atol=3e-15)
    pairs = np.array([philox.normal_pair(w, w) for w in words.tolist()])
    long = np.sqrt(-2 * np.log((words + 1) / 2**32))[:, None]
    np.testing.assert_allclose(pairs, long * expected, rtol=0, atol=1e-13)


def test_what_is_drawn(run_system, tmp_path):
    """Locks out compiled numbers that are not those of seed, body and step: a body at rest has
    after one step the velocity that the noise alone gives it."""
    system = mixture(side=2)
    words = fix_nvt(THERMOSTATS["langevin"])
    run_system(
        system, f"{FREE}velocity all set 0 0 0\ntimestep 0.002\n{words}run 1\n" + DUMP.format("end")
    )
    mass, momentum, *_ = body_momenta(tmp_path / "end")
    expected = []
    for body in range(1, len(mass) + 1):
        w = philox.words(float(body), 1, 0, 771, crc32(b"all molecule") & 0xFFFFFFFE)
        expected.append([*philox.normal_pair(*w[:2]), philox.normal_pair(*w[2:])[0]])
    noise = sqrt(2.0 * (1 - exp(-2 * 0.002 / 4e-3)))
    np.testing.assert_allclose(
        momentum / np.sqrt(mass)[:, None], noise * np.array(expected), rtol=1e-12
    )


# ------------------------------------------------------------------ what it computes


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_the_configurations_part_of_the_shadow_hamiltonian(run_system, tmp_path, ranks):
    """Locks out forces of another step than the one that is printed, torques about other axes, a
    body that two ranks count, and another factor: from the atoms' forces, with axes of numpy's."""
    accelerations = "".join(f"variable a{k} atom f{k}/mass\n" for k in "xyz")
    lines = f"{accelerations}{SMOOTH}timestep 0.002\n{fix_nvt(THERMOSTATS['csvr'])}"
    dump = DUMP.format("end").replace("vx vy vz", "v_ax v_ay v_az")
    rows = run_system(
        mixture(side=4), f"{lines}{thermo('f_1[5]', 7)}run 7\n{dump}", ranks=ranks
    ).thermo
    mass, force, _, along = body_momenta(tmp_path / "end")  # torques over roots of moments
    expected = (force**2 / mass[:, None]).sum() + np.nansum(along**2)
    assert rows["f_1[5]"][-1] == pytest.approx(0.002**2 / 24 * expected, rel=1e-9)


# ------------------------------------------------------------------ distributions


@pytest.mark.parametrize("name", ["langevin", "csvr", "separate"])
def test_free_bodies_have_the_exact_distribution(run_lammps, tmp_path, name):
    """Locks out noise of a wrong strength for a mass, a moment, a kind of body; an axis that is
    left out; noise that translation and rotation share; an energy that flows between them. There
    are no forces: each velocity and each component of the angular momentum is normal, and they are
    independent."""
    system = gas()
    script = f"{system.setup}\n{FREE}timestep 0.002\n{fix_nvt(THERMOSTATS[name])}run 60\n"
    # momenta forget as exp(-t / 2 steps); the others leave each its direction
    frames = range(8 if name == "langevin" else 1)
    script += "".join(DUMP.format(f"end{k}") + "run 20\n" for k in frames)
    run_lammps(script, files=system.files)
    results = [body_momenta(tmp_path / f"end{k}") for k in frames]
    moves = np.concatenate([one[1] / np.sqrt(2.0 * one[0])[:, None] for one in results])
    turns = np.concatenate([one[3] for one in results]) / sqrt(2.0)
    spins = np.concatenate([one[2] for one in results])
    assert np.abs(np.corrcoef(moves.T, spins.T)[:3, 3:]).max() < 4.5 / sqrt(len(moves))
    for numbers in (*moves.T, *turns.T):
        numbers = numbers[np.isfinite(numbers)]
        assert stats.kstest(numbers, "norm").pvalue > 1e-3
        if name == "langevin":  # of each body by itself; the others know the energy of all
            below = stats.chi2(len(numbers)).cdf((numbers**2).sum())
            assert 1e-4 < below < 1 - 1e-4, (numbers**2).mean()


def test_in_the_plane(run_system, tmp_path):
    """Locks out noise out of the plane, and rotation about another axis than z."""
    system = mixture("planar pair row single", side=10, dimension=2, temperature=0.5)
    words = fix_nvt(THERMOSTATS["langevin"]) + "fix 2 all enforce2d\n"
    run_system(system, f"{FREE}timestep 0.002\n{words}run 60\n" + DUMP.format("end"))
    mass, momentum, turn, along = body_momenta(tmp_path / "end")
    assert not momentum[:, 2].any()
    assert np.abs(turn[:, :2]).max() < 1e-12
    # of one about z, with its sign; without a moment there is none
    spins = np.sign(turn[:, 2]) * np.linalg.norm(np.nan_to_num(along), axis=1)
    for numbers in (
        *(momentum[:, :2] / np.sqrt(2.0 * mass)[:, None]).T,
        spins[np.isfinite(along).any(axis=1)] / sqrt(2.0),
    ):
        assert stats.kstest(numbers, "norm").pvalue > 1e-3


@pytest.mark.parametrize("style", ["", "run_style respa 2 4 pair 2\n"], ids=["verlet", "respa"])
def test_friction_of_langevin(run_system, tmp_path, style):
    """Locks out a friction that is not 1 / TDAMP, that of the outer step of run_style respa, or
    another one for rotation: momenta are forgotten as exp(-t / TDAMP).  And draws that repeat
    within a step: free bodies have the temperature."""
    system = gas()
    words = fix_nvt(THERMOSTATS["langevin"], "2 2 2e-2") + thermo("f_1[3] f_1[4]", 60)
    rows = run_system(
        system,
        f"{FREE}{style}timestep 0.002\n{words}run 60\n{DUMP.format('first')}run 5\n"
        f"{DUMP.format('second')}",
    ).thermo
    for column, axes in ("f_1[3]", 3), ("f_1[4]", 2):
        assert rows[column][1] == pytest.approx(2, rel=5 * sqrt(2 / (axes * 216)))
    one, two = body_momenta(tmp_path / "first"), body_momenta(tmp_path / "second")
    for before, after in zip(one[1:3], two[1:3]):
        kept = (before * after).sum() / (before**2).sum()
        spread = sqrt((1 - exp(-1.0)) / (before**2).sum() ** 2 * (before**4).sum())
        assert abs(kept - exp(-0.5)) < 4 * spread, (kept, spread)


@pytest.mark.parametrize(("name", "damping", "every"), [("csvr", "2e-2", 20), ("nh", "1e-1", 50)])
def test_kinetic_energy_is_canonical(run_system, name, damping, every):
    """Locks out a thermostat that keeps the mean and not the distribution, as one that scales to
    the target does, and degrees of freedom that are miscounted: few bodies, with forces."""
    system = mixture(side=2, spacing=2.9)
    words = fix_nvt(THERMOSTATS[name], f"2 2 {damping}") + thermo("f_1[1] f_1[2]", every)
    rows = run_system(system, f"{SMOOTH}timestep 0.002\n{words}run {1200 * every}\n").thermo[200:]
    energy = rows["f_1[1]"] + rows["f_1[2]"]
    kinds = ["solid", "planar", "pair", "row", "single", "solid", "planar", "pair"]
    degrees = sum({"pair": 5, "row": 5, "single": 3}.get(kind, 6) for kind in kinds) - 3
    assert stats.kstest(energy[::2], "gamma", (degrees / 2, 0, 2.0)).pvalue > 1e-3


@pytest.mark.parametrize("degrees", [1, 2, 7, 12])
def test_mean_of_a_rescaling(degrees):
    """Locks out degrees of freedom that are miscounted by one: a kinetic energy that is the mean
    one stays so in the mean, however fast it is damped."""
    bath = Scales(rate=2.0, kt=1.5, degrees=degrees, energies=1.5 * degrees, key_0=5)
    squares = []
    for bath.step in range(20000):
        squares.append(csvr.draw_factor(bath, None, 0, 0.4)[0] ** 2)
    error = np.std(squares) / sqrt(len(squares))
    assert abs(np.mean(squares) - 1.0) < 4 * error < 0.25 / degrees


# ------------------------------------------------------------------ what is conserved


@pytest.mark.parametrize("name", ["langevin", "csvr", "nh", "chains"])
def test_effective_energy(run_lammps, name):
    """Locks out an energy of the thermostat that leaves something out: econserve keeps its value
    but for an error that goes as the square of the step, while the energy itself changes."""
    system = mixture(side=3, spacing=2.9)
    line = fix_nvt(THERMOSTATS[name], "2 2 2e-1")
    ratios, _ = spreads(run_lammps, f"{system.setup}\n{SMOOTH}", line, system.files)
    if name in ("nh", "chains"):  # the noise of the others has another path for each time step
        assert ratios == pytest.approx([4, 4], rel=0.15)
    assert np.prod(ratios) > 5


@pytest.mark.parametrize("name", ["nh", "chains"])
def test_chains_are_reversible(run_system, tmp_path, name):
    """Locks out a chain, or a place of it in the step, that is not symmetric in time."""
    system = mixture(side=2, spacing=2.9)
    reverse(run_system, tmp_path, system, fix_nvt(THERMOSTATS[name] + " reinit no", "2 2 1e-1"))


HALVES = """
from fix_nosquish import of_fix_line
from fix_nosquish.integrators.csvr import Csvr
from fix_nosquish.integrators.nose_hoover import NoseHoover
from fix_nosquish.integrators.nvt import NVT

class LetterByLetter(Csvr):
    merged = None

class ChainsLetterByLetter(NoseHoover):
    merged = None

class Halves(NVT):
    thermostats = {"csvr": LetterByLetter, "nh": ChainsLetterByLetter}

__getattr__ = of_fix_line(Halves)
"""


def test_both_halves_are_one_motion(run_system, tmp_path):
    """Locks out a motion that is not the two around the thermostat: of points, linear bodies,
    rotors and such as are held, it is what the splitting says, done letter by letter."""
    system, files = mixture(side=2, spacing=2.9), {"halves.py": HALVES}
    held = THERMOSTATS["csvr"] + " force 2 off on on torque 3 off off off"
    for words in THERMOSTATS["csvr"], THERMOSTATS["nh"], THERMOSTATS["separate"], held:
        words, ends = f"molecule temp 2 2 5e-2 {words} rotor exact", []
        for line in "fix 1 {group} nosquish/nvt {words}", line_of_class("halves.Halves"):
            fix = line.format(group="all", words=words)
            run_system(
                system,
                f"{SMOOTH}timestep 0.004\n{fix}\nrun 60\n{DUMP.format('end')}",
                files=files,
                timeout=280,
            )  # the first one compiles
            ends.append(np.loadtxt(tmp_path / "end", skiprows=9)[:, 3:])
        assert np.abs(ends[0] - ends[1]).max() < 1e-9, words


# ------------------------------------------------------------------ velocities that atoms have


def test_temperature_is_that_of_the_middle(run_system):
    """Locks out velocities of the step's end, which are too cold: at a long step the printed
    temperature is the target, and a first run starts with the velocities that atoms have."""
    system = mixture("solid", side=5, spacing=2.4)
    words = fix_nvt("seed 3", "1 1 5e-2") + thermo("f_1[3] f_1[4] f_1", 10)
    rows = run_system(
        system, f"{SMOOTH}velocity all create 1.5 7 loop geom\n{words}timestep 0.012\nrun 6000\n"
    ).thermo
    assert rows["Temp"][0] == pytest.approx(1.5, rel=0.15)  # as rigid motion, of few bodies
    later = rows[100:]
    assert later["f_1[3]"].mean() == pytest.approx(1.0, abs=0.02)
    assert later["f_1[4]"].mean() == pytest.approx(1.0, abs=0.03)
    assert later["Temp"].mean() == pytest.approx(1.0, abs=0.02)


RESET = "fix 3 all dt/reset 10 1e-4 2e-3 5e-3 units box\n"


@pytest.mark.parametrize("name", ["langevin", "nh"])
def test_time_step_that_changes(run_system, name):
    """Locks out velocities and energies of the step's end, or a half kick of another length, in a
    step in which the time step changes: econserve keeps its value there as elsewhere. And bodies
    that go on with the old one."""
    system = mixture(side=3, spacing=2.9)
    words = fix_nvt(THERMOSTATS[name], "2 2 2e-1") + RESET + thermo("dt econserve time v_x", 1)
    rows = run_system(
        system,
        f"{SMOOTH}timestep 0.002\nvelocity all set 0.3 NULL NULL sum yes\n"
        f"variable x equal xcm(all,x)\n{words}run 100\n",
    ).thermo
    steps = rows["Dt"][1:]
    assert len(np.unique(steps)) > 3
    changed = np.flatnonzero(np.diff(rows["Dt"]))
    jumps = np.abs(np.diff(rows["Econserve"]))
    usual = np.delete(jumps, np.concatenate([changed - 1, changed]))
    assert jumps.max() < 2 * usual.max()
    if name == "nh":  # no noise
        speeds = np.diff(rows["v_x"]) / np.diff(rows["Time"])
        np.testing.assert_allclose(speeds[1:], speeds[:-1], rtol=1e-2)


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    "reset, steps", [("", 10), ("", 55), (RESET, 55)], ids=["last step", "before", "and time step"]
)
def test_velocities_that_other_fixes_change(run_system, tmp_path, reset, steps, ranks):
    """Locks out velocities that another fix gives atoms at the end of a step, of the last one or of
    one in which the time step changes, too, and that the bodies ignore."""
    system = mixture(side=3, spacing=2.9)
    words = "velocity all set 0.3 NULL NULL sum yes\n" + fix_nvt("seed 3", "2 2 2e3")
    words += reset + "fix 2 all momentum 10 linear 1 1 1\n"
    log = run_system(
        system, f"timestep 0.002\n{words}run {steps}\n" + DUMP.format("end"), ranks=ranks
    ).log
    momentum = body_momenta(tmp_path / "end")[1]
    assert "the bodies take them over" in log
    assert abs(momentum.sum(axis=0)[0]) < 1e-2 * np.abs(momentum[:, 0]).sum()


@pytest.mark.parametrize("every", [1, 100])
def test_step_of_a_force_that_is_not_finite(refused, every):
    """Locks out the number of the step before, where the end of a step is left to the next one."""
    system = mixture(side=2, spacing=2.9)
    push = "variable f equal exp(800*(step>6))-1\ngroup g id 7\nfix 2 g addforce v_f 0 0\n"
    script = f"{system.setup}\n{fix_nvt('seed 3')}{push}thermo {every}\nrun 20\n"
    refused(script, "is not finite at step 7", system.files)


# ------------------------------------------------------------------ ranks, restart, several runs

CELLS = {
    "": "",
    "crescale": "iso 12e-2 12e-2 2e-1 every 5 compressibility 8 ",
    "mtk": "iso 12e-2 12e-2 2e-1 every 5 barostat mtk ",
}


@pytest.mark.parametrize(
    ("name", "cell"),
    [*((name, cell) for name in ("langevin", "nh") for cell in CELLS), ("NPH", "mtk")],
)
def test_another_time_step_in_the_next_run(run_lammps, tmp_path, name, cell):
    """Locks out the half kick that one run leaves to the next one, done with the next one's time
    step: econserve of one and the same step jumped, and the run went on from another state than
    with 'pre no' or in one run.  A restart file keeps the step, too."""
    system = mixture(side=3, spacing=2.9)
    seed = "seed 771 " if cell == "crescale" and name == "nh" else ""
    line = fix_nvt(f"{THERMOSTATS.get(name, '')} {seed}{CELLS[cell]}", "2 2 2e-1")
    if cell:
        line = line.replace("nosquish/nvt", "nosquish/npt")
    if name == "NPH":
        cell = CELLS[cell].replace("barostat mtk", "")
        line = f"fix 1 all nosquish/nph molecule {cell}\n"
    begin = f"{system.setup}\n{SMOOTH}"
    line += thermo("econserve", 13)
    first, other, end = "timestep 0.004\nrun 53\n", "timestep 0.002\n", DUMP.format("end")
    second, restarted = f"{other}run 0\nrun 47\n", f"clear\nread_restart middle\n{SMOOTH}"
    scripts = [
        (f"{begin}{line}{first}{other}run 47 pre no\n{end}", 1),
        (f"{begin}{line}{first}{second}{end}", 1),
        (f"{begin}{line}{first}write_restart middle\n{second}{end}", 2),
        (f"{begin}{line}{first}write_restart middle\n{restarted}{AFTER}{line}{second}{end}", 1),
    ]
    assert distance_of_ends(run_lammps, tmp_path, scripts, system.files, system.h) < 1e-10
    rows = run_lammps(scripts[-1][0], files=system.files).thermo
    border = rows["Econserve"][rows["Step"] == 53]
    assert len(border) == 3  # the last one of a run, and the first ones of two
    np.testing.assert_allclose(border, border[0], rtol=1e-11)


def test_levels_before_and_after(run_lammps):
    """Locks out a half kick that is left out, or done twice, where a run with run_style respa comes
    before or after one without: econserve is continuous."""
    system = mixture(side=3, spacing=2.9)
    line = fix_nvt(THERMOSTATS["nh"], "2 2 2e-1") + thermo("econserve", 10)
    levels, plain = "run_style respa 2 2 pair 2\n", "run_style verlet\n"
    script = f"{system.setup}\n{SMOOTH}timestep 0.002\n{line}"
    runs = f"run 50\n{levels}run 0\n{plain}run 50\n{levels}run 50\n{plain}run 50\n"
    rows = run_lammps(f"{script}{runs}", files=system.files).thermo
    for step in 50, 100, 150:
        border = rows["Econserve"][rows["Step"] == step]
        np.testing.assert_allclose(border, border[0], rtol=1e-11)


FORGETS = fix_nvt(THERMOSTATS["langevin"], "2 2 1e-2")
TRIES = "fix 1 all nosquish/hmc molecule temp 2 steps 5 seed 771\n"


@pytest.mark.parametrize(
    ("line", "between"),
    [
        *((FORGETS, words) for words in ("", "clear", "write_restart kept", "write_data kept")),
        (FORGETS, "run 0"),
        (TRIES, ""),
    ],
    ids=["nothing", "clear", "write_restart", "write_data", "run 0", "HMC"],
)
def test_noise_does_not_repeat(run_lammps, tmp_path, line, between):
    """Locks out random numbers that repeat where the step counter goes back, whatever stands before
    that: free bodies that forget their velocities fast would have the same ones again."""
    system = mixture(side=4)
    words = f"{FREE}timestep 0.01\n{line}"
    script = f"{system.setup}\n{words}run 20\n{DUMP.format('one')}{between}\n"
    again = "run 20\n"
    if between == "clear":
        script = script.replace("clear", "write_restart kept\nclear\nread_restart kept")
        again = f"neighbor 0.4 bin\n{words}run 20\n"
    script += f"reset_timestep 0\n{again}{DUMP.format('two')}"
    script += f"{between if between != 'clear' else ''}\nreset_timestep 0\nrun 20\n"
    run_lammps(script + DUMP.format("three"), files=system.files)
    results = [body_momenta(tmp_path / name)[1].ravel() for name in ("one", "two", "three")]
    assert np.abs(np.corrcoef(results) - np.eye(3)).max() < 0.4  # 192 numbers


def test_noise_does_not_repeat_by_pre_no(run_lammps, refused):
    """Locks out random numbers that repeat in a run with 'pre no', for which LAMMPS asks nothing
    anew, behind a command that asked."""
    system = mixture(side=4)
    script = f"{system.setup}\n{FREE}timestep 0.01\n{FORGETS}"
    script += "thermo_style custom step\nrun 20\nwrite_restart kept\n"
    run_lammps(script + "run 5 pre no\n", files=system.files)
    script += "reset_timestep 0\nrun 5 pre no\n"
    refused(script, "step counter has gone back", system.files)


def test_ramp(run_system):
    """Locks out a temperature that does not go from TSTART to TSTOP over the run, or over the steps
    that run's start and stop name."""
    system = gas()
    words = fix_nvt("seed 3", "1 3 4e-3") + thermo("f_1[3]", 50)
    runs = "run 200\nrun 100 start 0 stop 600\nrun 100\n"
    rows = run_system(system, f"{FREE}timestep 0.002\n{words}{runs}").thermo
    expected = {200: 3.0, 300: 2.0, 100: 2.0, 350: 2.0, 400: 3.0}
    degrees = 3 * 216
    for step, goal in expected.items():
        actual = rows["f_1[3]"][rows["Step"] == step][-1]
        assert abs(actual / goal - 1) < 5 * sqrt(2 / degrees) + 0.02, (step, actual)


# ------------------------------------------------------------------ components that are off


def test_components_that_are_off(run_system, tmp_path):
    """Locks out noise on what keywords force and torque switch off: these components stay."""
    system = mixture("solid", side=3, spacing=2.9)
    words = " force 1*5 off on on torque 6*9 off off off"
    run_system(
        system,
        f"timestep 0.002\n{fix_nvt(THERMOSTATS['langevin'] + words)}run 0\n"
        f"{DUMP.format('start')}run 50\n{DUMP.format('end')}",
    )
    one, two = body_momenta(tmp_path / "start"), body_momenta(tmp_path / "end")
    np.testing.assert_allclose(one[1][:5, 0], two[1][:5, 0], rtol=1e-12)
    np.testing.assert_allclose(one[2][5:9], two[2][5:9], rtol=1e-10)
    assert np.abs(one[1][:5, 1:] - two[1][:5, 1:]).min() > 1e-3
    assert np.abs(one[2][9:] - two[2][9:]).max(axis=1).min() > 1e-2


def test_degrees_of_freedom_that_are_off(run_system):
    """Locks out a kinetic energy that counts what cannot change: half of the bodies cannot turn,
    and rescaling gives the others their temperature."""
    system = mixture("solid", side=6, spacing=2.9)
    words = THERMOSTATS["csvr"] + " torque 1*108 off off off"
    rows = run_system(
        system,
        f"{FREE}velocity all set 0 0 0\nvelocity all create 2 7 loop geom rot yes\n"
        f"timestep 0.002\n{fix_nvt(words)}{thermo('f_1[1] f_1[2]', 10)}run 1500\n",
    ).thermo
    kept = rows["f_1[2]"][0] / 2  # about: the part of those that cannot turn
    goal = 0.5 * 2.0 * (216 * 3 + 108 * 3)
    total = rows["f_1[1]"] + rows["f_1[2]"] - kept
    assert total[20:].mean() == pytest.approx(goal, rel=0.05)


@pytest.mark.parametrize("ranks", [1, 2])
def test_momentum_that_is_no_heat(run_system, ranks):
    """Locks out a drift of the whole that is taken as heat without a word, and a word where there
    is none."""
    system = mixture(side=3, spacing=2.9)
    drift = "velocity all set 0.5 NULL NULL sum yes\n"
    said = "the bodies' total momentum has"
    for more, words, warns in (
        (drift, "csvr", True), (drift, "langevin", False), ("", "csvr", False), (drift, "nh", True),
    ):  # fmt: skip
        start = "velocity all create 2 7 loop geom mom yes\n" + more
        assert (
            said
            in run_system(
                system, f"{start}{fix_nvt(THERMOSTATS[words], '2 2 2e-1')}run 0\n", ranks=ranks
            ).log
        ) is warns


def test_momentum_that_others_take(run_lammps):
    """Locks out a momentum that is counted out though atoms in no body may take it."""
    script = (
        "units lj\natom_modify map yes\nregion box block -9 9 -9 9 -9 9\ncreate_box 1 box\n"
        "create_atoms 1 random 10 7 box\nmass 1 1\npair_style zero 2.5\npair_coeff * *\n"
        "group own id 1:8\ngroup rest subtract all own\nvelocity all create 2 9\n"
        "timestep 0.05\nvariable own atom id\nfix 2 rest nve\n"
        "fix 1 own nosquish/nvt custom v_own temp 2 2 0.5 seed 5 thermostat csvr\n"
        f"{thermo('f_1[1]', 50)}run 20000\n"
    )
    kinetic = run_lammps(script).thermo["f_1[1]"][20:]
    assert kinetic.mean() == pytest.approx(24.0, abs=1.2)  # or 21


@pytest.mark.parametrize("name", ["csvr", "nh"])
def test_time_of_rescaling(run_lammps, name):
    """Locks out a damping that is not TDAMP: the kinetic energy of free bodies forgets where it was
    as exp(-t / TDAMP), and swings about a near target with the period sqrt(2) pi TDAMP."""
    system, damping = gas(), 0.4
    words, goal = (THERMOSTATS["csvr"], 1.0) if name == "csvr" else ("thermostat nh tchain 1", 1.8)
    script = f"{system.setup}\n{FREE}timestep 0.002\nvariable goal equal {goal}\n"
    script += fix_nvt(words, "v_goal v_goal 4e-1") + thermo("", 10) + "run 2000\n"
    rows = run_lammps(script, files=system.files).thermo
    times, off = 0.002 * rows["Step"], rows["Temp"] / goal - 1.0
    if name == "csvr":
        kept = off[np.argmin(np.abs(times - damping))] / off[0]
        assert kept == pytest.approx(exp(-1.0), abs=0.15)
    else:
        turns = times[np.flatnonzero(np.diff(np.sign(off)))]
        assert 2 * np.diff(turns).mean() == pytest.approx(sqrt(2) * np.pi * damping, rel=0.1)


def test_noise_of_two_fixes(run_lammps, tmp_path):
    """Locks out two fixes whose bodies of the same number have the same noise."""
    system = mixture("pair", side=2)
    groups = "".join(f"group {name} molecule {k}\n" for k, name in enumerate("abcd", 1))
    line = "fix {0} all nosquish/nvt group 2 {1} temp 2 2 4e-3 seed 771\n"
    script = f"{system.setup}\n{FREE}{groups}velocity all set 0 0 0\ntimestep 0.002\n"
    script += line.format(1, "a b") + line.format(2, "c d") + f"run 1\n{DUMP.format('end')}"
    run_lammps(script, files=system.files)
    momenta = body_momenta(tmp_path / "end")[1][:4]
    assert np.abs(momenta).min() > 0
    assert np.abs(momenta[:2] - momenta[2:]).min() > 1e-6


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("separate", ["yes", "no"])
@pytest.mark.parametrize("name", ["csvr", "nh"])
def test_a_thermostat_waits(run_system, name, separate, ranks):
    """Locks out a run that ends because bodies are at rest, or do not rotate: there a thermostat
    that scales velocities has nothing to do, and the other motion is at its temperature."""
    system = mixture("solid", side=3)
    line = f"molecule temp 2 2 2e-2 {THERMOSTATS[name]} separate {separate}"
    run = run_system(
        system,
        f"{FREE}velocity all set 0 0 0\ntimestep 0.002\nfix 1 all rigid/nvt/nosquish {line}\n"
        f"{thermo('f_1[1] f_1[2]', 5)}run 10\nvelocity all create 2 5\n"
        f"velocity all zero angular rigid 1\nrun 600\n",
        ranks=ranks,
    )
    assert not run.thermo["f_1[1]"][:3].any() and run.thermo["f_1[2]"].max() < 1e-25
    motions = ("translation", "rotation") if separate == "yes" else ("motion",)
    method = {"csvr": csvr.Csvr, "nh": NoseHoover}[name].method
    for motion in motions:
        assert f"the bodies have no {motion} that {method} could scale" in run.log
    degrees = 3 * 27 - 3 + 3 * 27 * (separate == "no")
    assert run.thermo["f_1[1]"][60:].mean() == pytest.approx(degrees, rel=0.1)


# ------------------------------------------------------------------ atoms as points


def test_energy_for_each_atom(run_system):
    """Locks out an energy of the thermostat that is not divided by the number of atoms where
    'thermo_modify norm yes' has all energies divided, or a temperature that is."""
    system, rows = mixture(side=2), {}
    for norm in "yes", "no":
        words = fix_nvt(THERMOSTATS["csvr"]) + thermo("f_1 f_1[3]", 10)
        rows[norm] = run_system(
            system, f"timestep 0.004\n{words}thermo_modify norm {norm}\nrun 10\n"
        ).thermo[-1]
    whole, each = rows["no"], rows["yes"]
    assert abs(whole["f_1"]) > 1e-3
    assert each["f_1"] * len(system.mass) == pytest.approx(whole["f_1"], rel=1e-12)
    assert each["f_1[3]"] == whole["f_1[3]"]


def test_points_move_as_with_nve(run_system, tmp_path):
    """Locks out points that miss forces, or feel those of a body: without a thermostat they move as
    fix nve has them beside the bodies."""
    system, ends = mixture(side=3, spacing=2.9), []
    one = "fix 1 stiff nosquish/nve molecule flexible loose\n"
    two = "fix 1 stiff nosquish/nve molecule\nfix 2 loose nve\n"
    for words in (one, two):
        rows = run_system(
            system,
            f"{POINTS}{words}{thermo('press', 50)}timestep 0.002\nrun 100\n" + DUMP.format("end"),
        ).thermo
        ends.append((np.loadtxt(tmp_path / "end", skiprows=9), rows["Temp"], rows["Press"]))
    for a, b in zip(*ends, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)


def test_points_have_the_temperature(run_system, tmp_path):
    """Locks out points without noise, or with that of another mass."""
    system = gas()
    groups = "group loose molecule 1:150\ngroup stiff subtract all loose\n"
    words = fix_nvt_with_points(THERMOSTATS["langevin"], "2 2 4e-3").replace(POINTS, groups)
    log = run_system(system, f"{FREE}timestep 0.002\n{words}run 60\n{DUMP.format('end')}").log
    atoms = np.loadtxt(tmp_path / "end", skiprows=9)
    loose = atoms[atoms[:, 1] <= 150]
    for component in (loose[:, 6:] * np.sqrt(loose[:, 2:3] / 2.0)).T:
        assert stats.kstest(component, "norm").pvalue > 1e-3
    assert f"{len(loose)} flexible atoms, of group loose" in log
    assert "  66 rigid bodies with" in log


@pytest.mark.parametrize("ranks", [1, 4])
@pytest.mark.parametrize("name", list(THERMOSTATS))
def test_forces_in_the_table(run_system, tmp_path, name, ranks):
    """Locks out forces of an earlier step in the table of keyword output, where nothing else looks
    at the step: a dump of every step, which has the forces gathered, changes nothing."""
    system, tables = mixture(side=2, spacing=2.9), []
    for dump in "", "dump 1 all custom 1 all id fx fy fz\n":
        words = fix_nvt(THERMOSTATS[name] + " output 5 table", "1 1 1") + "thermo 1000\n"
        run_system(system, f"{words}timestep 0.002\n{dump}run 20\n", ranks=ranks)
        tables.append(np.genfromtxt(tmp_path / "table", delimiter=",", skip_header=1))
    np.testing.assert_allclose(*tables, rtol=1e-9, atol=1e-9)


DIPOLES = """
units lj
atom_style full
region b block 0 15 0 15 0 15
create_box 1 b
create_atoms 1 single 3 3 3
create_atoms 1 single 4 3 3
create_atoms 1 single 3 4.2 3
create_atoms 1 single 9 9 9
create_atoms 1 single 9 10 9
create_atoms 1 single 9 9 10.3
set atom 1*3 mol 1
set atom 4*6 mol 2
set atom 1 charge 1
set atom 4 charge 1
set atom 2*3 charge -0.5
set atom 5*6 charge -0.5
mass 1 1
pair_style zero 2
pair_coeff * *
comm_modify cutoff 4
velocity all create 1 31
velocity all zero linear
timestep 0.05
"""
GRADIENT = "variable ez atom 2*sin(2*PI*z/15)\nfix ef all efield 0 0 v_ez\n"


COUNTED = re.compile(r"thermostat: (\d+) of these, (.*)")
ONE = "one atom\n\n1 atoms\n\nCoords\n\n1 0 0 0\n\nTypes\n\n1 1\n\nCharges\n\n1 0\n"
PUSHES = {
    "field": ("fix ef all efield 0 0 1", 9, "without"),
    "field of all times": ("variable et equal step\nfix ef all efield 0 0 v_et", 9, "without"),
    "field of a part": ("group some id 1 4\nfix ef some efield 0 0 1", 12, "fix ef"),
    "gradient": (GRADIENT, 12, "fix ef"),
    "velocities": ("region all block 0 15 0 15 0 15\nfix any all oneway 9 all x", 12, "fix any"),
    "inserted": (
        "molecule one m\nfix gas all gcmc 9 1 0 0 7 1 -9 0 mol one", 12, "fix gas"
    ),
    "charges": ("set atom 4 charge 1.5\nfix ef all efield 0 0 1", 12, "fix ef"),
    "springs": ("fix tie all spring/self 1", 12, "fix tie"),
    "tether": ("fix tie all spring tether 8 0 0 0 0", 12, "fix tie"),
    "readers": (
        "fix a all ave/time 1 1 1 c_thermo_temp\n"
        "fix c all controller 10 1 1 1 1 c_thermo_temp 1 goal", 9, "without",
    ),
    "mover of others": ("group none empty\nfix a none addforce 1 0 0", 9, "without"),
}  # fmt: skip
if NUMBER >= 20250204:
    PUSHES["function"] = ("fix ef all efield/lepton z^2", 12, "fix ef")


def assert_degrees(run_lammps, scripts, expected, **how):
    """Of each script the log says so many degrees of freedom, and why."""
    logged = COUNTED.findall(run_lammps("".join(scripts), **how).log)
    for (degrees, why), (number, words) in zip(expected, logged, strict=True):
        assert int(number) == degrees and why in words, (why, number, words)


@pytest.mark.parametrize("place", ["before", "behind"])
def test_what_changes_the_total_momentum(run_lammps, place):
    """Locks out a momentum that is counted out though a fix may change it, whatever its name, and
    one that is counted though all that acts is known to leave it alone."""
    scripts, ours = [], fix_nvt(THERMOSTATS["csvr"], "1 1 5e-1")
    for line, *_ in PUSHES.values():
        both = (line + "\n", ours) if place == "before" else (ours, line + "\n")
        scripts.append("clear" + DIPOLES + "variable goal internal 1\n" + "".join(both) + "run 0\n")
    assert_degrees(run_lammps, scripts, [push[1:] for push in PUSHES.values()], files={"m": ONE})


SPHERES = """
units lj
atom_style sphere
region b block 0 9 0 9 0 9
create_box 1 b
create_atoms 1 random 8 7 NULL overlap 2 maxtry 1000
set atom * diameter 1
comm_modify vel yes
"""
PAIRS = {
    "newton on\npair_style brownian 1 1 1 1.5 2 1 77 1 0\npair_coeff * *": (
        48,
        "pair style brownian",
    ),
    "newton on\npair_style hybrid/overlay zero 2 brownian 1 1 1 1.5 2 1 77 1 0\n"
    "pair_coeff * * zero\n"
    "pair_coeff * * brownian": (48, "pair style brownian"),
    "newton on\npair_style lubricate 1 1 1 1.5 2\npair_coeff * *": (48, "pair style lubricate"),
    "newton on\npair_style dpd/tstat 1 1 2 77\npair_coeff * * 3": (45, "without"),
    "newton off\npair_style dpd/tstat 1 1 2 77\npair_coeff * * 3": (48, "pair style dpd"),
    "newton off\npair_style lj/cut 2\npair_coeff * * 1 1": (45, "without"),
}


def test_pair_styles_that_change_the_total_momentum(run_lammps):
    """Locks out a momentum that is counted out though a pair style has friction or noise of each
    particle by itself, alone or in a hybrid style, or of pairs that are computed twice."""
    scripts, ours = [], fix_nvt(THERMOSTATS["csvr"], "1 1 5e-1").replace("molecule", "custom v_own")
    for pair in PAIRS:
        newton, rest = pair.split("\n", 1)
        scripts.append(
            f"clear\n{newton}{SPHERES}{rest}\nvelocity all create 1 9\n"
            f"variable own atom id\ntimestep 0.001\n{ours}run 0\n"
        )
    assert_degrees(run_lammps, scripts, PAIRS.values())


@pytest.mark.parametrize("ranks", [1, 2])
def test_momentum_that_changes_in_a_run(run_lammps, ranks):
    """Locks out a momentum that is counted out without a word though it changes: that a field is
    of a region no fix tells."""
    said = "something has changed the bodies' total momentum in this run"
    for where, warns in ("region half", True), ("", False):
        script = (
            f"{DIPOLES}region half block 0 15 0 15 0 7\nfix ef all efield 0 0 3 {where}\n"
            f"{fix_nvt(THERMOSTATS['csvr'], '1 1 5e-1')}run 0\nrun 2000\n"
        )
        log = run_lammps(script, ranks=ranks).log
        assert log.count(said) == warns, log
