"""What tests of ensembles run and read: potentials, dumps, momenta, distributions."""

import re
import sys
from functools import cache

import numpy as np
from scipy import stats

from support.systems import Result, apart, mixture

FREE = "pair_style zero 0.5\npair_coeff * *\n"  # no forces
SMOOTH = "pair_style lj/smooth/linear 2.5\npair_coeff * * 1.0 1.0\n"  # no jump at the cutoff
DUMP = "write_dump all custom {} id mol mass xu yu zu vx vy vz modify sort id format float %.17g\n"


@cache
def gas():
    """Bodies of all kinds, enough for a distribution."""
    return mixture(side=6, temperature=2.0)


def thermo(columns, every):
    return (
        f"thermo_style custom step temp pe {columns}\n"
        f"thermo {every}\nthermo_modify format float %.16g norm no\n"
    )


def body_momenta(path):
    """What a dump says of the bodies.

    Returns:
        mass (n,), momentum, angular momentum in space, both (n, 3), and each of its components
        along a principal axis, from the smallest moment on, divided by the root of the moment,
        (n, 3): nan where there is no moment.
    """
    atoms = np.loadtxt(path, skiprows=9)
    momenta, turns, along, masses = [], [], [], []
    for body in np.unique(atoms[:, 1]):
        m, x, v = np.split(atoms[atoms[:, 1] == body, 2:], [1, 4], axis=1)
        x = x - (m * x).sum(axis=0) / m.sum()
        momentum, turn = (m * v).sum(axis=0), np.cross(x, m * v).sum(axis=0)
        moments, axes = np.linalg.eigh((m * x**2).sum() * np.eye(3) - (m * x).T @ x)
        moments[moments <= 1e-6 * max(moments.max(), 1e-9)] = np.nan
        along.append(axes.T @ turn / np.sqrt(moments))
        momenta.append(momentum), turns.append(turn), masses.append(m.sum())
    return np.array(masses), np.array(momenta), np.array(turns), np.array(along)


def spreads(run_lammps, begin, line, files, time=2):
    """How much more econserve spreads when a time step is doubled, twice, from 0.001 on, while the
    energy itself changes by far more; and the last run's thermo table."""
    results = []
    for dt in (0.001, 0.002, 0.004):
        words = line + thermo("etotal econserve vol", round(0.02 / dt))
        script = f"{begin}timestep {dt}\n{words}run {round(time / dt)}\n"
        rows = run_lammps(script, files=files).thermo
        results.append(rows["Econserve"].std())
        assert np.ptp(rows["TotEng"]) > 50 * results[-1]
    return [results[1] / results[0], results[2] / results[1]], rows


# a box that changes in each fifth step does so in the same steps on the way back
REVERSE = """
import sys
import numpy as np
from lammps import lammps
from fix_nosquish.run.registry import of_fix

lmp = lammps()
lmp.file(sys.argv[1])
lmp.command("run 303")
fix = of_fix(lmp, "1")
run, integrator = fix.run, fix.integrator
fix.host.point()
run.run_passes("close")
run.bodies.v[:] *= -1
run.bodies.p[:] *= -1
if integrator.thermostat:
    integrator.thermostat.state.reshape(-1, 2, integrator.thermostat.length)[:, 1] *= -1
if getattr(integrator, "has_piston", False):
    integrator.barostat.piston.rates *= -1
run.passes.level_dt.set(-run.dt)
run.run_passes("close")
lmp.command("run 303")
columns = "id mol mass xu yu zu vx vy vz modify sort id format float %.17g"
lmp.command("write_dump all custom end " + columns)
"""


def reverse(run_system, tmp_path, system, line):
    """Run a fix line forth and back: all atoms are where they were then. Gives the Run."""
    lines = f"{SMOOTH}timestep 0.002\n{line}run 0\n{DUMP.format('start')}"
    done = run_system(system, lines, launcher=[sys.executable, "-c", REVERSE])
    start, end = (np.loadtxt(tmp_path / one, skiprows=9)[:, 3:6] for one in ("start", "end"))
    assert np.abs(start - end).max() < 1e-9
    return done


def distance_of_ends(run_lammps, tmp_path, scripts, files, h):
    """How far the atoms at the ends of several runs, (script, ranks), are from those of the
    first."""
    ends = []
    for script, ranks in scripts:
        run_lammps(script, ranks=ranks, files=files)
        atoms = np.loadtxt(tmp_path / "end", skiprows=9)
        ends.append(Result(atoms[:, 3:6], atoms[:, 6:], None, ""))
    return max(max(apart(one, ends[0], h), np.abs(one.v - ends[0].v).max()) for one in ends[1:])


FRAME_COLUMNS = "id mol mass xu yu zu fx fy fz vx vy vz ix iy iz"


def dump_lines(every, columns=FRAME_COLUMNS):
    """The lines for frames every so many steps, in the file `frames`."""
    line = f"dump 1 all custom {every} frames {columns}\n"
    return line + "dump_modify 1 sort id format float %.17g\n"


def read_frames(path):
    """The atoms of each frame, (frames, atoms, columns)."""
    parts = re.split(r"ITEM: TIMESTEP\n", (path / "frames").read_text())[1:]
    return np.array([np.loadtxt(part.splitlines(), skiprows=8) for part in parts])


DIPOLES = 6.0  # the force on each of two atoms of a body
PLACES = "id mol zu xu yu"  # along the field first
FIELD = f"""group up id 1:100000:5
group down id 2:100000:5
fix up up addforce 0 0 {DIPOLES}
fix down down addforce 0 0 -{DIPOLES}
fix_modify up energy yes
fix_modify down energy yes
"""


def assert_directions(path, bodies):
    """In FIELD at a temperature of 2 the directions of `frames` have Langevin's distribution."""
    atoms = read_frames(path)[1:, :, 2:].reshape(-1, bodies, 5, 3)
    apart = atoms[:, :, 0] - atoms[:, :, 1]
    length = np.linalg.norm(apart, axis=2)
    a, up = DIPOLES * length[0, 0] / 2.0, (apart[:, :, 0] / length).ravel()
    below = lambda z: (np.exp(a * z) - np.exp(-a)) / (np.exp(a) - np.exp(-a))  # noqa: E731
    assert stats.kstest(up, below).pvalue > 1e-3
