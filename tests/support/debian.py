"""Debian's LAMMPS, which has a fix python/move of its own, and a box of water for it."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np

import fix_nosquish
from support.running import ROOT
from validation.scenes.data_file import data_file

LMP = Path(os.environ.get("DEBIAN_LAMMPS", "/usr/bin/lmp"))


def obstacle():
    """Why these tests cannot run here, or nothing."""
    if not LMP.exists():
        return f"Debian's lammps package is not installed: no {LMP}"
    libraries = subprocess.run(["ldd", LMP], capture_output=True, text=True).stdout
    version = re.search(r"libpython(\d+\.\d+)", libraries)
    here = "{}.{}".format(*sys.version_info)
    if not version or version[1] != here:
        return (
            f"{LMP} holds Python {version and version[1]}, "
            f"which cannot use the compiled packages of this Python {here}"
        )
    return None


ICE = f"""
units         real
atom_style    full
read_data     data.ice
include       {ROOT}/inputs/water/forcefield.water
group         water type 1 2
velocity      all create 295 4928
"""


def ice(side=5, spacing=3.1):
    """A data file of water molecules on a cubic lattice, turned at random."""
    rng = np.random.default_rng(295)
    n = side**3
    half = np.radians(104.52 / 2)
    x, y = 0.9572 * np.cos(half), 0.9572 * np.sin(half)
    molecule = np.array([[0, 0, 0], [x, y, 0], [x, -y, 0]])
    turn = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
    centres = spacing * (np.stack(np.meshgrid(*[np.arange(side)] * 3), -1).reshape(n, 1, 3) + 0.5)
    place = (centres + np.einsum("nij,aj->nai", turn, molecule)).reshape(-1, 3)
    first = np.arange(0, 3 * n, 3)
    kind = np.tile([1, 2, 2], n)
    return data_file(
        "full",
        [np.repeat(np.arange(n), 3) + 1, kind, np.where(kind == 1, -0.834, 0.417), place],
        (0, side * spacing),
        mass=[15.9994, 1.008],
        terms={
            "bonds": [(1, m + 1, m + 1 + h) for m in first for h in (1, 2)],
            "angles": [(1, m + 2, m + 1, m + 3) for m in first],
        },
    )


def debian(ranks):
    """The command that starts Debian's LAMMPS, up to the name of the input script."""
    packages = dict.fromkeys(str(Path(module.__file__).parents[1]) for module in (fix_nosquish, np))
    return [
        "env",
        "OMPI_ALLOW_RUN_AS_ROOT=1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1",
        "OMPI_MCA_mpi_yield_when_idle=1",  # else ranks that wait take the cores, half of the time
        f"PYTHONPATH={':'.join(packages)}",
        *([str(LMP.parent / "mpirun"), "--oversubscribe", "-np", str(ranks)] if ranks > 1 else []),
        str(LMP),
        "-in",
    ]
