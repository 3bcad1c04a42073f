"""Runs by KOKKOS beside those of the same LAMMPS without it.

KOKKOS_LAMMPS names a LAMMPS with KOKKOS for which the plugin was compiled (docs/own-lammps.md); an
mpirun of its MPI is on the PATH. Words behind its name take the place of `OPTIONS`, as for a card:
KOKKOS_LAMMPS="/path/to/lmp -k on g 1 -sf kk". Where it is not set, conftest.py leaves this out.
"""

import os
import shlex

import numpy as np
import pytest

from support.builds import of_shell
from support.debian import ice
from support.running import ROOT

LMP, *GIVEN = shlex.split(os.environ["KOKKOS_LAMMPS"])
OPTIONS = [
    "-k on t 1 -sf kk",
    "-k on t 2 -sf kk -pk kokkos neigh half",
    "-k on t 1 -sf kk -pk kokkos newton off neigh full comm device sort device",
    "-k on t 1 -sf kk -pk kokkos comm host",
]
START = f"""
units         real
atom_style    full
{{box}}
read_data     data.ice
include       {ROOT}/inputs/water/forcefield.water
pair_modify   table 0
neighbor      0.5 bin
group         ours molecule 1:62
group         others subtract all ours
velocity      all create 400 4928 loop geom
atom_modify   sort 7 3.0
"""
END = """
thermo        5
thermo_style  custom step temp press pe etotal xy
thermo_modify format float %.17g norm no
timestep      {dt}
run           {steps}
write_restart restart
write_dump    all custom dump.end id x y z ix iy iz vx vy vz modify sort id format float %.17g
"""
SHAKE = "fix hold others shake 1e-10 200 0 b 1 a 1\nfix move others nve\nfix 1 ours "
AGAIN = "clear\nread_restart restart\npair_modify table 0\nkspace_style pppm 1e-5\n"
TILTS = (  # of 0.62 of an edge, so that the box flips
    "box tilt large",
    "change_box all triclinic xy final 9.6 xz final 9.6 yz final 9.6 remap\n"
    "kspace_style pppm 1e-5\n",
)
NVT, CELL = "nosquish/nvt molecule temp 400 400 50", "temp 400 400 50 seed 5"
FIXES = {
    "nve": "fix 1 all nosquish/nve molecule",
    "langevin": f"fix 1 all {NVT} seed 5",
    "csvr": f"fix 1 all {NVT} seed 5 thermostat csvr",
    "nh": f"fix 1 all {NVT} thermostat nh",
    "separate": f"fix 1 all {NVT} seed 5 thermostat csvr separate yes",
    "npt": f"fix 1 all nosquish/npt molecule {CELL} iso 1 1 200",
    "mtk": f"fix 1 all nosquish/npt molecule {CELL} iso 1 1 200 barostat mtk",
    "nph": "fix 1 all nosquish/nph molecule aniso 1 1 200",
    "tri": f"fix 1 all nosquish/npt molecule {CELL} tri 1 1 100",
    "hmc": "fix 1 all nosquish/hmc molecule temp 400 steps 5 seed 5",
    "respa": "run_style respa 2 2 pair 1 kspace 2\nfix 1 all nosquish/nve molecule",
    "suffix": "suffix hybrid kk nosquish\nfix 1 all rigid/nve molecule",
    "restart": f"fix 1 all {NVT} thermostat nh{END}{AGAIN}fix 1 all {NVT} thermostat nh",
    "shake": f"{SHAKE}nosquish/nve molecule",
    "held": f"{SHAKE}nosquish/npt molecule {CELL} iso 1 1 200 dilate all",
    "deform": "fix 2 all deform 1 xy erate 2e-5\nfix 1 all nosquish/nve molecule",
}

LONGER = {"hmc": (7.0, 40), "tri": (2.0, 40)}  # one trajectory is not accepted; lists are made anew

if "g" in GIVEN:  # refused on a card
    del FIXES["hmc"], FIXES["respa"]


@pytest.fixture(scope="module")
def done():
    """Runs without KOKKOS, by fix and number of ranks."""
    return {}


FIRST, *OTHERS = [" ".join(GIVEN)] if GIVEN else OPTIONS
CASES = [(fix, ranks, FIRST) for fix in FIXES for ranks in (1, 2)]
CASES += [(fix, 4, FIRST) for fix in ("nve", "npt", "shake")]
CASES += [(fix, 2, options) for fix in ("nve", "npt", "shake") for options in OTHERS]


@pytest.mark.parametrize("fix, ranks, options", CASES)
def test_moves_as_without(run_lammps, tmp_path, done, fix, ranks, options):
    """Locks out forces and atoms that KOKKOS has elsewhere, or in another order, than the fix."""
    large, tilted = TILTS if fix in ("tri", "deform") else ("", "")
    dt, steps = LONGER.get(fix, (2.0, 20))
    script = START.format(box=large) + tilted + FIXES[fix] + END
    parallel = ["mpirun", "-np", str(ranks)] if ranks > 1 else []
    environment = [f"{name}={value}" for name, value in of_shell().items()]

    def run(words):
        launcher = ["env", *environment, *parallel, LMP, *words, "-in"]
        files = {"data.ice": ice()}
        run = run_lammps(script.format(dt=dt, steps=steps), files=files, launcher=launcher)
        return run, np.loadtxt(tmp_path / "dump.end", skiprows=9)

    if (fix, ranks) not in done:
        done[fix, ranks] = run([])
    plain, end = done[fix, ranks]
    kokkos, there = run(shlex.split(options))
    assert "KOKKOS mode" in kokkos.log and "Rigid bodies by" in kokkos.log
    for column in plain.thermo.dtype.names:
        scale = np.abs(plain.thermo[column]).max()
        np.testing.assert_allclose(kokkos.thermo[column], plain.thermo[column], atol=1e-9 * scale)
    np.testing.assert_allclose(there, end, rtol=0, atol=1e-9)
