"""Boxes that fix deform changes in a run, beside LAMMPS's fix rigid, and shapes that stay."""

import numpy as np
import pytest
from systems import mixture
from test_nvt import SMOOTH

from validation.scenes.boxes import LIKE_LAMMPS, RIGID, nearest

# lines of fix deform, and whether the box must be triclinic
DEFORMED = {
    "stretch": ("x erate 0.3 y erate -0.2", 0.0),
    "scale": ("z scale 1.15 x volume y volume", 0.0),
    "shear": ("xy erate 0.3", 0.1),
    "all": ("x erate 0.2 xy erate 0.2 xz erate -0.2 yz erate 0.1", 0.1),
}
BOX = "variable lx equal lx\nvariable xy equal xy\n"
KEPT = "write_dump all custom {} id mol xu yu zu modify sort id format float %.17g\n"


def centres(system, x):
    """Centres of mass of the molecules."""
    one = np.unique(system.molecule)
    return np.array(
        [np.average(x[system.molecule == k], axis=0, weights=system.mass[system.molecule == k])
         for k in one]
    )  # fmt: skip


@pytest.mark.parametrize("ranks", [1, 2, 4])
@pytest.mark.parametrize("name", DEFORMED)
def test_as_with_fix_rigid(simulate, name, ranks):
    """Locks out bodies that stay where they are while the box moves on, or are moved twice: they go
    where LAMMPS's fix rigid has them."""
    lines, tilt = DEFORMED[name]
    system = mixture("solid planar single", side=3, tilt=tilt)
    change = f"fix box all deform 1 {lines} flip no" if tilt else f"fix box all deform 1 {lines}"
    before = f"{SMOOTH}velocity all create 1 9"
    theirs = simulate(system, f"{RIGID}\n{change}", 100, before=before, ranks=1)
    ours = simulate(system, f"{LIKE_LAMMPS}\n{change}", 100, before=before, ranks=ranks)
    h = system.h  # at the end it is another one, the same for both: images are those of a run
    gap = centres(system, ours.x) - centres(system, theirs.x)
    near = np.abs(gap).max(axis=1) < 1e-9
    assert near.mean() > 0.5
    assert np.abs(ours.thermo["PotEng"] - theirs.thermo["PotEng"]).max() < 1e-8
    assert np.abs(ours.thermo["Temp"] - theirs.thermo["Temp"]).max() < 1e-8
    assert np.abs(ours.v - theirs.v).max() < 1e-8
    assert np.abs(nearest(gap[near], h)).max() < 1e-9


@pytest.mark.parametrize("ranks", [1, 4])
@pytest.mark.parametrize("words", ["NVE all molecule", "NVT all molecule temp 1 1 1 seed 5"])
def test_shapes_stay(run_lammps, tmp_path, words, ranks):
    """Locks out bodies that are bent in what is printed, or stay behind the box: they follow their
    atoms to other ranks, and a second run goes on."""
    system = mixture(side=4, spacing=2.9, tilt=0.1)
    fix = f'fix 1 all python/move "fix_nosquish.{words}"\n'
    script = f"{system.setup}\n{SMOOTH}timestep 0.002\n{fix}run 0\n{KEPT.format('start')}"
    script += "fix box all deform 1 x erate 0.2 xy erate 0.3 z erate -0.1 flip no\nrun 300\n"
    script += f"{KEPT.format('middle')}run 200\n{KEPT.format('end')}"
    done = run_lammps(script, files=system.files, ranks=ranks)
    assert "deformed between" not in done.log
    start, middle, end = (
        np.loadtxt(tmp_path / name, skiprows=9)[:, 2:] for name in ("start", "middle", "end")
    )
    for other in middle, end:
        for k in np.unique(system.molecule):
            one, two = (x[system.molecule == k] for x in (start, other))
            gaps = [np.linalg.norm(x[:, None] - x, axis=2) for x in (one, two)]
            assert np.abs(gaps[0] - gaps[1]).max() < 1e-10


@pytest.mark.parametrize(
    "words", ["xy erate 1", "x erate 0.3 remap v", "x erate 0.3 remap none"], ids=lambda w: w[-6:]
)
def test_other_changes_are_refused(refused, words):
    """Locks out bodies in other box vectors than LAMMPS's, or that stay behind the box."""
    system = mixture(side=3, spacing=2.9, tilt=0.1)
    fix = 'fix 1 all python/move "fix_nosquish.NVE all molecule"\n'
    change = f"fix box all deform 1 {words}\n"
    script = f"{system.setup}\n{SMOOTH}timestep 0.004\n{fix}{change}run 1000\n"
    refused(script, "with its remap x and flip no", system.files)
