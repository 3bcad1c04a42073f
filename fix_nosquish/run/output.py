"""The table of bodies: as numpy array, as file of keyword output, as the fix's global array."""

import contextlib
import io
from collections.abc import Callable, Iterable
from typing import BinaryIO

import numpy as np

from ..bodies.bodies import Bodies
from ..bodies.species import keys
from ..host.lammps import Lammps
from ..motion.frames import matrices
from ..ranks.communicator import Ranks

_FIELDS = {
    "step": "step",
    "time": "time",
    "body": "body",
    "natoms": "natoms",
    "mass": "mass",
    "x": "x y z",
    "image": "ix iy iz",
    "v": "vx vy vz",
    "q": "q0 q1 q2 q3",
    "angmom": "angmomx angmomy angmomz",
    "omega": "omegax omegay omegaz",
    "force": "fx fy fz",
    "torque": "tqx tqy tqz",
}  # field of the table of bodies: columns of the file, one for each component
_WHOLE = "step", "body", "natoms", "image"
_QUATERNION = "quatw quati quatj quatk"  # the columns of field q in LAMMPS's words
_DUMP = (
    "mass x y z ix iy iz vx vy vz quati quatj quatk quatw angmomx angmomy angmomz "
    "omegax omegay omegaz fx fy fz tqx tqy tqz"
)  # columns of LAMMPS's dump format after id and type

DTYPE = np.dtype(
    [
        (name, np.int64 if name in _WHOLE else float, (n,) if (n := len(names.split())) > 1 else ())
        for name, names in _FIELDS.items()
    ]
)


def table(bodies: Bodies, lammps: Lammps) -> np.ndarray:
    """The bodies that are counted on this rank: each of the simulation's bodies is on one rank.

    Atoms of keyword flexible are not among them.

    Returns:
        structured array (n,), in the order of the bodies' IDs, in LAMMPS's units, vectors in the
        space frame: step, time, body (its ID), natoms, mass, x (centre of mass in the box, or
        slightly outside) with its image flags, velocity v, quaternion q (scalar first; it turns the
        principal into the space frame), angmom and omega, and, of the last forces that LAMMPS
        computed, force and torque about the centre of mass, before keywords force and torque act.
    """
    frames = matrices(bodies.q)
    rows = np.empty(len(bodies), DTYPE)
    rows["step"], rows["time"] = lammps.step, lammps.time
    rows["body"], rows["natoms"], rows["mass"] = bodies.id, bodies.natoms, bodies.mass
    rows["x"], rows["image"] = bodies.x.T, bodies.image.T
    rows["v"], rows["q"] = bodies.v.T, bodies.q.T
    rows["angmom"] = bodies.momenta()[3:].T
    rows["omega"] = np.einsum("abn,bn->na", frames, bodies.angular_velocity() * bodies.slowness)
    rows["force"], rows["torque"] = bodies.force.T, bodies.torque.T
    return rows[_listed(bodies)]


def _listed(bodies: Bodies) -> np.ndarray:
    """Places of the bodies in the table, in the order of their IDs."""
    places = np.flatnonzero(bodies.listed)
    return places[np.argsort(bodies.id[places])]


def rows_of_rank(bodies: Bodies, lammps: Lammps, words: list[str], groupbit: int) -> np.ndarray:
    """What LAMMPS's compute rigid/local says of the bodies that are counted on this rank, (n,
    words); collective.

    Args:
        words: values, as the compute names them.  groupbit: of a group in which the atom of a body
            is that has the smallest ID; "id" and "mol" are those of this atom.
    """
    listed = _listed(bodies)
    rows, (tag, molecule, groups) = table(bodies, lammps), _first_atoms(bodies, lammps)[:, listed]
    columns = _columns(rows) | {"id": tag, "mol": molecule}
    for names, values in (
        ("xu yu zu", rows["x"] + rows["image"] @ lammps.box.h.T),
        (_QUATERNION, rows["q"]),
        ("inertiax inertiay inertiaz", bodies.moments_of_atoms[:, listed].T),
    ):
        columns |= dict(zip(names.split(), values.T, strict=True))
    wanted = np.array([columns[word] for word in words], float).reshape(len(words), -1).T
    return np.ascontiguousarray(wanted[groups.astype(np.int64) & groupbit != 0])


def _first_atoms(bodies: Bodies, lammps: Lammps) -> np.ndarray:
    """ID, molecule-ID and bits of groups of the atom with the smallest ID that each body has on any
    rank, (3, n); collective."""
    (lowest,) = bodies.sharers.lowest(bodies.body, bodies.tag)
    first = bodies.tag == lowest[bodies.body]
    molecule = lammps.per_atom("molecule", lammps.tagint)
    if molecule is None:
        molecule = np.zeros_like(lammps.tags)
    columns = lammps.tags, molecule, lammps.groups
    return bodies.sharers.total(bodies.body, [first * column[bodies.index] for column in columns])


def global_array(rows: np.ndarray) -> np.ndarray:
    """Fix rigid's global array, (bodies, 15): centre, its velocity, force, torque, image flags."""
    columns = np.concatenate(
        [rows[name] for name in ("x", "v", "force", "torque", "image")], axis=1
    )
    return columns[np.argsort(rows["body"])]


def _columns(rows: np.ndarray) -> dict[str, np.ndarray]:
    """The columns (n,) of a table of bodies by name, in the order of the file."""
    return {
        name: column
        for field, names in _FIELDS.items()
        for name, column in zip(names.split(), np.atleast_2d(rows[field].T), strict=True)
    }


class BodyFile:
    """The file of keyword output.

    Its ending decides the format: with ``.lammpstrj`` that of LAMMPS's dump files, one particle per
    body; else comma-separated text, column names, then a row per body and step.

    Methods are collective; only rank 0 writes.  After each step all of it is on disk, and a step
    that does not fit is taken back, so that the file always ends with a whole step.

    Args:
        path: where; an older file of this name is replaced.
        communicator: the `Communicator` or `ALONE`.
    Raises:
        RunError: on all ranks, if the file cannot be written.
    """

    def __init__(self, path: str, communicator: Ranks) -> None:
        self.path, self.communicator = path, communicator
        self.last: int | None = None  # the last step in it
        self._file: BinaryIO  # of rank 0, for the rest of the run
        self._size = 0
        self._dump = path.endswith(".lammpstrj")
        self._types: dict[float, int] = {}  # of rank 0: species, in the order in which they came
        header = ",".join(" ".join(_FIELDS.values()).split()) + "\n"
        self._do(lambda: self._open(b"" if self._dump else header.encode()))

    def write(self, bodies: Bodies, lammps: Lammps) -> None:
        """Append the bodies of this step, of all ranks and in the order of their IDs."""
        gather = self.communicator.gather
        rows, species = gather(table(bodies, lammps)), None
        if self._dump:
            species = gather(keys(bodies, lammps.types[bodies.index])[_listed(bodies)])
        self._do(lambda: self._append(self._text(rows, species, lammps)))
        self.last = lammps.step

    def _text(self, rows: np.ndarray, species: np.ndarray | None, lammps: Lammps) -> bytes:
        """A step's rows, (n,) in any order; species: (n,) a number for each, None in a CSV file."""
        order = np.argsort(rows["body"])
        rows, text = rows[order], io.BytesIO()
        columns = _columns(rows)
        if species is not None:
            number = self._types.setdefault
            types = [number(key, len(self._types) + 1) for key in species[order].tolist()]
            columns |= dict(zip(_QUATERNION.split(), rows["q"].T, strict=True))
            columns = {"id": rows["body"], "type": np.array(types, int)} | {
                name: columns[name] for name in _DUMP.split()
            }
            text.write(_dump_header(lammps, len(rows), columns))
        formats = ["%d" if column.dtype == int else "%.17g" for column in columns.values()]
        delimiter = " " if self._dump else ","
        np.savetxt(text, np.transpose([*columns.values()]), fmt=formats, delimiter=delimiter)
        return text.getvalue()

    def _do(self, work: Callable[[], None]) -> None:
        problem = None
        if self.communicator.rank == 0:
            try:
                work()
            except OSError as error:
                whole = f"it is whole up to step {self.last}"
                problem = (
                    f"cannot write the table of bodies (keyword output) to {self.path}: "
                    f"{error.strerror}; {'nothing is in it' if self.last is None else whole}"
                )
        self.communicator.agree(problem)

    def _open(self, text: bytes) -> None:
        self._file = open(self.path, "wb", buffering=0)  # noqa: SIM115
        self._append(text)

    def _append(self, text: bytes) -> None:
        try:
            rest = memoryview(text)
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            with contextlib.suppress(OSError):  # what is no ordinary file cannot be cut
                self._file.truncate(self._size)
            raise
        self._size += len(text)


def _dump_header(lammps: Lammps, n: int, columns: Iterable[str]) -> bytes:
    """What precedes the rows of a step in LAMMPS's dump format; n bodies."""
    box = lammps.box
    corners = box.lo + np.array([*np.ndindex(2, 2, 2)]) @ box.h.T
    bounds, tilts = np.column_stack([corners.min(axis=0), corners.max(axis=0)]), ""
    if lammps.setting("triclinic"):
        bounds, tilts = np.column_stack([bounds, box.h[[0, 0, 1], [1, 2, 2]]]), "xy xz yz "
    lines = [
        f"ITEM: TIMESTEP\n{lammps.step}\nITEM: NUMBER OF ATOMS\n{n}",
        f"ITEM: BOX BOUNDS {tilts}{' '.join('pp' if wraps else 'ff' for wraps in box.periodic)}",
        *(" ".join(f"{bound:.17g}" for bound in row) for row in bounds),
        f"ITEM: ATOMS {' '.join(columns)}\n",
    ]
    return "\n".join(lines).encode()
