"""Boxes that fix deform changes in a run, beside LAMMPS's fix rigid, and shapes that stay."""

import numpy as np
import pytest

from support.body_table import read_table, vector
from support.sampling import SMOOTH, thermo
from support.systems import LIKE_LAMMPS, RIGID, mixture
from validation.scenes.boxes import nearest
from validation.scenes.integrators import target

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


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_press_berendsen(simulate, ranks):
    """Locks out the refusal of a barostat that tells fix rigid of its changes, and bodies that do
    not follow: the box is that of LAMMPS's bodies, but for their virial, which differs by the time
    step."""
    system = mixture("solid planar", side=3)
    line, volumes = "fix box all press/berendsen iso 1 1 1 modulus 5", []
    for shorter in 1, 2:
        runs = [
            simulate(
                system, f"{fix}\n{line}", 60 * shorter, dt=1.0 / shorter, columns="vol", ranks=n
            )
            for fix, n in ((RIGID, 1), (LIKE_LAMMPS, ranks))
        ]
        volumes.append([run.thermo["Volume"][-1] for run in runs])
    first, second = (theirs - ours for theirs, ours in volumes)
    change = np.ptp(volumes) + abs(volumes[0][0] - np.linalg.det(system.h))
    assert abs(first) < 1e-3 * change and 0.3 < second / first < 0.7


NVE, MN = "nosquish/nve molecule", target("MatubayasiNakahara")


@pytest.mark.parametrize(
    "words, change, says",
    [
        (
            NVE,
            "all deform 1 x erate 0.3 remap none",
            "fix deform with remap x (with fix nosquish/nve also v)",
        ),
        (
            NVE,
            "all deform 1 xy erate 0.01 remap none",
            "fix deform with remap x (with fix nosquish/nve also v)",
        ),
        (
            NVE,
            "all deform 1 xy wiggle 1 5 remap v",
            "bodies follow constant ones",
        ),
        (
            NVE,
            "some deform 1 xy erate 0.3 remap v",
            "lacks atoms of the bodies",
        ),
        (
            "nosquish/nvt molecule temp 1 1 1 seed 5",
            "all deform 1 xy erate 0.3 remap v",
            "nosquish/nvt does not support it",
        ),
        (
            f'python/move "{MN} all molecule"',
            "all deform 1 xy erate 0.3 remap v",
            "MatubayasiNakahara does not support it",
        ),
    ],
    ids=["none", "tilt", "wiggle", "group", "NVT", "derived"],
)
def test_other_changes_are_refused(refused, words, change, says):
    """Locks out bodies that stay behind the box, or do not go as its images do: also where the
    change is taken for one to other vectors of the lattice, or the class is derived from NVE."""
    system = mixture(side=3, spacing=2.9, tilt=0.1)
    script = f"{system.setup}\n{SMOOTH}group some id 1 2\ntimestep 0.004\n"
    script += f"fix 1 all {words}\nfix box {change}\nrun 1000\n"
    refused(script, says, system.files)


def test_a_box_that_was_deformed_is_known(run_system):
    """Locks out the refusal of a box with which the bodies moved, in a run that keeps them."""
    system = mixture(side=3, spacing=2.9, tilt=0.1)
    run_system(
        system,
        f"{SMOOTH}timestep 0.004\nfix 1 all nosquish/nve molecule reinit no\n"
        f"fix box all deform 1 x erate 0.1 remap x\nrun 50\nunfix box\nrun 50\n",
    )


# the tilts xy and xz pass half a box vector, and fix deform takes other vectors
FLIPS = "fix box all deform 1 xy erate 3 xz erate -4 yz erate 0.5"
BEFORE_FLIPS = f"{SMOOTH}velocity all create 1 9\n"


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_flips(simulate, ranks):
    """Locks out bodies that lose their image where fix deform takes other box vectors: they go as
    with LAMMPS's fix rigid where the same box does not flip.  Where it does, that fix goes another
    way."""
    system = mixture("solid planar single", side=4, spacing=2.9, tilt=0.45)
    how = {"before": BEFORE_FLIPS, "columns": "xy xz"}
    ours, theirs = (
        simulate(system, f"{fix}\n{FLIPS}{flip}", 100, ranks=n, **how)
        for fix, flip, n in ((LIKE_LAMMPS, "", ranks), (RIGID, " flip no", 1))
    )
    assert (np.diff(ours.thermo["Xy"]) < 0).any() and (np.diff(ours.thermo["Xz"]) > 0).any()
    for name in "PotEng", "Temp":
        assert np.abs(ours.thermo[name] - theirs.thermo[name]).max() < 1e-7
    assert np.abs(ours.v - theirs.v).max() < 1e-7


@pytest.mark.parametrize("ranks", [1, 2])
def test_image_flags_after_flips(run_lammps, tmp_path, ranks):
    """Locks out image flags of bodies that count box vectors of before a flip: with them a centre
    is where its atoms, unwrapped, have it."""
    system = mixture("solid planar single", side=4, spacing=2.9, tilt=0.45)
    script = (
        "processors * 1 1\n"  # so that a flip of xy or xz sends bodies to other ranks
        f"{system.setup}\n{BEFORE_FLIPS}variable table string bodies.csv\n"
        "velocity all set 0 50 -100 sum yes\n"  # most bodies cross faces before the last flip
        # no change of the box in a step whose table is written, before that change
        f"{FLIPS.replace('deform 1', 'deform 3')}\ntimestep 0.002\n"
        "fix 1 all nosquish/nve molecule output 50 v_table\n"
        "dump 1 all custom 50 dump.* id mol mass xu yu zu\n"
        "dump_modify 1 sort id format float %.17g\n"
        f"{thermo('lx ly lz xy xz yz', 50)}run 100\n"
    )
    rows = run_lammps(script, files=system.files, ranks=ranks).thermo
    assert rows["Xy"][1] < rows["Xy"][0] and rows["Xz"][-1] > rows["Xz"][0], "no flip"
    table = read_table(tmp_path / "bodies.csv")
    flags = vector(table, "ix", "iy", "iz")
    for k, step in enumerate(range(0, 101, 50)):
        h = np.diag([rows[f"L{axis}"][k] for axis in "xyz"])
        h[0, 1], h[0, 2], h[1, 2] = (rows[tilt][k] for tilt in ("Xy", "Xz", "Yz"))
        here = table["step"] == step
        told = vector(table[here], "x", "y", "z") + flags[here] @ h.T
        atoms = np.loadtxt(tmp_path / f"dump.{step}", skiprows=9)
        for place, body in zip(told, table["body"][here]):
            mine = atoms[atoms[:, 1] == body]
            centre = np.average(mine[:, 3:6], axis=0, weights=mine[:, 2])
            assert np.abs(place - centre).max() < 1e-9


@pytest.mark.parametrize("words", ["nve molecule", "nvt molecule temp 2 2 2e-1 seed 5"])
def test_a_fix_that_reads_velocities_at_the_end_of_steps(run_system, words):
    """Locks out the pressure of old velocities in fix deform/pressure: the box would depend on how
    often something is printed."""
    system, results = mixture(side=3), []
    for every in 1, 20:
        lines = f"fix 1 all nosquish/{words}\n"
        lines += "fix 2 all deform/pressure 1 x pressure 1.0 0.1\n" + thermo("vol", every)
        results.append(run_system(system, f"timestep 0.002\n{lines}run 20\n").thermo[-1]["Volume"])
    assert results[0] == results[1]


def test_array_behind_a_change(run_lammps, tmp_path):
    """Locks out the bodies' global array of before a change of the box, kept for who asks behind
    it in the same step."""
    system = mixture("solid planar single", side=3, spacing=2.9)
    script = (
        f"{system.setup}\n{SMOOTH}timestep 0.002\n"
        "fix 1 all nosquish/nve molecule\n"
        "fix before all ave/time 1 1 10 f_1[1] mode vector file before\n"
        f"fix box all deform 1 x erate 0.5\n{thermo('lx f_1[1][1]', 10)}run 10\n"
        + KEPT.format("end")
    )
    rows = run_lammps(script, files=system.files).thermo
    told, length = rows["f_1[1][1]"][-1], rows["Lx"][-1]
    gap = told - centres(system, np.loadtxt(tmp_path / "end", skiprows=9)[:, 2:])[0][0]
    assert abs(gap - length * round(gap / length)) < 1e-9
    before = [line.split() for line in (tmp_path / "before").read_text().splitlines()]
    assert abs(told - float(before[-system.molecule.max()][1])) > 1e-4
