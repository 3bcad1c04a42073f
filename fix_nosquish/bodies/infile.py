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
from .given import Given, Start
from .members import Members
from .membership import POINTS

_COLUMNS = 20
_OFF_CENTRE = 2.0  # radii of gyration that a centre of mass may be from that of the atoms
_OFF_POINT = 1e-3  # of the box, that it may be from a single atom: the file has few digits


def read(path: str, counts: bool, lammps: Lammps, members: Members, start: Start) -> Given:
    """Read the file; collective.

    Args:
        counts: whether its IDs count from 1 for the smallest of the bodies.
    Raises:
        RunError: if the file cannot be read, or names a body that is not there, or one twice, or
            has one far from its atoms.
    """
    communicator, ids = members.communicator, members.ids
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
    named = rows[:, 0].astype(np.int64) + _offset(counts, ids, communicator)
    here = np.isin(named, ids)
    order = np.argsort(ids)
    bodies = order[np.searchsorted(ids, named[here], sorter=order)]
    count = np.zeros(len(rows))
    count[here] = members.owned[bodies]
    missing = communicator.total(count) == 0
    if missing.any():
        raise RunError(
            f"the infile {path} names body {named[missing][0]}, which is not there", everywhere=True
        )
    rows, absent = rows[here], np.ones(len(ids), bool)
    absent[bodies] = False
    mass, image = rows[:, 1], rows[:, 17:20].T.astype(np.int64)
    shift = lammps.image_difference(image - start.image[:, bodies].astype(np.int64))
    centre = start.centre.copy()
    centre[:, bodies] = rows[:, 2:5].T - start.place[:, bodies] + lammps.box.h @ shift
    return Given(
        bodies=bodies, absent=absent, ids=ids[bodies], named=named, mass=mass,
        centre=centre[:, bodies], inertia=_tensors(rows),
        momenta=np.concatenate([mass * rows[:, 11:14].T, rows[:, 14:17].T]),
        warnings=_off_centre(lammps, members, start, centre - start.centre),
    )  # fmt: skip


def _offset(counts, ids, communicator):
    """By how much the bodies' IDs exceed those of a file that counts; else 0; collective."""
    if not counts:
        return 0
    return int(communicator.gather_to_all(ids[ids < POINTS]).min(initial=POINTS)) - 1


def _off_centre(lammps, members, start, off):
    """Warnings of bodies that the file has far from their atoms, (3, n); collective.

    Raises:
        RunError: where that is more than half the box.
    """
    far = np.abs(lammps.box.inverse @ off) * lammps.box.periodic[:, None] > 0.5
    members.refuse(
        far.any(axis=0),
        lambda k: (
            "has its centre in the infile more than half the box from its atoms: "
            "check the image flags there"
        ),
    )
    inertia = members.inertia(members.mass, start.delta - start.centre[:, members.body].T)
    trace = np.trace(inertia + start.particles)
    off, radius = np.linalg.norm(off, axis=0), np.sqrt(0.5 * trace / start.mass)  # of gyration
    point = radius < 1e-6 * off  # an atom alone, to rounding
    radius[point] = 0.0
    limit = np.where(point, _OFF_POINT * lammps.box.size, _OFF_CENTRE * radius)
    odd = members.owned & (off > limit)
    here = np.array([off, radius, members.ids], float).T[odd]
    rows = members.communicator.gather_to_all(here)
    if not len(rows):
        return ()
    off, radius, worst = rows[rows[:, 0].argmax()]
    name = members.membership.name(int(worst))
    return (
        f"WARNING: the infile has the centres of {len(rows)} bodies far from their atoms: that of "
        f"{name} by {off:.3g}, where its radius of gyration is {radius:.3g}. "
        "Give each fix the file of its own bodies",
    )


def _parse(path):
    """The rows of a file, (bodies, 20)."""
    with open(path) as file:
        lines = [line for line in (line.partition("#")[0].split() for line in file) if line]
    if not lines or len(lines[0]) != 1 or not lines[0][0].isdigit():
        raise ValueError("its first line must be the number of bodies in it")
    count = int(lines.pop(0)[0])
    if len(lines) != count:
        raise ValueError(f"it announces {count} bodies and has lines for {len(lines)}")
    for line in lines:
        if len(line) != _COLUMNS:
            raise ValueError(
                f"the line of body {line[0]} has {len(line)} values, where {_COLUMNS} are expected"
            )
    rows = np.array(lines, float).reshape(count, _COLUMNS)
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
    light = ~(rows[:, 1] > 0)
    if light.any():
        row = rows[light][0]
        raise ValueError(f"body {row[0]:.0f} has mass {row[1]:g} there: give it one above zero")
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


def write(path: str, counts: bool, bodies: Bodies, lammps: Lammps, communicator: Alone) -> None:
    """Write the bodies of the fix line, not its points, as they are, to a file that is whole, or is
    what it was; collective.

    Args:
        counts: as of `read`.
    Raises:
        RunError: if the file cannot be written.
    """
    turn = matrices(bodies.q)
    inertia = np.einsum("abn,bn,cbn->acn", turn, bodies.moments_of_atoms, turn)
    rows = np.concatenate(
        [
            bodies.id[None, :] - _offset(counts, bodies.id, communicator),
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
