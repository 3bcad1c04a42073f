"""Keyword moments: averages of configurations and velocities do not depend on it, times do."""

from math import sqrt

import numpy as np
import pytest
from scipy import stats

from support.body_table import read_table, vector
from support.fixes import CHOSEN, THERMOSTATS, fix_moments
from support.sampling import (
    DUMP,
    FIELD,
    FREE,
    PLACES,
    SMOOTH,
    assert_directions,
    body_momenta,
    dump_lines,
    gas,
    thermo,
)
from support.systems import mixture


@pytest.mark.parametrize(("name", "chosen"), [("langevin", "equal"), ("separate", "scale")])
def test_velocities_of_atoms(run_system, tmp_path, name, chosen):
    """Locks out velocities that are those of the chosen moments: atoms' angular momenta about each
    axis have the distribution of the atoms' own moments, and temp is the target.  The table of
    bodies has the atoms' angular momenta."""
    system = gas()
    words = fix_moments(f"{THERMOSTATS[name]} {CHOSEN[chosen]} output 60 table")
    words += thermo("f_1[3] f_1[4]", 60)
    rows = run_system(system, f"{FREE}timestep 0.002\n{words}run 60\n" + DUMP.format("end")).thermo
    *_, turns, along = body_momenta(tmp_path / "end")
    told = vector(read_table(tmp_path / "table")[-len(turns) :], "angmomx", "angmomy", "angmomz")
    np.testing.assert_allclose(told, turns, rtol=0, atol=1e-9)
    along = along[np.isfinite(along)]
    assert stats.kstest(along / sqrt(2.0), "norm").pvalue > 1e-3
    size = np.array([(along[:, None] ** 2).mean()])
    assert rows["f_1[4]"][-1] == pytest.approx(size[0], rel=1e-9)  # k T = 2 K / degrees of freedom


def test_orientations(run_system, tmp_path):
    """Locks out torques or rotations of other axes than those of the moments: in a field that
    pulls two atoms apart, directions have Langevin's distribution."""
    system = mixture("solid", side=6, temperature=2.0)
    words = fix_moments(f"{THERMOSTATS['langevin']} {CHOSEN['equal']}", "2 2 2e-1")
    run_system(
        system, f"{FREE}{FIELD}{words}timestep 0.01\nrun 1000\n{dump_lines(500, PLACES)}run 5000\n"
    )
    assert_directions(tmp_path, 216)


@pytest.mark.parametrize("dimension", [2, 3])
def test_pressure(run_lammps, dimension):
    """Locks out a constraint virial of other velocities than the atoms have: the pressure of free
    bodies is that of their translation, in every step."""
    kinds = "planar pair row single" if dimension == 2 else "solid planar pair row single"
    system = mixture(kinds, side=3, dimension=dimension)
    flat = "fix 2 all enforce2d\n" if dimension == 2 else ""
    words = (
        fix_moments(f"seed 5 {CHOSEN['scale']}", "2 2 1") + flat + thermo("press f_1[1] vol", 10)
    )
    rows = run_lammps(f"{system.setup}\n{FREE}timestep 0.002\n{words}run 50\n", files=system.files)
    rows = rows.thermo
    of_translation = 2 * rows["f_1[1]"] / dimension / rows["Volume"]
    np.testing.assert_allclose(rows["Press"], of_translation, rtol=1e-10)


def test_moments_decide_the_step(run_system):
    """Locks out moments that are only said to be others: with nh, econserve spreads as the square
    of the step over the time of a rotation, so larger moments stand a longer step."""
    system, spread = mixture("solid", side=3, spacing=2.4), {}
    for chosen in ("moments scale 1", "moments scale 16"):
        words = fix_moments(f"{THERMOSTATS['nh']} {chosen}", "1 1 5e-1") + thermo(
            "econserve etotal", 2
        )
        result = run_system(system, f"{SMOOTH}timestep 0.008\n{words}run 1000\n")
        spread[chosen] = result.thermo["Econserve"][100:].std()
        assert "do not change, but the dynamics do" in result.log
    assert spread["moments scale 16"] < 0.5 * spread["moments scale 1"], spread


def test_moments_of_the_step(run_system):
    """Locks out moments that the step does not need, or that are too small for it: where k T turns
    a body by at most 0.08 in a step, no trajectory changes, and else it is that of the moments
    which the equation gives."""
    system = mixture("solid planar pair", side=2)

    def energies(chosen, dt):
        words = fix_moments(f"seed 5 {chosen}", "1 2 1") + thermo("f_1[2]", 10)
        result = run_system(system, f"{FREE}timestep {dt}\n{words}run 50\n")
        return result.thermo["f_1[2]"], result.log

    short, log = energies("moments step", 1e-4)
    assert "at least 3.125e-06, for a step of 0.0001" in log
    np.testing.assert_allclose(short, energies("", 1e-4)[0], rtol=1e-12)
    # all are below
    long, equal, own = (
        energies(chosen, 0.16)[0] for chosen in ("moments step", "moments equal 8", "")
    )
    np.testing.assert_allclose(long, equal, rtol=1e-9)
    assert not np.allclose(long, own, rtol=1e-3)


@pytest.mark.parametrize("name", ["langevin", "nh"])
def test_moments_of_another_step(run_system, name):
    """Locks out a jump of econserve between two runs with other moments that is larger than its
    page says; it is that of a half kick, and with the same moments there is none."""
    system, jumps = mixture(side=3, spacing=2.9), {}
    for chosen in ("moments step", "moments equal 3"):
        words = fix_moments(f"{THERMOSTATS[name]} {chosen}", "2 2 2e-1") + thermo("econserve", 5)
        rows = run_system(
            system, f"{SMOOTH}{words}timestep 0.02\nrun 50\ntimestep 0.04\nrun 0\n"
        ).thermo
        before, after = np.flatnonzero(rows["Step"] == 50)
        jumps[chosen] = abs(rows["Econserve"][after] - rows["Econserve"][before])
        assert jumps[chosen] < rows["Econserve"][: before + 1].std()
    assert jumps["moments equal 3"] < 1e-9 < jumps["moments step"]
