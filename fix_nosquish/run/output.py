"""The table of bodies: as numpy array, as file of keyword output, as the fix's global array."""

import contextlib
import io

import numpy as np

from ..motion.frames import matrices

# mass, length, time, velocity, force, torque in each of LAMMPS's unit styles
_UNITS = {
    "lj": ("mass", "sigma", "tau", "sigma/tau", "epsilon/sigma", "epsilon"),
    "real": ("g/mol", "Angstrom", "fs", "Angstrom/fs", "kcal/mol/Angstrom", "kcal/mol"),
    "metal": ("g/mol", "Angstrom", "ps", "Angstrom/ps", "eV/Angstrom", "eV"),
    "si": ("kg", "m", "s", "m/s", "N", "N m"),
    "cgs": ("g", "cm", "s", "cm/s", "dyne", "dyne cm"),
    "electron": ("amu", "Bohr", "fs", "Bohr/fs", "Hartree/Bohr", "Hartree"),
    "micro": ("pg", "um", "us", "um/us", "pg um/us^2", "pg um^2/us^2"),
    "nano": ("ag", "nm", "ns", "nm/ns", "ag nm/ns^2", "ag nm^2/ns^2"),
}

# field, its components as columns of the file, frame, unit
_FIELDS = (
    ("step", ("step",), "", ""),
    ("time", ("time",), "", "{time}"),
    ("body", ("body",), "", ""),
    ("natoms", ("natoms",), "", ""),
    ("mass", ("mass",), "", "{mass}"),
    ("x", ("x", "y", "z"), "space frame", "{length}"),
    ("image", ("ix", "iy", "iz"), "", ""),
    ("v", ("vx", "vy", "vz"), "space frame", "{velocity}"),
    ("q", ("q0", "q1", "q2", "q3"), "principal to space frame", ""),
    ("angmom", ("angmomx", "angmomy", "angmomz"), "space frame", "{mass} {length} {velocity}"),
    ("omega", ("omegax", "omegay", "omegaz"), "space frame", "rad/{time}"),
    ("force", ("fx", "fy", "fz"), "space frame", "{force}"),
    ("torque", ("tqx", "tqy", "tqz"), "space frame", "{torque}"),
)
_WHOLE = "step", "body", "natoms", "image"
DTYPE = np.dtype(
    [
        (name, np.int64 if name in _WHOLE else float, (len(parts),) if len(parts) > 1 else ())
        for name, parts, *_ in _FIELDS
    ]
)


def table(bodies, lammps):
    """The bodies that are counted on this rank: each of the simulation's bodies is on one rank.

    Atoms of keyword points are not among them.

    Returns:
        structured array (n,), in LAMMPS's units, vectors in the space frame: step, time, body (its
        ID), natoms, mass, x (centre of mass in the box, or slightly outside) with its image flags,
        velocity v, quaternion q (scalar first; it turns the principal into the space frame), angmom
        and omega, and, of the last forces that LAMMPS computed, force and torque about the centre
        of mass.
    """
    turn = matrices(bodies.q)
    rows = np.empty(len(bodies), DTYPE)
    rows["step"], rows["time"] = lammps.step, lammps.time
    rows["body"], rows["natoms"], rows["mass"] = bodies.id, bodies.natoms, bodies.mass
    rows["x"], rows["image"], rows["v"], rows["q"] = (
        bodies.x.T,
        bodies.image.T,
        bodies.v.T,
        bodies.q.T,
    )
    rows["angmom"] = bodies.momenta()[3:].T
    rows["omega"] = np.einsum("abn,bn->na", turn, bodies.angular_velocity() * bodies.slowness)
    rows["force"], rows["torque"] = bodies.force.T, bodies.torque.T
    return rows[bodies.listed]


def rows_of_rank(bodies, lammps, communicator, words, groupbit):
    """What LAMMPS's compute rigid/local says of the bodies that are counted on this rank, (n,
    words); collective.

    Args:
        words: values, as the compute names them.  groupbit: of a group in which the atom of a body
            is that has the smallest ID; "id" and "mol" are those of this atom.
    """
    rows, listed, first = table(bodies, lammps), bodies.listed, _first_atoms(bodies, lammps)
    first = _of_all_ranks(first, bodies, communicator)[listed]
    unwrapped = rows["x"] + rows["image"] @ lammps.box.h.T
    columns = {"id": first["tag"], "mol": first["molecule"], "mass": rows["mass"]}
    for names, values in (
        (("x", "y", "z"), rows["x"]),
        (("xu", "yu", "zu"), unwrapped),
        (("ix", "iy", "iz"), rows["image"]),
        (("vx", "vy", "vz"), rows["v"]),
        (("fx", "fy", "fz"), rows["force"]),
        (("tqx", "tqy", "tqz"), rows["torque"]),
        (("omegax", "omegay", "omegaz"), rows["omega"]),
        (("angmomx", "angmomy", "angmomz"), rows["angmom"]),
        (("quatw", "quati", "quatj", "quatk"), rows["q"]),
        (("inertiax", "inertiay", "inertiaz"), bodies.moments_of_atoms[:, listed].T),
    ):
        columns |= dict(zip(names, values.T, strict=True))
    wanted = np.array([columns[word] for word in words], float).reshape(len(words), -1).T
    return np.ascontiguousarray(wanted[first["groups"] & groupbit != 0])


_ATOM = np.dtype(
    [("body", np.int64), ("tag", np.int64), ("molecule", np.int64), ("groups", np.int64)]
)


def _first_atoms(bodies, lammps):
    """The atom with the smallest ID that each body has on this rank, (n,) of `_ATOM`."""
    order = np.lexsort((bodies.tag, bodies.body))
    found, places = np.unique(bodies.body[order], return_index=True)
    atoms = bodies.index[order[places]]
    molecule = lammps.per_atom("molecule", lammps.tagint)
    first = np.zeros(len(bodies), _ATOM)
    first["body"], first["tag"] = bodies.id, np.iinfo(np.int64).max
    first["tag"][found] = lammps.tags[atoms]
    first["groups"][found] = lammps.groups[atoms]
    if molecule is not None:
        first["molecule"][found] = molecule[atoms]
    return first


def _of_all_ranks(first, bodies, communicator):
    """The same, of the atoms that shared bodies have on all ranks; collective."""
    shared = bodies.sharers.bodies
    rows = np.sort(communicator.gather_to_all(first[shared]), order=("body", "tag"))
    ids, places = np.unique(rows["body"], return_index=True)
    first[shared] = rows[places[np.searchsorted(ids, first["body"][shared])]]
    return first


def global_array(rows):
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

    def __init__(self, path, units, communicator):
        self.path, self.communicator = path, communicator
        self.last = None  # the last step in it
        self._file, self._size = None, 0
        self._do(lambda: (self._open(), self._append(header(units))))

    def write(self, step, rows):
        """Append a step's rows, of all ranks and in the order of the bodies."""
        rows = self.communicator.gather(rows)
        self._do(lambda: self._append(_text(np.sort(rows, order="body"))))
        self.last = step

    def _do(self, work):
        problem = None
        if self.communicator.rank == 0:
            try:
                work()
            except OSError as error:
                kept = (
                    "nothing is in it"
                    if self.last is None
                    else f"it is whole up to step {self.last}"
                )
                problem = (
                    f"cannot write the table of bodies (keyword output) to {self.path}: "
                    f"{error.strerror}; {kept}"
                )
        self.communicator.agree(problem)

    def _open(self):
        self._file = open(self.path, "wb", buffering=0)  # noqa: SIM115  for the rest of the run

    def _append(self, text):
        try:
            rest = memoryview(text)
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            with contextlib.suppress(OSError):  # what is no ordinary file cannot be cut
                self._file.truncate(self._size)
            raise
        self._size += len(text)


def header(units):
    """The line of column names, as bytes: each says its frame and unit."""
    symbols = dict(zip(("mass", "length", "time", "velocity", "force", "torque"), _UNITS[units]))
    names = []
    for _, parts, frame, unit in _FIELDS:
        says = "; ".join(word for word in (frame, unit.format(**symbols)) if word)
        names += [f"{part} ({says})" if says else part for part in parts]
    return (",".join(names) + "\n").encode()


def _text(rows):
    columns = [np.atleast_2d(rows[name].T) for name in DTYPE.names]
    formats = [
        "%d" if name in _WHOLE else "%.17g"
        for name, column in zip(DTYPE.names, columns)
        for _ in column
    ]
    text = io.BytesIO()
    np.savetxt(text, np.concatenate(columns).T, fmt=formats, delimiter=",")
    return text.getvalue()
