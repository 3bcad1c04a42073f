"""Dumps of atoms, and conserved quantities of free bodies."""

from pathlib import Path

import numpy as np


def dump(every: int) -> list[str]:
    """LAMMPS commands that dump all atoms every so many steps; see `frames`."""
    return [
        f'dump atoms all custom {every} "{{folder}}/atoms.dump" id mass xu yu zu vx vy vz',
        "dump_modify atoms sort id format float %.17g flush yes",
    ]


def frames(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """What `dump` left, whole frames only: steps (frames,), masses (atoms,), positions and
    velocities (frames, atoms, 3)."""
    steps, values = read(folder / "atoms.dump")
    return steps, values[0, :, 1], values[:, :, 2:5], values[:, :, 5:8]


def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """A dump of numbers, whole frames only: steps (frames,) and values (frames, atoms, columns)."""
    lines = path.read_text().split("\n")[:-1]  # of a run that was ended the last may be half of one
    n = int(lines[3]) if len(lines) > 3 else 0
    size = n + 9
    count = len(lines) // size
    steps = np.array([int(lines[size * k + 1]) for k in range(count)], int)
    rows = [line.split() for k in range(count) for line in lines[size * k + 9 : size * (k + 1)]]
    return steps, np.array(rows, float).reshape(count, n, -1 if rows else 0)


def conserved(
    mass: np.ndarray, x: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Conserved quantities of a free body in each frame: kinetic energy (frames,), momentum,
    angular momentum about its centre (frames, 3).

    Args:
        mass: (atoms,) of the body.  x, v: (frames, atoms, 3).
    """
    centre, mean = (np.einsum("i,fij->fj", mass, a) / mass.sum() for a in (x, v))
    r, u = x - centre[:, None], v - mean[:, None]
    return (
        0.5 * np.einsum("i,fij,fij->f", mass, v, v),
        mean * mass.sum(),
        np.einsum("i,fij->fj", mass, np.cross(r, u)),
    )


def distances(x: np.ndarray) -> np.ndarray:
    """All distances within a body, (frames, pairs), of positions (frames, atoms, 3)."""
    i, j = np.triu_indices(x.shape[1], 1)
    return np.linalg.norm(x[:, i] - x[:, j], axis=2)


def relative(vectors: np.ndarray) -> float:
    """Largest |a(t) - a(0)| / |a(0)|, of (frames, 3)."""
    return float(np.linalg.norm(vectors - vectors[0], axis=1).max() / np.linalg.norm(vectors[0]))
