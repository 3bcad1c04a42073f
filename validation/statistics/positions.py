"""Positions of atoms in a run."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Positions:
    """Atoms of a run, in order of ID, at its start and after each part (see ``worker``).

    Attributes:
        x: (frames, atoms, 3).  bodies: (atoms,), 0 for none.
        cells: (frames, 3, 3), of each frame the cell's vectors as rows.  periodic: (3,) bool.
        v, mass: of a job with ``motion`` only: velocities as ``x``, (atoms,).
    """

    x: np.ndarray
    bodies: np.ndarray
    cells: np.ndarray
    periodic: np.ndarray
    v: np.ndarray = field(default_factory=lambda: np.empty(0))
    mass: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def cell(self) -> np.ndarray:
        """Cell vectors of the last frame, as rows."""
        return self.cells[-1]
