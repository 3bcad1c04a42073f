"""Rigid water and benzene thrown into a box at random, so that they overlap: a start to relax.

TIP3P of CHARMM, whose hydrogens have a Lennard-Jones core, so that no charge falls into another;
benzene of CHARMM.  Both forces end smoothly at the cutoff: a minimum can be found to any accuracy.
"""

import itertools

import numpy as np
from scipy.spatial.transform import Rotation

from validation.scenes.boxes import System, nearest
from validation.scenes.data_file import data_file
from validation.scenes.liquids import RING

_HALF = np.radians(104.52 / 2)
# places, types, charges
_BENT = [[0, 0, 0], [np.sin(_HALF), np.cos(_HALF), 0], [-np.sin(_HALF), np.cos(_HALF), 0]]
WATER = 0.9572 * np.array(_BENT), [1, 2, 2], [-0.834, 0.417, 0.417]
BENZENE = (
    np.concatenate([1.375 * RING, 2.455 * RING]),
    [3] * 6 + [4] * 6,
    [-0.115] * 6 + [0.115] * 6,
)
APART = 3.5
MASSES = 15.9994, 1.008, 12.011, 1.008
DEPTH, SIZE = (0.1521, 0.046, 0.07, 0.03), (3.1507, 0.4, 3.55, 2.42)


def _pairs():
    """The lines of all pairs: a hybrid style mixes none."""
    for i, j in itertools.combinations_with_replacement(range(4), 2):
        depth, size = np.sqrt(DEPTH[i] * DEPTH[j]), (SIZE[i] + SIZE[j]) / 2
        yield f"pair_coeff {i + 1} {j + 1} lj/gromacs {depth:.6g} {size:.6g}"


SETUP = "\n".join([
    "units real",
    "atom_style full",
    "read_data data.overlapping",
    "pair_style hybrid/overlay lj/gromacs 7.0 9.0 coul/dsf 0.2 9.0",
    *_pairs(),
    "pair_coeff * * coul/dsf",
    "neighbor 1.0 bin",
    "neigh_modify every 1 delay 0 check yes exclude molecule/intra all",
])  # fmt: skip


def overlapping(waters: int, benzenes: int, *, volume: float = 1.1, seed: int = 1) -> System:
    """So many molecules, turned at random, at random places.

    Their atoms overlap at will, but no ring goes through another: centres of two benzenes are at
    least `APART` away from each other.

    Args:
        volume: of the box, over that of the liquids at room temperature.
    """
    rng = np.random.default_rng(seed)
    edge = (volume * (29.9 * waters + 148.0 * benzenes)) ** (1 / 3)
    places = np.empty((0, 3))
    while len(places) < benzenes:
        place = edge * rng.random(3)
        if (np.linalg.norm(nearest(places - place, edge * np.eye(3)), axis=1) > APART).all():
            places = np.vstack([places, place])
    places = np.vstack([edge * rng.random((waters, 3)), places])
    kinds = [WATER] * waters + [BENZENE] * benzenes
    x = [
        Rotation.from_quat(rng.normal(size=4)).apply(shape - shape.mean(axis=0)) + place
        for (shape, *_), place in zip(kinds, places, strict=True)
    ]
    molecule = np.repeat(np.arange(len(kinds)) + 1, [len(one) for one in x])
    types, charges = (np.concatenate([kind[k] for kind in kinds]) for k in (1, 2))
    place = np.concatenate(x)
    image = np.floor(place / edge).astype(int)
    atoms = [molecule, types, charges, place - edge * image, image]
    files = {"data.overlapping": data_file("full", atoms, (0.0, edge), mass=MASSES)}
    mass = np.array(MASSES)[types - 1]
    return System(SETUP, files, edge * np.eye(3), 1.0, "all", mass=mass, molecule=molecule)
