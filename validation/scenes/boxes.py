"""Small boxes of rigid Lennard-Jones bodies of many shapes, and the results of their runs: for
`stress`, and for tests."""

import itertools
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from .data_file import data_file

# ---- systems


class System(NamedTuple):
    """The first part of an input script, its files, and properties of the atoms."""

    setup: str
    files: dict
    h: np.ndarray
    dt: float
    group: str = "bodies"  # all bodies that LAMMPS's fix rigid accepts
    singles: bool = False  # whether there are others
    mass: np.ndarray | None = None
    molecule: np.ndarray | None = None


class Units(NamedTuple):
    """Length, mass and energy of a Lennard-Jones system in LAMMPS's units, and mass v^2 / energy
    there."""

    length: float = 1.0
    mass: float = 1.0
    energy: float = 1.0
    mvv2e: float = 1.0

    @property
    def time(self) -> float:
        return self.length * np.sqrt(self.mass * self.mvv2e / self.energy)


UNITS = {
    "lj": Units(),
    "real": Units(3.4, 12.0, 0.24, 48.88821291**2),
    "metal": Units(3.4, 12.0, 0.0104, 1.0364269e-4),
    "si": Units(3.4e-10, 2e-26, 1.66e-21, 1.0),
}

# shapes in units of the Lennard-Jones diameter, with the type of each atom
SHAPES = {
    "solid": (
        [[0, 0, 0], [0.9, 0.1, 0], [-0.2, 0.7, 0.1], [0.1, -0.3, 0.8], [-0.6, -0.4, -0.2]],
        [1, 2, 3, 1, 2],
    ),
    "planar": ([[0, 0, 0], [0.9, 0.1, 0], [-0.3, 0.6, 0], [0.2, -0.5, 0]], [2, 1, 3, 1]),
    "pair": ([[-0.5, 0, 0], [0.5, 0, 0]], [1, 2]),
    "row": ([[-0.8, 0, 0], [0, 0, 0], [0.6, 0, 0]], [3, 1, 2]),
    "single": ([[0, 0, 0]], [2]),
}
MASSES = np.array([1.0, 1.6, 0.4])

TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 0.3
CUBE = np.array(list(itertools.product([-0.3, 0.3], repeat=3)))
OCTAHEDRON = np.concatenate([np.eye(3), -np.eye(3)])
HEXAGON = np.array([[np.cos(a), np.sin(a), 0] for a in np.arange(6) * np.pi / 3]) * 0.5
TOPS = {  # symmetric and spherical
    "methane": ([*TETRAHEDRON, [0, 0, 0]], [3, 3, 3, 3, 1]),
    "tetrahedron": (TETRAHEDRON, [1, 1, 1, 1]),
    "cube": (CUBE, [3] * 8),
    "octahedron": (0.45 * OCTAHEDRON, [1] * 6),
    "ammonia": ([*TETRAHEDRON[1:], [0, 0, 0]], [3, 3, 3, 1]),
    "chloromethane": ([*TETRAHEDRON, [0, 0, 0]], [2, 3, 3, 3, 1]),
    "benzene": (HEXAGON, [1] * 6),
    "sulfurhexafluoride": (0.6 * OCTAHEDRON, [1] * 6),
    "seleniumhexafluoride": (0.6 * OCTAHEDRON, [2] * 6),
    "uraniumhexafluoride": (0.6 * OCTAHEDRON, [3] * 6),
    "nearlycube": (CUBE * [1, 1 + 1e-8, 1 - 1e-8], [3] * 8),
}
SHAPES |= {name: (np.array(shape), types) for name, (shape, types) in TOPS.items()}


def assemble(
    bodies: list,
    h: np.ndarray,
    *,
    units: str = "lj",
    dimension: int = 3,
    flags: bool = True,
    temperature: float = 1.0,
    dt: float = 0.002,
    seed: int = 1,
    setup: str = "",
) -> System:
    """A System of Lennard-Jones atoms with random velocities, which are not rigid motion.

    Args:
        bodies: A list of (kind, positions, types).
        h: The box, columns are its vectors; positions may be outside.
        flags: Whether the data file has the image flags, or 0 0 0.
    """
    u, rng = UNITS[units], np.random.default_rng(seed)
    molecule = np.concatenate([[k + 1] * len(x) for k, (_, x, _) in enumerate(bodies)])
    x = np.concatenate([x for _, x, _ in bodies])
    kind = np.concatenate([types for *_, types in bodies])
    mass = MASSES[kind - 1]
    image = np.floor(x @ np.linalg.inv(h).T + 1e-12).astype(int)
    if dimension == 2:
        image[:, 2] = 0
    x = x - image @ h.T
    v = rng.normal(size=x.shape) * np.sqrt(temperature / mass)[:, None]
    v[:, dimension:] = 0
    v -= mass @ v / mass.sum()
    low = np.array([0.0, 0.0, -0.5 * h[2, 2] if dimension == 2 else 0.0])
    data = data_file(
        "molecular",
        [molecule, kind, x * u.length, image * flags],
        np.stack([low, low + np.diag(h)], axis=1) * u.length,
        tilt=np.array([h[0, 1], h[0, 2], h[1, 2]]) * u.length,
        mass=MASSES * u.mass,
        velocities=[v * (u.length / u.time)],
    )
    groups: dict[str, list[int]] = {}
    for number, name in sorted(
        enumerate((name for name, *_ in bodies), 1), key=lambda pair: pair[1]
    ):
        groups.setdefault(name, []).append(number)
    text = [
        f"units {units}",
        f"dimension {dimension}",
        "atom_style molecular",
        "atom_modify map array",
        setup,
        "read_data data.bodies",
        f"pair_style lj/cut {2.5 * u.length:.17g}",
        f"pair_coeff * * {u.energy:.17g} {u.length:.17g}",
        f"neighbor {0.4 * u.length:.17g} bin",
        "neigh_modify every 1 delay 0 check yes exclude molecule/intra all",
        *(f"group {name} molecule " + " ".join(map(str, ids)) for name, ids in groups.items()),
        "group bodies " + ("subtract all single" if "single" in groups else "union all"),
    ]
    return System(
        "\n".join(text),
        {"data.bodies": data},
        h * u.length,
        dt * u.time,
        singles="single" in groups,
        mass=mass * u.mass,
        molecule=molecule,
    )


def turned(
    kind: str, place: np.ndarray, others: list, h: np.ndarray, rng: np.random.Generator
) -> tuple[str, np.ndarray, np.ndarray]:
    """A body (kind, positions, types) of a shape at a place, with a random rotation so that it
    overlaps with no other."""
    shape, types = SHAPES[kind]
    for _ in range(1000):
        if h[2, 2] == 1:  # two dimensions
            turn = Rotation.from_rotvec([0, 0, rng.uniform(0, 6.3)])
        else:
            turn = Rotation.from_quat(rng.normal(size=4))
        x = turn.apply(np.array(shape, float)) + place
        gaps = (nearest(x[:, None] - y, h) for _, y, _ in others)
        if min((np.linalg.norm(gap, axis=2).min() for gap in gaps), default=np.inf) > 0.9:
            return kind, x, np.array(types)
    raise RuntimeError("no room")


def mixture(
    kinds: str = "solid planar pair row single",
    *,
    side: int = 3,
    tilt: float = 0.0,
    spacing: float = 2.55,
    dimension: int = 3,
    seed: int = 1,
    **more,
) -> System:
    """Bodies of these kinds in turn with random rotations, on a lattice across the box's faces.

    No distance in the lattice is the cutoff, where the potential energy is discontinuous.
    """
    rng = np.random.default_rng(seed)
    count = np.array([side, side, side if dimension == 3 else 1])
    h = spacing * side * np.array([[1, tilt, -tilt / 2], [0, 1, tilt / 3], [0, 0, 1.0]])
    if dimension == 2:
        h[:, 2] = 0, 0, 1
    bodies: list = []
    for kind, site in zip(itertools.cycle(kinds.split()), itertools.product(*map(range, count))):
        bodies.append(turned(kind, h @ (site / count), bodies, h, rng))
    bodies.sort(key=lambda body: list(SHAPES).index(body[0]))
    return assemble(bodies, h, dimension=dimension, seed=seed, **more)


# ---- runs


class Result(NamedTuple):
    """Atoms in order of ID at the end of a run, the thermo table, and the log."""

    x: np.ndarray
    v: np.ndarray
    thermo: dict[str, np.ndarray]
    log: str


def nearest(delta: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Displacements (..., 3) folded to the nearest image."""
    return delta - np.rint(delta @ np.linalg.inv(h).T) @ h.T


def apart(a: Result, b: Result, h: np.ndarray) -> float:
    """The largest distance between atoms of two Results, nearest images."""
    return np.linalg.norm(nearest(a.x - b.x, h), axis=1).max()
