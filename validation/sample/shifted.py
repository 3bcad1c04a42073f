"""The water of the scene `water` as numbers, for engines that read no LAMMPS input: atoms, and
forces that end smoothly.

The scene's ``pair_style lj/gromacs/coul/gromacs`` is GROMACS's shift function: 1 / r^p becomes

    1 / r^p - A / 3 (r - r1)^3 - B / 4 (r - r1)^4 - C   from r1 on,   1 / r^p - C   before,

with A, B and C that make energy, force and the force's slope zero at the cutoff (GROMACS reference
manual, "Modified non-bonded interactions").  Tests hold energy and forces against LAMMPS's.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..scenes import Scene


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


# TIP3P as the scene's force field has it.  Of oxygen and hydrogen g/mol and e; of the oxygens'
# Lennard-Jones, which hydrogens have none of, kcal/mol and Angstrom; Angstrom between O and H, and
# between both H; how each part ends
MASS, CHARGE = (15.9994, 1.008), (-0.834, 0.417)
DEPTH, SIZE = 0.1521, 3.15061
BOND, ACROSS = 0.9572, 2 * 0.9572 * math.sin(math.radians(104.52) / 2)
DISPERSION, REPULSION, COULOMB = Shift(6, 7.0, 8.5), Shift(12, 7.0, 8.5), Shift(1, 0.0, 8.5)


@dataclass(frozen=True)
class Water:
    """Three-site molecules in a box, in order O, H, H.

    Attributes:
        box: (3,) Angstrom.
        x: (atoms, 3) Angstrom, each molecule whole.
    """

    box: np.ndarray
    x: np.ndarray

    @property
    def molecules(self) -> int:
        """Their number."""
        return len(self.x) // 3


def of_scene(scene: Scene) -> Water:
    """The water of the scene, whose data file has the atoms in order of ID."""
    (file,) = (line.split()[1] for line in scene.setup if line.startswith("read_data"))
    lines = [line.split() for line in (scene.folder / file).read_text().splitlines()]
    ends = np.array([words[:2] for words in lines if words[-1:] in (["xhi"], ["yhi"], ["zhi"])])
    low, high = ends.astype(float).T
    # ID, molecule, type, charge, position, image
    atoms = np.array([words for words in lines if len(words) == 10], float)
    atoms = atoms[np.argsort(atoms[:, 0])]
    return Water(high - low, atoms[:, 4:7] - low + atoms[:, 7:10] * (high - low))
