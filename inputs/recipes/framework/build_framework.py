"""Build data.framework: eight cells of the silica zeolite LTA, without guests.

    python build_framework.py

Atoms stand as in the symmetric framework, space group Pm-3m, with Si-O bonds of 1.58 to 1.61 Å.
Needs numpy.
"""

from itertools import permutations, product

import numpy as np

EDGE, CELLS = 11.867, 2  # of a cell, Å; along each axis
SITES = [  # type, charge and one atom of each kind, in cells
    (1, 1.5, (0.0, 0.1847, 0.3683)),
    (2, -0.75, (0.0, 0.2122, 0.5)),
    (2, -0.75, (0.0, 0.2967, 0.2967)),
    (2, -0.75, (0.1099, 0.1099, 0.3429)),
]


def alike(site):
    """All places in a cell that the cube's 48 symmetry operations make of one."""
    signs = product((1, -1), repeat=3)
    images = [sign * np.array(place) for sign in signs for place in permutations(site)]
    return np.unique(np.round(np.array(images) % 1, 6) % 1, axis=0)


corners = np.array(list(product(range(CELLS), repeat=3)))
rows = [
    (kind, charge, *EDGE * (corner + place))
    for kind, charge, site in SITES
    for place in alike(site)
    for corner in corners
]
head = f"silica LTA\n\n{len(rows)} atoms\n4 atom types\n2 extra special per atom\n\n"
box = "".join(f"0 {CELLS * EDGE} {axis}lo {axis}hi\n" for axis in "xyz")
masses = "\nMasses\n\n1 28.0855\n2 15.9994\n3 12.011\n4 15.9994\n\nAtoms # full\n\n"
with open("data.framework", "w") as file:
    file.write(head + box + masses)
    for number, (kind, charge, x, y, z) in enumerate(rows, 1):
        file.write(f"{number} 0 {kind} {charge} {x:.6f} {y:.6f} {z:.6f}\n")
