"""The peptide of figure 3: what SHAKE holds of it, and its helix."""

import gzip
import re
import warnings
from dataclasses import replace

import mdtraj
import numpy as np

from ..statistics import measures
from ..statistics.positions import NM_PER_ANGSTROM
from . import SCENES, Scene

# names of the peptide's atoms, which are the data file's first
PDB = SCENES["peptide"].folder / "peptide.pdb"


def topology() -> mdtraj.Topology:
    """The peptide's, as mdtraj's ``Topology``."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # mdtraj's about this file's box
        return mdtraj.load_topology(str(PDB))


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


def helical(frames: np.ndarray) -> np.ndarray:
    """Residues that are alpha helix by DSSP, (frames,), of unwrapped positions of the peptide
    (frames, atoms, 3) in Angstrom."""
    path = mdtraj.Trajectory(frames * NM_PER_ANGSTROM, topology())
    return (mdtraj.compute_dssp(path, simplified=True) == "H").sum(axis=1)


def helicity(x: np.ndarray, cell: np.ndarray, periodic: np.ndarray) -> np.ndarray:
    """Helical residues over those of the first frame, (frames,), of positions of all atoms, the
    peptide's first, in any image (frames, atoms, 3).

    Args:
        cell: vectors as rows.  periodic: (3,) bool.
    """
    x = x[:, : topology().n_atoms]
    # an atom is never far from the one before
    steps = measures.nearest_image(np.diff(x, axis=1), cell, periodic)
    found = helical(np.concatenate([x[:, :1], x[:, :1] + np.cumsum(steps, axis=1)], axis=1))
    return found / found[0]
