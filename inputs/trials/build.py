"""Build the starts of six scripts of kinds that the harness has no scene of.

    python build.py [FOLDER ...]

Molecules are put on a lattice, turned at random, and come to equilibrium with rigid bodies.  The
octahedra of `clusters` need no file: their script makes them.  That takes a few minutes.
`nosquish compare in.water` in the folder `water` then tries the script.

Random numbers have fixed seeds.  Needs this package with the extra `validation`.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
from fix_nosquish_validation.scenes.data_file import data_file
from scipy.spatial.transform import Rotation

HERE = Path(__file__).resolve().parent
DEGREE = np.pi / 180
START, SCRIPT = "data.start", "in.start"


def liquid(shape, number, spacing, seed, kinds, charges, mass, bonds=(), angles=()):
    """The data file of ``number``^3 molecules with these atoms (n, 3).

    Args:
        kinds, charges: of a molecule's atoms.  mass: of each type.
        bonds, angles: of a molecule, the type and its atoms from 0.
    """
    random, n = np.random.default_rng(seed), len(shape)
    axis = (np.arange(number) + 0.5) * spacing
    places = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 1, 3)
    shape = shape - np.mean(shape, axis=0)
    turned = [Rotation.random(random_state=random).apply(shape) for _ in places]
    x = (places + np.array(turned)).reshape(-1, 3)
    every = range(len(places))
    columns = [np.repeat(np.arange(1, len(places) + 1), n)]
    columns += [np.tile(kinds, len(places)), np.tile(charges, len(places)), x]
    terms = {
        name: [(kind, *(m * n + a + 1 for a in atoms)) for m in every for kind, *atoms in rows]
        for name, rows in (("bonds", bonds), ("angles", angles))
        if rows
    }
    return data_file("full", columns, (0.0, number * spacing), mass=mass, terms=terms)


def water():
    """TIP4P/2005, whose fourth site LAMMPS makes."""
    half, bond = 104.52 * DEGREE / 2, 0.9572
    arm = bond * np.array([np.sin(half), np.cos(half), 0.0])
    shape = np.array([[0, 0, 0], arm, arm * [-1, 1, 1]])
    return liquid(
        shape, 7, 3.104, 1, [1, 2, 2], [-1.1128, 0.5564, 0.5564], [15.9994, 1.008],
        [(1, 0, 1), (1, 0, 2)], [(1, 1, 0, 2)],
    )  # fmt: skip


def co2():
    """Linear molecules, without bonds."""
    shape = np.array([[0, 0, 0], [1.16, 0, 0], [-1.16, 0, 0]])
    return liquid(shape, 7, 4.15, 2, [1, 2, 2], [0.70, -0.35, -0.35], [12.011, 15.999])


def benzene():
    """Flat rings with their hydrogens."""
    angle = np.arange(6) * 60 * DEGREE
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    shape = np.concatenate([1.392 * ring, (1.392 + 1.08) * ring])
    bonds = [(1, i, (i + 1) % 6) for i in range(6)] + [(2, i, 6 + i) for i in range(6)]
    charges = [-0.095] * 6 + [0.095] * 6
    return liquid(shape, 6, 6.5, 3, [1] * 6 + [2] * 6, charges, [12.011, 1.008], bonds)


def brush():
    """Chains of 16 beads, with a rigid kite of four beads at every second one, to either side."""
    beads, chains, bond, apart = 16, 16, 0.97, 6.6
    kite = np.array([[0, 0, 0], [0, 0.8, 0.5], [0, 0.8, -0.5], [0, 1.6, 0]])
    kite[:, 1] += bond
    x, chain, kinds, body, bonds = [], [], [], [], []
    for c in range(chains):
        foot, last = [0, (c % 4 + 0.5) * apart, (c // 4 + 0.5) * apart], None
        for b in range(beads):
            x.append(foot + np.array([bond * (b + 0.5), 0, 0]))
            bead = len(x)
            bonds += [(1, last, bead)] if last else []
            kinds.append(1)
            body.append(0)
            if b % 2 == 0:
                bonds.append((1, bead, bead + 1))
                x += list(x[-1] + kite * [1, 1 if b % 4 == 0 else -1, 1])
                kinds += [2] * 4
                body += [max(body) + 1] * 4
            last = bead
        chain += [c + 1] * (len(x) - len(chain))
    box = np.array([[0, beads * bond], [0, 4 * apart], [0, 4 * apart]])
    columns, terms = [chain, kinds, np.array(x)], {"bonds": bonds}
    text = data_file("bond", columns, box, mass=[1.0, 1.0], terms=terms)
    room = " bond types\n3 extra special per atom\n2 extra bond per atom"
    text = text.replace(" bond types", room)
    return text + "\nBody\n\n" + "".join(f"{k} {line}\n" for k, line in enumerate(body, 1))


OURS = "fix 1 all nosquish/{} molecule {}\n"
ATOMS = f"units real\natom_style full\nread_data {START}\n"
APART = "neigh_modify exclude molecule/intra all\n"
# of each folder its data file, and how it comes to equilibrium
STARTS = {
    "water": (
        water,
        f"{ATOMS}include tip4p.inc\n{APART}velocity all create 298 3\ntimestep 2\n"
        + OURS.format("nvt", "temp 298.0 298.0 100.0 seed 3")
        + "run 6000\nwrite_data data.water nocoeff\n",
    ),
    "co2": (
        co2,
        f"{ATOMS}include trappe.inc\n{APART}velocity all create 250 3\ntimestep 2\n"
        + OURS.format("npt", "temp 250.0 250.0 200.0 seed 3 iso 60.0 60.0 1000.0")
        + "run 8000\nwrite_data data.co2 nocoeff\n",
    ),
    "benzene": (
        benzene,
        f"{ATOMS}include ff.lmp\n{APART}velocity all create 300 3\ntimestep 3\n"
        + OURS.format("npt", "temp 300.0 300.0 300.0 seed 3 iso 1.0 1.0 1000.0")
        + "run 6000\nwrite_restart restart.benzene\n",
    ),
    "brush": (
        brush,
        f"""units lj
atom_style bond
fix body all property/atom i_body
read_data {START} fix body NULL Body
include brush.inc
velocity all create 1.0 3
timestep 0.004
fix 1 sides nosquish/nvt custom i_body temp 1.0 1.0 1.0 seed 3
fix 2 backbone nve
fix 3 backbone langevin 1 1 1 8
run 2000
fix 4 all deform 1 y scale 0.62 z scale 0.62 remap x
run 4000
unfix 4
run 8000
write_data data.brush nocoeff
""",
    ),
}


def build(name):
    """Make the start of a folder."""
    make, text = STARTS[name]
    folder = HERE / name
    for file, words in ((START, make()), (SCRIPT, text)):
        (folder / file).write_text(words)
    lmp = [sys.executable, "-m", "fix_nosquish", "-screen", "none", "-log", "log.build"]
    subprocess.run([*lmp, "-in", SCRIPT], cwd=folder, check=True)
    for file in START, SCRIPT:
        (folder / file).unlink()
    print(f"{name}: done", flush=True)


for name in sys.argv[1:] or STARTS:
    build(name)
