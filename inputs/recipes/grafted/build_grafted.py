"""Build data.grafted: eight nanoparticles with grafted chains, reduced units.

    python build_grafted.py

A core is a shell of atoms in one rigid body, with the particle's number as molecule-ID; the chains
stand straight on some of them, with molecule-ID 0.  Needs numpy.
"""

from itertools import product

import numpy as np

SHELL, RADIUS = 72, 2.2  # atoms of a core
CHAINS, BEADS, BOND = 12, 8, 0.97  # each sixth atom of the core has a chain
SPACING = 24.0

turn = np.pi * (3 - 5**0.5) * np.arange(SHELL)
height = 1 - (2 * np.arange(SHELL) + 1) / SHELL
ring = np.sqrt(1 - height**2)
out = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)

atoms, bonds = [], []
for number, corner in enumerate(product(range(2), repeat=3), 1):
    centre = SPACING * (np.array(corner) + 0.5)
    core = len(atoms) + 1
    atoms += [(number, 1, *(centre + RADIUS * axis)) for axis in out]
    for anchor in range(0, SHELL, SHELL // CHAINS):
        last = core + anchor
        for bead in range(1, BEADS + 1):
            atoms.append((0, 2, *(centre + (RADIUS + BOND * bead) * out[anchor])))
            bonds.append((last, len(atoms)))
            last = len(atoms)

with open("data.grafted", "w") as file:
    print("nanoparticles\n", file=file)
    print(f"{len(atoms)} atoms\n2 atom types\n{len(bonds)} bonds\n1 bond types\n", file=file)
    for axis in "xyz":
        print(f"0 {2 * SPACING} {axis}lo {axis}hi", file=file)
    print("\nMasses\n\n1 1.0\n2 1.0\n\nAtoms # bond\n", file=file)
    for number, (molecule, kind, x, y, z) in enumerate(atoms, 1):
        print(f"{number} {molecule} {kind} {x:.6f} {y:.6f} {z:.6f}", file=file)
    print("\nBonds\n", file=file)
    for number, (first, second) in enumerate(bonds, 1):
        print(f"{number} 1 {first} {second}", file=file)
