"""A scene's water as numbers, for engines that read no LAMMPS input: atoms, and forces that end
smoothly.

The scene's ``pair_style lj/gromacs/coul/gromacs`` is GROMACS's shift function: 1 / r^p becomes

    1 / r^p - A / 3 (r - r1)^3 - B / 4 (r - r1)^4 - C   from r1 on,   1 / r^p - C   before,

with A, B and C that make energy, force and the force's slope zero at the cutoff (GROMACS reference
manual, "Modified non-bonded interactions").
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..scenes import Scene

STYLE = "lj/gromacs/coul/gromacs"
OXYGEN, HYDROGEN = 1, 2  # types


class Shift(NamedTuple):
    """What ends 1 / r^power at ``outer``, smoothly from ``inner`` on: A, B and C."""

    power: int
    inner: float
    outer: float

    @property
    def coefficients(self) -> tuple[float, float, float]:
        """A, B, C, in the power of the lengths' unit that they have."""
        p, r1, rc = self
        wide = rc - r1
        a = -p * ((p + 4) * rc - (p + 1) * r1) / (rc ** (p + 2) * wide**2)
        b = p * ((p + 3) * rc - (p + 1) * r1) / (rc ** (p + 2) * wide**3)
        return a, b, rc**-p - a / 3 * wide**3 - b / 4 * wide**4


@dataclass(frozen=True)
class Water:
    """Three-site molecules in a box, in order O, H, H; LAMMPS's units real.

    Attributes:
        box: (3,) Angstrom.
        x: (atoms, 3) Angstrom, each molecule whole.
        mass, charge: of oxygen and hydrogen; g/mol, e.
        depth, size: of the oxygens' Lennard-Jones: kcal/mol, Angstrom.  Hydrogens have none.
        bond, across: Angstrom between O and H, and between both H.
        dispersion, repulsion, coulomb: how each part ends; Angstrom.
    """

    box: np.ndarray
    x: np.ndarray
    mass: tuple[float, float]
    charge: tuple[float, float]
    depth: float
    size: float
    bond: float
    across: float
    dispersion: Shift
    repulsion: Shift
    coulomb: Shift

    @property
    def molecules(self) -> int:
        """Their number."""
        return len(self.x) // 3


def of_scene(scene: Scene) -> Water:
    """The water of a scene with `STYLE`, as its data file and its force field have it.

    Raises:
        ValueError: its force field, or its order of atoms, is another.
    """
    file = {line.split()[0]: scene.folder / line.split()[1] for line in scene.setup[2:4]}
    words = [line.split() for line in file["include"].read_text().splitlines() if line.strip()]
    found = {tuple(line[:-2]) if line[0] == "pair_coeff" else line[0]: line[1:] for line in words}
    style, *ends = found["pair_style"]
    hydrogens = found["pair_coeff", "*", "2"][-2:]
    if style != STYLE or float(hydrogens[0]) != 0:
        raise ValueError(f"{scene.name}: pair_style {STYLE} without hydrogens in it is expected")
    inner, outer, inner_coulomb, outer_coulomb = map(float, ends)
    depth, size = map(float, found["pair_coeff", "1", "1"][-2:])
    bond = float(found["bond_coeff"][1])
    across = 2 * bond * math.sin(math.radians(float(found["angle_coeff"][1])) / 2)
    sections = _sections(file["read_data"].read_text())
    oxygen, hydrogen = (float(line[1]) for line in sections["Masses"])
    sides = np.array([line[:2] for line in sections[""] if line[-1].endswith("hi")], float)
    box = sides[:, 1] - sides[:, 0]
    atoms = np.array(sorted((line[:10] for line in sections["Atoms"]), key=lambda one: int(one[0])))
    kinds, charges = atoms[:, 2].astype(int), atoms[:, 3].astype(float)
    if (kinds.reshape(-1, 3) != (OXYGEN, HYDROGEN, HYDROGEN)).any():
        raise ValueError(f"{scene.name}: atoms in the order O, H, H are expected")
    x = atoms[:, 4:7].astype(float) - sides[:, 0] + atoms[:, 7:10].astype(int) * box
    return Water(
        box,
        x,
        (oxygen, hydrogen),
        (float(charges[0]), float(charges[1])),
        depth,
        size,
        bond,
        across,
        Shift(6, inner, outer),
        Shift(12, inner, outer),
        Shift(1, inner_coulomb, outer_coulomb),
    )


def _sections(text: str) -> dict[str, list[list[str]]]:
    """The words of each line of a data file, by section; what comes before has no name."""
    found: dict[str, list[list[str]]] = {"": []}
    name = ""
    for words in (line.split() for line in text.splitlines()[1:]):
        if words and words[0][0].isalpha():
            name = words[0]
            found[name] = []
        elif words:
            found[name].append(words)
    return found
