"""The peptide of figure 3: what SHAKE holds of it, variants of its force field, the peptide without
water, and its helix."""

import gzip
import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import methodcaller
from pathlib import Path

import mdtraj
import numpy as np

from ..statistics import measures, motion
from ..statistics.positions import NM_PER_ANGSTROM
from . import SCENES, Scene

# names of the peptide's atoms, which are the data file's first
PDB = SCENES["peptide"].folder / "peptide.pdb"
BACKBONE = ("N", "CA", "C")


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


def _with(scene: Scene, *lines: str) -> Scene:
    return replace(scene, setup=(*scene.setup, *lines))


def alone(peptide: Scene) -> Scene:
    """The scene without its water."""
    delete = "delete_atoms group solvent bond yes compress no"
    return _with(peptide, f"group solvent id > {topology().n_atoms}", delete)


def within(peptide: Scene) -> Scene:
    """The scene with the Coulomb energy of pairs one or two bonds apart: in rigid groups it does no
    work, but it moves the zero of energy."""
    return _with(peptide, "special_bonds lj 0.0 0.0 0.0 coul 1.0 1.0 0.0")


def force_fields(accuracies: Sequence[str]) -> dict[str, Callable[[Scene], Scene]]:
    """Variants of the scene's force field: name to a function from scene to scene.

    Args:
        accuracies: of the mesh, beside the scene's own.
    """

    every, switched = "neigh_modify every 1 delay 0 check no", "lj/charmm/coul/long 10.0 12.0"
    return {
        "as it is": lambda scene: scene,
        **{f"mesh {accuracy}": methodcaller("on_mesh", accuracy) for accuracy in accuracies},
        "neighbour list each step": lambda scene: _with(scene, every),
        "switch 10-12": lambda scene: _with(scene, f"pair_style {switched}"),
    }


def dump(every: int) -> tuple[str, ...]:
    """LAMMPS commands that write the peptide's positions, unwrapped, each so many steps;
    ``{folder}`` is where to."""
    return (
        f"group peptide id 1:{topology().n_atoms}",
        f'dump helix peptide custom {every} "{{folder}}/helix.dump" id xu yu zu',
        "dump_modify helix sort id format float %.4f",
    )


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


def helix(folders: Sequence, ps_per_step: float) -> dict[str, np.ndarray] | None:
    """What becomes of the helix.

    Args:
        folders: of the pieces, in order, each with its number of steps.
        ps_per_step: the time step, ps.

    Returns:
        by frame ``time`` in ps, ``helical`` residues that are alpha helix by DSSP, ``rmsd`` of the
        backbone from the first frame, in Angstrom; None if there is no frame, or a piece without
        frames.
    """
    top, begin, times, frames = topology(), 0, [], []
    for folder, steps in folders:
        file = Path(folder) / "helix.dump"
        if not file.exists():
            return None
        at, values = motion.read(file)
        new = slice(1 if begin else 0, None)  # a piece starts where the one before has ended
        times.append((begin + at[new]) * ps_per_step)
        frames.append(values[new, :, 1:])
        begin += steps
    if not any(map(len, frames)):
        return None
    x = np.concatenate(frames)
    path = mdtraj.Trajectory(x * NM_PER_ANGSTROM, top)
    chosen = [atom.index for atom in top.atoms if atom.name in BACKBONE]
    rmsd = mdtraj.rmsd(path, path, 0, atom_indices=chosen) / NM_PER_ANGSTROM
    return {"time": np.concatenate(times), "helical": helical(x), "rmsd": rmsd}
