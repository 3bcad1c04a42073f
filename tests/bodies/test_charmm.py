"""Rigid groups of a flexible CHARMM22 peptide in rigid water: this fix against LAMMPS's fix
rigid/nve.

The bodies are bonded to atoms that fix nve moves.  They are bent a little, for symmetric tops part
by the error of the step.  The body styles run one after the other in one process, so a style that
fails may fail those after it too.
"""

import subprocess
import sys

import numpy as np
import pytest

from support.own_classes import MINE, TELLS, VIRIAL_LINES, assert_lammps_virial
from support.running import ROOT
from support.sampling import thermo
from support.systems import LIKE_LAMMPS, OURS, RIGID, Result, close

STEPS, DT = 10, 0.25  # fs
STYLES = {  # the words of each body style, and the groups that its fix moves
    "molecule": ("molecule", "stiff"),
    "custom i_NAME": ("custom i_body", "stiff"),
    "custom v_NAME": ("custom v_body", "stiff"),
    "group": ("group 3 ammonium methyls water", "ammonium methyls water"),
    "single": ("single", "methyls"),
}
LINEAR = {"with linear ones": ("molecule", "rigid")}
FOLDER = ROOT / "inputs" / "peptide"
# group stiff: NH3, CH3, CH2, NH2 and water, which are not linear
SETUP = f"""units real
atom_style full
atom_modify map array
include {FOLDER}/forcefield.peptide
kspace_modify mesh 40 32 32 gewald 0.3
read_data {FOLDER}/data.peptide.gz
group far molecule > 300
delete_atoms group far bond yes
displace_atoms all random 0.02 0.02 0.02 4928
group rigid molecule > 0
group stiff molecule 1 3 12 13 16 19:21 24 27:29 31 32 35 36 39 42 44 45 48 51:55 &
  58 59 62 65 68:70 72 73 76:300
group ammonium molecule 1
group methyls molecule 44 45
group water molecule 77
group first molecule 3
"""


def script(fix, styles, dt, steps):
    """An input script that runs body styles one after the other, each from where the last one
    ended.

    A body has molecule-ID 0, as atoms in no body have.  Values of v_body are not whole: a body has
    both n and 1.001 n for n = -12, -11, 1, 4 ..., and one has both -0.7 and 0.7.
    """
    lines = f"""{SETUP}set group first mol 0
variable molecule atom mol
fix 3 all property/atom i_body
variable body atom (mol-12)*(1+0.001*(id%2))+0.7*(2*(id%2)-1)*(mol==12)
set group all i_body v_molecule
timestep {dt}
thermo {steps}
thermo_style custom step temp etotal ebond eangle edihed eimp evdwl ecoul elong fmax
thermo_modify format float %.16g
dump 1 all custom {steps} end id xu yu zu vx vy vz
dump_modify 1 sort id format float %.16g
"""
    for style in styles:
        words, moved = (STYLES | LINEAR)[style]
        lines += f"""group body union {moved}
group rest subtract all body
{fix.format(group="body", words=words)}
fix 2 rest nve
run {steps} post no
unfix 1
unfix 2
group body delete
group rest delete
"""
    return lines


@pytest.fixture
def simulate(run_lammps, tmp_path, known):
    """A function that runs body styles in one process and gives their Results;
    no run is done twice."""

    def run(fix, *, ranks=1, styles=tuple(STYLES), dt=DT, steps=STEPS):
        text = script(fix, styles, dt, steps)
        if (text, ranks) not in known:
            done = run_lammps(text, ranks=ranks)
            frames = (tmp_path / "end").read_text().split("ITEM: TIMESTEP")[2:]
            known[text, ranks] = {}
            for k, (style, frame) in enumerate(zip(styles, frames, strict=True)):
                end = np.array([line.split() for line in frame.splitlines()[9:]], float)
                table = done.thermo[2 * k : 2 * k + 2]
                known[text, ranks][style] = Result(end[:, 1:4], end[:, 4:], table, done.log)
        return known[text, ranks]

    return run


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("style", STYLES)
def test_bonded_bodies_move_as_with_rigid_nve(simulate, style, ranks):
    """Locks out forces on bodies that miss those of bonds, angles, dihedrals and impropers to
    flexible atoms, or of the mesh (also across ranks), and a body style that takes other atoms than
    rigid/nve does: a body of number or molecule-ID 0, numbers below 0 or not whole, a body of two
    parts."""
    theirs, ours = simulate(RIGID)[style], simulate(LIKE_LAMMPS, ranks=ranks)[style]
    close(ours.x, theirs.x, 1e-10)
    close(ours.v, theirs.v, 1e-10)
    for name in "Temp", "TotEng":
        np.testing.assert_allclose(ours.thermo[name], theirs.thermo[name], rtol=1e-10)


def test_linear_groups(simulate):
    """Locks out a linear body's torque that misses bonded forces: with CH and NH groups, bonded to
    each other and to flexible atoms, bodies come as close to rigid/nve as dt^2 (LAMMPS splits the
    rotation of linear bodies)."""
    distance = []
    for steps in 10, 20:
        how = dict(styles=tuple(LINEAR), dt=5 / steps, steps=steps)
        ours, theirs = (simulate(fix, **how)["with linear ones"].x for fix in (OURS, RIGID))
        distance.append(np.abs(ours - theirs).max())
    assert distance[0] / distance[1] == pytest.approx(4.0, rel=0.1)
    assert distance[1] < 1e-3


@pytest.mark.parametrize("ranks", [1, 2])
def test_virial_of_bonded_bodies(run_lammps, ranks):
    """Locks out a barostat that leaves out the virial of bonds, angles, dihedrals, impropers or of
    the mesh, or takes its components in another order; and a mesh that is for the box of before."""
    words = "molecule iso 1 5000 5 every 1 dilate all"
    text = f"{SETUP}group rest subtract all rigid\nfix 2 rest nve\ntimestep 0.25\n{VIRIAL_LINES}"
    text += f'fix 1 rigid python/move "mine.Tells rigid {words}"\n'
    how = {"files": {"mine.py": TELLS}, "ranks": ranks}
    for steps in 0, 10:
        assert_lammps_virial(run_lammps(f"{text}run {steps}\n", **how))
    rows = run_lammps(f"{text}run 10\nrun 0\n", **how).thermo
    assert np.abs(rows["Volume"][-1] / rows["Volume"][0] - 1) > 1e-3
    assert rows["E_long"][-1] == pytest.approx(rows["E_long"][-2], rel=1e-9)


@pytest.mark.parametrize("ranks", [1, 2])
def test_cross_terms(run_lammps, tmp_path, ranks):
    """Locks out bodies that miss the forces of fix cmap, whose atoms are in bodies and beside them,
    and a barostat that leaves out its virial: motion is that of rigid/nve, and the virial that of
    compute pressure."""
    builder = ROOT / "inputs" / "recipes" / "peptide" / "build_cmap.py"
    subprocess.run([sys.executable, builder, ROOT / "inputs"], cwd=tmp_path, check=True)

    def crossed(text):
        lines = "fix cmap all cmap charmm22.cmap\nfix_modify cmap energy yes\n"
        lines += "read_data data.cmap fix cmap crossterm CMAP"
        return text.replace(f"read_data {FOLDER}/data.peptide.gz", lines)

    theirs, ours = (
        run_lammps(
            crossed(script(fix, ("molecule",), DT, STEPS)).replace("fmax", "fmax f_cmap"),
            ranks=number,
        ).thermo
        for fix, number in ((RIGID, 1), (LIKE_LAMMPS, ranks))
    )
    for name in "Temp", "TotEng", "f_cmap":
        np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-10)
    assert theirs["f_cmap"][0] < -5 and np.ptp(theirs["f_cmap"]) > 0.1
    text = crossed(
        f"{SETUP}group rest subtract all rigid\nfix 2 rest nve\ntimestep 0.25\n{VIRIAL_LINES}"
    )
    text += 'fix 1 rigid python/move "mine.Tells rigid molecule iso 1 5000 5 every 1 dilate all"\n'
    told = run_lammps(f"{text}run 10\n", files={"mine.py": TELLS}, ranks=ranks)
    assert_lammps_virial(told)


@pytest.mark.parametrize("ranks", [1, 2])
def test_rejected_trajectory_of_bonded_bodies(run_lammps, ranks):
    """Locks out terms of the force field that are not computed anew where a rejected trajectory
    goes back, or not for each atom: all energies, forces and pressures are those of before."""
    words = "molecule temp 300 steps 10 seed 7 flexible rest"
    text = f"{SETUP}group rest subtract all rigid\ntimestep 0.5\n"
    text += f'fix 1 rigid python/move "mine.Rejects rigid {words}"\n'
    text += "compute each all pe/atom\ncompute sum all reduce sumsq c_each\n"
    text += "compute f all pressure NULL pair bond angle dihedral improper kspace\n"
    text += thermo("ebond eangle edihed eimp evdwl ecoul elong fmax c_sum c_f[*]", 5) + "run 10\n"
    rows = run_lammps(text, files={"mine.py": MINE}, ranks=ranks).thermo
    of_start, of_away, of_end = rows
    for name in rows.dtype.names[3:]:
        assert of_end[name] == pytest.approx(of_start[name], rel=1e-7), name
        assert of_end[name] != pytest.approx(of_away[name], rel=1e-5), name
