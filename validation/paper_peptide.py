"""The peptide of figure 3: what SHAKE holds of it, variants of its force field, the peptide without water, and its helix."""

import gzip
import re
import warnings
from dataclasses import replace
from operator import methodcaller
from pathlib import Path

import mdtraj
import numpy as np

from validation.scenes import SCENES

PDB = (
    SCENES["peptide"].folder / "peptide.pdb"
)  # names of the peptide's atoms, which are the data file's first
BACKBONE = ("N", "CA", "C")
NM_PER_ANGSTROM = 0.1


def topology():
    """The peptide's, as mdtraj's ``Topology``."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # mdtraj's about this file's box
        return mdtraj.load_topology(str(PDB))


def scene():
    """The scene with what fix shake can hold of its rigid groups, in the fix's words.

    All bonds within a group, and the angle of the groups of three atoms (water, CH2, NH2), so that CH, NH, CH2, NH2 and water
    are as rigid as with the rigid fixes.  A group of four (CH3, NH3) keeps its three bonds only: fix shake has no more for it.
    """
    plain = SCENES["peptide"]
    file = plain.folder / next(
        line.split()[1] for line in plain.setup if line.startswith("read_data ")
    )
    with gzip.open(file, "rt") as opened:
        parts = re.split(r"^([A-Z][A-Za-z ]+?)(?: *#.*)?\n\n", opened.read(), flags=re.M)
    sections = dict(zip(parts[1::2], parts[2::2]))

    def rows(section, columns):
        return np.array(
            [line.split()[:columns] for line in sections[section].splitlines() if line.strip()], int
        )

    body = dict(rows("Atoms", 2))

    def types(section, atoms):
        found = set()
        for _, kind, *members in rows(section, 2 + atoms):
            first, *others = (body[atom] for atom in members)
            if first and others == [first] * len(others):
                found.add(str(kind))
        return " ".join(sorted(found, key=int))

    return replace(plain, constraints=f"b {types('Bonds', 2)} a {types('Angles', 3)}")


def alone(peptide):
    """The scene without its water."""
    count = topology().n_atoms
    return replace(
        peptide,
        setup=(
            *peptide.setup,
            f"group solvent id > {count}",
            "delete_atoms group solvent bond yes compress no",
        ),
    )


def within(peptide):
    """The scene with the Coulomb energy of pairs one or two bonds apart: in rigid groups it does no work, but it moves the zero of energy."""
    return replace(peptide, setup=(*peptide.setup, "special_bonds lj 0.0 0.0 0.0 coul 1.0 1.0 0.0"))


def force_fields(accuracies):
    """Variants of the scene's force field: name to a function from scene to scene.

    Args:
        accuracies: of the mesh, beside the scene's own.
    """

    def added(line):
        return lambda scene: replace(scene, setup=(*scene.setup, line))

    return {
        "as it is": lambda scene: scene,
        **{f"mesh {accuracy}": methodcaller("on_mesh", accuracy) for accuracy in accuracies},
        "neighbour list each step": added("neigh_modify every 1 delay 0 check no"),
        "switch 10-12": added("pair_style lj/charmm/coul/long 10.0 12.0"),
    }


def dump(every):
    """LAMMPS commands that write the peptide's positions, unwrapped, each so many steps; ``{folder}`` is where to."""
    return (
        f"group peptide id 1:{topology().n_atoms}",
        f'dump helix peptide custom {every} "{{folder}}/helix.dump" id xu yu zu',
        "dump_modify helix sort id format float %.4f",
    )


def helical(frames):
    """Residues that are alpha helix by DSSP, (frames,), of unwrapped positions of the peptide (frames, atoms, 3) in Angstrom."""
    return (
        mdtraj.compute_dssp(
            mdtraj.Trajectory(frames * NM_PER_ANGSTROM, topology()), simplified=True
        )
        == "H"
    ).sum(axis=1)


def helix(folders, ps_per_step):
    """What becomes of the helix.

    Args:
        folders: of the pieces, in order, each with its number of steps.
        ps_per_step: the time step, ps.

    Returns:
        dict: ``time`` (frames,) in ps, ``helical`` (frames,) residues that are alpha helix by DSSP, ``rmsd`` (frames,) of the
        backbone from the first frame, in Angstrom; None if there is no frame, or a piece without frames.
    """
    top, begin, times, frames = topology(), 0, [], []
    for folder, steps in folders:
        file = Path(folder) / "helix.dump"
        if not file.exists():
            return None
        lines = file.read_text().split("ITEM: TIMESTEP\n")[1:]
        for frame in lines[1:] if begin else lines:  # a piece starts where the one before has ended
            step, _, rows = frame.partition("\n")
            times.append((begin + int(step)) * ps_per_step)
            frames.append(
                [
                    [float(word) for word in row.split()[1:]]
                    for row in rows.splitlines()[-top.n_atoms :]
                ]
            )
        begin += steps
    if not frames:
        return None
    path = mdtraj.Trajectory(np.array(frames) * NM_PER_ANGSTROM, top)
    chosen = [atom.index for atom in top.atoms if atom.name in BACKBONE]
    return {
        "time": np.array(times),
        "helical": helical(np.array(frames)),
        "rmsd": mdtraj.rmsd(path, path, 0, atom_indices=chosen) / NM_PER_ANGSTROM,
    }
