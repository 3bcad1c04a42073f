"""fix deform with remap v: bodies get another velocity at periodic faces, as atoms do."""

import re

import numpy as np
import pytest

from support.running import read_thermo
from support.sampling import SMOOTH
from support.systems import mixture, sizes

KEPT = "dump end all custom {0} end id mol mass xu yu zu vx vy vz\n"  # as they are in a run
KEPT += "dump_modify end sort id format float %.17g\n"
OURS = "fix 1 all nosquish/nve molecule\n"
FLOW = "fix box all deform 1 xy erate {} remap v\n"
PRINT = "thermo_style custom step pe c_peculiar {}\nthermo_modify format float %.16g\nthermo 10\n"
PRINT = "compute peculiar all temp/deform\n" + PRINT


@pytest.fixture
def flow(run_lammps, tmp_path):
    """A function that runs a system in shear flow, and gives unwrapped places and velocities in the
    last step, and the thermo table."""

    def run(system, fix, *, before, rate, steps, ranks=1, runs=1, dt=0.002, first=False):
        script = f"{system.setup}\n{SMOOTH}velocity all create 4 9\n{before}print 'FLOWS'\n"
        flow = FLOW.format(rate)
        script += flow + fix if first else fix + flow
        columns = "f_1[2]" if fix == OURS else ""
        script += f"{PRINT.format(columns)}timestep {dt}\n"
        script += KEPT.format(max(steps, 1)) + f"run {steps // runs}\n" * runs
        done = run_lammps(script, files=system.files, ranks=ranks)
        last = (tmp_path / "end").read_text().split("ITEM: ATOMS")[-1]
        rows = np.loadtxt(last.splitlines()[1:])
        return (
            rows[:, 3:6],
            rows[:, 6:9],
            read_thermo(re.split("^FLOWS$", done.log, flags=re.M)[-1]),
        )

    return run


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("flips", [False, True], ids=["one box", "flips"])
def test_points_as_with_fix_nve(flow, ranks, flips):
    """Locks out bodies that keep their velocity where they cross a face, or lose their image where
    the box flips: bodies of one atom go as with fix nve, which LAMMPS's own bodies do not."""
    system = mixture("single", side=4, spacing=1.3, tilt=0.1)
    before = "displace_atoms all move 0.3 0.3 0.3 units box\n"  # no atom is on a face
    how = {"before": before, "rate": 2.0, "steps": 150 + 200 * flips}
    x, v, theirs = flow(system, "fix 1 all nve\n", ranks=1, **how)
    y, w, ours = flow(system, OURS, ranks=ranks, **how)
    assert np.abs(y - x).max() < 1e-9
    assert np.abs(w - v).max() < 1e-9
    for name in "PotEng", "c_peculiar":
        assert np.abs(ours[name] - theirs[name]).max() < 1e-9


MOVED = """compute mol all chunk/atom molecule
compute com all com/chunk mol
compute own all chunk/spread/atom mol c_com[*]
variable here atom c_own[2]-ylo-yz*(c_own[3]-zlo)/lz
variable there atom vx+(floor(v_here/ly)-floor((v_here+{0})/ly))*{1}*ly
run 0 post no
velocity all set v_there NULL NULL units box
displace_atoms all move 0 {0} 0 units box
"""


# images of an atom have one velocity along y
LATE = "velocity all set NULL 0.5 NULL sum yes units box\nfix late all momentum 7 linear 0 1 0\n"


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize(
    "rate, steps, late",
    [(0.5, 100, ""), (3.0, 300, ""), (0.5, 100, LATE)],
    ids=["one box", "flips", "another fix changes velocities"],
)
def test_free_bodies_know_no_face(flow, ranks, rate, steps, late):
    """Locks out bodies that a face cuts or that cross it, and do not move as elsewhere, or take
    over the velocities of images from another fix: where the faces are is a matter of choice.  So
    is where a run ends."""
    system = mixture("solid planar pair single", side=3, spacing=2.2, tilt=0.1)
    move, how = 0.4 * system.h[1, 1], {"rate": rate, "steps": steps}
    before = f"pair_style zero 2.5\npair_coeff * *\n{late}"
    x, v, here = flow(system, OURS, before=before, **how)
    before += MOVED.format(move, rate)
    y, w, there = flow(system, OURS, before=before, ranks=ranks, runs=2, **how)
    again = np.delete(there["f_1[2]"], len(there) // 2)  # a second run's first row
    assert np.abs(again / here["f_1[2]"] - 1).max() < 1e-9
    assert np.abs((y - x - [0.0, move, 0.0])[:, 1:]).max() < 1e-9
    gap = (w - v) / (rate * system.h[1, 1])
    assert np.abs(gap - np.rint(gap) * [1, 0, 0]).max() < 1e-9
    assert 0.2 < (np.rint(gap[:, 0]) != 0).mean() < 0.8


def test_bodies_know_no_face(flow):
    """Locks out forces across a face, on bodies that it cuts, that are not those of elsewhere.
    LAMMPS's box follows its images by a step, but not in the first one: as long as that is, other
    faces make a difference, and not more."""
    system = mixture("solid planar pair single", side=3, spacing=2.2, tilt=0.1)
    move, gaps = MOVED.format(0.4 * system.h[1, 1], 0.5), []
    for steps in 50, 200:
        how = {"rate": 0.5, "steps": steps, "dt": 0.1 / steps}
        one, other = (flow(system, OURS, before=before, **how)[2] for before in ("", move))
        gaps.append(abs(one["PotEng"][-1] - other["PotEng"][-1]))
    assert gaps[0] < 0.02 * np.ptp(one["PotEng"])
    assert 3 < gaps[0] / gaps[1] < 5


def test_shapes_stay(flow):
    """Locks out bodies that are bent where a face cuts them."""
    system = mixture("solid planar pair", side=3, spacing=2.2, tilt=0.1)
    how = {"before": "", "rate": 1.0, "first": True}
    start, *_ = flow(system, OURS, steps=1, **how)
    end, *_ = flow(system, OURS, steps=200, runs=2, **how)
    gap = sizes(system.molecule, end) - sizes(system.molecule, start)
    assert np.abs(gap).max() < 1e-10


@pytest.fixture
def ends(run_system, tmp_path):
    """A function that runs lines with bodies that faces cut, and gives where atoms are and their
    velocities in the last step."""
    system = mixture("solid planar pair single", side=3, spacing=2.2, tilt=0.1)

    def run(lines):
        log = run_system(system, f"{SMOOTH}velocity all create 4 9\ntimestep 0.002\n{lines}").log
        assert "without effect" not in log and "not rigid motion" not in log.rpartition("PART")[2]
        last = (tmp_path / "end").read_text().split("ITEM: ATOMS")[-1]
        return np.loadtxt(last.splitlines()[1:])[:, 3:]

    return run


@pytest.mark.parametrize("first, then", [("", "v"), ("v", "x")])
def test_each_run_has_its_own_rates(ends, first, then):
    """Locks out the rates of an earlier run where the bodies are not made anew, and a word on
    changed velocities that nobody has changed."""
    flow = "fix box all deform 1 xy erate 0.5 remap {}\n"
    begin = flow.format(first) + "run 40\nunfix box\n" if first else "run 40\n"
    results = []
    for reinit in "yes", "no":
        lines = f"{OURS[:-1]} reinit {reinit}\n{begin}print PART\n{flow.format(then)}"
        results.append(ends(lines + KEPT.format(20) + "run 200\n"))
    assert np.abs(results[0] - results[1]).max() < 1e-9


def test_files_between_runs(ends):
    """Locks out velocities of images that a file, or the next run, takes for the bodies' own."""
    lines = f"{FLOW.format(0.5)}{OURS}{KEPT.format(25)}run 25\nprint PART\nrun 75 every 25 "
    alone, together = (ends(f"{lines}'{what}'\n") for what in ("print x", "write_restart kept"))
    assert np.abs(alone - together).max() < 1e-9
