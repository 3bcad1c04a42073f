"""The piston: its conserved energy, reversal, the distribution of volumes, ranks and restart."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from fix_nosquish.integrators import mtk, nose_hoover, thermostat
from fix_nosquish.integrators.rescaling import Scales
from support.fixes import MTK_CELL, NPT_THERMOSTATS, THERMOSTATS, fix_mtk, fix_npt
from support.sampling import DUMP, FREE, SMOOTH, reverse, spreads, thermo
from support.systems import AFTER, mixture

PRESSED = "iso 12e-2 12e-2 2e-1"
FLAT_KINDS = "planar pair row single"


@pytest.mark.parametrize(
    ("name", "cell"),
    [
        ("NPH", MTK_CELL.replace("every 5", "every 1")),
        ("NPH", "x 12e-2 12e-2 4e-1 z 3e-1 5e-1 4e-1 every 1"),
        ("nh", MTK_CELL.replace("every 5", "every 1")),
        ("separate", "aniso 12e-2 12e-2 4e-1 couple xz every 1"),
        ("NPH", "tri 12e-2 12e-2 4e-1 every 1"),
        ("nh", "tri 12e-2 12e-2 4e-1 couple xy every 1"),
        ("NPH", "x 12e-2 12e-2 4e-1 xz 0 0 4e-1 every 1"),
    ],
)
def test_conserved_energy(run_lammps, name, cell):
    """Locks out a term that the piston lacks, or that its energy does."""
    tilted = {"tri", "xz"} & set(cell.split())
    system = mixture(side=3, spacing=2.9, tilt=0.3 if tilted else 0.0)
    begin = f"{system.setup}\n{SMOOTH}"
    ratios, rows = spreads(run_lammps, begin, fix_mtk(name, cell), system.files)
    assert np.ptp(rows["Volume"]) > 0.05 * rows["Volume"][0]
    assert ratios == pytest.approx([4, 4], rel=0.15)


RESCALED = (  # thermostats and boxes of stochastic cell rescaling
    ("chains", "iso 12e-2 12e-2 4e-1 every 1 compressibility 4"),
    ("langevin", "aniso 12e-2 12e-2 4e-1 couple xz every 2 compressibility 2"),
    ("chains", "tri 12e-2 12e-2 4e-1 every 1 compressibility 4"),
)


@pytest.mark.parametrize(
    ("line", "tilt", "most"),
    [
        *(
            (fix_mtk(name, MTK_CELL.replace("every 5", f"every {every}")), 0.0, 1e-3)
            for name in ("langevin", "fast csvr", "separate csvr")
            for every in (1, 5)
        ),
        *((fix_npt(NPT_THERMOSTATS[name], cell), 0.2, 0.01) for name, cell in RESCALED),
    ],
)
def test_effective_energy(run_system, line, tilt, most):
    """Locks out heat of the bodies' or of the piston's thermostat that `econserve` lacks, and one
    that follows from another kinetic energy than that of the step's middle; and with crescale that
    of the noise in the forces' work, which alone makes it rise by k T in PDAMP."""
    words = line + thermo("etotal econserve vol", 20)
    rows = run_system(
        mixture(side=3, spacing=2.9, tilt=tilt), f"{SMOOTH}timestep 0.001\n{words}run 4000\n"
    ).thermo
    assert np.ptp(rows["Volume"]) > 0.05 * rows["Volume"][0]
    assert rows["Econserve"].std() < most * rows["TotEng"].std()


@pytest.mark.parametrize("shape", ["iso", "tri"])
@pytest.mark.parametrize("every", [1, 5])
@pytest.mark.parametrize("name", ["NPH", "nh", "separate"])
def test_reversible(run_system, tmp_path, name, every, shape):
    """Locks out a piston, or a place of it in the step, that is not symmetric in time."""
    system = mixture(side=2, spacing=2.9, tilt=0.2 if shape == "tri" else 0.0)
    cell = MTK_CELL.replace("every 5", f"every {every}").replace("iso", shape)
    words = fix_mtk(name, cell, "reinit no") + thermo("vol", 303)
    volumes = reverse(run_system, tmp_path, system, words).thermo["Volume"]
    assert abs(volumes[-1] / volumes[0] - 1) < 1e-10 < 1e-2 < abs(volumes[2] / volumes[0] - 1)


SOFT = "compressibility 8"
FLAT = "iso 35e-2 35e-2 4e-1"
GASES = {
    "crescale langevin": fix_npt("seed 771", f"{PRESSED} every 2 {SOFT}"),
    # nothing else brings energy from rotation to translation
    "crescale separate csvr": fix_npt(THERMOSTATS["separate"], f"{PRESSED} every 2 {SOFT}"),
    "crescale x": fix_npt("seed 771", f"x 12e-2 12e-2 2e-1 every 2 {SOFT}"),
    "crescale flat": fix_npt("seed 771", f"{FLAT.replace('4e', '2e')} every 2 compressibility 3"),
    "mtk langevin": fix_mtk("langevin", MTK_CELL.replace("every 5", "every 2")),
    "mtk separate csvr": fix_mtk("separate csvr", MTK_CELL.replace("every 5", "every 2")),
    "mtk x": fix_mtk("langevin", "x 12e-2 12e-2 4e-1 every 2"),
    "mtk flat": fix_mtk("langevin", f"{FLAT} every 2"),
}


@pytest.mark.parametrize("name", GASES)
def test_volumes_of_a_gas(run_system, name):
    """Locks out a pressure that counts rotation, a wrong strength of noise or drift, of the drag on
    the momenta, and a piston at another temperature: the volume of free bodies has the gamma
    distribution, and in two dimensions the area."""
    system, pressure, bodies = mixture(side=2), 0.12, 8
    if "flat" in name:
        system, pressure, bodies = mixture(FLAT_KINDS, side=3, dimension=2), 0.35, 9
    elif "csvr" in name:
        bodies = 7  # it keeps the total momentum, and counts it out
    words = GASES[name] + "fix 2 all enforce2d\n" * ("flat" in name) + thermo("vol", 80)
    rows = run_system(system, f"{FREE}timestep 0.01\n{words}run 32000\n").thermo[20:]
    shape = bodies + 1, 0, 2.0 / pressure
    assert stats.kstest(rows["Volume"], "gamma", shape).pvalue > 1e-3, rows["Volume"].mean()


@pytest.mark.parametrize("name", ["crescale flat", "mtk flat"])
def test_flat_boxes_have_no_height(run_system, name):
    """Locks out a pressure of a volume in two dimensions: how high the box is does not matter."""
    system, edges = mixture(FLAT_KINDS, side=3, dimension=2), []
    line = f"{GASES[name]}fix 2 all enforce2d\n{thermo('lx lz', 10)}"
    for high in 0.5, 0.8:
        data = system.files["data.bodies"].replace("-0.5 0.5 zlo", f"-{high} {high} zlo")
        rows = run_system(
            system, f"{FREE}timestep 0.01\n{line}run 20\n", files={"data.bodies": data}
        ).thermo
        assert rows["Lz"][0] == 2 * high
        edges.append(rows["Lx"])
    assert np.ptp(edges[0]) > 1e-3
    np.testing.assert_allclose(*edges, rtol=1e-12)


def test_gas_with_fix_langevin(run_system):
    """Locks out noise on atoms that pushes the piston, too: volumes fluctuated three times as much.
    LAMMPS's virial does not count the forces of fix langevin, so the part of them that acts within
    bodies must not be taken from it."""
    system = mixture(side=3, temperature=2.0)
    words = "fix 2 all langevin 2 2 0.2 883 zero no\n" + fix_mtk(
        "NPH", MTK_CELL.replace("4e-1", "2e-1")
    )
    rows = run_system(
        system, f"{FREE}timestep 0.004\n{words}{thermo('vol', 200)}run 60000\n"
    ).thermo[20:]
    assert stats.kstest(rows["Volume"], "gamma", (28, 0, 2.0 / 0.12)).pvalue > 1e-3


def test_thermostats_of_the_piston_do_all_of_its_time():
    """Locks out friction for one step on a piston that moves in each fifth one only, and a chain
    that is as slow."""
    every, dt, rate = 5, 0.004, 2.5
    inertia = [3.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    numbers = mtk.PistonNumbers(rate=rate, unit=1.0, box_every=every, inertia=inertia, heavier=1)
    piston, mpi = mtk.Piston(), SimpleNamespace(rank=0)
    one, parameters = SimpleNamespace(barostat=numbers, piston=piston), Scales()
    piston.rates[0] = 1.0
    thermostat.thermalise_piston(mpi, parameters, one, None, dt)  # at zero temperature
    assert piston.rates[0] == pytest.approx(np.exp(-rate * dt * every), rel=1e-12)
    piston.rates[0], parameters.kt, chain = 1.0, 2.0, np.zeros(6)
    nose_hoover.move_chain_of_piston(mpi, parameters, one, chain, dt)
    expected = nose_hoover.move_chain(np.zeros(6), 3, 3.0, 1.0, 1.0, 2.0, rate, dt * every)
    assert piston.rates[0] == pytest.approx(expected, rel=1e-12) != 1.0


@pytest.mark.parametrize("name", ["langevin", "csvr"])
def test_temperature_of_the_piston(run_system, name):
    """Locks out a thermostat that keeps the piston at another temperature than the bodies: the mean
    square of its rate of strain is k T over its inertia."""
    system, dt, every, damping = mixture(side=2), 0.004, 5, 0.4
    words = fix_mtk(name) + thermo("vol", every)
    volumes = run_system(system, f"{FREE}timestep {dt}\n{words}run 40000\n").thermo["Volume"][400:]
    rate = np.diff(np.log(volumes)) / (3 * every * dt)
    freedom = 24 if name == "langevin" else 21
    assert np.mean(rate**2) * (freedom + 3) * damping**2 == pytest.approx(1.0, abs=0.2)


def test_files_before_bodies_move(run_lammps, tmp_path):
    """Locks out a data file that cannot be written before there is a temperature, and a piston
    whose inertia is that of another one than when the run begins."""
    system = mixture(side=2, spacing=2.9)
    begin = f"{system.setup}\n{SMOOTH}timestep 0.004\n{fix_mtk('NPH')}"
    heat, ends = "velocity all set 0 0 0\nWRITEvelocity all create 2 7 loop geom\n", []
    for write in "", "write_data early\n":
        script = f"{begin}{heat.replace('WRITE', write)}run 50\n{DUMP.format('end')}"
        run_lammps(script, files=system.files)
        ends.append(np.loadtxt(tmp_path / "end", skiprows=9))
    np.testing.assert_allclose(*ends, rtol=1e-9, atol=1e-9)


def test_state_of_another_barostat(run_lammps):
    """Locks out a piston that goes on along other axes than before, with rates that it has not."""
    system = mixture(side=2, spacing=2.9)
    begin = f"{system.setup}\n{SMOOTH}timestep 0.004\n"
    kept = "run 20\nwrite_restart middle\nunfix 1\nwrite_restart stateless\n"
    run_lammps(f"{begin}{fix_mtk('langevin')}{kept}", files=system.files)
    for cell, told in ((MTK_CELL, False), (MTK_CELL.replace("iso", "x"), True)):
        words = (
            f"{SMOOTH}{AFTER}timestep 0.004\n{fix_mtk('langevin', cell)}{thermo('vol', 20)}run 20\n"
        )
        runs = [run_lammps(f"read_restart {name}\n{words}") for name in ("middle", "stateless")]
        assert ("has the state of another thermostat or barostat" in runs[0].log) == told
        volumes = [run.thermo["Volume"][-1] for run in runs]
        assert (volumes[0] == volumes[1]) == told
