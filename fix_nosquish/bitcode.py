"""The bitcode of the package's loops, which its build makes, so that a first use needs no numba.

    python -m fix_nosquish.bitcode FILE

makes it.  It is for all processors of one kind and for all versions of Python.  It counts only for
the sources that it was made of, and for the version of LLVM that made it.
"""

import importlib
import importlib.util
import pickle
import pkgutil
import sys
from pathlib import Path

from . import compiled

FOLDER = Path(__file__).parent
FILE = FOLDER / "loops.bitcode"
NOT_IMPORTED = {"__main__", "lower", "compile", "plugin"}  # they have no loops


def kept():
    """The bitcode that came with the package, by its modules' names; empty if it does not count."""
    try:
        made_of, codes = pickle.loads(FILE.read_bytes())
    except (OSError, ValueError, EOFError, pickle.UnpicklingError):
        return {}
    return codes if made_of == _made_of() else {}


def keep(place):
    """Make the bitcode of all loops of the package, and write it to a file."""
    codes = compiled.in_processes("lower", modules())
    Path(place).write_bytes(pickle.dumps((_made_of(), codes)))


def modules():
    """All modules of the package that have loops, a list of `compiled.Module`; imports them."""
    for module in pkgutil.iter_modules([str(FOLDER)]):
        if module.name not in NOT_IMPORTED:
            importlib.import_module(f"{__package__}.{module.name}")
    return compiled.of_package(__package__)


def _made_of():
    """What bitcode follows from: the package's sources, LLVM, and the kind of processor."""
    from llvmlite import binding as llvm

    texts = b"".join(path.read_bytes() for path in sorted(FOLDER.glob("*.py")))
    kind = llvm.get_process_triple()
    return importlib.util.source_hash(texts), llvm.llvm_version_info, kind


if __name__ == "__main__":
    keep(sys.argv[1])
