"""Compiles the LAMMPS plugin; all else is in pyproject.toml.

The plugin uses LAMMPS's and MPI's headers and no Python.h: one wheel serves every Python version.
"""

import os
import shlex
import shutil
import subprocess
from importlib import metadata
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_ext import build_ext


def header_folder(distribution, header):
    """Folder of the first header of that name among an installed distribution's files."""
    for file in metadata.files(distribution) or ():
        if file.name == header:
            return file.locate().resolve().parent
    raise SystemExit(
        f"fix_nosquish: the package {distribution!r} that is installed has no {header}"
    )


def compiler():
    """The C++ compiler's command: CXX if that is set, else the first one on the PATH."""
    command = shlex.split(os.environ.get("CXX", ""))
    candidates = [command] if command else [["c++"], ["g++"], ["clang++"]]
    for candidate in candidates:
        if shutil.which(candidate[0]):
            return candidate
    raise SystemExit(
        f"fix_nosquish: no C++ compiler found (looked for {', '.join(c[0] for c in candidates)}). "
        "Install one (Debian and Ubuntu: apt-get install g++) or name it in the variable CXX."
    )


def lammps_version():
    """The number by which LAMMPS knows its version: 20250722 for the package 2025.7.22.4.0."""
    year, month, day = (int(part) for part in metadata.version("lammps").split(".")[:3])
    return year * 10000 + month * 100 + day


class BuildPlugin(build_ext):
    def get_ext_filename(self, fullname):
        return os.path.join(*fullname.split(".")) + ".so"  # LAMMPS looks for *plugin.so

    def build_extension(self, ext):
        target = Path(self.get_ext_fullpath(ext.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        command = [
            *compiler(), "-std=c++17", "-O2", "-fPIC", "-shared", "-Wl,-z,nodelete",
            *shlex.split(os.environ.get("CXXFLAGS", "")),
            "-DLAMMPS_SMALLBIG", f"-DCOMPILED_FOR_LAMMPS={lammps_version()}",
            "-I", str(header_folder("lammps", "fix.h")), "-I", str(header_folder("mpich", "mpi.h")),
            *ext.sources, "-o", str(target), "-ldl",
        ]  # fmt: skip
        print(shlex.join(command), flush=True)
        if subprocess.call(command):
            raise SystemExit("fix_nosquish: the C++ compiler could not compile the LAMMPS plugin")


class PlatformWheel(bdist_wheel):
    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


# what an earlier build has left there would go into the wheel, if the checkout no longer has it
shutil.rmtree(Path(__file__).with_name("build"), ignore_errors=True)

setup(
    ext_modules=[
        Extension("fix_nosquish.plugin.python_moveplugin", ["fix_nosquish/plugin/python_move.cpp"])
    ],
    cmdclass={"build_ext": BuildPlugin, "bdist_wheel": PlatformWheel},
)
