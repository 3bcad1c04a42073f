"""Compile the loops of the package into libraries: the build calls this.

    python -m fix_nosquish.loops FOLDER

writes a library for each level in NOSQUISH_LEVELS (separated by spaces; by default the highest of
this machine).  CXX is the compiler that links them: for other machines, a cross-compiler.
"""

import importlib
import os
import pkgutil
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from .machine_code import FOLDER, LEVELS, level
from .registry import LOOPS, PACKAGE

NO_LOOPS = "fix_nosquish.loops", "fix_nosquish.plugin", "fix_nosquish.__main__"
# not linked to libc and libm: Python has loaded them already
LINK = "-shared", "-nostdlib"


def modules() -> list[str]:
    """Import all modules of the package; return the names of those that have loops."""
    for module in pkgutil.walk_packages([str(FOLDER)], f"{PACKAGE}."):
        if not module.name.startswith(NO_LOOPS):
            importlib.import_module(module.name)
    return [name for name in LOOPS if name.startswith(f"{PACKAGE}.")]


def build(target: str, levels: list[str]) -> None:
    """Write a library of the package's loops for each level to a folder."""
    from . import lower

    names = modules()
    compiler = shlex.split(os.environ.get("CXX", "c++"))
    with tempfile.TemporaryDirectory() as folder:  # not the user's cache
        lower.compile_modules(Path(folder), names, levels)
        for name in levels:
            objects = sorted(Path(folder).glob(f"*.{name}.o"))
            subprocess.run(
                [*compiler, *LINK, *objects, "-o", Path(target, f"loops_{name}.so")], check=True
            )


if __name__ == "__main__":
    (folder,) = sys.argv[1:]
    build(folder, os.environ.get("NOSQUISH_LEVELS", LEVELS[level()]).split())
