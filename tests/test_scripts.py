"""What a script does between runs, against LAMMPS's own rigid/nve in the same script."""

import numpy as np
import pytest
from test_bad_input import BENT

SCRIPT = """
units         lj
atom_style    molecular
atom_modify   map yes
lattice       sc 0.04
region        box block 0 3 0 3 0 3
create_box    1 box
molecule      bent mol.bent
create_atoms  0 box mol bent 4928
mass          * 1.0
velocity      all create 1.0 4928
pair_style    lj/cut 2.5
pair_coeff    * * 1.0 0.4
neigh_modify  delay 0 every 1 check yes exclude molecule/intra all
timestep      0.001
thermo_style  custom step temp pe etotal press
thermo_modify format float %.16g
{groups}
fix           1 bodies {fix}
run           10
{between}
run           10 {how}
"""
OURS = 'python/move "fix_nosquish.NVE bodies molecule order 123"'


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    "between, how, groups",
    [
        # atoms come and go, so that LAMMPS moves its arrays: views of the old ones are dead
        ("create_atoms 1 random 40000 77 box\ngroup extra subtract all bodies\ndelete_atoms group extra compress no", "", ""),
        # a temperature outside of a run counts degrees of freedom
        ('print "$(c_other)"', "pre no", "compute other all temp\ncompute_modify other dynamic/dof yes"),
        ("velocity all create 2.0 87287", "", ""),
        ("timestep 0.002", "", ""),
        ("write_data data.out", "", ""),
        ("displace_atoms all move 3.3 0.2 -5.1", "", ""),
        # LAMMPS's last group has the sign bit of the atoms' mask
        ("", "", "\n".join(f"group g{k} empty" for k in range(30)) + "\ngroup bodies union all"),
    ],
    ids=["arrays moved", "dof between runs", "new velocities", "new time step", "write_data", "displaced", "32 groups"],
)
def test_between_runs(run_lammps, ranks, between, how, groups):
    """Locks out state of an earlier run that is used after the script has changed the system."""
    table = {}
    for fix in OURS, "rigid/nve molecule":
        script = SCRIPT.format(fix=fix, between=between, how=how, groups=groups if "group bodies" in groups else groups + "\ngroup bodies type 1")
        table[fix] = run_lammps(script, files={"mol.bent": BENT}, ranks=ranks).thermo
    ours, theirs = table.values()
    assert ours["Step"].tolist() == theirs["Step"].tolist()
    for column in "Temp", "PotEng", "TotEng":
        np.testing.assert_allclose(ours[column], theirs[column], rtol=1e-9, atol=1e-11)
