"""Keyword infile as in fix rigid: mass, centre of mass, inertia and velocities of bodies in a file.

The first line that is neither empty nor a comment is the number of bodies; one line each follows:

    ID mass x y z ixx iyy izz ixy ixz iyz vx vy vz lx ly lz ix iy iz

with the ID as in fix rigid (1 for single, 1 to N for groups, else the molecule-ID or the custom
value), the tensor of inertia and the angular momentum l in the space frame, and the image flags of
the centre of mass.
"""

import contextlib
import os
from collections.abc import Callable

import numpy as np

from ..motion.frames import matrices
from ..ranks.communicator import Ranks
from .bodies import Bodies
from .build import Prescribed
from .membership import FLEXIBLE, Membership
from .unwrap import UnwrappedPositions

_COLUMNS = 20
_OFF_CENTRE = 2.0  # largest distance of the centre from that of the atoms, in radii of gyration
_ROUNDED = 1e-3  # distances below this fraction of the box are ignored: the file has few digits


def read(path: str, counts: bool, unwrapped: UnwrappedPositions) -> Prescribed:
    """Read the file; collective.

    Args:
        counts: whether its IDs are numbered from 1 for the lowest body ID.
        unwrapped: unwrapped positions of this rank's atoms.
    Raises:
        RunError: on all ranks, if the file cannot be read, names a body that does not exist or is
            named twice, or has a centre of mass far from the body's atoms.
    """
    members = unwrapped.members
    lammps, communicator, ids = members.lammps, members.communicator, members.ids
    rows, problem = np.empty((0, _COLUMNS)), None
    if communicator.rank == 0:
        try:
            rows = _parse(path)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", error)
            problem = f"cannot read the infile {path}: {why}"
    communicator.agree(problem)
    rows = communicator.share(rows)
    named = rows[:, 0].astype(np.int64) + _offset(counts, ids, communicator)
    missing = communicator.total(np.isin(named, ids[members.owned])) == 0
    communicator.refuse(
        missing, lambda k: f"the infile {path} names body {named[k]}, which is not there"
    )
    rows = rows[np.argsort(named)][np.isin(np.sort(named), ids)]
    which = np.isin(ids, named)
    mass, image = rows[:, 1], rows[:, 17:20].T.astype(np.int64)
    shift = lammps.image_difference(image - unwrapped.image[:, which].astype(np.int64))
    centre = rows[:, 2:5].T - unwrapped.place[:, which] + lammps.box.h @ shift
    off = np.zeros_like(unwrapped.centre)
    off[:, which] = centre - unwrapped.centre[:, which]
    return Prescribed(
        which=which,
        ids=named,
        mass=mass,
        centre=centre,
        inertia=_tensors(rows),
        momenta=np.concatenate([mass * rows[:, 11:14].T, rows[:, 14:17].T]),
        warnings=_off_centre(unwrapped, off),
    )


def _offset(counts: bool, ids: np.ndarray, communicator: Ranks) -> int:
    """Body ID minus ID in the file if the file counts from 1; else 0; collective."""
    if not counts:
        return 0
    return int(communicator.gather_to_all(ids[ids < FLEXIBLE]).min(initial=FLEXIBLE)) - 1


def _off_centre(unwrapped: UnwrappedPositions, off: np.ndarray) -> list[str]:
    """Warnings of bodies whose centres in the file are far from their atoms; collective.

    Args:
        off: (3, n) centre of mass in the file minus that of the atoms.
    Raises:
        RunError: on all ranks, if the distance exceeds half the box.
    """
    members = unwrapped.members
    box = members.lammps.box
    far = np.abs(box.inverse @ off) * box.periodic[:, None] > 0.5
    members.refuse(
        far.any(axis=0),
        lambda k: (
            "has its centre in the infile more than half the box from its atoms: "
            "check the image flags there"
        ),
    )
    trace = np.trace(unwrapped.inertia())
    off, radius = np.linalg.norm(off, axis=0), np.sqrt(0.5 * trace / members.mass)  # of gyration
    odd = members.owned & (off > np.maximum(_ROUNDED * box.size, _OFF_CENTRE * radius))
    count = members.communicator.count(odd.sum())
    if not count:
        return []
    worst, size, body = members.furthest(odd, off, radius, members.ids)
    name = members.membership.name(int(body))
    return [
        f"WARNING: the infile has the centres of {count} bodies far from their atoms: that of "
        f"{name} by {worst:.3g}, where its radius of gyration is {size:.3g}. "
        "Give each fix the file of its own bodies"
    ]


def _parse(path: str) -> np.ndarray:
    """The rows of a file, (bodies, 20).

    Raises:
        OSError, ValueError: if it cannot be read.
    """
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
    ids, mass = rows[:, 0], rows[:, 1]
    numbers, times = np.unique(ids, return_counts=True)

    def refuse(wrong: np.ndarray, text: Callable[[int], str]) -> None:
        """Raise an error if a row is wrong, with the text for the first such row."""
        if wrong.any():
            raise ValueError(text(int(wrong.argmax())))

    refuse(np.isin(ids, numbers[times > 1]), lambda k: f"body {ids[k]:.0f} is in it twice")
    refuse(
        ~np.isfinite(rows).all(axis=1),
        lambda k: f"the line of body {ids[k]:.0f} has a value that is not finite",
    )
    refuse(ids % 1 > 0, lambda k: f"{ids[k]:g} is no ID of a body")
    refuse(
        ~(mass > 0),
        lambda k: f"body {ids[k]:.0f} has mass {mass[k]:g} there: give it one above zero",
    )
    return rows


def _tensors(rows: np.ndarray) -> np.ndarray:
    """The tensors of inertia (n, 3, 3) in rows (n, 20) of the file."""
    xx, yy, zz, xy, xz, yz = rows[:, 5:11].T
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)


def write(path: str, counts: bool, bodies: Bodies, membership: Membership) -> None:
    """Write the bodies, without flexible atoms, to a file; collective.

    The file is replaced only when it is complete.

    Args:
        counts: see `read`.
    Raises:
        RunError: on all ranks, if the file cannot be written.
    """
    communicator, turn = membership.communicator, matrices(bodies.q)
    inertia = np.einsum("abn,bn,cbn->acn", turn, bodies.moments_of_atoms, turn)
    columns = [
        bodies.id[None, :] - _offset(counts, bodies.id, communicator),
        bodies.mass[None, :],
        bodies.x,
        inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]],
        bodies.v,
        bodies.momenta()[3:],
        bodies.image,
    ]
    rows, problem = communicator.gather(np.concatenate(columns)[:, bodies.listed].T), None
    if communicator.rank == 0:
        rows, part = rows[np.argsort(rows[:, 0])], f"{path}.part"
        try:
            with open(part, "w") as file:
                file.write(
                    "# fix_nosquish: mass, centre of mass, inertia, velocities of the bodies on "
                    f"timestep {membership.lammps.step}\n\n{len(rows)}\n"
                )
                np.savetxt(file, rows, fmt=["%d"] + ["%.17g"] * 16 + ["%d"] * 3)
            os.replace(part, path)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.remove(part)
            problem = f"cannot write the bodies to {path}: {error.strerror}"
    communicator.agree(problem)
