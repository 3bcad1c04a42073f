"""A run ends where it does on any number of ranks, whether something looks at it or not, in parts
and from a restart file: with each thermostat and barostat."""

from typing import NamedTuple

import numpy as np
import pytest

from support.fixes import (
    CHOSEN,
    NPT_THERMOSTATS,
    THERMOSTATS,
    TRI_FIXES,
    fix_moments,
    fix_mtk,
    fix_npt,
    fix_nvt,
    fix_nvt_with_points,
)
from support.sampling import DUMP, FREE, SMOOTH, distance_of_ends, thermo
from support.systems import AFTER, mixture

SLOWLY = "2 2 2e-1"


class Case(NamedTuple):
    """A fix line, the tilt of the box, the forces, and the time step."""

    line: str
    tilt: float = 0.3
    pair: str = SMOOTH
    dt: float = 0.004


CASES = {
    **{f"nvt {name}": Case(fix_nvt(words, SLOWLY)) for name, words in THERMOSTATS.items()},
    **{
        f"points {name}": Case(fix_nvt_with_points(THERMOSTATS[name]), 0.0)
        for name in ("langevin", "csvr")
    },
    # without forces bodies come far, and with them what they have for chosen moments
    **{
        f"moments {name}": Case(fix_moments(f"seed 771 {words}", SLOWLY), pair=FREE, dt=0.01)
        for name, words in CHOSEN.items()
    },
    **{
        f"crescale {name}": Case(fix_npt(NPT_THERMOSTATS[name]), tilt)
        for name, tilt in (("langevin", 0.3), ("csvr", 0.0), ("chains", 0.3))
    },
    **{
        f"mtk {name}": Case(fix_mtk(name), tilt)
        for name, tilt in (("NPH", 0.3), ("langevin", 0.0), ("csvr", 0.3), ("nh", 0.0))
    },
    **{f"tri {name}": Case(line) for name, line in TRI_FIXES.items()},
}


@pytest.mark.parametrize("name", CASES)
def test_same_end(run_lammps, tmp_path, name):
    """Locks out noise, sums, rates of strain and copies of a body that depend on the rank, or count
    one twice; a step that goes on otherwise where something looks at it; and a state, of whatever
    part, that a second run or a restart forgets, or moves once too often, or that a periodic
    restart file leaves to the next run."""
    case = CASES[name]
    system = mixture(side=3, spacing=2.9, tilt=case.tilt)
    start = f"{case.pair}timestep {case.dt}\n{case.line}{thermo('econserve', 100)}"
    begin, end = f"{system.setup}\n{start}", DUMP.format("end")
    runs = [
        (f"{begin}{thermo('econserve press', 1)}run 100\n{end}", 1),
        (f"{begin}run 100\n{end}", 2),
        (f"{begin}run 100\n{end}", 8),
        (f"{begin}restart 30 one two\nrun 53\nwrite_restart middle\nrun 47\n{end}", 2),
        (f"read_restart middle\n{AFTER}{start}run 47\n{end}", 4),
    ]
    conserved = []

    def run(script, **how):
        conserved.append(run_lammps(script, **how).thermo["Econserve"][-1])

    assert distance_of_ends(run, tmp_path, runs, system.files, system.h) < 1e-10
    np.testing.assert_allclose(conserved, conserved[0], rtol=1e-10)
