"""fix deform with remap v: bodies get another velocity at periodic faces, as atoms do."""

import numpy as np
import pytest
from systems import mixture
from test_nvt import SMOOTH

KEPT = (
    "write_dump all custom {} id mol mass xu yu zu vx vy vz modify sort id format float %.17g\n"
)
OURS = 'fix 1 all python/move "fix_nosquish.NVE all molecule"\n'
FLOW = "fix box all deform 1 xy erate {} remap v\n"
PRINT = "thermo_style custom step pe c_peculiar\nthermo_modify format float %.16g\nthermo 10\n"
PRINT = "compute peculiar all temp/deform\n" + PRINT


@pytest.fixture
def flow(run_lammps, tmp_path):
    """A function that runs a system in shear flow, and gives masses, molecules, unwrapped places
    and velocities at the end, and the thermo table."""

    def run(system, fix, *, before="", steps=100, rate=0.3, ranks=1, between="run 0 post no\n"):
        script = f"{system.setup}\n{SMOOTH}{before}{fix}{FLOW.format(rate)}{PRINT}"
        script += f"timestep 0.002\nrun {steps}\n{KEPT.format('end')}"
        done = run_lammps(script, files=system.files, ranks=ranks)
        rows = np.loadtxt(tmp_path / "end", skiprows=9)
        return rows[:, 2], rows[:, 1], rows[:, 3:6], rows[:, 6:9], done

    return run


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("flips", [False, True], ids=["one box", "flips"])
def test_points_as_with_fix_nve(flow, ranks, flips):
    """Locks out bodies that keep their velocity where they cross a face, or lose their image where
    the box flips: bodies of one atom go as with fix nve, which LAMMPS's own bodies do not."""
    system = mixture("single", side=4, spacing=1.3, tilt=0.1)
    before = "velocity all create 2 9 dist gaussian\nchange_box all xy final 0.3\n"
    how = {"before": "velocity all create 4 9\n", "rate": 2.0, "steps": 150 + 200 * flips}
    *_, x, v, theirs = flow(system, "fix 1 all nve\n", ranks=1, **how)
    *_, y, w, ours = flow(system, OURS, ranks=ranks, **how)
    assert np.abs(y - x).max() < 1e-9
    assert np.abs(w - v).max() < 1e-9
    for name in "PotEng", "c_peculiar":
        assert np.abs(ours.thermo[name] - theirs.thermo[name]).max() < 1e-9
