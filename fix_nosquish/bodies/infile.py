"""Keyword infile of fix rigid: a file with mass, centre of mass, inertia, velocities of bodies.

The first line that is not empty and no comment holds the number of lines that follow, one a body:

    ID mass x y z ixx iyy izz ixy ixz iyz vx vy vz lx ly lz ix iy iz

with the ID as in fix rigid (1 for single, 1 to N for groups, else the molecule-ID or the custom
value), the tensor of inertia and the angular momentum l in the space frame, and the image flags of
the centre of mass.
"""

import contextlib
import os

import numpy as np

from ..errors import RunError
from ..host.lammps import Lammps
from ..ranks.communicator import Alone
from .bodies import Bodies, matrices

_COLUMNS = 20


class Given:
    """What the file says of this rank's bodies.

    Attributes:
        bodies: (m,) their places in this rank's list of bodies.
        absent: (n,) bool, the other ones of the list.
        named: IDs of all bodies in the file.
        mass: (m,).  x, image: (3, m), centre of mass and its image flags.
        inertia: (m, 3, 3), space frame.
    """

    def __init__(
        self, ids: np.ndarray, bodies: np.ndarray, rows: np.ndarray, named: np.ndarray
    ) -> None:
        self.named = named
        self.bodies, self.absent = bodies, np.ones(len(ids), bool)
        self.absent[bodies] = False
        self._ids = ids[bodies]
        self.mass, self.x, self.image = (
            rows[:, 1],
            rows[:, 2:5].T,
            rows[:, 17:20].T.astype(np.int64),
        )
        self.inertia = _tensors(rows)
        self._momenta = np.concatenate([self.mass * rows[:, 11:14].T, rows[:, 14:17].T])

    def momenta(self, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The bodies' places in a list of IDs, and their linear and angular momenta, (6, m)."""
        order = np.argsort(ids)
        return order[np.searchsorted(ids, self._ids, sorter=order)], self._momenta


def read(path: str, communicator: Alone, ids: np.ndarray, owned: np.ndarray) -> Given:
    """Read the file; collective.

    Args:
        ids: (n,) IDs of this rank's bodies.  owned: (n,) bool, each body on one rank only.
    Raises:
        RunError: if the file cannot be read, or names a body that is not there, or one twice.
    """
    rows, problem = None, None
    if communicator.rank == 0:
        try:
            rows = _parse(path)
        except (OSError, ValueError) as error:
            problem = (
                f"cannot read the infile {path}: "
                f"{error.strerror if isinstance(error, OSError) else error}"
            )
    communicator.agree(problem)
    rows = communicator.share(rows)
    named = rows[:, 0].astype(np.int64)
    here = np.isin(named, ids)
    order = np.argsort(ids)
    bodies = order[np.searchsorted(ids, named[here], sorter=order)]
    count = np.zeros(len(rows))
    count[here] = owned[bodies]
    missing = communicator.total(count) == 0
    if missing.any():
        raise RunError(
            f"the infile {path} names body {named[missing][0]}, which is not there", everywhere=True
        )
    return Given(ids, bodies, rows[here], named)


def _parse(path):
    """The rows of a file, (bodies, 20)."""
    with open(path) as file:
        lines = [line for line in (line.partition("#")[0].split() for line in file) if line]
    if not lines or len(lines[0]) != 1 or not lines[0][0].isdigit():
        raise ValueError("its first line must be the number of bodies in it")
    count = int(lines.pop(0)[0])
    if len(lines) < count:
        raise ValueError(f"it announces {count} bodies and has lines for {len(lines)}")
    for line in lines[:count]:
        if len(line) != _COLUMNS:
            raise ValueError(
                f"the line of body {line[0]} has {len(line)} values, where {_COLUMNS} are expected"
            )
    rows = np.array(lines[:count], float).reshape(count, _COLUMNS)
    ids, times = np.unique(rows[:, 0], return_counts=True)
    if (times > 1).any():
        raise ValueError(f"body {ids[times > 1][0]:.0f} stands in it twice")
    if not np.isfinite(rows).all():
        raise ValueError(
            f"the line of body {rows[~np.isfinite(rows).all(axis=1)][0, 0]:.0f} has a value that "
            "is not finite"
        )
    if (rows[:, 0] % 1).any():
        raise ValueError(f"{rows[rows[:, 0] % 1 > 0][0, 0]:g} is no ID of a body")
    moment = np.linalg.eigvalsh(_tensors(rows))
    negative = moment[:, 0] < -1e-7 * np.abs(moment).max(axis=1)
    if negative.any():
        raise ValueError(
            f"the inertia of body {rows[negative][0, 0]:.0f} has a negative principal moment, "
            f"{moment[negative][0, 0]:g}"
        )
    return rows


def _tensors(rows):
    """The tensors of inertia (n, 3, 3) in rows of the file."""
    xx, yy, zz, xy, xz, yz = rows[:, 5:11].T
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)


def write(path: str, bodies: Bodies, lammps: Lammps, communicator: Alone) -> None:
    """Write the bodies of the fix line, not its points, as they are, to a file that is whole, or is
    what it was; collective.

    Raises:
        RunError: if the file cannot be written.
    """
    turn = matrices(bodies.q)
    inertia = np.einsum("abn,bn,cbn->acn", turn, bodies.moments_of_atoms, turn)
    rows = np.concatenate(
        [
            bodies.id[None, :],
            bodies.mass[None, :],
            bodies.x,
            inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
            bodies.v,
            bodies.momenta()[3:],
            bodies.image,
        ]
    )[:, bodies.listed].T
    rows, problem = communicator.gather(rows), None
    if communicator.rank == 0:
        part = f"{path}.part"
        try:
            with open(part, "w") as file:
                file.write(
                    "# fix_nosquish: mass, centre of mass, inertia, velocities of the bodies on "
                    f"timestep {lammps.step}\n\n{len(rows)}\n"
                )
                np.savetxt(
                    file, rows[np.argsort(rows[:, 0])], fmt=["%d"] + ["%.17g"] * 16 + ["%d"] * 3
                )
            os.replace(part, path)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.remove(part)
            problem = f"cannot write the bodies to {path}: {error.strerror}"
    communicator.agree(problem)
