"""Input scripts of a user, made for the tests: kinds of systems that the harness has no scene of.

Each function writes a script and its files into a folder, and gives the script's path.  Molecules
stand on a lattice, turned at random, so the starts need no packing.
"""

import numpy as np
from scipy.spatial.transform import Rotation

DEGREE = np.pi / 180


def on_lattice(shape, number, spacing, seed):
    """``number``^3 copies of a molecule's atoms (n, 3), turned at random; (copies, n, 3) and the
    edge of the box."""
    random = np.random.default_rng(seed)
    axis = (np.arange(number) + 0.5) * spacing
    shape = shape - np.mean(shape, axis=0)
    places = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 1, 3)
    turned = [Rotation.random(random_state=random).apply(shape) for _ in places]
    return places + np.array(turned), number * spacing


def data(path, x, edge, types, charges, masses, bonds=(), angles=(), style="full"):
    """A data file of alike molecules: ``types`` and ``charges`` of one, ``bonds`` and ``angles`` of
    one as rows (type, atoms from 0)."""
    molecules, n, _ = x.shape
    lines = ["of a test", "", f"{molecules * n} atoms", f"{len(masses)} atom types"]
    for name, rows in ("bonds", bonds), ("angles", angles):
        if rows:
            kinds = max(row[0] for row in rows)
            lines += [f"{molecules * len(rows)} {name}", f"{kinds} {name[:-1]} types"]
    lines += ["", *(f"0 {edge} {a}lo {a}hi" for a in "xyz"), "", "Masses", ""]
    lines += [f"{number} {mass}" for number, mass in enumerate(masses, 1)]
    lines += ["", "Atoms", ""]
    for molecule in range(molecules):
        for atom in range(n):
            place = " ".join(f"{value:.12f}" for value in x[molecule, atom])
            charge = f" {charges[atom]}" if style == "full" else ""
            number = molecule * n + atom + 1
            lines.append(f"{number} {molecule + 1} {types[atom]}{charge} {place}")
    for name, rows in ("Bonds", bonds), ("Angles", angles):
        if rows:
            lines += ["", name, ""]
            every = ((m, row) for m in range(molecules) for row in rows)
            for number, (m, (kind, *atoms)) in enumerate(every, 1):
                lines.append(f"{number} {kind} " + " ".join(str(m * n + a + 1) for a in atoms))
    path.write_text("\n".join(lines) + "\n")


def spce(folder, fix=None, lines="", number=4):
    """SPC/E water, held by shake at constant temperature; files in a folder of their own, a loop
    and an include before the run."""
    bond, half = 1.0, 109.47 * DEGREE / 2
    oh = bond * np.array([[np.sin(half), np.cos(half), 0], [-np.sin(half), np.cos(half), 0]])
    shape = np.array([[0, 0, 0], *oh])
    x, edge = on_lattice(shape, number, 3.104, 1)
    (folder / "parts").mkdir(exist_ok=True)
    bonds, angles = [(1, 0, 1), (1, 0, 2)], [(1, 1, 0, 2)]
    charges = [-0.8476, 0.4238, 0.4238]
    data(
        folder / "parts" / "spce.data", x, edge, [1, 2, 2], charges, [15.9994, 1.008], bonds, angles
    )
    (folder / "parts" / "spce.ff").write_text(
        "pair_style lj/cut/coul/cut 6.0\npair_coeff * * 0.0 1.0\npair_coeff 1 1 0.1553 3.166\n"
        "bond_style harmonic\nbond_coeff 1 0 1.0\nangle_style harmonic\nangle_coeff 1 0 109.47\n"
        "special_bonds lj/coul 0 0 0\n"
    )
    fix = fix or "fix hold all shake 1e-6 100 0 b 1 a 1\nfix move all nvt temp ${T} $(v_T) 100"
    script = folder / "in.spce"
    script.write_text(
        f"""# water
variable T index 298
units real
atom_style full
read_data parts/spce.data
include parts/spce.ff
variable i loop 3
label again
  velocity all create $T 10${{i}}   # three times; the last counts
next i
jump SELF again
if "$T > 0" then "variable what string warm" else &
  "variable what string cold"
print "It is ${{what}}" append water.txt
dump 1 all atom 1 water.dump
neigh_modify every 1 delay 0
{fix}
timestep 2.0
thermo 50
log water.log
{lines}
run 100
"""
    )
    return script


def co2(folder):
    """CO2 with PPPM at constant pressure, by rigid/npt/small."""
    shape = np.array([[0, 0, 0], [1.16, 0, 0], [-1.16, 0, 0]])
    x, edge = on_lattice(shape, 5, 4.3, 2)
    data(folder / "co2.data", x, edge, [1, 2, 2], [0.6512, -0.3256, -0.3256], [12.011, 15.999])
    script = folder / "in.co2"
    script.write_text(
        """units real
atom_style full
read_data co2.data
pair_style lj/cut/coul/long 8.0
pair_coeff 1 1 0.0559 2.757
pair_coeff 2 2 0.15998 3.033
pair_coeff 1 2 0.0946 2.892
kspace_style pppm 1e-3
neigh_modify exclude molecule/intra all
velocity all create 250 4
fix 1 all rigid/npt/small molecule temp 250 250 100 iso 50 50 1000
timestep 2
run 200
"""
    )
    return script


def rings(folder):
    """Benzene of six united atoms, by fix rigid/nve/small and fix langevin, after a minimization of
    its atoms."""
    angle = np.arange(6) * 60 * DEGREE
    shape = 1.39 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    x, edge = on_lattice(shape, 4, 6.2, 3)
    bonds = [(1, i, (i + 1) % 6) for i in range(6)]
    data(folder / "rings.data", x, edge, [1] * 6, [0] * 6, [13.019], bonds)
    script = folder / "in.rings"
    script.write_text(
        """units real
atom_style full
read_data rings.data
pair_style lj/cut 8.0
pair_coeff * * 0.11 3.75
bond_style zero
bond_coeff * 1.39
special_bonds lj/coul 0 0 0
run 0
velocity all create 300 4
fix bodies all rigid/nve/small molecule
fix heat all langevin 300 300 200 11
timestep 4
run 50 every 10 "print done"
run 1000
"""
    )
    return script


def polymer(folder):
    """Chains of five atoms, of which the first three are a rigid bent unit, in reduced units."""
    shape = np.array([[0, 0, 0], [0.9, 0, 0], [1.3, 0.8, 0], [2.2, 0.9, 0], [3.0, 1.3, 0]])
    x, edge = on_lattice(shape, 3, 4.4, 4)
    bonds = [(1, 0, 1), (1, 1, 2), (2, 2, 3), (2, 3, 4)]
    data(folder / "chain.data", x, edge, [1, 1, 1, 2, 2], None, [1.0, 1.0], bonds, style="bond")
    script = folder / "in.chain"
    script.write_text(
        """units lj
atom_style bond
read_data chain.data
pair_style lj/cut 2.5
pair_coeff * * 1.0 1.0
bond_style harmonic
bond_coeff 1 0 0.9
bond_coeff 2 200 0.9
special_bonds lj 0 0 1
group stiff type 1
group soft type 2
neigh_modify exclude molecule/intra stiff
velocity all create 1.0 77
fix 1 stiff rigid/nvt/small molecule temp 1.0 1.0 0.5
fix 2 soft nvt temp 1.0 1.0 0.5
timestep 0.002
run 100
"""
    )
    return script


def clusters(folder):
    """Tetrahedra between two walls, made by the script itself, by fix rigid, in reduced units."""
    script = folder / "in.clusters"
    (folder / "tetra.mol").write_text(
        "a tetrahedron\n\n4 atoms\n\nCoords\n\n1 0.35 0.35 0.35\n2 0.35 -0.35 -0.35\n"
        "3 -0.35 0.35 -0.35\n4 -0.35 -0.35 0.35\n\nTypes\n\n1 1\n2 1\n3 1\n4 1\n"
    )
    script.write_text(
        """units lj
dimension 3
boundary p p f
atom_style molecular
lattice sc 0.05 origin 0.5 0.5 0.5
region box block 0 4 0 4 0 4
create_box 1 box
molecule tetra tetra.mol
mass 1 1.0
create_atoms 0 box mol tetra 5431
pair_style lj/cut 2.5
pair_coeff 1 1 1.0 1.0
neigh_modify exclude molecule/intra all
velocity all create 1.2 33
fix wall all wall/lj93 zlo EDGE 1.0 1.0 2.5 zhi EDGE 1.0 1.0 2.5
fix clumps all rigid/nve molecule
fix_modify wall energy yes
fix means all ave/time 10 5 100 c_thermo_temp file means.txt
timestep 0.002
run 100
"""
    )
    return script


def spheres(folder, lines=""):
    """Bodies of three spheres, whose temperature counts how these turn, in reduced units.

    Args:
        lines: in front of the fix that moves them.
    """
    script = folder / "in.spheres"
    (folder / "corner.mol").write_text(
        "three spheres in a corner\n\n3 atoms\n\nCoords\n\n1 0 0 0\n2 0.9 0 0\n3 0 0.9 0\n\n"
        "Types\n\n1 1\n2 1\n3 1\n\nDiameters\n\n1 1\n2 1\n3 1\n\nMasses\n\n1 1\n2 1\n3 1\n"
    )
    script.write_text(
        f"""units lj
atom_style hybrid sphere molecular
lattice sc 0.05 origin 0.5 0.5 0.5
region box block 0 3 0 3 0 3
create_box 1 box
molecule corner corner.mol
create_atoms 0 box mol corner 3847
pair_style lj/cut 2.5
pair_coeff 1 1 1 1
neigh_modify exclude molecule/intra all delay 0 every 1
velocity all create 1.0 4928
{lines}
fix 1 all rigid/nve/small molecule
timestep 0.002
run 0
run 100
"""
    )
    return script


def staged(folder):
    """Two bodies of two atoms and three points, moved by one of ours in other words than usual,
    behind a run on which groups, springs and a variable depend."""
    script = folder / "in.staged"
    script.write_text(
        """units lj
atom_style molecular
region box block 0 9 0 9 0 9
create_box 1 box
create_atoms 1 single 1 1 1
create_atoms 1 single 2 1 1
create_atoms 1 single 6 4 4
create_atoms 1 single 6 4.8 4
create_atoms 1 single 1 4 1
create_atoms 1 single 1 5 7
create_atoms 1 single 1 7 3
mass 1 1
set atom 1*2 mol 1
set atom 3*4 mol 2
group bodies id 1:4
group points id 5:7
pair_style zero 2.0
pair_coeff * *
velocity all create 1 33
velocity points set 1 0 0
timestep 0.01
fix early points nve
run 250
unfix early
variable seen equal $(step+0*pe)
region right block 3 INF INF INF INF INF
group there region right
fix hold there spring/self 5
fix_modify hold energy yes
variable T equal 1.5
fix 1 all python/move "fix_nosquish.NVE bodies molecule"
fix 1 all python/move &
  "fix_nosquish.NVT bodies molecule moments equal 6 temp v_T v_T 1 seed 7 flexible points"
fix_modify 1 virial yes
run 0
velocity all scale 1.5
change_box all z final 0 10
run 100
"""
    )
    return script


def solute(folder):
    """Rigid water and a flexible molecule of four atoms, two of whose bonds shake holds, as it
    holds a protein's bonds of hydrogen."""
    spce(folder, number=3)
    text = (folder / "parts" / "spce.data").read_text()
    edge = 3 * 3.104
    lines = text.splitlines()
    atoms, bonds = 81, 54
    more = [
        (3, 0.0, (0, 0, 0)),
        (3, 0.0, (1.5, 0, 0)),
        (2, 0.0, (-0.6, 0.9, 0)),
        (2, 0.0, (2.1, 0.9, 0)),
    ]
    shift = np.array([0.7, 1.55, 1.55]) + edge / 2
    added = []
    for number, (kind, q, place) in enumerate(more, atoms + 1):
        at = " ".join(str(value) for value in (np.array(place) + shift) % edge)
        added.append(f"{number} 28 {kind} {q} {at}")
    tied = [(2, 1, 2), (3, 1, 3), (3, 2, 4)]
    strings = [
        f"{bonds + n} {kind} {atoms + i} {atoms + j}" for n, (kind, i, j) in enumerate(tied, 1)
    ]
    lines[lines.index("81 atoms")] = "85 atoms"
    lines[lines.index("2 atom types")] = "3 atom types"
    lines[lines.index("54 bonds")] = "57 bonds"
    lines[lines.index("1 bond types")] = "3 bond types"
    lines.insert(lines.index("2 1.008") + 1, "3 12.0")
    at = lines.index("Bonds") - 1
    lines[at:at] = added
    at = lines.index("Angles") - 1
    lines[at:at] = strings
    (folder / "parts" / "all.data").write_text("\n".join(lines) + "\n")
    script = folder / "in.solute"
    script.write_text(
        """units real
atom_style full
read_data parts/all.data
include parts/spce.ff
pair_coeff 3 3 0.1 3.4
bond_coeff 2 300 1.5
bond_coeff 3 300 1.08
velocity all create 300 3
fix hold all shake 1e-6 200 0 b 1 3 a 1
fix move all nvt temp 300 300 100
timestep 1
run 100
"""
    )
    return script
