"""Small liquids of rigid molecules: benzene, and linear carbon dioxide.

Models, densities and temperatures are from the literature.  A start is the molecules' crystal,
expanded to the liquid's density; it must be melted.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from . import Scene
from .data_file import data_file
from .units import BOLTZMANN

AVOGADRO = 0.602214076  # molecules per cubic Angstrom = this * (g/cm^3) / (g/mol)
SIXTH = np.arange(6) * np.pi / 3
RING = np.stack([np.cos(SIXTH), np.sin(SIXTH), 0 * SIXTH], axis=1)
FACES = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])  # molecules in a cell


@dataclass(frozen=True)
class Liquid:
    """A liquid of one kind of molecule.

    Attributes:
        mass, charge, depth, size: of each atom type: g/mol, e, and Lennard-Jones kcal/mol and
            Angstrom; unlike types mix by ``mix``.
        types: of the molecule's atoms, from 0.  shape: (atoms, 3) Angstrom.
        density: g/cm^3.  temperature: K.
        cell: (3,) lengths of the crystal's cell of four molecules, in any unit.
        copies: of the cell, along each axis.
        turns: rotations of the four molecules.
        reach: cutoff, Angstrom.
        melt: K, at which the start is melted.
    """

    name: str
    title: str
    mass: tuple[float, ...]
    charge: tuple[float, ...]
    depth: tuple[float, ...]
    size: tuple[float, ...]
    mix: str
    types: tuple[int, ...]
    shape: np.ndarray
    density: float
    temperature: float
    cell: tuple[float, float, float]
    copies: tuple[int, int, int]
    turns: Callable[[], Rotation]
    reach: float
    melt: float

    @property
    def molecules(self) -> int:
        """The number of molecules."""
        return 4 * int(np.prod(self.copies))

    def scene(self, folder: Path) -> Scene:
        """The scene; its data file is written into a new folder in ``folder``."""
        folder = (folder / self.name).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        data, text = folder / f"data.{self.name}", self.data()
        if not data.exists() or data.read_text() != text:
            data.write_text(text)
        pairs = enumerate(zip(self.depth, self.size), 1)
        # forces and their slopes vanish at the cutoff: only the time step changes the energy
        style = f"{self.reach - 1.5:g} {self.reach:g} 0.0 {self.reach:g}"
        setup = (
            *("units real", "atom_style full", f"read_data {data.name}"),
            f"pair_style lj/gromacs/coul/gromacs {style}",
            f"pair_modify mix {self.mix}",
            *(f"pair_coeff {i} {i} {depth:.8g} {size:.8g}" for i, (depth, size) in pairs),
            "neighbor 2.0 bin",
            "neigh_modify every 1 delay 0 check yes exclude molecule/intra all",
            "group liquid type > 0",
        )
        return Scene(
            self.name,
            self.title,
            folder,
            setup,
            unit=self.molecules,
            group="liquid",
            bodies="molecule",
            constraints=None,
        )

    def data(self) -> str:
        """The text of the data file."""
        mass = np.array(self.mass)[list(self.types)]
        shape = self.shape - mass @ self.shape / mass.sum()
        room = self.molecules * mass.sum() / self.density / AVOGADRO
        cell = np.array(self.cell)
        box = cell * self.copies
        stretch = (room / box.prod()) ** (1 / 3)
        places = np.stack(np.meshgrid(*map(np.arange, self.copies), indexing="ij"), axis=-1)
        centres = places.reshape(-1, 1, 3) + FACES + 0.25
        atoms = np.stack([turn.apply(shape) for turn in self.turns()])
        x = (centres * cell * stretch)[:, :, None] + atoms
        x, box = x.reshape(-1, 3), box * stretch
        image = np.floor(x / box).astype(int)
        number = np.repeat(np.arange(1, self.molecules + 1), len(self.types))
        types = np.tile(self.types, self.molecules)
        columns = [number, types + 1, np.array(self.charge)[types], x - image * box, image]
        return data_file("full", columns, np.stack([0 * box, box], axis=1), mass=self.mass)


def _herringbone() -> Rotation:
    """The rotation of the ring in the crystal's cell: Pbca.

    The normal is that of Bacon, Curry and Wilson, Proc. R. Soc. A 279, 98 (1964).
    """
    first = np.array([[-0.0569, 0.1387, -0.0054], [-0.1335, 0.0460, 0.1264]]) * (7.44, 9.55, 6.92)
    mirrored = np.array([[1, 1, 1], [1, -1, -1], [-1, -1, 1], [-1, 1, -1]])[:, None] * first
    turns = []
    for corner, other in mirrored:
        axis = corner / np.linalg.norm(corner)
        normal = np.cross(corner, other)
        normal /= np.linalg.norm(normal)
        turns.append(np.stack([axis, np.cross(normal, axis), normal], axis=1))
    return Rotation.from_matrix(np.array(turns))


def _diagonals() -> Rotation:
    """The rotations of the axis x in the crystal's cell: Pa3, as in dry ice."""
    axes = np.array([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1]]) / np.sqrt(3)
    return Rotation.concatenate([Rotation.align_vectors([a], [[1, 0, 0]])[0] for a in axes])


# OPLS-AA: Jorgensen, Maxwell and Tirado-Rives, J. Am. Chem. Soc. 118, 11225 (1996).  The density is
# that of benzene at 25 degrees and 1 atm, CRC Handbook of Chemistry and Physics.
BENZENE = Liquid(
    name="benzene",
    title="192 OPLS-AA benzene molecules at 298 K and 0.874 g/cm³, smooth cutoff at 11 Å",
    mass=(12.011, 1.008),
    charge=(-0.115, 0.115),
    depth=(0.070, 0.030),
    size=(3.55, 2.42),
    mix="geometric",
    types=(0,) * 6 + (1,) * 6,
    shape=np.concatenate([1.40 * RING, 2.48 * RING]),
    density=0.8737,
    temperature=298.0,
    cell=(7.44, 9.55, 6.92),
    copies=(4, 3, 4),
    turns=_herringbone,
    reach=11.0,
    melt=600.0,
)
# TraPPE: Potoff and Siepmann, AIChE J. 47, 1676 (2001).  The density is that of the liquid in
# equilibrium with its vapour, Span and Wagner, J. Phys. Chem. Ref. Data 25, 1509 (1996).
CARBON_DIOXIDE = Liquid(
    name="co2",
    title="500 TraPPE carbon dioxide molecules at 240 K and 1.089 g/cm³, smooth cutoff at 11 Å",
    mass=(12.011, 15.9994),
    charge=(0.70, -0.35),
    depth=(27.0 * BOLTZMANN, 79.0 * BOLTZMANN),
    size=(2.80, 3.05),
    mix="arithmetic",
    types=(0, 1, 1),
    shape=np.array([[0, 0, 0], [1.16, 0, 0], [-1.16, 0, 0]]),
    density=1.0889,
    temperature=240.0,
    cell=(1.0, 1.0, 1.0),
    copies=(5, 5, 5),
    turns=_diagonals,
    reach=11.0,
    melt=400.0,
)
