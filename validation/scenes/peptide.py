"""The peptide of figure 3: what SHAKE holds of it."""

import gzip
import re
from dataclasses import replace

import numpy as np

from . import SCENES, Scene


def scene() -> Scene:
    """The scene with what fix shake can hold of its rigid groups, in the fix's words.

    All bonds within a group, and the angle of the groups of three atoms (water, CH2, NH2), so that
    CH, NH, CH2, NH2 and water are as rigid as with the rigid fixes.  A group of four (CH3, NH3)
    keeps its three bonds only: fix shake has no more for it.
    """
    plain = SCENES["peptide"]
    (file,) = (line.split()[1] for line in plain.setup if line.startswith("read_data "))
    with gzip.open(plain.folder / file, "rt") as opened:
        parts = re.split(r"^([A-Z][A-Za-z ]+?)(?: *#.*)?\n\n", opened.read(), flags=re.M)
    sections = dict(zip(parts[1::2], parts[2::2]))

    def rows(section, columns):
        lines = filter(str.strip, sections[section].splitlines())
        return np.array([line.split()[:columns] for line in lines], int)

    body = dict(rows("Atoms", 2))

    def types(section, atoms):
        found = set()
        for _, kind, *members in rows(section, 2 + atoms):
            first, *others = (body[atom] for atom in members)
            if first and others == [first] * len(others):
                found.add(str(kind))
        return " ".join(sorted(found, key=int))

    return replace(plain, constraints=f"b {types('Bonds', 2)} a {types('Angles', 3)}")
