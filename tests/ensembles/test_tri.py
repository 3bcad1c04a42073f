"""Boxes whose tilts change: the distribution of their shapes, flips, ranks; atoms in no body."""

import re

import numpy as np
import pytest
from scipy import stats

from support.fixes import TRI_CELL, TRI_FIXES, fix_mtk, fix_npt
from support.sampling import DUMP, FREE, SMOOTH, spreads, thermo
from support.systems import mixture

# ------------------------------------------------------------------ the distribution of shapes

KT, EDGE, BEADS = 2.0, 6.0, 12  # of the box, when the springs hold against the gas; of each chain
BENT = np.array([[0, 0, 0], [0.7, 0.0, 0.0], [-0.2, 0.6, 0.3]])


def frame(gas=24, seed=1):
    """Free bodies in a box that three closed chains hold together, one along each axis.

    A chain's beads are bodies of three atoms, of which one, off the centre, has springs of no
    length to the next beads.  So a chain that goes once around the box along a has an energy of
    |a|^2 k / 2 beads, and one of its beads' distances that is a function of these alone.

    Returns:
        (setup, files, stiff, power): the script's begin, its files, k / beads kT, and of how many
        places the volume is the measure.
    """
    rng = np.random.default_rng(seed)
    power = gas + 3
    stiff = power / EDGE**2
    atoms, bonds = [], []
    for n in range(3 * BEADS + gas):
        place = np.zeros(3) if n < 3 * BEADS else rng.uniform(0, EDGE, 3)
        if n < 3 * BEADS:
            place[n // BEADS] = n % BEADS * EDGE / BEADS
            to = n + 1 if (n + 1) % BEADS else n + 1 - BEADS
            bonds.append((3 * n + 1, 3 * to + 1))
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        atoms.extend((n + 1, *x) for x in place + BENT @ turn)
    lines = [f"\n{len(atoms)} atoms\n{len(bonds)} bonds\n1 atom types\n1 bond types"]
    lines += ["2 extra bond per atom", *(f"0 {EDGE} {k}lo {k}hi" for k in "xyz"), "0 0 0 xy xz yz"]
    lines += ["\nMasses\n\n1 0.3333\n\nAtoms # bond\n"]
    for k, (body, *x) in enumerate(atoms):
        image = np.floor(np.array(x) / EDGE).astype(int)
        x = np.array(x) - EDGE * image
        lines.append(f"{k + 1} {body} 1 {x[0]} {x[1]} {x[2]} {image[0]} {image[1]} {image[2]}")
    lines.append("\nBonds\n")
    lines += [f"{k + 1} 1 {one} {other}" for k, (one, other) in enumerate(bonds)]
    setup = (
        "units lj\natom_style bond\nspecial_bonds lj/coul 1 1 1\nread_data data.frame\n"
        f"bond_style harmonic\nbond_coeff 1 {0.5 * stiff * KT * BEADS} 0.0\n"
        f"{FREE}"
        f"comm_modify cutoff 3.2\nneighbor 0.5 bin\nvelocity all create {KT} 77\ntimestep 0.015\n"
    )
    return setup, {"data.frame": "\n".join(lines) + "\n"}, stiff, power


@pytest.mark.parametrize("words", ["barostat mtk", "compressibility 6"])
def test_shapes_of_a_box(run_lammps, words):
    """Locks out a tilt that is driven by the wrong force (that along y times the place along x), by
    forces on atoms instead of bodies, or not by the motion; a wrong strength of noise; and terms of
    the box itself that favour an axis: each entry of its matrix has its exact distribution.

    The density of upper triangular h is that of any h, turned: V^(n - 2) exp(-stiff |h|^2 / 2) dh,
    with n places for the bodies.  So h is normal above the diagonal, and on it the root of a
    chi-square number (Bartlett, 1933), of n + 1, n and n - 1 degrees of freedom.
    """
    setup, files, stiff, power = frame()
    line = f"molecule temp {KT} {KT} 0.5 seed 771 tri 0 0 1 every 2 {words}"
    script = f"{setup}fix 1 all nosquish/npt {line}\n" + thermo("lx ly lz xy xz yz", 300)
    rows = run_lammps(f"{script}run 40000\n", files=files, timeout=600).thermo[10:]
    for k, name in enumerate(("Lx", "Ly", "Lz")):
        free = power + 1 - k
        squares = stiff * rows[name] ** 2
        assert stats.kstest(squares, "chi2", (free,)).pvalue > 1e-3, (name, squares.mean(), free)
    for name in ("Xy", "Xz", "Yz"):
        tilts = np.sqrt(stiff) * rows[name]
        assert stats.kstest(tilts, "norm").pvalue > 1e-3, (name, tilts.mean(), tilts.var())


def test_shapes_in_two_dimensions(run_system):
    """Locks out tilts with z in two dimensions, and a tilt that does not change there."""
    system = mixture("planar pair row single", side=3, dimension=2, tilt=0.2)
    words = fix_mtk("langevin", "tri 35e-2 35e-2 4e-1 every 5") + thermo("lx ly lz xy xz yz", 100)
    rows = run_system(
        system, f"{FREE}timestep 0.004\n{words}fix 2 all enforce2d\nrun 2000\n"
    ).thermo
    assert np.ptp(rows["Lz"]) == np.ptp(rows["Xz"]) == np.ptp(rows["Yz"]) == 0
    assert min(np.ptp(rows["Lx"]), np.ptp(rows["Ly"]), np.ptp(rows["Xy"])) > 0.3


def test_crystal_as_of_lammps(run_lammps):
    """Locks out a box or a pressure that is not that of LAMMPS's own fix: a crystal of points has
    the same mean edges, tilts and pressures."""
    setup = (
        "units lj\nlattice fcc 1.0\nregion box prism 0 3 0 3 0 3 0 0 0\ncreate_box 1 box\n"
        "create_atoms 1 box\nmass 1 1.0\npair_style lj/smooth/linear 2.3\npair_coeff * * 1 1\n"
        "velocity all create 1.0 71\ntimestep 0.005\n"
        "variable one atom id\n"
    )
    fixes = [
        "fix 1 all npt temp 0.5 0.5 0.5 tri 1 1 1.0\n",
        *(
            "fix 1 all nosquish/npt custom v_one temp 0.5 0.5 0.5 seed 5 "
            f"tri 1 1 1 every 4 {words}\n"
            for words in ("barostat mtk", "compressibility 5e-2")
        ),
    ]
    means = []
    columns = ("Lx", "Ly", "Lz", "Xy", "Xz", "Yz", "Pxx", "Pyy", "Pzz", "Pxy", "Pxz", "Pyz")
    for line in fixes:
        words = line + thermo(" ".join(columns).lower(), 20)
        rows = run_lammps(f"{setup}{words}run 12000\n", timeout=400).thermo[101:]
        parts = np.array([np.array_split(rows[name], 10) for name in columns]).mean(axis=2)
        means.append((parts.mean(axis=1), parts.std(axis=1, ddof=1) / np.sqrt(10)))
    (reference, margin), *ours = means
    target = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    for mean, error in ours:
        assert (np.abs(mean - reference) < 5 * np.hypot(error, margin)).all(), (mean, reference)
        assert (np.abs(mean[6:] - target) < 5 * error[6:]).all(), (mean[6:], error[6:])


# ------------------------------------------------------------------ flips, ranks, restart


def of_other_vectors(system, h):
    """The data file of a system, with the box vectors h in place of its own, and places in it."""
    head, atoms, tail = re.split(
        r"(?<=Atoms # molecular\n\n)(.*?)(?=\n\nVel)", system.files["data.bodies"], flags=re.S
    )
    head = re.sub(r".* xy xz yz", f"{h[0, 1]:.17g} {h[0, 2]:.17g} {h[1, 2]:.17g} xy xz yz", head)
    rows = []
    for line in atoms.splitlines():
        *names, x, y, z, i, j, k = line.split()
        place = np.array([x, y, z], float) + system.h @ np.array([i, j, k], float)
        image = np.floor(np.linalg.solve(h, place) + 1e-12).astype(int)
        rows.append(" ".join([*names, *map("{:.17g}".format, place - h @ image), *map(str, image)]))
    return head + "\n".join(rows) + tail


@pytest.mark.parametrize("name", ["NPH", "mtk csvr", "crescale langevin"])
def test_flips(run_lammps, tmp_path, name):
    """Locks out tilts that grow without bound, vectors that are not of the same lattice, atoms that
    a flip loses or leaves on a rank, and images and image flags that it does not change: a box that
    begins with large tilts, and flips, goes on as the box that the same lattice has with small
    ones."""
    system = mixture(side=3, spacing=2.9, tilt=0.3)
    files = {"data.bodies": of_other_vectors(system, system.h @ [[1, 1, -2], [0, 1, 1], [0, 0, 1]])}
    begin = f"{system.setup}\n{SMOOTH}neighbor 0.4 bin\nneigh_modify every 1 delay 0 check yes\n"
    words = "timestep 0.004\n" + TRI_FIXES[name] + thermo("lx ly lz xy xz yz", 50)
    columns = "id mol mass xu yu zu vx vy vz modify sort id format float %.17g\n"
    script = f"{begin}{words}run 100\nwrite_dump all custom end {columns}"
    ends = []
    for which, ranks in (system.files, 1), *((files, ranks) for ranks in (1, 2, 4, 8)):
        rows = run_lammps(script, files=which, ranks=ranks).thermo
        ends.append((rows, np.loadtxt(tmp_path / "end", skiprows=9)))
        assert (np.abs(rows["Xy"][0] / rows["Lx"][0]) > 1) == (which is files)
        for tilt, edge in ("Xy", "Lx"), ("Xz", "Lx"), ("Yz", "Ly"):
            assert np.abs(rows[tilt][-1] / rows[edge][-1]) < 0.65
    (rows, first), *others = ends
    for last, end in others:
        for column in ("Lx", "Ly", "Lz", "PotEng"):
            np.testing.assert_allclose(last[column], rows[column], rtol=1e-9)
        apart = end[:, 3:6] - first[:, 3:6]
        apart -= apart[0]  # another box has another centre
        assert max(np.abs(apart).max(), np.abs(end[:, 6:] - first[:, 6:]).max()) < 1e-9


def test_flip_where_parts_of_the_box_have_changed(run_lammps):
    """Locks out atoms that a flip sends to ranks which had that part of the box before fix balance
    gave out others, in the same step."""
    script = """units lj
atom_style molecular
region b prism 0 20 0 20 0 20 11.9 0 0
create_box 1 b
molecule d pair.mol
create_atoms 0 random 200 1 NULL mol d 5
mass 1 1.0
pair_style zero 2.5
pair_coeff * *
comm_style tiled
comm_modify cutoff 4
velocity all create 1.0 4928
timestep 0.01
fix b all balance 2 1.0 rcb
fix 1 all nosquish/nph molecule xy 0 0 1
thermo_style custom step atoms lx xy
run 130
"""
    pair = "a pair\n\n2 atoms\n\nCoords\n\n1 0 0 0\n2 1 0 0\n\nTypes\n\n1 1\n2 1\n"
    rows = run_lammps(script, files={"pair.mol": pair}, ranks=3).thermo
    assert rows["Atoms"][-1] == 400 and abs(rows["Xy"][-1]) < 0.6 * rows["Lx"][-1]


# ------------------------------------------------------------------ atoms in no body


def with_others(system, group):
    """The script's begin, with some molecules that are in no body and do not move by themselves;
    none is near a face."""
    others = "group others molecule 10 12 20\ngroup ours subtract all others\n"
    others += "group left molecule 12\nvelocity others set 0 0 0\n"
    return f"{system.setup}\n{others}{SMOOTH}", f"dilate {group}"


GENTLY = "tri 12e-2 12e-2 8e-1 every 1"


@pytest.mark.parametrize("barostat", ["mtk", "crescale"])
@pytest.mark.parametrize("group", ["all", "left"])
def test_what_moves_with_the_box(run_lammps, tmp_path, barostat, group):
    """Locks out atoms of the group that stay behind, and others that are taken along."""
    system = mixture(side=3, spacing=2.9, tilt=0.3)
    begin, dilate = with_others(system, group)
    if barostat == "mtk":
        line = fix_mtk("NPH", GENTLY, dilate)
    else:
        line = fix_npt("seed 5", f"{GENTLY} compressibility 2 {dilate}")
    line = line.replace("fix 1 all", "fix 1 ours")
    words = line + thermo("xlo xhi ylo yhi zlo zhi xy xz yz", 100)
    columns = "id mol x y z modify sort id format float %.17g"
    dump = "write_dump others custom {} " + columns + "\n"
    script = f"{begin}timestep 0.004\n{words}run 0\n{dump.format('start')}run 100\n"
    for ranks in (1, 2):
        rows = run_lammps(script + dump.format("end"), files=system.files, ranks=ranks).thermo
        start, end = (np.loadtxt(tmp_path / name, skiprows=9) for name in ("start", "end"))
        places = []
        for row, x in (rows[0], start[:, 2:]), (rows[-1], end[:, 2:]):
            edges = [row[f"{k}hi"] - row[f"{k}lo"] for k in "XYZ"]
            h = np.diag(edges)
            h[0, 1], h[0, 2], h[1, 2] = row["Xy"], row["Xz"], row["Yz"]
            places.append((x, np.linalg.solve(h, (x - [row[f"{k}lo"] for k in "XYZ"]).T).T, h))
        (x0, parts0, h0), (x1, parts1, h1) = places
        assert np.abs(h1 - h0)[np.triu_indices(3)].min() > 1e-3
        moves = np.isin(start[:, 1], [12] if group == "left" else start[:, 1])
        assert moves.any()
        apart = parts1 - parts0
        assert np.abs((apart - np.rint(apart))[moves]).max() < 1e-9
        off = np.linalg.solve(h1, (x1 - x0)[~moves].T).T
        assert not len(off) or np.abs(off - np.rint(off)).max() < 1e-12


@pytest.mark.parametrize("group", ["all", "left"])
def test_energy_with_others(run_lammps, group):
    """Locks out forces that a piston lacks, or has too much, of atoms that stay where they are."""
    system = mixture(side=3, spacing=2.9, tilt=0.3)
    begin, dilate = with_others(system, group)
    line = fix_mtk("NPH", GENTLY, dilate).replace("fix 1 all", "fix 1 ours")
    ratios, _ = spreads(run_lammps, begin, line, system.files, time=0.6)
    assert ratios == pytest.approx([4, 4], rel=0.2)


def test_gas_of_which_some_move_by_another_fix(run_lammps):
    """Locks out a pressure without the motion of atoms that the box takes along, and velocities
    that it does not change: bodies and atoms of another fix have the gamma distribution of volumes
    of all of them."""
    system = mixture(side=2)
    # atoms that another thermostat holds at the same temperature
    begin = f"{system.setup}\n{FREE}group ours molecule 1:6\ngroup others subtract all ours\n"
    nve = "fix 2 others nve\nfix 3 others langevin 2 2 0.2 9182\n"
    line = fix_npt("seed 771", "iso 12e-2 12e-2 2e-1 every 5 compressibility 8 dilate all")
    words = line.replace("fix 1 all", "fix 1 ours") + thermo("vol", 200)
    done = run_lammps(f"{begin}{nve}timestep 0.004\n{words}run 80000\n", files=system.files)
    rows = done.thermo[20:]
    free = 6 + int(done.log.split("atoms in group others")[0].split()[-1])
    assert stats.kstest(rows["Volume"], "gamma", (free + 1, 0, 2.0 / 0.12)).pvalue > 1e-3


def test_faces_that_pass_atoms_that_stay(run_lammps, tmp_path):
    """Locks out a pressure that depends on which side of a face an atom that stays is stored, and
    so on the number of ranks: the box shrinks to less than half, over such atoms."""
    system = mixture(side=3, spacing=2.9)
    begin, dilate = with_others(system, "left")
    begin = begin.replace("molecule 10 12 20", "molecule 1 4 7 12 13 23:27")
    line = fix_mtk("NPH", "iso 3 3 8e-1 every 1", dilate).replace("fix 1 all", "fix 1 ours")
    script = f"{begin}timestep 0.004\n{line}{thermo('vol', 100)}run 100\n{DUMP.format('end')}"
    ends = {}
    for ranks in (1, 2, 4):
        rows = run_lammps(script, files=system.files, ranks=ranks).thermo
        assert rows["Volume"][-1] < 0.5 * rows["Volume"][0]
        ends[ranks] = np.loadtxt(tmp_path / "end", skiprows=9)
    assert np.abs(ends[2] - ends[1]).max() < 1e-10
    assert np.abs(ends[4] - ends[1]).max() < 1e-10


def test_changed_forces_of_atoms_that_stay(run_lammps):
    """Locks out a pressure from which a fix takes forces on atoms that stay, or to which it adds
    noise: these do not move, so the box is the same without that fix."""
    system = mixture(side=3, spacing=2.9, tilt=0.3)
    begin, dilate = with_others(system, "left")
    line = fix_mtk("NPH", TRI_CELL, dilate).replace("fix 1 all", "fix 1 ours")
    volumes = []
    for fixes in "", "fix 2 others setforce 0 0 0\n", "fix 2 others langevin 2 2 0.2 883\n":
        for ranks in 1, 2:
            script = f"{begin}{fixes}{line}timestep 0.002\n{thermo('vol', 20)}run 100\n"
            rows = run_lammps(script, files=system.files, ranks=ranks).thermo
            volumes.append(rows["Volume"])
    assert np.ptp(volumes[0]) > 0.1
    for other in volumes[1:]:
        np.testing.assert_allclose(other, volumes[0], rtol=1e-10)
