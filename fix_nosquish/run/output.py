"""The table of bodies: as numpy array, as file of keyword output, as the fix's global array."""

import contextlib
import io
from collections.abc import Callable
from typing import BinaryIO, NamedTuple

import numpy as np

from ..bodies.bodies import Bodies
from ..host.lammps import Lammps
from ..motion.frames import matrices
from ..ranks.communicator import Ranks


class _Units(NamedTuple):
    """The units of one of LAMMPS's unit styles."""

    mass: str
    length: str
    time: str
    velocity: str
    force: str
    torque: str


class _Field(NamedTuple):
    """A field of the table of bodies.

    Attributes:
        columns: of the file, one for each component.
        frame: in which the components are, "" for none.
        unit: in terms of `_Units`, "" for none.
    """

    name: str
    columns: tuple[str, ...]
    frame: str = ""
    unit: str = ""


_UNITS = {
    "lj": _Units("mass", "sigma", "tau", "sigma/tau", "epsilon/sigma", "epsilon"),
    "real": _Units("g/mol", "Angstrom", "fs", "Angstrom/fs", "kcal/mol/Angstrom", "kcal/mol"),
    "metal": _Units("g/mol", "Angstrom", "ps", "Angstrom/ps", "eV/Angstrom", "eV"),
    "si": _Units("kg", "m", "s", "m/s", "N", "N m"),
    "cgs": _Units("g", "cm", "s", "cm/s", "dyne", "dyne cm"),
    "electron": _Units("amu", "Bohr", "fs", "Bohr/fs", "Hartree/Bohr", "Hartree"),
    "micro": _Units("pg", "um", "us", "um/us", "pg um/us^2", "pg um^2/us^2"),
    "nano": _Units("ag", "nm", "ns", "nm/ns", "ag nm/ns^2", "ag nm^2/ns^2"),
}

_FIELDS = (
    _Field("step", ("step",)),
    _Field("time", ("time",), unit="{time}"),
    _Field("body", ("body",)),
    _Field("natoms", ("natoms",)),
    _Field("mass", ("mass",), unit="{mass}"),
    _Field("x", ("x", "y", "z"), "space frame", "{length}"),
    _Field("image", ("ix", "iy", "iz")),
    _Field("v", ("vx", "vy", "vz"), "space frame", "{velocity}"),
    _Field("q", ("q0", "q1", "q2", "q3"), "principal to space frame"),
    _Field(
        "angmom", ("angmomx", "angmomy", "angmomz"), "space frame", "{mass} {length} {velocity}"
    ),
    _Field("omega", ("omegax", "omegay", "omegaz"), "space frame", "rad/{time}"),
    _Field("force", ("fx", "fy", "fz"), "space frame", "{force}"),
    _Field("torque", ("tqx", "tqy", "tqz"), "space frame", "{torque}"),
)
_WHOLE = "step", "body", "natoms", "image"

DTYPE = np.dtype(
    [
        (
            field.name,
            np.int64 if field.name in _WHOLE else float,
            (len(field.columns),) if len(field.columns) > 1 else (),
        )
        for field in _FIELDS
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
    columns = {"id": tag, "mol": molecule, "mass": rows["mass"]}
    for names, values in (
        ("x y z", rows["x"]),
        ("xu yu zu", rows["x"] + rows["image"] @ lammps.box.h.T),
        ("ix iy iz", rows["image"]),
        ("vx vy vz", rows["v"]),
        ("fx fy fz", rows["force"]),
        ("tqx tqy tqz", rows["torque"]),
        ("omegax omegay omegaz", rows["omega"]),
        ("angmomx angmomy angmomz", rows["angmom"]),
        ("quatw quati quatj quatk", rows["q"]),
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
    known = lammps.tags, molecule, lammps.groups
    of_first = [first * column[bodies.index] for column in known]
    return bodies.sharers.total(bodies.body, of_first)


def global_array(rows: np.ndarray) -> np.ndarray:
    """Fix rigid's global array, (bodies, 15): centre, its velocity, force, torque, image flags."""
    columns = np.concatenate(
        [rows[name] for name in ("x", "v", "force", "torque", "image")], axis=1
    )
    return columns[np.argsort(rows["body"])]


class BodyFile:
    """The file of keyword output: comma-separated, column names, then a row per body and step.

    Methods are collective; only rank 0 writes.  After each step all of it is on disk, and a step
    that does not fit is taken back, so that the file always ends with a whole step.

    Args:
        path: where; an older file of this name is replaced.
        units: LAMMPS's unit style.  communicator: the `Communicator` or `ALONE`.
    Raises:
        RunError: on all ranks, if the file cannot be written.
    """

    def __init__(self, path: str, units: str, communicator: Ranks) -> None:
        self.path, self.communicator = path, communicator
        self.last: int | None = None  # the last step in it
        self._file: BinaryIO  # of rank 0, for the rest of the run
        self._size = 0
        self._do(lambda: self._open(header(units)))

    def write(self, step: int, rows: np.ndarray) -> None:
        """Append a step's rows, of all ranks and in the order of the bodies."""
        rows = self.communicator.gather(rows)
        self._do(lambda: self._append(_text(np.sort(rows, order="body"))))
        self.last = step

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


def header(units: str) -> bytes:
    """The line of column names: each says its frame and unit."""
    symbols, names = _UNITS[units]._asdict(), []
    for field in _FIELDS:
        says = "; ".join(filter(None, (field.frame, field.unit.format(**symbols))))
        names += [f"{name} ({says})" if says else name for name in field.columns]
    return (",".join(names) + "\n").encode()


def _text(rows: np.ndarray) -> bytes:
    columns, formats = [], []
    for field in _FIELDS:
        columns += [*np.atleast_2d(rows[field.name].T)]
        formats += ["%d" if field.name in _WHOLE else "%.17g"] * len(field.columns)
    text = io.BytesIO()
    np.savetxt(text, np.transpose(columns), fmt=formats, delimiter=",")
    return text.getvalue()
