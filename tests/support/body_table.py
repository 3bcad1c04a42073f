"""The table of bodies that keyword output writes."""

import re

import numpy as np

GENERAL = [
    "step",
    "time",
    "body",
    "natoms",
    "mass",
    "x",
    "y",
    "z",
    "ix",
    "iy",
    "iz",
    "vx",
    "vy",
    "vz",
    "q0",
    "q1",
    "q2",
    "q3",
]
MOMENTS = [
    "angmomx",
    "angmomy",
    "angmomz",
    "omegax",
    "omegay",
    "omegaz",
    "fx",
    "fy",
    "fz",
    "tqx",
    "tqy",
    "tqz",
]
NAMES = [*GENERAL, *MOMENTS]


def read_table(path):
    """The table as a structured array, by numpy alone."""
    with open(path) as file:
        header = file.readline().rstrip("\n").split(",")
    assert header == NAMES
    table = np.genfromtxt(path, delimiter=",", names=True)
    assert len(table.dtype.names) == len(NAMES)
    table = np.atleast_1d(table)
    table.dtype.names = NAMES
    return table


def read_dump(path):
    """The file in LAMMPS's dump format as a structured array, with the table's names of columns,
    and a field type: without time and natoms."""
    names = {"id": "body", "quatw": "q0", "quati": "q1", "quatj": "q2", "quatk": "q3"}
    rows = []
    for frame in path.read_text().split("ITEM: TIMESTEP\n")[1:]:
        head, columns, values = re.split("ITEM: ATOMS (.*)\n", frame)
        rows += [[*head.split()[:1], *line.split()] for line in values.splitlines()]
        assert len(values.splitlines()) == int(head.split()[5])
    fields = [(names.get(name, name), float) for name in ["step", *columns.split()]]
    return np.array([tuple(map(float, row)) for row in rows], fields)


def vector(table, *names):
    return np.stack([table[name] for name in names], axis=-1)
