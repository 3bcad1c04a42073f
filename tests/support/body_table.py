"""The table of bodies that keyword output writes."""

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
    """The table as a structured array, with the names without frame and unit, by numpy alone."""
    with open(path) as file:
        header = file.readline().rstrip("\n").split(",")
    assert [name.split(" (")[0] for name in header] == NAMES
    table = np.genfromtxt(path, delimiter=",", names=True)
    assert len(table.dtype.names) == len(NAMES)
    table = np.atleast_1d(table)
    table.dtype.names = NAMES
    return table


def vector(table, *names):
    return np.stack([table[name] for name in names], axis=-1)
