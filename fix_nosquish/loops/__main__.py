"""Compile all loops of the package: what its build calls.

    python -m fix_nosquish.loops FOLDER

writes to the folder a library for each level that NOSQUISH_LEVELS names, with spaces between;
without it, for this machine's highest.  CXX is the compiler that links them, for another kind of
machine a cross-compiler.
"""

import importlib
import os
import pkgutil
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from . import machine_code

NO_LOOPS = "fix_nosquish.loops", "fix_nosquish.plugin", "fix_nosquish.__main__"
# without libraries: Python has loaded those of C, of whatever version, before
LINK = ["-bundle", "-undefined", "dynamic_lookup"]
if sys.platform != "darwin":
    LINK = ["-shared", "-nostdlib"]


def modules():
    """The names of all modules of the package that have loops; imports them."""
    for module in pkgutil.walk_packages([str(machine_code.FOLDER)], f"{machine_code.PACKAGE}."):
        if not module.name.startswith(NO_LOOPS):
            importlib.import_module(module.name)
    return [name for name in machine_code.LOOPS if name.startswith(f"{machine_code.PACKAGE}.")]


def build(place, levels):
    """Write libraries of the package's loops for these levels to a folder."""
    from . import lower

    names = modules()
    compiler = shlex.split(os.environ.get("CXX", "c++"))
    with tempfile.TemporaryDirectory() as folder:  # not the user's cache
        lower.compile_modules(Path(folder), names, levels)
        for level in levels:
            objects = sorted(Path(folder).glob(f"*.{level}.o"))
            target = Path(place, f"loops_{level}.so")
            subprocess.run([*compiler, *LINK, *objects, "-o", target], check=True)


if __name__ == "__main__":
    (place,) = sys.argv[1:]
    highest = machine_code.LEVELS[machine_code.level()]
    build(place, os.environ.get("NOSQUISH_LEVELS", highest).split())
