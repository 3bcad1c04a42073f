"""What the ranks of a run and of a reader share: atoms, the cell, fixes and messages of LAMMPS."""

import re
import sys
from pathlib import Path

import numpy as np
from lammps import lammps
from mpi4py import MPI


def gather(lmp: lammps, name: str, kind: int, count: int) -> np.ndarray:
    """A per-atom array of all ranks, in order of atom ID; collective."""
    get = lmp.gather if name.startswith("i_") else lmp.gather_atoms
    values = np.array(get(name, kind, count))
    return values.reshape(-1, count) if count > 1 else values


def masses(lmp: lammps) -> np.ndarray:
    """Mass of each atom, in order of atom ID; collective."""
    if lmp.extract_setting("rmass_flag"):
        return gather(lmp, "rmass", 1, 1)
    return lmp.numpy.extract_atom("mass").ravel()[gather(lmp, "type", 0, 1)]


def geometry(lmp: lammps) -> tuple[list[list[float]], list[bool]]:
    """Cell vectors as rows, and periodicity."""
    low, high, xy, yz, xz, periodic, _ = lmp.extract_box()
    lx, ly, lz = (end - begin for begin, end in zip(low, high))
    return [[lx, 0, 0], [xy, ly, 0], [xz, yz, lz]], list(map(bool, periodic))


def fix_styles(lmp: lammps, log: Path) -> dict[str, str]:
    """The style of each fix by ID, with suffixes; collective."""
    lmp.command("info fixes out log")
    lmp.flush_buffers()
    MPI.COMM_WORLD.Barrier()  # rank 0 has written
    return dict(
        re.findall(r"^Fix\[.*?\]: +(.+), +style = ([^\s,]+)", log.read_text(errors="replace"), re.M)
    )


def abort(error: Path, failure: BaseException) -> None:
    """Write why a rank has failed to the file ``error``, and end all ranks."""
    try:
        if not error.exists():  # the first one stays, and whole if another rank ends this one
            part = error.with_suffix(f".{MPI.COMM_WORLD.rank}")
            part.write_text(f"{failure}" or type(failure).__name__)
            part.replace(error)
    finally:
        sys.stderr.flush()
        MPI.COMM_WORLD.Abort(1)
