"""Make the bitcode of all loops of the package: what its build calls.

python -m fix_nosquish.loops FILE
"""

import importlib
import pkgutil
import sys

from . import bitcode, machine_code

NO_LOOPS = "fix_nosquish.loops", "fix_nosquish.plugin", "fix_nosquish.__main__"


def modules():
    """All modules of the package that have loops, a list of `machine_code.Module`; imports them."""
    for module in pkgutil.walk_packages([str(bitcode.FOLDER)], f"{machine_code.PACKAGE}."):
        if not module.name.startswith(NO_LOOPS):
            importlib.import_module(module.name)
    return machine_code.of_package(machine_code.PACKAGE)


if __name__ == "__main__":
    (place,) = sys.argv[1:]
    bitcode.keep(machine_code.in_processes("lower", modules()), place)
